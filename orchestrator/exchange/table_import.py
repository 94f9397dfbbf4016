"""A table that another tool has written: what it holds of some ports, in full."""

from __future__ import annotations

import re
from array import array
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.formats.tables import SEPARATORS, Record, records
from orchestrator.master.experiment import ROUNDING
from orchestrator.system.values import BOOLEANS, finite

#: Columns that name the time, in lower case.
_TIME = ("time", "t")

#: What ecos puts after a name.
_TYPE = re.compile(r"\[[A-Z]+\]$")


@dataclass(frozen=True)
class ForeignTable:
    """What a table holds.

    Attributes:
        time: of its rows [s], growing from zero or later.
        columns: of the ports that were asked for, those that it has, by our names.
        others: names of its other columns, as they stand there.
        repeated: how many rows are passed over, for the one before them is of the same time.

    """

    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    others: Sequence[str]
    repeated: int


def read_table(path: Path, ports: Mapping[str, str], known: Collection[str]) -> ForeignTable:
    """Read a table: every value of the time and of the ports in it, or none.

    Args:
        path: CSV with a line of names; the separators are commas, semicolons or tabs.
        ports: types of the ports that are looked for, by `component.port`.
        known: names of all ports; names of systems may stand before them.

    Raises:
        InputError: a row is not as long as the first, a time falls, a value is no number,
            or a port has two columns.

    """
    what = "not a table that can be compared"
    with records(path, what, _places_of_time) as (names, rows):
        return _table(names, rows, ports, known)


def _table(
    names: Sequence[str], rows: Iterable[Record], ports: Mapping[str, str], known: Collection[str]
) -> ForeignTable:
    if not _places_of_time(names):
        separators = ", ".join(SEPARATORS.values())
        raise ValueError(f"no column of its first line is named time (separators are {separators})")
    clock, *more = _places_of_time(names)
    if more:
        raise ValueError(f"{1 + len(more)} columns are named {names[clock].strip()}")
    places: dict[str, int] = {}
    longest = max(map(len, known), default=0)
    for place, name in enumerate(names):
        port = _port_of(name, known, longest)
        port = port if port in ports else None
        if port in places:
            raise ValueError(f"columns {1 + places[port]} and {1 + place} are both {port}")
        if port is not None and place != clock:
            places[port] = place
    time, columns = array("d"), {port: array("d") for port in places}
    for expected, (line, row) in enumerate(rows, start=2):
        if line != expected:
            raise ValueError(f"line {expected} is empty")
        where = f"line {line}"
        time.append(finite(row[clock], f"{where}, time:"))
        if time[-1] < 0.0:
            raise ValueError(f"{where}: time {time[-1]:g} s is before the start at 0 s")
        if len(time) > 1 and time[-1] < time[-2]:
            raise ValueError(
                f"{where}: time {time[-1]:.9g} s follows {time[-2]:.9g} s; it must not fall"
            )
        for port, place in places.items():
            columns[port].append(_value(row[place], ports[port], f"{where}, {names[place]}"))
    others = [name for i, name in enumerate(names) if i not in (clock, *places.values())]
    times = np.array(time)
    new = np.diff(times, prepend=-np.inf) > ROUNDING * times
    return ForeignTable(
        times[new],
        {port: np.array(column)[new] for port, column in columns.items()},
        others,
        len(times) - int(new.sum()),
    )


def _places_of_time(names: Sequence[str]) -> list[int]:
    lowered = [name.strip().lower() for name in names]
    found = ([i for i, name in enumerate(lowered) if name == time] for time in _TIME)
    return next(filter(None, found), [])


def _port_of(name: str, known: Collection[str], longest: int) -> str | None:
    """Our name of a column: some tools write component::port, [REAL] after it, or systems before.

    Args:
        name: of the column.
        known: our names; of those that it ends with, the longest counts.
        longest: length of the longest of them.

    """
    name = name.strip()
    plain = _TYPE.sub("", name).replace("::", ".")
    end = plain[-longest - 1 :]
    ends = (end[i + 1 :] for i, character in enumerate(end) if character == ".")
    return next((ours for ours in (name, plain, *ends) if ours in known), None)


def _value(text: str, kind: str, where: str) -> float:
    words = BOOLEANS if kind == "Boolean" else {}
    word = text.strip().lower()
    return float(words[word]) if word in words else finite(text, f"{where}:")
