"""How the steps of a run are made: one after the other in Python, or many in one compiled call.

Both make the same calls of FMI in the same order, and the same rows bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from ctypes import CDLL, c_double
from dataclasses import replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Warning

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import ROUNDING, Experiment
from orchestrator.master.fmi.instance import Ended
from orchestrator.master.fmi.isolated import Isolation
from orchestrator.master.hooks.hook import Run
from orchestrator.master.schedule import Stage, step_members
from orchestrator.master.stepper import compile_stepper, load_stepper, step_compiled

#: Loops that can be asked for; the first is the default.
LOOPS = ("auto", "python", "compiled")

#: To set the compiled loop up takes as long as so many steps in Python, and to compile it as long
#: as so many.
_SET_UP, _COMPILED = 20, 10_000


class Steps(Protocol):
    """Makes the steps of a run, and is an iterator over the moments at which Python may look."""

    def __call__(self, run: Run) -> Iterator[None]:
        """Make the steps that are left, and count them; it ends before a row that is not finite.

        Yields:
            Nothing, when Python may look: after as many steps as are due, at the latest.

        Raises:
            ComponentFailed: by the step after them.

        """


class Stepping(NamedTuple):
    """A way to make the steps, and its name in records."""

    name: str
    steps: Steps


def step_interpreted(run: Run) -> Iterator[None]:
    """Make the steps in Python, and look after each."""
    values, shown, append = run.row.values, run.row.shown, run.blocks.append
    experiment, stages, steps = run.experiment, run.stages, run.experiment.rows - 1
    # Times zero, what is finite is zero and what is not is nan: the cheapest way to see it.
    is_not_finite = partial(np.vdot, shown, np.zeros_like(shown))
    for k, t, h, end in experiment.steps(run.made):
        for gather, members, decimation in stages:
            if decimation is None:
                # What most stages are costs no call.
                if gather.is_plain:
                    values[gather.targets] = values[gather.sources]
                else:
                    gather(values)
                step_members(members, t, h)
            elif decimation.is_due(k - 1, steps):
                gather(values)
                step_members(members, t, experiment.length(k - 1, decimation.every))
        if is_not_finite():
            return
        append(end, shown)
        run.made = k
        yield


#: The loop that is always there.
PYTHON_LOOP = Stepping("python", step_interpreted)


def choose_loop(
    wanted: str, experiment: Experiment, isolation: Isolation | None = None
) -> Stepping:
    """Choose the loop for a run.

    Args:
        wanted: one of :data:`LOOPS`.
        experiment: to be run.
        isolation: of the FMUs: none of their calls is then a function of this process.

    Raises:
        InputError: there is no such loop, or the compiled one cannot be had.

    """
    if wanted not in LOOPS:
        raise InputError(f"loop {wanted!r}: use one of {', '.join(LOOPS)}")
    if wanted == "compiled":
        if isolation:
            raise InputError(
                "the compiled loop cannot step isolated FMUs: leave one of the two out"
            )
        return _compiled(load_stepper() or compile_stepper())
    if wanted == "auto" and not isolation and experiment.rows > _SET_UP:
        if library := load_stepper():
            return _compiled(library)
        if experiment.rows > _COMPILED:
            with suppress(InputError):
                return _compiled(compile_stepper(in_no_time=True))
    return PYTHON_LOOP


def _compiled(library: CDLL) -> Stepping:
    return Stepping("compiled", partial(step_compiled, library))


def make_steps(steps: Steps, run: Run) -> Iterator[None]:
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
        yield from make_steps(partial(_finished, end=end), run)


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
            step_members(
                [one for one in stage.members if reached.get(one.instance.name, after) > t], t, h
            )
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
            step_members([idle if i < begun else member], t, h)
        except Ended as other:
            end = min(end, other, key=lambda one: one.time)
            step_members([idle], t, h)
    return end


def _nothing(t: c_double, h: c_double, no_rollback: int) -> int:
    return int(fmi2OK)
