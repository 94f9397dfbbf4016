"""What a `for` of the language of equations runs over, in C."""

from __future__ import annotations

import ast
from typing import NamedTuple

from fmus.native.expressions import SUM, Code, Expressions
from fmus.native.shapes import INTEGER, Structure, in_c
from fmus.native.variables import is_fixed_name


class Loop(NamedTuple):
    """The beginning of a loop.

    Attributes:
        before: what is computed before it: declarations.
        begin, test, change: what stands in the brackets after `for`.
        bound: names that get a value in each turn, and the value.
        turns: how often it runs; None: that is not known before.

    """

    before: list[str]
    begin: str
    test: str
    change: str
    bound: list[tuple[str, Code]]
    turns: int | None

    def head(self, *, may_raise: bool) -> str:
        """Its first line, with the open brace; it ends after an error, also by `continue`."""
        test = f"!error->raised && {self.test}" if may_raise else self.test
        return f"for ({self.begin}; {test}; {self.change}) {{"


def loop_over(within: Expressions, target: ast.expr, iterable: ast.expr, changed: set[str]) -> Loop:
    """The loop over something.

    Args:
        within: translates expressions of the function.
        target: what gets the values.
        iterable: what they come from.
        changed: names that the body changes, or that have a value already.

    Raises:
        Untranslatable: it is nothing that a loop can run over.

    """
    if _called(within, iterable) is range:
        assert isinstance(iterable, ast.Call)
        return _range(within, target, iterable, changed)
    before: list[str] = []
    names = (n.id.lstrip("_") for n in ast.walk(target) if isinstance(n, ast.Name))
    first = next(filter(None, names), "x")
    items = _Items(within, before, changed, first)
    place = Code(in_c(within.unused(f"{first}_at")), INTEGER)
    bound, count = items.taken(target, iterable, place)
    at = place.text
    return Loop(before, f"int {at} = 0", f"{at} < {count}", f"{at}++", bound, count)


def _called(within: Expressions, node: ast.expr) -> object:
    return within.known(node.func) if isinstance(node, ast.Call) else None


def _range(within: Expressions, target: ast.expr, call: ast.Call, changed: set[str]) -> Loop:
    if not isinstance(target, ast.Name):
        raise within.fail(target, "more than one name for the numbers of a range")
    first, stop, step = _bounds(within, call)
    numbers = [_number(code.text) for code in (first, stop, step)]
    if not numbers[2]:
        raise within.fail(call, "a step of a range that is not a constant other than 0")
    name = in_c(target.id)
    before = []
    if numbers[1] is None:
        end = within.unused(f"{name}_stop")
        before = [f"const int {end} = {stop.text};"]
        stop = Code(end, INTEGER)
    sign = "<" if numbers[2] > 0 else ">"
    known = None if None in numbers else len(range(*numbers))  # type: ignore[arg-type]
    if abs(numbers[2]) > 1 and (numbers[1] is None or abs(numbers[1] + numbers[2]) >= 2**31):
        # The counter may pass the largest int.
        at = within.unused(f"{name}_at")
        kind, counter = "long long", Code(f"(int){at}", INTEGER)
    elif target.id in changed and name != "_":
        at, kind = within.unused(f"{name}_at"), "int"
        counter = Code(at, INTEGER)
    else:
        at, kind, counter = name, "int", Code(name, INTEGER)
    change = {1: "++", -1: "--"}.get(numbers[2], f" += {step.text}")
    begin, test = f"{kind} {at} = {first.text}", f"{at} {sign} {stop.text}"
    bound = [] if name == "_" else [(target.id, counter)]
    return Loop(before, begin, test, f"{at}{change}", bound, known)


def _bounds(within: Expressions, call: ast.Call) -> list[Code]:
    """Where a range begins and ends, and its step."""
    within.check_plain(call, "range")
    if not 1 <= len(call.args) <= 3:
        raise within.fail(call, f"range with {len(call.args)} arguments")
    bounds = [_bound(within, argument) for argument in call.args]
    if len(bounds) == 1:
        bounds = [Code("0", INTEGER), *bounds]
    return [*bounds, Code("1", INTEGER)][:3]


def _bound(within: Expressions, node: ast.expr) -> Code:
    """A bound of a range; what consists of constants is the number that it stands for."""
    value = within.size(node)
    if value is not None:
        return within.code(ast.copy_location(ast.Constant(value), node))
    return within.integer(node, "a bound of a range")


def _number(text: str) -> int | None:
    return int(text) if text.removeprefix("-").isdecimal() else None


class _Items:
    """Takes the items of what a loop runs over apart."""

    def __init__(
        self, within: Expressions, before: list[str], changed: set[str], name: str
    ) -> None:
        self._within, self._before, self._changed, self._name = within, before, changed, name

    def taken(
        self, target: ast.expr, iterable: ast.expr, place: Code
    ) -> tuple[list[tuple[str, Code]], int]:
        """Names with their values at a place, and how many places there are."""
        called = _called(self._within, iterable)
        if called is zip or called is enumerate:
            assert isinstance(iterable, ast.Call)
            self._within.check_plain(iterable, called.__name__)
            if called is enumerate and len(iterable.args) != 1:
                raise self._within.fail(target, "enumerate with a start: add it to the count")
            if not isinstance(target, ast.Tuple):
                raise self._within.fail(target, f"{called.__name__} without a name for each part")
            if called is enumerate and len(target.elts) != 2:
                raise self._within.fail(target, "enumerate without two names")
            if called is enumerate:
                first, second = target.elts
                bound, count = self.taken(second, iterable.args[0], place)
                return [*self._within.taken_apart(first, place), *bound], count
            if len(target.elts) != len(iterable.args):
                raise self._within.fail(target, "another number of names than zip has parts")
            pairs = [self.taken(t, i, place) for t, i in zip(target.elts, iterable.args)]
            return [one for bound, _ in pairs for one in bound], min(n for _, n in pairs)
        if called is range:
            assert isinstance(iterable, ast.Call)
            return self._numbers(target, iterable, place)
        code = self._named(iterable, self._within.code(iterable))
        if not isinstance(code.shape, Structure) or not code.shape.is_array:
            raise self._within.fail(
                iterable, "a loop over something other than a range, vector or tuple of one type"
            )
        item = Code(f"{code.text}.v[{place.text}]", code.shape.parts[0][1])
        return list(self._within.taken_apart(target, item)), len(code.shape.parts)

    def _numbers(
        self, target: ast.expr, call: ast.Call, place: Code
    ) -> tuple[list[tuple[str, Code]], int]:
        """The numbers of a range that stands beside something else."""
        first, stop, step = (_number(code.text) for code in _bounds(self._within, call))
        if first is None or stop is None or not step:
            raise self._within.fail(call, "a range of other than constants within a zip")
        n = len(range(first, stop, step))
        if abs(step) * n >= 2**31:
            raise self._within.fail(call, "a range of so many numbers within a zip")
        moved = f"{place.text} * {step}" if step != 1 else place.text
        text = f"{first} + {moved}" if first else moved
        item = Code(text, INTEGER, SUM)
        return list(self._within.taken_apart(target, item)), n

    def _named(self, node: ast.expr, code: Code) -> Code:
        """The same, in a variable if it is no name, or if the body changes what it is made of."""
        used = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        if is_fixed_name(node) and not used & self._changed:
            return code
        name = in_c(self._within.unused(f"{self._name}_all"))
        self._within.program.defined(code.shape)
        self._before.append(f"const {code.shape.name} {name} = {code.text};")
        return Code(name, code.shape)
