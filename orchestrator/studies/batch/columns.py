"""The columns of the rows that the kernel fills, by the names of the ports."""

from __future__ import annotations

from orchestrator.vehicle.signals import AXES, DIRECTIONS, STANDARD

#: Behind the time.
COLUMNS: tuple[str, ...] = (
    *STANDARD.posture,
    *STANDARD.nu,
    *(f"plant.y.{axis}" for axis in AXES),
    *STANDARD.dy,
    *STANDARD.y_d,
    *STANDARD.dy_d,
    *(f"planner.ddy_d.{axis}" for axis in AXES),
    *STANDARD.dy_hat,
    *STANDARD.theta_hat,
    *STANDARD.tau,
    *STANDARD.commanded,
    *STANDARD.applied,
    *(f"plant.tau_w.{direction}" for direction in DIRECTIONS),
)
