"""The gain conditions of Theorem 1, (30) to (32), and of Theorem 2, (52) to (54).

The zetas of (26) and (29) bound what the paper leaves unknown, and :mod:`.zetas` bounds them from
below. So a condition is stated as its left side, the known part of the right side, and what the
zetas take at least. It is violated if they take more than there is, met if it has none, open
otherwise.

(30) adds N to N m/s, (31) adds N to kg/s, and |x| adds m/s to pure numbers: the paper counts speeds
in m/s. In another unit v0, with r_1 / v0 and r_2 / v0 in x and with |chi_i| / v0 in (26) and (29),
the same steps give the same conditions with k_2max v0 for k_2max in (30), and k_2max / v0 for it in
(31) and (32). k_1max has the slope of Tanh(dy_o - dy_r) in (21), which is per m/s in any case.
"""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.proof.zetas import Zetas
from auv_fmu.types import Vector3
from auv_fmu.vehicle import Vehicle


class Bounds(NamedTuple):
    """Extreme eigenvalues of M_2 and D_2 over all attitudes (P2.1 and P2.6).

    M_2 = R P^-T M_1 P^-1 R^T with J = R P, and P has one entry 1 and two of size ell: the
    eigenvalues are those of M_1 over 1 and ell^2, at every attitude. D_2 is alike.
    """

    lambda_m2: float  #: smallest eigenvalue of M_2 [kg]
    lambda_M2: float  #: largest eigenvalue of M_2 [kg]
    lambda_d2: float  #: smallest eigenvalue of D_2 [kg/s]
    lambda_D2: float  #: largest eigenvalue of D_2 [kg/s]


class Condition(NamedTuple):
    """One inequality left > right + zetas."""

    number: str  #: of the equation
    statement: str  #: as the paper writes it
    left: float
    right: float  #: without the zetas
    zetas: str  #: their term on the right; empty: none
    least: float  #: what that term is at least

    @property
    def room(self) -> float:
        """What is there for the zetas."""
        return self.left - self.right

    @property
    def margin(self) -> float:
        """What is left at most; the condition is violated for certain if it is not positive."""
        return self.room - self.least

    @property
    def verdict(self) -> str:
        """What is known for certain."""
        if self.margin <= 0.0:
            return "violated"
        return "open" if self.zetas else "met"


def bounds(vehicle: Vehicle, ell: float) -> Bounds:
    """Extreme eigenvalues of M_2 and D_2.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].

    """
    inertia = (vehicle.m11, vehicle.m55 / ell**2, vehicle.m66 / ell**2)
    damping = (vehicle.d11, vehicle.d55 / ell**2, vehicle.d66 / ell**2)
    return Bounds(min(inertia), max(inertia), min(damping), max(damping))


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
    """(52) to (54), which for tanh, with s'_MM = 1, are (30) to (32).

    Args:
        known: eigenvalues of M_2 and D_2.
        zetas: what they are at least.
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
