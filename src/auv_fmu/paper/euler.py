"""The Euler approximation of section 4.1.

Everything is evaluated at t_k, then all states advance together (reading 5): the `step` of every
module takes each state x to x + h dx/dt.
"""

from __future__ import annotations

from math import ceil, inf

from auv_fmu.language.vectors import Vector4

#: The time step h of section 4.1 [s].
STEP = 0.02

#: Share by which a step may exceed the largest internal one, and its end the stop time, because
#: hosts round times.
ROUNDING = 1e-9

#: Largest norm of a state, far beyond any vehicle's. From a state below it a step with sane
#: inputs is always finite, so one wild sample does not end a run.
LARGEST_STATE = 1e100

#: Largest number of internal steps; more would be a mistake, and take seconds in Python.
MOST_INTERNAL_STEPS = 100_000


def longest_step(h_max: float) -> float:
    """Longest step that is not split [s].

    Args:
        h_max: largest internal step [s].

    """
    return h_max * (1.0 + ROUNDING)


def latest_end(start: float, stop: float) -> float:
    """Latest end of a step [s]: hosts that add up their steps may pass the stop time slightly.

    Args:
        start: of the run [s].
        stop: of the run [s]; infinite: none.

    """
    return stop + ROUNDING * max(abs(start), abs(stop))


def internal_steps(h: float, longest: float) -> int:
    """Number of equal internal steps of a step.

    Args:
        h: step, not negative [s].
        longest: longest step that is not split [s].

    """
    return ceil(h / longest)


def end_of_step(start: float, t: float, h: float) -> float:
    """End of a step [s]: a multiple of the step, if its beginning is one.

    Args:
        start: of the run [s].
        t: beginning of the step [s].
        h: length of the step, more than 0 [s].

    """
    counted = (t - start) / h
    if not abs(counted) < inf:
        return t + h
    k = round(counted)
    return start + (k + 1) * h if t == start + k * h else t + h


def advance_4(x: Vector4, dx: Vector4, h: float) -> Vector4:
    """Euler step x + h dx of a state with four components."""
    x_1, x_2, x_3, x_4 = x
    dx_1, dx_2, dx_3, dx_4 = dx
    return x_1 + h * dx_1, x_2 + h * dx_2, x_3 + h * dx_3, x_4 + h * dx_4
