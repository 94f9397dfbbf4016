"""How much of a thread's stack the equations take.

Structures are passed and returned by value, so a function that adds large vectors keeps each sum on
the stack. Nothing calls itself, and all sizes are fixed: what lies there at most can be added up.
Compilers keep no more than this, but for a tenth, and less if they optimise.
"""

from __future__ import annotations

from collections.abc import Iterable
from operator import itemgetter

from fmus.language import tree
from fmus.language.tree import Call, Expression, Function, Make
from fmus.language.types import Scalar, Type, count

#: Bytes that a number takes, alone in a structure.
NUMBER = 8


def deepest(functions: Iterable[Function]) -> tuple[int, Function | None]:
    """The most bytes that lie on the stack in a call from outside, and the call of what.

    Args:
        functions: each after those that it calls.

    """
    depths: dict[Function, int] = {}
    for function in functions:
        own, deeper = 0, 0
        variables: dict[str, Type] = {}
        for one in tree.statements_in(function.body):
            if isinstance(one, tree.Reserve):
                variables[one.name] = one.type
            elif isinstance(one, tree.Store):
                variables |= {name: value.type for name, value in one.values}
            for each in tree.expressions_of(one):
                own += _held(each)
                calls = (part for part in tree.expressions_in(each) if isinstance(part, Call))
                deeper = max([deeper, *(depths[call.function] for call in calls)])
        own += sum(map(_result, variables.values()))
        depths[function] = _passed(function) + own + deeper
    found = [(depth + _result(one.returns), one) for one, depth in depths.items()]
    return max(found, key=itemgetter(0), default=(0, None))


def _result(type_: Type) -> int:
    """The bytes of a structure; a number lies in a register."""
    return 0 if isinstance(type_, Scalar) else NUMBER * count(type_)


def _passed(function: Function) -> int:
    """The bytes of the arguments that a function takes by value."""
    given = function.arguments.items()
    return sum(_result(type_) for name, type_ in given if name != function.by_address)


def _held(one: Expression, within: bool = False) -> int:
    """The bytes of the structures that an expression makes, and that are returned to it."""
    is_made = isinstance(one, Make)
    own = _result(one.type) if isinstance(one, Call) or (is_made and not within) else 0
    return own + sum(_held(part, is_made) for part in one.parts)
