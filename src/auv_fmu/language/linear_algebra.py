"""Functions of vectors and matrices of any size, in the language of equations."""

from __future__ import annotations

from auv_fmu.language.arrays import Matrix, Vector


def interpolate(x: float, xs: Vector, ys: Vector) -> float:
    """Interpolate linearly between points; outside of them, the value at the end holds.

    Args:
        x: argument.
        xs: arguments of the points, increasing.
        ys: values of the points.

    """
    if x <= xs[0]:
        return ys[0]
    for k in range(1, len(xs)):
        if x < xs[k]:
            share = (x - xs[k - 1]) / (xs[k] - xs[k - 1])
            return ys[k - 1] + share * (ys[k] - ys[k - 1])
    return ys[-1] if x >= xs[-1] else x


def solve(A: Matrix, b: Vector) -> Vector:
    """Solution x of A x = b, by Gaussian elimination with partial pivoting.

    Raises:
        ZeroDivisionError: A is singular.

    """
    for k in range(len(b)):
        p = k
        for i in range(k + 1, len(b)):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        pivot, right = A[p] / A[p, k], b[p] / A[p, k]
        A = A.replaced(p, A[k])
        A = A.replaced(k, pivot)
        b = b.replaced(p, b[k])
        b = b.replaced(k, right)
        for i in range(len(b)):
            if i != k:
                factor = A[i, k]
                A = A.replaced(i, A[i] - factor * pivot)
                b = b.replaced(i, b[i] - factor * right)
    return b
