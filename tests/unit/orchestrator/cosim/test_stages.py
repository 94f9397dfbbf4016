"""The stages of a step by names: which values move, and what components do then."""

from __future__ import annotations

import pytest

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.plan import make_plan, stages
from orchestrator.cosim.stages import Decimation, Stage, Visit, stages_of
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
        # Each takes what has just been computed, and states of t_k before one is stepped.
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
        # It takes its input at every second step, and is shown when it has made its own.
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
    solved = system.rings()
    plan = make_plan(system, Experiment(1.0, 0.1, order))
    found = stages_of(plan, stages(system, order, solved), solved)
    assert list(map(told, found.stepping)) == stepping
    assert (found.passing and list(map(told, found.passing))) == passing


def told(stage: Stage) -> str:
    """A stage in words; a component that takes its inputs, makes a step and is read by its name."""
    when = "" if stage.decimation is None else f"{stage.decimation.every} "
    when += "end " if stage.decimation and stage.decimation.at_end else ""
    if stage.shows:
        return f"{when}show {' '.join(map(str, stage.shows))}"
    taken = " ".join(str(connection.target) for connection in stage.connections)
    done = [
        f"{one.component}{'' if one == Visit(one.component) else f'({how(one)})'}"
        if isinstance(one, Visit)
        else f"{one.how} {'-'.join(one.ring)}"
        for one in stage.visits
    ]
    return " ".join([f"{when}{taken}:", *done])


def how(visit: Visit) -> str:
    return f"{'set ' * visit.takes}{'step' if visit.steps else 'pass'} {visit.reads}"


def test_a_slow_component_is_stepped_at_the_beginning_and_shown_at_the_end():
    begins, ends = Decimation(3), Decimation(3, at_end=True)
    assert [k for k in range(8) if begins.is_due(k, 8)] == [0, 3, 6]
    # Also where the run ends within its step.
    assert [k for k in range(8) if ends.is_due(k, 8)] == [2, 5, 7]
