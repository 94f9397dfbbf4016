"""Figures of a study, from its runs: a study file says which."""

from orchestrator.studies.figures.drawing import draw_figures, figure_files
from orchestrator.studies.figures.entries import FigureEntry, read_figures
from orchestrator.studies.figures.values import Columns

__all__ = ["Columns", "FigureEntry", "draw_figures", "figure_files", "read_figures"]
