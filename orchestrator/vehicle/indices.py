"""Indices of a run, (59) and others: each is declared once, in :data:`INDICES`.

The table is used for metrics.json, the terminal, the report, the columns of a study and the labels
of its figures. Each index is defined in a module of :mod:`.index`. The smallest distance between
vehicles is the one index of several vehicles together; it is computed here, because numpy compares
all pairs of hundreds of vehicles far faster than equations in Python do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import inf, nan
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import member_of
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer, read_reducer
from orchestrator.cosim import Ending, Header, PortName, System, Table
from orchestrator.machine.errors import InputError, shortened
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.index import (
    effort,
    estimate_error,
    final_error,
    largest_drift,
    largest_speed,
    parameter_estimates,
    peak_command,
    saturated_fraction,
    settling,
    tracking,
)
from orchestrator.vehicle.reduction import reductions_of
from orchestrator.vehicle.signals import ACTUATORS, STANDARD, Loop, Needs
from orchestrator.vehicle.verdict import verdict

#: The index of several vehicles: its name in files, and its label.
SMALLEST_DISTANCE = "smallest_distance"
SMALLEST_DISTANCE_LABEL = "smallest distance between vehicles"

#: Number of coordinates that are compared at once.
_AT_ONCE = 1_000_000

#: Key in metrics.json of the indices of each of several vehicles.
VEHICLES = "vehicles"


class Index(NamedTuple):
    """An index: its names, and the reducer that computes it.

    Attributes:
        name: name in files; `name.member` in the columns of a study.
        label: name in figures and tables.
        reducer: the reducer that has it among its results.
        symbol: symbol in formulas, before the label; members become its indices.
        is_metric: True if metrics.json contains it, False if only studies do.

    """

    name: str
    label: str
    reducer: Reducer
    symbol: str = ""
    is_metric: bool = False

    @property
    def _ports(self) -> tuple[Port, ...]:
        return self.reducer.results[self.name]

    @property
    def meaning(self) -> str:
        """Description for the reference page."""
        return self.reducer.meanings[self.name]

    @property
    def units(self) -> Mapping[str, str]:
        """Units of its members; a single number is a member without a name."""
        names = ("" if port.name == self.name else member_of(port.name) for port in self._ports)
        units = ("" if port.unit in (None, "1") else port.unit for port in self._ports)
        return dict(zip(names, units, strict=True))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in the table of a study."""
        return tuple(port.name for port in self._ports)

    @property
    def members(self) -> str:
        """Names of its members, separated by commas; empty for a single number."""
        return ", ".join(self.units)

    @property
    def unit(self) -> str:
        """Units of its members, each once, separated by commas."""
        return ", ".join(filter(None, dict.fromkeys(self.units.values())))


def _read(*modules: ModuleType) -> dict[str, Reducer]:
    """Return the reducers of modules, by the names of their indices."""
    reducers = map(read_reducer, modules)
    return {name: reducer for reducer in reducers for name in reducer.results}


_REDUCERS = _read(
    effort,
    peak_command,
    saturated_fraction,
    final_error,
    tracking,
    settling,
    estimate_error,
    parameter_estimates,
    largest_speed,
    largest_drift,
)


def _index(name: str, label: str, symbol: str = "", is_metric: bool = False) -> Index:
    return Index(name, label, _REDUCERS[name], symbol, is_metric)


#: The index of the verdict that is not in metrics.json.
_SETTLING = _index("time_to_settle", "time to settle")

#: All indices, in the order of the columns of a study; e is y - y_d with the true control point,
#: efforts are of the applied signal. A run lacks an index if its system has no ports for it, or if
#: its value is never reached.
INDICES: tuple[Index, ...] = (
    _index("l2_effort", "L2 effort", is_metric=True),
    _index("rms_effort", "RMS effort", is_metric=True),
    _index("peak_command", "peak command", is_metric=True),
    _index("saturated_fraction", "share of saturated steps", is_metric=True),
    _index("total_variation", "total variation", is_metric=True),
    _index("final_error", "final error", is_metric=True),
    _index("time_to_reach", "time to reach"),
    _SETTLING,
    _index("late_error", "largest late error"),
    _index("estimate_error", "error of the estimated velocity"),
    _index("theta_hat_half", "estimate at half time", r"\hat{\theta}"),
    _index("theta_hat_end", "estimate at the end", r"\hat{\theta}"),
    _index("largest_speed", "largest speed"),
    _index("largest_drift", "largest drift"),
)


def metrics() -> tuple[Index, ...]:
    """Return the indices in metrics.json."""
    return tuple(index for index in INDICES if index.is_metric)


def index_columns(
    loops: Sequence[Loop] = (STANDARD,), own: Sequence[Index] = ()
) -> tuple[str, ...]:
    """Return the columns of all indices in a study, the user's own last.

    With several vehicles, they begin with the vehicle's name.
    """
    of_each = (
        f"{prefix}{column}"
        for _, prefix in prefixed(loops)
        for index in (*INDICES, *own)
        for column in index.columns
    )
    return (*of_each, *([SMALLEST_DISTANCE] if len(loops) > 1 else []))


def index_units(index: Index, loops: Sequence[Loop] = (STANDARD,)) -> dict[str, str]:
    """Return the units of the columns of an index, and of its name if all have the same unit."""
    units = dict(zip(index.columns, index.units.values(), strict=True))
    if len({*units.values()}) == 1:
        units[index.name] = index.unit
    return {
        f"{prefix}{name}": unit for _, prefix in prefixed(loops) for name, unit in units.items()
    }


def prefixed(loops: Sequence[Loop]) -> Iterator[tuple[Loop, str]]:
    """Yield loops with the prefixes of their columns: with several, the vehicle's name."""
    for loop in loops:
        yield loop, f"{loop.name}." if len(loops) > 1 else ""


# The user's functions

#: The value of a user's function of a result.
Numbers = float | list[float] | dict[str, float]


def numbers_of(name: str, value: object) -> Numbers:
    """Return the value of a user's function as floats.

    Raises:
        InputError: it is not a number, and not a list or dictionary of numbers.

    """
    try:
        if isinstance(value, Mapping):
            return {str(member): float(number) for member, number in value.items()}
        number: Any = value
        return [float(each) for each in number] if np.ndim(number) else float(number)
    except (TypeError, ValueError):
        raise InputError(
            f"index {name}: returned {shortened(repr(value))}; return a number, or a list or "
            "dictionary of numbers"
        ) from None


def columns_of(name: str, numbers: Numbers) -> dict[str, float]:
    """Return the numbers of a user's function by their columns in a study."""
    if isinstance(numbers, dict):
        return {f"{name}.{member}": number for member, number in numbers.items()}
    if isinstance(numbers, list):
        return {f"{name}[{place}]": number for place, number in enumerate(numbers, 1)}
    return {name: numbers}


# Distances between vehicles


def size(vectors: np.ndarray) -> np.ndarray:
    """Return the Euclidean norm of each row, summed in the order of its members."""
    squares = np.zeros(len(vectors))
    for column in vectors.T:
        squares = squares + column * column
    norm: np.ndarray = np.sqrt(squares)
    return norm


def for_distances(loops: Sequence[Loop]) -> Needs:
    """Return what distances between vehicles are computed from."""
    return [column for loop in loops for column in loop.position], ()


def distances(table: Table, loops: Sequence[Loop]) -> dict[tuple[str, str], np.ndarray]:
    """Return the distance of the centres of mass of each two vehicles, by name, per row [m]."""
    return {
        (first.name, second.name): size(
            table.group(*first.position) - table.group(*second.position)
        )
        for first, second in combinations(loops, 2)
    }


def smallest_distances(table: Table, loops: Sequence[Loop]) -> np.ndarray:
    """Return the distance between the two closest vehicles, per row [m]."""
    positions = np.stack([table.group(*loop.position) for loop in loops], axis=1)
    rows = max(1, _AT_ONCE // positions.shape[1])
    blocks = np.split(positions, range(rows, len(positions), rows))
    return np.concatenate([_smallest(block) for block in blocks])


def _smallest(positions: np.ndarray) -> np.ndarray:
    """Return the smallest distance of each row [m], for positions (rows, vehicles, 3) [m]."""
    squares = np.full(len(positions), np.inf)
    for i in range(1, positions.shape[1]):
        apart = positions[:, i:] - positions[:, :-i]
        squares = np.minimum(squares, (apart**2).sum(axis=2).min(axis=1, initial=np.inf))
    smallest: np.ndarray = np.sqrt(squares)
    return smallest


# Observers


class Indices:
    """An observer that computes the indices for which a run has columns and parameters."""

    def __init__(
        self,
        loops: Sequence[Loop] = (STANDARD,),
        chosen: Sequence[Index] | None = None,
        own: Sequence[Index] = (),
    ) -> None:
        """Choose among :data:`INDICES`, by default all, and add the user's own."""
        self._loops, self._chosen = loops, (*(INDICES if chosen is None else chosen), *own)

    def begin(self, header: Header) -> None:
        """Select the indices that the run allows."""
        self._header, self._end = header, header.experiment.start_time
        self._failure: str | None = None
        self._reductions = reductions_of(
            dict.fromkeys(index.reducer for index in self._chosen), self._loops, header
        )
        none = Table.of(header, np.empty((0, 1 + len(header.columns))))
        has_distances = len(self._loops) > 1 and not none.missing(*for_distances(self._loops))
        #: Indices of several vehicles together.
        self.together = {SMALLEST_DISTANCE: inf} if has_distances else {}

    def take(self, rows: np.ndarray) -> None:
        """Process rows."""
        for reductions in self._reductions.values():
            for reduction in reductions.values():
                reduction.take(rows)
        for name, before in self.together.items():
            apart = smallest_distances(Table.of(self._header, rows), self._loops)
            self.together[name] = min(before, float(apart.min()))
        self._end = float(rows[-1, 0])

    def end(self, ending: Ending) -> None:
        """Keep the failure of the run, if any."""
        self._failure = ending.failure

    def found(self, loop: Loop = STANDARD) -> dict[str, list[float]]:
        """Return the members of the indices of a loop, by the names of the indices."""
        results = {
            reducer: reduction.found() for reducer, reduction in self._reductions[loop].items()
        }
        return {
            index.name: results[index.reducer][index.name]
            for index in self._chosen
            if index.name in results.get(index.reducer, ())
        }

    @property
    def failures(self) -> list[str]:
        """Messages of the indices that have raised an exception."""
        every = (
            reduction
            for reductions in self._reductions.values()
            for reduction in reductions.values()
        )
        return [reduction.failure for reduction in every if reduction.failure]

    def values(self) -> dict[str, float]:
        """Return the numbers of all loops, by their columns in a study."""
        return self.together | {
            f"{prefix}{column}": value
            for loop, prefix in prefixed(self._loops)
            for numbers in [self.found(loop)]
            for index in self._chosen
            if index.name in numbers
            for column, value in zip(index.columns, numbers[index.name], strict=True)
        }


class Metrics(Indices):
    """An observer that computes the content of metrics.json, and the verdict on a run."""

    def __init__(self, loops: Sequence[Loop] = (STANDARD,)) -> None:
        """Take the loops of the vehicles."""
        super().__init__(loops, (*metrics(), _SETTLING))

    def content(self, scenario: str, system: System) -> dict[str, Any]:
        """Return the content of metrics.json; indices of several vehicles are under their names."""
        experiment = self._header.experiment
        content: dict[str, Any] = {
            "scenario": scenario,
            "stop_time": self._end,
            "step": experiment.step,
            "order": experiment.order,
            "parameters": dict(_differing(system, self._header.parameters)),
        }
        if self._failure is not None:
            content["failure"] = self._failure
        vehicles = {loop.name: self._vehicle(loop, system) for loop in self._loops}
        if len(vehicles) == 1:
            return content | next(iter(vehicles.values()))
        return content | self.together | {VEHICLES: vehicles}

    def verdict(self) -> str:
        """Return the verdict on the run in a line; empty if it has not followed a reference."""
        found = [self.found(loop) for loop in self._loops]
        return verdict(found, ACTUATORS, self.together.get(SMALLEST_DISTANCE, nan))

    def _vehicle(self, loop: Loop, system: System) -> dict[str, Any]:
        numbers = self.found(loop)
        content: dict[str, Any] = {
            index.name: numbers[index.name] if len(index.units) > 1 else numbers[index.name][0]
            for index in metrics()
            if index.name in numbers
        }
        if loop.controller in system.components:
            reaching = velocities_reaching(system, loop)
            content["velocities_reaching_controller"] = reaching
        return content


def of_vehicles(content: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the indices in metrics.json by the vehicle's name, which is empty for a single one."""
    return dict(content.get(VEHICLES, {"": content}))


def metrics_of(table: Table, loops: Sequence[Loop] = (STANDARD,)) -> Metrics:
    """Return the metrics of a finished run."""
    result = Metrics(loops)
    result.begin(table.header)
    result.take(table.rows)
    result.end(table.ending)
    return result


def _differing(system: System, held: Mapping[PortName, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the parameters that differ from their FMU's defaults, as users write them."""
    for name, value in {**held, **system.parameters}.items():
        component = system.component(name.component)
        variable = component.variable(name.port)
        shown, own = (variable.shown(raw) for raw in (value, component.start(name.port)))
        if shown != own:
            yield str(name), shown
