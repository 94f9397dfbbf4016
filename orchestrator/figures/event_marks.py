"""The events of runs in figures: numbered lines in the panels, and a list of them below."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING

from orchestrator.figures.style import Drawn, escape_math

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Of the occurrences in a run, so many are marked, and of one event, so many are listed.
_MOST_MARKS, _MOST_TIMES = 20, 4

#: Numbers nearer to each other than this share of the time stand above each other, so far [pt].
_NEAR, _RISE = 0.04, 13

#: Letters in a line of the list, and its height [in].
_LETTERS, _LINE = 104, 0.16


def mark_events(panels: Sequence[Axes], runs: Sequence[Drawn]) -> None:
    """Lines where an event has begun or ended; below the first panel its number in the list."""
    spans = _events(runs)
    times = sorted({(start, i) for i, found in enumerate(spans.values(), 1) for start, *_ in found})
    for time in {time for found in spans.values() for span in found for time in span}:
        for axes in panels:
            axes.axvline(time, color="0.35", linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1)
    start, end = panels[0].get_xlim()
    last: list[float] = []
    for time, number in times:
        row = next(
            (k for k, other in enumerate(last) if time - other > _NEAR * (end - start)),
            len(last),
        )
        last[row : row + 1] = [time]
        panels[0].annotate(
            str(number), (time, 0), xycoords=panels[0].get_xaxis_transform(),
            xytext=(0, row * _RISE), textcoords="offset points",
            ha="center", va="center", fontsize="x-small",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "0.35"},
        )  # fmt: skip


def list_events(figure: Figure, runs: Sequence[Drawn], grow: bool = True) -> None:
    """List the events of some runs below a figure, by the numbers that they have in its panels.

    Args:
        figure: whose panels have these numbers.
        runs: that are drawn.
        grow: make the figure higher, so that its panels keep their height.

    """
    lines = [f"{i}: {_listed(label, runs)}" for i, label in enumerate(_events(runs), 1)]
    if not lines:
        return
    text = textwrap.fill("; ".join(lines), _LETTERS)
    if grow:
        figure.set_figheight(figure.get_figheight() + _LINE * (2 + text.count("\n")))
    figure.supxlabel(escape_math(text), x=0.01, ha="left", fontsize="small")


def _listed(label: str, runs: Sequence[Drawn]) -> str:
    """What an event is, when it began and ended, and, of several runs, in which."""
    found = {run.label: _spans(run).get(label, []) for run in runs}
    if len({*map(tuple, found.values())}) == 1:
        return f"{label}, {_in_words(found[runs[0].label])}"
    times = (f"{_in_words(spans)} ({run})" for run, spans in found.items() if spans)
    return f"{label}, {', '.join(times)}"


def _in_words(spans: Sequence[tuple[float, ...]]) -> str:
    words = [" to ".join(f"{time:.5g}" for time in span) + " s" for span in spans[:_MOST_TIMES]]
    return ", ".join([*words, *["..."] * (len(spans) > _MOST_TIMES)])


def _events(runs: Sequence[Drawn]) -> dict[str, set[tuple[float, ...]]]:
    """When each event has begun, and ended, in any of some runs; the first one comes first."""
    found: dict[str, set[tuple[float, ...]]] = {}
    for run in runs:
        for label, spans in _spans(run).items():
            found.setdefault(label, set()).update(spans)
    return dict(sorted(found.items(), key=lambda one: min(one[1])))


def _spans(run: Drawn) -> dict[str, list[tuple[float, ...]]]:
    """When each event of a run has begun, and ended, if it has."""
    occurrences = run.result.ending.events
    found: dict[str, list[tuple[float, ...]]] = {}
    for i, one in enumerate(occurrences[:_MOST_MARKS], start=1):
        if one.label:
            ends = (
                other.time
                for other in occurrences[i:]
                if not other.label and other.event == one.event
            )
            found.setdefault(one.label, []).append((one.time, *islice(ends, 1)))
    return found
