"""The state of the saturated velocity observer: equation (24), or (51), in three forms.

The paper has two signals of almost the same name (reading 15): the state dy_hat_o of (23) and
(24), and dy_o of (18), which the control law and the proof use. They differ by k_d z. (18) and (23)
are in :func:`.output_feedback.evaluate`.
"""

from __future__ import annotations

from enum import IntEnum
from math import expm1

from auv_fmu.language.vectors import Vector3, add_scaled, scale


class Form(IntEnum):
    """A form of the observer."""

    #: (51) in Euler's scheme (reading 4).
    EULER = 0

    #: The same, with the term -k_d z of the error integrated exactly: :func:`exact_gain`.
    EXACT = 1

    #: (24) as printed, dy_hat_o = dy_r + k_d Lambda int s(z). The state is the second term. It
    #: begins at zero, which contradicts the initial condition below (24), unless dy_r(0) = 0.
    INTEGRAL = 2


#: Module-level names, which Python looks up faster than members of the class.
EULER, EXACT, INTEGRAL = Form


def exact_gain(k_d: float, h: float) -> float:
    """Gain (1 - exp(-k_d h)) / h [1/s], with which a step takes z to exp(-k_d h) z.

    Not in the paper. It is the mean of k_d exp(-k_d t) over the step, so (23) becomes the mean
    velocity of a y_hat whose correction k_d z decays as it would between two samples, if everything
    else is held. It is below 1 / h, so no k_d is too large for the step. If y itself were held,
    (23) would overestimate a constant speed by the factor k_d h / (1 - exp(-k_d h)).

    Args:
        k_d: observer gain [1/s].
        h: step [s].

    """
    return -expm1(-k_d * h) / h


def initial_dy_hat_o(s_z: Vector3, z: Vector3, lambda_: float, k_d: float) -> Vector3:
    """Initial condition below (24): dy_hat_o(0) = -(Lambda s(z(0)) + k_d z(0)) [m/s].

    With it the first velocity estimate (23) is zero.
    """
    return scale(-1.0, add_scaled(scale(lambda_, s_z), k_d, z))


def rate(form: Form, ddy_r: Vector3, s_z: Vector3, lambda_: float, k_d: float) -> Vector3:
    """Equation (51), the rate of the state [m/s2], which is the derivative of (24) (reading 4).

    (51) is ddy_hat_o = ddy_r + k_d Lambda s(z); the integral in (24) grows by its second term.

    Args:
        form: of the observer.
        ddy_r: acceleration of the virtual reference [m/s2].
        s_z: s(z) of the estimation error.
        lambda_: diagonal entry of Lambda [m/s].
        k_d: observer gain [1/s].

    """
    if form == INTEGRAL:
        return scale(k_d * lambda_, s_z)
    return add_scaled(ddy_r, k_d * lambda_, s_z)
