"""Functions of the language of equations in C: their statements."""

from __future__ import annotations

import ast
import inspect
from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import groupby
from pathlib import Path
from types import FunctionType
from typing import Any

from auv_fmu.variable import Refusal
from fmus.native.calls import Calls
from fmus.native.expressions import AND, OR, WHOLE, Code
from fmus.native.language import foreign, is_text, word_of
from fmus.native.layout import INDENT, annotated, comment_of, comments_of, laid_out, quoted
from fmus.native.loops import loop_over
from fmus.native.program import Function, Program, Untranslatable
from fmus.native.shapes import (
    BOOLEAN,
    DOUBLE,
    NOTHING,
    TEXT,
    Shape,
    Structure,
    closed,
    declared,
    has_no_size,
    in_c,
    shape_of,
)
from fmus.native.variables import (
    always_stored,
    both,
    is_fixed_name,
    loaded_names,
    names_in,
    stored_names,
)
from fmus.ports.behaviour import NUMBER_FORMAT


@cache
def _checked(path: str) -> ast.Module:
    """The tree of a module that is in the language."""
    for one in foreign(Path(path)):
        raise Untranslatable(one)
    return ast.parse(Path(path).read_bytes())


def function_in_c(program: Program, function: FunctionType, made: Function) -> None:
    """Write the text of a function of equations in C.

    Args:
        program: that gets the functions and structures that it needs.
        function: whose module is in the language.
        made: the function, which gets its text.

    Raises:
        Untranslatable: it has no counterpart.

    """
    path = str(inspect.getsourcefile(function))
    line = function.__code__.co_firstlineno
    found = [n for n in _checked(path).body if isinstance(n, ast.FunctionDef) and n.lineno == line]
    if not found:
        raise Untranslatable(f"{path}:{line}: {function.__name__} is not made by def in a module")
    tree = found[0]
    names = {*made.arguments, *stored_names(*tree.body)}
    words = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    nothing = function.__annotations__.get("return") in (None, "None")
    calls = Calls(program, path, function.__globals__, made, names, words)
    _Translation(tree, calls, nothing).write()


class _Translation:
    """One function on its way to C."""

    def __init__(self, tree: ast.FunctionDef, in_c: Calls, returns_nothing: bool) -> None:
        self._tree, self._in_c, self._made = tree, in_c, in_c.made
        self._returns_nothing = returns_nothing
        self._assigned = Counter(stored_names(*tree.body))
        #: Names that are declared, block by block.
        self._scopes = [set(self._made.arguments)]
        #: Names that are given a value in a block and used after it, with their shapes.
        self._hoisted: dict[str, Shape | None] = {}

    def write(self) -> None:
        """Write its text."""
        body = list(self._block(self._tree.body, INDENT, new=False))
        if self._in_c.assigned is not None and not self._returns_nothing:
            raise self._in_c.fail(self._tree, f"{self._tree.name} may end without a return")
        head = [*comment_of(ast.get_docstring(self._tree)), *laid_out(self._made.head, "")]
        self._made.text = "\n".join([*head, *body, "}"])

    # Blocks

    def _block(self, statements: list[ast.stmt], indent: str, new: bool = True) -> Iterator[str]:
        if new:
            self._scopes.append(set())
        for statement in statements:
            lines = [line for text in self._statement(statement, indent) for line in text]
            about = comments_of(self._in_c.path).get(statement.end_lineno or 0)
            simple = not isinstance(statement, (ast.If, ast.While, ast.For, ast.FunctionDef))
            if about and lines and simple:
                lines = annotated(lines, f"/* {closed(about)} */", indent)
            yield from lines
        if new:
            self._scopes.pop()

    def _statement(self, node: ast.stmt, indent: str) -> Iterator[list[str]]:
        if isinstance(node, (ast.If, ast.While, ast.For)):
            yield from self._hoisting(node, indent)
        elif isinstance(node, ast.Return):
            yield laid_out(self._returned(node), indent)
            self._in_c.assigned = None
        elif isinstance(node, (ast.Break, ast.Continue)):
            yield [f"{indent}{'break' if isinstance(node, ast.Break) else 'continue'};"]
            self._in_c.assigned = None
        elif isinstance(node, (ast.Assign, ast.AnnAssign, ast.AugAssign)):
            for text in self._storing(node):
                yield laid_out(text, indent)
        elif isinstance(node, ast.Raise):
            yield laid_out(self._raised(node), indent)
            if self._made.returns is not None or self._returns_nothing:
                yield [f"{indent}{self._made.leave}"]
            self._in_c.assigned = None
        elif isinstance(node, ast.FunctionDef):
            self._local_function(node)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield laid_out(f"{self._in_c.code(node.value).text};", indent)
        elif not (isinstance(node, ast.Pass) or is_text(node)):
            raise self._in_c.fail(node, f"{word_of(node)} is not in the language of equations")

    def _returned(self, node: ast.Return) -> str:
        name, gives = self._tree.name, not self._returns_nothing
        if node.value is None and gives:
            raise self._in_c.fail(node, f"{name} has a result: return a value")
        if node.value is None:
            return "return;"
        if not gives:
            raise self._in_c.fail(node, f"{name} returns a value, and its type is None")
        code = self._in_c.fitting(node.value, self._made.returns)
        if self._made.returns is None:
            self._made.returns = code.shape
        return f"return {code.text};"

    def _hoisting(self, node: ast.If | ast.While | ast.For, indent: str) -> Iterator[list[str]]:
        """A statement with blocks, after the declarations of what is used after it."""
        inside = set(stored_names(node))
        before = set().union(*self._scopes)
        outside = Counter(loaded_names(self._tree)) - Counter(loaded_names(node))
        wanted = {name for name in inside - before if outside[name] > 0}
        always = always_stored(node)
        mine = sorted(wanted & always) if always is not None else []
        self._hoisted |= dict.fromkeys(mine)
        self._scopes[-1] |= set(mine)
        lines = [line for text in self._compound(node, indent) for line in text]
        for name in mine:
            shape = self._hoisted.pop(name)
            if shape is not None:
                value = "{0}" if isinstance(shape, Structure) else "0"
                yield [f"{indent}{declared(shape)}{in_c(name)} = {value};"]
        yield lines

    def _compound(self, node: ast.If | ast.While | ast.For, indent: str) -> Iterator[list[str]]:
        inner = indent + INDENT
        if isinstance(node, ast.If):
            yield laid_out(f"if ({self._in_c.condition(node.test).text}) {{", indent)
            before = self._in_c.assigned
            yield list(self._block(node.body, inner))
            after_body, self._in_c.assigned = self._in_c.assigned, before
            if node.orelse:
                yield [f"{indent}}} else {{"]
                yield list(self._block(node.orelse, inner))
            self._in_c.assigned = both(after_body, self._in_c.assigned)
            yield [f"{indent}}}"]
            return
        yield from self._loop(node, indent)

    def _loop(self, node: ast.While | ast.For, indent: str) -> Iterator[list[str]]:
        before, bound, known = self._in_c.assigned, [], set[str]()
        if isinstance(node, ast.While):
            condition = self._in_c.condition(node.test).within(AND)
        else:
            known = names_in(node.target) & set().union(*self._scopes)
            changed = {*stored_names(*node.body), *known}
            loop = loop_over(self._in_c, node.target, node.iter, changed)
            bound = loop.bound
            yield [line for text in loop.before for line in laid_out(text, indent)]
        # After an error the turns that it counts may be any number: it ends at once.
        self._made.raises |= isinstance(node, ast.While) or loop.turns is None
        self._scopes.append(set())
        body: list[str] = []
        for name, code in bound:
            if code.text == in_c(name):
                self._scopes[-1].add(name)
                self._in_c.local[name] = code.shape
                self._note(name)
            elif name in {*known, *loaded_names(*node.body)}:
                body += laid_out(self._stored(node, [(name, code)]), indent + INDENT)
        body += self._block(node.body, indent + INDENT)
        self._scopes.pop()
        self._in_c.assigned = before
        if isinstance(node, ast.While):
            head = f"while (!error->raised && {condition}) {{"
        else:
            head = loop.head(may_raise=self._made.raises)
        yield [*laid_out(head, indent), *body, f"{indent}}}"]

    def _local_function(self, node: ast.FunctionDef) -> None:
        """A function within this one, as a function of its own that gets what it captures."""
        if self._assigned[node.name] > 1:
            raise self._in_c.fail(node, f"{node.name} is given a value twice: use two names")
        inner, captured = self._in_c.inside(node, node.name)
        given: dict[str, Any] = {a.arg: self._shape(a.annotation) for a in node.args.args}
        own = {*given, *stored_names(*node.body)}
        for name in captured:
            if name in own:
                raise self._in_c.fail(node, f"{name} has two meanings in {node.name}: rename one")
            if self._assigned[name] > (name not in self._made.arguments):
                raise self._in_c.fail(node, f"{name}, which {node.name} uses, is changed")
        made = inner.made
        made.arguments = {**given, **{name: self._in_c.local[name] for name in captured}}
        nothing = isinstance(node.returns, ast.Constant) and node.returns.value is None
        made.returns = None if nothing else self._shape(node.returns, is_result=True)
        inner.local = dict(made.arguments)
        inner.names = {*made.arguments, *own}
        inner.functions = {n: f for n, f in inner.functions.items() if n not in inner.names}
        if inner.assigned is not None:
            inner.assigned = {*made.arguments, *inner.functions}
        _Translation(node, inner, nothing).write()
        self._in_c.program.functions[made.name] = made
        self._in_c.functions = {**self._in_c.functions, node.name: (made, captured)}
        self._note(node.name)

    def _shape(self, annotation: ast.expr | None, *, is_result: bool = False) -> Shape | None:
        """The shape that an annotation names; None: a result of any size."""
        text = ast.unparse(annotation) if annotation else ""
        try:
            hint: Any = eval(text, self._in_c.scope)
            if is_result and has_no_size(hint):
                return None
            return self._in_c.program.defined(shape_of(hint))
        except Exception as error:
            raise self._in_c.placed(annotation or self._tree, error) from None

    # Assignments

    def _storing(self, node: ast.Assign | ast.AnnAssign | ast.AugAssign) -> Iterator[str]:
        if isinstance(node, ast.Assign):
            yield from self._assignment(node.targets[0], node.value)
        elif isinstance(node, ast.AnnAssign):
            assert isinstance(node.target, ast.Name) and node.value is not None
            code = self._in_c.fitting(node.value, self._shape(node.annotation))
            yield self._stored(node, [(node.target.id, code)])
        else:
            target = ast.Name(ast.unparse(node.target), ast.Load(), lineno=node.lineno)
            changed = ast.BinOp(target, node.op, node.value, lineno=node.lineno)
            yield self._stored(node, [(target.id, self._in_c.code(changed))])

    def _assignment(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        if isinstance(target, ast.Name) and target.id == "_":
            yield f"(void)({self._in_c.code(value).text});"
        elif isinstance(target, ast.Name):
            is_old = any(target.id in scope for scope in self._scopes)
            wanted = self._in_c.local.get(target.id) if is_old else None
            yield self._stored(target, [(target.id, self._in_c.code(value, wanted))])
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            has_star = any(isinstance(one, ast.Starred) for one in value.elts)
            if has_star or len(target.elts) != len(value.elts):
                yield from self._taken_apart_in(target, value)
                return
            pairs = list(zip(target.elts, value.elts))
            if names_in(target) & names_in(value):
                yield from self._at_once(target, pairs)
            elif all(isinstance(one, ast.Name) and one.id != "_" for one, _ in pairs):
                codes = [(ast.unparse(one), self._in_c.code(other)) for one, other in pairs]
                for alike in _alike(codes):
                    yield self._stored(target, alike)
            else:
                for one, other in pairs:
                    yield from self._assignment(one, other)
        else:
            yield from self._taken_apart_in(target, value)

    def _at_once(self, target: ast.expr, pairs: list[tuple[ast.expr, ast.expr]]) -> Iterator[str]:
        """Values that are all computed before the first is stored, as Python does."""
        codes = []
        for i, (_, value) in enumerate(pairs):
            code, name = self._in_c.code(value), self._in_c.unused(f"next_{i}")
            self._in_c.program.defined(code.shape)
            yield f"const {declared(code.shape)}{name} = {code.text};"
            codes.append(Code(name, code.shape))
        for (one, _), code in zip(pairs, codes):
            for alike in _alike(list(self._in_c.taken_apart(one, code))):
                yield self._stored(target, alike)

    def _taken_apart_in(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        code = self._in_c.code(value)
        # A part that depends on what is given a value here is read before.
        if not is_fixed_name(value) or names_in(target) & names_in(value):
            name = self._name_of_all(target, value)
            self._in_c.program.defined(code.shape)
            yield f"const {declared(code.shape)}{in_c(name)} = {code.text};"
            code = Code(in_c(name), code.shape)
        for alike in _alike(list(self._in_c.taken_apart(target, code))):
            yield self._stored(target, alike)

    def _name_of_all(self, target: ast.expr, value: ast.expr) -> str:
        """A name for what is taken apart: the name of the function it comes from."""
        name = ast.unparse(value.func).rsplit(".")[-1] if isinstance(value, ast.Call) else "all"
        found = (n.id for n in ast.walk(target) if isinstance(n, ast.Name) and n.id != "_")
        first = next(found, "_")
        called = {n.id for n in ast.walk(self._tree) if isinstance(n, ast.Name)}
        taken = name in self._in_c.local or name in called
        return self._in_c.unused(f"{name}_{first}" if taken else name.lstrip("_"))

    def _stored(self, node: ast.AST, values: list[tuple[str, Code]]) -> str:
        """The assignment of values of one type, to names that are new or not."""
        stores = [f"{in_c(name)} = {code.text}" for name, code in values]
        old = [name for name, _ in values if any(name in scope for scope in self._scopes)]
        for name, code in values:
            if name in self._hoisted and self._hoisted[name] is None:
                self._hoisted[name] = self._in_c.local[name] = self._in_c.program.defined(
                    code.shape
                )
            elif name in old and code.shape != self._in_c.local[name]:
                raise self._in_c.fail(node, self._other(name, code))
        if old and len(old) < len(values):
            return " ".join(self._stored(node, [value]) for value in values)
        for name, _ in values:
            self._note(name)
        if old:
            return "; ".join(stores) + ";"
        shape = values[0][1].shape
        if shape == NOTHING:
            raise self._in_c.fail(node, "what returns nothing is used as a value")
        if shape == TEXT and len(values) > 1:
            return " ".join(self._stored(node, [value]) for value in values)
        for name, code in values:
            self._scopes[-1].add(name)
            self._in_c.local[name] = self._in_c.program.defined(code.shape)
        changes = any(self._assigned[name] > 1 for name, _ in values)
        constant = "" if changes or shape == TEXT else "const "
        return f"{constant}{declared(shape)}{', '.join(stores)};"

    def _other(self, name: str, code: Code) -> str:
        before = self._in_c.local[name]
        if before == DOUBLE and code.shape in WHOLE:
            better = f"{code.text}.0" if code.text.isdecimal() else f"float({code.text})"
            return f"{name} is a float and gets an int: write {better}"
        if before in WHOLE and code.shape == DOUBLE:
            return f"{name} is {before.word} and gets a float: begin with a float, such as 0.0"
        return f"{name} is {before.word} and gets {code.shape.word}: use another name"

    def _note(self, name: str) -> None:
        """A name has a value from here on."""
        if self._in_c.assigned is not None:
            self._in_c.assigned = self._in_c.assigned | {name}

    def _raised(self, node: ast.Raise) -> str:
        assert isinstance(node.exc, ast.Call)
        self._made.raises = True
        kind, text = self._in_c.known(node.exc.func), node.exc.args[0]
        if not (isinstance(kind, type) and issubclass(kind, Exception)):
            raise self._in_c.fail(node, f"{ast.unparse(node.exc.func)} is not an exception")
        form = "" if kind is Refusal else f"{kind.__name__}: "
        arguments = []
        for part in text.values if isinstance(text, ast.JoinedStr) else [text]:
            if isinstance(part, ast.FormattedValue):
                directive, argument = self._formatted(part)
                form += directive
                arguments.append(argument)
            else:
                form += str(ast.literal_eval(part)).replace("%", "%%")
        return f"raise_error({', '.join(['error', quoted(form), *arguments])});"

    def _formatted(self, part: ast.FormattedValue) -> tuple[str, str]:
        """A value in a text: its directive in C, and the argument."""
        code = self._in_c.code(part.value)
        if part.conversion not in (-1, ord("s")):
            raise self._in_c.fail(part.value, f"!{chr(part.conversion)} in a text: leave it out")
        if any(isinstance(x, ast.FormattedValue) for x in getattr(part.format_spec, "values", ())):
            raise self._in_c.fail(part.value, "a format that is computed")
        how = "".join(ast.literal_eval(x) for x in getattr(part.format_spec, "values", ()))
        if code.shape == TEXT and not how:
            return "%s", code.text
        if code.shape == BOOLEAN and not how:
            return "%s", f'{code.within(OR)} ? "True" : "False"'
        if code.shape in WHOLE and how in ("", "d"):
            return "%d", code.text
        if code.shape in (DOUBLE, *WHOLE) and NUMBER_FORMAT.fullmatch(how):
            number = code.text if code.shape == DOUBLE else f"(double)({code.text})"
            return f"%{how}", number
        name = ast.unparse(part.value)
        raise self._in_c.fail(part.value, f"{{{name}}} in a text: write {{{name}:g}}")


def _alike(values: list[tuple[str, Code]]) -> Iterator[list[tuple[str, Code]]]:
    """Neighbours of one type."""
    return (list(group) for _, group in groupby(values, key=lambda value: value[1].shape))
