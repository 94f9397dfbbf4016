"""Stages and decimations of a plan, systems that cannot be run, and the identity of a run."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cache, wraps
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.cosim import plan
from orchestrator.cosim.component import Component
from orchestrator.cosim.connection import Linear, PortName
from orchestrator.cosim.events import Event, Stop
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.isolated import Isolation
from orchestrator.cosim.hooks import InputTable
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.stages import arrange, gathered_connections
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import digest_of
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.request import Request
from support.relay import relay, system_of
from support.runs import prepared
from support.texts import mentions

EXPERIMENT = Experiment(1.0, 0.125)

#: g of a relay follows from u at once, y from its state.
CHAIN, STATES, RING = (
    {"b.u": "a.g", "c.u": "b.g"},
    {"b.u": "a.y", "c.u": "b.y"},
    {"b.u": "a.g", "a.u": "b.g"},
)


@pytest.fixture(scope="module")
def relays(tmp_path_factory: pytest.TempPathFactory):
    """Systems of three connected relays."""
    path = relay(tmp_path_factory.mktemp("relay"))
    return lambda wires: system_of(dict.fromkeys("abc", path), wires)


@pytest.mark.parametrize(
    ("wires", "order", "expected"),
    [
        (CHAIN, "gauss-seidel", ["a", "b", "c"]),
        (CHAIN, "jacobi", ["abc"]),
        (CHAIN, "cba", ["cba"]),
        (CHAIN, "acb", ["ac", "b"]),
        (STATES, "gauss-seidel", ["abc"]),
        # A late feedthrough does not wait.
        (RING, "gauss-seidel", ["ac", "b"]),
    ],
)
def test_no_component_waits_for_another_of_its_stage(relays, wires, order, expected):
    how = order if "-" in order or order == "jacobi" else tuple(order)
    assert arrange(relays(wires), how).stages == [list(names) for names in expected]


def test_a_ring_that_is_solved_is_a_stage_of_its_own(relays):
    for order in ("jacobi", "gauss-seidel"):
        assert arrange(relays(RING), order, [["a", "b"]]).stages == [["c"], ["a", "b"]]


@pytest.mark.parametrize(
    ("order", "words"), [("aabc", "a twice"), ("ab", "c order"), ("abcd", "'d'")]
)
def test_an_order_names_every_component_once(relays, order, words):
    with pytest.raises(InputError) as error:
        make_plan(relays(CHAIN), replace(EXPERIMENT, order=tuple(order)))
    assert mentions(str(error.value), words)


def test_what_opens_a_ring_is_said(relays):
    [text] = arrange(relays(RING), "gauss-seidel").delays({"b": "b is a stranger"})
    assert text.startswith("a ") and mentions(text, "b.g stranger")
    assert arrange(relays(RING), "gauss-seidel", [["a", "b"]]).delays() == []
    assert arrange(relays(CHAIN), "gauss-seidel").delays() == []


@pytest.mark.parametrize(
    ("wires", "order", "latest", "expected"),
    [
        (CHAIN, "gauss-seidel", False, [[], ["b.u"], ["c.u"]]),
        (CHAIN, "jacobi", False, [["b.u", "c.u"], [], []]),
        # A state must be taken before any component is stepped, unless the latest values are
        # wanted.
        (STATES, "gauss-seidel", False, [["b.u", "c.u"], [], []]),
        (STATES, "gauss-seidel", True, [[], ["b.u"], ["c.u"]]),
    ],
)
def test_inputs_are_gathered_before_the_stage_that_needs_them(
    relays, wires, order, latest, expected
):
    system = relays(wires)
    arrangement = arrange(system, order)._replace(stages=["a", "b", "c"])
    found = gathered_connections(system, arrangement, latest=latest)
    assert [[str(wire.target) for wire in wires] for wires in found] == expected


def test_a_solved_ring_gathers_by_itself(relays):
    system = relays(RING)
    assert gathered_connections(system, arrange(system, "gauss-seidel", [["a", "b"]])) == [[], []]


@pytest.mark.parametrize(
    ("steps", "experiment", "word"),
    [({}, replace(EXPERIMENT, order=("a", "b")), "c"), ({"b": 0.2}, EXPERIMENT, "b")],
)
def test_impossible_systems_are_refused_by_name(relays, steps, experiment, word):
    with pytest.raises(InputError, match=word):
        make_plan(replace(relays(CHAIN), steps=steps), experiment)


def test_a_step_of_a_component_is_a_multiple_of_the_step_of_the_run(relays):
    system = replace(relays(CHAIN), steps={"b": 0.25})
    assert make_plan(system, EXPERIMENT).decimations == {"a": 1, "b": 2, "c": 1}


def test_an_fmu_of_one_step_length_ends_with_its_last_whole_step(relays, monkeypatch):
    monkeypatch.setattr(Component, "takes_any_step", False)
    plan = make_plan(relays(CHAIN), Experiment(1.05, 0.125))
    assert plan.experiment.stop_time == 1.0
    assert mentions(" ".join(plan.remarks), "a, b, c 1 s")
    assert make_plan(relays(CHAIN), EXPERIMENT).remarks == ()
    with pytest.raises(InputError, match=r"0\.125 s"):
        make_plan(relays(CHAIN), Experiment(0.1, 0.125))


@cache
def base() -> Prepared:
    return prepared("fig5", "python")


numbers = st.floats(allow_nan=False, allow_infinity=False)
choices = st.randoms(use_true_random=False)


@dataclass
class Choice:
    """Random choices of an example."""

    random: Random
    number: float


def on_system(change: Callable[[System, Choice], System]) -> Callable[[Prepared, Choice], Prepared]:
    @wraps(change)
    def changed(run: Prepared, choice: Choice) -> Prepared:
        return replace(run, plan=replace(run.plan, system=change(run.system, choice)))

    return changed


def another_fmu(system: System, choice: Choice) -> System:
    name = choice.random.choice(list(system.components))
    part = replace(system.components[name], digest=f"{choice.number!r}")
    return replace(system, components={**system.components, name: part})


def another_first_component(system: System, choice: Choice) -> System:
    first, *others = system.components
    chosen = choice.random.choice(others)
    names = [chosen, *(name for name in system.components if name != chosen)]
    return replace(system, components={name: system.components[name] for name in names})


def no_wire(system: System, choice: Choice) -> System:
    gone = choice.random.choice(system.connections)
    return replace(system, connections=tuple(c for c in system.connections if c != gone))


def another_source(system: System, choice: Choice) -> System:
    return _rewired(system, choice, source=PortName("plant", "another"))


def another_unit(system: System, choice: Choice) -> System:
    return _rewired(system, choice, transformation=Linear(choice.number, 1.0))


def _rewired(system: System, choice: Choice, **change: object) -> System:
    i = choice.random.randrange(len(system.connections))
    wires = list(system.connections)
    wires[i] = replace(wires[i], **change)
    return replace(system, connections=tuple(wires))


def another_parameter(system: System, choice: Choice) -> System:
    names = [
        PortName(part.name, variable.name)
        for part in system.components.values()
        for variable in part.having("parameter")
        if type(part.start(variable.name)) is float
    ]
    name = choice.random.choice(names)
    value = choice.number
    if repr(value) == repr(system.value(name)):
        value = np.nextafter(value, np.inf).item()
    return replace(system, parameters={**system.parameters, name: value})


def longer_steps(system: System, choice: Choice) -> System:
    return replace(system, steps={choice.random.choice(list(system.components)): choice.number})


def another_field(run: Prepared, choice: Choice) -> Prepared:
    """Any field, including future ones."""
    experiment = copy(run.experiment)
    field = choice.random.choice(fields(Experiment))
    object.__setattr__(experiment, field.name, ("another", choice.number))
    return replace(run, plan=replace(run.plan, experiment=experiment))


def an_event(run: Prepared, choice: Choice) -> Prepared:
    return replace(run, events=(Event("stop", Stop("stop"), "stop", at=choice.number),))


def inputs(run: Prepared, choice: Choice) -> Prepared:
    values = np.array([[choice.number]])
    target = PortName("controller", "y.x")
    table = InputTable((target,), np.zeros(1), values, np.array([False]))
    return replace(run, input_tables=(table,))


OTHERS = [
    *map(
        on_system,
        (
            another_fmu,
            another_first_component,
            no_wire,
            another_source,
            another_unit,
            another_parameter,
            longer_steps,
        ),
    ),
    another_field,
    an_event,
    inputs,
]


@pytest.mark.parametrize("change", OTHERS)
@settings(max_examples=30)
@given(random=choices, number=numbers)
def test_another_run_has_another_identity(change, random, number):
    other = change(base(), Choice(random, number))
    different = dict(base().identity.items() ^ other.identity.items())
    assert different
    assert digest_of(other.identity) != digest_of(base().identity)


def in_another_order(system: System, choice: Choice) -> System:
    wires, values = list(system.connections), list(system.parameters.items())
    choice.random.shuffle(wires)
    choice.random.shuffle(values)
    return replace(system, connections=tuple(wires), parameters=dict(values))


def elsewhere(system: System, choice: Choice) -> System:
    parts = {
        name: replace(part, fmu=Path("elsewhere", f"{choice.number!r}.fmu"))
        for name, part in system.components.items()
    }
    return replace(system, components=parts, name="another")


def set_to_its_own(system: System, choice: Choice) -> System:
    part = choice.random.choice(list(system.components.values()))
    names = [
        name
        for name in part.starts
        if part.is_settable(name) and PortName(part.name, name) not in system.parameters
    ]
    name = choice.random.choice(names)
    return system.with_parameters({PortName(part.name, name): part.start(name)})


def made_in_another_way(run: Prepared, choice: Choice) -> Prepared:
    return replace(
        run,
        scenario=replace(run.scenario, name="another", title="Another", digest="1234"),
        plan=replace(
            run.plan,
            isolation=choice.random.choice([None, Isolation(20.0)]),
            loop=choice.random.choice(["python", "auto"]),
        ),
    )


SAME = [*map(on_system, (in_another_order, elsewhere, set_to_its_own)), made_in_another_way]


@pytest.mark.parametrize("change", SAME)
@settings(max_examples=30)
@given(random=choices, number=numbers)
def test_the_same_run_has_the_same_identity(change, random, number):
    same = change(base(), Choice(random, number))
    assert same.identity == base().identity
    assert digest_of(same.identity) == digest_of(base().identity)


def test_the_same_fmus_from_elsewhere_are_the_same_run(tmp_path, native):
    runs = []
    for name in "ab":
        folder = tmp_path / name
        folder.mkdir()
        (folder / "auv.ssp").write_bytes((native / "auv.ssp").read_bytes())
        request = Request(stop_time=1.0, order="jacobi")
        runs.append(prepared(folder / "auv.ssp", "python", request))
    assert runs[0].identity == runs[1].identity


def test_zero_has_a_sign():
    name = PortName("plant", "nu0.u")
    assert base().system.component("plant").start("nu0.u") == 0.0
    system = base().system.with_parameters({name: -0.0})
    other = replace(base(), plan=replace(base().plan, system=system))
    assert other.identity != base().identity


def test_another_version_is_another_run(monkeypatch):
    before = base().identity
    monkeypatch.setattr(plan, "version", lambda package: "another")
    assert {name.split()[-1] for name, _ in before.items() - base().identity.items()} == {
        *plan.PACKAGES
    }


@pytest.mark.parametrize(
    ("room", "is_same"), [("fmi", False), ("cosim", False), ("machine", True), ("runs", True)]
)
def test_code_is_part_of_a_run_where_it_makes_rows(monkeypatch, room, is_same):
    def commented(path: Path) -> bytes:
        return read(path) + b"# more" * (path.parent.name == room)

    before, read = base().identity, Path.read_bytes
    monkeypatch.setattr(plan, "code_of", plan.code_of.__wrapped__)
    monkeypatch.setattr(Path, "read_bytes", commented)
    assert (base().identity == before) == is_same


def test_an_unknown_loop_is_refused_by_name():
    with pytest.raises(InputError, match=r"loop 'fast': use one of auto, python, compiled"):
        make_plan(base().system, base().experiment, loop="fast")
