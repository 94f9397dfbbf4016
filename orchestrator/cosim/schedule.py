"""The stages of a communication step, as the loops make them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from fmpy.fmi2 import fmi2Error, fmi2OK, fmi2Warning

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.instance import DO_STEP, GET_OUTPUTS, SET_INPUTS, Instance
from orchestrator.cosim.fmi.surroundings import PRODUCT, A, B, C, restore_mode
from orchestrator.cosim.fmi.transfer import CMember, CMove, DoStepCallback, address_of
from orchestrator.cosim.plan import Plan
from orchestrator.cosim.ring import Ring
from orchestrator.cosim.row import Gathering, Row
from orchestrator.cosim.stages import (
    ALL,
    CHECK,
    RENEW,
    RENEW_ALWAYS,
    Close,
    Closing,
    Decimation,
    Reads,
    Visit,
    stages_of,
    types_read,
)
from orchestrator.cosim.stages import Stage as StageByNames
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.values import TYPES

#: What closes a ring.
_CLOSES: Mapping[Closing, Callable[[Ring], object]] = {
    CHECK: Ring.check,
    RENEW: Ring.renew,
    RENEW_ALWAYS: partial(Ring.renew, always=True),
}


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
    ring_of = {ring.names[0]: ring for ring in rings}

    def linked(visit: Visit | Close) -> Member:
        if isinstance(visit, Close):
            close, ring = _CLOSES[visit.how], ring_of[visit.ring[0]]
            return StageCall(lambda _t, _h: close(ring)).member
        return _visiting(visit, instances[visit.component], plan.system.components[visit.component])

    def all_linked(found: Sequence[StageByNames]) -> list[Stage]:
        return [
            Stage(
                Gathering(*row.hidden(stage.shows))
                if stage.shows
                else Gathering.along(row, stage.connections),
                list(map(linked, stage.visits)),
                stage.decimation,
            )
            for stage in found
        ]

    found = stages_of(plan, sequence, [ring.names for ring in rings], latest=latest)
    return Schedule(
        all_linked(found.stepping), None if found.passing is None else all_linked(found.passing)
    )


def member(instance: Instance) -> Member:
    """The calls of an instance that is tied to a row."""
    return Member(instance.set_inputs, instance.do_step, instance.get_outputs, instance)


def _visiting(visit: Visit, instance: Instance, component: Component) -> Member:
    """The calls that do what a component does in a stage."""
    return Member(
        instance.set_inputs if visit.takes else [],
        instance.do_step if visit.steps else instance.do_exchange,
        _reading(visit.reads, instance, component),
        instance,
    )


def _reading(reads: Reads, instance: Instance, component: Component) -> list[Callable[[], int]]:
    """The calls that read some outputs of a component, each all of a type."""
    # The answer of another process has to be taken.
    if reads == ALL or not instance.is_here:
        return instance.get_outputs
    outputs = component.having("output")
    types = [fmi_type for fmi_type in TYPES if any(one.type == fmi_type for one in outputs)]
    wanted = types_read(reads, component, (one.name for one in outputs))
    return [call for call, of in zip(instance.get_outputs, types, strict=True) if of in wanted]


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
