"""The plan of a run, checked before any FMU is loaded; its stages, and its identity.

Every communication step has stages; which ones, loaded FMUs decide where rings are solved, and
those of other tools where no order is stated. Before a stage is stepped its inputs are gathered;
the outputs of a component are read as soon as it was stepped.

- `feedthrough`: two parts. First values of t_k pass: a component whose outputs have direct
  feedthrough takes its inputs and is read without a step, before those it feeds. The row shows
  them. Then all components are stepped.
- `jacobi`: one stage. All inputs are outputs of t_k.
- `gauss-seidel`: a component whose output has direct feedthrough is stepped in an earlier
  stage than those it feeds, so they receive without delay what follows from t_k. Outputs
  without feedthrough are states: all take them at t_k.
- the names of all components: the same in the order that they stand in.

A ring of feedthroughs that is not solved is opened before the one of its components that stands
first in the system, which takes what feeds it at t_k.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import lcm
from platform import python_version

from orchestrator.cosim.experiment import (
    FEEDTHROUGH,
    GAUSS_SEIDEL,
    JACOBI,
    LINEAR,
    Experiment,
    Order,
)
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import InputError, shortened
from orchestrator.machine.identity import PACKAGES, Identity, code_of


@dataclass(frozen=True)
class Plan:
    """What :func:`make_plan` makes of a system, for :func:`.simulation.simulate_plan` to run.

    Attributes:
        system: that is run.
        experiment: until when, in which steps and which order.
        decimations: how many communication steps one step of each component takes.
        remarks: what the user is told when it is run, in lines.

    """

    system: System
    experiment: Experiment
    decimations: Mapping[str, int]
    remarks: Sequence[str] = ()


def make_plan(system: System, experiment: Experiment) -> Plan:
    """Check what can be checked before an FMU is loaded.

    Where an FMU takes steps of one length only, a last, shorter step is left out.

    Raises:
        InputError: the system or its steps are not usable, or no step is left.

    """
    system.check()
    check_order(system, experiment.order)
    if experiment.coupling == LINEAR:
        _check_linear(system)
    found = system.decimations(experiment.step)
    remarks = tuple(
        f"{name}: {component.remainder}"
        for name, component in system.components.items()
        if component.unsupported
    )
    rigid = [name for name, component in system.components.items() if not component.takes_any_step]
    period = lcm(*(found[name] for name in rigid))
    whole = experiment.full_steps // period * period
    if not rigid or whole == experiment.rows - 1:
        return Plan(system, experiment, found, remarks)
    why = f"{', '.join(rigid)}: takes only steps of a fixed length, so"
    if whole == 0:
        shortest = period * experiment.step
        raise InputError(f"{why} the run must last at least one step, {shortest:g} s")
    end = experiment.time(whole)
    remark = f"{why} the run ends with the last whole step, at t = {end:.12g} s"
    return Plan(system, replace(experiment, stop_time=end), found, (*remarks, remark))


def _check_linear(system: System) -> None:
    """Check that the components of a system can be stepped with linear inputs.

    Raises:
        InputError: one that others feed cannot go back, or its inputs cannot change in a step; or
            one takes longer steps.

    """
    for name, component in system.components.items():
        if system.feeding[name] and not component.takes_linear_inputs:
            raise InputError(
                f"coupling linear: {name} cannot go back to the beginning of a step and let its "
                "inputs change in it (canGetAndSetFMUstate, canInterpolateInputs)"
            )
    if system.steps:
        raise InputError(
            f"coupling linear: {', '.join(system.steps)}: takes longer steps; leave them out"
        )


def stages(system: System, order: Order, solved: Sequence[Sequence[str]] = ()) -> list[list[str]]:
    """Components in the order in which they are stepped; within one stage they are independent.

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
        return system.in_stages(system.derived_order(solved), solved)
    check_order(system, order)
    return system.in_stages(order, solved)


def check_order(system: System, order: Order | None) -> None:
    """Check that an order that is stated names each component once.

    Raises:
        InputError: it does not.

    """
    if order is None or isinstance(order, str):
        return
    for name in order:
        system.component(name)
    stated = Counter(order)
    twice = [name for name, n in stated.items() if n > 1]
    missing = [name for name in system.components if name not in stated]
    for names, what in ((twice, "twice"), (missing, "not at all")):
        if names:
            raise InputError(
                f"order {','.join(order)}: names {', '.join(names)} {what}; it must name every "
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
    for connection in system.delayed_connections(system.derived_order(solved), solved):
        late.setdefault(connection.target.component, []).append(connection.source)
    found = []
    for name, sources in late.items():
        text = f"{name} takes {shortened(', '.join(map(str, sources)))} one step late: "
        concerned = (name, *(source.component for source in sources))
        why = next((reasons[one] for one in concerned if one in reasons), "") if reasons else ""
        found.append(f"{text}direct feedthroughs form a ring{why and f'; {why}'}")
    return found


def gathered_connections(
    system: System,
    sequence: Sequence[Sequence[str]],
    solved: Sequence[Sequence[str]] = (),
    order: Order = GAUSS_SEIDEL,
    *,
    latest: bool = False,
) -> list[list[Connection]]:
    """The connections along which values are gathered before each stage.

    Args:
        system: whose connections say what feeds what.
        sequence: its components in :func:`stages`.
        solved: rings among them, which gather by themselves what they feed themselves.
        order: of the stages.
        latest: whether stages take all that those before them have computed.

    """
    stage_of = {name: i for i, names in enumerate(sequence) for name in names}
    ring_of = {name: i for i, ring in enumerate(solved) for name in ring}
    found: list[list[Connection]] = [[] for _ in sequence]
    for connection in system.connections:
        start, end = connection.source.component, connection.target.component
        if start in ring_of and ring_of[start] == ring_of.get(end):
            continue
        source, target = stage_of[start], stage_of[end]
        # An output without feedthrough is a state, and must be read before any component advances.
        at_once = latest or (order != JACOBI and system.has_feedthrough(connection))
        there = order == FEEDTHROUGH or (at_once and source < target)
        found[target if there else 0].append(connection)
    return found


def identity(plan: Plan, events: Sequence[object] = (), inputs: str = "") -> Identity:
    """What makes a run the one that it is: all that decides its rows.

    Code counts by whole rooms, comments included: it is better to make a run once too often than to
    take another one for it. What other rooms decide is in the plan, the events and the inputs.

    How the steps are made, in which loop and process, is not in it: the rows are the same. Nor is
    where an FMU lies, or what a scenario is called.

    Args:
        plan: what is run.
        events: that happen to it.
        inputs: digest of the values of inputs over time; empty: they keep their values.

    """
    system = plan.system
    return {
        "the code": code_of("orchestrator.cosim"),
        "the version of Python": python_version(),
        **{f"the version of {package}": version(package) for package in PACKAGES},
        # Their order is the order of the columns, and says where a ring is opened.
        "the components": ", ".join(system.components),
        **{f"the FMU of {name}": part.digest for name, part in system.components.items()},
        # What follows from the units of the two ends is in the transformation.
        **{f"what feeds {wire.target}": repr(wire) for wire in system.connections},
        **{f"the step of {name}": repr(float(step)) for name, step in system.steps.items()},
        **_parameters(system),
        **{name: repr(value) for name, value in vars(plan.experiment).items()},
        "the events": repr(tuple(events)),
        "the inputs": inputs,
    }


def _parameters(system: System) -> dict[str, str]:
    """Those that are set to another value than the FMU's own."""
    return {
        str(name): repr(value)
        for name, value in system.parameters.items()
        if repr(value) != repr(system.components[name.component].starts.get(name.port))
    }
