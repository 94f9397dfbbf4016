"""An FMU loaded into this process."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from functools import partial
from itertools import count
from pathlib import Path
from time import sleep
from typing import Any, TypeAlias

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Component,
    fmi2Discard,
    fmi2DoStepStatus,
    fmi2Error,
    fmi2Fatal,
    fmi2FMUstate,
    fmi2LastSuccessfulTime,
    fmi2OK,
    fmi2Pending,
    fmi2Status,
    fmi2Terminated,
    fmi2Warning,
)
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelVariable

from orchestrator.machine.errors import InputError, reason
from orchestrator.master.fmi.binary import Library, library_of, name_with_fmu
from orchestrator.master.fmi.instance import DO_STEP, ComponentFailed, Ended, Listener, Part
from orchestrator.master.fmi.surroundings import restore_mode
from orchestrator.master.fmi.transfer import (
    DO_STEP_TYPES,
    CMember,
    CMove,
    DoStepCallback,
    PortBlock,
    address_of,
    decode_text,
)
from orchestrator.system.component import Component
from orchestrator.system.values import StringTable, Value

#: FMI's categories of messages about what goes wrong (FMI 2.0.4, section 2.2.4).
_LOGGED = {f"logStatus{status}" for status in ("Warning", "Discard", "Error", "Fatal")}

_DoStep: TypeAlias = Callable[[Any, Any, int], int]

#: Messages that are remembered, to say why something has failed.
_MOST_COMPLAINTS = 3

#: How often is looked whether a step has ended that goes on after its call [s].
_GLANCE = 1e-3


class LoadedInstance:
    """An instance whose FMU is called directly: see :class:`.instance.Instance`."""

    is_here = True

    def __init__(self, component: Component, library: Library, listener: Listener) -> None:
        """Instantiate an FMU.

        Raises:
            InputError: it does not let itself be instantiated.

        """
        self.name = component.name
        self.set_inputs: list[Callable[[], int]] = []
        self.get_outputs: list[Callable[[], int]] = []
        self._inputs: list[PortBlock] = []
        self._outputs: list[PortBlock] = []
        self._variables = component.variables
        self._gives_state = component.gives_state
        self.gives_derivatives = component.gives_derivatives
        categories = component.description.logCategories
        self._logged = [one.name for one in categories if one.name in _LOGGED]
        self._kept = fmi2FMUstate()
        self._library = library
        self._listener = listener
        self._complaints: deque[str] = deque(maxlen=_MOST_COMPLAINTS)
        self._worst = 0
        self._environment = next(_environments)
        _instances[self._environment] = self
        # The functions of the library serve all instances; only what differs is theirs.
        self._fmu = copy(library.fmu)
        self._fmu.instanceName = component.name
        callbacks = fmi2CallbackFunctions.from_buffer_copy(_SHARED)
        callbacks.componentEnvironment = self._environment
        try:
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:
            del _instances[self._environment]
            heard = [text.removeprefix(f"{self.name}: ") for text in self._complaints]
            why = " ".join(heard) or reason(error)
            needs = component.description.coSimulation.needsExecutionTool
            tool = "; it needs the tool that it was made with" * needs
            text = f"{name_with_fmu(component)} cannot be instantiated: {why}{tool}"
            raise InputError(text) from error
        self.do_step = self.function("DoStep")
        self._called_back: Any = None
        if component.description.coSimulation.canRunAsynchronuously:
            # Called back with numbers of Python, too.
            self.do_step = do_step = self._awaited(self.function("DoStep", DO_STEP_TYPES))
            self._called_back = DoStepCallback(lambda _, *step: do_step(*step))

    def _awaited(self, do_step: _DoStep) -> _DoStep:
        """Steps that the FMU may go on with after the call, as calls that end when they do."""
        ask = self.function("GetStatus", (fmi2Component, ctypes.c_int, ctypes.POINTER(fmi2Status)))

        def awaited(t: Any, h: Any, no_rollback: int) -> int:
            status = fmi2Status(do_step(t, h, no_rollback))
            while status.value == fmi2Pending:
                sleep(_GLANCE)
                if ask(fmi2DoStepStatus, ctypes.byref(status)) not in (fmi2OK, fmi2Warning):
                    return int(fmi2Error)
            return int(status.value)

        return awaited

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

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Say where its values are."""
        for part in parts:
            block = PortBlock(*part[:3], values[part.place], strings)
            function = self.function(block.function)
            if part.causality == "input":
                self._inputs.append(block)
                self.set_inputs.append(block.setter(function))
            else:
                self._outputs.append(block)
                self.get_outputs.append(block.getter(function))

    def pointers(self) -> CMember:
        """The same calls for the compiled loop."""
        inputs, outputs = (
            [block.move(address_of(self._fmu.dll[f"fmi2{block.function}"])) for block in blocks]
            for blocks in (self._inputs, self._outputs)
        )
        return CMember(
            self._fmu.component,
            address_of(self._called_back or self._fmu.dll["fmi2DoStep"]),
            (CMove * len(inputs))(*inputs),
            (CMove * len(outputs))(*outputs),
            len(inputs),
            len(outputs),
        )

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""
        self._set(values)
        # No stop time: k h ends beyond it by a rounding error, which many FMUs refuse.
        self._call("setupExperiment", startTime=start_time)
        self._call("enterInitializationMode")
        # FMI has it that guesses are set only before.
        variables = self._variables
        self._set({port: v for port, v in values.items() if variables[port].initial == "exact"})

    def exit_initialization(self) -> None:
        """Get ready for the first step, in which no FMU is to log more than what goes wrong.

        To log every step may take longer than the step. PythonFMU, which logs nothing on its own,
        gives the reasons of a failure no category.
        """
        self._call("exitInitializationMode")
        if not self._library.runs_python:
            with suppress(FMICallException):
                self._fmu.setDebugLogging(bool(self._logged), self._logged)

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        for call in (*self.set_inputs, *self.get_outputs):
            if (status := call()) not in (fmi2OK, fmi2Warning):
                raise self.failed(status, "exchanging values")
        restore_mode()

    def derivatives(self, outputs: Sequence[int], of: int) -> Sequence[float]:
        """How some outputs change with one input at the same time, by their value references."""
        found: list[float] = self._call("getDirectionalDerivative", outputs, [of], [1.0])
        return found

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""
        return {port: self._get(self._variables[port]) for port in ports}

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._set(values)

    def reset(self) -> None:
        """Return to the state before the initialisation."""
        self._call("reset")

    def keep(self) -> None:
        """Keep the state of now, to go back to it."""
        self._call("fmi2GetFMUstate", self._fmu.component, ctypes.byref(self._kept))

    def go_back(self) -> None:
        """Go back to the state that was kept."""
        self._call("setFMUstate", self._kept)

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs change linearly in the steps from now on."""
        if inputs:
            self._call("setRealInputDerivatives", inputs, [1] * len(inputs), slopes)

    def state(self) -> bytes:
        """The FMU's whole state between two steps."""
        with self._held("getFMUstate") as state:
            serialised: bytes = self._call("serializeFMUstate", state)
        return serialised

    def restore(self, state: bytes) -> None:
        """Take on a state."""
        self._complaints.clear()
        self._worst = 0
        with self._held("deSerializeFMUstate", state) as read:
            self._call("setFMUstate", read)
        # Some say only in a message that it is not theirs.
        if self._worst >= fmi2Discard:
            raise ComponentFailed(self._complaints[-1])

    @contextmanager
    def _held(self, method: str, *arguments: Any) -> Iterator[Any]:
        """A state that one of fmpy's methods gives, in the FMU's memory, freed at the end."""
        if not self._gives_state:
            raise ComponentFailed(f"{self.name}: its FMU does not provide its state")
        state = self._call(method, *arguments)
        try:
            yield state
        finally:
            if not self._library.corrupted:
                self._call("freeFMUstate", state)

    def terminate(self) -> None:
        """Let the FMU finish what it has begun."""
        if not self._library.corrupted:
            self._call("terminate")

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        if self._library.corrupted:
            # What it was given by us must stay where it is, too.
            return
        if self._kept:
            with suppress(FMICallException):
                self._fmu.freeFMUstate(self._kept)
        # FMU2Slave.freeInstance would unload the library as well.
        self._fmu.fmi2FreeInstance(self._fmu.component)
        del _instances[self._environment]

    def hear(self, status: int, message: str) -> None:
        """Take a message of the FMU; the latest explains a failure, a refusal before a warning."""
        text = f"{self.name}: {'; '.join(message.splitlines())}"
        if status >= min(self._worst, fmi2Discard):
            if self._worst < min(status, fmi2Discard):
                self._complaints.clear()
            self._complaints.append(text)
            self._worst = status
        self._listener.take(status, text)

    def _set(self, values: Mapping[str, Value]) -> None:
        for port, value in values.items():
            variable = self._variables[port]
            self._call(f"set{_fmi_type(variable)}", [variable.valueReference], [value])

    def _get(self, variable: ModelVariable) -> Value:
        value: Value | bytes | None
        (value,) = self._call(f"get{_fmi_type(variable)}", [variable.valueReference])
        if value is None or isinstance(value, bytes):
            return decode_text(value)
        return bool(value) if variable.type == "Boolean" else value

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """One of fmpy's methods, which are slow and convenient."""
        try:
            return getattr(self._fmu, method)(*arguments, **named)
        except FMICallException as error:
            raise self._failed(error) from error

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """What to raise after a call that has ended with a status."""
        restore_mode()
        if (function, status) == (DO_STEP, fmi2Discard) and not self._library.is_akin:
            with suppress(FMICallException):
                if self._fmu.getBooleanStatus(fmi2Terminated):
                    time = self._fmu.getRealStatus(fmi2LastSuccessfulTime)
                    text = f"{self.name} has ended the simulation, at {time:.12g} s"
                    return Ended(text, self.name, time)
        if status == fmi2Pending:
            return ComponentFailed(
                f"{self.name}: its step goes on after {function}, and its description does not "
                "say so (canRunAsynchronuously)"
            )
        return self._failed(FMICallException(function=function, status=status))

    def _failed(self, error: FMICallException) -> ComponentFailed:
        fatal = error.status == fmi2Fatal
        if fatal:
            self._library.corrupted = True
        last = self._complaints[-1] if self._complaints else f"{self.name}: {error}"
        return ComponentFailed(last, fatal)


def _fmi_type(variable: ModelVariable) -> str:
    return "Integer" if variable.type == "Enumeration" else str(variable.type)


@contextmanager
def load_instance(
    component: Component, listener: Listener, folder: Path | None = None
) -> Iterator[LoadedInstance]:
    """Load an instance of a component into this process, freed at the end.

    Args:
        component: to instantiate.
        listener: takes its messages.
        folder: into which its FMU is unpacked; None: this process unpacks it.

    Raises:
        InputError: the FMU cannot be loaded.

    """
    folder = component.folder if folder is None else folder
    with library_of(component, folder) as library:
        instance = LoadedInstance(component, library, listener)
        try:
            yield instance
        finally:
            instance.free()


#: Instances by the component environments that their FMUs hand back with every message.
_instances: dict[int, LoadedInstance] = {}
_environments = count(1)


@fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log(
    environment: int | None, name: bytes, status: int, _: bytes, message: bytes | None
) -> None:
    instance = _instances.get(environment or 0) or _bearing(name)
    if instance is not None:
        instance.hear(status, (message or b"").decode(errors="replace"))


def _bearing(name: bytes | None) -> LoadedInstance | None:
    """The instance with a name: some FMUs do not hand the environment back."""
    text = (name or b"").decode(errors="replace")
    return next((found for found in _instances.values() if found.name == text), None)


def _shared_callbacks() -> fmi2CallbackFunctions:
    """Callbacks of all instances: fmpy's proxy, which formats messages, knows one logger only."""
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _log
    # The functions of C themselves: made into callbacks of Python, they would cost an FMU that
    # allocates in every step more than the step.
    callbacks.allocateMemory = ctypes.cast(fmpy.calloc, fmi2CallbackAllocateMemoryTYPE)
    callbacks.freeMemory = ctypes.cast(fmpy.free, fmi2CallbackFreeMemoryTYPE)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


_SHARED = _shared_callbacks()
