"""Expressions of the language of equations in C: names, constants, elements and tuples."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from enum import IntEnum
from itertools import count
from types import ModuleType
from typing import Any, NamedTuple

from auv_fmu.language.arrays import Matrix
from fmus.native import arrays
from fmus.native.language import word_of
from fmus.native.layout import quoted
from fmus.native.program import Function, Program, Untranslatable, home, number_in_c
from fmus.native.shapes import (
    BOOLEAN,
    DOUBLE,
    INTEGER,
    NOTHING,
    PLACED,
    TEXT,
    Shape,
    Structure,
    in_c,
    structure,
    vector,
)
from fmus.native.variables import constant_of, is_dotted_name
from fmus.ports.groups import is_class

#: How tightly the operators of C bind.
TERNARY, OR, AND, EQUALITY, RELATION, SUM, PRODUCT, UNARY, POSTFIX = range(9)

#: Compilers take brackets within brackets, but not any number of them.
_DEEPEST = 200


def _power_of(base: Any, exponent: Any) -> Any:
    """A power of an int that is no larger than sizes can be."""
    if not (isinstance(base, int) and exponent in range(32)) or abs(base) > 2**31:
        raise OverflowError
    return base ** int(exponent)


#: Operators between constants.
_FOLDED: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: _power_of,
}  # fmt: skip

WHOLE = (INTEGER, BOOLEAN)
NUMBERS = (DOUBLE, *WHOLE)


class Code(NamedTuple):
    """An expression in C.

    Attributes:
        text, shape: what it says, and what it is.
        binding: how tightly its outermost operator binds.
        literal: the part of the text after the type, if the whole is a structure written out.

    """

    text: str
    shape: Shape
    binding: int = POSTFIX
    literal: str = ""

    def within(self, binding: int) -> str:
        """The text as an operand of what binds so tightly."""
        return self.text if self.binding >= binding else f"({self.text})"

    @property
    def argument(self) -> str:
        """The text as an argument of a macro, which takes the commas of a literal for its own."""
        outside = re.sub(r"\(.*?\)", "", self.text)
        return f"({self.text})" if "{" in outside or "}" in outside else self.text


class Expressions:
    """Translates the expressions of one function.

    Attributes:
        made: the function, of which it notes whether it raises.
        names: all names of its arguments and variables.
        words: names in the text around it, also those that belong to expressions.
        local: shapes of the ones that have been met.
        assigned: names that have a value here; None: here no step of the program comes.
        functions: local functions by their names: the function, and what it captures.
        numbers: of the functions that are made of parts of this one.

    """

    def __init__(
        self,
        program: Program,
        path: str,
        scope: dict[str, Any],
        made: Function,
        names: set[str],
        words: set[str],
    ) -> None:
        """Begin with the arguments.

        Args:
            program: that the function belongs to.
            path: of its module.
            scope: of its module.
            made: the function in C.
            names: of its arguments and variables.
            words: names in the text around it.

        """
        self.made, self.names, self.local = made, names, dict(made.arguments)
        self.words = words
        self.assigned: set[str] | None = set(made.arguments)
        self.functions: dict[str, tuple[Function, list[str]]] = {}
        self.program, self.path, self.scope = program, path, scope
        self.numbers = count(1)
        self._made_up: set[str] = set()
        self._depth = 0

    def unused(self, name: str) -> str:
        """A name for C only, which the function has not and gets now."""
        names = (name, *(f"{name}_{number}" for number in range(2, 10_000)))
        taken = self.names | self.words | self._made_up | self.program.taken
        found = next(n for n in names if n not in taken)
        self._made_up.add(found)
        self.program.words.add(found)
        return found

    def fail(self, node: ast.AST, what: str) -> Untranslatable:
        """What to raise, with the line."""
        return Untranslatable(f"{self.path}:{getattr(node, 'lineno', 0)}: {what}")

    def placed(self, node: ast.AST, error: Exception) -> Exception:
        """What to raise for an error: with the line, if it does not say one."""
        if PLACED.match(str(error)) or isinstance(error, RecursionError):
            return error
        ours = isinstance(error, (TypeError, Untranslatable))
        return self.fail(node, str(error) if ours else f"{type(error).__name__}: {error}")

    def parts(self, node: ast.AST, code: Code) -> list[Code]:
        """The elements of a tuple that has a name."""
        if not isinstance(code.shape, Structure):
            raise self.fail(node, "a number is taken apart")
        return [Code(f"{code.text}{suffix}", part) for suffix, part in code.shape.parts]

    def taken_apart(self, target: ast.expr, code: Code) -> Iterator[tuple[str, Code]]:
        """The names in a target, each with its part of a value."""
        if isinstance(target, ast.Name):
            if target.id != "_":
                yield target.id, code
            return
        assert isinstance(target, ast.Tuple)
        parts = self.parts(target, code)
        if len(parts) != len(target.elts):
            raise self.fail(target, f"{len(target.elts)} names for {len(parts)} values")
        for one, part in zip(target.elts, parts):
            yield from self.taken_apart(one, part)

    def known(self, node: ast.expr) -> Any:
        """What a name of a module stands for; None: it is a local one, or an expression."""
        if isinstance(node, ast.Name) and node.id not in self.names:
            builtins: dict[str, Any] = self.scope.get("__builtins__", {})
            return self.scope.get(node.id, builtins.get(node.id))
        if isinstance(node, ast.Attribute):
            owner = self.known(node.value)
            if isinstance(owner, ModuleType) or is_class(owner, IntEnum):
                return getattr(owner, node.attr, None)
        return None

    def constant(self, node: ast.expr) -> float | None:
        """The number that an expression of constants is; None: it is computed."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            operand = self.constant(node.operand)
            return None if operand is None else -operand
        if isinstance(node, ast.BinOp) and type(node.op) in _FOLDED:
            one, other = self.constant(node.left), self.constant(node.right)
            if one is None or other is None:
                return None
            with suppress(ArithmeticError):
                return _FOLDED[type(node.op)](one, other)
            return None
        if isinstance(node, ast.Call) and self.known(node.func) is len:
            return int(self.code(node).text)
        value = node.value if isinstance(node, ast.Constant) else self.known(node)
        return value if type(value) in (int, float) else None  # type: ignore[return-value]

    def size(self, node: ast.expr | None) -> int | None:
        """The int that an expression of constants is; None: it is none, or computed."""
        value = None if node is None else self.constant(node)
        return value if isinstance(value, int) else None

    def code(self, node: ast.expr, wanted: Shape | None = None) -> Code:
        """An expression in C, of a shape if there is a choice.

        Raises:
            Untranslatable: it has no counterpart.

        """
        name = f"_{type(node).__name__.lower()}"
        if not hasattr(self, name):
            raise self.fail(node, f"{word_of(node)} has no counterpart in C here")
        method: Callable[[Any, Shape | None], Code] = getattr(self, name)
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self.fail(node, f"an expression of {_DEEPEST} levels: take it apart")
        try:
            return method(node, wanted)
        except Exception as error:
            raise self.placed(node, error) from None
        finally:
            self._depth -= 1

    def fitting(self, node: ast.expr, wanted: Shape | None) -> Code:
        """An expression of exactly this shape."""
        return self.fit(node, self.code(node, wanted), wanted)

    def fit(self, node: ast.expr, code: Code, wanted: Shape | None) -> Code:
        """The code of an expression, if it is of exactly this shape."""
        if wanted is None or code.shape == wanted:
            return code
        if wanted == DOUBLE and code.shape in WHOLE:
            text = ast.unparse(node)
            better = f"{text}.0" if text.removeprefix("-").isdecimal() else f"float({text})"
            raise self.fail(node, f"{text} is an int where a float is wanted: write {better}")
        raise self.fail(node, f"{code.shape.word} where {wanted.word} is wanted")

    def number(self, node: ast.expr, code: Code | None = None) -> Code:
        """An operand that is a float, or an int that becomes one."""
        if isinstance(node, ast.Constant) and type(node.value) is int:
            return Code(repr(float(node.value)), DOUBLE)
        code = code or self.code(node)
        if code.shape not in NUMBERS:
            raise self.fail(node, f"{code.shape.word} where a number is wanted")
        return code

    def integer(self, node: ast.expr, what: str) -> Code:
        """An expression that is an int."""
        code = self.code(node)
        if code.shape not in WHOLE:
            raise self.fail(node, f"{what} that is {code.shape.word}, not an int")
        return code

    def check_plain(self, node: ast.Call, word: str) -> None:
        """Check that a call has arguments by their places only."""
        if node.keywords:
            raise self.fail(node, f"{word} with {node.keywords[0].arg or '**'}=")
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                raise self.fail(node, f"{word} with a star")

    def calling(self, function: Function, arguments: Sequence[str]) -> Code:
        """A call; what returns nothing is a statement."""
        self.made.raises |= function.raises
        return Code(function.call(arguments), function.returns or NOTHING)

    # Names and constants

    def _constant(self, node: ast.Constant, wanted: Shape | None) -> Code:
        value: Any = node.value
        if isinstance(value, str):
            return Code(quoted(value), TEXT)
        shapes: dict[type, Shape] = {float: DOUBLE, bool: BOOLEAN, int: INTEGER}
        return Code(number_in_c(value), shapes[type(value)])

    def _name(self, node: ast.Name, wanted: Shape | None) -> Code:
        if node.id not in self.names:
            return self._module_constant(node)
        if node.id not in self.local or (
            self.assigned is not None and node.id not in self.assigned
        ):
            raise self.fail(node, f"{node.id} may have no value here")
        return Code(in_c(node.id), self.local[node.id])

    def _module_constant(self, node: ast.expr) -> Code:
        name = node.id if isinstance(node, ast.Name) else ast.unparse(node).rsplit(".")[-1]
        value = self.known(node)
        if value is None:
            raise self.fail(node, f"the name {ast.unparse(node)} is not known here")
        # It bears the name of the module that it stands in, wherever it was imported.
        is_dotted = isinstance(node, ast.Attribute) and self.known(node.value) is math
        module = "math" if is_dotted else home(self.scope["__name__"], name)
        if module == "math" and type(value) is float:
            return Code(number_in_c(value), DOUBLE)
        if isinstance(value, IntEnum):
            module, name = type(value).__module__, f"{type(value).__name__}_{value.name}"
        return Code(*self.program.constant(module, name, value))

    def _attribute(self, node: ast.Attribute, wanted: Shape | None) -> Code:
        owner = self.known(node.value)
        if isinstance(owner, ModuleType) or is_class(owner, IntEnum):
            return self._module_constant(node)
        code = self.code(node.value)
        if node.attr == "T" and arrays.is_array(code.shape) and len(arrays.sizes(code.shape)) == 2:
            return self.calling(arrays.transpose(self.program, code.shape), [code.text])
        for suffix, part in _fields(code.shape):
            if suffix == f".{in_c(node.attr)}":
                return Code(f"{code.within(POSTFIX)}{suffix}", part)
        raise self.fail(node, f"{node.attr} is not a field of {code.shape.word}")

    # Elements

    def _subscript(self, node: ast.Subscript, wanted: Shape | None) -> Code:
        code = self.code(node.value)
        if isinstance(node.slice, ast.Slice):
            return self._cut(node, node.slice, code)
        if not isinstance(node.slice, ast.Tuple):
            return self._element(node, node.slice, code)
        if getattr(code.shape, "made", None) is not Matrix:
            raise self.fail(node, f"two subscripts of {code.shape.word}")
        for place in node.slice.elts:
            if isinstance(place, ast.Slice):
                raise self.fail(node, "a slice of a Matrix: its column j is A.T[j], its row i A[i]")
            code = self._element(node, place, code)
        return code

    def _element(self, node: ast.Subscript, place: ast.expr, code: Code) -> Code:
        parts = code.shape.parts if isinstance(code.shape, Structure) else ()
        key = constant_of(place)
        if key is None and not (isinstance(code.shape, Structure) and code.shape.is_array):
            key = self.size(place)
        if isinstance(key, (float, str)):
            raise self.fail(node, f"there is no element {ast.unparse(place)} here")
        if isinstance(key, int) and key < 0:
            key += len(parts)
        for i, (suffix, part) in enumerate(parts):
            if key == i:
                return Code(f"{code.within(POSTFIX)}{suffix}", part)
        if key is not None:
            raise self.fail(node, f"there is no element {ast.unparse(place)} here")
        if not isinstance(code.shape, Structure) or not code.shape.is_array:
            kinds = {part for _, part in parts}
            what = "something other than a tuple of parts of one type"
            if kinds == {DOUBLE, INTEGER} and not getattr(code.shape, "made", None):
                what = "a tuple of ints and floats: write all of them as floats"
            raise self.fail(node, f"a computed subscript of {what}")
        where = self.integer(place, "a subscript")
        self.made.raises = True
        text = f"{code.within(POSTFIX)}.v[PLACE({where.argument}, {len(parts)})]"
        return Code(text, parts[0][1])

    def _cut(self, node: ast.Subscript, places: ast.Slice, code: Code) -> Code:
        if getattr(code.shape, "made", None) is Matrix:
            raise self.fail(node, "a slice of a Matrix: write Matrix((A[0], A[1]))")
        parts = self._sliced(node, places, code)
        made = vector(len(parts)) if arrays.is_array(code.shape) else None
        return self.literal(made or structure([part.shape for part in parts]), parts)

    def _sliced(self, node: ast.Subscript, places: ast.Slice, code: Code) -> list[Code]:
        """The elements of a constant slice."""
        bounds = [places.lower, places.upper, places.step]
        numbers = [self.size(bound) for bound in bounds]
        known = all(n is not None or bound is None for n, bound in zip(numbers, bounds))
        if not known or not isinstance(code.shape, Structure) or not code.shape.is_array:
            raise self.fail(node, "a slice other than a constant one of a vector or tuple")
        if numbers[2] == 0:
            raise self.fail(node, "a slice with a step of 0")
        if not is_dotted_name(node.value):
            raise self.fail(node, "a slice of something that has no name")
        parts = self.parts(node, code)[slice(*numbers)]
        if not parts:
            raise self.fail(node, "a slice without elements")
        return parts

    # Tuples

    def _tuple(self, node: ast.Tuple, wanted: Shape | None) -> Code:
        is_tuple = isinstance(wanted, Structure) and not wanted.made
        shapes = [part for _, part in wanted.parts] if is_tuple else []  # type: ignore[union-attr]
        codes = self.elements(node.elts, shapes)
        shape = wanted if shapes else structure([code.shape for code in codes])
        assert isinstance(shape, Structure)
        if len(codes) != len(shape.parts):
            raise self.fail(node, f"{len(codes)} values for {len(shape.parts)}")
        return self.literal(shape, codes)

    def elements(self, nodes: Sequence[ast.expr], shapes: Sequence[Shape]) -> list[Code]:
        """Expressions, of which those with a star stand for their elements."""
        codes: list[Code] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                parts = self._unpacked(node.value)
                wanted = [*shapes[len(codes) :], *[None] * len(parts)]
                codes += [self.fit(node, *one) for one in zip(parts, wanted)]
            else:
                wanted = [*shapes[len(codes) :], None]
                codes.append(self.fitting(node, wanted[0]))
        return codes

    def _unpacked(self, node: ast.expr) -> list[Code]:
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice):
            return self._sliced(node, node.slice, self.code(node.value))
        if not is_dotted_name(node):
            raise self.fail(node, "a star before something that has no name")
        return self.parts(node, self.code(node))

    def literal(self, shape: Structure, codes: Sequence[Code]) -> Code:
        """A structure with these values."""
        self.program.defined(shape)
        texts = [code.literal or code.text for code in codes]
        if shape.is_array:
            values = f"{{{{{', '.join(texts)}}}}}"
        else:
            names = [suffix for suffix, _ in shape.parts]
            filled = [f"{name} = {text}" for name, text in zip(names, texts)]
            values = f"{{{', '.join(filled) or '0'}}}"
        return Code(f"({shape.name}){values}", shape, literal=values)


def _fields(shape: Shape) -> Sequence[tuple[str, Shape]]:
    """The fields of a NamedTuple."""
    is_record = isinstance(shape, Structure) and hasattr(shape.made, "_fields")
    return shape.parts if is_record else ()  # type: ignore[union-attr]
