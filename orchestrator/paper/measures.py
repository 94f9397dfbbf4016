"""Numbers of a run that claims speak of, beyond the indices of every run."""

from __future__ import annotations

import numpy as np

from orchestrator.analysis.signals import APPLIED, THETA_HAT, tracking_error
from orchestrator.master.table import Table


def turning_radius(table: Table) -> float:
    """Radius of the level circle that the centre of mass ends on [m]."""
    u, v, r = (table[f"plant.nu.{k}"][-1] for k in "uvr")
    return float(np.hypot(u, v) / abs(r))


def total_variation_until(table: Table, stop_time: float) -> float:
    """Sum of |difference| of the three applied signals up to a time."""
    applied = table.group(*APPLIED)[table.time <= stop_time]
    return float(np.abs(np.diff(applied[1:], axis=0)).sum())


def largest_error_after(table: Table, start: float) -> float:
    """Largest tracking error of any axis after a time [m]; zero for a shorter run."""
    return float(np.abs(tracking_error(table)[table.time > start]).max(initial=0.0))


def largest_estimate(table: Table) -> float:
    """Largest component of theta_hat in a run."""
    return float(table.group(*THETA_HAT).max())
