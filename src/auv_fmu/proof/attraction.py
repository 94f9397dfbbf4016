"""Coverage of Theorems 1 and 2: the alphas of (40), and upper bounds on the region (33).

Only lower bounds of the zetas are known, so the numbers here are upper bounds: what no choice of
gains covers by them is not covered.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.gain_conditions import (
    Bounds,
    Condition,
    Zetas,
    at_least,
    bounds,
    conditions,
    coupling,
)


class Alphas(NamedTuple):
    """Upper bounds of alpha_1 to alpha_4 in (40), the bound on (37) [W]; two are exact."""

    alpha_1: float
    alpha_2: float
    alpha_3: float
    alpha_4: float


class Theorem(NamedTuple):
    """The theorem for a vehicle and its gains."""

    bounds: Bounds
    zetas: Zetas
    conditions: tuple[Condition, Condition, Condition]
    alphas: Alphas
    x_at_most: float  #: largest |x| at which (42) may hold with these gains
    x_of_any_gains: float  #: the same with any gains
    zeta_of_any_gains: float  #: lower bound of 0.5 (zeta_1 + zeta_2) of (31) with any gains
    speed_of_any_gains: float  #: upper bound of |r_1| of (42) and |dy_d|, any gains and v0 [m/s]
    alpha_1_of_any_gains: float  #: upper bound of alpha_1 where (31) holds, any gains and v0 [W]
    stretch: float  #: sqrt of the max in (33): |x| never exceeds this times |vartheta(0)|

    @property
    def radius(self) -> float:
        """Upper bound of the radius of the region of attraction (33); zero if it is empty."""
        return self.x_at_most / self.stretch if min(self.alphas) > 0.0 else 0.0


def theorem(
    vehicle: Vehicle, ell: float, gains: Gains, maximum_slope: float, v0: float = 1.0
) -> Theorem:
    """Evaluate the conditions, the alphas and the region of attraction.

    Args:
        vehicle: parameters.
        ell: distance of the control point [m].
        gains: of the controller.
        maximum_slope: s'_MM of its saturation function; 1 is Theorem 1.
        v0: unit of speed [m/s], see :mod:`.gain_conditions`.

    """
    known, k = bounds(vehicle, ell), coupling(vehicle, ell)
    zetas = at_least(vehicle, ell, gains.lambda_, v0)
    found = conditions(
        known, zetas, gains.K1, gains.K2, gains.lambda_, gains.k_d, maximum_slope, v0
    )
    return Theorem(
        known,
        zetas,
        found,
        alphas(known, found, gains, v0),
        reach(found[1].room, k) / v0,
        reach(known.lambda_d2, k) / v0,
        0.5 * at_least(vehicle, ell, 0.0, v0).zeta_1_2,
        reach(known.lambda_d2, k),
        alpha_1_at_most(known.lambda_d2, k),
        stretch(known, gains, maximum_slope, v0),
    )


def alphas(
    known: Bounds, found: tuple[Condition, Condition, Condition], gains: Gains, v0: float = 1.0
) -> Alphas:
    """alpha_1 to alpha_4, defined below (40): the margins of (30) to (32), and one more.

    Args:
        known: eigenvalues of M_2.
        found: the conditions.
        gains: of the controller.
        v0: unit of speed [m/s].

    """
    first, second, third = (condition.margin for condition in found)
    square = v0 * v0
    return Alphas(
        first,
        first + 0.5 * max(gains.K2) * v0,
        second * square,
        third * known.lambda_m2 * square,
    )


def reach(room: float, k: float) -> float:
    """Upper bound of v0 |x| [m/s] where (42) holds, with (26) required only up to this |x|.

    (42) and alpha_m <= alpha_3 ask for 2 zeta_1 + zeta_2 (1 + |x|^2) < 2 room; a chi_1 of
    k |r_1|^2 / 2 with |r_1| = v0 |x| asks for zeta_1 + zeta_2 |x| >= k v0 |x| / 2. As
    1 + |x|^2 >= 2 |x|, both need k v0 |x| < 2 room. So does (31) of the speed of a reference: see
    :func:`.coupling`.

    Args:
        room: lambda_d2 less the terms of the gains in (31) [kg/s].
        k: coupling [kg/m].

    """
    return max(2.0 * room / k, 0.0)


def alpha_1_at_most(lambda_d2: float, k: float) -> float:
    """Upper bound of alpha_1 [W] where (31) holds, for any gains and v0.

    (31) has k_2max < 2 v0 (lambda_d2 - k sqrt(v0^2 + lambda^2) / 4), and alpha_1 is
    k_2max (lambda / 2 - v0) at most. The product is largest at lambda = (2 + sqrt(5)) v0.

    Args:
        lambda_d2: smallest eigenvalue of D_2 [kg/s].
        k: coupling [kg/m].

    """
    return 64.0 / 27.0 * lambda_d2**3 / k**2 / (4.0 + 2.0 * sqrt(5.0))


def ball(theta: float, eps_t: float, mu_sigma: float) -> float:
    """Radius sqrt(gamma / c) of Omega_p in (44), with the kappa of (41) that minimises it.

    c is mu_sigma (1 - 0.5 / kappa^2) at most, and gamma = 0.5 mu_sigma kappa^2 theta^2 + 3 eps_t.

    Args:
        theta: |theta - theta_0|, in SI units.
        eps_t: width of the boundary layer [W].
        mu_sigma: smallest entry of Sigma.

    """
    return 0.5 * (theta + sqrt(theta * theta + 12.0 * eps_t / mu_sigma))


def stretch(known: Bounds, gains: Gains, maximum_slope: float, v0: float = 1.0) -> float:
    """sqrt(max{lambda_u / lambda_x, lambda_max(Gamma^-1) / (2 lambda_x)}) of (46) and (33).

    (33) prints min for max, but (47) has a sum over both parts of vartheta, which only the larger
    factor bounds. Lemma 1 (i) weights k_2 with s'_MM.

    Args:
        known: eigenvalues of M_2.
        gains: of the controller.
        maximum_slope: s'_MM of its saturation function.
        v0: unit of speed [m/s].

    """
    square = v0 * v0
    lambda_x = 0.5 * min(min(gains.K2) / maximum_slope, known.lambda_m2 * square)
    lambda_u = 0.5 * max(max(gains.K2) * maximum_slope, known.lambda_M2 * square)
    of_theta = 0.5 / gains.gamma if gains.gamma else inf
    return sqrt(max(lambda_u, of_theta) / lambda_x)
