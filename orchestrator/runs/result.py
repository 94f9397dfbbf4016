"""A result: its table, its indices in metrics.json and its record run.json; read and written."""

from __future__ import annotations

import json
import platform
import sys
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields
from datetime import UTC, datetime
from functools import cached_property
from html import escape
from importlib.metadata import version
from importlib.util import find_spec
from itertools import chain
from math import inf, isfinite
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kinds import NATIVE, PYTHON
from orchestrator.cosim import (
    Ending,
    Experiment,
    Header,
    Occurrence,
    PortName,
    System,
    Table,
    TableFile,
)
from orchestrator.figures.run_figures import main_figure
from orchestrator.figures.style import Drawn, Look, Style, printed_unit
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.identity import PACKAGES, digest_of
from orchestrator.machine.user_files import explain_errors, read_text
from orchestrator.runs.folder import RECORD, is_changed, locate, replace_files
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.scenario import Scenario
from orchestrator.runs.tables import read_columns, read_rows
from orchestrator.vehicle.indices import (
    INDICES,
    SMALLEST_DISTANCE,
    SMALLEST_DISTANCE_LABEL,
    VEHICLES,
    metrics,
    metrics_of,
    numbers_of,
    of_vehicles,
)
from orchestrator.vehicle.signals import STANDARD, Loop, loop_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: The file of the indices of a run.
METRICS = "metrics.json"

#: The table of a run, in one format or the other, and all files that every run writes.
TABLES = tuple(f"result.{ending}" for ending in TableFile.FORMATS)
FILES = (*TABLES, METRICS, RECORD)

#: Packages whose versions a result depends on.
RECORDED_PACKAGES = (*PACKAGES, "matplotlib")

#: Methods of a table that only a run needs.
_FILLING = {"begin", "take", "end", "hold", "of"}

#: Names beside indices in metrics.json, in tables of studies and in their figures.
_TAKEN = {
    SMALLEST_DISTANCE, VEHICLES, "caution", "failed", "failure", "lost", "order", "parameters",
    "run", "saturated", "scenario", "step", "stop_time", "time", "velocities_reaching_controller",
}  # fmt: skip

#: Messages about a file that cannot be read.
_NOT_A_RECORD, _NOT_INDICES = "not the record of a run", "not the indices of a run"

#: Texts in place of numbers that JSON does not have.
_NOT_FINITE = {text: float(text) for text in ("inf", "-inf", "nan")}

#: Entries of the indices that hold texts of the user.
_TEXTS = ("scenario", "order", "parameters")


# Results in memory


class Parameters(Mapping[Any, Any]):
    """Values of the parameters of all components, by `component.parameter`."""

    def __init__(self, values: Mapping[PortName, Any]) -> None:
        """Take the values that the FMUs reported."""
        self._values = {str(name): value for name, value in values.items()}

    def __getitem__(self, name: str | PortName) -> Any:
        """Return the value of one parameter.

        Raises:
            KeyError: there is no such parameter; the text has a suggestion.

        """
        if str(name) not in self._values:
            raise KeyError(f"no parameter {str(name)!r}{did_you_mean(str(name), self._values)}")
        return self._values[str(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return repr(self._values)


class Result(Table):
    """The table of a run, with its indices and figures.

    `result["plant.eta.x"]` is a column as a numpy array, `result["plant.eta"]` the columns of a
    group side by side, (rows, columns); an unknown name is a KeyError with a suggestion.
    `result.time` holds the times, `result.columns` the names of all columns, `result.units` their
    units, `result.failure` why the run ended early, or None. It can be pickled and copied.

    Attributes:
        resumed_at: when it continued from a checkpoint [s]; None: it was not resumed.

    """

    def __init__(
        self, scenario: Scenario, loops: Sequence[Loop], prepared: Prepared | None = None
    ) -> None:
        """Begin without rows; `prepared` is the run, if it is made in this process."""
        super().__init__()
        self.resumed_at: float | None = None
        self._scenario, self._loops, self._clock = scenario, loops, Stopwatch()
        self._prepared = prepared
        self._file, self._record = Path(), dict[str, Any]()

    def __repr__(self) -> str:
        """Show the scenario and the computed rows in one line."""
        end = f", {self.failure}" if self.failure else ""
        first, last = (self.time[0], self.time[-1]) if len(self) else (0.0, 0.0)
        order = Experiment.format_order(self.header.experiment.order)
        return (
            f"<Result {self._scenario.name}: {len(self)} rows of {len(self.columns)} "
            f"columns, {first:g} to {last:g} s, {order}{end}>"
        )

    def __dir__(self) -> list[str]:
        """Leave out the methods with which a run fills it."""
        return sorted({*super().__dir__()} - _FILLING)

    def _repr_html_(self) -> str:
        """Show the indices in a notebook."""
        rows = []
        with suppress(InputError):
            for vehicle, title, numbers in summary(self.metrics()):
                cells = "".join(f"<td>{number}</td>" for number in numbers)
                heading = escape(", ".join(filter(None, (vehicle, title))))
                rows.append(f"<tr><th style='text-align: left'>{heading}</th>{cells}</tr>")
        title = escape(self._scenario.title or self._scenario.name)
        return (
            f"<div><b>{title}</b><br><code>{escape(repr(self))}</code>"
            f"<table>{''.join(rows)}</table></div>"
        )

    def end(self, ending: Ending) -> None:
        """Keep the ending and the duration."""
        super().end(ending)
        self._clock.stop()

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
        if self._prepared is None:
            raise InputError(f"{self._file}: a stored result has no system; load() gives it")
        return self._prepared.system

    @property
    def events(self) -> tuple[Occurrence, ...]:
        """Events that happened during the run: each has a time [s], a text and a label."""
        return self.ending.events

    def metrics(
        self, indices: Mapping[str, Callable[[Result], object]] | None = None
    ) -> dict[str, Any]:
        """Return the indices, as in metrics.json.

            result.metrics({"deepest": lambda result: result["plant.eta.z"].max()})["deepest"]

        Args:
            indices: your own by their names: functions of the result, which return a number, or a
                list or dictionary of numbers; as for :func:`.sweep`.

        Raises:
            ValueError: an index has the name of another, or returns something else.

        """
        own = indices or {}
        for name, function in own.items():
            check_function(name, function)
        return self._metrics() | {
            name: numbers_of(name, function(self)) for name, function in own.items()
        }

    def _metrics(self) -> dict[str, Any]:
        if self._prepared is None:
            # The stored table may have fewer rows and columns than the run.
            return read_metrics(locate(self._file.with_name(METRICS)))
        indices = metrics_of(self, self._loops)
        return indices.content(self._scenario.name, self._prepared.system)

    def to_dataframe(self) -> pd.DataFrame:
        """Return all columns as a pandas DataFrame, with the time as its index.

        Its `attrs` hold the scenario, the experiment, the failure and the units, as in JSON.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        import pandas as pd  # noqa: PLC0415

        index = pd.Index(self.time, name="time")
        frame = pd.DataFrame(self.rows[:, 1:], index=index, columns=list(self.columns), copy=True)
        for place, name in enumerate(self.columns):
            if name in self.header.types:
                frame.isetitem(place, self[name])
        experiment = vars(self.header.experiment)
        frame.attrs = {
            "scenario": self._scenario.name,
            "experiment": json.loads(json.dumps(experiment)),
            "failure": self.failure,
            "units": self.units,
        }
        return frame

    def plot(
        self,
        *what: str | Result,
        title: str = "",
        labels: Sequence[str] = (),
        width: float | None = None,
        font: str = "",
        size: float | None = None,
        style: Style = "",
    ) -> Figure:
        """Plot columns over time, with one panel for each group such as `plant.y`.

        Args:
            what: names of groups or columns, or patterns such as `plant.eta.*`; without any:
                errors, commands and estimates of all vehicles, or all of few columns. Results among
                them are drawn over this one.
            title: heading; empty for none.
            labels: of this result and the others, in legends; empty: labels or scenarios.
            width: of the figure [in]; None: 7.2.
            font: family, such as `serif` or `Times New Roman`; empty: DejaVu Sans.
            size: of texts [pt]; None: 10.
            style: of matplotlib (name, path of a file, or settings), applied over the project's
                `auv_fmu.figures`; the arguments before it have precedence.

        Raises:
            ValueError: a pattern matches no column, there is no such font or style, or the number
                of labels is wrong.

        """
        from orchestrator.figures.drawing import plot, told_apart  # noqa: PLC0415

        results = [self, *(each for each in what if isinstance(each, Result))]
        patterns = [each for each in what if not isinstance(each, Result)]
        runs = told_apart([result._drawn() for result in results], labels=labels)
        return plot(runs, patterns, title, Look(width, font, size, style))

    def figure(
        self,
        *others: Result,
        name: str | None = None,
        vehicle: str = "",
        title: str | None = None,
        labels: Sequence[str] = (),
        width: float | None = None,
        font: str = "",
        size: float | None = None,
        style: Style = "",
    ) -> Figure:
        """Draw the figure of its scenario, or another, as `auv-fmu run` does.

        Args:
            others: results that are drawn with it, as in a comparison.
            name: name of the figure, such as `comparison` or `tracking-velocity`; None: the
                scenario's, or of several vehicles the one of all.
            vehicle: name of the vehicle, if there are several; empty: all, or the first.
            title: heading; None: the scenario's; empty for none.
            labels: as for :meth:`plot`, as all below.
            width: of the figure [in]; panels of a narrow one are below each other.
            font: family.
            size: of texts [pt].
            style: of matplotlib.

        Raises:
            ValueError: there is no such figure, font or style, the result lacks all signals of the
                figure, one of the others is not a result, or the number of labels is wrong.

        """
        from orchestrator.figures.drawing import one_figure, told_apart  # noqa: PLC0415

        for other in others:
            if not isinstance(other, Result):
                raise InputError(f"{other!r}: not a result; name= takes the name of a figure")
        runs = told_apart([result._drawn() for result in (self, *others)], labels=labels)
        return one_figure(
            name or main_figure(self._scenario.figure, self._loops, vehicle),
            self._scenario.title if title is None else title,
            runs,
            vehicle,
            Look(width, font, size, style),
        )

    def save(
        self,
        folder: str | Path,
        format: TableFile.Format = "csv",  # noqa: A002
        *,
        force: bool = False,
    ) -> Path:
        """Write the table, metrics.json and run.json; :func:`read` and `auv-fmu plot` read them.

        Args:
            folder: made if it does not exist; an earlier result in it is replaced.
            format: of the table, `csv` or `parquet`.
            force: rename your own files that are in the way; without it nothing is written then.

        Returns:
            The folder.

        Raises:
            ValueError: the folder cannot be written, or there is no such format.

        """
        if format not in TableFile.FORMATS:
            raise InputError(f"format {format!r}: use one of {', '.join(TableFile.FORMATS)}")
        folder = Path(folder)
        with replace_files(folder, FILES, force=force) as staging:
            table = TableFile.at(staging / f"result.{format}")
            table.begin(self.header)
            table.take(self.rows)
            table.end(self.ending)
            if self._prepared is not None:
                write_record(
                    staging,
                    self._prepared,
                    self.header,
                    self.ending,
                    self.metrics(),
                    sys.argv,
                    self._clock,
                )
            elif self._record:
                (staging / METRICS).write_text(in_json(self.metrics()), encoding="utf-8")
                copy_record(staging, self._record)
        return folder

    def _drawn(self) -> Drawn:
        scenario = self._scenario
        return Drawn(scenario.legend, self, scenario.z_up, self._loops, scenario.name)


def check_function(name: str, function: object) -> None:
    """Check that a user's function can be an index of a name.

    Raises:
        InputError: it is not a function, or there is another meaning of the name.

    """
    taken = {index.name for index in INDICES} | _TAKEN
    if not name.isidentifier():
        raise InputError(f"index {name!r}: a name has letters, digits and _")
    if name in taken:
        raise InputError(f"index {name}: the name is taken; choose another")
    if not callable(function):
        raise InputError(f"index {name}: {function!r} is not a function of a result")


def read(path: str | Path) -> Result:
    """Read a result that `auv-fmu run` or :meth:`Result.save` has written.

        result = read("results/fig4")

    Args:
        path: path of the folder, or of a table in it.

    Raises:
        ValueError: there is no result, or it cannot be read.

    """
    file, record, header, blocks = _stored(Path(path))
    shown = {name: record[name] for name in ("title", "label", "z_up", "figure") if name in record}
    result = Result(Scenario(str(record.get("scenario", file.stem)), **shown), loops_in(record))
    result._file, result._record = file, record
    result.hold(header, np.concatenate(list(blocks)), ending_in(record))
    return result


def summary(values: Mapping[str, Any]) -> Iterator[tuple[str, str, list[str]]]:
    """Describe the content of metrics.json.

    Yields:
        The vehicle, empty if there is only one; an index with its members and unit; its numbers.

    """
    for vehicle, indices in of_vehicles(values).items():
        for index in metrics():
            if index.name in indices:
                unit = f" [{printed_unit(index.unit)}]" if index.unit else ""
                title = f"{index.label} {index.members}{unit}"
                numbers = np.atleast_1d(indices[index.name]).tolist()
                yield vehicle, title, [*map(format_number, numbers)]
    if SMALLEST_DISTANCE in values:
        yield "all", f"{SMALLEST_DISTANCE_LABEL} [m]", [format_number(values[SMALLEST_DISTANCE])]


def format_number(value: float) -> str:
    """Four digits, with an exponent for numbers below 1e-4 and from 1e7 on."""
    if value and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.3e}"
    return np.format_float_positional(value, precision=4, unique=False, fractional=False, trim="-")


# The record and the indices


class Stopwatch:
    """Start and duration of a run; setting the clock does not change the duration."""

    def __init__(self) -> None:
        """Start now."""
        self._started = datetime.now(UTC)
        self._tick, self._end = monotonic(), 0.0

    def stop(self) -> None:
        """End the run."""
        self._end = monotonic()

    def times(self) -> dict[str, object]:
        """Return the entries of a record."""
        return {
            "started": self._started.isoformat(timespec="seconds"),
            "seconds": round((self._end or monotonic()) - self._tick, 3),
        }


def read_metrics(path: Path) -> dict[str, Any]:
    """Read metrics.json.

    Raises:
        InputError: it cannot be read.

    """
    with explain_errors(path, _NOT_INDICES):
        values = json.loads(read_text(path, _NOT_INDICES))
        if not isinstance(values, dict):
            raise ValueError("it holds no names")
        return {
            name: value if name in _TEXTS else _as_numbers(value) for name, value in values.items()
        }


def write_record(
    folder: Path,
    prepared: Prepared,
    header: Header,
    ending: Ending,
    indices: Mapping[str, Any],
    command: Sequence[str],
    clock: Stopwatch,
    remarks: Mapping[str, object] | None = None,
) -> None:
    """Write the indices and the record of a run, the last files of its folder.

    Args:
        folder: with all other files of the result.
        prepared: the run.
        header, ending: of its table.
        indices: content of metrics.json.
        command: of the run.
        clock: started with the run.
        remarks: further entries.

    """
    (folder / METRICS).write_text(in_json(indices), encoding="utf-8")
    scenario, system = prepared.scenario, prepared.system
    content = {
        "scenario": scenario.name,
        "title": scenario.title,
        "label": scenario.label,
        "z_up": scenario.z_up,
        "figure": scenario.figure,
        "sha256": scenario.digest,
        "identity": digest_of(prepared.identity),
        "command": list(command),
        **clock.times(),
        **content_of(header, ending, prepared.loops),
        "experiment": {**vars(header.experiment), "steps": dict(system.steps)},
        **(remarks or {}),
        "fmus": {
            component.name: {
                "file": component.fmu.name,
                "sha256": component.digest,
                "kind": PYTHON if component.runs_python else NATIVE,
            }
            for component in system.components.values()
        },
    }
    write_content(folder, content)


def content_of(header: Header, ending: Ending, loops: Sequence[Loop]) -> dict[str, object]:
    """Entries of a record for :func:`header_in`, :func:`ending_in` and :func:`loops_in`."""
    return {
        "failure": ending.failure,
        "remark": ending.remark,
        "messages": list(ending.messages),
        "experiment": vars(header.experiment),
        "loop": header.loop,
        "types": {
            **{n: header.types[n] for n in header.columns if n in header.types},
            **{str(n): "String" for n, value in header.parameters.items() if type(value) is str},
        },
        "units": dict(header.units),
        "vehicles": [asdict(loop) for loop in loops],
        "events": [occurrence._asdict() for occurrence in ending.events],
        "parameters": {str(name): value for name, value in header.parameters.items()},
    }


def write_content(
    folder: Path, content: Mapping[str, object], packages: Sequence[str] = RECORDED_PACKAGES
) -> None:
    """Write a record, with versions, the platform, and the names of all files in its folder."""
    versions = {"python": platform.python_version(), **{name: version(name) for name in packages}}
    copy_record(folder, {**content, "versions": versions, "platform": platform.platform()})


def copy_record(folder: Path, content: Mapping[str, object]) -> None:
    """Write a record unchanged, except for the names of all files in its folder."""
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    whole = {**content, "files": sorted(files | {RECORD})}
    (folder / RECORD).write_text(in_json(whole), encoding="utf-8")


def in_json(content: Mapping[str, object]) -> str:
    """Format a record or indices as JSON, with texts for numbers that are not finite."""
    return json.dumps(_as_texts(content), indent=2, allow_nan=False) + "\n"


def _as_texts(content: object) -> object:
    """Replace numbers that are not finite by texts."""
    if isinstance(content, Mapping):
        return {name: _as_texts(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return list(map(_as_texts, content))
    return str(content) if isinstance(content, float) and not isfinite(content) else content


def _as_numbers(content: Any) -> Any:
    """Replace texts for numbers that are not finite by these numbers."""
    if isinstance(content, dict):
        return {name: _as_numbers(value) for name, value in content.items()}
    if isinstance(content, list):
        return list(map(_as_numbers, content))
    return _NOT_FINITE.get(content, content) if isinstance(content, str) else content


def ending_in(record: dict[str, Any]) -> Ending:
    """Read the end of a run from its record."""
    events = (
        Occurrence(float(e["time"]), str(e["text"]), str(e["label"]), int(e.get("event", 0)))
        for e in record.get("events", ())
    )
    return Ending(
        record.get("failure"),
        record.get("remark"),
        tuple(record.get("messages", ())),
        events=tuple(events),
    )


def header_in(record: dict[str, Any], columns: tuple[str, ...]) -> Header:
    """Read the header of a table from its record."""
    stated = record["experiment"]
    known = {field.name: stated[field.name] for field in fields(Experiment) if field.name in stated}
    types = _types_in(record)
    return Header(
        columns,
        Experiment(**known),
        {
            PortName.read(name): value if types.get(name) == "String" else _as_numbers(value)
            for name, value in record["parameters"].items()
        },
        record.get("loop", "python"),
        {name: types[name] for name in columns if name in types},
        record.get("units", {}),
    )


def _types_in(record: dict[str, Any]) -> dict[str, str]:
    """Read the types of columns and parameters other than doubles."""
    # Earlier versions named columns of texts only.
    types = record.get("types", dict.fromkeys(record.get("texts", ()), "String"))
    if not Header.TYPES.issuperset(types.values()):
        raise ValueError("it holds types that no run has")
    return dict(types)


def loops_in(record: dict[str, Any]) -> tuple[Loop, ...]:
    """Read the loops of the vehicles of a run from its record; default: the standard loop."""
    return tuple(loop_of(names) for names in record.get("vehicles", ())) or (STANDARD,)


# Stored tables


def read_result(
    path: Path,
    watched: Callable[[Sequence[str], Sequence[Loop]], Collection[str]] | None = None,
) -> Drawn:
    """Read a stored result for drawing: only some columns, and no more rows than can be seen.

    Args:
        path: a folder that a run has written, or a table in CSV or Parquet; without a record, the
            parameters are unknown.
        watched: chooses among the columns, given the loops; None: those of the paper's figures.

    Raises:
        InputError: there is no result, or it cannot be read.

    """
    file, record, header, blocks = _stored(path)
    loops = loops_in(record)
    drawn = {name for loop in loops for name in loop.drawn()}
    table = VisibleRows(drawn if watched is None else watched(header.columns, loops))
    table.begin(header)
    for rows in blocks:
        table.take(rows)
    table.end(ending_in(record))
    name = str(record.get("scenario") or file.stem)
    label = str(record.get("label") or name)
    return Drawn(label, table, bool(record.get("z_up")), loops, name)


def _stored(path: Path) -> tuple[Path, dict[str, Any], Header, Iterator[np.ndarray]]:
    """Open a stored result, with a warning about files that were changed since the run.

    Returns:
        The file of its table, its record, its header, and its rows, block by block.

    Raises:
        InputError: there is none, it cannot be read, or it has no rows.

    """
    file = table_in(path)
    for written in (file, file.with_name(RECORD)):
        if locate(written).is_file() and is_changed(written):
            warnings.warn(f"{written} was changed since the run wrote it", stacklevel=3)
    record, place = read_record(file), locate(file)
    columns = read_columns(place)
    header = header_in(record, columns) if record else None
    blocks = read_rows(place, header.encoders if header else {})
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{file}: has no rows")
    if header is None:
        step = float(first[1, 0] - first[0, 0]) if len(first) > 1 else 1.0
        if not 0.0 < step < inf:
            raise InputError(f"{file}: times must increase")
        header = Header(columns, Experiment(step, step))
    return file, record, header, chain([first], blocks)


def table_in(path: Path) -> Path:
    """Find the file with the table of a result.

    Raises:
        InputError: there is none.

    """
    with explain_errors(path, "not the name of a result"):
        for file in (path, *(path / name for name in TABLES)):
            if locate(file).is_file():
                return file
        what = "holds no result.csv or result.parquet" if path.exists() else "no such result"
    raise InputError(f"{path}: {what}")


def companion_tables(table: Path) -> list[Path]:
    """Find the tables of the runs that a result is compared with, in folders below its own."""
    names = (Path(str(name)) for name in read_record(table).get("files", ()))
    below = (name for name in names if len(name.parts) == 2 and name.name in TABLES)
    files = (table.parent / name for name in below if name.parent.name not in ("", ".."))
    return [file for file in files if file.is_file() and not file.parent.is_symlink()]


def read_record(table: Path) -> dict[str, Any]:
    """Read the record of the run that wrote a table; empty if there is none that names the table.

    Raises:
        InputError: it is broken.

    """
    file = locate(table.with_name(RECORD))
    if not file.exists():
        return {}
    with explain_errors(file, _NOT_A_RECORD):
        record = json.loads(read_text(file, _NOT_A_RECORD))
        try:
            if table.name not in record["files"]:
                return {}
            header, *_ = header_in(record, ()), ending_in(record), loops_in(record)
        except (KeyError, TypeError, AttributeError):
            raise ValueError("it lacks what a run writes") from None
        except InputError as error:
            raise ValueError(str(error)) from None
        for name, value in header.parameters.items():
            if not isinstance(value, float | int | str):
                raise ValueError(f"the parameter {name} is {value!r}")
    return dict(record)
