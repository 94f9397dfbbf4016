"""The compiled loop: steps made by stepper.c, some hundred in one call."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from ctypes import CDLL, POINTER, c_double, c_int, c_size_t

from orchestrator.master import stepper_types as layout
from orchestrator.master.fmi.instance import CALLS
from orchestrator.master.hooks.hook import Run
from orchestrator.master.schedule import Pace, Stage

#: Longest time until Python looks whether somebody wants the run to stop [s].
_GLANCE = 0.02


def stepped(library: CDLL, run: Run) -> Iterator[None]:
    """Make the steps of a run by stepper.c, compiled: see :class:`.loop.Steps`."""
    advance = library.advance
    advance.restype = c_int
    advance.argtypes = (
        POINTER(layout.Run), c_size_t, c_size_t, c_double, POINTER(layout.Block),
        POINTER(layout.Failure),
    )  # fmt: skip
    stages, row, experiment, blocks = run.stages, run.row, run.experiment, run.blocks
    steps = experiment.rows - 1
    plan = layout.Run(
        (layout.Stage * len(stages))(*map(_laid_out, stages)),
        row.values.ctypes.data,
        len(stages),
        len(row.shown),
        experiment.start_time,
        experiment.step,
        experiment.stop_time,
        experiment.full_steps,
        steps,
    )
    block, failure = blocks.block, layout.Failure()
    outcome = layout.DUE
    while outcome == layout.DUE and run.made < steps:
        if block.n == block.most:
            blocks.hand_over()
        before = block.n
        outcome = advance(plan, run.made, min(run.due, steps), _GLANCE, block, failure)
        run.made += block.n - before
        yield
    if outcome == layout.FAILED:
        member = stages[failure.stage].members[failure.member]
        raise member.instance.failed(failure.status, CALLS[failure.call])


def _laid_out(stage: Stage) -> layout.Stage:
    gather, members = stage.gather, [member.instance.pointers() for member in stage.members]
    mappings = [_mapping(place, gather.mapped[place]) for place in sorted(gather.mapped)]
    return layout.Stage(
        *(array.ctypes.data for array in (gather.targets, gather.sources)),
        *(array.ctypes.data for array in (gather.factors, gather.offsets)),
        (layout.Mapping * len(mappings))(*mappings),
        (layout.Member * len(members))(*members),
        len(gather.targets),
        len(mappings),
        len(members),
        *(stage.pace or Pace(1)),
    )


def _mapping(place: int, pairs: Mapping[float, float]) -> layout.Mapping:
    n = len(pairs)
    return layout.Mapping(place, n, (c_double * n)(*pairs), (c_double * n)(*pairs.values()))
