"""Trees in C: structures, constants and functions, each after those that it uses."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cache
from itertools import groupby
from math import inf, isinf, isnan
from typing import Any

from fmus.language import tree
from fmus.language.mathematics import FUNCTIONS, OWN, RANGE
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
    Operator,
    Statement,
)
from fmus.language.types import (
    BOOL,
    FLOAT,
    NOTHING,
    TEXT,
    Array,
    Record,
    Scalar,
    Type,
    count,
    is_whole,
)
from fmus.native.names import class_in_c, in_c, is_of_library, words_of_runtime

LINE_WIDTH = 98
INDENT = "    "

#: Type of counters that may pass the largest int.
_WIDE = "long long"

#: Precedence of the operators of C.
TERNARY, _OR, _AND, _EQUALITY, _RELATION, _SUM, _PRODUCT, _UNARY, POSTFIX = range(9)

#: Operators of C between two operands.
_INFIX: dict[Operator, tuple[str, int]] = {
    tree.ADD: ("+", _SUM), tree.SUBTRACT: ("-", _SUM), tree.MULTIPLY: ("*", _PRODUCT),
    tree.OVER: ("/", _PRODUCT), tree.COUNT_ADD: ("+", _SUM), tree.COUNT_MULTIPLY: ("*", _PRODUCT),
    tree.LESS: ("<", _RELATION), tree.LESS_EQUAL: ("<=", _RELATION),
    tree.GREATER: (">", _RELATION), tree.GREATER_EQUAL: (">=", _RELATION),
    tree.EQUAL: ("==", _EQUALITY), tree.NOT_EQUAL: ("!=", _EQUALITY),
}  # fmt: skip

#: Functions of arithmetic.h, and of C.
_CALLED: dict[Operator, str] = {
    tree.DIVIDE: "py_div", tree.FLOOR_DIVIDE: "py_floordiv", tree.MODULO: "py_mod",
    tree.POWER: "py_pow", tree.INT_ADD: "int_add", tree.INT_SUBTRACT: "int_sub",
    tree.INT_MULTIPLY: "int_mul", tree.INT_NEGATIVE: "int_neg", tree.INT_DIVIDE: "int_div",
    tree.INT_FLOOR_DIVIDE: "int_floordiv", tree.INT_MODULO: "int_mod", tree.INT_POWER: "int_pow",
    tree.INT_ABS: "int_abs", tree.TO_INT: "int_of", tree.PLACE: "place_in", tree.ABS: "fabs",
    tree.NEAREST: "nearest", tree.MIN: "smaller", tree.MAX: "larger",
    tree.INT_MIN: "smaller_int", tree.INT_MAX: "larger_int",
}  # fmt: skip

#: Spaces at which no line is broken, and the sign for a space in a string.
_UNBROKEN = re.compile(r"(?<!,) (?!(?:[-+?:]|&&|\|\|) )")
_KEPT = "\x01"

#: The sign for a space at which a line is broken first.
_BREAK = "\x02"


def quoted(text: str) -> str:
    """Return a string literal of C."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    escaped = re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\{ord(match[0]):03o}", escaped)
    # Two question marks may begin a trigraph.
    escaped = escaped.replace("?", "\\?") if "??" in escaped else escaped
    return f'"{escaped}"'


def unbroken(text: str) -> str:
    """Return a string literal of C in which no line is broken."""
    return quoted(text).replace(" ", _KEPT)


def lines_of(text: str, indent: str) -> list[str]:
    """Break a statement into lines, if possible after commas of its outermost list."""
    lines: list[str] = []
    begin = indent
    for item in text.split(_BREAK):
        if lines and len(f"{lines[-1]} {item}") <= LINE_WIDTH:
            lines[-1] += f" {item}"
        else:
            lines.append(begin + item)
        begin = indent + INDENT
    wrapped = [part for line in lines for part in _wrapped(line, begin)]
    return [line.replace(_KEPT, " ") for line in wrapped]


def _wrapped(line: str, indent: str) -> list[str]:
    """Break a line after commas and before operators."""
    if len(line) <= LINE_WIDTH:
        return [line]
    text = line.lstrip()
    wrapper = textwrap.TextWrapper(
        LINE_WIDTH,
        initial_indent=line.removesuffix(text),
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return wrapper.wrap(_UNBROKEN.sub(_KEPT, text))


def _list(items: Iterable[str]) -> str:
    """Join items by commas, at which a line is broken first."""
    return f",{_BREAK}".join(item.replace(_BREAK, " ") for item in items)


def call(name: str, arguments: Iterable[str], fails: bool) -> str:
    """Return a call; if it may fail, it gets `error` as its last argument."""
    return f"{name}({_list([*arguments, *(['error'] if fails else [])])})"


def number_in_c(value: float) -> str:
    """Write a number in C."""
    if isinstance(value, float):
        if isnan(value):
            return "NAN"
        if isinf(value):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        return repr(float(value))
    # C has no literal for the smallest int.
    return "(-2147483647 - 1)" if value == -(2**31) else str(int(value))


def members(type_: Type) -> Sequence[tuple[str, Type]]:
    """Return the suffix in C and the type of each part of a value."""
    if isinstance(type_, Array):
        return [(f".v[{i}]", type_.item) for i in range(type_.n)]
    return [(f".{in_c(n)}", part) for n, part in type_.fields] if isinstance(type_, Record) else ()


def strip_sphinx_marks(text: str) -> str:
    """Remove Sphinx roles and backquotes from a text."""
    return closed(re.sub(r"(?::\w+:)?`+[~.]?([^`]*)`+", r"\1", text))


def closed(text: str) -> str:
    """Change a text so that it does not end a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def _comment(text: str) -> list[str]:
    """Return the lines of a docstring as a comment."""
    lines = strip_sphinx_marks(textwrap.dedent(text)).rstrip().splitlines()
    if len(lines) < 2:
        return [f"/* {line} */" for line in lines]
    return [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]


class Emitter:
    """Functions in C.

    Attributes:
        structures, constants: their definitions, by name.
        names: names of the functions.
        taken: names of structures, functions and constants.

    """

    #: Type of a float, and whether comments are kept.
    real, explains = "double", True

    def __init__(
        self,
        functions: Iterable[Function],
        most_copied: float = inf,
        taken: Collection[str] = (),
    ) -> None:
        """Choose names of the functions, and define the structures that they pass.

        Args:
            functions: functions, each after those that it calls.
            most_copied: largest structure, in numbers, that is passed by value, not by address.
            taken: names that something else in the file has.

        """
        functions = [*functions]
        self._addressed = {function: _addressed(function, most_copied) for function in functions}
        self._shared = {
            function: given | _large_parts(function, given, most_copied)
            for function, given in self._addressed.items()
        }
        self.structures: dict[str, str] = {}
        self.constants: dict[str, str] = {}
        self._types: dict[Type | tuple[str, int], str] = {}
        self._constants: dict[tree.Constant, str] = {}
        self._wrappers: dict[str, str] = {}
        #: Names of variables, which nothing else may have.
        self._variables = {in_c(name) for function in functions for name in _variables(function)}
        #: Names of structures, functions and constants, and of functions of `math` that raise.
        self.taken = {f"math_{name}" for name in FUNCTIONS} | {*taken}
        for function in functions:
            for type_ in (*function.arguments.values(), function.returns):
                self.type(type_)
        self.names = {
            function: self._in_module(function.module, function.name, *function.sizes)
            for function in functions
        }

    def text(self) -> str:
        """Return all definitions."""
        functions = [self._defined(function) for function in self.names]
        parts = [*self.structures.values(), *self.constants.values(), *self._wrappers.values()]
        return "\n\n".join([*parts, *functions])

    def _defined(self, function: Function) -> str:
        return Definition(self, function).text()

    def call(self, function: Function, arguments: Sequence[str]) -> str:
        """Return a call in a function that has an argument `error` if it is needed."""
        addressed = self.addressed(function)
        given = [
            f"&{text}" if name in addressed else text
            for name, text in zip(function.arguments, arguments)
        ]
        return call(self.names[function], given, function.fails)

    def addressed(self, function: Function) -> frozenset[str]:
        """Return the arguments of a function that are passed by address."""
        return self._addressed[function]

    def shared(self, function: Function) -> frozenset[str]:
        """Return these arguments and the variables that point into them, which are not copied."""
        return self._shared[function]

    # Names

    def unused(self, name: str) -> str:
        """Return a name that no other structure, function or constant has."""
        name += "_" if is_of_library(name) else ""
        while name in self.taken or name in self._variables or name in words_of_runtime():
            name += "_"
        self.taken.add(name)
        return name

    def _in_module(self, module: str, name: str, *sizes: Type) -> str:
        """Return a name for a function or constant of a module."""
        stems = (part.lstrip("_") for part in (module.rpartition(".")[2], name))
        parts = [*stems, *map(self.type, sizes)]
        word = re.sub(r"\W+", "_", "_".join(filter(None, parts)))
        return self.unused(word if word.isidentifier() else f"of_{word}")

    # Types and constants

    def type(self, type_: Type) -> str:
        """Return the name of a type, and define its structures."""
        if isinstance(type_, Scalar):
            if is_whole(type_):
                return "int"
            return {FLOAT: self.real, TEXT: "const char *"}.get(type_, "void")
        # Arrays with the same type in C share one structure.
        key = (self.type(type_.item), type_.n) if isinstance(type_, Array) else type_
        if key not in self._types:
            self._types[key] = self._structure(type_)
        return self._types[key]

    def is_number(self, type_: Type) -> bool:
        """Return True for a number of C."""
        return isinstance(type_, Scalar)

    def declared(self, type_: Type) -> str:
        """Return a type for a declaration, with a space if one is needed before the name."""
        name = self.type(type_)
        return name if name.endswith("*") else f"{name} "

    def _structure(self, type_: Array | Record) -> str:
        """Define a structure, after the structures in it, and return its name."""
        doc = ""
        if isinstance(type_, Array):
            item, n = self.type(type_.item), type_.n
            rows = [f"    {item} v[{n}];"]
            if type_.item == FLOAT:
                name = f"Vector{n}"
            elif isinstance(type_.item, Array) and type_.item.item == FLOAT:
                name = f"Matrix{n}x{type_.item.n}"
            else:
                name = f"{item}x{n}"
        else:
            about = _comments(type_.made) if self.explains else {}
            rows = [
                f"    {self.type(part)} {in_c(name)};{about.get(name, '')}"
                for name, part in type_.fields
            ] or ["    char nothing; /* C has no empty structure */"]
            name = "_".join(self.type(part) for _, part in type_.fields) or "Empty"
            if type_.made:
                name = class_in_c(type_.made.__name__)
                doc = inspect.cleandoc(type_.made.__doc__ or "").partition("\n")[0]
        name = self.unused(name)
        head = [f"/* {strip_sphinx_marks(doc)} */"] if doc and self.explains else []
        self.structures[name] = "\n".join([*head, "typedef struct {", *rows, f"}} {name};"])
        return name

    def constant(self, constant: tree.Constant) -> str:
        """Define a constant, and return its name."""
        if constant not in self._constants:
            name = self._constants[constant] = self._in_module(constant.module, constant.name)
            literal = self._literal(constant.value, constant.type)
            value = f"{self.declared(constant.type)}{name} = {literal}"
            self.constants[name] = "\n".join(lines_of(f"static const {value};", ""))
        return self._constants[constant]

    def _literal(self, value: Any, type_: Type) -> str:
        """Return the initializer of a value."""
        if isinstance(type_, Scalar):
            return self.numeral(value, type_)
        parts = _list(self._literal(item, part) for item, (_, part) in zip(value, members(type_)))
        return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"

    def numeral(self, value: float, type_: Scalar) -> str:
        """Return the initializer of a number."""
        return number_in_c(value)

    def wrap(self, name: str) -> None:
        """Define a function of `math` that fails in the same cases as Python's."""
        raises = FUNCTIONS[name].raises
        if raises == OWN:
            return
        body = f"    return {name}(x);"
        if raises == RANGE:
            body = f"    return bounded_result(x, {name}(x), error);"
        else:
            body = f"    raise_if({raises}, error, DOMAIN_ERROR);\n{body}"
        head = f"static inline double math_{name}(double x, Error *error) {{"
        self._wrappers[name] = f"{head}\n{body}\n}}"


class Definition:
    """The translation of one function."""

    def __init__(self, emitter: Emitter, function: Function) -> None:
        self._emitter, self._function = emitter, function
        self._addressed = emitter.shared(function)
        self._parts = self._addressed - emitter.addressed(function)
        #: Variables that keep results whose address is taken, and their declarations.
        self._results: dict[str, str] = {}

    def text(self) -> str:
        """Return the definition of the function."""
        emitter, function = self._emitter, self._function
        given = [
            f"const {emitter.type(type_)} *{in_c(name)}"
            if name in self._addressed
            else f"{emitter.declared(type_)}{in_c(name)}"
            for name, type_ in function.arguments.items()
        ]
        given += ["Error *error"] if function.fails else []
        name = f"{emitter.declared(function.returns)}{emitter.names[function]}"
        head = lines_of(f"static {name}({_list(given) or 'void'}) {{", "")
        body = self._block(function.body, {*function.arguments}, INDENT)
        # A line that is too long is written twice.
        written = "\n".join(body)
        body[:0] = [
            line for name, line in self._results.items() if re.search(rf"\b{name}\b", written)
        ]
        if function.returns != NOTHING and not _ends(function.body):
            body.append(f"{INDENT}{self._left()}")
        doc = _comment(function.doc) if emitter.explains else []
        return "\n".join([*doc, *head, *body, "}"])

    # Expressions

    def expression(self, expression: Expression, within: int = TERNARY) -> str:
        """Return an expression, in brackets if the context has a higher precedence."""
        text, binding = self.bound(expression)
        if binding != POSTFIX:
            text = text.replace(_BREAK, " ")
        return text if binding >= within else f"({text})"

    def bound(self, expression: Expression) -> tuple[str, int]:  # noqa: PLR0911, for each class
        """Return an expression and the precedence of its outermost operator."""
        if isinstance(expression, Number):
            text = number_in_c(expression.value)
            return text, _UNARY if text.startswith("-") else POSTFIX
        if isinstance(expression, tree.Text):
            return unbroken(expression.value), POSTFIX
        if isinstance(expression, Local):
            name = in_c(expression.name)
            return f"(*{name})" if expression.name in self._addressed else name, POSTFIX
        if isinstance(expression, tree.Constant):
            return self._emitter.constant(expression), POSTFIX
        if isinstance(expression, Field):
            return f"{self._member(expression.owner)}{in_c(expression.name)}", POSTFIX
        if isinstance(expression, Item):
            return (
                f"{self._owner(expression.owner)}v[{self.expression(expression.place)}]",
                POSTFIX,
            )
        if isinstance(expression, Make):
            return f"({self._emitter.type(expression.type)}){self._initial(expression)}", POSTFIX
        if isinstance(expression, Choice):
            test, this = (self.expression(part, _OR) for part in (expression.test, expression.this))
            return f"{test} ? {this} : {self.expression(expression.other)}", TERNARY
        if isinstance(expression, Call):
            addressed = self._emitter.addressed(expression.function)
            given = [
                self._address(part) if name in addressed else self.expression(part)
                for name, part in zip(expression.function.arguments, expression.parts)
            ]
            name = self._emitter.names[expression.function]
            return call(name, given, expression.function.fails), POSTFIX
        assert isinstance(expression, Operation)
        return self.operation(expression)

    def number(self, expression: Expression, within: int = TERNARY) -> str:
        """Return a number that is not differentiated, in brackets if necessary."""
        return self.expression(expression, within)

    def _address(self, expression: Expression) -> str:
        """Return the address of a value."""
        if isinstance(expression, Local) and expression.name in self._addressed:
            return in_c(expression.name)
        root = expression
        while isinstance(root, (Field, Item)):
            root = root.owner
        if isinstance(root, (Local, tree.Constant, Make)):
            return f"&{self.expression(expression, _UNARY)}"
        return self._kept(expression)

    def _kept(self, expression: Expression) -> str:
        """Return the address of a result, which a variable keeps."""
        # No variable of Python has such a name in C.
        name = f"_result{len(self._results)}"
        self._results[name] = f"{INDENT}{self._emitter.declared(expression.type)}{name};"
        return f"({name} = {self.expression(expression)}, &{name})"

    def _member(self, expression: Expression) -> str:
        """Return a structure with the operator for access to a member."""
        if isinstance(expression, Local) and expression.name in self._addressed:
            return f"{in_c(expression.name)}->"
        return f"{self.expression(expression, POSTFIX)}."

    def _owner(self, expression: Expression) -> str:
        """Return an array with the operator for access to a member."""
        root = expression
        while isinstance(root, Field):
            root = root.owner
        if not isinstance(root, (Call, Choice)):
            return self._member(expression)
        # In C99, the lifetime of a result may end before its element is read.
        return f"{self._kept(expression)}->"

    def _initial(self, expression: Expression) -> str:
        """Return a value in a context that determines its type."""
        if not isinstance(expression, Make):
            return self.expression(expression)
        texts = [self._initial(part) for part in expression.parts]
        if isinstance(expression.type, Array):
            return f"{{{{{_list(texts)}}}}}"
        filled = [f"{name} = {text}" for (name, _), text in zip(members(expression.type), texts)]
        return f"{{{_list(filled) or '0'}}}"

    def _mathematics(self, operation: Operation, op: Operator) -> tuple[str, int]:
        texts = [self.number(part) for part in operation.operands]
        # A macro would take the commas of a structure for its own.
        if any(
            isinstance(part, Make) for each in operation.parts for part in tree.expressions_in(each)
        ):
            texts = [f"({text})" for text in texts]
        if op.fails:
            self._emitter.wrap(op.function)
            return call(f"math_{op.function}", texts, True), POSTFIX
        text = call(op.function, texts, False)
        return (f"{text} != 0", _EQUALITY) if operation.type == BOOL else (text, POSTFIX)

    def operation(self, operation: Operation) -> tuple[str, int]:  # noqa: PLR0911, by operator
        op = operation.operator
        if op.function:
            return self._mathematics(operation, op)
        if op in _INFIX:
            sign, binding = _INFIX[op]
            # Compilers warn of a comparison in another one without brackets.
            both = (_SUM, _SUM) if binding < _SUM else (binding, binding + 1)
            left, right = (self.number(*each) for each in zip(operation.parts, both))
            return f"{left} {sign} {right}", binding
        if op in _CALLED:
            return call(_CALLED[op], map(self.number, operation.parts), op.fails), POSTFIX
        if op in (tree.AND, tree.OR):
            sign, binding = (" || ", _OR) if op == tree.OR else (" && ", _AND)
            # Compilers warn of && in || without brackets.
            return sign.join(self.expression(p, _EQUALITY) for p in operation.parts), binding
        [part] = operation.parts
        if op == tree.AS_INT:
            return self.bound(part)
        if op == tree.TO_BOOL:
            zero = "0.0" if part.type == FLOAT else "0"
            return f"{self.number(part, _RELATION)} != {zero}", _EQUALITY
        if op == tree.NEGATIVE:
            return f"-{self.expression(part, POSTFIX)}", _UNARY
        sign = {tree.NOT: "!", tree.TO_FLOAT: "(double)", tree.NARROW: "(int)"}[op]
        return f"{sign}{self.expression(part, _UNARY)}", _UNARY

    # Statements

    def _block(self, statements: Sequence[Statement], known: set[str], indent: str) -> list[str]:
        """Return a block; variables are declared before the first statement that uses them."""
        used: dict[str, list[int]] = {}
        for i, statement in enumerate(statements):
            for name in dict.fromkeys(_used(statement)):
                used.setdefault(name, []).append(i)
        here: dict[int, list[str]] = {}
        for name, places in used.items():
            is_here = len(places) > 1 or name in _used(statements[places[0]], deep=False)
            if is_here and name not in known:
                here.setdefault(places[0], []).append(name)
        known = known | {name for names in here.values() for name in names}
        types = tree.variables_in(statements)
        stores = Counter(_stores(statements))
        lines: list[str] = []
        for i, statement in enumerate(statements):
            new = here.get(i, [])
            if not isinstance(statement, (tree.Store, tree.Reserve)):
                lines += [f"{indent}{self._zero(name, types[name])}" for name in new]
            texts = [*self._statement(statement, new, stores, known, indent)]
            if statement.comment and texts and self._emitter.explains:
                texts = _annotated(texts, f"/* {closed(statement.comment)} */", indent)
            lines += texts
        return lines

    def _zero(self, name: str, type_: Type) -> str:
        """Return the declaration of a variable that gets its value in a nested block."""
        is_number = self._emitter.is_number(type_)
        value = "{0}" if not is_number else "0.0" if type_ == FLOAT else "0"
        return f"{self._emitter.declared(type_)}{in_c(name)} = {value};"

    def _statement(
        self,
        statement: Statement,
        new: Sequence[str],
        stores: Counter[str],
        known: set[str],
        indent: str,
    ) -> Iterator[str]:
        inner, emitter = indent + INDENT, self._emitter
        if isinstance(statement, tree.Store):
            yield from self._stored(statement, new, stores, indent)
        elif isinstance(statement, tree.Reserve):
            yield f"{indent}{emitter.declared(statement.type)}{in_c(statement.name)};"
        elif isinstance(statement, tree.StoreItem):
            places = "".join(f".v[{self.expression(place)}]" for place in statement.places)
            yield from lines_of(
                f"{in_c(statement.name)}{places} = {self.expression(statement.value)};", indent
            )
        elif isinstance(statement, tree.Do):
            text = self.expression(statement.call, _UNARY)
            is_plain = isinstance(statement.call, Call) and statement.call.type == NOTHING
            yield from lines_of(f"{text};" if is_plain else f"(void){text};", indent)
        elif isinstance(statement, tree.Return):
            yield from self._returned(statement, indent)
        elif isinstance(statement, (tree.Break, tree.Continue)):
            yield f"{indent}{type(statement).__name__.lower()};"
        elif isinstance(statement, tree.Raise):
            yield from lines_of(self._raised(statement), indent)
            yield f"{indent}{self._left()}"
        elif isinstance(statement, tree.If):
            head, (chain, orelse) = "if", _chain(statement)
            for each in chain:
                yield from lines_of(f"{head} ({self.expression(each.test)}) {{", indent)
                yield from self._block(each.body, known, inner)
                head = "} else if"
            if orelse:
                yield f"{indent}}} else {{"
                yield from self._block(orelse, known, inner)
            yield f"{indent}}}"
        else:
            assert isinstance(statement, (tree.While, tree.For))
            yield from lines_of(f"{self._head(statement)} {{", indent)
            counter = {statement.counter} if isinstance(statement, tree.For) else set()
            yield from self._block(statement.body, known | counter, inner)
            yield f"{indent}}}"

    def _head(self, loop: tree.While | tree.For) -> str:
        """Return the first line of a loop, which also tests for errors in its body."""
        if isinstance(loop, tree.While):
            return f"while (!error->raised && {self.expression(loop.test, _AND)})"
        fails = loop.turns is None or any(map(tree.may_fail, tree.statements_in(loop.body)))
        name, sign = in_c(loop.counter), "<" if loop.step > 0 else ">"
        test = f"{name} {sign} {self.expression(loop.stop, _SUM)}"
        test = f"!error->raised && {test}" if fails else test
        change = {1: f"{name}++", -1: f"{name}--"}.get(loop.step, f"{name} += {loop.step}")
        kind = _WIDE if loop.is_wide else "int"
        return f"for ({kind} {name} = {self.expression(loop.start)}; {test}; {change})"

    def _stored(
        self, store: tree.Store, new: Sequence[str], stores: Counter[str], indent: str
    ) -> Iterator[str]:
        """Yield assignments; new variables of one type are declared together."""

        def alike(value: tuple[str, Expression]) -> tuple[Any, ...]:
            name, made = value
            is_new = name in new
            is_apart = name in self._parts or (made.type == TEXT and is_new)
            return is_new, is_new and stores[name] == 1, made.type, name if is_apart else ""

        for (is_new, is_constant, type_, apart), group in groupby(store.values, alike):
            if apart in self._parts:
                [(name, value)] = group
                text = f"const {self._emitter.type(type_)} *{in_c(name)} = {self._address(value)};"
                yield from lines_of(text, indent)
                continue
            write = self._initial if is_new else self.expression
            texts = [f"{in_c(name)} = {write(value)}" for name, value in group]
            head = "const " if is_constant and type_ != TEXT else ""
            head += self._emitter.declared(type_) if is_new else ""
            text = _list(texts) if is_new and len(texts) > 1 else "; ".join(texts)
            yield from lines_of(f"{head}{text};", indent)

    def _returned(self, statement: tree.Return, indent: str) -> Iterator[str]:
        text = (
            f"return {self.expression(statement.value)};"
            if statement.value is not None
            else "return;"
        )
        is_long = len(indent) + len(text) > LINE_WIDTH
        if (
            is_long
            and isinstance(statement.value, Make)
            and isinstance(statement.value.type, Record)
        ):
            # A line for each field.
            yield f"{indent}return ({self._emitter.type(statement.value.type)}){{"
            for (name, _), part in zip(members(statement.value.type), statement.value.parts):
                yield from lines_of(f"{name} = {self._initial(part)},", indent + INDENT)
            yield f"{indent}}};"
            return
        yield from lines_of(text, indent)

    def _left(self) -> str:
        """Return the statement that leaves the function after an error."""
        returns = self._function.returns
        if returns == NOTHING:
            return "return;"
        is_number = self._emitter.is_number(returns)
        return "return 0;" if is_number else f"return ({self._emitter.type(returns)}){{0}};"

    def _raised(self, statement: tree.Raise) -> str:
        form, arguments = "", []
        for part in statement.parts:
            if isinstance(part, str):
                form += part.replace("%", "%%")
                continue
            value, how = part
            text = self.number(value)
            if value.type == BOOL:
                text = f'{self.expression(value, _OR)} ? "True" : "False"'
            form += f"%{how}" if how else "%s"
            arguments.append(text)
        return f"raise_error({_list(['error', unbroken(form), *arguments])});"


def _addressed(function: Function, most_copied: float) -> frozenset[str]:
    """Return the arguments that are passed by address: large ones that are not changed."""
    stored = {
        name
        for statement in tree.statements_in(function.body)
        for name in tree.stored_in(statement)
    }
    large = {name for name, type_ in function.arguments.items() if count(type_) > most_copied}
    return frozenset({function.by_address} | (large - stored)) - {""}


def _large_parts(
    function: Function, addressed: frozenset[str], most_copied: float
) -> frozenset[str]:
    """Return the variables that are large parts of such arguments: pointers, too."""
    stores, found = Counter(_stores(function.body)), {*addressed}
    for statement in function.body:
        for name, value in statement.values if isinstance(statement, tree.Store) else ():
            root = value
            while isinstance(root, Field):
                root = root.owner
            is_part = isinstance(root, Local) and root.name in found
            is_kept = stores[name] == 1 and name not in function.arguments
            if is_part and is_kept and count(value.type) > most_copied:
                found.add(name)
    return frozenset(found - addressed)


def _ends(body: Sequence[Statement]) -> bool:
    """Return True if every path through a block leaves the function."""
    last = body[-1] if body else None
    while isinstance(last, tree.If) and _ends(last.body):
        last = last.orelse[-1] if last.orelse else None
    return isinstance(last, (tree.Return, tree.Raise))


def _chain(branch: tree.If) -> tuple[list[tree.If], Sequence[Statement]]:
    """Return an if with its chain of elifs, and the block of the final else."""
    branches, orelse = [branch], branch.orelse
    while len(orelse) == 1 and isinstance(orelse[0], tree.If) and not orelse[0].comment:
        branches.append(orelse[0])
        orelse = orelse[0].orelse
    return branches, orelse


def _used(statement: Statement, deep: bool = True) -> Iterator[str]:
    """Yield the variables that a statement uses or assigns; if `deep`, also in its blocks."""
    rest = [(statement, frozenset[str]())]
    while rest:
        statement, counters = rest.pop()
        if isinstance(statement, tree.For):
            counters |= {statement.counter}
        parts = (
            part for each in tree.expressions_of(statement) for part in tree.expressions_in(each)
        )
        names = [part.name for part in parts if isinstance(part, Local)] + tree.stored_in(statement)
        yield from (name for name in names if name not in counters)
        inner = [nested for block in tree.blocks_of(statement) for nested in block if deep]
        rest += [(nested, counters) for nested in reversed(inner)]


def _stores(statements: Sequence[Statement]) -> Iterator[str]:
    """Yield the variables that are assigned, each time; twice for changes of elements."""
    for statement in tree.statements_in(statements):
        is_twice = isinstance(statement, (tree.StoreItem, tree.Reserve))
        yield from tree.stored_in(statement) * (1 + is_twice)


def _variables(function: Function) -> Iterator[str]:
    """Yield the names of all arguments and variables of a function."""
    yield from function.arguments
    for statement in tree.statements_in(function.body):
        yield from tree.stored_in(statement)
        if isinstance(statement, tree.For):
            yield statement.counter


def _annotated(lines: list[str], comment: str, indent: str) -> list[str]:
    """Add a comment at the end of a line, or before the lines."""
    if len(lines) == 1 and len(lines[0]) + 1 + len(comment) <= LINE_WIDTH:
        return [f"{lines[0]} {comment}"]
    return [f"{indent}{comment}", *lines]


@cache
def _comments(made: Any) -> dict[str, str]:
    """Return the `#:` comments of the fields of a class, as comments of C."""
    if made is None:
        return {}
    try:
        text = inspect.getsource(made)
    except OSError:
        return {}  # made without a class statement
    comments = re.findall(r"^    (\w+):.*#: (.*)$", text, re.MULTILINE)
    return {name: f" /* {strip_sphinx_marks(text)} */" for name, text in comments}
