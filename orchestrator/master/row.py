"""The row of all values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from math import isfinite

import numpy as np
from fmpy.model_description import ModelVariable

from orchestrator.master.fmi.instance import Instance, Part
from orchestrator.master.fmi.transfer import FMI_TYPES, are_integers
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.system.values import StringTable, Value

#: A change so small, or so small a share of the value, is a rounding error.
_ROUNDING = 1e-12


class Row:
    """All inputs and outputs of a system side by side, as floats.

    The ports of a component that have the same causality and type are neighbours, in the order
    of its description, so that one FMI call moves them all.

    Outputs of some components have a hidden place after all columns, into which their instance
    writes them; they are shown once they are copied into their columns.

    Attributes:
        values: of all ports, and the hidden ones.
        shown: a view of the columns only.
        columns: where the value of a port is.
        strings, text_ports: the texts for which numbers stand in it, and the ports they belong to.

    """

    def __init__(
        self, system: System, instances: Mapping[str, Instance], hidden: Collection[str] = ()
    ) -> None:
        """Lay out the row, tie the instances to it, and enter the inputs' values at the start.

        Args:
            system: whose ports these are.
            instances: of its components.
            hidden: the components whose outputs are hidden at first.

        """
        groups = [
            (name, causality, fmi_type, ports)
            for name in instances
            for causality in ("input", "output")
            for fmi_type in FMI_TYPES
            if (ports := _ports(system.components[name], causality, fmi_type))
        ]
        n = sum(len(ports) for *_, ports in groups)
        more = sum(
            len(ports) for name, causality, _, ports in groups if _hides(name, causality, hidden)
        )
        self.values = np.zeros(n + more)
        self.shown = self.values[:n]
        self.columns: dict[PortName, int] = {}
        self.strings, self.text_ports = StringTable(), set[PortName]()
        self._hidden: dict[PortName, int] = {}
        self._sources = {c.target: c.source for c in system.connections}
        self._ports: dict[str, list[tuple[PortName, str, str]]] = {name: [] for name in instances}
        self._integers: list[int] = []
        firsts: dict[str, int] = {}
        parts: dict[str, list[Part]] = {name: [] for name in instances}
        for component, causality, fmi_type, ports in groups:
            column = len(self.columns)
            where = column
            if _hides(component, causality, hidden):
                where = n + len(self._hidden)
                for i, port in enumerate(ports, start=where):
                    self._hidden[PortName(component, port.name)] = i
            first = where - firsts.setdefault(component, column)
            references = [port.valueReference for port in ports]
            place = slice(first, first + len(ports))
            parts[component].append(Part(causality, fmi_type, references, place))
            for i, port in enumerate(ports, start=column):
                name = PortName(component, port.name)
                self.columns[name] = i
                self._ports[component].append((name, causality, fmi_type))
                if causality == "input" and fmi_type != "Real":
                    self._integers.append(i)
                if fmi_type == "String":
                    self.text_ports.add(name)
                self.values[i] = self.number(system.components[component].starts.get(port.name, 0))
        for component, instance in instances.items():
            part = self.values[firsts.get(component, 0) :]
            instance.tie(part, parts[component], self.strings)
        self._hiding = {name: self.hidden(self._outputs(name)) for name in hidden}
        self.enter(system.parameters)

    def _outputs(self, component: str) -> list[PortName]:
        return [port for port, causality, _ in self._ports[component] if causality == "output"]

    def enter(self, values: Mapping[PortName, Value]) -> None:
        """Take values of ports, except the ones that are no finite numbers."""
        for port, value in values.items():
            if port in self.columns and isfinite(number := self.number(value)):
                self.values[self.columns[port]] = number

    def number(self, value: Value) -> float:
        """What stands for a value in the row."""
        return self.strings.number(value) if isinstance(value, str) else float(value)

    def wrong(self, components: Iterable[str]) -> str | None:
        """The first value that is no number, infinite, or none of an input's type, in words.

        Args:
            components: in the order in which they are stepped: others may have passed it on.

        Returns:
            What is wrong and where it comes from; None: nothing is.

        """
        if np.isfinite(self.shown).all() and are_integers(self.values[self._integers]):
            return None
        ports = [port for component in components for port in self._ports[component]]
        passed_on = None
        for port, causality, fmi_type in ports:
            value = self.values[self.columns[port]]
            if not isfinite(value):
                text = f"{port} is {value:g}"
            elif causality == "input" and fmi_type != "Real" and not are_integers(value):
                text = f"{port} is {value:.16g}, which no {fmi_type} of FMI can be"
            else:
                continue
            if causality == "output":
                return text
            source = self._sources.get(port)
            text += f", fed by {source}" if source else ", as a table or an event has it"
            if source is None or isfinite(self.values[self.columns[source]]):
                return text
            passed_on = passed_on or text
        return passed_on

    def moving(self, before: np.ndarray) -> list[PortName]:
        """The ports whose values are not what they were, apart from rounding."""
        near = np.isclose(self.values, before, rtol=_ROUNDING, atol=_ROUNDING)
        return [port for port, column in self.columns.items() if not near[column]]

    def places(self, connections: Sequence[Connection]) -> tuple[np.ndarray, np.ndarray]:
        """Where the targets and the sources of some connections are."""
        return (
            np.array([self.columns[c.target] for c in connections], dtype=np.intp),
            np.array([self.columns[c.source] for c in connections], dtype=np.intp),
        )

    def hidden(self, ports: Sequence[PortName]) -> tuple[np.ndarray, np.ndarray]:
        """Where the columns and the hidden places of some outputs are, as far as they have any."""
        known = [port for port in ports if port in self._hidden]
        return (
            np.array([self.columns[port] for port in known], dtype=np.intp),
            np.array([self._hidden[port] for port in known], dtype=np.intp),
        )

    def show(self, component: str) -> None:
        """Copy what is hidden of a component into its columns."""
        if component in self._hiding:
            targets, sources = self._hiding[component]
            self.values[targets] = self.values[sources]


def _hides(component: str, causality: str, hidden: Collection[str]) -> bool:
    return causality == "output" and component in hidden


def _ports(component: Component, causality: str, fmi_type: str) -> list[ModelVariable]:
    return [variable for variable in component.having(causality) if variable.type == fmi_type]
