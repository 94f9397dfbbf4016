"""The row of all values, and which FMI call moves which part of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import c_size_t
from functools import partial
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2Boolean, fmi2Integer, fmi2Real, fmi2ValueReference
from fmpy.model_description import ModelVariable

from orchestrator.master.instance import Instance
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System

#: Kinds of values that can be connected and recorded, with FMI's functions and types for them.
KINDS = {
    "Real": ("Real", fmi2Real),
    "Integer": ("Integer", fmi2Integer),
    "Enumeration": ("Integer", fmi2Integer),
    "Boolean": ("Boolean", fmi2Boolean),
}


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
            (instance, causality, kind, ports)
            for name, instance in instances.items()
            for causality in ("input", "output")
            for kind in KINDS
            if (ports := _ports(system.components[name], causality, kind))
        ]
        self.values = np.zeros(sum(len(ports) for *_, ports in groups))
        self.columns: dict[PortName, int] = {}
        for instance, causality, kind, ports in groups:
            first = len(self.columns)
            part = self.values[first : first + len(ports)]
            block = _Block(kind, [port.valueReference for port in ports], part)
            if causality == "input":
                instance.set_inputs.append(block.setter(instance))
            else:
                instance.get_outputs.append(block.getter(instance))
            for i, port in enumerate(ports, start=first):
                self.columns[PortName(instance.name, port.name)] = i
                start = system.components[instance.name].start(port.name)
                self.values[i] = 0.0 if start is None else float(start)
        for target, value in system.parameters.items():
            if target in self.columns:
                self.values[self.columns[target]] = float(value)

    def places(self, connections: Sequence[Connection]) -> tuple[np.ndarray, np.ndarray]:
        """Where the targets and the sources of some connections are."""
        return (
            np.array([self.columns[c.target] for c in connections], dtype=np.intp),
            np.array([self.columns[c.source] for c in connections], dtype=np.intp),
        )


def _ports(component: Component, causality: str, kind: str) -> list[ModelVariable]:
    return [variable for variable in component.having(causality) if variable.type == kind]


class _Block:
    """Values of one kind, side by side in the row of all values, moved by one FMI call."""

    def __init__(self, kind: str, references: list[int], row: np.ndarray) -> None:
        """Prepare the arrays that every call uses.

        Args:
            kind: one of :data:`KINDS`.
            references: value references.
            row: the part of the row of all values where the values are, a view.

        """
        self._kind, c_type = KINDS[kind]
        self._row = row
        self._n = c_size_t(len(references))
        self._references = (fmi2ValueReference * len(references))(*references)
        if kind == "Real":
            self._values = (c_type * len(references)).from_buffer(row)
        else:
            self._values = (c_type * len(references))()
            self._integers = np.frombuffer(self._values, dtype=np.intc)

    def _call(self, instance: Instance, action: str) -> Callable[[], Any]:
        return partial(
            instance.function(f"{action}{self._kind}"), self._references, self._n, self._values
        )

    def setter(self, instance: Instance) -> Callable[[], Any]:
        """A call that hands the values to the FMU."""
        call = self._call(instance, "Set")
        if self._kind == "Real":
            return call

        def set_converted() -> None:
            self._integers[:] = self._row
            call()

        return set_converted

    def getter(self, instance: Instance) -> Callable[[], Any]:
        """A call that takes the values from the FMU."""
        call = self._call(instance, "Get")
        if self._kind == "Real":
            return call

        def get_converted() -> None:
            call()
            self._row[:] = self._integers

        return get_converted
