"""What a set of functions needs in C: structures, constants and functions, in their order."""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import resolve_name
from math import isinf, isnan
from types import FunctionType, ModuleType
from typing import Any

from auv_fmu.language.arrays import Matrix, Vector
from fmus.native.shapes import (
    BOOLEAN,
    DOUBLE,
    INTEGER,
    PLACED,
    Shape,
    Structure,
    declaration,
    declared,
    has_no_size,
    in_c,
    inner_structures,
    is_of_library,
    matrix,
    place_of,
    shape_of,
    structure,
    vector,
    words_of_runtime,
)
from fmus.ports.groups import hints_of


class Untranslatable(Exception):
    """Something has no counterpart in C; the text says what, and where."""


@dataclass
class Function:
    """A function in C.

    Attributes:
        name: in C.
        arguments: by their names.
        returns: None: nothing, or what its first `return` shows.
        raises: whether it has an argument `error`.
        text: in C.

    """

    name: str
    arguments: dict[str, Shape]
    returns: Shape | None
    raises: bool = False
    text: str = ""

    @property
    def head(self) -> str:
        """Its first line, with the open brace."""
        given = [f"{declared(shape)}{in_c(name)}" for name, shape in self.arguments.items()]
        given += ["Error *error"] if self.raises else []
        returned = self.returns.name if self.returns else "void"
        return f"static {returned} {self.name}({', '.join(given) or 'void'}) {{"

    @property
    def leave(self) -> str:
        """The statement that ends it after an error."""
        zero = f"({self.returns.name}){{0}}" if isinstance(self.returns, Structure) else "0"
        return f"return {zero};" if self.returns else "return;"

    def call(self, arguments: Sequence[str]) -> str:
        """A call, in a function that has an `error` where this one needs it."""
        return f"{self.name}({', '.join([*arguments, *(['error'] if self.raises else [])])})"


class Program:
    """All that a set of functions needs: structures, constants and functions in C.

    Attributes:
        structures, constants: their texts, by their names.
        functions: by what they were made from.

    """

    def __init__(self, translate: Callable[[Program, FunctionType, Function], None]) -> None:
        """Begin with nothing.

        Args:
            translate: fills in the text of a function.

        """
        self._translate = translate
        self.structures: dict[str, str] = {}
        self._made: dict[str, Structure] = {}
        self.constants: dict[str, str] = {}
        self.functions: dict[Hashable, Function] = {}
        self._begun: set[Hashable] = set()
        self._owners: dict[str, Hashable] = {}
        self.words: set[str] = set()

    @property
    def taken(self) -> set[str]:
        """Names in C of functions and constants."""
        return {*self._owners}

    def name(self, owner: Hashable, name: str) -> str:
        """A name in C that only its owner has, and no variable of a module met so far."""
        taken = words_of_runtime() | self.words | self.structures.keys()
        if is_of_library(name):
            name += "_"
        while name in taken or self._owners.setdefault(name, owner) != owner:
            name += "_"
        return name

    def shape(self, hint: Any) -> Shape:
        """What a type is in C; its structures are defined."""
        return self.defined(shape_of(hint))

    def defined(self, shape: Shape) -> Shape:
        """The shape, whose structures are defined."""
        for part in inner_structures(shape):
            other, text = self._made.setdefault(part.name, part), declaration(part)
            is_taken = part.name in self._owners
            if is_taken or self.structures.setdefault(part.name, text) != text:
                raise Untranslatable(_alike(part, other))
        return shape

    def constant(self, module: str, name: str, value: Any) -> tuple[str, Shape]:
        """The name in C and the shape of what stands in a module: numbers, or tuples of them."""
        shape = self.defined(_shape_of_value(value, name))
        text = literal(value, shape, name)
        # Another module, or an enumeration, may have one of this name and another value.
        given = self.name(("constant", shape, text), c_name(module, name))
        self.constants.setdefault(given, f"static const {shape.name} {given} = {text};")
        return given, shape

    def function(self, function: FunctionType, shapes: Sequence[Shape] = ()) -> Function:
        """A function in C, after the functions that it calls.

        Args:
            function: of the equations.
            shapes: of its arguments, of which some may be vectors of any size.

        """
        hints = hints_of(function)
        returns = hints.pop("return", None)
        unsized = any(map(has_no_size, hints.values()))
        key = (function, *shapes) if unsized else function
        if key in self.functions:
            return self.functions[key]
        if key in self._begun:
            raise Untranslatable(f"{function.__name__} calls itself")
        self._begun.add(key)
        self.words |= _words(function.__module__)
        arguments = {
            name: shapes[i] if has_no_size(hint) and i < len(shapes) else
            self._shape_in(function, f"the argument {name}", hint)
            for i, (name, hint) in enumerate(hints.items())
        }  # fmt: skip
        name = c_name(function.__module__, function.__name__)
        if unsized:
            sizes = "_".join(shape.name for shape in arguments.values())
            name = re.sub(r"\W+", "_", f"{name}_{sizes}")
        is_open = returns in (None, type(None)) or has_no_size(returns)
        shape = None if is_open else self._shape_in(function, "the result", returns)
        made = Function(self.name(key, name), arguments, shape)
        self._translate(self, function, made)
        self.functions[key] = made
        return made

    def _shape_in(self, function: FunctionType, what: str, hint: Any) -> Shape:
        """The shape of an argument or a result."""
        try:
            return self.shape(hint)
        except (TypeError, Untranslatable) as error:
            if PLACED.match(str(error)):
                raise
            code = function.__code__
            place = f"{code.co_filename}:{code.co_firstlineno}"
            why = f"{what} of {function.__name__}: {error}"
            raise Untranslatable(f"{place}: {why}") from None

    def helper(self, name: str, arguments: dict[str, Shape], returns: Shape, body: str) -> Function:
        """A function that is written in C, made once; it raises if it uses DIV or PLACE."""
        if name not in self.functions:
            self.defined(returns)
            raises = "DIV(" in body or "PLACE(" in body
            made = Function(self.name(("helper", name), name), arguments, returns, raises)
            for shape in arguments.values():
                self.defined(shape)
            made.text = f"{made.head}\n{body}\n}}"
            self.functions[name] = made
        return self.functions[name]


def _alike(*structures: Structure) -> str:
    """What to say of structures that would have one name in C; the user's class is named first."""
    made = [shape.made for shape in structures if shape.made]
    made.sort(key=lambda one: one.__module__.partition(".")[0] in ("auv_fmu", "fmus"))
    if not made:
        return f"two things have the name {structures[0].name} in C: rename a class"
    beside = f" of {made[1].__module__}" if len(made) > 1 else ""
    return (
        f"{place_of(made[0])}the class {made[0].__name__} has the name of another "
        f"structure{beside} in C: rename it"
    )


@cache
def _words(module: str) -> frozenset[str]:
    """All names in the text of a module."""
    return frozenset(re.findall(r"\b[A-Za-z_]\w*\b", inspect.getsource(sys.modules[module])))


def home(module: str, name: str) -> str:
    """The module that a constant was defined in, seen from one that uses it."""
    origin = _origins(sys.modules[module]).get(name)
    return module if origin is None else origin if origin == "math" else home(origin, name)


@cache
def _origins(module: ModuleType) -> dict[str, str]:
    """Where the names come from that a module imports."""
    imports = [
        n for n in ast.parse(inspect.getsource(module)).body if isinstance(n, ast.ImportFrom)
    ]
    return {
        alias.name: resolve_name(f"{'.' * node.level}{node.module or ''}", module.__package__)
        for node in imports
        for alias in node.names
    }


def c_name(module: str, name: str) -> str:
    """The name of something in C, where names of several modules stand side by side."""
    return f"{module.rsplit('.', maxsplit=1)[-1]}_{name.lstrip('_')}"


def _shape_of_value(value: Any, name: str) -> Shape:
    if isinstance(value, Vector):
        return vector(len(value))
    if isinstance(value, Matrix):
        return matrix(len(value), len(value[0]) if value else 0)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return shape_of(type(value))
    if isinstance(value, tuple) and value:
        return structure([_shape_of_value(part, name) for part in value])
    if type(value) is float:
        return DOUBLE
    if isinstance(value, int):
        return BOOLEAN if type(value) is bool else INTEGER
    # numpy's numbers make numpy's of all that they meet, which divide by zero.
    advice = ": write float(...) or int(...)" if hasattr(value, "dtype") else ""
    raise Untranslatable(f"{name} is not a number, nor a tuple of numbers{advice}")


def literal(value: Any, shape: Shape, name: str) -> str:
    """A value of a shape as an initializer.

    Raises:
        Untranslatable: it is of another shape, which its annotation does not tell.

    """
    if isinstance(shape, Structure):
        made = shape.made or tuple
        if not isinstance(value, made) or len(value) != len(shape.parts):
            raise Untranslatable(f"{name} is not {shape.word}")
        names = getattr(value, "_fields", range(len(value)))
        parts = ", ".join(
            literal(one, part, f"{name}.{field}")
            for one, (_, part), field in zip(value, shape.parts, names)
        )
        return f"{{{{{parts}}}}}" if shape.is_array else f"{{{parts}}}"
    if shape == DOUBLE and isinstance(value, int):
        raise Untranslatable(f"{name} is an int where a float is wanted: write {value}.0")
    if type(value) is not float if shape == DOUBLE else not isinstance(value, int):
        raise Untranslatable(f"{name} is a {type(value).__name__} where {shape.word} is wanted")
    return number_in_c(value)


def number_in_c(value: float) -> str:
    """A number in C."""
    if isinstance(value, float):
        if isnan(value):
            return "NAN"
        if isinf(value):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        return repr(float(value))
    if not -(2**31) <= value < 2**31:
        raise Untranslatable(f"{value} is an int of more than 32 bits: write {value}.0")
    return str(int(value))
