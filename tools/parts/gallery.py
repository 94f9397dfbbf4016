"""The sections of docs/gallery.md, for `tools/pages.py`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from orchestrator.figures.run_figures import FLEET
from orchestrator.figures.study_values import Values
from orchestrator.machine.texts import flatten
from orchestrator.runs.scenario import Scenario, names, read_scenario
from orchestrator.studies.study import LABELS, FigureTable, Study, read_study, ready_studies

#: The pictures of the scenarios and, below it, of the studies, in docs/.
PICTURES = "images"

#: What one sees on the pictures of scenarios, by their kind of figure.
SEEN = {
    "tracking": "path, tracking errors, commands and estimated parameters",
    "comparison": "both paths, commands and tracking errors",
    FLEET: "paths, tracking errors and distances of all vehicles",
    "comparison-errors": "tracking errors of both controllers",
    "open-loop-surge": "path, surge velocity and acceleration",
    "open-loop-turn": "path, velocities and accelerations",
}

#: How many pictures are side by side.
_COLUMNS = 2


def gallery() -> dict[str, str]:
    """The scenarios and the studies."""
    return {
        "scenarios": _grid(map(_scenario, sorted(map(read_scenario, names()), key=_place))),
        "studies": _grid(map(_study, map(read_study, ready_studies()))),
    }


def picture(study: Study, figure: str) -> str:
    """The file of a study's figure, below :data:`PICTURES`."""
    return f"studies/{study.name}-{figure}.png"


def figures(study: Study) -> Iterator[str]:
    """The names of a study's figures."""
    return (name for name in study.figures if name != LABELS)


def seen(study: Study, figure: str) -> str:
    """What one sees on a study's figure, in words."""
    declared = FigureTable.model_validate(study.figures[figure])
    labels = study.figures.get(LABELS, {})

    def words(columns: str | list[str] | None) -> str:
        named = [columns] if isinstance(columns, str) else columns or []
        called = (labels.get(one) or Values({}).label(one) for one in named)
        return ", ".join(re.sub(r" \[.*\]$|[|]|\$.*\$, ", "", text) for text in called)

    x, y, show = declared.x, declared.y, declared.show
    text = {
        "bands": f"{words(show)} over {words(x)}",
        "maps": f"{words(show)} as colours over {words(x)} and {words(y)}",
        "front": f"{words(y)} against {words(x)}, and the runs that no other run beats in both",
        "influence": f"how much {words(x)} move {words(show)}",
    }[declared.kind]
    only = "".join(f", {words(key)} {value}" for key, value in flatten(declared.where or {}))
    return f"{study.title}: {text}{only}"


def _scenario(scenario: Scenario) -> str:
    alternative = SEEN[FLEET if scenario.vehicles else scenario.figure]
    file = f"{PICTURES}/{scenario.name}.png"
    return _cell(scenario.title, alternative, file, f"run {scenario.name}", scenario.name)


def _place(scenario: Scenario) -> tuple[bool, bool, str]:
    """The paper's scenarios come first, and of these the ones without a controller last."""
    name = scenario.name
    return not name.startswith("fig"), name.startswith("fig3"), name


def _study(study: Study) -> str:
    first = next(figures(study))
    settings = dict(study.parameters)
    if study.stop_time is not None and not study.stop_time.per:
        settings["stop_time"] = study.stop_time.base
    stated = [study.scenario[0], *(f"{key}={value}" for key, value in settings.items())]
    # The live page knows no stars in names.
    preset = "" if any("*" in one for one in stated) else "&".join(stated)
    alternative = seen(study, first).removeprefix(f"{study.title}: ")
    file = f"{PICTURES}/{picture(study, first)}"
    return _cell(study.title, alternative, file, f"sweep {study.name}", preset)


def _cell(title: str, alternative: str, file: str, command: str, preset: str) -> str:
    live = f" <!-- live: {preset} -->" if preset else ""
    shown = f"[![{alternative}]({file})]({file})"
    return f"{shown}<br>**{title}**<br>`auv-fmu {command}`{live}"


def _grid(cells: Iterable[str]) -> str:
    """A table of pictures."""
    left = [*cells]
    rows = [left[k : k + _COLUMNS] for k in range(0, len(left), _COLUMNS)]
    rows[-1] += [""] * (_COLUMNS - len(rows[-1]))
    return "\n".join(
        [
            f"|{' |' * _COLUMNS}",
            f"|{'---|' * _COLUMNS}",
            *(f"| {' | '.join(row)} |" for row in rows),
        ]
    )
