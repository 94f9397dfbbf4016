"""Operators of vectors and matrices as functions of elements, evaluated in Python's order."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from fmus.language import tree
from fmus.language.tree import (
    Call,
    Expression,
    Function,
    Functions,
    Item,
    Local,
    Statement,
    StoreItem,
    int_of,
)
from fmus.language.types import (
    FLOAT,
    INT,
    Array,
    Type,
    is_algebraic,
    is_number,
    matrix,
    sizes,
    vector,
)


def binary(
    functions: Functions, operator: ast.operator, left: Expression, right: Expression
) -> Expression | None:
    """Return a sum, a difference, a product or a quotient; None if Python defines none."""
    left_type, right_type = left.type, right.type
    if (
        isinstance(operator, (ast.Add, ast.Sub))
        and left_type == right_type
        and is_algebraic(left_type)
    ):
        name, sign = (
            ("plus", tree.ADD) if isinstance(operator, ast.Add) else ("minus", tree.SUBTRACT)
        )
        return Call(_each(functions, name, sign, left_type, right_type), (left, right))
    if isinstance(operator, ast.MatMult):
        return _product(functions, left, right)
    if isinstance(operator, ast.Mult):
        array, number = (left, right) if is_algebraic(left_type) else (right, left)
        if is_algebraic(array.type) and is_number(number.type):
            function = _each(functions, "times", tree.MULTIPLY, array.type, FLOAT)
            return Call(function, (array, number))
    if isinstance(operator, ast.Div) and is_algebraic(left_type) and is_number(right_type):
        return Call(_each(functions, "over", tree.DIVIDE, left_type, FLOAT), (left, right))
    return None


def negative(functions: Functions, operand: Expression) -> Expression:
    """Return a vector or a matrix with all signs changed."""
    return Call(_each(functions, "negative", tree.NEGATIVE, operand.type), (operand,))


def _each(functions: Functions, name: str, operator: tree.Operator, *types: Type) -> Function:
    """Return the function that applies an operator to each element of the first argument."""
    given = dict(zip(("a", "b"), types))

    def body() -> Sequence[Statement]:
        places = [Local(letter, INT) for letter, _ in zip("ij", sizes(types[0]))]
        operands = [
            _at(name, type_, places if is_algebraic(type_) else ()) for name, type_ in given.items()
        ]
        value = tree.Operation(operator, operands, FLOAT)
        return [
            *_loops(places, sizes(types[0]), StoreItem("a", places, value)),
            tree.Return(Local("a", types[0])),
        ]

    return functions.helper(name, types[:1], given, types[0], body)


def _at(name: str, type_: Type, places: Sequence[Expression]) -> Expression:
    """Return an element of an argument."""
    element: Expression = Local(name, type_)
    for place in places:
        element = Item(element, place)
    return element


def _loops(counters: Sequence[Local], n: Sequence[int], inner: Statement) -> Sequence[Statement]:
    """Return a statement in nested loops."""
    block = [inner]
    for counter, stop in reversed([*zip(counters, n)]):
        block = [tree.For(counter.name, int_of(0), int_of(stop), 1, stop, block)]
    return block


def _product(functions: Functions, left: Expression, right: Expression) -> Expression | None:
    left_type, right_type = left.type, right.type
    if (
        not (is_algebraic(left_type) and is_algebraic(right_type))
        or sizes(left_type)[-1] != sizes(right_type)[0]
    ):
        return None
    rows, columns = sizes(left_type)[:-1], sizes(right_type)[1:]
    if columns and not rows:
        return None  # a row vector is not a Vector
    returns: Type = FLOAT
    if rows:
        returns = matrix(*rows, *columns) if columns else vector(*rows)
    # Large matrices are not copied.
    by_address = "a" if rows and _is_stored(left) else ""

    def body() -> Sequence[Statement]:
        i, j = ([Local(letter, INT)] if n else [] for letter, n in (("i", rows), ("j", columns)))
        k, total = Local("k", INT), Local("total", FLOAT)
        term = tree.Operation(
            tree.MULTIPLY, (_at("a", left_type, [*i, k]), _at("b", right_type, [k, *j])), FLOAT
        )
        add = tree.Store([("total", tree.Operation(tree.ADD, (total, term), FLOAT))])
        sum_: list[Statement] = [
            tree.Store([("total", tree.Number(0.0, FLOAT))]),
            *_loops([k], sizes(right_type)[:1], add),
        ]
        if not rows:
            return [*sum_, tree.Return(total)]
        [outer] = _loops([*i, *j], [*rows, *columns], StoreItem("c", [*i, *j], total))
        inner = outer
        while isinstance(inner, tree.For) and isinstance(inner.body[0], tree.For):
            inner = inner.body[0]
        assert isinstance(inner, tree.For)
        inner.body = [*sum_, *inner.body]
        return [tree.Reserve("c", returns), outer, tree.Return(Local("c", returns))]

    name = "product_at" if by_address else "product"
    function = functions.helper(
        name, (left_type, right_type), {"a": left_type, "b": right_type}, returns, body
    )
    function.by_address = by_address
    return Call(function, (left, right))


def _is_stored(expression: Expression) -> bool:
    """Return True if a value has an address: a variable, constant, new value, or a part of one."""
    if isinstance(expression, (tree.Field, Item)):
        return _is_stored(expression.owner)
    return isinstance(expression, (Local, tree.Constant, tree.Make))


def transpose(functions: Functions, operand: Expression) -> Expression:
    """Return the transpose of a matrix."""
    rows, columns = sizes(operand.type)
    returns = matrix(columns, rows)

    def body() -> Sequence[Statement]:
        i, j = Local("i", INT), Local("j", INT)
        store = StoreItem("b", [i, j], _at("a", operand.type, [j, i]))
        return [
            tree.Reserve("b", returns),
            *_loops([i, j], [columns, rows], store),
            tree.Return(Local("b", returns)),
        ]

    types = (operand.type,)
    return Call(
        functions.helper("transpose", types, {"a": operand.type}, returns, body), (operand,)
    )


def sum_of(functions: Functions, owner: Expression) -> Expression:
    """Return the sum of a vector, from the first element to the last."""

    def body() -> Sequence[Statement]:
        k, total = Local("k", INT), Local("total", FLOAT)
        added = tree.Operation(tree.ADD, (total, _at("a", owner.type, [k])), FLOAT)
        return [
            tree.Store([("total", tree.Number(0.0, FLOAT))]),
            *_loops([k], sizes(owner.type)[:1], tree.Store([("total", added)])),
            tree.Return(total),
        ]

    function = functions.helper("sum", (owner.type,), {"a": owner.type}, FLOAT, body)
    return Call(function, (owner,))


def replaced(
    functions: Functions, owner: Expression, place: Expression, value: Expression
) -> Expression:
    """Return a copy with another element, or another row."""
    type_ = owner.type
    assert isinstance(type_, Array)
    given: dict[str, Type] = {"a": type_, "place": INT, "value": type_.item}

    def body() -> Sequence[Statement]:
        at = tree.Operation(tree.PLACE, (Local("place", INT), int_of(type_.n)), INT)
        return [
            StoreItem("a", [at], Local("value", type_.item)),
            tree.Return(Local("a", type_)),
        ]

    function = functions.helper("replaced", (type_,), given, type_, body)
    return Call(function, (owner, place, value))


def extreme(functions: Functions, word: str, operand: Expression) -> Expression:
    """Return the smallest or the largest element of a tuple of numbers."""
    type_ = operand.type
    assert isinstance(type_, Array)

    def body() -> Sequence[Statement]:
        i, found = Local("i", INT), Local("found", type_.item)
        next_ = extreme_of_two(word, found, _at("a", type_, [i]))
        return [
            tree.Store([("found", _at("a", type_, [int_of(0)]))]),
            tree.For(
                "i", int_of(1), int_of(type_.n), 1, type_.n - 1, [tree.Store([("found", next_)])]
            ),
            tree.Return(found),
        ]

    function = functions.helper(word, (type_,), {"a": type_}, type_.item, body)
    return Call(function, (operand,))


def extreme_of_two(word: str, first: Expression, second: Expression) -> Expression:
    """Return the smaller or the larger of two numbers of one type; the first if they are equal."""
    operators = {
        ("min", True): tree.MIN, ("max", True): tree.MAX,
        ("min", False): tree.INT_MIN, ("max", False): tree.INT_MAX,
    }  # fmt: skip
    return tree.Operation(operators[word, first.type == FLOAT], (first, second), first.type)
