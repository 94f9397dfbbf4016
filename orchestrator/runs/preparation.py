"""A run that is ready to be made, with the user's changes, and its companion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from auv_fmu.paper.euler import STEP
from orchestrator.cosim.experiment import (
    Experiment,
)
from orchestrator.cosim.fmi.isolated import Isolation, isolation_of
from orchestrator.cosim.hooks.events import Alter, Event, Events, Set
from orchestrator.cosim.hooks.hook import Hook
from orchestrator.cosim.hooks.timing import InputTable, Playback, RealTime
from orchestrator.cosim.loop import PYTHON_LOOP, Stepping, choose_loop
from orchestrator.cosim.observers.observer import Ending, Observer
from orchestrator.cosim.plan import Plan, make_plan
from orchestrator.cosim.simulation import simulate_plan
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.identity import Identity
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.loading import doubts_of, first_given, load_scenario
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import (
    Inputs,
    Scenario,
    check_events,
    read_inputs,
    read_scenario,
    role_of,
)
from orchestrator.runs.scenario_events import read_events, shared_events
from orchestrator.runs.wiring import closed_loop, component_of, read_wiring
from orchestrator.vehicle.signals import STANDARD, Loop, loops_of

#: The components that a comparison exchanges, and keeps.
CONTROLLER, PLANNER = STANDARD.controller, STANDARD.planner

#: Communication step of the paper [s], for systems that name none.
DEFAULT_STEP = STEP

#: Stop time of a system that names none, where it is only checked or exported [s].
FALLBACK_STOP_TIME = 1.0


@dataclass(frozen=True)
class Prepared:
    """A run that is ready to be made, and the scenario that it comes from.

    Attributes:
        scenario: as its file has it, but for events and inputs of the request.
        plan: the system, and its steps.
        isolation: of the FMUs in processes of their own; None: they run in this one.
        stepping: how its steps are made.
        real_time: simulated seconds in a second; None: as many as can be had.
        events: that happen to it.
        input_table: values of inputs over time; None: they keep their values.

    """

    scenario: Scenario
    plan: Plan
    isolation: Isolation | None = None
    stepping: Stepping = PYTHON_LOOP
    real_time: float | None = None
    events: tuple[Event, ...] = ()
    input_table: InputTable | None = None

    @property
    def system(self) -> System:
        """What is run."""
        return self.plan.system

    @property
    def experiment(self) -> Experiment:
        """Until when it is run, in which steps and which order."""
        return self.plan.experiment

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The loops of its vehicles."""
        return loops_of(self.system)

    def run(self, observers: Sequence[Observer], hooks: Sequence[Hook] = ()) -> Ending:
        """Make the run.

        Args:
            observers: take its rows.
            hooks: act on it before its own do.

        Raises:
            InputError: an FMU or a parameter is not usable; nothing was stepped.

        """
        return simulate_plan(
            self.plan, observers, self.isolation, self.stepping, [*hooks, *self._hooks()]
        )

    def doubts(self) -> list[str]:
        """What may have been forgotten, in lines: inputs without a source, a part of a vehicle."""
        actions = [event.action for event in self.events]
        given = {*(self.input_table.targets if self.input_table else ())}
        given |= {port for one in actions if isinstance(one, Alter) for port, _ in one.values}
        given |= {port for one in actions if isinstance(one, Set) for port, _ in one.inputs}
        return doubts_of(self.system, given)

    @property
    def identity(self) -> Identity:
        """All that its rows depend on."""
        inputs = self.input_table.digest if self.input_table else ""
        return self.plan.identity(self.events, inputs)

    def _hooks(self) -> list[Hook]:
        playing: list[Hook] = [] if self.input_table is None else [Playback(self.input_table)]
        return playing + ([Events(self.events)] if self.events else [])

    def missed(self, ending: Ending) -> list[Event]:
        """The events that have not happened in a run of it."""
        happened = {occurrence.event for occurrence in ending.events}
        return [event for i, event in enumerate(self.events) if i not in happened]


def prepare_request(request: Request) -> Prepared:
    """Prepare what a request asks for.

    Raises:
        InputError: there is no such scenario, or something about the request cannot be done.

    """
    return prepare(*load_scenario(request.scenario, request.kind), request)


def prepare(scenario: Scenario, system: System, request: Request) -> Prepared:
    """A scenario with the user's changes.

    Raises:
        InputError: something about the request cannot be done.

    """
    findings, values = Findings(request.strict), system.expanded(request.parameters)
    system = system.with_parameters(values)
    input_table = None
    if request.inputs is not None:
        scenario = replace(scenario, inputs=Inputs(Path(request.inputs), wins=True))
    if scenario.inputs is not None:
        given = {*values} if scenario.inputs.wins else {*values, *scenario.parameters}
        with findings.collecting():
            system, input_table = read_inputs(scenario.inputs, system, given)
    if isinstance(request.events, str):
        scenario = replace(scenario, events=read_scenario(request.events).events)
    elif request.events is not None:
        check_events("events", request.events)
        scenario = replace(scenario, events=request.events)
    stop_time = first_given(request.stop_time, scenario.stop_time, system.stop_time)
    if stop_time is None:
        raise InputError(f"{scenario.name}: has no stop time; set one with --stop-time")
    system = replace(system, steps={**system.steps, **request.steps})
    step = first_given(request.step, scenario.step, system.step)
    if step is None:
        system = system.with_common_step()
        step = DEFAULT_STEP if system.step is None else system.step
    order = request.order or scenario.order or None
    coupling = first_given(request.coupling, scenario.coupling)
    if request.strict and coupling is None and order in (None, "feedthrough", "gauss-seidel"):
        coupling = "solve"
    experiment = Experiment(stop_time, step, order, system.start_time or 0.0, coupling)
    plan = make_plan(system, experiment)
    with findings.collecting():
        followed = input_table.targets if input_table else ()
        events = read_events(scenario.name, scenario.events, replace(system, step=step), followed)
    findings.refuse()
    isolation = isolation_of(request.isolate, request.step_timeout)
    stepping = choose_loop(request.loop, experiment, isolation)
    if request.real_time is not None:
        RealTime.check(request.real_time)
    return Prepared(scenario, plan, isolation, stepping, request.real_time, events, input_table)


def with_companion(prepared: Prepared, request: Request) -> list[Prepared]:
    """A scenario, and the one it is compared with, if there is one.

    Settings of the scenario and of the user apply to both, where both have them. The companion
    keeps its controller, and follows the reference of the scenario.

    Raises:
        InputError: something about the request cannot be done for the companion.

    """
    scenario = prepared.scenario
    if not scenario.compare:
        return [prepared]
    companion, system = load_scenario(scenario.compare, request.kind)
    if scenario.digest and companion.digest:
        companion, system = _beside(scenario, prepared.system, companion, system, request.kind)
    inputs = scenario.inputs or companion.inputs
    followed = {system.named(PortName.read(name)) for name in inputs.names} if inputs else ()
    given = prepared.system.expanded(request.parameters)
    shared = {
        target: value
        for target, value in {**scenario.parameters, **given}.items()
        if system.has(target) and system.named(target) not in followed
    }
    steps = {
        name: step
        for name, step in {**scenario.steps, **request.steps}.items()
        if name in system.components
    }
    own = companion.events if request.events is None else ()
    same = replace(
        companion,
        stop_time=scenario.stop_time,
        step=scenario.step,
        order=scenario.order,
        coupling=scenario.coupling,
        events=shared_events(own or scenario.events, system, followed),
        inputs=inputs,
    )
    wanted = replace(request, parameters=shared, steps=steps, events=None, inputs=None)
    return [prepared, prepare(same, system, wanted)]


def _beside(
    scenario: Scenario, system: System, companion: Scenario, other: System, kind: str
) -> tuple[Scenario, System]:
    """A companion in the surroundings of a scenario, whose controllers are compared.

    Where both have the same controller, something else is compared, and only the reference is
    the scenario's.

    Args:
        scenario: that it is compared with.
        system: of the scenario.
        companion: as its file has it.
        other: of the companion.
        kind: of the bundle's FMUs.

    """
    if scenario.vehicles != companion.vehicles:
        raise InputError(
            f"{scenario.name}: compare = {companion.name!r}: write the same number of vehicles in "
            f"both, not {scenario.vehicles or 'none'} and {companion.vehicles or 'none'}"
        )
    standard = read_wiring(scenario.vehicles)["components"]
    ours, theirs = ({**standard, **one.components} for one in (scenario, companion))
    controllers = {name for name in (*ours, *theirs) if role_of(name) == CONTROLLER}
    # What is outside of all vehicles leads them.
    planners = {
        name
        for name in (*ours, *theirs)
        if role_of(name) == PLANNER or (scenario.vehicles and role_of(name) == name)
    }
    is_compared = any(ours.get(name) != theirs.get(name) for name in controllers)
    shared = ours.keys() - controllers if is_compared else ours.keys() & planners

    def is_taken(target: str, source: str | bool) -> bool:
        if component_of(target, ours) not in shared:
            return False
        start = component_of(source, ours) if isinstance(source, str) else None
        if start is None or start in shared:
            return True
        there = other.components.get(start)
        group = f"{str(source)[len(start) + 1 :]}."
        return there is not None and any(v.startswith(group) for v in there.variables)

    wires = {
        target: source
        for target, source in companion.wires.items()
        if component_of(target, theirs) not in planners
    }
    wires |= {
        target: source for target, source in scenario.wires.items() if is_taken(target, source)
    }
    only, given = companion.only, companion.parameters
    if is_compared and not controllers.isdisjoint(scenario.only):
        only = [*scenario.only, *(name for name in theirs if name not in ours)]
    companion = replace(
        companion,
        components={
            **{name: fmu for name, fmu in theirs.items() if name in ours or name not in planners},
            **{name: ours[name] for name in shared},
        },
        wires=wires,
        only=only,
        parameters={},
    )
    new = closed_loop(current_fmus(kind), companion)
    fed = {connection.target for connection in new.connections}
    values = {
        name: system.value(name) if is_planned else value
        for name, value in given.items()
        for is_planned in [new.named(name).component in planners]
        if new.has(name) and (system.has(name) or not is_planned) and new.named(name) not in fed
    }
    steps = {
        name: step
        for name, step in companion.steps.items()
        if name in new.components and name not in planners
    }
    return replace(companion, parameters=values), replace(new.with_parameters(values), steps=steps)
