"""The stages of a communication step, as the loops make them.

Rings of feedthroughs that are solved have stages of their own. Each is closed before its components
are stepped, with their states of t_k, after that, with those of t_k+1 and the latest of what feeds
it, and again when all have been stepped: every row shows its solution.

A component may span n communication steps in one step. It is stepped at every n-th t_k, with
the inputs of that time, which it holds. What it computes waits in hidden columns of the row: from
there outputs with direct feedthrough, which hold from t_k on, are shown at once, unless the order
is `jacobi`; all others when the time has come that they belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double
from functools import partial
from typing import NamedTuple

from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.master.experiment import JACOBI, Order
from orchestrator.master.fmi.instance import DO_STEP, GET_OUTPUTS, SET_INPUTS, Instance
from orchestrator.master.fmi.surroundings import PRODUCT, A, B, C, restore_mode
from orchestrator.master.fmi.transfer import CMember, CMove, DoStepCallback, address_of
from orchestrator.master.plan import Plan, gathered_connections
from orchestrator.master.ring import Ring
from orchestrator.master.row import Gathering, Row
from orchestrator.system.component import Component
from orchestrator.system.connection import Connection
from orchestrator.system.names import PortName


class Member(NamedTuple):
    """The calls that step one component."""

    set_inputs: list[Callable[[], int]]
    do_step: Callable[[c_double, c_double, int], int]
    get_outputs: list[Callable[[], int]]
    instance: Instance | StageCall


class StageCall:
    """Takes the place of an instance in a stage that acts but steps no component."""

    name, is_here = "", True

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
        """Whether in the communication step after the k-th of so many."""
        if self.at_end:
            return (k + 1) % self.every == 0 or k + 1 == steps
        return k % self.every == 0


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


def schedule(
    plan: Plan,
    sequence: Sequence[Sequence[str]],
    instances: Mapping[str, Instance],
    row: Row,
    rings: Sequence[Ring] = (),
    *,
    latest: bool = False,
) -> list[Stage]:
    """The stages of every step.

    Args:
        plan: what is run.
        sequence: its components in :func:`.plan.stages`.
        instances: of all components.
        row: that they are tied to.
        rings: that are solved, in stages of their own.
        latest: whether stages take all that those before them have computed.

    """
    system, order, decimation = plan.system, plan.experiment.order, plan.decimations
    ring_of = {ring.names[0]: ring for ring in rings}
    renewed = [Stage(Gathering.along(row, ()), [_action(ring.renew)]) for ring in rings]
    found: list[Stage] = []
    shown: list[Stage] = []
    nothing = Gathering.along(row, ())
    solved = [ring.names for ring in rings]
    gathers = gathered_connections(system, sequence, solved, order, latest=latest)
    for names, connections in zip(sequence, gathers, strict=True):
        taken: dict[int, list[Connection]] = {1: []}
        for connection in connections:
            taken.setdefault(decimation[connection.target.component], []).append(connection)
        fast = Stage(
            Gathering.along(row, taken.pop(1)),
            [member(instances[name]) for name in names if decimation[name] == 1],
        )
        # All inputs are gathered before any component is stepped.
        found += [Stage(Gathering.along(row, some), [], Decimation(n)) for n, some in taken.items()]
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
    return [stage for stage in found if stage.members or len(stage.gather.targets)]


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


def step_members(members: Sequence[Member], t: float, h: float, is_final: bool = True) -> None:
    """Step the components of a stage, which may run side by side until their outputs are asked.

    Args:
        members: the components.
        t, h: beginning and length of the step [s].
        is_final: whether no component will go back to its beginning.

    """
    # Converted once for all of them.
    time, length = c_double(t), c_double(h)
    for set_inputs, do_step, _, instance in members:
        for call in set_inputs:
            if (status := call()) != fmi2OK and status != fmi2Warning:
                raise instance.failed(status, SET_INPUTS)
        if (status := do_step(time, length, is_final)) != fmi2OK and status != fmi2Warning:
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
