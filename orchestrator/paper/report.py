"""The report: all of section 4, run and compared, as Markdown and as one HTML page."""

from __future__ import annotations

import json
import platform
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import chain, count
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kinds import AUTO, KindName
from orchestrator.cosim import PortName
from orchestrator.figures.drawing import draw
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import Drawn, printed_unit
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.workers import Workers, workers
from orchestrator.paper.claims import CLAIMS
from orchestrator.paper.effects import EFFECTS, show_effect
from orchestrator.paper.kept_runs import Companion, KeptRun, KeptRuns
from orchestrator.paper.page import (
    contents,
    errata,
    escape_markdown,
    html,
    linked,
    picture,
    readings,
    table,
    values_with_units,
    without_pictures,
)
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.folder import RECORD, replace_files
from orchestrator.runs.preparation import prepare_request
from orchestrator.runs.request import Request
from orchestrator.runs.result import RECORDED_PACKAGES, Stopwatch, write_content
from orchestrator.runs.scenario import Scenario, read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.indices import metrics, of_vehicles
from orchestrator.vehicle.proof import gain_check

#: The folder of the figures.
_FIGURES = "figures"

#: The files.
_NAMES = _PAGE, _MARKDOWN = "report.html", "report.md"

#: So many runs of a claim are not named one by one; the end of the report lists all.
_MANY = 5

_TITLE = "# Section 4 reproduced"

_INTRODUCTION = """\
*Three-dimensional tracking control of autonomous underwater vehicles with limited torque and \
without velocity sensors*, simulated from FMI components. Differences from the paper are \
stated; no parameter was chosen to bring the results closer. The paper gives neither the level of \
its measurement noise nor the end times of its figures: the scenarios have ours, and all but Fig. \
4 run without noise, so that roughness in a signal comes from the controller itself. In every run \
the righting moment of roll, 5 N·m (reading 1), and the seed of any noise are also ours. The \
readings, points where the paper is silent or contradicts itself, are explained [at the \
end](#readings)."""

_WHY_NUMBERS_DIFFER = """\
Why the numbers differ: efforts and final errors depend on the end time and the noise, which are \
not given. The proposed controller's e_f moves with the phase of the waves (period 63 s) at the \
end of the run, and shrinks with eps_t, as Remark 6 says. The PD controller's e_f is some \
millimetres, up to a centimetre, for the same reason."""

_NO_VARIANTS = """\
No choice of the points that the paper leaves open gives all printed numbers together: \
`python tools/printed_table.py`, in the repository, tries every combination, and the page \
*The printed table against every reading* of the documentation has what comes of it."""

#: The parameter that decides whether a run has a twin without noise.
_NOISE = "plant.noise.std"


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
    """The sections of some scenarios, by their names or the paths of their files.

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
        label = scenario.compare.label or scenario.compare.name
        label += " (2)" * (label == scenario.legend)
        return {scenario.legend: request, label: Companion(reference, kind=kind)}
    noise, system = PortName.read(_NOISE), prepared.system
    if scenario.figure == "tracking" and system.has(noise) and system.value(noise):
        quiet = replace(request, parameters={_NOISE: 0.0})
        return {"with noise": request, "without noise": quiet}
    return {scenario.legend: request}


def draw_section(section: Section, kept_runs: Sequence[KeptRun], folder: Path) -> list[str]:
    """Draw the figures of a section and give notes on what is left out; a task for a worker."""
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
    """A section in Markdown, with notes on what its figures in the folder leave out."""
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
    by_vehicle = {
        ", ".join(filter(None, (label, vehicle))): found
        for label, kept_run in made.items()
        for vehicle, found in of_vehicles(kept_run.metrics).items()
    }
    if rows := list(_indices(list(by_vehicle.values()))):
        yield table(["index", *map(escape_markdown, by_vehicle)], rows)
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


def write_report(
    folder: Path,
    scenarios: Sequence[str],
    command: Sequence[str],
    stop_time: float | None = None,
    kind: KindName = AUTO,
    force: bool = False,
) -> tuple[Path, Path]:
    """Make all runs, and write `report.html`, `report.md` and their figures.

    Args:
        folder: to write into.
        scenarios: that have a section: names, or paths of files.
        command: for the record.
        stop_time: of all runs [s]; None: their own. For a look at the report, not at the paper.
        kind: of the bundle's FMUs in all runs.
        force: move aside files of the user's that have names of these.

    Returns:
        The two files.

    Raises:
        InputError: a scenario file has a mistake, or the folder cannot be written.
        KeyboardInterrupt: the user does not want to wait.

    """
    clock = Stopwatch()
    # Built before there are processes that would each build them.
    fmus = current_fmus(kind)
    chapters = sections(scenarios, kind)
    requests = [request for section in chapters for request in section.runs.values()]
    requests += [request for claim in CLAIMS for request in claim.runs]
    requests += [request for effect in EFFECTS for request in effect.runs]
    with replace_files(folder, (*_NAMES, RECORD), force=force) as unfinished:
        with workers() as crew:
            kept_runs = KeptRuns(requests, crew, stop_time, kind)
            notes, effects = _draw(chapters, kept_runs, unfinished, crew)
        parts = _text(chapters, kept_runs, notes, effects, command, unfinished, fmus)
        body = linked("\n\n".join(parts))
        text = f"{_TITLE}\n\n{linked(_INTRODUCTION)}\n\n{contents(body)}\n\n{body}\n"
        (unfinished / _MARKDOWN).write_text(text, encoding="utf-8")
        (unfinished / _PAGE).write_text(html(text, unfinished), encoding="utf-8")
        record = {
            "title": _TITLE.removeprefix("# "),
            "command": list(command),
            **clock.times(),
            "runs": [f"auv-fmu run {label}" for label in kept_runs.labels],
        }
        write_content(unfinished, record)
    return folder / _PAGE, folder / _MARKDOWN


def _draw(
    chapters: Sequence[Section], kept_runs: KeptRuns, folder: Path, crew: Workers
) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Draw all figures; give the notes on the sections' figures, and the texts of the effects."""
    figures = folder / _FIGURES
    figures.mkdir()
    tasks: dict[tuple[str, str], Callable[[], Any]] = {}
    for section in chapters:
        made = [kept_runs[request] for request in section.runs.values()]
        tasks["section", section.name] = partial(
            draw_section, section, made, figures / section.name
        )
    for effect in EFFECTS:
        made = [kept_runs[request] for request in effect.runs]
        tasks["effect", effect.name] = partial(show_effect, effect.name, made, figures)
    results = dict(crew.results(tasks, "figure"))
    notes = {section.name: results["section", section.name] for section in chapters}
    return notes, {effect.name: results["effect", effect.name] for effect in EFFECTS}


def _text(
    chapters: Sequence[Section],
    kept_runs: KeptRuns,
    notes: dict[str, list[str]],
    effects: dict[str, str],
    command: Sequence[str],
    folder: Path,
    fmus: Path,
) -> Iterator[str]:
    yield "## Every printed number and claim"
    yield _claims(kept_runs)
    yield _WHY_NUMBERS_DIFFER
    yield "## The printed table against every reading"
    yield _NO_VARIANTS
    yield "## Figures"
    for section in chapters:
        yield from section_text(section, kept_runs, notes[section.name], folder)
    yield "## Effects that the paper does not show"
    for effect in EFFECTS:
        yield f"### {effect.title}"
        yield effects[effect.name]
        yield "\n".join(f"- `auv-fmu run {kept_runs.label(request)}`" for request in effect.runs)
    yield "## Gain conditions"
    yield f"`auv-fmu gains`:\n\n```\n{gain_check(closed_loop(fmus))}\n```"
    yield "## What is wrong in the paper"
    yield errata()
    yield "## Readings"
    yield readings()
    yield "## Versions and commands"
    versions = ", ".join(f"{package} {version(package)}" for package in RECORDED_PACKAGES)
    yield f"Python {platform.python_version()}, {versions}. Written by `{shlex.join(command)}`."
    yield (
        "Each of these commands makes a run of this report; settings without an option are in "
        "parentheses:"
    )
    yield "```\n" + "\n".join(f"auv-fmu run {label}" for label in kept_runs.labels) + "\n```"


def _claims(kept_runs: KeptRuns) -> str:
    rows, verdicts = [], []
    for claim in CLAIMS:
        finding = claim.finding([kept_runs[request] for request in claim.runs])
        verdicts.append(finding.verdict)
        cells = [claim.title, claim.published, finding.ours, finding.verdict]
        labels = [f"`{kept_runs.label(request)}`" for request in claim.runs]
        runs = ", ".join(labels if len(labels) < _MANY else [labels[0], "...", labels[-1]])
        rows.append([cell.replace("|", "\\|") for cell in (*cells, runs)])
    return f"{counted(verdicts)}\n\n" + table(["claim", "paper", "ours", "verdict", "run"], rows)


def counted(verdicts: Sequence[str]) -> str:
    """Count the verdicts of each kind, in a sentence."""
    agree, differ = (sum(v.startswith(kind) for v in verdicts) for kind in ("agrees", "**"))
    text = f"Of {len(verdicts)} printed numbers and claims, {agree} agree and {differ} do not"
    rest = len(verdicts) - agree - differ
    return f"{text}; for the other {rest} the verdict is a ratio, ours to the printed number."
