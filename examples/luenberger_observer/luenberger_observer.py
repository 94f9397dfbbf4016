"""A Luenberger observer that estimates the velocity of a mass on a spring from its position.

    m dv/dt = u - d v - k p,  dp/dt = v                         plant
    dx/dt = A x + B u + L (y - p),  x = (p, v)                  observer

The observer is a copy of the plant that is corrected by the difference of the measured and the
estimated position; see D. G. Luenberger, An introduction to observers, 1971. The error obeys
de/dt = (A - L C) e, whatever the force is. `L` is such that the error has the frequency `omega` and
the damping `zeta`:

    L = (2 zeta omega - d/m,  omega^2 - k/m - d/m L[1])

A higher `omega` forgets the wrong start sooner, and lets more of the measurement's noise through.
It is continuous, as the plant is, and stepped by the Runge-Kutta method of fourth order.

With the default values the mass rests at 0.1 m, held by a force of 2 N. The estimate starts from 0.
Look at how `p` and `v` reach the true values.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector

H_MAX, STOP_TIME = 0.02, 2.0


class Parameters(NamedTuple):
    """Plant, and motion of the error."""

    m: Annotated[float, Variable("kg", "Mass", minimum=POSITIVE)] = 1.0
    d: Annotated[float, Variable("kg/s", "Damping", minimum=0.0)] = 0.5
    k: Annotated[float, Variable("N/m", "Stiffness of the spring", minimum=0.0)] = 20.0
    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 15.0
    zeta: Annotated[float, Variable("1", "Damping of the error", minimum=0.0)] = 0.7


class Inputs(NamedTuple):
    """Force and measurement."""

    u: Annotated[float, Variable("N", "Force on the mass")] = 2.0
    y: Annotated[float, Variable("m", "Measured position")] = 0.1


class State(NamedTuple):
    """Estimate."""

    x: Annotated[Vector, 2]  #: estimated position [m] and velocity [m/s]


class Outputs(NamedTuple):
    """Outputs of the observer."""

    p: Annotated[float, Variable("m", "Estimated position")]
    v: Annotated[float, Variable("m/s", "Estimated velocity")]


def start() -> State:
    """State at the start."""
    return State(Vector((0.0, 0.0)))


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    damping, stiffness = parameters.d / parameters.m, parameters.k / parameters.m
    A = Matrix(((0.0, 1.0), (-stiffness, -damping)))
    B = Vector((0.0, 1.0 / parameters.m))
    L1 = 2 * parameters.zeta * parameters.omega - damping
    L = Vector((L1, parameters.omega * parameters.omega - stiffness - damping * L1))

    def rate(x: Annotated[Vector, 2]) -> Annotated[Vector, 2]:
        return A @ x + B * inputs.u + L * (inputs.y - x[0])

    x = state.x
    k1 = rate(x)
    k2 = rate(x + h / 2 * k1)
    k3 = rate(x + h / 2 * k2)
    k4 = rate(x + h * k3)
    return State(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def outputs(state: State) -> Outputs:
    """Outputs of the observer."""
    return Outputs(state.x[0], state.x[1])
