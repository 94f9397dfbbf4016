"""Reading tables: of runs, in CSV or Parquet, and of users and other tools, in CSV."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.machine.lazy import ROWS_AT_ONCE, parquet
from orchestrator.machine.texts import finite
from orchestrator.machine.user_files import explain_errors, open_lines

#: Separators of the values of a row, with their names.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}

#: Names of the time column, in lower case.
_TIME = ("time", "t")

#: Type that ecos appends to a name.
_TYPE = re.compile(r"\[[A-Z]+\]$")

#: Default message for a file that cannot be read.
_NO_RUN = "not a table of a run"

#: Functions from texts to numbers, by the indices of columns.
_Converters = dict[int | str, Callable[[str], float]]

#: Number and values of a line.
Record = tuple[int, list[str]]


def read_columns(path: Path, what: str = _NO_RUN) -> tuple[str, ...]:
    """Return the names of the columns after the time; `what` begins the message about a mistake.

    Raises:
        InputError: the file is not such a table.

    """
    with explain_errors(path, what):
        if path.suffix == ".parquet":
            with parquet().ParquetFile(path) as file:
                return _after_time(file.schema_arrow.names)
        with open_lines(path) as lines:
            return _after_time(next(csv.reader(lines), ()))


def read_rows(
    path: Path, numbers: Mapping[str, Callable[[Any], float]] | None = None, what: str = _NO_RUN
) -> Iterator[np.ndarray]:
    """Yield the rows of a file, time first, some thousand at a time.

    Args:
        path: of the file.
        numbers: convert columns without doubles to numbers: from texts in CSV, from Parquet's own
            values.
        what: begins the message about a mistake.

    Raises:
        InputError: the file is not such a table.

    """
    numbers = numbers or {}
    with explain_errors(path, what):
        if path.suffix == ".parquet":
            with parquet().ParquetFile(path) as file:
                for batch in file.iter_batches(ROWS_AT_ONCE):
                    named = zip(batch.schema.names, batch.columns, strict=True)
                    columns = [_numbers(column, numbers.get(name)) for name, column in named]
                    yield _with_times(np.column_stack(columns).astype(float, copy=False))
            return
        # Texts may have ends of lines in them, also of other systems, and empty lines.
        with open_lines(path, newline="" if numbers else None) as lines:
            header = ("time", *_after_time(next(csv.reader(lines), ())))
            places = enumerate(header)
            converters: _Converters = {i: numbers[name] for i, name in places if name in numbers}
            filled = _filled(lines) if numbers else (line for line in lines if line.strip())
            for first in filled:
                rows = _loaded(chain([first], filled), converters)
                if rows.shape[1] != len(header):
                    raise ValueError(f"rows of {rows.shape[1]} values for {len(header)} columns")
                yield _with_times(rows)


def _with_times(rows: np.ndarray) -> np.ndarray:
    """Return rows, whose times must be finite."""
    if not np.isfinite(rows[:, 0]).all():
        raise ValueError("a time is not finite")
    return rows


@contextmanager
def records(
    path: Path, what: str, are_names: Callable[[Sequence[str]], object]
) -> Iterator[tuple[list[str], Iterator[Record]]]:
    """Read a table in CSV that a user or another tool has written.

    Args:
        path: of the file.
        what: begins the message about a mistake.
        are_names: True if the first line, split at one of :data:`SEPARATORS`, has the expected
            names: this finds the separator.

    Returns:
        The values of its first line, and the records of the others without empty lines.

    Raises:
        InputError: there is no such file, a line is not as long as the first, or a ValueError was
            raised while the table was read.

    """
    with explain_errors(path, what), open_lines(path, newline="") as lines:
        first = next(lines, "")
        marks = [mark for mark in SEPARATORS if mark in first] or [","]
        mark = next((m for m in marks if are_names(next(_reader([first], m)))), marks[0])
        reader = _reader(chain([first], lines), mark, strict=True)
        try:
            names = next(reader)
            yield names, _records(reader, len(names))
        except csv.Error as error:
            raise ValueError(f"line {reader.line_num}: {error}") from error


def places_of_time(names: Sequence[str]) -> list[int]:
    """Return the indices of the time columns."""
    lowered = [name.strip().lower() for name in names]
    places = ([i for i, name in enumerate(lowered) if name == time] for time in _TIME)
    return next(filter(None, places), [])


def time_of(row: Sequence[str], clocks: Sequence[int], where: str) -> float:
    """Return the time of a row; some tools write it twice, once as a variable of an FMU.

    Raises:
        ValueError: it is not a finite number, or its columns differ.

    """
    time, *more = (finite(row[clock], f"{where}, time:") for clock in clocks)
    if any(other != time for other in more):
        raise ValueError(f"{where}: the columns of the time differ: {time:g} and {more[0]:g} s")
    return time


def port_of(name: str, known: Collection[str], longest: int) -> str | None:
    """Return our name of a column that another tool has written.

    Some tools write component::port, [REAL] after it, or systems before.

    Args:
        name: of the column.
        known: our names; the longest one that the name ends with counts.
        longest: length of the longest of them.

    """
    name = name.strip()
    plain = _TYPE.sub("", name).replace("::", ".")
    end = plain[-longest - 1 :]
    ends = (end[i + 1 :] for i, character in enumerate(end) if character == ".")
    return next((ours for ours in (name, plain, *ends) if ours in known), None)


def _filled(lines: Iterable[str]) -> Iterator[str]:
    """Yield lines without empty ones, unless these are within a text."""
    is_within = False
    for line in lines:
        if is_within or line.strip():
            yield line
        is_within ^= bool(line.count('"') % 2)


def _numbers(column: Any, convert: Callable[[Any], float] | None) -> Any:
    """Convert a column of Parquet to numbers."""
    if convert is None:
        return column.to_numpy(zero_copy_only=False)
    if column.null_count:
        raise ValueError("a value is missing")
    return list(map(convert, column.to_pylist()))


def _loaded(lines: Iterable[str], converters: _Converters) -> np.ndarray:
    try:
        return np.loadtxt(
            lines, delimiter=",", comments=None, quotechar='"', ndmin=2, max_rows=ROWS_AT_ONCE,
            converters=converters or None,
        )  # fmt: skip
    except ValueError as error:
        # The message of a converter is clearer.
        raise error.__cause__ or error from None


def _reader(lines: Iterable[str], separator: str, strict: bool = False) -> Any:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=strict)


def _records(reader: Any, width: int) -> Iterator[Record]:
    line = reader.line_num
    for values in reader:
        line += 1
        if reader.line_num != line:
            # A lone quote, and the next one some rows later: what is between would be one value.
            raise ValueError(f"line {line}: a value in quotes continues on the next line")
        if values and len(values) != width:
            raise ValueError(f"line {line} has {len(values)} values for {width} columns")
        if values:
            yield line, values


def _after_time(names: Sequence[str]) -> tuple[str, ...]:
    if not names:
        raise ValueError("it is empty")
    first, *others = names
    if first != "time":
        raise ValueError(f"its first column is {first!r}, not 'time'")
    return tuple(others)
