"""The live page: scenarios with their comparisons and events, as plain data.

Names and meanings are those in `web/src/types.ts`. Everything that depends on a plan is decided
here: the program of each loop, the parameters that a comparison shares, the inputs of an event.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

from fmus.kinds import NATIVE
from orchestrator.cosim import (
    Component,
    Event,
    PortName,
    System,
)
from orchestrator.figures.style import printed_unit, reference_colours, vehicle_colours
from orchestrator.live.assembly import Plain, assemble, vehicle_data
from orchestrator.live.module import LICENCES, MODULE, REDUCERS, Programs, live_module
from orchestrator.machine.errors import InputError
from orchestrator.program.writer import Text, indices_of
from orchestrator.runs.preparation import Prepared, load_scenario, prepare, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import (
    Difference,
    Scenario,
    names,
    read_events,
    read_scenario,
    shared_events,
)
from orchestrator.runs.scenario_file import AT_ONCE
from orchestrator.vehicle.cautions import RULES, Rule
from orchestrator.vehicle.indices import metrics
from orchestrator.vehicle.signals import STANDARD, AllocatedLoop, Loop, loops_of


class _Controller(NamedTuple):
    """A controller that the page supports in comparisons.

    Attributes:
        label: label of its lines, unless the scenario has one.
        other: FMU of the controller to compare with, unless the scenario names one.
        measures_velocity: true if it takes `dy` of the vehicle.

    """

    label: str
    other: str
    measures_velocity: bool


#: Controllers by their FMUs, in the order in which they are drawn.
_CONTROLLERS = {
    "ObserverController": _Controller("proposed", "PdController", measures_velocity=False),
    "PdController": _Controller("PD", "ObserverController", measures_velocity=True),
}

_INDICES = {index.reducer for index in metrics()}

#: Most steps, of all vehicles together: the page keeps all rows of a run in memory.
_MOST_STEPS = 200_000

#: Most vehicles: paths of more are hard to distinguish.
_MOST_VEHICLES = 10


def live_page(opened: str, hear: Callable[[str], None] = lambda line: None) -> str:
    """Make the page.

    Args:
        opened: the scenario that it shows first.
        hear: called with a line before a part is made, which may take minutes.

    Raises:
        InputError: there is no such scenario, the page cannot run it, or a part cannot be made.

    """
    data, programs = page_data(opened)
    modules = [live_module(each.sources, hear) for each in programs]
    linked = modules[0][LICENCES].read_text(encoding="utf-8")
    titles = {each["name"]: each["title"] for each in data["presets"]}
    binary = [module[MODULE].read_bytes() for module in modules]
    return assemble(
        "live", data, binary, {"title": titles[data["opened"]], "licences": linked}, hear
    )


def page_data(opened: str) -> tuple[Plain, Sequence[Programs]]:
    """Return the data of all presets, including the opened one, and the programs that run them.

    Args:
        opened: a scenario of the bundle, or the path of a file.

    Raises:
        InputError: there is no such scenario, or it or the page cannot run it.

    """
    first, modules = preset(opened)
    for run in runs_of(opened):
        # A value that a component refuses is refused before the page is made.
        run.run([])
    others = [preset(name)[0] for name in names() if name != first["name"]]
    presets = sorted([first, *others], key=itemgetter("name"))
    measured: list[list[Plain]] = []
    for loop in (loop for each in presets for loop in each["loops"]):
        # Most vehicles have the same indices: share them.
        measured += [indices for indices in loop["measured"] if indices not in measured]
        loop["measured"] = [measured.index(indices) for indices in loop["measured"]]
    data = {
        "opened": first["name"],
        "mostSteps": _MOST_STEPS,
        "presets": presets,
        "measured": measured,
        "rules": [_rule(rule) for rule in RULES],
    }
    return data, modules


def _rule(rule: Rule) -> Plain:
    """Return a rule for a warning; JSON has no infinity."""
    above = max(rule.above, -sys.float_info.max)
    return {"number": rule.number, "above": above, "text": rule.text}


@cache
def bundled() -> Programs:
    """Return the programs of all scenarios of the bundle and of their comparisons."""
    return Programs([run for both in _bundled_runs().values() for run in both])


@cache
def _bundled_runs() -> Mapping[str, list[Prepared]]:
    return {name: runs_of(name) for name in names()}


def preset(name: str) -> tuple[Plain, Sequence[Programs]]:
    """Return the data of a scenario with its comparison, and the programs that include theirs.

    Raises:
        InputError: there is no such scenario, or the page cannot run it.

    """
    both, modules = _bundled_runs().get(name) or runs_of(name), [bundled()]
    matches = [modules[0].find(run) for run in both]
    if None in matches:
        modules.append(Programs(both))
        matches = [modules[1].find(run) for run in both]
    programs = [_Program(len(modules) - 1, *each) for each in matches if each is not None]
    return _preset(name, both, programs), modules


class _Program(NamedTuple):
    """The program of a run.

    Attributes:
        module: number of its module.
        number: its number in the module.
        text: its text.

    """

    module: int
    number: int
    text: Text


def _preset(name: str, both: Sequence[Prepared], programs: Sequence[_Program]) -> Plain:
    scenario, experiment = both[0].scenario, both[0].plan.experiment
    loops = [_loop(run, scenario, program) for run, program in zip(both, programs, strict=True)]
    fleet = both[0].loops if len(both[0].loops) > 1 else ()
    loops[0]["scenario"] = name
    if len({loop["label"] for loop in loops}) < len(loops):
        # The page identifies loops by their labels.
        for run, loop in zip(both, loops, strict=True):
            loop["label"] = run.scenario.name
    return {
        "name": scenario.name,
        "title": scenario.title or scenario.name,
        "remark": scenario.remark.strip(),
        "zUp": scenario.z_up,
        "stopTime": experiment.stop_time,
        "step": experiment.step,
        "events": scenario.name if scenario.events else "",
        "loops": loops,
        "drawn": sorted(range(len(both)), key=lambda i: _place(both[i].system)),
        "colours": vehicle_colours(len(fleet)),
        "references": reference_colours(fleet),
    }


def runs_of(name: str) -> list[Prepared]:
    """Prepare a scenario and its comparison, if it has one.

    Raises:
        InputError: there is no such scenario, or the page cannot run it.

    """
    request = Request(name, kind=NATIVE)
    scenario, system = load_scenario(name, NATIVE)
    own = prepare(scenario, system, request)
    compare = scenario.compare or _other(scenario, system)
    both = with_companion(replace(own, scenario=replace(scenario, compare=compare)), request)
    for run in both:
        _check(run)
    if len({len(run.loops) for run in both}) > 1:
        raise InputError(
            f"{scenario.name}: the live page cannot run a comparison with another number of "
            "vehicles"
        )
    return both


def _other(scenario: Scenario, system: System) -> Difference | None:
    """Return the comparison of a vehicle of the paper's loop with the other controller."""
    controller, [loop, *others] = _controller(system), loops_of(system)
    if not scenario.digest or controller is None or others:
        return None
    # The controllers' own gains are not for a vehicle whose actuators are allocated.
    if loop.controller != STANDARD.controller or isinstance(loop, AllocatedLoop):
        return None
    label, velocity = _CONTROLLERS[controller.other].label, f"{STANDARD.controller}.dy"
    if controller.measures_velocity:
        measured = (name for name in scenario.wires if f"{name}.".startswith(f"{velocity}."))
        wires: dict[str, str | bool] = dict.fromkeys(measured, False)
    else:
        wires = {velocity: f"{loop.vehicle}.dy"}
    return Difference(label, label, {STANDARD.controller: controller.other}, wires)


def _controller(system: System) -> _Controller | None:
    """Return the controller of the first vehicle."""
    component = system.components.get(loops_of(system)[0].controller)
    return _CONTROLLERS.get(_type(component)) if component else None


def _place(system: System) -> int:
    """Return the place of a system's controller in the order of drawing."""
    controller = _controller(system)
    return [*_CONTROLLERS.values()].index(controller) if controller else 0


def _type(component: Component) -> str:
    return str(component.description.modelName)


def _check(prepared: Prepared) -> None:
    """Check that the page can run a scenario.

    Raises:
        InputError: it cannot, with the reason.

    """
    plan = prepared.plan
    system, experiment, loops = plan.system, plan.experiment, prepared.loops
    most_steps = _MOST_STEPS // len(loops)
    lacking = {
        "rings of direct feedthroughs": plan.rings,
        "linear inputs": experiment.coupling == "linear",
        "a table of inputs": prepared.input_tables,
        "a start time other than 0": experiment.start_time != 0.0,
        f"a system without the {loops[0].vehicle}": loops[0].vehicle not in system.components,
        f"more than {_MOST_VEHICLES} vehicles": len(loops) > _MOST_VEHICLES,
        f"more than {most_steps:,} steps": experiment.rows - 1 > most_steps,
    }
    for what, is_there in lacking.items():
        if is_there:
            raise InputError(f"{prepared.scenario.name}: the live page cannot run {what}")


def _loop(prepared: Prepared, owner: Scenario, program: _Program) -> Plain:
    scenario, plan = prepared.scenario, prepared.plan
    system = plan.system
    controller = _controller(system)
    module, number, text = program
    return {
        "label": scenario.label or (controller.label if controller else scenario.name),
        "vehicles": list(map(vehicle_data, prepared.loops)),
        "measured": [_measured(text, loop) for loop in prepared.loops],
        "components": {name: _type(part) for name, part in system.components.items()},
        "head": {
            "order": scenario.order,
            "vehicles": scenario.vehicles,
            "absent": [name for name, fmu in scenario.components.items() if fmu is False],
            "only": [*scenario.only],
            "wires": {**scenario.wires},
        },
        "program": [module, number],
        "ports": {name: _ports(text, name) for name in system.components},
        "actingRow": text.plan.experiment.acting_row,
        "restarted": {name: _restarted(text, name) for name in system.components},
        "parameters": list(_parameters(text)),
        **({"fixedStep": plan.experiment.step} if text.slow else {}),
        "events": _events(prepared, owner),
    }


def _measured(text: Text, loop: Loop) -> list[Plain]:
    """Return the reducers of a vehicle's indices, with the sources of their numbers."""
    return [
        {
            "name": reducer.name,
            "isIndex": reducer in _INDICES,
            "takes": [
                # JSON has no infinity.
                str(source) if isinstance(source, PortName) else min(source, sys.float_info.max)
                for source in sources
            ],
            "gives": [name for name, ports in reducer.results.items() for _ in ports],
        }
        for reducer, sources in indices_of(text.plan.system, loop, REDUCERS)
    ]


def _ports(text: Text, name: str) -> dict[str, list[str]]:
    """Return the inputs and outputs of a component, in the order of a program's rows."""
    ports = text.kind(name).ports
    return {group: [port.name for port in ports[group]] for group in ("input", "output")}


def _restarted(text: Text, name: str) -> str:
    """Return the message of a component whose state is reset, with `{}` for the time."""
    return re.sub(r"\{.*?\}", "{}", text.kind(name).behaviour.restarted)


def _parameters(text: Text) -> Iterator[Plain]:
    """Yield the values that a user may change: parameters and unconnected inputs."""
    system = text.plan.system
    for name in text.parameters:
        component = system.components[name.component]
        variable, start = component.variables[name.port], component.start(name.port)
        value = system.parameters.get(name, start)
        data: Plain = {
            "name": str(name),
            "type": variable.type,
            "description": variable.description or "",
            "default": variable.shown(start),
            "value": variable.shown(value),
        }
        if unit := printed_unit(variable.unit or ""):
            data["unit"] = unit
        for end in ("min", "max"):
            if (limit := getattr(variable, end)) is not None:
                data[end] = float(limit)
        if choices := variable.items:
            data["choices"] = {choice: int(number) for choice, number in choices.items()}
        yield data


def _events(prepared: Prepared, owner: Scenario) -> dict[str, list[Plain]]:
    """Return all events that can happen to a system, by the scenario that has them.

    Args:
        prepared: run of the system.
        owner: scenario of the preset.

    """
    system = replace(prepared.system, step=prepared.experiment.step)
    tables = {name: [*enumerate(events)] for name, events in _bundled_events().items()}
    tables[owner.name] = [*enumerate(owner.events)]
    return {
        name: [
            _event(number, event) | {"canEnd": not any(action in table for action in AT_ONCE)}
            for number, table in numbered
            for event in read_events(name, shared_events([table], system), system)
        ]
        for name, numbered in tables.items()
        if numbered
    }


@cache
def _bundled_events() -> Mapping[str, Sequence[Mapping[str, Any]]]:
    """Return the events of the bundle's scenarios, by scenario."""
    return {name: read_scenario(name).events for name in names()}


def _event(number: int, event: Event) -> Plain:
    data = {
        "number": number,
        "text": event.text,
        "label": event.label,
        "at": event.at,
        "lasts": event.lasts,
        "repeat": event.repeat or None,
        "action": _action(event),
    }
    if (when := event.when) is not None:
        signal = {"signal": str(when.signal)}
        data["when"] = signal | {"comparison": when.comparison, "value": when.value}
    return {key: value for key, value in data.items() if value is not None}


def _action(event: Event) -> Plain:
    """Return the action of an event with the names of its fields, and its class as `kind`."""
    fields = {name: _plain(value) for name, value in vars(event.action).items()}
    return {"kind": type(event.action).__name__.lower(), **fields}


def _plain(value: Any) -> Any:
    """Convert names of ports to text, and tuples to lists."""
    if isinstance(value, PortName):
        return str(value)
    return list(map(_plain, value)) if isinstance(value, tuple) else value
