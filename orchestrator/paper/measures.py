"""Measures of a run that the paper's claims are about, and the numbers that it prints."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.observers.table import Table
from orchestrator.vehicle.index.final_error import LAST as LAST_SECONDS
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import STANDARD, applied, real_parameter

#: Control efforts of section 4.2, in the order u, q, r.
EFFORT_PROPOSED, EFFORT_PD = (130.0, 40.0, 53.0), (235.0, 163.0, 172.0)

#: e_f of section 4.2, in the order x, y, z [m].
FINAL_ERROR_PROPOSED, FINAL_ERROR_PD = (0.01, 0.02, 0.06), (0.004, 0.001, 0.001)

#: Turning radius of section 4.1 [m].
TURNING_RADIUS = 0.6


def sum_without_step(l2: Any, duration: Any, h: float) -> Any:
    """(59) coded as sqrt(sum of tau_k^2 / T_f): a sum over steps that leaves out their length.

    Args:
        l2: norm of the signal, sqrt(sum of h tau_k^2).
        duration: T_f [s].
        h: step [s].

    """
    return l2 / np.sqrt(h * duration)


class Approach(NamedTuple):
    """The vehicle's way to the reference.

    Attributes:
        duration: until |e| is at most :data:`REACHED` [s].
        impulse: of the surge force, as applied in that time [N.s].

    """

    duration: float
    impulse: float

    @property
    def least_effort(self) -> float:
        """The least L2 norm that a force with this impulse can have in this time [N.s^0.5].

        (integral of tau)^2 <= T * integral of tau^2 by Cauchy and Schwarz, whatever its course.
        """
        return abs(self.impulse) / sqrt(self.duration)

    def contradicts_until(self, effort: float, h: float) -> float:
        """The T_f before which :func:`sum_without_step` cannot be as small as an effort [s]."""
        return (self.least_effort / effort) ** 2 / h

    def soonest(self, effort: float) -> float:
        """The least time in which a force of an L2 norm [N.s^0.5] can have this impulse [s]."""
        return (self.impulse / effort) ** 2


def errors(table: Table) -> np.ndarray:
    """e of all rows at once, far sooner than :func:`.tracking_error` and equal up to rounding."""
    _, theta, psi = table.group(*STANDARD.attitude).T
    ahead = np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)
    y = table.group(*STANDARD.position) + real_parameter(table, STANDARD.ell) * np.column_stack(
        ahead
    )
    error: np.ndarray = y - table.group(*STANDARD.y_d)
    return error


def approach_of(table: Table) -> Approach | None:
    """The way of a run to its reference; None if it does not come there, or is there already."""
    near = np.linalg.norm(errors(table), axis=1) <= REACHED
    first = int(near.argmax())
    if not near[first] or not first:
        return None
    force = applied(table)[:first, 0]
    return Approach(float(table.time[first]), float(force @ np.diff(table.time[: first + 1])))


def numbers_of(table: Table, end_times: Sequence[float]) -> np.ndarray:
    """Three L2 norms and three e_f, an axis for applied and commanded and one for the end times.

    Args:
        table: of a run until the last of them; what has failed before gives no numbers.
        end_times: in their order [s].

    """
    if table.time[-1] < end_times[-1] - table.time[1]:
        return np.full((2, len(end_times), 6), np.nan)
    h = np.diff(table.time)[:, np.newaxis]
    # Half a step is more than times are rounded by.
    ends = np.searchsorted(table.time, np.subtract(end_times, 0.5 * table.time[1]))
    begins = np.searchsorted(table.time, table.time[ends] - LAST_SECONDS)
    error = np.abs(errors(table))
    final = np.stack([error[i : k + 1].max(axis=0) for i, k in zip(begins, ends, strict=True)])
    efforts = (
        np.sqrt(np.cumsum(signal**2 * h, axis=0)[ends - 1])
        for signal in (applied(table), table.step_values(*STANDARD.commanded))
    )
    return np.stack([np.hstack((effort, final)) for effort in efforts])


def turning_radius(table: Table) -> float:
    """Radius of the level circle that the centre of mass ends on [m]."""
    u, v, r = (table[f"plant.nu.{k}"][-1] for k in "uvr")
    return float(np.hypot(u, v) / abs(r))


def total_variation_until(table: Table, stop_time: float) -> np.ndarray:
    """Sum of |difference| of each applied signal up to a time, in the order u, q, r."""
    signal = applied(table)[table.time[1:] <= stop_time]
    variation: np.ndarray = np.abs(np.diff(signal, axis=0)).sum(axis=0)
    return variation


def largest_error_after(table: Table, start: float) -> float:
    """Largest tracking error of any axis after a time [m]; zero for a shorter run."""
    return float(np.abs(errors(table)[table.time > start]).max(initial=0.0))


def largest_estimate(table: Table) -> float:
    """Largest component of theta_hat in a run."""
    return float(table.step_values(*STANDARD.theta_hat).max())
