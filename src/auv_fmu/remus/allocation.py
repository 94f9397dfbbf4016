"""Allocation of a force and two moments to fins and propeller, by the inverse model of the tail.

Not in the paper, whose vehicle takes tau_u, tau_q and tau_r themselves. The moment of a fin depends
on the flow past it, so the allocation depends on the speed through the water.
"""

from __future__ import annotations

from math import copysign, pi, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import NU, TAU
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.actuators import limit
from auv_fmu.remus.tail import (
    ACTUATOR,
    FASTEST,
    Tail,
    fin_lift,
    forces,
    thrust_at_rest,
    thrust_loss,
)


class Parameters(NamedTuple):
    """All parameters of the allocation."""

    tail: Annotated[Tail, Variable(name="")] = Tail()
    speed: Annotated[
        float,
        Variable(
            "m/s",
            "Nominal speed through the water; used if not `measured`",
            POSITIVE,
            FASTEST,
            tunable=True,
        ),
    ] = 1.5
    measured: Annotated[
        bool, Variable("1", "Whether nu_r gives the speed; if not, it is the nominal one")
    ] = False


class Wanted(NamedTuple):
    """Wanted force and moments, and velocity of the vehicle."""

    tau: Annotated[Vector3, Variable(TAU, "Wanted force and moments")]
    nu_r: Annotated[
        Vector3,
        Variable(
            {"u": NU["u"], "v": NU["v"], "w": NU["w"]},
            "Velocity through the water in the body frame; used if `measured`",
        ),
    ]


class Allocated(NamedTuple):
    """Command, and the force and moments that it gives."""

    command: Annotated[Vector3, Variable(ACTUATOR, "Command of rudder, stern planes and propeller")]
    tau_attained: Annotated[Vector3, Variable(TAU, "Force and moments that the command gives")]


def fin_angle(moment: float, effect: float, largest: float) -> float:
    """Angle of a fin that gives a moment, within its limits [rad].

    A fin without flow gives none: for any moment but zero it goes to its limit.

    Args:
        moment: wanted [N.m].
        effect: moment per angle, not negative [N.m/rad].
        largest: angle of the fin [rad].

    """
    if abs(moment) < effect * largest:
        return moment / effect
    return copysign(largest, moment) if moment else 0.0


def propeller_speed(tail: Tail, thrust: float, speed: float) -> float:
    """Speed of the propeller that gives a thrust [rad/s].

    A propeller that advances and turns slowly ahead brakes, with up to the square of its loss over
    four times its thrust at rest. It turns backwards only for more than that.

    Args:
        tail: parameters.
        thrust: wanted, before the deduction [N].
        speed: of advance of the propeller [m/s].

    """
    at_rest, loss = thrust_at_rest(tail), thrust_loss(tail, speed)
    root = loss * loss + 4.0 * at_rest * thrust
    rev = (loss + sqrt(root)) / (2.0 * at_rest) if root >= 0.0 else -sqrt(-thrust / at_rest)
    return limit(2.0 * pi * rev, -tail.n_max, tail.n_max)


def allocate(tail: Tail, tau: Vector3, u: float, v: float, w: float) -> Allocated:
    """Fins and propeller that give (tau_u, tau_q, tau_r) within their limits.

    The fins come first; the propeller makes up for their drag.

    Args:
        tail: parameters.
        tau: wanted [N, N.m].
        u, v, w: velocity through the water [m/s], body frame.

    """
    tau_u, tau_q, tau_r = tau
    lift_r = fin_lift(tail, tail.lift_r, u * u + v * v)
    lift_s = fin_lift(tail, tail.lift_s, u * u + w * w)
    # At the stern, a rudder to starboard pushes to port; the stern planes act in the same way.
    delta_r = fin_angle(tau_r, -tail.x * lift_r, tail.delta_max)
    delta_s = -fin_angle(tau_q, -tail.x * lift_s, tail.delta_max)
    drag = lift_r * delta_r * delta_r + lift_s * delta_s * delta_s
    speed = sqrt(u * u + v * v + w * w)
    n = propeller_speed(tail, (tau_u + drag) / (1.0 - tail.deduction), speed)
    command = delta_r, delta_s, n
    given = forces(tail, command, u, v, w, speed)
    return Allocated(command, (given[0], given[4], given[5]))


def evaluate(parameters: Parameters, tau: Vector3, nu_r: Vector3) -> Allocated:
    """Allocate with the measured or the nominal speed.

    Args:
        parameters: of the allocation.
        tau: wanted (tau_u, tau_q, tau_r) [N, N.m].
        nu_r: velocity (u, v, w) through the water [m/s], body frame, used only if `measured`.

    """
    if parameters.measured:
        u, v = limit(nu_r[0], -FASTEST, FASTEST), limit(nu_r[1], -FASTEST, FASTEST)
        return allocate(parameters.tail, tau, u, v, limit(nu_r[2], -FASTEST, FASTEST))
    return allocate(parameters.tail, tau, parameters.speed, 0.0, 0.0)
