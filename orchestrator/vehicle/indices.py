"""Indices of a run, (59) and others: each is declared once, in :data:`INDICES`.

The table serves metrics.json, the terminal, the report, the columns of a study and the labels of
its figures. What an index is, its module in :mod:`.index` says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import member_of
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer, read_reducer
from orchestrator.cosim import Ending, Header, PortName, System, Table
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.distances import (
    SMALLEST_DISTANCE,
    for_distances,
    smallest_distances,
)
from orchestrator.vehicle.index import (
    effort,
    estimate_error,
    final_error,
    largest_drift,
    largest_speed,
    parameter_estimates,
    peak_command,
    saturated_fraction,
    tracking,
)
from orchestrator.vehicle.reduction import reductions_of
from orchestrator.vehicle.signals import STANDARD, Loop

#: Where metrics.json has the indices of each of several vehicles.
VEHICLES = "vehicles"


class Index(NamedTuple):
    """An index: what it is called, and what makes it.

    Attributes:
        name: in files; `name.member` in the columns of a study.
        label: in figures and tables.
        reducer: that has it among its results.
        symbol: in formulas, with its members as indices, before the label.
        is_metric: whether metrics.json holds it, or a study only.

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
        """What the reference page says."""
        return self.reducer.meanings[self.name]

    @property
    def units(self) -> Mapping[str, str]:
        """Units of its members; a single number is a member without a name."""
        names = ("" if port.name == self.name else member_of(port.name) for port in self._ports)
        units = ("" if port.unit in (None, "1") else port.unit for port in self._ports)
        return dict(zip(names, units, strict=True))

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its numbers in the table of a study."""
        return tuple(port.name for port in self._ports)

    @property
    def members(self) -> str:
        """Its members, with commas between them; empty: it is a single number."""
        return ", ".join(self.units)

    @property
    def unit(self) -> str:
        """The units of its members, each once, with commas between them."""
        return ", ".join(filter(None, dict.fromkeys(self.units.values())))


def _read(*modules: ModuleType) -> dict[str, Reducer]:
    """The reducers of some modules, by the names of their indices."""
    reducers = map(read_reducer, modules)
    return {name: reducer for reducer in reducers for name in reducer.results}


_REDUCERS = _read(
    effort,
    peak_command,
    saturated_fraction,
    final_error,
    tracking,
    estimate_error,
    parameter_estimates,
    largest_speed,
    largest_drift,
)


def _index(name: str, label: str, symbol: str = "", is_metric: bool = False) -> Index:
    return Index(name, label, _REDUCERS[name], symbol, is_metric)


#: All indices, in the order of the columns of a study; e is y - y_d with the true control point,
#: efforts are of the applied signal. What a system has no ports for, and what is never reached, is
#: not there.
INDICES: tuple[Index, ...] = (
    _index("l2_effort", "L2 effort", is_metric=True),
    _index("rms_effort", "RMS effort", is_metric=True),
    _index("peak_command", "peak command", is_metric=True),
    _index("saturated_fraction", "share of saturated steps", is_metric=True),
    _index("total_variation", "total variation", is_metric=True),
    _index("final_error", "final error", is_metric=True),
    _index("time_to_reach", "time to reach"),
    _index("late_error", "largest late error"),
    _index("estimate_error", "error of the estimated velocity"),
    _index("theta_hat_half", "estimate at half time", r"\hat{\theta}"),
    _index("theta_hat_end", "estimate at the end", r"\hat{\theta}"),
    _index("largest_speed", "largest speed"),
    _index("largest_drift", "largest drift"),
)


def metrics() -> tuple[Index, ...]:
    """The indices that metrics.json holds."""
    return tuple(index for index in INDICES if index.is_metric)


def index_columns(
    loops: Sequence[Loop] = (STANDARD,), own: Sequence[Index] = ()
) -> tuple[str, ...]:
    """The columns of all indices in a study; of several loops, after the names of the vehicles.

    Args:
        loops: of the vehicles.
        own: the user's, after the others.

    """
    of_each = (
        f"{prefix}{column}"
        for _, prefix in prefixed(loops)
        for index in (*INDICES, *own)
        for column in index.columns
    )
    return (*of_each, *([SMALLEST_DISTANCE] if len(loops) > 1 else []))


def index_units(index: Index, loops: Sequence[Loop] = (STANDARD,)) -> dict[str, str]:
    """Units of the columns of an index, and of all of it if they have one."""
    units = dict(zip(index.columns, index.units.values(), strict=True))
    if len({*units.values()}) == 1:
        units[index.name] = index.unit
    return {
        f"{prefix}{name}": unit for _, prefix in prefixed(loops) for name, unit in units.items()
    }


def prefixed(loops: Sequence[Loop]) -> Iterator[tuple[Loop, str]]:
    """Loops with what the names of their columns begin with: of several, the vehicle."""
    for loop in loops:
        yield loop, f"{loop.name}." if len(loops) > 1 else ""


class Indices:
    """An observer that computes the indices that a run has columns and parameters for."""

    def __init__(
        self,
        loops: Sequence[Loop] = (STANDARD,),
        chosen: Sequence[Index] | None = None,
        own: Sequence[Index] = (),
    ) -> None:
        """Take what is measured.

        Args:
            loops: of the vehicles.
            chosen: out of :data:`INDICES`; None: all.
            own: indices of the user's own.

        """
        self._loops, self._chosen = loops, (*(INDICES if chosen is None else chosen), *own)

    def begin(self, header: Header) -> None:
        """Find out which indices there will be."""
        self._header, self._end = header, header.experiment.start_time
        self._failure: str | None = None
        self._reductions = reductions_of(
            dict.fromkeys(index.reducer for index in self._chosen), self._loops, header
        )
        none = Table.of(header, np.empty((0, 1 + len(header.columns))))
        has_distances = len(self._loops) > 1 and not none.missing(*for_distances(self._loops))
        #: What there is of several vehicles together.
        self.together = {SMALLEST_DISTANCE: inf} if has_distances else {}

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account."""
        for reductions in self._reductions.values():
            for reduction in reductions.values():
                reduction.take(rows)
        for name, before in self.together.items():
            apart = smallest_distances(Table.of(self._header, rows), self._loops)
            self.together[name] = min(before, float(apart.min()))
        self._end = float(rows[-1, 0])

    def end(self, ending: Ending) -> None:
        """Remember how the run has ended."""
        self._failure = ending.failure

    def found(self, loop: Loop = STANDARD) -> dict[str, list[float]]:
        """The members of the indices of a loop, by their names."""
        of = {reducer: one.found() for reducer, one in self._reductions[loop].items()}
        return {
            index.name: of[index.reducer][index.name]
            for index in self._chosen
            if index.name in of.get(index.reducer, ())
        }

    @property
    def failures(self) -> list[str]:
        """What indices have raised."""
        every = (one for reductions in self._reductions.values() for one in reductions.values())
        return [one.failure for one in every if one.failure]

    def values(self) -> dict[str, float]:
        """The numbers of all loops, by their columns in a study."""
        return self.together | {
            f"{prefix}{column}": value
            for loop, prefix in prefixed(self._loops)
            for found in [self.found(loop)]
            for index in self._chosen
            if index.name in found
            for column, value in zip(index.columns, found[index.name], strict=True)
        }


class Metrics(Indices):
    """An observer that computes what metrics.json holds."""

    def __init__(self, loops: Sequence[Loop] = (STANDARD,)) -> None:
        """Take the loops of the vehicles."""
        super().__init__(loops, metrics())

    def content(self, scenario: str, system: System) -> dict[str, Any]:
        """What metrics.json holds: of several vehicles, the indices of each under its name.

        Args:
            scenario: its name.
            system: that was run.

        """
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
        of = {loop.name: self._of(loop, system) for loop in self._loops}
        if len(of) == 1:
            return content | next(iter(of.values()))
        return content | self.together | {VEHICLES: of}

    def _of(self, loop: Loop, system: System) -> dict[str, Any]:
        found = self.found(loop)
        content: dict[str, Any] = {
            index.name: found[index.name] if len(index.units) > 1 else found[index.name][0]
            for index in self._chosen
            if index.name in found
        }
        if loop.controller in system.components:
            reaching = velocities_reaching(system, loop)
            content["velocities_reaching_controller"] = reaching
        return content


def of_vehicles(content: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The indices that metrics.json holds, by the vehicle's name; of one vehicle, by none."""
    return dict(content.get(VEHICLES, {"": content}))


def metrics_of(table: Table, loops: Sequence[Loop] = (STANDARD,)) -> Metrics:
    """The metrics of a run whose rows are all there."""
    found = Metrics(loops)
    found.begin(table.header)
    found.take(table.rows)
    found.end(table.ending)
    return found


def _differing(system: System, held: Mapping[PortName, Any]) -> Iterator[tuple[str, Any]]:
    """The parameters that are not as their FMU has them, in a user's words."""
    for name, value in {**held, **system.parameters}.items():
        component = system.component(name.component)
        variable = component.variable(name.port)
        shown, own = (variable.shown(one) for one in (value, component.start(name.port)))
        if shown != own:
            yield str(name), shown
