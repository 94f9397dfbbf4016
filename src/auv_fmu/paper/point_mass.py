"""The vehicle as a mass at its control point: a model for control laws, not in the paper.

Along the axes of the body the control point has the velocity v = R^T dy, and

    m_k dv_k/dt = f_k - d_k v_k,    m = (m11, m66 / ell^2, m55 / ell^2), and d likewise

with the force f = R^T F of :func:`.control_point.actuator_command`. This is (2) without sway and
heave, which no actuator drives, and without what couples the others.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.quantities import ACCELERATION, EULER, POSITION, TAU, VELOCITY
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import ELL, Distance

#: A vector in the earth frame or in the body frame, and the one of no length.
Triple = Annotated[Vector, 3]
ZERO = Vector((0.0, 0.0, 0.0))


class PointMass(NamedTuple):
    """Vehicle in the eyes of a law, by default the one of Fig. 4."""

    mass: Annotated[
        Vector,
        3,
        Variable(
            dict.fromkeys("xyz", "kg"), "Mass at the control point along each body axis", POSITIVE
        ),
    ] = Vector((25.0, 122.4, 183.7))
    drag: Annotated[
        Vector,
        3,
        Variable(
            dict.fromkeys("xyz", "kg/s"), "Damping at the control point along each body axis", 0.0
        ),
    ] = Vector((30.0, 163.3, 163.3))
    ell: Distance = ELL
    tau_max: Annotated[Vector3, Variable(TAU, "Largest force and moments", POSITIVE)] = (
        80.0,
        80.0,
        80.0,
    )


class Inputs(NamedTuple):
    """Measurement with the velocity, and reference; by default it is a step of one metre."""

    y: Annotated[Vector, 3, Variable(POSITION, "Measured control point")] = ZERO
    eta: Annotated[Vector3, Variable(EULER, "Measured Euler angle")] = (0.0, 0.0, 0.0)
    dy: Annotated[Vector, 3, Variable(VELOCITY, "Measured velocity of the control point")] = ZERO
    y_d: Annotated[Vector, 3, Variable(POSITION, "Desired control point")] = Vector((1.0, 0.0, 0.0))
    dy_d: Annotated[Vector, 3, Variable(VELOCITY, "Desired velocity")] = ZERO
    ddy_d: Annotated[Vector, 3, Variable(ACCELERATION, "Desired acceleration")] = ZERO


class Outputs(NamedTuple):
    """The command."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments")]


def axes(euler: Vector3) -> Annotated[Matrix, 3, 3]:
    """R^T of the attitude (phi, theta, psi) [rad]: its rows are the axes of the body."""
    return Matrix(rotation_from_euler(*euler))


def turn(point: PointMass, v: Triple) -> Triple:
    """Rate [rad/s] of a body that follows its control point at v [m/s]: e_1 x v / ell."""
    return Vector((0.0, -v[2], v[1])) / point.ell


def turned(R_T: Annotated[Matrix, 3, 3], angle: Triple) -> Annotated[Matrix, 3, 3]:
    """Axes that have turned about themselves, by Cayley's map: by 2 atan(|angle| / 2) [rad]."""
    half = crossed(angle / 2.0)
    return R_T - (half @ (R_T - half @ R_T)) * (2.0 / (1.0 + angle @ angle / 4.0))


def by_angle(by_axes: Triple, angle: Triple) -> Triple:
    """Gradient by the angle of :func:`turned`, from the one by a small turn of the axes."""
    return (by_axes - crossed(angle) @ by_axes / 2.0) / (1.0 + angle @ angle / 4.0)


def crossed(a: Triple) -> Annotated[Matrix, 3, 3]:
    """S(a), the matrix of the cross product: S(a) b = a x b."""
    return Matrix(((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)))


def largest(point: PointMass) -> Triple:
    """Largest force [N] along each axis of the body, as `tau_max` allows it."""
    tau_u, tau_q, tau_r = point.tau_max
    return Vector((tau_u, tau_r / point.ell, tau_q / point.ell))


def limited(point: PointMass, force: Triple) -> Triple:
    """A force [N] in the body frame within its largest values."""
    return Vector(min(max(f, -most), most) for f, most in zip(force, largest(point)))


def unwound(R_T: Annotated[Matrix, 3, 3], rate: Triple, missing: Triple) -> Triple:
    """The rate of an integral that does not wind up.

    Args:
        R_T: axes of the body.
        rate: of an integral that adds to the force, earth frame.
        missing: what the limits took from the force [N], body frame.

    Returns:
        The rate without its part along each axis whose force would go further beyond its limit.

    """
    along = R_T @ rate
    return R_T.T @ Vector(0.0 if r * beyond > 0.0 else r for r, beyond in zip(along, missing))


def command(point: PointMass, force: Triple) -> Vector3:
    """(tau_u [N], tau_q, tau_r [N.m]) of a force [N] in the body frame, by (11)."""
    return force[0], -point.ell * force[2], point.ell * force[1]


def times(a: Triple, b: Triple) -> Triple:
    """The products of the elements."""
    return Vector(x * y for x, y in zip(a, b))


def over(a: Triple, b: Triple) -> Triple:
    """The quotients of the elements."""
    return Vector(x / y for x, y in zip(a, b))
