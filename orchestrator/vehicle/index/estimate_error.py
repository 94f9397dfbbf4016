"""Error of the estimated velocity."""

from __future__ import annotations

from math import nan, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import VELOCITY
from auv_fmu.language.vectors import Vector3


class Inputs(NamedTuple):
    """The velocity of the control point, and its estimate."""

    dy: Annotated[Vector3, Variable(VELOCITY, "Velocity", name="plant.dy")]
    dy_hat: Annotated[Vector3, Variable(VELOCITY, "Its estimate", name="controller.dy_hat")]


class State(NamedTuple):
    """Sums over the steps of the second half so far."""

    squares: Vector3  #: sums of the squares of the error
    steps: int  #: number of these steps
    is_late: bool  #: true if the next step begins in the second half


class Outputs(NamedTuple):
    """The error."""

    estimate_error: Annotated[
        float,
        Variable(
            "m/s",
            "root mean square of |dy_hat - dy| in the second half, both of the same instant",
        ),
    ]


def is_late(t: float, begin: float, end: float) -> bool:
    """Return True for a time in the second half of a run."""
    return t >= begin + 0.5 * (end - begin)


def start(t: float, begin: float, end: float) -> State:
    """Begin without a step."""
    return State((0.0, 0.0, 0.0), 0, is_late(t, begin, end))


def update(
    state: State, before: Inputs, acting: Inputs, t: float, begin: float, end: float
) -> State:
    """Add a step."""
    if not state.is_late:
        return state._replace(is_late=True) if is_late(t, begin, end) else state
    s_x, s_y, s_z = state.squares
    x, y, z = acting.dy_hat
    d_x, d_y, d_z = before.dy
    x, y, z = x - d_x, y - d_y, z - d_z
    return State((s_x + x * x, s_y + y * y, s_z + z * z), state.steps + 1, True)


def outputs(state: State) -> Outputs:
    """Return the root of the mean."""
    if state.steps == 0:
        return Outputs(nan)
    x, y, z = state.squares
    return Outputs(sqrt((x + y + z) / state.steps))
