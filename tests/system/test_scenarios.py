"""Every figure of the paper as a scenario, with the bounds its claims put on our numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cosim import PortName, Table
from orchestrator.paper.claims import EFFORT_PD, EFFORT_PROPOSED, total_variation_until
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.indices import metrics_of
from orchestrator.vehicle.proof import CERTIFICATE_COLUMNS, certificates
from orchestrator.vehicle.signals import tracking_error
from support.runs import final_error, system_of
from support.runs import run as simulated

Runner = Callable[..., Table]


@pytest.fixture(scope="module")
def run(native: Path) -> Runner:
    """Run a scenario once, with changes given as `component__parameter=value`."""

    @cache
    def runner(name: str, order: str = "gauss-seidel", **changes: float) -> Table:
        scenario = read_scenario(name)
        system = closed_loop(native, scenario).with_parameters(
            {
                PortName(component, name.replace("__", ".")): value
                for component, name, value in (
                    (*key.split("__", 1), value) for key, value in changes.items()
                )
            }
        )
        assert scenario.stop_time is not None
        result = simulated(system, scenario.stop_time, 0.02, order, loop="compiled")
        assert result.failure is None
        return result

    return runner


def variation(result: Table) -> np.ndarray:
    """Total variation of each actuator."""
    return np.array(metrics_of(result).found()["total_variation"])


def test_fig3a_follows_the_analytic_solution(run: Runner):
    """u(t) = 1/3 (1 - exp(-t d11 / m11)) to the accuracy of Euler's scheme."""
    result = run("fig3a")
    expected = (1 - np.exp(-result.time * 30 / 25)) / 3
    np.testing.assert_allclose(result["plant.nu.u"], expected, atol=2e-3)
    assert not result.group(*(f"plant.nu.{k}" for k in "vwpqr")).any()


def test_fig3b_settles_on_a_helix(run: Runner):
    """Constant velocities and pitch, and a constant radius of the path from above."""
    result = run("fig3b")
    end = result.group(*(f"plant.nu.{k}" for k in "uvwpqr"))[-500:]
    assert np.ptp(end, axis=0).max() < 1e-4
    assert np.ptp(result["plant.eta.theta"][-500:]) < 1e-4
    x, y = result["plant.eta.x"][-2000:], result["plant.eta.y"][-2000:]
    A = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
    (a, b, _), *_ = np.linalg.lstsq(A, x**2 + y**2)
    radius = np.hypot(x - a, y - b)
    assert np.ptp(radius) < 0.01 * radius.mean()


@pytest.mark.parametrize("eps_t", [10.0, 1.0])
def test_fig5_proposed_does_not_saturate(run: Runner, eps_t: float):
    assert not any(metrics_of(run("fig5", controller__eps_t=eps_t)).found()["saturated_fraction"])


def test_fig5_pd_saturates_chatters_and_ends_more_accurate(run: Runner):
    proposed, pd = run("fig5"), run("fig5-pd")
    assert all(metrics_of(pd).found()["saturated_fraction"])
    assert (variation(pd) >= np.array([2.3, 5.0, 11.0]) * variation(proposed)).all()
    assert (final_error(proposed) >= 5.0 * final_error(pd)).all()


@pytest.mark.parametrize(("name", "published"), [("fig5", EFFORT_PROPOSED), ("fig5-pd", EFFORT_PD)])
def test_published_efforts_are_met_within_a_factor_of_2(run: Runner, name, published):
    ratio = np.divide(metrics_of(run(name)).found()["l2_effort"], published)
    assert (ratio > 0.5).all()
    assert (ratio < 2.0).all()


def test_fig6_pd_chatters_severely(run: Runner):
    pd, proposed = (total_variation_until(run(name), 60.0) for name in ("fig6-pd", "fig6"))
    assert (pd >= 400.0 * proposed).all()


def test_fig5_passes_the_vertical_without_a_jump(run: Runner):
    """Pitch beyond 89 degrees; every output but the Euler angles moves no faster than it can.

    At less than 1 m/s a position moves less than 2 cm in a step; at most 43 N on 17.5 kg change a
    velocity by less than 5 cm/s in a step.
    """
    result = run("fig5")
    assert np.abs(result["plant.eta.theta"]).max() > np.deg2rad(89)
    assert np.abs(np.diff(result["plant.eta.phi"])).max() > 3.0, "the Euler angles do jump"
    for group, bound in (("eta", 0.02), ("y", 0.02), ("dy", 0.05)):
        for k in "xyz":
            assert np.abs(np.diff(result[f"plant.{group}.{k}"])).max() < bound
    for k in "uvwpqr":
        assert np.abs(np.diff(result[f"plant.nu.{k}"])).max() < 0.05


def test_fig7_needs_more_effort_under_more_disturbance(run: Runner):
    efforts = [np.array(metrics_of(run(f"fig7{letter}")).found()["l2_effort"]) for letter in "abc"]
    assert (efforts[0] < efforts[1]).all()
    assert (efforts[1] < efforts[2]).all()


@pytest.mark.parametrize(("letter", "bound"), [("a", 0.2), ("b", 0.4)])
def test_fig7_errors_stay_small(run: Runner, letter: str, bound: float):
    """e_f below 0.2 m. When the waves turn, at 72 s, (b) is off by 0.35 m for a moment."""
    result = run(f"fig7{letter}")
    assert (final_error(result) < 0.2).all()
    assert np.abs(tracking_error(result)[result.time > 40.0]).max() < bound


def test_jacobi_order_makes_pd_chatter_and_leaves_the_proposed_controller_alone(run: Runner):
    assert (variation(run("fig5", order="jacobi")) < 1.2 * variation(run("fig5"))).all()
    times = variation(run("fig5-pd", order="jacobi")) / variation(run("fig5-pd"))
    assert (times > (100.0, 1.3, 1.2)).all()


def test_jacobian_as_printed_saturates_where_the_full_attitude_does_not(run: Runner):
    printed = metrics_of(run("fig5", controller__printed_jacobian=True)).found()
    assert any(printed["saturated_fraction"])
    assert (np.array(printed["total_variation"]) > 3.0 * variation(run("fig5"))).all()


def test_noise_of_1_cm_saturates_and_1_mm_does_not(run: Runner):
    assert min(metrics_of(run("fig4", plant__noise__std=0.01)).found()["peak_command"]) > 160.0
    assert max(metrics_of(run("fig4")).found()["peak_command"]) < 80.0


@pytest.mark.parametrize("name", ["fig4", "fig5", "fig5-pd", "fig6", "fig6-pd", "fig7c"])
def test_no_velocity_reaches_the_output_feedback_controller(dist: Path, name: str):
    """All of them reach the PD controller."""
    velocities = [f"plant.dy.{k}" for k in "xyz"] * name.endswith("-pd")
    assert velocities_reaching(system_of(dist, name)) == velocities


def test_certificates_agree_with_the_matrix_form_of_34(run: Runner):
    """V from logarithms of cosh and M_2 = J^-T M_1 J^-1, at some instants of Fig. 4."""
    result = run("fig4", plant__noise__std=0.0)
    table = certificates(result)
    column = dict(zip(CERTIFICATE_COLUMNS, table.T, strict=True))
    M_1, ell = np.diag([25.0, 22.5, 15.0]), 0.35
    for k in range(1, 5000, 1700):
        phi, theta, psi = (result[f"plant.eta.{a}"][k - 1] for a in ("phi", "theta", "psi"))
        c, s = np.cos, np.sin
        R = (
            np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
            @ np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
            @ np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
        )
        J_inverse = np.linalg.inv(np.column_stack([R[:, 0], -ell * R[:, 2], ell * R[:, 1]]))
        M_2 = J_inverse.T @ M_1 @ J_inverse
        e, z, dy_hat, y_d, dy_d = (
            result.step_values(*(f"controller.{group}.{a}" for a in "xyz"))[k - 1]
            for group in ("e", "z", "dy_hat", "y_d", "dy_d")
        )
        dy = result.group(*(f"plant.dy.{a}" for a in "xyz"))[k - 1]
        r_1 = dy - dy_d + np.tanh(e - z)
        r_2 = dy - dy_hat + np.tanh(z)
        V = 10 * np.log(np.cosh(e - z)).sum() + 10 * np.log(np.cosh(z)).sum()
        V += 0.5 * r_1 @ M_2 @ r_1 + 0.5 * r_2 @ M_2 @ r_2
        row = k - 1
        assert column["time"][row] == result.time[k - 1]
        assert column["V_without_theta"][row] == pytest.approx(V, rel=1e-9)
        np.testing.assert_allclose([column[f"r_1.{a}"][row] for a in "xyz"], r_1, atol=1e-12)
        np.testing.assert_allclose([column[f"r_2.{a}"][row] for a in "xyz"], r_2, atol=1e-12)
        [tau] = result.step_values("plant.tau.u")[k - 1]
        assert column["saturation_margin.u"][row] == pytest.approx(80 - abs(tau))


def test_composite_errors_end_in_a_small_ball(run: Runner):
    """The theorem's claim in numbers: |r_1| < 0.2 m/s and |r_2| < 0.02 m/s after 40 s."""
    column = dict(
        zip(CERTIFICATE_COLUMNS, certificates(run("fig4", plant__noise__std=0.0)).T, strict=True)
    )
    settled = column["time"] > 40.0
    for name, bound in (("r_1", 0.2), ("r_2", 0.02)):
        norm = np.linalg.norm([column[f"{name}.{a}"] for a in "xyz"], axis=0)
        assert norm[settled].max() < bound
