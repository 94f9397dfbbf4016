"""What the Euler approximation of section 4.1 asks of the gains; not in the paper.

A mode with the rate p is multiplied by 1 - h p in a step: it changes its sign in every step above
h p = 1, and grows above h p = 2.
"""

from __future__ import annotations

from math import sqrt

from auv_fmu.adaptation import NU


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
    """Rate at which the robust term damps the composite error, at most [1/s].

    rho_hat tanh(nu rho_hat r / eps_t) has the slope nu rho_hat^2 / eps_t at r = 0, and acts on
    inertias of lambda_m2 and more.

    Args:
        rho_hat: estimated bound [N].
        eps_t: width of the boundary layer [W].
        lambda_m2: smallest eigenvalue of M_2 [kg].

    """
    return NU * rho_hat * rho_hat / (eps_t * lambda_m2)
