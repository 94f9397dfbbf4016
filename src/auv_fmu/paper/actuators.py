"""The limits of the actuators, equation (3), and the dynamics that Remark 2 neglects."""

from __future__ import annotations

from math import exp, expm1
from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import TAU
from auv_fmu.language.variable import Variable
from auv_fmu.language.vectors import Vector3, scale, sub


class Limits(NamedTuple):
    """Limits of (3) for u, q, r, with the values of section 4.1."""

    tau_min: Annotated[Vector3, Variable(TAU, "Lower limit of the actuators (3)", maximum=0.0)] = (
        -80.0,
        -80.0,
        -80.0,
    )
    tau_max: Annotated[Vector3, Variable(TAU, "Upper limit of the actuators (3)", 0.0)] = (
        80.0,
        80.0,
        80.0,
    )


def limit(tau_k: float, tau_min: float, tau_max: float) -> float:
    """Equation (3): the limits of one actuator.

    Args:
        tau_k: commanded force [N] or moment [N.m].
        tau_min, tau_max: limits in the same unit, tau_min < tau_max.

    """
    if tau_k > tau_max:
        return tau_max
    if tau_k < tau_min:
        return tau_min
    return tau_k


def limit_all(tau: Vector3, tau_min: Vector3, tau_max: Vector3) -> Vector3:
    """Equation (3) for k = u, q, r."""
    return (
        limit(tau[0], tau_min[0], tau_max[0]),
        limit(tau[1], tau_min[1], tau_max[1]),
        limit(tau[2], tau_min[2], tau_max[2]),
    )


def margin(tau_k: float, tau_min: float, tau_max: float) -> float:
    """Distance of a command from the nearer limit of (3), negative beyond it.

    Args:
        tau_k: commanded force [N] or moment [N.m].
        tau_min, tau_max: limits in the same unit, tau_min < tau_max.

    """
    return min(tau_max - tau_k, tau_k - tau_min)


class Drive(NamedTuple):
    """Force and moments (u, q, r) of the actuators within a step [N, N.m]."""

    first: Vector3  #: at its beginning
    middle: Vector3  #: halfway, as Simpson's rule needs it for the mean
    last: Vector3  #: at its end
    mean: Vector3  #: over the step


def respond(before: float, tau_k: float, T: float, h: float) -> float:
    """Output of an actuator of first order after a step: T dtau_a/dt = tau_k - tau_a, exactly.

    Args:
        before: output at the beginning of the step [N, N.m].
        tau_k: command within the limits of (3), held during the step.
        T: time constant [s]; 0: no lag.
        h: step [s].

    """
    return tau_k + (before - tau_k) * exp(-h / T) if T else tau_k


def follow(tau_a: float, tau_k: float, T: float) -> float:
    """Rate of the output of an actuator of first order [N/s, N.m/s]; 0 without a lag.

    Args:
        tau_a: output [N, N.m].
        tau_k: command within the limits of (3).
        T: time constant [s]; 0: no lag.

    """
    return (tau_k - tau_a) / T if T else 0.0


def mean_response(before: float, tau_k: float, T: float, h: float) -> float:
    """Mean output of the same actuator over the step: its impulse divided by h, exactly."""
    if not T:
        return tau_k
    x = h / T
    return tau_k + (before - tau_k) * (-expm1(-x) / x if x else 1.0)


def given(before: Vector3, tau: Vector3, T: Vector3) -> Vector3:
    """Outputs of the actuators u, q, r when the command changes: without a lag, the command.

    Args:
        before: outputs just before [N, N.m].
        tau: commands [N, N.m].
        T: time constants [s]; 0: no lag.

    """
    return (
        before[0] if T[0] else tau[0],
        before[1] if T[1] else tau[1],
        before[2] if T[2] else tau[2],
    )


def drive(before: Vector3, tau: Vector3, T: Vector3, h: float) -> Drive:
    """Outputs of the actuators u, q, r within a step.

    The mean gives the exact impulse, and so does a scheme that weights first, middle and last by 1,
    4, 1: `middle` is chosen for this, and differs from the true value by O(h^4) for any T.

    Args:
        before: outputs at the beginning of the step [N, N.m].
        tau: commands within the limits of (3), held during the step [N, N.m].
        T: time constants [s]; 0: no lag.
        h: step [s].

    """
    first = given(before, tau, T)
    last = (
        respond(before[0], tau[0], T[0], h),
        respond(before[1], tau[1], T[1], h),
        respond(before[2], tau[2], T[2], h),
    )
    mean = (
        mean_response(before[0], tau[0], T[0], h),
        mean_response(before[1], tau[1], T[1], h),
        mean_response(before[2], tau[2], T[2], h),
    )
    middle = scale(0.25, sub(sub(scale(6.0, mean), first), last))
    return Drive(first, middle, last, mean)
