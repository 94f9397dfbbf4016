"""What a run gives to Python, when it was made or when it is read again."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from orchestrator.cosim.experiment import format_order
from orchestrator.cosim.observers.files import TABLE_FORMATS, TableFormat
from orchestrator.cosim.observers.observer import Occurrence
from orchestrator.cosim.observers.table import Table
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.figures.style import Drawn, printed_unit
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.runs.folder import locate, replace_files
from orchestrator.runs.record import (
    FILES,
    METRICS,
    changed_files,
    copy_record,
    ending_in,
    loops_in,
    read_metrics,
    read_record,
    stored_rows,
    table_in,
    write_metrics,
)
from orchestrator.runs.scenario import Scenario
from orchestrator.vehicle.distances import SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL
from orchestrator.vehicle.indices import metrics, of_vehicles
from orchestrator.vehicle.signals import Loop

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


class Origin(Protocol):
    """Where a result comes from: a run of this process, or the files of one."""

    @property
    def scenario(self) -> Scenario:
        """What was run, as far as its figures need it."""
        ...

    @property
    def loops(self) -> Sequence[Loop]:
        """Of its vehicles."""
        ...

    @property
    def system(self) -> System:
        """What was run."""
        ...

    def metrics(self, result: Result) -> dict[str, Any]:
        """What metrics.json holds."""
        ...

    def write_ends(self, folder: Path, result: Result) -> None:
        """Write metrics.json and run.json, after everything else."""
        ...


class Result(Table):
    """The table of a run, with its indices and figures.

    `result["plant.eta.x"]` is a column as a numpy array; an unknown name is a KeyError with a
    suggestion. `result.time` holds the times, `result.columns` the names of all columns,
    `result.failure` why the run ended early, or None.

    Attributes:
        resumed_at: when it continued from a checkpoint [s]; None: it was not resumed.

    """

    def __init__(self, origin: Origin) -> None:
        """Take the rows of a run."""
        super().__init__()
        self._origin = origin
        self.resumed_at: float | None = None

    def __repr__(self) -> str:
        """One line: the scenario, and how far it came."""
        end = f", {self.failure}" if self.failure else ""
        first, last = (self.time[0], self.time[-1]) if len(self) else (0.0, 0.0)
        return (
            f"<Result {self._origin.scenario.name}: {len(self)} rows of {len(self.columns)} "
            f"columns, {first:g} to {last:g} s, {format_order(self.header.experiment.order)}{end}>"
        )

    def _repr_html_(self) -> str:
        """The same for a notebook, with the indices."""
        rows = []
        with suppress(InputError):
            for vehicle, title, numbers in summary(self.metrics()):
                cells = "".join(f"<td>{number}</td>" for number in numbers)
                heading = escape(", ".join(filter(None, (vehicle, title))))
                rows.append(f"<tr><th style='text-align: left'>{heading}</th>{cells}</tr>")
        title = escape(self._origin.scenario.title or self._origin.scenario.name)
        return (
            f"<div><b>{title}</b><br><code>{escape(repr(self))}</code>"
            f"<table>{''.join(rows)}</table></div>"
        )

    @cached_property
    def parameters(self) -> Parameters:
        """Parameters of all components, as the FMUs reported them after initialisation."""
        return Parameters(self.header.parameters)

    @property
    def system(self) -> System:
        """The system of the run.

        Raises:
            ValueError: the result was read from files, which do not hold it.

        """
        return self._origin.system

    @property
    def events(self) -> tuple[Occurrence, ...]:
        """Events that happened during the run: each has a time [s], a text and a label."""
        return self.ending.events

    def metrics(self) -> dict[str, Any]:
        """The indices, as in metrics.json."""
        return self._origin.metrics(self)

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas DataFrame, with the time as its index.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        import pandas as pd  # noqa: PLC0415

        index = pd.Index(self.time, name="time")
        frame = pd.DataFrame(self.rows[:, 1:], index=index, columns=list(self.columns), copy=True)
        for place, standing in self.header.places():
            frame.isetitem(place - 1, standing.values(self.rows[:, place]))
        return frame

    def plot(self, *what: str | Result) -> Figure:
        """Plot columns over time, with one panel for each group such as `plant.y`.

        Args:
            what: names of groups or columns, or patterns such as `plant.eta.*`; without any:
                errors, commands and estimates of all vehicles. Results among them are drawn over
                this one.

        Raises:
            ValueError: a pattern matches no column.

        """
        from orchestrator.figures.plot import plot, told_apart  # noqa: PLC0415

        others = [one for one in what if isinstance(one, Result)]
        patterns = [one for one in what if not isinstance(one, Result)]
        return plot(told_apart([one._drawn() for one in (self, *others)]), patterns)

    def figure(self, *others: Result, name: str | None = None, vehicle: str = "") -> Figure:
        """Draw the figure of its scenario, or another, as `auv-fmu run` does.

        Args:
            others: results that are drawn with it, as in a comparison.
            name: name of the figure, such as `comparison` or `tracking-velocity`; None: the
                scenario's.
            vehicle: name of the vehicle, if there are several; empty: the first.

        Raises:
            ValueError: there is no such figure, the result lacks all of its signals, or one of the
                others is not a result.

        """
        from orchestrator.figures.drawing import one_figure  # noqa: PLC0415
        from orchestrator.figures.plot import told_apart  # noqa: PLC0415

        for other in others:
            if not isinstance(other, Result):
                raise InputError(f"{other!r}: not a result; name= takes the name of a figure")
        scenario = self._origin.scenario
        runs = told_apart([one._drawn() for one in (self, *others)])
        return one_figure(name or scenario.figure, scenario.title, runs, vehicle)

    def save(
        self,
        folder: str | Path,
        format: TableFormat = "csv",  # noqa: A002
        *,
        force: bool = False,
    ) -> Path:
        """Write the table, metrics.json and run.json; :func:`read` and `auv-fmu plot` read them.

        Args:
            folder: made if it does not exist; an earlier result in it is replaced.
            format: of the table, `csv` or `parquet`.
            force: move aside your files with names of its files; without it they stay, and nothing
                is written.

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
            self._origin.write_ends(unfinished, self)
        return folder

    def _drawn(self) -> Drawn:
        scenario = self._origin.scenario
        return Drawn(scenario.legend, self, scenario.z_up, self._origin.loops)


def summary(values: Mapping[str, Any]) -> Iterator[tuple[str, str, list[str]]]:
    """What metrics.json holds, to be read by people.

    Args:
        values: of metrics.json.

    Yields:
        The vehicle, empty if there is only one; an index with its members and unit; its numbers.

    """
    for vehicle, found in of_vehicles(values).items():
        for index in metrics():
            if index.name in found:
                unit = f" [{printed_unit(index.unit)}]" if index.unit else ""
                title = f"{index.label} {index.members}{unit}"
                yield vehicle, title, [*map(_number, np.atleast_1d(found[index.name]).tolist())]
    if SMALLEST_DISTANCE in values:
        yield "all", f"{SMALLEST_DISTANCE_LABEL} [m]", [_number(values[SMALLEST_DISTANCE])]


def _number(value: float) -> str:
    """Four digits; an exponent only where zeros would be all that is seen."""
    if value and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.3e}"
    return np.format_float_positional(value, precision=4, unique=False, fractional=False, trim="-")


class _OnDisk:
    """Where a result comes from that was read from files."""

    def __init__(self, file: Path, record: dict[str, Any]) -> None:
        self._file, self._record = file, record
        self.loops: Sequence[Loop] = loops_in(record)
        shown = {"title", "label", "z_up", "figure"} & record.keys()
        said = {name: record[name] for name in shown}
        self.scenario = Scenario(str(record.get("scenario", file.stem)), **said)

    @property
    def system(self) -> System:
        """Nothing: files do not hold it."""
        raise InputError(f"{self._file}: a stored result has no system; load() gives it")

    def metrics(self, _: Result) -> dict[str, Any]:
        """What the run wrote: the table may have fewer rows and columns."""
        return read_metrics(locate(self._file.with_name(METRICS)))

    def write_ends(self, folder: Path, result: Result) -> None:
        """Write what the files hold, once more."""
        if self._record:
            write_metrics(folder, self.metrics(result))
            copy_record(folder, self._record)


def read(path: str | Path) -> Result:
    """Read a result that `auv-fmu run` or :meth:`Result.save` has written.

        result = read("results/fig4")

    Args:
        path: path of the folder, or of a table in it.

    Raises:
        ValueError: there is no result, or it cannot be read.

    """
    file = table_in(Path(path))
    record = read_record(file)
    for changed in changed_files(file) if record else ():
        warnings.warn(f"{changed} was changed since the run wrote it", stacklevel=2)
    result = Result(_OnDisk(file, record))
    header, blocks = stored_rows(file, record)
    result.hold(header, np.concatenate(list(blocks)), ending_in(record))
    return result
