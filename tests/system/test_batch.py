"""The batch engine: the numbers of the FMUs, bit for bit."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import chain, cycle
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from fmus.kinds import AUTO
from orchestrator import sweep
from orchestrator.commands.main import main
from orchestrator.cosim import Order, PortName, System, write_ssp
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import Prepared, load, load_scenario
from orchestrator.studies.batch_engine import REFUSED, BatchEngine
from orchestrator.studies.columns import Case, Outcomes, Point, Points
from orchestrator.studies.engine import FmuEngine, outcomes_of
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.studies.space import Space
from orchestrator.studies.study import read_study, ready_studies
from support import largest_depth, others
from support.runs import prepared, whole
from support.texts import mentions
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

KIND = "native"

ORDERS = ("feedthrough", "jacobi")


@cache
def systems(*names: str) -> dict[str, System]:
    return {name: load(name, KIND) for name in names}


def ready(name: str) -> Prepared:
    """A scenario, or an SSP with FMUs of its own, ready to be run."""
    return prepared(name, AUTO if name.endswith(".ssp") else KIND)


@cache
def engines(*names: str, own: tuple[OwnIndex, ...] = ()) -> tuple[BatchEngine, FmuEngine]:
    made = {name: ready(name) for name in names}
    batch = BatchEngine({name: prepared.system for name, prepared in made.items()}, own)
    return batch, FmuEngine(made, "compiled", own)


@cache
def sampled(name: str) -> list[Point]:
    """Ten runs of a ready study, 40 steps each, every second one in the other order."""
    study = read_study(name)
    space = Space(study, {scenario: load_scenario(scenario, KIND) for scenario in study.scenario})
    numbers = Random(name).sample(range(len(space)), 10)
    return [
        space[number]._replace(stop_time=40 * space[number].step, order=ORDERS[i % len(ORDERS)])
        for i, number in enumerate(numbers)
    ]


def bits(rows: np.ndarray) -> np.ndarray:
    """Rows as integers, in which -0.0 differs from 0.0."""
    return np.ascontiguousarray(rows).view(np.int64)


def changes(values: Mapping[str, Any]) -> dict[Any, Any]:
    return {PortName.read(name): value for name, value in values.items()}


@pytest.mark.parametrize(
    "name", ["attraction", "gains", *slow(*sorted({*ready_studies()} - {"attraction", "gains"}))]
)
def test_runs_of_studies_equal_the_fmus(name):
    """All indices are equal; the FMUs report why a run fails."""
    runs = sampled(name)
    batch, fmus = engines(*read_study(name).scenario)
    for by_batch, by_fmus in zip(outcomes_of(batch, runs), outcomes_of(fmus, runs), strict=True):
        if by_batch.failure == REFUSED:
            assert by_fmus.failure and not by_batch.indices
        else:
            assert by_batch == by_fmus


def compare_with_fmus(name: str, point: Point, own: tuple[OwnIndex, ...] = ()) -> None:
    """Every column of every row, to the last bit, and all indices."""
    batch, fmus = engines(name, own=own)
    point = point._replace(scenario=name)
    table = batch.table(point)
    system = ready(name).system.with_parameters(changes(point.parameters))
    expected = whole(system, table.header.experiment, "compiled")
    assert table.failure is None
    assert len(table.columns) >= 40
    assert table.header.parameters == expected.header.parameters
    # A program has no column for refusals.
    faults = {f"{part}.fault" for part in system.components}
    assert [name for name in expected.columns if name not in faults] == [*table.columns]
    rows = np.column_stack([expected.time, expected.group(*table.columns)])
    different = np.argwhere(bits(table.rows) != bits(rows))
    assert not different.size, ("time", *table.columns)[different[0][1]]
    [by_batch], [by_fmus] = outcomes_of(batch, [point]), outcomes_of(fmus, [point])
    assert by_batch == by_fmus and by_batch.indices


#: With noise, and a shorter step at the end.
NOISY = {"plant.noise.std": 0.002, "plant.noise.seed": 5}
PLANTS_FIRST: Order = ("plant", "disturbance", "planner", "controller")


@pytest.mark.parametrize(
    ("name", "order"),
    [("fig4", None), ("path", "feedthrough"), ("remus", "jacobi"), ("navigation", None),
     *slow(("fig5-pd", "jacobi"), ("sea", None), ("remus-pd", "feedthrough"),
           ("bluerov", "jacobi"))]
)  # fmt: skip
def test_every_column_equals_the_fmus(name, order):
    compare_with_fmus(name, Point(0, name, NOISY, 4.01, 0.02, order))


@pytest.mark.parametrize(
    "order", ["jacobi", PLANTS_FIRST, *slow("feedthrough", (PLANTS_FIRST[::-1],))], ids=str
)
def test_orders_equal_the_fmus(order):
    """One engine makes runs of all orders. An exact observer shows the gain of the step before."""
    values = {**NOISY, "controller.observer": "exact"}
    compare_with_fmus("fig5", Point(0, "fig5", values, 2.01, 0.02, order))


@pytest.mark.parametrize(
    ("name", "order"), [("formation-v", "feedthrough"), *slow(("formation-change", "jacobi"))]
)
def test_fleets_equal_the_fmus(name, order):
    """The smallest distance between vehicles is among the indices; a star means all of them."""
    values = {"auv*.plant.noise.std": 0.01, "auv2.plant.m11": 26.0, "auv3.controller.K1": (9, 9, 8)}
    point = Point(0, name, values, 2.01, 0.02, order)
    compare_with_fmus(name, point)
    [outcome] = outcomes_of(engines(name)[0], [point])
    assert outcome.indices["smallest_distance"] > 0.0


@pytest.mark.parametrize(("name", "start"), [("fig4", -1.0), ("path", 10.0)])
def test_start_times_equal_the_fmus(tmp_path, name, start):
    times = {"start_time": start, "stop_time": start + 4.0, "step": 0.02}
    write_ssp(replace(systems(name)[name], name="later", **times), tmp_path)
    point = Point(0, "", NOISY, start + 4.0, 0.02, start_time=start)
    compare_with_fmus(str(tmp_path / "later.ssp"), point)


@pytest.mark.parametrize(
    ("slow", "order"),
    [("controller = 0.2", "jacobi"), ("planner = 0.06\ndisturbance = 0.04", PLANTS_FIRST)],
)
def test_components_with_longer_steps_equal_the_fmus(tmp_path, slow, order):
    path = tmp_path / "slow.toml"
    path.write_text(f"stop_time = 4.0\n[steps]\n{slow}\n")
    compare_with_fmus(str(path), Point(0, "", NOISY, 4.0, 0.02, order))


#: Systems with more or fewer parts.
OTHERS = {
    "two planners": '[components]\nmore = "MotionPlanner"\n',
    "an open loop": '[wires]\n"controller.y" = false\n',
    "fed back": '[wires]\n"controller.y_d" = "plant.y"\n',
}


@pytest.mark.parametrize(("name", "order"), zip(OTHERS, cycle(ORDERS), strict=False))
def test_other_systems_equal_the_fmus(tmp_path, name, order):
    path = tmp_path / "own.toml"
    path.write_text(OTHERS[name])
    compare_with_fmus(str(path), Point(0, "", {}, 4.01, 0.02, order))


def test_a_users_controller_equals_its_fmu(workplace):
    assert main(["new", "controller", "my_law"]) == 0
    script, scenario = Path("my_law/my_law.py"), Path("my_law/my_law.toml")
    assert main(["build", str(script), "--kind", KIND]) == 0
    compare_with_fmus(str(scenario.resolve()), Point(0, "", NOISY, 4.01, 0.02))
    script.write_text(script.read_text() + "# Other words.\n")
    with pytest.raises(InputError) as refused:
        BatchEngine({"mine": load(str(scenario), KIND)})
    assert mentions(str(refused.value), "mine: my_law.py changed --engine fmu")


# Refusals


#: Refused by components: values, values that do not fit, starts, steps.
MISTAKES: list[tuple[str, dict[str, Any]]] = [
    ("fig4", {"plant.tau_min.u": 0.0, "plant.tau_max.u": 0.0, "planner.eta0.theta": 1.6}),
    ("fig4", {"plant.roll": False, "plant.nu0.p": 0.1}),
    ("fig4", {"plant.h_max": 1e-9, "controller.h_max": 1e-9}),
    ("fig4", {"plant.m11": 1e-9}),
    ("path", {"planner.timed": True, "planner.waypoint[3].t": 1.0}),
    ("sea", {"sea.waves.Hs": 20.0}),
    ("remus", {"plant.drag.T.yaw": 1e-3}),
]


@pytest.mark.parametrize(("mistake", "order"), zip(MISTAKES, cycle(ORDERS), strict=False))
def test_the_engine_refuses_the_same_as_the_fmus(mistake, order):
    name, values = mistake
    point = Point(5, name, values, 3.0, 0.02, order)
    [[by_batch], [by_fmus]] = (outcomes_of(engine, [point]) for engine in engines(name))
    assert by_fmus.failure
    assert by_batch == (5, {}, REFUSED, None)
    with pytest.raises(InputError):
        engines(name)[0].table(point)


COMPONENT = """
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Parameters(NamedTuple):
    k: Annotated[float, Variable("1", "Factor")] = 1.0


class Inputs(NamedTuple):
    x: Annotated[float, Variable("m", "A number")]


class Outputs(NamedTuple):
    y: Annotated[float, Variable("m", "Another number")]


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    x = parameters.k * inputs.x
    STATEMENT
    return Outputs(x)
"""


def test_values_that_would_make_a_loop_endless_are_refused(workplace):
    statements = {"scaled": "x = 3.0 * x", "halved": "while abs(x) > 1.0:\n        x = x / 2.0"}
    for name, statement in statements.items():
        Path(f"{name}.py").write_text(COMPONENT.replace("STATEMENT", statement))
        assert main(["build", f"{name}.py", "--kind", KIND]) == 0
    Path("own.toml").write_text(
        '[components]\nscaled = "Scaled.fmu"\nhalved = "Halved.fmu"\n'
        '[wires]\n"scaled.x" = "planner.y_d.x"\n"halved.x" = "scaled.y"\n'
    )
    path = str(Path("own.toml").resolve())
    # The reference comes beyond x = 1.1 m after 5.4 s.
    point = Point(0, path, {"scaled.k": 6e307}, 20.0, 0.02, "jacobi")
    assert [*outcomes_of(BatchEngine({path: load(path, KIND)}), [point])] == [
        (0, {}, REFUSED, None)
    ]


def test_runs_that_are_refused_have_the_words_of_the_fmus(tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    study = {"scenario": "fig4", "stop_time": 3.0, "vary": {"planner.tau_d.q": [1.0, 40.0, 45.0]}}
    by_batch, by_fmus = (
        sweep(study, engine=engine, kind=KIND, workers=1, out=tmp_path / engine)
        for engine in ("batch", "fmu")
    )
    assert list(by_batch) == list(by_fmus)
    assert by_batch["failure"][0] is None
    assert all("SteepReference" in failure for failure in by_batch["failure"][1:])
    for name in by_batch:
        assert str(by_batch[name].tolist()) == str(by_fmus[name].tolist()), name
    assert (by_batch.failed, by_batch.cautions) == (2, by_fmus.cautions)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('[[events]]\nat = 0.5\nfreeze = "plant.y"\n', "own events 'batch'"),
        ('coupling = "linear"\n', "coupling linear"),
    ],
)
def test_scenarios_outside_the_engine_are_refused_by_name(workplace, refused, content, words):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    Path("own.toml").write_text(f"stop_time = 1.0\n{content}")
    Path("mine.toml").write_text('scenario = "own.toml"\nengine = "batch"\n')
    assert mentions(refused("sweep", "mine.toml", "--kind", KIND), words)


def test_an_fmu_of_another_tool_is_refused_by_name(tmp_path):
    system = others.system_of(others.build(tmp_path), "t")
    with pytest.raises(InputError) as refused:
        BatchEngine({"own": system})
    assert mentions(str(refused.value), "own: t: no component language --engine fmu")


# Engines


@pytest.mark.parametrize("name", ["fig4", *slow("formation-v")])
def test_a_users_index_is_the_same_in_both_engines(name):
    own = (OwnIndex("largest_depth", Path(largest_depth.__file__).read_bytes()),)
    run = Point(0, name, {}, 2.01, 0.02)
    compare_with_fmus(name, run, own)
    [outcome] = outcomes_of(engines(name, own=own)[0], [run])
    assert any(key.endswith("largest_depth") for key in outcome.indices)


def test_engine_that_has_travelled_makes_the_same_and_needs_no_fmus():
    """Before and after its first run, if its program is prepared."""
    batch = BatchEngine(systems("fig4"))
    run = Point(0, "fig4", {}, 0.5, 0.02)
    batch.prepare(run)
    copies = [pickle.loads(pickle.dumps(batch))]
    [outcome] = outcomes_of(batch, [run])
    sent = pickle.dumps(batch)
    assert len(sent) < 2_000_000
    copies += [pickle.loads(sent), pickle.loads(pickle.dumps(pickle.loads(sent)))]
    for copy in copies:
        assert copy.digest == batch.digest
        assert list(outcomes_of(copy, [run])) == [outcome]


def test_runs_as_columns_are_those_made_one_by_one():
    """Also values of all types that a component refuses, and several cases and steps."""
    values = {
        "plant.m11": np.array([25.0, -1.0, np.inf, 26.0, 1e-9, 25.0]),
        "plant.noise.seed": np.array([1, 2, 3, 2**31, 5, -(2**31)]),
        "plant.roll": np.array([True, False, True, True, True, False]),
        "controller.saturation": np.array(["tanh", *["algebraic"] * 4, "none"], dtype=object),
    }
    batch, ones = engines("fig4")[0], np.ones(6)
    cases = [Case("fig4", {"controller.k_d": 90.0}, (*values,)), Case("fig4", {}, ("plant.m11",))]
    numbers, case, step = np.arange(6), np.array([0, 0, 0, 0, 0, 1]), np.array([0.02, 0.01] * 3)
    points = Points(numbers, cases, case, values, ones, step)
    found = Outcomes.joined([*batch.outcomes(points)])
    assert [*found] == [*outcomes_of(batch, points)]
    assert [outcome.failure for outcome in found] == [None, *[REFUSED] * 4, None]


def test_a_column_may_be_for_several_vehicles():
    values = {
        "auv*.plant.noise.std": np.array([0.0, 0.01, 0.02]),
        "auv2.plant.m11": 25.0 + np.arange(3),
    }
    case, ones = Case("formation-v", {"auv*.plant.m11": 24.0}, (*values,)), np.ones(3)
    points = Points(np.arange(3), [case], np.zeros(3, dtype=int), values, 0.4 * ones, 0.02 * ones)
    batch, _ = engines("formation-v")
    found = [*chain(*batch.outcomes(points))]
    assert found == [*outcomes_of(batch, points)]
    assert len({outcome.indices["auv2.peak_command.u"] for outcome in found}) == 3


def test_threads_have_noise_of_their_own():
    batch, _ = engines("fig4")
    runs = [Point(i, "fig4", {"plant.noise.seed": i}, 2.0, 0.02) for i in range(12)]
    with ThreadPoolExecutor(4) as pool:
        side_by_side = list(pool.map(lambda run: next(outcomes_of(batch, [run])), runs))
    assert side_by_side == list(outcomes_of(batch, runs))
    assert len({outcome.indices["late_error"] for outcome in side_by_side}) == len(runs)
