"""What is done to values on their way from outputs to inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator.master.row import Row
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection
from orchestrator.system.units import Linear, Mapped

#: Times one, plus minus zero: every number stays what it is, minus zero, too.
FACTOR, OFFSET = 1.0, -0.0


class Gathering:
    """Values moved within the row at the same time, each times a factor, plus an offset.

    Attributes:
        targets, sources: where they are in the row.
        factors, offsets: one for each.
        mapped: places of those that are mapped first, and what to; others stay what they are.
        is_plain: whether all values arrive as they are.

    """

    def __init__(self, targets: np.ndarray, sources: np.ndarray) -> None:
        """Move values as they are."""
        self.targets, self.sources = targets, sources
        self.factors = np.full(len(targets), FACTOR)
        self.offsets = np.full(len(targets), OFFSET)
        self.mapped: dict[int, Mapping[float, float]] = {}
        self.is_plain = True

    @classmethod
    def along(cls, row: Row, connections: Sequence[Connection]) -> Gathering:
        """What inputs take from outputs along some connections."""
        gathering = cls(*row.places(connections))
        for place, connection in enumerate(connections):
            match connection.transformation:
                case Linear(factor, offset):
                    gathering.set(place, factor, offset)
                case Mapped(pairs):
                    gathering.mapped[place] = dict(pairs)
                    gathering.is_plain = False
        return gathering

    def __call__(self, values: np.ndarray) -> None:
        """Move the values within the row."""
        if self.is_plain:
            values[self.targets] = values[self.sources]
            return
        taken = values[self.sources]
        for place, pairs in self.mapped.items():
            taken[place] = pairs.get(taken[place], taken[place])
        values[self.targets] = self.factors * taken + self.offsets

    def move(self, values: np.ndarray, place: int) -> None:
        """Move one of the values."""
        taken = values[self.sources[place]]
        taken = self.mapped.get(place, {}).get(taken, taken)
        values[self.targets[place]] = self.factors[place] * taken + self.offsets[place]

    def set(self, place: int, factor: float, offset: float) -> None:
        """Say what is done to one of the values."""
        self.factors[place], self.offsets[place] = factor, offset
        plain = (self.factors == FACTOR) & (self.offsets == OFFSET) & np.signbit(self.offsets)
        self.is_plain = bool(plain.all()) and not self.mapped


class Overrides:
    """All that is gathered in a step, and what is done to it for some time."""

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
        # An input of a solved ring is gathered in more than one place.
        self._fed: dict[int, list[tuple[Gathering, int]]] = {}
        for gathering in gatherings:
            for place, column in enumerate(gathering.targets.tolist()):
                self._fed.setdefault(column, []).append((gathering, place))
        self._own = {column: _factor_and_offset(fed) for column, fed in self._fed.items()}
        self._targets = [connection.target for connection in connections]
        # Of inputs that nothing feeds: what they would have, and what is done to it.
        self._open: dict[int, tuple[float, float, float]] = {}

    def override(self, target: PortName, value: float) -> None:
        """Let an input take a value, whatever feeds it."""
        self._alter(target, 0.0, value)

    def bias(self, target: PortName, offset: float) -> None:
        """Let an input take the value that it would take, and something more."""
        factor, own = self._own.get(self._row.columns[target], (FACTOR, OFFSET))
        self._alter(target, factor, own + offset)

    def release(self, target: PortName) -> None:
        """Let an input take what feeds it, or what it would have."""
        column = self._row.columns[target]
        if column in self._fed:
            self._alter(target, *self._own[column])
        elif column in self._open:
            self._row.values[column], _, _ = self._open.pop(column)

    def supply(self, target: PortName, value: float) -> None:
        """Let an input that nothing feeds have a value, which is altered as one that is fed is."""
        column = self._row.columns[target]
        if column in self._open:
            _, factor, offset = self._open[column]
            self._open[column] = value, factor, offset
            value = factor * value + offset
        self._row.values[column] = value

    def supplied(self, target: PortName) -> float:
        """What an input has that nothing feeds, before it is altered."""
        column = self._row.columns[target]
        value, *_ = self._open.get(column, (float(self._row.values[column]),))
        return value

    def refresh(self, component: str) -> None:
        """Let the inputs of a component take at once what feeds them."""
        for target in self._targets:
            if target.component == component:
                gathering, place = self._fed[self._row.columns[target]][0]
                gathering.move(self._row.values, place)

    def state(self) -> dict[str, Any]:
        """What is done to them, as JSON has it."""
        return {
            "fed": [(column, *_factor_and_offset(fed)) for column, fed in self._fed.items()],
            "open": list(self._open.items()),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Do to them what was done before; the row is left as it is."""
        for column, factor, offset in state["fed"]:
            for gathering, place in self._fed[column]:
                gathering.set(place, factor, offset)
        self._open = {column: tuple(values) for column, values in state["open"]}

    def _alter(self, target: PortName, factor: float, offset: float) -> None:
        column, values = self._row.columns[target], self._row.values
        if column in self._fed:
            for gathering, place in self._fed[column]:
                gathering.set(place, factor, offset)
        else:
            value = self.supplied(target)
            self._open[column] = value, factor, offset
            values[column] = factor * value + offset


def _factor_and_offset(fed: Sequence[tuple[Gathering, int]]) -> tuple[float, float]:
    gathering, place = fed[0]
    return float(gathering.factors[place]), float(gathering.offsets[place])
