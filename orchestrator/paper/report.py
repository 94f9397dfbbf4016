"""The report: all of section 4, run and compared, as Markdown and as one HTML page."""

from __future__ import annotations

import json
import platform
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import chain, count
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fmus.kinds import AUTO, KindName
from orchestrator.cosim import PortName, Table
from orchestrator.figures.drawing import draw
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import Drawn, printed_unit
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.identity import digest_of
from orchestrator.machine.workers import Workers, workers
from orchestrator.paper.claims import CLAIMS, CLOSE, KeptRun
from orchestrator.paper.effects import EFFECTS, show_effect
from orchestrator.paper.page import (
    VERDICT,
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
from orchestrator.runs.preparation import Prepared, prepare_request, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.result import RECORDED_PACKAGES, Stopwatch, write_content
from orchestrator.runs.scenario import Scenario, read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.indices import Metrics, metrics, of_vehicles
from orchestrator.vehicle.proof import gain_check

#: Folder of the figures, and files of the report.
_FIGURES = "figures"
_NAMES = _PAGE, _MARKDOWN = "report.html", "report.md"

#: Number of runs from which only the first and last run of a claim are named.
_MANY = 5

_TITLE = "# Section 4 reproduced"

_INTRODUCTION = """\
*Three-dimensional tracking control of autonomous underwater vehicles with limited torque and \
without velocity sensors*, simulated from FMI components. No parameter was chosen to bring the \
results closer."""

_WHAT_IS_OURS = """\
The paper gives neither the level of its measurement noise nor the end times of its figures: the \
scenarios have ours, and all but Fig. 4 run without noise, so that roughness in a signal comes \
from the controller itself. In every run the righting moment of roll, 5 N·m (reading 1), and the \
seed of any noise are also ours. The readings, points where the paper is silent or contradicts \
itself, are explained [at the end](#readings)."""

_WHY_NUMBERS_DIFFER = f"""\
A number agrees if it is within {100 * CLOSE:g} % of the printed one. Why the numbers differ: \
efforts and final errors depend on the end time and the noise, which are not given. The proposed \
controller's e_f moves with the phase of the waves (period 63 s) at the end of the run, and \
shrinks with eps_t, as Remark 6 says. The PD controller's e_f is some millimetres, up to a \
centimetre, for the same reason."""

_NO_VARIANTS = """\
No choice of the points that the paper leaves open gives all printed numbers together: \
`python tools/printed_table.py`, in the repository, tries every combination, and the page \
*The printed table against every reading* of the documentation has what comes of it."""

#: A run in which this parameter is not 0 is drawn with a second run without noise.
_NOISE = "plant.noise.std"


# Runs


@dataclass(frozen=True)
class Companion(Request):
    """The run that a scenario is compared with, as the request of the scenario."""

    @property
    def label(self) -> str:
        """Command that makes both runs."""
        return f"{super().label} (its companion)"


def make_runs(
    requests: Iterable[Request],
    pool: Workers,
    stop_time: float | None = None,
    kind: KindName = AUTO,
) -> dict[Request, KeptRun]:
    """Make runs, the longest first; equal runs, whatever their names, are made once.

    Args:
        requests: of the runs.
        pool: that makes them.
        stop_time: of all runs [s]; None: their own.
        kind: of the bundle's FMUs in all runs.

    Returns:
        The runs, with the shortest label of the requests that equal runs have.

    Raises:
        KeyboardInterrupt: there was a signal to stop.

    """
    keys: dict[Request, str] = {}
    labels: dict[str, str] = {}
    runs: dict[str, KeptRun] = {}
    to_make: dict[str, tuple[int, Request]] = {}
    for request in dict.fromkeys(requests):
        asked = replace(request, stop_time=stop_time or request.stop_time, kind=kind)
        try:
            prepared = _prepared(asked)
        except InputError as error:
            key, label = repr(request), request.label
            runs[key] = KeptRun({"failure": str(error)}, Table())
        else:
            key, label = digest_of(prepared.identity), asked.label
            to_make.setdefault(key, (prepared.experiment.rows, asked))
        keys[request] = key
        labels[key] = min(label, labels.get(key, label), key=len)
    longest_first = sorted(to_make.items(), key=lambda item: -item[1][0])
    tasks = {key: partial(_make, asked) for key, (_, asked) in longest_first}
    runs |= pool.results(tasks, "run")
    named = {key: replace(runs[key], label=label) for key, label in labels.items()}
    return {request: named[key] for request, key in keys.items()}


def _prepared(request: Request) -> Prepared:
    own = prepare_request(request)
    return with_companion(own, request)[1] if isinstance(request, Companion) else own


def _make(request: Request) -> KeptRun:
    """Make a run; a task for a worker."""
    try:
        prepared = _prepared(request)
        metrics = Metrics(prepared.loops)
        seen = VisibleRows({name for loop in prepared.loops for name in loop.drawn()})
        prepared.run([metrics, seen])
    except InputError as error:
        return KeptRun({"failure": str(error)}, Table())
    values = metrics.content(prepared.scenario.name, prepared.system)
    return KeptRun(values, Table.of(seen.header, seen.rows, seen.ending), prepared.loops)


# Sections


@dataclass(frozen=True)
class Section:
    """A scenario in the report.

    Attributes:
        name: of the folder of its figures.
        scenario: content of its file.
        runs: to draw, by label; the scenario's own run first.

    """

    name: str
    scenario: Scenario
    runs: Mapping[str, Request]

    @property
    def title(self) -> str:
        """Heading."""
        return escape_markdown(self.scenario.title or self.scenario.name)


def sections(references: Sequence[str], kind: KindName = AUTO) -> list[Section]:
    """Return the sections of scenarios, given by their names or the paths of their files.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    sections: dict[str, Section] = {}
    for reference in references:
        scenario = read_scenario(reference)
        stem = scenario.stem
        names = chain([stem], (f"{stem}-{n}" for n in count(2)))
        name = next(name for name in names if name not in sections)
        sections[name] = Section(name, scenario, _runs(reference, scenario, kind))
    return list(sections.values())


def _runs(reference: str, scenario: Scenario, kind: KindName) -> dict[str, Request]:
    """Return the run of a scenario, and its companion or the same run without noise."""
    request = Request(reference, kind=kind)
    try:
        prepared = prepare_request(request)
    except InputError:
        # The report gives the reason.
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


def draw_section(section: Section, runs: Sequence[KeptRun], folder: Path) -> list[str]:
    """Draw the figures of a section, return notes on what is left out; a task for a worker."""
    key = section.scenario.figure
    if key not in FIGURES:
        return [f"no figure: there is none of the name {key!r}{did_you_mean(key, FIGURES)}"]
    drawn = [
        Drawn(label, run.table, section.scenario.z_up, run.loops)
        for label, run in zip(section.runs, runs, strict=True)
        if len(run.table)
    ]
    if not drawn:
        return []
    folder.mkdir(parents=True)
    # The section has the heading.
    return draw(key, "", drawn, folder, section.name)


def section_text(
    section: Section, runs: Mapping[Request, KeptRun], notes: Sequence[str], folder: Path
) -> Iterator[str]:
    """Yield the parts of a section in Markdown, with notes and the figures in a folder."""
    scenario = section.scenario
    made = {label: runs[request] for label, request in section.runs.items()}
    yield f"### {section.title}"
    # Sorted by stem: `fig4` comes before `fig4-velocity`.
    files = Path(folder, _FIGURES, section.name).glob("*.png")
    for file in sorted(files, key=attrgetter("stem")):
        yield picture(section.title, file.relative_to(folder).as_posix())
    yield from (f"Note: {escape_markdown(note)}." for note in notes)
    if scenario.remark:
        yield without_pictures(scenario.remark)
    for label, run in made.items():
        if run.failure is not None:
            why = escape_markdown(run.failure)
            yield f"**The run {escape_markdown(label)} ended early:** {why}"
    by_vehicle = {
        ", ".join(filter(None, (label, vehicle))): indices
        for label, run in made.items()
        for vehicle, indices in of_vehicles(run.metrics).items()
    }
    if rows := list(_index_rows(list(by_vehicle.values()))):
        yield table(["index", *map(escape_markdown, by_vehicle)], rows)
    reaching = next(iter(made.values())).metrics.get("velocities_reaching_controller")
    if reaching is not None:
        names = ", ".join(f"`{name}`" for name in reaching) or "none"
        yield f"Velocities of the vehicle that reach the controller: {names}."
    yield "\n".join(
        f"- {escape_markdown(label)}: `auv-fmu run {run.label}`"
        + (f", until {time:g} s" if (time := run.metrics.get("stop_time")) else "")
        for label, run in made.items()
    )
    if scenario.ours:
        yield "Ours, not the paper's:"
        yield "\n".join(_ours(scenario))


def _index_rows(runs: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
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
    """Yield the values that are ours, not the paper's, with reasons."""
    values = {str(name): value for name, value in scenario.parameters.items()}
    for name, why in scenario.ours.items():
        value = values.get(name, vars(scenario).get(name))
        is_short = value is not None and not isinstance(value, Mapping)
        stated = f"{name} = {json.dumps(value, default=str)}" if is_short else name
        yield f"- `{stated}`: {escape_markdown(why)}"


# The report


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
        scenarios: of the sections: names, or paths of files.
        command: for the record.
        stop_time: of all runs [s], for a quick look; None: their own.
        kind: of the bundle's FMUs in all runs.
        force: move aside files of the user's with the same names.

    Returns:
        The two files.

    Raises:
        InputError: a scenario file has a mistake, or the folder cannot be written.
        KeyboardInterrupt: there was a signal to stop.

    """
    clock = Stopwatch()
    # Built here, so that not every worker builds them.
    fmus = current_fmus(kind)
    chapters = sections(scenarios, kind)
    requests = [request for section in chapters for request in section.runs.values()]
    requests += [request for claim in CLAIMS for request in claim.runs]
    requests += [request for effect in EFFECTS for request in effect.runs]
    with replace_files(folder, (*_NAMES, RECORD), force=force) as unfinished:
        with workers() as pool:
            runs = make_runs(requests, pool, stop_time, kind)
            notes, effects = _draw(chapters, runs, unfinished, pool)
        verdict, claims = _claims(runs)
        labels = list(dict.fromkeys(f"auv-fmu run {run.label}" for run in runs.values()))
        parts = [
            "## Every printed number and claim",
            claims,
            _WHY_NUMBERS_DIFFER,
            _WHAT_IS_OURS,
            "## The printed table against every reading",
            _NO_VARIANTS,
            "## Figures",
        ]
        for section in chapters:
            parts += section_text(section, runs, notes[section.name], unfinished)
        parts.append("## Effects that the paper does not show")
        for effect in EFFECTS:
            commands = (f"- `auv-fmu run {runs[request].label}`" for request in effect.runs)
            parts += [f"### {effect.title}", effects[effect.name], "\n".join(commands)]
        versions = ", ".join(f"{package} {version(package)}" for package in RECORDED_PACKAGES)
        parts += [
            "## Gain conditions",
            f"`auv-fmu gains`:\n\n```\n{gain_check(closed_loop(fmus))}\n```",
            "## What is wrong in the paper",
            errata(),
            "## Readings",
            readings(),
            "## Versions and commands",
            f"Python {platform.python_version()}, {versions}. Written by `{shlex.join(command)}`.",
            "Each of these commands makes a run of this report; settings without an option are in "
            "parentheses:",
            "```\n" + "\n".join(labels) + "\n```",
        ]
        start = f"{_TITLE}\n\n{verdict}\n\n{_INTRODUCTION}"
        body = linked("\n\n".join(parts))
        text = f"{start}\n\n{contents(body)}\n\n{body}\n"
        (unfinished / _MARKDOWN).write_text(text, encoding="utf-8")
        page = html(f"{start}\n\n{body}", unfinished)
        (unfinished / _PAGE).write_text(page, encoding="utf-8")
        record = {
            "title": _TITLE.removeprefix("# "),
            "command": list(command),
            **clock.times(),
            "runs": labels,
        }
        write_content(unfinished, record)
    return folder / _PAGE, folder / _MARKDOWN


def _draw(
    chapters: Sequence[Section], runs: Mapping[Request, KeptRun], folder: Path, pool: Workers
) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Draw all figures; return the notes of the sections, and the texts of the effects."""
    figures = folder / _FIGURES
    figures.mkdir()
    tasks: dict[tuple[str, str], Callable[[], Any]] = {}
    for section in chapters:
        made = [runs[request] for request in section.runs.values()]
        tasks["section", section.name] = partial(
            draw_section, section, made, figures / section.name
        )
    for effect in EFFECTS:
        made = [runs[request] for request in effect.runs]
        tasks["effect", effect.name] = partial(show_effect, effect.name, made, figures)
    results = dict(pool.results(tasks, "figure"))
    files = sorted(figures.rglob("*.png"))
    dict(pool.results({file: partial(_with_few_colours, file) for file in files}, "picture"))
    notes = {section.name: results["section", section.name] for section in chapters}
    return notes, {effect.name: results["effect", effect.name] for effect in EFFECTS}


def _with_few_colours(file: Path) -> None:
    """Store a picture with 256 colours, in 40 % of its size; a task for a worker."""
    with Image.open(file) as picture:
        few = picture.convert("RGB").quantize(dither=Image.Dither.NONE)
    few.save(file)


def _claims(kept: Mapping[Request, KeptRun]) -> tuple[str, str]:
    """Return the count of the verdicts, and the table of all claims."""
    rows, verdicts = [], []
    for claim in CLAIMS:
        runs = [kept[request] for request in claim.runs]
        finding = claim.finding(runs)
        verdicts.append(finding.verdict)
        labels = [f"`{run.label}`" for run in runs]
        listed = ", ".join(labels if len(labels) < _MANY else [labels[0], "...", labels[-1]])
        cells = [claim.title, claim.published, finding.ours, finding.verdict, listed]
        rows.append([cell.replace("|", "\\|") for cell in cells])
    return counted(verdicts), table(["claim", "paper", "ours", VERDICT, "run"], rows)


def counted(verdicts: Sequence[str]) -> str:
    """Return a sentence with the number of verdicts of each kind."""
    agree, differ = (sum(v.startswith(kind) for v in verdicts) for kind in ("agrees", "**"))
    rest = len(verdicts) - agree - differ
    return (
        f"Of {len(verdicts)} printed numbers and claims, {agree} agree and {differ} do not"
        + f"; {rest} could not be checked" * (rest > 0)
        + "."
    )
