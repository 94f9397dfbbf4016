"""The report: all of section 4, run and compared, as Markdown and as one HTML page."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmus.kinds import AUTO, KindName
from orchestrator.machine.workers import Workers, workers
from orchestrator.paper import printed_table
from orchestrator.paper.claims import CLAIMS
from orchestrator.paper.effects import EFFECTS, show_effect
from orchestrator.paper.kept_runs import KeptRuns
from orchestrator.paper.page import contents, errata, html, linked, readings, table
from orchestrator.paper.sections import (
    Section,
    draw_section,
    make_studies,
    section_text,
    sections,
    study_sections,
)
from orchestrator.paper.variants import all_variants
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.folder import RECORD, inner_folder, replace_files
from orchestrator.runs.record import RECORDED_PACKAGES, Stopwatch, write_content
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.proof import gain_check

#: Folders within the report's: figures, and runs that the next report can use again.
_FIGURES, _RUNS, _STUDIES = "figures", "runs", "studies"

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
No choice of the open points gives all printed numbers together: `auv-fmu table` tries every \
combination. `auv-fmu report --studies` does so for this section."""


def write_report(
    folder: Path,
    scenarios: Sequence[str],
    command: Sequence[str],
    stop_time: float | None = None,
    kind: KindName = AUTO,
    ready: Sequence[str] = (),
    variants: bool = False,
    force: bool = False,
) -> tuple[Path, Path]:
    """Run what was not run before, and write `report.html`, `report.md` and their figures.

    Args:
        folder: to write into.
        scenarios: that have a section: names, or paths of files.
        command: for the record.
        stop_time: of all runs [s]; None: their own. For a look at the report, not at the paper.
        kind: of the bundle's FMUs in all runs.
        ready: studies that have a section: names, or paths of files.
        variants: compare the printed table with every reading of the paper.
        force: move aside files of the user's that have names of these.

    Returns:
        The two files.

    Raises:
        InputError: a scenario file has a mistake, or the folder cannot be written.
        KeyboardInterrupt: the user does not want to wait; runs that are finished are kept.

    """
    clock = Stopwatch()
    # Built before there are processes that would each build them.
    fmus = current_fmus(kind)
    chapters = sections(scenarios, kind)
    kept_runs = KeptRuns(inner_folder(folder, _RUNS), stop_time, kind, force)
    made = make_studies(ready, inner_folder(folder, _STUDIES), kind, command, force)
    with replace_files(folder, (*_NAMES, RECORD), force=force) as unfinished:
        with workers() as crew:
            kept_runs.make(
                [
                    *(request for section in chapters for request in section.runs.values()),
                    *(request for claim in CLAIMS for request in claim.runs),
                    *(request for effect in EFFECTS for request in effect.runs),
                ],
                crew,
            )
            notes, effects = _draw(chapters, kept_runs, unfinished, crew)
            held = printed_table.section(all_variants(crew)) if variants else _NO_VARIANTS
        shown = list(study_sections(made, folder / _STUDIES, unfinished))
        parts = _text(chapters, kept_runs, notes, effects, command, unfinished, fmus, shown, held)
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
    kept_runs.forget_others()
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
    shown: Sequence[str],
    held: str,
) -> Iterator[str]:
    yield "## Every printed number and claim"
    yield _claims(kept_runs)
    yield _WHY_NUMBERS_DIFFER
    yield "## The printed table against every reading"
    yield held
    yield "## Figures"
    for section in chapters:
        yield from section_text(section, kept_runs, notes[section.name], folder)
    yield "## Effects that the paper does not show"
    for effect in EFFECTS:
        yield f"### {effect.title}"
        yield effects[effect.name]
        yield "\n".join(f"- `auv-fmu run {kept_runs.label(request)}`" for request in effect.runs)
    yield "## Studies of many vehicles"
    yield from shown
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
    """How many verdicts there are of each kind, in a sentence."""
    agree, differ = (sum(v.startswith(kind) for v in verdicts) for kind in ("agrees", "**"))
    text = f"Of {len(verdicts)} printed numbers and claims, {agree} agree and {differ} do not"
    rest = len(verdicts) - agree - differ
    return f"{text}; for the other {rest} the verdict is a ratio, ours to the printed number."
