"""The functions of an FMU in this process, and how they differ between versions of FMI."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Mapping, Sequence
from ctypes import addressof, byref
from functools import partial
from itertools import count
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple, Protocol

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Discard,
    fmi2DoStepStatus,
    fmi2Error,
    fmi2LastSuccessfulTime,
    fmi2OK,
    fmi2Pending,
    fmi2Status,
    fmi2String,
    fmi2Terminated,
    fmi2ValueReference,
    fmi2Warning,
)
from fmpy.fmi3 import (
    FMU3Slave,
    fmi3InstanceEnvironment,
    fmi3IntermediateUpdateCallback,
    fmi3LogMessageCallback,
)
from fmpy.logging import addLoggerProxy

from orchestrator.cosim.fmi.surroundings import restore_mode
from orchestrator.cosim.fmi.transfer import (
    DO_STEP_TYPES,
    CStepResult,
    DoStepCallback,
    Moved,
    address_of,
)
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.values import TYPES

#: Functions that FMUs must have: of FMI 2.0 all but those of a capability, of FMI 3.0 those that a
#: run calls.
_NEEDED_IN_2 = re.compile(r"(?!.*(FMUstate|Derivative|Status|CancelStep|DebugLogging)).*")
_NEEDED_IN_3 = re.compile(
    r"fmi3(InstantiateCoSimulation|FreeInstance|EnterInitializationMode|ExitInitializationMode|"
    r"DoStep|Terminate|Reset|[GS]et((Float|U?Int)\d+|Boolean|String))"
)

#: Interval of looks at a step that goes on after its call [s].
_GLANCE = 1e-3


class Stepped(NamedTuple):
    """The doStep of an FMU for the compiled loop.

    Attributes:
        do_step: where the function is.
        result: into which FMI 3.0 writes how a step has ended; None: FMI 2.0 does not.

    """

    do_step: int | None
    result: Any = None


class Hearer(Protocol):
    """Takes the messages of an instance.

    Attributes:
        name: of the instance.

    """

    name: str

    def hear(self, status: int, message: str) -> None:
        """Take a message."""


class _Slave:
    """The common part of all versions.

    Attributes:
        prefix: of the names of functions.
        platform: what it calls the folder of this machine's libraries.
        needed: the functions that no FMU may lack.

    """

    prefix: str
    platform: str
    needed: re.Pattern[str]
    dll: Any
    component: Any
    instanceName: str
    _functions: Mapping[str, Any]

    def moved(self, fmi_type: str) -> Moved:
        """The way in which values of a type are moved."""
        raise NotImplementedError

    def _loadFunctions(self) -> None:
        dll = self.dll
        self.dll = _Lenient(dll, self.needed)
        super()._loadFunctions()  # type: ignore[misc]
        self.dll = dll

    def _call(self, fname: str, *args: Any) -> Any:
        try:
            result = super()._call(fname, *args)  # type: ignore[misc]
        finally:
            restore_mode()
        # fmpy takes anything below FMI's statuses for success.
        if self._functions[fname].restype is fmi2Status and result < 0:
            raise FMICallException(fname, result)
        return result

    def freeLibrary(self) -> None:
        """Unload the library."""
        super().freeLibrary()  # type: ignore[misc]
        restore_mode()

    def begin(self, hearer: Hearer) -> None:
        """Instantiate the FMU.

        Args:
            hearer: takes its messages.

        Raises:
            Exception: it does not let itself be instantiated.

        """
        self._environment = next(_environments)
        _hearers[self._environment] = hearer
        try:
            self._instantiate(self._environment)
        except Exception:
            del _hearers[self._environment]
            raise

    def _instantiate(self, environment: int) -> None:
        raise NotImplementedError

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        # fmpy's freeInstance would unload the library as well.
        self._call(f"{self.prefix}FreeInstance", self.component)
        del _hearers[self._environment]

    def function(self, name: str, types: Sequence[Any] | None = None) -> Callable[..., Any]:
        """One of the FMU's functions, for calls of every step.

        fmpy's own methods look the function up and convert its arguments in every call, which
        costs as much as the call.

        Args:
            name: of the function, without its prefix.
            types: of its arguments; None: they come as values of ctypes.

        """
        called = self.dll[f"{self.prefix}{name}"]
        called.argtypes, called.restype = types, fmi2Status
        return partial(called, ctypes.c_void_p.from_param(self.component))

    def address(self, name: str) -> int | None:
        """The address of one of the FMU's functions."""
        return address_of(self.dll[f"{self.prefix}{name}"])

    def set(self, fmi_type: str, references: Sequence[int], values: Sequence[Any]) -> None:
        """Set values of one type."""
        moved = self.moved(fmi_type)
        if moved.c_type is fmi2String:
            values = [value.encode() for value in values]
        self._move(f"Set{moved.function}", references, (moved.c_type * len(values))(*values))

    def get(self, fmi_type: str, references: Sequence[int], n: int) -> list[Any]:
        """So many values of one type."""
        moved = self.moved(fmi_type)
        values = (moved.c_type * n)()
        self._move(f"Get{moved.function}", references, values)
        return list(values)

    def _move(self, name: str, references: Sequence[int], values: Any) -> None:
        n = len(references)
        arguments = ((fmi2ValueReference * n)(*references), n, values)
        self._call(f"{self.prefix}{name}", self.component, *arguments, *self._counted(len(values)))

    def derivatives(
        self, unknowns: Sequence[int], knowns: Sequence[int], seed: Sequence[float], n: int
    ) -> list[float]:
        """Derivatives of n values of some variables with others."""
        values: list[float] = self.getDirectionalDerivative(  # type: ignore[attr-defined]
            unknowns, knowns, seed, *self._counted(n)
        )
        return values

    def returned_at(self) -> float | None:
        """The time at which it has returned from that step, which it had to make in full [s]."""
        return None

    def _counted(self, n: int) -> tuple[int, ...]:
        """The arguments that say how many values there are."""
        return ()


class _Lenient:
    """A library in which optional functions that are missing can be looked up."""

    def __init__(self, dll: Any, needed: re.Pattern[str]) -> None:
        self._dll, self._needed = dll, needed

    def __getattr__(self, name: str) -> Any:
        try:
            return getattr(self._dll, name)
        except AttributeError:
            if self._needed.fullmatch(name):
                raise
            return lambda *_: fmi2Error


class FMU2OfOthers(_Slave, FMU2Slave):  # type: ignore[misc]
    """An FMU of FMI 2.0 that may lack functions that its capabilities do not ask for.

    By the beginning of the class's name fmpy knows the version.
    """

    prefix, platform, needed = "fmi2", fmpy.platform, _NEEDED_IN_2

    def moved(self, fmi_type: str) -> Moved:
        """The way in which values of a type are moved."""
        function = "Integer" if fmi_type == "Enumeration" else fmi_type
        c_types = {"Boolean": ctypes.c_int, "String": fmi2String}
        return Moved(function, c_types.get(fmi_type, TYPES[fmi_type].c_type))

    def _instantiate(self, environment: int) -> None:
        callbacks = _callbacks()
        callbacks.componentEnvironment = environment
        self.instantiate(callbacks=callbacks, loggingOn=True)

    def enter_initialization(self, start_time: float) -> None:
        """Set up the experiment, and enter that mode."""
        self.setupExperiment(startTime=start_time)
        self.enterInitializationMode()

    def stepping(self, component: Component) -> tuple[Callable[..., int], Stepped]:
        """Its doStep, and the same for the compiled loop."""
        if not component.description.coSimulation.canRunAsynchronuously:
            return self.function("DoStep"), Stepped(self.address("DoStep"))
        # Called back with numbers of Python, too.
        do_step = self._awaited(self.function("DoStep", DO_STEP_TYPES))
        self._called_back = DoStepCallback(lambda _, *step: do_step(*step))
        return do_step, Stepped(address_of(self._called_back))

    def _awaited(self, do_step: Callable[..., int]) -> Callable[..., int]:
        """Steps that the FMU may go on with after the call, as calls that end when they do."""
        status_of = (ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(fmi2Status))
        ask = self.function("GetStatus", status_of)

        def awaited(t: Any, h: Any, no_rollback: int) -> int:
            status = fmi2Status(do_step(t, h, no_rollback))
            while status.value == fmi2Pending:
                sleep(_GLANCE)
                if ask(fmi2DoStepStatus, byref(status)) not in (fmi2OK, fmi2Warning):
                    return int(fmi2Error)
            return int(status.value)

        return awaited

    def ended_at(self) -> float | None:
        """The time at which it has ended the run in a step that it has discarded [s]."""
        ended: bool = self.getBooleanStatus(fmi2Terminated)
        return float(self.getRealStatus(fmi2LastSuccessfulTime)) if ended else None


class FMU3OfOthers(_Slave, FMU3Slave):  # type: ignore[misc]
    """An FMU of FMI 3.0 that may lack functions that co-simulation without events does not need."""

    prefix, platform, needed = "fmi3", fmpy.platform_tuple, _NEEDED_IN_3

    def moved(self, fmi_type: str) -> Moved:
        """The way in which values of a type are moved."""
        function = "Int64" if fmi_type == "Enumeration" else fmi_type
        c_types = {"Enumeration": ctypes.c_int64, "String": fmi2String}
        return Moved(function, c_types.get(fmi_type, TYPES[fmi_type].c_type), is_counted=True)

    def _counted(self, n: int) -> tuple[int, ...]:
        return (n,)

    def _instantiate(self, environment: int) -> None:
        """Without event mode, and without leave to return early."""
        resources = Path(self.unzipDirectory, "resources")
        self.component = self.fmi3InstantiateCoSimulation(
            self.instanceName.encode(),
            self.guid.encode(),
            f"{resources}/".encode() if resources.is_dir() else None,
            visible=False,
            loggingOn=True,
            eventModeUsed=False,
            earlyReturnAllowed=False,
            requiredIntermediateVariables=None,
            nRequiredIntermediateVariables=0,
            instanceEnvironment=fmi3InstanceEnvironment(environment),
            logMessage=_log_of_fmi3,
            intermediateUpdate=fmi3IntermediateUpdateCallback(),
        )
        if not self.component:
            raise RuntimeError("Failed to instantiate model")

    def enter_initialization(self, start_time: float) -> None:
        """Set up the experiment, and enter that mode."""
        self.enterInitializationMode(startTime=start_time)

    def stepping(self, component: Component) -> tuple[Callable[..., int], Stepped]:
        """Its doStep, and the same for the compiled loop."""
        self._result = result = CStepResult()
        called = self.function("DoStep")
        outputs = [
            ctypes.c_void_p.from_param(addressof(result) + getattr(type(result), name).offset)
            for name, _ in result._fields_
        ]

        def do_step(t: Any, h: Any, no_rollback: int) -> int:
            status: int = called(t, h, no_rollback, *outputs)
            is_over = result.terminate or result.early
            return int(fmi2Discard) if is_over and status in (fmi2OK, fmi2Warning) else status

        return do_step, Stepped(self.address("DoStep"), ctypes.pointer(result))

    def ended_at(self) -> float | None:
        """The time at which it has ended the run in a step that it has discarded [s]."""
        result = self._result
        return float(result.last) if result.terminate else None

    def returned_at(self) -> float | None:
        """The time at which it has returned from that step, which it had to make in full [s]."""
        result = self._result
        return float(result.last) if result.early else None


def slave_class(component: Component) -> type[FMU2OfOthers | FMU3OfOthers]:
    """The functions of a component's version."""
    return FMU3OfOthers if component.description.fmiMajorVersion == 3 else FMU2OfOthers


#: Hearers of instances, by the environments that FMUs hand back with every message.
_hearers: dict[int, Hearer] = {}
_environments = count(1)


@fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log(
    environment: int | None, name: bytes, status: int, _: bytes, message: bytes | None
) -> None:
    hearer = _hearers.get(environment or 0) or _bearing(name)
    if hearer is not None:
        hearer.hear(status, (message or b"").decode(errors="replace"))


@fmi3LogMessageCallback  # type: ignore[untyped-decorator]
def _log_of_fmi3(environment: int | None, status: int, _: bytes, message: bytes | None) -> None:
    if (hearer := _hearers.get(environment or 0)) is not None:
        hearer.hear(status, (message or b"").decode(errors="replace"))


def _bearing(name: bytes | None) -> Hearer | None:
    """The instance with a name: some FMUs do not hand the environment back."""
    text = (name or b"").decode(errors="replace")
    return next((hearer for hearer in _hearers.values() if hearer.name == text), None)


def _callbacks() -> fmi2CallbackFunctions:
    """Callbacks of an instance.

    fmpy's proxy, which formats messages, knows one logger only: the last one that it was given. It
    may be another one after a run of fmpy's own.
    """
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _log
    # The functions of C themselves: made into callbacks of Python, they would cost an FMU that
    # allocates in every step more than the step.
    callbacks.allocateMemory = ctypes.cast(fmpy.calloc, fmi2CallbackAllocateMemoryTYPE)
    callbacks.freeMemory = ctypes.cast(fmpy.free, fmi2CallbackFreeMemoryTYPE)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks
