"""How figures look, and what they are told of a run; nothing here needs matplotlib."""

from __future__ import annotations

import colorsys
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from typing import Any, NamedTuple

from orchestrator.cosim import Table
from orchestrator.vehicle.signals import STANDARD, Loop, Needs

#: Okabe and Ito's colours, which stay apart for colour-blind eyes, darkest first; every line
#: also has its own style, for print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
STYLES = ("-", "--", "-.", ":")
REFERENCE = "#555555"

#: Hues of more vehicles than there are colours: their lightnesses in turn, and their saturation.
_LIGHTNESSES, _SATURATION = (0.32, 0.6), 0.75

#: The hull of a vehicle, in shares of its length: distance behind the nose and radius of its rings.
RINGS = ((0, 0), (0.02, 0.04), (0.08, 0.075), (0.18, 0.09), (0.7, 0.09), (0.9, 0.05), (1, 0.02))

#: Corners of the upper fin: distance behind the nose, and height above the axis.
FIN = ((0.74, 0.05), (0.84, 0.22), (0.94, 0.22), (0.94, 0.03))

#: Width of the page [in]: two columns of a journal, and a phone still shows its letters.
FIGURE_WIDTH = 7.2

SETTINGS: Any = {
    "axes.formatter.limits": (-3, 4),
    "axes.grid": True,
    "axes.labelpad": 2.0,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": "medium",
    "agg.path.chunksize": 20_000,
    "figure.constrained_layout.use": True,
    "figure.titlesize": "large",
    "font.size": 10,
    "grid.alpha": 0.3,
    "legend.borderaxespad": 0.2,
    "legend.borderpad": 0.2,
    "legend.columnspacing": 1.0,
    "legend.fontsize": "small",
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.handletextpad": 0.5,
    "legend.title_fontsize": "medium",
    "lines.linewidth": 1.4,
    "savefig.dpi": 200,
    # Figures of the same run are the same file.
    "svg.hashsalt": "auv-fmu",
}

#: What may stand before an underscore in a heading: letters of the paper.
_GREEK = {
    **{name: name for name in ("gamma", "lambda", "omega", "phi", "psi", "rho", "sigma", "tau")},
    **{name: name for name in ("alpha", "beta", "delta", "eta", "nu", "theta", "epsilon")},
    "eps": "epsilon",
}
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_SYMBOL = re.compile(rf"(?<![\w\\.])({'|'.join(_GREEK)}|[A-Za-z])_([A-Za-z0-9]+)(?!\w)")

#: What figures are written as.
FIGURE_FORMATS = ("png", "svg")


class Drawn(NamedTuple):
    """A run in a figure.

    Attributes:
        label: that tells it from others.
        result: its rows.
        z_up: whether z is up and y west where its path is drawn (reading 16); or down, and east.
        loops: of its vehicles; the first is the one that is drawn.

    """

    label: str
    result: Table
    z_up: bool = False
    loops: Sequence[Loop] = (STANDARD,)

    @property
    def loop(self) -> Loop:
        """The loop that is drawn."""
        return self.loops[0]

    def lacks(self, needs: Callable[[Loop], Needs]) -> list[str]:
        """What of that which something needs is not there."""
        return self.result.missing(*needs(self.loop))


def vehicle_colours(n: int) -> list[str]:
    """A colour for each of n vehicles, all different; of more than seven, many are alike."""
    colours = list(COLOURS[:n])
    more = n - len(colours)
    for i in range(more):
        lightness = _LIGHTNESSES[i % len(_LIGHTNESSES)]
        rgb = colorsys.hls_to_rgb(i / more, lightness, _SATURATION)
        colours.append("#" + "".join(f"{round(255 * part):02X}" for part in rgb))
    return colours


def reference_colours(loops: Sequence[Loop]) -> list[str]:
    """The colour of each vehicle's reference: its own, or grey where several have the same."""
    followed = Counter(loop.y_d for loop in loops)
    colours = zip(loops, vehicle_colours(len(loops)), strict=True)
    return [REFERENCE if followed[loop.y_d] > 1 else colour for loop, colour in colours]


def earth_axes(z_up: bool) -> tuple[str, str, str]:
    """Titles of the axes x, y and z of a path."""
    if z_up:
        return "x north [m]", "y west [m]", "z up [m]"
    return "x north [m]", "y east [m]", "z down [m]"


def runs_with(runs: Sequence[Drawn], needs: Callable[[Loop], Needs]) -> Iterator[tuple[Drawn, str]]:
    """The runs that have what is needed, each with its own colour whichever others have."""
    for run, colour in zip(runs, cycle(COLOURS), strict=False):
        if not run.lacks(needs):
            yield run, colour


def printed_unit(unit: str) -> str:
    """A unit of FMI's as it is printed: N.m as N·m, m/s2 as m/s²."""
    text = unit.replace("s^1/2", "√s").replace(".", "·")
    return re.sub(r"(?<=[A-Za-z])\d+", lambda power: power[0].translate(_RAISED), text)


def escape_math(text: str) -> str:
    """Escape what matplotlib would take for a formula."""
    return text.replace("$", r"\$")


def heading(title: str) -> str:
    """A title whose symbols such as A_f and theta_hat are set as such, and the rest as it is."""
    return _SYMBOL.sub(_set, escape_math(title))


def _set(symbol: re.Match[str]) -> str:
    base, index = symbol.groups()
    letter = rf"\{_GREEK[base]}" if base in _GREEK else base
    return rf"$\hat{{{letter}}}$" if index == "hat" else rf"${letter}_{{{index}}}$"
