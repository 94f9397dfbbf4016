"""Values in the types of FMI's variables: from text, to text, and as numbers of a row."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from math import copysign, isclose
from typing import Any, NamedTuple, TypeAlias

import numpy as np

#: A value in the type of its variable.
Value: TypeAlias = float | int | bool | str


class Type(NamedTuple):
    """A type of FMI's variables.

    Attributes:
        family: what FMI 2.0 calls this type, or the one that is its like.
        c_type: of its values; None: they are texts.
        least, most: the range of its numbers.

    """

    family: str
    c_type: Any
    least: float = 0
    most: float = 0

    @property
    def is_wide(self) -> bool:
        """Whether it has integers that a double cannot hold."""
        return self.family == "Integer" and self.most > EXACT

    @property
    def stands(self) -> bool:
        """Whether numbers of a row may stand for its values, and are not the values themselves."""
        return self.c_type is None or self.is_wide


def _real(c_type: Any) -> Type:
    most = float(np.finfo(np.dtype(c_type)).max)
    return Type("Real", c_type, -most, most)


def _integer(c_type: Any, family: str = "Integer") -> Type:
    info = np.iinfo(np.dtype(c_type))
    return Type(family, c_type, int(info.min), int(info.max))


#: Types that can be connected, set and recorded, in the order of their columns.
TYPES = {
    "Real": _real(ctypes.c_double),
    "Float64": _real(ctypes.c_double),
    "Float32": _real(ctypes.c_float),
    "Integer": _integer(ctypes.c_int32),
    "Int32": _integer(ctypes.c_int32),
    "Int8": _integer(ctypes.c_int8),
    "UInt8": _integer(ctypes.c_uint8),
    "Int16": _integer(ctypes.c_int16),
    "UInt16": _integer(ctypes.c_uint16),
    "UInt32": _integer(ctypes.c_uint32),
    "Int64": _integer(ctypes.c_int64),
    "UInt64": _integer(ctypes.c_uint64),
    "Enumeration": _integer(ctypes.c_int32, "Enumeration"),
    "Boolean": Type("Boolean", ctypes.c_bool, 0, 1),
    "String": Type("String", None),
}

#: Up to here every integer is a double.
EXACT = 2**53

#: Numbers from the first on, so far apart, stand for integers that a double cannot hold: they
#: are doubles themselves, and none of FMI's integers is so large.
_BEYOND, _APART = 2.0**65, 2.0**13

#: An FMU may keep a value in another unit, and round it by such a share.
_ROUNDING = 1e-9


def family_of(fmi_type: str) -> str:
    """What FMI 2.0 calls a type, or the one that is its like."""
    return TYPES[fmi_type].family if fmi_type in TYPES else fmi_type


def same(wanted: Value, held: Value) -> bool:
    """Whether a value is the one that was set, apart from rounding."""
    if isinstance(wanted, float) and isinstance(held, float):
        return isclose(wanted, held, rel_tol=_ROUNDING)
    return wanted == held


def are_of(fmi_type: str, numbers: np.ndarray) -> np.ndarray:
    """Which numbers of a row a variable of a type can hold; doubles and texts take all."""
    of = TYPES[fmi_type]
    if of.family == "Boolean":
        # FMI 2.0 has integers for them.
        of = TYPES["Integer"]
    if of.c_type in (None, ctypes.c_double):
        return np.ones(np.shape(numbers), dtype=bool)
    # As a double, the end of 64 bits is the first number beyond it.
    fit = of.least <= numbers
    fit &= numbers < float(of.most) if of.is_wide else numbers <= of.most
    if of.family != "Real":
        fit &= numbers == np.trunc(numbers)
    if of.is_wide:
        fit |= np.abs(numbers) >= _BEYOND
    return np.asarray(fit)


def as_float32(numbers: np.ndarray) -> np.ndarray:
    """Numbers as a Float32 holds them; those that are too large for one stay as they are."""
    fit = np.abs(numbers) <= TYPES["Float32"].most
    return np.where(fit, np.where(fit, numbers, 0.0).astype(np.float32), numbers)


class StringTable:
    """Texts by their numbers, which they keep: the first is empty, and the next one takes the next.

    What FMUs say is not forgotten, so that a run in which one has a new text in every step takes
    memory for all of them. Integers that a double cannot hold are kept like texts.
    """

    def __init__(self) -> None:
        """Begin with the empty text."""
        self.restore([""])

    def number(self, text: str) -> int:
        """The number of a text, which it gets if it has none."""
        found = self._numbers.setdefault(text, len(self._texts))
        if found == len(self._texts):
            self._texts.append(text)
        return found

    def text(self, number: float) -> str:
        """The text of a number.

        Raises:
            ValueError: it has none.

        """
        if not 0 <= number < len(self._texts):
            raise ValueError(f"no text has the number {number:g}")
        return self._texts[int(number)]

    def stand_in(self, value: Value) -> float:
        """The number for a value in a row: itself, unless it is a text or no double can hold it."""
        if isinstance(value, str):
            return self.number(value)
        number = float(value)
        if isinstance(value, int) and number != value:
            return copysign(_BEYOND + _APART * self.number(str(value)), number)
        return number

    def integer(self, number: float) -> int:
        """The integer that a number of a row is, or stands for.

        Raises:
            ValueError: it stands for none.

        """
        size = abs(number)
        return int(number) if size < _BEYOND else int(self.text((size - _BEYOND) / _APART))

    def state(self) -> list[str]:
        """All of them, as JSON has them."""
        return list(self._texts)

    def restore(self, state: Iterable[str]) -> None:
        """Take on the texts of another process, with their numbers."""
        self._texts = list(state)
        self._numbers = {text: number for number, text in enumerate(self._texts)}


class Standing(NamedTuple):
    """What the numbers of a column of the row stand for.

    Attributes:
        fmi_type: of the values.
        strings: that know them.

    """

    fmi_type: str
    strings: StringTable

    @property
    def c_type(self) -> Any:
        """Of the values; None: they are texts."""
        return TYPES[self.fmi_type].c_type

    def value(self, number: float) -> str | int:
        """The text or the integer that a number stands for.

        Raises:
            ValueError: it stands for none.

        """
        return self.strings.text(number) if self.c_type is None else self.strings.integer(number)

    def values(self, numbers: np.ndarray) -> np.ndarray:
        """A column in its type, from its numbers in the row.

        Raises:
            ValueError: a number stands for no value.

        """
        if self.c_type is not None and (np.abs(numbers) < _BEYOND).all():
            return numbers.astype(self.c_type)
        return np.array(list(map(self.value, numbers.tolist())), dtype=self.c_type or str)

    def number(self, value: str | float) -> float:
        """The number that stands for a value, or for the text of one."""
        if self.c_type is None:
            return self.strings.number(str(value))
        return self.strings.stand_in(int(value))
