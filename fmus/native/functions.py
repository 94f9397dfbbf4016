"""Functions of the language of equations in C."""

from __future__ import annotations

import ast
import inspect
import io
import math
import sys
import textwrap
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, get_type_hints

from fmus.native.language import foreign
from fmus.native.layout import INDENT, WIDTH, laid_out
from fmus.native.shapes import (
    DOUBLE,
    INTEGER,
    TEXT,
    Shape,
    Structure,
    declaration,
    inner,
    plain,
    shape_of,
    structure,
)
from fmus.ports.port import Refusal

#: How tightly the operators of C bind.
_TERNARY, _OR, _AND, _EQUALITY, _RELATION, _SUM, _PRODUCT, _UNARY, _POSTFIX = range(9)

_BINARY = {ast.Add: ("+", _SUM), ast.Sub: ("-", _SUM), ast.Mult: ("*", _PRODUCT)}
_COMPARE = {
    ast.Lt: ("<", _RELATION), ast.LtE: ("<=", _RELATION), ast.Gt: (">", _RELATION),
    ast.GtE: (">=", _RELATION), ast.Eq: ("==", _EQUALITY), ast.NotEq: ("!=", _EQUALITY),
}  # fmt: skip

#: Functions that never raise, and those of arithmetic.h for the others.
_PLAIN = {math.atan2: "atan2", math.copysign: "copysign", math.tanh: "tanh", abs: "fabs"}
_RAISING = {
    math.asin: "ASIN", math.cos: "COS", math.exp: "EXP", math.log: "LOG", math.log1p: "LOG1P",
    math.sin: "SIN", math.sqrt: "SQRT",
}  # fmt: skip


class Untranslatable(Exception):
    """Something has no counterpart in C; the text says what, and where."""


class Code(NamedTuple):
    """An expression in C."""

    text: str
    shape: Shape
    binding: int = _POSTFIX

    def within(self, binding: int) -> str:
        """The text as an operand of what binds so tightly."""
        return self.text if self.binding >= binding else f"({self.text})"


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
        structures, constants, functions: their texts, each behind what it needs.

    """

    def __init__(self) -> None:
        """Begin with nothing."""
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

    def constant(self, name: str, value: Any) -> Code:
        """A number or a tuple of numbers that stands in a module."""
        if isinstance(value, tuple):
            shape: Shape = self.defined(structure([DOUBLE] * len(value)))
            text = "{{" + ", ".join(repr(float(x)) for x in value) + "}}"
        elif type(value) in (float, int):
            shape = DOUBLE if type(value) is float else INTEGER
            text = repr(value)
        else:
            raise Untranslatable(f"{name} is no number")
        self.constants.setdefault(name, f"static const {shape.name} {name} = {text};")
        return Code(name, shape)

    def function(self, function: FunctionType) -> Function:
        """A function in C, behind those that it calls."""
        if function not in self.functions:
            if function in self._begun:
                raise Untranslatable(f"{function.__name__} calls itself")
            self._begun.add(function)
            self.functions[function] = _Translation(self, function).done()
        return self.functions[function]


def c_name(module: str, name: str) -> str:
    """The name of something in C: those of several modules stand side by side there."""
    return f"{module.rsplit('.', maxsplit=1)[-1]}_{name.lstrip('_')}"


@cache
def _comments(path: str) -> dict[int, str]:
    """The comments of a file behind code, by line."""
    text = Path(path).read_text(encoding="utf-8")
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {
        token.start[0]: token.string.lstrip("#: ")
        for token in tokens
        if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip()
    }


@cache
def _checked(path: str) -> ast.Module:
    """The tree of a module that is in the language."""
    for one in foreign(Path(path)):
        raise Untranslatable(str(one))
    return ast.parse(Path(path).read_text(encoding="utf-8"))


class _Translation:
    """One function on its way to C."""

    def __init__(self, program: Program, function: FunctionType) -> None:
        self._program, self._globals = program, function.__globals__
        self._path = str(inspect.getsourcefile(function))
        [self._tree] = [
            node
            for node in _checked(self._path).body
            if isinstance(node, ast.FunctionDef) and node.name == function.__name__
        ]
        hints = get_type_hints(function)
        returns = hints.pop("return")
        self._locals = {name: program.shape(kind) for name, kind in hints.items()}
        returned = None if returns is type(None) else program.shape(returns)
        self._made = Function(
            c_name(function.__module__, function.__name__), dict(self._locals), returned
        )
        names = [n for n in ast.walk(self._tree) if isinstance(n, ast.Name)]
        self._names = {name.id for name in names}
        self._assigned = Counter(n.id for n in names if isinstance(n.ctx, ast.Store))
        self._scopes = [set(self._locals)]

    def done(self) -> Function:
        """The function with its text."""
        made = self._made
        body = list(self._block(self._tree.body, INDENT, new=False))
        arguments = [f"{_declared(shape)}{name}" for name, shape in made.arguments.items()]
        if made.raises:
            arguments.append("Error *error")
        returned = "void" if made.returns is None else made.returns.name
        head = f"static {returned} {made.name}({', '.join(arguments) or 'void'}) {{"
        lines = [*_comment(ast.get_docstring(self._tree)), *laid_out(head, ""), *body, "}"]
        made.text = "\n".join(lines)
        return made

    def _fail(self, node: ast.AST, what: str) -> Untranslatable:
        return Untranslatable(f"{self._path}:{getattr(node, 'lineno', 0)}: {what}")

    # Statements

    def _block(self, statements: list[ast.stmt], indent: str, new: bool = True) -> Iterator[str]:
        if new:
            self._scopes.append(set())
        for statement in statements:
            lines = [line for text in self._statement(statement, indent) for line in text]
            about = _comments(self._path).get(statement.end_lineno or 0)
            if about and lines and not isinstance(statement, (ast.If, ast.While)):
                lines = _annotated(lines, f"/* {about} */", indent)
            yield from lines
        if new:
            self._scopes.pop()

    def _statement(self, node: ast.stmt, indent: str) -> Iterator[list[str]]:
        if isinstance(node, ast.Return) and node.value is not None:
            yield laid_out(
                f"return {self._expression(node.value, self._made.returns).text};", indent
            )
        elif isinstance(node, ast.Assign):
            for text in self._assignment(node.targets[0], node.value):
                yield laid_out(text, indent)
        elif isinstance(node, ast.AugAssign):
            target = ast.Name(ast.unparse(node.target), ast.Load(), lineno=node.lineno)
            changed = ast.BinOp(target, node.op, node.value, lineno=node.lineno)
            yield laid_out(f"{target.id} = {self._expression(changed).text};", indent)
        elif isinstance(node, ast.If):
            yield laid_out(f"if ({self._condition(node.test).text}) {{", indent)
            yield list(self._block(node.body, indent + INDENT))
            if node.orelse:
                yield [f"{indent}}} else {{"]
                yield list(self._block(node.orelse, indent + INDENT))
            yield [f"{indent}}}"]
        elif isinstance(node, ast.While):
            yield laid_out(f"while ({self._condition(node.test).text}) {{", indent)
            yield list(self._block(node.body, indent + INDENT))
            if self._made.raises:
                yield [f"{indent}{INDENT}if (error->raised) break;"]
            yield [f"{indent}}}"]
        elif isinstance(node, ast.Raise):
            yield laid_out(self._raised(node), indent)
            if self._made.returns is not None:
                yield [f"{indent}return {_zero(self._made.returns)};"]
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield laid_out(f"{self._expression(node.value).text};", indent)

    def _assignment(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        if isinstance(target, ast.Name):
            code = self._expression(value, self._locals.get(target.id))
            yield self._stored([(target.id, code)])
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts))
            if all(isinstance(one, ast.Name) for one, _ in pairs):
                codes = [(ast.unparse(one), self._expression(other)) for one, other in pairs]
                for alike in _alike(codes):
                    yield self._stored(alike)
            else:
                for one, other in pairs:
                    yield from self._assignment(one, other)
        else:
            code = self._expression(value)
            if not _is_path(value):
                name = self._name_of_all(target, value)
                yield self._stored([(name, code)])
                code = Code(name, code.shape)
            for alike in _alike(list(self._taken_apart(target, code))):
                yield self._stored(alike)

    def _name_of_all(self, target: ast.expr, value: ast.expr) -> str:
        """A name for what is taken apart: that of the function it comes from."""
        name = ast.unparse(value.func).rsplit(".")[-1] if isinstance(value, ast.Call) else "all"
        first = next(n.id for n in ast.walk(target) if isinstance(n, ast.Name) and n.id != "_")
        taken = name in self._locals or name in self._names
        return f"{name}_{first}" if taken else name.lstrip("_")

    def _taken_apart(self, target: ast.expr, code: Code) -> Iterator[tuple[str, Code]]:
        if isinstance(target, ast.Name):
            if target.id != "_":
                yield target.id, code
            return
        assert isinstance(target, ast.Tuple)
        parts = self._parts(target, code)
        if len(parts) != len(target.elts):
            raise self._fail(target, f"{len(target.elts)} names for {len(parts)} values")
        for one, part in zip(target.elts, parts):
            yield from self._taken_apart(one, part)

    def _parts(self, node: ast.AST, code: Code) -> list[Code]:
        if not isinstance(code.shape, Structure):
            raise self._fail(node, "a number is taken apart")
        return [Code(f"{code.text}{suffix}", part) for suffix, part in code.shape.parts]

    def _stored(self, values: list[tuple[str, Code]]) -> str:
        """The assignment of values of one type, to names that are new or not."""
        texts = ", ".join(f"{name} = {code.text}" for name, code in values)
        if any(name in scope for name, _ in values for scope in self._scopes):
            return texts.replace(", ", "; ") + ";" if len(values) > 1 else f"{texts};"
        shape = values[0][1].shape
        for name, code in values:
            self._scopes[-1].add(name)
            self._locals[name] = self._program.defined(code.shape)
        changes = any(self._assigned[name] > 1 for name, _ in values)
        return f"{'' if changes else 'const '}{_declared(shape)}{texts};"

    def _raised(self, node: ast.Raise) -> str:
        assert isinstance(node.exc, ast.Call)
        self._made.raises = True
        kind, text = self._known(node.exc.func), node.exc.args[0]
        form = "" if kind is Refusal else f"{kind.__name__}: "
        arguments = []
        for part in text.values if isinstance(text, ast.JoinedStr) else [text]:
            if isinstance(part, ast.FormattedValue):
                code = self._expression(part.value)
                how = "".join(ast.literal_eval(x) for x in getattr(part.format_spec, "values", ()))
                form += "%s" if code.shape == TEXT else f"%{how}"
                arguments.append(f"shown({code.text})" if code.shape == DOUBLE else code.text)
            else:
                form += str(ast.literal_eval(part)).replace("%", "%%")
        quoted = '"' + form.replace("\\", "\\\\").replace('"', '\\"') + '"'
        return f"raise_error({', '.join(['error', quoted, *arguments])});"

    # Expressions

    def _known(self, node: ast.expr) -> Any:
        """What a name of a module stands for; None: it is a local one, or an expression."""
        if isinstance(node, ast.Name) and node.id not in self._locals:
            return self._globals.get(node.id, {"abs": abs}.get(node.id))
        if isinstance(node, ast.Attribute):
            owner = self._known(node.value)
            if isinstance(owner, ModuleType):
                return getattr(owner, node.attr)
        return None

    def _expression(self, node: ast.expr, wanted: Shape | None = None) -> Code:
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
        if node.id in self._locals:
            return Code(node.id, self._locals[node.id])
        return self._module_constant(node)

    def _module_constant(self, node: ast.expr) -> Code:
        name = node.id if isinstance(node, ast.Name) else ast.unparse(node).rsplit(".")[-1]
        value = self._known(node)
        # A constant bears the name of the module that it stands in, wherever it was imported.
        home = _home(self._globals["__name__"], name)
        try:
            return self._program.constant(c_name(home, name), value)
        except Untranslatable as error:
            raise self._fail(node, str(error)) from None

    def _attribute(self, node: ast.Attribute, wanted: Shape | None) -> Code:
        if self._known(node.value) is not None:
            return self._module_constant(node)
        code = self._expression(node.value)
        for suffix, part in code.shape.parts if isinstance(code.shape, Structure) else ():
            if suffix == f".{node.attr}":
                return Code(f"{code.within(_POSTFIX)}{suffix}", part)
        raise self._fail(node, f"{node.attr} is no field here")

    def _subscript(self, node: ast.Subscript, wanted: Shape | None) -> Code:
        code, key = self._expression(node.value), ast.literal_eval(node.slice)
        for i, (suffix, part) in enumerate(getattr(code.shape, "parts", ())):
            if key in (i, suffix[1:]):
                return Code(f"{code.within(_POSTFIX)}{suffix}", part)
        raise self._fail(node, f"there is no element {key!r} here")

    def _binop(self, node: ast.BinOp, wanted: Shape | None) -> Code:
        left, right = self._alike(node.left, node.right, wanted)
        if isinstance(node.op, ast.Div):
            if DOUBLE not in (left.shape, right.shape):
                raise self._fail(node, "a division of whole numbers")
            if isinstance(node.right, ast.Constant) and node.right.value:
                return Code(f"{left.within(_PRODUCT)} / {right.text}", DOUBLE, _PRODUCT)
            self._made.raises = True
            return Code(f"DIV({left.text}, {right.text})", DOUBLE)
        sign, binding = _BINARY[type(node.op)]
        shape = DOUBLE if DOUBLE in (left.shape, right.shape) else INTEGER
        text = f"{left.within(binding)} {sign} {right.within(binding + 1)}"
        return Code(text, shape, binding)

    def _alike(
        self, left: ast.expr, right: ast.expr, wanted: Shape | None = None
    ) -> tuple[Code, Code]:
        """Two operands; whole numbers that are written beside a double become one."""
        one, other = self._expression(left, wanted), self._expression(right, wanted)
        if DOUBLE in (one.shape, other.shape):
            return self._expression(left, DOUBLE), self._expression(right, DOUBLE)
        return one, other

    def _unaryop(self, node: ast.UnaryOp, wanted: Shape | None) -> Code:
        if isinstance(node.op, ast.Not):
            operand = self._expression(node.operand)
            if operand.shape == DOUBLE:
                return Code(f"{operand.within(_RELATION)} == 0.0", INTEGER, _EQUALITY)
            return Code(f"!{operand.within(_UNARY)}", INTEGER, _UNARY)
        operand = self._expression(node.operand, wanted)
        return Code(f"-{operand.within(_POSTFIX)}", operand.shape, _UNARY)

    def _condition(self, node: ast.expr) -> Code:
        """An expression as a truth value."""
        code = self._expression(node)
        if code.shape == DOUBLE:
            return Code(f"{code.within(_RELATION)} != 0.0", INTEGER, _EQUALITY)
        return code

    def _boolop(self, node: ast.BoolOp, wanted: Shape | None) -> Code:
        sign, binding = ("||", _OR) if isinstance(node.op, ast.Or) else ("&&", _AND)
        # Compilers want brackets around one kind of them within the other.
        texts = [self._condition(value).within(_EQUALITY) for value in node.values]
        return Code(f" {sign} ".join(texts), INTEGER, binding)

    def _compare(self, node: ast.Compare, wanted: Shape | None) -> Code:
        operands = [node.left, *node.comparators]
        if not all(map(_is_path, operands[1:-1])):
            raise self._fail(node, "what stands between two comparisons must be a name")
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
        condition = self._condition(node.test).within(_OR)
        one, other = self._expression(node.body, wanted), self._expression(node.orelse, wanted)
        text = f"{condition} ? {one.within(_OR)} : {other.text}"
        return Code(text, one.shape, _TERNARY)

    def _tuple(self, node: ast.Tuple, wanted: Shape | None) -> Code:
        shapes = [part for _, part in wanted.parts] if isinstance(wanted, Structure) else []
        codes = self._elements(node.elts, shapes)
        shape = wanted if shapes else structure([code.shape for code in codes])
        assert isinstance(shape, Structure)
        self._program.defined(shape)
        if len(codes) != len(shape.parts):
            raise self._fail(node, f"{len(codes)} values for {len(shape.parts)}")
        return Code(_literal(shape, codes), shape)

    def _elements(self, nodes: list[ast.expr], shapes: list[Shape]) -> list[Code]:
        """Expressions, of which those with a star stand for their elements."""
        codes: list[Code] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                if not _is_path(node.value):
                    raise self._fail(node, "a star before something that has no name")
                codes += self._parts(node, self._expression(node.value))
            else:
                wanted = shapes[len(codes)] if len(codes) < len(shapes) else None
                codes.append(self._expression(node, wanted))
        return codes

    def _dict(self, node: ast.Dict, wanted: Shape | None) -> Code:
        if not isinstance(wanted, Structure):
            raise self._fail(node, "a dict that is no result")
        given = {ast.literal_eval(k): v for k, v in zip(node.keys, node.values) if k is not None}
        codes = [self._expression(given[suffix[1:]], part) for suffix, part in wanted.parts]
        return Code(_literal(wanted, codes), wanted)

    def _call(self, node: ast.Call, wanted: Shape | None) -> Code:
        called = self._known(node.func)
        if called in _PLAIN or called in _RAISING:
            texts = [self._expression(argument, DOUBLE).text for argument in node.args]
            self._made.raises |= called in _RAISING
            return Code(f"{(_PLAIN | _RAISING)[called]}({', '.join(texts)})", DOUBLE)
        if called is math.degrees:
            factor = Code(repr(math.degrees(1.0)), DOUBLE)
            operand = self._expression(node.args[0], DOUBLE)
            return Code(f"{operand.within(_PRODUCT)} * {factor.text}", DOUBLE, _PRODUCT)
        if isinstance(called, type):
            shape = self._program.shape(called)
            assert isinstance(shape, Structure)
            codes = self._elements(node.args, [part for _, part in shape.parts])
            if len(codes) != len(shape.parts):
                raise self._fail(node, f"{len(codes)} values for {len(shape.parts)} fields")
            return Code(_literal(shape, codes), shape)
        if not isinstance(called, FunctionType):
            raise self._fail(node, f"{ast.unparse(node.func)} is no function of equations")
        function = self._program.function(called)
        codes = self._elements(node.args, list(function.arguments.values()))
        if [code.shape for code in codes] != list(function.arguments.values()):
            raise self._fail(node, f"other arguments than those of {function.name}")
        self._made.raises |= function.raises
        # What returns nothing is a statement of its own.
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


def _zero(shape: Shape) -> str:
    return f"({shape.name}){{0}}" if isinstance(shape, Structure) else "0"


def _declared(shape: Shape) -> str:
    """A type before a name."""
    return shape.name if shape.name.endswith("*") else f"{shape.name} "


def _is_path(node: ast.expr) -> bool:
    """Whether an expression is a name, or a part of one."""
    if isinstance(node, (ast.Attribute, ast.Subscript)):
        return _is_path(node.value)
    return isinstance(node, (ast.Name, ast.Constant))


def _alike(values: list[tuple[str, Code]]) -> Iterator[list[tuple[str, Code]]]:
    """Neighbours of one type."""
    group: list[tuple[str, Code]] = []
    for value in values:
        if group and group[0][1].shape != value[1].shape:
            yield group
            group = []
        group.append(value)
    if group:
        yield group


def _annotated(lines: list[str], comment: str, indent: str) -> list[str]:
    """Lines with a comment at the end, or before them."""
    if len(lines) == 1 and len(lines[0]) + 1 + len(comment) <= WIDTH:
        return [f"{lines[0]} {comment}"]
    return [f"{indent}{comment}", *lines]


def _comment(docstring: str | None) -> list[str]:
    if not docstring:
        return []
    lines = plain(textwrap.dedent(docstring)).rstrip().splitlines()
    if len(lines) == 1:
        return [f"/* {lines[0]} */"]
    return [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]
