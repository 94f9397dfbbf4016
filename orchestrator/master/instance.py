"""One running FMU: loading, parameters, steps, and what it says."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2Boolean,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Component,
    fmi2Discard,
    fmi2Real,
    fmi2Status,
    fmi2Warning,
)
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.errors import InputError, reason
from orchestrator.system.component import Component
from orchestrator.system.unpacking import check_place, unpacked
from orchestrator.system.values import Value

#: Messages that are kept: an FMU may have something to say in every step.
_MOST_MESSAGES = 100


class Log:
    """What the FMUs of a run have said with status warning or worse.

    Attributes:
        refusals: the first of it with status discard or worse.
        last: the latest, a refusal before a warning.

    """

    def __init__(self) -> None:
        """Start empty."""
        self._said: list[str] = []
        self._n = 0
        self.refusals: list[str] = []
        self.last = ""
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._take)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(ctypes.byref(self.callbacks))

    def _take(self, _: Any, instance: bytes, status: int, _category: bytes, message: bytes) -> None:
        text = f"{instance.decode(errors='replace')}: {message.decode(errors='replace')}"
        if status >= fmi2Warning:
            self._n += 1
            self._said += [text] * (len(self._said) < _MOST_MESSAGES)
        if status >= fmi2Discard:
            self.refusals += [text] * (len(self.refusals) < _MOST_MESSAGES)
        if status >= fmi2Discard or not self.refusals:
            self.last = text

    @property
    def messages(self) -> tuple[str, ...]:
        """The first of it, and how much there was."""
        more = self._n - len(self._said)
        return (*self._said, *([f"and {more} messages more"] * (more > 0)))


class Instance:
    """A loaded and instantiated FMU whose inputs and outputs live in a row of floats.

    Attributes:
        name: of the component.
        fmu: fmpy's view of it.
        set_inputs, get_outputs: one call for each kind of value that the component has; tied to
            the row by :class:`orchestrator.master.row.Row`.
        do_step: FMI's doStep, to be called with time and step size.

    """

    def __init__(self, component: Component, fmu: FMU2Slave) -> None:
        """Wrap an FMU that has been instantiated."""
        self.name = component.name
        self.fmu = fmu
        self._variables = component.variables
        self.set_inputs: list[Callable[[], Any]] = []
        self.get_outputs: list[Callable[[], Any]] = []
        self.do_step = self.function("DoStep", (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean))

    def function(self, name: str, types: Sequence[Any] | None = None) -> Callable[..., Any]:
        """One of the FMU's functions, for calls of every step.

        fmpy's own methods look the function up and convert its arguments in every call, which
        costs as much as the call.

        Args:
            name: of the function, without fmi2.
            types: of its arguments; None: they come as values of ctypes.

        """
        called = self.fmu.dll[f"fmi2{name}"]
        called.argtypes, called.restype, called.errcheck = types, fmi2Status, _refuse_failures
        return partial(called, fmi2Component(self.fmu.component))

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        for call in (*self.set_inputs, *self.get_outputs):
            call()

    def set(self, port: str, value: Value) -> None:
        """Set a start value or a parameter, given in the type of its variable."""
        variable = self._variables[port]
        setter = getattr(self.fmu, f"set{_fmi_type(variable)}")
        setter([variable.valueReference], [value])

    def parameters(self) -> dict[str, Any]:
        """Values of all parameters, as the FMU reports them."""
        return {
            name: self._get(variable)
            for name, variable in self._variables.items()
            if variable.causality == "parameter"
        }

    def _get(self, variable: ModelVariable) -> Any:
        value = getattr(self.fmu, f"get{_fmi_type(variable)}")([variable.valueReference])[0]
        if variable.type == "Boolean":
            return bool(value)
        return value.decode() if isinstance(value, bytes) else value


def _fmi_type(variable: ModelVariable) -> str:
    return "Integer" if variable.type == "Enumeration" else str(variable.type)


def _refuse_failures(status: int, called: Any, _: Any) -> int:
    if status > fmi2Warning:
        raise FMICallException(function=called.__name__, status=status)
    return status


@contextmanager
def running(component: Component, log: Log) -> Iterator[Instance]:
    """An instance of a component, freed at the end; its FMU stays loaded.

    Raises:
        InputError: the FMU cannot be loaded.

    """
    # The functions of the library serve all instances; what differs is theirs alone.
    with _LOCK:
        fmu = copy(_library(component.fmu, component.description, unpacked(component.fmu)))
    fmu.instanceName = component.name
    try:
        fmu.instantiate(callbacks=log.callbacks, loggingOn=True)
    except Exception as error:
        raise InputError(f"{component.fmu}: {reason(error)}") from error
    try:
        yield Instance(component, fmu)
    finally:
        # FMU2Slave.freeInstance would unload the library as well.
        fmu.fmi2FreeInstance(fmu.component)


#: Libraries by the folders into which their FMUs are unpacked, for runs in several threads.
_libraries: dict[Path, FMU2Slave] = {}
_LOCK = Lock()


def _library(fmu: Path, description: ModelDescription, folder: Path) -> FMU2Slave:
    """The library of an unpacked FMU, loaded once a process."""
    if folder not in _libraries:
        check_place(folder)
        try:
            _libraries[folder] = FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.coSimulation.modelIdentifier,
                unzipDirectory=str(folder),
            )
        except Exception as error:
            raise InputError(f"{fmu}: cannot be loaded: {reason(error)}") from error
    return _libraries[folder]
