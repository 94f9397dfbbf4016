"""The coupling of components, at the start and in every step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from ctypes import c_double
from dataclasses import replace

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import (
    DELAY,
    FEEDTHROUGH,
    FULL,
    GAUSS_SEIDEL,
    JACOBI,
    LINEAR,
    NONE,
    OURS,
    SOLVE,
    Exchange,
    Order,
)
from orchestrator.cosim.fmi.instance import ComponentFailed, Instance, Log
from orchestrator.cosim.plan import Plan
from orchestrator.cosim.ring import Ring, why_not_following
from orchestrator.cosim.row import Gathering, Row
from orchestrator.cosim.stages import (
    Arrangement,
    LinkedStage,
    StageCall,
    Stages,
    arrange,
    link_stages,
    member,
    step_members,
)
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError, StartError, shortened

#: Limit of the rounds in which values go along all connections until they rest.
_MOST_ROUNDS = 1000


class _Single:
    """A component outside all rings: see :class:`.ring.Ring`."""

    def __init__(self, system: System, instance: Instance, row: Row) -> None:
        self.names = [instance.name]
        self._instance, self._row = instance, row
        self._gather = Gathering.along(row, system.feeding[instance.name])
        self.gatherings = [self._gather]

    def renew(self, always: bool = False) -> bool:
        values, targets = self._row.values, self._gather.targets
        before = values[targets]
        self._gather(values)
        if not always and before.tobytes() == values[targets].tobytes():
            return False
        self._instance.exchange()
        self._row.show(self._instance.name)
        return True


class _Settling:
    """Exchange of values along all connections at one time, until every input has what feeds it."""

    def __init__(self, units: Sequence[Ring | _Single], row: Row) -> None:
        """Take rings and single components, in the order of direct feedthroughs."""
        self._units, self._row = units, row

    @property
    def gatherings(self) -> list[Gathering]:
        """Everything that is gathered."""
        return [gather for unit in self._units for gather in unit.gatherings]

    @property
    def places(self) -> dict[str, int]:
        """Place of each component in that order."""
        return {name: i for i, unit in enumerate(self._units) for name in unit.names}

    def settle(self) -> None:
        """Exchange values until they rest.

        Raises:
            ComponentFailed: the values do not come to rest, or a component fails.

        """
        for _ in range(_MOST_ROUNDS):
            before = self._row.values.copy()
            if not self.hand_on():
                return
        if restless := self._row.moving(before):
            raise ComponentFailed(
                "an algebraic loop does not converge: the values that still change are "
                f"{shortened(', '.join(map(str, restless)))}"
            )

    def hand_on(self, everything: bool = False) -> bool:
        """Exchange values along all connections once, and return True if any input has changed.

        Args:
            everything: if set, also step components whose inputs have not changed.

        """
        changed = [unit.renew(everything) for unit in self._units]
        return any(changed)


class _LinearSteps:
    """Steps in which inputs change linearly from one communication point to the next.

    Every step is made twice. The first time all inputs are held, which gives their values at its
    end; then the components go back to its beginning, and make it with inputs that change to these
    values. The error of coupled values falls with the square of the step, with held inputs only
    with the step.
    """

    def __init__(
        self, system: System, instances: Mapping[str, Instance], row: Row, settling: _Settling
    ) -> None:
        self._values, self._settling = row.values, settling
        self._all = [member(instance) for instance in instances.values()]
        self._fed = [instance for name, instance in instances.items() if system.feeding[name]]
        self._again = [member(instance) for instance in self._fed]
        self._inputs = [
            row.columns[PortName(instance.name, variable.name)]
            for instance in self._fed
            for variable in system.components[instance.name].having("input")
        ]
        #: References and columns of the changing inputs of each component.
        self._changing: list[tuple[list[int], list[int]]] = []
        for instance in self._fed:
            component = system.components[instance.name]
            targets = [
                connection.target
                for connection in system.feeding[instance.name]
                if component.is_continuous(connection.target.port)
            ]
            references = [component.variables[target.port].reference for target in targets]
            self._changing.append((references, [row.columns[target] for target in targets]))

    def step(self, t: float, h: float) -> None:
        values = self._values
        self._settling.settle()
        begin = values.copy()
        for instance in self._fed:
            instance.keep()
        step_members(self._all, c_double(t), c_double(h), is_final=False)
        self._settling.settle()
        slopes = (values - begin) / h
        values[self._inputs] = begin[self._inputs]
        for instance, (references, columns) in zip(self._fed, self._changing, strict=True):
            instance.go_back()
            instance.let_change(references, slopes[columns].tolist())
        step_members(self._again, c_double(t), c_double(h))
        for instance, (references, _) in zip(self._fed, self._changing, strict=True):
            instance.let_change(references, [0.0] * len(references))
        self._settling.settle()


class Coupling:
    """The rings of direct feedthroughs of a system, and the stages that follow from them.

    Attributes:
        plan: of the run; after initialisation, with the order that the run takes.

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
            plan: the system, and the way in which rings are closed.
            instances: of its components.
            row: that they are tied to.
            log: receives a remark for each ring that is delayed.
            exchange: of values.

        """
        self.plan, self._exchange = plan, exchange
        self._system, self._experiment = plan.system, plan.experiment
        self._instances, self._row, self._log = instances, row, log
        self._rings = self._made(plan.rings)
        self._solved: list[Ring] = []

    def initialise(self) -> None:
        """Set parameters, then exchange values in initialisation mode until they rest.

        Raises:
            InputError: the values do not come to rest, an FMU refuses a value, a ring cannot be
                solved that has to be, or the order is not possible.
            StartError: a value is not finite.

        """
        system, instances, start = self._system, self._instances, self._experiment.start_time
        for name, instance in instances.items():
            instance.enter_initialization(system.parameters_of(name), start)
            self._enter(name, system.open_inputs(name))
        if self._exchange.initial == FULL:
            settling = self._settling(self.plan.arrangement, self._rings)
            self._read_ahead(settling.places)
            settling.hand_on(everything=True)
            settling.settle()
            self._check_finite()
        for instance in instances.values():
            instance.exit_initialization()
        order = self._order_taken()
        experiment, arrangement = replace(self._experiment, order=order), self._arranged(order)
        self.plan = replace(self.plan, experiment=experiment, arrangement=arrangement)
        self._solved = self._made(arrangement.solved)
        if self._exchange.initial == FULL:
            self._settling(arrangement, self._solved).hand_on(everything=True)
        elif self._exchange.initial == NONE:
            for name in instances:
                self._enter(name, [port.name for port in system.components[name].having("output")])
        self._check_finite()
        if self._log.refusals:
            raise InputError("; ".join(self._log.refusals))

    def stages(self) -> tuple[Stages[LinkedStage], list[Gathering]]:
        """Return the stages of every step, and everything that they gather."""
        system, instances, row = self._system, self._instances, self._row
        if self._experiment.coupling == LINEAR:
            settling = self._settling(self.plan.arrangement, self._solved)
            steps = _LinearSteps(system, instances, row, settling)
            stage = LinkedStage(Gathering.along(row, ()), [StageCall(steps.step).member])
            return Stages([stage]), settling.gatherings
        by_names = self.plan.stages(latest=bool(self._exchange.groups))
        stages = link_stages(by_names, system, instances, row, self._solved)
        gatherings = [stage.gather for stage in (*(stages.passing or ()), *stages.stepping)]
        own = [gather for ring in self._solved for gather in ring.gatherings]
        return stages, gatherings + own

    def _order_taken(self) -> Order:
        """Return the order that is asked for, or else the best one that the FMUs allow.

        Raises:
            InputError: values cannot pass through an FMU, and the order is stated.

        """
        order = self._experiment.order
        if order not in (None, FEEDTHROUGH):
            return order
        if self._experiment.coupling == LINEAR:
            return GAUSS_SEIDEL
        tried: set[str] = set()
        for connection in self._system.connections:
            component = self._system.components[connection.source.component]
            # Our FMUs do what they declare, even where no output happens to follow, as in a calm
            # sea.
            if component.is_ours or component.digest in tried:
                continue
            if not self._system.has_feedthrough(connection):
                continue
            tried.add(component.digest)
            if why := why_not_following(component, self._instances[component.name], self._row):
                if order is None:
                    return GAUSS_SEIDEL
                raise InputError(f"order {FEEDTHROUGH}: {why}; --order {GAUSS_SEIDEL} runs it")
        return FEEDTHROUGH

    def _arranged(self, order: Order) -> Arrangement:
        """Arrange the components in an order, and find the rings that every step solves.

        Raises:
            InputError: a ring cannot be solved that has to be.

        """
        system, coupling = self._system, self._experiment.coupling
        if coupling == LINEAR:
            # Outputs that are computed only in steps are right after the second one.
            return arrange(system, order, self.plan.rings)
        reasons: dict[str, str] = {}
        if coupling == DELAY or self._exchange.groups:
            reasons = dict.fromkeys(system.components, "")
        else:
            for ring in self._rings:
                reasons |= ring.unsolved()
            for name, n in self.plan.decimations.items():
                if n > 1:
                    reasons[name] = f"{name} takes longer steps"
        solved = system.rings(system.components.keys() - reasons.keys())
        arrangement = arrange(system, order, solved)
        delays = arrangement.delays(reasons)
        if delays and coupling == SOLVE:
            raise InputError(f"coupling solve: {delays[0]}")
        if isinstance(order, str):
            for delay in delays if order != JACOBI else ():
                self._log.remark(delay)
        elif self._exchange.groups:
            return arrangement._replace(stages=self._exchange.groups)
        return arrangement

    def _made(self, rings: Sequence[Sequence[str]]) -> list[Ring]:
        return [Ring(names, self._system, self._instances, self._row) for names in rings]

    def _settling(self, arrangement: Arrangement, solved: Sequence[Ring]) -> _Settling:
        ring_of = {ring.names[0]: ring for ring in solved}
        units: list[Ring | _Single] = []
        for stage in arrangement.settling:
            units += [ring_of[name] for name in stage if name in ring_of] or [
                _Single(self._system, self._instances[name], self._row) for name in stage
            ]
        return _Settling(units, self._row)

    def _read_ahead(self, places: Mapping[str, int]) -> None:
        """Read outputs that feed a component which is initialised before their own."""
        outputs: dict[str, dict[str, None]] = {}
        for connection in self._system.connections:
            source, target = connection.source, connection.target
            if places[source.component] >= places[target.component]:
                outputs.setdefault(source.component, {})[source.port] = None
        for name, ports in outputs.items():
            self._enter(name, list(ports))

    def _enter(self, name: str, ports: Sequence[str]) -> None:
        """Enter values that an FMU holds into the row."""
        held = self._instances[name].read(ports)
        self._row.enter({PortName(name, port): value for port, value in held.items()})

    def _check_finite(self) -> None:
        if wrong := self._row.wrong(self._instances):
            raise StartError(f"stopped at t = {self._experiment.start_time:g} s: {wrong}")
