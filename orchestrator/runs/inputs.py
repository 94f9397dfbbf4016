"""Inputs from a table: which file, and what its columns mean to a system."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.formats.tables import read_columns, read_rows
from orchestrator.machine.errors import InputError
from orchestrator.master.hooks.timing import InputTable
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.system.values import type_of, typed

#: How a continuous Real input goes from one row to the next; the first is the default.
WAYS = ("linear", "hold")

#: So many seconds are farther apart than two numbers can be, apart from rounding [s].
_MOST = 1e308


@dataclass(frozen=True)
class Inputs:
    """A table of inputs, as a scenario or the command line names it.

    Attributes:
        file: with the table.
        between: what continuous Real inputs do between two rows, one of :data:`WAYS`.

    """

    file: Path
    between: str = WAYS[0]


def read_inputs(
    inputs: Inputs, system: System, given: Collection[PortName]
) -> tuple[System, InputTable]:
    """A system that begins with the first values of a table, and what follows.

    Args:
        inputs: that are wanted.
        system: that has them.
        given: ports that have values from where the table is named: it must not name them, too.

    Raises:
        InputError: the table cannot be read, or a column is no input that is to be had.

    """
    file = inputs.file
    if inputs.between not in WAYS:
        raise InputError(f"between = {inputs.between!r}: use one of {', '.join(WAYS)}")
    targets = tuple(system.named(port_name(name)) for name in read_columns(file))
    rows = np.vstack([np.empty((0, 1 + len(targets))), *read_rows(file)])
    try:
        _check(rows, targets)
        for target, column in zip(targets, rows[:, 1:].T, strict=True):
            if target in map(system.named, given):
                raise InputError(f"{target} is given a value of its own beside the table")
            _check_column(system, target, column)
        linear = [_is_linear(system, target, inputs.between) for target in targets]
        input_table = InputTable(targets, rows[:, 0], rows[:, 1:], np.array(linear))
        start = system.start_time or 0.0
        values = map(_number, input_table.at(start, int((input_table.times <= start).sum()) - 1))
        return system.with_parameters(dict(zip(targets, values, strict=True))), input_table
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def _check(rows: np.ndarray, targets: tuple[PortName, ...]) -> None:
    if not len(rows) or not targets:
        raise InputError("holds no inputs: write a column time, one for each input, and rows")
    if len(set(targets)) < len(targets):
        raise InputError("two columns have the same name")
    if not np.isfinite(rows).all():
        raise InputError("all times and values must be finite")
    if (rows[1:, 0] < rows[:-1, 0]).any():
        raise InputError("times must not fall")
    if rows[-1, 0] / 2 - rows[0, 0] / 2 > _MOST / 2:
        raise InputError(f"times must lie less than {_MOST:g} s apart")


def _check_column(system: System, target: PortName, column: np.ndarray) -> None:
    """Check that an input can be supplied, and takes all values of its column."""
    variable = system.component(target.component).variable(target.port)
    if variable.causality != "input":
        raise InputError(f"{target} is of causality {variable.causality}, not input")
    if type_of(variable) == "String":
        raise InputError(f"{target} is a String: a table has numbers")
    for connection in system.connections:
        if connection.target == target:
            raise InputError(f"{target} is fed by {connection.source} and cannot be set")
    is_real = type_of(variable) == "Real"
    for value in (column.min(), column.max()) if is_real else np.unique(column):
        typed(str(target), variable, _number(value))


def _number(value: float) -> str:
    """A number as an Integer is written as well: without a point where it is whole."""
    return f"{value:.17g}"


def _is_linear(system: System, target: PortName, between: str) -> bool:
    variable = system.component(target.component).variable(target.port)
    # FMI has it that what is discrete changes at events only.
    return (type_of(variable), variable.variability, between) == ("Real", "continuous", "linear")
