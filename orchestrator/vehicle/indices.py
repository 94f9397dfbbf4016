"""Indices of a run, (59) and others: each is declared once, in :data:`INDICES`.

The table serves metrics.json, the terminal, the report, the columns of a study and the labels of
its figures. What an index is of, it gets in blocks of rows while the run goes on; sums go on row by
row, so that they do not depend on the blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import inf
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import POSITION, TAU, THETA, Members, member_name
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import named
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.reducers import (
    BEFORE,
    LAST_SECONDS,
    SMALLEST_DISTANCE,
    Fold,
    LargestOfTheEnd,
    LoopRows,
    first,
    for_distances,
    largest,
    last,
    size,
    smallest_distances,
    total,
)
from orchestrator.vehicle.signals import STANDARD, Loop, Needs

#: An error of tracking that counts as having reached the reference [m].
REACHED = 1.0

#: Where metrics.json has the indices of each of several vehicles.
VEHICLES = "vehicles"


class Index(NamedTuple):
    """An index: what it is called, what it is of, and what makes it.

    Attributes:
        name: in files; `name.member` in the columns of a study.
        label: in figures and tables.
        units: of its members; a single number is a member without a name.
        meaning: what the reference page says.
        needs: what a run must have.
        reducer: takes rows in, for what it is a function of.
        accumulated: where the batch engine has the same; empty: it makes it of the rows.
        result: that function, also of the number of terms and of the length of the run [s].
        symbol: in formulas, with its members as indices, before the label.
        is_metric: whether metrics.json holds it, or a study only.

    """

    name: str
    label: str
    units: Members
    meaning: str
    needs: Callable[[Loop], Needs]
    reducer: Callable[[], Fold | LargestOfTheEnd]
    accumulated: str = ""
    result: Callable[[np.ndarray, int, float], Any] = lambda found, n, length: found
    symbol: str = ""
    is_metric: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its numbers in the table of a study."""
        return tuple(member_name(self.name, m) if m != "" else self.name for m in self.units)

    def members_of(self, found: np.ndarray, n: int, length: float) -> list[float]:
        """The values of its members, from what its terms come to."""
        values: list[float] = np.atleast_1d(self.result(found, n, length)).tolist()
        return values

    @property
    def members(self) -> str:
        """Its members, with commas between them; empty: it is a single number."""
        return ", ".join(map(str, self.units))

    @property
    def unit(self) -> str:
        """The units of its members, each once, with commas between them."""
        return ", ".join(filter(None, dict.fromkeys(self.units.values())))


def _root_mean(squares: np.ndarray, n: int, length: float) -> np.ndarray:
    # One after the other, as the equations add.
    x, y, z = squares
    mean: np.ndarray = np.sqrt((x + y + z) / n)
    return mean


def _actuation(loop: Loop) -> Needs:
    return loop.applied, ()


#: Two indices are made of it.
_ENERGY = partial(Fold, LoopRows.energy, total)

#: Units of its root.
_EFFORT = {member: f"{unit}.s^1/2" for member, unit in TAU.items()}

#: All indices, in the order of the columns of a study; e is y - y_d with the true control point,
#: efforts are of the applied signal. What a system has no ports for, and what is never reached, is
#: not there.
INDICES: tuple[Index, ...] = (
    Index(
        "l2_effort",
        "L2 effort",
        _EFFORT,
        "root of the integral of the square of the applied signal, the quantity that the "
        "paper prints (reading 6)",
        _actuation,
        _ENERGY,
        "square",
        lambda found, n, length: np.sqrt(found),
        is_metric=True,
    ),
    Index(
        "rms_effort",
        "RMS effort",
        TAU,
        "root mean square of the applied signal (59)",
        _actuation,
        _ENERGY,
        "square",
        lambda found, n, length: np.sqrt(found / length),
        is_metric=True,
    ),
    Index(
        "peak_command",
        "peak command",
        TAU,
        "largest absolute value of the commanded signal",
        Loop.for_commands,
        partial(Fold, lambda rows: np.abs(rows.acting(*rows.loop.commanded)), largest),
        "peak",
        is_metric=True,
    ),
    Index(
        "saturated_fraction",
        "share of saturated steps",
        dict.fromkeys(TAU, ""),
        "share of the steps whose command is outside the limits",
        lambda loop: (loop.commanded, loop.limits),
        partial(Fold, LoopRows.outside, total),
        "outside",
        lambda found, n, length: found / n,
        is_metric=True,
    ),
    Index(
        "total_variation",
        "total variation",
        TAU,
        "sum of the absolute differences of the applied signal from step to step",
        _actuation,
        partial(Fold, LoopRows.change, total),
        "variation",
        is_metric=True,
    ),
    Index(
        "final_error",
        "final error",
        POSITION,
        f"e_f: largest absolute value of e in the last {LAST_SECONDS:g} s",
        Loop.for_tracking,
        LargestOfTheEnd,
        "final",
        is_metric=True,
    ),
    Index(
        "time_to_reach",
        "time to reach",
        {"": "s"},
        f"time from the start of the run until |e| is at most {REACHED:g} m",
        Loop.for_tracking,
        partial(Fold, lambda rows: rows.elapsed[rows.distance <= REACHED], first),
        "reached",
    ),
    Index(
        "late_error",
        "largest late error",
        {"": "m"},
        "largest |e| in the second half of the run",
        Loop.for_tracking,
        partial(Fold, LoopRows.late_distance, largest),
        "late",
    ),
    Index(
        "estimate_error",
        "error of the estimated velocity",
        {"": "m/s"},
        "root mean square of |dy_hat - dy| in the second half, both of the same instant",
        Loop.for_velocity_estimates,
        partial(Fold, LoopRows.miss, total),
        "miss",
        _root_mean,
    ),
    Index(
        "theta_hat_half",
        "estimate at half time",
        THETA,
        "theta_hat halfway through the run",
        Loop.for_parameter_estimates,
        partial(Fold, LoopRows.late_estimates, first),
        "half",
        symbol=r"\hat{\theta}",
    ),
    Index(
        "theta_hat_end",
        "estimate at the end",
        THETA,
        "theta_hat at the end of the run",
        Loop.for_parameter_estimates,
        partial(Fold, lambda rows: rows.acting(*rows.loop.theta_hat), last),
        "end",
        symbol=r"\hat{\theta}",
    ),
    Index(
        "largest_speed",
        "largest speed",
        {"": "m/s"},
        "largest speed of the control point, |dy|",
        lambda loop: (loop.dy, ()),
        partial(Fold, lambda rows: size(rows.at(*rows.loop.dy)), largest),
        "speed",
    ),
    Index(
        "largest_drift",
        "largest drift",
        {"": "m/s"},
        "largest speed of sway and heave, |(v, w)| (Assumption 1)",
        lambda loop: (loop.drift, ()),
        partial(Fold, lambda rows: size(rows.at(*rows.loop.drift)), largest),
        "drift",
    ),
)


def metrics() -> tuple[Index, ...]:
    """The indices that metrics.json holds."""
    return tuple(index for index in INDICES if index.is_metric)


def index_columns(loops: Sequence[Loop] = (STANDARD,)) -> tuple[str, ...]:
    """The columns of all indices in a study; of several loops, after the names of the vehicles."""
    of_each = (
        f"{prefix}{column}"
        for _, prefix in _prefixed(loops)
        for index in INDICES
        for column in index.columns
    )
    return (*of_each, *([SMALLEST_DISTANCE] if len(loops) > 1 else []))


def _prefixed(loops: Sequence[Loop]) -> Iterator[tuple[Loop, str]]:
    for loop in loops:
        yield loop, f"{loop.name}." if len(loops) > 1 else ""


class Indices:
    """An observer that computes the indices there are columns for; it keeps the last seconds."""

    def __init__(
        self, loops: Sequence[Loop] = (STANDARD,), chosen: Sequence[Index] | None = None
    ) -> None:
        """Take what is measured.

        Args:
            loops: of the vehicles.
            chosen: out of :data:`INDICES`; None: all.

        """
        self._loops, self._chosen = loops, INDICES if chosen is None else chosen

    def begin(self, header: Header) -> None:
        """Find out which indices there will be."""
        self._header, self._end, self._n = header, header.experiment.start_time, 0
        self._failure: str | None = None
        self._last = np.empty((0, 1 + len(header.columns)))
        none = Table.of(header, self._last)
        self._measured = {
            loop: [index for index in self._chosen if not none.missing(*index.needs(loop))]
            for loop in self._loops
        }
        has_distances = len(self._loops) > 1 and not none.missing(*for_distances(self._loops))
        #: What there is of several vehicles together.
        self.together = {SMALLEST_DISTANCE: inf} if has_distances else {}
        # Those that are made of the same share it.
        self._reducers = {
            loop: {index.reducer: index.reducer() for index in found}
            for loop, found in self._measured.items()
        }

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account."""
        table = Table.of(self._header, np.vstack((self._last, rows)))
        for loop, reducers in self._reducers.items():
            seen = LoopRows(loop, self._n, table, len(self._last))
            for reducer in reducers.values():
                reducer.take(seen)
        for name, before in self.together.items():
            apart = smallest_distances(Table.of(self._header, rows), self._loops)
            self.together[name] = min(before, float(apart.min()))
        self._last, self._end = table.rows[-BEFORE:].copy(), float(rows[-1, 0])
        self._n += len(rows)

    def end(self, ending: Ending) -> None:
        """Remember how the run has ended."""
        self._failure = ending.failure

    @np.errstate(all="ignore")
    def found(self, loop: Loop = STANDARD) -> dict[str, list[float]]:
        """The members of the indices of a loop, by their names."""
        length = self._end - self._header.experiment.start_time
        return {
            index.name: index.members_of(reducer.found(self._end), reducer.n, length)
            for index in self._measured[loop]
            if (reducer := self._reducers[loop][index.reducer]).n
        }

    def values(self) -> dict[str, float]:
        """The numbers of all loops, by their columns in a study."""
        return self.together | {
            f"{prefix}{column}": value
            for loop, prefix in _prefixed(self._loops)
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
        shown, own = (named(variable, one) for one in (value, component.start(name.port)))
        if shown != own:
            yield str(name), shown
