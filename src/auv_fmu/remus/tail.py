"""The tail of the REMUS 100: rudder, stern planes and propeller, and their forces.

The model is taken from the class `remus100` in PythonVehicleSimulator 1.0.1 (vehicles/remus100.py).
The thrust of its propeller is linear in the advance number, after a Wageningen series. Not in the
paper.
"""

from __future__ import annotations

from math import pi, radians
from typing import Annotated, NamedTuple

from auv_fmu import __citation__ as of_the_paper
from auv_fmu.language.quantities import Members
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector6
from auv_fmu.paper.actuators import limit

#: Source of the model, and the paper of the equation numbers.
__citation__ = (
    "The model is taken from the class remus100 in PythonVehicleSimulator 1.0.1, by T. I. Fossen. "
    f"{of_the_paper}"
)

#: Largest speed through the water [m/s], four times the largest of the vehicle. Explicit steps of
#: 20 ms are stable below it.
FASTEST = 10.0

#: Largest rate of turn [rad/s].
FASTEST_TURN = 30.0

#: Rudder, stern planes and propeller, as commands and as states.
ACTUATOR: Members = {"delta_r": "rad", "delta_s": "rad", "n": "rad/s"}


class Tail(NamedTuple):
    """Parameters of fins and propeller, with the values of the REMUS 100."""

    rho: Annotated[float, Variable("kg/m3", "Density of the water (rho)", POSITIVE)] = 1026.0
    area: Annotated[float, Variable("m2", "Area of a pair of fins", POSITIVE, name="fin.area")] = (
        2 * 0.00665
    )
    x: Annotated[
        float,
        Variable(
            "m",
            "Where the fins are ahead of the centre; at the stern: < 0",
            maximum=-POSITIVE,
            name="fin.x",
        ),
    ] = -0.8
    lift_r: Annotated[
        float,
        Variable("1/rad", "Lift coefficient of the rudder per angle", POSITIVE, name="fin.lift.r"),
    ] = 0.5
    lift_s: Annotated[
        float,
        Variable(
            "1/rad", "Lift coefficient of the stern planes per angle", POSITIVE, name="fin.lift.s"
        ),
    ] = 0.7
    delta_max: Annotated[
        float, Variable("rad", "Largest angle of a fin", POSITIVE, pi / 2, name="fin.max")
    ] = radians(15.0)
    diameter: Annotated[
        float, Variable("m", "Diameter of the propeller", POSITIVE, name="propeller.diameter")
    ] = 0.14
    deduction: Annotated[
        float,
        Variable(
            "1",
            "Share of the thrust that the flow around the hull takes (thrust deduction number)",
            0.0,
            0.9,
            name="propeller.deduction",
        ),
    ] = 0.1
    advance: Annotated[
        float,
        Variable(
            "1",
            "Speed of advance per speed of the vehicle (1 - wake fraction)",
            0.0,
            name="propeller.advance",
        ),
    ] = 0.944
    j_1: Annotated[
        float,
        Variable(
            "1",
            "Advance number to which KT_1 and KQ_1 belong (J_1)",
            POSITIVE,
            name="propeller.J_1",
        ),
    ] = 0.6632
    kt_0: Annotated[
        float,
        Variable(
            "1", "Thrust coefficient at advance number 0 (KT_0)", POSITIVE, name="propeller.KT_0"
        ),
    ] = 0.4566
    kt_1: Annotated[
        float,
        Variable("1", "Thrust coefficient at advance number J_1 (KT_1)", name="propeller.KT_1"),
    ] = 0.1798
    kq_0: Annotated[
        float,
        Variable("1", "Torque coefficient at advance number 0 (KQ_0)", 0.0, name="propeller.KQ_0"),
    ] = 0.0700
    kq_1: Annotated[
        float,
        Variable("1", "Torque coefficient at advance number J_1 (KQ_1)", name="propeller.KQ_1"),
    ] = 0.0312
    torque: Annotated[
        float,
        Variable("1", "Share of the torque that rolls the vehicle", 0.0, name="propeller.torque"),
    ] = 0.1
    n_max: Annotated[
        float,
        Variable("rad/s", "Largest speed of the propeller", POSITIVE, name="propeller.max"),
    ] = round(1525.0 * pi / 30.0, 12)


def limit_tail(tail: Tail, actuator: Vector3) -> Vector3:
    """(delta_r, delta_s, n) within the limits of fins and propeller [rad, rad, rad/s]."""
    delta_r, delta_s, n = actuator
    return (
        limit(delta_r, -tail.delta_max, tail.delta_max),
        limit(delta_s, -tail.delta_max, tail.delta_max),
        limit(n, -tail.n_max, tail.n_max),
    )


def margins(tail: Tail, actuator: Vector3) -> Vector3:
    """Distances of (delta_r, delta_s, n) from the limits [rad, rad, rad/s], negative beyond."""
    delta_r, delta_s, n = actuator
    return tail.delta_max - abs(delta_r), tail.delta_max - abs(delta_s), tail.n_max - abs(n)


def fin_lift(tail: Tail, lift: float, squared_speed: float) -> float:
    """Force of a pair of fins per angle [N/rad].

    Args:
        tail: parameters.
        lift: of the pair, per angle [1/rad].
        squared_speed: of the water past the fins [m2/s2].

    """
    return 0.5 * tail.rho * squared_speed * tail.area * lift


def thrust_at_rest(tail: Tail) -> float:
    """Thrust of the propeller per squared speed, in rev/s, for a vehicle at rest [N.s2]."""
    D = tail.diameter
    return tail.rho * D * D * D * D * tail.kt_0


def thrust_loss(tail: Tail, speed: float) -> float:
    """Loss of thrust per speed, in rev/s, of a propeller that advances [N.s].

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
        (thrust [N], torque [N.m]), without the deductions for the hull.

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
    """Forces of fins and propeller.

    Args:
        tail: parameters.
        actuator: (delta_r, delta_s, n) within their limits [rad, rad, rad/s].
        u, v, w: velocity through the water [m/s], body frame.
        speed: of advance of the propeller [m/s].

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
