"""The page of stored runs: the live page's scene, charts and player over rows that are there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim import Table
from orchestrator.figures.style import Drawn, printed_unit, reference_colours, vehicle_colours
from orchestrator.live.assembly import Plain, assemble, vehicle_data
from orchestrator.vehicle.indices import SMALLEST_DISTANCE, VEHICLES, metrics
from orchestrator.vehicle.signals import Loop, real_parameter

#: A page holds so many numbers, of all runs together: of longer ones fewer rows.
_NUMBERS = 800_000

#: A column whose range is a smaller share of its values than this needs doubles.
_NARROW = 1e-3

#: What there is to see of a vehicle, and what it needs.
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
        metrics: what metrics.json holds, as far as it is there.

    """

    run: Drawn
    metrics: Mapping[str, Any]


def view_page(
    title: str, stored: Sequence[Stored], hear: Callable[[str], None] = lambda line: None
) -> str:
    """Write the page of a run, and of the one that it is compared with.

    Args:
        title: heading.
        stored: the runs, with different labels.
        hear: called with a line before a part of the page is made, which may take minutes.

    Raises:
        InputError: a parameter is not a number, or a part of the page cannot be made.

    """
    vehicles = [_vehicles(one.run) for one in stored]
    n = len(vehicles[0])
    # Vehicles of one run stand for those of the other.
    pairs = [(one, loops) for one, loops in zip(stored, vehicles, strict=True) if len(loops) == n]
    names = [_columns(one.run.result, loops) for one, loops in pairs]
    times = _times([one.run.result for one, _ in pairs], sum(map(len, names)))
    runs, binary = [], []
    for (one, loops), columns in zip(pairs, names, strict=True):
        data, content = _packed(one.run.result, columns, times)
        indices = [_indices(one.metrics, loop) for loop in loops]
        vehicle = list(map(vehicle_data, loops))
        runs.append({"label": one.run.label, "vehicles": vehicle, "metrics": indices, **data})
        binary.append(content)
    fleet = vehicles[0] if n > 1 else ()
    data = {
        "loops": runs,
        "zUp": stored[0].run.z_up,
        "colours": vehicle_colours(len(fleet)),
        "references": reference_colours(fleet),
    }
    if not n:
        units = {k: v for one, _ in pairs for k, v in one.run.result.header.units.items()}
        every = dict.fromkeys(name for columns in names for name in columns)
        data["columns"] = {name: printed_unit(str(units.get(name, ""))) for name in every}
    notes = [*(_drawn(stored[0].run) if n else ()), *_endings([one.run for one in stored])]
    text = "".join(f"{note}. " for note in notes)
    return assemble("view", data, binary, {"title": title, "notes": text}, hear)


def _vehicles(run: Drawn) -> list[Loop]:
    """The vehicles whose paths are known."""
    found = [loop for loop in run.loops if not run.result.missing(*loop.for_control_point())]
    for loop in found:
        real_parameter(run.result, loop.ell)
    return found


def _drawn(run: Drawn) -> Iterator[str]:
    """The size of what is drawn, and what is skipped."""
    yield "Vehicles are drawn larger than they are"
    for loop in run.loops:
        of_vehicle = f"{loop.name}: " if len(run.loops) > 1 else ""
        for name, needs in _SHOWN.items():
            if missing := run.result.missing(*needs(loop)):
                yield f"{of_vehicle}{name} skipped: no {missing[0]}"


def _endings(runs: Sequence[Drawn]) -> Iterator[str]:
    """The reasons of runs that ended early."""
    for run in runs:
        for text in (run.result.failure, run.result.ending.remark):
            if text:
                yield f"{run.label}: {text}" if len(runs) > 1 else text


def _columns(table: Table, loops: Sequence[Loop]) -> list[str]:
    """The columns that the page shows: of the vehicles, or all."""
    if not loops:
        return [*table.header.numeric_columns]
    wanted = (
        name
        for loop in loops
        for name in (
            *loop.posture, *loop.y_d, *loop.commanded, *loop.dy, *loop.dy_hat, *loop.theta_hat
        )
    )  # fmt: skip
    return [name for name in dict.fromkeys(wanted) if name in table]


def _times(tables: Sequence[Table], columns: int) -> np.ndarray:
    """The times of the rows in the page: of the run that goes on longest."""
    longest = max(tables, key=lambda table: table.time[-1])
    n = len(longest)
    rows = np.linspace(0, n - 1, min(n, max(2, _NUMBERS // max(columns, 1))))
    times: np.ndarray = longest.time[rows.round().astype(int)]
    return times


def _packed(table: Table, columns: Sequence[str], times: np.ndarray) -> tuple[Plain, bytes]:
    """A run as data and rows: its columns one after the other, time first.

    Args:
        table: of the run.
        columns: that are shown.
        times: at which rows are taken, as far as the run goes.

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
        "happened": [one._asdict() for one in table.ending.events if _is_number(one.time)],
    }
    wide = b"".join(column.tobytes() for column in (time, *(values[name] for name in doubles)))
    return data, wide + b"".join(values[name].astype("<f4").tobytes() for name in singles)


def _needs_doubles(column: np.ndarray) -> bool:
    finite = column[np.isfinite(column)]
    return bool(finite.size and 0.0 < np.ptp(finite) < _NARROW * np.abs(finite).max())


def _indices(content: Mapping[str, Any], loop: Loop) -> dict[str, list[float | None]]:
    """The indices of a vehicle in metrics.json, and what there is of all together."""
    of_each = content.get(VEHICLES)
    own = of_each.get(loop.name) if isinstance(of_each, Mapping) else None
    found = {**content, **own} if isinstance(own, Mapping) else content
    names = (*(index.name for index in metrics()), SMALLEST_DISTANCE)
    return {name: _members(found[name]) for name in names if name in found}


def _members(value: Any) -> list[float | None]:
    """The members of an index, without what JSON has no words for."""
    members = value if isinstance(value, list) else [value]
    return [one if _is_number(one) else None for one in members]


def _is_number(value: object) -> bool:
    """Whether a value is a number that JSON has words for."""
    return isinstance(value, int | float) and abs(value) < inf
