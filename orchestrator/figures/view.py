"""One page to turn a run around and play it: the paths in space, beside them signals over time."""

from __future__ import annotations

import html
import json
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from orchestrator.figures.page_scene import scene_of_one, scene_of_several
from orchestrator.figures.page_series import series_of_one, series_of_several
from orchestrator.figures.style import Drawn
from orchestrator.machine.errors import InputError

_PAGE = Path(__file__).with_name("view.html")

#: Scripts of what moves on a page of one vehicle, and on one of several.
_SCRIPTS = (_PAGE.with_name("view_one.js"), _PAGE.with_name("view_several.js"))


#: A narrow page has a choice of the vehicle in its lowest line, too.
_NARROW = (
    "\n    nav { flex-wrap: wrap; }"
    "\n    nav > #toggle { min-width: 4rem; }"
    "\n    #vehicle { max-width: 5.5rem; }"
)


def view_page(title: str, run: Drawn) -> str:
    """A page of a run that needs no other file: of its vehicle, or of all of them together.

    Args:
        title: heading.
        run: that is shown.

    Raises:
        InputError: plotly is not installed, or the run lacks the path of a vehicle.

    """
    if find_spec("plotly") is None:
        raise InputError("view needs plotly: pip install 'auv-fmu[view]'")
    for loop in run.loops:
        if missing := run.result.missing(*loop.for_control_point()):
            raise InputError(f"has no vehicle to show: no {missing[0]}")
    is_one = len(run.loops) == 1
    if is_one:
        series, notes = series_of_one(run)
        data = scene_of_one(run) | {"series": series}
        drawn = "The vehicle is drawn larger than it is"
    else:
        series, notes = series_of_several(run)
        data = scene_of_several(run) | series
        drawn = "The vehicles are drawn larger than they are, their references dashed"
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    fields = {
        "title": html.escape(title),
        "notes": html.escape("; ".join((drawn, *notes)) + "."),
        "plotly": import_module("plotly.offline").get_plotlyjs(),
        # What ends the script's element must not occur in it.
        "data": text.replace("</", "<\\/"),
        "narrow": "" if is_one else _NARROW,
        "vehicles": "" if is_one else _choice(run),
        "show": _SCRIPTS[not is_one].read_text(encoding="utf-8").rstrip(),
    }
    before, *parts = _PAGE.read_text(encoding="utf-8").split("{{")
    return before + "".join(
        fields[name] + rest for name, _, rest in (part.partition("}}") for part in parts)
    )


def _choice(run: Drawn) -> str:
    """The vehicles to choose from, of which one is shown in detail."""
    options = (
        f'<option value="{i}">{html.escape(loop.name)}</option>' for i, loop in enumerate(run.loops)
    )
    return f'\n  <select id="vehicle" aria-label="vehicle">{"".join(options)}</select>'
