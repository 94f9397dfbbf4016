"""Values in the types of FMI's variables: from text, to text, and as numbers of a row."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from math import isclose, isfinite
from typing import TypeAlias

from fmpy.model_description import ModelVariable

from orchestrator.machine.errors import InputError, shortened

#: A value in the type of its variable.
Value: TypeAlias = float | int | bool | str

#: What FMI's Integers can hold.
INTEGERS = -(2**31), 2**31 - 1

#: What FMI 2.0 calls the types of FMI 3.0 that have a name there.
FMI2_NAMES = {"Float64": "Real", "Int32": "Integer"}

#: An FMU may keep a value in another unit, and round it by such a share.
_ROUNDING = 1e-9

#: Truth values, as XML writes them.
BOOLEANS = {"true": True, "1": True, "false": False, "0": False}

#: Types in words.
_IN_WORDS = {
    "Real": "a real number",
    "Boolean": "a Boolean (true or false)",
    "String": "a text in UTF-8",
}


def typed(name: str, variable: ModelVariable, value: object) -> Value:
    """A value, or its text from a command line or file, in the variable's type.

    Args:
        name: of the variable in the system, for the message.
        variable: whose type and range count.
        value: a number, a truth value or a text.

    Raises:
        InputError: it is not of that type, not finite, or outside the range of the variable.

    """
    shown = ""
    try:
        text = str(value).strip()
        shown = f" = {shortened(text)}"
        if type_of(variable) == "Boolean":
            return BOOLEANS[text.lower()]
        if type_of(variable) == "String":
            return _transferable(text)
        if type_of(variable) == "Enumeration":
            text = items_of(variable).get(text, text)
        number = real(text) if type_of(variable) == "Real" else integer(text)
    except (KeyError, ValueError):
        # Python itself refuses to write and to read integers of very many digits.
        items = ", ".join(items_of(variable))
        words = f"one of {items}" if items else _IN_WORDS.get(type_of(variable), "an integer")
        raise InputError(f"{name}{shown}: not {words}") from None
    if isinstance(number, float) and not isfinite(number):
        raise InputError(f"{name}{shown}: must be finite")
    lower, upper = _range(variable)
    if lower is not None and number < lower:
        raise InputError(f"{name}{shown}: must be at least {lower:g}")
    if upper is not None and number > upper:
        raise InputError(f"{name}{shown}: must be at most {upper:.16g}")
    return number


def real(text: str) -> float:
    """A number as every program reads it: only Python takes 1_000, and digits of any script."""
    return float(_plain(text))


def integer(text: str) -> int:
    """A whole number as every program reads it."""
    return int(_plain(text))


def finite(text: str, where: str) -> float:
    """A number that can be computed with, from a file.

    Args:
        text: of the number.
        where: it stands, for the message.

    Raises:
        ValueError: it is not one.

    """
    try:
        number = real(text)
    except ValueError:
        raise ValueError(f"{where} {text[:40]!r} is not a number") from None
    if not isfinite(number):
        raise ValueError(f"{where} {text[:40]!r} is not finite")
    return number


def is_finite(value: object) -> bool:
    """Whether it is a number that can be computed with: TOML has nan, inf, and endless integers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _plain(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a plain number")
    return text


def _transferable(text: str) -> str:
    """A text that FMI can carry: in UTF-8, and ended by the first zero."""
    text.encode()
    if "\0" in text:
        raise ValueError("a text ends at a zero")
    return text


def _range(variable: ModelVariable) -> tuple[float | None, float | None]:
    lower, upper = (None if end is None else real(end) for end in (variable.min, variable.max))
    if type_of(variable) == "Real":
        return lower, upper
    least, most = INTEGERS
    # What a description says beyond them no FMU can be given.
    lower, upper = least if lower is None else lower, most if upper is None else upper
    return max(least, lower), min(most, upper)


def type_of(variable: ModelVariable) -> str:
    """The type of a variable, as FMI 2.0 calls it."""
    return FMI2_NAMES.get(variable.type, str(variable.type))


def items_of(variable: ModelVariable) -> dict[str, str]:
    """The values of an Enumeration by their names, as its description writes them."""
    declared = variable.declaredType
    return {} if declared is None else {item.name: item.value for item in declared.items}


def literal(value: Value) -> str:
    """A value as XML writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def same(wanted: Value, held: Value) -> bool:
    """Whether a value is the one that was set, apart from rounding."""
    if isinstance(wanted, float) and isinstance(held, float):
        return isclose(wanted, held, rel_tol=_ROUNDING)
    return wanted == held


def is_of(variable: ModelVariable, value: object) -> bool:
    """Whether a value is one that the variable can have."""
    fmi_type = type_of(variable)
    if fmi_type in ("Integer", "Enumeration"):
        return type(value) is int and is_integer(value)
    if isinstance(value, str):
        # Half of a UTF-16 pair is not text.
        return fmi_type == "String" and value.encode(errors="ignore").decode() == value
    return type(value) is {"Real": float, "Boolean": bool}.get(fmi_type)


def is_integer(number: float) -> bool:
    """Whether a number is one of FMI's Integers."""
    least, most = INTEGERS
    return least <= number <= most and number == int(number)


def unit_of(variable: ModelVariable) -> str | None:
    """The unit of a variable, its own or its type's."""
    declared = variable.declaredType
    unit: str | None = variable.unit or (declared.unit if declared is not None else None)
    return unit


class StringTable:
    """Texts by their numbers, which they keep: the first is empty, and the next one takes the next.

    What FMUs say is not forgotten, so that a run in which one has a new text in every step takes
    memory for all of them.
    """

    def __init__(self) -> None:
        """Begin with the empty text."""
        self.restore([""])

    def __len__(self) -> int:
        """How many there are."""
        return len(self._texts)

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

    def since(self, n: int) -> list[str]:
        """All texts but the first so many."""
        return self._texts[n:]

    def state(self) -> list[str]:
        """All of them, as JSON has them."""
        return list(self._texts)

    def restore(self, state: Iterable[str]) -> None:
        """Take on the texts of another process, with their numbers."""
        self._texts = list(state)
        self._numbers = {text: number for number, text in enumerate(self._texts)}
