"""Checkpoints of runs that belong together: where they lie, and what they are of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from orchestrator.machine.errors import InputError
from orchestrator.master.hooks.checkpoint import (
    Checkpoints,
    check_gives_states,
    interval_in,
)
from orchestrator.runs.preparation import Prepared

#: The folder of checkpoints, within the folder of the result.
FOLDER = "checkpoint"


def checkpoints_of(
    runs: Sequence[Prepared],
    folders: Sequence[Path],
    every: float | None,
    resume: bool,
    force: bool = False,
    token: str = "",
    say: Callable[[str], None] = lambda _: None,
) -> list[Checkpoints]:
    """The checkpoints of some runs, one after the other.

    Args:
        runs: whose results go into a folder: of the first into it, of the others below it.
        folders: of their checkpoints.
        every: one for so many simulated seconds [s]; None: as often as before, if runs are resumed.
        resume: begin with those that are there.
        force: move aside what is there otherwise.
        token: random, for new ones; empty: one is drawn.
        say: takes notes for the user.

    Returns:
        None at all, if none are wanted.

    Raises:
        InputError: there is nothing to resume, or something else; or an FMU has no state.

    """
    if resume and every is None:
        every = interval_in(folders[0])
        if every is None:
            raise InputError(
                f"there is nothing to resume in {folders[0]}; a run leaves something there with "
                "--checkpoint-every"
            )
    if every is None:
        return []
    for prepared in runs:
        check_gives_states(prepared.system)
    found = [
        Checkpoints(folder, prepared.identity, every, resume, force, token)
        for folder, prepared in zip(folders, runs, strict=True)
    ]
    for checkpoints in found:
        # FMUs may change the current folder.
        checkpoints.folder = checkpoints.folder.absolute()
    times = [checkpoints.time for checkpoints in found]
    for prepared, time in zip(runs, times, strict=True):
        if time is not None:
            say(f"{prepared.scenario.name}: goes on at t = {time:g} s")
    if resume and not any(times):
        say(f"there is nothing to resume in {folders[0]}: begins at the start")
    return found


def leave(
    kept: Sequence[Checkpoints], is_whole: bool, say: Callable[[str], None] = lambda _: None
) -> None:
    """Remove checkpoints that are not needed any more, or say where they are.

    Args:
        kept: of runs that belong together.
        is_whole: whether all of these have come to their end.
        say: takes notes for the user.

    """
    # The folder with the first one's holds the others'.
    for checkpoints in reversed(kept):
        if is_whole:
            checkpoints.remove()
        elif checkpoints.time is not None:
            place = _shown(checkpoints.folder)
            say(f"--resume goes on from t = {checkpoints.time:g} s, from {place}")


def _shown(folder: Path) -> Path:
    """A folder as it is called from the current one, if that holds it."""
    with suppress(OSError, ValueError):
        return folder.relative_to(Path.cwd())
    return folder
