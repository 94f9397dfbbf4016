"""Colours, symbols and units of figures, and a run as figures take it; without matplotlib."""

from __future__ import annotations

import colorsys
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from orchestrator.cosim import Table
from orchestrator.vehicle.signals import STANDARD, Loop, Needs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Okabe and Ito's colours, darkest first, which the colour-blind can distinguish. For print, every
#: line also has its own style.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
STYLES = ("-", "--", "-.", ":")

#: Marks of up to four vehicles: their lines differ without colours too.
MARKS = ("o", "s", "^", "D")
REFERENCE = "#555555"

#: Alternating lightnesses, and saturation, of vehicles beyond the colours above.
_LIGHTNESSES, _SATURATION = (0.32, 0.6), 0.75

#: Rings of a vehicle's hull: distance from the nose and radius, in shares of its length.
RINGS = ((0, 0), (0.02, 0.04), (0.08, 0.075), (0.18, 0.09), (0.7, 0.09), (0.9, 0.05), (1, 0.02))

#: Corners of the upper fin: distance from the nose, and height above the axis.
FIN = ((0.74, 0.05), (0.84, 0.22), (0.94, 0.22), (0.94, 0.03))

#: Width of a figure [in]: two columns of a journal, and legible on a phone.
FIGURE_WIDTH = 7.2

#: Size of texts [pt] for which the heights of panels are given.
_TEXT = 10.0

#: Points in an inch.
_POINTS = 72.0

#: Greek letters that may come before an underscore in a heading, and their names in LaTeX.
_GREEK = {
    **{name: name for name in ("gamma", "lambda", "omega", "phi", "psi", "rho", "sigma", "tau")},
    **{name: name for name in ("alpha", "beta", "delta", "eta", "nu", "theta", "epsilon")},
    "eps": "epsilon",
}
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_SYMBOL = re.compile(rf"(?<![\w\\.])({'|'.join(_GREEK)}|[A-Za-z])_([A-Za-z0-9]+)(?!\w)")

#: Endings of the files of a figure.
FIGURE_FORMATS = ("png", "svg")


#: A style of matplotlib: a name, the path of a file, or settings.
Style: TypeAlias = str | Path | Mapping[str, Any]


@dataclass(frozen=True)
class Look:
    """The appearance of a figure.

    Attributes:
        width: of the figure [in]; None: the style's, or 7.2.
        font: family, such as `serif` or `Times New Roman`; empty: the style's.
        size: of texts [pt]; None: the style's, or 10.
        style: applied over the project's own.

    """

    width: float | None = None
    font: str = ""
    size: float | None = None
    style: Style = ""


class Drawn(NamedTuple):
    """A run in a figure.

    Attributes:
        label: in legends.
        result: its rows.
        z_up: if true, its path is drawn with z up and y west (reading 16), else down and east.
        loops: of its vehicles; figures of one vehicle show the first.
        name: of its scenario, for legends in which a run has no other label; empty: unknown.

    """

    label: str
    result: Table
    z_up: bool = False
    loops: Sequence[Loop] = (STANDARD,)
    name: str = ""

    @property
    def loop(self) -> Loop:
        """The loop to draw."""
        return self.loops[0]

    def lacks(self, needs: Callable[[Loop], Needs]) -> list[str]:
        """Return the columns and parameters of the loop that are needed and missing."""
        return self.result.missing(*needs(self.loop))


def text_scale() -> float:
    """Return the size of texts as a multiple of the usual one."""
    # A figure is being drawn: matplotlib is there.
    from matplotlib import rcParams  # noqa: PLC0415

    return float(rcParams["font.size"]) / _TEXT


def widths_of_text(figure: Figure) -> float:
    """Return the width of a figure as a multiple of the size of its texts."""
    return figure.get_figwidth() * _POINTS / (_TEXT * text_scale())


def vehicle_colours(n: int) -> list[str]:
    """Return n different colours; beyond seven, many are similar."""
    colours = list(COLOURS[:n])
    more = n - len(colours)
    for i in range(more):
        lightness = _LIGHTNESSES[i % len(_LIGHTNESSES)]
        rgb = colorsys.hls_to_rgb(i / more, lightness, _SATURATION)
        colours.append("#" + "".join(f"{round(255 * part):02X}" for part in rgb))
    return colours


def reference_colours(loops: Sequence[Loop]) -> list[str]:
    """Return the colour of each vehicle's reference: the vehicle's, or grey if several share it."""
    followed = Counter(loop.y_d for loop in loops)
    colours = zip(loops, vehicle_colours(len(loops)), strict=True)
    return [REFERENCE if followed[loop.y_d] > 1 else colour for loop, colour in colours]


def earth_axes(z_up: bool) -> tuple[str, str, str]:
    """Return the labels of the axes x, y and z of a path."""
    if z_up:
        return "x north [m]", "y west [m]", "z up [m]"
    return "x north [m]", "y east [m]", "z down [m]"


def runs_with(runs: Sequence[Drawn], needs: Callable[[Loop], Needs]) -> Iterator[tuple[Drawn, str]]:
    """Yield the runs that have what is needed; their colours do not depend on the other runs."""
    for run, colour in zip(runs, cycle(COLOURS), strict=False):
        if not run.lacks(needs):
            yield run, colour


def printed_unit(unit: str) -> str:
    """Return a unit of FMI in print: N.m as N·m, m/s2 as m/s², nothing for 1."""
    text = unit.replace("s^1/2", "√s").replace(".", "·")
    raised = re.sub(r"(?<=[A-Za-z])\d+", lambda power: power[0].translate(_RAISED), text)
    return "" if raised == "1" else raised


def escape_math(text: str) -> str:
    """Escape the dollar signs that would make matplotlib set a formula."""
    return text.replace("$", r"\$")


def heading(title: str) -> str:
    """Return a title for matplotlib with symbols such as A_f and theta_hat as formulas."""
    return _SYMBOL.sub(_formula, escape_math(title))


def _formula(symbol: re.Match[str]) -> str:
    base, index = symbol.groups()
    letter = rf"\{_GREEK[base]}" if base in _GREEK else base
    return rf"$\hat{{{letter}}}$" if index == "hat" else rf"${letter}_{{{index}}}$"
