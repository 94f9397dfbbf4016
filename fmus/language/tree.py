"""Programs of the language as trees: functions of statements of typed expressions.

An expression knows its type, and whether it can fail, as Python would raise. There is no exception
in a tree: where something fails, the first failure is noted, the run of the tree goes on with any
number, and nothing that is computed after it is used.

Vectors, matrices, expressions with a `for` and local functions have become functions of numbers,
elements, loops and arguments. So what writes a tree in another language needs a form for each
class here, and for each of the operators.
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
    """What an operation does.

    Attributes:
        name: as Python has it; of ints, and of functions of `math`, with a word before it.
        fails: whether it can.
        function: of `math`; empty: none.

    """

    name: str
    fails: bool = False
    function: str = ""


#: Of floats.
ADD, SUBTRACT, MULTIPLY, OVER, NEGATIVE = map(Operator, ("+", "-", "*", "/", "-x"))
DIVIDE, FLOOR_DIVIDE, MODULO, POWER = (Operator(n, True) for n in ("x / y", "//", "%", "**"))

#: Of ints, which have 32 bits.
INT_ADD, INT_SUBTRACT, INT_MULTIPLY, INT_NEGATIVE, INT_DIVIDE, INT_FLOOR_DIVIDE, INT_MODULO, \
    INT_POWER, INT_ABS = (
        Operator(f"int {n}", True) for n in ("+", "-", "*", "-x", "/", "//", "%", "**", "abs")
    )  # fmt: skip

#: Of ints that have room for the result.
COUNT_ADD, COUNT_MULTIPLY = Operator("count +"), Operator("count *")

LESS, LESS_EQUAL, GREATER, GREATER_EQUAL, EQUAL, NOT_EQUAL = map(
    Operator, ("<", "<=", ">", ">=", "==", "!=")
)
AND, OR, NOT = map(Operator, ("and", "or", "not"))
ABS, MIN, MAX, INT_MIN, INT_MAX = map(Operator, ("abs", "min", "max", "int min", "int max"))

#: Conversions: of an int to a float, of a number to a bool, of a whole float to an int, of a float
#: to the nearest whole one, and of a bool or a member of an enumeration to the int that it is.
TO_FLOAT, TO_BOOL, TO_INT, NEAREST, AS_INT = (
    Operator("float"), Operator("bool"), Operator("int", True), Operator("round"),
    Operator("as int"),
)  # fmt: skip

#: Functions of `math`: of an int, C has the float before it.
MATHEMATICS = {
    name: Operator(f"math.{name}", bool(about.raises), name)
    for name, about in FUNCTIONS.items()
    if not about.factor
}

#: The counter of a loop that may pass the largest int, in a turn, where it does not.
NARROW = Operator("narrow")

#: The place in an array that an int stands for, which may be below 0; the second is the length.
PLACE = Operator("place", True)


class Expression:
    """A value: its type, and the expressions that it consists of."""

    type: Type
    fails: bool

    @cached_property
    def parts(self) -> Sequence[Expression]:
        """In the order in which they are computed."""
        return [*_expressions_in(vars(self).values())]

    def __post_init__(self) -> None:
        """Find whether it can fail, of parts that know it."""
        self.fails = any(part.fails for part in self.parts)


@dataclass(eq=False)
class Number(Expression):
    """A float, an int or a bool that is written out."""

    value: Any
    type: Type


@dataclass(eq=False)
class Text(Expression):
    """A text that is written out."""

    value: str
    type: Type = TEXT


@dataclass(eq=False)
class Local(Expression):
    """An argument or a variable of the function."""

    name: str
    type: Type


@dataclass(eq=False)
class Constant(Expression):
    """What stands in a module: a number, or numbers."""

    module: str
    name: str
    value: Any
    type: Type

    @cached_property
    def parts(self) -> Sequence[Expression]:
        """There are none among its numbers, which may be many."""
        return ()


@dataclass(eq=False)
class Field(Expression):
    """A field of a record."""

    owner: Expression
    name: str
    type: Type


@dataclass(eq=False)
class Item(Expression):
    """An element of an array, at a place from 0 to one below its length."""

    owner: Expression
    place: Expression

    def __post_init__(self) -> None:
        """Find its type."""
        assert isinstance(self.owner.type, Array)
        self.type = self.owner.type.item
        super().__post_init__()


@dataclass(eq=False)
class Make(Expression):
    """An array or a record of some values."""

    type: Type
    values: Sequence[Expression]


@dataclass(eq=False)
class Operation(Expression):
    """An operator between its operands, of which `and` and `or` compute as many as they need."""

    operator: Operator
    operands: Sequence[Expression]
    type: Type

    def __post_init__(self) -> None:
        """Fail as the operator or an operand does."""
        super().__post_init__()
        self.fails |= self.operator.fails


@dataclass(eq=False)
class Choice(Expression):
    """One of two, by a condition."""

    test: Expression
    one: Expression
    other: Expression

    def __post_init__(self) -> None:
        """Find its type."""
        self.type = self.one.type
        super().__post_init__()


@dataclass(eq=False)
class Call(Expression):
    """A call of a function."""

    function: Function
    arguments: Sequence[Expression]

    def __post_init__(self) -> None:
        """Find its type; fail as the function or an argument does."""
        self.type = self.function.returns
        super().__post_init__()
        self.fails |= self.function.fails


@dataclass
class Statement:
    """A step of a function.

    Attributes:
        comment: that stands after it in its source.

    """

    comment: str = field(default="", init=False)


@dataclass
class Store(Statement):
    """Values of variables, one after the other."""

    values: Sequence[tuple[str, Expression]]


@dataclass
class Reserve(Statement):
    """A variable whose elements get their values one by one."""

    name: str
    type: Type


@dataclass
class StoreItem(Statement):
    """The value of an element of a variable, or of an element of its elements."""

    name: str
    places: Sequence[Expression]
    value: Expression


@dataclass
class Do(Statement):
    """A call of what returns nothing, or whose result is not used."""

    call: Expression


@dataclass
class If(Statement):
    """One of two blocks, by a condition."""

    test: Expression
    body: Sequence[Statement]
    orelse: Sequence[Statement] = ()


@dataclass
class While(Statement):
    """A block, as long as a condition holds and nothing has failed."""

    test: Expression
    body: Sequence[Statement]


@dataclass
class For(Statement):
    """A block for each number of a range; the body does not change the counter.

    Attributes:
        counter: variable that has the number, in this statement only.
        start, stop, step: of the range.
        turns: how many there are; None: that is not known before.
        is_wide: whether the counter may pass the largest int.

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
    """The end of the function, with its result."""

    value: Expression | None = None


@dataclass
class Break(Statement):
    """The end of the innermost loop."""


@dataclass
class Continue(Statement):
    """The end of a turn of the innermost loop."""


@dataclass
class Raise(Statement):
    """A failure, with a text of texts and of values with their formats, and its end."""

    parts: Sequence[str | tuple[Expression, str]]


@dataclass(eq=False)
class Function:
    """A function.

    Attributes:
        module, name: that it stands in, and its own; empty: one of operators or loops.
        sizes: types that it was made for; empty: there is but one of it.
        arguments: their types by their names.
        returns: type of its result.
        body: its statements.
        doc: its docstring.
        fails: whether it may.
        by_address: an array among its arguments that is not copied; empty: none.

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

    def end(self, body: Sequence[Statement]) -> None:
        """Give it its body."""
        self.body, self.fails = body, any(map(may_fail, statements_in(body)))


def statements_in(body: Sequence[Statement]) -> Iterator[Statement]:
    """All statements of a block, also those within others."""
    for statement in body:
        yield statement
        for block in blocks_of(statement):
            yield from statements_in(block)


def blocks_of(statement: Statement) -> Sequence[Sequence[Statement]]:
    """The blocks that a statement has."""
    if isinstance(statement, If):
        return (statement.body, statement.orelse)
    return (statement.body,) if isinstance(statement, (While, For)) else ()


def expressions_of(statement: Statement) -> Iterator[Expression]:
    """The expressions of a statement, but not those of its blocks."""
    yield from _expressions_in(vars(statement).values())


def _expressions_in(values: Iterable[Any]) -> Iterator[Expression]:
    """The expressions among the attributes of a node, also within its lists."""
    for value in values:
        if isinstance(value, Expression):
            yield value
        elif isinstance(value, (list, tuple)):
            yield from _expressions_in(value)


def expressions_in(expression: Expression) -> Iterator[Expression]:
    """An expression, and all that it consists of."""
    yield expression
    for part in expression.parts:
        yield from expressions_in(part)


def calls_in(body: Sequence[Statement]) -> Iterator[Call]:
    """All calls in a block, also those within others."""
    for statement in statements_in(body):
        for expression in expressions_of(statement):
            yield from (one for one in expressions_in(expression) if isinstance(one, Call))


def stored_in(statement: Statement) -> list[str]:
    """The variables that a statement gives a value, but not those of its blocks."""
    if isinstance(statement, Store):
        return [name for name, _ in statement.values]
    return [statement.name] if isinstance(statement, (Reserve, StoreItem)) else []


def variables_in(body: Sequence[Statement]) -> dict[str, Type]:
    """The variables that a block gives a value, with their types."""
    found: dict[str, Type] = {}
    for one in statements_in(body):
        if isinstance(one, Store):
            found |= {name: value.type for name, value in one.values}
        elif isinstance(one, Reserve):
            found[one.name] = one.type
    return found


def may_fail(statement: Statement) -> bool:
    """Whether a statement itself may fail, or must end where something has failed."""
    ends = isinstance(statement, (Raise, While))
    is_endless = isinstance(statement, For) and statement.turns is None
    return ends or is_endless or any(one.fails for one in expressions_of(statement))


def int_of(value: int) -> Number:
    """An int that is written out."""
    return Number(value, INT)


class Functions(dict[Hashable, Function]):
    """Functions by what they were made from, each after those that it calls."""

    def helper(
        self,
        name: str,
        types: Sequence[Type],
        arguments: Mapping[str, Type],
        returns: Type,
        body: Callable[[], Sequence[Statement]],
    ) -> Function:
        """A function of an operator, made once for some types."""
        key = (name, *types)
        if key not in self:
            made = Function("", name, dict(arguments), returns, sizes=types)
            made.end(body())
            self[key] = made
        return self[key]
