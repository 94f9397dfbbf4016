"""The calls of a stage, and what of a component is read."""

from __future__ import annotations

from ctypes import c_double
from types import SimpleNamespace

import pytest
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.plan import make_plan, stages
from orchestrator.cosim.row import Row
from orchestrator.cosim.schedule import (
    Member,
    Stage,
    StageCall,
    schedule,
    step_members,
)
from support.relay import relay, system_of


def test_in_feedthrough_order_each_value_is_moved_as_often_as_it_is_needed(tmp_path):
    """All pass something on; only the plant's state is taken before it has passed it on itself."""
    fmus = dict.fromkeys(("plant", "meter", "law"), relay(tmp_path))
    wires = {"law.u": "plant.y", "plant.u": "law.g", "meter.u": "law.g"}
    system = system_of(fmus, wires)
    plan = make_plan(system, Experiment(1.0, 0.1, "feedthrough"))
    instances = {
        name: SimpleNamespace(
            name=name, is_here=True, do_exchange=None, do_step="step",
            set_inputs=["set"], get_outputs=["get"], tie=lambda *_: None,
        )
        for name in fmus
    }  # fmt: skip
    row = Row(system, instances)
    found = schedule(plan, stages(system, "feedthrough"), instances, row)

    def calls(some: list[Stage]) -> list[list[str]]:
        return [
            [" ".join([one.instance.name, *one.set_inputs, *[one.do_step] * bool(one.do_step),
                       *one.get_outputs]) for one in stage.members]
            for stage in some
        ]  # fmt: skip

    assert calls(found.passing) == [["law set get"], ["plant set get", "meter set get"]]
    assert calls(found.stepping) == [["law step", "plant step get", "meter step"]]


def test_outputs_are_asked_for_when_all_of_a_stage_have_been_stepped():
    calls: list[object] = []

    def called(name: str):
        def call(what: str):
            return lambda *how: calls.append((name, what, *(x.value for x in how[:2]))) or fmi2OK

        return Member([call("set")], call("step"), [call("get")], SimpleNamespace())

    step_members([called("a"), called("b")], c_double(1.5), c_double(0.5))
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
        step_members([member], c_double(0.0), c_double(1.0))
    assert error.value.args[0] == fmi2Error
    step_members([Member([], lambda *_: fmi2Warning, [], failed)], c_double(0.0), c_double(1.0))


def test_what_acts_in_place_of_a_step_may_fail_as_one_does():
    def act(t: float, h: float) -> None:
        raise KeyError(t + h)

    call = StageCall(act)
    assert call.do_step(c_double(1.0), c_double(0.5), 1) == fmi2Error
    assert call.failed(fmi2Error, "doStep").args == (1.5,)
    assert StageCall(lambda t, h: None).do_step(c_double(1.0), c_double(0.5), 1) == fmi2OK
