"""One run and its files: the table as it is computed, then metrics, figures and record."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from orchestrator.figures.run_figures import draw, figure_files
from orchestrator.figures.style import Drawn
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.machine.ledger import LEDGER, Ledger
from orchestrator.master.fmi.transfer import FMI_TYPES
from orchestrator.master.hooks.checkpoint import Checkpoints
from orchestrator.master.hooks.hook import Hook
from orchestrator.master.hooks.timing import RealTime
from orchestrator.master.observers.files import TABLE_FORMATS
from orchestrator.master.observers.observer import (
    Ending,
    Observer,
    Progress,
    Selection,
    check_interval,
    matches,
    matching,
)
from orchestrator.runs.folder import INCOMPLETE, inner_folder, place_of, publish, replace_files
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.record import (
    CHECKPOINTS,
    FILES,
    Stopwatch,
    checkpoints_of,
    leave_checkpoints,
    write_metrics,
    write_record,
)
from orchestrator.runs.request import Files
from orchestrator.runs.scenario import Scenario
from orchestrator.system.names import file_name
from orchestrator.system.structure import System
from orchestrator.vehicle.cautions import cautions, cautions_after, cautions_beside, watched_columns
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.proof import CertificatesFile
from orchestrator.vehicle.signals import Loop, suffixes

#: A file that keeps room for what is written last, so that a full disk does not cost the record.
_SPARE, _SPARE_BYTES = ".spare", 65536

#: Exit status of a process that a run has to end with.
_FAILED = 1


@dataclass(frozen=True)
class Finished:
    """A run whose files are written.

    Attributes:
        folder: of its files.
        name: of the scenario.
        metrics: what metrics.json holds.
        ending: how it has ended.
        notes: what else there is to say of it, in lines.

    """

    folder: Path
    name: str
    metrics: dict[str, Any]
    ending: Ending
    notes: Sequence[str] = ()


def run_into(
    folder: Path,
    runs: Sequence[Prepared],
    files: Files,
    command: Sequence[str],
    say: Callable[[str], None],
) -> list[Finished]:
    """Run a scenario, and those it is compared with, and write the files of all.

    Args:
        folder: for the files of the first; the others go into folders below it.
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
    clock = Stopwatch()
    done: list[_Running] = []
    loops = runs[0].loops
    figures = figure_files(runs[0].scenario.figure, runs[0].scenario.stem, loops)
    folders = _folders(runs, figures)
    names = [*figures, *(Path(below, name).as_posix() for below in folders for name in FILES)]
    names += [
        Path(below, _certificates(vehicle)).as_posix()
        for prepared, below in zip(runs, folders, strict=True)
        for vehicle in suffixes(prepared.loops).values()
    ]
    with (
        held_interrupts() as interrupts,
        replace_files(folder, names, force=files.force, keep=lambda: bool(done)) as unfinished,
    ):
        kept = checkpoints_of(
            runs,
            [inner_folder(folder, CHECKPOINTS, *filter(None, [below])) for below in folders],
            files.checkpoint_every,
            files.resume,
            files.force,
            Ledger(folder).token,
            say,
        )
        spare = unfinished / _SPARE
        # No zeros: some file systems need no room for them.
        spare.write_bytes(os.urandom(_SPARE_BYTES))
        try:
            for prepared, below, columns, checkpoints in zip_longest(runs, folders, tables, kept):
                for caution in cautions(prepared.system, prepared.experiment):
                    say(f"warning: {prepared.scenario.name}: {caution}")
                target = unfinished / below
                target.mkdir(exist_ok=True)
                run = _Running(target, prepared, files, columns, checkpoints)
                give_up = partial(_give_up, run, done, unfinished, folder, command, clock, say)
                with interrupts.insistence(give_up):
                    ending = prepared.run(run.observers, run.hooks)
                run.end(ending)
                done.append(run)
                missed = [] if ending.failure else prepared.missed(ending)
                said = [f"did not happen: {event}" for event in missed]
                said += cautions_beside(run.seen, runs[0].scenario.name, done[0].seen, loops)
                said += cautions_after(run.seen, prepared.loops)
                for caution in said:
                    say(f"warning: {prepared.scenario.name}: {caution}")
                if interrupts:
                    break
            ended_at_once = done[0].ending.failure is not None and len(done[0].seen.rows) == 1
            if not files.no_figures and not interrupts.urgent and not ended_at_once:
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
    is_whole = len(done) == len(runs) and all(run.ending.failure is None for run in done)
    leave_checkpoints(kept, is_whole, say)
    return [
        Finished(place, run.prepared.scenario.name, run.metrics, run.ending, run.notes)
        for run in done
    ]


class _Running:
    """A run and the observers of its rows, and what has come of it once it has ended."""

    def __init__(
        self,
        folder: Path,
        prepared: Prepared,
        files: Files,
        columns: Sequence[str] | None,
        checkpoints: Checkpoints | None,
    ) -> None:
        self.folder, self.prepared = folder, prepared
        self.ending, self.metrics = Ending(), dict[str, Any]()
        loops = prepared.loops
        self._metrics = Metrics(loops)
        # Without figures only the cautions look at what was seen.
        seen = watched_columns if files.no_figures else Loop.drawn
        self.seen = VisibleRows({name for loop in loops for name in seen(loop)})
        self._table = TABLE_FORMATS[files.format](folder / f"result.{files.format}")
        self.observers: list[Observer] = [
            Selection(self._table, files.interval, columns),
            *(
                CertificatesFile(folder / _certificates(vehicle), files.interval, loop)
                for loop, vehicle in suffixes(loops).items()
            ),
            self._metrics,
            self.seen,
            Progress(prepared.scenario.name),
        ]
        self.hooks: list[Hook] = []
        self._real_time = None if prepared.real_time is None else RealTime(prepared.real_time)
        self._resumed_at = None
        if checkpoints is not None:
            self.observers.append(checkpoints)
            self.hooks.append(checkpoints)
            self._resumed_at = checkpoints.time
        if self._real_time is not None:
            self.hooks.append(self._real_time)

    def end(self, ending: Ending) -> None:
        """Take note of the end, of which its observers have been told."""
        self.ending = ending
        self.metrics = self._metrics.content(self.prepared.scenario.name, self.prepared.system)

    def give_up(self) -> None:
        """End it without what else can end it."""
        self.ending = Ending("was ended: an FMU did not return from its step")
        self._table.end(self.ending)
        self.metrics = {
            "scenario": self.prepared.scenario.name,
            "failure": self.ending.failure,
        }

    @property
    def remarks(self) -> dict[str, object]:
        """What else the record says."""
        return {
            **({} if self._real_time is None else {"real_time": self._real_time.record()}),
            **({} if self._resumed_at is None else {"resumed_at": self._resumed_at}),
        }

    @property
    def notes(self) -> list[str]:
        """What else the user is told, in lines."""
        return [] if self._real_time is None else [str(self._real_time)]


def _give_up(
    run: _Running,
    done: Sequence[_Running],
    unfinished: Path,
    folder: Path,
    command: Sequence[str],
    clock: Stopwatch,
    say: Callable[[str], None],
) -> None:
    """Keep what is there and end the process; the thread that steps the FMUs never will."""
    try:
        (unfinished / _SPARE).unlink()
        run.give_up()
        _write_ends([*done, run], command, clock)
        place = publish(Ledger(folder))
        say(f"{run.prepared.scenario.name} {run.ending.failure}; its rows are in {place}")
        rmtree(process_folder(), ignore_errors=True)
    except Exception as error:
        say(f"ended: an FMU did not return; its rows are in {unfinished}: {reason(error)}")
    finally:
        os._exit(_FAILED)


def _write_ends(done: Sequence[_Running], command: Sequence[str], clock: Stopwatch) -> None:
    """Write what is written last; the record of the first names the files of all."""
    for run in reversed(done):
        write_metrics(run.folder, run.metrics)
        header = run.seen.header
        write_record(run.folder, run.prepared, header, run.ending, command, clock, run.remarks)


def _draw(
    scenario: Scenario, done: Sequence[_Running], folder: Path, interrupts: Interrupts
) -> list[str]:
    """Draw all figures or, where one of them cannot be written, none; notes on what is left out."""
    drawn = [
        Drawn(run.prepared.scenario.legend, run.seen, scenario.z_up, run.prepared.loops)
        for run in done
    ]
    try:
        return draw(
            scenario.figure,
            scenario.title,
            drawn,
            folder,
            scenario.stem,
            stop=lambda: interrupts.urgent,
        )
    except BaseException:
        for name in figure_files(scenario.figure, scenario.stem, drawn[0].loops):
            (folder / name).unlink(missing_ok=True)
        raise


def _folders(runs: Sequence[Prepared], figures: Sequence[str]) -> list[str]:
    """The folder of each run, from the first one's on."""
    taken = [*FILES, _certificates(""), *figures, CHECKPOINTS, INCOMPLETE, LEDGER]
    return ["", *(file_name(prepared.scenario.name, taken) for prepared in runs[1:])]


def _certificates(vehicle: str) -> str:
    """The file of the certificates of a loop, whose name ends with what tells it from others."""
    return f"certificates{vehicle}.csv"


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
        if variable.type in FMI_TYPES
    ]
    if outputs:
        return names
    patterns = [pattern.strip() for pattern in wanted.split(",") if pattern.strip()]
    if not patterns:
        raise InputError("--columns: name columns, or write all or outputs")
    if is_companion:
        return [name for name in names if any(matches(name, pattern) for pattern in patterns)]
    return matching(names, patterns)
