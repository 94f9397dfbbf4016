"""Vectors and matrices of fixed size, with operators, for users' components.

The equations of the paper use :mod:`.vectors` instead, for speed. Both classes are immutable, and
their operators add up numbers in a fixed order, so that a translation to C gives the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from operator import add, neg, sub
from typing import Any, overload


class Vector(tuple[float, ...]):
    """A tuple of numbers with the operators of linear algebra."""

    __slots__ = ()

    def __new__(cls, values: Iterable[float]) -> Vector:
        """Make a vector of numbers."""
        return _vector(map(float, values))

    def __add__(self, other: Vector) -> Vector:  # type: ignore[override]
        return _vector(map(add, self, _alike(self, other)))

    def __sub__(self, other: Vector) -> Vector:
        return _vector(map(sub, self, _alike(self, other)))

    def __neg__(self) -> Vector:
        return _vector(map(neg, self))

    def __mul__(self, factor: float) -> Vector:  # type: ignore[override]
        _check_number(factor)
        return _vector([x * factor for x in self])

    __rmul__ = __mul__  # type: ignore[assignment]

    def __truediv__(self, divisor: float) -> Vector:
        _check_number(divisor)
        return _vector([x / divisor for x in self])

    def __matmul__(self, other: Vector) -> float:
        """Return the scalar product."""
        total = 0.0
        for x, y in zip(self, _alike(self, other)):
            total += x * y
        return total

    @overload  # type: ignore[override]
    def __getitem__(self, place: int) -> float: ...

    @overload
    def __getitem__(self, place: slice) -> Vector: ...

    def __getitem__(self, place: Any) -> Any:
        found = tuple.__getitem__(self, place)
        return _vector(found) if isinstance(place, slice) else found

    def sum(self) -> float:
        """Return the sum, from first to last element, as Python did before version 3.12."""
        total = 0.0
        for x in self:
            total += x
        return total

    def replaced(self, place: int, value: float) -> Vector:
        """Return a copy with another element at a place."""
        elements = [*self]
        self[place]  # raises IndexError
        elements[place] = float(value)
        return _vector(elements)


class Matrix(tuple[Vector, ...]):
    """A matrix, as a tuple of its rows, with the operators of linear algebra."""

    __slots__ = ()

    def __new__(cls, rows: Iterable[Iterable[float]]) -> Matrix:
        """Make a matrix of rows of the same length."""
        made = _matrix(map(Vector, rows))
        if len({len(row) for row in made}) > 1:
            raise TypeError(f"rows of {', '.join(str(len(row)) for row in made)} elements")
        return made

    def __add__(self, other: Matrix) -> Matrix:  # type: ignore[override]
        return _matrix(map(Vector.__add__, self, _alike(self, other)))

    def __sub__(self, other: Matrix) -> Matrix:
        return _matrix(map(Vector.__sub__, self, _alike(self, other)))

    def __neg__(self) -> Matrix:
        return _matrix(map(Vector.__neg__, self))

    def __mul__(self, factor: float) -> Matrix:  # type: ignore[override]
        return _matrix([row * factor for row in self])

    __rmul__ = __mul__  # type: ignore[assignment]

    def __truediv__(self, divisor: float) -> Matrix:
        return _matrix([row / divisor for row in self])

    @overload
    def __matmul__(self, other: Matrix) -> Matrix: ...

    @overload
    def __matmul__(self, other: Vector) -> Vector: ...

    def __matmul__(self, other: Matrix | Vector) -> Matrix | Vector:
        """Return the product with a matrix, or with a column."""
        if isinstance(other, Matrix):
            columns = other.T
            return _matrix([_vector([row @ column for column in columns]) for row in self])
        return _vector([row @ other for row in self])

    @overload  # type: ignore[override]
    def __getitem__(self, place: int) -> Vector: ...

    @overload
    def __getitem__(self, place: tuple[int, int]) -> float: ...

    def __getitem__(self, place: Any) -> Any:
        if isinstance(place, tuple):
            row, column = place
            return tuple.__getitem__(self, row)[column]
        return tuple.__getitem__(self, place)

    @property
    def T(self) -> Matrix:
        """The transpose."""
        return _matrix(map(_vector, zip(*self)))

    def replaced(self, place: int, row: Vector) -> Matrix:
        """Return a copy with another row at a place."""
        rows = [*self]
        rows[place] = _alike(self[place], row)
        return _matrix(rows)


def _vector(values: Iterable[float]) -> Vector:
    return tuple.__new__(Vector, values)


def _matrix(rows: Iterable[Vector]) -> Matrix:
    return tuple.__new__(Matrix, rows)


def _alike(one: Any, other: Any) -> Any:
    """Return `other`, which must have the type and length of `one`."""
    if type(one) is not type(other) or len(one) != len(other):
        names = (f"a {type(x).__name__} of {len(x)}" for x in (one, other))
        raise TypeError(f"{' and '.join(names)} do not fit together")
    return other


def _check_number(factor: object) -> None:
    if not isinstance(factor, (float, int)):
        raise TypeError(f"a Vector times a {type(factor).__name__}: use @, or a number")
