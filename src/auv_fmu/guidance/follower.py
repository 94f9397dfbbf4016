"""The vehicle that follows a reference, and what the reference demands of it.

Not in the paper, whose references are motions of (1) and (2) by Definition 1. Others may demand too
much, so planners refuse them.
"""

from __future__ import annotations

from math import atan2, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.variable import Refusal, Variable
from auv_fmu.language.vectors import Vector3, Vector5, add_scaled, norm
from auv_fmu.paper.actuators import Limits
from auv_fmu.paper.control_point import ELL, Distance
from auv_fmu.paper.motion_planner import Reference
from auv_fmu.paper.vehicle import Vehicle


class Follower(NamedTuple):
    """The vehicle, and limits of the references that it follows."""

    vehicle: Annotated[Vehicle, Variable(name="")] = Vehicle()
    ell: Distance = ELL
    limits: Annotated[Limits, Variable(name="")] = Limits()
    #: By (2) and (3) the vehicle reaches 2.67 m/s straight ahead.
    speed_max: Annotated[float, Variable("m/s", "Largest accepted speed", 0.0)] = 2.5
    #: By (2) and (3) the vehicle at rest reaches this rate of turn.
    turn_max: Annotated[float, Variable("rad/s", "Largest accepted turn rate", 0.0)] = 4.0


class Demand(NamedTuple):
    """Motion and forces that a path demands of the vehicle at an instant."""

    is_steady: bool  #: False: no steady motion turns that tightly, and tau is zero
    speed: float  #: [m/s]
    turn: float  #: rate at which the path turns [rad/s]
    tau: Vector3  #: (u, q, r) [N, N.m]


def posture(y_d: Vector3, along: Vector3, ell: float) -> Vector5:
    """Posture (x, y, z, theta, psi) of a vehicle on the path that points along it.

    Args:
        y_d: its control point [m], earth frame.
        along: direction of the path, earth frame, of any length but 0.
        ell: distance of the control point [m].

    """
    dx, dy, dz = along
    x, y, z = add_scaled(y_d, -ell / norm(along), along)
    return x, y, z, atan2(-dz, sqrt(dx * dx + dy * dy)), atan2(dy, dx)


# Demands


def demand(vehicle: Vehicle, ell: float, moment: Reference) -> Demand:
    """Force and moments by (2) of a vehicle that turns steadily with the path.

    In a steady turn sway and heave are v = -m11 u r / d22 and w = m11 u q / d33, so the speed of
    the control point (10) gives the surge u, and (2) the force and moments. The force that
    accelerates the vehicle along the path is added.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].
        moment: reference at an instant, with a velocity that is neither zero nor vertical.

    """
    m11, m22, m33 = vehicle.m11, vehicle.m22, vehicle.m33
    _, (dx, dy, dz), (ddx, ddy, ddz) = moment
    speed, level = norm(moment.dy_d), sqrt(dx * dx + dy * dy)
    faster = (dx * ddx + dy * ddy) / level
    q = (dz * faster - ddz * level) / (speed * speed)
    r = (dx * ddy - dy * ddx) / (level * speed)
    turn = sqrt(r * r + q * q)
    # speed^2 = u^2 + (v + ell r)^2 + (w - ell q)^2, with sway and heave as functions of u.
    sway, heave = m11 * r / vehicle.d22, m11 * q / vehicle.d33
    A = 1.0 + sway * sway + heave * heave
    B = ell * (sway * r + heave * q)
    C = ell * ell * (r * r + q * q) - speed * speed
    if B * B < A * C:
        return Demand(False, speed, turn, (0.0, 0.0, 0.0))
    u = (B + sqrt(B * B - A * C)) / A
    v, w = -sway * u, heave * u
    thrust = m11 * (dx * ddx + dy * ddy + dz * ddz) / speed
    return Demand(
        True,
        speed,
        turn,
        (
            thrust + vehicle.d11 * u - m22 * v * r + m33 * w * q,
            vehicle.d55 * q + vehicle.righting_pitch * -dz / speed - (m33 - m11) * u * w,
            vehicle.d66 * r - (m11 - m22) * u * v,
        ),
    )


def is_easy(follower: Follower, moment: Reference) -> bool:
    """True if the vehicle can follow a reference, at an instant, with any heading.

    The surge force moves the control point along the bow, and the moments move it across, ell ahead
    of the centre of mass. Sway and heave are neglected.

    Args:
        follower: the vehicle.
        moment: reference at the instant.

    """
    vehicle, ell, (least, most) = follower.vehicle, follower.ell, follower.limits
    speed, a = norm(moment.dy_d), norm(moment.ddy_d)
    tau_u = vehicle.m11 * a + vehicle.d11 * speed
    tau_q = (vehicle.m55 * a + vehicle.d55 * speed) / ell + abs(vehicle.righting_pitch)
    tau_r = (vehicle.m66 * a + vehicle.d66 * speed) / ell
    return (
        speed <= follower.speed_max
        and speed / ell <= follower.turn_max
        and tau_u <= min(most[0], -least[0])
        and tau_q <= min(most[1], -least[1])
        and tau_r <= min(most[2], -least[2])
    )


# Checks


def check(follower: Follower) -> None:
    """Refuse a vehicle for which :func:`demand` has no answer.

    Raises:
        Refusal: nothing limits its drift.

    """
    if not (follower.vehicle.d22 > 0.0 and follower.vehicle.d33 > 0.0):
        raise Refusal("d22 and d33 must be positive: nothing else limits the drift in a turn")


def check_demand(
    follower: Follower, moment: Reference, before: str, number: float, after: str, advice: str
) -> None:
    """Refuse a reference, at an instant, that demands more of the vehicle than it has.

    Args:
        follower: the vehicle.
        moment: reference at the instant, with a velocity that is neither zero nor vertical.
        before, number, after: the instant in words, such as "t = ", 2.5 and " s".
        advice: end of the message.

    Raises:
        Refusal: the demand exceeds a limit.

    """
    asked, (x, y, z) = demand(follower.vehicle, follower.ell, moment), moment.y_d
    if not asked.is_steady:
        raise Refusal(
            f"{before}{number:g}{after}, at ({x:.3g}, {y:.3g}, {z:.3g}) m, the path turns at "
            f"{asked.turn:.3g} rad/s with {asked.speed:.3g} m/s: more tightly than the vehicle's "
            f"control point can, {follower.ell:g} m ahead; {advice}"
        )

    def check_range(what: str, value: float, least: float, most: float, unit: str) -> None:
        if not least <= value <= most:
            limit = least if value < least else most
            raise Refusal(
                f"{before}{number:g}{after}, at ({x:.3g}, {y:.3g}, {z:.3g}) m, the path asks for "
                f"{what} of {value:.3g} {unit}, {abs(value - limit):.2g} beyond the limit of "
                f"{limit:.3g}; {advice}"
            )

    least, most = follower.limits
    check_range("a speed", asked.speed, 0.0, follower.speed_max, "m/s")
    check_range("a turn", asked.turn, 0.0, follower.turn_max, "rad/s")
    check_range("a surge force", asked.tau[0], least[0], most[0], "N")
    check_range("a moment in pitch", asked.tau[1], least[1], most[1], "N.m")
    check_range("a moment in yaw", asked.tau[2], least[2], most[2], "N.m")
