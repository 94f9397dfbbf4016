"""The columns of the rows that the kernel fills, by the names of the ports."""

from __future__ import annotations

from orchestrator.vehicle.signals import (
    APPLIED,
    AXES,
    COMMANDED,
    DIRECTIONS,
    DY,
    DY_D,
    DY_HAT,
    NU,
    POSTURE,
    TAU,
    THETA_HAT,
    Y_D,
)

#: Behind the time.
COLUMNS: tuple[str, ...] = (
    *POSTURE,
    *NU,
    *(f"plant.y.{axis}" for axis in AXES),
    *DY,
    *Y_D,
    *DY_D,
    *(f"planner.ddy_d.{axis}" for axis in AXES),
    *DY_HAT,
    *THETA_HAT,
    *TAU,
    *COMMANDED,
    *APPLIED,
    *(f"plant.tau_w.{direction}" for direction in DIRECTIONS),
)
