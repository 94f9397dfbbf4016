"""Both kinds of FMUs have the same rows, bit for bit, and the same refusals."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmus.ports.port import Port
from orchestrator.cosim import Experiment
from orchestrator.runs.scenario import read_scenario
from support.instances import component
from support.kinds import Outcome, difference, outcome
from support.tiers import slow

STEP = 0.02

#: Scenarios with each of the controllers, and the FMUs of their components.
FMUS_OF = {
    "fig4": {
        "plant": "AuvPlant",
        "controller": "ObserverController",
        "disturbance": "DisturbanceGenerator",
        "planner": "MotionPlanner",
    },
    "fig5-pd": {
        "plant": "AuvPlant",
        "controller": "PdController",
        "disturbance": "DisturbanceGenerator",
        "planner": "MotionPlanner",
    },
}
each_controller = pytest.mark.parametrize("scenario", FMUS_OF)


def both(
    dist: Path,
    native: Path,
    scenario: str,
    experiment: Experiment,
    values: dict[str, object] | None = None,
) -> Outcome:
    """The outcome of a run, which is the same on both kinds of FMUs."""
    ours, theirs = (
        outcome(folder, scenario, values or {}, experiment) for folder in (dist, native)
    )
    assert difference(ours, theirs) == ""
    return ours


@pytest.mark.parametrize(
    "scenario",
    [
        "fig3b",
        "path",
        "sea",
        "remus-pd",
        "remus-prestero",
        "formation-lost-link",
        "los",
        "los-remus",
    ],
)
def test_scenario_is_the_same(dist: Path, native: Path, scenario: str):
    both(dist, native, scenario, Experiment(2.0, STEP))


@pytest.mark.parametrize(
    ("scenario", "order"), [("fig4", "feedthrough"), *slow(("fig5-pd", "jacobi"))]
)
def test_scenario_is_the_same_to_its_end(dist: Path, native: Path, scenario: str, order: str):
    stop_time = read_scenario(scenario).stop_time
    assert stop_time is not None
    both(dist, native, scenario, Experiment(stop_time, STEP, order))


@pytest.mark.parametrize(
    ("scenario", "values"),
    [
        ("fig4", {"controller.saturation": "algebraic", "controller.innovation_gate": 0.0}),
        ("fig5", {"controller.printed_jacobian": True, "controller.observer": "integral"}),
        ("fig5-pd", {"controller.printed_jacobian": True}),
        ("fig4", {"controller.saturation": "arctan", "controller.observer": "exact"}),
        ("fig5-pd", {"plant.roll": False, "plant.actuator.T.q": 0.1, "plant.noise.std": 0.0}),
        ("fig4", {"plant.current.x": 0.2, "plant.current.z": -0.1, "planner.nu0.u": 0.2}),
        ("los", {"planner.law": "adaptive", "planner.waypoint[2].x": 4.0, "plant.eta0.psi": 3.0}),
        ("los-remus", {"planner.law": "integral", "controller.vertical": "depth"}),
        ("fig5-pd", {"plant.actuator.T.u": 0.5, "plant.actuator.T.r": 0.001}),
        ("fig5", {"plant.integrator": "rk4", "plant.current.y": 0.1, "plant.actuator.T.r": 0.1}),
        ("fig5-pd", {"plant.integrator": "rk4", "plant.roll": False}),
    ],
    ids=str,
)
def test_choices_are_the_same(dist: Path, native: Path, scenario, values):
    for order, stop_time in zip(Experiment.ORDERS, (3.0, 0.5, 0.5), strict=True):
        experiment = Experiment(stop_time, STEP, order)
        assert both(dist, native, scenario, experiment, values).failure is None


@pytest.mark.parametrize("seed", [-(2**31), 0, 2**31 - 1])
def test_noise_of_other_seeds_is_the_same(dist: Path, native: Path, seed: int):
    values = {"plant.noise.seed": seed, "plant.noise.std": 0.01}
    both(dist, native, "fig4", Experiment(2.0, STEP), values)


@each_controller
@pytest.mark.parametrize("step", [0.0137, 0.1, 0.33])
def test_other_steps_are_the_same(dist: Path, native: Path, scenario: str, step: float):
    """Above 0.02 s, h_max, components split them."""
    both(dist, native, scenario, Experiment(min(300 * step, 5.0), step))


def varied(scenario: str) -> st.SearchStrategy[dict[str, float]]:
    """Values of some parameters, most about as large as they are, some as no vehicle has them."""
    ports = [
        (f"{instance}.{port.name}", port)
        for instance, name in FMUS_OF[scenario].items()
        for port in component(name).ports
        if port.causality == "parameter" and port.type == "Real"
    ]
    factors = st.floats(0.3, 3.0) | st.floats(0.9, 1.1) | st.sampled_from([1e-9, 1e6, 1e150, 1e300])
    chosen = st.lists(st.tuples(st.sampled_from(ports), factors), min_size=1, max_size=6)
    return chosen.map(lambda all_: {name: scaled(port, f) for (name, port), f in all_})


def scaled(port: Port, factor: float) -> float:
    assert isinstance(port.start, float)
    value = (port.start or 0.5) * factor
    value = value if port.minimum is None else max(value, port.minimum)
    return value if port.maximum is None else min(value, port.maximum)


@each_controller
def test_runs_with_any_parameters_are_the_same(dist: Path, native: Path, scenario: str):
    @settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
    @given(varied(scenario), st.sampled_from([STEP, 0.05]))
    def hold(values: dict[str, float], step: float) -> None:
        both(dist, native, scenario, Experiment(20 * step, step), dict(values))

    hold()


#: Parameters that end in a refusal, and when [s]; None: before the first step.
REFUSED = [
    ("fig4", {"plant.m11": 1e-9}, 0.1),
    ("fig4", {"controller.gamma": 1e6}, 1.5),
    ("fig4", {"controller.lambda": 1e300}, None),
    ("fig4", {"disturbance.omega_d": 1e308}, 1.8),
    ("fig4", {"planner.righting.pitch": -1e3}, 1.34),
    ("fig5-pd", {"controller.gamma": 1e200}, 0.0),
]


@pytest.mark.parametrize(("scenario", "values", "time"), REFUSED, ids=str)
def test_refusals_are_the_same(dist: Path, native: Path, scenario, values, time):
    failure = both(dist, native, scenario, Experiment(3.0, STEP), values).failure
    expected = "initialisation refused" if time is None else f"stopped at t = {time:g} s: "
    assert failure is not None
    assert expected in failure
