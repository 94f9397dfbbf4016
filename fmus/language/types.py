"""Types of the language of equations: numbers, and arrays and records of them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any, Union, get_args, get_origin

from auv_fmu.language.arrays import Matrix, Vector
from fmus.ports.groups import hints_of, is_class, is_record, sizes_in, split

#: The beginning of a message with a place.
PLACED = re.compile(r".+?:\d+: ")

#: Largest vector or matrix, since it may be copied to the stack, which has 1 MB on Windows.
_MOST_NUMBERS = 65_536


def _one(made: type) -> str:
    """Return the name of a class with its article."""
    return f"{'an' if made.__name__[0] in 'AEIOUaeiou' else 'a'} {made.__name__}"


@dataclass(frozen=True)
class Scalar:
    """A number, or a text of a refusal.

    Attributes:
        word: its name in messages.
        made: class of an enumeration; None for other types.

    """

    word: str
    made: Any = None


@dataclass(frozen=True)
class Array:
    """A vector, a matrix, which is an array of rows, or a tuple of elements of one type.

    Attributes:
        item, n: type and number of the elements.
        made: Vector or Matrix; None for a tuple.

    """

    item: Type
    n: int
    made: Any = None

    @property
    def word(self) -> str:
        """Its name in messages."""
        if self.made is Matrix:
            return f"a Matrix of {self.n} rows of {sizes(self)[1]}"
        return f"a {'Vector' if self.made else 'tuple'} of {self.n}"


@dataclass(frozen=True)
class Record:
    """A NamedTuple, or a tuple whose elements differ.

    Attributes:
        fields: names and types of the fields; a tuple has fields m0, m1 ...
        made: the class; None for a tuple.

    """

    fields: tuple[tuple[str, Type], ...]
    made: Any = None

    @property
    def word(self) -> str:
        """Its name in messages."""
        return _one(self.made) if self.made else f"a tuple of {len(self.fields)}"


Type = Union[Scalar, Array, Record]

FLOAT, INT, BOOL, TEXT, NOTHING = map(Scalar, ("a float", "an int", "a bool", "a text", "nothing"))

#: Type of an expression that has been refused.
UNKNOWN = Scalar("unknown")

_SCALARS: dict[Any, Scalar] = {float: FLOAT, int: INT, bool: BOOL, str: TEXT}


def is_whole(type_: Type) -> bool:
    """Return True for an int, a bool or an enumeration."""
    return type_ in (INT, BOOL) or (isinstance(type_, Scalar) and type_.made is not None)


def is_number(type_: Type) -> bool:
    """Return True for a type of numbers."""
    return type_ == FLOAT or is_whole(type_)


def is_algebraic(type_: Type) -> bool:
    """Return True for a vector or a matrix."""
    return isinstance(type_, Array) and type_.made is not None


def sizes(type_: Type) -> tuple[int, ...]:
    """Return the length of an array, or the rows and columns of a matrix."""
    return (type_.n, *sizes(type_.item)) if isinstance(type_, Array) else ()


def parts_of(type_: Type) -> tuple[Type, ...]:
    """Return the types of the elements of an array or a record; empty for a number."""
    if isinstance(type_, Array):
        return (type_.item,) * type_.n
    return tuple(part for _, part in type_.fields) if isinstance(type_, Record) else ()


def scalars_in(type_: Type) -> Iterator[Scalar]:
    """Yield the types of all numbers in a type."""
    if isinstance(type_, Scalar):
        yield type_
    for part in parts_of(type_):
        yield from scalars_in(part)


@cache
def count(type_: Type) -> int:
    """Return the number of numbers in a type."""
    if isinstance(type_, Array):
        return type_.n * count(type_.item)
    return sum(map(count, parts_of(type_))) if isinstance(type_, Record) else 1


@cache
def has_only_floats(type_: Type) -> bool:
    """Return True if all numbers in a type are floats."""
    if isinstance(type_, Array):
        return has_only_floats(type_.item)
    return (
        type_ == FLOAT if isinstance(type_, Scalar) else all(map(has_only_floats, parts_of(type_)))
    )


def vector(n: int) -> Array:
    """Return the type of a vector."""
    check_size(f"a Vector of {n}", n)
    return Array(FLOAT, n, Vector)


def matrix(rows: int, columns: int) -> Array:
    """Return the type of a matrix."""
    check_size(f"a Matrix of {rows} rows of {columns}", rows * columns)
    return Array(vector(columns), rows, Matrix)


def check_size(what: str, n: int) -> None:
    """Refuse an array that is empty, or too large for C.

    Raises:
        TypeError: it is.

    """
    if n < 1:
        raise TypeError(f"{what} is empty")
    if n > _MOST_NUMBERS:
        raise TypeError(f"{what} is too large for C, which takes at most {_MOST_NUMBERS} numbers")


def tuple_of(items: list[Type]) -> Array | Record:
    """Return the type of a plain tuple."""
    if TEXT in items:
        raise TypeError("a tuple of texts; choose between texts by if")
    if items and all(item == items[0] for item in items):
        return Array(items[0], len(items))
    return Record(tuple((f"m{i}", item) for i, item in enumerate(items)))


def type_of(hint: Any) -> Type:
    """Return the type of an annotation.

    Raises:
        TypeError: it is not in the language.

    """
    hint, notes = split(hint)
    given = sizes_in(notes)
    if hint is Vector and len(given) == 1:
        return vector(*given)
    if hint is Matrix and len(given) == 2:
        return matrix(*given)
    if hint in (Vector, Matrix):
        example = "Vector, 3" if hint is Vector else "Matrix, 2, 3"
        raise TypeError(f"{hint.__name__} has no size here: write Annotated[{example}]")
    if hint in _SCALARS:
        return _SCALARS[hint]
    if get_origin(hint) is tuple and Ellipsis not in get_args(hint):
        return tuple_of([type_of(part) for part in get_args(hint)])
    if is_class(hint, IntEnum):
        return enumeration(hint)
    if is_record(hint):
        return _record(hint)
    name = hint.__name__ if isinstance(hint, type) else hint
    raise TypeError(f"{name} is not a type in the language of equations")


def enumeration(made: type[IntEnum]) -> Scalar:
    """Return the type of an enumeration."""
    for base in made.__mro__[: made.__mro__.index(IntEnum)]:
        _check_plain(base)
    return Scalar(_one(made), made)


@cache
def _record(made: Any) -> Record:
    _check_plain(made)
    hints = hints_of(made)
    if made.__bases__[0] is not tuple or [*hints] != [*made._fields]:
        what = f"the class {made.__name__} is not a NamedTuple with a type for each field"
        raise TypeError(f"{place_of(made)}{what}")
    return Record(tuple((name, _field(made, name, hint)) for name, hint in hints.items()), made)


def _check_plain(made: type) -> None:
    """Refuse a class with special methods, which change the operators of its values."""
    for name, value in vars(made).items():
        called = getattr(value, "__func__", value)
        is_own = getattr(called, "__module__", "") == made.__module__ and callable(called)
        if is_own and re.fullmatch(r"__\w+__|_missing_", name) and not isinstance(value, type):
            raise TypeError(f"{place_of(made)}{name} in the class {made.__name__}: leave it out")


def _field(made: type, name: str, hint: Any) -> Type:
    """Return the type of a field of a class."""
    try:
        type_ = type_of(hint)
        if type_ == TEXT:
            raise TypeError("texts are for raise Refusal(...) only")
    except TypeError as error:
        if PLACED.match(str(error)):
            raise
        raise TypeError(f"{place_of(made, name)}{made.__name__}.{name}: {error}") from None
    return type_


def place_of(made: type, field: str = "") -> str:
    """Return the place of a class or field, as the beginning of a message; empty if unknown."""
    try:
        lines, first = inspect.getsourcelines(made)
        path = inspect.getsourcefile(made)
    except OSError:
        return ""
    at = [i for i, line in enumerate(lines) if field and re.match(rf"\s+{field}\s*:", line)]
    return f"{path}:{first + (at or [0])[0]}: "


def has_no_size(hint: Any) -> bool:
    """Return True for a vector or a matrix without a size, or a tuple with one."""
    parts = get_args(hint) if get_origin(hint) is tuple else ()
    return hint in (Vector, Matrix) or any(map(has_no_size, parts))


def type_of_value(value: Any, name: str) -> Type:
    """Return the type of a constant: a number, or a group of numbers.

    Raises:
        TypeError: it is not in the language.

    """
    if isinstance(value, Vector):
        return vector(len(value))
    if isinstance(value, Matrix):
        return matrix(len(value), len(value[0]) if value else 0)
    if is_record(type(value)):
        return type_of(type(value))
    if isinstance(value, tuple) and value:
        return tuple_of([type_of_value(part, name) for part in value])
    if isinstance(value, IntEnum):
        return enumeration(type(value))
    if type(value) in (float, int, bool):
        return _SCALARS[type(value)]
    advice = ""
    if hasattr(value, "dtype"):
        # Operations with numpy's numbers give numpy's numbers, which divide by zero.
        advice = ": write float(...) or int(...)"
    elif isinstance(value, dict):
        advice = ": write a tuple, and the place of an element for its key"
    raise TypeError(f"{name} is not a number, nor a tuple of numbers{advice}")


def check_value(value: Any, type_: Type, name: str) -> None:
    """Refuse a value of another type than its annotation.

    Raises:
        TypeError: it has another type.

    """
    parts = parts_of(type_)
    if not isinstance(type_, Scalar):
        made = type_.made or tuple
        if not isinstance(value, made) or len(value) != len(parts):
            raise TypeError(f"{name} is not {type_.word}")
        for field, item, part in zip(getattr(value, "_fields", range(len(value))), value, parts):
            check_value(item, part, f"{name}.{field}")
        return
    if type_ == FLOAT and isinstance(value, int):
        raise TypeError(f"{name} is an int where a float is wanted: write {value}.0")
    if not isinstance(value, type_.made) if type_.made else _SCALARS.get(type(value)) != type_:
        raise TypeError(f"{name} is {_one(type(value))} where {type_.word} is wanted")
    if not isinstance(value, (float, str)):
        check_int(value)


def check_int(value: int) -> None:
    """Refuse an int of more than 32 bits.

    Raises:
        TypeError: it has more.

    """
    if not -(2**31) <= value < 2**31:
        raise TypeError(f"{value} is an int of more than 32 bits: write {value}.0")
