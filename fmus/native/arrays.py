"""The operators of vectors and matrices in C: loops in the order of Python's."""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from fmus.native.program import Function, Program
from fmus.native.shapes import BOOLEAN, DOUBLE, INTEGER, Scalar, Shape, Structure, matrix, vector

_NUMBERS = (DOUBLE, INTEGER, BOOLEAN)


def is_array(shape: Shape | None) -> bool:
    """Whether a shape is a vector's or a matrix's."""
    return isinstance(shape, Structure) and shape.made in (Vector, Matrix)


class Operation(NamedTuple):
    """A function for an operator, and what it takes for its operands.

    Attributes:
        function: that computes the result.
        swapped: whether it takes the right one first.
        by_address: whether it takes the address of the left one.

    """

    function: Function
    swapped: bool = False
    by_address: bool = False


def binary(
    program: Program, operator: ast.operator, left: Shape, right: Shape, is_stored: bool
) -> Operation | None:
    """What computes a sum, a difference, a product or a quotient; None: Python has none either.

    Args:
        program: that gets the function.
        operator: between two operands.
        left: shape of the first one.
        right: of the other.
        is_stored: whether the first one has an address. A large matrix is not copied then.

    """
    if isinstance(operator, (ast.Add, ast.Sub)) and left == right and is_array(left):
        word, sign = ("plus", "+") if isinstance(operator, ast.Add) else ("minus", "-")
        return Operation(_each(program, left, word, f"a@ {sign} b@", {"b": left}))
    if isinstance(operator, ast.MatMult):
        by_address = is_stored and is_array(left) and len(sizes(left)) == 2
        function = _product(program, left, right, by_address)
        return Operation(function, by_address=by_address) if function else None
    if isinstance(operator, ast.Mult):
        array, number = (left, right) if is_array(left) else (right, left)
        if is_array(array) and number in _NUMBERS:
            times = _each(program, array, "times", "a@ * factor", {"factor": DOUBLE})
            return Operation(times, swapped=array is not left)
    if isinstance(operator, ast.Div) and is_array(left) and right in _NUMBERS:
        return Operation(_each(program, left, "over", "DIV(a@, divisor)", {"divisor": DOUBLE}))
    return None


def negative(program: Program, shape: Shape) -> Function:
    """What changes all signs."""
    return _each(program, shape, "negative", "-a@", {})


def sizes(shape: Shape) -> tuple[int, ...]:
    """The length of a vector, or the rows and columns of a matrix."""
    assert isinstance(shape, Structure)
    inner = shape.parts[0][1] if shape.parts else None
    return (len(shape.parts), *(sizes(inner) if isinstance(inner, Structure) else ()))


def _each(
    program: Program, shape: Shape, word: str, element: str, others: dict[str, Shape]
) -> Function:
    """What makes each element anew; `@` stands for its place."""
    places, indent, lines = "", "    ", []
    for letter, n in zip("ij", sizes(shape)):
        lines.append(f"{indent}for (int {letter} = 0; {letter} < {n}; {letter}++) {{")
        places, indent = f"{places}.v[{letter}]", f"{indent}    "
    lines.append(f"{indent}{f'a@ = {element};'.replace('@', places)}")
    lines += [f"{'    ' * depth}}}" for depth in range(len(sizes(shape)), 0, -1)]
    body = "\n".join([*lines, "    return a;"])
    name = f"{shape.name}_{word}"
    return program.helper(name, {"a": shape, **others}, shape, body)


def _product(program: Program, left: Shape, right: Shape, by_address: bool) -> Function | None:
    if not (is_array(left) and is_array(right)) or sizes(left)[-1] != sizes(right)[0]:
        return None
    n = sizes(left)[-1]
    address = Scalar(f"const {left.name} *", left.word)
    given: dict[str, Shape] = {"a": address if by_address else left, "b": right}
    name = f"{left.name}{'_at' * by_address}_product_{right.name}"
    a = "a->" if by_address else "a."
    if len(sizes(left)) == 1:
        if len(sizes(right)) == 2:
            return None  # a row vector is no Vector
        return program.helper(name, given, DOUBLE, _sum("a.v[k] * b.v[k]", n))
    rows = sizes(left)[0]
    returns: Structure
    if len(sizes(right)) == 1:
        returns, inner, element = vector(rows), [f"i < {rows}; i++"], "c.v[i]"
        term = f"{a}v[i].v[k] * b.v[k]"
    else:
        columns = sizes(right)[1]
        returns = matrix(rows, columns)
        inner, element = [f"i < {rows}; i++", f"j < {columns}; j++"], "c.v[i].v[j]"
        term = f"{a}v[i].v[k] * b.v[k].v[j]"
    lines, indent = [f"    {returns.name} c;"], "    "
    for loop in inner:
        lines.append(f"{indent}for (int {loop[0]} = 0; {loop}) {{")
        indent += "    "
    lines += [
        f"{indent}double total = 0.0;",
        f"{indent}for (int k = 0; k < {n}; k++) total += {term};",
        f"{indent}{element} = total;",
        *(f"{'    ' * depth}}}" for depth in range(len(inner), 0, -1)),
        "    return c;",
    ]
    return program.helper(name, given, returns, "\n".join(lines))


def _sum(term: str, n: int) -> str:
    return (
        "    double total = 0.0;\n"
        f"    for (int k = 0; k < {n}; k++) total += {term};\n    return total;"
    )


def transpose(program: Program, shape: Shape) -> Function:
    """What makes columns of rows."""
    rows, columns = sizes(shape)
    returns = matrix(columns, rows)
    body = (
        f"    {returns.name} b;\n"
        f"    for (int i = 0; i < {columns}; i++) {{\n"
        f"        for (int j = 0; j < {rows}; j++) b.v[i].v[j] = a.v[j].v[i];\n"
        "    }\n    return b;"
    )
    return program.helper(f"{shape.name}_transpose", {"a": shape}, returns, body)


def _sum_of(program: Program, shape: Structure) -> Function:
    return program.helper(
        f"{shape.name}_sum", {"a": shape}, DOUBLE, _sum("a.v[k]", len(shape.parts))
    )


def _replaced(program: Program, shape: Structure) -> Function:
    element, n = shape.parts[0][1], len(shape.parts)
    body = f"    a.v[PLACE(place, {n})] = value;\n    return a;"
    given: dict[str, Shape] = {"a": shape, "place": INTEGER, "value": element}
    return program.helper(f"{shape.name}_replaced", given, shape, body)


#: Methods, by their names.
METHODS: dict[str, Callable[[Program, Structure], Function]] = {
    "replaced": _replaced,
    "sum": _sum_of,
}


def extreme_of_two(word: str, shape: Shape) -> str:
    """The function of arithmetic.h for min or max of two numbers."""
    return f"{'smaller' if word == 'min' else 'larger'}{'' if shape == DOUBLE else '_integer'}"


def extreme(program: Program, shape: Structure, word: str) -> Function:
    """What finds the smallest or the largest element of a tuple of numbers."""
    part = shape.parts[0][1]
    function = extreme_of_two(word, part)
    body = (
        f"    {part.name} found = a.v[0];\n"
        f"    for (int i = 1; i < {len(shape.parts)}; i++) found = {function}(found, a.v[i]);\n"
        "    return found;"
    )
    return program.helper(f"{shape.name}_{word}", {"a": shape}, part, body)
