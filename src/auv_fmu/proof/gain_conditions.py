"""Conditions on the gains: (30) to (32) of Theorem 1, (52) to (54) of Theorem 2, Euler's scheme.

The paper does not give the zetas of (26) and (29); here they are bounded from below. At |x| = 1,
(26) and (29) are |chi_1| <= zeta_1 + zeta_2 and |chi_2| <= zeta_3 + zeta_4, so any state with |x| =
1 bounds the sums from below. The states used here are a level vehicle without sway and heave, a
reference at rest, and z = 0: then dy_r = -lambda s(e), and with e_1 ahead, e_2 to starboard and e_3
down, chi_1 and chi_2 are short products. There are no upper bounds: C_2 has a pole at the vertical,
where P2.4 fails.

So a condition consists of its left side, the known part of the right side, and a lower bound of the
zetas' term. It is violated if this bound exceeds the rest, met if it has no zetas, open otherwise.

(30) adds N to N m/s, (31) adds N to kg/s, and |x| adds m/s to pure numbers: the paper counts speeds
in m/s. In another unit v0, with r_1 / v0 and r_2 / v0 in x and with |chi_i| / v0 in (26) and (29),
the same steps give the same conditions with k_2max v0 for k_2max in (30), and k_2max / v0 for it in
(31) and (32). k_1max has the slope of Tanh(dy_o - dy_r) in (21), which is per m/s in any case.
"""

from __future__ import annotations

from math import hypot, sqrt
from typing import NamedTuple

from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.adaptation import NU
from auv_fmu.paper.vehicle import Vehicle

# Zetas


class Zetas(NamedTuple):
    """Lower bounds of the sums of the zetas [kg/s]."""

    zeta_1_2: float  #: zeta_1 + zeta_2
    zeta_3_4: float  #: zeta_3 + zeta_4


def coupling(vehicle: Vehicle, ell: float) -> float:
    """k [kg/m] with |chi_1| = k |r_1|^2 / 2 for some r_1 of any size, with any gains.

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
    """Lower bounds of zeta_1 + zeta_2 and zeta_3 + zeta_4, for chi_1 and chi_2 as printed.

    With r_1 = (a, b, 0) and s(e) = (-c, 0, 0), chi_1 = -k b (a + lambda c) e_2 for the k of
    :func:`coupling`. With r_1 = (0, b, 0), s(e) = (c, 0, 0) and r_2 = (a, 0, 0), chi_2 has the part
    -b (m66 / ell^3 (a + lambda c (2 - m11 / m22)) + d66 / ell^2) along e_2. Each is maximised over
    a, b and c. In the plane of e_1 and e_3 pitch and heave replace yaw and sway.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].
        lambda_: diagonal entry of Lambda [m/s].
        v0: unit of speed [m/s]; at 1 it is as printed.

    """
    square, m11 = ell**2, vehicle.m11
    yaw = vehicle.m66 / ell**3 * hypot(v0, lambda_ * (2.0 - m11 / vehicle.m22))
    pitch = vehicle.m55 / ell**3 * hypot(v0, lambda_ * (2.0 - m11 / vehicle.m33))
    return Zetas(
        0.5 * coupling(vehicle, ell) * hypot(v0, lambda_),
        max(_largest(yaw, vehicle.d66 / square), _largest(pitch, vehicle.d55 / square)),
    )


def _largest(turning: float, damping: float) -> float:
    """Maximum of b (turning a + damping) with a^2 + b^2 = 1."""
    a = (sqrt(damping**2 + 8.0 * turning**2) - damping) / (4.0 * turning)
    return sqrt(1.0 - a * a) * (turning * a + damping)


# Conditions


class Bounds(NamedTuple):
    """Extreme eigenvalues of M_2 and D_2 over all attitudes (P2.1 and P2.6).

    M_2 = R P^-T M_1 P^-1 R^T with J = R P, and P has one entry 1 and two of size ell: the
    eigenvalues are those of M_1 over 1 and ell^2, at every attitude. The same holds for D_2.
    """

    lambda_m2: float  #: smallest eigenvalue of M_2 [kg]
    lambda_M2: float  #: largest eigenvalue of M_2 [kg]
    lambda_d2: float  #: smallest eigenvalue of D_2 [kg/s]
    lambda_D2: float  #: largest eigenvalue of D_2 [kg/s]


class Condition(NamedTuple):
    """One inequality left > right + zetas."""

    number: str  #: number of the equation
    statement: str  #: as printed
    left: float
    right: float  #: right side without the zetas
    zetas: str  #: term of the zetas on the right; empty: none
    least: float  #: lower bound of that term

    @property
    def room(self) -> float:
        """Left side less the known part of the right side."""
        return self.left - self.right

    @property
    def margin(self) -> float:
        """Upper bound of the margin; the condition is violated if it is not positive."""
        return self.room - self.least

    @property
    def verdict(self) -> str:
        """Verdict: violated, open or met."""
        if self.margin <= 0.0:
            return "violated"
        return "open" if self.zetas else "met"


def least_inertia(m11: float, m55: float, m66: float, ell: float) -> float:
    """Smallest eigenvalue of M_2 [kg].

    Args:
        m11: surge mass [kg].
        m55, m66: pitch and yaw inertia [kg.m2].
        ell: distance of the control point [m].

    """
    return min(m11, min(m55, m66) / ell**2)


def bounds(vehicle: Vehicle, ell: float) -> Bounds:
    """Extreme eigenvalues of M_2 and D_2.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].

    """
    m11, m55, m66 = vehicle.m11, vehicle.m55, vehicle.m66
    damping = (vehicle.d11, vehicle.d55 / ell**2, vehicle.d66 / ell**2)
    return Bounds(
        least_inertia(m11, m55, m66, ell),
        max(m11, m55 / ell**2, m66 / ell**2),
        min(damping),
        max(damping),
    )


def conditions(
    known: Bounds,
    zetas: Zetas,
    K1: Vector3,
    K2: Vector3,
    lambda_: float,
    k_d: float,
    maximum_slope: float,
    v0: float = 1.0,
) -> tuple[Condition, Condition, Condition]:
    """Equations (52) to (54), which for tanh, with s'_MM = 1, are (30) to (32).

    Args:
        known: eigenvalues of M_2 and D_2.
        zetas: lower bounds.
        K1, K2: diagonals of K_1 and K_2 [N].
        lambda_: diagonal entry of Lambda [m/s].
        k_d: gain of the observer [1/s].
        maximum_slope: s'_MM of the saturation function.
        v0: unit of speed [m/s]; at 1 the conditions are as printed.

    """
    k_1, k_2 = max(K1), max(K2)
    return (
        Condition(
            "(30), (52)",
            "lambda_min(K_2 Lambda) > 0.5 k_2max lambda + k_2max",
            min(K2) * lambda_,
            0.5 * k_2 * lambda_ + k_2 * v0,
            "",
            0.0,
        ),
        Condition(
            "(31), (53)",
            "lambda_d2 > s'_MM k_1max + 0.5 k_2max + 0.5 (zeta_1 + zeta_2)",
            known.lambda_d2,
            maximum_slope * k_1 + 0.5 * k_2 / v0,
            "0.5 (zeta_1 + zeta_2)",
            0.5 * zetas.zeta_1_2,
        ),
        Condition(
            "(32), (54)",
            "k_d > (2 s'_MM k_1max + k_2max + 0.5 (zeta_3 + zeta_4)) / lambda_m2",
            k_d,
            (2.0 * maximum_slope * k_1 + k_2 / v0) / known.lambda_m2,
            "0.5 (zeta_3 + zeta_4) / lambda_m2",
            0.5 * zetas.zeta_3_4 / known.lambda_m2,
        ),
    )


# Conditions of the Euler approximation in section 4.1 on the gains; not in the paper. A step
# multiplies a mode of the rate p by 1 - h p: it changes its sign in every step above h p = 1, and
# grows above h p = 2.


def observer_rate(lambda_: float, k_d: float) -> float:
    """Rate of the fastest mode of the observer near rest [1/s].

    With s(z) = z, (50) and (51) under the acceleration of Remark 3 are, for a vehicle at rest on
    its reference, d2z/dt2 + (k_d + 2 lambda) dz/dt + k_d lambda z = 0.

    Args:
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    b = k_d + 2.0 * lambda_
    return (b + sqrt(b * b - 4.0 * k_d * lambda_)) / 2.0


def robust_rate(rho_hat: float, eps_t: float, lambda_m2: float) -> float:
    """Largest rate at which the robust term damps the composite error [1/s].

    rho_hat tanh(nu rho_hat r / eps_t) has the slope nu rho_hat^2 / eps_t at r = 0, and acts on
    inertias of lambda_m2 and more.

    Args:
        rho_hat: estimated bound [N].
        eps_t: width of the boundary layer [W].
        lambda_m2: smallest eigenvalue of M_2 [kg].

    """
    return NU * rho_hat * rho_hat / (eps_t * lambda_m2)
