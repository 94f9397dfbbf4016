"""A pendulum on a cart, the standard unstable plant of control courses.

    (M + m) p'' + m l cos(a) a'' = u - c p' + m l sin(a) a'^2
    m l cos(a) p'' + m l^2 a''   = m g l sin(a)

`p` is the position of the cart and `angle` the angle a of the pendulum, which is 0 where it stands
upright, and positive to the right. The rod has no mass. Lagrange's equations give both lines; see
the balance systems of K. J. Åström and R. M. Murray, Feedback Systems. They are linear in the
accelerations, which `solve` finds, and stepped by the Runge-Kutta method of fourth order.

With the default values the pendulum falls over from 0.1 rad and swings. There is no friction, so
`energy` stays constant: how much it drifts shows how good a step is. Look at `p`, `angle` and
`energy`; then try to balance it, with `u` as the force on the cart.
"""

from __future__ import annotations

from math import cos, sin
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector, solve

H_MAX, STOP_TIME = 0.02, 5.0


class Parameters(NamedTuple):
    """Cart and pendulum, and the start."""

    M: Annotated[float, Variable("kg", "Mass of the cart", POSITIVE)] = 1.0
    m: Annotated[float, Variable("kg", "Mass of the pendulum", POSITIVE)] = 0.2
    l: Annotated[float, Variable("m", "Length of the pendulum", POSITIVE)] = 0.5
    c: Annotated[float, Variable("kg/s", "Friction of the cart", minimum=0.0)] = 0.0
    g: Annotated[float, Variable("m/s2", "Gravity", minimum=0.0)] = 9.81
    angle0: Annotated[float, Variable("rad", "Angle at the start")] = 0.1


class Inputs(NamedTuple):
    """Force on the cart."""

    u: Annotated[float, Variable("N", "Force on the cart")] = 0.0


class State(NamedTuple):
    """Motion of cart and pendulum."""

    q: Annotated[Vector, 2, Variable({"p": "m", "angle": "rad"}, "Position and angle")]
    dq: Annotated[Vector, 2, Variable({"p": "m/s", "angle": "rad/s"}, "Their rates")]


class Outputs(NamedTuple):
    """Outputs of the cart and the pendulum."""

    p: Annotated[float, Variable("m", "Position of the cart")]
    angle: Annotated[float, Variable("rad", "Angle of the pendulum from upright")]
    v: Annotated[float, Variable("m/s", "Velocity of the cart")]
    rate: Annotated[float, Variable("rad/s", "Rate of the angle")]
    energy: Annotated[float, Variable("J", "Energy, which is 0 for a level pendulum at rest")]


def start(parameters: Parameters) -> State:
    """State at the start: it rests."""
    return State(Vector((0.0, parameters.angle0)), Vector((0.0, 0.0)))


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with a held force."""
    q, dq = state.q, state.dq
    k1 = rates(parameters, state, inputs)
    k2 = rates(parameters, State(q + h / 2 * k1.q, dq + h / 2 * k1.dq), inputs)
    k3 = rates(parameters, State(q + h / 2 * k2.q, dq + h / 2 * k2.dq), inputs)
    k4 = rates(parameters, State(q + h * k3.q, dq + h * k3.dq), inputs)
    return State(
        q + h / 6 * (k1.q + 2 * k2.q + 2 * k3.q + k4.q),
        dq + h / 6 * (k1.dq + 2 * k2.dq + 2 * k3.dq + k4.dq),
    )


def rates(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """Rates of the state, by Lagrange's equations."""
    M, m, l = parameters.M, parameters.m, parameters.l
    q, dq = state.q, state.dq
    s, c = sin(q[1]), cos(q[1])
    mass = Matrix(((M + m, m * l * c), (m * l * c, m * l * l)))
    force = inputs.u - parameters.c * dq[0] + m * l * s * dq[1] * dq[1]
    return State(dq, solve(mass, Vector((force, m * parameters.g * l * s))))


def outputs(parameters: Parameters, state: State) -> Outputs:
    """Outputs of the cart and the pendulum."""
    q, dq, m, l = state.q, state.dq, parameters.m, parameters.l
    v, turn = dq[0], l * dq[1]
    bob = v * v + 2 * v * turn * cos(q[1]) + turn * turn
    energy = (parameters.M * v * v + m * bob) / 2 + m * parameters.g * l * cos(q[1])
    return Outputs(q[0], q[1], v, dq[1], energy)
