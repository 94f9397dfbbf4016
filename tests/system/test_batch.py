"""The batch engine: the numbers of the straight line and of the FMUs, bit for bit."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from random import Random
from typing import Any

import numpy as np
import pytest

from auv_fmu.loop.closed_loop import Instant, Setting
from auv_fmu.loop.closed_loop import closed_loop as straight_line
from auv_fmu.paper.output_feedback import ControllerState
from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import FEEDTHROUGH, JACOBI, Experiment, Order
from orchestrator.runs.loading import load, load_scenario
from orchestrator.studies import batch_engine
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import FmuEngine, Point
from orchestrator.studies.space import Space
from orchestrator.studies.study import ready_studies
from orchestrator.studies.study_file import read_study
from orchestrator.system.names import port_name
from orchestrator.system.structure import System
from orchestrator.vehicle.indices import INDICES
from support.runs import prepared, whole
from support.texts import tells

pytest.importorskip("numba", reason="needs the extra `studies`")

KIND = "native"

#: Those of the engine.
ORDERS = (FEEDTHROUGH, JACOBI)

#: The ready studies that the engine makes.
STUDIES = [name for name in ready_studies() if read_study(name).engine == "batch"]

#: How many runs of each study are tried, how many of them with FMUs, and how many steps of each.
SAMPLES, STEPS = 200, 40


@cache
def systems(*names: str) -> dict[str, System]:
    return {name: load(name, KIND) for name in names}


def engines(*names: str) -> tuple[BatchEngine, FmuEngine]:
    fmus = FmuEngine({name: prepared(name, KIND) for name in names}, "compiled")
    return BatchEngine(systems(*names), KIND), fmus


@cache
def sampled(name: str) -> list[Point]:
    """Some runs of a ready study, cut short, every second one in the other order."""
    study = read_study(name)
    space = Space(study, {scenario: load_scenario(scenario, KIND) for scenario in study.scenario})
    numbers = Random(name).sample(range(len(space)), SAMPLES)
    return [
        space[number]._replace(stop_time=STEPS * space[number].step, order=ORDERS[i % len(ORDERS)])
        for i, number in enumerate(numbers)
    ]


def bits(rows: np.ndarray) -> np.ndarray:
    """As integers: -0.0 is not 0.0."""
    return np.ascontiguousarray(rows).view(np.int64)


def straight_rows(setting: Setting, steps: int, order: Order) -> np.ndarray:
    """Time and values of every row: what the FMUs' table holds."""
    instants = list(straight_line(steps, setting, order == JACOBI))
    acting = instants if order == FEEDTHROUGH else [instants[0], *instants[:-1]]
    T = setting.plant.T
    return np.array([_row(*pair, T) for pair in zip(acting, instants, strict=True)])


def _row(acting: Instant, now: Instant, T: tuple[float, ...]) -> list[float]:
    seen, state = now.scene.plant, acting.controller_state
    values = [
        now.t, *now.vehicles.plant.position, *seen.euler, *seen.nu, *now.scene.y, *seen.dy,
    ]  # fmt: skip
    for one in now.scene.reference:
        values += one
    # Actuators with a lag give what they have come to.
    given = zip(T, now.vehicles.plant.tau, acting.tau, strict=True)
    values += [reached if lag else tau for lag, reached, tau in given]
    if isinstance(state, ControllerState):
        values += acting.signals.dy_hat
        state = state.theta_hat
    return [*values, *state, *acting.signals.tau, *acting.command, *acting.tau_w]


def compare_with_straight_line(engine: BatchEngine, point: Point) -> None:
    table = engine.table(point)
    order = table.header.experiment.order
    straight = straight_rows(engine.setting(point), len(table) - 1, order)
    different = np.argwhere(bits(table.rows) != bits(straight))
    # Where nothing is drawn, what is zero is not of a sign.
    different = [at for at in different if table.rows[*at] != straight[*at]]
    assert not different, ("time", *table.columns)[different[0][1]]


@pytest.mark.parametrize("name", STUDIES)
def test_runs_of_studies_are_those_of_the_straight_line(name):
    """Every signal after every step."""
    runs = sampled(name)
    engine, _ = engines(*read_study(name).scenario)
    for run in runs:
        compare_with_straight_line(engine, run)


@pytest.mark.parametrize("name", STUDIES)
def test_runs_of_studies_are_those_of_the_fmus(name):
    """All indices, and why runs fail."""
    runs = sampled(name)
    batch, fmus = engines(*read_study(name).scenario)
    for one, other in zip(batch.outcomes(runs), fmus.outcomes(runs), strict=True):
        assert one == other


#: Scenarios with other blocks in the loop than the paper has, and a loop with all of them but one.
OTHERS = ["path", "path-pd", "sea", "sea-pd", "remus", "remus-pd"]
REMUS_IN_A_SEA = """
[components]
plant = "Remus100"
allocation = "Allocation"
sea = "Sea"
[wires]
"allocation.tau" = "controller.tau"
"allocation.nu_r" = "plant.nu_r"
"plant.command" = "allocation.command"
"plant.tau" = false
"plant.tau_w" = false
"disturbance.nu" = false
"sea.eta" = "plant.eta"
"plant.water" = "sea.water"
"plant.dwater" = "sea.dwater"
[parameters]
plant.ell = 0.8
plant.eta0.z = 2.0
plant.noise.std = 0.001
plant.current.y = 0.1
allocation.measured = true
sea.waves.spectrum = "pierson-moskowitz"
sea.depth = 0.0
controller.ell = 0.8
planner.ell = 0.8
planner.eta0.z = 2.0
"""


def compare_with_fmus(name: str, values: dict[str, Any], order: str, until: float) -> None:
    """Every signal after every step, and all indices, with noise and a shorter step at the end."""
    batch, fmus = engines(name)
    point = Point(0, name, values, until, 0.02, order)
    table = batch.table(point)
    system = systems(name)[name].with_parameters({port_name(k): v for k, v in values.items()})
    expected = whole(system, Experiment(until, 0.02, order), "compiled")
    assert table.failure is None
    assert len(table.columns) >= 40
    rows = np.column_stack([expected.time, expected.group(*table.columns)])
    assert bits(table.rows).tolist() == bits(rows).tolist()
    for one, other in zip(batch.outcomes([point]), fmus.outcomes([point]), strict=True):
        assert one == other


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", OTHERS)
def test_runs_with_other_blocks_are_those_of_the_fmus(name, order):
    noise = {"plant.noise.std": 0.002, "plant.noise.seed": 5}
    compare_with_fmus(name, noise, order, 30.01)


@pytest.mark.parametrize("order", ORDERS)
def test_remus_in_a_sea_is_that_of_the_fmus(tmp_path, order):
    path = tmp_path / "both.toml"
    path.write_text(REMUS_IN_A_SEA)
    compare_with_fmus(str(path), {}, order, 10.01)


#: Values that make a difference to how these are computed.
OTHER_ADDITIONS: list[tuple[str, dict[str, Any]]] = [
    ("path", {"planner.cruise": 0.4, "planner.rounding": 40.0, "plant.water.y": 0.1}),
    ("path", {"planner.timed": True, "planner.count": 4, "planner.waypoint[1].t": 0.01}),
    ("sea", {"sea.waves.spectrum": "none", "sea.current.mu": 0.5, "sea.current.root": 0.0}),
    ("sea", {"sea.waves.count": 64, "sea.waves.s": 0.0, "sea.depth": 6.0, "sea.waves.Hs": 0.5}),
    ("sea", {"plant.integrator": "rk4", "plant.current.z": 0.1, "plant.h_max": 0.007}),
    ("sea", {"plant.roll": False, "plant.actuator.T.u": 0.2, "sea.waves.seed": -3}),
    ("remus", {"plant.h_max": 0.004, "plant.water.x": 0.3, "plant.current.y": -0.1}),
    ("remus", {"allocation.measured": True, "plant.r_bg.y": 0.001, "plant.fin.T": 0.0}),
]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("name", "values"), OTHER_ADDITIONS)
def test_additions_with_other_blocks_are_those_of_the_fmus(name, values, order):
    compare_with_fmus(name, values, order, 2.01)


#: What they refuse: values that do not fit, starts, steps.
OTHERS_REFUSED: list[tuple[str, dict[str, Any]]] = [
    ("path", {"planner.cruise": 2.0, "planner.rounding": 0.5}),
    ("path", {"planner.timed": True, "planner.waypoint[3].t": 1.0}),
    ("path", {"planner.ell": 1e308}),
    ("sea", {"sea.waves.Hs": 20.0}),
    ("sea", {"sea.current.sigma": 1e200}),
    ("sea", {"plant.m11": 1e-9}),
    ("remus", {"plant.nu0.u": 11.0}),
    ("remus", {"plant.diameter": 1.5}),
    ("remus", {"plant.drag.T.yaw": 1e-3}),
    ("remus", {"plant.current.x": 9.9, "controller.gamma": 1e200}),
]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("name", "values"), OTHERS_REFUSED)
def test_what_fmus_of_other_blocks_refuse_is_refused_at_the_same_step(name, values, order):
    compare_refusals(Point(5, name, values, 3.0, 0.02, order))


@pytest.mark.parametrize("name", ["plant.dwater.x", "disturbance.nu.r"])
def test_inputs_without_a_place_stay_zero(name):
    scenario = "remus" if name.startswith("disturbance") else "path"
    batch, _ = engines(scenario)
    [outcome] = batch.outcomes([Point(0, scenario, {name: 0.1}, 1.0, 0.02)])
    assert outcome.failure == f"{name}: the batch engine has no place for it; leave it 0"


#: Values that make a difference to how the loop is computed.
ADDITIONS: list[dict[str, Any]] = [
    {"controller.saturation": "algebraic"},
    {"controller.saturation": "arctan", "controller.observer": "exact"},
    {"controller.observer": "integral", "controller.printed_jacobian": True},
    {"controller.innovation_gate": 0.001, "plant.noise.std": 0.01, "plant.noise.seed": -7},
    {"plant.roll": False, "plant.noise.std": 0.001},
    {"plant.current.x": 0.4, "plant.current.z": -0.2, "plant.water.y": 0.3, "plant.water.z": 0.1},
    {"plant.actuator.T.u": 0.3, "plant.actuator.T.r": 0.05, "plant.tau_max.u": 20.0},
    {"plant.integrator": "rk4", "plant.current.y": 0.3, "plant.actuator.T.q": 0.1},
    {"plant.integrator": "rk4", "plant.roll": False, "plant.h_max": 0.01},
    {"planner.nu0.u": 0.2, "planner.h_max": 0.003, "controller.h_max": 0.007},
    {"plant.ell": 0.5, "plant.h_max": 0.004, "planner.m11": 20.0},
]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("values", ADDITIONS, ids=", ".join)
def test_additions_are_those_of_the_straight_line(values, order):
    engine, _ = engines("fig4")
    compare_with_straight_line(engine, Point(0, "fig4", values, 2.0, 0.02, order))


#: What components refuse: values, values that do not fit, starts, steps.
REFUSED: list[dict[str, Any]] = [
    {"controller.gamma": -1.0},
    {"controller.saturation": "sigmoid"},
    {"plant.tau.u": 1.0},
    {"plant.tau_min.u": 0.0, "plant.tau_max.u": 0.0, "planner.eta0.theta": 1.6},
    {"plant.roll": False, "plant.nu0.p": 0.1},
    {"plant.eta0.x": 1e101},
    {"plant.ell": 1e308},
    {"plant.h_max": 1e-9, "controller.h_max": 1e-9},
    {"planner.tau_d.q": 40.0},
    {"plant.m11": 1e-9},
    {"plant.m66": 1e-3, "planner.tau_d.q": 50.0},
    {"disturbance.omega_d": 1e308},
    {"disturbance.A_d": 1.7e308, "disturbance.A_f": 1.7e308},
    {"controller.gamma": 1e200},
]


def where(failure: str | None) -> str:
    """The step that a run fails in, or its start."""
    found = re.search(r"initialisation refused|t = \S+ s", str(failure))
    return found.group() if found else str(failure)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("values", REFUSED, ids=", ".join)
def test_what_fmus_refuse_is_refused_at_the_same_step(values, order):
    compare_refusals(Point(5, "fig4", values, 3.0, 0.02, order))


def compare_refusals(run: Point) -> None:
    """Both fail, in the same step."""
    made = (engine.outcomes([run]) for engine in engines(run.scenario))
    for batch, fmus in zip(*made, strict=True):
        assert batch.failure and fmus.failure and not batch.indices
        if run.order == JACOBI and "outputs refused" in fmus.failure:
            # They are read at the end of the step before.
            assert float(where(batch.failure)[4:-2]) == pytest.approx(
                float(where(fmus.failure)[4:-2]) + run.step
            )
        else:
            assert where(batch.failure) == where(fmus.failure)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("scenario", ["fig4", "fig5-pd"])
def test_indices_are_those_of_the_rows_of_fmus(scenario, order):
    """With noise, and a shorter step at the end."""
    run = Point(0, scenario, {"plant.noise.std": 0.001}, 30.01, 0.02, order)
    for batch, fmus in zip(*(engine.outcomes([run]) for engine in engines(scenario)), strict=True):
        assert batch == fmus
        assert batch.failure is None
        assert ("estimate_error" in batch.indices) == (scenario == "fig4")


@pytest.mark.parametrize("name", ["fig4", "fig5-pd", "remus"])
def test_an_index_that_is_not_accumulated_is_made_of_the_rows(monkeypatch, name):
    """To the last bit what the accumulators hold, for each of several stop times."""
    batch, _ = engines(name)
    run = Point(0, name, {"plant.noise.std": 0.001}, 20.01, 0.02)
    ends = [2.0, 7.5, 20.01]
    expected = batch.outcomes_at(run, ends)
    monkeypatch.setattr(batch_engine, "_ACCUMULATED", [])
    monkeypatch.setattr(batch_engine, "_OF_ROWS", INDICES)
    assert batch.outcomes_at(run, ends) == expected
    assert expected[-1].indices.keys() >= {"final_error.x", "late_error"}


def test_an_index_of_what_is_not_computed_is_refused(monkeypatch):
    first = INDICES[0]
    ports = (replace(first.reducer.ports[0], name="controller.z.x"),)
    reducer = replace(first.reducer, ports=ports)
    of_z = first._replace(name="size_of_z", reducer=reducer)
    monkeypatch.setattr(batch_engine, "_OF_ROWS", [of_z])
    with pytest.raises(InputError) as refused:
        engines("fig4")
    assert str(refused.value) == (
        "fig4: its index size_of_z is of controller.z.x, which the batch engine cannot run; "
        "use --engine fmu"
    )


def test_one_run_gives_what_came_of_shorter_ones():
    batch, _ = engines("fig5-pd")
    run = Point(3, "fig5-pd", {"plant.m66": 0.4}, 20.0, 0.02)
    ends = [2.0, 7.5, 20.0]
    alone = [next(batch.outcomes([run._replace(stop_time=end)])) for end in ends]
    assert batch.outcomes_at(run, ends) == alone


def test_ends_between_steps_are_refused():
    batch, _ = engines("fig4")
    run = Point(0, "fig4", {}, 1.0, 0.02)
    for end in (0.515, 1.5):
        [outcome] = batch.outcomes_at(run, [end])
        assert tells(str(outcome.failure), (end, 1))


def test_runs_that_failed_later_have_come_to_their_earlier_ends():
    batch, _ = engines("fig4")
    early, late = batch.outcomes_at(
        Point(0, "fig4", {"planner.tau_d.q": 40.0}, 3.0, 0.02), [1.0, 3.0]
    )
    assert early.failure is None and early.indices
    assert "SteepReference" in str(late.failure)


def test_engine_that_has_travelled_makes_the_same_and_needs_no_fmus():
    batch, _ = engines("fig4")
    run = Point(0, "fig4", {}, 0.5, 0.02)
    copy = pickle.loads(pickle.dumps(batch))
    assert copy.digest == batch.digest
    assert list(copy.outcomes([run])) == list(batch.outcomes([run]))
    assert len(pickle.dumps(batch)) < 1_000_000


def test_threads_have_noise_of_their_own():
    batch, _ = engines("fig4")
    runs = [Point(i, "fig4", {"plant.noise.seed": i}, 5.0, 0.02) for i in range(20)]
    with ThreadPoolExecutor(4) as pool:
        side_by_side = list(pool.map(lambda run: next(batch.outcomes([run])), runs))
    assert side_by_side == list(batch.outcomes(runs))


def test_other_systems_are_refused_by_what_differs(tmp_path):
    other = tmp_path / "Other.fmu"
    own = tmp_path / "own.toml"
    plant = systems("fig4")["fig4"].components["plant"].fmu
    other.write_bytes(plant.read_bytes())
    for text, why in (
        ('only = ["plant"]', "it has no controller"),
        (f'[components]\nplant = "{other}"', f"its plant is {other}"),
        ('[components]\nmore = "MotionPlanner"', "it also has more"),
        ('[wires]\n"controller.y" = false', "it has no wire plant.y.x -> controller.y.x"),
        (
            '[wires]\n"controller.y_d" = "plant.y"',
            "it has the wire plant.y.x -> controller.y_d.x",
        ),
        (
            '[components]\nsea = "Sea"\n[wires]\n"sea.eta" = "plant.eta"\n'
            '"plant.water" = "sea.water"',
            "it has no wire sea.dwater.x -> plant.dwater.x",
        ),
        ('[components]\nsea = "MotionPlanner"', "it also has sea"),
        (
            '[components]\nplanner = "PathPlanner"\n[wires]\n"plant.tau_w" = false',
            "it has no wire disturbance.tau_w.p -> plant.tau_w.p",
        ),
    ):
        own.write_text(text)
        with pytest.raises(InputError) as refused:
            BatchEngine({"own": load(str(own), KIND)}, KIND)
        assert str(refused.value) == (
            f"own: {why}, which the batch engine cannot run; use --engine fmu"
        )


def test_another_process_finds_the_kernel_compiled():
    """It loads in a fraction of a second what has taken several to compile."""
    text = (
        "from auv_fmu.loop.closed_loop import PAPER, blocks_of\n"
        "from orchestrator.studies.batch.compilation import compile_run\n"
        "from orchestrator.studies.batch_engine import BatchEngine\n"
        "from orchestrator.studies.engine import Point\n"
        "import pickle, sys\n"
        "engine = pickle.load(sys.stdin.buffer)\n"
        "list(engine.outcomes([Point(0, 'fig4', {}, 0.1, 0.02)]))\n"
        "stats = compile_run(blocks_of(PAPER)).stats\n"
        "print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))\n"
    )
    batch, _ = engines("fig4")
    list(batch.outcomes([Point(0, "fig4", {}, 0.1, 0.02)]))
    said = subprocess.run(
        [sys.executable, "-c", text], input=pickle.dumps(batch), capture_output=True, check=True
    )
    assert said.stdout.split() == [b"1", b"0"]
