"""A bare master on fmpy: FMUs of FMI 2.0, stepped in groups, from a given beginning."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

#: How a run begins: outputs exchanged in initialisation mode until they settle; read before the
#: first step, and not exchanged in initialisation mode; zeros until a component was stepped.
FULL, NONE, ZERO = "full", "none", "zero"

#: Rounds after which the outputs have settled in initialisation mode.
_ROUNDS = 10

Port = tuple[str, str]


class _Unit:
    """An FMU, and the values at its ports."""

    def __init__(self, name: str, folder: str, wires: Sequence[tuple[Port, Port]]) -> None:
        description = fmpy.read_model_description(folder, validate=False)
        numbers = {v.name: v.valueReference for v in description.modelVariables}
        self.sources = [source for source, target in wires if target[0] == name]
        self.inputs = [numbers[port] for _, (owner, port) in wires if owner == name]
        outputs = [v for v in description.modelVariables if v.causality == "output"]
        self.outputs = [v for v in outputs if v.type == "Real"]
        self.name = name
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def take(self, values: dict[Port, float]) -> None:
        """Set the inputs that are fed."""
        if self.inputs:
            self.fmu.setReal(self.inputs, [values[source] for source in self.sources])

    def give(self, values: dict[Port, float]) -> None:
        """Read the outputs."""
        read = self.fmu.getReal([v.valueReference for v in self.outputs])
        values.update(zip(((self.name, v.name) for v in self.outputs), read, strict=True))


def _groups(order: str, names: Sequence[str]) -> list[list[str]]:
    """The groups that `jacobi`, or `a,b,[rest]`, stands for."""
    if order == "jacobi":
        return [list(names)]
    first = [[name] for name in order.split(",") if name != "[rest]"]
    rest = [name for name in names if [name] not in first]
    return [*first, rest] if rest else first


def rows(
    folders: dict[str, str],
    wires: Sequence[tuple[Port, Port]],
    wanted: Sequence[Port],
    beginning: str,
    order: str,
    steps: int,
    step: float,
) -> np.ndarray:
    """The wanted outputs after every step.

    Args:
        folders: of the unpacked FMUs, by the names of the components.
        wires: source and target.
        wanted: component and port.
        beginning: FULL, NONE or ZERO.
        order: `jacobi`, or components in their order; `[rest]` are all others, side by side.
        steps: how many.
        step: communication step [s].

    """
    units = {name: _Unit(name, folder, wires) for name, folder in folders.items()}
    values: dict[Port, float] = {source: 0.0 for source, _ in wires}

    def exchange() -> None:
        for unit in units.values():
            unit.give(values)
        for unit in units.values():
            unit.take(values)

    for _ in range(_ROUNDS if beginning == FULL else 0):
        exchange()
    for unit in units.values():
        unit.fmu.exitInitializationMode()
        if beginning != ZERO:
            unit.give(values)

    def run() -> Iterator[list[float]]:
        for k in range(steps):
            for group in _groups(order, list(units)):
                for name in group:
                    units[name].take(values)
                for name in group:
                    units[name].fmu.doStep(k * step, step)
                for name in group:
                    units[name].give(values)
            yield [values[port] for port in wanted]

    found = np.array(list(run()))
    for unit in units.values():
        unit.fmu.terminate()
        unit.fmu.freeInstance()
    return found
