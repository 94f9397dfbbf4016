"""What is done to values on their way from outputs to inputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from orchestrator.master.row import Row
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection

#: Times one, plus minus zero: every number stays what it is, minus zero, too.
FACTOR, OFFSET = 1.0, -0.0


class Gathering:
    """Values that inputs take from outputs at the same time, each times a factor, plus an offset.

    Attributes:
        targets, sources: where they are in the row.
        factors, offsets: one for each.
        is_plain: whether all values arrive as they are.

    """

    def __init__(self, row: Row, connections: Sequence[Connection]) -> None:
        """Gather along some connections."""
        self.targets, self.sources = row.places(connections)
        self.factors = np.full(len(connections), FACTOR)
        self.offsets = np.full(len(connections), OFFSET)
        self.is_plain = True

    def __call__(self, values: np.ndarray) -> None:
        """Move the values within the row."""
        if self.is_plain:
            values[self.targets] = values[self.sources]
        else:
            values[self.targets] = self.factors * values[self.sources] + self.offsets

    def set(self, place: int, factor: float, offset: float) -> None:
        """Say what is done to one of the values."""
        self.factors[place], self.offsets[place] = factor, offset
        plain = (self.factors == FACTOR) & (self.offsets == OFFSET) & np.signbit(self.offsets)
        self.is_plain = bool(plain.all())


class Signals:
    """All that is gathered in a step, and what somebody does to it for some time."""

    def __init__(
        self, row: Row, gatherings: Iterable[Gathering], connections: Sequence[Connection]
    ) -> None:
        """Know where every input takes its value from.

        Args:
            row: of all values.
            gatherings: of all stages.
            connections: of the system.

        """
        self._row = row
        self._fed = {
            int(column): (gathering, place)
            for gathering in gatherings
            for place, column in enumerate(gathering.targets)
        }
        self._own = {
            place: (float(gathering.factors[at]), float(gathering.offsets[at]))
            for place, (gathering, at) in self._fed.items()
        }
        self._targets: dict[PortName, list[PortName]] = {}
        for connection in connections:
            self._targets.setdefault(connection.source, []).append(connection.target)
        self._before: dict[int, float] = {}

    def inputs(self, port: PortName) -> list[PortName]:
        """The inputs that a signal reaches: those that an output feeds, or an input alone."""
        return self._targets.get(port, [port])

    def override(self, target: PortName, value: float) -> None:
        """Let an input take a value, whatever feeds it."""
        self._alter(target, 0.0, value)

    def bias(self, target: PortName, offset: float) -> None:
        """Let an input take the value that it would take, and something more."""
        factor, own = self._own.get(self._row.columns[target], (FACTOR, OFFSET))
        self._alter(target, factor, own + offset)

    def freeze(self, target: PortName) -> None:
        """Let an input keep the value that it has."""
        self.override(target, float(self._row.values[self._row.columns[target]]))

    def release(self, target: PortName) -> None:
        """Let an input take what feeds it, or what it had before."""
        column = self._row.columns[target]
        if column in self._fed:
            self._alter(target, *self._own[column])
        elif column in self._before:
            self._row.values[column] = self._before.pop(column)

    def _alter(self, target: PortName, factor: float, offset: float) -> None:
        column, values = self._row.columns[target], self._row.values
        if column in self._fed:
            gathering, place = self._fed[column]
            gathering.set(place, factor, offset)
        else:
            before = self._before.setdefault(column, float(values[column]))
            values[column] = factor * before + offset
