"""Figures of a study, from its runs: a study file says which.

====================  ================================================================
module                what it holds
====================  ================================================================
:mod:`.values`        the runs of a study as columns; names of values in figures
:mod:`.entries`       figures as a study file has them, read and checked
:mod:`.bins`          values sorted into bins of an axis
:mod:`.panels`        panels in rows and columns, with their axes
:mod:`.bands`         a value over another one: medians, and bands around them
:mod:`.maps`          a value over two others, in colours
:mod:`.fronts`        two values against each other, with the best that can be had
:mod:`.influence`     rank correlations: what moves what
:mod:`.drawing`       all figures of a study, into files
====================  ================================================================
"""

from orchestrator.studies.figures.drawing import draw_figures, figure_files
from orchestrator.studies.figures.entries import Plan, read_figures
from orchestrator.studies.figures.values import Columns

__all__ = ["Columns", "Plan", "draw_figures", "figure_files", "read_figures"]
