"""Which component is stepped when, and what each takes then."""

from __future__ import annotations

from ctypes import c_double
from types import SimpleNamespace

import pytest
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.machine.errors import InputError
from orchestrator.master.schedule import (
    Decimation,
    Member,
    StageCall,
    delays,
    gathered,
    stages,
    step,
)
from support.relay import relay, system_of
from support.texts import mentions

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


def test_a_slow_component_is_stepped_at_the_beginning_and_shown_at_the_end():
    begins, ends = Decimation(3), Decimation(3, at_end=True)
    assert [k for k in range(8) if begins.is_due(k, 8)] == [0, 3, 6]
    # Also where the run ends within its step.
    assert [k for k in range(8) if ends.is_due(k, 8)] == [2, 5, 7]


def test_outputs_are_asked_for_when_all_of_a_stage_have_been_stepped():
    calls: list[object] = []

    def called(name: str):
        def call(what: str):
            return lambda *how: calls.append((name, what, *(x.value for x in how[:2]))) or fmi2OK

        return Member([call("set")], call("step"), [call("get")], SimpleNamespace())

    step([called("a"), called("b")], 1.5, 0.5)
    assert calls == [
        ("a", "set"), ("a", "step", 1.5, 0.5), ("b", "set"), ("b", "step", 1.5, 0.5),
        ("a", "get"), ("b", "get"),
    ]  # fmt: skip


@pytest.mark.parametrize("where", range(3))
def test_a_status_worse_than_a_warning_ends_the_step(where):
    status = [fmi2Warning] * 3
    status[where] = fmi2Error
    failed = SimpleNamespace(failed=ValueError)
    member = Member([lambda: status[0]], lambda *_: status[1], [lambda: status[2]], failed)
    with pytest.raises(ValueError, match=("inputs", "DoStep", "outputs")[where]) as error:
        step([member], 0.0, 1.0)
    assert error.value.args[0] == fmi2Error
    step([Member([], lambda *_: fmi2Warning, [], failed)], 0.0, 1.0)


def test_what_acts_in_place_of_a_step_may_fail_as_one_does():
    def act(t: float, h: float) -> None:
        raise KeyError(t + h)

    call = StageCall(act)
    assert call.do_step(c_double(1.0), c_double(0.5), 1) == fmi2Error
    assert call.failed(fmi2Error, "doStep").args == (1.5,)
    assert StageCall(lambda t, h: None).do_step(c_double(1.0), c_double(0.5), 1) == fmi2OK
