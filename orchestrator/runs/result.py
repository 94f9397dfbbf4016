"""Runs from Python: `simulate` and its result."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kinds import AUTO, KindName
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.master.experiment import CouplingName, OrderName, format_order
from orchestrator.master.hooks.checkpoint import Checkpoints
from orchestrator.master.loop import LOOPS, LoopName
from orchestrator.master.observers.files import TABLE_FORMATS, TableFormat
from orchestrator.master.observers.observer import Observer, Occurrence, Progress
from orchestrator.master.observers.table import Table
from orchestrator.runs.folder import lock_folder, make_folder, replace_files
from orchestrator.runs.loading import check_brings_its_own, load_scenario, notes_as_warnings
from orchestrator.runs.preparation import Prepared, prepare
from orchestrator.runs.record import (
    FILES,
    Stopwatch,
    checkpoints_of,
    leave_checkpoints,
    write_metrics,
    write_record,
)
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.vehicle.indices import metrics_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Parameters(Mapping[Any, Any]):
    """Values of the parameters of all components, by `component.parameter`."""

    def __init__(self, values: Mapping[PortName, Any]) -> None:
        """Take the values as the FMUs reported them."""
        self._values = {str(name): value for name, value in values.items()}

    def __getitem__(self, name: str | PortName) -> Any:
        """The value of one parameter.

        Raises:
            KeyError: there is no such parameter; the text has a suggestion.

        """
        if str(name) not in self._values:
            raise KeyError(f"no parameter {str(name)!r}{did_you_mean(str(name), self._values)}")
        return self._values[str(name)]

    def __iter__(self) -> Iterator[str]:
        """Their names."""
        return iter(self._values)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._values)

    def __repr__(self) -> str:
        """As a dictionary."""
        return repr(self._values)


class Result(Table):
    """The table of a run, with its indices and figures.

    `result["plant.eta.x"]` is a column as a numpy array; an unknown name is a KeyError with a
    suggestion. `result.time` holds the times, `result.columns` the names of all columns,
    `result.failure` why the run ended early, or None.

    Attributes:
        resumed_at: where it went on with a checkpoint of an earlier process [s]; None: it did not.

    """

    def __init__(self, prepared: Prepared) -> None:
        """Take the rows of a run."""
        super().__init__()
        self._prepared = prepared
        self._clock = Stopwatch()
        self.resumed_at: float | None = None

    def __repr__(self) -> str:
        """One line: the scenario, and how far it came."""
        end = f", {self.failure}" if self.failure else ""
        first, last = (self.time[0], self.time[-1]) if len(self) else (0.0, 0.0)
        return (
            f"<Result {self._prepared.scenario.name}: {len(self)} rows of {len(self.columns)} "
            f"columns, {first:g} to {last:g} s, {format_order(self.header.experiment.order)}{end}>"
        )

    @cached_property
    def parameters(self) -> Parameters:
        """Of all components, as the FMUs reported them after initialisation."""
        return Parameters(self.header.parameters)

    @property
    def system(self) -> System:
        """What was run."""
        return self._prepared.system

    @property
    def events(self) -> tuple[Occurrence, ...]:
        """What has happened during the run: each has a time [s], a text and a label."""
        return self.ending.events

    def metrics(self) -> dict[str, Any]:
        """What the command line writes into metrics.json."""
        found = metrics_of(self, self._prepared.loops)
        return found.content(self._prepared.scenario.name, self.system)

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas DataFrame, with the time as its index.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        import pandas as pd  # noqa: PLC0415

        index = pd.Index(self.time, name="time")
        return pd.DataFrame(self.rows[:, 1:], index=index, columns=list(self.columns), copy=True)

    def plot(self, *patterns: str) -> Figure:
        """Draw columns over time, a group such as `plant.y` a panel.

        Args:
            patterns: names of groups or columns, or patterns such as `plant.eta.*`; none: errors,
                commands and estimates of the loop.

        Raises:
            ValueError: a pattern matches no column.

        """
        from orchestrator.figures.plot import plot  # noqa: PLC0415

        return plot([(self._prepared.scenario.name, self)], patterns)

    def save(
        self,
        folder: str | Path,
        format: TableFormat = "csv",  # noqa: A002
        *,
        force: bool = False,
    ) -> Path:
        """Write the table, metrics.json and run.json; `auv-fmu plot` and `view` take the folder.

        Args:
            folder: made if it does not exist; an earlier result in it is replaced.
            format: of the table, `csv` or `parquet`.
            force: move aside files of yours that have names of its files; otherwise they stay, and
                nothing is written.

        Returns:
            The folder.

        Raises:
            ValueError: the folder cannot be written, or there is no such format.

        """
        if format not in TABLE_FORMATS:
            raise InputError(f"format {format!r}: use one of {', '.join(TABLE_FORMATS)}")
        folder = Path(folder)
        with replace_files(folder, FILES, force=force) as unfinished:
            table = TABLE_FORMATS[format](unfinished / f"result.{format}")
            table.begin(self.header)
            table.take(self.rows)
            table.end(self.ending)
            write_metrics(unfinished, self.metrics())
            write_record(
                unfinished, self._prepared, self.header, self.ending, sys.argv, self._clock
            )
        return folder


def simulate(
    system: str | Path | System,
    parameters: Mapping[str, object] | None = None,
    *,
    stop_time: float | None = None,
    step: float | None = None,
    order: OrderName | list[str] | tuple[str, ...] | None = None,
    kind: KindName = AUTO,
    progress: bool = False,
    isolate: bool = False,
    step_timeout: float | None = None,
    loop: LoopName = LOOPS[0],
    variant: str | None = None,
    strict: bool = False,
    steps: Mapping[str, float] | None = None,
    events: Sequence[Mapping[str, Any]] | None = None,
    inputs: str | Path | None = None,
    coupling: CouplingName | None = None,
    checkpoint: str | Path | None = None,
    checkpoint_every: float | None = None,
    resume: bool = False,
) -> Result:
    """Run a scenario, an SSP or a system.

        result = simulate("fig4", {"controller.eps_t": 10.0}, stop_time=50.0)
        result["plant.eta.x"], result.metrics(), result.plot("plant.tau.*")

    Args:
        system: name of a scenario, path of a .toml or .ssp file, or what :func:`load` has given.
        parameters: values that win over the scenario's, by `component.parameter`: numbers, truth
            values, names, or text as it stands on the command line.
        stop_time: end of the run [s]; None: the scenario's own.
        step: communication step [s]; None: the scenario's own, else the longest that fits into
            the steps that the FMUs were made for, else 0.02.
        order: `gauss-seidel`, as the paper's scheme has it, `jacobi`, as most tools step, or the
            names of all components, one stepped after the other; None: the scenario's own, else
            `gauss-seidel`.
        kind: of the bundle's FMUs, `python`, `native`: translated to C, with the same numbers, or
            `auto`, native where available.
        progress: show a bar on runs that take longer than some seconds.
        isolate: run each FMU in a process of its own, whose end, whatever it does, is no more than
            a failure of the run.
        step_timeout: how long an isolated FMU may take for one call [s]; None: 60.
        loop: what makes the steps: `python`, `compiled`, or `auto`, the compiled loop where it is
            to be had; the rows are the same.
        variant: which of the descriptions in an SSP; None: the default.
        strict: refuse what otherwise is a warning.
        steps: of components that take longer ones of their own [s], multiples of the communication
            step; they win over the scenario's.
        events: what happens during the run, instead of the scenario's own: tables as a
            scenario file has them, such as `{"at": 20.0, "lose": "controller.tau.r"}`.
        inputs: a table of inputs over time, instead of the scenario's own: a .csv or .parquet
            file.
        coupling: how rings of direct feedthroughs are closed: `solve`, at every communication
            point, `delay`, by a delay of one step, or `linear`, solved, with inputs that change
            linearly during a step; None: the scenario's own, else `solve` where the FMUs allow it.
        checkpoint: folder for what it takes to go on after the process has ended, whatever ended
            it; removed when the run has come to its end.
        checkpoint_every: how often that is written, in simulated seconds; None: as often as
            before, if the run is resumed.
        resume: go on from there. The result has all rows, as if nothing had happened, and says in
            `resumed_at` where it went on.

    Returns:
        The rows that were computed: all of them, or those before a failure, which
        `Result.failure` then describes.

    Raises:
        ValueError: a name, a value or a file is not usable; the text says what to change.
        KeyboardInterrupt: Ctrl-C, when the step has ended that it came in.

    """
    is_named = not isinstance(system, System)
    if isinstance(system, System):
        check_brings_its_own(str(system), kind)
        if variant is not None:
            raise InputError(f"{system}: has no variants; give it to load")
        scenario = Scenario(system.name)
    else:
        with notes_as_warnings(strict) as findings:
            scenario, system = load_scenario(str(system), kind, variant=variant, findings=findings)
    if not isinstance(parameters, Mapping | None):
        raise InputError(f"parameters: a mapping by component.parameter, not {parameters!r}")
    request = Request(
        parameters=parameters or {},
        stop_time=stop_time,
        step=step,
        order=order,
        coupling=coupling,
        kind=kind,
        events=events,
        inputs=inputs,
        loop=loop,
        isolate=isolate,
        step_timeout=step_timeout,
        strict=strict,
        steps=steps or {},
    )
    prepared = prepare(scenario, system, request)
    if is_named:
        with notes_as_warnings(strict) as findings:
            for doubt in prepared.doubts():
                findings.note(doubt)
            findings.refuse()
    result = Result(prepared)
    observers: list[Observer] = [result, *([Progress(scenario.name)] * progress)]
    with _checkpoints(prepared, checkpoint, checkpoint_every, resume) as kept:
        result.resumed_at = next((checkpoints.time for checkpoints in kept), None)
        ending = prepared.run([*observers, *kept], kept)
        leave_checkpoints(kept, ending.failure is None)
    for number in ending.interrupts:
        # Held back while the FMUs computed; now it acts as usual.
        signal.raise_signal(number)
    return result


@contextmanager
def _checkpoints(
    prepared: Prepared, folder: str | Path | None, every: float | None, resume: bool
) -> Iterator[Sequence[Checkpoints]]:
    """The checkpoints of a run in a folder that is kept from others; none, if none are wanted."""
    if folder is None and every is None and not resume:
        yield ()
        return
    if folder is None or (every is None and not resume):
        raise InputError("checkpoints need checkpoint=, and checkpoint_every= or resume=")
    place = Path(folder)
    try:
        with make_folder(place), lock_folder(place):
            yield checkpoints_of([prepared], [place], every, resume)
    except OSError as error:
        raise InputError(f"cannot write into {place}: {reason(error)}") from error
