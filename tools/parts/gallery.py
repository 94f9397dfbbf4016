"""The sections of docs/gallery.md, for `tools/pages.py`."""

from __future__ import annotations

import re
from collections.abc import Iterator

from orchestrator.figures.run_figures import FLEET
from orchestrator.figures.study_values import Values
from orchestrator.machine.schema import flatten
from orchestrator.runs.scenario import Scenario, names, read_scenario
from orchestrator.studies.study import Study, ready_studies
from orchestrator.studies.study_file import LABELS, FigureTable, read_study

#: The pictures of the scenarios and, below it, of the studies, in docs/.
PICTURES = "images"

#: What one sees on the pictures of scenarios, by their kind of figure.
SEEN = {
    "tracking": "path of the vehicle and its reference in space; over time the tracking errors, "
    "the commands and their limits, and the estimated parameters",
    "comparison": "paths of both vehicles and their reference in space; over time the commands and "
    "their limits, and the tracking errors, also on a logarithmic scale",
    FLEET: "paths of all vehicles and their references in space, and from above; over time the "
    "sizes of their tracking errors, and the distances between them",
    "comparison-errors": "tracking errors of both controllers over time, also on a logarithmic "
    "scale",
    "open-loop-surge": "path of the vehicle in space; over time its surge velocity and "
    "acceleration",
    "open-loop-turn": "path of the vehicle in space and from above; over time its linear and "
    "angular velocities and accelerations",
}


def gallery() -> dict[str, str]:
    """The scenarios and the studies."""
    return {
        "scenarios": "\n\n".join(map(_scenario, sorted(map(read_scenario, names()), key=_place))),
        "studies": "\n\n".join(map(_study, map(read_study, ready_studies()))),
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
    title = scenario.title
    figure = FLEET if scenario.vehicles else scenario.figure
    shown = f"{title}: {SEEN[figure]}", f"{PICTURES}/{scenario.name}.png"
    command = f"run {scenario.name}"
    return _entry(title, shown, _sentence(scenario.remark), command, scenario.name)


def _place(scenario: Scenario) -> tuple[bool, str]:
    """The paper's scenarios come first."""
    return not scenario.name.startswith("fig"), scenario.name


def _study(study: Study) -> str:
    first = next(figures(study))
    settings = dict(study.parameters)
    if study.stop_time is not None and not study.stop_time.per:
        settings["stop_time"] = study.stop_time.base
    stated = [study.scenario[0], *(f"{key}={value}" for key, value in settings.items())]
    # The live page knows no stars in names.
    preset = "" if any("*" in one for one in stated) else "&".join(stated)
    return _entry(
        study.title,
        (seen(study, first), f"{PICTURES}/{picture(study, first)}"),
        _sentence(study.remark),
        f"sweep {study.name}",
        preset,
    )


def _entry(title: str, shown: tuple[str, str], sentence: str, command: str, preset: str) -> str:
    words, file = shown
    live = f"\n\n<!-- live: {preset} -->" if preset else ""
    return f"### {title}\n\n[![{words}]({file})]({file})\n\n{sentence}\n\n`auv-fmu {command}`{live}"


def _sentence(remark: str) -> str:
    """The first sentence."""
    text = " ".join(remark.removeprefix("\n").split()).removeprefix("Not in the paper: ")
    first = re.split(r"(?<=\.)\s+(?=[A-Z])", text)[0]
    return first[:1].upper() + first[1:]
