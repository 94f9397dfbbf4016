"""Tables of runs that were never made."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from auv_fmu.language.quantities import ETA, NU, TAU
from orchestrator.cosim import Experiment, Header, Order, PortName, Table
from orchestrator.vehicle.signals import STANDARD, Loop

COLUMNS = (
    *STANDARD.posture, *STANDARD.nu, *STANDARD.dy, *STANDARD.commanded, *STANDARD.y_d,
    *STANDARD.dy_hat, *STANDARD.theta_hat,
)  # fmt: skip
STEP = 0.02
UNITS = {
    f"{group}.{member}": unit
    for group, quantity in (("plant.eta", ETA), ("plant.nu", NU), ("plant.tau", TAU))
    for member, unit in quantity.items()
}


def loop_table(
    n: int = 400, without: Collection[str] = (), seed: int = 1, order: Order | None = None
) -> Table:
    """A closed loop whose signals swing; limits are +-80, ell is 0.35 m."""
    columns = tuple(name for name in COLUMNS if name not in without)
    time = STEP * np.arange(n)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(columns))
    rows = np.column_stack((time, np.sin(time[:, np.newaxis] + phases)))
    parameters = {STANDARD.ell: 0.35}
    parameters |= dict.fromkeys(STANDARD.lower_limits, -80.0) | dict.fromkeys(
        STANDARD.upper_limits, 80.0
    )
    known = {
        PortName.read(name): value for name, value in parameters.items() if name not in without
    }
    experiment = Experiment(max(n - 1, 1) * STEP, STEP, order)
    return Table.of(Header(columns, experiment, known, units=UNITS), rows)


def at_its_time(table: Table, acting: Collection[str]) -> Table:
    """The same run, with the values that act in a step in the row of its beginning.

    The last row then holds what never acts: here it is no number.
    """
    experiment = replace(table.header.experiment, order="feedthrough")
    rows = table.rows.copy()
    places = [table.header.place[name] for name in acting if name in table]
    rows[:-1, places] = table.rows[1:, places]
    rows[-1, places] = np.nan
    return Table.of(replace(table.header, experiment=experiment), rows, table.ending)


def fleet(n: int) -> tuple[Loop, ...]:
    """The loops of vehicles auv1, auv2, ..."""
    return tuple(
        Loop(*(f"auv{i}.{component}" for component in vars(STANDARD).values()))
        for i in range(1, n + 1)
    )


def fleet_table(n: int, rows: int = 400, without: Collection[str] = ()) -> Table:
    """Several of these loops, each with other phases, by the names that :func:`fleet` has."""
    of_each = {f"auv{i}": loop_table(rows, seed=i) for i in range(1, n + 1)}
    columns = [f"{name}.{column}" for name, table in of_each.items() for column in table.columns]
    values = np.column_stack([table.rows[:, 1:] for table in of_each.values()])
    kept = [i for i, column in enumerate(columns) if column not in without]
    parameters = {
        PortName.read(f"{name}.{port}"): value
        for name, table in of_each.items()
        for port, value in table.parameters.items()
    }
    time = of_each["auv1"].time
    header = Header(tuple(columns[i] for i in kept), Experiment(float(time[-1]), STEP), parameters)
    return Table.of(header, np.column_stack((time, values[:, kept])))


def table_of(
    time: np.ndarray, parameters: Mapping[PortName, Any] | None = None, **columns: Any
) -> Table:
    """A table of given columns, `a__b` for `a.b`; a number is the value of all rows."""
    names = tuple(name.replace("__", ".") for name in columns)
    values = [np.broadcast_to(value, len(time)) for value in columns.values()]
    header = Header(names, Experiment(float(time[-1]), float(time[1])), parameters or {})
    return Table.of(header, np.column_stack([time, *values]))
