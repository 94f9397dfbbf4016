"""The stages of a communication step, by the names of its components.

In `feedthrough` order values pass first, then all components are stepped. Rings of feedthroughs
that are solved are closed where values come to them.

In other orders such rings have stages of their own. Each is closed before its components are
stepped, with their states of t_k, after that, with those of t_k+1 and the latest of what feeds it,
and again when all have been stepped: every row shows its solution.

A component may span n communication steps in one step. It is stepped at every n-th t_k, with
the inputs of that time, which it holds. What it computes waits in hidden columns of the row until
the time has come that it belongs to. Outputs with direct feedthrough hold from t_k on: they are
shown when they pass, or as soon as the component was stepped, unless the order is `jacobi`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias, get_args

from orchestrator.cosim.experiment import FEEDTHROUGH, JACOBI, Order
from orchestrator.cosim.plan import Plan, gathered_connections
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName

#: Which outputs are read: all; those with direct feedthrough; the others, which are states; of
#: these, the ones that are not read together with the former.
Reads: TypeAlias = Literal["all", "direct", "states", "only states"]
READS: tuple[Reads, ...] = get_args(Reads)
ALL, DIRECT, STATES, ONLY_STATES = READS

#: How a ring is closed: where something about its components has changed; where that or what others
#: feed it has, which it takes; with what others feed it, in any case.
Closing: TypeAlias = Literal["check", "renew", "renew always"]
CLOSINGS: tuple[Closing, ...] = get_args(Closing)
CHECK, RENEW, RENEW_ALWAYS = CLOSINGS


def types_read(reads: Reads, component: Component, outputs: Iterable[str]) -> set[str]:
    """The types of FMI whose outputs are read, as a call reads all outputs of a type.

    Args:
        reads: which outputs are wanted. One is enough to read a type; if those with feedthrough are
            read elsewhere, it must have none.
        component: whose outputs they are.
        outputs: names of them.

    """
    found: dict[str, set[bool]] = {}
    for name in outputs:
        direct = component.has_feedthrough(name)
        found.setdefault(component.variables[name].type, set()).add(direct)
    if reads == ALL:
        return {*found}
    if reads == ONLY_STATES:
        return {one for one, direct in found.items() if direct == {False}}
    return {one for one, direct in found.items() if (reads == DIRECT) in direct}


class Visit(NamedTuple):
    """What a component does in a stage.

    Attributes:
        component: its name.
        takes: whether it takes its inputs.
        steps: whether it makes a step; else values pass through it.
        reads: which of its outputs are read then.

    """

    component: str
    takes: bool = True
    steps: bool = True
    reads: Reads = ALL


class Close(NamedTuple):
    """A ring that is closed in a stage.

    Attributes:
        ring: names of its components, in the order in which values go round.
        how: it is closed.

    """

    ring: Sequence[str]
    how: Closing


class Decimation(NamedTuple):
    """When a slow component is stepped, or its outputs are shown.

    Attributes:
        every: how many communication steps one of its steps spans.
        at_end: whether in the last of them, not in the first.

    """

    every: int
    at_end: bool = False

    def is_due(self, k: int, steps: int) -> bool:
        """Whether in the communication step after the k-th of so many, or at the end of all."""
        k += self.at_end
        return k % self.every == 0 or k == steps


class Stage(NamedTuple):
    """Values to move, and what components do then.

    Attributes:
        connections: along which inputs take their values at the same time.
        visits: of components, which may run side by side until their outputs are read.
        shows: outputs whose hidden values are copied into their columns; there are no connections
            then.
        decimation: in which communication steps; None: in all of them.

    """

    connections: Sequence[Connection] = ()
    visits: Sequence[Visit | Close] = ()
    shows: Sequence[PortName] = ()
    decimation: Decimation | None = None

    @property
    def acts(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.connections or self.visits or self.shows)


class Stages(NamedTuple):
    """The stages of every communication step; in each there is something to do.

    Attributes:
        stepping: in which all components are stepped.
        passing: in which values of t_k pass before a row shows them and all are stepped; None: the
            row is shown once all have been stepped.

    """

    stepping: list[Stage]
    passing: list[Stage] | None = None


def stages_of(
    plan: Plan,
    sequence: Sequence[Sequence[str]],
    rings: Sequence[Sequence[str]] = (),
    *,
    latest: bool = False,
) -> Stages:
    """The stages of every step.

    Args:
        plan: what is run, in an order that is not left open.
        sequence: its components in :func:`.plan.stages`.
        rings: that are solved, in stages of their own.
        latest: whether stages take all that those before them have computed.

    """
    system, order, decimation = plan.system, plan.experiment.order, plan.decimations
    assert order is not None
    gathered = gathered_connections(system, sequence, rings, order, latest=latest)
    if order == FEEDTHROUGH:
        return _passing_first(plan, sequence, gathered, rings)
    ring_of = {ring[0]: ring for ring in rings}
    found: list[Stage] = []
    shown: list[Stage] = []
    for names, connections in zip(sequence, gathered, strict=True):
        slow, taken = _taken(connections, decimation)
        found += slow
        fast = [Visit(name) for name in names if decimation[name] == 1]
        here = [ring_of[name] for name in names if name in ring_of]
        if here:
            # All are stepped before one takes what another has come to.
            found += [Stage(taken, [Close(ring, CHECK) for ring in here]), Stage(visits=fast)]
            if order != JACOBI:
                found.append(Stage(visits=[Close(ring, RENEW_ALWAYS) for ring in here]))
        else:
            found.append(Stage(taken, fast))
        for name in names:
            if (n := decimation[name]) > 1:
                early, later = _shown(system.components[name], order)
                found += [
                    Stage(visits=[Visit(name)], decimation=Decimation(n)),
                    Stage(shows=early, decimation=Decimation(n)),
                ]
                shown.append(Stage(shows=later, decimation=Decimation(n, at_end=True)))
    renewed = [Stage(visits=[Close(ring, RENEW)]) for ring in rings]
    return Stages(_acting(found + shown + renewed))


def _passing_first(
    plan: Plan,
    sequence: Sequence[Sequence[str]],
    gathered: Sequence[Sequence[Connection]],
    rings: Sequence[Sequence[str]],
) -> Stages:
    """The stages in feedthrough order."""
    components, decimation = plan.system.components, plan.decimations
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
    for names, connections in zip(sequence, gathered, strict=True):
        slow, taken = _taken(
            [one for one in connections if one.target.component not in ringed], decimation
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
            Stage(visits=[Close(ring_of[name], RENEW_ALWAYS)]) for name in names if name in ring_of
        ]
    place = {name: i for i, names in enumerate(sequence) for name in names}
    # What is read when values pass is read after a step too if something takes it before it passes.
    early = {
        one.source.component
        for one in plan.system.connections
        if place[one.source.component] >= place[one.target.component]
    }
    # Whatever takes an output with direct feedthrough then, takes what follows from the inputs of
    # this step.
    late = {one.source.component for one in plan.system.delayed_connections([*place], rings)}

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
    """What components that take longer steps take, and the others, before any is stepped."""
    taken: dict[int, list[Connection]] = {1: []}
    for connection in connections:
        taken.setdefault(decimation[connection.target.component], []).append(connection)
    fast = taken.pop(1)
    return [Stage(some, decimation=Decimation(n)) for n, some in taken.items()], fast


def _shown(component: Component, order: Order) -> tuple[list[PortName], list[PortName]]:
    """The outputs of a slow component: those shown when it was stepped, and the others."""
    early: list[PortName] = []
    later: list[PortName] = []
    for output in component.having("output"):
        at_once = order != JACOBI and component.has_feedthrough(output.name)
        (early if at_once else later).append(PortName(component.name, output.name))
    return early, later


def _acting(stages: Sequence[Stage]) -> list[Stage]:
    return [stage for stage in stages if stage.acts]
