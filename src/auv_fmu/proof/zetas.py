"""Lower bounds on the zetas of (26) and (29), which the paper leaves unknown.

At |x| = 1, (26) and (29) are |chi_1| <= zeta_1 + zeta_2 and |chi_2| <= zeta_3 + zeta_4, so any
state with |x| = 1 bounds the sums from below. Those taken here are a level vehicle without sway and
heave, a reference at rest, and z = 0: then dy_r = -lambda s(e), and with e_1 ahead, e_2 to
starboard and e_3 down, chi_1 and chi_2 are short products. There are no upper bounds: C_2 has a
pole at the vertical, where P2.4 fails.
"""

from __future__ import annotations

from math import hypot, sqrt
from typing import NamedTuple

from auv_fmu.vehicle import Vehicle


class Zetas(NamedTuple):
    """What the sums of the zetas are at least [kg/s]."""

    zeta_1_2: float  #: of zeta_1 + zeta_2
    zeta_3_4: float  #: of zeta_3 + zeta_4


def coupling(vehicle: Vehicle, ell: float) -> float:
    """k [kg/m] with |chi_1| = k |r_1|^2 / 2 for some r_1 of any size, whatever the gains.

    A control point that moves sideways turns the vehicle; turning drives its sway, (7), and sway
    moves the control point. At dy_r = 0 that is all of chi_1 = -d(r_1), and at
    r_1 = |r_1| (e_1 + e_2) / sqrt(2), or with e_3 for e_2, it is the larger of these products.
    Where dy_r is ahead and r_1 is not, |chi_1| = k |dy_r| |r_1|.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].

    """
    return vehicle.m11 * max(vehicle.m66 / vehicle.m22, vehicle.m55 / vehicle.m33) / ell**3


def at_least(vehicle: Vehicle, ell: float, lambda_: float, v0: float = 1.0) -> Zetas:
    """What zeta_1 + zeta_2 and zeta_3 + zeta_4 are at least, for chi_1 and chi_2 as printed.

    With r_1 = (a, b, 0) and s(e) = (-c, 0, 0), chi_1 = -k b (a + lambda c) e_2 for the k of
    :func:`coupling`. With r_1 = (0, b, 0), s(e) = (c, 0, 0) and r_2 = (a, 0, 0), chi_2 has the part
    -b (m66 / ell^3 (a + lambda c (2 - m11 / m22)) + d66 / ell^2) along e_2. Each is taken at the
    a, b and c at which it is largest. In the plane of e_1 and e_3 pitch and heave stand for yaw and
    sway.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].
        lambda_: diagonal entry of Lambda [m/s].
        v0: unit of speed [m/s], see :mod:`.gain_conditions`.

    """
    square, m11 = ell**2, vehicle.m11
    yaw = vehicle.m66 / ell**3 * hypot(v0, lambda_ * (2.0 - m11 / vehicle.m22))
    pitch = vehicle.m55 / ell**3 * hypot(v0, lambda_ * (2.0 - m11 / vehicle.m33))
    return Zetas(
        0.5 * coupling(vehicle, ell) * hypot(v0, lambda_),
        max(_largest(yaw, vehicle.d66 / square), _largest(pitch, vehicle.d55 / square)),
    )


def _largest(turning: float, damping: float) -> float:
    """The largest b (turning a + damping) with a^2 + b^2 = 1."""
    a = (sqrt(damping**2 + 8.0 * turning**2) - damping) / (4.0 * turning)
    return sqrt(1.0 - a * a) * (turning * a + damping)
