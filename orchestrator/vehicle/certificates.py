"""What the proof speaks of, along a run: Lyapunov function, composite errors, margins.

Everything is computed from the true state of the vehicle, which the controller does not know.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.proof.lyapunov import Errors, composite_errors, lyapunov
from auv_fmu.saturation import SATURATIONS
from orchestrator.master.observers.files import CsvLines
from orchestrator.master.observers.observer import Ending, Header, every
from orchestrator.master.observers.table import Table
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    STANDARD,
    Loop,
    limits,
    parameter,
    true_control_point,
    value_of,
    vehicle,
)

COLUMNS = (
    "time",
    "V_without_theta",
    *(f"r_1.{k}" for k in AXES),
    *(f"r_2.{k}" for k in AXES),
    *(f"saturation_margin.{k}" for k in ACTUATORS),
)


def missing_for_certificates(table: Table, loop: Loop = STANDARD) -> list[str]:
    """Ports and parameters of the proposed controller and the vehicle that a run does not have."""
    columns = (
        *loop.posture, *loop.dy, *loop.seen_y_d, *loop.seen_dy_d, *loop.y_hat, *loop.dy_hat,
        *loop.z, *loop.tau,
    )  # fmt: skip
    return table.missing(columns, (*_gains(loop), *loop.limits, *loop.vehicle_parameters, loop.ell))


def _gains(loop: Loop) -> tuple[str, ...]:
    """K_2, lambda and the saturation function: parameters of the proposed controller."""
    names = ("K2[1]", "K2[2]", "K2[3]", "lambda", "saturation")
    return tuple(f"{loop.controller}.{name}" for name in names)


def certificates(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Table with :data:`COLUMNS`, one row for each instant at which the controller was evaluated.

    V is (34), or (55) for another saturation function, without its term in theta - theta_hat:
    theta is unknown. r_1 is (17), r_2 is (19). The margin is the distance of a command from its
    nearer limit, negative beyond it.
    """
    return _certificates(table.header, loop, table.rows[:-1], table.rows[1:])


def _certificates(header: Header, loop: Loop, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Certificates of some steps, from the rows at their starts and at their ends."""
    return np.array(list(_rows(loop, Table.of(header, starts), Table.of(header, ends))))


def _rows(loop: Loop, start: Table, end: Table) -> Iterator[list[float]]:
    plant = vehicle(lambda name: parameter(start, name), loop)
    *K2_names, lambda_name, saturation = _gains(loop)
    ell, lambda_ = parameter(start, loop.ell), parameter(start, lambda_name)
    K2_x, K2_y, K2_z = (parameter(start, name) for name in K2_names)
    s = SATURATIONS[str(value_of(start, saturation))]
    lower, upper = limits(start, loop)

    y, dy = true_control_point(start, loop), start.group(*loop.dy)
    euler = start.group(*loop.attitude)
    # The controller is sampled: the row at the end of a step has its values of the start.
    y_d, dy_d, y_hat, dy_hat, z_measured, tau = (
        end.group(*group)
        for group in (loop.seen_y_d, loop.seen_dy_d, loop.y_hat, loop.dy_hat, loop.z, loop.tau)
    )

    e, z, e_z = y - y_d, y - y_hat, y_hat - y_d
    margin = np.minimum(upper - tau, tau - lower)
    for i, t in enumerate(start.time.tolist()):
        r_1, r_2 = composite_errors(dy[i], dy_d[i], dy_hat[i], e_z[i], z_measured[i], lambda_, s)
        errors = Errors(e[i].tolist(), z[i].tolist(), r_1, r_2)
        rotation = rotation_from_euler(*euler[i].tolist())
        V = lyapunov(plant, rotation, errors, (K2_x, K2_y, K2_z), s, ell)
        yield [t, V, *r_1, *r_2, *margin[i]]


class CertificatesFile:
    """An observer that writes the table as CSV, if the run has what it takes."""

    def __init__(self, path: Path, interval: float | None = None, loop: Loop = STANDARD) -> None:
        """Write into a file, which is made when there is something to write.

        Args:
            path: of the file.
            interval: an instant is written for each of these [s]; None: all.
            loop: whose certificates they are.

        """
        self._path, self._loop = path, loop
        self._interval = interval
        self._lines: CsvLines | None = None

    def begin(self, header: Header) -> None:
        """Find out whether there will be certificates."""
        self._every = every(self._interval, header)
        self._header = header
        self._last = np.empty((0, 1 + len(header.columns)))
        self._is_possible = not missing_for_certificates(Table.of(header, self._last), self._loop)

    def take(self, rows: np.ndarray) -> None:
        """Write the certificates of the steps that end at these rows."""
        if not self._is_possible:
            return
        rows = np.vstack((self._last, rows))
        self._last = rows[-1:]
        starts, ends = rows[:-1], rows[1:]
        if self._every is not None and len(starts):
            chosen = self._every.chosen(starts[:, 0])
            starts, ends = starts[chosen], ends[chosen]
        if len(starts):
            if self._lines is None:
                self._lines = CsvLines(self._path, COLUMNS)
            found = _certificates(self._header, self._loop, starts, ends)
            self._lines.write(found.tolist())

    def end(self, ending: Ending) -> None:
        """Close the file."""
        if self._lines is not None:
            self._lines.close()
