"""Which component is stepped when, what each takes then, and what cannot be run."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import Experiment
from orchestrator.master.plan import delays, gathered, planned, stages
from orchestrator.system.component import Component
from support.relay import relay, system_of
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
    """Systems of three relays that are wired so."""
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
        # A feedthrough that comes late waits for nobody.
        (RING, "gauss-seidel", ["ac", "b"]),
    ],
)
def test_no_component_waits_for_another_of_its_stage(relays, wires, order, expected):
    how = order if "-" in order or order == "jacobi" else tuple(order)
    assert stages(relays(wires), how) == [list(names) for names in expected]


def test_a_ring_that_is_solved_is_a_stage_of_its_own(relays):
    for order in ("jacobi", "gauss-seidel"):
        assert stages(relays(RING), order, [["a", "b"]]) == [["c"], ["a", "b"]]


@pytest.mark.parametrize(
    ("order", "words"), [("aabc", "a twice"), ("ab", "c order"), ("abcd", "'d'")]
)
def test_an_order_names_every_component_once(relays, order, words):
    with pytest.raises(InputError) as error:
        stages(relays(CHAIN), tuple(order))
    assert mentions(str(error.value), words)


def test_what_opens_a_ring_is_said(relays):
    [text] = delays(relays(RING), "gauss-seidel", reasons={"b": "b is a stranger"})
    assert text.startswith("a ") and mentions(text, "b.g stranger")
    assert delays(relays(RING), "gauss-seidel", [["a", "b"]]) == []
    assert delays(relays(RING), "jacobi") == delays(relays(CHAIN), "gauss-seidel") == []


@pytest.mark.parametrize(
    ("wires", "order", "latest", "expected"),
    [
        (CHAIN, "gauss-seidel", False, [[], ["b.u"], ["c.u"]]),
        (CHAIN, "jacobi", False, [["b.u", "c.u"], [], []]),
        # A state must be taken before anybody advances, unless the latest is wanted.
        (STATES, "gauss-seidel", False, [["b.u", "c.u"], [], []]),
        (STATES, "gauss-seidel", True, [[], ["b.u"], ["c.u"]]),
    ],
)
def test_inputs_are_gathered_before_the_stage_that_needs_them(
    relays, wires, order, latest, expected
):
    found = gathered(relays(wires), ["a", "b", "c"], order=order, latest=latest)
    assert [[str(wire.target) for wire in wires] for wires in found] == expected


def test_a_solved_ring_gathers_by_itself(relays):
    assert gathered(relays(RING), [["a", "b"], ["c"]], [["a", "b"]]) == [[], []]


@pytest.mark.parametrize(
    ("steps", "experiment", "word"),
    [({}, replace(EXPERIMENT, order=("a", "b")), "c"), ({"b": 0.2}, EXPERIMENT, "b")],
)
def test_what_cannot_be_run_is_refused_by_name(relays, steps, experiment, word):
    with pytest.raises(InputError, match=word):
        planned(replace(relays(CHAIN), steps=steps), experiment)


def test_a_step_of_a_component_is_a_number_of_those_of_the_run(relays):
    system = replace(relays(CHAIN), steps={"b": 0.25})
    assert planned(system, EXPERIMENT).decimations == {"a": 1, "b": 2, "c": 1}


def test_an_fmu_of_one_step_length_ends_with_its_last_whole_step(relays, monkeypatch):
    monkeypatch.setattr(Component, "takes_any_step", False)
    plan = planned(relays(CHAIN), Experiment(1.05, 0.125))
    assert plan.experiment.stop_time == 1.0
    assert mentions(" ".join(plan.remarks), "a, b, c 1 s")
    assert planned(relays(CHAIN), EXPERIMENT).remarks == ()
    with pytest.raises(InputError, match=r"0\.125 s"):
        planned(relays(CHAIN), Experiment(0.1, 0.125))
