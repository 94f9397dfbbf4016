"""An extended Kalman filter: a target seen by range and bearing, with four states."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector, solve

EYE = Matrix([float(i == j) for j in range(4)] for i in range(4))
STEP_SIZE, STOP_TIME = 0.1, 20.0


class Parameters(NamedTuple):
    q: Annotated[float, Variable("m2/s3", "Strength of the accelerations", POSITIVE)] = 0.1
    std_range: Annotated[float, Variable("m", "Of the range", POSITIVE, tunable=True)] = 0.5
    std_bearing: Annotated[float, Variable("rad", "Of the bearing", POSITIVE)] = 0.01


class Inputs(NamedTuple):
    range: Annotated[float, Variable("m", "Measured range")] = 50.0
    bearing: Annotated[float, Variable("rad", "Measured bearing")] = 0.5
    valid: Annotated[bool, Variable(description="Whether there is a measurement")] = True


class State(NamedTuple):
    x: Annotated[Vector, 4]
    P: Annotated[Matrix, 4, 4]
    lost: int = 0


class Outputs(NamedTuple):
    position: Annotated[Vector, 2, Variable("m", "Estimated position")]
    nis: Annotated[float, Variable("1", "Normalised innovation squared")]
    lost: Annotated[int, Variable(description="Steps without a measurement")]


class Corrected(NamedTuple):
    state: State
    nis: float


def wrap(angle: float) -> float:
    while True:
        if angle > math.pi:
            angle -= 2 * math.pi
        elif angle < -math.pi:
            angle += 2 * math.pi
        else:
            return angle


def measure(x: Vector) -> Vector:
    return Vector([math.hypot(x[0], x[1]), math.atan2(x[1], x[0])])


def start(inputs: Inputs) -> State:
    r, angle = inputs.range, inputs.bearing
    return State(Vector([r * math.cos(angle), r * math.sin(angle), 0.0, 0.0]), EYE * 10.0)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> Corrected:
    x, P = state.x, state.P
    if not inputs.valid:
        return Corrected(state._replace(lost=state.lost + 1), nis=0)
    assert abs(inputs.bearing) < 100.0, f"a bearing of {inputs.bearing:g} rad"
    r2 = x[0] ** 2 + x[1] ** 2
    r = math.sqrt(r2)
    H = Matrix([[x[0] / r, x[1] / r, 0.0, 0.0], [-x[1] / r2, x[0] / r2, 0.0, 0.0]])
    R = Matrix([[parameters.std_range**2, 0.0], [0.0, parameters.std_bearing**2]])
    y = [a - b for a, b in zip((inputs.range, inputs.bearing), measure(x))]
    y[1] = wrap(y[1])
    S = H @ P @ H.T + R
    K = Matrix(solve(S, row) for row in P @ H.T)
    nis = solve(S, Vector(y)) @ Vector(y)
    return Corrected(State(x + K @ Vector(y), (EYE - K @ H) @ P), nis)


def update(parameters: Parameters, derived: Corrected, h: float) -> State:
    F = Matrix([[1.0, 0.0, h, 0.0], [0.0, 1.0, 0.0, h], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    a, b, c = h**3 / 3, h**2 / 2, h
    Q = Matrix([[a, 0.0, b, 0.0], [0.0, a, 0.0, b], [b, 0.0, c, 0.0], [0.0, b, 0.0, c]])
    x, P, lost = derived.state
    return State(F @ x, F @ P @ F.T + parameters.q * Q, lost)


def outputs(derived: Corrected) -> Outputs:
    return Outputs(derived.state.x[:2], derived.nis, derived.state.lost)
