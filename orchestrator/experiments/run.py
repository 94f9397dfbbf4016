"""One experiment and its files: the table as it is computed, then metrics, figures and record."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from orchestrator.analysis.cautions import cautions, cautions_after
from orchestrator.analysis.certificates import CertificatesFile
from orchestrator.analysis.figures import Drawn, draw
from orchestrator.analysis.metrics import Metrics
from orchestrator.analysis.sensors import velocities_reaching
from orchestrator.analysis.signals import CONTROLLER, THETA_HAT
from orchestrator.analysis.visible import VisibleRows
from orchestrator.errors import InputError
from orchestrator.experiments.folder import place_of, replaced
from orchestrator.experiments.preparation import Prepared
from orchestrator.experiments.record import write_record
from orchestrator.master.files import FORMATS
from orchestrator.master.interrupts import Interrupts, held_interrupts
from orchestrator.master.observer import Ending, Observer
from orchestrator.master.progress import Progress
from orchestrator.master.selection import Selection, check_interval, matches, matching
from orchestrator.master.simulation import simulate
from orchestrator.master.transfer import KINDS
from orchestrator.system.structure import System


@dataclass(frozen=True)
class Files:
    """What is kept of a run.

    Attributes:
        interval: of the rows in the table [s]; None: every step.
        columns: of the table: `all`, `outputs`, or patterns with commas between them.
        format: of the table, a key of :data:`orchestrator.master.files.FORMATS`.
        figures: whether to draw them.

    """

    interval: float | None = None
    columns: str = "all"
    format: str = "csv"
    figures: bool = True


@dataclass(frozen=True)
class Finished:
    """A run whose files are written: where, what metrics.json holds, and how it has ended."""

    folder: Path
    name: str
    metrics: dict[str, Any]
    ending: Ending


def run_into(
    folder: Path,
    runs: Sequence[Prepared],
    files: Files,
    command: Sequence[str],
    say: Callable[[str], None],
) -> list[Finished]:
    """Run a scenario, and those it is compared with, and write the files of all.

    Args:
        folder: for the files of the first; those of the others go into folders below it.
        runs: the scenario, and those it is compared with.
        files: what to keep.
        command: for the record.
        say: takes notes for the user while it goes on.

    Raises:
        InputError: a run cannot be made, or its files cannot be written.

    """
    if files.interval is not None:
        check_interval(files.interval)
    tables = [
        selected_columns(prepared.system, files.columns, is_companion=i > 0)
        for i, prepared in enumerate(runs)
    ]
    started = datetime.now(UTC)
    with (
        held_interrupts(_answer) as interrupts,
        replaced(folder) as unfinished,
    ):
        done: list[tuple[Path, Prepared, Finished, VisibleRows]] = []
        for prepared, columns in zip(runs, tables, strict=True):
            for caution in cautions(prepared.system, prepared.experiment):
                say(f"warning: {prepared.scenario.name}: {caution}")
            target = unfinished / prepared.scenario.name if done else unfinished
            target.mkdir(exist_ok=True)
            done.append((target, prepared, *_run(target, prepared, files, columns)))
            for caution in cautions_after(done[-1][-1]):
                say(f"warning: {prepared.scenario.name}: {caution}")
            if interrupts:
                break
        if files.figures and not interrupts.urgent:
            scenario = runs[0].scenario
            drawn = [Drawn(run.scenario.legend, seen) for _, run, _, seen in done]
            for note in draw(
                scenario.figure,
                scenario.title,
                drawn,
                unfinished,
                scenario.name,
                stop=lambda: interrupts.urgent,
            ):
                say(note)
        # The record of the first names the files of all, so it comes last.
        for target, prepared, finished, seen in reversed(done):
            write_record(target, prepared, seen.header, finished.ending, command, started)
        place = place_of(unfinished, folder)
        return [replace(finished, folder=place) for _, _, finished, _ in done]


def _answer(interrupts: Interrupts) -> None:
    """Tell the user at once what happens now, from within the handler of the signal."""
    text = "stopping: writing what was computed and drawing it; once more leaves the figures out"
    if interrupts.urgent:
        text = "stopping at once: what was computed is kept, figures are left out"
    # print could have been interrupted itself, and must not be entered a second time.
    with suppress(OSError):
        os.write(2, f"auv-fmu: {text}\n".encode())


def _run(
    folder: Path, prepared: Prepared, files: Files, columns: Sequence[str] | None
) -> tuple[Finished, VisibleRows]:
    scenario, system = prepared.scenario, prepared.system
    metrics = Metrics()
    # Without figures the cautions alone look at what was seen.
    seen = VisibleRows() if files.figures else VisibleRows(THETA_HAT[:1])
    table = FORMATS[files.format](folder / f"result.{files.format}")
    observers: list[Observer] = [
        Selection(table, files.interval, columns),
        CertificatesFile(folder / "certificates.csv", files.interval),
        metrics,
        seen,
        Progress(scenario.name),
    ]
    ending = simulate(system, prepared.experiment, observers, prepared.isolation)
    values = metrics_json(metrics, prepared)
    write_metrics(folder, values)
    return Finished(folder, scenario.name, values, ending), seen


def metrics_json(metrics: Metrics, prepared: Prepared) -> dict[str, Any]:
    """What metrics.json holds of a run."""
    values = metrics.values(prepared.scenario.name, prepared.system)
    if CONTROLLER in prepared.system.components:
        values["velocities_reaching_controller"] = velocities_reaching(prepared.system)
    return values


def write_metrics(folder: Path, values: dict[str, Any]) -> None:
    """Write metrics.json into a folder."""
    (folder / "metrics.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")


def selected_columns(system: System, wanted: str, is_companion: bool = False) -> list[str] | None:
    """The columns of a table.

    Args:
        system: that is run.
        wanted: `all`, `outputs`, or patterns with commas between them.
        is_companion: whether patterns may match nothing, because they are meant for another run.

    Raises:
        InputError: a pattern matches no column.

    """
    if wanted == "all":
        return None
    outputs = wanted == "outputs"
    names = [
        f"{component.name}.{variable.name}"
        for component in system.components.values()
        for causality in (("output",) if outputs else ("input", "output"))
        for variable in component.having(causality)
        if variable.type in KINDS
    ]
    if outputs:
        return names
    patterns = [pattern.strip() for pattern in wanted.split(",") if pattern.strip()]
    if not patterns:
        raise InputError("--columns: name columns, or write all or outputs")
    if is_companion:
        return [name for name in names if any(matches(name, pattern) for pattern in patterns)]
    return matching(names, patterns)
