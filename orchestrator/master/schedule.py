"""Which components are stepped when, and on whose outputs.

Every communication step has stages. Before a stage is stepped its inputs are gathered; the
outputs of a component are read as soon as it was stepped.

- `jacobi`: one stage. All inputs are outputs of t_k.
- `gauss-seidel`: a component whose output has direct feedthrough is stepped in an earlier
  stage than those it feeds, so they receive without delay what follows from t_k. Outputs
  without feedthrough are states: everybody takes them at t_k.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from fmpy.fmi2 import fmi2Warning

from orchestrator.master.instance import Instance
from orchestrator.master.row import Row
from orchestrator.master.signals import Gathering
from orchestrator.system.graph import feedthrough_stages, has_feedthrough
from orchestrator.system.structure import Connection, System

#: What a component is asked for in every step, one after the other.
CALLS = SET_INPUTS, DO_STEP, GET_OUTPUTS = "setting inputs", "fmi2DoStep", "getting outputs"


class Member(NamedTuple):
    """The calls that step one component."""

    set_inputs: list[Callable[[], int]]
    do_step: Callable[[float, float, int], int]
    get_outputs: list[Callable[[], int]]
    instance: Instance


class Stage(NamedTuple):
    """Inputs to gather, and the components to step then."""

    gather: Gathering
    members: list[Member]


def stages(system: System, order: str) -> list[list[str]]:
    """Components in the order in which they are stepped; those of one stage are independent.

    Raises:
        InputError: direct feedthroughs form a loop.

    """
    return [list(system.components)] if order == "jacobi" else feedthrough_stages(system)


def schedule(
    system: System, plan: Sequence[Sequence[str]], instances: Mapping[str, Instance], row: Row
) -> list[Stage]:
    """The stages of every step.

    Args:
        system: whose connections say what feeds what.
        plan: its components in :func:`stages`.
        instances: of all components.
        row: that they are tied to.

    """
    stage_of = {name: i for i, names in enumerate(plan) for name in names}
    gathered: list[list[Connection]] = [[] for _ in plan]
    for connection in system.connections:
        # What is no feedthrough is a state, and must be taken before anybody advances.
        late = len(plan) > 1 and has_feedthrough(system, connection)
        gathered[stage_of[connection.target.component] if late else 0].append(connection)
    return [
        Stage(Gathering(row, connections), [member(instances[name]) for name in names])
        for names, connections in zip(plan, gathered, strict=True)
    ]


def member(instance: Instance) -> Member:
    """The calls of an instance that is tied to a row."""
    return Member(instance.set_inputs, instance.do_step, instance.get_outputs, instance)


def step(members: Sequence[Member], t: float, h: float) -> None:
    """Step the components of a stage, which may run side by side until their outputs are asked."""
    for set_inputs, do_step, _, instance in members:
        for call in set_inputs:
            if (status := call()) > fmi2Warning:
                raise instance.failed(status, SET_INPUTS)
        if (status := do_step(t, h, 1)) > fmi2Warning:
            raise instance.failed(status, DO_STEP)
    for _, _, get_outputs, instance in members:
        for call in get_outputs:
            if (status := call()) > fmi2Warning:
                raise instance.failed(status, GET_OUTPUTS)
