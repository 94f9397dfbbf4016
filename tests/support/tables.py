"""Tables of runs that were never made."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Header
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName, port_name
from orchestrator.vehicle.signals import (
    COMMANDED,
    DY,
    DY_HAT,
    ELL,
    LOWER_LIMITS,
    NU,
    POSTURE,
    THETA_HAT,
    UPPER_LIMITS,
    Y_D,
)

COLUMNS = (*POSTURE, *NU, *DY, *COMMANDED, *Y_D, *DY_HAT, *THETA_HAT)
STEP = 0.02


def loop_table(n: int = 400, without: Collection[str] = (), seed: int = 1) -> Table:
    """A closed loop whose signals swing; limits are +-80, ell is 0.35 m."""
    columns = tuple(name for name in COLUMNS if name not in without)
    time = STEP * np.arange(n)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(columns))
    rows = np.column_stack((time, np.sin(time[:, np.newaxis] + phases)))
    parameters = {ELL: 0.35}
    parameters |= dict.fromkeys(LOWER_LIMITS, -80.0) | dict.fromkeys(UPPER_LIMITS, 80.0)
    known = {port_name(name): value for name, value in parameters.items() if name not in without}
    return Table.of(Header(columns, Experiment(max(n - 1, 1) * STEP, STEP), known), rows)


def table_of(
    time: np.ndarray, parameters: Mapping[PortName, Any] | None = None, **columns: Any
) -> Table:
    """A table of given columns, `a__b` for `a.b`; a number stands in all rows."""
    names = tuple(name.replace("__", ".") for name in columns)
    values = [np.broadcast_to(value, len(time)) for value in columns.values()]
    header = Header(names, Experiment(float(time[-1]), float(time[1])), parameters or {})
    return Table.of(header, np.column_stack([time, *values]))
