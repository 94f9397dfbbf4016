"""A quarter of a car: a body on a spring and a damper, on a wheel with an elastic tyre.

    m_body   dv1/dt = -k (z1 - z2) - d (v1 - v2)
    m_wheel  dv2/dt =  k (z1 - z2) + d (v1 - v2) - k_tyre (z2 - road)

All heights are measured from the position at rest. This is the usual model for a first choice of a
suspension; see R. Rajamani, Vehicle Dynamics and Control. A softer damper is better for the
comfort, a stiffer one for the grip.

The equations are linear, dx/dt = A x + b road, and stepped by the trapezoidal rule

    (I - h/2 A) x[k+1] = (I + h/2 A) x[k] + h b road

A linear system is solved in each step. The rule is stable for steps of any length, although the
wheel moves much faster than the body.

With the default values the car has just reached a kerb of 5 cm. Look at `body` and `wheel`, at
`acceleration` for the comfort, and at `tyre_force` for the grip.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector, solve

IDENTITY = Matrix(
    ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
)

H_MAX, STOP_TIME = 0.02, 2.0


class Parameters(NamedTuple):
    """Masses, springs and the damper."""

    m_body: Annotated[float, Variable("kg", "Mass of the body", POSITIVE)] = 300.0
    m_wheel: Annotated[float, Variable("kg", "Mass of the wheel", POSITIVE)] = 40.0
    k: Annotated[float, Variable("N/m", "Stiffness of the spring", 0.0, tunable=True)] = 18000.0
    d: Annotated[float, Variable("kg/s", "Coefficient of the damper", 0.0, tunable=True)] = 1200.0
    k_tyre: Annotated[float, Variable("N/m", "Stiffness of the tyre", 0.0)] = 180000.0


class Inputs(NamedTuple):
    """Road."""

    road: Annotated[float, Variable("m", "Height of the road")] = 0.05


class State(NamedTuple):
    """Heights and velocities."""

    x: Annotated[Vector, 4, Variable({"z1": "m", "v1": "m/s", "z2": "m", "v2": "m/s"}, "Motion")]


class Outputs(NamedTuple):
    """Outputs of the car."""

    body: Annotated[float, Variable("m", "Height of the body", feedthrough=())]
    wheel: Annotated[float, Variable("m", "Height of the wheel", feedthrough=())]
    acceleration: Annotated[float, Variable("m/s2", "Acceleration of the body", feedthrough=())]
    tyre_force: Annotated[float, Variable("N", "Force of the tyre, beyond the weight")]


def start() -> State:
    """State at the start: it rests at height 0."""
    return State(Vector((0.0, 0.0, 0.0, 0.0)))


def derive(parameters: Parameters) -> Annotated[Matrix, 4, 4]:
    """The matrix A."""
    k, d = parameters.k, parameters.d
    body = Vector((-k, -d, k, d)) / parameters.m_body
    wheel = Vector((k, d, -k - parameters.k_tyre, -d)) / parameters.m_wheel
    return Matrix(((0.0, 1.0, 0.0, 0.0), body, (0.0, 0.0, 0.0, 1.0), wheel))


def update(
    parameters: Parameters,
    state: State,
    derived: Annotated[Matrix, 4, 4],
    inputs: Inputs,
    h: float,
) -> State:
    """State after a step of h seconds with held inputs."""
    x, A = state.x, derived
    push = Vector((0.0, 0.0, 0.0, h * parameters.k_tyre / parameters.m_wheel * inputs.road))
    return State(solve(IDENTITY - h / 2 * A, x + h / 2 * (A @ x) + push))


def rates(
    parameters: Parameters, state: State, derived: Annotated[Matrix, 4, 4], inputs: Inputs
) -> State:
    """Rates of the state."""
    push = parameters.k_tyre / parameters.m_wheel * inputs.road
    return State(derived @ state.x + Vector((0.0, 0.0, 0.0, push)))


def outputs(
    parameters: Parameters, state: State, derived: Annotated[Matrix, 4, 4], inputs: Inputs
) -> Outputs:
    """Outputs of the car."""
    x = state.x
    return Outputs(x[0], x[2], derived[1] @ x, parameters.k_tyre * (inputs.road - x[2]))
