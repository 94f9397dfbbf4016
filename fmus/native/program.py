"""What a set of functions needs in C: the shapes of its types, structures, constants, functions.

A shape is what a type is in C: a number, or a structure of them.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FunctionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from auv_fmu import vectors


@dataclass(frozen=True)
class Scalar:
    """A number, or a text of a refusal."""

    name: str


@dataclass(frozen=True)
class Structure:
    """A tuple: an array `v` where its elements are alike, else one member an element.

    Attributes:
        name: of the structure in C.
        parts: how each element is written after a name, and its shape.
        made: the NamedTuple or TypedDict; None: a plain tuple.

    """

    name: str
    parts: tuple[tuple[str, Shape], ...]
    made: Any = None

    @property
    def is_array(self) -> bool:
        """Whether its elements stand in an array."""
        return bool(self.parts) and self.parts[0][0] == ".v[0]"


Shape = Union[Scalar, Structure]

DOUBLE, INTEGER, TEXT = Scalar("double"), Scalar("int"), Scalar("const char *")

_SCALARS = {float: DOUBLE, int: INTEGER, bool: INTEGER, str: TEXT}

#: Names of tuples that the equations have given them.
_NAMES = {hint: name for name, hint in vars(vectors).items() if get_origin(hint) is tuple}


def shape_of(hint: Any) -> Shape:
    """What a type is in C.

    Raises:
        TypeError: it is nothing there.

    """
    if hint in _SCALARS:
        return _SCALARS[hint]
    if get_origin(hint) is tuple:
        return structure([shape_of(part) for part in get_args(hint)], _NAMES.get(hint))
    if isinstance(hint, type) and hasattr(hint, "__annotations__"):
        hints = get_type_hints(hint)
        parts = tuple((f".{name}", shape_of(part)) for name, part in hints.items())
        return Structure(hint.__name__, parts, hint)
    raise TypeError(f"{hint} is not a type in the language of equations")


def structure(items: list[Shape], name: str | None = None) -> Structure:
    """The structure of a plain tuple."""
    if all(item == items[0] for item in items):
        first = items[0]
        own = f"Vector{len(items)}" if first == DOUBLE else f"{first.name}x{len(items)}"
        return Structure(name or own, tuple((f".v[{i}]", item) for i, item in enumerate(items)))
    joined = "_".join(item.name for item in items)
    return Structure(name or joined, tuple((f".m{i}", item) for i, item in enumerate(items)))


def count_numbers(shape: Shape) -> int:
    """How many numbers a shape holds.

    Raises:
        TypeError: some of them are not doubles.

    """
    if isinstance(shape, Structure):
        return sum(count_numbers(part) for _, part in shape.parts)
    if shape != DOUBLE:
        raise TypeError(f"{shape.name} among numbers")
    return 1


def inner_structures(shape: Shape) -> Iterator[Structure]:
    """The structures that a structure needs, and itself after them."""
    if isinstance(shape, Structure):
        for _, part in shape.parts:
            yield from inner_structures(part)
        yield shape


def declaration(shape: Structure) -> str:
    """The definition of a structure, with the comments of a class."""
    about = _comments(shape.made)
    members = [f"{part.name} {suffix[1:]};{about.get(suffix, '')}" for suffix, part in shape.parts]
    if shape.is_array:
        members = [f"{shape.parts[0][1].name} v[{len(members)}];"]
    lines = [f"    {line}" for line in members or ["char nothing; /* C has no empty structure */"]]
    text = inspect.cleandoc(shape.made.__doc__).splitlines()[0] if shape.made else ""
    head = f"/* {strip_sphinx_marks(text)} */\n" if text else ""
    return head + "\n".join(["typedef struct {", *lines, f"}} {shape.name};"])


def _comments(made: Any) -> dict[str, str]:
    """What `#:` says of the fields of a class, as comments."""
    if made is None:
        return {}
    found = re.findall(r"^    (\w+):.*#: (.*)$", inspect.getsource(made), re.MULTILINE)
    return {f".{name}": f" /* {strip_sphinx_marks(text)} */" for name, text in found}


def strip_sphinx_marks(text: str) -> str:
    """Take the marks that Sphinx reads out of a text."""
    return re.sub(r"(?::\w+:)?`+[~.]?([^`]*)`+", r"\1", text).replace("*/", "* /")


class Untranslatable(Exception):
    """Something has no counterpart in C; the text says what, and where."""


@dataclass
class Function:
    """A function in C."""

    name: str
    arguments: dict[str, Shape]
    returns: Shape | None
    raises: bool = False
    text: str = ""

    def call(self, arguments: list[str]) -> str:
        """A call, in a function that has an `error` where this one needs it."""
        return f"{self.name}({', '.join([*arguments, *(['error'] if self.raises else [])])})"


class Program:
    """All that a set of functions needs: structures, constants and functions in C.

    Attributes:
        structures, constants, functions: their texts, each after what it needs.

    """

    def __init__(self, translate: Callable[[Program, FunctionType], Function]) -> None:
        """Begin with nothing.

        Args:
            translate: makes a function of C.

        """
        self._translate = translate
        self.structures: dict[str, str] = {}
        self.constants: dict[str, str] = {}
        self.functions: dict[FunctionType, Function] = {}
        self._begun: set[FunctionType] = set()

    def shape(self, hint: Any) -> Shape:
        """What a type is in C; its structures are defined."""
        return self.defined(shape_of(hint))

    def defined(self, shape: Shape) -> Shape:
        """The shape, whose structures are defined."""
        for part in inner_structures(shape):
            text = declaration(part)
            if self.structures.setdefault(part.name, text) != text:
                raise Untranslatable(f"two structures have the name {part.name}")
        return shape

    def constant(self, name: str, value: Any) -> Shape:
        """The shape of a number, or of a tuple of numbers, that stands in a module."""
        if isinstance(value, tuple):
            shape: Shape = self.defined(structure([DOUBLE] * len(value)))
            text = "{{" + ", ".join(repr(float(x)) for x in value) + "}}"
        elif type(value) in (float, int):
            shape = DOUBLE if type(value) is float else INTEGER
            text = repr(value)
        else:
            raise Untranslatable(f"{name} is not a number")
        self.constants.setdefault(name, f"static const {shape.name} {name} = {text};")
        return shape

    def function(self, function: FunctionType) -> Function:
        """A function in C, after the functions that it calls."""
        if function not in self.functions:
            if function in self._begun:
                raise Untranslatable(f"{function.__name__} calls itself")
            self._begun.add(function)
            self.functions[function] = self._translate(self, function)
        return self.functions[function]


def c_name(module: str, name: str) -> str:
    """The name of something in C, where names of several modules stand side by side."""
    return f"{module.rsplit('.', maxsplit=1)[-1]}_{name.lstrip('_')}"
