"""Compare a table from any tool with our own runs of the same system."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from orchestrator.errors import InputError
from orchestrator.experiments.preparation import DEFAULT_STEP
from orchestrator.master.experiment import ORDERS, Experiment
from orchestrator.master.simulation import completed
from orchestrator.master.table import Table
from orchestrator.system.names import PortName
from orchestrator.system.structure import System

#: What ecos puts behind a name.
_KIND = re.compile(r"\[[A-Z]+\]$")

#: Columns that name the time, in lower case.
_TIME = ("time", "t")


def verify(path: Path, system: System, tolerance: float) -> str:
    """Compare a table from any tool with our own runs of the same system.

    Args:
        path: CSV with a time column and columns named after our ports.
        system: that the tool has run.
        tolerance: largest difference that is accepted, relative to the larger of one and the
            largest magnitude of the port.

    Returns:
        What agrees, and with which order of evaluation.

    Raises:
        InputError: the file cannot be read, has no column of ours, or differs in both orders; the
            text names the port that differs first.

    """
    if not tolerance >= 0.0:
        raise InputError(f"tolerance {tolerance:g} must not be negative")
    time, columns = _read(path)
    stop_time = float(time[-1])
    if not stop_time > 0.0:
        raise InputError(f"{path}: the time does not advance")
    outputs = {
        str(PortName(component.name, variable.name))
        for component in system.components.values()
        for variable in component.having("output")
    }
    # Inputs are left out: tools write them before or after the exchange.
    shared = {name: column for name, column in columns.items() if name in outputs}
    if not shared:
        raise InputError(
            f"{path}: no column is named after an output; they are named as {min(outputs)}"
        )
    complaints = []
    for order in ORDERS:
        ours = Table()
        completed(system, Experiment(stop_time, system.step or DEFAULT_STEP, order), [ours])
        complaint = _first_difference(time, shared, ours, tolerance)
        if complaint is None:
            return f"{len(shared)} ports agree over {stop_time:g} s, in {order} order"
        complaints.append(f"in {order} order {complaint}")
    raise InputError(f"{path}: {'; '.join(complaints)}")


def _read(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time and all columns of numbers of a table, by the names of our ports."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file, skipinitialspace=True)
    except (OSError, UnicodeDecodeError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not a readable table: {error}") from error
    columns: dict[str, np.ndarray] = {}
    for name, column in zip(header, zip(*rows, strict=False), strict=False):
        try:
            columns[_port_of(name)] = np.array([_number(text) for text in column])
        except ValueError:
            # Tools write text as well, parameters for example.
            continue
    time = next((columns[name] for name in columns if name.lower() in _TIME), None)
    if time is None or len(time) < 2:
        raise InputError(f"{path}: no column of numbers is named time")
    return time, columns


def _port_of(name: str) -> str:
    """Our name of a column: some tools write component::port, [REAL] behind it, or the system's."""
    return _KIND.sub("", name.strip()).replace("::", ".").removeprefix("auv.")


def _number(text: str) -> float:
    return float({"true": "1", "false": "0"}.get(text.strip().lower(), text))


def _first_difference(
    time: np.ndarray, columns: dict[str, np.ndarray], ours: Table, tolerance: float
) -> str | None:
    first: tuple[float, str, float, float] | None = None
    for name, column in columns.items():
        expected = np.interp(time, ours.time, ours[name])
        accepted = tolerance * max(1.0, float(np.abs(expected).max()))
        # A value that is no number differs.
        # What is shown before the first step depends on how a tool exchanges initial values.
        wrong = np.flatnonzero(~(np.abs(column - expected) <= accepted) & (time > 0.0))
        if len(wrong) and (first is None or time[wrong[0]] < first[0]):
            k = wrong[0]
            first = float(time[k]), name, float(column[k]), float(expected[k])
    if first is None:
        return None
    t, name, theirs, mine = first
    return f"{name} differs first, at t = {t:g} s: {theirs:.9g} instead of {mine:.9g}"
