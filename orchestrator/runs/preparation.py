"""A run that is ready to be made, with the user's changes, and its companion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from auv_fmu.paper.euler import STEP
from orchestrator.cosim import (
    Alter,
    Ending,
    Event,
    Events,
    Experiment,
    Hook,
    InputTable,
    Isolation,
    Observer,
    Plan,
    PortName,
    Set,
    System,
    make_plan,
    simulate_plan,
)
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.identity import Identity
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.loading import doubts_of, first_given, load_scenario
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import (
    Inputs,
    Scenario,
    check_events,
    read_events,
    read_inputs,
    read_scenario,
    shared_events,
)
from orchestrator.runs.wiring import closed_loop, read_wiring
from orchestrator.vehicle.signals import Loop, loops_of

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
        events: that happen to it.
        input_table: values of inputs over time; None: they keep their values.

    """

    scenario: Scenario
    plan: Plan
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
        return simulate_plan(self.plan, observers, [*hooks, *self._hooks()])

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
        playing: list[Hook] = [] if self.input_table is None else [self.input_table.playback()]
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
    isolation = Isolation.of(request.isolate, request.step_timeout)
    plan = make_plan(system, experiment, isolation, request.loop)
    with findings.collecting():
        followed = input_table.targets if input_table else ()
        events = read_events(scenario.name, scenario.events, replace(system, step=step), followed)
    findings.refuse()
    return Prepared(scenario, plan, events, input_table)


def with_companion(prepared: Prepared, request: Request) -> list[Prepared]:
    """Prepare the run that a scenario is compared with, too, if there is one.

    It is the scenario but for the entries of `[compare]`. All other settings of the scenario and of
    the user apply to both runs, where both have such a port.

    Raises:
        InputError: something about the request cannot be done for the companion.

    """
    scenario, difference = prepared.scenario, prepared.scenario.compare
    if difference is None:
        return [prepared]
    standard = read_wiring(scenario.vehicles)["wires"]
    wires = {
        target: source
        for target, source in {**scenario.wires, **difference.wires}.items()
        # A wire of the scenario's own is removed by not being there.
        if source is not False or target in standard or target not in scenario.wires
    }
    companion = replace(
        scenario,
        name=difference.name,
        label=difference.label,
        title=f"{scenario.title or scenario.name} ({difference.label or difference.name})",
        compare=None,
        components={**scenario.components, **difference.components},
        wires=wires,
        only=scenario.only and [*scenario.only, *difference.components],
        parameters={},
    )
    system = closed_loop(current_fmus(request.kind), companion)
    fed = {connection.target for connection in system.connections}

    def shared(values: Mapping[PortName, Any]) -> dict[PortName, Any]:
        return {
            name: value
            for name, value in values.items()
            if system.has(name) and system.named(name) not in fed
        }

    values = {**shared(scenario.parameters), **system.expanded(difference.parameters)}
    companion = replace(companion, parameters=values, events=shared_events(scenario.events, system))
    given = shared(prepared.system.expanded(request.parameters))
    wanted = replace(request, parameters=given, events=None, inputs=None)
    return [prepared, prepare(companion, system.with_parameters(values), wanted)]
