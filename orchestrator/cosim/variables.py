"""Variables of an FMU, with their types and values; arrays as their elements."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import product
from math import copysign, isclose, isfinite, prod
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias
from xml.etree import ElementTree

import numpy as np
from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.machine.errors import InputError, shortened
from orchestrator.machine.texts import (
    BOOLEANS,
    finite,
    integer,
    is_finite,
    real,
    transferable,
    whole,
)

#: A value in the type of its variable.
Value: TypeAlias = float | int | bool | str


class Type(NamedTuple):
    """A type of FMI's variables.

    Attributes:
        family: this type or its equivalent in FMI 2.0.
        c_type: of its values; None: they are texts.
        least, most: range of its numbers.

    """

    family: str
    c_type: Any
    least: float = 0
    most: float = 0

    @property
    def is_wide(self) -> bool:
        """True if it has integers that a double cannot hold."""
        return self.family == "Integer" and self.most > EXACT

    @property
    def stands(self) -> bool:
        """True if numbers of a row may stand for other values."""
        return self.c_type is None or self.is_wide


def _real(c_type: Any) -> Type:
    most = float(np.finfo(np.dtype(c_type)).max)
    return Type("Real", c_type, -most, most)


def _integer(c_type: Any, family: str = "Integer") -> Type:
    info = np.iinfo(np.dtype(c_type))
    return Type(family, c_type, int(info.min), int(info.max))


#: Types that can be connected, set and recorded, in the order in which calls move their values.
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

#: Every integer up to this one is a double.
EXACT = 2**53

#: Numbers that stand for integers that a double cannot hold: the first of them and their distance.
#: They are doubles, and larger than all of FMI's integers.
_BEYOND, _APART = 2.0**65, 2.0**13

#: Relative rounding of an FMU that keeps a value in another unit.
_ROUNDING = 1e-9


def family_of(fmi_type: str) -> str:
    """Return a type or its equivalent in FMI 2.0."""
    return TYPES[fmi_type].family if fmi_type in TYPES else fmi_type


def same(value: Value, held: Value) -> bool:
    """Return True for a value that equals the one that was set, apart from rounding."""
    if isinstance(value, float) and isinstance(held, float):
        return isclose(value, held, rel_tol=_ROUNDING)
    return value == held


def are_of(fmi_type: str, numbers: np.ndarray) -> np.ndarray:
    """Return which numbers of a row fit a type; doubles and texts take all."""
    own = TYPES[fmi_type]
    if own.family == "Boolean":
        # FMI 2.0 uses integers for them.
        own = TYPES["Integer"]
    if own.c_type in (None, ctypes.c_double):
        return np.ones(np.shape(numbers), dtype=bool)
    # As a double, the largest integer of 64 bits is the first number beyond the range.
    fit = own.least <= numbers
    fit &= numbers < float(own.most) if own.is_wide else numbers <= own.most
    if own.family != "Real":
        fit &= numbers == np.trunc(numbers)
    if own.is_wide:
        fit |= np.abs(numbers) >= _BEYOND
    return np.asarray(fit)


def as_float32(numbers: np.ndarray) -> np.ndarray:
    """Round numbers to Float32; those too large for it stay as they are."""
    fit = np.abs(numbers) <= TYPES["Float32"].most
    return np.where(fit, np.where(fit, numbers, 0.0).astype(np.float32), numbers)


class StringTable:
    """Texts and their numbers, which stay the same; the first text is empty.

    Nothing is forgotten: a run in which an FMU has a new text in every step takes memory for all of
    them. Integers that a double cannot hold are kept like texts.
    """

    def __init__(self) -> None:
        """Start with the empty text."""
        self.restore([""])

    def number(self, text: str) -> int:
        """Return the number of a text; a new text gets the next one."""
        number = self._numbers.setdefault(text, len(self._texts))
        if number == len(self._texts):
            self._texts.append(text)
        return number

    def text(self, number: float) -> str:
        """Return the text of a number.

        Raises:
            ValueError: there is none.

        """
        if not 0 <= number < len(self._texts):
            raise ValueError(f"no text has the number {number:g}")
        return self._texts[int(number)]

    def stand_in(self, value: Value) -> float:
        """Return the number for a value in a row: a double is itself, other values get a number."""
        if isinstance(value, str):
            return self.number(value)
        number = float(value)
        if isinstance(value, int) and number != value:
            return copysign(_BEYOND + _APART * self.number(str(value)), number)
        return number

    def integer(self, number: float) -> int:
        """Return the integer that a number of a row is or stands for.

        Raises:
            ValueError: it stands for none.

        """
        size = abs(number)
        return int(number) if size < _BEYOND else int(self.text((size - _BEYOND) / _APART))

    def state(self) -> list[str]:
        """Return all texts as JSON."""
        return list(self._texts)

    def restore(self, state: Iterable[str]) -> None:
        """Take the texts of another process, with their numbers."""
        self._texts = list(state)
        self._numbers = {text: number for number, text in enumerate(self._texts)}


class Standing(NamedTuple):
    """The values that the numbers in a column of the row stand for.

    Attributes:
        fmi_type: of the values.
        strings: texts and integers by their numbers.

    """

    fmi_type: str
    strings: StringTable

    @property
    def c_type(self) -> Any:
        """Type of the values in C; None: they are texts."""
        return TYPES[self.fmi_type].c_type

    def value(self, number: float) -> str | int:
        """Return the text or the integer that a number stands for.

        Raises:
            ValueError: it stands for none.

        """
        return self.strings.text(number) if self.c_type is None else self.strings.integer(number)

    def values(self, numbers: np.ndarray) -> np.ndarray:
        """Return a column in its type, from its numbers in the row.

        Raises:
            ValueError: a number stands for no value.

        """
        if self.c_type is not None and (np.abs(numbers) < _BEYOND).all():
            return numbers.astype(self.c_type)
        return np.array(list(map(self.value, numbers.tolist())), dtype=self.c_type or str)

    def number(self, value: str | float) -> float:
        """Return the number that stands for a value, or for a text of it."""
        if self.c_type is None:
            return self.strings.number(str(value))
        return self.strings.stand_in(int(value))


#: Largest number of elements of an array, each of which is a column.
MOST_ELEMENTS = 1_000_000

#: Separates the start values of an array of texts; no text contains it.
_BETWEEN = "\0"

#: Types in words.
_IN_WORDS = {
    "Real": "a real number",
    "Boolean": "a Boolean (true or false)",
    "String": "a text in UTF-8",
}


class Variable(NamedTuple):
    """A variable of an FMU, or one element of an array.

    Attributes:
        name: for an element, with its indices.
        type: in FMI.
        causality, variability, initial: as FMI defines them.
        reference: its value reference, which the elements of an array share.
        start, min, max, nominal: attributes of the description, as texts.
        unit: of the variable or of its type.
        is_relative: True for a difference, such as one of temperatures.
        shape: of the array of an element; empty: it is a scalar.
        items: values of an Enumeration by name, as the description writes them.
        enumeration: name of that type.
        description: text in the FMU's description.

    """

    name: str
    type: str
    causality: str | None = None
    variability: str | None = None
    initial: str | None = None
    reference: int = 0
    start: str | None = None
    min: str | None = None
    max: str | None = None
    nominal: str | None = None
    unit: str | None = None
    is_relative: bool = False
    shape: tuple[int, ...] = ()
    items: Mapping[str, str] = MappingProxyType({})
    enumeration: str | None = None
    description: str | None = None

    @classmethod
    def of(cls, variable: ModelVariable) -> Variable:
        """Make a scalar variable, or a whole array, of a description."""
        own = variable.declaredType
        choices = own is not None and family_of(variable.type) == "Enumeration"
        return cls(
            variable.name,
            variable.type,
            variable.causality,
            variable.variability,
            variable.initial,
            variable.valueReference,
            variable.start,
            variable.min,
            variable.max,
            variable.nominal,
            variable.unit or (own.unit if own is not None else None),
            bool(variable.relativeQuantity or (own is not None and own.relativeQuantity)),
            tuple(variable.shape or ()),
            {item.name: item.value for item in own.items} if choices else {},
            own.name if choices else None,
            variable.description,
        )

    @property
    def array(self) -> str:
        """Name in the FMU; for an element, the array's."""
        return self.name.rpartition("[")[0] if self.shape else self.name

    @property
    def family(self) -> str:
        """Type, or its equivalent in FMI 2.0."""
        return family_of(self.type)

    def typed(self, value: object, name: str) -> Value:
        """Convert a value, or its text from a command line or file, to the variable's type.

        Args:
            value: a number, a truth value or a text.
            name: of the variable in the system, for messages.

        Raises:
            InputError: it is not of that type, not finite, or out of range.

        """
        shown = ""
        try:
            text = str(value).strip()
            shown = f" = {shortened(text)}"
            if self.family == "Boolean":
                return BOOLEANS[text.lower()]
            if self.family == "String":
                return transferable(str(value))
            read = real if self.family == "Real" else integer
            number = read(self.items.get(text, text))
            if self.items and not any(number == int(item) for item in self.items.values()):
                raise ValueError(f"{number} is not an item")
        except (KeyError, ValueError):
            # Python does not convert integers with thousands of digits.
            names = ", ".join(self.items)
            words = f"one of {names}" if names else _IN_WORDS.get(self.family, "an integer")
            raise InputError(f"{name}{shown}: not {words}") from None
        if isinstance(number, float) and not isfinite(number):
            raise InputError(f"{name}{shown}: must be finite")
        lower, upper = self.range
        if number < lower:
            raise InputError(f"{name}{shown}: must be at least {_written(lower)}")
        if number > upper:
            raise InputError(f"{name}{shown}: must be at most {_written(upper)}")
        # The value that the FMU will hold.
        return ctypes.c_float(number).value if self.type == "Float32" else number

    def difference(self, value: Any, name: str) -> float:
        """Return a value that can be added to the variable's own.

        Args:
            value: a number.
            name: of the variable in the system, for messages.

        Raises:
            InputError: nothing can be added to the variable, or the value does not fit.

        """
        own = TYPES[self.type]
        if own.family not in ("Real", "Integer") or own.is_wide:
            raise InputError(f"{name} is of type {self.type}: nothing can be added to it")
        if not is_finite(value) or (
            own.family == "Integer" and (value != int(value) or abs(value) > own.most - own.least)
        ):
            raise InputError(f"{name}: {value!r} cannot be added to it")
        return float(value)

    def cell(self, value: object, where: str = "") -> Value:
        """Convert a value of a table: a number, a truth value or the name of an item.

        Args:
            value: as a run or a user writes it; its range is not checked.
            where: the value stands, for messages.

        Raises:
            ValueError: it is neither a finite number nor a value of the type.

        """
        text = str(value)
        if self.family == "String":
            return transferable(text)
        word = text.strip()
        if self.family == "Boolean" and word.lower() in BOOLEANS:
            return BOOLEANS[word.lower()]
        word = self.items.get(word, word)
        return finite(word, where) if self.family == "Real" else whole(word, where)

    def shown(self, value: Any) -> Any:
        """Return a value as a user writes it: an item of an Enumeration by its name."""
        names = (name for name, number in self.items.items() if int(number) == value)
        return next(names, value)

    def holds(self, value: object) -> bool:
        """Return True for a value that the variable can have."""
        if isinstance(value, str):
            # Half of a UTF-16 pair is not text.
            is_text = value.encode(errors="ignore").decode() == value
            return self.family == "String" and is_text
        if type(value) is int:
            own = TYPES[self.type]
            is_whole = self.family in ("Integer", "Enumeration")
            return is_whole and own.least <= value <= own.most
        return type(value) is {"Real": float, "Boolean": bool}.get(self.family)

    @property
    def range(self) -> tuple[float, float]:
        """Range of the description, limited by the type."""
        own = TYPES[self.type]
        lower = own.least if self.min is None else max(own.least, _end(self.min))
        upper = own.most if self.max is None else min(own.most, _end(self.max))
        return lower, upper


def _end(text: str) -> float:
    """Read an end of a range, exactly if it is an integer."""
    with suppress(ValueError):
        return integer(text)
    return real(text)


def _written(end: float) -> str:
    return str(end) if isinstance(end, int) else f"{end:.16g}"


class Variables(NamedTuple):
    """The variables of an FMU.

    Attributes:
        known: variables that can be connected, set and recorded, by name; elements of an array one
            by one, in their order.
        unsupported: reasons why other variables cannot, by name.
        other_names: for aliases and arrays, the name to write instead.

    """

    known: Mapping[str, Variable]
    unsupported: Mapping[str, str]
    other_names: Mapping[str, str]


@lru_cache(maxsize=256)
def variables_of(description: ModelDescription) -> Variables:
    """Collect the variables of an FMU."""
    known: dict[str, Variable] = {}
    unsupported: dict[str, str] = {}
    other_names: dict[str, str] = {}
    names = {variable.name for variable in description.modelVariables}
    for variable in description.modelVariables:
        if reason := _reason(variable):
            unsupported[variable.name] = reason
            continue
        first = next(element_names(variable.name, variable.shape or ()))
        if variable.shape and first in names:
            unsupported[variable.name] = (
                f"is an array, but its element {first} is another variable's name"
            )
        elif variable.alias is not None:
            other_names[variable.name] = f"is another name of {variable.alias.name}: use that one"
        elif variable.shape:
            other_names[variable.name] = f"is an array: name an element, as {first}"
            known |= {element.name: element for element in _elements(Variable.of(variable))}
        else:
            known[variable.name] = Variable.of(variable)
    return Variables(known, unsupported, other_names)


def _reason(variable: ModelVariable) -> str:
    """Return why a variable is not supported; empty: it is."""
    if variable.type not in TYPES:
        return f"is of type {variable.type}, which is not supported"
    if variable.clocks:
        return "belongs to a Clock, and Clocks are not supported"
    if any(length < 1 for length in variable.shape or ()):
        return "is an array without elements"
    if prod(variable.shape or ()) > MOST_ELEMENTS:
        return f"is an array of more than {MOST_ELEMENTS:,} elements"
    return ""


def element_names(array: str, shape: Sequence[int]) -> Iterator[str]:
    """Yield the names of an array's elements by FMI's naming convention, in their order.

    Args:
        array: name of the array.
        shape: its lengths; indices begin with 1. Empty: it is a scalar.

    """
    for indices in product(*(range(1, length + 1) for length in shape)):
        yield f"{array}[{','.join(map(str, indices))}]" if indices else array


def _elements(array: Variable) -> Iterator[Variable]:
    n = prod(array.shape)
    starts = _starts(array)
    if len(starts) == 1:
        # One value holds for all elements.
        starts *= n
    for place, name in enumerate(element_names(array.name, array.shape)):
        start = starts[place] if place < len(starts) else None
        yield array._replace(name=name, start=start)


def _starts(array: Variable) -> list[str]:
    if array.start is None:
        return []
    return array.start.split(_BETWEEN if array.type == "String" else None)


def references_of(variables: Sequence[Variable]) -> list[int]:
    """Return the value references of variables, one for all elements of an array."""
    references, place = [], 0
    while place < len(variables):
        references.append(variables[place].reference)
        place += prod(variables[place].shape)
    return references


def complete(description: ModelDescription, root: ElementTree.Element) -> None:
    """Add the parts of a description of FMI 3.0 that fmpy does not read.

    Args:
        description: as read by fmpy.
        root: root element of the file.

    """
    if description.coSimulation is not None:
        stated = root.find("CoSimulation")
        assert stated is not None
        gives = stated.get("providesDirectionalDerivatives")
        description.coSimulation.providesDirectionalDerivative = gives in ("true", "1")
        # Only FMI 2.0 has this capability.
        description.coSimulation.canInterpolateInputs = False
    elements = {element.get("name"): element for element in root.findall("ModelVariables/*")}
    for variable in description.modelVariables:
        element = elements.get(variable.name)
        if element is None:
            continue
        if variable.type.startswith("UInt"):
            variable.min, variable.max = element.get("min"), element.get("max")
        if variable.shape and variable.type == "String":
            texts = [start.get("value", "") for start in element.findall("Start")]
            variable.start = _BETWEEN.join(texts) if texts else None


_MEMBER = "TerminalMemberVariable"

#: Matching rules of terminals: those that connect all members, and the other one.
COMPLETE, BUS = ("plug", "sequence"), "bus"


class Terminal(NamedTuple):
    """Variables that are connected together.

    Attributes:
        rule: members that are connected: all of a plug, by name; those of a bus that the other
            terminal has; all of a sequence, by place, which is their name.
        members: names of variables by names of members.
        flows: members that are not signals; connecting them would take sums and signs.

    """

    rule: str
    members: Mapping[str, str]
    flows: Sequence[str]


def terminals_of(folder: Path) -> dict[str, Terminal]:
    """Return the terminals of an unpacked FMU by name; an inner one has a dotted name.

    Raises:
        InputError: the file that lists them cannot be read.

    """
    file = folder / "terminalsAndIcons" / "terminalsAndIcons.xml"
    if not file.is_file():
        return {}
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as error:
        raise InputError(f"{file.name} is not well-formed XML: {error}") from None
    return dict(_terminals(root.find("Terminals"), ""))


def _terminals(parent: ElementTree.Element | None, outer: str) -> Iterator[tuple[str, Terminal]]:
    for element in () if parent is None else parent.findall("Terminal"):
        name, rule = outer + element.get("name", ""), element.get("matchingRule", "")
        members = [
            (member.get("memberName", ""), member.get("variableName", ""))
            for member in element.findall(_MEMBER)
        ]
        if rule == "sequence":
            members = [(str(place), variable) for place, (_, variable) in enumerate(members)]
        flows = [
            member.get("variableName") or member.get("inStreamVariableName") or ""
            for member in element
            if member.tag == "TerminalStreamMemberVariable"
            or (member.tag == _MEMBER and member.get("variableKind") != "signal")
        ]
        yield name, Terminal(rule, dict(members), flows)
        yield from _terminals(element, f"{name}.")
