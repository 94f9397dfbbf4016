"""An FMU loaded into this process: its library, its functions, its instances."""

from __future__ import annotations

import ctypes
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from ctypes import addressof, byref
from functools import partial
from itertools import count
from pathlib import Path
from shutil import copytree
from tempfile import mkdtemp
from threading import Lock
from time import sleep
from typing import Any, NamedTuple

import fmpy
import numpy as np
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
    fmi2Fatal,
    fmi2FMUstate,
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

from orchestrator.cosim.component import Component, runs_python
from orchestrator.cosim.fmi.binary import (
    binary_of,
    check_binary,
    check_place,
    make_binary,
    name_with_fmu,
)
from orchestrator.cosim.fmi.instance import (
    DO_STEP,
    DO_STEP_TYPES,
    CMember,
    CMove,
    ComponentFailed,
    CStepResult,
    DoStepCallback,
    Ended,
    Listener,
    Moved,
    Part,
    PortBlock,
    address_of,
    decode_text,
)
from orchestrator.cosim.fmi.surroundings import restore_mode, within_folder
from orchestrator.cosim.variables import TYPES, StringTable, Value
from orchestrator.machine.errors import InputError, reason

#: Functions that FMUs must have: in FMI 2.0 without capabilities, in FMI 3.0 for a run.
_NEEDED_IN_2 = re.compile(r"(?!.*(FMUstate|Derivative|Status|CancelStep|DebugLogging)).*")
_NEEDED_IN_3 = re.compile(
    r"fmi3(InstantiateCoSimulation|FreeInstance|EnterInitializationMode|ExitInitializationMode|"
    r"DoStep|Terminate|Reset|[GS]et((Float|U?Int)\d+|Boolean|String))"
)

#: Interval at which the status of a pending step is read [s].
_GLANCE = 1e-3


class Stepped(NamedTuple):
    """The doStep of an FMU for the compiled loop.

    Attributes:
        do_step: address of the function.
        result: into which FMI 3.0 writes how a step has ended; None for FMI 2.0.

    """

    do_step: int | None
    result: Any = None


class _Slave:
    """The part that all versions of FMI share.

    Attributes:
        prefix: of the names of functions.
        needed: pattern of the functions that an FMU must have.

    """

    prefix: str
    needed: re.Pattern[str]
    dll: Any
    component: Any
    instanceName: str
    _functions: Mapping[str, Any]

    def moved(self, fmi_type: str) -> Moved:
        """Return the FMI function for values of a type."""
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
        # fmpy takes a negative status for success.
        if self._functions[fname].restype is fmi2Status and result < 0:
            raise FMICallException(fname, result)
        return result

    def freeLibrary(self) -> None:
        """Unload the library."""
        super().freeLibrary()  # type: ignore[misc]
        restore_mode()

    def begin(self, instance: LoadedInstance) -> None:
        """Instantiate the FMU.

        Args:
            instance: takes its messages.

        Raises:
            Exception: it refuses.

        """
        self._environment = next(_environments)
        _instances[self._environment] = instance
        try:
            self._instantiate(self._environment)
        except Exception:
            del _instances[self._environment]
            raise

    def _instantiate(self, environment: int) -> None:
        raise NotImplementedError

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        # fmpy's freeInstance would also unload the library.
        self._call(f"{self.prefix}FreeInstance", self.component)
        del _instances[self._environment]

    def function(self, name: str, types: Sequence[Any] | None = None) -> Callable[..., Any]:
        """Return one of the FMU's functions, for calls in every step.

        fmpy's own methods look up the function and convert its arguments in every call, which takes
        as long as the call.

        Args:
            name: of the function, without its prefix.
            types: of its arguments; None: they are values of ctypes.

        """
        called = self.dll[f"{self.prefix}{name}"]
        called.argtypes, called.restype = types, fmi2Status
        return partial(called, ctypes.c_void_p.from_param(self.component))

    def address(self, name: str) -> int | None:
        """Return the address of one of the FMU's functions."""
        return address_of(self.dll[f"{self.prefix}{name}"])

    def set(self, fmi_type: str, references: Sequence[int], values: Sequence[Any]) -> None:
        """Set values of one type."""
        moved = self.moved(fmi_type)
        if moved.c_type is fmi2String:
            values = [value.encode() for value in values]
        self._move(f"Set{moved.function}", references, (moved.c_type * len(values))(*values))

    def get(self, fmi_type: str, references: Sequence[int], n: int) -> list[Any]:
        """Return n values of one type."""
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
        """Return the derivatives of n values of some variables by others."""
        values: list[float] = self.getDirectionalDerivative(  # type: ignore[attr-defined]
            unknowns, knowns, seed, *self._counted(n)
        )
        return values

    def returned_at(self) -> float | None:
        """Return the time of an early return from a step, which FMI does not allow here [s]."""
        return None

    def _counted(self, n: int) -> tuple[int, ...]:
        """Return the arguments for the number of values."""
        return ()


class _Lenient:
    """A library in which missing optional functions can be looked up."""

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
    """An FMU of FMI 2.0, which may lack functions of capabilities that it does not have.

    fmpy reads the version from the beginning of the class's name.
    """

    prefix, needed = "fmi2", _NEEDED_IN_2

    def moved(self, fmi_type: str) -> Moved:
        """Return the FMI function for values of a type."""
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
        """Return its doStep, and the same for the compiled loop."""
        if not component.description.coSimulation.canRunAsynchronuously:
            return self.function("DoStep"), Stepped(self.address("DoStep"))
        # The compiled loop calls it with numbers of Python.
        do_step = self._awaited(self.function("DoStep", DO_STEP_TYPES))
        self._called_back = DoStepCallback(lambda _, *step: do_step(*step))
        return do_step, Stepped(address_of(self._called_back))

    def _awaited(self, do_step: Callable[..., int]) -> Callable[..., int]:
        """Return a step that waits until the FMU has finished, where doStep may return earlier."""
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
        """Return the time at which it has ended the run in a discarded step [s]."""
        ended: bool = self.getBooleanStatus(fmi2Terminated)
        return float(self.getRealStatus(fmi2LastSuccessfulTime)) if ended else None


class FMU3OfOthers(_Slave, FMU3Slave):  # type: ignore[misc]
    """An FMU of FMI 3.0, which may lack functions for events."""

    prefix, needed = "fmi3", _NEEDED_IN_3

    def moved(self, fmi_type: str) -> Moved:
        """Return the FMI function for values of a type."""
        function = "Int64" if fmi_type == "Enumeration" else fmi_type
        c_types = {"Enumeration": ctypes.c_int64, "String": fmi2String}
        return Moved(function, c_types.get(fmi_type, TYPES[fmi_type].c_type), is_counted=True)

    def _counted(self, n: int) -> tuple[int, ...]:
        return (n,)

    def _instantiate(self, environment: int) -> None:
        """Instantiate the FMU without event mode, and without early return."""
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
        """Return its doStep, and the same for the compiled loop."""
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
        """Return the time at which it has ended the run in a discarded step [s]."""
        result = self._result
        return float(result.last) if result.terminate else None

    def returned_at(self) -> float | None:
        """Return the time of an early return from a step, which FMI does not allow here [s]."""
        result = self._result
        return float(result.last) if result.early else None


def slave_class(component: Component) -> type[FMU2OfOthers | FMU3OfOthers]:
    """Return the class for a component's version of FMI."""
    return FMU3OfOthers if component.description.fmiMajorVersion == 3 else FMU2OfOthers


#: Instances by the environments that FMUs return with every message.
_instances: dict[int, LoadedInstance] = {}
_environments = count(1)


@fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log(
    environment: int | None, name: bytes, status: int, _: bytes, message: bytes | None
) -> None:
    instance = _instances.get(environment or 0) or _instance_of(name)
    if instance is not None:
        instance.hear(status, (message or b"").decode(errors="replace"))


@fmi3LogMessageCallback  # type: ignore[untyped-decorator]
def _log_of_fmi3(environment: int | None, status: int, _: bytes, message: bytes | None) -> None:
    if (instance := _instances.get(environment or 0)) is not None:
        instance.hear(status, (message or b"").decode(errors="replace"))


def _instance_of(name: bytes | None) -> LoadedInstance | None:
    """Return the instance of a name: some FMUs do not return the environment."""
    text = (name or b"").decode(errors="replace")
    return next((instance for instance in _instances.values() if instance.name == text), None)


def _callbacks() -> fmi2CallbackFunctions:
    """Return the callbacks of an instance.

    fmpy's proxy, which formats messages, has only one logger: the last one that was set, which may
    be another one after a run of fmpy's own.
    """
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _log
    # Functions of C: as callbacks of Python, they would take longer than the step of an FMU that
    # allocates memory in every step.
    callbacks.allocateMemory = ctypes.cast(fmpy.calloc, fmi2CallbackAllocateMemoryTYPE)
    callbacks.freeMemory = ctypes.cast(fmpy.free, fmi2CallbackFreeMemoryTYPE)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


#: Libraries by the folders of their unpacked FMUs, for runs in several threads.
_libraries: dict[Path, Library] = {}
_LOCK = Lock()


class Library:
    """A loaded FMU with all its instances in this process.

    Attributes:
        fmu: object of fmpy.
        corrupted: True if an instance has ended with status fatal: FMI then forbids all further
            calls of all instances, even to free them.
        runs_python: True if PythonFMU has made it.
        is_akin: True if this program or PythonFMU has made it: nothing of an instance remains in
            it.
        users: number of instances.

    """

    def __init__(self, component: Component, folder: Path) -> None:
        """Load an FMU from the folder into which it is unpacked.

        Raises:
            InputError: it cannot be loaded.

        """
        check_place(folder)
        check_binary(component, folder)
        make_binary(component, folder)
        try:
            # fmpy changes the current folder, and does not restore it on failure.
            with within_folder(folder):
                self.fmu = slave_class(component)(
                    guid=component.description.guid,
                    modelIdentifier=component.description.coSimulation.modelIdentifier,
                    unzipDirectory=str(folder),
                    libraryPath=str(binary_of(component, folder)),
                )
        except Exception as error:
            raise InputError(
                f"{name_with_fmu(component)} cannot be loaded: {reason(error)}"
            ) from error
        finally:
            restore_mode()
        self.runs_python = runs_python(folder)
        self.is_akin = component.is_ours or self.runs_python
        self.corrupted, self.users = False, 0


@contextmanager
def library_of(component: Component, folder: Path) -> Iterator[Library]:
    """Provide the library of an unpacked FMU for one more instance.

    Many libraries keep something of their earlier instances: a library is unloaded with its last
    instance, unless it is known to keep nothing.

    Raises:
        InputError: it cannot be loaded.

    """
    with _LOCK:
        library = _libraries.get(folder)
        if library is None:
            library = Library(component, folder)
        elif library.corrupted:
            # It stays loaded with its memory; a copy under another name is a new library.
            library = Library(component, _copied(folder))
        _libraries[folder] = library
        library.users += 1
    try:
        yield library
    finally:
        with _LOCK:
            library.users -= 1
            if not (library.users or library.corrupted or library.is_akin):
                del _libraries[folder]
                library.fmu.freeLibrary()


def _copied(folder: Path) -> Path:
    try:
        return Path(copytree(folder, mkdtemp(dir=folder.parent), dirs_exist_ok=True))
    except OSError as error:
        raise InputError(f"{folder}: cannot be copied: {reason(error)}") from error


#: Categories of messages about errors (FMI 2.0.4, section 2.2.4).
_LOGGED = {f"logStatus{status}" for status in ("Warning", "Discard", "Error", "Fatal")}

#: Largest number of messages that are kept to explain a failure.
_MOST_COMPLAINTS = 3


class LoadedInstance:
    """An instance whose FMU is called directly: see :class:`.instance.Instance`."""

    is_here = True
    do_exchange = None

    def __init__(self, component: Component, library: Library, listener: Listener) -> None:
        """Instantiate an FMU.

        Raises:
            InputError: it refuses.

        """
        self.name = component.name
        self.set_inputs: list[Callable[[], int]] = []
        self.get_outputs: list[Callable[[], int]] = []
        self._inputs: list[PortBlock] = []
        self._outputs: list[PortBlock] = []
        self._component = component
        self._variables = component.variables
        self._gives_state = component.gives_state
        self.gives_derivatives = component.gives_derivatives
        categories = component.description.logCategories
        self._logged = [category.name for category in categories if category.name in _LOGGED]
        self._kept = fmi2FMUstate()
        self._library = library
        self._listener = listener
        #: References, orders and values of the derivatives of inputs.
        self._slopes: tuple[Sequence[int], Sequence[int], Sequence[float]] = ((), (), ())
        self._complaints: deque[str] = deque(maxlen=_MOST_COMPLAINTS)
        self._worst = 0
        # The functions of the library are shared by all instances; only the rest is copied.
        self._fmu = copy(library.fmu)
        self._fmu.instanceName = component.name
        try:
            self._fmu.begin(self)
        except Exception as error:
            heard = [text.removeprefix(f"{self.name}: ") for text in self._complaints]
            why = " ".join(heard) or reason(error)
            needs = component.description.coSimulation.needsExecutionTool
            tool = "; it needs the tool that it was made with" * needs
            text = f"{name_with_fmu(component)} cannot be instantiated: {why}{tool}"
            raise InputError(text) from error
        self.do_step, self._stepped = self._fmu.stepping(component)

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Tie the instance to its values in the row."""
        for calls in (self._inputs, self._outputs, self.set_inputs, self.get_outputs):
            calls.clear()
        for part in parts:
            moved = self._fmu.moved(part.fmi_type)
            row = values[part.place]
            block = PortBlock(part.causality, part.fmi_type, moved, part.references, row, strings)
            call = block.mover(self._fmu.function(block.function))
            if part.causality == "input":
                self._inputs.append(block)
                self.set_inputs.append(call)
            else:
                self._outputs.append(block)
                self.get_outputs.append(call)

    def pointers(self) -> CMember:
        """Return the same calls for the compiled loop."""
        inputs, outputs = (
            [block.move(self._fmu.address(block.function)) for block in blocks]
            for blocks in (self._inputs, self._outputs)
        )
        return CMember(
            self._fmu.component,
            self._stepped.do_step,
            self._stepped.result,
            (CMove * len(inputs))(*inputs),
            (CMove * len(outputs))(*outputs),
            len(inputs),
            len(outputs),
        )

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""
        # Nothing can be read yet.
        whole = self._whole(values, self._starts)
        self._set(whole)
        # No stop time: k h exceeds it by a rounding error, which many FMUs refuse.
        self._call("enter_initialization", start_time)
        # FMI allows guesses to be set only before.
        variables = self._variables
        self._set({port: v for port, v in whole.items() if variables[port].initial == "exact"})

    def exit_initialization(self) -> None:
        """Leave initialisation mode, and restrict logging to errors.

        Logging every step may take longer than the step. PythonFMU does not log on its own, and
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

    def derivatives(self, outputs: Sequence[str], known: str) -> Sequence[float]:
        """Return the derivatives of some outputs by one input at the same time."""
        unknowns, knowns = self._arrays(outputs), self._arrays([known])
        seed = [float(port == known) for ports in knowns for port in ports]
        values = self._call(
            "derivatives", self._references(unknowns), self._references(knowns), seed,
            sum(map(len, unknowns)),
        )  # fmt: skip
        by_name = dict(zip((port for ports in unknowns for port in ports), values, strict=True))
        return [by_name[port] for port in outputs]

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Return values of some variables, as the FMU holds them."""
        held = {port: v for array in self._arrays(ports) for port, v in self._get(array).items()}
        return {port: held[port] for port in ports}

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._set(self._whole(values, self.read))

    def reset(self) -> None:
        """Return to the state before the initialisation."""
        self._call("reset")

    def keep(self) -> None:
        """Keep the present state, to go back to it."""
        self._call("fmi2GetFMUstate", self._fmu.component, ctypes.byref(self._kept))

    def go_back(self) -> None:
        """Go back to the state that was kept."""
        self._call("setFMUState", self._kept)

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs change linearly in all further steps."""
        if inputs:
            if self._change not in self.set_inputs:
                # Set after the values: an FMU may take a value for a new one that does not change.
                self.set_inputs.append(self._change)
            self._slopes = inputs, [1] * len(inputs), slopes
            self._change()

    def _change(self) -> int:
        self._call("setRealInputDerivatives", *self._slopes)
        return int(fmi2OK)

    def state(self) -> bytes:
        """Return the FMU's whole state between two steps."""
        with self._held("getFMUState") as state:
            serialised: bytes = self._call("serializeFMUState", state)
        return serialised

    def restore(self, state: bytes) -> None:
        """Restore a state."""
        self._complaints.clear()
        self._worst = 0
        with self._held("deserializeFMUState", state) as read:
            self._call("setFMUState", read)
        # Some FMUs refuse a foreign state only in a message.
        if self._worst >= fmi2Discard:
            raise ComponentFailed(self._complaints[-1])

    @contextmanager
    def _held(self, method: str, *arguments: Any) -> Iterator[Any]:
        """Provide a state in the FMU's memory, made by a method of fmpy and freed at the end."""
        if not self._gives_state:
            raise ComponentFailed(f"{self.name}: its FMU does not provide its state")
        state = self._call(method, *arguments)
        try:
            yield state
        finally:
            if not self._library.corrupted:
                self._call("freeFMUState", state)

    def terminate(self) -> None:
        """Terminate the FMU."""
        if not self._library.corrupted:
            self._call("terminate")

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        if self._library.corrupted:
            # The FMU may still use memory that we have given it.
            return
        if self._kept:
            with suppress(FMICallException):
                self._fmu.freeFMUState(self._kept)
        self._fmu.free()

    def hear(self, status: int, message: str) -> None:
        """Take a message; the latest one explains a failure, a refusal before a warning."""
        text = f"{self.name}: {'; '.join(message.splitlines())}"
        if status >= min(self._worst, fmi2Discard):
            if self._worst < min(status, fmi2Discard):
                self._complaints.clear()
            self._complaints.append(text)
            self._worst = status
        self._listener.take(status, text)

    def _arrays(self, ports: Iterable[str]) -> list[list[str]]:
        """Return the names of some variables, each with all elements of its array."""
        arrays = self._component.arrays
        names = dict.fromkeys(self._variables[port].array for port in ports)
        return [[v.name for v in arrays[name]] if name in arrays else [name] for name in names]

    def _references(self, arrays: Sequence[Sequence[str]]) -> list[int]:
        return [self._variables[ports[0]].reference for ports in arrays]

    def _whole(
        self, values: Mapping[str, Value], others: Callable[[list[str]], Mapping[str, Value]]
    ) -> dict[str, Value]:
        """Add the other elements of their arrays, which can only be set as a whole."""
        ports = [port for array in self._arrays(values) for port in array]
        return {**others([port for port in ports if port not in values]), **values}

    def _starts(self, ports: Iterable[str]) -> dict[str, Value]:
        """Return the start values of some variables."""
        starts = self._component.starts
        for port in ports:
            if port not in starts:
                raise ComponentFailed(
                    f"{self.name}.{port} has no start value in its description: set all elements "
                    "of the array"
                )
        return {port: starts[port] for port in ports}

    def _set(self, values: Mapping[str, Value]) -> None:
        for ports in self._arrays(values):
            variable = self._variables[ports[0]]
            taken = [values[port] for port in ports]
            self._call("set", variable.type, [variable.reference], taken)

    def _get(self, ports: Sequence[str]) -> dict[str, Value]:
        """Return values of a variable, or of all elements of an array."""
        variable = self._variables[ports[0]]
        values = self._call("get", variable.type, [variable.reference], len(ports))
        if variable.type == "String":
            values = map(decode_text, values)
        elif variable.type == "Boolean":
            values = map(bool, values)
        return dict(zip(ports, values, strict=True))

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Call one of fmpy's methods, which are slow but convenient."""
        try:
            return getattr(self._fmu, method)(*arguments, **named)
        except FMICallException as error:
            raise self._failed(error) from error

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """Return the exception for a call that has ended with a status."""
        restore_mode()
        # Made first: the FMU may complain about later questions.
        failure = self._failed(FMICallException(function=function, status=status))
        # PythonFMU reports a wish to terminate for every step that it refuses.
        if (function, status) == (DO_STEP, fmi2Discard) and not self._library.runs_python:
            with suppress(FMICallException):
                if (time := self._fmu.ended_at()) is not None:
                    return Ended(f"{self.name} has ended the simulation, at {time:.12g} s")
        if (function, status) == (DO_STEP, fmi2Discard) and (
            time := self._fmu.returned_at()
        ) is not None:
            return ComponentFailed(
                f"{self.name}: returned early from its step, at {time:.12g} s, without being "
                "allowed to"
            )
        if status == fmi2Pending:
            return ComponentFailed(
                f"{self.name}: its step continues after {function}, although its description does "
                "not say so (canRunAsynchronuously)"
            )
        return failure

    def _failed(self, error: FMICallException) -> ComponentFailed:
        fatal = error.status == fmi2Fatal
        if fatal:
            self._library.corrupted = True
        last = self._complaints[-1] if self._complaints else f"{self.name}: {error}"
        return ComponentFailed(last, fatal)


@contextmanager
def load_instance(
    component: Component, listener: Listener, folder: Path | None = None
) -> Iterator[LoadedInstance]:
    """Load an instance of a component into this process, and free it at the end.

    Args:
        component: to instantiate.
        listener: takes its messages.
        folder: of its unpacked FMU; None: this process unpacks it.

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
