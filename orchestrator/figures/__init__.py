"""Figures of a run, as far as it has what they show."""

from orchestrator.figures.drawing import check_figure, draw, figure_files
from orchestrator.figures.panels import draw_commands, draw_errors
from orchestrator.figures.run_figures import FIGURES, overlay
from orchestrator.figures.style import COLOURS, SETTINGS, STYLES, Drawn, save

__all__ = [
    "COLOURS",
    "FIGURES",
    "SETTINGS",
    "STYLES",
    "Drawn",
    "check_figure",
    "draw",
    "draw_commands",
    "draw_errors",
    "figure_files",
    "overlay",
    "save",
]
