"""An FMU loaded into this process."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    fmi2Discard,
    fmi2Fatal,
    fmi2FMUstate,
    fmi2OK,
    fmi2Pending,
    fmi2Warning,
)

from orchestrator.cosim.fmi.binary import Library, library_of, name_with_fmu
from orchestrator.cosim.fmi.instance import DO_STEP, ComponentFailed, Ended, Listener, Part
from orchestrator.cosim.fmi.surroundings import restore_mode
from orchestrator.cosim.fmi.transfer import CMember, CMove, PortBlock, decode_text
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.values import StringTable, Value
from orchestrator.machine.errors import InputError, reason

#: FMI's categories of messages about what goes wrong (FMI 2.0.4, section 2.2.4).
_LOGGED = {f"logStatus{status}" for status in ("Warning", "Discard", "Error", "Fatal")}

#: Messages that are remembered, to say why something has failed.
_MOST_COMPLAINTS = 3


class LoadedInstance:
    """An instance whose FMU is called directly: see :class:`.instance.Instance`."""

    is_here = True
    do_exchange = None

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
        self._component = component
        self._variables = component.variables
        self._gives_state = component.gives_state
        self.gives_derivatives = component.gives_derivatives
        categories = component.description.logCategories
        self._logged = [one.name for one in categories if one.name in _LOGGED]
        self._kept = fmi2FMUstate()
        self._library = library
        self._listener = listener
        #: References, orders and values of the derivatives of inputs.
        self._slopes: tuple[Sequence[int], Sequence[int], Sequence[float]] = ((), (), ())
        self._complaints: deque[str] = deque(maxlen=_MOST_COMPLAINTS)
        self._worst = 0
        # The functions of the library serve all instances; only what differs is theirs.
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
        """Say where its values are."""
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
        """The same calls for the compiled loop."""
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
        # There is nothing to be read yet.
        whole = self._whole(values, self._starts)
        self._set(whole)
        # No stop time: k h ends beyond it by a rounding error, which many FMUs refuse.
        self._call("enter_initialization", start_time)
        # FMI has it that guesses are set only before.
        variables = self._variables
        self._set({port: v for port, v in whole.items() if variables[port].initial == "exact"})

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

    def derivatives(self, outputs: Sequence[str], of: str) -> Sequence[float]:
        """Derivatives of some outputs with one input at the same time."""
        unknowns, knowns = self._arrays(outputs), self._arrays([of])
        seed = [float(port == of) for ports in knowns for port in ports]
        values = self._call(
            "derivatives", self._references(unknowns), self._references(knowns), seed,
            sum(map(len, unknowns)),
        )  # fmt: skip
        by_name = dict(zip((port for ports in unknowns for port in ports), values, strict=True))
        return [by_name[port] for port in outputs]

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""
        held = {port: v for array in self._arrays(ports) for port, v in self._get(array).items()}
        return {port: held[port] for port in ports}

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._set(self._whole(values, self.read))

    def reset(self) -> None:
        """Return to the state before the initialisation."""
        self._call("reset")

    def keep(self) -> None:
        """Keep the state of now, to go back to it."""
        self._call("fmi2GetFMUstate", self._fmu.component, ctypes.byref(self._kept))

    def go_back(self) -> None:
        """Go back to the state that was kept."""
        self._call("setFMUState", self._kept)

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs change linearly in the steps from now on."""
        if inputs:
            if self._change not in self.set_inputs:
                # After the values: an FMU may take each for a new one that does not change.
                self.set_inputs.append(self._change)
            self._slopes = inputs, [1] * len(inputs), slopes
            self._change()

    def _change(self) -> int:
        self._call("setRealInputDerivatives", *self._slopes)
        return int(fmi2OK)

    def state(self) -> bytes:
        """The FMU's whole state between two steps."""
        with self._held("getFMUState") as state:
            serialised: bytes = self._call("serializeFMUState", state)
        return serialised

    def restore(self, state: bytes) -> None:
        """Take on a state."""
        self._complaints.clear()
        self._worst = 0
        with self._held("deserializeFMUState", state) as read:
            self._call("setFMUState", read)
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
                self._call("freeFMUState", state)

    def terminate(self) -> None:
        """Let the FMU finish what it has begun."""
        if not self._library.corrupted:
            self._call("terminate")

    def free(self) -> None:
        """Free the instance; its library stays loaded."""
        if self._library.corrupted:
            # The memory that it was given by us must stay where it is, too.
            return
        if self._kept:
            with suppress(FMICallException):
                self._fmu.freeFMUState(self._kept)
        self._fmu.free()

    def hear(self, status: int, message: str) -> None:
        """Take a message of the FMU; the latest explains a failure, a refusal before a warning."""
        text = f"{self.name}: {'; '.join(message.splitlines())}"
        if status >= min(self._worst, fmi2Discard):
            if self._worst < min(status, fmi2Discard):
                self._complaints.clear()
            self._complaints.append(text)
            self._worst = status
        self._listener.take(status, text)

    def _arrays(self, ports: Iterable[str]) -> list[list[str]]:
        """The names of some variables, each with those of all others of its array."""
        arrays = self._component.arrays
        names = dict.fromkeys(self._variables[port].array for port in ports)
        return [[v.name for v in arrays[name]] if name in arrays else [name] for name in names]

    def _references(self, arrays: Sequence[Sequence[str]]) -> list[int]:
        return [self._variables[ports[0]].reference for ports in arrays]

    def _whole(
        self, values: Mapping[str, Value], others: Callable[[list[str]], Mapping[str, Value]]
    ) -> dict[str, Value]:
        """Values with those of all other elements of their arrays, which are set as a whole."""
        ports = [port for array in self._arrays(values) for port in array]
        return {**others([port for port in ports if port not in values]), **values}

    def _starts(self, ports: Iterable[str]) -> dict[str, Value]:
        """The start values of some variables."""
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
        """Values of a variable, or of all elements of an array."""
        variable = self._variables[ports[0]]
        values = self._call("get", variable.type, [variable.reference], len(ports))
        if variable.type == "String":
            values = map(decode_text, values)
        elif variable.type == "Boolean":
            values = map(bool, values)
        return dict(zip(ports, values, strict=True))

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """One of fmpy's methods, which are slow and convenient."""
        try:
            return getattr(self._fmu, method)(*arguments, **named)
        except FMICallException as error:
            raise self._failed(error) from error

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """Make the exception for a call that has ended with a status."""
        restore_mode()
        # First of all: what an FMU is asked now may make it complain of the question.
        failure = self._failed(FMICallException(function=function, status=status))
        # PythonFMU says that it wants to terminate of each step that it refuses.
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
