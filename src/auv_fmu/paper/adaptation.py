"""The adaptive bound on the uncertainty: (22) and (49), shared by (58), with Lemma 2."""

from __future__ import annotations

from math import tanh
from typing import Annotated

from auv_fmu.language.quantities import THETA
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector4, norm

#: Parameters of the adaptive law; Gamma and Sigma are multiples of the identity.
Gamma = Annotated[
    float, Variable("1", "Gain of the adaptation, in SI units (gamma)", 0.0, tunable=True)
]
Sigma = Annotated[
    float, Variable("1/s", "Rate at which the adaptation forgets (sigma)", 0.0, tunable=True)
]
Prior = Annotated[Vector4, Variable(THETA, "Prior estimate of the parameters (theta_0)")]
Layer = Annotated[
    float,
    Variable(
        "W", "Width of the boundary layer of the robust force (eps_t)", POSITIVE, tunable=True
    ),
]

#: Estimate of the adaptive law [N, kg/s, kg/m, kg].
Estimate = Annotated[
    Vector4, Variable(THETA, "Estimated parameters of the bounding function (theta_hat)")
]

#: The constant of Lemma 2, nu = exp(-(nu + 1)), with the digits the paper gives (reading 9).
NU = 0.2785


def regressor(velocity: Vector3, acceleration: Vector3) -> Vector4:
    """G = [1, |velocity|, |velocity|^2, |acceleration|], below (20) and below (57).

    Args:
        velocity: dy_r/dt in (21), dy_d/dt in (57) [m/s].
        acceleration: d2y_r/dt2 in (21), d2y_d/dt2 in (57) [m/s2].

    """
    speed = norm(velocity)
    return 1.0, speed, speed * speed, norm(acceleration)


def bound(G: Vector4, theta_hat: Vector4) -> float:
    """rho_hat = G theta_hat [N]: the estimated bound on the uncertainty, below (21)."""
    return G[0] * theta_hat[0] + G[1] * theta_hat[1] + G[2] * theta_hat[2] + G[3] * theta_hat[3]


def robust_force(rho_hat: float, r: Vector3, eps_t: float) -> Vector3:
    """rho_hat Tanh(nu rho_hat r / eps_t) [N]: the last term of (21), (48) and (57).

    Args:
        rho_hat: estimated bound [N].
        r: r_hat_1 + r_hat_2 in (21) and (48), r in (57) [m/s].
        eps_t: width of the boundary layer [W].

    """
    steepness = NU * rho_hat
    return (
        rho_hat * tanh(steepness * r[0] / eps_t),
        rho_hat * tanh(steepness * r[1] / eps_t),
        rho_hat * tanh(steepness * r[2] / eps_t),
    )


def theta_hat_rate(
    G: Vector4, r_norm: float, theta_hat: Vector4, theta_0: Vector4, gamma: float, sigma: float
) -> Vector4:
    """dtheta_hat = Gamma G^T |r| - Gamma Sigma (theta_hat - theta_0): (22), (49), (58).

    Args:
        G: regressor.
        r_norm: norm of the composite error [m/s].
        theta_hat, theta_0: estimate and prior [N, kg/s, kg/m, kg].
        gamma: diagonal entry of Gamma.
        sigma: diagonal entry of Sigma [1/s].

    """
    return (
        gamma * (G[0] * r_norm - sigma * (theta_hat[0] - theta_0[0])),
        gamma * (G[1] * r_norm - sigma * (theta_hat[1] - theta_0[1])),
        gamma * (G[2] * r_norm - sigma * (theta_hat[2] - theta_0[2])),
        gamma * (G[3] * r_norm - sigma * (theta_hat[3] - theta_0[3])),
    )
