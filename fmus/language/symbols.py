"""Programs of the language with symbols of CasADi in place of numbers.

A plain number stays plain, so that conditions on plain numbers decide which code runs, and loops of
a known length run turn by turn. After a condition on a symbol both branches are evaluated, and what
they assign or return is joined by `if_else`.

A branch that is not taken must not spoil the derivatives of the other: zero times its infinite
derivative would be no number. So within a branch, the operands of operations that have such places
are replaced by harmless ones wherever the branch is not taken.

An expression cannot fail. Branches that refuse are left out: the values are taken to be valid.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

from fmus.language import tree
from fmus.language.tree import (
    Call,
    Choice,
    Field,
    Function,
    Item,
    Local,
    Make,
    Number,
    Operation,
    Operator,
)
from fmus.language.types import BOOL, FLOAT, Record, Scalar, Type, check_int, parts_of
from orchestrator.machine.errors import InputError
from orchestrator.machine.lazy import casadi

#: A number, a symbol, or a nested tuple of them: an array, or the fields of a record.
Value = Any

#: True, False or a symbol.
Condition = Any

#: Variables and their values.
_Known = dict[str, Value]

#: Most numbers among which a symbol may choose by an index.
_MOST_CHOICES = 1024

#: Most turns of a `while` whose condition is a symbol; after them it must be a number.
_MOST_TURNS = 100

#: Operands that are harmless for each operation with infinite derivatives, by their places. Small
#: quotients cannot grow beyond all bounds in the turns of a loop that has ended.
_HARMLESS: Mapping[str, Mapping[int, float]] = {
    "x / y": {1: 1e100}, "int /": {1: 1.0}, "//": {1: 1.0}, "%": {1: 1.0}, "**": {0: 1.0},
    "math.acos": {0: 0.0}, "math.acosh": {0: 2.0}, "math.asin": {0: 0.0}, "math.atan2": {1: 1.0},
    "math.atanh": {0: 0.0}, "math.cosh": {0: 0.0}, "math.exp": {0: 0.0}, "math.expm1": {0: 0.0},
    "math.fmod": {1: 1.0}, "math.log": {0: 1.0}, "math.log10": {0: 1.0}, "math.log1p": {0: 0.0},
    "math.log2": {0: 1.0}, "math.pow": {0: 1.0}, "math.sinh": {0: 0.0}, "math.sqrt": {0: 1.0},
    "math.tan": {0: 0.0},
}  # fmt: skip


class NotSymbolic(InputError):
    """A program that symbols cannot run; the message has the file and the line."""


class _Refused(Exception):
    """A failure of the program, with its message."""


def numbers_in(value: Value) -> Iterator[Value]:
    """Yield the numbers and symbols in a value, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers_in(part)
    else:
        yield value


def filled(type_: Type, numbers: Iterator[Value]) -> Value:
    """Return a value of a type from its numbers."""
    if isinstance(type_, Scalar):
        return next(numbers)
    return tuple([filled(part, numbers) for part in parts_of(type_)])


class Evaluator:
    """Evaluates functions of a program."""

    def __init__(self) -> None:
        self._casadi = casadi()
        self._symbol: Any = self._casadi.SX
        self._symbolic = _symbolic(self._casadi)
        self._constants: dict[int, Value] = {}
        #: Conditions of the present branch, from the outermost on, and their conjunctions.
        self._path: list[Condition] = []
        self._joined: list[Condition] = []
        #: Functions that are being evaluated.
        self._frames: list[_Frame] = []

    def call(self, function: Function, *arguments: Value, unless: Condition = False) -> Value:
        """Return the result of a function.

        Args:
            function: the function.
            arguments: its arguments, in order.
            unless: condition under which nothing uses the result.

        Raises:
            NotSymbolic: it needs a number where there is a symbol, or it refuses its arguments.

        """
        if unless is not False:
            self._enter(self._not(unless))
        try:
            return self._call(function, arguments)
        except _Refused as error:
            raise NotSymbolic(str(error)) from None
        finally:
            self._leave(0)

    def joined(self, test: Condition, this: Value, other: Value) -> Value:
        """Return one of two values, chosen by a condition."""
        if not isinstance(test, self._symbol):
            return this if test else other
        if this is other:
            return this
        if isinstance(this, tuple):
            parts = tuple([self.joined(test, *pair) for pair in zip(this, other)])
            return this if all(map(operator.is_, parts, this)) else parts
        are_plain = not isinstance(this, self._symbol) and not isinstance(other, self._symbol)
        if are_plain and this == other:
            return this
        return self._casadi.if_else(test, this, other)

    # Places and branches

    def _place(self) -> str:
        """Return file and line of the present statement, as the beginning of a message."""
        for frame in reversed(self._frames):
            if frame.line and frame.function.path:
                return f"{frame.function.path}:{frame.line}: "
        return ""

    def _cannot(self, what: str) -> NotSymbolic:
        return NotSymbolic(f"{self._place()}{what} depends on a symbol")

    def _refused(self, why: str) -> _Refused:
        return _Refused(f"{self._place()}{why}")

    def _enter(self, test: Condition) -> None:
        """Begin a part of the program that runs only under a condition."""
        self._path.append(test)
        self._joined.append(self._and(self._joined[-1], test) if self._joined else test)

    def _leave(self, depth: int) -> None:
        del self._path[depth:], self._joined[depth:]

    def _since(self, depth: int) -> Condition:
        """Return the conjunction of the conditions from a depth on."""
        found: Condition = True
        for test in self._path[depth:]:
            found = self._and(found, test)
        return found

    def _and(self, first: Condition, second: Condition) -> Condition:
        if first is True or second is False:
            return second
        if second is True or first is False:
            return first
        return self._casadi.logic_and(first, second)

    def _or(self, first: Condition, second: Condition) -> Condition:
        if first is True or second is False:
            return first
        if second is True or first is False:
            return second
        return self._casadi.logic_or(first, second)

    def _not(self, test: Condition) -> Condition:
        return self._casadi.logic_not(test) if isinstance(test, self._symbol) else not test

    def _within(self, test: Condition, run: Callable[[], Any]) -> Any:
        """Run something under a condition; return the refusal if it refuses."""
        depth = len(self._path)
        self._enter(test)
        try:
            return run()
        except _Refused as refused:
            return refused
        finally:
            self._leave(depth)

    # Functions and statements

    def _call(self, function: Function, arguments: Sequence[Value]) -> Value:
        frame = _Frame(function, len(self._path))
        self._frames.append(frame)
        try:
            self._block(function.body, dict(zip(function.arguments, arguments)))
        finally:
            self._frames.pop()
        if not frame.results:
            return None
        *earlier, (_, value) = frame.results
        for test, other in reversed(earlier):
            value = self.joined(test, other, value)
        return value

    def _block(self, body: Sequence[tree.Statement], known: _Known) -> Condition:
        """Run a block; return the condition under which it comes to its end."""
        depth = len(self._path)
        try:
            for statement in body:
                goes_on = self._statement(statement, known)
                if goes_on is False:
                    return False
                if goes_on is not True:
                    self._enter(goes_on)
            return self._since(depth)
        except _Refused:
            if len(self._path) == depth:
                raise
            return False  # it has returned, or left a loop, in all valid cases
        finally:
            self._leave(depth)

    def _statement(self, statement: tree.Statement, known: _Known) -> Condition:
        """Run a statement; return the condition under which the next one runs."""
        frame = self._frames[-1]
        frame.line = statement.line or frame.line
        if isinstance(statement, tree.Store):
            for name, value in statement.values:
                known[name] = self._value(value, known)
        elif isinstance(statement, tree.Reserve):
            known[statement.name] = _zero(statement.type)
        elif isinstance(statement, tree.StoreItem):
            places = [self._value(place, known) for place in statement.places]
            value = self._value(statement.value, known)
            known[statement.name] = self._replaced(known[statement.name], places, value)
        elif isinstance(statement, tree.Do):
            self._value(statement.call, known)
        elif isinstance(statement, tree.If):
            return self._if(statement, known)
        elif isinstance(statement, tree.For):
            return self._for(statement, known)
        elif isinstance(statement, tree.While):
            return self._while(statement, known)
        elif isinstance(statement, tree.Raise):
            raise self._refused(self._text(statement, known))
        else:
            self._end(statement, known)
            return False
        return True

    def _end(self, statement: tree.Statement, known: _Known) -> None:
        """Note the value of a return, or the variables where a turn or a loop ends."""
        frame = self._frames[-1]
        if isinstance(statement, tree.Return):
            value = None if statement.value is None else self._value(statement.value, known)
            frame.results.append((self._since(frame.depth), value))
            return
        loop = frame.loops[-1]
        exits = loop.breaks if isinstance(statement, tree.Break) else loop.continues
        depth = loop.depth if isinstance(statement, tree.Break) else loop.turn
        exits.append((self._since(depth), {**known}))

    def _text(self, statement: tree.Raise, known: _Known) -> str:
        texts = []
        for part in statement.parts:
            if isinstance(part, str):
                texts.append(part)
                continue
            value = self._value(part[0], known)
            shown = "..." if isinstance(value, self._symbol) else format(value, part[1])
            texts.append(shown)
        return "".join(texts)

    def _if(self, statement: tree.If, known: _Known) -> Condition:
        test = self._value(statement.test, known)
        if not isinstance(test, self._symbol):
            return self._block(statement.body if test else statement.orelse, known)
        one, two = {**known}, {**known}
        this = self._within(test, partial(self._block, statement.body, one))
        other = self._within(self._not(test), partial(self._block, statement.orelse, two))
        if isinstance(this, _Refused) and isinstance(other, _Refused):
            raise this
        # A refusal is not to happen, so the other branch runs in all valid cases.
        if isinstance(this, _Refused) or (this is False and not isinstance(other, _Refused)):
            is_valid = isinstance(this, _Refused)
            goes_on = other if is_valid else self._and(self._not(test), other)
            return self._become(known, two, goes_on)
        if isinstance(other, _Refused) or other is False:
            goes_on = this if isinstance(other, _Refused) else self._and(test, this)
            return self._become(known, one, goes_on)
        goes_on = True
        if this is not True or other is not True:
            goes_on = self._or(self._and(test, this), self._and(self._not(test), other))
        return self._become(known, self._merged(test, one, two), goes_on)

    def _become(self, known: _Known, other: _Known, goes_on: Condition) -> Condition:
        """Take over the variables of a branch, and return a condition."""
        known.clear()
        known.update(other)
        return goes_on

    def _merged(self, test: Condition, this: _Known, other: _Known) -> _Known:
        """Join the variables after two branches; one that only one of them knows is not used."""
        return {
            name: self.joined(test, value, other[name])
            for name, value in this.items()
            if name in other
        }

    def _for(self, statement: tree.For, known: _Known) -> Condition:
        bounds = [self._value(bound, known) for bound in (statement.start, statement.stop)]
        if any(isinstance(bound, self._symbol) for bound in bounds):
            raise self._cannot("the number of turns of a loop")
        turns = iter(range(bounds[0], bounds[1], statement.step))

        def next_turn() -> bool:
            for known[statement.counter] in turns:
                return True
            known.pop(statement.counter, None)
            return False

        return self._loop(statement.body, known, next_turn)

    def _while(self, statement: tree.While, known: _Known) -> Condition:
        loop, turns = self._frames[-1].loops, iter(range(_MOST_TURNS))

        def next_turn() -> bool:
            test = self._value(statement.test, known)
            is_symbol = isinstance(test, self._symbol)
            may_have_ended = len(self._path) > loop[-1].depth
            if (is_symbol or (test and may_have_ended)) and next(turns, None) is None:
                raise self._cannot("the end of a while")
            if not is_symbol:
                return bool(test)
            # The loop ends here unless the condition holds.
            depth = len(self._path)
            self._enter(self._not(test))
            loop[-1].breaks.append((self._since(loop[-1].depth), {**known}))
            self._leave(depth)
            self._enter(test)
            return True

        return self._loop(statement.body, known, next_turn)

    def _loop(
        self, body: Sequence[tree.Statement], known: _Known, next_turn: Callable[[], bool]
    ) -> Condition:
        """Run a loop turn by turn; return the condition under which the next statement runs."""
        frame, depth = self._frames[-1], len(self._path)
        loop, line, returned = _Loop(depth, depth), frame.line, len(frame.results)
        frame.loops.append(loop)
        goes_on: Condition = True
        try:
            while goes_on is not False and next_turn():
                loop.turn, loop.continues = len(self._path), []
                exits = len(frame.results), len(loop.breaks)
                goes_on = self._left(known, self._block(body, known), loop.continues)
                if exits == (len(frame.results), len(loop.breaks)):
                    goes_on = True
                elif goes_on is not False:
                    self._enter(goes_on)
                frame.line = line
            goes_on = False if goes_on is False else self._since(depth)
        except _Refused:
            if len(self._path) == depth:
                raise
            goes_on = False
        finally:
            self._leave(depth)
            frame.loops.pop()
        goes_on = self._left(known, goes_on, loop.breaks)
        return True if returned == len(frame.results) else goes_on

    def _left(
        self, known: _Known, goes_on: Condition, exits: Sequence[tuple[Condition, _Known]]
    ) -> Condition:
        """Join the variables at the end of a turn or loop with those at other exits from it."""
        for test, other in exits:
            if goes_on is False:
                goes_on = self._become(known, other, test)
            else:
                self._become(known, self._merged(test, other, known), True)
                goes_on = self._or(goes_on, test)
        return goes_on

    def _replaced(self, owner: Value, places: Sequence[Value], value: Value) -> Value:
        """Return an array with another value at nested indices."""
        if not places:
            return value
        place, *inner = places
        if isinstance(place, self._symbol):
            self._check_choices(owner)
            return tuple(
                [
                    self.joined(place == k, self._replaced(part, inner, value), part)
                    for k, part in enumerate(owner)
                ]
            )
        new = self._replaced(owner[place], inner, value)
        return (*owner[:place], new, *owner[place + 1 :])

    def _check_choices(self, owner: Value) -> None:
        if sum(1 for _ in numbers_in(owner)) > _MOST_CHOICES:
            raise self._cannot(f"the index into more than {_MOST_CHOICES} numbers")

    # Expressions

    def _value(self, expression: tree.Expression, known: _Known) -> Value:  # noqa: PLR0911
        if isinstance(expression, Number):
            return expression.value
        if isinstance(expression, Local):
            return known[expression.name]
        if isinstance(expression, Operation):
            return self._operation(expression, known)
        if isinstance(expression, Field):
            assert isinstance(expression.owner.type, Record)
            names = [name for name, _ in expression.owner.type.fields]
            return self._value(expression.owner, known)[names.index(expression.name)]
        if isinstance(expression, Item):
            owner = self._value(expression.owner, known)
            return self._item(owner, self._value(expression.place, known))
        if isinstance(expression, Make):
            return tuple([self._value(part, known) for part in expression.values])
        if isinstance(expression, Call):
            given = [self._value(part, known) for part in expression.arguments]
            return self._call(expression.function, given)
        if isinstance(expression, Choice):
            return self._choice(expression, known)
        if isinstance(expression, tree.Text):
            return expression.value
        assert isinstance(expression, tree.Constant)
        if id(expression) not in self._constants:
            self._constants[id(expression)] = _plain(expression.value)
        return self._constants[id(expression)]

    def _item(self, owner: Value, place: Value) -> Value:
        if not isinstance(place, self._symbol):
            return owner[place]
        self._check_choices(owner)
        value = owner[-1]
        for k in range(len(owner) - 2, -1, -1):
            value = self.joined(place == k, owner[k], value)
        return value

    def _choice(self, choice: Choice, known: _Known) -> Value:
        test = self._value(choice.test, known)
        if not isinstance(test, self._symbol):
            return self._value(choice.this if test else choice.other, known)
        this = self._within(test, partial(self._value, choice.this, known))
        other = self._within(self._not(test), partial(self._value, choice.other, known))
        if isinstance(this, _Refused):
            if isinstance(other, _Refused):
                raise other
            return other
        return this if isinstance(other, _Refused) else self.joined(test, this, other)

    def _operation(self, operation: Operation, known: _Known) -> Value:
        op = operation.operator
        if op in (tree.AND, tree.OR):
            return self._logic(operation, known)
        values = [self._value(part, known) for part in operation.operands]
        if not any(isinstance(value, self._symbol) for value in values):
            try:
                value = _PLAIN[op](*values)
                if op.name.startswith("int ") and isinstance(value, int):
                    check_int(value)
            except TypeError:
                raise self._refused("OverflowError: an integer exceeds 32 bits") from None
            except (ArithmeticError, LookupError, ValueError) as error:
                raise self._refused(f"{type(error).__name__}: {error}") from None
            return value
        if self._path:
            for place, harmless in _HARMLESS.get(op.name, {}).items():
                if isinstance(values[place], self._symbol):
                    values[place] = self.joined(self._joined[-1], values[place], harmless)
        if op not in self._symbolic:
            raise self._cannot(f"the operand of {op.name}")
        value = self._symbolic[op](*values)
        if isinstance(value, self._symbol) and value.is_constant():
            number = float(value)
            if operation.type == FLOAT:
                return number
            return bool(number) if operation.type == BOOL else int(number)
        return value

    def _logic(self, operation: Operation, known: _Known) -> Condition:
        """Return `and` or `or`; each operand is evaluated where the earlier ones decide nothing."""
        is_and = operation.operator == tree.AND
        found: Condition = is_and
        for part in operation.operands:
            goes_on = found if is_and else self._not(found)
            if goes_on is False:
                break
            if goes_on is True:
                value = self._value(part, known)
            else:
                value = self._within(goes_on, partial(self._value, part, known))
                if isinstance(value, _Refused):
                    break
            if not isinstance(value, self._symbol):
                value = bool(value)
            found = self._and(found, value) if is_and else self._or(found, value)
        return found


@dataclass
class _Loop:
    """A loop that is being evaluated.

    Attributes:
        depth, turn: numbers of conditions around it, and around its present turn.
        breaks, continues: variables where it, or its present turn, ends early, with conditions.

    """

    depth: int
    turn: int
    breaks: list[tuple[Condition, _Known]] = field(default_factory=list)
    continues: list[tuple[Condition, _Known]] = field(default_factory=list)


@dataclass
class _Frame:
    """A function that is being evaluated.

    Attributes:
        function: the function.
        depth: number of conditions around its call.
        line: line of its present statement; 0 if it is unknown.
        results: results, and the conditions under which it returns them.
        loops: loops around the present statement.

    """

    function: Function
    depth: int
    line: int = 0
    results: list[tuple[Condition, Value]] = field(default_factory=list)
    loops: list[_Loop] = field(default_factory=list)


def _zero(type_: Type) -> Value:
    """Return a value of a type whose numbers are all zero."""
    if isinstance(type_, Scalar):
        return 0.0 if type_ == FLOAT else 0
    return tuple([_zero(part) for part in parts_of(type_)])


def _plain(value: Any) -> Value:
    """Return a constant of a module as nested tuples."""
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value


def _nearest(x: float) -> float:
    return float(round(x)) if math.isfinite(x) else x


def _place_in(i: int, n: int) -> int:
    return range(n)[i]


#: Operators of numbers.
_PLAIN: Mapping[Operator, Callable[..., Value]] = {
    tree.ADD: operator.add, tree.SUBTRACT: operator.sub, tree.MULTIPLY: operator.mul,
    tree.OVER: operator.truediv, tree.NEGATIVE: operator.neg, tree.DIVIDE: operator.truediv,
    tree.FLOOR_DIVIDE: operator.floordiv, tree.MODULO: operator.mod, tree.POWER: operator.pow,
    tree.INT_ADD: operator.add, tree.INT_SUBTRACT: operator.sub, tree.INT_MULTIPLY: operator.mul,
    tree.INT_NEGATIVE: operator.neg, tree.INT_DIVIDE: operator.truediv,
    tree.INT_FLOOR_DIVIDE: operator.floordiv, tree.INT_MODULO: operator.mod,
    tree.INT_POWER: operator.pow, tree.INT_ABS: abs,
    tree.COUNT_ADD: operator.add, tree.COUNT_MULTIPLY: operator.mul,
    tree.LESS: operator.lt, tree.LESS_EQUAL: operator.le, tree.GREATER: operator.gt,
    tree.GREATER_EQUAL: operator.ge, tree.EQUAL: operator.eq, tree.NOT_EQUAL: operator.ne,
    tree.NOT: operator.not_, tree.ABS: abs, tree.MIN: min, tree.MAX: max, tree.INT_MIN: min,
    tree.INT_MAX: max, tree.TO_FLOAT: float, tree.TO_BOOL: bool, tree.TO_INT: int,
    tree.NEAREST: _nearest, tree.AS_INT: int,
    tree.NARROW: int, tree.PLACE: _place_in,
    **{op: getattr(math, name) for name, op in tree.MATHEMATICS.items()},
}  # fmt: skip


def _same(x: Value) -> Value:
    return x


@cache
def _symbolic(ca: Any) -> Mapping[Operator, Callable[..., Value]]:
    """Return the operators of symbols; others take numbers only."""

    def atan2(y: Value, x: Value) -> Value:
        # The derivatives at the origin are infinite, but may be multiplied by zero.
        return ca.atan2(y, x + ca.logic_and(x == 0.0, y == 0.0))

    def sqrt(x: Value) -> Value:
        # The derivative at zero is infinite, but may be multiplied by zero, as in a norm.
        is_zero = x == 0.0
        return ca.sqrt(x + is_zero) - is_zero

    def modulo(x: Value, y: Value) -> Value:
        z = ca.fmod(x, y)
        return ca.if_else(ca.logic_and(z != 0.0, (y < 0.0) != (z < 0.0)), z + y, z)

    def floor_divide(x: Value, y: Value) -> Value:
        n = (x - modulo(x, y)) / y
        whole = ca.floor(n)
        return whole + (n - whole > 0.5)

    def nearest(x: Value) -> Value:
        below = ca.floor(x)
        is_half = x - below == 0.5
        return ca.if_else(is_half, 2.0 * ca.floor((below + 1.0) / 2.0), ca.floor(x + 0.5))

    def place(i: Value, n: Value) -> Value:
        return ca.if_else(i < 0, i + n, i)

    return {
        **{op: _PLAIN[op] for op in (
            tree.ADD, tree.SUBTRACT, tree.MULTIPLY, tree.OVER, tree.NEGATIVE, tree.DIVIDE,
            tree.POWER, tree.INT_ADD, tree.INT_SUBTRACT, tree.INT_MULTIPLY, tree.INT_NEGATIVE,
            tree.INT_DIVIDE, tree.INT_POWER, tree.COUNT_ADD, tree.COUNT_MULTIPLY, tree.LESS,
            tree.LESS_EQUAL, tree.GREATER, tree.GREATER_EQUAL, tree.EQUAL, tree.NOT_EQUAL,
        )},
        tree.FLOOR_DIVIDE: floor_divide, tree.MODULO: modulo,
        tree.INT_FLOOR_DIVIDE: lambda a, b: ca.floor(a / b),
        tree.INT_MODULO: lambda a, b: a - b * ca.floor(a / b),
        tree.NOT: ca.logic_not, tree.ABS: ca.fabs, tree.INT_ABS: ca.fabs,
        tree.MIN: ca.fmin, tree.MAX: ca.fmax, tree.INT_MIN: ca.fmin, tree.INT_MAX: ca.fmax,
        tree.TO_FLOAT: _same, tree.TO_BOOL: lambda x: x != 0, tree.TO_INT: _same,
        tree.NEAREST: nearest, tree.AS_INT: _same, tree.NARROW: _same, tree.PLACE: place,
        **{tree.MATHEMATICS[name]: getattr(ca, name) for name in (
            "acos", "acosh", "asin", "asinh", "atan", "atanh", "ceil", "copysign", "cos",
            "cosh", "exp", "expm1", "fabs", "floor", "fmod", "log", "log10", "log1p", "sin",
            "sinh", "tan", "tanh",
        )},
        tree.MATHEMATICS["atan2"]: atan2,
        tree.MATHEMATICS["isfinite"]: lambda x: ca.fabs(x) < math.inf,
        tree.MATHEMATICS["isinf"]: lambda x: ca.fabs(x) == math.inf,
        tree.MATHEMATICS["isnan"]: lambda x: ca.logic_not(ca.fabs(x) <= math.inf),
        tree.MATHEMATICS["log2"]: lambda x: ca.log(x) / math.log(2.0),
        tree.MATHEMATICS["pow"]: lambda x, y: x**y,
        tree.MATHEMATICS["sqrt"]: sqrt,
        tree.MATHEMATICS["trunc"]: lambda x: ca.if_else(x < 0.0, ca.ceil(x), ca.floor(x)),
    }  # fmt: skip
