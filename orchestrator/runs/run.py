"""Making runs: `simulate` in memory, `run_into` into a folder; checkpoints of both."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from orchestrator.cosim import (
    Checkpoints,
    Ending,
    Hook,
    Observer,
    RealTime,
    Selection,
    System,
    TableFile,
)
from orchestrator.figures.run_figures import figure_files
from orchestrator.figures.style import Drawn
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.disk import file_name, process_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.machine.texts import matches, matching
from orchestrator.runs.folder import (
    INCOMPLETE,
    LEDGER,
    Ledger,
    inner_folder,
    locked_folder,
    place_of,
    publish,
    replace_files,
)
from orchestrator.runs.preparation import (
    Prepared,
    prepare_options,
)
from orchestrator.runs.progress import Progress
from orchestrator.runs.request import (
    Files,
    SimulateOptions,
    takes_keywords,
)
from orchestrator.runs.result import FILES, Result, Stopwatch, write_record
from orchestrator.vehicle.cautions import (
    Watch,
    cautions,
    cautions_beside,
    follows_vehicle,
    values_of,
)
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.proof import CertificatesFile
from orchestrator.vehicle.signals import suffixes

#: The folder of checkpoints, within the folder of the result.
CHECKPOINTS = "checkpoint"

#: A file that reserves room for the files written last, so that a full disk does not cost the
#: record.
_SPARE, _SPARE_BYTES = ".spare", 65536

#: Exit status of a process that a run has to end.
_FAILED = 1


# Runs in memory


@takes_keywords(SimulateOptions)
def simulate(options: SimulateOptions) -> Result:
    """Run a scenario, an SSP or a system.

        result = simulate("fig4", {"controller.eps_t": 10.0}, stop_time=50.0)
        result["plant.eta.x"], result.metrics(), result.plot("plant.tau.*")

    Args:
        {arguments}

    Returns:
        The computed rows: all of them, or the rows before a failure, which `Result.failure` then
        describes.

    Raises:
        ValueError: a name, a value or a file is not usable; the message says what to change.
        KeyboardInterrupt: Ctrl-C, after the current step.

    """
    prepared = prepare_options(options)
    scenario = prepared.scenario
    result = Result(scenario, prepared.loops, prepared)
    observers: list[Observer] = [result, *([Progress(scenario.name)] * options.progress)]
    with _checkpoints_for(prepared, options) as all_checkpoints:
        result.resumed_at = next((checkpoints.time for checkpoints in all_checkpoints), None)
        ending = prepared.run([*observers, *all_checkpoints], all_checkpoints)
        leave_checkpoints(all_checkpoints, ending.failure is None)
    for number in ending.interrupts:
        # Held back while the FMUs computed; now it acts as usual.
        signal.raise_signal(number)
    return result


@contextmanager
def _checkpoints_for(
    prepared: Prepared, options: SimulateOptions
) -> Iterator[Sequence[Checkpoints]]:
    """Provide the checkpoints that the options ask for, in a folder locked against other runs."""
    folder, every, resume = options.checkpoint, options.checkpoint_every, options.resume
    if folder is None and every is None and not resume:
        yield ()
        return
    if folder is None or (every is None and not resume):
        raise InputError("checkpoints need checkpoint=, and checkpoint_every= or resume=")
    place = Path(folder)
    with locked_folder(place):
        yield checkpoints_of([prepared], [place], every, resume)
    with suppress(OSError):
        # Fails if it is not empty. The lock was in it when the checkpoint was removed.
        place.rmdir()


# Runs into a folder


class WrittenRun:
    """A run whose rows are written into files.

    Attributes:
        name: of its scenario.
        prepared: the run.
        folder: of its files, until they are published.
        ending: how it has ended.
        metrics: content of metrics.json.
        verdict: a line on it; empty if it failed, or has no reference and no limits.

    """

    def __init__(
        self,
        folder: Path,
        prepared: Prepared,
        files: Files,
        columns: Sequence[str] | None,
        checkpoints: Checkpoints | None,
    ) -> None:
        """Open the files in a folder.

        Args:
            folder: of the files.
            prepared: the run.
            files: options of the files.
            columns: of its table; None: all.
            checkpoints: to write and to continue from; None: there are none.

        """
        self.folder, self.prepared, loops = folder, prepared, prepared.loops
        self.name, self.ending, self.metrics = prepared.scenario.name, Ending(), dict[str, Any]()
        # Without figures only references are compared.
        seen = [name for loop in loops for name in (loop.y_d if files.no_figures else loop.drawn())]
        self.seen = VisibleRows({*seen} if prepared.vehicles else {*self.outputs})
        self.verdict = ""
        self._watch, self._metrics = Watch(loops), Metrics(loops)
        self._table = TableFile.at(folder / f"result.{files.format}")
        self._real_time = None if files.real_time is None else RealTime(files.real_time)
        self._resumed_at = checkpoints and checkpoints.time
        self._hooks: list[Hook] = [hook for hook in (checkpoints, self._real_time) if hook]
        self._observers: list[Observer] = [
            Selection(self._table, files.interval, columns),
            *(
                CertificatesFile(folder / _certificates(vehicle), files.interval, loop)
                for loop, vehicle in suffixes(loops).items()
            ),
            self._metrics,
            self._watch,
            self.seen,
            Progress(self.name),
            *([checkpoints] if checkpoints else []),
        ]

    def make(self) -> None:
        """Step it to its end."""
        self.ending = self.prepared.run(self._observers, self._hooks)
        self.metrics = self._metrics.content(self.name, self.prepared.system)
        if self.ending.failure is None:
            self.verdict = self._metrics.verdict()

    @property
    def outputs(self) -> list[str]:
        """Columns of the outputs of all components."""
        return outputs_of(self.prepared.system)

    def give_up(self) -> None:
        """End it from another thread, while an FMU does not return."""
        self.ending = Ending("was ended: an FMU did not return from its step")
        self._table.end(self.ending)
        self.metrics = {"scenario": self.name, "failure": self.ending.failure}

    def warnings(self, first: WrittenRun) -> Iterator[str]:
        """Warn of its events and rows; `first` is the run that it is compared with."""
        if not self.ending.failure:
            yield from (f"did not happen: {event}" for event in self.prepared.missed(self.ending))
        system = first.prepared.system
        loops = [loop for loop in first.prepared.loops if not follows_vehicle(system, loop)]
        yield from cautions_beside(self.seen, first.name, first.seen, loops)
        yield from (caution.text for caution in self._watch.found())

    def write_ends(self, command: Sequence[str], clock: Stopwatch) -> None:
        """Write metrics.json, and the record of all files in its folder."""
        remarks: dict[str, object] = {}
        if self._real_time is not None:
            remarks["real_time"] = self._real_time.record()
        if self._resumed_at is not None:
            remarks["resumed_at"] = self._resumed_at
        write_record(
            self.folder,
            self.prepared,
            self.seen.whole_header,
            self.ending,
            self.metrics,
            command,
            clock,
            remarks,
        )

    @property
    def notes(self) -> list[str]:
        """Lines for the user."""
        return [] if self._real_time is None else [str(self._real_time)]


def run_into(
    folder: Path,
    runs: Sequence[Prepared],
    files: Files,
    command: Sequence[str],
    say: Callable[[str], None],
    draw: Callable[..., list[str]] | None,
) -> tuple[Path, list[WrittenRun]]:
    """Run a scenario and the one that it is compared with, and write the files of both.

    Args:
        folder: of the files of the first; the others go into folders below it.
        runs: the scenario, and the compared one, if there is one.
        files: the files to write.
        command: for the record.
        say: takes notes for the user during the run.
        draw: the figures, :func:`.drawing.draw`; None: there are none.

    Returns:
        The folder of the files, which is another one if a run failed and `folder` holds an earlier
        result; the runs.

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
    below, names = _places(runs)
    done: list[WrittenRun] = []
    with (
        held_interrupts() as interrupts,
        replace_files(folder, names, force=files.force, keep=lambda: bool(done)) as staging,
    ):
        all_checkpoints = checkpoints_of(
            runs,
            [inner_folder(folder, CHECKPOINTS, *filter(None, [name])) for name in below],
            files.checkpoint_every,
            files.resume,
            files.force,
            Ledger(folder).token,
            say,
        )
        clock, spare = Stopwatch(), staging / _SPARE
        # No zeros: some file systems need no room for them.
        spare.write_bytes(os.urandom(_SPARE_BYTES))

        def give_up(run: WrittenRun) -> None:
            """Keep the rows so far and end the process: the thread of the FMUs never will."""
            try:
                spare.unlink()
                run.give_up()
                _write_ends([*done, run], command, clock)
                place = publish(Ledger(folder))
                say(f"{run.name} {run.ending.failure}; its rows are in {place}")
                rmtree(process_folder(), ignore_errors=True)
            except Exception as error:
                say(f"ended: an FMU did not return; its rows are in {staging}: {reason(error)}")
            finally:
                os._exit(_FAILED)

        latest = staging
        try:
            for prepared, name, columns, checkpoints in zip_longest(
                runs, below, tables, all_checkpoints
            ):
                for caution in cautions(
                    values_of(prepared.system), prepared.experiment.step, prepared.loops
                ):
                    say(f"warning: {prepared.scenario.name}: {caution.text}")
                latest = staging / name
                latest.mkdir(exist_ok=True)
                run = WrittenRun(latest, prepared, files, columns, checkpoints)
                with interrupts.insistence(partial(give_up, run)):
                    run.make()
                done.append(run)
                for text in run.warnings(done[0]):
                    say(f"warning: {run.name}: {text}")
                if interrupts:
                    break
            if draw is not None:
                _draw(draw, done, staging, interrupts, say)
        except (OSError, MemoryError) as error:
            # The runs that are done are written without the other, or without figures.
            if not done:
                raise
            if latest != done[-1].folder and latest.is_dir():
                rmtree(latest)
            failure = done[0].ending.failure or f"could not be written in full: {reason(error)}"
            done[0].ending = replace(done[0].ending, failure=failure)
        if not staging.is_dir():
            raise InputError(
                f"{folder} was moved or deleted while it was written, along with the results in "
                f"{staging.name}"
            )
        spare.unlink()
        _write_ends(done, command, clock)
        place = place_of(Ledger(folder))
    # The second run is missing after an interrupt.
    leave_checkpoints(
        all_checkpoints, [run.ending.failure for run in done] == [None] * len(runs), say
    )
    return place, done


def _write_ends(runs: Sequence[WrittenRun], command: Sequence[str], clock: Stopwatch) -> None:
    """Write the records of runs: the one of the first, which names all files, comes last."""
    for run in reversed(runs):
        run.write_ends(command, clock)


def _draw(
    draw: Callable[..., list[str]],
    done: Sequence[WrittenRun],
    folder: Path,
    interrupts: Interrupts,
    say: Callable[[str], None],
) -> None:
    """Draw all figures or, if one of them cannot be written, none."""
    first, scenario = done[0], done[0].prepared.scenario
    ended_at_once = first.ending.failure is not None and len(first.seen.rows) == 1
    if interrupts.urgent or ended_at_once:
        return
    drawn = [
        Drawn(run.prepared.scenario.legend, run.seen, scenario.z_up, run.prepared.vehicles)
        for run in done
    ]
    try:
        notes = draw(
            scenario.figure,
            scenario.title,
            drawn,
            folder,
            scenario.stem,
            stop=lambda: interrupts.urgent,
        )
    except BaseException:
        for name in _figures(first.prepared):
            (folder / name).unlink(missing_ok=True)
        raise
    for note in notes:
        say(note)


def _figures(prepared: Prepared) -> list[str]:
    """Files of the figures of a scenario."""
    return figure_files(prepared.scenario.figure, prepared.scenario.stem, prepared.vehicles)


def first_figure(folder: Path, prepared: Prepared) -> Path | None:
    """Return the first figure of a run in its folder; None: there is no figure."""
    paths = (folder / name for name in _figures(prepared))
    return next((path for path in paths if path.is_file()), None)


def _places(runs: Sequence[Prepared]) -> tuple[list[str], list[str]]:
    """Name the folder of each run below the first, and all files that are known before."""
    files = _figures(runs[0])
    taken = [*FILES, _certificates(""), *files, CHECKPOINTS, INCOMPLETE, LEDGER]
    below = ["", *(file_name(prepared.scenario.name, taken) for prepared in runs[1:])]
    for prepared, name in zip(runs, below, strict=True):
        certificates = map(_certificates, suffixes(prepared.loops).values())
        files += [Path(name, file).as_posix() for file in (*FILES, *certificates)]
    return below, files


def _certificates(vehicle: str) -> str:
    """File of the certificates of a loop, by the suffix that names its vehicle."""
    return f"certificates{vehicle}.csv"


def selected_columns(system: System, choice: str, is_companion: bool = False) -> list[str] | None:
    """Choose the columns of a table by `all`, `outputs`, or patterns with commas between them.

    Args:
        system: the system of the run.
        choice: `all`, `outputs`, or the patterns.
        is_companion: True if patterns may match nothing, because another run has the columns.

    Returns:
        Their names; None: all.

    Raises:
        InputError: a pattern matches no column.

    """
    if choice == "all":
        return None
    if choice == "outputs":
        return outputs_of(system)
    names = [*map(str, system.columns())]
    patterns = [pattern.strip() for pattern in choice.split(",") if pattern.strip()]
    if not patterns:
        raise InputError("--columns: name columns, or write all or outputs")
    for name, component in system.components.items():
        for variable, why in component.unsupported.items():
            if f"{name}.{variable}" in patterns:
                raise InputError(f"--columns: {name}.{variable} {why}")
    if is_companion:
        return [name for name in names if any(matches(name, pattern) for pattern in patterns)]
    return matching(names, patterns)


def outputs_of(system: System) -> list[str]:
    """Return the columns of all outputs."""
    return [*map(str, system.columns(["output"]))]


# Checkpoints


def checkpoints_of(
    runs: Sequence[Prepared],
    folders: Sequence[Path],
    every: float | None,
    resume: bool,
    force: bool = False,
    token: str = "",
    say: Callable[[str], None] = lambda _: None,
) -> list[Checkpoints]:
    """Begin or resume the checkpoints of runs that are made one after the other.

    Args:
        runs: the runs.
        folders: of their checkpoints.
        every: time between two checkpoints [simulated s]; None: that of the resumed runs.
        resume: begin with the checkpoints that are there.
        force: move aside other files that are there.
        token: random, for new checkpoints; empty: one is drawn.
        say: takes notes for the user.

    Returns:
        Checkpoints of each run; an empty list if none are wanted.

    Raises:
        InputError: there is nothing to resume, or an FMU does not provide its state.

    """
    if resume and every is None:
        every = Checkpoints.interval_in(folders[0])
        if every is None:
            raise InputError(
                f"nothing to resume in {folders[0]}; a run with "
                "--checkpoint-every writes checkpoints there"
            )
    if every is None:
        return []
    for prepared in runs:
        check_gives_states(prepared.system)
    all_checkpoints = []
    for folder, prepared in zip(folders, runs, strict=True):
        checkpoints = Checkpoints(folder, prepared.identity, every, resume, force, token)
        # FMUs may change the current folder.
        checkpoints.folder = checkpoints.folder.absolute()
        all_checkpoints.append(checkpoints)
    for checkpoints, prepared in zip(all_checkpoints, runs, strict=True):
        if checkpoints.time is not None:
            say(f"{prepared.scenario.name}: continues at t = {checkpoints.time:g} s")
    if resume and not any(checkpoints.time for checkpoints in all_checkpoints):
        say(f"nothing to resume in {folders[0]}: starts from the beginning")
    return all_checkpoints


def check_gives_states(system: System) -> None:
    """Check that all FMUs provide their state; an InputError names one that does not."""
    for name, component in system.components.items():
        if not component.gives_state:
            raise InputError(
                f"{name}: its FMU {component.fmu.name} does not provide its state "
                "(canGetAndSetFMUstate and canSerializeFMUstate): a run with it has no checkpoints"
            )


def leave_checkpoints(
    all_checkpoints: Sequence[Checkpoints],
    is_whole: bool,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Remove the checkpoints of runs that belong together if all are complete, else name them."""
    # The first folder contains the others.
    for checkpoints in reversed(all_checkpoints):
        if is_whole:
            checkpoints.remove()
        elif checkpoints.time is not None:
            place = checkpoints.folder
            with suppress(OSError, ValueError):
                place = place.relative_to(Path.cwd())
            say(f"--resume continues from t = {checkpoints.time:g} s, from {place}")
