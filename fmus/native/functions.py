"""Functions of the language of equations in C: their statements, and how these are laid out."""

from __future__ import annotations

import ast
import inspect
import io
import re
import textwrap
import tokenize
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import get_type_hints

from fmus.native.expressions import Code, Expressions, is_dotted_name
from fmus.native.language import foreign
from fmus.native.program import (
    DOUBLE,
    TEXT,
    Function,
    Program,
    Shape,
    Structure,
    Untranslatable,
    c_name,
    strip_sphinx_marks,
)
from fmus.ports.port import Refusal

LINE_WIDTH = 98
INDENT = "    "

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')

#: Spaces that no line is broken at.
_UNBROKEN = re.compile(r"(?<!,) (?!(?:[-+?:]|&&|\|\|) )")

#: What stands for a space that no line is broken at, and for brackets and commas that are text.
_KEPT = str.maketrans(" (){},", "\x01\x02\x03\x04\x05\x06")
_BACK = str.maketrans("\x01\x02\x03\x04\x05\x06", " (){},")


def laid_out(text: str, indent: str) -> list[str]:
    """A statement as lines."""
    protected = _STRINGS.sub(lambda string: string.group().translate(_KEPT), text)
    return [line.translate(_BACK) for line in _lines(protected, indent)]


def _lines(text: str, indent: str) -> list[str]:
    if len(indent) + len(text) <= LINE_WIDTH:
        return [indent + text]
    start, end = _widest(text)
    # Inside of a short bracket there is nothing to gain.
    if end - start < len(text) // 2 or "{" not in text[start:end]:
        return _wrapped(text, indent)
    # Two of them around the same are opened as one.
    while text[start + 1] == "{" and _closing(text, start + 1) == end - 1:
        start, end = start + 1, end - 1
    *items, last = _split(text[start + 1 : end])
    after = [f"{last},", text[end:]] if text[start] == "{" else [f"{last}{text[end:]}"]
    lines = [indent + text[: start + 1]]
    for item in (*(f"{item}," for item in items), after[0]):
        lines += _lines(item, indent + INDENT)
    return lines + [indent + closing for closing in after[1:]]


def _wrapped(text: str, indent: str) -> list[str]:
    """Lines that end after commas and before operators."""
    wrapper = textwrap.TextWrapper(
        LINE_WIDTH,
        initial_indent=indent,
        subsequent_indent=indent + INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return wrapper.wrap(_UNBROKEN.sub("\x01", text))


def _closing(text: str, start: int) -> int:
    """Where a bracket is closed; its own place if it is not."""
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] in "({") - (text[i] in ")}")
        if depth == 0:
            return i
    return start


def _widest(text: str) -> tuple[int, int]:
    """The outermost pair of brackets that holds the most."""
    spans, i = [(0, 0)], 0
    while i < len(text):
        if text[i] in "({":
            spans.append((i, _closing(text, i)))
            i = spans[-1][1]
        i += 1
    return max(spans, key=lambda span: span[1] - span[0])


def _split(text: str) -> list[str]:
    """The items of a list, at the commas that are in no bracket."""
    items, depth, start = [], 0, 0
    for i, character in enumerate(text):
        depth += (character in "({") - (character in ")}")
        if character == "," and depth == 0:
            items.append(text[start:i].strip())
            start = i + 1
    return [*items, text[start:].strip()]


@cache
def _comments(path: str) -> dict[int, str]:
    """The comments of a file after code, by line."""
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
        raise Untranslatable(one)
    return ast.parse(Path(path).read_text(encoding="utf-8"))


def function_in_c(program: Program, function: FunctionType) -> Function:
    """A function of equations in C.

    Args:
        program: that gets the functions and structures that it needs.
        function: whose module is in the language.

    Raises:
        Untranslatable: it has no counterpart.

    """
    return _Translation(program, function).done()


class _Translation:
    """One function on its way to C."""

    def __init__(self, program: Program, function: FunctionType) -> None:
        self._program, self._path = program, str(inspect.getsourcefile(function))
        [self._tree] = [
            node
            for node in _checked(self._path).body
            if isinstance(node, ast.FunctionDef) and node.name == function.__name__
        ]
        hints = get_type_hints(function)
        returns = hints.pop("return")
        self._made = Function(
            c_name(function.__module__, function.__name__),
            {name: program.shape(hint) for name, hint in hints.items()},
            None if returns is type(None) else program.shape(returns),
        )
        self._in_c = Expressions(program, self._path, function.__globals__, self._made)
        names = [n for n in ast.walk(self._tree) if isinstance(n, ast.Name)]
        self._names = {name.id for name in names}
        self._assigned = Counter(n.id for n in names if isinstance(n.ctx, ast.Store))
        self._scopes = [set(self._made.arguments)]

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
                f"return {self._in_c.code(node.value, self._made.returns).text};", indent
            )
        elif isinstance(node, ast.Assign):
            for text in self._assignment(node.targets[0], node.value):
                yield laid_out(text, indent)
        elif isinstance(node, ast.AugAssign):
            target = ast.Name(ast.unparse(node.target), ast.Load(), lineno=node.lineno)
            changed = ast.BinOp(target, node.op, node.value, lineno=node.lineno)
            yield laid_out(f"{target.id} = {self._in_c.code(changed).text};", indent)
        elif isinstance(node, ast.If):
            yield laid_out(f"if ({self._in_c.condition(node.test).text}) {{", indent)
            yield list(self._block(node.body, indent + INDENT))
            if node.orelse:
                yield [f"{indent}}} else {{"]
                yield list(self._block(node.orelse, indent + INDENT))
            yield [f"{indent}}}"]
        elif isinstance(node, ast.While):
            yield laid_out(f"while ({self._in_c.condition(node.test).text}) {{", indent)
            yield list(self._block(node.body, indent + INDENT))
            if self._made.raises:
                yield [f"{indent}{INDENT}if (error->raised) break;"]
            yield [f"{indent}}}"]
        elif isinstance(node, ast.Raise):
            yield laid_out(self._raised(node), indent)
            if self._made.returns is not None:
                yield [f"{indent}return {_zero(self._made.returns)};"]
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield laid_out(f"{self._in_c.code(node.value).text};", indent)

    def _assignment(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        if isinstance(target, ast.Name):
            code = self._in_c.code(value, self._in_c.local.get(target.id))
            yield self._stored([(target.id, code)])
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            # Python computes all values first, C stores one after the other.
            for name in sorted(_names(target) & _names(value)):
                raise self._in_c.fail(target, f"{name} is given and used in one assignment")
            pairs = list(zip(target.elts, value.elts))
            if all(isinstance(one, ast.Name) for one, _ in pairs):
                codes = [(ast.unparse(one), self._in_c.code(other)) for one, other in pairs]
                for alike in _alike(codes):
                    yield self._stored(alike)
            else:
                for one, other in pairs:
                    yield from self._assignment(one, other)
        else:
            code = self._in_c.code(value)
            if not is_dotted_name(value):
                name = self._name_of_all(target, value)
                yield self._stored([(name, code)])
                code = Code(name, code.shape)
            for alike in _alike(list(self._taken_apart(target, code))):
                yield self._stored(alike)

    def _name_of_all(self, target: ast.expr, value: ast.expr) -> str:
        """A name for what is taken apart: the name of the function it comes from."""
        name = ast.unparse(value.func).rsplit(".")[-1] if isinstance(value, ast.Call) else "all"
        first = next(n.id for n in ast.walk(target) if isinstance(n, ast.Name) and n.id != "_")
        taken = name in self._in_c.local or name in self._names
        return f"{name}_{first}" if taken else name.lstrip("_")

    def _taken_apart(self, target: ast.expr, code: Code) -> Iterator[tuple[str, Code]]:
        if isinstance(target, ast.Name):
            if target.id != "_":
                yield target.id, code
            return
        assert isinstance(target, ast.Tuple)
        parts = self._in_c.parts(target, code)
        if len(parts) != len(target.elts):
            raise self._in_c.fail(target, f"{len(target.elts)} names for {len(parts)} values")
        for one, part in zip(target.elts, parts):
            yield from self._taken_apart(one, part)

    def _stored(self, values: list[tuple[str, Code]]) -> str:
        """The assignment of values of one type, to names that are new or not."""
        stores = [f"{name} = {code.text}" for name, code in values]
        if any(name in scope for name, _ in values for scope in self._scopes):
            return "; ".join(stores) + ";"
        shape = values[0][1].shape
        for name, code in values:
            self._scopes[-1].add(name)
            self._in_c.local[name] = self._program.defined(code.shape)
        changes = any(self._assigned[name] > 1 for name, _ in values)
        return f"{'' if changes else 'const '}{_declared(shape)}{', '.join(stores)};"

    def _raised(self, node: ast.Raise) -> str:
        assert isinstance(node.exc, ast.Call)
        self._made.raises = True
        kind, text = self._in_c.known(node.exc.func), node.exc.args[0]
        form = "" if kind is Refusal else f"{kind.__name__}: "
        arguments = []
        for part in text.values if isinstance(text, ast.JoinedStr) else [text]:
            if isinstance(part, ast.FormattedValue):
                code = self._in_c.code(part.value)
                how = "".join(ast.literal_eval(x) for x in getattr(part.format_spec, "values", ()))
                form += "%s" if code.shape == TEXT else f"%{how}"
                arguments.append(f"shown({code.text})" if code.shape == DOUBLE else code.text)
            else:
                form += str(ast.literal_eval(part)).replace("%", "%%")
        quoted = '"' + form.replace("\\", "\\\\").replace('"', '\\"') + '"'
        return f"raise_error({', '.join(['error', quoted, *arguments])});"


def _zero(shape: Shape) -> str:
    return f"({shape.name}){{0}}" if isinstance(shape, Structure) else "0"


def _names(node: ast.expr) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _declared(shape: Shape) -> str:
    """A type before a name."""
    return shape.name if shape.name.endswith("*") else f"{shape.name} "


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
    if len(lines) == 1 and len(lines[0]) + 1 + len(comment) <= LINE_WIDTH:
        return [f"{lines[0]} {comment}"]
    return [f"{indent}{comment}", *lines]


def _comment(docstring: str | None) -> list[str]:
    if not docstring:
        return []
    lines = strip_sphinx_marks(textwrap.dedent(docstring)).rstrip().splitlines()
    if len(lines) == 1:
        return [f"/* {lines[0]} */"]
    return [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]
