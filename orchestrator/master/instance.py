"""One running FMU: loading, parameters, and the transfer of its values in blocks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2Boolean,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Integer,
    fmi2Real,
    fmi2ValueReference,
    fmi2Warning,
)
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelVariable

from orchestrator.errors import InputError
from orchestrator.system.structure import Component, typed

#: Kinds of values that can be connected and recorded.
KINDS = ("Real", "Integer", "Boolean")

_C_TYPES = {"Real": fmi2Real, "Integer": fmi2Integer, "Boolean": fmi2Boolean}


class Log:
    """What the FMUs of a run have said with status warning or worse."""

    def __init__(self) -> None:
        """Start empty."""
        self.messages: list[str] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._take)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(ctypes.byref(self.callbacks))

    def _take(self, _: Any, instance: bytes, status: int, _category: bytes, message: bytes) -> None:
        if status >= fmi2Warning:
            self.messages.append(f"{instance.decode()}: {message.decode(errors='replace')}")


class Instance:
    """A loaded and instantiated FMU whose inputs and outputs live in a row of floats.

    Attributes:
        name: of the component.
        set_inputs, get_outputs: one call for each kind of value that the component has.
        do_step: FMI's doStep, to be called with time and step size.

    """

    def __init__(self, component: Component, fmu: FMU2Slave) -> None:
        """Wrap an FMU that has been instantiated."""
        self.name = component.name
        self.fmu = fmu
        self._variables = component.variables
        self.set_inputs: list[Callable[[], Any]] = []
        self.get_outputs: list[Callable[[], Any]] = []
        self.do_step = partial(fmu.fmi2DoStep, fmu.component)

    def attach(self, inputs: Iterable[Block], outputs: Iterable[Block]) -> None:
        """Tie the FMU's ports to their places in the row of all values."""
        self.set_inputs = [block.setter(self.fmu) for block in inputs]
        self.get_outputs = [block.getter(self.fmu) for block in outputs]

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        for call in (*self.set_inputs, *self.get_outputs):
            call()

    def set(self, port: str, value: Any) -> None:
        """Set a start value or a parameter.

        Raises:
            InputError: the value is not of the variable's type.

        """
        variable = self._variables[port]
        literal = typed(f"{self.name}.{port}", variable, value)
        setter = getattr(self.fmu, f"set{_fmi_type(variable)}")
        setter([variable.valueReference], [literal])

    def parameters(self) -> dict[str, Any]:
        """Values of all parameters, as the FMU reports them."""
        return {
            name: self._get(variable)
            for name, variable in self._variables.items()
            if variable.causality == "parameter"
        }

    def is_faulty(self) -> bool:
        """The component's own `fault` output; False for an FMU that has none."""
        fault = self._variables.get("fault")
        return fault is not None and fault.type == "Boolean" and bool(self._get(fault))

    def _get(self, variable: ModelVariable) -> Any:
        value = getattr(self.fmu, f"get{_fmi_type(variable)}")([variable.valueReference])[0]
        if variable.type == "Boolean":
            return bool(value)
        return value.decode() if isinstance(value, bytes) else value


class Block:
    """Values of one kind, side by side in the row of all values, moved by one FMI call."""

    def __init__(self, kind: str, references: list[int], row: np.ndarray) -> None:
        """Prepare the arrays that every call uses.

        Args:
            kind: one of :data:`KINDS`.
            references: value references.
            row: the part of the row of all values where the values are, a view.

        """
        self._kind = kind
        self._row = row
        self._n = len(references)
        self._references = (fmi2ValueReference * self._n)(*references)
        c_type = _C_TYPES[kind]
        if kind == "Real":
            self._values = (c_type * self._n).from_buffer(row)
        else:
            self._values = (c_type * self._n)()
            self._integers = np.frombuffer(self._values, dtype=np.intc)

    def _call(self, fmu: FMU2Slave, action: str) -> Callable[[], Any]:
        return partial(
            getattr(fmu, f"fmi2{action}{self._kind}"),
            fmu.component,
            self._references,
            self._n,
            self._values,
        )

    def setter(self, fmu: FMU2Slave) -> Callable[[], Any]:
        """A call that hands the values to the FMU."""
        call = self._call(fmu, "Set")
        if self._kind == "Real":
            return call

        def set_converted() -> None:
            self._integers[:] = self._row
            call()

        return set_converted

    def getter(self, fmu: FMU2Slave) -> Callable[[], Any]:
        """A call that takes the values from the FMU."""
        call = self._call(fmu, "Get")
        if self._kind == "Real":
            return call

        def get_converted() -> None:
            call()
            self._row[:] = self._integers

        return get_converted


def _fmi_type(variable: ModelVariable) -> str:
    return "Integer" if variable.type == "Enumeration" else str(variable.type)


@contextmanager
def running(component: Component, log: Log) -> Iterator[Instance]:
    """An instance of a component; the FMU is freed and its temporary folder removed at the end.

    Raises:
        InputError: the FMU cannot be loaded.

    """
    with TemporaryDirectory(prefix="auvfmu") as folder:
        if "%" in Path(folder).as_uri().replace("%20", ""):
            # PythonFMU 0.7 does not decode the URI and crashes its host.
            raise InputError(
                f"temporary folder {folder!r}: FMUs need a path of plain ASCII characters; "
                "set TMPDIR to one"
            )
        try:
            fmpy.extract(component.fmu, unzipdir=folder)
            fmu = FMU2Slave(
                instanceName=component.name,
                guid=component.description.guid,
                modelIdentifier=component.description.coSimulation.modelIdentifier,
                unzipDirectory=folder,
            )
        except Exception as error:
            raise InputError(f"{component.fmu}: cannot be loaded: {error}") from error
        try:
            fmu.instantiate(callbacks=log.callbacks, loggingOn=True)
        except Exception as error:
            fmu.freeLibrary()
            raise InputError(f"{component.fmu}: {error}") from error
        try:
            yield Instance(component, fmu)
        finally:
            fmu.freeInstance()


def initialise(instances: Mapping[str, Instance], stop_time: float) -> None:
    """Bring instances whose parameters are set into initialisation mode.

    Raises:
        InputError: an FMU refused.

    """
    for instance in instances.values():
        instance.fmu.setupExperiment(startTime=0.0, stopTime=stop_time)
        instance.fmu.enterInitializationMode()
