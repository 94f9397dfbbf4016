"""An FMU loaded into this process."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from copy import copy
from functools import partial
from itertools import count
from pathlib import Path
from shutil import copytree
from tempfile import mkdtemp
from threading import Lock
from typing import Any

import fmpy
import numpy as np
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
    fmi2Fatal,
    fmi2Real,
    fmi2Status,
    fmi2Warning,
)
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.errors import InputError, reason
from orchestrator.master import layout
from orchestrator.master.instance import ComponentFailed, Instance, Part
from orchestrator.master.log import Listener
from orchestrator.master.transfer import Block
from orchestrator.system.component import Component
from orchestrator.system.unpacking import check_place, unpacked
from orchestrator.system.values import Value


class Library:
    """A loaded FMU, which serves all its instances in this process.

    Attributes:
        fmu: fmpy's view of it.
        corrupted: whether one of them has ended with fmi2Fatal: FMI then forbids every further
            call, also for the others, even to free them.

    """

    def __init__(self, archive: Path, description: ModelDescription, folder: Path) -> None:
        """Load what has been unpacked into a folder.

        Raises:
            InputError: it cannot be loaded.

        """
        check_place(folder)
        try:
            self.fmu = FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.coSimulation.modelIdentifier,
                unzipDirectory=str(folder),
            )
        except Exception as error:
            raise InputError(f"{archive}: cannot be loaded: {reason(error)}") from error
        self.corrupted = False


#: Libraries by the folders into which their FMUs are unpacked, for runs in several threads.
_libraries: dict[Path, Library] = {}
_LOCK = Lock()


def _library(component: Component, folder: Path) -> Library:
    """The library of an unpacked FMU, loaded once a process, or a copy of a corrupted one."""
    with _LOCK:
        found = _libraries.get(folder)
        if found is None:
            found = Library(component.fmu, component.description, folder)
        elif found.corrupted:
            # It stays loaded, with all that it has in memory; under another name it is a new one.
            found = Library(component.fmu, component.description, _copied(folder))
        _libraries[folder] = found
        return found


def _copied(folder: Path) -> Path:
    try:
        return Path(copytree(folder, mkdtemp(dir=folder.parent), dirs_exist_ok=True))
    except OSError as error:
        raise InputError(f"{folder}: cannot be copied: {reason(error)}") from error


class LoadedInstance:
    """An instance whose FMU is called directly: see :class:`.instance.Instance`."""

    def __init__(self, component: Component, library: Library, listener: Listener) -> None:
        """Instantiate an FMU.

        Raises:
            InputError: it does not let itself be instantiated.

        """
        self.name = component.name
        self.set_inputs: list[Callable[[], int]] = []
        self.get_outputs: list[Callable[[], int]] = []
        self._inputs: list[Block] = []
        self._outputs: list[Block] = []
        self._variables = component.variables
        self._gives_state = component.gives_state
        self._library = library
        self._listener = listener
        self._complaint = ""
        self._worst = 0
        self._environment = next(_environments)
        _instances[self._environment] = self
        # The functions of the library serve all instances; what differs is theirs alone.
        self._fmu = copy(library.fmu)
        self._fmu.instanceName = component.name
        try:
            self._fmu.instantiate(callbacks=_callbacks(self._environment), loggingOn=True)
        except Exception as error:
            del _instances[self._environment]
            why = self._complaint or reason(error)
            raise InputError(f"{component.fmu}: {why}") from error
        self.do_step = self.function("DoStep", (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean))

    def function(self, name: str, types: Sequence[Any] | None = None) -> Callable[..., Any]:
        """One of the FMU's functions, for calls of every step.

        fmpy's own methods look the function up and convert its arguments in every call, which
        costs as much as the call.

        Args:
            name: of the function, without fmi2.
            types: of its arguments; None: they come as values of ctypes.

        """
        called = self._fmu.dll[f"fmi2{name}"]
        called.argtypes, called.restype = types, fmi2Status
        return partial(called, fmi2Component(self._fmu.component))

    def tie(self, values: np.ndarray, parts: Sequence[Part]) -> None:
        """Say where its values are."""
        for part in parts:
            block = Block(*part[:3], values[part.place])
            function = self.function(block.function)
            if part.causality == "input":
                self._inputs.append(block)
                self.set_inputs.append(block.setter(function))
            else:
                self._outputs.append(block)
                self.get_outputs.append(block.getter(function))

    def pointers(self) -> layout.Member:
        """The same calls for the compiled loop."""
        inputs, outputs = (
            [block.move(self._address(block.function)) for block in blocks]
            for blocks in (self._inputs, self._outputs)
        )
        return layout.Member(
            self._fmu.component,
            self._address("DoStep"),
            (layout.Move * len(inputs))(*inputs),
            (layout.Move * len(outputs))(*outputs),
            len(inputs),
            len(outputs),
        )

    def _address(self, name: str) -> int | None:
        """Of one of the FMU's functions, without fmi2."""
        return ctypes.cast(self._fmu.dll[f"fmi2{name}"], ctypes.c_void_p).value

    def enter_initialization(
        self, values: Mapping[str, Value], stop_time: float, start_time: float = 0.0
    ) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""
        self._set(values)
        self._call("setupExperiment", startTime=start_time, stopTime=stop_time)
        self._call("enterInitializationMode")
        # FMI has it that guesses are set before alone.
        variables = self._variables
        self._set({port: v for port, v in values.items() if variables[port].initial == "exact"})

    def exit_initialization(self) -> None:
        """Get ready for the first step."""
        self._call("exitInitializationMode")

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        for call in (*self.set_inputs, *self.get_outputs):
            if (status := call()) > fmi2Warning:
                raise self.failed(status, "exchanging values")

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""
        return {port: self._get(self._variables[port]) for port in ports}

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._set(values)

    def reset(self) -> None:
        """Be what it was before the initialisation."""
        self._call("reset")

    def state(self) -> bytes:
        """The FMU's whole state between two steps."""
        with self._held("getFMUstate") as state:
            serialised: bytes = self._call("serializeFMUstate", state)
        return serialised

    def restore(self, state: bytes) -> None:
        """Take on a state."""
        self._complaint, self._worst = "", 0
        with self._held("deSerializeFMUstate", state) as read:
            self._call("setFMUstate", read)
        # Some say in a message alone that it is none of theirs.
        if self._worst >= fmi2Discard:
            raise ComponentFailed(self._complaint)

    @contextmanager
    def _held(self, method: str, *arguments: Any) -> Iterator[Any]:
        """A state that one of fmpy's methods gives, in the FMU's memory, freed at the end."""
        if not self._gives_state:
            raise ComponentFailed(f"{self.name}: its FMU does not give its state away")
        state = self._call(method, *arguments)
        try:
            yield state
        finally:
            if not self._library.corrupted:
                self._call("freeFMUstate", state)

    def terminate(self) -> None:
        """Let the FMU end what it has begun."""
        if not self._library.corrupted:
            self._call("terminate")

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        if self._library.corrupted:
            # What it was given by us must stay where it is, too.
            return
        # FMU2Slave.freeInstance would unload the library as well.
        self._fmu.fmi2FreeInstance(self._fmu.component)
        del _instances[self._environment]

    def hear(self, status: int, message: str) -> None:
        """Take a message of the FMU; the latest explains a failure, a refusal before a warning."""
        text = f"{self.name}: {'; '.join(message.splitlines())}"
        if status >= min(self._worst, fmi2Discard):
            self._complaint, self._worst = text, status
        self._listener.take(status, text)

    def _set(self, values: Mapping[str, Value]) -> None:
        for port, value in values.items():
            variable = self._variables[port]
            self._call(f"set{_fmi_type(variable)}", [variable.valueReference], [value])

    def _get(self, variable: ModelVariable) -> Value:
        value: Value | bytes | None
        (value,) = self._call(f"get{_fmi_type(variable)}", [variable.valueReference])
        if isinstance(value, bytes):
            return value.decode(errors="replace")
        # Some have no text where an empty one is meant.
        return "" if value is None else bool(value) if variable.type == "Boolean" else value

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """One of fmpy's methods, which are slow and convenient."""
        try:
            return getattr(self._fmu, method)(*arguments, **named)
        except FMICallException as error:
            raise self._failed(error) from error

    def failed(self, status: int, function: str) -> ComponentFailed:
        """What to raise after a call that has ended with a status."""
        return self._failed(FMICallException(function=function, status=status))

    def _failed(self, error: FMICallException) -> ComponentFailed:
        fatal = error.status == fmi2Fatal
        if fatal:
            self._library.corrupted = True
        return ComponentFailed(self._complaint or f"{self.name}: {error}", fatal)


def _fmi_type(variable: ModelVariable) -> str:
    return "Integer" if variable.type == "Enumeration" else str(variable.type)


@contextmanager
def loaded(
    component: Component, listener: Listener, folder: Path | None = None
) -> Iterator[LoadedInstance]:
    """An instance of a component in this process, freed at the end.

    Args:
        component: what is instantiated.
        listener: takes what it says.
        folder: into which its FMU is unpacked; None: this process unpacks it.

    Raises:
        InputError: the FMU cannot be loaded.

    """
    folder = unpacked(component.fmu) if folder is None else folder
    instance = LoadedInstance(component, _library(component, folder), listener)
    try:
        yield instance
    finally:
        instance.free()


@contextmanager
def all_loaded(
    components: Mapping[str, Component], listener: Listener
) -> Iterator[dict[str, Instance]]:
    """Instances of components by their names, all in this process, freed at the end."""
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(loaded(component, listener))
            for name, component in components.items()
        }


#: Instances by the component environments that their FMUs hand back with every message.
_instances: dict[int, LoadedInstance] = {}
_environments = count(1)


@fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log(
    environment: int | None, _: bytes, status: int, _category: bytes, message: bytes | None
) -> None:
    instance = _instances.get(environment or 0)
    if instance is not None:
        instance.hear(status, (message or b"").decode(errors="replace"))


def _shared_callbacks() -> fmi2CallbackFunctions:
    """Those of all instances: fmpy's proxy, which formats the messages, knows one logger only."""
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _log
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


_SHARED = _shared_callbacks()


def _callbacks(environment: int) -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions.from_buffer_copy(_SHARED)
    callbacks.componentEnvironment = environment
    return callbacks
