"""Values of an FMU over time, from a table that names its variables; two such, compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fmpy.model_description import ModelVariable

from orchestrator.exchange.verify import places_of_time, port_of
from orchestrator.formats.tables import records
from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import ROUNDING
from orchestrator.master.observers.table import Table
from orchestrator.system.component import Component
from orchestrator.system.values import BOOLEANS, finite, items_of, type_of


class Series(NamedTuple):
    """A table of values over time.

    Attributes:
        times: of its rows [s].
        columns: by the names of variables; texts of a String, else numbers.
        others: its other columns.

    """

    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    others: Sequence[str]


def read_series(path: Path, variables: Mapping[str, ModelVariable]) -> Series:
    """Read a table of variables over time.

    Raises:
        InputError: it has a mistake.

    """
    with records(path, "not a table of values over time", places_of_time) as (names, rows):
        clocks = places_of_time(names)
        if len(clocks) != 1:
            raise ValueError(f"{len(clocks) or 'no'} columns of its first line are named time")
        longest = max(map(len, variables), default=0)
        ports = {
            place: name
            for place, text in enumerate(names)
            if place not in clocks and (name := port_of(text, variables, longest)) is not None
        }
        if len({*ports.values()}) < len(ports):
            raise ValueError("two columns are of one variable")
        times: list[float] = []
        columns: dict[str, list[float | str]] = {name: [] for name in ports.values()}
        for line, row in rows:
            times.append(finite(row[clocks[0]], f"line {line}, time:"))
            if len(times) > 1 and times[-1] < times[-2]:
                raise ValueError(f"line {line}: times must not decrease")
            for place, name in ports.items():
                where = f"line {line}, {name}:"
                columns[name].append(_value(row[place], variables[name], where))
    others = [text for place, text in enumerate(names) if place not in (*clocks, *ports)]
    arrays = {name: np.array(values) for name, values in columns.items()}
    return Series(np.array(times), arrays, others)


def _value(text: str, variable: ModelVariable, where: str) -> float | str:
    fmi_type, word = type_of(variable), text.strip().lower()
    if fmi_type == "String":
        return text
    if fmi_type == "Boolean" and word in BOOLEANS:
        return float(BOOLEANS[word])
    return finite(str(items_of(variable).get(text, text)), where)


def comparison(table: Table, component: Component, expected: Series, tolerance: float) -> str:
    """Compare results with those that are expected, and say how they agree.

    A Real may differ by the tolerance, times the larger of one and its largest magnitude. Between
    two rows of ours it goes in a straight line. All others are to be equal, and hold a value until
    the next row. Of several rows of one time the first counts.

    Raises:
        InputError: they do not agree, or there is nothing to compare.

    """
    outputs = [v.name for v in component.having("output") if v.name in expected.columns]
    if not outputs:
        raise InputError("none of the columns of its results is an output")
    times, ours = expected.times, table.time
    slack = ROUNDING * max(1.0, float(np.abs(ours).max()))
    new = np.diff(times, prepend=-np.inf) > slack
    chosen = new & (times >= ours[0] - slack) & (times <= ours[-1] + slack)
    if not chosen.any():
        raise InputError(
            f"its results have no row from t = {ours[0]:g} to {ours[-1]:g} s, where it is made"
        )
    times = times[chosen]
    rows = np.searchsorted(ours, times + slack, side="right") - 1
    # Apart from rounding, most times are a row's.
    exact = np.where(np.abs(ours[rows] - times) <= slack, ours[rows], times)
    worst, first = 0.0, None
    for name in outputs:
        wanted, found = expected.columns[name][chosen], table[f"{component.name}.{name}"]
        if type_of(component.variables[name]) == "Real":
            found = np.interp(exact, ours, found)
            deviations = np.abs(found - wanted) / max(1.0, float(np.abs(wanted).max()))
            wrong, worst = deviations > tolerance, max(worst, float(deviations.max()))
        else:
            found = found[rows]
            wrong = found != wanted
        if wrong.any() and (first is None or times[wrong][0] < first[0]):
            first = times[wrong][0], name, found[wrong][0], wanted[wrong][0]
    if first is not None:
        time, name, is_now, was = first
        raise InputError(
            f"{name} differs first, at t = {time:g} s: {_shown(is_now)} instead of {_shown(was)}, "
            f"to {tolerance:g}"
        )
    left = int((new & ~chosen).sum())
    return (
        f"{len(outputs)} outputs agree in {len(times)} rows from t = {times[0]:g} to "
        f"{times[-1]:g} s{f', {left} rows are of other times' * bool(left)}; they differ by at "
        f"most {worst:.2g}, with a tolerance of {tolerance:g}"
    )


def _shown(value: object) -> str:
    return repr(str(value)) if isinstance(value, str) else f"{value:.9g}"
