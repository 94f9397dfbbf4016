"""The attitude of a rigid body as a quaternion, integrated by Runge and Kutta's rule."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

H_MAX = 0.05


class Parameters(NamedTuple):
    inertia: Annotated[Vector, 3, Variable("kg.m2", "Principal moments", POSITIVE)] = Vector(
        [1.0, 2.0, 3.0]
    )
    k_p: Annotated[float, Variable("N.m", "Gain of the angle", tunable=True)] = 4.0
    k_d: Annotated[float, Variable("N.m.s", "Gain of the rate", tunable=True)] = 3.0


class Inputs(NamedTuple):
    torque: Annotated[Vector, 3, Variable("N.m", "Disturbance")] = Vector([0.1, 0.0, -0.1])
    wanted: Annotated[Vector, 4, Variable("1", "Attitude")] = Vector([1.0, 0.0, 0.0, 0.0])


class State(NamedTuple):
    q: Annotated[Vector, 4] = Vector([0.5, 0.5, 0.5, 0.5])
    w: Annotated[Vector, 3] = Vector((0.0,) * 3)


class Outputs(NamedTuple):
    q: Annotated[Vector, 4, Variable("1", "Attitude")]
    angle: Annotated[float, Variable("rad", "From the wanted attitude")]
    tumbles: Annotated[bool, Variable(description="Whether it turns fast")]


def cross(a: Vector, b: Vector) -> Annotated[Vector, 3]:
    return Vector(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))


def product(p: Vector, q: Vector) -> Annotated[Vector, 4]:
    p_v, q_v = p[1:], q[1:]
    return Vector([p[0] * q[0] - p_v @ q_v, *(p[0] * q_v + q[0] * p_v + cross(p_v, q_v))])


def conjugate(q: Vector) -> Annotated[Vector, 4]:
    return Vector([q[0], *-q[1:]])


def normalised(v: Vector) -> Annotated[Vector, 4]:
    norm = math.sqrt(sum(x**2 for x in v))
    assert norm > 0.0, "a quaternion of zeros"
    return v / norm


def control(parameters: Parameters, x: State, wanted: Vector) -> Annotated[Vector, 3]:
    error = product(conjugate(wanted), x.q)
    sign = 1 if error[0] >= 0 else -1
    return -parameters.k_p * sign * error[1:] - parameters.k_d * x.w


def rate(parameters: Parameters, x: State, inputs: Inputs) -> State:
    J, w = parameters.inertia, x.w
    torque = inputs.torque + control(parameters, x, wanted=normalised(inputs.wanted))
    spin = torque - cross(w, Vector(j * a for j, a in zip(J, w)))
    return State(0.5 * product(x.q, Vector([0.0, *w])), Vector(a / j for a, j in zip(spin, J)))


def moved(x: State, dx: State, h: float = 1.0) -> State:
    return State(x.q + h * dx.q, x.w + h * dx.w)


def start() -> State:
    return State()


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    total = k = State(Vector([0.0] * 4), Vector([0.0] * 3))
    for ahead, weight in zip((0.0, 0.5, 0.5, 1.0), (1, 2, 2, 1)):
        k = rate(parameters, moved(state, k, h=ahead * h), inputs)
        total = moved(total, k, weight / 6)
    q, w = moved(state, total, h)
    return State(normalised(q), w)


def outputs(state: State, inputs: Inputs) -> Outputs:
    error = product(conjugate(normalised(inputs.wanted)), state.q)
    angle = 2 * math.acos(min(1, abs(error[0])))
    return Outputs(state.q, angle, tumbles=max(abs(a) for a in state.w) > 2.0)
