"""The row of all values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite

import numpy as np
from fmpy.model_description import ModelVariable

from orchestrator.master.instance import Instance, Part
from orchestrator.master.transfer import KINDS
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.system.values import Value


class Row:
    """All inputs and outputs of a system side by side, as floats.

    The ports of a component that have the same causality and kind are neighbours, in the order
    of its description, so that one FMI call moves them all.

    Attributes:
        values: of all ports.
        columns: where the value of a port is.

    """

    def __init__(self, system: System, instances: Mapping[str, Instance]) -> None:
        """Lay out the row, tie the instances to it, and enter the inputs' values at the start."""
        groups = [
            (name, causality, kind, ports)
            for name in instances
            for causality in ("input", "output")
            for kind in KINDS
            if (ports := _ports(system.components[name], causality, kind))
        ]
        self.values = np.zeros(sum(len(ports) for *_, ports in groups))
        self.columns: dict[PortName, int] = {}
        self._outputs: list[PortName] = []
        firsts: dict[str, int] = {}
        parts: dict[str, list[Part]] = {name: [] for name in instances}
        for component, causality, kind, ports in groups:
            column = len(self.columns)
            first = column - firsts.setdefault(component, column)
            references = [port.valueReference for port in ports]
            place = slice(first, first + len(ports))
            parts[component].append(Part(causality, kind, references, place))
            for i, port in enumerate(ports, start=column):
                name = PortName(component, port.name)
                self.columns[name] = i
                self._outputs += [name] * (causality == "output")
                start = system.components[component].start(port.name)
                self.values[i] = 0.0 if start is None else float(start)
        for component, instance in instances.items():
            instance.tie(self.values[firsts.get(component, 0) :], parts[component])
        for target, value in system.parameters.items():
            if target in self.columns:
                self.values[self.columns[target]] = float(value)

    def enter(self, component: str, values: Mapping[str, Value]) -> None:
        """Take values of a component's ports, but for those that are no finite numbers."""
        for port, value in values.items():
            column = self.columns.get(PortName(component, port))
            if column is not None and isinstance(value, int | float) and isfinite(value):
                self.values[column] = value

    def not_finite(self, components: Iterable[str]) -> str | None:
        """The first output that is no number or infinite, in words; None: all are finite.

        Args:
            components: in the order in which they are stepped: others may have passed it on.

        """
        for component in components:
            for port in self._outputs:
                value = self.values[self.columns[port]]
                if port.component == component and not isfinite(value):
                    return f"{port} is {value:g}"
        return None

    def places(self, connections: Sequence[Connection]) -> tuple[np.ndarray, np.ndarray]:
        """Where the targets and the sources of some connections are."""
        return (
            np.array([self.columns[c.target] for c in connections], dtype=np.intp),
            np.array([self.columns[c.source] for c in connections], dtype=np.intp),
        )


def _ports(component: Component, causality: str, kind: str) -> list[ModelVariable]:
    return [variable for variable in component.having(causality) if variable.type == kind]
