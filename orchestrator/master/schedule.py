"""The stages of a communication step, as the loops make them.

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

from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.master.experiment import FEEDTHROUGH, JACOBI, Experiment, Order
from orchestrator.master.fmi.instance import DO_STEP, GET_OUTPUTS, SET_INPUTS, Instance
from orchestrator.master.fmi.surroundings import PRODUCT, A, B, C, restore_mode
from orchestrator.master.fmi.transfer import CMember, CMove, DoStepCallback, address_of
from orchestrator.master.plan import Plan, gathered_connections
from orchestrator.master.ring import Ring
from orchestrator.master.row import Gathering, Row
from orchestrator.system.component import Component
from orchestrator.system.connection import Connection
from orchestrator.system.graph import delayed_connections
from orchestrator.system.names import PortName
from orchestrator.system.values import TYPES


class Member(NamedTuple):
    """The calls that step one component, or let values pass through it."""

    set_inputs: list[Callable[[], int]]
    do_step: Callable[[c_double, c_double, int], int] | None
    get_outputs: list[Callable[[], int]]
    instance: Instance | StageCall


class StageCall:
    """Takes the place of an instance in a stage that acts but steps no component."""

    name, is_here = "", True
    get_outputs: ClassVar[list[Callable[[], int]]] = []

    def __init__(self, act: Callable[[float, float], object]) -> None:
        """Do something in every step.

        Args:
            act: what to do, with the time and the length of the step.

        """
        self._act = act
        self._error: Exception | None = None
        self._called_back = DoStepCallback(lambda _, t, h, __: self._tried(t, h))

    @property
    def member(self) -> Member:
        """As the loops know it."""
        return Member([], self.do_step, [], self)

    def do_step(self, t: c_double, h: c_double, _: int) -> int:
        """Act; the status says whether it went well."""
        return self._tried(t.value, h.value)

    def failed(self, status: int, function: str) -> Exception:
        """What it has raised."""
        assert self._error is not None
        return self._error

    def pointers(self) -> CMember:
        """The same for the compiled loop."""
        nothing = (CMove * 0)()
        return CMember(None, address_of(self._called_back), None, nothing, nothing, 0, 0)

    def _tried(self, t: float, h: float) -> int:
        try:
            self._act(t, h)
        except Exception as error:
            # No exception can leave through the compiled loop.
            self._error = error
            return int(fmi2Error)
        return int(fmi2OK)


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
    """Inputs to gather, and the components to step then.

    Attributes:
        gather: moves values within the row.
        members: the components.
        decimation: in which communication steps; None: in all of them.

    """

    gather: Gathering
    members: list[Member]
    decimation: Decimation | None = None

    @property
    def acts(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.members) or self.gather.acts


class Schedule(NamedTuple):
    """The stages of every communication step.

    Attributes:
        stepping: in which all components are stepped.
        passing: in which values of t_k pass before a row shows them and all are stepped; None: the
            row is shown once all have been stepped.

    """

    stepping: list[Stage]
    passing: list[Stage] | None = None

    @property
    def gatherings(self) -> list[Gathering]:
        """What is gathered in them."""
        return [stage.gather for stage in (*(self.passing or ()), *self.stepping)]


def schedule(
    plan: Plan,
    sequence: Sequence[Sequence[str]],
    instances: Mapping[str, Instance],
    row: Row,
    rings: Sequence[Ring] = (),
    *,
    latest: bool = False,
) -> Schedule:
    """The stages of every step.

    Args:
        plan: what is run, in an order that is not left open.
        sequence: its components in :func:`.plan.stages`.
        instances: of all components.
        row: that they are tied to.
        rings: that are solved, in stages of their own.
        latest: whether stages take all that those before them have computed.

    """
    system, order, decimation = plan.system, plan.experiment.order, plan.decimations
    assert order is not None
    gathers = gathered_connections(
        system, sequence, [ring.names for ring in rings], order, latest=latest
    )
    ring_of = {ring.names[0]: ring for ring in rings}
    if order == FEEDTHROUGH:
        return _passing_first(plan, sequence, gathers, instances, row, ring_of)
    renewed = [Stage(Gathering.along(row, ()), [_action(ring.renew)]) for ring in rings]
    found: list[Stage] = []
    shown: list[Stage] = []
    nothing = Gathering.along(row, ())
    for names, connections in zip(sequence, gathers, strict=True):
        slow, gathering = _gatherings(connections, decimation, row)
        found += slow
        fast = Stage(
            gathering, [member(instances[name]) for name in names if decimation[name] == 1]
        )
        here = [ring_of[name] for name in names if name in ring_of]
        if here:
            # All are stepped before one takes what another has come to.
            checked = Stage(fast.gather, [_action(ring.check) for ring in here])
            found += [checked, Stage(nothing, fast.members)]
            if order != JACOBI:
                found.append(Stage(nothing, [_action(partial(ring.renew, True)) for ring in here]))
        else:
            found.append(fast)
        for name in names:
            if (n := decimation[name]) > 1:
                early, later = (
                    Gathering(*row.hidden(ports))
                    for ports in _shown(system.components[name], order)
                )
                found += [
                    Stage(nothing, [member(instances[name])], Decimation(n)),
                    Stage(early, [], Decimation(n)),
                ]
                shown.append(Stage(later, [], Decimation(n, at_end=True)))
    found += shown + renewed
    return Schedule([stage for stage in found if stage.acts])


def _passing_first(
    plan: Plan,
    sequence: Sequence[Sequence[str]],
    gathers: Sequence[Sequence[Connection]],
    instances: Mapping[str, Instance],
    row: Row,
    ring_of: Mapping[str, Ring],
) -> Schedule:
    """The stages in feedthrough order, with each ring by its first component."""
    components, decimation = plan.system.components, plan.decimations
    nothing = Gathering.along(row, ())
    outputs = {
        name: [PortName(name, output.name) for output in component.having("output")]
        for name, component in components.items()
    }
    direct = {
        name: [port for port in ports if components[name].has_feedthrough(port.port)]
        for name, ports in outputs.items()
    }
    reads = {name: _reads(instances[name], component) for name, component in components.items()}
    rings = [ring.names for ring in ring_of.values()]
    ringed = {name for names in rings for name in names}
    passing: list[Stage] = []
    for names, connections in zip(sequence, gathers, strict=True):
        slow, gathering = _gatherings(
            [one for one in connections if one.target.component not in ringed], decimation, row
        )
        through = [name for name in names if direct[name] and name not in ringed]
        fast = [_passed(instances[name], reads[name]) for name in through if decimation[name] == 1]
        passing += [*slow, Stage(gathering, fast)]
        for name in through:
            if (n := decimation[name]) > 1:
                passing += [
                    Stage(nothing, [_passed(instances[name], reads[name])], Decimation(n)),
                    Stage(Gathering(*row.hidden(direct[name])), [], Decimation(n)),
                ]
        passing += [
            Stage(nothing, [_action(partial(ring_of[name].renew, True))])
            for name in names
            if name in ring_of
        ]
    place = {name: i for i, names in enumerate(sequence) for name in names}
    early = {
        one.source.component
        for one in plan.system.connections
        if place[one.source.component] >= place[one.target.component]
    }
    late = {one.source.component for one in delayed_connections(plan.system, [*place], rings)}
    stepping: list[Stage] = []
    later: list[Stage] = []
    for n in sorted(set(decimation.values())):
        here = [name for name in place if decimation[name] == n]
        members = [
            _stepped(instances[name], reads[name], name in early or n > 1, name in late)
            if direct[name]
            else member(instances[name])
            for name in here
        ]
        stepping.append(Stage(nothing, members, Decimation(n) if n > 1 else None))
        if n > 1:
            ports = [port for name in here for port in outputs[name]]
            later.append(Stage(Gathering(*row.hidden(ports)), [], Decimation(n, at_end=True)))
    return Schedule(*([one for one in all_ if one.acts] for all_ in (stepping + later, passing)))


def _gatherings(
    connections: Sequence[Connection], decimation: Mapping[str, int], row: Row
) -> tuple[list[Stage], Gathering]:
    """What components that take longer steps gather, and the others, before any is stepped."""
    taken: dict[int, list[Connection]] = {1: []}
    for connection in connections:
        taken.setdefault(decimation[connection.target.component], []).append(connection)
    fast = Gathering.along(row, taken.pop(1))
    return [Stage(Gathering.along(row, some), [], Decimation(n)) for n, some in taken.items()], fast


def _action(act: Callable[[], object]) -> Member:
    """A member that does something that needs no time."""
    return StageCall(lambda _t, _h: act()).member


def _shown(component: Component, order: Order) -> tuple[list[PortName], list[PortName]]:
    """The outputs of a slow component: those shown when it was stepped, and the others."""
    early: list[PortName] = []
    later: list[PortName] = []
    for output in component.having("output"):
        at_once = order != JACOBI and component.has_feedthrough(output.name)
        (early if at_once else later).append(PortName(component.name, output.name))
    return early, later


def member(instance: Instance) -> Member:
    """The calls of an instance that is tied to a row."""
    return Member(instance.set_inputs, instance.do_step, instance.get_outputs, instance)


class Reads(NamedTuple):
    """The calls that read the outputs of a component, each all of a type.

    Attributes:
        direct: of a type that has outputs with direct feedthrough.
        states: of one that has others.

    """

    direct: list[Callable[[], int]]
    states: list[Callable[[], int]]


def _reads(instance: Instance, component: Component) -> Reads:
    """How the outputs of a component are read."""
    calls = instance.get_outputs
    if not instance.is_here:
        # The answer of another process has to be taken.
        return Reads(calls, calls)
    outputs = component.having("output")
    types = [fmi_type for fmi_type in TYPES if any(one.type == fmi_type for one in outputs)]
    kinds = {(one.type, component.has_feedthrough(one.name)) for one in outputs}
    return Reads(
        *(
            [call for call, of in zip(calls, types, strict=True) if (of, is_direct) in kinds]
            for is_direct in (True, False)
        )
    )


def _passed(instance: Instance, reads: Reads) -> Member:
    """The calls that let values pass through an instance."""
    return Member(instance.set_inputs, instance.do_exchange, reads.direct, instance)


def _stepped(instance: Instance, reads: Reads, is_early: bool, is_late: bool) -> Member:
    """The calls that step an instance which has its inputs already.

    What is read when values pass is read here too if something takes it before. Whatever takes an
    output with direct feedthrough then, takes what follows from the inputs of this step.

    Args:
        instance: to step.
        reads: how its outputs are read.
        is_early: whether something takes outputs before they pass.
        is_late: whether outputs with direct feedthrough are among these.

    """
    if is_late:
        outputs = instance.get_outputs
    elif is_early or not instance.is_here:
        outputs = reads.states
    else:
        outputs = [call for call in reads.states if call not in reads.direct]
    return Member([], instance.do_step, outputs, instance)


def make_stages(
    stages: Sequence[Stage],
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
        experiment: that the step belongs to.
        steps: how many there are.
        k: how many were made before.
        t, h: beginning and length of the step [s].

    """
    for gather, members, decimation in stages:
        if decimation is None:
            # What most stages are costs no call.
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
    """Step the components of a stage, which may run side by side until their outputs are asked.

    Values only pass through a component whose calls have no step.

    Args:
        members: the components.
        t, h: beginning and length of the step [s].
        is_final: whether no component will go back to its beginning.

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
        # To call a function that looks costs more than to look.
        if A * B * C != PRODUCT:
            restore_mode()
    for _, _, get_outputs, instance in members:
        for call in get_outputs:
            if (status := call()) != fmi2OK and status != fmi2Warning:
                raise instance.failed(status, GET_OUTPUTS)
        if A * B * C != PRODUCT:
            restore_mode()
