"""Whether noise is added to what is measured, so that none need be drawn where it is none.

`measured` adds it if the numbers that are drawn go through sums, and products with parameters, and
nothing is chosen by them. Then what they add is the same whatever is measured.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from fmus.language import tree
from fmus.language.tree import ADD, DIVIDE, MULTIPLY, NEGATIVE, OVER, SUBTRACT

#: What a value is made of, besides parameters: names of arguments of `measured`.
Made = frozenset[str]

_NOTHING: Made = frozenset()


class _Mixed(Exception):
    """What is drawn acts otherwise than as a term of a sum."""


def is_added(measured: tree.Function, drawn: str, group: str) -> bool:
    """Whether what is drawn is added to a group, as terms that do not depend on it."""
    arguments = {name: Made({name} & {drawn, group}) for name in measured.arguments}
    try:
        _Reading(drawn, arguments).result(measured)
    except _Mixed:
        return False
    return True


@dataclass
class _Reading:
    """What the variables of a function are made of."""

    drawn: str
    known: dict[str, Made]
    returned: set[str] = field(default_factory=set)

    def result(self, function: tree.Function) -> Made:
        """What a function returns is made of."""
        self._read(function.body)
        # Loops hand on what later statements have made.
        before: dict[str, Made] = {}
        while before != self.known:
            before = {**self.known}
            self._read(function.body)
        return Made(self.returned)

    def _read(self, body: Sequence[tree.Statement]) -> None:
        for one in body:
            match one:
                case tree.Store(values):
                    for name, value in values:
                        self._keep(name, self._made(value))
                case tree.StoreItem(name, places, value):
                    self._unmixed(places)
                    self._keep(name, self._made(value))
                case tree.Return(value) if value is not None:
                    self.returned |= self._made(value)
                case tree.Return() | tree.Reserve() | tree.Break() | tree.Continue():
                    pass
                case _:
                    # Tests, bounds of loops, and what is said of a failure.
                    self._unmixed(tree.expressions_of(one))
                    for block in tree.blocks_of(one):
                        self._read(block)

    def _keep(self, name: str, made: Made) -> None:
        self.known[name] = self.known.get(name, _NOTHING) | made

    def _unmixed(self, expressions: Iterable[tree.Expression]) -> None:
        """Refuse what is drawn, or measured, where it chooses what happens."""
        if any(self._made(one) for one in expressions):
            raise _Mixed

    def _made(self, of: tree.Expression) -> Made:
        match of:
            case tree.Local(name):
                return self.known.get(name, _NOTHING)
            case tree.Item(owner, place):
                self._unmixed([place])
                return self._made(owner)
            case tree.Choice(test, one, other):
                self._unmixed([test])
                return self._made(one) | self._made(other)
            case tree.Call(function, arguments):
                known = dict(zip(function.arguments, map(self._made, arguments), strict=True))
                return _Reading(self.drawn, known).result(function)
            case tree.Operation(operator, operands):
                parts = [self._made(one) for one in operands]
                return self._operated(operator, parts)
        return _joined(map(self._made, of.parts))

    def _operated(self, operator: tree.Operator, parts: Sequence[Made]) -> Made:
        made = _joined(parts)
        is_sum = operator in (ADD, SUBTRACT, NEGATIVE)
        is_share = operator in (OVER, DIVIDE) and not parts[-1]
        is_product = operator == MULTIPLY and (made == {self.drawn} or not all(parts))
        if self.drawn in made and not (is_sum or is_share or is_product):
            raise _Mixed
        return made


def _joined(parts: Iterable[Collection[str]]) -> Made:
    return _NOTHING.union(*parts)
