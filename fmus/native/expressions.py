"""Expressions of the language of equations in C."""

from __future__ import annotations

import ast
import inspect
import math
import sys
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from fmus.native.program import (
    DOUBLE,
    INTEGER,
    TEXT,
    Function,
    Program,
    Shape,
    Structure,
    Untranslatable,
    c_name,
    structure,
)

#: How tightly the operators of C bind.
_TERNARY, _OR, _AND, _EQUALITY, _RELATION, _SUM, _PRODUCT, _UNARY, _POSTFIX = range(9)

_BINARY = {ast.Add: ("+", _SUM), ast.Sub: ("-", _SUM), ast.Mult: ("*", _PRODUCT)}
_COMPARE = {
    ast.Lt: ("<", _RELATION), ast.LtE: ("<=", _RELATION), ast.Gt: (">", _RELATION),
    ast.GtE: (">=", _RELATION), ast.Eq: ("==", _EQUALITY), ast.NotEq: ("!=", _EQUALITY),
}  # fmt: skip

#: Functions that never raise, and arithmetic.h's for the others.
_PLAIN = {
    math.atan: "atan", math.atan2: "atan2", math.copysign: "copysign", math.tanh: "tanh",
    abs: "fabs",
}  # fmt: skip
_RAISING = {
    math.asin: "ASIN", math.cos: "COS", math.exp: "EXP", math.expm1: "EXPM1", math.log: "LOG",
    math.log1p: "LOG1P", math.sin: "SIN", math.sqrt: "SQRT",
}  # fmt: skip


class Code(NamedTuple):
    """An expression in C."""

    text: str
    shape: Shape
    binding: int = _POSTFIX

    def within(self, binding: int) -> str:
        """The text as an operand of what binds so tightly."""
        return self.text if self.binding >= binding else f"({self.text})"


class Expressions:
    """Translates the expressions of one function.

    Attributes:
        made: the function, of which it notes whether it raises.
        local: shapes of its arguments and variables.

    """

    def __init__(self, program: Program, path: str, scope: dict[str, Any], made: Function) -> None:
        """Begin with the arguments.

        Args:
            program: that the function belongs to.
            path: of its module.
            scope: of its module.
            made: the function in C.

        """
        self.made, self.local = made, dict(made.arguments)
        self._program, self._path, self._scope = program, path, scope

    def fail(self, node: ast.AST, what: str) -> Untranslatable:
        """What to raise, with the line."""
        return Untranslatable(f"{self._path}:{getattr(node, 'lineno', 0)}: {what}")

    def parts(self, node: ast.AST, code: Code) -> list[Code]:
        """The elements of a tuple that has a name."""
        if not isinstance(code.shape, Structure):
            raise self.fail(node, "a number is taken apart")
        return [Code(f"{code.text}{suffix}", part) for suffix, part in code.shape.parts]

    def known(self, node: ast.expr) -> Any:
        """What a name of a module stands for; None: it is a local one, or an expression."""
        if isinstance(node, ast.Name) and node.id not in self.local:
            return self._scope.get(node.id, {"abs": abs}.get(node.id))
        if isinstance(node, ast.Attribute):
            owner = self.known(node.value)
            if isinstance(owner, ModuleType):
                return getattr(owner, node.attr)
        return None

    def code(self, node: ast.expr, wanted: Shape | None = None) -> Code:
        """An expression in C, of a shape if there is a choice.

        Raises:
            Untranslatable: it has no counterpart.

        """
        method: Callable[[Any, Shape | None], Code]
        method = getattr(self, f"_{type(node).__name__.lower()}")
        return method(node, wanted)

    def _constant(self, node: ast.Constant, wanted: Shape | None) -> Code:
        value: Any = node.value
        if isinstance(value, str):
            return Code(f'"{value}"', TEXT)
        if type(value) is float or wanted == DOUBLE:
            return Code(repr(float(value)), DOUBLE)
        return Code(str(int(value)), INTEGER)

    def _name(self, node: ast.Name, wanted: Shape | None) -> Code:
        if node.id in self.local:
            return Code(node.id, self.local[node.id])
        return self._module_constant(node)

    def _module_constant(self, node: ast.expr) -> Code:
        name = node.id if isinstance(node, ast.Name) else ast.unparse(node).rsplit(".")[-1]
        value = self.known(node)
        # It bears the name of the module that it stands in, wherever it was imported.
        in_c = c_name(_home(self._scope["__name__"], name), name)
        try:
            return Code(in_c, self._program.constant(in_c, value))
        except Untranslatable as error:
            raise self.fail(node, str(error)) from None

    def _attribute(self, node: ast.Attribute, wanted: Shape | None) -> Code:
        if self.known(node.value) is not None:
            return self._module_constant(node)
        code = self.code(node.value)
        for suffix, part in code.shape.parts if isinstance(code.shape, Structure) else ():
            if suffix == f".{node.attr}":
                return Code(f"{code.within(_POSTFIX)}{suffix}", part)
        raise self.fail(node, f"{node.attr} is not a field")

    def _subscript(self, node: ast.Subscript, wanted: Shape | None) -> Code:
        code = self.code(node.value)
        if not isinstance(node.slice, ast.Constant):
            return self._element(node, code)
        key = node.slice.value
        for i, (suffix, part) in enumerate(getattr(code.shape, "parts", ())):
            if key in (i, suffix[1:]):
                return Code(f"{code.within(_POSTFIX)}{suffix}", part)
        raise self.fail(node, f"there is no element {key!r} here")

    def _element(self, node: ast.Subscript, code: Code) -> Code:
        """The element of an array at a place that is computed."""
        place = self.code(node.slice)
        if not isinstance(code.shape, Structure) or not code.shape.is_array:
            raise self.fail(
                node, "a computed subscript of something other than a tuple of parts of one type"
            )
        if place.shape != INTEGER:
            raise self.fail(node, "a subscript that is not a whole number")
        self.made.raises = True
        text = f"{code.within(_POSTFIX)}.v[PLACE({place.text}, {len(code.shape.parts)})]"
        return Code(text, code.shape.parts[0][1])

    def _binop(self, node: ast.BinOp, wanted: Shape | None) -> Code:
        left, right = self._alike(node.left, node.right, wanted)
        if isinstance(node.op, ast.Div):
            if DOUBLE not in (left.shape, right.shape):
                raise self.fail(node, "a division of whole numbers")
            if isinstance(node.right, ast.Constant) and node.right.value:
                return Code(f"{left.within(_PRODUCT)} / {right.text}", DOUBLE, _PRODUCT)
            self.made.raises = True
            return Code(f"DIV({left.text}, {right.text})", DOUBLE)
        sign, binding = _BINARY[type(node.op)]
        shape = DOUBLE if DOUBLE in (left.shape, right.shape) else INTEGER
        text = f"{left.within(binding)} {sign} {right.within(binding + 1)}"
        return Code(text, shape, binding)

    def _alike(
        self, left: ast.expr, right: ast.expr, wanted: Shape | None = None
    ) -> tuple[Code, Code]:
        """Two operands; whole numbers that are written beside a double become one."""
        one, other = self.code(left, wanted), self.code(right, wanted)
        if DOUBLE in (one.shape, other.shape):
            return self.code(left, DOUBLE), self.code(right, DOUBLE)
        return one, other

    def _unaryop(self, node: ast.UnaryOp, wanted: Shape | None) -> Code:
        if isinstance(node.op, ast.Not):
            operand = self.code(node.operand)
            if operand.shape == DOUBLE:
                return Code(f"{operand.within(_RELATION)} == 0.0", INTEGER, _EQUALITY)
            return Code(f"!{operand.within(_UNARY)}", INTEGER, _UNARY)
        operand = self.code(node.operand, wanted)
        return Code(f"-{operand.within(_POSTFIX)}", operand.shape, _UNARY)

    def condition(self, node: ast.expr) -> Code:
        """An expression as a truth value."""
        code = self.code(node)
        if code.shape == DOUBLE:
            return Code(f"{code.within(_RELATION)} != 0.0", INTEGER, _EQUALITY)
        return code

    def _boolop(self, node: ast.BoolOp, wanted: Shape | None) -> Code:
        sign, binding = ("||", _OR) if isinstance(node.op, ast.Or) else ("&&", _AND)
        # Compilers want brackets around one kind of them within the other.
        texts = [self.condition(value).within(_EQUALITY) for value in node.values]
        return Code(f" {sign} ".join(texts), INTEGER, binding)

    def _compare(self, node: ast.Compare, wanted: Shape | None) -> Code:
        operands = [node.left, *node.comparators]
        if not all(map(is_dotted_name, operands[1:-1])):
            raise self.fail(node, "what stands between two comparisons must be a name")
        parts = []
        for operator, left, right in zip(node.ops, operands, operands[1:]):
            sign, binding = _COMPARE[type(operator)]
            one, other = self._alike(left, right)
            parts.append(
                Code(
                    f"{one.within(binding + 1)} {sign} {other.within(binding + 1)}",
                    INTEGER,
                    binding,
                )
            )
        if len(parts) == 1:
            return parts[0]
        return Code(" && ".join(part.text for part in parts), INTEGER, _AND)

    def _ifexp(self, node: ast.IfExp, wanted: Shape | None) -> Code:
        condition = self.condition(node.test).within(_OR)
        one, other = self.code(node.body, wanted), self.code(node.orelse, wanted)
        text = f"{condition} ? {one.within(_OR)} : {other.text}"
        return Code(text, one.shape, _TERNARY)

    def _tuple(self, node: ast.Tuple, wanted: Shape | None) -> Code:
        shapes = [part for _, part in wanted.parts] if isinstance(wanted, Structure) else []
        codes = self._elements(node.elts, shapes)
        shape = wanted if shapes else structure([code.shape for code in codes])
        assert isinstance(shape, Structure)
        self._program.defined(shape)
        if len(codes) != len(shape.parts):
            raise self.fail(node, f"{len(codes)} values for {len(shape.parts)}")
        return Code(_literal(shape, codes), shape)

    def _elements(self, nodes: list[ast.expr], shapes: list[Shape]) -> list[Code]:
        """Expressions, of which those with a star stand for their elements."""
        codes: list[Code] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                if not is_dotted_name(node.value):
                    raise self.fail(node, "a star before something that has no name")
                codes += self.parts(node, self.code(node.value))
            else:
                wanted = shapes[len(codes)] if len(codes) < len(shapes) else None
                codes.append(self.code(node, wanted))
        return codes

    def _dict(self, node: ast.Dict, wanted: Shape | None) -> Code:
        if not isinstance(wanted, Structure):
            raise self.fail(node, "a dict that is not a result")
        given = {ast.literal_eval(k): v for k, v in zip(node.keys, node.values) if k is not None}
        codes = [self.code(given[suffix[1:]], part) for suffix, part in wanted.parts]
        return Code(_literal(wanted, codes), wanted)

    def _call(self, node: ast.Call, wanted: Shape | None) -> Code:
        called = self.known(node.func)
        if called in _PLAIN or called in _RAISING:
            texts = [self.code(argument, DOUBLE).text for argument in node.args]
            self.made.raises |= called in _RAISING
            return Code(f"{(_PLAIN | _RAISING)[called]}({', '.join(texts)})", DOUBLE)
        if called is math.degrees:
            factor = Code(repr(math.degrees(1.0)), DOUBLE)
            operand = self.code(node.args[0], DOUBLE)
            return Code(f"{operand.within(_PRODUCT)} * {factor.text}", DOUBLE, _PRODUCT)
        if isinstance(called, type):
            shape = self._program.shape(called)
            assert isinstance(shape, Structure)
            codes = self._elements(node.args, [part for _, part in shape.parts])
            if len(codes) != len(shape.parts):
                raise self.fail(node, f"{len(codes)} values for {len(shape.parts)} fields")
            return Code(_literal(shape, codes), shape)
        if not isinstance(called, FunctionType):
            raise self.fail(node, f"{ast.unparse(node.func)} is not a function of equations")
        function = self._program.function(called)
        codes = self._elements(node.args, list(function.arguments.values()))
        if [code.shape for code in codes] != list(function.arguments.values()):
            raise self.fail(node, f"arguments that do not match {function.name}")
        self.made.raises |= function.raises
        # A call that returns nothing is a statement.
        return Code(function.call([code.text for code in codes]), function.returns or INTEGER)


def _home(module: str, name: str) -> str:
    """The module that a constant was defined in, seen from one that uses it."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    for node in tree.body:
        names = [alias.name for alias in node.names] if isinstance(node, ast.ImportFrom) else []
        if name in names:
            return _home(str(node.module), name)  # type: ignore[attr-defined]
    return module


def _literal(shape: Structure, codes: list[Code]) -> str:
    """A structure with these values."""
    texts = [_initializer(code) for code in codes]
    if shape.is_array:
        return f"({shape.name}){{{{{', '.join(texts)}}}}}"
    names = [suffix for suffix, _ in shape.parts]
    filled = [f"{name} = {text}" for name, text in zip(names, texts)]
    return f"({shape.name}){{{', '.join(filled) or '0'}}}"


def _initializer(code: Code) -> str:
    """An expression within a literal, which says its type."""
    prefix = f"({code.shape.name}){{"
    return code.text[len(prefix) - 1 :] if code.text.startswith(prefix) else code.text


def is_dotted_name(node: ast.expr) -> bool:
    """Whether an expression is a name, or a part of one."""
    if isinstance(node, (ast.Attribute, ast.Subscript)):
        return is_dotted_name(node.value)
    return isinstance(node, (ast.Name, ast.Constant))
