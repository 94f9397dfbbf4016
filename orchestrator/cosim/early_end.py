"""The last row of a run that a component ends within a step, at the time that it has come to.

FMI has it that a slave may end a run so. Components that were stepped before that one, or in the
same stage, have made their whole steps; the others are stepped in Python to where the run ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ctypes import c_double
from dataclasses import replace
from functools import partial

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Warning

from orchestrator.cosim.experiment import ROUNDING, Experiment
from orchestrator.cosim.fmi.instance import Ended
from orchestrator.cosim.hooks.hook import Run
from orchestrator.cosim.loop import Steps
from orchestrator.cosim.schedule import Member, Stage, step_members


def make_steps(steps: Steps, run: Run) -> Iterator[None]:
    """Make the steps of a run, and its last row where a component ends it within a step.

    Yields:
        Nothing, when Python may look.

    Raises:
        Ended: the run has been ended, and has the rows until then.
        ComponentFailed: by the step after them.

    """
    while True:
        try:
            yield from steps(run)
            return
        except Ended as end:
            if not end.time > run.time:
                raise
            # On the way there another one may end it earlier.
            steps = partial(_finished, end=end)


def _finished(run: Run, end: Ended) -> Iterator[None]:
    """Go on from a component that has ended the run, until the time that it has come to.

    The run ends there as it would at its stop time.
    """
    planned = run.experiment
    place = _place(run.stages, end)
    stage = run.stages[place]
    end = _stepped_on(stage, end, run.time, planned.length(run.made, _every(stage)))
    run.passing = run.passing and _without_inputs(run.passing, end.component)
    shorter = _shorter(run, stage, end)
    reached = _reached(run)
    reached[end.component] = shorter.stop_time
    run.experiment, left = shorter, run.stages[place + 1 :]
    for k, t, _, after in shorter.steps(run.made):
        for stage in left:
            if stage.decimation is None or stage.decimation.is_due(k - 1, shorter.rows - 1):
                stage.gather(run.row.values)
                _step_those_before(stage, run, planned, k, t, reached)
        if run.passing is None:
            if not np.isfinite(run.row.shown).all():
                return
            run.blocks.append(after, run.row.shown)
        run.made, left = k, run.stages
        if k < shorter.rows - 1:
            yield
            run.show()
    elsewhere = ", ".join(name for name, time in reached.items() if time != run.time)
    raise Ended(f"{end}; the last row has {elsewhere} at another time" if elsewhere else str(end))


def _without_inputs(stages: Sequence[Stage], component: str) -> list[Stage]:
    """Stages in which values pass, but not to a component that has ended the run."""
    return [
        stage._replace(
            members=[
                _idle(member) if member.instance.name == component else member
                for member in stage.members
            ]
        )
        for stage in stages
    ]


def _idle(member: Member) -> Member:
    """The calls that only read outputs."""
    return member._replace(set_inputs=[], do_step=None)


def _place(stages: Sequence[Stage], end: Ended) -> int:
    """The number of the stage with the component that has ended the run.

    Raises:
        Ended: there is none, or its outputs cannot be read any more.

    """
    for i, stage in enumerate(stages):
        if any(member.instance.name == end.component for member in stage.members):
            if _can_be_read(stage, end.component):
                return i
            break
    raise Ended(str(end))


def _can_be_read(stage: Stage, component: str) -> bool:
    """Whether a component that has ended the run has outputs to the last."""
    return all(
        call() in (fmi2OK, fmi2Warning)
        for member in stage.members
        if member.instance.name == component
        for call in member.get_outputs
    )


def _stepped_on(stage: Stage, end: Ended, t: float, h: float) -> Ended:
    """Step the other components of a stage, and read all outputs; the earliest end of them."""
    names = [member.instance.name for member in stage.members]
    at = names.index(end.component)
    # Isolated ones have all begun their steps before the first is read.
    begun = at + 1 if stage.members[at].instance.is_here else len(names)
    for i, member in enumerate(stage.members):
        idle = _idle(member)
        try:
            step_members([idle if i < begun else member], c_double(t), c_double(h))
        except Ended as other:
            end = min(end, other, key=lambda one: one.time)
            step_members([idle], c_double(t), c_double(h))
    return end


def _shorter(run: Run, stage: Stage, end: Ended) -> Experiment:
    """The experiment up to the time that a component of a stage has come to.

    Raises:
        Ended: there is no row to be had before that time.

    """
    planned = run.experiment
    latest = planned.time(min(run.made + _every(stage), planned.rows - 1))
    # An FMU that adds up its time is off by rounding.
    stop = latest if end.time > latest - ROUNDING * planned.step else end.time
    if stop <= run.time or (found := replace(planned, stop_time=stop)).rows - 1 == run.made:
        raise Ended(str(end))
    return found


def _reached(run: Run) -> dict[str, float]:
    """The times that components are at after the steps that they have made or begun."""
    k, last = run.made, run.experiment.rows - 1
    return {
        member.instance.name: run.experiment.time(min(k - k % n + n, last))
        for stage in run.stages
        for n in [_every(stage)]
        for member in stage.members
        if member.instance.name
    }


def _step_those_before(
    stage: Stage, run: Run, planned: Experiment, k: int, t: float, reached: dict[str, float]
) -> None:
    """Step the components of a stage as far as they can be, and note the times that they are at.

    Args:
        stage: whose components.
        run: with the experiment up to where it ends.
        planned: the experiment that it had.
        k: number of the step.
        t: its beginning [s].
        reached: takes the times.

    """
    shorter, every = run.experiment, _every(stage)
    h = shorter.length(k - 1, every)
    is_whole = h == planned.length(k - 1, every)
    after = shorter.time(min(k - 1 + every, shorter.rows - 1))
    stepped = []
    for member in stage.members:
        if name := member.instance.name:
            takes = is_whole or run.system.components[name].takes_any_step
            reached[name] = after if takes else t
        if not name or reached[name] > t:
            stepped.append(member)
    step_members(stepped, c_double(t), c_double(h))


def _every(stage: Stage) -> int:
    return stage.decimation.every if stage.decimation else 1
