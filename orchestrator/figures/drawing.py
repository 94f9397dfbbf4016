"""Figures of runs, drawn into files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from tqdm import tqdm

from orchestrator.figures.layout import compose
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import FORMATS, Drawn, save
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.vehicle.signals import STANDARD, Loop, suffixes

#: Seconds before a bar appears on a terminal.
_PATIENCE = 2.0


def check_figure(kind: str) -> None:
    """Check before a run that its figure is known.

    Raises:
        InputError: it is not.

    """
    if kind not in FIGURES:
        hint = did_you_mean(kind, FIGURES) or f"; there are {', '.join(FIGURES)}"
        raise InputError(f"no figure {kind!r}{hint}")


def figure_files(kind: str, stem: str, loops: Sequence[Loop] = (STANDARD,)) -> list[str]:
    """The files that :func:`draw` may write.

    Args:
        kind: key of :data:`FIGURES`.
        stem: of their names.
        loops: of the vehicles.

    """
    return [
        f"{stem}{vehicle}{suffix}.{ending}"
        for vehicle in suffixes(loops).values()
        for suffix in FIGURES[kind]
        for ending in FORMATS
    ]


def draw(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Draw the figures of a scenario, as PNG and SVG, as far as the runs have what they show.

    Of several vehicles each has its own, together with the vehicle of that name in the other runs.

    Args:
        kind: key of :data:`FIGURES`.
        title: heading; empty where there is one beside the figure.
        runs: the run of the scenario, and those it is compared with.
        folder: to write into.
        stem: of the file names.
        stop: asked before each figure whether to leave it out.

    Returns:
        What was left out, and why.

    """
    notes: list[str] = []
    for i, (loop, vehicle) in enumerate(suffixes(runs[0].loops).items()):
        of_vehicle = [run._replace(loops=[_same(run, loop, i)]) for run in runs]
        name = ", ".join(filter(None, (title, loop.vehicle if vehicle and title else "")))
        notes += _drawn(kind, name, of_vehicle, folder, f"{stem}{vehicle}", stop)
    return notes


def _same(run: Drawn, loop: Loop, i: int) -> Loop:
    """The loop of a run that is drawn beside another's: the one of the same vehicle."""
    named = [own for own in run.loops if own.vehicle == loop.vehicle]
    return next(iter([*named, *run.loops[i : i + 1], *run.loops]))


def _drawn(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool],
) -> list[str]:
    """Draw the figures of one vehicle, and say what was left out."""
    notes: list[str] = []
    bar = tqdm(FIGURES[kind].items(), desc="drawing", delay=_PATIENCE, disable=None, leave=False)
    for suffix, rows in bar:
        if stop():
            break
        figure, left_out = compose(title, rows, runs)
        if figure is not None:
            try:
                save(figure, *(folder / f"{stem}{suffix}.{ending}" for ending in FORMATS))
                notes += left_out
            except InputError as error:
                notes.append(f"{stem}{suffix} left out: {error}")
        elif not suffix:
            return [f"no figure: the run has no {left_out[0]}"]
        else:
            notes.append(f"{stem}{suffix} left out: no {left_out[0]}")
    return notes
