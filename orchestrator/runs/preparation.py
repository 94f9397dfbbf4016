"""From a name to what is run: a scenario or a file of others, with the user's changes."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from auv_fmu.euler import STEP
from fmus.kinds import FMI_VERSIONS, PYTHON
from orchestrator.figures import check_figure
from orchestrator.formats.examination import open_inputs
from orchestrator.formats.osp import STRUCTURE as OSP
from orchestrator.formats.osp import read_osp
from orchestrator.formats.ssp import STRUCTURE as SSD
from orchestrator.formats.ssp.reader import read_ssp
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.user_files import is_folder
from orchestrator.master.experiment import (
    GAUSS_SEIDEL,
    ORDERS,
    SOLVE,
    Experiment,
    step_of,
    with_common_step,
)
from orchestrator.master.fmi.isolated import Isolation, isolation_of
from orchestrator.master.hooks.clock import check_factor
from orchestrator.master.hooks.events import Alter, Event, Events, Set
from orchestrator.master.hooks.hook import Hook
from orchestrator.master.hooks.playback import InputTable, Playback
from orchestrator.master.identity import Identity, identity
from orchestrator.master.loop import PYTHON_LOOP, Stepping, chosen
from orchestrator.master.observers.observer import Ending, Observer
from orchestrator.master.plan import Plan, planned
from orchestrator.master.simulation import simulate
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.inputs import Inputs, read_inputs
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario, check_events, names, read_scenario
from orchestrator.runs.scenario_events import read_events, shared_events
from orchestrator.runs.wiring import closed_loop, read_wiring
from orchestrator.system.component import RUNNABLE, WRITABLE, read_component
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.vehicle.cautions import differing_vehicle
from orchestrator.vehicle.signals import STANDARD

T = TypeVar("T")

#: The components that a comparison exchanges, and keeps.
CONTROLLER, PLANNER = STANDARD.controller, STANDARD.planner

#: Communication step of the paper [s], for systems that name none.
DEFAULT_STEP = STEP

#: Stop time of a system that names none, where it is only checked or exported [s].
SOME_TIME = 1.0


@dataclass(frozen=True)
class Prepared:
    """A run that is ready to be made, and the scenario that it comes from.

    Attributes:
        scenario: as its file has it.
        plan: the system, and its steps.
        isolation: of the FMUs in processes of their own; None: they run in this one.
        loop: that makes the steps.
        real_time: simulated seconds in a second; None: as many as can be had.
        events: that happen to it.
        input_table: values of inputs over time; None: they keep their values.

    """

    scenario: Scenario
    plan: Plan
    isolation: Isolation | None = None
    loop: Stepping = PYTHON_LOOP
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

    def run(self, observers: Sequence[Observer], hooks: Sequence[Hook] = ()) -> Ending:
        """Make the run.

        Args:
            observers: take its rows.
            hooks: act on it before its own do.

        Raises:
            InputError: an FMU or a parameter is not usable; nothing was stepped.

        """
        return simulate(self.plan, observers, self.isolation, self.loop, [*hooks, *self._hooks()])

    def doubts(self) -> list[str]:
        """What may have been forgotten, in lines: inputs without a source, a part of a vehicle."""
        actions = [event.action for event in self.events]
        given = {*(self.input_table.targets if self.input_table else ())}
        given |= {port for one in actions if isinstance(one, Alter) for port, _ in one.values}
        given |= {port for one in actions if isinstance(one, Set) for port, _ in one.inputs}
        return _doubts(self.system, given)

    @property
    def identity(self) -> Identity:
        """All that its rows depend on."""
        return identity(self.system, self.experiment, self.events, self.input_table)

    def _hooks(self) -> list[Hook]:
        playing: list[Hook] = [] if self.input_table is None else [Playback(self.input_table)]
        return playing + ([Events(self.events)] if self.events else [])

    def missed(self, ending: Ending) -> list[Event]:
        """The events that have not happened in a run of it."""
        happened = {occurrence.event for occurrence in ending.events}
        return [event for i, event in enumerate(self.events) if i not in happened]


def load(
    name: str | Path, kind: str = PYTHON, *, variant: str | None = None, strict: bool = False
) -> System:
    """The system of a scenario, or of a file of others, with its experiment.

    What is not as it should be and does no harm is a warning.

    Args:
        name: of a scenario of the bundle, or path of a .toml file, an SSP, an FMU, or libcosim's
            OspSystemStructure.xml; an SSP and the latter may also be a folder.
        kind: of the bundle's FMUs, `python` or `native`.
        variant: which of the descriptions in an SSP; None: the default.
        strict: refuse what otherwise is a warning.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    with warned(strict) as findings:
        scenario, system = loaded(str(name), kind, variant=variant, findings=findings)
        left = left_behind(scenario)
        for note in [left] if left else _doubts(system):
            findings.note(note)
        findings.refuse()
    return replace(
        system,
        name=scenario.name,
        stop_time=_first_given(scenario.stop_time, system.stop_time),
        step=_first_given(scenario.step, system.step),
    )


@contextmanager
def warned(strict: bool = False) -> Iterator[Findings]:
    """Findings whose notes become warnings, as Python has them."""
    findings = Findings(strict)
    yield findings
    for note in findings.notes:
        warnings.warn(note, stacklevel=4)


def loaded(
    name: str,
    kind: str = PYTHON,
    fmi: str = FMI_VERSIONS[0],
    variant: str | None = None,
    findings: Findings | None = None,
) -> tuple[Scenario, System]:
    """A scenario and its system.

    Args:
        name: of a scenario of the bundle, or path of a .toml file, an SSP, an FMU, or libcosim's
            OspSystemStructure.xml; an SSP and the latter may also be a folder.
        kind: of the bundle's FMUs, `python` or `native`; FMUs that a file names are as they are.
        fmi: their version of FMI. The master can step those of the first.
        variant: which of the descriptions in an SSP; None: the default.
        findings: takes what is wrong with it; None: nobody asks for what does no harm.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    path = Path(name)
    read = _reader(path)
    if variant is not None and read is not read_ssp:
        raise InputError(f"{name}: has no variants; an SSP may have")
    if read is not None:
        check_brings_its_own(name, kind, fmi)
        system = read_ssp(path, variant, findings) if read is read_ssp else read(path, findings)
        whole = path.resolve()
        named = whole.parent if path.name in (SSD, OSP) else whole
        return Scenario(named.stem, title=path.name or named.name), system
    scenario = read_scenario(name)
    check_figure(scenario.figure)
    versions = RUNNABLE if fmi == FMI_VERSIONS[0] else WRITABLE
    return scenario, closed_loop(current_fmus(kind, fmi), scenario, versions)


def read_fmu(path: Path, findings: Findings | None = None) -> System:
    """A system of one FMU, with the experiment that it was made for.

    Raises:
        InputError: the file is missing, or is no FMU that can be run.

    """
    name = re.sub(r"\W", "_", path.stem)
    component = read_component(name, path, findings=findings)
    return System(
        name=path.stem,
        components={name: component},
        connections=(),
        start_time=component.experiment("startTime"),
        stop_time=component.experiment("stopTime"),
        step=step_of(component),
    )


#: Who reads what is no scenario, by the endings of files.
_READERS: Mapping[str, Callable[..., System]] = {
    ".ssp": read_ssp,
    ".ssd": read_ssp,
    ".xml": read_osp,
    ".fmu": read_fmu,
}


def is_path(name: str) -> bool:
    """Whether what is run is named by a path: all else is the name of a scenario."""
    return name.endswith((".toml", *_READERS))


def _reader(path: Path) -> Callable[..., System] | None:
    """Who reads a file or folder; None: it is a scenario."""
    if path.suffix in _READERS or str(path) in names() or not is_folder(path):
        return _READERS.get(path.suffix)
    return read_osp if (path / OSP).is_file() and not (path / SSD).is_file() else read_ssp


def left_behind(scenario: Scenario) -> str | None:
    """What of a scenario a system by itself does not have, in words."""
    has = {"events": bool(scenario.events), "inputs": scenario.inputs is not None}
    names = " and ".join(name for name, there in has.items() if there)
    return f"{scenario.name}: the system comes without the scenario's {names}" if names else None


def check_brings_its_own(name: str, kind: str, fmi: str = FMI_VERSIONS[0]) -> None:
    """Check that no other FMUs are asked for than those that a system comes with.

    Raises:
        InputError: it would not have any effect.

    """
    if (kind, fmi) != (PYTHON, FMI_VERSIONS[0]):
        raise InputError(f"{name}: comes with its FMUs; kind and fmi are for the bundle's own")


def prepared_of(request: Request) -> Prepared:
    """What a request asks for.

    Raises:
        InputError: there is no such scenario, or something about the request cannot be done.

    """
    return prepare(*loaded(request.scenario, request.kind), request)


def prepare(scenario: Scenario, system: System, request: Request) -> Prepared:
    """A scenario with the user's changes.

    Raises:
        InputError: something about the request cannot be done.

    """
    findings, values = Findings(request.strict), request.values
    system = system.with_parameters(values)
    input_table, inputs = None, scenario.inputs
    if request.inputs is not None:
        inputs = Inputs(Path(request.inputs))
    if inputs is not None:
        given = set(values)
        if request.inputs is None:
            given |= set(scenario.parameters)
        with findings.collecting():
            system, input_table = read_inputs(inputs, system, given)
    system.check()
    events = _events(request)
    if events is None:
        events = scenario.events
    else:
        check_events("events", events)
    stop_time = _first_given(request.stop_time, scenario.stop_time, system.stop_time)
    if stop_time is None:
        raise InputError(f"{scenario.name}: names no stop time; give one with --stop-time")
    system = replace(system, steps={**system.steps, **request.steps})
    step = _first_given(request.step, scenario.step, system.step)
    if step is None:
        system = with_common_step(system)
        step = _first_given(system.step, DEFAULT_STEP)
        assert step is not None
    order = request.order or scenario.order or ORDERS[0]
    coupling = _first_given(request.coupling, scenario.coupling)
    if request.strict and coupling is None and order == GAUSS_SEIDEL:
        coupling = SOLVE
    experiment = Experiment(stop_time, step, order, system.start_time or 0.0, coupling)
    plan = planned(system, experiment)
    with findings.collecting():
        happening = read_events(scenario.name, events, replace(system, step=step))
    findings.refuse()
    isolation = isolation_of(request.isolate, request.step_timeout)
    loop = chosen(request.loop, experiment, isolation)
    if request.real_time is not None:
        check_factor(request.real_time)
    return Prepared(
        scenario,
        plan,
        isolation,
        loop,
        request.real_time,
        happening,
        input_table,
    )


def with_companion(prepared: Prepared, request: Request) -> list[Prepared]:
    """A scenario, and the one it is compared with, if there is one.

    What the scenario and the user set goes for both, as far as both have it. The companion keeps
    its controller, and follows the reference of the scenario.

    Raises:
        InputError: something about the request cannot be done for the companion.

    """
    scenario = prepared.scenario
    if not scenario.compare:
        return [prepared]
    companion, system = loaded(scenario.compare, request.kind)
    if scenario.digest and companion.digest:
        companion, system = _beside(scenario, prepared.system, companion, system, request.kind)
    played = prepared.input_table.targets if prepared.input_table else ()
    shared = {
        target: value
        for target, value in {**scenario.parameters, **request.values}.items()
        if system.has(target) and target not in played
    }
    steps = {
        name: step
        for name, step in {**scenario.steps, **request.steps}.items()
        if name in system.components
    }
    events = _events(request)
    if events is None:
        events = companion.events or scenario.events
    same = replace(
        companion,
        stop_time=scenario.stop_time,
        step=scenario.step,
        order=scenario.order,
        coupling=scenario.coupling,
        events=shared_events(events, system),
        inputs=scenario.inputs or companion.inputs,
    )
    wanted = replace(request, parameters=shared, steps=steps, events=None)
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
    standard = read_wiring()["components"]
    ours, theirs = ({**standard, **one.components} for one in (scenario, companion))
    is_compared = ours[CONTROLLER] != theirs[CONTROLLER]
    shared = ours.keys() - {CONTROLLER} if is_compared else {PLANNER}

    def is_taken(target: str, source: str | bool) -> bool:
        if port_name(target).component not in shared:
            return False
        start = port_name(source) if isinstance(source, str) else None
        if start is None or start.component in shared:
            return True
        there = other.components.get(start.component)
        return there is not None and any(v.startswith(f"{start.port}.") for v in there.variables)

    wires = {
        target: source
        for target, source in companion.wires.items()
        if port_name(target).component != PLANNER
    }
    wires |= {
        target: source for target, source in scenario.wires.items() if is_taken(target, source)
    }
    only, given = companion.only, companion.parameters
    if is_compared and CONTROLLER in scenario.only:
        only = [*scenario.only, *(name for name in theirs if name not in ours)]
    companion = replace(
        companion,
        components={**theirs, **{name: ours[name] for name in shared}},
        wires=wires,
        only=only,
        parameters={},
    )
    new = closed_loop(current_fmus(kind), companion)
    values = {
        name: system.value(name) if name.component == PLANNER else value
        for name, value in given.items()
        if new.has(name) and (name.component != PLANNER or system.has(name))
    }
    steps = {
        name: step
        for name, step in companion.steps.items()
        if name in new.components and name != PLANNER
    }
    return replace(companion, parameters=values), replace(new.with_parameters(values), steps=steps)


def _doubts(system: System, given: Collection[PortName] = ()) -> list[str]:
    if len(system.components) == 1:
        # No other one could feed it.
        return []
    found = open_inputs(system, given), differing_vehicle(system)
    return [text for text in found if text is not None]


def _events(request: Request) -> Sequence[Mapping[str, Any]] | None:
    """The events that a request has in the place of the scenario's; None: the scenario's own."""
    if isinstance(request.events, str):
        return read_scenario(request.events).events
    return request.events


def _first_given(*values: T | None) -> T | None:
    return next((value for value in values if value is not None), None)
