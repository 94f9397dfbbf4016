"""What figures of a study show: kinds of figures, the runs as columns, and bins of their values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from math import isnan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from orchestrator.figures.style import heading, printed_unit
from orchestrator.vehicle import indices
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.indices import SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL, Index

#: Columns of runs.parquet, an array each; what a run does not have is nan or None.
Columns: TypeAlias = Mapping[str, np.ndarray]

#: Columns that are texts.
SCENARIO, FAILURE, CAUTION = "scenario", "failure", "caution"

#: Up to so many different values have a bin each.
_GRID = 40

#: An axis is logarithmic if its values are positive, and a large one, larger than this share of
#: them, is so many times a small one.
_LARGE, _WIDE = 0.95, 10.0

#: The ratios of a geometric grid differ by less than this share of what they exceed 1 by.
_EVEN = 1e-6

_NORM = re.compile(r"\|(.+)\|")
_UNIT = re.compile(r" \[([^\]]*)\]$")


class Chart(NamedTuple):
    """What a figure of a study needs, and what it may have beside."""

    needs: Sequence[str]
    may: Sequence[str]


#: What figures show, by the names that study files have for it under `kind`; one shows by itself
#: all that varies.
INFLUENCE = "influence"
CHARTS: Mapping[str, Chart] = {
    "bands": Chart(("x", "show"), ("by", "where", "limits")),
    "maps": Chart(("x", "y", "show"), ("by", "where", "limits")),
    "front": Chart(("x", "y"), ("by", "where")),
    INFLUENCE: Chart(("show",), ("x", "by", "where")),
}


@dataclass(frozen=True)
class FigureEntry:
    """A figure that is to be drawn, as a study file has it.

    Attributes:
        name: of its files.
        logarithmic: whether the axes of values that are sampled are; the spread of others says it.

    """

    name: str
    chart: str
    x: Sequence[str] = ()
    y: str = ""
    show: Sequence[str] = ()
    by: Sequence[str] = ()
    where: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    logarithmic: Mapping[str, bool] = field(default_factory=dict)


def _failed(columns: Columns) -> np.ndarray:
    return np.array([isinstance(text, str) and text != "" for text in columns[FAILURE]])


def _parts(value: str) -> tuple[Index, str, str] | None:
    """The index that a column or group is of, its member and its vehicle; None: it is another."""
    names = "|".join(index.name for index in indices.INDICES)
    found = re.fullmatch(rf"(?:(.+)\.)?({names})(?:\.(\w+)|\[(\d+)\])?", value)
    if found is None:
        return None
    vehicle, name, *member = found.groups()
    [index] = (index for index in indices.INDICES if index.name == name)
    return index, next(filter(None, member), ""), vehicle or ""


def _largest(columns: Columns, index: str) -> np.ndarray:
    """The largest member of an index of each run, of all its vehicles."""
    named = [name for name in columns if (parts := _parts(name)) and parts[0].name == index]
    largest: np.ndarray = np.max([columns[name].astype(float) for name in named], axis=0)
    return largest


def _lost(columns: Columns) -> np.ndarray:
    lost: np.ndarray = ~(_largest(columns, "late_error") <= REACHED)
    return lost


def _saturated(columns: Columns) -> np.ndarray:
    saturated: np.ndarray = _largest(columns, "saturated_fraction") > 0.0
    return saturated


#: What is true or false of a run: of several, figures show the share of runs of which it is true.
VERDICTS: Mapping[str, tuple[str, Callable[[Columns], np.ndarray]]] = {
    "failed": ("share of failed runs", _failed),
    "lost": (f"share of runs with a late error above {REACHED:g} m", _lost),
    "saturated": ("share of runs that saturate", _saturated),
}


class Values:
    """The values of some runs.

    A value is a column, or one of :data:`VERDICTS`, or is made of columns:

    ====================  ==============================================================
    `peak_command`        the largest member of a group
    `|a, b, c|`           the root of the sum of the squares
    `a * b`               the product
    ====================  ==============================================================
    """

    def __init__(
        self,
        columns: Columns,
        labels: Mapping[str, str] | None = None,
        legends: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> None:
        """Take some columns.

        Args:
            columns: of the same length.
            labels: of values, in place of what they are called otherwise.
            legends: what the lines of scenarios are called.
            units: of parameters, as FMUs write them.

        """
        self._columns, self._labels, self._legends = columns, labels or {}, legends or {}
        self._units = units or {}

    def __getitem__(self, value: str) -> np.ndarray:
        """A value of each run; nan where it has none."""
        if value in VERDICTS:
            return VERDICTS[value][1](self._columns).astype(float)
        factors = [self._factor(factor) for factor in _factors(value)]
        product: np.ndarray = reduce(np.multiply, factors)
        return product

    def _factor(self, factor: str) -> np.ndarray:
        columns = [self._columns[name].astype(float) for name in members(factor, self._columns)]
        reduction = np.linalg.norm if _NORM.fullmatch(factor) else np.max
        values: np.ndarray = reduction(columns, axis=0)
        return values

    def label(self, value: str) -> str:
        """What a value is called, with its unit in brackets."""
        if value in self._labels:
            return heading(self._labels[value])
        if value in VERDICTS:
            return VERDICTS[value][0]
        if value == SMALLEST_DISTANCE:
            return f"{SMALLEST_DISTANCE_LABEL} [m]"
        if len(factors := _factors(value)) > 1:
            return " · ".join(map(self.label, factors))
        if (parts := _parts(value)) is None:
            unit = printed_unit(self._units.get(value, ""))
            return f"{value} [{unit}]" if unit else value
        index, member, vehicle = parts
        units = {str(m): printed_unit(unit) for m, unit in index.units.items()}
        # A group may have one unit.
        unit = units.get(member, next(iter(units.values())) if len({*units.values()}) == 1 else "")
        symbol = f"{index.symbol}_{member}" if member else index.symbol
        text = f"${symbol}$, {index.label}" if index.symbol else f"{index.label} {member}".rstrip()
        return ", ".join(filter(None, (text, vehicle))) + (f" [{unit}]" if unit else "")

    def name(self, value: str) -> str:
        """What a value is called, without its unit."""
        return _UNIT.sub("", self.label(value))

    def where(self, values: Mapping[str, Any]) -> Values:
        """The runs of which some columns have some values."""
        fitting = [self._columns[name] == value for name, value in values.items()]
        return self._rows(np.all(fitting, axis=0)) if fitting else self

    def _rows(self, rows: np.ndarray) -> Values:
        columns = {name: values[rows] for name, values in self._columns.items()}
        return Values(columns, self._labels, self._legends, self._units)

    def parts(self, by: Sequence[str]) -> Iterator[tuple[str, Values]]:
        """The runs that agree in some columns, and what tells them from the others.

        Args:
            by: names of columns; a run that lacks one of these differs from all that have it.

        """
        keys = list(zip(*(self._columns[name].tolist() for name in by), strict=True))
        keys = [tuple(None if _is_nan(part) else part for part in key) for key in keys]
        for key in dict.fromkeys(keys):
            yield self._name(by, key), self._rows(np.array([other == key for other in keys]))
        if not by:
            yield "", self

    def _name(self, by: Sequence[str], key: Sequence[Any]) -> str:
        return ", ".join(
            self.named(name, value)
            for name, value in zip(by, key, strict=True)
            if value is not None
        )

    def named(self, name: str, value: Any) -> str:
        """What runs with a value in a column are called."""
        if name == SCENARIO:
            return self._legends.get(value, value)
        number = f"{value:g}" if isinstance(value, int | float) else str(value)
        unit = _UNIT.search(self.label(name))
        return f"{self.name(name)} {number}" + (f" {unit[1]}" if unit else "")


def members(factor: str, columns: Columns | Sequence[str]) -> list[str]:
    """The columns that a value without a product is made of; none if there is no such value."""
    if _NORM.fullmatch(factor):
        names = names_of(factor)
        return names if all(name in columns for name in names) else []
    if factor in columns:
        return [factor]
    return [name for name in columns if name.startswith((f"{factor}.", f"{factor}["))]


def is_known(value: str, columns: Sequence[str]) -> bool:
    """Whether runs with some columns have a value."""
    return value in VERDICTS or all(members(factor, columns) for factor in _factors(value))


def names_of(value: str) -> list[str]:
    """The names that a value is made of."""
    norms = ((factor, _NORM.fullmatch(factor)) for factor in _factors(value))
    found = (norm[1].split(",") if norm else [factor] for factor, norm in norms)
    return [name.strip() for names in found for name in names]


def _factors(value: str) -> list[str]:
    # A star without spaces stands for any text in the name of a component.
    return [factor.strip() for factor in value.split(" * ")]


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and isnan(value)


@dataclass(frozen=True)
class Bins:
    """The bins of an axis.

    Attributes:
        edges: one more than there are bins.
        centres: of the bins; of a grid, its values.
        is_logarithmic: whether the axis is.

    """

    edges: np.ndarray
    centres: np.ndarray
    is_logarithmic: bool

    def places(self, values: np.ndarray) -> np.ndarray:
        """The number of the bin of each value."""
        places: np.ndarray = np.searchsorted(self.edges[1:-1], values, side="right")
        return places


def is_logarithmic(values: np.ndarray) -> bool:
    """Whether values are spread so far that only a logarithmic axis shows them all."""
    values = values[np.isfinite(values)]
    if not values.size or values.min() <= 0.0:
        return False
    small, large = np.quantile(values, (1.0 - _LARGE, _LARGE))
    return bool(large >= _WIDE * small)


def is_geometric(grid: np.ndarray) -> bool:
    """Whether the values of a grid, in order, are the same number of times each other."""
    if len(grid) < 3 or grid[0] <= 0.0:
        return False
    times = grid[1:] / grid[:-1]
    return bool(np.ptp(times) < _EVEN * (times[0] - 1.0))


def bins_of(
    values: np.ndarray, most: int, *, are_full: bool = False, is_wide: bool | None = None
) -> Bins:
    """Bins for some values, at least one of which is finite.

    Args:
        values: of a grid, or anywhere.
        most: how many bins there are for values that do not form a grid.
        are_full: whether these have as many values each, and not the same width.
        is_wide: whether the axis is logarithmic; None: where the values ask for it.

    """
    values = values[np.isfinite(values)]
    asked = is_logarithmic(values) or is_geometric(np.unique(values))
    wide = asked if is_wide is None else is_wide
    places = np.unique(np.log(values) if wide else values)
    if len(places) > _GRID:
        even = np.linspace(0.0, 1.0, most + 1)
        edges = np.quantile(places, even) if are_full else np.interp(even, (0, 1), places[[0, -1]])
        centres = 0.5 * (edges[1:] + edges[:-1])
    else:
        between = 0.5 * (places[1:] + places[:-1])
        # The outer bins are as wide as they would be with one more neighbour.
        first, last = (between[0], between[-1]) if between.size else (places + 0.5, places - 0.5)
        edges = np.hstack((2.0 * places[0] - first, between, 2.0 * places[-1] - last))
        centres = places
    if wide:
        edges, centres = np.exp(edges), np.exp(centres)
    return Bins(edges, centres, wide)


def grouped(places: np.ndarray, values: np.ndarray, n: int) -> list[np.ndarray]:
    """The finite values of each of n bins.

    Args:
        places: the number of the bin of each value.
        values: to be grouped.
        n: how many bins there are.

    """
    finite = np.isfinite(values)
    places, values = places[finite], values[finite]
    order = np.argsort(places, kind="stable")
    return np.split(values[order], np.searchsorted(places[order], np.arange(1, n)))
