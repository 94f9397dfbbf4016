"""The stages of a communication step, by the names of components and as calls of FMUs.

Loaded FMUs decide which stages a step has: where rings are solved and, for third-party FMUs, where
no order is stated. Inputs are gathered before a stage is stepped; outputs are read after it.

- `feedthrough`: two parts. First values of t_k pass: a component whose outputs have direct
  feedthrough takes its inputs and is read without a step, before those it feeds. The row shows
  them. Then all components are stepped.
- `jacobi`: one stage. All inputs are outputs of t_k.
- `gauss-seidel`: a component whose output has direct feedthrough is stepped in an earlier
  stage than those it feeds, so they receive without delay what follows from t_k. Outputs
  without feedthrough are states: all take them at t_k.
- the names of all components: the same, in this order.

A ring of feedthroughs that is not solved is opened before its first component in the system, which
takes what feeds it at t_k.

In `feedthrough` order values pass first, then all components are stepped. Solved rings are closed
where values come to them.

In other orders such rings have stages of their own. Each is closed three times: before its
components are stepped, with their states of t_k; after that, with their states of t_k+1 and the
latest values that feed it; and when all components have been stepped, so that every row shows its
solution.

A component may span n communication steps in one step. It is stepped at every n-th t_k, with the
inputs of that time. Its results wait in hidden places of the row until their time. Outputs with
direct feedthrough hold from t_k on: they are shown when they pass, or as soon as the component was
stepped, unless the order is `jacobi`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import c_double
from functools import partial
from typing import ClassVar, Generic, Literal, NamedTuple, TypeAlias, TypeVar, get_args

import numpy as np
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.cosim.component import Component
from orchestrator.cosim.connection import Connection, PortName
from orchestrator.cosim.experiment import FEEDTHROUGH, JACOBI, Experiment, Order
from orchestrator.cosim.fmi.instance import (
    DO_STEP,
    GET_OUTPUTS,
    SET_INPUTS,
    CMember,
    CMove,
    DoStepCallback,
    Instance,
    address_of,
)
from orchestrator.cosim.fmi.surroundings import PRODUCT, A, B, C, restore_mode
from orchestrator.cosim.ring import Ring
from orchestrator.cosim.row import Gathering, Row
from orchestrator.cosim.system import System
from orchestrator.machine.errors import shortened

#: A stage by names or as calls.
AnyStage = TypeVar("AnyStage", "Stage", "LinkedStage")

#: Outputs that are read: all; those with direct feedthrough; the others, which are states; or only
#: those states that no call reads together with the former.
Reads: TypeAlias = Literal["all", "direct", "states", "only states"]
READS: tuple[Reads, ...] = get_args(Reads)
ALL, DIRECT, STATES, ONLY_STATES = READS

#: Ways to close a ring: if its components have changed; if they or the values that feed it have
#: changed, which it takes; or always, with the values that feed it.
Closing: TypeAlias = Literal["check", "renew", "renew always"]
CLOSINGS: tuple[Closing, ...] = get_args(Closing)
CHECK, RENEW, RENEW_ALWAYS = CLOSINGS

#: Functions that close a ring.
_CLOSES: Mapping[Closing, Callable[[Ring], object]] = {
    CHECK: Ring.check,
    RENEW: Ring.renew,
    RENEW_ALWAYS: partial(Ring.renew, always=True),
}


class Arrangement(NamedTuple):
    """The order of components, in stages, for known solved rings.

    Attributes:
        order: of the components.
        solved: rings whose components are stepped as one, in stages of their own.
        settling: stages for values of one time: a component with direct feedthrough comes before
            those that it feeds.
        late: connections with direct feedthrough that are a step late in these stages.
        stages: in which components are stepped; components of one stage are independent.

    """

    order: Order
    solved: Sequence[Sequence[str]]
    settling: Sequence[Sequence[str]]
    late: Sequence[Connection]
    stages: Sequence[Sequence[str]]

    def delays(self, reasons: Mapping[str, str] | None = None) -> list[str]:
        """Return a line for each place where a ring is opened.

        Args:
            reasons: why components are not part of a solved ring.

        """
        late: dict[str, list[PortName]] = {}
        for connection in self.late:
            late.setdefault(connection.target.component, []).append(connection.source)
        texts = []
        for name, sources in late.items():
            text = f"{name} takes {shortened(', '.join(map(str, sources)))} one step late: "
            concerned = (name, *(source.component for source in sources))
            why = (
                next((reasons[component] for component in concerned if component in reasons), "")
                if reasons
                else ""
            )
            texts.append(f"{text}direct feedthroughs form a ring{why and f'; {why}'}")
        return texts


def arrange(system: System, order: Order, solved: Sequence[Sequence[str]] = ()) -> Arrangement:
    """Arrange the components of a system.

    Args:
        system: to run.
        order: of the components; a stated one names each of them once.
        solved: rings whose components are stepped as one.

    """
    derived = system.derived_order(solved)
    settling = system.in_stages(derived, solved)
    stages = settling
    if order == JACOBI:
        ringed = {name for ring in solved for name in ring}
        others = [name for name in system.components if name not in ringed]
        stages = [others] * bool(others) + list(map(list, solved))
    elif not isinstance(order, str):
        stages = system.in_stages(order, solved)
    late = system.delayed_connections(derived, solved)
    return Arrangement(order, solved, settling, late, stages)


def gathered_connections(
    system: System, arrangement: Arrangement, *, latest: bool = False
) -> list[list[Connection]]:
    """Return the connections along which values are gathered before each stage.

    Args:
        system: with the connections.
        arrangement: of its components; solved rings gather by themselves what they feed themselves.
        latest: if set, stages take all outputs that the stages before them have computed.

    """
    stage_of = {name: i for i, names in enumerate(arrangement.stages) for name in names}
    ring_of = {name: i for i, ring in enumerate(arrangement.solved) for name in ring}
    gathered: list[list[Connection]] = [[] for _ in arrangement.stages]
    for connection in system.connections:
        start, end = connection.source.component, connection.target.component
        if start in ring_of and ring_of[start] == ring_of.get(end):
            continue
        source, target = stage_of[start], stage_of[end]
        # An output without feedthrough is a state, and must be read before any component advances.
        at_once = latest or (arrangement.order != JACOBI and system.has_feedthrough(connection))
        there = arrangement.order == FEEDTHROUGH or (at_once and source < target)
        gathered[target if there else 0].append(connection)
    return gathered


class Visit(NamedTuple):
    """The work of a component in a stage.

    Attributes:
        component: name of the component.
        takes: True if it takes its inputs.
        steps: True if it makes a step; else values pass through it.
        reads: the outputs that are read then.

    """

    component: str
    takes: bool = True
    steps: bool = True
    reads: Reads = ALL

    def types_read(self, component: Component, outputs: Iterable[str]) -> set[str]:
        """Return the FMI types whose outputs are read: one call reads all outputs of a type.

        One wanted output is enough to read a type. States that are read apart from outputs with
        feedthrough must not share their type with any of these.

        Args:
            component: of the visit.
            outputs: names of its outputs.

        """
        feedthroughs: dict[str, set[bool]] = {}
        for name in outputs:
            direct = component.has_feedthrough(name)
            feedthroughs.setdefault(component.variables[name].type, set()).add(direct)
        if self.reads == ALL:
            return {*feedthroughs}
        if self.reads == ONLY_STATES:
            return {fmi_type for fmi_type, direct in feedthroughs.items() if direct == {False}}
        is_direct = self.reads == DIRECT
        return {fmi_type for fmi_type, direct in feedthroughs.items() if is_direct in direct}


class Close(NamedTuple):
    """The closing of a ring in a stage.

    Attributes:
        ring: names of its components, in the order in which values go round.
        how: a way to close it.

    """

    ring: Sequence[str]
    how: Closing


class Decimation(NamedTuple):
    """The communication steps in which a slow component is stepped, or its outputs are shown.

    Attributes:
        every: number of communication steps in one of its steps.
        at_end: if set, the last of these steps, else the first.

    """

    every: int
    at_end: bool = False

    def is_due(self, k: int, steps: int) -> bool:
        """Return True in the communication step after the k-th of all steps, or at their end."""
        k += self.at_end
        return k % self.every == 0 or k == steps


class Stage(NamedTuple):
    """Values to move, and the work of components after that.

    Attributes:
        connections: inputs take their values along these at the same time.
        visits: of components, which may run side by side until their outputs are read.
        closings: of rings; a stage with any has no visits.
        shows: outputs whose hidden values are copied into their columns; such a stage has no
            connections.
        decimation: the communication steps of the stage; None: all of them.

    """

    connections: Sequence[Connection] = ()
    visits: Sequence[Visit] = ()
    closings: Sequence[Close] = ()
    shows: Sequence[PortName] = ()
    decimation: Decimation | None = None

    @property
    def acts(self) -> bool:
        """True if there is anything to do."""
        return bool(self.connections or self.visits or self.closings or self.shows)


class Stages(NamedTuple, Generic[AnyStage]):
    """The stages of every communication step, each with something to do.

    Attributes:
        stepping: in which all components are stepped.
        passing: in which values of t_k pass before the row shows them and all components are
            stepped; None: the row is shown after all components have been stepped.

    """

    stepping: list[AnyStage]
    passing: list[AnyStage] | None = None


def stages_of(
    system: System,
    arrangement: Arrangement,
    decimation: Mapping[str, int],
    *,
    latest: bool = False,
) -> Stages[Stage]:
    """Return the stages of every step.

    Args:
        system: to run.
        arrangement: of its components.
        decimation: number of communication steps in one step of each component.
        latest: if set, stages take all outputs that the stages before them have computed.

    """
    order, rings = arrangement.order, arrangement.solved
    gathered = gathered_connections(system, arrangement, latest=latest)
    if order == FEEDTHROUGH:
        return _passing_first(system, arrangement, decimation, gathered)
    ring_of = {ring[0]: ring for ring in rings}
    stepping: list[Stage] = []
    shown: list[Stage] = []
    for names, connections in zip(arrangement.stages, gathered, strict=True):
        slow, taken = _taken(connections, decimation)
        stepping += slow
        fast = [Visit(name) for name in names if decimation[name] == 1]
        here = [ring_of[name] for name in names if name in ring_of]
        if here:
            # All components of a ring are stepped before one takes new values of another.
            stepping += [
                Stage(taken, closings=[Close(ring, CHECK) for ring in here]),
                Stage(visits=fast),
            ]
            if order != JACOBI:
                stepping.append(Stage(closings=[Close(ring, RENEW_ALWAYS) for ring in here]))
        else:
            stepping.append(Stage(taken, fast))
        for name in names:
            if (n := decimation[name]) > 1:
                early, later = _shown(system.components[name], order)
                stepping += [
                    Stage(visits=[Visit(name)], decimation=Decimation(n)),
                    Stage(shows=early, decimation=Decimation(n)),
                ]
                shown.append(Stage(shows=later, decimation=Decimation(n, at_end=True)))
    renewed = [Stage(closings=[Close(ring, RENEW)]) for ring in rings]
    return Stages(_acting(stepping + shown + renewed))


def _passing_first(
    system: System,
    arrangement: Arrangement,
    decimation: Mapping[str, int],
    gathered: Sequence[Sequence[Connection]],
) -> Stages[Stage]:
    """Return the stages in feedthrough order."""
    components, rings = system.components, arrangement.solved
    outputs = {
        name: [PortName(name, output.name) for output in component.having("output")]
        for name, component in components.items()
    }
    direct = {
        name: [port for port in ports if components[name].has_feedthrough(port.port)]
        for name, ports in outputs.items()
    }
    ring_of = {ring[0]: ring for ring in rings}
    ringed = {name for ring in rings for name in ring}
    passing: list[Stage] = []
    for names, connections in zip(arrangement.stages, gathered, strict=True):
        slow, taken = _taken(
            [connection for connection in connections if connection.target.component not in ringed],
            decimation,
        )
        passed = {
            name: Visit(name, steps=False, reads=DIRECT)
            for name in names
            if direct[name] and name not in ringed
        }
        fast = [visit for name, visit in passed.items() if decimation[name] == 1]
        passing += [*slow, Stage(taken, fast)]
        for name, visit in passed.items():
            if (n := decimation[name]) > 1:
                passing += [
                    Stage(visits=[visit], decimation=Decimation(n)),
                    Stage(shows=direct[name], decimation=Decimation(n)),
                ]
        passing += [
            Stage(closings=[Close(ring_of[name], RENEW_ALWAYS)])
            for name in names
            if name in ring_of
        ]
    place = {name: i for i, names in enumerate(arrangement.stages) for name in names}
    # An output that is read when values pass is read again after a step if something takes it
    # earlier.
    early = {
        connection.source.component
        for connection in system.connections
        if place[connection.source.component] >= place[connection.target.component]
    }
    # A component that takes an output with direct feedthrough before it passes must get the output
    # for the inputs of this step.
    late = {connection.source.component for connection in arrangement.late}

    def stepped(name: str) -> Visit:
        if not direct[name]:
            return Visit(name)
        is_early = name in early or decimation[name] > 1
        reads = ALL if name in late else STATES if is_early else ONLY_STATES
        return Visit(name, takes=False, reads=reads)

    stepping: list[Stage] = []
    shown: list[Stage] = []
    for n in sorted(set(decimation.values())):
        here = [name for name in place if decimation[name] == n]
        visits = list(map(stepped, here))
        stepping.append(Stage(visits=visits, decimation=Decimation(n) if n > 1 else None))
        if n > 1:
            ports = [port for name in here for port in outputs[name]]
            shown.append(Stage(shows=ports, decimation=Decimation(n, at_end=True)))
    return Stages(_acting(stepping + shown), _acting(passing))


def _taken(
    connections: Sequence[Connection], decimation: Mapping[str, int]
) -> tuple[list[Stage], list[Connection]]:
    """Return the stages in which slow components take their inputs, and the other connections."""
    taken: dict[int, list[Connection]] = {1: []}
    for connection in connections:
        taken.setdefault(decimation[connection.target.component], []).append(connection)
    fast = taken.pop(1)
    return [Stage(some, decimation=Decimation(n)) for n, some in taken.items()], fast


def _shown(component: Component, order: Order) -> tuple[list[PortName], list[PortName]]:
    """Return the outputs of a slow component that are shown when it was stepped, and the others."""
    early: list[PortName] = []
    later: list[PortName] = []
    for output in component.having("output"):
        at_once = order != JACOBI and component.has_feedthrough(output.name)
        (early if at_once else later).append(PortName(component.name, output.name))
    return early, later


def _acting(stages: Sequence[Stage]) -> list[Stage]:
    return [stage for stage in stages if stage.acts]


class Member(NamedTuple):
    """The calls that step a component, or let values pass through it."""

    set_inputs: list[Callable[[], int]]
    do_step: Callable[[c_double, c_double, int], int] | None
    get_outputs: list[Callable[[], int]]
    instance: Instance | StageCall


class StageCall:
    """Replaces an instance in a stage that acts but steps no component."""

    name, is_here = "", True
    get_outputs: ClassVar[list[Callable[[], int]]] = []

    def __init__(self, act: Callable[[float, float], object]) -> None:
        """Call a function in every step.

        Args:
            act: takes the time and the length of the step.

        """
        self._act = act
        self._error: Exception | None = None
        self._called_back = DoStepCallback(lambda _, t, h, __: self._tried(t, h))

    @property
    def member(self) -> Member:
        """Member of a stage."""
        return Member([], self.do_step, [], self)

    def do_step(self, t: c_double, h: c_double, _: int) -> int:
        """Act, and return a status."""
        return self._tried(t.value, h.value)

    def failed(self, status: int, function: str) -> Exception:
        """Return the exception that was raised."""
        assert self._error is not None
        return self._error

    def pointers(self) -> CMember:
        """Return the pointers for the compiled loop."""
        nothing = (CMove * 0)()
        return CMember(None, address_of(self._called_back), None, nothing, nothing, 0, 0)

    def _tried(self, t: float, h: float) -> int:
        try:
            self._act(t, h)
        except Exception as error:
            # An exception cannot pass through the compiled loop.
            self._error = error
            return int(fmi2Error)
        return int(fmi2OK)


class LinkedStage(NamedTuple):
    """Inputs to gather, and the components to step then.

    Attributes:
        gather: moves values within the row.
        members: components to step.
        decimation: the communication steps of the stage; None: all of them.

    """

    gather: Gathering
    members: list[Member]
    decimation: Decimation | None = None


def link_stages(
    stages: Stages[Stage],
    system: System,
    instances: Mapping[str, Instance],
    row: Row,
    rings: Sequence[Ring] = (),
) -> Stages[LinkedStage]:
    """Turn the stages of every step into calls.

    Args:
        stages: by the names of components.
        system: to run.
        instances: of all components.
        row: that they are tied to.
        rings: solved rings.

    """
    ring_of = {ring.names[0]: ring for ring in rings}

    def closing(close: Close) -> Member:
        function, ring = _CLOSES[close.how], ring_of[close.ring[0]]
        return StageCall(lambda _t, _h: function(ring)).member

    def visiting(visit: Visit) -> Member:
        return _visiting(visit, instances[visit.component], system.components[visit.component])

    def all_linked(some: Sequence[Stage]) -> list[LinkedStage]:
        return [
            LinkedStage(
                Gathering(*row.hidden(stage.shows))
                if stage.shows
                else Gathering.along(row, stage.connections),
                [*map(visiting, stage.visits), *map(closing, stage.closings)],
                stage.decimation,
            )
            for stage in some
        ]

    passing = None if stages.passing is None else all_linked(stages.passing)
    return Stages(all_linked(stages.stepping), passing)


def member(instance: Instance) -> Member:
    """Return the calls of an instance that is tied to a row."""
    return Member(instance.set_inputs, instance.do_step, instance.get_outputs, instance)


def _visiting(visit: Visit, instance: Instance, component: Component) -> Member:
    """Return the calls for the work of a component in a stage."""
    return Member(
        instance.set_inputs if visit.takes else [],
        instance.do_step if visit.steps else instance.do_exchange,
        _reading(visit, instance, component),
        instance,
    )


def _reading(visit: Visit, instance: Instance, component: Component) -> list[Callable[[], int]]:
    """Return the calls that read outputs of a component, one for each type."""
    # The answer of another process must be taken in any case.
    if visit.reads == ALL or not instance.is_here:
        return instance.get_outputs
    read_types = visit.types_read(component, (port.name for port in component.having("output")))
    calls = zip(instance.get_outputs, component.by_type("output"), strict=True)
    return [call for call, fmi_type in calls if fmi_type in read_types]


def make_stages(
    stages: Sequence[LinkedStage],
    values: np.ndarray,
    experiment: Experiment,
    steps: int,
    k: int,
    t: c_double,
    h: c_double,
) -> None:
    """Make some stages of a step.

    Args:
        stages: to make.
        values: of the row.
        experiment: of the run.
        steps: number of steps of the run.
        k: number of steps made before.
        t, h: beginning and length of the step [s].

    """
    for gather, members, decimation in stages:
        if decimation is None:
            # Most stages are like this: no call is needed.
            if gather.is_plain:
                values[gather.targets] = values[gather.sources]
            elif gather.acts:
                gather(values)
            step_members(members, t, h)
        elif decimation.is_due(k, steps):
            gather(values)
            step_members(members, t, c_double(experiment.length(k, decimation.every)))


def step_members(
    members: Sequence[Member], t: c_double, h: c_double, is_final: bool = True
) -> None:
    """Step the components of a stage; they may run side by side until their outputs are read.

    Values only pass through a component without a step.

    Args:
        members: the components.
        t, h: beginning and length of the step [s].
        is_final: False if a component may go back to the beginning of the step.

    """
    for set_inputs, do_step, _, instance in members:
        for call in set_inputs:
            if (status := call()) != fmi2OK and status != fmi2Warning:
                raise instance.failed(status, SET_INPUTS)
        if (
            do_step is not None
            and (status := do_step(t, h, is_final)) != fmi2OK
            and status != fmi2Warning
        ):
            raise instance.failed(status, DO_STEP)
        # Testing here is cheaper than calling a function that tests.
        if A * B * C != PRODUCT:
            restore_mode()
    for _, _, get_outputs, instance in members:
        for call in get_outputs:
            if (status := call()) != fmi2OK and status != fmi2Warning:
                raise instance.failed(status, GET_OUTPUTS)
        if A * B * C != PRODUCT:
            restore_mode()
