"""The last row of a run that a component ends within a step."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import c_double
from dataclasses import replace
from functools import partial

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Warning

from orchestrator.master.experiment import ROUNDING
from orchestrator.master.fmi.instance import Ended
from orchestrator.master.hooks.hook import Run
from orchestrator.master.loop import Steps
from orchestrator.master.schedule import Stage, step


def to_its_end(steps: Steps, run: Run) -> Iterator[None]:
    """Make the steps of a run, and its last row where a component ends it within a step.

    Yields:
        Nothing, when Python may look.

    Raises:
        Ended: the run has been ended, and has the rows until then.
        ComponentFailed: by the step after them.

    """
    try:
        yield from steps(run)
    except Ended as end:
        if not end.time > run.time:
            raise
        yield from to_its_end(partial(_finished, end=end), run)


def _finished(run: Run, end: Ended) -> Iterator[None]:
    """Go on from a component that has ended the run, until the time that it has come to.

    The run ends there as it would at its stop time. Components that were stepped before that one,
    or in the same stage, have made their whole steps.
    """
    k, planned = run.made, run.experiment
    place, stage = next(
        (
            (i, stage)
            for i, stage in enumerate(run.stages)
            if any(member.instance.name == end.component for member in stage.members)
        ),
        (0, None),
    )
    if stage is None or not _can_be_read(stage, end.component):
        raise Ended(str(end))
    every = _every(stage)
    end = _stepped_on(stage, end, run.time, planned.length(k, every))
    latest = planned.time(min(k + every, planned.rows - 1))
    # An FMU that adds up its time is off by rounding.
    stop = latest if end.time > latest - ROUNDING * planned.step else end.time
    if stop <= run.time or (cut := replace(planned, stop_time=stop)).rows - 1 == k:
        raise Ended(str(end))
    reached = {
        member.instance.name: planned.time(min(k - k % n + n, planned.rows - 1))
        for stage in run.stages
        for n in [_every(stage)]
        for member in stage.members
        if member.instance.name
    }
    reached[end.component] = stop
    run.experiment, left = cut, run.stages[place + 1 :]
    for n, t, _, after in cut.steps(k):
        for stage in left:
            if stage.decimation and not stage.decimation.is_due(n - 1, cut.rows - 1):
                continue
            stage.gather(run.row.values)
            every = _every(stage)
            h = cut.length(n - 1, every)
            is_whole = h == planned.length(n - 1, every)
            for name in filter(None, (one.instance.name for one in stage.members)):
                takes = is_whole or run.system.components[name].takes_any_step
                reached[name] = cut.time(min(n - 1 + every, cut.rows - 1)) if takes else t
            step([one for one in stage.members if reached.get(one.instance.name, after) > t], t, h)
        if not np.isfinite(run.row.shown).all():
            return
        run.blocks.append(after, run.row.shown)
        run.made, left = n, run.stages
        if n < cut.rows - 1:
            yield
    elsewhere = ", ".join(name for name, time in reached.items() if time != run.time)
    raise Ended(f"{end}; the last row has {elsewhere} at another time" if elsewhere else str(end))


def _every(stage: Stage) -> int:
    return stage.decimation.every if stage.decimation else 1


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
        idle = member._replace(set_inputs=[], do_step=_nothing)
        try:
            step([idle if i < begun else member], t, h)
        except Ended as other:
            end = min(end, other, key=lambda one: one.time)
            step([idle], t, h)
    return end


def _nothing(t: c_double, h: c_double, no_rollback: int) -> int:
    return int(fmi2OK)
