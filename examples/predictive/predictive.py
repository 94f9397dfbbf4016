"""A nonlinear model predictive law: the best forces for the seconds ahead, at each step.

    minimise sum over all moves of e^2 + (u / omega^2)^2,  dde/dt = u,  e = y - y_d
    with |f| <= f_max on each axis of the body,  f = M R' (u + ddy_d - w) + D v,  v = R' dy
    and dR/dt = R S(e_1 x (v - s) / ell): the body turns after its control point, ell ahead
    w = l (dy - o),  do/dt = R M^-1 (f - D v) + w,  s = ell R' (n - R e_1) / (1 s)

M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`). The plan of N moves
holds ddy_d, w and s; P stands for later moves. It begins as K (e, de), the best without limits, and
gets up to ROUNDS gradient steps within them: Käpernick and Graichen, The gradient based nonlinear
model predictive control software GRAMPC, European Control Conference 2014. Its first move is made.
Velocity o and direction n of the model estimate other forces and sideslip. Constant ones leave no
error: Pannocchia and Rawlings, Disturbance models for offset-free MPC, AIChE Journal 49, 2003.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector
from auv_fmu.paper import point_mass
from auv_fmu.paper.point_mass import Inputs, Outputs, PointMass, Triple, axes, crossed, over, times

SAMPLED, STOP_TIME = True, 10.0
GAINS = {"omega": (0.2, 8.0), "l": (0.02, 5.0)}
#: Moves, their length, rounds, steepest slope, pace; the regulator. 1 / omega is the unit of time.
N, T, ROUNDS, STEEPEST, PACE = 8, 1.0 / 3.0, 6, 24.5, 0.66
K, P = Vector((-0.79044434, -1.25733396)), Matrix(((3.77200187, 3.0), (3.0, 4.27200187)))


class Parameters(NamedTuple):
    """Gains and vehicle."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    l: Annotated[float, Variable("1/s", "Rate of the estimated disturbance", 0.0)] = 0.3
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class State(NamedTuple):
    """Velocity [m/s] and direction of the model."""

    o: Triple
    n: Triple


def start(inputs: Inputs) -> State:
    """Return the state at the start."""
    return State(inputs.dy, axes(inputs.eta)[0])


def better(p: Parameters, x: Inputs, w: Triple, s: Triple, plan: Matrix, share: float) -> Matrix:
    """The plan and a share of K (e, de), after a step against the gradient, by the adjoint."""
    h, mass, drag, R_T = T / p.omega, p.point.mass, over(p.point.drag, p.point.mass), axes(x.eta)
    e, de, dy, rows = x.y - x.y_d, x.dy - x.dy_d, x.dy, Matrix([(0.0,) * 24] * N)
    for k in range(N):
        v = R_T @ dy
        a = R_T @ (w - x.ddy_d) - times(drag, v)
        u = R_T @ (p.omega * (K[0] * p.omega * e + K[1] * de))
        f = point_mass.limited(p.point, plan[k] + share * times(mass, u - a))
        u, angle = over(f, mass) + a, h * point_mass.turn(p.point, v - s)
        e, de = e + h * de + h * h / 2.0 * (R_T.T @ u), de + h * (R_T.T @ u)
        rows = rows.replaced(k, Vector((*f, *u, *v, *angle, *e, *R_T[0], *R_T[1], *R_T[2])))
        R_T, dy = point_mass.turned(R_T, angle), de + x.dy_d + (k + 1) * h * x.ddy_d
    by_e = p.omega**4 * P[0, 0] * e + p.omega**3 * P[0, 1] * de
    by_de, by_R = p.omega**3 * P[1, 0] * e + p.omega**2 * P[1, 1] * de, 0.0 * e
    for k in reversed(range(N)):
        row, R_T = rows[k], Matrix((rows[k][15:18], rows[k][18:21], rows[k][21:]))
        f, u, v, by_e = row[:3], row[3:6], row[6:9], by_e + p.omega**4 * row[12:15]
        by_u = u + R_T @ (h * h / 2.0 * by_e + h * by_de)
        by_angle = point_mass.by_angle(R_T @ by_R, row[9:12])
        by_v = -h * point_mass.turn(p.point, by_angle) - times(drag, by_u)
        by_de = by_de + h * by_e + R_T.T @ by_v
        by_R = by_R + R_T.T @ (crossed(by_v) @ v - crossed(by_u) @ (over(f, mass) - times(drag, v)))
        plan = plan.replaced(k, point_mass.limited(p.point, f - times(mass, by_u) / STEEPEST))
    return plan


def derive(parameters: Parameters, state: State, inputs: Inputs) -> tuple[Triple, Triple, Triple]:
    """The force [N] in the body frame, and the rates of the state [m/s2, 1/s]."""
    point, R_T, w = parameters.point, axes(inputs.eta), parameters.l * (inputs.dy - state.o)
    v, s, plan = R_T @ inputs.dy, point.ell * (R_T @ (state.n - R_T[0])), Matrix([(0.0,) * 3] * N)
    z = plan
    for k in range(ROUNDS):
        last, plan = plan, better(parameters, inputs, w, s, z, 0.0 if k else 1.0)
        z = plan + PACE * (plan - last) if k else plan
        if max(max(abs(f) for f in move) for move in plan - last) < 1e-3:
            break
    a, turning = over(plan[0] - times(point.drag, v), point.mass), point_mass.turn(point, v - s)
    return plan[0], R_T.T @ a + w, R_T.T @ (crossed(turning) @ Vector((1.0, 0.0, 0.0)))


def update(state: State, derived: tuple[Triple, Triple, Triple], h: float) -> State:
    """Return the state h seconds later."""
    return State(state.o + h * derived[1], state.n + h * derived[2])


def outputs(parameters: Parameters, derived: tuple[Triple, Triple, Triple]) -> Outputs:
    """Return the command."""
    return Outputs(point_mass.command(parameters.point, derived[0]))
