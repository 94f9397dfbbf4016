"""The loop of FMUs against a straight line of Python, and the claims of Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from auv_fmu.loop.closed_loop import PAPER, Instant, Setting, closed_loop
from auv_fmu.paper import motion_planner, plant
from auv_fmu.paper.disturbance import Disturbance
from auv_fmu.paper.observer import Form
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.plant import RollAxis
from auv_fmu.paper.saturation import Saturation
from orchestrator.cosim import PortName, System, Table
from orchestrator.vehicle.indices import metrics_of
from orchestrator.vehicle.signals import tracking_error, true_control_point
from support.runs import final_error, run

STEPS = 5000
UQR, XYZ = ("u", "q", "r"), ("x", "y", "z")
QUIET = {PortName("plant", "noise.std"): 0.0}


@pytest.fixture(scope="module")
def noisy(system: System) -> Table:
    return run(system, 100.0, 0.02, loop="compiled")


@pytest.fixture(scope="module")
def quiet(system: System) -> Table:
    return run(system.with_parameters(QUIET), 100.0, 0.02, loop="compiled")


def rows_of(instants: Sequence[Instant], setting: Setting, table: Table) -> list[dict[str, float]]:
    """Expected value of every port of the FMU loop in each row of a table."""
    late = [instants[0], *instants[:-1]] if table.header.experiment.acting_row else instants
    # Actuators with a lag apply their states.
    T = setting.plant.T
    return [row(now, acting, T) for now, acting in zip(instants, late, strict=True)]


def row(now: Instant, acting: Instant, T: tuple[float, ...]) -> dict[str, float]:
    """Values of all ports, from an instant and from the instant whose commands act."""
    values: dict[str, float] = {}

    def group(name: str, members, numbers) -> None:
        values.update(zip((f"{name}.{m}" for m in members), numbers, strict=True))

    def both(names: tuple[str, str], members, numbers) -> None:
        for name in names:
            group(name, members, numbers)

    signals, state, measured = acting.signals, acting.controller_state, acting.measured
    vehicle, seen = now.vehicles.plant, now.scene.plant
    planned, reference = now.vehicles.planner, now.scene.reference
    both(("plant.tau", "controller.tau"), UQR, signals.tau)
    both(("plant.tau_w", "disturbance.tau_w"), "uvwpqr", acting.tau_w)
    group("disturbance.nu", "uvwpqr", acting.scene.plant.nu_r)
    group("plant.water", XYZ, (0.0, 0.0, 0.0))
    group("plant.dwater", XYZ, (0.0, 0.0, 0.0))
    group("plant.eta", (*XYZ, "phi", "theta", "psi"), (*vehicle.position, *seen.euler))
    group("plant.nu", "uvwpqr", seen.nu)
    group("plant.nu_r", "uvwpqr", seen.nu_r)
    group("plant.y", XYZ, now.scene.y)
    group("plant.dy", XYZ, seen.dy)
    given = zip(T, vehicle.tau, acting.tau, strict=True)
    group("plant.tau_applied", UQR, [state if lag else tau for lag, state, tau in given])
    group("controller.y", XYZ, measured.y)
    group("controller.eta", ("phi", "theta", "psi"), measured.euler)
    group("controller.y_d", XYZ, measured.y_d)
    group("controller.dy_d", XYZ, measured.dy_d)
    group("controller.ddy_d", XYZ, measured.ddy_d)
    group("controller.y_hat", XYZ, state.y_hat)
    group("controller.dy_hat", XYZ, signals.dy_hat)
    for i, estimate in enumerate(state.theta_hat, start=1):
        values[f"controller.theta_hat[{i}]"] = estimate
    group("controller.e", XYZ, signals.e)
    group("controller.z", XYZ, signals.z)
    group("planner.y_d", XYZ, reference.y_d)
    group("planner.dy_d", XYZ, reference.dy_d)
    group("planner.ddy_d", XYZ, reference.ddy_d)
    group("planner.eta_d", (*XYZ, "theta", "psi"), (*planned.position, planned.theta, planned.psi))
    return values


def test_loop_of_fmus_is_the_straight_line_bit_for_bit(noisy: Table):
    """Every port, 5,000 steps, with noise and disturbance on."""
    assert noisy.failure is None
    instants = list(closed_loop(STEPS))
    rows = rows_of(instants, PAPER, noisy)
    faults = {name for name in noisy.columns if name.endswith(".fault")}
    assert set(noisy.columns) == set(rows[0]) | faults
    for name in rows[0]:
        expected = np.array([values[name] for values in rows])
        assert np.array_equal(noisy[name], expected), name
    for name in faults:
        assert not noisy[name].any()


@pytest.mark.parametrize(
    ("values", "setting"),
    [
        (
            {"controller.saturation": "arctan", "controller.observer": "exact"},
            Setting(controller=Gains(s=Saturation.ARCTAN, form=Form.EXACT)),
        ),
        ({"controller.observer": "integral"}, Setting(controller=Gains(form=Form.INTEGRAL))),
        (
            {
                "plant.roll": False,
                "plant.current.x": 0.2,
                "plant.actuator.T.u": 0.1,
                "planner.nu0.u": 0.1,
            },
            Setting(
                plant=plant.Parameters(
                    roll=RollAxis(rolls=False), current=(0.2, 0.0, 0.0), T=(0.1, 0.0, 0.0)
                ),
                planner=motion_planner.Parameters(nu0=(0.1, 0.0, 0.0, 0.0, 0.0)),
            ),
        ),
        (
            {
                "plant.integrator": "rk4",
                "plant.current.z": -0.2,
                "plant.actuator.T.q": 0.1,
                "disturbance.A_f": 2.0,
            },
            Setting(
                plant=plant.Parameters(
                    current=(0.0, 0.0, -0.2), T=(0.0, 0.1, 0.0), integrator=plant.RK4
                ),
                disturbance=Disturbance(A_f=2.0),
            ),
        ),
    ],
    ids=str,
)
def test_additions_are_the_straight_line_bit_for_bit_too(system, values, setting):
    """With steps that components split."""
    changes = {PortName.read(name): value for name, value in values.items()}
    table = run(system.with_parameters(changes), 100 * 0.05, 0.05)
    rows = rows_of(list(closed_loop(100, setting._replace(h=0.05))), setting, table)
    for name in rows[0]:
        assert np.array_equal(table[name], [values[name] for values in rows]), name


def test_fig4_without_noise_never_reaches_a_limit_and_ends_within_10_cm(quiet: Table):
    """ "The AUV successfully tracks the desired trajectory without the actuator saturation".

    (22) cannot carry theta_hat beyond G |r| / sigma; ours stay below 25 in 100 s.
    """
    commands = quiet.group(*(f"controller.tau.{k}" for k in UQR))
    assert np.abs(commands).max() < 80.0
    applied = quiet.group(*(f"plant.tau_applied.{k}" for k in UQR))
    assert np.array_equal(applied, commands)
    assert (final_error(quiet) < 0.1).all()
    estimates = quiet.group(*(f"controller.theta_hat[{i}]" for i in range(1, 5)))
    assert estimates.min() >= 0.0 and estimates.max() < 25.0


def test_estimated_velocity_is_the_true_one_after_the_transient(quiet: Table):
    """The observer lags by about 1 / k_d = 20 ms: 1 cm/s at the accelerations of the helix."""
    true = quiet.start_values(*(f"plant.dy.{k}" for k in XYZ))[1500:]
    estimated = quiet.step_values(*(f"controller.dy_hat.{k}" for k in XYZ))[1500:]
    assert np.abs(true - estimated).max() < 0.01


def test_jacobi_changes_the_efforts_by_less_than_4_percent(system: System, noisy: Table):
    delayed = run(system, 100.0, 0.02, "jacobi", loop="compiled")
    change = (
        np.divide(metrics_of(delayed).found()["l2_effort"], metrics_of(noisy).found()["l2_effort"])
        - 1.0
    )
    assert np.abs(change).max() < 0.04
    assert np.abs(change).max() > 1e-6, "the order must make a difference"


def test_true_control_point_is_the_measured_one_without_noise(quiet: Table, noisy: Table):
    measured = quiet.group(*(f"plant.y.{k}" for k in XYZ))
    np.testing.assert_allclose(true_control_point(quiet), measured, atol=1e-12)
    error = quiet.step_values(*(f"controller.e.{k}" for k in XYZ))
    np.testing.assert_allclose(tracking_error(quiet)[:-1], error, atol=1e-12)
    noise = noisy.group(*(f"plant.y.{k}" for k in XYZ)) - true_control_point(noisy)
    assert noise.std() == pytest.approx(0.001, rel=0.03)
    assert abs(noise.mean()) < 5e-5


def test_finer_steps_converge_to_the_same_motion(system: System, quiet: Table):
    """Halving the step halves the distance of a first-order scheme from its limit."""
    halves = [
        run(system.with_parameters(QUIET), 20.0, 0.02 / 2**n, loop="compiled")["plant.eta.x"][-1]
        for n in range(3)
    ]
    differences = np.abs(np.diff(halves))
    assert quiet["plant.eta.x"][1000] == halves[0]
    np.testing.assert_allclose(differences[:-1] / differences[1:], 2.0, rtol=0.25)
