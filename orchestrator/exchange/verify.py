"""Compare a table from any tool with our own runs of the same system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from orchestrator.errors import InputError
from orchestrator.exchange.foreign import ForeignTable, read_table
from orchestrator.experiments.preparation import DEFAULT_STEP
from orchestrator.experiments.wiring import read_wiring
from orchestrator.master.experiment import DELAY, ORDERS, Experiment
from orchestrator.master.observer import Ending, Header
from orchestrator.master.simulation import completed
from orchestrator.master.transfer import KINDS
from orchestrator.system.graph import rings
from orchestrator.system.names import PortName
from orchestrator.system.structure import System


def verify(path: Path, system: System, tolerance: float) -> str:
    """Compare a table from any tool with our own runs of the same system.

    Every row after t = 0 and every column that is named after an output is compared. Columns of
    inputs are not: tools write them before or after the exchange.

    Args:
        path: CSV with a time column and columns named after our ports.
        system: that the tool has run.
        tolerance: largest difference that is accepted, relative to the larger of one and the
            largest magnitude of the port.

    Returns:
        What agrees, with which order of evaluation, and what was not compared, in lines.

    Raises:
        InputError: the file cannot be read in full, has no column of ours, or differs in both
            orders; the text names the port that differs first.

    """
    if not 0.0 <= tolerance < 1.0:
        raise InputError(f"tolerance {tolerance:g}: must not be negative, and less than 1")
    outputs = {
        str(PortName(component.name, variable.name)): variable.type
        for component in system.components.values()
        for variable in component.having("output")
        if variable.type in KINDS
    }
    table = read_table(path, outputs, (system.name, read_wiring()["name"]))
    if not len(table.time) or not table.time[-1] > 0.0:
        raise InputError(f"{path}: has no row after t = 0")
    if not table.columns:
        raise InputError(
            f"{path}: no column is named after an output; they are named as {min(outputs)}"
        )
    complaints = []
    # Other tools solve rings, or delay them.
    for coupling, order in product((None, DELAY) if rings(system) else (None,), ORDERS):
        complaint = _complaint(table, system, order, coupling, tolerance)
        way = f"in {order} order" + ", rings delayed" * (coupling == DELAY)
        if complaint is None:
            return "\n".join(_certificate(table, system, outputs, way, tolerance))
        complaints.append(f"{way} {complaint}")
    raise InputError(f"{path}: {'; '.join(complaints)}")


def _complaint(
    table: ForeignTable, system: System, order: str, coupling: str | None, tolerance: float
) -> str | None:
    """What is wrong with a table, seen from our own run; None: nothing."""
    stop_time = float(table.time[-1])
    ours = _Samples(table.time, tuple(table.columns))
    try:
        step, start_time = system.step or DEFAULT_STEP, system.start_time or 0.0
        completed(system, Experiment(stop_time, step, order, start_time, coupling), [ours])
    except InputError as error:
        return f"our own run fails: {error}"
    return _first_difference(table.time, table.columns, ours.values, tolerance)


class _Samples:
    """An observer that keeps some columns at some times, linear between the rows.

    Attributes:
        values: (times, columns).

    """

    def __init__(self, times: np.ndarray, columns: Sequence[str]) -> None:
        self._times, self._columns = times, columns
        self._n = 0
        self.values = np.full((len(times), len(columns)), np.nan)

    def begin(self, header: Header) -> None:
        """Find out where the columns are."""
        self._places = [1 + header.columns.index(name) for name in self._columns]
        self._last = np.empty((0, 1 + len(header.columns)))

    def take(self, rows: np.ndarray) -> None:
        """Take the samples that lie between some rows."""
        rows = np.vstack((self._last, rows))
        self._sample(rows, int(np.searchsorted(self._times, rows[-1, 0], side="right")))
        self._last = rows[-1:].copy()

    def end(self, ending: Ending) -> None:
        """Take the samples that lie behind the last row, but for rounding."""
        self._sample(self._last, len(self._times))

    def _sample(self, rows: np.ndarray, end: int) -> None:
        times = self._times[self._n : end]
        for i, place in enumerate(self._places):
            self.values[self._n : end, i] = np.interp(times, rows[:, 0], rows[:, place])
        self._n = end


def _first_difference(
    time: np.ndarray,
    columns: Mapping[str, np.ndarray],
    ours: np.ndarray,
    tolerance: float,
) -> str | None:
    first: tuple[float, str, float, float] | None = None
    for (name, column), expected in zip(columns.items(), ours.T, strict=True):
        accepted = tolerance * max(1.0, float(np.abs(expected).max()))
        # What is shown before the first step depends on how a tool exchanges initial values.
        with np.errstate(over="ignore"):
            # A value that is no number differs.
            wrong = np.flatnonzero(~(np.abs(column - expected) <= accepted) & (time > 0.0))
        if len(wrong) and (first is None or time[wrong[0]] < first[0]):
            k = wrong[0]
            first = float(time[k]), name, float(column[k]), float(expected[k])
    if first is None:
        return None
    t, name, theirs, mine = first
    return f"{name} differs first, at t = {t:g} s: {theirs:.9g} instead of {mine:.9g}"


def _certificate(
    table: ForeignTable,
    system: System,
    outputs: Mapping[str, str],
    way: str,
    tolerance: float,
) -> Iterator[str]:
    """What was compared and found to agree, and what was not compared."""
    times = table.time[table.time > 0.0]
    yield (
        f"{len(table.columns)} of {len(outputs)} outputs agree to {tolerance:g} in {len(times)} "
        f"rows from t = {times[0]:g} to {times[-1]:g} s, {way}"
    )
    if len(times) < len(table.time):
        yield "not compared: the row at t = 0, which tools fill in different ways"
    if system.stop_time is not None and times[-1] < system.stop_time:
        yield f"not compared: what follows until the system's stop time of {system.stop_time:g} s"
    if table.others:
        yield f"not compared: columns that are no outputs: {', '.join(table.others)}"
    if absent := outputs.keys() - table.columns.keys():
        yield f"not in the table: {', '.join(name for name in outputs if name in absent)}"
