"""The page of stored runs: the live page's scene, charts and player, for rows in the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from math import inf
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim import Table
from orchestrator.figures.style import Drawn, printed_unit, reference_colours, vehicle_colours
from orchestrator.live.assembly import Plain, assemble, vehicle_data
from orchestrator.vehicle.indices import SMALLEST_DISTANCE, VEHICLES, metrics
from orchestrator.vehicle.signals import Loop, real_parameter

#: Most numbers in a page, of all runs together; rows of longer runs are skipped.
_NUMBERS = 400_000

#: Share of its values below which a column's range needs doubles.
_NARROW = 1e-3

#: Parts of the page about a vehicle, and the columns that they need.
_SHOWN = {
    "path": Loop.for_control_point,
    "tracking errors": Loop.for_tracking,
    "commands": Loop.for_commands,
    "velocity": Loop.for_velocity_estimates,
    "estimated parameters": Loop.for_parameter_estimates,
}


class Stored(NamedTuple):
    """A stored run.

    Attributes:
        run: its label, rows and vehicles.
        metrics: content of metrics.json; empty: there is none.

    """

    run: Drawn
    metrics: Mapping[str, Any]


def view_page(
    title: str, stored: Sequence[Stored], hear: Callable[[str], None] = lambda line: None
) -> str:
    """Make the page of a run and of its comparison.

    Args:
        title: heading.
        stored: runs with different labels.
        hear: called with a line before a part of the page is made, which may take minutes.

    Raises:
        InputError: a parameter is not a number, or a part of the page cannot be made.

    """
    vehicles = [_vehicles(each.run) for each in stored]
    n = len(vehicles[0])
    # Charts compare vehicle by vehicle, so runs with another number of vehicles are left out.
    pairs = [(each, loops) for each, loops in zip(stored, vehicles, strict=True) if len(loops) == n]
    names = [_columns(each.run.result, loops) for each, loops in pairs]
    times = _times([each.run.result for each, _ in pairs], sum(map(len, names)))
    runs, binary = [], []
    for (each, loops), columns in zip(pairs, names, strict=True):
        data, content = _packed(each.run.result, columns, times)
        indices = [_indices(each.metrics, loop) for loop in loops]
        vehicle = list(map(vehicle_data, loops))
        runs.append({"label": each.run.label, "vehicles": vehicle, "metrics": indices, **data})
        binary.append(content)
    fleet = vehicles[0] if n > 1 else ()
    data = {
        "loops": runs,
        "zUp": stored[0].run.z_up,
        "colours": vehicle_colours(len(fleet)),
        "references": reference_colours(fleet),
    }
    if not n:
        units = {k: v for each, _ in pairs for k, v in each.run.result.header.units.items()}
        shown = dict.fromkeys(chain.from_iterable(names))
        data["columns"] = {name: printed_unit(str(units.get(name, ""))) for name in shown}
    notes = [*(_left_out(stored[0].run) if n else ()), *_endings([each.run for each in stored])]
    text = "".join(f"{note}. " for note in notes)
    return assemble("view", data, binary, {"title": title, "notes": text}, hear)


def _vehicles(run: Drawn) -> list[Loop]:
    """Return the vehicles whose paths are known."""
    loops = [loop for loop in run.loops if not run.result.missing(*loop.for_control_point())]
    for loop in loops:
        real_parameter(run.result, loop.ell)
    return loops


def _left_out(run: Drawn) -> Iterator[str]:
    """Yield notes on parts that are left out."""
    for loop in run.loops:
        of_vehicle = f"{loop.name}: " if len(run.loops) > 1 else ""
        for name, needs in _SHOWN.items():
            if missing := run.result.missing(*needs(loop)):
                yield f"{of_vehicle}{name} left out: the run has no {missing[0]}"


def _endings(runs: Sequence[Drawn]) -> Iterator[str]:
    """Yield why runs ended early."""
    for run in runs:
        for text in (run.result.failure, run.result.ending.remark):
            if text:
                yield f"{run.label}: {text}" if len(runs) > 1 else text


def _columns(table: Table, loops: Sequence[Loop]) -> list[str]:
    """Return the columns that the page shows: signals of vehicles, or all if there are none."""
    if not loops:
        return [*table.header.numeric_columns]
    names = (
        name
        for loop in loops
        for name in (
            *loop.posture, *loop.y_d, *loop.commanded, *loop.dy, *loop.dy_hat, *loop.theta_hat
        )
    )  # fmt: skip
    return [name for name in dict.fromkeys(names) if name in table]


def _times(tables: Sequence[Table], columns: int) -> np.ndarray:
    """Return the times of the rows in the page, from the longest run."""
    longest = max(tables, key=lambda table: table.time[-1])
    n = len(longest)
    rows = np.linspace(0, n - 1, min(n, max(2, _NUMBERS // max(columns, 1))))
    times: np.ndarray = longest.time[rows.round().astype(int)]
    return times


def _packed(table: Table, columns: Sequence[str], times: np.ndarray) -> tuple[Plain, bytes]:
    """Return the data of a run, and its columns one after the other, time first.

    Args:
        table: rows of the run.
        columns: columns that are shown.
        times: times at which rows are taken, up to the end of the run.

    """
    time = times[times <= table.time[-1]]
    rows = (np.searchsorted(table.time, time, side="right") - 1).clip(0)
    values = {name: table[name][rows].astype(float) for name in columns}
    for column in values.values():
        column[~np.isfinite(column)] = np.nan
    doubles = [name for name, column in values.items() if _needs_doubles(column)]
    singles = [name for name in columns if name not in doubles]
    header = table.header
    data = {
        "actingRow": header.experiment.acting_row,
        "rows": len(time),
        "doubles": doubles,
        "singles": singles,
        "parameters": {str(k): v for k, v in header.parameters.items() if _is_number(v)},
        "happened": [event._asdict() for event in table.ending.events if _is_number(event.time)],
    }
    wide = b"".join(column.tobytes() for column in (time, *(values[name] for name in doubles)))
    return data, wide + b"".join(values[name].astype("<f4").tobytes() for name in singles)


def _needs_doubles(column: np.ndarray) -> bool:
    finite = column[np.isfinite(column)]
    return bool(finite.size and 0.0 < np.ptp(finite) < _NARROW * np.abs(finite).max())


def _indices(content: Mapping[str, Any], loop: Loop) -> dict[str, list[float | None]]:
    """Return the indices of a vehicle in metrics.json, and the common ones of all vehicles."""
    of_each = content.get(VEHICLES)
    own = of_each.get(loop.name) if isinstance(of_each, Mapping) else None
    indices = {**content, **own} if isinstance(own, Mapping) else content
    names = (*(index.name for index in metrics()), SMALLEST_DISTANCE)
    return {name: _members(indices[name]) for name in names if name in indices}


def _members(value: Any) -> list[float | None]:
    """Return the members of an index, None for those that JSON has no number for."""
    members = value if isinstance(value, list) else [value]
    return [member if _is_number(member) else None for member in members]


def _is_number(value: object) -> bool:
    """Tell whether a value is a number that JSON supports."""
    return isinstance(value, int | float) and abs(value) < inf
