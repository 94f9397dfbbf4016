"""The row of all values, and their changes on the way from outputs to inputs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from orchestrator.cosim.connection import Connection, Linear, Mapped, PortName
from orchestrator.cosim.fmi.instance import Instance, Part
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import (
    TYPES,
    Standing,
    StringTable,
    Value,
    Variable,
    are_of,
    as_float32,
    references_of,
)

#: A smaller change, absolute or relative, is a rounding error.
_ROUNDING = 1e-12

FACTOR, OFFSET = Linear.UNCHANGED


class Row:
    """All inputs and outputs of a system side by side, as doubles.

    Ports of a component with the same causality and type are neighbours, so that one FMI call moves
    all of them; a table has them as declared.

    Outputs of some components have a hidden place after all others, into which their instance
    writes; they are shown once they are copied into their own places.

    Attributes:
        values: of all ports, then the hidden ones.
        shown: a view of those that are not hidden.
        columns: index of each port's value, in the order of the columns of a table.
        strings: texts and integers that numbers in the row stand for.
        standing: decoding of each port whose numbers may stand for other values.

    """

    def __init__(
        self, system: System, instances: Mapping[str, Instance], hidden: Collection[str] = ()
    ) -> None:
        """Lay out the row, tie the instances to it, and enter the start values of inputs.

        Args:
            system: with the ports.
            instances: of its components.
            hidden: components whose outputs are hidden at first.

        """
        self.columns = dict.fromkeys(system.columns(), 0)
        n = len(self.columns)
        more = sum(len(system.components[name].having("output")) for name in hidden)
        self.values = np.zeros(n + more)
        self.shown = self.values[:n]
        self.strings = StringTable()
        self.standing: dict[PortName, Standing] = {}
        self._hidden: dict[PortName, int] = {}
        self._components = system.components
        self._sources = {c.target: c.source for c in system.connections}
        self._ports: dict[str, list[tuple[PortName, str, str]]] = {name: [] for name in instances}
        self._inputs: dict[str, list[int]] = {}
        firsts: dict[str, int] = {}
        parts: dict[str, list[Part]] = {name: [] for name in instances}
        end = 0
        for component, causality, fmi_type, ports in _moved(system):
            where = end
            if causality == "output" and component in hidden:
                where = n + len(self._hidden)
                for i, port in enumerate(ports, start=where):
                    self._hidden[PortName(component, port.name)] = i
            first = where - firsts.setdefault(component, end)
            references = references_of(ports)
            place = slice(first, first + len(ports))
            parts[component].append(Part(causality, fmi_type, references, place))
            for i, port in enumerate(ports, start=end):
                name = PortName(component, port.name)
                self.columns[name] = i
                self._ports[component].append((name, causality, fmi_type))
                if causality == "input":
                    self._inputs.setdefault(fmi_type, []).append(i)
                if TYPES[fmi_type].stands:
                    self.standing[name] = Standing(fmi_type, self.strings)
                self.values[i] = self.number(system.components[component].starts.get(port.name, 0))
            end += len(ports)
        for component, instance in instances.items():
            part = self.values[firsts.get(component, 0) :]
            instance.tie(part, parts[component], self.strings)
        order = np.fromiter(self.columns.values(), dtype=np.intp)
        self._arranged = np.flatnonzero(order != np.arange(n))
        self._taken = order[self._arranged]
        self._hiding = {name: self.hidden(self._outputs(name)) for name in hidden}
        self.enter(system.parameters)

    def _outputs(self, component: str) -> list[PortName]:
        return [port for port, causality, _ in self._ports[component] if causality == "output"]

    def enter(self, values: Mapping[PortName, Value]) -> None:
        """Enter values of ports, except those that are not finite numbers."""
        for port, value in values.items():
            if port in self.columns and isfinite(number := self.number(value)):
                self.values[self.columns[port]] = number

    def number(self, value: Value) -> float:
        """Return the number that stands for a value in the row."""
        return self.strings.stand_in(value)

    def number_of(self, port: PortName, value: float) -> float:
        """Return the number that stands for a value of a port in the row."""
        return self.standing[port].number(value) if port in self.standing else float(value)

    def value(self, port: PortName) -> Value:
        """Return the value of a port."""
        number = float(self.values[self.columns[port]])
        return self.standing[port].value(number) if port in self.standing else number

    def arrange(self, values: np.ndarray) -> None:
        """Turn shown values, of one row or several, into rows of a table, in place."""
        if rounded := self._inputs.get("Float32"):
            values[..., rounded] = as_float32(values[..., rounded])
        if len(self._taken):
            values[..., self._arranged] = values[..., self._taken]

    def wrong(self, components: Iterable[str], passed: bool = False) -> str | None:
        """Describe the first value that is not finite or does not fit an input's type.

        Args:
            components: in the order in which they are stepped, since a component may pass a value
                on.
            passed: if set, all values are of one time: states come first, starting with those of
                components that no wrong input has reached.

        Returns:
            The value and its source, in words; None: all values are right.

        """
        inputs = self._inputs.items()
        fit = all(are_of(fmi_type, self.values[places]).all() for fmi_type, places in inputs)
        if fit and np.isfinite(self.shown).all():
            return None
        ports = [port for component in components for port in self._ports[component]]
        if passed:
            reached = {
                name.component
                for name, causality, _ in ports
                if causality == "input" and not isfinite(self.values[self.columns[name]])
            }
            ports.sort(key=lambda port: (self._passes(*port[:2]), port[0].component in reached))
        passed_on = None
        for port, causality, fmi_type in ports:
            value = self.values[self.columns[port]]
            if not isfinite(value):
                text = f"{port} is {value:g}"
            elif causality == "input" and not are_of(fmi_type, value):
                text = f"{port} is {value:.16g}, which FMI type {fmi_type} cannot hold"
            else:
                continue
            if causality == "output":
                return text
            source = self._sources.get(port)
            text += f", fed by {source}" if source else ", from a table or an event"
            if source is None or isfinite(self.values[self.columns[source]]):
                return text
            passed_on = passed_on or text
        return passed_on

    def _passes(self, port: PortName, causality: str) -> bool:
        """Return True for an input, and for an output with direct feedthrough."""
        return causality == "input" or self._components[port.component].has_feedthrough(port.port)

    def moving(self, before: np.ndarray) -> list[PortName]:
        """Return the ports whose values have changed by more than rounding."""
        same = np.isclose(self.values, before, rtol=_ROUNDING, atol=_ROUNDING)
        standing = [self.columns[port] for port in self.standing]
        same[standing] = self.values[standing] == before[standing]
        return [port for port, column in self.columns.items() if not same[column]]

    def places(self, connections: Sequence[Connection]) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns of the targets and of the sources of some connections."""
        return (
            np.array([self.columns[c.target] for c in connections], dtype=np.intp),
            np.array([self.columns[c.source] for c in connections], dtype=np.intp),
        )

    def hidden(self, ports: Sequence[PortName]) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns and the hidden places of those outputs that have both."""
        known = [port for port in ports if port in self._hidden]
        return (
            np.array([self.columns[port] for port in known], dtype=np.intp),
            np.array([self._hidden[port] for port in known], dtype=np.intp),
        )

    def show(self, component: str) -> None:
        """Copy the hidden values of a component into its columns."""
        if component in self._hiding:
            targets, sources = self._hiding[component]
            self.values[targets] = self.values[sources]


def _moved(system: System) -> Iterator[tuple[str, str, str, list[Variable]]]:
    """Yield the ports that one FMI call moves, with their component, causality and type."""
    for name, component in system.components.items():
        for causality in ("input", "output"):
            for fmi_type, ports in component.by_type(causality).items():
                yield name, causality, fmi_type, ports


class Gathering:
    """Values moved within the row at the same time, each multiplied by a factor, plus an offset.

    Attributes:
        targets, sources: columns of the row.
        factors, offsets: one of each for each value.
        mapped: new values by old ones, by the places of values that are mapped first; unlisted
            values stay.
        acts: True if there are any values.
        is_plain: True if there are values and none changes.

    """

    def __init__(self, targets: np.ndarray, sources: np.ndarray) -> None:
        """Move values without a change."""
        self.targets, self.sources = targets, sources
        self.factors = np.full(len(targets), FACTOR)
        self.offsets = np.full(len(targets), OFFSET)
        self.mapped: dict[int, Mapping[float, float]] = {}
        self.acts = self.is_plain = len(targets) > 0

    @classmethod
    def along(cls, row: Row, connections: Sequence[Connection]) -> Gathering:
        """Gather the values that inputs take along some connections."""
        gathering = cls(*row.places(connections))
        for place, connection in enumerate(connections):
            match connection.transformation:
                case Linear(factor, offset):
                    gathering.set(place, factor, offset)
                case Mapped(pairs):
                    gathering.mapped[place] = {
                        row.number_of(connection.source, before): row.number_of(
                            connection.target, after
                        )
                        for before, after in pairs
                    }
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
        """Set the factor and the offset of one of the values."""
        self.factors[place], self.offsets[place] = factor, offset
        plain = (self.factors == FACTOR) & (self.offsets == OFFSET) & np.signbit(self.offsets)
        self.is_plain = bool(plain.all()) and not self.mapped


class Overrides:
    """Everything that a step gathers, and temporary changes to it."""

    def __init__(
        self, row: Row, gatherings: Iterable[Gathering], connections: Sequence[Connection]
    ) -> None:
        """Find where every input takes its value.

        Args:
            row: of all values.
            gatherings: of all stages.
            connections: of the system.

        """
        self._row = row
        # An input of a solved ring is gathered in several places.
        self._fed: dict[int, list[tuple[Gathering, int]]] = {}
        for gathering in gatherings:
            for place, column in enumerate(gathering.targets.tolist()):
                self._fed.setdefault(column, []).append((gathering, place))
        self._own = {column: _factor_and_offset(fed) for column, fed in self._fed.items()}
        self._targets = [connection.target for connection in connections]
        # Unconnected inputs that are changed: the value without the change, its factor and its
        # offset.
        self._open: dict[int, tuple[float, float, float]] = {}

    def override(self, target: PortName, value: Value) -> None:
        """Give an input a value, whatever feeds it."""
        self._alter(target, 0.0, self._row.number(value))

    def bias(self, target: PortName, offset: float) -> None:
        """Add an offset to what an input takes."""
        factor, own = self._own.get(self._row.columns[target], (FACTOR, OFFSET))
        self._alter(target, factor, own + offset)

    def release(self, target: PortName) -> None:
        """Undo all changes of an input."""
        column = self._row.columns[target]
        if column in self._fed:
            self._alter(target, *self._own[column])
        elif column in self._open:
            self._row.values[column], _, _ = self._open.pop(column)

    def supply(self, target: PortName, value: Value) -> None:
        """Give an unconnected input a value, to which its changes apply."""
        value = self._row.number(value)
        column = self._row.columns[target]
        if column in self._open:
            _, factor, offset = self._open[column]
            self._open[column] = value, factor, offset
            value = factor * value + offset
        self._row.values[column] = value

    def supplied(self, target: PortName) -> float:
        """Return the value of an unconnected input without its changes."""
        column = self._row.columns[target]
        value, *_ = self._open.get(column, (float(self._row.values[column]),))
        return value

    def refresh(self, component: str) -> None:
        """Update the inputs of a component from their sources at once."""
        for target in self._targets:
            if target.component == component:
                gathering, place = self._fed[self._row.columns[target]][0]
                gathering.move(self._row.values, place)

    def state(self) -> dict[str, Any]:
        """Return the changes as JSON."""
        return {
            "fed": [(column, *_factor_and_offset(fed)) for column, fed in self._fed.items()],
            "open": list(self._open.items()),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the changes; the row is left as it is."""
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
