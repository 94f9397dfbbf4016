"""The calls of a component in a run, and how values move between an FMU and its row."""

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

#: Types of the arguments of doStep in FMI 2.0, and a function of Python in its place for the
#: compiled loop.
DO_STEP_TYPES = (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean)
DoStepCallback = CFUNCTYPE(fmi2Status, *DO_STEP_TYPES)

#: A function of Python in place of one that moves values.
_MoveCallback = CFUNCTYPE(fmi2Status)

#: Numbers of conversions in the compiled loop, by types in C: see stepper.c.
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

#: Types whose values are not all numbers of the row: Python moves these.
_LOOKED_UP = (ctypes.c_int64, ctypes.c_uint64, fmi2String)


class Moved(NamedTuple):
    """The way in which values of a type are moved.

    Attributes:
        function: the one of FMI, without its prefix and Get or Set.
        c_type: of the values.
        is_counted: whether the function is told how many values there are.

    """

    function: str
    c_type: Any
    is_counted: bool = False


class CMove(Structure):
    """Values of one type, neighbours in the row, and FMI's function for them: see stepper.c."""

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
    """A component: how it is stepped, and its inputs and outputs moved: see stepper.c."""

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
    """Values of one type, side by side in the row of all values, moved by one FMI call.

    Attributes:
        function: the one of FMI that moves them, without its prefix.

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
            moved: how its values are moved.
            references: value references, one for each array.
            row: the part of the row of all values where the values are, a view.
            strings: know what numbers in the row stand for.

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
            of = np.uint8 if moved.c_type is ctypes.c_bool else np.dtype(moved.c_type)
            self._numbers = np.frombuffer(self._values, dtype=of)
        # As ctypes passes them on: to convert them in every call costs a third of it.
        count = c_size_t.from_param
        self._arguments = [byref(self._references), count(n_references), byref(self._values)]
        if moved.is_counted:
            self._arguments.append(count(n))

    def mover(self, function: Callable[..., int]) -> Callable[[], int]:
        """A call that hands the values to an FMU or takes them, by its function of this block."""
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
            # Lists are compared in a third of the time. The row says which value it is.
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

        # Most components have one such output, and an array of one costs twice as much.
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
        # A value that an FMU leaves as it is must not be one that it gave before.
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
        """The same for the compiled loop, by the address of the FMU's function of this block."""
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
    """The address of a function of ctypes, for the compiled loop."""
    return cast(function, c_void_p).value


def decode_text(string: bytes | None) -> str:
    """Decode a text that an FMU has given; some give none where an empty one is meant."""
    return (string or b"").decode(errors="replace")


#: Calls of a component in every step, in their order.
CALLS = SET_INPUTS, DO_STEP, GET_OUTPUTS = "setting inputs", "doStep", "getting outputs"

#: Messages that are kept: an FMU may have something to say in every step.
MOST_MESSAGES = 100


class ComponentFailed(Exception):
    """A component failed to do what it was asked to; the text names it and says why.

    Attributes:
        fatal: whether it is lost: FMI's status fatal, or its process has ended or hangs.

    """

    def __init__(self, text: str, fatal: bool = False) -> None:
        """Say what happened."""
        super().__init__(text)
        self.fatal = fatal


class Ended(Exception):
    """The run ends with the last step that was made, and well; the text says why."""


class Part(NamedTuple):
    """Ports of one component that have the same causality and type.

    Attributes:
        causality: `input` or `output`.
        fmi_type: one of :data:`.variables.TYPES`.
        references: value references, one for each array.
        place: of their values among the component's.

    """

    causality: str
    fmi_type: str
    references: list[int]
    place: slice


class Instance(Protocol):
    """An instantiated FMU whose inputs and outputs live in a row of floats.

    In every step the calls of `set_inputs`, then `do_step` with time and step size, then the calls
    of `get_outputs` are made, the last once all components of a stage have been stepped.
    Each returns FMI's status: `failed` is for one that is worse than a warning.

    Attributes:
        name: of the component.
        is_here: whether its FMU is in this process, so that there are pointers to its functions.
        gives_derivatives: whether its FMU can say how outputs change with inputs.

    """

    name: str
    is_here: bool
    gives_derivatives: bool
    set_inputs: list[Callable[[], int]]
    get_outputs: list[Callable[[], int]]

    @property
    def do_exchange(self) -> Callable[[c_double, c_double, int], int] | None:
        """The call in place of doStep where values only pass; None: there is none."""

    @property
    def do_step(self) -> Callable[[c_double, c_double, int], int]:
        """FMI's doStep, to be called with time, step size and one."""

    def pointers(self) -> CMember:
        """The same calls as pointers, for an FMU in this process."""

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """Make the exception for a call that has ended with a status.

        Args:
            status: worse than a warning.
            function: one of :data:`CALLS`.

        """

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Say where its values are: a view of the row, with the inputs first, and its parts.

        Args:
            values: of the row, from its first on.
            parts: of them.
            strings: what numbers there stand for.

        """

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode.

        What may be set in that mode is set there once more: some FMUs take on their own values
        when they enter it.
        """

    def exit_initialization(self) -> None:
        """Get ready for the first step."""

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""

    def derivatives(self, outputs: Sequence[str], of: str) -> Sequence[float]:
        """Derivatives of some outputs with one input at the same time.

        Raises:
            ComponentFailed: the FMU does not say it.

        """

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""

    def reset(self) -> None:
        """Return to the state before the initialisation, which can then be entered again."""

    def keep(self) -> None:
        """Keep the state of now, to go back to it."""

    def go_back(self) -> None:
        """Go back to the state that was kept; what the row holds is left as it is."""

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs, by their value references, change linearly in the steps from now on."""

    def state(self) -> bytes:
        """The FMU's whole state between two steps, from which another instance can go on.

        Raises:
            ComponentFailed: it cannot be had; see :attr:`.component.Component.gives_state`.

        """

    def restore(self, state: bytes) -> None:
        """Take on a state; what the row holds of this instance is left as it is."""

    def terminate(self) -> None:
        """Let the FMU finish what it has begun."""


class Listener(Protocol):
    """Something that takes messages."""

    def take(self, status: int, text: str) -> None:
        """Take a message with the status that it was given by FMI, and its component's name."""


class Log:
    """Messages of the FMUs with status warning or worse, and remarks on the FMUs.

    Attributes:
        refusals: the first of it with status discard: a value was not taken, though the call went
            well.

    """

    def __init__(self) -> None:
        """Start empty."""
        self._remarks: list[str] = []
        self._said: list[str] = []
        self._n = 0
        self.refusals: list[str] = []

    def remark(self, text: str) -> None:
        """Note a remark on an FMU: no flood of its messages hides that."""
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
        """All remarks, the first messages, and the number of the others."""
        more = self._n - len(self._said)
        return (*self._remarks, *self._said, *([f"and {more} more messages"] * (more > 0)))

    def state(self) -> dict[str, Any]:
        """The content, as JSON has it."""
        return {
            "remarks": self._remarks,
            "said": self._said,
            "n": self._n,
            "refusals": self.refusals,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take on what another one has taken."""
        self._remarks, self.refusals = state["remarks"], state["refusals"]
        self._said, self._n = state["said"], state["n"]
