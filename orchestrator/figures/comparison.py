"""Figs. 5 and 6, and several runs over each other."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from orchestrator.figures.layout import Rows, compose
from orchestrator.figures.panels import COMMANDS, ERRORS, LOGARITHMIC_ERRORS, PATH
from orchestrator.figures.style import Drawn
from orchestrator.machine.errors import InputError

#: Fig. 5.
COMPARISON: dict[str, Rows] = {"": ((PATH, COMMANDS), (ERRORS, LOGARITHMIC_ERRORS))}

#: Fig. 6: the paper leaves out the control signals.
COMPARISON_ERRORS: dict[str, Rows] = {"": ((ERRORS, LOGARITHMIC_ERRORS),)}

#: Fig. 7 in one: any number of runs.
OVERLAY: dict[str, Rows] = {"": ((ERRORS, COMMANDS),)}


def overlay(title: str, runs: Sequence[Drawn]) -> Figure:
    """Tracking errors and commands of several runs in the same panels.

    Args:
        title: heading; empty for none.
        runs: with labels that tell them apart.

    Raises:
        InputError: no run has anything to show.

    """
    figure, missing = compose(title, OVERLAY[""], runs)
    if figure is None:
        raise InputError(f"no figure: the runs have no {missing[0]}")
    return figure
