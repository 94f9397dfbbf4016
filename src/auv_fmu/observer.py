"""The saturated velocity observer: equations (18), (23) and (24), or (50) and (51).

All gain matrices of the paper are diagonal and its saturation functions act component by
component, so the observer is written for one axis of the control point.
"""

from __future__ import annotations


def velocity_estimate(dy_o: float, s_z: float, z: float, lambda_: float, k_d: float) -> float:
    """D y_hat/dt: equations (23) and (50), which are (18) solved for it.

    Args:
        dy_o: observer state [m/s].
        s_z: s(z) of the estimation error.
        z: estimation error y - y_hat [m].
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    return dy_o + lambda_ * s_z + k_d * z


def observer_acceleration(ddy_r: float, s_z: float, lambda_: float, k_d: float) -> float:
    """D dy_o/dt: equation (51), the derivative of (24) (reading 4).

    Args:
        ddy_r: acceleration of the virtual reference [m/s2].
        s_z: s(z) of the estimation error.
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    return ddy_r + k_d * lambda_ * s_z


def initial_dy_o(s_z: float, z: float, lambda_: float, k_d: float) -> float:
    """dy_o(0) = -(Lambda s(z(0)) + k_d z(0)), so that the first velocity estimate is zero.

    The initial condition below (24). With y_hat(0) = y(0) it is zero.
    """
    return -(lambda_ * s_z + k_d * z)
