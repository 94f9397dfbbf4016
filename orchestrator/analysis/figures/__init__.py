"""The paper's figures, as far as a run has what they show.

======================  ==============================================================
module                  what it holds
======================  ==============================================================
:mod:`.style`           colours, settings, headings, files
:mod:`.signal`          a signal over time: a line, or a band where it chatters
:mod:`.panels`          panels that several figures have: path, errors, commands
:mod:`.layout`          panels in rows; what a run lacks is left out, with a note
:mod:`.tracking`        Figs. 4 and 7
:mod:`.comparison`      Figs. 5 and 6, and several runs over each other
:mod:`.open_loop`       Fig. 3
:mod:`.drawing`         figures by the names that scenarios select them with
======================  ==============================================================
"""

from orchestrator.analysis.figures.comparison import overlay
from orchestrator.analysis.figures.drawing import FIGURES, check_figure, draw, figure_files
from orchestrator.analysis.figures.panels import draw_commands, draw_errors
from orchestrator.analysis.figures.style import COLOURS, SETTINGS, STYLES, Drawn, save

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
