"""One instance of a component, driven by the names of its ports: as a class, or as an FMU."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from fmpy.fmi2 import FMU2Slave
from pythonfmu.enums import Fmi2Status

from fmus.discovery import source_of
from fmus.python.component import Component
from fmus.python.loading import ANSWER
from fmus.python.slave import slave_of


def component(name: str) -> type[Component]:
    """The class of a component."""
    return slave_of(name, import_module(source_of(name).module))


def messages_of(slave: Component) -> list[str]:
    """Messages that a slave has logged for the host."""
    return [entry.msg for entry in slave.log_queue if entry.category != ANSWER]


def answers_of(slave: Component) -> list[Fmi2Status]:
    """The statuses that a slave has told the native loader."""
    # An entry with a text tells a time.
    return [e.status for e in slave.log_queue if e.category == ANSWER and not e.msg]


class Variable(NamedTuple):
    """A port as a host sees it; its type has functions of its own."""

    reference: int
    type: str
    causality: str


def _variable(reference: int, fmi_type: str, causality: str) -> Variable:
    # Enumerations have the functions of integers.
    return Variable(reference, fmi_type.replace("Enumeration", "Integer"), causality)


class Instance(ABC):
    """An instance as tests use it, in whichever way it runs."""

    def __init__(self, variables: Mapping[str, Variable]) -> None:
        self.variables = variables
        self.time = 0.0

    @abstractmethod
    def write(self, fmi_type: str, references: list[int], values: list[Any]) -> None: ...

    @abstractmethod
    def read(self, fmi_type: str, references: list[int]) -> Sequence[Any]: ...

    @abstractmethod
    def advance(self, h: float) -> bool: ...

    def set(self, **values: Any) -> None:
        """Set ports by their names, with two underscores for a dot."""
        for name, value in values.items():
            variable = self.variables[name.replace("__", ".")]
            self.write(variable.type, [variable.reference], [value])

    def get(self, name: str) -> Any:
        variable = self.variables[name]
        return self.read(variable.type, [variable.reference])[0]

    def references(self, causality: str) -> list[int]:
        """References of the Real ports, in their order."""
        return [
            variable.reference
            for variable in self.variables.values()
            if (variable.causality, variable.type) == (causality, "Real")
        ]

    def outputs(self) -> list[float]:
        return [*self.read("Real", self.references("output"))]

    def excite(self, k: int) -> None:
        """Inputs of no special value, all in one call as a master does it."""
        references = self.references("input")
        if references:
            self.write("Real", references, [0.05 * ((i * 7 + k) % 11) - 0.2 for i in references])

    def step(self, h: float = 0.02) -> bool:
        accepted = self.advance(h)
        self.time += h
        return accepted

    def run(self, first: int, last: int) -> list[list[float]]:
        """The outputs after each of some excited steps."""
        rows = []
        for k in range(first, last):
            self.excite(k)
            assert self.step()
            rows.append(self.outputs())
        return rows


class ClassInstance(Instance):
    """A component as a Python class, initialised with some values.

    Args:
        name: of the component.
        plain: whether it is as in an FMU without the native loader.
        values: of ports, by their names, with two underscores for a dot.

    """

    def __init__(self, name: str, plain: bool = False, **values: object) -> None:
        self.component = component(name)
        self.slave = self.component(instance_name="under_test")
        self.slave._has_loader = not plain
        self.ports = self.slave._store.ports
        super().__init__(
            {
                port.name: _variable(reference, port.type, port.causality)
                for reference, port in enumerate(self.ports)
            }
        )
        self.slave.setup_experiment(0.0)
        self.set(**values)
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()

    def write(self, fmi_type: str, references: list[int], values: list[Any]) -> None:
        getattr(self.slave, f"set_{fmi_type.lower()}")(references, values)

    def read(self, fmi_type: str, references: list[int]) -> Sequence[Any]:
        read: Sequence[Any] = getattr(self.slave, f"get_{fmi_type.lower()}")(references)
        return read

    def advance(self, h: float) -> bool:
        return self.slave.do_step(self.time, h)

    def messages(self) -> list[str]:
        return messages_of(self.slave)

    def answers(self) -> list[Fmi2Status]:
        return answers_of(self.slave)


class FmuInstance(Instance):
    """An unpacked FMU, instantiated."""

    def __init__(self, folder: Path, name: str = "under_test") -> None:
        self.folder = folder
        self.description = fmpy.read_model_description(folder)
        super().__init__(
            {
                variable.name: _variable(variable.valueReference, variable.type, variable.causality)
                for variable in self.description.modelVariables
            }
        )
        self.fmu = FMU2Slave(
            instanceName=name,
            guid=self.description.guid,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=str(folder),
        )
        self.fmu.instantiate()

    def initialise(self, **values: Any) -> FmuInstance:
        self.fmu.setupExperiment(startTime=0.0)
        self.set(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time = 0.0
        return self

    def write(self, fmi_type: str, references: list[int], values: list[Any]) -> None:
        getattr(self.fmu, f"set{fmi_type}")(references, values)

    def read(self, fmi_type: str, references: list[int]) -> Sequence[Any]:
        read: Sequence[Any] = getattr(self.fmu, f"get{fmi_type}")(references)
        return read

    def advance(self, h: float) -> bool:
        """Raises FMICallException where the step is refused."""
        self.fmu.doStep(self.time, h)
        return True


@contextmanager
def unpacked(fmu: Path, folder: Path, name: str = "under_test") -> Iterator[FmuInstance]:
    """An FMU unpacked into a folder and instantiated, freed in the end."""
    fmpy.extract(fmu, unzipdir=folder)
    instance = FmuInstance(folder, name)
    try:
        yield instance
    finally:
        instance.fmu.freeInstance()
