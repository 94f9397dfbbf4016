"""A Kalman filter that estimates position and velocity from noisy positions.

    K  = P_ H' (H P_ H' + r^2)^-1                           gain
    x  = x_ + K (z - H x_),  P = L P_ L' + K r^2 K'         correction, L = I - K H
    x_ = F x,  P_ = F P F' + Q                              prediction

The state x is position and velocity. Between two measurements, h seconds apart, the acceleration is
modelled as white noise of the density `q`, and `r` is the standard deviation of a measurement.
This is the usual model of a target that manoeuvres a little; see Bar-Shalom, Li and Kirubarajan,
Estimation with Applications to Tracking and Navigation.

A larger `q` makes the filter faster, and its estimate less smooth. Once the start is
forgotten, only the ratio of `q` to the square of `r` determines the gain. The correction of P is in
Joseph's form, which keeps P positive in spite of rounding.

The filter is sampled: its outputs belong to the current measurement. With the default values the
target rests at 1 m, and the estimate goes there from 0. Look at `p` and at `std_p`, the standard
deviation that the filter computes for it.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector

IDENTITY = Matrix(((1.0, 0.0), (0.0, 1.0)))
H = Matrix(((1.0, 0.0),))  #: Only the position is measured.

SAMPLED = True
STEP_SIZE, STOP_TIME = 0.1, 10.0


class Parameters(NamedTuple):
    """Motion of the target, and uncertainty at the start."""

    q: Annotated[
        float, Variable("m2/s3", "Density of the acceleration", minimum=0.0, tunable=True)
    ] = 0.1
    r: Annotated[
        float, Variable("m", "Standard deviation of a position", minimum=POSITIVE, tunable=True)
    ] = 0.5
    p0: Annotated[float, Variable("m", "First estimate of the position")] = 0.0
    v0: Annotated[float, Variable("m/s", "First estimate of the velocity")] = 0.0
    std_p0: Annotated[float, Variable("m", "Standard deviation of p0", 0.0)] = 10.0
    std_v0: Annotated[float, Variable("m/s", "Standard deviation of v0", 0.0)] = 1.0


class Inputs(NamedTuple):
    """Measurement."""

    z: Annotated[float, Variable("m", "Measured position")] = 1.0


class State(NamedTuple):
    """Prediction for the next measurement."""

    x: Annotated[Vector, 2]  #: position [m] and velocity [m/s]
    P: Annotated[Matrix, 2, 2]  #: covariance of their errors


class Outputs(NamedTuple):
    """Outputs of the filter."""

    p: Annotated[float, Variable("m", "Estimated position")]
    v: Annotated[float, Variable("m/s", "Estimated velocity")]
    std_p: Annotated[float, Variable("m", "Standard deviation of p")]
    std_v: Annotated[float, Variable("m/s", "Standard deviation of v")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    std = Matrix(((parameters.std_p0, 0.0), (0.0, parameters.std_v0)))
    return State(Vector((parameters.p0, parameters.v0)), std @ std)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """The prediction, corrected by the measurement."""
    x, P, r = state.x, state.P, parameters.r
    K = P @ H.T / ((H @ P @ H.T)[0, 0] + r * r)
    L = IDENTITY - K @ H
    return State(x + K @ (Vector((inputs.z,)) - H @ x), L @ P @ L.T + K @ K.T * (r * r))


def update(parameters: Parameters, derived: State, h: float) -> State:
    """The prediction for h seconds later."""
    F = Matrix(((1.0, h), (0.0, 1.0)))
    Q = Matrix(((h * h * h / 3, h * h / 2), (h * h / 2, h))) * parameters.q
    return State(F @ derived.x, F @ derived.P @ F.T + Q)


def outputs(derived: State) -> Outputs:
    """Outputs of the filter."""
    x, P = derived.x, derived.P
    return Outputs(x[0], x[1], sqrt(P[0, 0]), sqrt(P[1, 1]))
