"""The saturated velocity observer: equations (18), (23) and (24), or (50) and (51).

All gain matrices of the paper are diagonal and its saturation functions act component by
component, so the observer is written for one axis of the control point.

The paper has two signals of almost the same name (reading 15): the state dy_hat_o of (23) and
(24), and dy_o of (18), which the control law and the proof use. They differ by k_d z.
"""

from __future__ import annotations


def velocity_estimate(dy_hat_o: float, s_z: float, z: float, lambda_: float, k_d: float) -> float:
    """D y_hat/dt: equations (23) and (50), which are (18) solved for it.

    Args:
        dy_hat_o: observer state [m/s].
        s_z: s(z) of the estimation error.
        z: estimation error y - y_hat [m].
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    return dy_hat_o + lambda_ * s_z + k_d * z


def observer_velocity(dy_hat: float, s_z: float, lambda_: float) -> float:
    """dy_o/dt = d y_hat/dt - Lambda s(z): equation (18).

    Args:
        dy_hat: estimated velocity [m/s].
        s_z: s(z) of the estimation error.
        lambda_: diagonal entry of Lambda [m/s].

    """
    return dy_hat - lambda_ * s_z


def observer_acceleration(ddy_r: float, s_z: float, lambda_: float, k_d: float) -> float:
    """D dy_o/dt: equation (51), the derivative of (24) (reading 4).

    Args:
        ddy_r: acceleration of the virtual reference [m/s2].
        s_z: s(z) of the estimation error.
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    return ddy_r + k_d * lambda_ * s_z


def initial_dy_hat_o(s_z: float, z: float, lambda_: float, k_d: float) -> float:
    """dy_hat_o(0) = -(Lambda s(z(0)) + k_d z(0)), so that the first velocity estimate is zero.

    The initial condition below (24). With y_hat(0) = y(0) it is zero.
    """
    return -(lambda_ * s_z + k_d * z)
