"""The Euler approximation that section 4.1 simulates with.

Everything is evaluated at t_k, then all states advance together (reading 5): the `step` of every
module takes each state x to x + h dx/dt.
"""

from __future__ import annotations

from auv_fmu.types import Vector3, Vector4

#: The time step h of section 4.1 [s].
STEP = 0.02


def advance(x: Vector3, dx: Vector3, h: float) -> Vector3:
    """x + h dx: one step of a state whose rate is dx."""
    return x[0] + h * dx[0], x[1] + h * dx[1], x[2] + h * dx[2]


def advance_4(x: Vector4, dx: Vector4, h: float) -> Vector4:
    """The same for a state of four components."""
    return x[0] + h * dx[0], x[1] + h * dx[1], x[2] + h * dx[2], x[3] + h * dx[3]
