"""From the name of a system to a run that is ready to be made.

:func:`load_scenario` reads a scenario of the bundle, or a file that contains its own FMUs;
:func:`prepare` applies the user's changes, and :func:`with_companion` adds the run that a scenario
is compared with.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import radians, tau
from pathlib import Path
from typing import Any, TypeVar

from auv_fmu.paper.euler import STEP
from fmus.discovery import ORIGIN, origin_of
from fmus.kinds import AUTO, FMI_VERSIONS, NATIVE, FmiVersion, KindName
from orchestrator.cosim import (
    Alter,
    Component,
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
    read_component,
    read_osp,
    read_ssp,
    simulate_plan,
)
from orchestrator.figures.run_figures import check_figure
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.identity import Identity
from orchestrator.machine.user_files import is_folder
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.made_components import with_fmus
from orchestrator.runs.request import PROGRAM, Request, SystemOptions
from orchestrator.runs.scenario import (
    Inputs,
    Scenario,
    check_events,
    names,
    read_events,
    read_inputs,
    read_scenario,
    scenario_of,
    shared_events,
)
from orchestrator.runs.wiring import check_built, closed_loop, read_wiring
from orchestrator.vehicle.cautions import differing_vehicle, samples_too_old
from orchestrator.vehicle.signals import Loop, loops_of

T = TypeVar("T")

#: Communication step of the paper [s], for systems without a step.
DEFAULT_STEP = STEP

#: Stop time of a system without one, if it is only checked or exported [s].
FALLBACK_STOP_TIME = 1.0

#: The caller of a function of the Python interface, seen from where it is warned.
_STACK_LEVEL = 5

#: Number of steps of a run without an end.
MANY_STEPS = 500_000_000

# Loading


def load(
    name: str | Path | Mapping[str, Any],
    kind: KindName = AUTO,
    *,
    fmi: FmiVersion = FMI_VERSIONS[0],
    variant: str | None = None,
    strict: bool = False,
) -> System:
    """Read the system of a scenario, of an SSP or of another file, with its experiment.

    Harmless flaws give a warning.

    Args:
        name: name of a scenario, path of a .toml file, an SSP, an FMU or libcosim's
            OspSystemStructure.xml, or a dictionary with the entries of a scenario file. An
            unpacked SSP and the folder of an OspSystemStructure.xml also work.
        kind: kind of the bundle's FMUs: `python`, `native`, or `auto`, native where available.
        fmi: their version of FMI, `2` or `3`.
        variant: name of a system description in an SSP; None: the default.
        strict: treat warnings as errors.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    findings = Findings(strict)
    scenario, system = load_scenario(name, kind, fmi, variant, findings)
    lost = left_behind(scenario)
    warn_of(findings, [lost] if lost else doubts_of(system))
    return replace(
        system,
        name=scenario.name,
        stop_time=first_given(scenario.stop_time, system.stop_time),
        step=first_given(scenario.step, system.step),
    )


def warn_of(findings: Findings, notes: Sequence[str], stacklevel: int = 3) -> None:
    """Add notes to findings and give all as Python's warnings, for the caller of the caller.

    Raises:
        Refused: the findings have problems.

    """
    for note in notes:
        findings.note(note)
    findings.refuse()
    for note in findings.notes:
        warnings.warn(note, stacklevel=stacklevel)


def load_scenario(
    name: str | Path | Mapping[str, Any],
    kind: str = AUTO,
    fmi: str = FMI_VERSIONS[0],
    variant: str | None = None,
    findings: Findings | None = None,
    platforms: str | None = None,
) -> tuple[Scenario, System]:
    """Load a scenario, with a value for each port, and its system.

    Args:
        name, kind, fmi, variant: as in :func:`load`.
        findings: takes flaws; None: harmless flaws are ignored, and an FMU that is older than its
            script gives a warning.
        platforms: of the bundle's FMUs, with commas between them; None: this machine.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    path = None if isinstance(name, Mapping) else Path(name)
    read = None if path is None else _reader(path)
    if variant is not None and read is not read_ssp:
        what = "a dictionary" if path is None else f"{name}:"
        raise InputError(f"{what} has no variants; only an SSP can have them")
    if path is None or read is None:
        scenario = scenario_of(name) if isinstance(name, Mapping) else read_scenario(str(name))
        check_figure(scenario.figure)
        folder = current_fmus(kind, fmi, platforms)
        system = closed_loop(folder, with_fmus(scenario, folder, kind, platforms))
        scenario = replace(scenario, parameters=system.expanded(scenario.parameters))
    else:
        check_brings_its_own(str(name), kind, fmi, platforms)
        system = read_ssp(path, variant, findings) if read is read_ssp else read(path, findings)
        named = path.resolve().parent if path.name in _STRUCTURES else path.resolve()
        scenario = Scenario(named.stem, title=path.name or named.name)
    for text in filter(None, map(outdated, system.components.values())):
        if findings is None:
            warnings.warn(text, stacklevel=2)
        else:
            findings.note(text)
    return scenario, system


def outdated(component: Component) -> str | None:
    """Warn that the FMU of a user's script is older than the script; None: it is not."""
    record = component.folder / ORIGIN
    origin = origin_of(record.read_bytes()) if record.is_file() else None
    # An FMU that was renamed is kept on purpose, beside a newer script.
    if origin is None or component.fmu.name != origin.fmu:
        return None
    changed = origin.changed(component.fmu)
    if not changed:
        return None
    command = f"auv-fmu build {origin.place(component.fmu) / origin.script}"
    command += f" --kind {NATIVE}" * (origin.kind == NATIVE)
    command += " --fmi 3" * (component.description.fmiMajorVersion == 3)
    command += f" --out {component.fmu.parent}" * (origin.folder != ".")
    return (
        f"{component.name}: {component.fmu} is older than {changed[0]}; build it again ({command}) "
        "or give it another name"
    )


def read_fmu(path: Path, findings: Findings | None = None) -> System:
    """Read an FMU as a system of one component, with its default experiment.

    Raises:
        InputError: the file is missing, or is not an FMU that can be run.

    """
    name = re.sub(r"\W", "_", path.stem)
    check_built(path)
    component = read_component(name, path, findings=findings)
    return System(
        name=path.stem,
        components={name: component},
        connections=(),
        start_time=component.experiment("startTime"),
        stop_time=component.experiment("stopTime"),
        step=component.step,
    )


#: Names of descriptions in folders: of SSP, and of OSP.
_STRUCTURES = ("SystemStructure.ssd", "OspSystemStructure.xml")

#: Readers of files other than scenarios, by ending.
_READERS: Mapping[str, Callable[..., System]] = {
    ".ssp": read_ssp,
    ".ssd": read_ssp,
    ".xml": read_osp,
    ".fmu": read_fmu,
}


def is_path(name: str) -> bool:
    """Tell whether a name is a path; otherwise it names a scenario."""
    return name.endswith((".toml", *_READERS))


def _reader(path: Path) -> Callable[..., System] | None:
    """Return the reader of a file or folder; None: it is a scenario."""
    if path.suffix in _READERS or str(path) in names() or not is_folder(path):
        return _READERS.get(path.suffix)
    of_ssp, of_osp = ((path / name).is_file() for name in _STRUCTURES)
    return read_osp if of_osp and not of_ssp else read_ssp


def brings_its_own(name: str) -> bool:
    """Tell whether a system contains its own FMUs, so that there is no choice of kind."""
    return _reader(Path(name)) is not None


def check_brings_its_own(
    name: str, kind: str, fmi: str = FMI_VERSIONS[0], platforms: str | None = None
) -> None:
    """Raise an InputError if a form of FMU is requested of a system with its own FMUs."""
    if kind == NATIVE or fmi != FMI_VERSIONS[0] or platforms:
        raise InputError(
            f"{name}: contains its own FMUs; kind, fmi and platforms apply only to the bundle's"
        )


def left_behind(scenario: Scenario) -> str | None:
    """Warn of parts of a scenario that are lost if only its system is kept."""
    has = {"events": bool(scenario.events), "inputs": bool(scenario.inputs)}
    if not any(has.values()):
        return None
    lost = " and ".join(name for name, there in has.items() if there)
    return f"{scenario.name}: only the system is used, without the scenario's {lost}"


def doubts_of(system: System, given: Collection[PortName] = ()) -> list[str]:
    """Warn of possible omissions: inputs without a source, parameters of a vehicle, degrees.

    `given` are inputs that get their values from events or tables.

    """
    turns = _turns(system)
    if len(system.components) == 1:
        # No other component could feed it.
        return turns
    found = system.unfed_inputs(given), differing_vehicle(system), samples_too_old(system)
    return [*filter(None, found), *turns]


def _turns(system: System) -> list[str]:
    """Warn of angles beyond a full turn, which may be meant in degrees."""
    return [
        f"{name} = {value:g} rad is more than a full turn: if degrees are meant, write "
        f"{radians(value):.5g}"
        for name, value in system.parameters.items()
        if isinstance(value, float) and abs(value) > tau and system.variable(name).unit == "rad"
    ]


def first_given(*values: T | None) -> T | None:
    """Return the first value that is not None."""
    return next((value for value in values if value is not None), None)


# Preparation


@dataclass(frozen=True)
class Prepared:
    """A run that is ready to be made, and its scenario.

    Attributes:
        scenario: as its file has it, except for events and inputs of the request.
        plan: the system, and its steps.
        events: of the run.
        input_tables: values of inputs over time; other inputs keep their values.
        is_open: if set, nothing says when the run ends.

    """

    scenario: Scenario
    plan: Plan
    events: tuple[Event, ...] = ()
    input_tables: tuple[InputTable, ...] = ()
    is_open: bool = False

    @property
    def system(self) -> System:
        """The system."""
        return self.plan.system

    @property
    def experiment(self) -> Experiment:
        """Times, step and order of the run."""
        return self.plan.experiment

    @property
    def stop_time(self) -> float | None:
        """End of the run [s]; None: it is open."""
        return None if self.is_open else self.experiment.stop_time

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The loops of its vehicles."""
        return loops_of(self.system)

    @property
    def vehicles(self) -> tuple[Loop, ...]:
        """Its loops that have a vehicle; none, if the system has no vehicle."""
        return tuple(loop for loop in self.loops if loop.vehicle in self.system.components)

    @property
    def identity(self) -> Identity:
        """Everything that decides its rows."""
        inputs = (table.digest for table in self.input_tables)
        return self.plan.identity(self.events, " ".join(inputs))

    def run(self, observers: Sequence[Observer], hooks: Sequence[Hook] = ()) -> Ending:
        """Make the run; `hooks` act before its tables of inputs and its events do.

        Raises:
            InputError: an FMU or a parameter is not usable; nothing was stepped.

        """
        return simulate_plan(self.plan, observers, [*hooks, *self.hooks()])

    def hooks(self) -> list[Hook]:
        """Return hooks for its tables of inputs and its events."""
        hooks: list[Hook] = [table.playback() for table in self.input_tables]
        return hooks + ([Events(self.events)] if self.events else [])

    def with_parameters(self, values: Mapping[str, object]) -> Prepared:
        """Return the run with further values of parameters.

        Raises:
            InputError: a name or a value is not usable.

        """
        system = self.system.with_parameters(values)
        return replace(self, plan=replace(self.plan, system=system))

    def doubts(self) -> list[str]:
        """Return warnings, as :func:`doubts_of` does."""
        given = {target for table in self.input_tables for target in table.targets}
        for action in (event.action for event in self.events):
            values = action.values if isinstance(action, Alter) else ()
            values = action.inputs if isinstance(action, Set) else values
            given |= {port for port, _ in values}
        return doubts_of(self.system, given)

    def missed(self, ending: Ending) -> list[Event]:
        """Return the events that have not happened in a run of it."""
        happened = {occurrence.event for occurrence in ending.events}
        return [event for i, event in enumerate(self.events) if i not in happened]


def prepare_options(options: SystemOptions, *, is_open: bool = False) -> Prepared:
    """Load and prepare the system of a call in Python; flaws and doubts are Python's warnings.

    Args:
        options: of the call.
        is_open: if set, the run need not have a stop time.

    Raises:
        InputError: there is no such system, or the request cannot be met.

    """
    system, findings = options.system, Findings(options.strict)
    if isinstance(system, System):
        check_brings_its_own(str(system), options.kind)
        if options.variant is not None:
            raise InputError(f"{system}: has no variants; give it to load")
        scenario = Scenario(system.name)
    else:
        scenario, system = load_scenario(
            system, options.kind, variant=options.variant, findings=findings
        )
        findings.refuse()
    if not isinstance(options.parameters, Mapping | None):
        raise InputError(
            f"parameters: a mapping by component.parameter, not {options.parameters!r}"
        )
    prepared = prepare(scenario, system, options, is_open=is_open)
    warn_of(findings, [] if options.system is system else prepared.doubts(), _STACK_LEVEL)
    return prepared


def prepare_request(request: Request) -> Prepared:
    """Load and prepare the scenario of a request.

    Raises:
        InputError: there is no such scenario, or the request cannot be met.

    """
    return prepare(*load_scenario(request.scenario, request.kind), request)


def prepare(
    scenario: Scenario,
    system: System,
    request: Request | SystemOptions,
    *,
    is_open: bool = False,
) -> Prepared:
    """Apply a request to a scenario and its system.

    Args:
        scenario, system: of the run.
        request: of the user.
        is_open: if set, the run need not have a stop time.

    Raises:
        InputError: the request cannot be met.

    """
    findings, values = Findings(request.strict), system.expanded(request.parameters or {})
    system = system.with_parameters(values)
    if request.inputs is not None:
        files = [request.inputs] if isinstance(request.inputs, str | Path) else request.inputs
        scenario = replace(scenario, inputs=[Inputs(Path(file), wins=True) for file in files])
    input_tables: tuple[InputTable, ...] = ()
    with findings.collecting():
        system, input_tables = read_inputs(scenario.inputs, system, values, scenario.parameters)
    if isinstance(request.events, str):
        scenario = replace(scenario, events=read_scenario(request.events).events)
    elif request.events is not None:
        check_events("events", request.events)
        scenario = replace(scenario, events=request.events)
    stop_time = first_given(request.stop_time, scenario.stop_time, system.stop_time)
    is_open &= stop_time is None
    if stop_time is None and not is_open:
        raise InputError(f"{scenario.name}: has no stop time; set one with --stop-time")
    system = replace(system, steps={**system.steps, **(request.steps or {})})
    step = first_given(request.step, scenario.step, system.step)
    if step is None:
        system = system.with_common_step()
        step = DEFAULT_STEP if system.step is None else system.step
    order = request.order or scenario.order or None
    coupling = first_given(request.coupling, scenario.coupling)
    if request.strict and coupling is None and order in (None, "feedthrough", "gauss-seidel"):
        coupling = "solve"
    start_time = system.start_time or 0.0
    if stop_time is None:
        stop_time = start_time + MANY_STEPS * step
    experiment = Experiment(stop_time, step, order, start_time, coupling)
    isolation = Isolation.of(request.isolate, request.step_timeout)
    # A program is not a loop of FMUs.
    loop = Plan.LOOPS[0] if request.loop == PROGRAM else request.loop
    plan = make_plan(system, experiment, isolation, loop)
    with findings.collecting():
        followed = [target for table in input_tables for target in table.targets]
        events = read_events(scenario.name, scenario.events, replace(system, step=step), followed)
    findings.refuse()
    return Prepared(scenario, plan, events, input_tables, is_open)


def with_companion(prepared: Prepared, request: Request) -> list[Prepared]:
    """Prepare the run that a scenario is compared with, too, if there is one.

    It is the scenario but for the entries of `[compare]`. All other settings of the scenario and of
    the user apply to both runs, where both have such a port.

    Raises:
        InputError: the request cannot be met by the companion.

    """
    scenario, difference = prepared.scenario, prepared.scenario.compare
    if difference is None:
        return [prepared]
    standard = read_wiring(scenario.vehicles)["wires"]
    companion = replace(
        scenario,
        name=difference.name,
        label=difference.label,
        title=f"{scenario.title or scenario.name} ({difference.label or difference.name})",
        compare=None,
        components={**scenario.components, **difference.components},
        wires={
            target: source
            for target, source in {**scenario.wires, **difference.wires}.items()
            # A wire that only the scenario has is removed by leaving it out.
            if source is not False or target in standard or target not in scenario.wires
        },
        only=scenario.only and [*scenario.only, *difference.components],
        parameters={},
    )
    folder = current_fmus(request.kind)
    system = closed_loop(folder, with_fmus(companion, folder, request.kind))
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
    own_request = replace(request, parameters=given, events=None, inputs=None)
    return [prepared, prepare(companion, system.with_parameters(values), own_request)]
