"""Whether a table agrees with a run: judged without anything of the program's own."""

from __future__ import annotations

import csv
import re
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from decimal import Decimal
from itertools import pairwise
from typing import NamedTuple

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

#: Times whose distance is a smaller share of them are one.
_SAME = 1e-9


class Agreement(NamedTuple):
    """How much of a table was compared: columns, rows, and from when to when [s]."""

    columns: int
    rows: int
    start: float
    end: float


def agreement(
    content: bytes, run: Mapping[str, Sequence[float]], booleans: set[str], tolerance: float
) -> Agreement | None:
    """What a table that agrees in full has; None: it does not, or it is no table.

    Args:
        content: of the file.
        run: columns of the run by `component.port`, and `time`.
        booleans: columns whose values may be words.
        tolerance: relative to the larger of one and the largest value compared.

    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    lines = re.split("\r\n|\r|\n", text)
    while lines and not lines[-1]:
        lines.pop()
    for separator in ",;\t":
        rows = [_fields(line, separator) for line in lines]
        if rows and rows[0] and any(name.lower().strip() in ("time", "t") for name in rows[0]):
            return _agreement(rows, run, booleans, tolerance)
    return None


def _fields(line: str, separator: str) -> list[str] | None:
    """The fields of a line, some in quotes; None: the quotes are not well set."""
    reader = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    try:
        return next(reader, [""])
    except csv.Error:
        return None


def _agreement(  # noqa: PLR0911  # one for each thing that can be wrong
    rows: list[list[str] | None],
    run: Mapping[str, Sequence[float]],
    booleans: set[str],
    tolerance: float,
) -> Agreement | None:
    names, *body = rows
    if names is None or any(row is None or len(row) != len(names) for row in body):
        return None
    lowered = [name.strip().lower() for name in names]
    clock = lowered.index("time" if "time" in lowered else "t")
    if lowered.count(lowered[clock]) > 1:
        return None
    times = [_number(row[clock]) for row in body if row is not None]
    if None in times or not times or not times[-1]:
        return None
    known = [float(time) for time in times if time is not None]
    if known[0] < 0 or any(a > b for a, b in pairwise(known)):
        return None
    first = [True, *(b - a > _SAME * b for a, b in pairwise(known))]
    compared: dict[str, int] = {}
    for i, name in enumerate(names):
        parts = re.sub(r"\[[A-Z]+\]$", "", name.strip()).replace("::", ".").split(".")
        # No name of a port has more parts.
        ends = {".".join(parts[-n:]) for n in range(2, min(len(parts), 5) + 1)}
        for port in (ends | {name.strip()}) & run.keys() - {"time"}:
            if port in compared:
                return None
            compared[port] = i
    for port, place in compared.items():
        cells = [row[place] for row in body if row is not None]
        words = {"true": 1.0, "false": 0.0} if port in booleans else {}
        values = [words.get(cell.strip().lower(), _number(cell)) for cell in cells]
        expected = [_at(time, run["time"], run[port]) for time in known]
        largest = max(abs(x) for x, counts in zip(expected, first, strict=True) if counts)
        accepted = tolerance * max(1.0, largest) * (1 + 1e-9)
        for counts, time, value, wanted in zip(first, known, values, expected, strict=True):
            if value is None or (counts and time > 0.0 and not abs(value - wanted) <= accepted):
                return None
    after = [time for time, counts in zip(known, first, strict=True) if counts and time > 0.0]
    return Agreement(len(compared), len(after), after[0], after[-1]) if compared else None


def _number(text: str) -> float | None:
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return None
    number = Decimal(text)
    return float(number) if abs(number) < Decimal("1.7e308") else None


def _at(time: float, times: Sequence[float], values: Sequence[float]) -> float:
    """The value of a run at a time, linear between its rows."""
    i = min(max(bisect_left(times, time), 1), len(times) - 1)
    share = (time - times[i - 1]) / (times[i] - times[i - 1])
    return values[i - 1] + min(share, 1.0) * (values[i] - values[i - 1])
