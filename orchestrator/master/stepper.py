"""The compiled loop: steps made by stepper.c, some hundred in one call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ctypes import CDLL, POINTER, c_double, c_int, c_size_t

import numpy as np

from orchestrator.master import layout
from orchestrator.master.experiment import Experiment
from orchestrator.master.observer import Blocks
from orchestrator.master.schedule import CALLS, Stage

#: Longest time until Python looks whether somebody wants the run to stop [s].
_GLANCE = 0.02


def stepped(
    library: CDLL,
    experiment: Experiment,
    stages: Sequence[Stage],
    values: np.ndarray,
    blocks: Blocks,
) -> Iterator[int]:
    """Make the steps of a run: see :class:`.loop.Steps`.

    Args:
        library: stepper.c, compiled.
        experiment, stages, values, blocks: of the run.

    """
    advance = library.advance
    advance.restype = c_int
    advance.argtypes = (
        POINTER(layout.Run), c_size_t, c_double, POINTER(layout.Block), POINTER(layout.Failure),
    )  # fmt: skip
    run = layout.Run(
        (layout.Stage * len(stages))(*map(_laid_out, stages)),
        values.ctypes.data,
        len(stages),
        len(values),
        experiment.step,
        experiment.stop_time,
        experiment.full_steps,
        experiment.rows - 1,
    )
    block, failure = blocks.block, layout.Failure()
    k, outcome = 0, layout.DUE
    while outcome == layout.DUE and k < run.steps:
        if block.n == block.most:
            blocks.hand_over()
        before = block.n
        outcome = advance(run, k, _GLANCE, block, failure)
        k += block.n - before
        yield k
    if outcome == layout.FAILED:
        member = stages[failure.stage].members[failure.member]
        raise member.instance.failed(failure.status, CALLS[failure.call])


def _laid_out(stage: Stage) -> layout.Stage:
    members = [member.instance.pointers() for member in stage.members]
    return layout.Stage(
        stage.targets.ctypes.data,
        stage.sources.ctypes.data,
        (layout.Member * len(members))(*members),
        len(stage.targets),
        len(members),
    )
