"""Figures of a study, from its runs: a study file says which."""

from orchestrator.studies.figures.figure_entries import FigureEntry, read_figures
from orchestrator.studies.figures.study_data import Columns
from orchestrator.studies.figures.study_drawing import draw_figures, figure_files

__all__ = ["Columns", "FigureEntry", "draw_figures", "figure_files", "read_figures"]
