"""Orders, rings, longer steps of single components, and what happens on the way to an input."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from fmus.kinds import NATIVE
from orchestrator.cosim import Experiment, Isolation, System, Table, make_plan, simulate_plan
from orchestrator.cosim.stages import arrange
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.run import simulate as simulated
from orchestrator.runs.scenario import Scenario
from support.relay import relay, system_of
from support.runs import whole as run
from support.texts import mentions

#: Step [s]; all multiples are exact.
H = 0.125


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("relays")


def ring(folder: Path, declares: bool = True, **others: object) -> System:
    """Three relays with feedthrough; each takes the output of the one before it."""
    wires = {"a.u": "c.g", "b.u": "a.g", "c.u": "b.g"}
    values = {"a.a": 0.5, "b.a": -1.0, "c.a": 0.25, "a.c": 1.0, "b.c": 2.0, "c.c": -1.0}
    return system_of({name: relay(folder, declares) for name in "abc"}, wires, values, **others)


@pytest.mark.parametrize("declares", [True, False])
def test_a_ring_is_opened_before_its_first_component_and_one_line_says_so(folder, declares):
    system, table = ring(folder, declares), Table()
    ending = simulate_plan(make_plan(system, Experiment(3 * H, H, coupling="delay")), [table])
    line = "a takes c.g one step late: direct feedthroughs form a ring"
    assert ending.messages == (line, *(f"{name}: initialises" for name in "abc"))
    assert arrange(system, "gauss-seidel").stages == [["a"], ["b"], ["c"]]
    # The value that closes the ring is a step old, every other is new.
    np.testing.assert_array_equal(table["a.u"][1:], table["c.g"][:-1])
    np.testing.assert_array_equal(table["b.u"][1:], table["a.g"][1:])
    np.testing.assert_array_equal(table["c.u"][1:], table["b.g"][1:])


def test_a_ring_that_feeds_another_is_opened_first(folder):
    """Although it is listed later: inputs from it are not late."""
    fmus = {name: relay(folder) for name in "abcde"}
    wires = {"a.u": "b.g", "b.u": "a.g", "a.v": "d.g", "c.u": "d.g", "d.u": "c.g", "e.u": "b.g"}
    system = system_of(fmus, wires)
    arrangement = arrange(system, "gauss-seidel")
    assert arrangement.stages == [["c"], ["d"], ["a"], ["b"], ["e"]]
    lines = arrangement.delays()
    assert [mentions(*pair) for pair in zip(lines, ("a b.g", "c d.g"), strict=True)] == [True, True]


def test_strict_wants_rings_solved_unless_something_else_is_stated(folder):
    """A ring through a component with longer steps cannot be solved."""
    system = replace(ring(folder, steps={"a": 2 * H}), stop_time=1.0)
    with pytest.raises(InputError, match=r"a .*c\.g .*; a "):
        simulated(system, strict=True, step=H)
    assert len(simulated(system, strict=True, order=["b", "c", "a"], step=H)) == 9
    assert len(simulated(system, strict=True, coupling="delay", step=H)) == 9
    simulated(replace(system, steps={}), strict=True)


@pytest.mark.parametrize("order", ["gauss-seidel", *permutations(("plant", "controller"))])
def test_an_order_of_names_is_the_derived_one_where_it_says_the_same(order):
    """The order counts where outputs follow inputs at once."""
    system, experiment = load("fig4", NATIVE), Experiment(2.0, 0.02, "gauss-seidel")
    derived = run(system, experiment)
    if order == "gauss-seidel":
        order = [name for names in arrange(system, order).stages for name in names]
    else:
        order = ("disturbance", "planner", *order)
    table = run(system, replace(experiment, order=order))
    same = system.delayed_connections(order) == []
    assert same == (order[-1] == "plant")
    assert (table.rows.tobytes() == derived.rows.tobytes()) == same


def test_isolated_components_have_steps_of_their_own_too(folder):
    system = ring(folder, declares=False, steps={"b": 2 * H, "c": 3 * H})
    experiment = Experiment(10.5 * H, H)
    apart = run(system, experiment, isolation=Isolation(20.0))
    assert apart.rows.tobytes() == run(system, experiment).rows.tobytes()


def test_steps_follow_from_the_request_and_otherwise_from_the_fmus(folder):
    fmus = {"a": relay(folder, step=0.02), "b": relay(folder, step=0.05), "c": relay(folder)}
    system = system_of(fmus, stop_time=1.0)

    def decimations_of(system: System, **stated: object) -> tuple[float, dict[str, int]]:
        prepared = prepare(Scenario("s"), system, Request(**stated))
        step = prepared.experiment.step
        return step, prepared.system.decimations(step)

    assert decimations_of(system) == (0.01, {"a": 2, "b": 5, "c": 1})
    assert decimations_of(system, steps={"b": 0.1}) == (0.02, {"a": 1, "b": 5, "c": 1})
    assert decimations_of(system, step=0.05) == (0.05, {"a": 1, "b": 1, "c": 1})
    annotated = replace(system, step=0.05, steps={"c": 0.15})
    assert decimations_of(annotated) == (0.05, {"a": 1, "b": 1, "c": 3})
    assert decimations_of(annotated, steps={"c": 0.1}) == (0.05, {"a": 1, "b": 1, "c": 2})
    assert decimations_of(system_of({"a": relay(folder)}, stop_time=1.0)) == (0.02, {"a": 1})


@pytest.mark.parametrize("isolation", [None, Isolation(20.0)])
def test_no_step_is_logged(folder, isolation):
    ending = simulate_plan(
        make_plan(system_of({"a": relay(folder)}), Experiment(10 * H, H), isolation)
    )
    assert ending.messages == ("a: initialises",)
