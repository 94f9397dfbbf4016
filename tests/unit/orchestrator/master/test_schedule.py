"""The calls of a stage, and when slow components are stepped and shown."""

from __future__ import annotations

from ctypes import c_double
from types import SimpleNamespace

import pytest
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.master.schedule import Decimation, Member, StageCall, step_members


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

    step_members([called("a"), called("b")], 1.5, 0.5)
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
    with pytest.raises(ValueError, match=("inputs", "doStep", "outputs")[where]) as error:
        step_members([member], 0.0, 1.0)
    assert error.value.args[0] == fmi2Error
    step_members([Member([], lambda *_: fmi2Warning, [], failed)], 0.0, 1.0)


def test_what_acts_in_place_of_a_step_may_fail_as_one_does():
    def act(t: float, h: float) -> None:
        raise KeyError(t + h)

    call = StageCall(act)
    assert call.do_step(c_double(1.0), c_double(0.5), 1) == fmi2Error
    assert call.failed(fmi2Error, "doStep").args == (1.5,)
    assert StageCall(lambda t, h: None).do_step(c_double(1.0), c_double(0.5), 1) == fmi2OK
