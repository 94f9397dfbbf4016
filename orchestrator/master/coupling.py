"""How components are coupled: at the start, in every step, and when a delay lets values grow."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from orchestrator.machine.errors import InputError, StartError
from orchestrator.master.experiment import (
    DELAY,
    GAUSS_SEIDEL,
    LINEAR,
    OURS,
    SOLVE,
    Exchange,
)
from orchestrator.master.fmi.instance import Instance
from orchestrator.master.fmi.log import Log
from orchestrator.master.gathering import Gathering
from orchestrator.master.linear import LinearSteps
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.plan import Plan, delays, stages
from orchestrator.master.ring import Ring
from orchestrator.master.row import Row
from orchestrator.master.schedule import Stage, StageCall, schedule
from orchestrator.master.settling import Settling
from orchestrator.system.graph import has_feedthrough, rings
from orchestrator.system.names import PortName

#: A value grows without bound if it doubles at least so often in each of so many intervals, one
#: after the other, and so often in all of them together. What grows with a power of time does not.
_INTERVALS, _DOUBLINGS, _IN_ALL = 8, 1.0, 24.0

#: Lengths of these intervals, in steps.
_LENGTHS = tuple(2**i for i in range(9))


class Growth:
    """An observer that ends a run in which values of delayed rings grow without bound."""

    def __init__(self, ports: Collection[PortName]) -> None:
        """Watch some ports."""
        self._names = list(map(str, ports))
        self._columns: list[int] = []
        self._rows = 0
        self._last = {length: np.empty((0, len(self._names))) for length in _LENGTHS}

    def begin(self, header: Header) -> None:
        """Find the ports."""
        places = {name: i for i, name in enumerate(header.columns, start=1)}
        self._columns = [places[name] for name in self._names]

    def take(self, rows: np.ndarray) -> None:
        """Look at some rows.

        Raises:
            InputError: a value grows without bound.

        """
        sizes = np.log2(np.abs(rows[:, self._columns]))
        # From zero, everything is infinitely far.
        sizes[np.isinf(sizes)] = np.nan
        for length in _LENGTHS:
            new = sizes[-self._rows % length :: length]
            known = np.concatenate([self._last[length], new])
            self._last[length] = known[-_INTERVALS - 1 :]
            if len(new) and len(known) > _INTERVALS:
                doublings = sliding_window_view(np.diff(known, axis=0), _INTERVALS, axis=0)
                grows = doublings.min(axis=-1) >= _DOUBLINGS
                grows &= doublings.sum(axis=-1) >= _IN_ALL
                if found := np.flatnonzero(grows.any(axis=0)).tolist():
                    raise InputError(
                        f"{self._names[found[0]]} grows without bound, in a ring of direct "
                        "feedthroughs that is delayed by a step; --coupling solve, if its FMUs "
                        "allow it, or another --order may help"
                    )
        self._rows += len(rows)

    def end(self, ending: Ending) -> None:
        """Nothing is kept."""


class Coupling:
    """The rings of direct feedthroughs of a system, and what follows from them.

    Attributes:
        sequence: all components in stages, once they are initialised.

    """

    def __init__(
        self,
        plan: Plan,
        instances: Mapping[str, Instance],
        row: Row,
        log: Log,
        exchange: Exchange = OURS,
    ) -> None:
        """Find the rings.

        Args:
            plan: what is run, and how rings are closed.
            instances: of its components.
            row: that they are tied to.
            log: takes where a ring is delayed.
            exchange: of values.

        """
        self._plan, self._exchange = plan, exchange
        self._system, self._experiment = plan.system, plan.experiment
        self._instances, self._row, self._log = instances, row, log
        self._rings = [self._ring(names) for names in rings(plan.system)]
        self._solved: list[Ring] = []
        self.sequence: list[list[str]] = []

    def initialise(self) -> None:
        """Set parameters, exchange values in initialisation mode until they rest, leave that mode.

        Raises:
            InputError: the values do not come to rest, an FMU refused a value, or a ring is to be
                solved that cannot be.
            StartError: a value is not finite.

        """
        system, instances, start = self._system, self._instances, self._experiment.start_time
        for name, instance in instances.items():
            instance.enter_initialization(system.parameters_of(name), start)
            held = instance.read(system.open_inputs(name))
            self._row.enter({PortName(name, port): value for port, value in held.items()})
        settling = self._settling(self._rings)
        if self._exchange.at_start:
            settling.begin()
            self._check_finite()
        for instance in instances.values():
            instance.exit_initialization()
        self._solved = self._solvable()
        self.sequence = self._in_stages(self._experiment.order, self._solved)
        if self._rings:
            settling = self._settling(self._solved)
        if self._exchange.at_start:
            settling.hand_on(everything=True)
        else:
            self._read_outputs()
        self._check_finite()
        if self._log.refusals:
            raise InputError("; ".join(self._log.refusals))

    def schedule(self) -> tuple[list[Stage], list[Gathering]]:
        """The stages of every step, and all that is gathered in one."""
        system, instances, row = self._system, self._instances, self._row
        if self._experiment.coupling == LINEAR:
            settling = self._settling(self._solved)
            steps = LinearSteps(system, instances, row, settling)
            stage = Stage(Gathering.along(row, ()), [StageCall(steps.step).member])
            return [stage], settling.gatherings
        found = schedule(
            self._plan,
            self.sequence,
            instances,
            row,
            self._solved,
            latest=self._exchange.latest,
        )
        own = [gather for ring in self._solved for gather in ring.gatherings]
        return found, [stage.gather for stage in found] + own

    def delayed_ports(self) -> list[PortName]:
        """The inputs that a ring feeds by itself, of rings that are not solved as a whole."""
        solved = [set(ring.names) for ring in self._solved]
        left = [ring.names for ring in self._rings if set(ring.names) not in solved]
        ring_of = {name: i for i, names in enumerate(left) for name in names}
        return [
            connection.target
            for connection in self._system.connections
            if connection.source.component in ring_of
            and ring_of[connection.source.component] == ring_of.get(connection.target.component)
            and has_feedthrough(self._system, connection)
        ]

    def _solvable(self) -> list[Ring]:
        """The rings that are solved in every step."""
        system, coupling = self._system, self._experiment.coupling
        if coupling == LINEAR:
            # Where outputs are computed in steps only, the second one has them right.
            return self._rings
        reasons: dict[str, str] = {}
        if coupling == DELAY or self._exchange.latest:
            reasons = dict.fromkeys(system.components, "")
        else:
            for ring in self._rings:
                reasons |= ring.unsolved()
            for name, n in self._plan.decimations.items():
                if n > 1:
                    reasons[name] = f"{name} takes longer steps"
        solved = rings(system, system.components.keys() - reasons.keys())
        if coupling == SOLVE:
            for delay in delays(system, GAUSS_SEIDEL, solved, reasons):
                raise InputError(f"coupling solve: {delay}")
        for delay in delays(system, self._experiment.order, solved, reasons):
            self._log.remark(delay)
        return [self._ring(names) for names in solved]

    def _ring(self, names: Sequence[str]) -> Ring:
        return Ring(names, self._system, self._instances, self._row)

    def _in_stages(self, order: str | Sequence[str], solved: Sequence[Ring]) -> list[list[str]]:
        if self._exchange.latest and not isinstance(order, str):
            return [[name] for name in order]
        return stages(self._system, order, [ring.names for ring in solved])

    def _settling(self, solved: Sequence[Ring]) -> Settling:
        sequence = self._in_stages(GAUSS_SEIDEL, solved)
        return Settling(self._system, self._instances, self._row, sequence, solved)

    def _read_outputs(self) -> None:
        """Enter what components show whose inputs have not been set."""
        for name, instance in self._instances.items():
            outputs = self._system.components[name].having("output")
            ports = [PortName(name, variable.name) for variable in outputs]
            held = instance.read([port.port for port in ports if port in self._row.columns])
            self._row.enter({PortName(name, port): value for port, value in held.items()})

    def _check_finite(self) -> None:
        if wrong := self._row.wrong(self._instances):
            raise StartError(f"stopped at t = {self._experiment.start_time:g} s: {wrong}")
