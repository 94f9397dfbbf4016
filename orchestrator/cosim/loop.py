"""The loops that make the steps of a run: one after the other in Python, or many in one C call.

Both make the same calls of FMI in the same order, and the same rows bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from ctypes import CDLL, c_double
from functools import partial
from typing import Literal, NamedTuple, Protocol, TypeAlias, get_args

import numpy as np

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.isolated import Isolation
from orchestrator.cosim.hooks.hook import Run
from orchestrator.cosim.stages import make_stages
from orchestrator.cosim.stepper import compile_stepper, load_stepper, step_compiled
from orchestrator.machine.errors import InputError

#: Loops that can be asked for; the first is the default.
LoopName: TypeAlias = Literal["auto", "python", "compiled"]
LOOPS: tuple[LoopName, ...] = get_args(LoopName)

#: To set the compiled loop up takes as long as so many steps in Python, and to compile it as long
#: as so many.
_SET_UP, _COMPILED = 20, 10_000

#: Above this number of values numpy's library shares products among threads, which takes
#: milliseconds where the other cores are busy.
_MOST_MULTIPLIED = 4_096


class Steps(Protocol):
    """Makes the steps of a run, and is an iterator over the moments at which Python may look."""

    def __call__(self, run: Run) -> Iterator[None]:
        """Make the steps that are left, and count them; it ends before a row that is not finite.

        Yields:
            Nothing, when Python may look: after as many steps as are due, at the latest.

        Raises:
            ComponentFailed: by the step after them.
            Ended: a component ends the run within that step.

        """


class Stepping(NamedTuple):
    """A way to make the steps, and its name in records."""

    name: str
    steps: Steps


def step_interpreted(run: Run) -> Iterator[None]:
    """Make the steps in Python, and look after each."""
    values, shown, append = run.row.values, run.row.shown, run.blocks.append
    experiment, stages, passing = run.experiment, run.stages, run.passing
    steps = experiment.rows - 1
    is_not_finite = _watch(shown)
    for k, t, h, end in experiment.steps(run.made):
        # Converted once for all of them.
        time, length = c_double(t), c_double(h)
        if passing is not None:
            make_stages(passing, values, experiment, steps, k - 1, time, length)
            if is_not_finite():
                return
            append(t, shown)
        make_stages(stages, values, experiment, steps, k - 1, time, length)
        if passing is None:
            if is_not_finite():
                return
            append(end, shown)
        run.made = k
        yield


def _watch(values: np.ndarray) -> Callable[[], object]:
    """A function that looks whether one of some values is not finite."""
    if len(values) > _MOST_MULTIPLIED:
        return lambda: not np.isfinite(values).all()
    # Times zero, what is finite is zero and what is not is nan: the cheapest way to see it.
    return partial(np.vdot, values, np.zeros_like(values))


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
                "the compiled loop cannot step isolated FMUs: drop --loop compiled or --isolate"
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
