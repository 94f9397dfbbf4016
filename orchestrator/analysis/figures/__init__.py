"""The paper's figures, and what they are put together from."""

from orchestrator.analysis.figures.panels import (
    COLOURS,
    FIGURES,
    SETTINGS,
    STYLES,
    Drawn,
    draw,
    draw_commands,
    draw_errors,
    draw_path,
    missing_for,
    save,
)

__all__ = [
    "COLOURS",
    "FIGURES",
    "SETTINGS",
    "STYLES",
    "Drawn",
    "draw",
    "draw_commands",
    "draw_errors",
    "draw_path",
    "missing_for",
    "save",
]
