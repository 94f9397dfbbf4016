"""The Euler approximation that section 4.1 simulates with.

Everything is evaluated at t_k, then all states advance together (reading 5): the `step` of every
module takes each state x to x + h dx/dt.
"""

from __future__ import annotations

from math import ceil, inf

from auv_fmu.language.vectors import Vector4

#: The time step h of section 4.1 [s].
STEP = 0.02

#: A step may exceed the largest internal one, and its end the stop time, by this share: hosts round
#: time.
ROUNDING = 1e-9

#: Largest norm of a state. No vehicle comes near it, and from a state below it a step with sane
#: inputs is always finite: one wild sample must not be the end of a run.
LARGEST_STATE = 1e100

#: More internal steps than this in one step are taken for a mistake: in Python they take seconds.
MOST_INTERNAL_STEPS = 100_000


def longest_step(h_max: float) -> float:
    """The longest step that is not split [s].

    Args:
        h_max: largest internal step [s].

    """
    return h_max * (1.0 + ROUNDING)


def latest_end(start: float, stop: float) -> float:
    """The latest end of a step: hosts that add their steps up reach a stop time nearly [s].

    Args:
        start: of the run [s].
        stop: of the run; infinite: none [s].

    """
    return stop + ROUNDING * max(abs(start), abs(stop))


def internal_steps(h: float, longest: float) -> int:
    """How many equal internal steps a step is split into.

    Args:
        h: step, not negative [s].
        longest: that is not split [s].

    """
    return ceil(h / longest)


def end_of_step(start: float, t: float, h: float) -> float:
    """The end of a step: that of a host that counts them, where its beginning is.

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
    """x + h dx: one step of a state of four components whose rate is dx."""
    x_1, x_2, x_3, x_4 = x
    dx_1, dx_2, dx_3, dx_4 = dx
    return x_1 + h * dx_1, x_2 + h * dx_2, x_3 + h * dx_3, x_4 + h * dx_4
