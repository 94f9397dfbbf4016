"""A pitch controller whose gains come from a table over Mach number and altitude."""

from __future__ import annotations

from bisect import bisect_right
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector

MACH = Vector([0.2, 0.4, 0.6, 0.8, 0.95])
ALTITUDE = Vector([0.0, 3e3, 6e3, 11e3])
K_P = Matrix(
    [
        [2.0, 2.2, 2.6, 3.1],
        [1.6, 1.8, 2.1, 2.7],
        [1.2, 1.3, 1.6, 2.2],
        [0.9, 1.0, 1.3, 1.9],
        [0.7, 0.9, 1.1, 1.6],
    ]
)
K_I = K_P * 0.3

SAMPLED = True


class Parameters(NamedTuple):
    limit: Annotated[float, Variable("rad", "Largest deflection", POSITIVE, tunable=True)] = 0.4


class Inputs(NamedTuple):
    mach: Annotated[float, Variable("1", "Mach number")] = 0.5
    altitude: Annotated[float, Variable("m", "Altitude")] = 2000.0
    error: Annotated[float, Variable("rad", "Wanted less measured pitch")] = 0.1
    on: Annotated[bool, Variable(description="Whether it controls")] = True


class State(NamedTuple):
    integral: float = 0.0


class Outputs(NamedTuple):
    elevator: Annotated[float, Variable("rad", "Deflection")]
    gains: Annotated[Vector, 2, Variable("1", "In use", members=("p", "i"))]


def locate(x: float, grid: Vector) -> tuple[int, float]:
    """The cell of x, and where in it x is, from 0 to 1."""
    n = len(grid)
    if x <= grid[0]:
        return 0, 0.0
    if x >= grid[-1]:
        return n - 2, 1.0
    k = bisect_right(grid, x) - 1
    return k, (x - grid[k]) / (grid[k + 1] - grid[k])


def lookup(table: Matrix, mach: float, altitude: float = 0.0) -> float:
    (i, u), (j, v) = locate(mach, MACH), locate(altitude, ALTITUDE)
    low = (1 - v) * table[i, j] + v * table[i, j + 1]
    high = (1 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return (1 - u) * low + u * high


def gains_of(inputs: Inputs) -> Annotated[Vector, 2]:
    return Vector(lookup(t, inputs.mach, altitude=inputs.altitude) for t in (K_P, K_I))


def start() -> State:
    return State()


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    if not inputs.on:
        return State()
    integral = state.integral + h * inputs.error
    bound = parameters.limit / max(gains_of(inputs)[1], 1e-3)
    return State(max(min(integral, bound), -bound))


def outputs(parameters: Parameters, state: State, inputs: Inputs) -> Outputs:
    assert inputs.mach >= 0, "the Mach number is negative"
    gains = gains_of(inputs)
    u = gains @ Vector([inputs.error, state.integral]) if inputs.on else 0
    if -parameters.limit <= u <= parameters.limit:
        return Outputs(u, gains)
    return Outputs(parameters.limit * (1 if u > 0 else -1), gains)
