"""The open-loop motion planner of Definition 1: (1) and (2) driven by constant torques.

The reference is the control point of a second, undisturbed vehicle whose roll is held at
zero. Its first two derivatives follow from the planner's own equations, without differences
of samples (reading 12).
"""

from __future__ import annotations

from math import degrees, radians
from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import (
    ACCELERATION,
    ETA_WITHOUT_ROLL,
    NU_WITHOUT_ROLL,
    POSITION,
    TAU,
    VELOCITY,
)
from auv_fmu.language.variable import Variable
from auv_fmu.language.vectors import Rotation, Vector3, Vector5, add_scaled
from auv_fmu.paper.attitude import rotate, rotation_from_euler
from auv_fmu.paper.control_point import ELL, Distance, control_point, control_point_velocity
from auv_fmu.paper.vehicle import Vehicle, accelerations, euler_rates

#: Driving force and moments (u, q, r) of section 4.1 [N, N.m]; they make the reference a helix.
TAU_D: Vector3 = (5.0, 1.0, 2.0)

#: Initial posture of section 4.1: x, y, z [m], theta, psi [rad].
ETA_D0: Vector5 = (0.0, 0.0, -2.0, 0.0, 0.0)

#: Initial velocity (u, v, w, q, r) [m/s, rad/s]: at rest, which section 4.1 does not say.
NU_D0: Vector5 = (0.0, 0.0, 0.0, 0.0, 0.0)

#: Steepest pitch of the reference [rad]. At 90 degrees (1) has a pole: near it the yaw rate is
#: unbounded, and a step may jump past it.
STEEPEST = radians(85.0)

_UNDISTURBED = (0.0, 0.0, 0.0, 0.0, 0.0)


class SteepReference(ArithmeticError):
    """The pitch of the reference vehicle is too steep."""


class Parameters(NamedTuple):
    """All parameters of the planner."""

    tau_d: Annotated[Vector3, Variable(TAU, "Driving force and moments (tau_d)")] = TAU_D
    eta0: Annotated[Vector5, Variable(ETA_WITHOUT_ROLL, "Initial posture")] = ETA_D0
    vehicle: Annotated[Vehicle, Variable(name="")] = Vehicle()  #: the reference vehicle
    ell: Distance = ELL
    nu0: Annotated[Vector5, Variable(NU_WITHOUT_ROLL, "Initial velocity in the body frame")] = NU_D0


class PlannerState(NamedTuple):
    """Motion of the reference vehicle."""

    position: Vector3  #: centre of mass (x, y, z) [m], earth frame
    theta: float  #: pitch [rad]
    psi: float  #: yaw [rad]
    nu: Vector5  #: (u, v, w, q, r) [m/s, rad/s], body frame


class Motion(NamedTuple):
    """Attitude by (1) and accelerations by (2), from which step and reference follow."""

    rotation: Rotation  #: body to earth
    dnu: Vector5  #: d/dt (u, v, w, q, r) [m/s2, rad/s2]


class Reference(NamedTuple):
    """Desired trajectory of the control point, earth frame."""

    y_d: Annotated[Vector3, Variable(POSITION, "Desired control point")]
    dy_d: Annotated[Vector3, Variable(VELOCITY, "Desired velocity")]
    ddy_d: Annotated[Vector3, Variable(ACCELERATION, "Desired acceleration, in closed form")]


def initial_state(eta_d: Vector5, nu_d: Vector5) -> PlannerState:
    """State in the posture eta_d = (x, y, z, theta, psi) [m, rad] with the velocity nu_d."""
    x, y, z, theta, psi = eta_d
    return PlannerState((x, y, z), theta, psi, nu_d)


def motion(vehicle: Vehicle, state: PlannerState, tau_d: Vector3) -> Motion:
    """Attitude (1) and accelerations (2) of the reference vehicle.

    Args:
        vehicle: parameters of the reference vehicle.
        state: of the reference vehicle.
        tau_d: (tau_ud, tau_qd, tau_rd) [N, N.m].

    Raises:
        SteepReference: the pitch is steeper than :data:`STEEPEST`.

    """
    _, theta, psi, nu = state
    if not -STEEPEST <= theta <= STEEPEST:
        raise SteepReference(
            f"the pitch of the reference is {degrees(theta):.1f} degrees; (1) has a pole at 90, so "
            f"it must stay within {degrees(STEEPEST):g}"
        )
    rotation = rotation_from_euler(0.0, theta, psi)
    return Motion(rotation, accelerations(vehicle, nu, -rotation[0][2], tau_d, _UNDISTURBED))


def step(state: PlannerState, moving: Motion, h: float) -> PlannerState:
    """One Euler step of (1) and (2).

    Args:
        state: at the beginning of the step.
        moving: its motion.
        h: step [s].

    """
    position, theta, psi, (u, v, w, q, r) = state
    rotation, (du, dv, dw, dq, dr) = moving
    dtheta, dpsi = euler_rates(theta, q, r)
    return PlannerState(
        add_scaled(position, h, rotate(rotation, (u, v, w))),
        theta + h * dtheta,
        psi + h * dpsi,
        (u + h * du, v + h * dv, w + h * dw, q + h * dq, r + h * dr),
    )


def reference(state: PlannerState, moving: Motion, ell: float) -> Reference:
    """Reference y_d, dy_d/dt and d2y_d/dt2 in closed form: (9), (10) and the derivative of (10).

    With a = (u, v + ell r, w - ell q) equation (10) reads dy = R a, and hence
    d2y = R (da/dt + omega x a). With roll held at zero R turns at omega = (-r tan(theta), q, r).

    Args:
        state: of the reference vehicle.
        moving: its motion.
        ell: distance of the control point [m].

    """
    position, _, _, (u, v, w, q, r) = state
    rotation, (du, dv, dw, dq, dr) = moving
    a1, a2, a3 = u, v + ell * r, w - ell * q
    p = r * rotation[0][2] / rotation[2][2]
    return Reference(
        control_point(position, rotation, ell),
        control_point_velocity(rotation, (u, v, w, p, q, r), ell),
        rotate(
            rotation,
            (
                du + q * a3 - r * a2,
                dv + ell * dr + r * a1 - p * a3,
                dw - ell * dq + p * a2 - q * a1,
            ),
        ),
    )
