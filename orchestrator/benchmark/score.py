"""Indices of the benchmark: error, effort, saturation and chatter of a run."""

from __future__ import annotations

from math import nan, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import Variable, Vector
from auv_fmu.language.vectors import norm, sub
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point

XYZ, ANGLES, TAU = ("x", "y", "z"), ("phi", "theta", "psi"), {"u": "N", "q": "N.m", "r": "N.m"}

#: A command is at its limit from this share on: a law that limits its force rounds.
FULL = 1.0 - 1e-9


class Inputs(NamedTuple):
    """Posture, reference, command and limits."""

    position: Annotated[Vector, 3, Variable("m", "Position", members=XYZ, name="plant.eta")]
    attitude: Annotated[Vector, 3, Variable("rad", "Attitude", members=ANGLES, name="plant.eta")]
    y_d: Annotated[Vector, 3, Variable("m", "Reference", members=XYZ, name="planner.y_d")]
    tau: Annotated[Vector, 3, Variable(TAU, "Command", name="controller.tau")]
    tau_max: Annotated[Vector, 3, Variable(TAU, "Limits", name="limiter.tau_max")]
    ell: Annotated[float, Variable("m", "Distance of the control point", name="plant.ell")]


class State(NamedTuple):
    """Sums over the steps so far; commands are shares of their limits."""

    squares: float  #: sum of the squared errors in the second half [m2]
    rows: int  #: in the second half
    largest: float  #: error in the second half [m]
    energy: float  #: mean square of the limited commands, times the number of steps
    saturated: int  #: steps with a command at its limit or beyond
    variation: float  #: total variation of the limited commands
    shares: Annotated[Vector, 3]  #: limited commands of the last step
    steps: int


class Outputs(NamedTuple):
    """Numbers of the run."""

    error: Annotated[float, Variable("m", "root mean square of |e| in the second half")]
    largest: Annotated[float, Variable("m", "largest |e| in the second half")]
    effort: Annotated[
        float, Variable("1", "root mean square of the limited commands, as shares of the limits")
    ]
    saturated: Annotated[float, Variable("1", "share of the steps with a command at a limit")]
    chatter: Annotated[
        float,
        Variable("1/s", "total variation of the limited commands per second, mean of the three"),
    ]


def start() -> State:
    """Begin without a row."""
    return State(0.0, 0, 0.0, 0.0, 0, 0.0, Vector((0.0, 0.0, 0.0)), 0)


def update(
    state: State, inputs: Inputs, acting: Inputs, t: float, begin: float, end: float
) -> State:
    """Add a step."""
    squares, rows, largest = state.squares, state.rows, state.largest
    if t >= begin + 0.5 * (end - begin):
        phi, theta, psi = inputs.attitude
        x, y, z = inputs.position
        a, b, c = inputs.y_d
        point = control_point((x, y, z), rotation_from_euler(phi, theta, psi), inputs.ell)
        error = norm(sub(point, (a, b, c)))
        squares, rows, largest = squares + error * error, rows + 1, max(largest, error)
    wanted = Vector(acting.tau[i] / acting.tau_max[i] for i in range(3))
    shares = Vector(max(-1.0, min(1.0, share)) for share in wanted)
    full = any(abs(share) >= FULL for share in shares)
    change = abs(shares[0] - state.shares[0])
    change = change + abs(shares[1] - state.shares[1])
    change = change + abs(shares[2] - state.shares[2])
    return State(
        squares,
        rows,
        largest,
        state.energy + (shares @ shares) / 3.0,
        state.saturated + (1 if full else 0),
        state.variation + (change / 3.0 if state.steps > 0 else 0.0),
        shares,
        state.steps + 1,
    )


def outputs(state: State, t: float, begin: float) -> Outputs:
    """Return the numbers."""
    if state.steps == 0 or state.rows == 0:
        return Outputs(nan, nan, nan, nan, nan)
    return Outputs(
        sqrt(state.squares / state.rows),
        state.largest,
        sqrt(state.energy / state.steps),
        state.saturated / state.steps,
        state.variation / (t - begin),
    )
