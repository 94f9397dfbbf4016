"""All that a set of functions needs in C: structures, constants and functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from fmus.native.shapes import DOUBLE, INTEGER, Shape, declaration, inner, shape_of, structure


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

    def shape(self, kind: Any) -> Shape:
        """What a type is in C; its structures are defined."""
        return self.defined(shape_of(kind))

    def defined(self, shape: Shape) -> Shape:
        """The shape, whose structures are defined."""
        for part in inner(shape):
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
            raise Untranslatable(f"{name} is no number")
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
