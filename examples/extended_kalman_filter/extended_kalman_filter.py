"""An extended Kalman filter that tracks a target by radar, from its range and bearing.

    S = H P_ H' + R,  e = z - g(x_)                     innovation, H = dg/dx at x_
    x = x_ + P_ H' S^-1 e,  P = P_ - P_ H' S^-1 H P_    correction
    x_ = F x,  P_ = F P F' + Q                          prediction

The radar is at the origin. The state is the target's position and velocity in the plane, and the
measurement is g(x) = (sqrt(px^2 + py^2), atan2(py, px)). The filter linearises g at its latest
estimate; see Bar-Shalom, Li and Kirubarajan, Estimation with
Applications to Tracking and Navigation. The inverse of S is never computed: `solve` gives each row
of the gain.

The filter is sampled: its outputs belong to the current measurement. It starts from a guess and the
standard deviation of that guess. A target at the origin has no bearing, and is refused. With the
default values a target rests 1 km away, and the estimate goes there from 280 m off. Look at
`position` and `range_error`.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Refusal, Variable, Vector, solve

_XY = ("x", "y")
GUESS = Vector((700.0, 700.0))  #: [m]

SAMPLED = True
STEP_SIZE, STOP_TIME = 0.5, 50.0


class Parameters(NamedTuple):
    """Motion of the target, and accuracy of the radar."""

    q: Annotated[float, Variable("m2/s3", "Density of the acceleration", 0.0, tunable=True)] = 1.0
    std_range: Annotated[float, Variable("m", "Standard deviation of a range", POSITIVE)] = 10.0
    std_bearing: Annotated[float, Variable("rad", "The same of a bearing", POSITIVE)] = 0.01
    position0: Annotated[Vector, 2, Variable("m", "First estimate", members=_XY)] = GUESS
    std_position0: Annotated[float, Variable("m", "Its standard deviation", 0.0)] = 200.0
    std_velocity0: Annotated[float, Variable("m/s", "The same of the velocity", 0.0)] = 10.0


class Inputs(NamedTuple):
    """Measurements of the radar."""

    range: Annotated[float, Variable("m", "Range of the target", 0.0)] = 1000.0
    bearing: Annotated[float, Variable("rad", "Bearing of the target")] = 0.5


class State(NamedTuple):
    """Prediction for the next measurement."""

    x: Annotated[Vector, 4]  #: position [m] and velocity [m/s]
    P: Annotated[Matrix, 4, 4]  #: covariance of their errors


class Outputs(NamedTuple):
    """Outputs of the filter."""

    position: Annotated[Vector, 2, Variable("m", "Estimated position", members=_XY)]
    velocity: Annotated[Vector, 2, Variable("m/s", "Estimated velocity", members=_XY)]
    range_error: Annotated[float, Variable("m", "Measured less expected range")]


def start(parameters: Parameters) -> State:
    """State at the start: the target is assumed to be at rest."""
    a, b = parameters.std_position0, parameters.std_velocity0
    x = Vector((parameters.position0[0], parameters.position0[1], 0.0, 0.0))
    std = Matrix(((a, 0.0, 0.0, 0.0), (0.0, a, 0.0, 0.0), (0.0, 0.0, b, 0.0), (0.0, 0.0, 0.0, b)))
    return State(x, std @ std)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """The prediction, corrected by the measurement."""
    x, P, px, py = state.x, state.P, state.x[0], state.x[1]
    r = sqrt(px * px + py * py)
    if r < 1e-3:
        raise Refusal(f"the target is {r:g} m from the radar: too near for a bearing")
    H = Matrix(((px / r, py / r, 0.0, 0.0), (-py / (r * r), px / (r * r), 0.0, 0.0)))
    R = Matrix(((parameters.std_range, 0.0), (0.0, parameters.std_bearing)))
    S = H @ P @ H.T + R @ R
    turn = inputs.bearing - atan2(py, px)
    e = Vector((inputs.range - r, atan2(sin(turn), cos(turn))))
    PH = P @ H.T
    for i in range(4):
        gain = solve(S, PH[i])
        x = x.replaced(i, x[i] + gain @ e)
        P = P.replaced(i, P[i] - PH @ gain)
    return State(x, P)


def update(parameters: Parameters, derived: State, h: float) -> State:
    """The prediction for h seconds later."""
    F = Matrix(((1.0, 0.0, h, 0.0), (0.0, 1.0, 0.0, h), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    a, b = h * h * h / 3, h * h / 2
    Q = Matrix(((a, 0.0, b, 0.0), (0.0, a, 0.0, b), (b, 0.0, h, 0.0), (0.0, b, 0.0, h)))
    return State(F @ derived.x, F @ derived.P @ F.T + Q * parameters.q)


def outputs(state: State, derived: State, inputs: Inputs) -> Outputs:
    """Outputs of the filter."""
    x, expected = derived.x, sqrt(state.x[0] * state.x[0] + state.x[1] * state.x[1])
    return Outputs(x[:2], x[2:], inputs.range - expected)
