"""What a run has produced: a table of all ports over time."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import InputError
from orchestrator.system.structure import PortName, System, port_name, typed


@dataclass
class Result:
    """Rows of all inputs and outputs of a run, one at the start and one a step.

    A row holds, at time t_k, the outputs after the step that ended there, and the inputs that
    this step was made with.

    Attributes:
        columns: `component.port` of every column behind the time.
        times: of all rows that were asked for [s].
        order: in which the components were stepped.
        step: communication step [s].
        parameters: of all components, as the FMUs reported them after initialisation.
        messages: what the FMUs logged with status warning or worse.
        failure: why the run ended early, or None.
        computed: rows that were computed.

    """

    columns: tuple[str, ...]
    times: np.ndarray
    order: str
    step: float
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)
    failure: str | None = None
    computed: int = 0

    def __post_init__(self) -> None:
        """Make room for all rows."""
        # Memory is taken when a row is written, so a long run costs what it has computed.
        try:
            self.rows = np.empty((len(self.times), 1 + len(self.columns)))
        except MemoryError as error:
            raise InputError(f"a table of {len(self.times)} rows does not fit: {error}") from error
        self._index = {name: i for i, name in enumerate(self.columns, start=1)}

    def __contains__(self, column: str) -> bool:
        """Whether there is a column `component.port`."""
        return column in self._index

    def has(self, columns: Iterable[str], parameters: Iterable[str] = ()) -> bool:
        """Whether all these columns and parameters, `component.name`, are there."""
        return all(column in self for column in columns) and all(
            port_name(parameter) in self.parameters for parameter in parameters
        )

    def __getitem__(self, column: str) -> np.ndarray:
        """The computed values of one column."""
        view: np.ndarray = self.rows[: self.computed, self._index[column]]
        return view

    def group(self, *columns: str) -> np.ndarray:
        """Several columns side by side, (rows, columns)."""
        return np.column_stack([self[column] for column in columns])

    @property
    def time(self) -> np.ndarray:
        """Times of the computed rows [s]."""
        view: np.ndarray = self.rows[: self.computed, 0]
        return view

    def append(self, values: np.ndarray) -> None:
        """Take the values of all columns as the next row."""
        row = self.computed
        self.rows[row, 0] = self.times[row]
        self.rows[row, 1:] = values
        self.computed = row + 1

    def write_csv(self, path: Path) -> None:
        """Write the computed rows; numbers are written so that they read back exactly."""
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("time", *self.columns))
            writer.writerows(self.rows[: self.computed].tolist())


def read_result(folder: Path, system: System) -> Result:
    """The result that a run of a system has left in a folder.

    Raises:
        OSError: a file is missing.

    """
    values = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    with (folder / "result.csv").open(encoding="utf-8") as file:
        _, *columns = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    parameters = {
        PortName(component.name, name): typed(name, variable, variable.start)
        for component in system.components.values()
        for name, variable in component.variables.items()
        if variable.causality == "parameter"
    }
    parameters |= {port_name(name): value for name, value in values["parameters"].items()}
    result = Result(
        tuple(columns), table[:, 0], values["order"], values["step"], parameters,
        failure=values.get("failure"), computed=len(table),
    )  # fmt: skip
    result.rows[:] = table
    return result
