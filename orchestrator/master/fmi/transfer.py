"""The FMI calls that move values between an FMU and its row, also for the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, POINTER, Structure, addressof, c_size_t, c_void_p, cast
from functools import partial
from typing import Any

import numpy as np
from fmpy.fmi2 import (
    fmi2Boolean,
    fmi2Component,
    fmi2Error,
    fmi2Integer,
    fmi2Real,
    fmi2Status,
    fmi2String,
    fmi2ValueReference,
)

from orchestrator.system.values import StringTable

#: Kinds of values that can be connected and recorded, with FMI's functions for them and the types
#: that they are moved in: for a String moves the number of its text.
FMI_TYPES = {
    "Real": ("Real", fmi2Real),
    "Integer": ("Integer", fmi2Integer),
    "Enumeration": ("Integer", fmi2Integer),
    "Boolean": ("Boolean", fmi2Boolean),
    "String": ("String", fmi2Integer),
}

#: Types of the arguments of FMI's doStep, and a function of Python in its place for the compiled
#: loop.
DO_STEP_TYPES = (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean)
DoStepCallback = CFUNCTYPE(fmi2Status, *DO_STEP_TYPES)

#: The same in place of FMI's functions that move Integers.
_MoveCallback = CFUNCTYPE(fmi2Status, fmi2Component, c_void_p, c_size_t, c_void_p)


class CMove(Structure):
    """Values of one type, neighbours in the row, and FMI's function for them: see stepper.c."""

    _fields_ = (
        ("call", c_void_p),
        ("references", c_void_p),
        ("n", c_size_t),
        ("values", c_void_p),
        ("integers", c_void_p),
    )


class CMember(Structure):
    """A component: how it is stepped, and its inputs and outputs moved: see stepper.c."""

    _fields_ = (
        ("component", c_void_p),
        ("do_step", c_void_p),
        ("inputs", POINTER(CMove)),
        ("outputs", POINTER(CMove)),
        ("n_inputs", c_size_t),
        ("n_outputs", c_size_t),
    )


class PortBlock:
    """Values of one type, side by side in the row of all values, moved by one FMI call.

    Attributes:
        function: the one of FMI that moves them, without fmi2.

    """

    def __init__(
        self,
        causality: str,
        fmi_type: str,
        references: Sequence[int],
        row: np.ndarray,
        strings: StringTable,
    ) -> None:
        """Prepare the arrays that every call uses.

        Args:
            causality: `input` or `output`.
            fmi_type: one of :data:`FMI_TYPES`.
            references: value references.
            row: the part of the row of all values where the values are, a view.
            strings: the texts whose numbers stand in the row.

        """
        self._fmi_type, c_type = FMI_TYPES[fmi_type]
        self._strings = strings
        self.function = f"{'Set' if causality == 'input' else 'Get'}{self._fmi_type}"
        self._row = row
        n = len(references)
        self._n = c_size_t(n)
        self._references = (fmi2ValueReference * n)(*references)
        if self._fmi_type == "Real":
            self._values = (c_type * n).from_buffer(row)
        else:
            self._values = (c_type * n)()
            self._integers = np.frombuffer(self._values, dtype=np.intc)

    def setter(self, function: Callable[..., int]) -> Callable[[], int]:
        """A call that hands the values to an FMU, by its function of this block."""
        call = self._call(function)
        if self._fmi_type == "Real":
            return call

        row, integers = self._row, self._integers

        def set_converted() -> int:
            integers[:] = row
            # Lists are compared in a third of the time. The row says which value it is.
            return call() if integers.tolist() == row.tolist() else int(fmi2Error)

        return set_converted

    def getter(self, function: Callable[..., int]) -> Callable[[], int]:
        """A call that takes the values from an FMU, by its function of this block."""
        call = self._call(function)
        if self._fmi_type == "Real":
            return call

        row, values = self._row, self._values

        def get_one() -> int:
            status = call()
            row[0] = values[0]
            return status

        def get_converted() -> int:
            status = call()
            row[:] = self._integers
            return status

        # Most components have one such output, and an array of one costs twice as much.
        return get_one if len(row) == 1 else get_converted

    def move(self, address: int | None) -> CMove:
        """The same for the compiled loop, by the address of the FMU's function of this block."""
        integers = None if self._fmi_type == "Real" else addressof(self._values)
        if self._fmi_type == "String":
            address = address_of(self._called_back)
        references, row = addressof(self._references), self._row.ctypes.data
        return CMove(address, references, self._n, row, integers)

    def _call(self, function: Callable[..., int]) -> Callable[[], int]:
        if self._fmi_type == "String":
            move = self._set_texts if self.function.startswith("Set") else self._get_texts
            call = partial(move, function)
            # The compiled loop looks for numbers and has an FMU's function move them.
            self._called_back = _MoveCallback(lambda *_: call())
            return call
        return partial(function, self._references, self._n, self._values)

    def _set_texts(self, function: Callable[..., int]) -> int:
        texts = [self._strings.text(number).encode() for number in self._values]
        return function(self._references, self._n, (fmi2String * len(texts))(*texts))

    def _get_texts(self, function: Callable[..., int]) -> int:
        texts = (fmi2String * len(self._values))()
        status = function(self._references, self._n, texts)
        for i, text in enumerate(texts):
            self._values[i] = self._strings.number(decode_text(text))
        return status


def address_of(function: Any) -> int | None:
    """The address of a function of ctypes, for the compiled loop."""
    return cast(function, c_void_p).value


def are_integers(values: np.ndarray) -> bool:
    """Whether FMI's Integers can hold all of some values."""
    return bool((values.astype(np.intc) == values).all())


def decode_text(string: bytes | None) -> str:
    """Decode a text that an FMU has given; some give none where an empty one is meant."""
    return (string or b"").decode(errors="replace")
