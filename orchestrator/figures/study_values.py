"""The runs of a study as columns, and what figures call their values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from math import isnan
from typing import Any, TypeAlias

import numpy as np

from orchestrator.figures.style import heading
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.studies.engine import INDICES, REACHED
from orchestrator.vehicle.signals import THETA_UNITS

#: Columns of runs.parquet, an array each; what a run does not have is nan or None.
Columns: TypeAlias = Mapping[str, np.ndarray]

#: Columns that are texts.
SCENARIO, FAILURE = "scenario", "failure"

#: What figures call the indices, by the name before the dot, and their units.
_INDICES = {
    "l2_effort": ("L2 effort", {"u": "N·√s", "q": "N·m·√s", "r": "N·m·√s"}),
    "rms_effort": ("RMS effort", {"u": "N", "q": "N·m", "r": "N·m"}),
    "peak_command": ("peak command", {"u": "N", "q": "N·m", "r": "N·m"}),
    "saturated_fraction": ("share of saturated steps", {}),
    "total_variation": ("total variation", {"u": "N", "q": "N·m", "r": "N·m"}),
    "final_error": ("final error", dict.fromkeys(("", "x", "y", "z"), "m")),
    "time_to_reach": ("time to reach", {"": "s"}),
    "late_error": ("largest late error", {"": "m"}),
    "estimate_error": ("error of the estimated velocity", {"": "m/s"}),
    "theta_hat_half": ("estimate at half time", {}),
    "theta_hat_end": ("estimate at the end", {}),
    "largest_speed": ("largest speed", {"": "m/s"}),
    "largest_drift": ("largest drift", {"": "m/s"}),
}
_THETA_UNITS = {f"[{i}]": unit for i, unit in enumerate(THETA_UNITS, start=1)}

_MEMBER = re.compile(r"\.(\w+)$|(\[\d\])$")
_NORM = re.compile(r"\|(.+)\|")
_UNIT = re.compile(r" \[([^\]]*)\]$")


def _failed(columns: Columns) -> np.ndarray:
    return np.array([isinstance(text, str) and text != "" for text in columns[FAILURE]])


def _lost(columns: Columns) -> np.ndarray:
    lost: np.ndarray = ~(columns["late_error"].astype(float) <= REACHED)
    return lost


def _saturated(columns: Columns) -> np.ndarray:
    shares = [columns[name].astype(float) for name in INDICES if name.startswith("saturated_")]
    saturated: np.ndarray = np.max(shares, axis=0) > 0.0
    return saturated


#: What is true or false of a run: of several, figures show the share of those of which it is true.
VERDICTS: Mapping[str, tuple[str, Callable[[Columns], np.ndarray]]] = {
    "failed": ("share of failed runs", _failed),
    "lost": (f"share of runs not kept within {REACHED:g} m", _lost),
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

    def __init__(self, columns: Columns, labels: Mapping[str, str] | None = None) -> None:
        """Take some columns.

        Args:
            columns: of the same length.
            labels: of values, in place of what they are called otherwise.

        """
        self._columns, self._labels = columns, labels or {}

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
        if len(factors := _factors(value)) > 1:
            return " · ".join(map(self.label, factors))
        base = _MEMBER.sub("", value)
        if base not in _INDICES:
            return value
        words, units = _INDICES[base]
        member = value[len(base) :]
        if base.startswith("theta_hat"):
            name, unit = (
                rf"$\hat{{\theta}}_{member.strip('[]')}$, {words}",
                _THETA_UNITS.get(member),
            )
        else:
            name, unit = f"{words} {member[1:]}".rstrip(), units.get(member[1:])
        return f"{name} [{unit}]" if unit else name

    def name(self, value: str) -> str:
        """What a value is called, without its unit."""
        return _UNIT.sub("", self.label(value))

    def where(self, values: Mapping[str, Any]) -> Values:
        """The runs of which some columns have some values."""
        fitting = [self._columns[name] == value for name, value in values.items()]
        return self._rows(np.all(fitting, axis=0)) if fitting else self

    def _rows(self, rows: np.ndarray) -> Values:
        columns = {name: values[rows] for name, values in self._columns.items()}
        return Values(columns, self._labels)

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
            self._part(name, value)
            for name, value in zip(by, key, strict=True)
            if value is not None
        )

    def _part(self, name: str, value: Any) -> str:
        if name == SCENARIO:
            return _legend(value)
        number = f"{value:g}" if isinstance(value, int | float) else str(value)
        unit = _UNIT.search(self.label(name))
        return f"{self.name(name)} {number}" + (f" {unit[1]}" if unit else "")


def members(factor: str, columns: Columns | Sequence[str]) -> list[str]:
    """The columns that a value without a product is made of; none if there is no such value."""
    if norm := _NORM.fullmatch(factor):
        names = [name.strip() for name in norm[1].split(",")]
        return names if all(name in columns for name in names) else []
    if factor in columns:
        return [factor]
    return [name for name in columns if name.startswith((f"{factor}.", f"{factor}["))]


def is_known(value: str, columns: Sequence[str]) -> bool:
    """Whether runs with some columns have a value."""
    return value in VERDICTS or all(members(factor, columns) for factor in _factors(value))


def _factors(value: str) -> list[str]:
    return [factor.strip() for factor in value.split("*")]


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and isnan(value)


def _legend(reference: str) -> str:
    """What the lines of a scenario are called."""
    try:
        return read_scenario(reference).legend
    except InputError:
        return reference
