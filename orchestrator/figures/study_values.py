"""Figures of a study as its file declares them, and the values of its runs that they show."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from math import isnan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from orchestrator.figures.style import heading, printed_unit
from orchestrator.vehicle import indices
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.indices import SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL, Index

#: Columns of runs.parquet as arrays; a missing value is nan or None.
Columns: TypeAlias = Mapping[str, np.ndarray]

#: Columns of texts.
SCENARIO, FAILURE, CAUTION = "scenario", "failure", "caution"

_NORM = re.compile(r"\|(.+)\|")
_UNIT = re.compile(r" \[([^\]]*)\]$")


class Chart(NamedTuple):
    """Entries that a kind of figure needs, and those that it may have."""

    needs: Sequence[str]
    may: Sequence[str]


#: Kinds of figures by their names in study files; a figure of influence needs no x.
INFLUENCE = "influence"
CHARTS: Mapping[str, Chart] = {
    "bands": Chart(("x", "show"), ("by", "where", "limits")),
    "maps": Chart(("x", "y", "show"), ("by", "where", "limits")),
    "front": Chart(("x", "y"), ("by", "where")),
    INFLUENCE: Chart(("show",), ("x", "by", "where")),
}


@dataclass(frozen=True)
class FigureEntry:
    """A figure of a study file; `name` is the stem of its files."""

    name: str
    chart: str
    x: Sequence[str] = ()
    y: str = ""
    show: Sequence[str] = ()
    by: Sequence[str] = ()
    where: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)


def _index_of(value: str) -> tuple[Index, str, str] | None:
    """Return the index, the member and the vehicle of a column or group; None for another value."""
    names = "|".join(index.name for index in indices.INDICES)
    match = re.fullmatch(rf"(?:(.+)\.)?({names})(?:\.(\w+)|\[(\d+)\])?", value)
    if match is None:
        return None
    vehicle, name, *member = match.groups()
    [index] = (index for index in indices.INDICES if index.name == name)
    return index, next(filter(None, member), ""), vehicle or ""


def _numbers(columns: Columns, name: str) -> np.ndarray:
    return columns[name].astype(float, copy=False)


def _largest(columns: Columns, index: str) -> np.ndarray:
    """Return the largest member of an index in each run, over all vehicles."""
    named = [name for name in columns if (parts := _index_of(name)) and parts[0].name == index]
    return reduce(np.maximum, (_numbers(columns, name) for name in named))


#: Values that are true or false for a run: labels, and functions of the columns. Figures show the
#: share of runs for which they are true.
VERDICTS: Mapping[str, tuple[str, Callable[[Columns], np.ndarray]]] = {
    "failed": (
        "share of failed runs",
        lambda columns: np.array(
            [isinstance(text, str) and text != "" for text in columns[FAILURE]]
        ),
    ),
    "lost": (
        f"share of runs with a late error above {REACHED:g} m",
        lambda columns: ~(_largest(columns, "late_error") <= REACHED),
    ),
    "saturated": (
        "share of runs that saturate",
        lambda columns: _largest(columns, "saturated_fraction") > 0.0,
    ),
}


class _Some(Mapping[str, np.ndarray]):
    """Some rows of columns, each of which is read when it is needed."""

    def __init__(self, columns: Columns, rows: np.ndarray) -> None:
        self._columns, self._rows = columns, rows

    def __getitem__(self, name: str) -> np.ndarray:
        some: np.ndarray = self._columns[name][self._rows]
        return some

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


@dataclass(frozen=True)
class Values:
    """The values of some runs.

    A value is a column, one of :data:`VERDICTS`, or made of columns:

    ====================  ==============================================================
    `peak_command`        the largest member of a group
    `|a, b, c|`           the root of the sum of the squares
    `a * b`               the product
    ====================  ==============================================================

    Attributes:
        columns: of runs.parquet, of the same length.
        labels: of values, instead of the usual ones.
        legends: of scenarios.
        units: of parameters, as FMUs write them.
        logarithmic: True for sampled values whose axes are logarithmic.

    """

    columns: Columns
    labels: Mapping[str, str] = field(default_factory=dict)
    legends: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    logarithmic: Mapping[str, bool] = field(default_factory=dict)

    def __getitem__(self, value: str) -> np.ndarray:
        """Return a value of each run, or nan."""
        if value in VERDICTS:
            return VERDICTS[value][1](self.columns).astype(float)
        product: np.ndarray = reduce(np.multiply, map(self._factor, _factors(value)))
        return product

    def _factor(self, factor: str) -> np.ndarray:
        # One after the other, since all at once would not fit the memory.
        columns = (_numbers(self.columns, name) for name in members(factor, self.columns))
        if _NORM.fullmatch(factor):
            squares: np.ndarray = reduce(np.add, (column * column for column in columns))
            norm: np.ndarray = np.sqrt(squares)
            return norm
        return reduce(np.maximum, columns)

    def label(self, value: str) -> str:
        """Return the label of a value, with its unit in brackets."""
        if value in self.labels:
            return heading(self.labels[value])
        if value in VERDICTS:
            return VERDICTS[value][0]
        if value == SMALLEST_DISTANCE:
            return f"{SMALLEST_DISTANCE_LABEL} [m]"
        if len(factors := _factors(value)) > 1:
            return " · ".join(map(self.label, factors))
        if (parts := _index_of(value)) is None:
            unit = printed_unit(self.units.get(value, ""))
            return f"{value} [{unit}]" if unit else value
        index, member, vehicle = parts
        units = {str(m): printed_unit(unit) for m, unit in index.units.items()}
        # A group may have one unit.
        unit = units.get(member, next(iter(units.values())) if len({*units.values()}) == 1 else "")
        symbol = f"{index.symbol}_{member}" if member else index.symbol
        text = f"${symbol}$, {index.label}" if index.symbol else f"{index.label} {member}".rstrip()
        return ", ".join(filter(None, (text, vehicle))) + (f" [{unit}]" if unit else "")

    def name(self, value: str) -> str:
        """Return the label of a value without its unit."""
        return _UNIT.sub("", self.label(value))

    def where(self, values: Mapping[str, Any]) -> Values:
        """Return the runs with some values in some columns."""
        fitting = [self.columns[name] == value for name, value in values.items()]
        if not fitting:
            return self
        return replace(self, columns=_Some(self.columns, np.flatnonzero(np.all(fitting, axis=0))))

    def parts(self, by: Sequence[str]) -> tuple[list[str], np.ndarray]:
        """Split the runs into those that agree in some columns.

        A run without a value in one of the columns differs from all that have one.

        Returns:
            Texts that distinguish the parts, and the place of each run's part among them.

        """
        columns = [self.columns[name] for name in by]
        if not columns:
            return [""], np.zeros(len(next(iter(self.columns.values()))), dtype=np.uint8)
        first, places = _parts(columns)
        keys = zip(*(column[first].tolist() for column in columns), strict=True)
        pairs = (zip(by, key, strict=True) for key in keys)
        return [
            ", ".join(self.named(*pair) for pair in some if not _is_missing(pair[1]))
            for some in pairs
        ], places

    def named(self, name: str, value: Any) -> str:
        """Return a text for the runs with a value in a column."""
        if name == SCENARIO:
            return self.legends.get(value, value)
        number = f"{value:g}" if isinstance(value, int | float) else str(value)
        unit = _UNIT.search(self.label(name))
        return f"{self.name(name)} {number}" + (f" {unit[1]}" if unit else "")


def members(factor: str, columns: Columns | Sequence[str]) -> list[str]:
    """Return the columns of a value that is not a product; none if there is no such value."""
    if _NORM.fullmatch(factor):
        names = names_of(factor)
        return names if all(name in columns for name in names) else []
    if factor in columns:
        return [factor]
    return [name for name in columns if name.startswith((f"{factor}.", f"{factor}["))]


def is_known(value: str, columns: Sequence[str]) -> bool:
    """Return true if runs with some columns have a value."""
    return value in VERDICTS or all(members(factor, columns) for factor in _factors(value))


def names_of(value: str) -> list[str]:
    """Return the names in a value."""
    norms = ((factor, _NORM.fullmatch(factor)) for factor in _factors(value))
    parts = (norm[1].split(",") if norm else [factor] for factor, norm in norms)
    return [name.strip() for names in parts for name in names]


def _factors(value: str) -> list[str]:
    # A star without spaces is a wildcard in the name of a component.
    return [factor.strip() for factor in value.split(" * ")]


def _is_missing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and isnan(value))


def _parts(columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the first row of each combination of values, and the place of each row's."""
    codes = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        if column.dtype == object:
            known = dict[Any, int]()
            every = [known.setdefault(value, len(known)) for value in column.tolist()]
            codes = codes * len(known) + every
        else:
            distinct = np.unique(column)
            codes = codes * len(distinct) + np.searchsorted(distinct, column)
    # Small numbers are sorted sooner.
    codes = codes.astype(np.min_scalar_type(codes.max()))
    _, first, places = np.unique(codes, return_index=True, return_inverse=True)
    order = np.argsort(first)
    ranks = np.argsort(order).astype(np.min_scalar_type(len(order)))
    return first[order], ranks[places]
