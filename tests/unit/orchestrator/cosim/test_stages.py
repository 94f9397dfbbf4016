"""The stages of a step: moved values, the work of components, and their calls."""

from __future__ import annotations

from ctypes import c_double
from types import SimpleNamespace

import pytest
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.row import Row
from orchestrator.cosim.stages import (
    Decimation,
    LinkedStage,
    Member,
    Stage,
    StageCall,
    Visit,
    link_stages,
    stages_of,
    step_members,
)
from support.relay import relay, system_of
from support.small_fmus import description, unknown, variable, write

#: g of a relay follows from u at once; its y, t and h are states, as the y of an integrator is.
LOOP = {"law.u": "meter.g", "law.v": "path.y", "plant.u": "law.g", "meter.u": "plant.y"}
RING = {"law.u": "meter.g", "meter.u": "law.g", "plant.u": "law.g", "law.v": "plant.y"}

PLAIN, SLOW = {}, {"meter": 0.2}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("fmus")
    ports = [variable("u", 0, "input"), variable("y", 1, "output")]
    text = description("integrator", ports, [unknown(2, "")])
    integrator = write(folder / "integrator.fmu", text)
    whole = relay(folder)
    return {"law": whole, "plant": integrator, "meter": whole, "path": integrator}


@pytest.mark.parametrize(
    ("wires", "steps", "order", "passing", "stepping"),
    [
        (LOOP, PLAIN, "jacobi", None, [
            "law.u law.v plant.u meter.u: law plant meter path",
        ]),
        # Each component takes values that were just computed, and states of t_k before a step.
        (LOOP, PLAIN, "gauss-seidel", None, [
            "law.v meter.u: meter path",
            "law.u: law",
            "plant.u: plant",
        ]),
        (LOOP, PLAIN, "feedthrough", [
            "meter.u: meter(set pass direct)",
            "law.u law.v: law(set pass direct)",
            "plant.u:",
        ], [
            ": meter(step only states) path law(step only states) plant",
        ]),
        # It takes its input at every second step, and is shown after its own step.
        (LOOP, SLOW, "jacobi", None, [
            "2 meter.u:",
            "law.u law.v plant.u: law plant path",
            "2 : meter",
            "2 end show meter.g meter.y meter.t meter.h",
        ]),
        (LOOP, SLOW, "gauss-seidel", None, [
            "2 meter.u:",
            "law.v: path",
            "2 : meter",
            "2 show meter.g",
            "law.u: law",
            "plant.u: plant",
            "2 end show meter.y meter.t meter.h",
        ]),
        (LOOP, SLOW, "feedthrough", [
            "2 meter.u:",
            "2 : meter(set pass direct)",
            "2 show meter.g",
            "law.u law.v: law(set pass direct)",
            "plant.u:",
        ], [
            ": path law(step only states) plant",
            "2 : meter(step states)",
            "2 end show meter.g meter.y meter.t meter.h",
        ]),
        (RING, PLAIN, "jacobi", None, [
            "plant.u law.v: plant path",
            ": check law-meter",
            ": law meter",
            ": renew law-meter",
        ]),
        (RING, PLAIN, "gauss-seidel", None, [
            "law.v: path",
            ": check law-meter",
            ": law meter",
            ": renew always law-meter",
            "plant.u: plant",
            ": renew law-meter",
        ]),
        # Components of a ring take states of each other before these pass.
        (RING, PLAIN, "feedthrough", [
            ": renew always law-meter",
            "plant.u:",
        ], [
            ": path law(step states) meter(step states) plant",
        ]),
    ],
)  # fmt: skip
def test_stages_of_four_components_in_a_loop(fmus, wires, steps, order, passing, stepping):
    system = system_of(fmus, wires, steps=steps)
    plan = make_plan(system, Experiment(1.0, 0.1, order))
    found = stages_of(system, plan.arrangement, plan.decimations)
    assert list(map(described, found.stepping)) == stepping
    assert (found.passing and list(map(described, found.passing))) == passing


def described(stage: Stage) -> str:
    """Describe a stage; a component with all of its work has only its name."""
    when = "" if stage.decimation is None else f"{stage.decimation.every} "
    when += "end " if stage.decimation and stage.decimation.at_end else ""
    if stage.shows:
        return f"{when}show {' '.join(map(str, stage.shows))}"
    taken = " ".join(str(connection.target) for connection in stage.connections)
    done = [
        f"{visit.component}{'' if visit == Visit(visit.component) else f'({how(visit)})'}"
        for visit in stage.visits
    ]
    done += [f"{closing.how} {'-'.join(closing.ring)}" for closing in stage.closings]
    return " ".join([f"{when}{taken}:", *done])


def how(visit: Visit) -> str:
    return f"{'set ' * visit.takes}{'step' if visit.steps else 'pass'} {visit.reads}"


def test_a_slow_component_is_stepped_at_the_beginning_and_shown_at_the_end():
    begins, ends = Decimation(3), Decimation(3, at_end=True)
    assert [k for k in range(8) if begins.is_due(k, 8)] == [0, 3, 6]
    # Even if the run ends within its step.
    assert [k for k in range(8) if ends.is_due(k, 8)] == [2, 5, 7]


def test_in_feedthrough_order_each_value_is_moved_as_often_as_it_is_needed(tmp_path):
    """All components pass values on; only the plant's state is taken before that."""
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
    stages = stages_of(system, plan.arrangement, plan.decimations)
    found = link_stages(stages, system, instances, row)

    def calls(some: list[LinkedStage]) -> list[list[str]]:
        return [
            [" ".join([own.instance.name, *own.set_inputs, *[own.do_step] * bool(own.do_step),
                       *own.get_outputs]) for own in stage.members]
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
