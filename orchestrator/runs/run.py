"""One run and its files: the table as it is computed, then metrics, figures and record."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from orchestrator.cosim.hooks.checkpoint import Checkpoints
from orchestrator.cosim.hooks.hook import Hook
from orchestrator.cosim.hooks.timing import RealTime
from orchestrator.cosim.observers.files import TABLE_FORMATS
from orchestrator.cosim.observers.observer import (
    Ending,
    Observer,
    Progress,
    Selection,
    matches,
    matching,
)
from orchestrator.cosim.system.names import file_name
from orchestrator.cosim.system.structure import System
from orchestrator.figures.run_figures import figure_files
from orchestrator.figures.style import Drawn
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.runs.folder import (
    INCOMPLETE,
    LEDGER,
    Ledger,
    inner_folder,
    place_of,
    publish,
    replace_files,
)
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
from orchestrator.vehicle.cautions import Watch, cautions, cautions_beside, values_of
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.proof import CertificatesFile
from orchestrator.vehicle.signals import suffixes

#: A file that keeps room for the files written last, so that a full disk does not cost the record.
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
    draw: Callable[..., list[str]] | None,
) -> list[Finished]:
    """Run a scenario, and those it is compared with, and write the files of all.

    Args:
        folder: for the files of the first; the others go into folders below it.
        runs: the scenario, and those it is compared with.
        files: what to keep.
        command: for the record.
        say: takes notes for the user while it goes on.
        draw: the figures, :func:`.drawing.draw`; None: there are none.

    Raises:
        InputError: a run cannot be made, or its files cannot be written.

    """
    tables = [
        selected_columns(prepared.system, files.columns, is_companion=i > 0)
        for i, prepared in enumerate(runs)
    ]
    # The library of numpy's algebra ends the process if there is no memory for it: not later, when
    # there are rows to lose.
    np.linalg.inv(np.eye(1))
    clock = Stopwatch()
    done: list[_Running] = []
    folders = _folders(runs)
    names = _names(runs, folders)
    with (
        held_interrupts() as interrupts,
        replace_files(folder, names, force=files.force, keep=lambda: bool(done)) as path,
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
        unfinished = _Unfinished(path, folder, done, command, clock, say)
        try:
            for prepared, below, columns, checkpoints in zip_longest(runs, folders, tables, kept):
                step, loops = prepared.experiment.step, prepared.loops
                before = cautions(values_of(prepared.system), step, loops)
                unfinished.caution(prepared, (caution.text for caution in before))
                target = unfinished.begin(below)
                run = _Running(target, prepared, files, columns, checkpoints)
                unfinished.make(run, interrupts)
                if interrupts:
                    break
            if draw is not None:
                unfinished.draw(draw, interrupts)
        except (OSError, MemoryError) as error:
            unfinished.rescue(error)
        place = unfinished.finish()
    is_whole = len(done) == len(runs) and all(run.ending.failure is None for run in done)
    leave_checkpoints(kept, is_whole, say)
    return [
        Finished(place, run.prepared.scenario.name, run.metrics, run.ending, run.notes)
        for run in done
    ]


class _Running:
    """A run, the observers of its rows, and its results once it has ended."""

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
        self.watch = Watch(loops)
        # Without figures only references are compared.
        self.seen = VisibleRows(
            {name for one in loops for name in (one.y_d if files.no_figures else one.drawn())}
        )
        self._table = TABLE_FORMATS[files.format](folder / f"result.{files.format}")
        self.observers: list[Observer] = [
            Selection(self._table, files.interval, columns),
            *(
                CertificatesFile(folder / _certificates(vehicle), files.interval, loop)
                for loop, vehicle in suffixes(loops).items()
            ),
            self._metrics,
            self.watch,
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


class _Unfinished:
    """The folder that runs are made in, until its files take their places.

    A step that never returns or a full disk costs what is not written yet, not what is.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        done: list[_Running],
        command: Sequence[str],
        clock: Stopwatch,
        say: Callable[[str], None],
    ) -> None:
        """Take the path that the folder has for now, and keep room there for the record."""
        self._path, self._folder, self._done = path, folder, done
        self._command, self._clock, self._say = command, clock, say
        self._latest = path
        self._spare = path / _SPARE
        # No zeros: some file systems need no room for them.
        self._spare.write_bytes(os.urandom(_SPARE_BYTES))

    def caution(self, prepared: Prepared, said: Iterable[str]) -> None:
        """Tell the user what to be wary of in a run."""
        for caution in said:
            self._say(f"warning: {prepared.scenario.name}: {caution}")

    def begin(self, below: str) -> Path:
        """Make the folder of the next run."""
        self._latest = self._path / below
        self._latest.mkdir(exist_ok=True)
        return self._latest

    def make(self, run: _Running, interrupts: Interrupts) -> None:
        """Make a run, and tell what is to be said of it beside the first."""
        prepared = run.prepared
        with interrupts.insistence(partial(self._give_up, run)):
            ending = prepared.run(run.observers, run.hooks)
        run.end(ending)
        self._done.append(run)
        first, missed = self._done[0], [] if ending.failure else prepared.missed(ending)
        said = [f"did not happen: {event}" for event in missed]
        compared = first.prepared
        said += cautions_beside(run.seen, compared.scenario.name, first.seen, compared.loops)
        said += [caution.text for caution in run.watch.found()]
        self.caution(prepared, said)

    def draw(self, draw: Callable[..., list[str]], interrupts: Interrupts) -> None:
        """Draw all figures or, where one of them cannot be written, none."""
        first = self._done[0]
        ended_at_once = first.ending.failure is not None and len(first.seen.rows) == 1
        if interrupts.urgent or ended_at_once:
            return
        scenario = first.prepared.scenario
        drawn = [
            Drawn(run.prepared.scenario.legend, run.seen, scenario.z_up, run.prepared.loops)
            for run in self._done
        ]
        try:
            notes = draw(
                scenario.figure,
                scenario.title,
                drawn,
                self._path,
                scenario.stem,
                stop=lambda: interrupts.urgent,
            )
        except BaseException:
            for name in _figures(first.prepared):
                (self._path / name).unlink(missing_ok=True)
            raise
        for note in notes:
            self._say(note)

    def rescue(self, error: OSError | MemoryError) -> None:
        """Go on with the runs that are done, where another or the figures cannot be written."""
        if not self._done:
            raise error
        if self._latest != self._done[-1].folder and self._latest.is_dir():
            rmtree(self._latest)
        first, failure = self._done[0], f"could not be written in full: {reason(error)}"
        first.ending = replace(first.ending, failure=first.ending.failure or failure)

    def finish(self) -> Path:
        """Write what is written last, and say where all will be.

        Raises:
            InputError: the folder is gone.

        """
        if not self._path.is_dir():
            raise InputError(
                f"{self._folder} was moved or deleted while it was written, along "
                f"with the results in {self._path.name}"
            )
        self._spare.unlink()
        self._write_ends(self._done)
        return place_of(Ledger(self._folder))

    def _give_up(self, run: _Running) -> None:
        """Keep what is there and end the process; the thread that steps the FMUs never will."""
        try:
            self._spare.unlink()
            run.give_up()
            self._write_ends([*self._done, run])
            place = publish(Ledger(self._folder))
            self._say(f"{run.prepared.scenario.name} {run.ending.failure}; its rows are in {place}")
            rmtree(process_folder(), ignore_errors=True)
        except Exception as error:
            self._say(
                f"ended: an FMU did not return; its rows are in {self._path}: {reason(error)}"
            )
        finally:
            os._exit(_FAILED)

    def _write_ends(self, done: Sequence[_Running]) -> None:
        """Write what is written last; the record of the first names the files of all."""
        for run in reversed(done):
            write_metrics(run.folder, run.metrics)
            write_record(
                run.folder, run.prepared, run.seen.whole_header, run.ending, self._command,
                self._clock, run.remarks,
            )  # fmt: skip


def _figures(prepared: Prepared) -> list[str]:
    """The files of the figures of a scenario."""
    return figure_files(prepared.scenario.figure, prepared.scenario.stem, prepared.loops)


def _folders(runs: Sequence[Prepared]) -> list[str]:
    """The folder of each run, from the first one's on."""
    figures = _figures(runs[0])
    taken = [*FILES, _certificates(""), *figures, CHECKPOINTS, INCOMPLETE, LEDGER]
    return ["", *(file_name(prepared.scenario.name, taken) for prepared in runs[1:])]


def _names(runs: Sequence[Prepared], folders: Sequence[str]) -> list[str]:
    """The files that will be written, as far as they are known."""
    names = _figures(runs[0])
    for prepared, below in zip(runs, folders, strict=True):
        certificates = map(_certificates, suffixes(prepared.loops).values())
        names += [Path(below, name).as_posix() for name in (*FILES, *certificates)]
    return names


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
    ]
    if outputs:
        return names
    patterns = [pattern.strip() for pattern in wanted.split(",") if pattern.strip()]
    if not patterns:
        raise InputError("--columns: name columns, or write all or outputs")
    for name, component in system.components.items():
        for variable, why in component.left_alone.items():
            if f"{name}.{variable}" in patterns:
                raise InputError(f"--columns: {name}.{variable} {why}")
    if is_companion:
        return [name for name in names if any(matches(name, pattern) for pattern in patterns)]
    return matching(names, patterns)
