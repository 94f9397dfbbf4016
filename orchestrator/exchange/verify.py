"""Verification of a table from any tool by our own runs of the same system."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import inf
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.cosim import (
    Ending,
    Event,
    Events,
    Exchange,
    Experiment,
    Header,
    Hook,
    Observer,
    Order,
    PortName,
    Run,
    System,
    make_plan,
    simulate_plan,
)
from orchestrator.machine.errors import InputError
from orchestrator.machine.texts import BOOLEANS, finite
from orchestrator.runs.preparation import DEFAULT_STEP
from orchestrator.runs.tables import SEPARATORS, places_of_time, port_of, records, time_of

#: Default of the largest accepted difference.
TOLERANCE = 1e-6

#: Number of names that are listed if not all are.
_FIRST = 5

#: Description of the exchange before the first step.
_STARTS = {
    "full": "",
    "none": ", no values exchanged in initialisation mode",
    "zero": ", no values exchanged before the first step",
}


class Algorithm(NamedTuple):
    """A way in which a tool may run a system.

    Attributes:
        order: order of its components.
        coupling: how its rings are closed.
        exchange: exchange of values.
        words: description for messages.
        turned: if set, outputs are read on the other side of the exchange of values than in ours.

    """

    order: Order
    coupling: str | None
    exchange: Exchange
    words: str
    turned: bool = False

    def turn(self) -> Algorithm:
        """Return the same algorithm with outputs read on the other side."""
        side = "before" if self.order == "feedthrough" else "after"
        words = f"{self.words}, outputs read {side} values are passed on"
        return self._replace(words=words, turned=True)

    def run(self, system: System, experiment: Experiment, observer: Observer, *hooks: Hook) -> None:
        """Run a system this way.

        Raises:
            InputError: it cannot be run to its end.

        """
        experiment = replace(experiment, order=self.order, coupling=self.coupling)
        plan = make_plan(system, experiment)
        if self.turned:
            turned = _Turned(observer)
            observer, hooks = turned, (*hooks, turned)
        ending = simulate_plan(plan, [observer], hooks, self.exchange)
        ending.require_success(system.name)


class _Turned:
    """An observer's view of a tool that reads outputs on the other side of the exchange.

    Our master reads outputs after values were passed on in feedthrough order, and before in the
    others. As a hook, this reads them again between two steps and restores the row.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self.begin, self.end = observer.begin, observer.end

    def take(self, rows: np.ndarray) -> None:
        """Ignore the master's own rows."""

    def act(self, run: Run) -> int:
        """Pass the current row to the observer."""
        row, before = run.row, run.row.values.copy()
        if run.passing is None:
            for name in run.instances:
                run.overrides.refresh(name)
            for instance in run.instances.values():
                instance.exchange()
        else:
            for name, component in run.system.components.items():
                outputs = [variable.name for variable in component.having("output")]
                held = run.instances[name].read(outputs)
                row.enter({PortName(name, port): value for port, value in held.items()})
        shown = row.shown.copy()
        row.arrange(shown)
        self._observer.take(np.array([[run.time, *shown]]))
        row.values[:] = before
        return run.made + 1


def verify(
    path: Path,
    system: System,
    tolerance: float,
    order: Order | None = None,
    *,
    events: Sequence[Event] = (),
    initial: str = "full",
    verbose: bool = False,
) -> str:
    """Compare a table from any tool with our own runs of the same system.

    Every row after the start and every column that is named after an output is compared, except
    Strings. Columns of inputs are not: tools write them before or after the exchange.

    Args:
        path: CSV with a time column and columns named after our ports.
        system: the system that the tool ran.
        tolerance: largest accepted difference, relative to the larger of one and the largest
            magnitude of the port.
        order: order in which the tool steps the components, with `a+b` for components that it
            steps side by side; None: one of :data:`Experiment.ORDERS`.
        events: events of its run.
        initial: values that it exchanges before the first step.
        verbose: if set, list all names of what was not compared.

    Returns:
        Lines on what agrees, with which order of evaluation, and on what was not compared.

    Raises:
        InputError: the file cannot be read in full, has no column of an output, or differs in every
            order; the text names the port that differs first.

    """
    check_tolerance(tolerance)
    algorithms = list(ways(system, order, initial))
    outputs = {
        str(PortName(component.name, variable.name)): variable.family
        for component in system.components.values()
        for variable in component.having("output")
        if variable.family != "String"
    }
    if not outputs:
        raise InputError(f"{system.name}: has no numeric output to compare")
    known = {
        str(PortName(component.name, variable))
        for component in system.components.values()
        for variable in component.variables
    }
    # The table of a tool that runs a single FMU may have names without the component.
    names = [f"{name}." for name in system.components]
    start = system.start_time or 0.0
    table = read_table(path, outputs, known, names[0] if len(names) == 1 else "", start)
    if not len(table.time) or not table.time[-1] > start:
        raise InputError(f"{path}: has no row after t = {start:g}")
    if not table.columns:
        raise InputError(
            f"{path}: no column is named after an output; outputs are named like {min(outputs)}"
            f"{_of_one(system, outputs, table.others)}"
        )
    step = DEFAULT_STEP if system.step is None else system.step
    experiment = Experiment(float(table.time[-1]), step, start_time=start)
    complaints = []
    # Most tools read outputs on the same side of the exchange as our master.
    for way in [*algorithms, *(way.turn() for way in algorithms)]:
        complaint = _complaint(table, system, experiment, events, way, tolerance)
        if complaint is None:
            return "\n".join(_certificate(table, start, system, outputs, way, tolerance, verbose))
        complaints.append(complaint)
    # The side on which a way agrees for longer is the likelier one.
    n = len(algorithms)
    likelier = (max(pair) for pair in zip(complaints[:n], complaints[n:], strict=True))
    mismatch = f"not a run of {system.name}, which --scenario names"
    raise InputError(f"{path}: {mismatch}: {'; '.join(text for _, text in likelier)}")


def _of_one(system: System, outputs: Collection[str], columns: Sequence[str]) -> str:
    """Return a hint if the table looks like one of a tool that ran only one component."""
    longest = max(map(len, outputs), default=0)
    counts = {
        component.fmu.name: sum(
            port_of(f"{name}.{column.strip()}", outputs, longest) is not None for column in columns
        )
        for name, component in system.components.items()
    }
    fmu = max(counts, key=counts.__getitem__)
    if not counts[fmu]:
        return ""
    return f"; for the table of a tool that ran only {fmu}, add --scenario {fmu}"


def check_tolerance(tolerance: float) -> None:
    """Check that a tolerance is at least 0 and less than 1.

    Raises:
        InputError: it is not: nothing, or anything, would agree.

    """
    if not 0.0 <= tolerance < 1.0:
        raise InputError(f"tolerance {tolerance:g}: must be at least 0 and less than 1")


def ways(system: System, order: Order | None, initial: str) -> Iterator[Algorithm]:
    """Yield the ways to run a system that a table may agree with, the likeliest first.

    Raises:
        InputError: there is no such order.

    """
    exchange, start = Exchange(initial), _STARTS[initial]
    if isinstance(order, str):
        Experiment(DEFAULT_STEP, DEFAULT_STEP, order)
    elif order is not None:
        groups = [name.split("+") for name in order]
        names = tuple(chain(*groups))
        system.check_order(names)
        words = (
            f"in the order {Experiment.format_order(order)}, each with the latest outputs{start}"
        )
        yield Algorithm(names, None, replace(exchange, groups=groups), words)
        if names != tuple(order):
            return
    # Other tools solve rings, or delay them.
    for coupling in (None, "delay") if system.rings() else (None,):
        delayed = ", rings delayed" * (coupling == "delay")
        for each in Experiment.ORDERS if order is None else (order,):
            named = Experiment.format_order(each)
            words = f"in {named} order" if isinstance(each, str) else f"as run --order {named}"
            yield Algorithm(each, coupling, exchange, f"{words}{delayed}{start}")


def _complaint(
    table: ForeignTable,
    system: System,
    experiment: Experiment,
    events: Sequence[Event],
    way: Algorithm,
    tolerance: float,
) -> tuple[float, str] | None:
    """Return until when a table agrees with our own run, and the difference; None: none."""
    ours = _Samples(table.time, tuple(table.columns))
    try:
        way.run(system, experiment, ours, *([Events(events)] if events else []))
    except InputError as error:
        return -inf, f"{way.words} our own run fails: {error}"
    # A tool's row before the first step depends on how it exchanges initial values.
    after = table.time > experiment.start_time
    difference = _first_difference(table.time, table.columns, ours.values, tolerance, after)
    return difference and (difference[0], f"{way.words} {difference[1]}")


class _Samples:
    """An observer that keeps some columns at given times, interpolated between the rows.

    Attributes:
        values: values in shape (times, columns).

    """

    def __init__(self, times: np.ndarray, columns: Sequence[str]) -> None:
        self._times, self._columns = times, columns
        self._n = 0
        self.values = np.full((len(times), len(columns)), np.nan)

    def begin(self, header: Header) -> None:
        """Note the places and types of columns."""
        self._header = header
        self._last = np.empty((0, 1 + len(header.columns)))

    def take(self, rows: np.ndarray) -> None:
        """Take the samples between these rows."""
        rows = np.vstack((self._last, rows))
        self._sample(rows, int(np.searchsorted(self._times, rows[-1, 0], side="right")))
        self._last = rows[-1:].copy()

    def end(self, ending: Ending) -> None:
        """Take the samples that rounding has put after the last row."""
        if len(self._last):
            self._sample(self._last, len(self._times))

    def _sample(self, rows: np.ndarray, end: int) -> None:
        times = self._times[self._n : end]
        for i, name in enumerate(self._columns):
            values = self._header.values(name, rows)
            self.values[self._n : end, i] = np.interp(times, rows[:, 0], values)
        self._n = end


def _first_difference(
    time: np.ndarray,
    columns: Mapping[str, np.ndarray],
    ours: np.ndarray,
    tolerance: float,
    compared: np.ndarray,
) -> tuple[float, str] | None:
    first: tuple[float, str, float, float] | None = None
    for (name, column), expected in zip(columns.items(), ours.T, strict=True):
        accepted = tolerance * max(1.0, float(np.abs(expected).max()))
        with np.errstate(over="ignore"):
            # A value that is not a number differs.
            wrong = np.flatnonzero(~(np.abs(column - expected) <= accepted) & compared)
        if len(wrong) and (first is None or time[wrong[0]] < first[0]):
            k = wrong[0]
            first = float(time[k]), name, float(column[k]), float(expected[k])
    if first is None:
        return None
    t, name, theirs, mine = first
    return t, f"{name} differs first, at t = {t:g} s: {theirs:.9g} instead of {mine:.9g}"


def _certificate(
    table: ForeignTable,
    start: float,
    system: System,
    outputs: Mapping[str, str],
    way: Algorithm,
    tolerance: float,
    verbose: bool,
) -> Iterator[str]:
    """Yield lines on what was compared and agrees, and on what was not compared."""
    times = table.time[table.time > start]
    yield (
        f"{len(table.columns)} of {len(outputs)} outputs agree to {tolerance:g} in {len(times)} "
        f"rows from t = {times[0]:g} to {times[-1]:g} s, {way.words}"
    )
    if table.repeated:
        rows = "row that has" if table.repeated == 1 else "rows that have"
        yield f"skipped: {table.repeated} {rows} the time of the row before"
    if len(times) < len(table.time):
        yield f"not compared: the row at t = {start:g}, which tools fill in different ways"
    if system.stop_time is not None and times[-1] < system.stop_time:
        yield f"not compared: the time up to the system's stop time of {system.stop_time:g} s"
    if table.others:
        others = enumerated(table.others, verbose)
        yield f"not compared: columns that are not numeric outputs: {others}"
    if absent := [name for name in outputs if name not in table.columns]:
        yield f"not in the table: {enumerated(absent, verbose)}"


def enumerated(names: Sequence[str], verbose: bool) -> str:
    """Join names with commas; without `verbose`, give only the number and the first of many."""
    if verbose or len(names) <= _FIRST:
        return ", ".join(names)
    return f"{len(names)}, such as {', '.join(names[:_FIRST])} (--verbose lists all)"


@dataclass(frozen=True)
class ForeignTable:
    """Content of a table from another tool.

    Attributes:
        time: times of the rows [s], increasing, at or after the start of the run.
        columns: values of the wanted ports that it has, by our names.
        others: names of its other columns, unchanged.
        repeated: number of rows that are skipped, as their time is that of the row before.

    """

    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    others: Sequence[str]
    repeated: int


def read_table(
    path: Path,
    ports: Mapping[str, str],
    known: Collection[str],
    before: str = "",
    start: float = 0.0,
) -> ForeignTable:
    """Read all values of the time and of the wanted ports in a table.

    Args:
        path: CSV with a line of names, separated by commas, semicolons or tabs.
        ports: types of the wanted ports, by `component.port`.
        known: names of all ports; in the table, they may follow names of systems.
        before: prefix that the names of columns may lack.
        start: time before which there must be no row [s].

    Raises:
        InputError: a row is not as long as the first, a time decreases, a value is not a number,
            a port has two columns, or the time has two that differ.

    """
    separators = ", ".join(SEPARATORS.values())
    places: dict[str, int] = {}
    longest = max(map(len, known), default=0)
    with records(path, "not a table that can be compared", places_of_time) as (names, rows):
        clocks = places_of_time(names)
        if not clocks:
            raise ValueError(
                f"no column of its first line is named time (separators are {separators})"
            )
        for place, name in enumerate(names):
            port = port_of(f"{before}{name.strip()}", known, longest)
            port = port if port in ports else None
            if port in places:
                raise ValueError(f"columns {1 + places[port]} and {1 + place} are both {port}")
            if port is not None and place not in clocks:
                places[port] = place
        time, columns = array("d"), {port: array("d") for port in places}
        for expected, (line, row) in enumerate(rows, start=2):
            if line != expected:
                raise ValueError(f"line {expected} is empty")
            where = f"line {line}"
            time.append(time_of(row, clocks, where))
            if time[-1] < start:
                raise ValueError(f"{where}: time {time[-1]:g} s is before the start at {start:g} s")
            if len(time) > 1 and time[-1] < time[-2]:
                raise ValueError(
                    f"{where}: time {time[-1]:.9g} s follows {time[-2]:.9g} s; times must not "
                    "decrease"
                )
            for port, place in places.items():
                columns[port].append(_value(row[place], ports[port], f"{where}, {names[place]}"))
    others = [name for i, name in enumerate(names) if i not in (*clocks, *places.values())]
    times = np.array(time)
    new = np.diff(times, prepend=-np.inf) > Experiment.ROUNDING * np.abs(times)
    return ForeignTable(
        times[new],
        {port: np.array(column)[new] for port, column in columns.items()},
        others,
        len(times) - int(new.sum()),
    )


def _value(text: str, fmi_type: str, where: str) -> float:
    words = BOOLEANS if fmi_type == "Boolean" else {}
    word = text.strip().lower()
    return float(words[word]) if word in words else finite(text, f"{where}:")
