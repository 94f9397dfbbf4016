"""Sections of the report: a scenario with its figure and indices, a study with its figures."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kinds import AUTO, KindName
from orchestrator.cosim.system.names import PortName
from orchestrator.figures.drawing import draw
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import Drawn, printed_unit
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.file_names import file_name
from orchestrator.paper.kept_runs import KeptRun, KeptRuns
from orchestrator.paper.page import (
    escape_markdown,
    picture,
    table,
    values_with_units,
    without_pictures,
)
from orchestrator.runs.folder import inner_folder
from orchestrator.runs.preparation import Prepared, prepare_request, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario, read_scenario
from orchestrator.studies.study import Study, ready_studies
from orchestrator.studies.study_file import read_study
from orchestrator.studies.sweep import Means, complete_study
from orchestrator.vehicle.indices import metrics, of_vehicles

#: The parameter that decides whether a run has a twin without noise.
_NOISE = "plant.noise.std"

#: What the report says in place of studies.
_WITHOUT = (
    f"Not in this report: {', '.join(ready_studies())}, each 10,000 runs or more. "
    "`auv-fmu report --studies` makes them, or the runs that are missing."
)


@dataclass(frozen=True)
class Section:
    """A scenario in the report.

    Attributes:
        name: of its figures' folder.
        scenario: what its file says.
        runs: what is drawn, by the labels that tell them apart; its own comes first.

    """

    name: str
    scenario: Scenario
    runs: Mapping[str, Request]

    @property
    def title(self) -> str:
        """Heading."""
        return escape_markdown(self.scenario.title or self.scenario.name)


def sections(references: Sequence[str], kind: KindName = AUTO) -> list[Section]:
    """The sections of some scenarios.

    Args:
        references: names of scenarios, or paths of files.
        kind: of the bundle's FMUs in their runs.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    found: list[Section] = []
    for reference in references:
        scenario = read_scenario(reference)
        taken = {section.name for section in found}
        stem = scenario.stem
        names = chain([stem], (f"{stem}-{n}" for n in count(2)))
        name = next(name for name in names if name not in taken)
        found.append(Section(name, scenario, _runs(reference, scenario, kind)))
    return found


def _runs(reference: str, scenario: Scenario, kind: KindName) -> dict[str, Request]:
    """The run of a scenario and what it is drawn with: its companion, or its twin without noise."""
    request = Request(reference, kind=kind)
    try:
        prepared = prepare_request(request)
    except InputError:
        # The report says why it cannot be made.
        return {scenario.legend: request}
    if scenario.compare:
        [_, companion] = with_companion(prepared, request)
        label = companion.scenario.legend
        label += " (2)" * (label == scenario.legend)
        return {scenario.legend: request, label: as_request(companion, prepared, request)}
    noise, system = PortName.read(_NOISE), prepared.system
    if scenario.figure == "tracking" and system.has(noise) and system.value(noise):
        quiet = replace(request, parameters={_NOISE: 0.0})
        return {"with noise": request, "without noise": quiet}
    return {scenario.legend: request}


def as_request(prepared: Prepared, compared: Prepared, request: Request) -> Request:
    """What was prepared as the companion of a run, as the least that changes its own scenario.

    Args:
        prepared: the companion.
        compared: the run that it is drawn together with.
        request: of that run.

    Raises:
        InputError: no change of values makes it of its own scenario.

    """
    standard = Request(compared.scenario.compare, kind=request.kind)
    own = prepare_request(standard)
    here, there = (
        ({name: part.digest for name, part in one.components.items()}, {*one.connections})
        for one in (prepared.system, own.system)
    )
    if here != there:
        raise InputError(
            f"{compared.scenario.name}: compare = {standard.scenario!r}: is a scenario with other "
            "components or wires, which a report cannot show; write one that has the same"
        )
    experiment, table = prepared.experiment, prepared.input_table
    played = table.targets if table else ()
    inputs = prepared.scenario.inputs
    changed = {
        name: getattr(experiment, name)
        for name in ("stop_time", "step", "order", "coupling")
        if getattr(experiment, name) != getattr(own.experiment, name)
    }
    return replace(
        standard,
        **changed,
        parameters={
            str(name): value
            for name, value in prepared.system.parameters.items()
            if own.system.value(name) != value and name not in played
        },
        events=None if prepared.events == own.events else request.events or request.scenario,
        inputs=str(inputs.file) if inputs and inputs != own.scenario.inputs else None,
        steps={
            name: step
            for name, step in prepared.system.steps.items()
            if own.system.steps.get(name) != step
        },
    )


def draw_section(section: Section, kept_runs: Sequence[KeptRun], folder: Path) -> list[str]:
    """Draw the figures of a section and give notes on what is left out; a task for a worker.

    Args:
        section: whose figures.
        kept_runs: of the section.
        folder: to write into.

    """
    key = section.scenario.figure
    if key not in FIGURES:
        return [f"no figure: there is none of the name {key!r}{did_you_mean(key, FIGURES)}"]
    runs = [
        Drawn(label, kept_run.table, section.scenario.z_up, kept_run.loops)
        for label, kept_run in zip(section.runs, kept_runs, strict=True)
        if len(kept_run.table)
    ]
    if not runs:
        return []
    folder.mkdir(parents=True)
    # The heading of the section stands above the figure already.
    return draw(key, "", runs, folder, section.name)


def section_text(
    section: Section, kept_runs: KeptRuns, notes: Sequence[str], folder: Path
) -> Iterator[str]:
    """A section in Markdown.

    Args:
        section: to write.
        kept_runs: all that the report has.
        notes: on what its figures leave out.
        folder: of the report, in which its figures are.

    """
    scenario, own = section.scenario, kept_runs[next(iter(section.runs.values()))]
    yield f"### {section.title}"
    # By their stems: `fig4` comes before `fig4-velocity`.
    files = Path(folder, "figures", section.name).glob("*.png")
    for file in sorted(files, key=attrgetter("stem")):
        yield picture(section.title, file.relative_to(folder).as_posix())
    yield from (f"Note: {escape_markdown(note)}." for note in notes)
    if scenario.remark:
        yield without_pictures(scenario.remark)
    made = {label: kept_runs[request] for label, request in section.runs.items()}
    for label, kept_run in made.items():
        if kept_run.failure is not None:
            why = escape_markdown(kept_run.failure)
            yield f"**The run {escape_markdown(label)} ended early:** {why}"
    of = {
        ", ".join(filter(None, (label, vehicle))): found
        for label, kept_run in made.items()
        for vehicle, found in of_vehicles(kept_run.metrics).items()
    }
    if rows := list(_indices(list(of.values()))):
        yield table(["index", *map(escape_markdown, of)], rows)
    reaching = own.metrics.get("velocities_reaching_controller")
    if reaching is not None:
        names = ", ".join(f"`{name}`" for name in reaching) or "none"
        yield f"Velocities of the vehicle that reach the controller: {names}."
    yield "\n".join(
        f"- {escape_markdown(label)}: `auv-fmu run {kept_runs.label(request)}`"
        + (f", until {time:g} s" if (time := kept_runs[request].metrics.get("stop_time")) else "")
        for label, request in section.runs.items()
    )
    if scenario.ours:
        yield "Ours, not the paper's:"
        yield "\n".join(_ours(scenario))


def _indices(runs: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    for index in metrics():
        if any(index.name in values for values in runs):
            units = [printed_unit(unit) for unit in index.units.values()]
            cells = (
                values_with_units(np.atleast_1d(values[index.name]).tolist(), units)
                if index.name in values
                else ""
                for values in runs
            )
            members = f" ({index.members})" * (len(index.units) > 1)
            yield [f"{index.label}{members}", *cells]


def _ours(scenario: Scenario) -> Iterator[str]:
    """The values that are not the paper's, and why."""
    values = {str(name): value for name, value in scenario.parameters.items()}
    for name, why in scenario.ours.items():
        value = values.get(name, vars(scenario).get(name))
        is_short = value is not None and not isinstance(value, Mapping)
        stated = f"{name} = {json.dumps(value, default=str)}" if is_short else name
        yield f"- `{stated}`: {escape_markdown(why)}"


def make_studies(
    names: Sequence[str], folder: Path, kind: KindName, command: Sequence[str], force: bool = False
) -> list[Study]:
    """Make what is missing of some studies.

    Args:
        names: of ready studies, or paths of files.
        folder: in which each has a folder, from one report to the next.
        kind: of the bundle's FMUs.
        command: for the record.
        force: move aside files of the user's that are in the way.

    Raises:
        InputError: something about a study is not usable, or cannot be written.
        KeyboardInterrupt: a signal has come to stop it; what is done is kept.

    """
    studies = [read_study(name) for name in names]
    for study in studies:
        place = inner_folder(folder, study.stem)
        complete_study(study, Means(kind=kind, force=force), place, command, progress=True)
    return studies


def study_sections(studies: Sequence[Study], kept: Path, folder: Path) -> Iterator[str]:
    """A section for each study, in Markdown.

    Args:
        studies: that were made.
        kept: the folder that has their folders.
        folder: of the report, into which their figures go.

    """
    if not studies:
        yield _WITHOUT
    for study in studies:
        title = escape_markdown(study.title or study.name)
        yield f"### {title}"
        figures = Path("figures", "studies", study.stem)
        (folder / figures).mkdir(parents=True)
        for figure in study.figures:
            file = kept / study.stem / f"{file_name(figure)}.png"
            if file.is_file():
                shutil.copy(file, folder / figures)
                yield picture(f"{title}: {figure}", (figures / file.name).as_posix())
        if study.remark:
            yield without_pictures(study.remark.strip())
        yield f"- `auv-fmu sweep {study.name}`"
