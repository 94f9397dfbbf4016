"""Programs of the language as trees: functions of statements of typed expressions.

An expression has a type, and a flag that is true if it can fail, which means that Python would
raise an exception. A tree has no exceptions: the first failure is noted, the program continues with
any number, and results after the failure are not used.

Operators of vectors and matrices, expressions with a `for` and local functions have become
functions with elements, loops and arguments. So a translator to another language must handle only
the classes and operators of this module.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from fmus.language.mathematics import FUNCTIONS
from fmus.language.types import INT, NOTHING, TEXT, Array, Type


@dataclass(frozen=True)
class Operator:
    """An operator.

    Attributes:
        name: name in Python, with a prefix for ints and functions of `math`.
        fails: True if it can fail.
        function: name of a function of `math`; empty for other operators.

    """

    name: str
    fails: bool = False
    function: str = ""


#: Operators of floats.
ADD, SUBTRACT, MULTIPLY, OVER, NEGATIVE = map(Operator, ("+", "-", "*", "/", "-x"))
DIVIDE, FLOOR_DIVIDE, MODULO, POWER = (Operator(n, True) for n in ("x / y", "//", "%", "**"))

#: Operators of ints, which have 32 bits.
INT_ADD, INT_SUBTRACT, INT_MULTIPLY, INT_NEGATIVE, INT_DIVIDE, INT_FLOOR_DIVIDE, INT_MODULO, \
    INT_POWER, INT_ABS = (
        Operator(f"int {n}", True) for n in ("+", "-", "*", "-x", "/", "//", "%", "**", "abs")
    )  # fmt: skip

#: Operators of ints whose result never exceeds 32 bits.
COUNT_ADD, COUNT_MULTIPLY = Operator("count +"), Operator("count *")

LESS, LESS_EQUAL, GREATER, GREATER_EQUAL, EQUAL, NOT_EQUAL = map(
    Operator, ("<", "<=", ">", ">=", "==", "!=")
)
AND, OR, NOT = map(Operator, ("and", "or", "not"))
ABS, MIN, MAX, INT_MIN, INT_MAX = map(Operator, ("abs", "min", "max", "int min", "int max"))

#: Conversions: of an int to a float, of a number to a bool, of a whole float to an int, of a float
#: to the nearest whole one, and of a bool or a member of an enumeration to an int.
TO_FLOAT, TO_BOOL, TO_INT, NEAREST, AS_INT = (
    Operator("float"), Operator("bool"), Operator("int", True), Operator("round"),
    Operator("as int"),
)  # fmt: skip

#: Functions of `math`; those with an int as result give a float in C, which is then converted.
MATHEMATICS = {
    name: Operator(f"math.{name}", bool(about.raises), name)
    for name, about in FUNCTIONS.items()
    if not about.factor
}

#: Converts the counter of a loop with a wide counter to an int, within the loop.
NARROW = Operator("narrow")

#: Index into an array for an int that may be negative; the second operand is the length.
PLACE = Operator("place", True)


class Expression:
    """A value: its type, and its operands."""

    type: Type
    fails: bool

    @cached_property
    def parts(self) -> Sequence[Expression]:
        """Operands in the order of evaluation."""
        return [*_expressions_in(vars(self).values())]

    def __post_init__(self) -> None:
        """Set the flag `fails` from the operands."""
        self.fails = any(part.fails for part in self.parts)


@dataclass(eq=False)
class Number(Expression):
    """A literal float, int or bool."""

    value: Any
    type: Type


@dataclass(eq=False)
class Text(Expression):
    """A literal text."""

    value: str
    type: Type = TEXT


@dataclass(eq=False)
class Local(Expression):
    """An argument or a variable of the function."""

    name: str
    type: Type


@dataclass(eq=False)
class Constant(Expression):
    """A constant of a module: a number, or a group of numbers."""

    module: str
    name: str
    value: Any
    type: Type

    @cached_property
    def parts(self) -> Sequence[Expression]:
        """No operands; looking for them among many numbers would take long."""
        return ()


@dataclass(eq=False)
class Field(Expression):
    """A field of a record."""

    owner: Expression
    name: str
    type: Type


@dataclass(eq=False)
class Item(Expression):
    """An element of an array, at an index from 0 to one below its length."""

    owner: Expression
    place: Expression

    def __post_init__(self) -> None:
        """Set its type."""
        assert isinstance(self.owner.type, Array)
        self.type = self.owner.type.item
        super().__post_init__()


@dataclass(eq=False)
class Make(Expression):
    """An array or a record made from values."""

    type: Type
    values: Sequence[Expression]


@dataclass(eq=False)
class Operation(Expression):
    """An operation; `and` and `or` evaluate only the operands that they need."""

    operator: Operator
    operands: Sequence[Expression]
    type: Type

    def __post_init__(self) -> None:
        """Set the flag `fails` from the operator and the operands."""
        super().__post_init__()
        self.fails |= self.operator.fails


@dataclass(eq=False)
class Choice(Expression):
    """One of two values, chosen by a condition."""

    test: Expression
    this: Expression
    other: Expression

    def __post_init__(self) -> None:
        """Set its type."""
        self.type = self.this.type
        super().__post_init__()


@dataclass(eq=False)
class Call(Expression):
    """A call of a function."""

    function: Function
    arguments: Sequence[Expression]

    def __post_init__(self) -> None:
        """Set its type, and the flag `fails` from the function and the arguments."""
        self.type = self.function.returns
        super().__post_init__()
        self.fails |= self.function.fails


@dataclass
class Statement:
    """A statement of a function.

    Attributes:
        comment: comment on its line in the source.
        line: its line in the source; 0 if it is not there.

    """

    comment: str = field(default="", init=False)
    line: int = field(default=0, init=False)


@dataclass
class Store(Statement):
    """Assignments to variables, in order."""

    values: Sequence[tuple[str, Expression]]


@dataclass
class Reserve(Statement):
    """Declaration of a variable whose elements are assigned one by one."""

    name: str
    type: Type


@dataclass
class StoreItem(Statement):
    """Assignment to an element of a variable, or of a nested array."""

    name: str
    places: Sequence[Expression]
    value: Expression


@dataclass
class Do(Statement):
    """A call without a result, or whose result is not used."""

    call: Expression


@dataclass
class If(Statement):
    """One of two blocks, chosen by a condition."""

    test: Expression
    body: Sequence[Statement]
    orelse: Sequence[Statement] = ()


@dataclass
class While(Statement):
    """A block that is repeated while a condition holds and nothing has failed."""

    test: Expression
    body: Sequence[Statement]


@dataclass
class For(Statement):
    """A block for each number of a range; the body does not change the counter.

    Attributes:
        counter: variable with the number, known in this statement only.
        start, stop, step: bounds and step of the range.
        turns: number of turns; None if it is not constant.
        is_wide: True if the counter may pass the largest int.

    """

    counter: str
    start: Expression
    stop: Expression
    step: int
    turns: int | None
    body: Sequence[Statement]
    is_wide: bool = False


@dataclass
class Return(Statement):
    """Return from the function, with its result."""

    value: Expression | None = None


@dataclass
class Break(Statement):
    """Leave the innermost loop."""


@dataclass
class Continue(Statement):
    """Continue with the next turn of the innermost loop."""


@dataclass
class Raise(Statement):
    """A failure, after which the function ends; its message has texts, and values with formats."""

    parts: Sequence[str | tuple[Expression, str]]


@dataclass(eq=False)
class Function:
    """A function.

    Attributes:
        module, name: its module and name; module is empty for functions of operators and loops.
        sizes: types that it was specialised for; empty if it has only one version.
        arguments: types of the arguments by name.
        returns: type of its result.
        body: its statements.
        doc: its docstring.
        fails: True if it can fail.
        by_address: an argument, which is an array, that is not copied; empty if there is none.
        path: its file; empty for functions of operators.

    """

    module: str
    name: str
    arguments: dict[str, Type]
    returns: Type = NOTHING
    body: Sequence[Statement] = ()
    sizes: Sequence[Type] = ()
    doc: str = ""
    fails: bool = False
    by_address: str = ""
    path: str = ""

    def end(self, body: Sequence[Statement]) -> None:
        """Set its body, and the flag `fails`."""
        self.body, self.fails = body, any(map(may_fail, statements_in(body)))


def statements_in(body: Sequence[Statement]) -> Iterator[Statement]:
    """Yield all statements of a block, including nested ones."""
    for statement in body:
        yield statement
        for block in blocks_of(statement):
            yield from statements_in(block)


def blocks_of(statement: Statement) -> Sequence[Sequence[Statement]]:
    """Return the blocks of a statement."""
    if isinstance(statement, If):
        return (statement.body, statement.orelse)
    return (statement.body,) if isinstance(statement, (While, For)) else ()


def expressions_of(statement: Statement) -> Iterator[Expression]:
    """Yield the expressions of a statement, without its blocks."""
    yield from _expressions_in(vars(statement).values())


def _expressions_in(values: Iterable[Any]) -> Iterator[Expression]:
    """Yield the expressions among the attributes of a node, including lists."""
    for value in values:
        if isinstance(value, Expression):
            yield value
        elif isinstance(value, (list, tuple)):
            yield from _expressions_in(value)


def expressions_in(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and all nested expressions."""
    yield expression
    for part in expression.parts:
        yield from expressions_in(part)


def calls_in(body: Sequence[Statement]) -> Iterator[Call]:
    """Yield all calls in a block, including nested ones."""
    for statement in statements_in(body):
        for expression in expressions_of(statement):
            yield from (part for part in expressions_in(expression) if isinstance(part, Call))


def stored_in(statement: Statement) -> list[str]:
    """Return the variables that a statement assigns, without its blocks."""
    if isinstance(statement, Store):
        return [name for name, _ in statement.values]
    return [statement.name] if isinstance(statement, (Reserve, StoreItem)) else []


def variables_in(body: Sequence[Statement]) -> dict[str, Type]:
    """Return the variables that a block assigns, with their types."""
    types: dict[str, Type] = {}
    for statement in statements_in(body):
        if isinstance(statement, Store):
            types |= {name: value.type for name, value in statement.values}
        elif isinstance(statement, Reserve):
            types[statement.name] = statement.type
    return types


def may_fail(statement: Statement) -> bool:
    """Return True if a statement itself can fail, or must stop after a failure."""
    ends = isinstance(statement, (Raise, While))
    is_endless = isinstance(statement, For) and statement.turns is None
    return ends or is_endless or any(expression.fails for expression in expressions_of(statement))


def int_of(value: int) -> Number:
    """Return a literal int."""
    return Number(value, INT)


class Functions(dict[Hashable, Function]):
    """Functions by their origin, each after those that it calls."""

    def helper(
        self,
        name: str,
        types: Sequence[Type],
        arguments: Mapping[str, Type],
        returns: Type,
        body: Callable[[], Sequence[Statement]],
    ) -> Function:
        """Return the function of an operator, made once for each combination of types."""
        key = (name, *types)
        if key not in self:
            made = Function("", name, dict(arguments), returns, sizes=types)
            made.end(body())
            self[key] = made
        return self[key]
