"""The language of equations: translation of Python functions to trees.

This module defines the language: other constructs are refused, with their line and, if possible,
advice. A mistake ends only its statement, so one pass finds the mistakes of all functions.
"""

from __future__ import annotations

import ast
import inspect
import math
import operator
import tokenize
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from enum import IntEnum
from functools import cache, partial
from inspect import Parameter
from itertools import chain, count
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, NamedTuple

from auv_fmu import Refusal
from auv_fmu.language.arrays import Matrix, Vector
from fmus.language import arrays, tree
from fmus.language.mathematics import BY_FUNCTION, CONSTANTS, FUNCTIONS
from fmus.language.tree import (
    Call,
    Choice,
    Expression,
    Field,
    Function,
    Item,
    Local,
    Make,
    Number,
    Operation,
    Statement,
    int_of,
)
from fmus.language.types import (
    BOOL,
    FLOAT,
    INT,
    NOTHING,
    PLACED,
    TEXT,
    UNKNOWN,
    Array,
    Record,
    Scalar,
    Type,
    check_int,
    check_size,
    check_value,
    enumeration,
    has_no_size,
    has_only_floats,
    is_algebraic,
    is_number,
    is_whole,
    matrix,
    parts_of,
    sizes,
    tuple_of,
    type_of,
    type_of_value,
    vector,
)
from fmus.language.words import advice, word_of
from fmus.ports.behaviour import NUMBER_FORMAT
from fmus.ports.groups import hints_of, is_class, is_record

#: Deepest nesting of expressions, since compilers limit nested brackets.
_DEEPEST = 200

#: Deepest nesting of blocks, including each `elif`, and most cases of a `match`.
_MOST_BLOCKS = 100

#: Message if Python's stack is exhausted.
_TOO_DEEP = "too deep for Python: take expressions apart, or join functions that call each other"

#: Packages whose functions all equations may call.
_SHARED = frozenset(("auv_fmu", "fmus"))

#: Exceptions that may be raised, with their subclasses.
_EXCEPTIONS = (Refusal, ArithmeticError, AssertionError, RuntimeError, ValueError)

_ARITHMETIC: Mapping[type, tuple[tree.Operator, tree.Operator]] = {
    ast.Add: (tree.ADD, tree.INT_ADD),
    ast.Sub: (tree.SUBTRACT, tree.INT_SUBTRACT),
    ast.Mult: (tree.MULTIPLY, tree.INT_MULTIPLY),
    ast.Div: (tree.DIVIDE, tree.INT_DIVIDE),
    ast.FloorDiv: (tree.FLOOR_DIVIDE, tree.INT_FLOOR_DIVIDE),
    ast.Mod: (tree.MODULO, tree.INT_MODULO),
}

_COMPARISONS: Mapping[type, tree.Operator] = {
    ast.Lt: tree.LESS, ast.LtE: tree.LESS_EQUAL, ast.Gt: tree.GREATER,
    ast.GtE: tree.GREATER_EQUAL, ast.Eq: tree.EQUAL, ast.NotEq: tree.NOT_EQUAL,
}  # fmt: skip


def _power_of(base: Any, exponent: Any) -> Any:
    """Compute a power of ints that may be a size."""
    are_ints = isinstance(base, int) and isinstance(exponent, int)
    if not are_ints or exponent not in range(32) or abs(base) > 2**31:
        raise OverflowError
    return base**exponent


#: Operators that are evaluated between constants.
_FOLDED: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: _power_of,
}  # fmt: skip

#: Returns a value for use in each turn of a loop; also takes its source, and a part of its name.
_Hold = Callable[[Expression, ast.expr, str], Expression]


class Untranslatable(Exception):
    """A program that is outside the language; each argument is a mistake with its place."""

    def __str__(self) -> str:
        """Return the first mistake, and the number of further ones."""
        first, *others = map(str, self.args)
        return f"{first} (and {len(others)} more: see auv-fmu check)" if others else first


class _Outside(Exception):
    """A construct outside the language: its node, and the reason."""

    def __init__(self, node: ast.AST, what: str) -> None:
        super().__init__(what)
        self.node = node


class _Follows(Exception):
    """A mistake that follows from one that has been refused."""


class Program:
    """Functions as trees, with all functions that they call.

    Attributes:
        functions: functions by their origin, each after those that it calls.

    """

    def __init__(self, *functions: FunctionType) -> None:
        """Translate functions, and collect mistakes."""
        self.functions = tree.Functions()
        #: Constants of modules, by name and value.
        self.constants: dict[Hashable, tree.Constant] = {}
        self._begun: set[Hashable] = set()
        self._mistakes: dict[str, str] = {}
        for function in functions:
            try:
                self.function(function)
            except TypeError as error:
                self.refuse("", str(error))

    @property
    def mistakes(self) -> list[str]:
        """Messages of all mistakes, sorted by file and line."""
        return sorted((f"{place}{what}" for place, what in self._mistakes.items()), key=position)

    def check(self) -> None:
        """Refuse a program with mistakes.

        Raises:
            Untranslatable: there is at least one.

        """
        if self._mistakes:
            raise Untranslatable(*self.mistakes)

    def refuse(self, place: str, what: str) -> None:
        """Note a mistake; only the first one of each line, since others follow from it."""
        match = PLACED.match(what)
        if match:
            place, what = match[0], what[match.end() :]
        self._mistakes.setdefault(place, what)

    def function(self, function: FunctionType, types: Sequence[Type] = ()) -> Function:
        """Return a function as a tree.

        Args:
            function: a Python function, made by `def` in a module.
            types: types of its arguments, if some of them are vectors of any size.

        Raises:
            TypeError: it was not made by `def` in a module, or calls itself.

        """
        key = (function, *types)
        if key in self.functions:
            return self.functions[key]
        if key in self._begun:
            raise TypeError(f"{function.__name__} calls itself")
        path, line = str(inspect.getsourcefile(function)), function.__code__.co_firstlineno
        node = _definition(path, line)
        if node is None:
            raise TypeError(f"{path}:{line}: {function.__name__} is not made by def in a module")
        made = Function(function.__module__, function.__name__, {}, sizes=types, path=path)
        self._begun.add(key)
        given = dict(zip((argument.arg for argument in _arguments(node)), types))
        try:
            _Builder(self, path, function.__globals__, made, node).build(given)
        except RecursionError:
            raise TypeError(f"{path}:{line}: {_TOO_DEEP}") from None
        self.functions[key] = made
        return made


def _message_of(error: Exception) -> str:
    """Return the message of an error, with its class unless it is a TypeError."""
    if isinstance(error, RecursionError):
        raise error  # reported where the stack has room again
    return str(error) if isinstance(error, TypeError) else f"{type(error).__name__}: {error}"


def position(mistake: str) -> tuple[str, int]:
    """Return the file and line of a mistake; a mistake without them comes first."""
    match = PLACED.match(mistake)
    file, _, number = match[0][:-2].rpartition(":") if match else ("", "", "0")
    return file, int(number)


@cache
def _module(path: str) -> ast.Module:
    return ast.parse(Path(path).read_bytes())


def _definition(path: str, line: int) -> ast.FunctionDef | None:
    """Return the function that begins at a line of a module."""
    functions = (
        n for n in _module(path).body if isinstance(n, ast.FunctionDef) and n.lineno == line
    )
    return next(functions, None)


@cache
def _comments(path: str) -> dict[int, str]:
    """Return the comments after code in a file, by line."""
    with tokenize.open(path) as file:
        return {
            token.start[0]: token.string.lstrip("#: ")
            for token in tokenize.generate_tokens(file.readline)
            if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip()
        }


def _is_included(function: FunctionType, path: str, module: str) -> bool:
    """Return True if a function is in this product, or next to the module that uses it."""
    if function.__module__.partition(".")[0] in _SHARED:
        return True
    depth = module.count(".") + (Path(path).stem == "__init__")
    root = Path(path).resolve().parents[depth]
    file = Path(str(inspect.getsourcefile(function))).resolve()
    return root in file.parents and "site-packages" not in file.relative_to(root).parts


# Names that a piece of a program assigns, and names that it uses


def _stored(*nodes: ast.AST) -> list[str]:
    """Return the names that nodes assign, not in nested functions and expressions with `for`."""
    names: list[str] = []
    for node in nodes:
        if isinstance(node, ast.FunctionDef):
            names.append(node.name)
        elif isinstance(node, ast.Name):
            names += [node.id] if isinstance(node.ctx, ast.Store) else []
        elif not isinstance(node, ast.GeneratorExp):
            names += _stored(*ast.iter_child_nodes(node))
    return names


def _names(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _free(*nodes: ast.AST) -> list[str]:
    """Return the names that nodes use and do not define themselves, in the order of use."""
    names: list[str] = []
    for node in nodes:
        if isinstance(node, ast.Name):
            names += [node.id] if isinstance(node.ctx, ast.Load) else []
        elif isinstance(node, ast.FunctionDef):
            own = _own(node)
            names += _free(*node.args.defaults, *filter(None, node.args.kw_defaults))
            names += [name for name in _free(*node.body) if name not in own]
        elif isinstance(node, ast.GeneratorExp):
            generator, own = node.generators[0], _names(node.generators[0].target)
            inner = _free(node.elt, *generator.ifs)
            names += [*_free(generator.iter), *(name for name in inner if name not in own)]
        elif isinstance(node, ast.AnnAssign):
            names += _free(*filter(None, [node.value]))
        else:
            names += _free(*ast.iter_child_nodes(node))
    return names


def _arguments(node: ast.FunctionDef) -> list[ast.arg]:
    return [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]


def _own(node: ast.FunctionDef) -> set[str]:
    """Return the names of a function's arguments and variables."""
    return {*(argument.arg for argument in _arguments(node)), *_stored(*node.body)}


def _is_none(node: ast.expr | None) -> bool:
    """Return True for a missing expression or `None`."""
    return node is None or (isinstance(node, ast.Constant) and node.value is None)


def _beyond_loops(*nodes: ast.AST) -> set[str]:
    """Return the names that occur outside of the loops that assign them."""
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.For):
            names |= {*_free(node.iter)} | _beyond_loops(*node.body) - _names(node.target)
        elif isinstance(node, (ast.FunctionDef, ast.expr)):
            names |= {*_free(node), *_stored(node)}
        else:
            names |= _beyond_loops(*ast.iter_child_nodes(node))
    return names


class _Loop(NamedTuple):
    """The head of a loop.

    Attributes:
        counter: number of the turn, or number of a range.
        start, stop, step: bounds and step of the counter.
        turns: number of turns; None if it is not constant.
        bound: names that are assigned in each turn, and their values.
        is_wide: True if the counter may pass the largest int.

    """

    counter: Local
    start: Expression
    stop: Expression
    step: int
    turns: int | None
    bound: Sequence[tuple[str, Expression]]
    is_wide: bool = False

    def made(self, body: Sequence[Statement]) -> tree.For:
        """Return the loop with a body."""
        name, numbers = self.counter.name, (self.start, self.stop, self.step, self.turns)
        return tree.For(name, *numbers, body, self.is_wide)


#: Names that have a value at a point of a function, with their types.
_Known = dict[str, Type]


class _Signature(NamedTuple):
    """The signature of a function or class.

    Attributes:
        module, name: its module and name.
        types: types of the arguments by name; None for a vector or matrix of any size.
        unnamed, positional: numbers of arguments that must, and that may, be positional.
        defaults: default values, as Python values or trees.

    """

    module: str
    name: str
    types: Mapping[str, Type | None]
    unnamed: int
    positional: int
    defaults: Mapping[str, Any]


class _Callable(NamedTuple):
    """A local function as a tree; captured variables are further arguments."""

    function: Function
    signature: _Signature
    captured: Sequence[str]


class _Each(NamedTuple):
    """An unfinished function with a loop, for an expression with a `for`.

    Attributes:
        builder: builder of the function.
        given: arguments of the call, by their names in the function.
        loop: head of the loop.
        turn: statements of each turn.
        block: statements that use the element: the same, or the body of an `if` among them.

    """

    builder: _Builder
    given: dict[str, Expression]
    loop: _Loop
    turn: list[Statement]
    block: list[Statement]

    def call(self, before: Sequence[Statement], after: Expression) -> Expression:
        """Finish the function with statements before the loop and a result, and call it."""
        function = self.builder.made
        function.returns = after.type
        function.arguments = {name: value.type for name, value in self.given.items()}
        function.end([*before, self.loop.made(self.turn), tree.Return(after)])
        self.builder.program.functions["inner", function] = function
        return Call(function, [*self.given.values()])


class _Builder:
    """Builds the tree of one function.

    Attributes:
        made: the function.
        names: names of its arguments and variables.
        known: names that have a value at the present statement; None if it is unreachable.
        functions: local functions by name.

    """

    def __init__(
        self,
        program: Program,
        path: str,
        scope: dict[str, Any],
        made: Function,
        node: ast.FunctionDef | None = None,
    ) -> None:
        """Begin an empty tree."""
        self.made, self.program, self.path, self.scope = made, program, path, scope
        self.node = node
        self.names: set[str] = set()
        self.known: _Known | None = {}
        self.functions: dict[str, _Callable] = {}
        #: Names of variables in the tree, by names and types in Python.
        self._variables: dict[tuple[str, Type], str] = {}
        self._taken: set[str] = set()
        #: Names that are used outside of the loops that assign them.
        self._beyond_loops: Set[str] = frozenset()
        #: Known names after each `break`, for the loops around the present statement.
        self._ends: list[_Known | None] = []
        #: Statements before the present one; None if its parts may not all be evaluated.
        self._before: list[Statement] | None = None
        self._depth = self._blocks = self._parts = 0
        self.has_mistakes = False
        self._counts: Counter[str] = Counter()

    # Functions

    def build(self, sized: Mapping[str, Type], captured: Mapping[str, Type] | None = None) -> None:
        """Build the tree of a Python function.

        Args:
            sized: types of arguments without a size.
            captured: variables of the surrounding function, which are further arguments.

        """
        node = self.node
        assert node is not None
        self.made.doc = ast.get_docstring(node) or ""
        arguments = _arguments(node)
        self.names = _own(node)
        self._taken |= {*self.names, *_names(node)}
        self._counts = Counter(_stored(*node.body))
        self._beyond_loops = _beyond_loops(*node.body)
        with _Noting(self):
            self._check_head(node)
        for argument in arguments:
            self.made.arguments[argument.arg] = UNKNOWN
            with _Noting(self):
                what = f"the argument {argument.arg} of {node.name}"
                type_ = self._hinted(argument, argument.annotation, what) or sized.get(argument.arg)
                if type_ is None:
                    what += ": a Vector or Matrix has no size here: write Annotated[Vector, 3]"
                    raise _Outside(node, what)
                self.made.arguments[argument.arg] = type_
        self.made.arguments |= captured or {}
        self.names |= self.made.arguments.keys()
        self._start(self.made.arguments)
        self._gives = node.returns is None or not _is_none(node.returns)
        self._returns: Type | None = NOTHING
        if self._gives:
            self._returns = UNKNOWN
            with _Noting(self):
                self._returns = self._hinted(node, node.returns, f"the result of {node.name}")
        body = self._block(node.body)
        if self.known is not None and self._gives and not self.has_mistakes:
            with _Noting(self):
                raise _Outside(node, f"{node.name} may end without a return")
        self.made.returns = self._returns or UNKNOWN
        self.made.end(body)

    def _start(self, arguments: Mapping[str, Type]) -> None:
        """Mark the arguments, and local functions of the surrounding function, as known."""
        self.known = {**arguments, **dict.fromkeys(self.functions, NOTHING)}
        self._variables |= {(name, type_): name for name, type_ in arguments.items()}

    def _check_head(self, node: ast.FunctionDef) -> None:
        given = node.args
        if node.decorator_list:
            raise _Outside(node, f"a decorator of {node.name} is not in the language of equations")
        if given.vararg or given.kwarg:
            raise _Outside(node, f"* among the arguments of {node.name}: name them")
        for argument in _arguments(node):
            if argument.arg == "_":
                raise self._cannot(argument, "an argument _")
            if argument.annotation is None:
                raise _Outside(argument, f"the argument {argument.arg} of {node.name} has no type")
        if node.returns is None:
            raise _Outside(node, f"the result of {node.name} has no type: write -> float")

    def _hinted(self, node: ast.AST, annotation: ast.expr | None, what: str) -> Type | None:
        """Return the type of an annotation; None for a vector or matrix without a size."""
        if annotation is None:
            raise _Follows
        try:
            text = ast.unparse(annotation)
            hint: Any = eval(text, self.scope)
            hint = eval(hint, self.scope) if isinstance(hint, str) else hint
            return None if has_no_size(hint) else type_of(hint)
        except Exception as error:
            if PLACED.match(str(error)):
                raise
            raise _Outside(node, f"{what}: {_message_of(error)}") from None

    # Mistakes

    def _cannot(self, node: ast.AST, what: str) -> _Outside:
        return _Outside(node, f"{what} is not in the language of equations{advice(what)}")

    # Blocks

    def _block(self, nodes: Sequence[ast.stmt]) -> list[Statement]:
        statements: list[Statement] = []
        self._blocks += 1
        for node in nodes:
            if self.known is None:
                break  # unreachable
            before = len(statements)
            self._before = statements
            with _Noting(self, node):
                self._statement(node, statements)
            self._before = None
            for statement in statements[before:]:
                statement.line = node.lineno
            about = _comments(self.path).get(node.end_lineno or 0)
            is_simple = not isinstance(
                node, (ast.If, ast.While, ast.For, ast.FunctionDef, ast.Match)
            )
            if about and is_simple and len(statements) > before:
                statements[-1].comment = about
        self._blocks -= 1
        return statements

    def _statement(self, node: ast.stmt, statements: list[Statement]) -> None:
        name = f"_{type(node).__name__.lower()}_statement"
        is_branched = isinstance(node, (ast.If, ast.Match))
        if is_branched and self._blocks + len(getattr(node, "cases", ())) > _MOST_BLOCKS:
            what = f"more than {_MOST_BLOCKS} branches: use a tuple of values, or functions"
            raise _Outside(node, what)
        if not hasattr(self, name):
            raise self._cannot(node, word_of(node))
        getattr(self, name)(node, statements)

    def _pass_statement(self, node: ast.Pass, statements: list[Statement]) -> None:
        """Add no statement."""

    def _expr_statement(self, node: ast.Expr, statements: list[Statement]) -> None:
        if isinstance(getattr(node.value, "value", None), str):
            return  # as docstrings are
        if not isinstance(node.value, ast.Call):
            is_word = isinstance(node.value, (ast.Await, ast.Yield, ast.YieldFrom))
            raise self._cannot(node, word_of(node.value if is_word else node))
        statements.append(tree.Do(self.expression(node.value, NOTHING)))

    def _return_statement(self, node: ast.Return, statements: list[Statement]) -> None:
        assert self.node is not None
        name, value = self.node.name, None
        try:
            if _is_none(node.value) and self._gives:
                raise _Outside(node, f"{name} has a result: return a value")
            if node.value is not None and not _is_none(node.value):
                if not self._gives:
                    raise _Outside(node, f"{name} returns a value, and its type is None")
                value = self.fitting(node.value, self._returns)
                self._returns = self._returns or value.type
        finally:
            self.known = None
        statements.append(tree.Return(value))

    def _break_statement(self, node: ast.Break, statements: list[Statement]) -> None:
        self._ends[-1] = _both(self._ends[-1], self.known)
        self.known = None
        statements.append(tree.Break())

    def _continue_statement(self, node: ast.Continue, statements: list[Statement]) -> None:
        self.known = None
        statements.append(tree.Continue())

    def _if_statement(self, node: ast.If, statements: list[Statement]) -> None:
        test: Expression = Number(True, BOOL)
        with _Noting(self):
            test = self.condition(node.test)
        before = self.known
        body = self._block(node.body)
        after, self.known = self.known, before
        orelse = self._block(node.orelse)
        self.known = _both(after, self.known)
        statements.append(tree.If(test, body, orelse))

    def _assert_statement(self, node: ast.Assert, statements: list[Statement]) -> None:
        test = Operation(tree.NOT, (self.condition(node.test),), BOOL)
        # The text is evaluated only if the condition does not hold.
        self._before = None
        parts: list[str | tuple[Expression, str]] = ["AssertionError: "]
        if node.msg is not None:
            parts += self._message(node.msg)
        statements.append(tree.If(test, [tree.Raise(parts)]))

    def _match_statement(self, node: ast.Match, statements: list[Statement]) -> None:
        subject = self._held(self.expression(node.subject), "case")
        if not is_whole(subject.type):
            raise _Outside(node, f"match of {subject.type.word}: it takes an int or an enumeration")
        self._before = None
        rest = {*subject.type.made} if getattr(subject.type, "made", None) else {None}
        before, after = self.known, None
        tests: list[tuple[Expression | None, Sequence[Statement]]] = []
        for case in node.cases:
            self.known = before
            self._blocks += 1
            test: Expression | None = Number(True, BOOL)
            with _Noting(self):
                values = self._cases(case.pattern)
                if rest - {None} and case.guard is None:
                    rest -= {getattr(value, "value", None) for value in values}
                test = self._is_one_of(subject, values) if values and rest else None
                if case.guard is not None:
                    guard = self.condition(case.guard)
                    test = guard if test is None else Operation(tree.AND, (test, guard), BOOL)
            tests.append((test, self._block(case.body)))
            after = _both(after, self.known)
            if test is None:
                break
        self._blocks -= len(tests)
        self.known = _both(after, before) if tests[-1][0] is not None else after
        orelse: Sequence[Statement] = ()
        for test, body in reversed(tests):
            orelse = body if test is None else [tree.If(test, body, orelse)]
        statements += orelse

    def _cases(self, pattern: ast.pattern) -> list[Expression]:
        """Return the values of a case; empty for the default case."""
        if isinstance(pattern, ast.MatchAs) and pattern.pattern is None and pattern.name is None:
            return []
        if isinstance(pattern, ast.MatchOr):
            cases = [self._cases(alternative) for alternative in pattern.patterns]
            return [value for values in cases for value in values] if all(cases) else []
        if isinstance(pattern, ast.MatchValue):
            value = self.expression(pattern.value)
            if is_whole(value.type):
                return [value]
        raise _Outside(pattern, "a case other than an int, a member of an enumeration or _")

    def _is_one_of(self, subject: Expression, values: Sequence[Expression]) -> Expression:
        tests = [Operation(tree.EQUAL, (subject, value), BOOL) for value in values]
        return tests[0] if len(tests) == 1 else Operation(tree.OR, tests, BOOL)

    def _while_statement(self, node: ast.While, statements: list[Statement]) -> None:
        if node.orelse:
            raise self._cannot(node.orelse[0], "else of a while")
        is_endless = isinstance(node.test, ast.Constant) and node.test.value == 1
        inside = [n for statement in node.body for n in ast.walk(statement)]
        if is_endless:
            if not any(isinstance(n, (ast.Break, ast.Return, ast.Raise)) for n in inside):
                raise _Outside(node, "a while that nothing ends: write break, or a condition")
        elif not _names(node.test) & {*_stored(*node.body)}:
            raise self._cannot(node, "a while that changes nothing in its condition")
        self._before = None
        before = self.known
        test: Expression = Number(True, BOOL)
        with _Noting(self):
            test = self.condition(node.test)
        self._ends.append(None)
        body = self._block(node.body)
        end = self._ends.pop()
        self.known = end if is_endless else before
        statements.append(tree.While(test, body))

    def _for_statement(self, node: ast.For, statements: list[Statement]) -> None:
        if node.orelse:
            raise self._cannot(node.orelse[0], "else of a for")
        self._check_target(node.target)
        changed = {*_stored(*node.body), *_names(node.target)}
        first = _first_name(node.target)

        def hold(value: Expression, source: ast.expr, word: str) -> Expression:
            """Store a value that the body could change, or that would be evaluated in each turn."""
            if word == "start" or (_is_fixed(value) and not _names(source) & changed):
                return value
            return self._kept(value, f"{first}_{word}")

        try:
            loop = self._loop(node, hold)
        except (_Outside, _Follows):
            before = self.known
            self._forget(node.target)
            self._ends.append(None)
            self._block(node.body)
            self._ends.pop()
            self.known = before
            raise
        before = self.known
        used = {*_free(*node.body), *_stored(*node.body), *self._beyond_loops}
        stores = self._turn(node, loop, used)
        inside = self.known
        self._ends.append(None)
        body = self._block(node.body)
        self._ends.pop()
        if before is not None and inside is not None:
            after = {name: inside[name] for name, _ in loop.bound if name in self._beyond_loops}
            self.known = {**before, **after}
            self.known = self.known if loop.turns else _both(before, self.known)
        statements.append(loop.made([*stores, *body]))

    def _turn(
        self, node: ast.For | ast.comprehension, loop: _Loop, used: Set[str]
    ) -> Sequence[Statement]:
        """Return the first statements in each turn of a loop, which assign the names in use."""
        bound, counter = dict(loop.bound), loop.counter
        names = [name for name, value in loop.bound if value is counter]
        other = {*self._beyond_loops, *(self.known or ()), *_stored(*getattr(node, "body", ()))}
        if names and names[0] not in other:
            counter.name = self._variable(names[0], INT)
            self._know(names[0], INT)
            del bound[names[0]]
        else:
            counter.name = self._unused(f"{_first_name(node.target)}_at")
        return [self._store(node, [each]) for each in bound.items() if each[0] in used]

    # Nested functions

    def _functiondef_statement(self, node: ast.FunctionDef, statements: list[Statement]) -> None:
        if self._counts[node.name] > (node.name not in self.made.arguments):
            raise _Outside(node, f"{node.name} is given a value twice: use two names")
        own = _own(node)
        free = _free(node)
        if node.name in free:
            raise _Outside(node, f"{node.name} calls itself")
        captured = self._captured(node, free, own)
        for name in captured:
            if self._counts[name] > (name not in self.made.arguments):
                raise _Outside(node, f"{name}, which {node.name} uses, is changed")
        inner = self._inner(node.name, own, node)
        inner.build({}, {name: self._local(node, name).type for name in captured})
        names, given = [argument.arg for argument in _arguments(node)], node.args
        types = {name: inner.made.arguments[name] for name in names}
        n = len(names) - len(given.kwonlyargs)
        defaults = [*zip(names[n - len(given.defaults) : n], given.defaults)]
        defaults += [(name, value) for name, value in zip(names[n:], given.kw_defaults) if value]
        values = {}
        for name, default in defaults:
            value = self._sometimes(partial(self.fitting, wanted=types[name]), default)
            if value.fails or _names(default) & {*self.names, *self.functions}:
                raise _Outside(default, f"the default value of {name} is not a constant")
            values[name] = value
        takes = _Signature("", node.name, types, len(given.posonlyargs), n, values)
        called = _Callable(inner.made, takes, captured)
        self.functions = {**self.functions, node.name: called}
        self._know(node.name, NOTHING)

    def _captured(self, node: ast.AST, names: Sequence[str], own: Set[str]) -> list[str]:
        """Return the variables that a nested function uses, also in functions that it calls."""
        self._check_functions(names)
        captured = {name: called.captured for name, called in self.functions.items()}
        used = [n for name in names for n in (name, *captured.get(name, ()))]
        needed = [n for n in dict.fromkeys(used) if n in self.names and n not in self.functions]
        for name in needed:
            if name in own:
                raise _Outside(node, f"{name} has two meanings here: rename one")
        return needed

    def _check_functions(self, names: Sequence[str]) -> None:
        """Refuse local functions that may be undefined."""
        for name in names:
            if name in self.functions and not self._is_known(name):
                raise _Outside(ast.Pass(), f"{name} may have no value here")

    def _is_known(self, name: str) -> bool:
        return self.known is None or name in self.known

    def _inner(self, word: str, own: set[str], node: ast.FunctionDef | None = None) -> _Builder:
        """Return the builder of a nested function."""
        name, sizes = f"{self.made.name}_{word}", self.made.sizes
        made = Function(self.made.module, name, {}, sizes=sizes, path=self.path)
        inner = _Builder(self.program, self.path, self.scope, made, node)
        inner.functions = {
            name: called
            for name, called in self.functions.items()
            if self._is_known(name) and name not in own
        }
        inner._taken = {*self._taken, *own}
        return inner

    # Assignments

    def _assign_statement(self, node: ast.Assign, statements: list[Statement]) -> None:
        for target in node.targets:
            self._check_target(target)
        value: ast.expr = node.value
        if len(node.targets) == 1:
            self._assign(node.targets[0], value, statements)
            return
        held = self._kept(self.expression(value), "all")
        for target in node.targets:
            statements += self._take_apart(target, held)

    def _annassign_statement(self, node: ast.AnnAssign, statements: list[Statement]) -> None:
        self._check_target(node.target)
        assert isinstance(node.target, ast.Name)
        if node.value is None:
            raise self._cannot(node, word_of(node))
        type_ = self._hinted(node, node.annotation, node.target.id)
        statements.append(self._store(node, [(node.target.id, self.fitting(node.value, type_))]))

    def _augassign_statement(self, node: ast.AugAssign, statements: list[Statement]) -> None:
        self._check_target(node.target)
        assert isinstance(node.target, ast.Name)
        target = ast.copy_location(ast.Name(node.target.id, ast.Load()), node)
        changed = ast.copy_location(ast.BinOp(target, node.op, node.value), node)
        statements.append(self._store(node, [(target.id, self.expression(changed))]))

    def _check_target(self, node: ast.expr) -> None:
        if isinstance(node, (ast.Tuple, ast.List)):
            if isinstance(node, ast.List):
                raise self._cannot(node, f"an assignment to {word_of(node)}")
            parts = [part for part in ast.walk(node) if isinstance(part, ast.Name)]
            names = [part.id for part in parts if part.id != "_"]
            if len(names) != len({*names}):
                raise self._cannot(node, "a name twice in one assignment")
            for element in node.elts:
                self._check_target(element)
        elif not isinstance(node, ast.Name):
            is_of_matrix = isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple)
            what = f"{word_of(node)} of a matrix" if is_of_matrix else word_of(node)
            raise self._cannot(node, f"an assignment to {what}")

    def _assign(self, target: ast.expr, value: ast.expr, statements: list[Statement]) -> None:
        if isinstance(target, ast.Name) and target.id == "_":
            statements.append(tree.Do(self.expression(value)))
        elif isinstance(target, ast.Name) and (change := self._change_of(target, value)):
            statements.append(change)
        elif isinstance(target, ast.Name):
            wanted = (self.known or {}).get(target.id)
            statements.append(self._store(target, [(target.id, self.expression(value, wanted))]))
        elif (
            isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            and len(target.elts) == len(value.elts)
            and not any(isinstance(element, ast.Starred) for element in value.elts)
        ):  # fmt: skip
            pairs = [*zip(target.elts, value.elts)]
            if _names(target) & _names(value):
                # All values are computed before the first is stored.
                values = [
                    self._kept(self.expression(element), f"next_{i}")
                    for i, (_, element) in enumerate(pairs)
                ]
                for (element, _), held in zip(pairs, values):
                    statements += self._take_apart(element, held)
            elif all(isinstance(name, ast.Name) and name.id != "_" for name, _ in pairs):
                made = [(ast.unparse(name), self.expression(element)) for name, element in pairs]
                statements.append(self._store(target, made))
            else:
                for name, element in pairs:
                    self._assign(name, element, statements)
        else:
            made_of = self.expression(value)
            # Store the value if an assignment could change parts that are read later.
            if not _is_fixed(made_of) or _names(target) & _names(value):
                made_of = self._kept(made_of, self._name_of_all(target, value))
            statements += self._take_apart(target, made_of)

    def _change_of(self, target: ast.Name, value: ast.expr) -> Statement | None:
        """Return the change of an element if the assignment only replaces one: it needs no copy."""
        method = value.func if isinstance(value, ast.Call) else None
        is_same = (
            isinstance(method, ast.Attribute) and method.attr == "replaced"
            and isinstance(method.value, ast.Name) and method.value.id == target.id
        )  # fmt: skip
        if not is_same or target.id not in (self.known or {}):
            return None
        assert isinstance(value, ast.Call) and isinstance(method, ast.Attribute)
        owner = self.expression(method.value)
        if not (isinstance(owner, Local) and is_algebraic(owner.type)):
            return None
        self._check_plain(value, method.attr, 2)
        place, element = self._replacing(value, owner.type)
        assert isinstance(owner.type, Array)
        at = Operation(tree.PLACE, (place, int_of(owner.type.n)), INT)
        return tree.StoreItem(target.id, [at], element)

    def _name_of_all(self, target: ast.expr, value: ast.expr) -> str:
        """Return a name for a value that is unpacked: the name of its function, or `all`."""
        name = ast.unparse(value.func).rsplit(".")[-1] if isinstance(value, ast.Call) else "all"
        return _stem(name) or "all"

    def _take_apart(self, target: ast.expr, value: Expression) -> list[Statement]:
        made = list(self._taken_apart(target, value))
        return [self._store(target, made)] if made else []

    def _taken_apart(self, target: ast.expr, value: Expression) -> Iterator[tuple[str, Expression]]:
        """Yield the names in a target, each with its part of a value."""
        if isinstance(target, ast.Name):
            if target.id != "_":
                yield target.id, value
            return
        assert isinstance(target, ast.Tuple)
        parts = self._parts_of(target, value)
        if len(parts) != len(target.elts):
            raise _Outside(target, f"{len(target.elts)} names for {len(parts)} values")
        for name, part in zip(target.elts, parts):
            yield from self._taken_apart(name, part)

    def _parts_of(self, node: ast.AST, value: Expression) -> list[Expression]:
        """Return the elements of a value."""
        if isinstance(value.type, Array):
            return [Item(value, int_of(i)) for i in range(value.type.n)]
        if isinstance(value.type, Record):
            return [Field(value, name, part) for name, part in value.type.fields]
        raise _Outside(node, f"{value.type.word} is taken apart")

    def _store(self, node: ast.AST, values: Sequence[tuple[str, Expression]]) -> tree.Store:
        """Return the statement that assigns values to names, in order."""
        stores = []
        for name, value in values:
            known = (self.known or {}).get(name)
            value = _as_wanted(value, known)
            if known and known != value.type:
                raise _Outside(node, self._other(name, known, value))
            stores.append((self._variable(name, value.type), value))
            self._know(name, value.type)
        return tree.Store(stores)

    def _other(self, name: str, before: Type, value: Expression) -> str:
        if UNKNOWN in (before, value.type):
            raise _Follows
        if before == FLOAT and is_whole(value.type):
            better = f"{value.value}.0" if isinstance(value, Number) else "float(...)"
            return f"{name} is a float and gets an int: write {better}"
        if is_whole(before) and value.type == FLOAT:
            return f"{name} is {before.word} and gets a float: begin with a float, such as 0.0"
        return f"{name} is {before.word} and gets {value.type.word}: use another name"

    def _know(self, name: str, type_: Type) -> None:
        """Mark a name as known from here on."""
        if self.known is not None:
            self.known = {**self.known, name: type_}

    def _forget(self, node: ast.AST) -> None:
        """Mark the names in a refused statement as unknown from here on."""
        for name in _stored(node):
            self._know(name, UNKNOWN)

    def _variable(self, name: str, type_: Type) -> str:
        """Return the variable of the tree for a name with values of a type."""
        if (name, type_) not in self._variables:
            is_first = name not in self._variables.values()
            self._variables[name, type_] = name if is_first else self._unused(name)
        return self._variables[name, type_]

    def _unused(self, name: str) -> str:
        """Return a new name for the tree."""
        names = chain([name], (f"{name}_{number}" for number in count(2)))
        free = next(n for n in names if n not in self._taken)
        self._taken.add(free)
        return free

    def _held(self, value: Expression, name: str) -> Expression:
        """Return a value that may be used several times: a variable, if it must be computed."""
        return value if _is_fixed(value) else self._kept(value, name)

    def _kept(self, value: Expression, name: str) -> Expression:
        """Store a value in a new variable."""
        if self._before is None:
            raise _Outside(ast.Pass(), "this is computed only in some cases: give it a name before")
        local = self._unused(name)
        self._before.append(tree.Store([(local, value)]))
        return Local(local, value.type)

    # Exceptions that a component raises

    def _raise_statement(self, node: ast.Raise, statements: list[Statement]) -> None:
        try:
            statements.append(self._raised(node, node.exc))
        finally:
            self.known = None

    def _raised(self, node: ast.Raise, call: ast.expr | None) -> tree.Raise:
        if not _is_none(node.cause):
            raise self._cannot(node, "a raise with from")
        if not isinstance(call, ast.Call) or len(call.args) != 1 or call.keywords:
            raise self._cannot(node, "a raise without a text")
        kind = self._global_value(call.func)
        is_known = is_class(kind, BaseException) and issubclass(kind, _EXCEPTIONS)
        changed = [
            value for base in getattr(kind, "__mro__", ()) if base is not Refusal
            for value in vars(base).values() if isinstance(value, FunctionType)
        ]  # fmt: skip
        if not is_known or changed or kind.__str__ is not BaseException.__str__:
            what = ast.unparse(call.func)
            raise _Outside(node, f"{what} may not be raised: write raise Refusal(...)")
        head = "" if issubclass(kind, Refusal) else f"{kind.__name__}: "
        return tree.Raise([head, *self._message(call.args[0])])

    def _message(self, text: ast.expr) -> list[str | tuple[Expression, str]]:
        """Return the texts and values of a message."""
        if not isinstance(text, ast.JoinedStr):
            if not (isinstance(text, ast.Constant) and isinstance(text.value, str)):
                raise self._cannot(text, "a raise without a text")
            text = ast.copy_location(ast.JoinedStr([text]), text)
        parts: list[Any] = []
        for part in text.values:
            if isinstance(part, ast.FormattedValue):
                parts.append(self._formatted(part))
            else:
                parts.append(_text(ast.literal_eval(part)).value)
        return parts

    def _formatted(self, part: ast.FormattedValue) -> tuple[Expression, str]:
        """Return a value in a message, and its format."""
        value = self.expression(part.value)
        if part.conversion not in ((-1,) if part.format_spec else (-1, ord("s"))):
            raise _Outside(part.value, f"!{chr(part.conversion)} in a text: leave it out")
        if any(isinstance(x, ast.FormattedValue) for x in getattr(part.format_spec, "values", ())):
            raise _Outside(part.value, "a format that is computed")
        how = "".join(ast.literal_eval(x) for x in getattr(part.format_spec, "values", ()))
        if value.type in (TEXT, BOOL) and not how:
            return value, ""
        if is_whole(value.type) and how in ("", "d"):
            return _as_int(value), "d"
        if is_number(value.type) and NUMBER_FORMAT.fullmatch(how):
            return self._float(value), how
        name = ast.unparse(part.value)
        better = f": write {{{name}:g}}" if is_number(value.type) else ""
        raise _Outside(part.value, f"{{{name}}} in a text{better}")

    # Loops

    def _loop(self, node: ast.For | ast.comprehension, hold: _Hold) -> _Loop:
        """Return the head of a loop."""
        counter = Local("", INT)
        called, call = self._called(node.iter)
        if not call or called is not range:
            bound, n = self._items(node.target, node.iter, counter, hold)
            return _Loop(counter, int_of(0), int_of(n), 1, n, bound)
        if not isinstance(node.target, ast.Name):
            raise _Outside(node.target, "more than one name for the numbers of a range")
        bounds = self._bounds(call)
        first, last, step = map(_value, bounds)
        if not step:
            raise _Outside(call, "a step of a range that is not a constant other than 0")
        start, stop = hold(bounds[0], call, "start"), hold(bounds[1], call, "stop")
        turns = None if first is None or last is None else len(range(first, last, step))
        is_wide = abs(step) > 1 and (last is None or abs(last + step) >= 2**31)
        number: Expression = Operation(tree.NARROW, (counter,), INT) if is_wide else counter
        bound = [] if node.target.id == "_" else [(node.target.id, number)]
        return _Loop(counter, start, stop, step, turns, bound, is_wide)

    def _called(self, node: ast.expr) -> tuple[Any, ast.Call | None]:
        return (self._global_value(node.func), node) if isinstance(node, ast.Call) else (None, None)

    def _bounds(self, call: ast.Call) -> list[Expression]:
        """Return the bounds and the step of a range."""
        self._check_plain(call, "range")
        if not 1 <= len(call.args) <= 3:
            raise _Outside(call, f"range with {len(call.args)} arguments")
        bounds = [self._bound_of(argument) for argument in call.args]
        if len(bounds) == 1:
            bounds = [int_of(0), *bounds]
        return [*bounds, int_of(1)][:3]

    def _bound_of(self, node: ast.expr) -> Expression:
        """Return a bound of a range; an expression of constants becomes a number."""
        value = self._size(node)
        if value is None:
            return self._integer(node, "a bound of a range")
        check_int(value)
        return int_of(value)

    def _items(
        self, target: ast.expr, iterable: ast.expr, place: Expression, hold: _Hold
    ) -> tuple[list[tuple[str, Expression]], int]:
        """Return names with their values in a turn, and the number of turns."""
        called, call = self._called(iterable)
        if call and called in (zip, enumerate):
            return self._side_by_side(target, call, called, place, hold)
        is_back = called is reversed
        if call and is_back:
            self._check_plain(call, "reversed", 1)
            [iterable] = call.args
            called, call = self._called(iterable)
        if call and called is range:
            first, stop, step = map(_value, self._bounds(call))
            if first is None or stop is None or not step:
                raise _Outside(call, "a range of other than constants, with something beside it")
            numbers = range(first, stop, step)[:: -1 if is_back else 1]
            if abs(step) * len(numbers) >= 2**31:
                raise _Outside(call, "a range of so many numbers, with something beside it")
            item = _count(numbers.start, place, numbers.step)
            return [*self._taken_apart(target, item)], len(numbers)
        value = hold(self._array(iterable), iterable, "all")
        assert isinstance(value.type, Array)
        at = _count(value.type.n - 1, place, -1) if is_back else place
        return [*self._taken_apart(target, Item(value, at))], value.type.n

    def _array(self, node: ast.expr) -> Expression:
        value = self.expression(node)
        if not isinstance(value.type, Array):
            what = "a loop over something other than a range, vector or tuple of one type"
            raise _Outside(node, what)
        return value

    def _side_by_side(
        self,
        target: ast.expr,
        call: ast.Call,
        called: Any,
        place: Expression,
        hold: _Hold,
    ) -> tuple[list[tuple[str, Expression]], int]:
        """Return the names and values of `zip` and `enumerate`."""
        starts = [named for named in call.keywords if called is enumerate and named.arg == "start"]
        given = [*call.args, *(named.value for named in starts)]
        others = [named for named in call.keywords if named not in starts]
        self._check_plain(ast.copy_location(ast.Call(call.func, given, others), call),
                          called.__name__)  # fmt: skip
        if not isinstance(target, ast.Tuple):
            raise _Outside(target, f"{called.__name__} without a name for each part")
        names = target.elts
        if called is zip:
            if len(names) != len(given) or not given:
                raise _Outside(target, "another number of names than zip has parts")
            pairs = [self._items(t, i, place, hold) for t, i in zip(names, given)]
            return [binding for bound, _ in pairs for binding in bound], min(n for _, n in pairs)
        if len(names) != 2 or not 1 <= len(given) <= 2:
            raise _Outside(target, "enumerate of other than two names, and a start")
        first = self._size(given[1]) if given[1:] else 0
        if first is None:
            raise _Outside(call, "enumerate with a start that is not a constant")
        bound, n = self._items(names[1], given[0], place, hold)
        check_int(first)
        check_int(first + max(n - 1, 0))
        return [*self._taken_apart(names[0], _count(first, place, 1)), *bound], n

    # Expressions

    def expression(self, node: ast.expr, wanted: Type | None = None) -> Expression:
        """Return an expression as a tree; `wanted` is its type if several are possible."""
        name = f"_{type(node).__name__.lower()}"
        if not hasattr(self, name):
            raise self._cannot(node, word_of(node))
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _Outside(node, f"an expression of {_DEEPEST} levels: take it apart")
        try:
            expression: Expression = getattr(self, name)(node, wanted)
        except (_Outside, _Follows) as error:
            if isinstance(error, _Outside) and not hasattr(error.node, "lineno"):
                error.node = node
            raise
        except Exception as error:
            raise _Outside(node, _message_of(error)) from None
        finally:
            self._depth -= 1
        if expression.type == UNKNOWN:
            raise _Follows
        if expression.type == NOTHING != wanted:
            raise _Outside(node, "what returns nothing is used as a value")
        return expression

    def fitting(self, node: ast.expr, wanted: Type | None) -> Expression:
        """Return an expression of exactly this type."""
        return self._fit(node, self.expression(node, wanted), wanted)

    def _fit(self, node: ast.AST, value: Expression, wanted: Type | None) -> Expression:
        """Return a value, if it has exactly this type, or can be converted to it."""
        value = _as_wanted(value, wanted)
        if wanted is None or value.type == wanted:
            return value
        if wanted == UNKNOWN:
            raise _Follows
        if wanted == FLOAT and is_whole(value.type):
            text = ast.unparse(node)
            better = f"{text}.0" if text.removeprefix("-").isdecimal() else f"float({text})"
            raise _Outside(node, f"{text} is an int where a float is wanted: write {better}")
        if value.type == INT and isinstance(wanted, Scalar) and wanted.made:
            what = f"an int where {wanted.word} is wanted: write {wanted.made.__name__}(...)"
            raise _Outside(node, what)
        raise _Outside(node, f"{value.type.word} where {wanted.word} is wanted")

    def _number(self, node: ast.expr, value: Expression | None = None) -> Expression:
        """Return an operand as a float."""
        if isinstance(node, ast.Constant) and type(node.value) is int:
            return Number(float(node.value), FLOAT)
        value = value or self.expression(node)
        if not is_number(value.type):
            raise _Outside(node, f"{value.type.word} where a number is wanted")
        return self._float(value)

    def _float(self, value: Expression) -> Expression:
        if value.type == FLOAT:
            return value
        return Operation(tree.TO_FLOAT, (value,), FLOAT)

    def _integer(self, node: ast.expr, what: str) -> Expression:
        """Return an expression that must be an int."""
        value = self.expression(node)
        if not is_whole(value.type):
            raise _Outside(node, f"{what} that is {value.type.word}, not an int")
        return value

    def _sometimes(self, make: Callable[[ast.expr], Expression], node: ast.expr) -> Expression:
        """Return an expression that may not be evaluated."""
        before, self._before = self._before, None
        try:
            return make(node)
        finally:
            self._before = before

    def _check_plain(self, node: ast.Call, word: str, n: int | None = None) -> None:
        """Check that a call has only positional arguments."""
        if node.keywords:
            raise _Outside(node, f"{word} with {node.keywords[0].arg or '**'}=")
        if any(isinstance(argument, ast.Starred) for argument in node.args):
            raise _Outside(node, f"{word} with a star")
        if n is not None and len(node.args) != n:
            raise _Outside(node, f"{word} with {len(node.args)} arguments")

    # Names and constants

    def _global_value(self, node: ast.expr) -> Any:
        """Return the value of a global name; None for a local name or an expression."""
        if isinstance(node, ast.Name) and node.id not in self.names | self.functions.keys():
            builtins: Any = self.scope.get("__builtins__", {})
            builtins = builtins if isinstance(builtins, dict) else vars(builtins)
            return self.scope.get(node.id, builtins.get(node.id))
        if isinstance(node, ast.Attribute):
            owner = self._global_value(node.value)
            if isinstance(owner, ModuleType) or is_class(owner, IntEnum):
                return getattr(owner, node.attr, None)
        return None

    def _folded(self, node: ast.expr) -> float | None:
        """Return the number of an expression of constants; None for other expressions."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            operand = self._folded(node.operand)
            return None if operand is None else -operand
        if isinstance(node, ast.BinOp) and type(node.op) in _FOLDED:
            left, right = self._folded(node.left), self._folded(node.right)
            if left is None or right is None:
                return None
            with suppress(ArithmeticError):
                return _FOLDED[type(node.op)](left, right)
            return None
        if (
            isinstance(node, ast.Call) and self._global_value(node.func) is len
            and not any(isinstance(part, ast.Call) for x in node.args for part in ast.walk(x))
        ):  # fmt: skip
            size = self.expression(node)
            return int(size.value) if isinstance(size, Number) else None
        value = node.value if isinstance(node, ast.Constant) else self._global_value(node)
        return value if type(value) in (int, float) else None  # type: ignore[return-value]

    def _size(self, node: ast.expr | None) -> int | None:
        """Return the int of an expression of constants; None for other expressions."""
        value = None if node is None else self._folded(node)
        return value if isinstance(value, int) else None

    def _constant(self, node: ast.Constant, wanted: Type | None) -> Expression:
        value: Any = node.value
        if isinstance(value, str):
            return _text(value)
        if type(value) not in (bool, int, float):
            raise self._cannot(node, f"the constant {value!r}")
        if type(value) is int:
            check_int(value)
        return Number(value, type_of_value(value, ""))

    def _name(self, node: ast.Name, wanted: Type | None) -> Expression:
        if node.id == "_":
            raise self._cannot(node, "a value of _")
        if node.id in self.functions and node.id not in self.names:
            raise _Outside(node, f"{node.id} is a function: call it")
        if node.id not in self.names:
            return self._of_module(node)
        return self._local(node, node.id)

    def _local(self, node: ast.AST, name: str) -> Expression:
        if self.known is None or name not in self.known:
            raise _Outside(node, f"{name} may have no value here")
        type_ = self.known[name]
        if type_ == UNKNOWN:
            raise _Follows
        if name in self.functions:
            raise _Outside(node, f"{name} is a function: call it")
        return Local(self._variable(name, type_), type_)

    def _of_module(self, node: ast.expr) -> Expression:
        name = node.id if isinstance(node, ast.Name) else ast.unparse(node).rsplit(".")[-1]
        value = self._global_value(node)
        if value is None:
            what = f"the name {ast.unparse(node)}"
            if advice(what):
                raise self._cannot(node, what)
            raise _Outside(node, f"{what} is not known here")
        if isinstance(value, ModuleType):
            what = f"the module {value.__name__}"
            raise _Outside(node, f"{what} is not a value: name a part of it")
        if callable(value):
            raise self._cannot(node, f"the name {ast.unparse(node)}")
        if any(value is getattr(math, constant) for constant in CONSTANTS):
            return Number(value, FLOAT)
        owner = self._global_value(node.value) if isinstance(node, ast.Attribute) else None
        module = owner.__name__ if isinstance(owner, ModuleType) else self.scope["__name__"]
        if isinstance(value, IntEnum):
            module, name = type(value).__module__, f"{type(value).__name__}_{value.name}"
        return self._constant_of(module, name, value)

    def _constant_of(
        self, module: str, name: str, value: Any, wanted: Type | None = None
    ) -> Expression:
        constants, key = self.program.constants, (name, id(value), wanted)
        if key not in constants:
            type_ = wanted or type_of_value(value, name)
            check_value(value, type_, name)
            constants[key] = tree.Constant(module, name, value, type_)
        return constants[key]

    def _attribute(self, node: ast.Attribute, wanted: Type | None) -> Expression:
        owner = self._global_value(node.value)
        if isinstance(owner, ModuleType) or is_class(owner, IntEnum):
            return self._of_module(node)
        value = self.expression(node.value)
        if node.attr == "T" and is_algebraic(value.type) and len(sizes(value.type)) == 2:
            return arrays.transpose(self.program.functions, value)
        if isinstance(value.type, Record) and value.type.made:
            for name, part in value.type.fields:
                if name == node.attr:
                    return Field(value, name, part)
        raise _Outside(node, f"{node.attr} is not a field of {value.type.word}")

    # Elements

    def _subscript(self, node: ast.Subscript, wanted: Type | None) -> Expression:
        value = self.expression(node.value)
        if isinstance(node.slice, ast.Slice):
            return self._slice(node, node.slice, value)
        if not isinstance(node.slice, ast.Tuple):
            return self._element(node, node.slice, value)
        if getattr(value.type, "made", None) is not Matrix:
            raise _Outside(node, f"two subscripts of {value.type.word}")
        if len(node.slice.elts) != 2:
            raise _Outside(node, f"{len(node.slice.elts)} subscripts of {value.type.word}")
        for place in node.slice.elts:
            if isinstance(place, ast.Slice):
                raise _Outside(node, "a slice of a Matrix: its column j is A.T[j], its row i A[i]")
            value = self._element(node, place, value)
        return value

    def _element(self, node: ast.Subscript, place: ast.expr, value: Expression) -> Expression:
        type_ = value.type
        n = type_.n if isinstance(type_, Array) else len(parts_of(type_))
        key = self._size(place)
        if key is not None and key in range(-n, n):
            if isinstance(type_, Array):
                return Item(value, int_of(key % n))
            assert isinstance(type_, Record)
            return Field(value, *type_.fields[key])
        is_written = isinstance(place, (ast.Constant, ast.UnaryOp))
        if key is not None and (is_written or isinstance(type_, Record)):
            raise _Outside(node, f"there is no element {ast.unparse(place)} here")
        if not isinstance(type_, Array):
            kinds = {*parts_of(type_)}
            what = "something other than a tuple of parts of one type"
            if kinds == {FLOAT, INT} and not getattr(type_, "made", None):
                what = "a tuple of ints and floats: write all of them as floats"
            raise _Outside(node, f"a computed subscript of {what}")
        where = self._integer(place, "a subscript")
        return Item(value, Operation(tree.PLACE, (where, int_of(n)), INT))

    def _slice(self, node: ast.Subscript, places: ast.Slice, value: Expression) -> Expression:
        if getattr(value.type, "made", None) is Matrix:
            raise _Outside(node, "a slice of a Matrix: write Matrix((A[0], A[1]))")
        parts = self._sliced(node, places, value)
        if is_algebraic(value.type):
            return Make(vector(len(parts)), parts)
        return Make(tuple_of([part.type for part in parts]), parts)

    def _sliced(
        self, node: ast.Subscript, places: ast.Slice, value: Expression
    ) -> list[Expression]:
        """Return the elements of a constant slice."""
        bounds = [places.lower, places.upper, places.step]
        numbers = [self._size(bound) for bound in bounds]
        are_known = all(n is not None or bound is None for n, bound in zip(numbers, bounds))
        if not are_known or not isinstance(value.type, (Array, Record)):
            raise _Outside(node, "a slice other than a constant one of a vector or tuple")
        if numbers[2] == 0:
            raise _Outside(node, "a slice with a step of 0")
        parts = self._parts_of(node, self._held(value, "all"))[slice(*numbers)]
        if not parts:
            raise _Outside(node, "a slice without elements")
        return parts

    # Tuples

    def _tuple(self, node: ast.Tuple, wanted: Type | None) -> Expression:
        types = parts_of(wanted) if wanted is not None and not getattr(wanted, "made", 1) else ()
        values = self._elements(node.elts, types)
        made = wanted if types else tuple_of([value.type for value in values])
        assert made is not None
        if len(values) != len(parts_of(made)):
            raise _Outside(node, f"{len(values)} values for {len(parts_of(made))}")
        return Make(made, values)

    def _elements(
        self,
        nodes: Sequence[ast.expr],
        types: Sequence[Type | None],
        make: Callable[[ast.expr, Type | None], Expression] | None = None,
    ) -> list[Expression]:
        """Return expressions, with the elements of starred ones."""
        make = make or self.fitting
        values: list[Expression] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                parts = self._unpacked(node.value)
                wanted = [*types[len(values) :], *[None] * len(parts)]
                values += [self._fit(node, *pair) for pair in zip(parts, wanted)]
            else:
                wanted = [*types[len(values) :], None]
                values.append(make(node, wanted[0]))
        return values

    def _unpacked(self, node: ast.expr) -> list[Expression]:
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice):
            return self._sliced(node, node.slice, self.expression(node.value))
        return self._parts_of(node, self._held(self.expression(node), "all"))

    # Operators

    def _binop(self, node: ast.BinOp, wanted: Type | None) -> Expression:
        if isinstance(node.left, ast.Tuple):
            parts = self._listed(node, self.fitting)
            if parts is not None:
                return self._collected(node, tuple, parts)
        left = self.expression(node.left)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left)
        right = self.expression(node.right)
        if is_algebraic(left.type) or is_algebraic(right.type):
            return self._of_arrays(node, left, right)
        for side, value in ((node.left, left), (node.right, right)):
            if not is_number(value.type):
                raise _Outside(side, f"{value.type.word} where a number is wanted")
        if type(node.op) not in _ARITHMETIC:
            raise self._cannot(node, f"the operator {word_of(node.op)}")
        of_floats, of_ints = _ARITHMETIC[type(node.op)]
        if FLOAT not in (left.type, right.type):
            type_ = FLOAT if isinstance(node.op, ast.Div) else INT
            return Operation(of_ints, (left, right), type_)
        operands = self._number(node.left, left), self._number(node.right, right)
        if of_floats is tree.DIVIDE and isinstance(operands[1], Number) and operands[1].value:
            of_floats = tree.OVER
        return Operation(of_floats, operands, FLOAT)

    def _power(self, node: ast.BinOp, base: Expression) -> Expression:
        exponent = self._folded(node.right)
        if exponent is None or not float(exponent).is_integer():
            raise self._cannot(node, "** with other than a whole constant")
        if not is_number(base.type):
            raise _Outside(node.left, f"{base.type.word} where a number is wanted")
        if is_whole(base.type) and isinstance(exponent, int) and exponent >= 0:
            check_int(exponent)
            return Operation(tree.INT_POWER, (base, int_of(exponent)), INT)
        operands = self._number(node.left, base), Number(float(exponent), FLOAT)
        return Operation(tree.POWER, operands, FLOAT)

    def _of_arrays(self, node: ast.BinOp, left: Expression, right: Expression) -> Expression:
        operands = [
            self._number(side, value) if is_number(value.type) else value
            for side, value in ((node.left, left), (node.right, right))
        ]
        found = arrays.binary(self.program.functions, node.op, operands[0], operands[1])
        if found is None:
            sign = ast.unparse(ast.BinOp(ast.Name("a"), node.op, ast.Name("b")))[2:-2]
            what = f"{left.type.word} {sign} {right.type.word} is not defined"
            raise _Outside(node, what)
        return found

    def _unaryop(self, node: ast.UnaryOp, wanted: Type | None) -> Expression:
        if isinstance(node.op, ast.Not):
            return Operation(tree.NOT, (self.condition(node.operand),), BOOL)
        if isinstance(node.op, ast.Invert):
            raise self._cannot(node, f"the operator {word_of(node.op)}")
        is_minus = isinstance(node.op, ast.USub)
        if is_minus and isinstance(node.operand, ast.Constant) and type(node.operand.value) is int:
            check_int(-node.operand.value)
            return Number(-node.operand.value, INT)
        operand = self.expression(node.operand)
        if is_algebraic(operand.type) and is_minus:
            return arrays.negative(self.program.functions, operand)
        if not is_number(operand.type):
            raise _Outside(node, f"{operand.type.word} where a number is wanted")
        if not is_minus:
            # + turns a bool into an int.
            return operand if operand.type == FLOAT else _as_int(operand)
        if is_whole(operand.type):
            return Operation(tree.INT_NEGATIVE, (operand,), INT)
        return Operation(tree.NEGATIVE, (operand,), FLOAT)

    def condition(self, node: ast.expr) -> Expression:
        """Return an expression as a condition."""
        if isinstance(node, ast.BoolOp):
            return self._joined(node, self.condition)
        value = self.expression(node)
        if value.type == FLOAT:
            return Operation(tree.NOT_EQUAL, (value, Number(0.0, FLOAT)), BOOL)
        if not is_whole(value.type):
            raise _Outside(node, f"{value.type.word} as a condition")
        return value

    def _boolop(self, node: ast.BoolOp, wanted: Type | None) -> Expression:
        def of_bool(operand: ast.expr) -> Expression:
            value = self.expression(operand)
            if value.type != BOOL:
                what = f"{value.type.word} before or after and, or: write a comparison"
                raise _Outside(operand, what)
            return value

        return self._joined(node, of_bool)

    def _joined(self, node: ast.BoolOp, make: Callable[[ast.expr], Expression]) -> Expression:
        first, *others = node.values
        values = [make(first), *(self._sometimes(make, other) for other in others)]
        return Operation(tree.OR if isinstance(node.op, ast.Or) else tree.AND, values, BOOL)

    def _compare(self, node: ast.Compare, wanted: Type | None) -> Expression:
        nodes = [node.left, *node.comparators]
        values = [self.expression(nodes[0]), self.expression(nodes[1])]
        values += [self._sometimes(self.expression, operand) for operand in nodes[2:]]
        parts = []
        for op, left, right, left_value, right_value in zip(
            node.ops, nodes, nodes[1:], values, values[1:]
        ):
            if type(op) not in _COMPARISONS:
                raise self._cannot(node, "a comparison other than of size")
            for side, value in ((left, left_value), (right, right_value)):
                if not is_number(value.type):
                    raise _Outside(side, f"a comparison of {value.type.word}")
            if FLOAT in (left_value.type, right_value.type):
                left_value, right_value = (
                    self._number(left, left_value),
                    self._number(right, right_value),
                )
            parts.append(Operation(_COMPARISONS[type(op)], (left_value, right_value), BOOL))
        return parts[0] if len(parts) == 1 else Operation(tree.AND, parts, BOOL)

    def _ifexp(self, node: ast.IfExp, wanted: Type | None) -> Expression:
        test = self.condition(node.test)
        this, other = (
            self._sometimes(lambda side: self.expression(side, wanted), side)
            for side in (node.body, node.orelse)
        )
        if FLOAT in (this.type, other.type):
            this = self._fit(node.body, this, FLOAT)
            other = self._fit(node.orelse, other, FLOAT)
        elif this.type != other.type and INT in (this.type, other.type):
            # A member of an enumeration is converted to the other value's type, int.
            this, other = self._fit(node.body, this, INT), self._fit(node.orelse, other, INT)
            return Choice(test, _as_int(this), _as_int(other))
        return Choice(test, this, self._fit(node.orelse, other, this.type))

    # Calls

    def _call(  # noqa: PLR0911, for each kind of function
        self, node: ast.Call, wanted: Type | None
    ) -> Expression:
        if isinstance(node.func, ast.Name) and node.func.id in self.names | self.functions.keys():
            return self._call_of(node, node.func.id)
        if not isinstance(node.func, (ast.Name, ast.Attribute)):
            raise self._cannot(node, word_of(node.func))
        called = self._global_value(node.func)
        if called is None and isinstance(node.func, ast.Attribute):
            return self._method(node, node.func)
        if called in (Vector, Matrix, tuple):
            return self._made_array(node, called)
        if isinstance(called, BuiltinFunctionType) and called in BY_FUNCTION:
            return self._mathematics(node, BY_FUNCTION[called])
        for function, make in _BUILT_IN.items():
            if called is function:
                return make(self, node)
        if is_record(called):
            return self._record(node, called)
        if is_class(called, IntEnum):
            return self._member(node, called)
        if isinstance(called, FunctionType) and _is_included(
            called, self.path, self.scope["__name__"]
        ):
            return self._function(node, called)
        what = f"the name {ast.unparse(node.func)}"
        if advice(what):
            raise self._cannot(node, what)
        raise _Outside(node, f"{ast.unparse(node.func)} is not a function of equations")

    def _mathematics(self, node: ast.Call, name: str) -> Expression:
        about = FUNCTIONS[name]
        if about.result == INT:
            return self._of_number(node, name)
        self._check_plain(node, name, about.arguments)
        values = [self._number(argument) for argument in node.args]
        if about.factor:
            return Operation(tree.MULTIPLY, (values[0], Number(about.factor, FLOAT)), FLOAT)
        return Operation(tree.MATHEMATICS[name], values, about.result)

    def _of_number(self, node: ast.Call, name: str) -> Expression:
        """Return a call of a function that takes any number."""
        self._check_plain(node, name, 1)
        value = self.expression(node.args[0])
        if not is_number(value.type):
            raise _Outside(node, f"{name} of {value.type.word}")
        is_float = value.type == FLOAT
        if name == "float":
            return self._float(value)
        if name == "bool":
            return Operation(tree.TO_BOOL, (value,), BOOL)
        if name == "abs":
            return Operation(tree.ABS if is_float else tree.INT_ABS, (value,),
                             FLOAT if is_float else INT)  # fmt: skip
        if not is_float:
            return _as_int(value)
        word = "trunc" if name == "int" else name
        how = tree.NEAREST if name == "round" else tree.MATHEMATICS[word]
        return Operation(tree.TO_INT, (Operation(how, (value,), FLOAT),), INT)

    def _len(self, node: ast.Call) -> Expression:
        self._check_plain(node, "len", 1)
        value = self.expression(node.args[0])
        if not isinstance(value.type, (Array, Record)):
            raise _Outside(node, f"len of {value.type.word}")
        if value.fails:
            self._held(value, "all")
        return int_of(len(parts_of(value.type)))

    def _extreme(self, node: ast.Call, word: str) -> Expression:
        self._check_plain(node, word)
        if len(node.args) == 1:
            if isinstance(node.args[0], ast.GeneratorExp):
                return self._reduced(node.args[0], word)
            value = self.expression(node.args[0])
            if not isinstance(value.type, Array):
                raise _Outside(node, f"{word} of {value.type.word}")
            if not is_number(value.type.item):
                raise _Outside(node, f"{word} of {value.type.item.word}")
            return arrays.extreme(self.program.functions, word, value)
        if not node.args:
            raise _Outside(node, f"{word} without arguments")
        values = [self.expression(argument) for argument in node.args]
        for argument, value in zip(node.args, values):
            if not is_number(value.type):
                raise _Outside(argument, f"{word} of {value.type.word}")
        if any(value.type == FLOAT for value in values):
            values = [
                self._fit(argument, value, FLOAT) for argument, value in zip(node.args, values)
            ]
        elif any(value.type != values[0].type for value in values):
            values = [*map(_as_int, values)]
        extreme = values[0]
        for value in values[1:]:
            extreme = arrays.extreme_of_two(word, extreme, value)
        return extreme

    def _of_generator(self, node: ast.Call, word: str) -> Expression:
        self._check_plain(node, word, 1)
        [given] = node.args
        if not isinstance(given, ast.GeneratorExp):
            if isinstance(given, ast.ListComp):
                raise self._cannot(node, f"{word} of a list")
            raise self._cannot(node, f"the name {word}")
        return self._reduced(given, word)

    # Vectors, matrices and tuples

    def _made_array(self, node: ast.Call, made: Any) -> Expression:
        self._check_plain(node, made.__name__)
        if len(node.args) != 1:
            raise _Outside(node, f"{made.__name__} of other than one argument")
        [given] = node.args
        if isinstance(given, ast.GeneratorExp):
            return self._comprehension(given, made)
        parts = self._listed(given, self._row if made is Matrix else self.fitting)
        if parts is None:
            value = self.expression(given)
            if getattr(value.type, "made", None) is made:
                return value
            parts = self._parts_of(given, self._held(value, "all"))
        if made is not Matrix:
            return self._collected(node, made, parts)
        rows = [self._as_row(given, part) for part in parts]
        if not rows or any(row.type != rows[0].type for row in rows):
            raise _Outside(node, "a Matrix of rows of different lengths")
        return Make(matrix(len(rows), *sizes(rows[0].type)), rows)

    def _listed(
        self, node: ast.expr, make: Callable[[ast.expr, Type | None], Expression]
    ) -> list[Expression] | None:
        """Return the elements of a list or a tuple, which may be repeated; None for others."""
        times: int | None = 1
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            times, node = self._size(node.right), node.left
        if not isinstance(node, (ast.Tuple, ast.List)):
            return None
        if times is None or times < 1:
            raise _Outside(node, "a tuple a number of times that is not a constant above 0")
        if times > 1:
            check_size(f"a tuple of {len(node.elts)} times {times}", times * len(node.elts))
        return self._elements(node.elts, (), make) * times

    def _collected(self, node: ast.AST, made: Any, values: Sequence[Expression]) -> Expression:
        """Return a vector or a tuple of values."""
        if made is tuple:
            return Make(tuple_of([value.type for value in values]), values)
        return Make(vector(len(values)), [self._in_vector(node, value) for value in values])

    def _in_vector(self, node: ast.AST, value: Expression) -> Expression:
        if not is_number(value.type):
            raise _Outside(node, f"{value.type.word} in a Vector")
        return self._float(value)

    def _row(self, node: ast.expr, wanted: Type | None = None) -> Expression:
        if isinstance(node, ast.GeneratorExp):
            return self._comprehension(node, Vector)
        parts = self._listed(node, self.fitting)
        if parts is None:
            return self._as_row(node, self.expression(node))
        return self._collected(node, Vector, parts)

    def _as_row(self, node: ast.expr, value: Expression) -> Expression:
        if getattr(value.type, "made", None) is Vector:
            return value
        return self._collected(node, Vector, self._parts_of(node, self._held(value, "row")))

    # Expressions with a for

    def _comprehension(self, node: ast.GeneratorExp, made: Any) -> Expression:
        """Return a vector, a matrix or a tuple of the values of an expression with a `for`."""
        if node.generators[0].ifs:
            raise _Outside(node, "an if in an expression of a fixed size")

        each = self._in_a_loop(node)
        inner, turns = each.builder, each.loop.turns
        if not turns:
            raise _Outside(node, "a number of elements that is not a constant above 0")
        type_: Array
        if made is Matrix:
            element = inner._row(node.elt)
            type_ = matrix(turns, *sizes(element.type))
        elif made is Vector:
            element = inner._in_vector(node, inner.expression(node.elt))
            type_ = vector(turns)
        else:
            element = inner.expression(node.elt)
            check_size(f"a tuple of {turns}", turns)
            single = tuple_of([element.type])
            assert isinstance(single, Array)
            type_ = replace(single, n=turns)
        elements = Local(inner._unused("elements"), type_)
        before: list[Statement] = [tree.Reserve(elements.name, type_)]
        counts = _value(each.loop.start) == 0 and each.loop.step == 1
        place = each.loop.counter if counts else Local(inner._unused("place"), INT)
        each.block.append(tree.StoreItem(elements.name, [place], element))
        if not counts:
            before.append(tree.Store([(place.name, int_of(0))]))
            following = Operation(tree.COUNT_ADD, (place, int_of(1)), INT)
            each.block.append(tree.Store([(place.name, following)]))
        return each.call(before, elements)

    def _generatorexp(self, node: ast.GeneratorExp, wanted: Type | None) -> Expression:
        raise self._cannot(node, word_of(node))

    def _reduced(self, node: ast.GeneratorExp, word: str) -> Expression:
        """Return `sum`, `min`, `max`, `any` or `all` of an expression with a `for`."""
        each = self._in_a_loop(node)
        inner, loop = each.builder, each.loop
        if word in ("any", "all"):
            is_any = word == "any"
            test = inner.condition(node.elt)
            test = test if is_any else Operation(tree.NOT, (test,), BOOL)
            each.block.append(tree.If(test, [tree.Return(Number(is_any, BOOL))]))
            return each.call((), Number(not is_any, BOOL))
        value = inner.expression(node.elt)
        if not is_number(value.type):
            raise _Outside(node, f"{word} of {value.type.word}")
        if word == "sum":
            if value.type == FLOAT:
                raise self._cannot(node, "sum of floats")
            found = Local(inner._unused("found"), INT)
            next_: Expression = Operation(tree.INT_ADD, (found, value), INT)
        else:
            if each.block is not each.turn or not loop.turns:
                raise _Outside(node, f"{word} of a number of values that is not a constant above 0")
            found = Local(inner._unused("found"), value.type)
            element = Local(inner._unused("each"), value.type)
            each.block.append(tree.Store([(element.name, value)]))
            is_first = Operation(tree.EQUAL, (loop.counter, loop.start), BOOL)
            next_ = Choice(is_first, element, arrays.extreme_of_two(word, found, element))
        each.block.append(tree.Store([(found.name, next_)]))
        zero = Number(0.0, FLOAT) if found.type == FLOAT else int_of(0)
        return each.call([tree.Store([(found.name, zero)])], found)

    def _in_a_loop(self, node: ast.GeneratorExp) -> _Each:
        """Return the unfinished function of an expression with a `for`, up to the element."""
        if len(node.generators) > 1 or node.generators[0].is_async:
            raise _Outside(node, "an expression with more than one for")
        [generator] = node.generators
        self._check_target(generator.target)
        own, first = _names(generator.target), _first_name(generator.target)
        self._parts += 1
        inner = self._inner(f"each{self._parts}", own)
        inside = [name for name in _free(node.elt, *generator.ifs) if name not in own]
        captured = self._captured(node, inside, own)
        given: dict[str, Expression] = {name: self._local(node, name) for name in captured}
        inner.names = {*given, *own}
        inner._start({name: value.type for name, value in given.items()})

        def hold(value: Expression, source: ast.expr, word: str) -> Expression:
            """Pass a value of the loop's head as an argument."""
            if isinstance(value, (tree.Constant, Number)):
                return value
            name = value.name if isinstance(value, Local) else ""
            if not name or name in {*own, *given}:
                name = inner._unused(f"{first}_{word}")
            given[name] = value
            return Local(name, value.type)

        loop = self._loop(generator, hold)
        turn = [*inner._turn(generator, loop, own)]
        block = turn
        for condition in generator.ifs:
            inner._before, outer = block, block
            test, block = inner.condition(condition), []
            outer.append(tree.If(test, block))
        inner._before = block
        return _Each(inner, given, loop, turn, block)

    # Methods, records and functions

    def _method(self, node: ast.Call, method: ast.Attribute) -> Expression:
        if isinstance(self._global_value(method.value), ModuleType):
            return self._of_module(method)
        owner = self.expression(method.value)
        type_, name = owner.type, method.attr
        if name == "_replace" and isinstance(type_, Record) and type_.made:
            return self._changed(node, owner)
        is_known = name == "replaced" or (name == "sum" and len(sizes(type_)) == 1)
        if not (is_algebraic(type_) and is_known):
            raise _Outside(node, f"{type_.word} has no method {name} in the language")
        self._check_plain(node, name, 0 if name == "sum" else 2)
        if name == "sum":
            return arrays.sum_of(self.program.functions, owner)
        return arrays.replaced(self.program.functions, owner, *self._replacing(node, type_))

    def _replacing(self, node: ast.Call, type_: Type) -> tuple[Expression, Expression]:
        """Return the index and the new value of an element, the arguments of `replaced`."""
        assert isinstance(type_, Array)
        place, value = node.args
        is_number = type_.item == FLOAT
        element = self._number(value) if is_number else self.fitting(value, type_.item)
        return self.fitting(place, INT), element

    def _changed(self, node: ast.Call, owner: Expression) -> Expression:
        """Return a record with new values of some fields."""
        type_, owner = owner.type, self._held(owner, "all")
        assert isinstance(type_, Record)
        fields = {name: Field(owner, name, part) for name, part in type_.fields}
        takes = _Signature("", "_replace", dict(type_.fields), 0, 0, fields)
        return Make(type_, [*self._given(node, takes).values()])

    def _record(self, node: ast.Call, made: Any) -> Expression:
        type_ = type_of(made)
        assert isinstance(type_, Record)
        types, defaults = dict(type_.fields), made._field_defaults
        takes = _Signature(made.__module__, made.__name__, types, 0, len(types), defaults)
        return Make(type_, [*self._given(node, takes).values()])

    def _member(self, node: ast.Call, made: Any) -> Expression:
        """Return the member of an enumeration with a value."""
        self._check_plain(node, made.__name__, 1)
        type_ = enumeration(made)
        given = self.expression(node.args[0])
        if given.type == type_:
            return given
        if given.type != INT:
            raise _Outside(node, f"{made.__name__} of {given.type.word}: it takes an int")

        def body() -> Sequence[Statement]:
            k = Local("k", INT)
            known = self._is_one_of(k, [int_of(int(member)) for member in made])
            parts: list[str | tuple[Expression, str]] = [
                "ValueError: ",
                (k, "d"),
                f" is not a valid {made.__qualname__}",
            ]
            return [
                tree.If(Operation(tree.NOT, (known,), BOOL), [tree.Raise(parts)]),
                tree.Return(Operation(tree.AS_INT, (k,), type_)),
            ]

        name = f"{made.__name__}_of"
        return Call(
            self.program.functions.helper(name, (type_,), {"k": INT}, type_, body), (given,)
        )

    def _function(self, node: ast.Call, called: FunctionType) -> Expression:
        hints: Mapping[str, Any] = {}
        with suppress(Exception):  # reported where it is translated
            hints = hints_of(called)
        parameters = inspect.signature(called).parameters.values()
        unsized = [
            parameter.name for parameter in parameters if has_no_size(hints.get(parameter.name))
        ]
        if unsized:
            function = None
            types = {
                parameter.name: None
                if parameter.name in unsized
                else type_of(hints[parameter.name])
                for parameter in parameters
                if parameter.name in hints
            }
        else:
            function = self.program.function(called)
            types = {**function.arguments}
        kinds = [parameter.kind for parameter in parameters]
        takes = _Signature(
            called.__module__, called.__name__, types, kinds.count(Parameter.POSITIONAL_ONLY),
            len(kinds) - kinds.count(Parameter.KEYWORD_ONLY),
            {x.name: x.default for x in parameters if x.default is not x.empty},
        )  # fmt: skip
        given = self._given(node, takes)
        for name in unsized:
            if not has_only_floats(given[name].type):
                what = f"{given[name].type.word} with other than floats: write them as 1.0"
                raise _Outside(node, what)
        if function is None:
            function = self.program.function(called, [value.type for value in given.values()])
        return Call(function, [*given.values()])

    def _call_of(self, node: ast.Call, name: str) -> Expression:
        """Return a call of a local function."""
        if name not in self.functions:
            raise _Outside(node, f"{self._local(node, name).type.word} is called")
        self._check_functions([name])
        called = self.functions[name]
        self.program.functions["inner", called.function] = called.function
        captured = [self._local(node, name) for name in called.captured]
        given = self._given(node, called.signature)
        return Call(called.function, [*given.values(), *captured])

    def _given(self, node: ast.Call, takes: _Signature) -> dict[str, Expression]:
        """Return the arguments of a call by name, in the order of the signature."""
        types = takes.types
        values = self._elements(node.args, [*types.values()])
        words = {str(keyword.arg): keyword.value for keyword in node.keywords}
        names = [*types]
        places = names[: len(values)]
        missing = {*names} - {*places} - {*words} - {*takes.defaults}
        if (
            len(values) > takes.positional or missing or {*words} & {*places}
            or {*words} - {*names[takes.unnamed :]}
        ):  # fmt: skip
            raise _Outside(node, f"{takes.name} takes {', '.join(names) or 'no arguments'}")
        found = dict(zip(places, values))
        for name, value in words.items():
            found[name] = self.fitting(value, types[name])
        for name in takes.defaults if len(found) < len(names) else ():
            if name not in found:
                found[name] = self._default(takes, name)
        return {name: found[name] for name in names}

    def _default(self, takes: _Signature, name: str) -> Expression:
        """Return the default value of an argument."""
        value, what = takes.defaults[name], f"the default value of {name}"
        if isinstance(value, Expression):
            return value
        wanted = takes.types[name] or type_of_value(value, what)
        check_value(value, wanted, what)
        if wanted == TEXT:
            return _text(value)
        if isinstance(wanted, Scalar):
            return Number(value, wanted)
        return self._constant_of(takes.module, f"{takes.name}_{name}", value, wanted)


class _Noting:
    """A context that notes a mistake and continues after it."""

    def __init__(self, builder: _Builder, node: ast.stmt | None = None) -> None:
        self._builder, self._node = builder, node

    def __enter__(self) -> None:
        """Begin."""

    def __exit__(self, kind: type | None, error: BaseException | None, _: Any) -> bool:
        """Note a mistake; the names that the statement assigns become unknown."""
        if error is None:
            return False
        builder = self._builder
        if isinstance(error, RecursionError):
            error = _Outside(ast.Pass(), _TOO_DEEP)
        if isinstance(error, (_Outside, TypeError)):
            node = error.node if isinstance(error, _Outside) else self._node
            places = (getattr(origin, "lineno", 0) for origin in (node, self._node, builder.node))
            line = next(filter(None, places), 0)
            builder.program.refuse(f"{builder.path}:{line}: ", str(error))
            builder.has_mistakes = True
        elif not isinstance(error, _Follows):
            return False
        if self._node is not None:
            builder._forget(self._node)
        return True


def _both(first: _Known | None, second: _Known | None) -> _Known | None:
    """Return the names known on both of two paths, with the same type; None if unreachable."""
    if first is None or second is None:
        return first if second is None else second
    types = {name: {type_, second[name]} for name, type_ in first.items() if name in second}
    return {
        name: UNKNOWN if UNKNOWN in both else first[name]
        for name, both in types.items()
        if len(both) == 1 or UNKNOWN in both
    }


def _text(value: str) -> tree.Text:
    """Return a literal text, if C can represent it."""
    if "\0" in value or any("\ud800" <= letter < "\ue000" for letter in value):
        raise TypeError("a text with a NUL, which ends one in C, or with half a letter")
    return tree.Text(value)


def _first_name(target: ast.expr) -> str:
    """Return the first name in a target, from which names for its loop are made."""
    names = (_stem(part.id) for part in ast.walk(target) if isinstance(part, ast.Name))
    return next(filter(None, names), "x")


def _stem(name: str) -> str:
    """Return a name without leading underscores; empty if nothing remains."""
    bare = name.lstrip("_")
    return bare if bare.isidentifier() else ""


def _value(expression: Expression) -> int | None:
    """Return the value of a literal; None for other expressions."""
    return expression.value if isinstance(expression, Number) else None


def _count(first: int, place: Expression, step: int) -> Expression:
    """Return the number of a range at an index."""
    offset = place
    if step != 1:
        offset = Operation(tree.COUNT_MULTIPLY, (place, int_of(step)), INT)
    return Operation(tree.COUNT_ADD, (int_of(first), offset), INT) if first else offset


def _is_fixed(value: Expression) -> bool:
    """Return True for a number, a variable or a constant, or a part of one at a constant index."""
    if isinstance(value, Field):
        return _is_fixed(value.owner)
    if isinstance(value, Item):
        return _is_fixed(value.owner) and isinstance(value.place, Number)
    return isinstance(value, (Number, Local, tree.Constant))


def _as_wanted(value: Expression, wanted: Type | None) -> Expression:
    """Convert a member of an enumeration if an int is wanted."""
    is_member = is_whole(value.type) and value.type != BOOL
    return _as_int(value) if wanted == INT and is_member else value


def _as_int(value: Expression) -> Expression:
    """Convert a bool, or a member of an enumeration, to an int."""
    if value.type == INT:
        return value
    return Operation(tree.AS_INT, (value,), INT)


#: Translations of calls of built-in functions.
_BUILT_IN: Mapping[Any, Callable[[_Builder, ast.Call], Expression]] = {
    len: _Builder._len,
    **{known: partial(_Builder._of_number, name=known.__name__)
       for known in (abs, bool, float, int, round)},
    **{known: partial(_Builder._extreme, word=known.__name__) for known in (max, min)},
    **{known: partial(_Builder._of_generator, word=known.__name__) for known in (all, any, sum)},
}  # fmt: skip
