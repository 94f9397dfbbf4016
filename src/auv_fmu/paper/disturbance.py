"""Friction, waves and ocean currents: equation (56)."""

from __future__ import annotations

from math import copysign, sin
from typing import Annotated, NamedTuple

from auv_fmu.language.variable import Variable
from auv_fmu.language.vectors import Vector6


class Disturbance(NamedTuple):
    """Parameters of (56), with the values of section 4.1."""

    A_f: Annotated[
        float, Variable("N", "Amplitude of the friction, in N.m for moments (A_f)", tunable=True)
    ] = 0.5
    A_d: Annotated[
        float,
        Variable("N", "Amplitude of waves and currents, in N.m for moments (A_d)", tunable=True),
    ] = 1.0
    omega_d: Annotated[
        float, Variable("rad/s", "Angular frequency of the waves (omega_d)", tunable=True)
    ] = 0.1


def sign(x: float) -> float:
    """Sign of x: -1, 0 or 1, with sign(0) = 0 (reading 8)."""
    return copysign(1.0, x) if x else 0.0


def disturbance(parameters: Disturbance, nu: Vector6, t: float) -> Vector6:
    """Equation (56), tau_w(t): the same form in every degree of freedom.

    `sign(k)` in (56) is the sign of the velocity in direction k (reading 8).

    Args:
        parameters: amplitudes and frequency.
        nu: (u, v, w, p, q, r) [m/s, rad/s], body frame.
        t: time [s].

    Returns:
        tau_w (u, v, w, p, q, r) [N, N.m]; it enters (2) with a minus.

    """
    A_f, A_d, omega_d = parameters
    waves = A_d * sin(omega_d * t)
    u, v, w, p, q, r = nu
    return (
        A_f * sign(u) + waves,
        A_f * sign(v) + waves,
        A_f * sign(w) + waves,
        A_f * sign(p) + waves,
        A_f * sign(q) + waves,
        A_f * sign(r) + waves,
    )
