"""One experiment and its files: the table as it is computed, then metrics, figures and record."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from orchestrator.analysis.cautions import cautions, cautions_after
from orchestrator.analysis.certificates import CertificatesFile
from orchestrator.analysis.figures import Drawn, draw
from orchestrator.analysis.metrics import Metrics
from orchestrator.analysis.sensors import velocities_reaching
from orchestrator.analysis.signals import CONTROLLER, THETA_HAT
from orchestrator.analysis.visible import VisibleRows
from orchestrator.errors import InputError, reason
from orchestrator.experiments.folder import place_of, publish, replaced
from orchestrator.experiments.preparation import Prepared
from orchestrator.experiments.record import Clock, write_record
from orchestrator.experiments.scenario import Scenario
from orchestrator.master.files import FORMATS
from orchestrator.master.interrupts import Interrupts, held_interrupts
from orchestrator.master.observer import Ending, Observer
from orchestrator.master.progress import Progress
from orchestrator.master.selection import Selection, check_interval, matches, matching
from orchestrator.master.simulation import simulate
from orchestrator.master.transfer import KINDS
from orchestrator.system.leftovers import process_folder
from orchestrator.system.structure import System

#: A file that keeps room for what is written last, so that a full disk does not cost the record.
_SPARE, _SPARE_BYTES = ".spare", 65536


#: Exit status of a process that a run has to end with.
_FAILED = 1


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


@dataclass
class _Done:
    """A run that has ended: its folder, what metrics.json will hold, and what figures show."""

    folder: Path
    prepared: Prepared
    metrics: dict[str, Any]
    seen: VisibleRows
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
    # The library of numpy's algebra ends the process if there is no memory for it: not later, when
    # there are rows to lose.
    np.linalg.inv(np.eye(1))
    clock = Clock()
    done: list[_Done] = []
    with (
        held_interrupts() as interrupts,
        replaced(folder, keep=lambda: bool(done)) as unfinished,
    ):
        spare = unfinished / _SPARE
        # No zeros: some file systems need no room for them.
        spare.write_bytes(os.urandom(_SPARE_BYTES))
        try:
            for prepared, columns in zip(runs, tables, strict=True):
                for caution in cautions(prepared.system, prepared.experiment):
                    say(f"warning: {prepared.scenario.name}: {caution}")
                target = unfinished / prepared.scenario.name if done else unfinished
                target.mkdir(exist_ok=True)
                run = _Running(target, prepared, files, columns)

                def give_up(run: _Running = run) -> None:
                    _give_up(run, done, unfinished, folder, command, clock, say)

                with interrupts.insistence(give_up):
                    ending = simulate(
                        prepared.system,
                        prepared.experiment,
                        run.observers,
                        prepared.isolation,
                        prepared.loop,
                        prepared.attendants(),
                    )
                done.append(run.ended(ending))
                for event in () if ending.failure else prepared.missed(ending):
                    say(f"warning: {prepared.scenario.name}: did not happen: {event}")
                for caution in cautions_after(done[-1].seen):
                    say(f"warning: {prepared.scenario.name}: {caution}")
                if interrupts:
                    break
            if files.figures and not interrupts.urgent:
                for note in _draw(runs[0].scenario, done, unfinished, interrupts):
                    say(note)
        except (OSError, MemoryError) as error:
            if not done:
                raise
            if target != done[-1].folder:
                rmtree(target)
            first, failure = done[0], f"could not be written in full: {reason(error)}"
            first.ending = replace(first.ending, failure=first.ending.failure or failure)
        if not unfinished.is_dir():
            raise InputError(
                f"{folder} was moved or deleted while it was written, and what was computed went "
                f"with it, in {unfinished.name}"
            )
        spare.unlink()
        _write_ends(done, command, clock)
        place = place_of(unfinished, folder)
    return [Finished(place, run.prepared.scenario.name, run.metrics, run.ending) for run in done]


class _Running:
    """A run and the observers of its rows."""

    def __init__(
        self, folder: Path, prepared: Prepared, files: Files, columns: Sequence[str] | None
    ) -> None:
        self._folder, self._prepared = folder, prepared
        self._metrics = Metrics()
        # Without figures the cautions alone look at what was seen.
        self._seen = VisibleRows() if files.figures else VisibleRows(THETA_HAT[:1])
        self._table = FORMATS[files.format](folder / f"result.{files.format}")
        self.observers: list[Observer] = [
            Selection(self._table, files.interval, columns),
            CertificatesFile(folder / "certificates.csv", files.interval),
            self._metrics,
            self._seen,
            Progress(prepared.scenario.name),
        ]

    def ended(self, ending: Ending) -> _Done:
        """When its observers have been told the end."""
        values = metrics_json(self._metrics, self._prepared)
        return _Done(self._folder, self._prepared, values, self._seen, ending)

    def given_up(self) -> _Done:
        """Without what else can end it."""
        ending = Ending("was ended: an FMU did not return from its step")
        self._table.end(ending)
        values = {"scenario": self._prepared.scenario.name, "failure": ending.failure}
        return _Done(self._folder, self._prepared, values, self._seen, ending)


def _give_up(
    run: _Running,
    done: Sequence[_Done],
    unfinished: Path,
    folder: Path,
    command: Sequence[str],
    clock: Clock,
    say: Callable[[str], None],
) -> None:
    """Keep what is there and end the process; the thread that steps the FMUs never will."""
    try:
        (unfinished / _SPARE).unlink()
        _write_ends([*done, last := run.given_up()], command, clock)
        place = publish(unfinished, folder)
        say(f"{last.prepared.scenario.name} {last.ending.failure}; its rows are in {place}")
        rmtree(process_folder(), ignore_errors=True)
    finally:
        os._exit(_FAILED)


def _write_ends(done: Sequence[_Done], command: Sequence[str], clock: Clock) -> None:
    """Write what is written last; the record of the first names the files of all."""
    for run in reversed(done):
        write_metrics(run.folder, run.metrics)
        write_record(run.folder, run.prepared, run.seen.header, run.ending, command, clock)


def _draw(
    scenario: Scenario, done: Sequence[_Done], folder: Path, interrupts: Interrupts
) -> list[str]:
    """Draw all figures or, where one of them cannot be written, none; notes on what is left out."""
    drawn = [Drawn(run.prepared.scenario.legend, run.seen) for run in done]
    with TemporaryDirectory(dir=folder) as temporary:
        notes = draw(
            scenario.figure,
            scenario.title,
            drawn,
            Path(temporary),
            scenario.name,
            stop=lambda: interrupts.urgent,
        )
        for figure in Path(temporary).iterdir():
            figure.rename(folder / figure.name)
    return notes


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
