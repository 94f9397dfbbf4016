"""Rows of the straight line of Python, in the columns of the compiled one."""

from __future__ import annotations

import numpy as np

from auv_fmu import plant
from auv_fmu.closed_loop import Instant, Setting, closed_loop
from auv_fmu.output_feedback import ControllerState


def straight_rows(setting: Setting, steps: int, delayed: bool) -> np.ndarray:
    """Time and values after every step: what a row of the FMUs' table holds."""
    instants = list(closed_loop(steps, setting, delayed))
    start, _ = plant.begin(setting.plant, instants[0].tau, setting.plant.current)
    acting = [start.tau, *(instant.vehicles.plant.tau for instant in instants[1:])]
    pairs = zip([instants[0], *instants[:-1]], instants, acting, strict=True)
    return np.array([_row(*pair) for pair in pairs])


def _row(before: Instant, now: Instant, tau: tuple[float, ...]) -> list[float]:
    seen, state = now.scene.plant, before.controller_state
    values = [
        now.t, *now.vehicles.plant.position, *seen.euler, *seen.nu, *now.scene.y, *seen.dy,
    ]  # fmt: skip
    for one in now.scene.reference:
        values += one
    if isinstance(state, ControllerState):
        values += before.signals.dy_hat
        state = state.theta_hat
    return [*values, *state, *before.signals.tau, *before.command, *tau, *before.tau_w]
