"""Tables of runs that were never made."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from fmus.ports.quantities import ETA, NU, TAU
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Header
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName, port_name
from orchestrator.vehicle.signals import STANDARD

COLUMNS = (
    *STANDARD.posture,
    *STANDARD.nu,
    *STANDARD.dy,
    *STANDARD.commanded,
    *STANDARD.y_d,
    *STANDARD.dy_hat,
    *STANDARD.theta_hat,
)
STEP = 0.02
UNITS = {
    f"{group}.{member}": unit
    for group, quantity in (("plant.eta", ETA), ("plant.nu", NU), ("plant.tau", TAU))
    for member, unit in quantity.items()
}


def loop_table(n: int = 400, without: Collection[str] = (), seed: int = 1) -> Table:
    """A closed loop whose signals swing; limits are +-80, ell is 0.35 m."""
    columns = tuple(name for name in COLUMNS if name not in without)
    time = STEP * np.arange(n)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(columns))
    rows = np.column_stack((time, np.sin(time[:, np.newaxis] + phases)))
    parameters = {STANDARD.ell: 0.35}
    parameters |= dict.fromkeys(STANDARD.lower_limits, -80.0) | dict.fromkeys(
        STANDARD.upper_limits, 80.0
    )
    known = {port_name(name): value for name, value in parameters.items() if name not in without}
    experiment = Experiment(max(n - 1, 1) * STEP, STEP)
    return Table.of(Header(columns, experiment, known, units=UNITS), rows)


def table_of(
    time: np.ndarray, parameters: Mapping[PortName, Any] | None = None, **columns: Any
) -> Table:
    """A table of given columns, `a__b` for `a.b`; a number stands in all rows."""
    names = tuple(name.replace("__", ".") for name in columns)
    values = [np.broadcast_to(value, len(time)) for value in columns.values()]
    header = Header(names, Experiment(float(time[-1]), float(time[1])), parameters or {})
    return Table.of(header, np.column_stack([time, *values]))
