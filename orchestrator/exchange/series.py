"""Values of an FMU over time, from a table that names its variables; two such, compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.cosim import Component, Experiment, Table, Value, Variable
from orchestrator.machine.errors import InputError
from orchestrator.runs.tables import places_of_time, port_of, records, time_of


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


def read_series(path: Path, variables: Sequence[Variable]) -> Series:
    """Read a table of variables over time; a column of an array holds all of it in each row.

    Raises:
        InputError: it has a mistake.

    """
    known: dict[str, list[Variable]] = {}
    for variable in variables:
        known.setdefault(variable.name, []).append(variable)
        if variable.shape and variable.family != "String":
            known.setdefault(variable.array, []).append(variable)
    with records(path, "not a table of values over time", places_of_time) as (names, rows):
        clocks = places_of_time(names)
        if not clocks:
            raise ValueError("no column of its first line is named time")
        longest = max(map(len, known), default=0)
        ports = {
            place: known[name]
            for place, text in enumerate(names)
            if place not in clocks and (name := port_of(text, known, longest)) is not None
        }
        found = [variable.name for group in ports.values() for variable in group]
        if len({*found}) < len(found):
            raise ValueError("two columns belong to the same variable")
        times: list[float] = []
        columns: dict[str, list[Value]] = {name: [] for name in found}
        for line, row in rows:
            times.append(time_of(row, clocks, f"line {line}"))
            if len(times) > 1 and times[-1] < times[-2]:
                raise ValueError(f"line {line}: times must not decrease")
            for place, group in ports.items():
                cells = [row[place]] if len(group) == 1 else row[place].split()
                if len(cells) != len(group):
                    raise ValueError(
                        f"line {line}, {names[place]}: {len(cells)} values of an array of "
                        f"{len(group)}"
                    )
                for variable, text in zip(group, cells, strict=True):
                    where = f"line {line}, {variable.name}:"
                    columns[variable.name].append(variable.cell(text, where))
    others = [text for place, text in enumerate(names) if place not in (*clocks, *ports)]
    arrays = {name: np.array(values) for name, values in columns.items()}
    return Series(np.array(times), arrays, others)


def comparison(
    table: Table, component: Component, expected: Series, tolerance: float, stop_time: float
) -> str:
    """Compare results with those that are expected, and say how they agree.

    A Real may differ by the tolerance, times the larger of one and its largest magnitude. Between
    two rows of ours it goes in a straight line. All others are to be equal, and hold a value until
    the next row. Of several rows of one time the first counts.

    Raises:
        InputError: they do not agree, there is nothing to compare, or the run ended before the stop
            time and before the expected results do.

    """
    if not expected.columns:
        raise InputError("none of the columns of its results is an output")
    times, ours = expected.times, table.time
    slack = Experiment.ROUNDING * max(1.0, float(np.abs(ours).max()))
    new = np.diff(times, prepend=-np.inf) > slack
    chosen = new & (times >= ours[0] - slack) & (times <= ours[-1] + slack)
    if not chosen.any():
        raise InputError(
            f"its results have no row from t = {ours[0]:g} to {ours[-1]:g} s, the time of the run"
        )
    if (new & (times > ours[-1] + slack) & (times <= stop_time + slack)).any():
        raise InputError(f"ended at t = {ours[-1]:g} s, before its results end")
    times = times[chosen]
    rows = np.searchsorted(ours, times + slack, side="right") - 1
    # Apart from rounding, most times are a row's.
    exact = np.where(np.abs(ours[rows] - times) <= slack, ours[rows], times)
    worst, first = 0.0, None
    for name, column in expected.columns.items():
        wanted, found = column[chosen], table[f"{component.name}.{name}"]
        if component.variables[name].family == "Real":
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
            f"with a tolerance of {tolerance:g}"
        )
    left = int((new & ~chosen).sum())
    n = len(expected.columns)
    outputs = f"{n} outputs agree" if n > 1 else f"{n} output agrees"
    others = f", {left} rows are outside the run" * bool(left)
    return (
        f"{outputs} in {len(times)} rows from t = {times[0]:g} to {times[-1]:g} s{others}; "
        f"they differ by at most {worst:.2g}, with a tolerance of {tolerance:g}"
    )


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    return repr(str(value)) if isinstance(value, str) else str(value)
