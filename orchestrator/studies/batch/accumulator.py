"""The indices of a run on the way.

They equal :data:`orchestrator.vehicle.indices.INDICES` of the rows of a table bit for bit: sums go
on row by row, in the same order.
"""

from __future__ import annotations

from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.actuators import Limits
from auv_fmu.vectors import Vector3, Vector4, norm
from orchestrator.vehicle.indices import REACHED

#: Up to where an accumulator goes.
END = np.dtype(
    [
        ("steps", int),
        ("late", float),  # when half of the time is over [s]
        ("last", float),  # when the last seconds of it begin [s]
    ]
)

#: What is kept of a run until then.
ACCUMULATOR = np.dtype(
    [
        ("square", float, 3),  # integral of the square of the applied signal
        ("variation", float, 3),
        ("peak", float, 3),
        ("outside", int, 3),  # steps whose command is beyond the limits
        ("final", float, 3),  # largest |e| of each axis in the last seconds [m]
        ("reached", float),  # [s]
        ("late", float),  # largest |e| since half of the time [m]
        ("miss", float, 3),  # sum of (dy_hat - dy)^2 since half of the time
        ("instants", int),  # that it is a sum of
        ("half", float, 4),  # theta_hat at half of the time
        ("end", float, 4),
        ("speed", float),
        ("drift", float),
    ]
)


class RowSignals(NamedTuple):
    """What of a row of the table the indices follow from."""

    t: float  #: [s]
    e: Vector3  #: y - y_d with the true control point [m]
    dy: Vector3  #: velocity of the control point [m/s]
    drift: float  #: |(v, w)| [m/s]
    theta_hat: Vector4


class StepSignals(NamedTuple):
    """What of a step the indices follow from."""

    begun: float  #: [s]
    ended: float  #: [s]
    command: Vector3  #: (tau_u, tau_q, tau_r), as it reached the actuators [N, N.m]
    tau: Vector3  #: applied [N, N.m]
    before: Vector3  #: applied in the step before [N, N.m]
    miss: Vector3  #: dy_hat - dy at its beginning [m/s]
    is_first: bool


def new(n: int) -> np.ndarray:
    """Accumulators of nothing yet."""
    accumulators = np.zeros(n, ACCUMULATOR)
    accumulators["reached"] = accumulators["half"] = nan
    return accumulators


def take_row(accumulator: Any, row: RowSignals, end: Any) -> None:
    """Take a row into account."""
    error = norm(row.e)
    if isnan(accumulator.reached) and error <= REACHED:
        accumulator.reached = row.t
    accumulator.speed = max(accumulator.speed, norm(row.dy))
    accumulator.drift = max(accumulator.drift, row.drift)
    for i in range(4):
        accumulator.end[i] = row.theta_hat[i]
    if row.t >= end.late:
        accumulator.late = max(accumulator.late, error)
        if isnan(accumulator.half[0]):
            for i in range(4):
                accumulator.half[i] = row.theta_hat[i]
    if row.t >= end.last:
        for i in range(3):
            accumulator.final[i] = max(accumulator.final[i], abs(row.e[i]))


def take_step(accumulator: Any, step: StepSignals, limits: Limits, end: Any) -> None:
    """Take a step into account."""
    h = step.ended - step.begun
    for i in range(3):
        accumulator.square[i] += step.tau[i] * step.tau[i] * h
        if not step.is_first:
            accumulator.variation[i] += abs(step.tau[i] - step.before[i])
        accumulator.peak[i] = max(accumulator.peak[i], abs(step.command[i]))
        if not limits.tau_min[i] <= step.command[i] <= limits.tau_max[i]:
            accumulator.outside[i] += 1
    if step.begun >= end.late:
        accumulator.instants += 1
        for i in range(3):
            accumulator.miss[i] += step.miss[i] * step.miss[i]
