"""Figures by the names that scenarios select them with, drawn into files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tqdm import tqdm

from orchestrator.figures.comparison import COMPARISON, COMPARISON_ERRORS, OVERLAY
from orchestrator.figures.layout import Rows, compose
from orchestrator.figures.open_loop import SURGE, TURN
from orchestrator.figures.style import Drawn, save
from orchestrator.figures.tracking import TRACKING
from orchestrator.machine.errors import InputError, did_you_mean

#: Rows of panels by what the names of their files end with, for each name.
FIGURES: Mapping[str, Mapping[str, Rows]] = {
    "tracking": TRACKING,
    "comparison": COMPARISON,
    "comparison-errors": COMPARISON_ERRORS,
    "overlay": OVERLAY,
    "open-loop-surge": SURGE,
    "open-loop-turn": TURN,
}

_FORMATS = ("png", "svg")

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


def figure_files(kind: str, stem: str) -> list[str]:
    """The files that :func:`draw` may write.

    Args:
        kind: key of :data:`FIGURES`.
        stem: of their names.

    """
    return [f"{stem}{suffix}.{ending}" for suffix in FIGURES[kind] for ending in _FORMATS]


def draw(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Draw the figures of a scenario, as PNG and SVG, as far as the runs have what they show.

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
    bar = tqdm(FIGURES[kind].items(), desc="drawing", delay=_PATIENCE, disable=None, leave=False)
    for suffix, rows in bar:
        if stop():
            break
        figure, left_out = compose(title, rows, runs)
        if figure is not None:
            try:
                save(figure, *(folder / f"{stem}{suffix}.{ending}" for ending in _FORMATS))
                notes += left_out
            except InputError as error:
                notes.append(f"{stem}{suffix} left out: {error}")
        elif not suffix:
            return [f"no figure: the run has no {left_out[0]}"]
        else:
            notes.append(f"{stem}{suffix} left out: no {left_out[0]}")
    return notes
