"""The calls of a component in a run, and the moves of values between an FMU and its row."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from ctypes import (
    CFUNCTYPE,
    POINTER,
    Structure,
    addressof,
    byref,
    c_double,
    c_size_t,
    c_void_p,
    cast,
)
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from fmpy.fmi2 import (
    fmi2Boolean,
    fmi2Component,
    fmi2Discard,
    fmi2Error,
    fmi2OK,
    fmi2Real,
    fmi2Status,
    fmi2String,
    fmi2ValueReference,
    fmi2Warning,
)

from orchestrator.cosim.variables import TYPES, StringTable, Value, are_of

#: Argument types of doStep in FMI 2.0, and a Python function that replaces it in the compiled loop.
DO_STEP_TYPES = (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean)
DoStepCallback = CFUNCTYPE(fmi2Status, *DO_STEP_TYPES)

#: A Python function that replaces one that moves values.
_MoveCallback = CFUNCTYPE(fmi2Status)

#: Numbers of conversions in the compiled loop by types in C: see stepper.c.
_KINDS = {
    c_type: kind
    for kind, c_type in enumerate(
        (
            *(ctypes.c_double, ctypes.c_float, ctypes.c_int8, ctypes.c_uint8),
            *(ctypes.c_int16, ctypes.c_uint16, ctypes.c_int32, ctypes.c_uint32),
            *(ctypes.c_int64, ctypes.c_uint64, fmi2String),
        )
    )
}
_KINDS[ctypes.c_bool] = _KINDS[ctypes.c_uint8]

#: Types whose values may need numbers that stand for them: Python moves these.
_LOOKED_UP = (ctypes.c_int64, ctypes.c_uint64, fmi2String)


class Moved(NamedTuple):
    """The FMI function for values of a type.

    Attributes:
        function: its name, without the prefix and Get or Set.
        c_type: of the values.
        is_counted: True if the function takes the number of values.

    """

    function: str
    c_type: Any
    is_counted: bool = False


class CMove(Structure):
    """Values of one type, neighbours in the row, and their FMI function: see stepper.c."""

    _fields_ = (
        ("call", c_void_p),
        ("python", c_void_p),
        ("references", c_void_p),
        ("n_references", c_size_t),
        ("n", c_size_t),
        ("row", c_void_p),
        ("values", c_void_p),
        ("kind", ctypes.c_int),
        ("is_counted", ctypes.c_int),
    )


class CStepResult(Structure):
    """Results of doStep of FMI 3.0: see stepper.c."""

    _fields_ = (
        ("event", ctypes.c_bool),
        ("terminate", ctypes.c_bool),
        ("early", ctypes.c_bool),
        ("last", ctypes.c_double),
    )


class CMember(Structure):
    """A component with its step, its inputs and its outputs: see stepper.c."""

    _fields_ = (
        ("component", c_void_p),
        ("do_step", c_void_p),
        ("result", POINTER(CStepResult)),
        ("inputs", POINTER(CMove)),
        ("outputs", POINTER(CMove)),
        ("n_inputs", c_size_t),
        ("n_outputs", c_size_t),
    )


class PortBlock:
    """Values of one type, side by side in the row, moved by one FMI call.

    Attributes:
        function: name of the FMI function that moves them, without its prefix.

    """

    def __init__(
        self,
        causality: str,
        fmi_type: str,
        moved: Moved,
        references: Sequence[int],
        row: np.ndarray,
        strings: StringTable,
    ) -> None:
        """Prepare the arrays that every call uses.

        Args:
            causality: `input` or `output`.
            fmi_type: one of :data:`.variables.TYPES`.
            moved: FMI function for the values.
            references: value references, one for each array.
            row: view of the values in the row.
            strings: texts and integers that numbers in the row stand for.

        """
        self._is_input = causality == "input"
        self._fmi_type, self._moved, self._strings = fmi_type, moved, strings
        self.function = f"{'Set' if self._is_input else 'Get'}{moved.function}"
        self._row = row
        n, n_references = len(row), len(references)
        self._references = (fmi2ValueReference * n_references)(*references)
        self._called_back: Any = None
        if moved.c_type is fmi2Real:
            self._values = (moved.c_type * n).from_buffer(row)
        else:
            self._values = (moved.c_type * n)()
        if moved.c_type not in _LOOKED_UP:
            # A byte of a Boolean may be neither 0 nor 1.
            dtype = np.uint8 if moved.c_type is ctypes.c_bool else np.dtype(moved.c_type)
            self._numbers = np.frombuffer(self._values, dtype=dtype)
        # Prepared for ctypes: to convert them in every call takes a third of its time.
        count = c_size_t.from_param
        self._arguments = [byref(self._references), count(n_references), byref(self._values)]
        if moved.is_counted:
            self._arguments.append(count(n))

    def mover(self, function: Callable[..., int]) -> Callable[[], int]:
        """Return a call of an FMU's function that moves the values to or from it."""
        call = partial(function, *self._arguments)
        if self._moved.c_type is fmi2Real:
            return call
        if self._moved.c_type in _LOOKED_UP:
            move = partial(self._set_each if self._is_input else self._get_each, call)
            self._called_back = _MoveCallback(move)
            return move
        return self._setter(call) if self._is_input else self._getter(call)

    def _setter(self, call: Callable[[], int]) -> Callable[[], int]:
        row, numbers = self._row, self._numbers

        def set_converted() -> int:
            numbers[:] = row
            # Comparing lists takes a third of the time. The check of the row names the value.
            return call() if numbers.tolist() == row.tolist() else int(fmi2Error)

        def set_rounded() -> int:
            if not are_of(self._fmi_type, row).all():
                return int(fmi2Error)
            numbers[:] = row
            return call()

        return set_rounded if self._moved.c_type is ctypes.c_float else set_converted

    def _getter(self, call: Callable[[], int]) -> Callable[[], int]:
        row, numbers, values = self._row, self._numbers, self._values

        def get_one() -> int:
            status = call()
            row[0] = values[0]
            return status

        def get_converted() -> int:
            status = call()
            row[:] = numbers
            return status

        # Most components have one such output; an array of one value takes twice as long.
        return get_one if len(row) == 1 else get_converted

    def _set_each(self, call: Callable[[], int]) -> int:
        if not are_of(self._fmi_type, self._row).all():
            return int(fmi2Error)
        for i, number in enumerate(self._row.tolist()):
            self._values[i] = self._value(number)
        return call()

    def _value(self, number: float) -> bytes | int:
        if self._moved.c_type is fmi2String:
            return self._strings.text(number).encode()
        return self._strings.integer(number)

    def _get_each(self, call: Callable[[], int]) -> int:
        # A value that an FMU does not set must not be the previous one.
        ctypes.memset(self._values, 0, ctypes.sizeof(self._values))
        status = call()
        if status in (fmi2OK, fmi2Warning):
            is_text = self._moved.c_type is fmi2String
            for i, value in enumerate(self._values):
                self._row[i] = self._strings.stand_in(decode_text(value) if is_text else value)
                if not TYPES[self._fmi_type].stands and self._row[i] != value:
                    return int(fmi2Error)
        return status

    def move(self, address: int | None) -> CMove:
        """Return the same for the compiled loop, given the address of the FMU's function."""
        return CMove(
            address,
            address_of(self._called_back),
            addressof(self._references),
            len(self._references),
            len(self._row),
            self._row.ctypes.data,
            addressof(self._values),
            _KINDS[self._moved.c_type],
            self._moved.is_counted,
        )


def address_of(function: Any) -> int | None:
    """Return the address of a function of ctypes, for the compiled loop."""
    return cast(function, c_void_p).value


def decode_text(string: bytes | None) -> str:
    """Decode a text of an FMU; some return NULL for an empty one."""
    return (string or b"").decode(errors="replace")


#: Calls of a component in every step, in their order.
CALLS = SET_INPUTS, DO_STEP, GET_OUTPUTS = "setting inputs", "doStep", "getting outputs"

#: Largest number of messages that are kept, since an FMU may log in every step.
MOST_MESSAGES = 100


class ComponentFailed(Exception):
    """A component has failed; the text names it and gives the reason.

    Attributes:
        fatal: True if it is lost: FMI's status fatal, or its process has ended or hangs.

    """

    def __init__(self, text: str, fatal: bool = False) -> None:
        """Set the text."""
        super().__init__(text)
        self.fatal = fatal


class Ended(Exception):
    """A component ends the run without a failure; the text gives the reason."""


class Part(NamedTuple):
    """Ports of one component that have the same causality and type.

    Attributes:
        causality: `input` or `output`.
        fmi_type: one of :data:`.variables.TYPES`.
        references: value references, one for each array.
        place: of the values among the component's.

    """

    causality: str
    fmi_type: str
    references: list[int]
    place: slice


class Instance(Protocol):
    """An instantiated FMU whose inputs and outputs are in a row of doubles.

    A step calls `set_inputs`, then `do_step` with time and step size, then `get_outputs`, the last
    once all components of a stage have been stepped. Each call returns FMI's status; `failed` is
    for a status worse than a warning.

    Attributes:
        name: of the component.
        is_here: True if its FMU is in this process, so that its functions have addresses.
        gives_derivatives: True if its FMU provides derivatives of outputs by inputs.

    """

    name: str
    is_here: bool
    gives_derivatives: bool
    set_inputs: list[Callable[[], int]]
    get_outputs: list[Callable[[], int]]

    @property
    def do_exchange(self) -> Callable[[c_double, c_double, int], int] | None:
        """Replacement of doStep where values only pass; None: no call is needed."""

    @property
    def do_step(self) -> Callable[[c_double, c_double, int], int]:
        """doStep of FMI, to be called with time, step size and one."""

    def pointers(self) -> CMember:
        """Return the same calls as pointers, for an FMU in this process."""

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """Return the exception for a call that has ended with a status.

        Args:
            status: worse than a warning.
            function: one of :data:`CALLS`.

        """

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Tie the instance to its values in the row.

        Args:
            values: view of the row from the component's first value on, inputs first.
            parts: of the values.
            strings: texts and integers that numbers in the row stand for.

        """

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode.

        Values that may be set in that mode are set there again: some FMUs replace them with their
        own when they enter it.
        """

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""

    def derivatives(self, outputs: Sequence[str], known: str) -> Sequence[float]:
        """Return the derivatives of some outputs by one input at the same time.

        Raises:
            ComponentFailed: the FMU does not provide them.

        """

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Return values of some variables, as the FMU holds them."""

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""

    def reset(self) -> None:
        """Return to the state before the initialisation, which can then be repeated."""

    def keep(self) -> None:
        """Keep the present state, to go back to it."""

    def go_back(self) -> None:
        """Go back to the state that was kept; the row is left as it is."""

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs, by value reference, change linearly in all further steps."""

    def state(self) -> bytes:
        """Return the FMU's whole state between two steps, from which another instance can continue.

        Raises:
            ComponentFailed: the FMU does not provide it; see
                :attr:`.component.Component.gives_state`.

        """

    def restore(self, state: bytes) -> None:
        """Restore a state; the row is left as it is."""

    def terminate(self) -> None:
        """Terminate the FMU."""


class Listener(Protocol):
    """Takes messages."""

    def take(self, status: int, text: str) -> None:
        """Take a message, which names its component, with its FMI status."""


class Log:
    """Messages of the FMUs with status warning or worse, and remarks on the FMUs.

    Attributes:
        refusals: the first messages with status discard: a value was not taken, though the call
            went well.

    """

    def __init__(self) -> None:
        """Start empty."""
        self._remarks: list[str] = []
        self._said: list[str] = []
        self._n = 0
        self.refusals: list[str] = []

    def remark(self, text: str) -> None:
        """Add a remark on an FMU, which is kept even if its messages are too many."""
        self._remarks.append(text)

    def take(self, status: int, text: str) -> None:
        """Take a message."""
        if status >= fmi2Warning:
            self._n += 1
            self._said += [text] * (len(self._said) < MOST_MESSAGES)
        if status == fmi2Discard:
            self.refusals += [text] * (len(self.refusals) < MOST_MESSAGES)

    @property
    def messages(self) -> tuple[str, ...]:
        """All remarks, the first messages, and the number of further messages."""
        more = self._n - len(self._said)
        return (*self._remarks, *self._said, *([f"and {more} more messages"] * (more > 0)))

    def state(self) -> dict[str, Any]:
        """Return the content as JSON."""
        return {
            "remarks": self._remarks,
            "said": self._said,
            "n": self._n,
            "refusals": self.refusals,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the content."""
        self._remarks, self.refusals = state["remarks"], state["refusals"]
        self._said, self._n = state["said"], state["n"]
