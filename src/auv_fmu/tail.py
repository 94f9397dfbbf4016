"""The tail of the REMUS 100: rudder, stern planes and propeller, and the forces that they give.

The model is that of the class `remus100` in PythonVehicleSimulator 1.0.1 (vehicles/remus100.py),
whose propeller has the thrust of a Wageningen series that is linear in the advance number. Not in
the paper.
"""

from __future__ import annotations

from math import pi, radians
from typing import NamedTuple

from auv_fmu.actuators import limit
from auv_fmu.vectors import Vector3, Vector6

#: Beyond this speed [m/s] through the water there is no model: it is four times the largest of the
#: vehicle, and explicit steps of 20 ms are stable below it.
FASTEST = 10.0

#: The same for the rate of turn [rad/s].
FASTEST_TURN = 30.0


class Tail(NamedTuple):
    """Parameters of fins and propeller, with the values of the REMUS 100."""

    rho: float = 1026.0  #: density of the water [kg/m3]
    area: float = 2 * 0.00665  #: area of a pair of fins [m2]
    x: float = -0.8  #: where the fins are ahead of the centre [m]: they are at the stern
    lift_r: float = 0.5  #: lift of the rudder per angle [1/rad]
    lift_s: float = 0.7  #: lift of the stern planes per angle [1/rad]
    delta_max: float = radians(15.0)  #: largest angle of a fin [rad]
    diameter: float = 0.14  #: of the propeller [m]
    deduction: float = 0.1  #: share of the thrust that the flow around the hull takes
    advance: float = 0.944  #: speed of advance per speed of the vehicle: 1 - wake fraction
    j_1: float = 0.6632  #: advance number at the largest speed
    kt_0: float = 0.4566  #: thrust coefficient at the advance number 0
    kt_1: float = 0.1798  #: thrust coefficient at j_1
    kq_0: float = 0.0700  #: torque coefficient at the advance number 0
    kq_1: float = 0.0312  #: torque coefficient at j_1
    torque: float = 0.1  #: share of the torque of the propeller that rolls the vehicle
    n_max: float = round(1525.0 * pi / 30.0, 12)  #: largest speed of the propeller [rad/s]


def limit_tail(tail: Tail, actuator: Vector3) -> Vector3:
    """What fins and propeller can be of (delta_r, delta_s, n) [rad, rad, rad/s]."""
    delta_r, delta_s, n = actuator
    return (
        limit(delta_r, -tail.delta_max, tail.delta_max),
        limit(delta_s, -tail.delta_max, tail.delta_max),
        limit(n, -tail.n_max, tail.n_max),
    )


def fin_lift(tail: Tail, lift: float, squared_speed: float) -> float:
    """The force of a pair of fins per angle [N/rad].

    Args:
        tail: parameters.
        lift: of the pair, per angle [1/rad].
        squared_speed: of the water past the fins [m2/s2].

    """
    return 0.5 * tail.rho * squared_speed * tail.area * lift


def thrust_at_rest(tail: Tail) -> float:
    """The thrust of the propeller per squared speed, in rev/s, of a vehicle at rest [N.s2]."""
    D = tail.diameter
    return tail.rho * D * D * D * D * tail.kt_0


def thrust_loss(tail: Tail, speed: float) -> float:
    """By how much the thrust falls per speed, in rev/s, of a propeller that advances [N.s].

    Args:
        tail: parameters.
        speed: of the vehicle, not negative [m/s].

    """
    D = tail.diameter
    return tail.rho * D * D * D * (tail.kt_0 - tail.kt_1) / tail.j_1 * tail.advance * speed


def propeller(tail: Tail, n: float, speed: float) -> tuple[float, float]:
    """Thrust and torque of the propeller.

    Args:
        tail: parameters.
        n: speed of the propeller [rad/s].
        speed: of the vehicle, not negative [m/s].

    Returns:
        (thrust [N], torque [N.m]), before what the hull takes of either.

    """
    rev = n / (2.0 * pi)
    D = tail.diameter
    thrust = thrust_at_rest(tail) * abs(rev) * rev
    torque = tail.rho * D * D * D * D * D * tail.kq_0 * abs(rev) * rev
    if rev > 0.0:
        thrust -= thrust_loss(tail, speed) * rev
        slope = (tail.kq_0 - tail.kq_1) / tail.j_1
        torque -= tail.rho * D * D * D * D * slope * tail.advance * speed * rev
    return thrust, torque


def forces(tail: Tail, actuator: Vector3, u: float, v: float, w: float, speed: float) -> Vector6:
    """What fins and propeller give.

    Args:
        tail: parameters.
        actuator: (delta_r, delta_s, n) within their limits [rad, rad, rad/s].
        u, v, w: velocity through the water [m/s], body frame.
        speed: with which the propeller advances [m/s].

    Returns:
        Force and moment (u, v, w, p, q, r) [N, N.m], body frame.

    """
    delta_r, delta_s, n = actuator
    thrust, torque = propeller(tail, n, speed)
    lift_r = fin_lift(tail, tail.lift_r, u * u + v * v)
    lift_s = fin_lift(tail, tail.lift_s, u * u + w * w)
    sway, heave = -lift_r * delta_r, -lift_s * delta_s
    drag = lift_r * delta_r * delta_r + lift_s * delta_s * delta_s
    return (
        (1.0 - tail.deduction) * thrust - drag,
        sway,
        heave,
        tail.torque * torque,
        -tail.x * heave,
        tail.x * sway,
    )
