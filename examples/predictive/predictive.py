"""A model predictive law: the best forces for the seconds ahead within the limits, at each step.

    minimise sum over N moves of e^2 + (u / omega^2)^2,  dde/dt = u,  e = y - y_d
    with |f| <= f_max on each axis of the body,  f = M (u + ddy_d - w) + D v,  v = R' dy

M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`). A plan is for 4 / omega
seconds, and holds attitude, ddy_d, w and drag; its first move is made. Without limits the best plan
is K (e, de). Clipped, it begins ROUNDS of the fast gradient method: Richter, Jones and Morari,
Computational complexity certification for real-time MPC with input constraints, IEEE Transactions
on Automatic Control 57 (2012). With a velocity o of the model,

    w = l (dy - o),  do/dt = R M^-1 (f - D v) + w

estimates the other forces, so that constant ones leave no error (Pannocchia and Rawlings,
Disturbance models for offset-free model-predictive control, AIChE Journal 49, 2003).
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector, solve
from auv_fmu.language.quantities import TAU
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.point_mass import Inputs, PointMass, Triple, axes, command, largest, over, times

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "l": (0.02, 5.0)}

#: Moves, their length, rounds. Errors G u + S (e, de), with 1 / omega as the unit of time.
N, T, ROUNDS = 12, 4.0 / 12, 20
G = Matrix((T * T * (k - j + 0.5) if j <= k else 0.0 for j in range(N)) for k in range(N))
S = Matrix((1.0, T * (k + 1)) for k in range(N))
H = G.T @ G + Matrix((1.0 if j == k else 0.0 for j in range(N)) for k in range(N))
K = -Matrix(solve(H, column) for column in (G.T @ S).T).T
STEEPEST = max(row.sum() for row in H)
PACE = (sqrt(STEEPEST) - 1.0) / (sqrt(STEEPEST) + 1.0)


class Parameters(NamedTuple):
    """Gains and vehicle."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    l: Annotated[float, Variable("1/s", "Rate of the estimated disturbance", 0.0)] = 0.3
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class State(NamedTuple):
    """Velocity of the model [m/s]."""

    o: Triple


class Outputs(NamedTuple):
    """The command."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments")]


def start(inputs: Inputs) -> State:
    """Return the state at the start."""
    return State(inputs.dy)


def first(e: float, de: float, low: float, high: float) -> float:
    """The first move of the best plan with moves from low to high; 1 / omega is the unit."""
    free = K @ Vector((e, de))
    u = z = Vector(min(max(move, low), high) for move in free)
    for _ in range(ROUNDS):
        better = z - H @ (z - free) / STEEPEST
        better = Vector(min(max(move, low), high) for move in better)
        u, z = better, better + PACE * (better - u)
    return u[0]


def derive(parameters: Parameters, state: State, inputs: Inputs) -> tuple[Triple, Triple]:
    """The force [N] in the body frame, and the rate of the state [m/s2]."""
    omega, point, R_T = parameters.omega, parameters.point, axes(inputs.eta)
    w, v = parameters.l * (inputs.dy - state.o), R_T @ inputs.dy
    e, de = R_T @ (inputs.y - inputs.y_d), R_T @ (inputs.dy - inputs.dy_d) / omega
    drag = over(times(point.drag, v), point.mass)
    a, most, unit = R_T @ (inputs.ddy_d - w) + drag, over(largest(point), point.mass), omega * omega
    low, high = (-most - a) / unit, (most - a) / unit
    u = unit * Vector(first(e[k], de[k], low[k], high[k]) for k in range(3))
    return times(point.mass, u + a), R_T.T @ (u + a - drag) + w


def update(state: State, derived: tuple[Triple, Triple], h: float) -> State:
    """Return the state h seconds later."""
    return State(state.o + h * derived[1])


def outputs(parameters: Parameters, derived: tuple[Triple, Triple]) -> Outputs:
    """Return the command."""
    return Outputs(command(parameters.point, derived[0]))
