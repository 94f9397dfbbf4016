"""Which components are stepped when, and on whose outputs.

Every communication step has stages. Before a stage is stepped its inputs are gathered; the
outputs of a component are read as soon as it was stepped.

- `jacobi`: one stage. All inputs are outputs of t_k.
- `gauss-seidel`: a component whose output has direct feedthrough is stepped in an earlier
  stage than those it feeds, so they receive without delay what follows from t_k. Outputs
  without feedthrough are states: everybody takes them at t_k.
- the names of all components: the same in the order that they stand in.

Rings of feedthroughs that are solved have stages of their own. Each is closed before its components
are stepped, with their states of t_k, after that, with those of t_k+1 and the latest of what feeds
it, and again when all have been stepped: every row shows its solution. One that is not solved is
opened before the one of its components that stands first in the system, which takes what feeds it
at t_k.

A component may take n communication steps in one of its own. It is stepped at every n-th t_k, with
the inputs of that time, which it holds. What it computes waits in hidden columns of the row: from
there outputs with direct feedthrough, which hold from t_k on, are shown at once, unless the order
is `jacobi`; all others when the time has come that they belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import CFUNCTYPE, c_double, c_int, c_void_p, cast
from functools import partial
from typing import NamedTuple, Protocol

from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.machine.errors import InputError, shortened
from orchestrator.master.experiment import JACOBI, ORDERS, Experiment, Order, decimations
from orchestrator.master.fmi.instance import DO_STEP, GET_OUTPUTS, SET_INPUTS, Instance
from orchestrator.master.fmi.surroundings import PRODUCT, A, B, C, put_back
from orchestrator.master.gathering import Gathering
from orchestrator.master.ring import Ring
from orchestrator.master.row import Row
from orchestrator.master.stepper_types import CMember, CMove
from orchestrator.system.component import Component
from orchestrator.system.graph import delayed, derived_order, has_feedthrough, in_stages
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System

#: FMI's doStep, as the compiled loop calls it.
_CALLBACK = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)


class Steppable(Protocol):
    """What a loop asks of a member besides its calls.

    Attributes:
        name: of the component; empty: it is none.
        is_here: whether its calls are functions of this process.

    """

    name: str
    is_here: bool

    def pointers(self) -> CMember:
        """The same calls as pointers."""

    def failed(self, status: int, function: str) -> Exception:
        """What to raise after a call that has ended with a status."""


class Member(NamedTuple):
    """The calls that step one component."""

    set_inputs: list[Callable[[], int]]
    do_step: Callable[[c_double, c_double, int], int]
    get_outputs: list[Callable[[], int]]
    instance: Steppable


class StageCall:
    """A member of a stage that acts in the place of a step, and is no component."""

    name, is_here = "", True

    def __init__(self, act: Callable[[float, float], object]) -> None:
        """Do something in every step.

        Args:
            act: what to do, with the time and the length of the step.

        """
        self._act = act
        self._error: Exception | None = None
        self._called_back = _CALLBACK(lambda _, t, h, __: self._tried(t, h))

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
        return CMember(None, cast(self._called_back, c_void_p).value, nothing, nothing, 0, 0)

    def _tried(self, t: float, h: float) -> int:
        try:
            self._act(t, h)
        except Exception as error:
            # No exception can leave through the compiled loop.
            self._error = error
            return int(fmi2Error)
        return int(fmi2OK)


class Decimation(NamedTuple):
    """When a slow component is stepped, or what it has computed is shown.

    Attributes:
        every: how many communication steps one of its own takes.
        at_end: whether in the last of them, not in the first.

    """

    every: int
    at_end: bool = False

    def is_due(self, k: int, steps: int) -> bool:
        """Whether in the communication step behind the k-th of so many."""
        if self.at_end:
            return (k + 1) % self.every == 0 or k + 1 == steps
        return k % self.every == 0


class Stage(NamedTuple):
    """Inputs to gather, and the components to step then.

    Attributes:
        gather: moves values within the row.
        members: the components.
        pace: in which communication steps; None: in all of them.

    """

    gather: Gathering
    members: list[Member]
    decimation: Decimation | None = None


def stages(system: System, order: Order, solved: Sequence[Sequence[str]] = ()) -> list[list[str]]:
    """Components in the order in which they are stepped; those of one stage are independent.

    Args:
        system: that is stepped.
        order: of its components.
        solved: rings of them that are stepped as one, in stages of their own.

    Raises:
        InputError: an order that does not name each component once.

    """
    if order == JACOBI:
        ringed = {name for ring in solved for name in ring}
        others = [name for name in system.components if name not in ringed]
        return [others, *map(list, solved)] if others else list(map(list, solved))
    if isinstance(order, str):
        return in_stages(system, derived_order(system, solved), solved)
    _check_names(system, order)
    return in_stages(system, order, solved)


def _check_names(system: System, order: Sequence[str]) -> None:
    for name in order:
        system.component(name)
    twice = [name for i, name in enumerate(order) if name in order[:i]]
    missing = [name for name in system.components if name not in order]
    for names, what in ((twice, "twice"), (missing, "not at all")):
        if names:
            raise InputError(
                f"order {','.join(order)}: names {', '.join(names)} {what}; it takes every "
                "component once"
            )


def delays(
    system: System,
    order: Order,
    solved: Sequence[Sequence[str]] = (),
    reasons: Mapping[str, str] | None = None,
) -> list[str]:
    """Where an order that follows from the feedthroughs opens a ring of them, in words.

    Args:
        system: that is stepped.
        order: of its components.
        solved: rings that are solved.
        reasons: why components are in none of these.

    """
    if not isinstance(order, str) or order == JACOBI:
        return []
    late: dict[str, list[PortName]] = {}
    for connection in delayed(system, derived_order(system, solved), solved):
        late.setdefault(connection.target.component, []).append(connection.source)
    found = []
    for name, sources in late.items():
        text = f"{name} takes {shortened(', '.join(map(str, sources)))} one step late: "
        concerned = (name, *(source.component for source in sources))
        why = next((reasons[one] for one in concerned if one in reasons), "") if reasons else ""
        found.append(f"{text}direct feedthroughs form a ring{why and f'; {why}'}")
    return found


def gathered(
    system: System,
    plan: Sequence[Sequence[str]],
    solved: Sequence[Sequence[str]] = (),
    order: Order = ORDERS[0],
    *,
    latest: bool = False,
) -> list[list[Connection]]:
    """The connections along which values are gathered before each stage.

    Args:
        system: whose connections say what feeds what.
        plan: its components in :func:`stages`.
        solved: rings among them, which gather by themselves what they feed themselves.
        order: of the stages.
        latest: whether stages take all that those before them have computed.

    """
    stage_of = {name: i for i, names in enumerate(plan) for name in names}
    ring_of = {name: i for i, ring in enumerate(solved) for name in ring}
    found: list[list[Connection]] = [[] for _ in plan]
    for connection in system.connections:
        start, end = connection.source.component, connection.target.component
        if start in ring_of and ring_of[start] == ring_of.get(end):
            continue
        source, target = stage_of[start], stage_of[end]
        # What is no feedthrough is a state, and must be taken before anybody advances.
        at_once = latest or (order != JACOBI and has_feedthrough(system, connection))
        late = at_once and source < target
        found[target if late else 0].append(connection)
    return found


def schedule(
    system: System,
    experiment: Experiment,
    plan: Sequence[Sequence[str]],
    instances: Mapping[str, Instance],
    row: Row,
    rings: Sequence[Ring] = (),
    *,
    latest: bool = False,
) -> list[Stage]:
    """The stages of every step.

    Args:
        system: whose connections say what feeds what, and whose steps which components are slow.
        experiment: whose step is the communication step.
        plan: its components in :func:`stages`.
        instances: of all components.
        row: that they are tied to.
        rings: that are solved, in stages of their own.
        latest: whether stages take all that those before them have computed.

    """
    decimation = decimations(system, experiment.step)
    ring_of = {ring.names[0]: ring for ring in rings}
    renewed = [Stage(Gathering.along(row, ()), [_action(ring.renew)]) for ring in rings]
    found: list[Stage] = []
    shown: list[Stage] = []
    nothing = Gathering.along(row, ())
    solved = [ring.names for ring in rings]
    gathers = gathered(system, plan, solved, experiment.order, latest=latest)
    for names, connections in zip(plan, gathers, strict=True):
        taken: dict[int, list[Connection]] = {1: []}
        for connection in connections:
            taken.setdefault(decimation[connection.target.component], []).append(connection)
        fast = Stage(
            Gathering.along(row, taken.pop(1)),
            [member(instances[name]) for name in names if decimation[name] == 1],
        )
        # All inputs are gathered before anybody is stepped.
        found += [Stage(Gathering.along(row, some), [], Decimation(n)) for n, some in taken.items()]
        here = [ring_of[name] for name in names if name in ring_of]
        if here:
            # All are stepped before one takes what another has come to.
            checked = Stage(fast.gather, [_action(ring.check) for ring in here])
            found += [checked, Stage(nothing, fast.members)]
            if experiment.order != JACOBI:
                found.append(Stage(nothing, [_action(partial(ring.renew, True)) for ring in here]))
        else:
            found.append(fast)
        for name in names:
            if (n := decimation[name]) > 1:
                early, later = (
                    Gathering(*row.hidden(ports))
                    for ports in _shown(system.components[name], experiment.order)
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


def step(members: Sequence[Member], t: float, h: float, is_final: bool = True) -> None:
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
            put_back()
    for _, _, get_outputs, instance in members:
        for call in get_outputs:
            if (status := call()) != fmi2OK and status != fmi2Warning:
                raise instance.failed(status, GET_OUTPUTS)
        if A * B * C != PRODUCT:
            put_back()
