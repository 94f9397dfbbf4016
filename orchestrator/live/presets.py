"""The page in which a loop runs: scenarios beside their comparisons, and events, as plain data.

Names and meanings are the ones of `web/src/types.ts`. What a plan decides is decided here: which
program makes its steps, which parameters a comparison shares, and to which inputs an event gets.
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
    Action,
    Alter,
    Component,
    Event,
    Freeze,
    PortName,
    Release,
    Reset,
    Set,
    Stop,
    System,
    Value,
)
from orchestrator.figures.style import printed_unit, reference_colours, vehicle_colours
from orchestrator.live.assembly import Plain, assemble, vehicle_data
from orchestrator.live.module import LICENCES, MODULE, live_module
from orchestrator.live.programs import REDUCERS, Programs
from orchestrator.machine.errors import InputError
from orchestrator.program.writer import looking_at
from orchestrator.program.writer import Text
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import Prepared, prepare, with_companion
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
from orchestrator.vehicle.signals import STANDARD, AllocatedLoop, Loop, loops_of


class _Controller(NamedTuple):
    """A controller that the page knows.

    Attributes:
        label: of its lines, where a scenario has none.
        other: the FMU of the controller that it is compared with, where a scenario names none.
        measures_velocity: whether it takes `dy` of the vehicle.

    """

    label: str
    other: str
    measures_velocity: bool


#: In the order in which they are drawn.
_CONTROLLERS = {
    "ObserverController": _Controller("proposed", "PdController", measures_velocity=False),
    "PdController": _Controller("PD", "ObserverController", measures_velocity=True),
}

#: The page keeps all rows of a run in its memory, and refuses more steps of all vehicles together.
_MOST_STEPS = 200_000

#: Paths of more are hard to tell apart.
_MOST_VEHICLES = 10


def live_page(opened: str, hear: Callable[[str], None] = lambda line: None) -> str:
    """The page.

    Args:
        opened: the scenario that it shows first.
        hear: called with a line before a part is made, which may take minutes.

    Raises:
        InputError: there is no such scenario, the page cannot run it, or a part cannot be made.

    """
    data, programs = page_data(opened)
    modules = [live_module(one.sources, hear) for one in programs]
    linked = modules[0][LICENCES].read_text(encoding="utf-8")
    titles = {one["name"]: one["title"] for one in data["presets"]}
    binary = [module[MODULE].read_bytes() for module in modules]
    return assemble(
        "live", data, binary, {"title": titles[data["opened"]], "licences": linked}, hear
    )


def page_data(opened: str) -> tuple[Plain, Sequence[Programs]]:
    """All presets, the opened one among them, and the programs that run them.

    Args:
        opened: a scenario of the bundle, or the path of a file.

    Raises:
        InputError: there is no such scenario, or it or the page cannot run it.

    """
    first, modules = preset(opened)
    for run in runs_of(opened):
        # What a component refuses is refused here, before there is a page.
        run.run([])
    others = [preset(name)[0] for name in names() if name != first["name"]]
    presets = sorted([first, *others], key=itemgetter("name"))
    measured: list[list[Plain]] = []
    for loop in (loop for one in presets for loop in one["loops"]):
        # Most vehicles have the same.
        measured += [one for one in loop["measured"] if one not in measured]
        loop["measured"] = [measured.index(one) for one in loop["measured"]]
    data = {
        "opened": first["name"],
        "mostSteps": _MOST_STEPS,
        "presets": presets,
        "measured": measured,
    }
    return data, modules


@cache
def bundled() -> Programs:
    """The programs of all scenarios of the bundle, and of what they are compared with."""
    return Programs([run for both in _bundled_runs().values() for run in both])


@cache
def _bundled_runs() -> Mapping[str, list[Prepared]]:
    return {name: runs_of(name) for name in names()}


def preset(name: str) -> tuple[Plain, Sequence[Programs]]:
    """A scenario, and what it is compared with; the programs among which theirs are.

    Raises:
        InputError: there is no such scenario, or the page cannot run it.

    """
    both, modules = _bundled_runs().get(name) or runs_of(name), [bundled()]
    found = [modules[0].find(run) for run in both]
    if None in found:
        modules.append(Programs(both))
        found = [modules[1].find(run) for run in both]
    programs = (_Program(len(modules) - 1, *one) for one in found if one is not None)
    return _preset(name, both, [*programs]), modules


class _Program(NamedTuple):
    """The program of a run.

    Attributes:
        module: the number of the module that has it.
        number: its number there.
        text: what it is written from.

    """

    module: int
    number: int
    text: Text


def _preset(name: str, both: Sequence[Prepared], programs: Sequence[_Program]) -> Plain:
    scenario, experiment = both[0].scenario, both[0].plan.experiment
    loops = [_loop(one, scenario, program) for one, program in zip(both, programs, strict=True)]
    fleet = both[0].loops if len(both[0].loops) > 1 else ()
    loops[0]["scenario"] = name
    if len({loop["label"] for loop in loops}) < len(loops):
        # The page tells loops apart by their labels.
        for one, loop in zip(both, loops, strict=True):
            loop["label"] = one.scenario.name
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
    """The run of a scenario, and the one that it is compared with, if there is one.

    Raises:
        InputError: there is no such scenario, or the page cannot run it.

    """
    request = Request(name, kind=NATIVE)
    scenario, system = load_scenario(name, NATIVE)
    own = prepare(scenario, system, request)
    compare = scenario.compare or _other(scenario, system)
    both = with_companion(replace(own, scenario=replace(scenario, compare=compare)), request)
    for one in both:
        _check(one)
    if len({len(one.loops) for one in both}) > 1:
        raise InputError(
            f"{scenario.name}: the live page cannot run a comparison with another number of "
            "vehicles"
        )
    return both


def _other(scenario: Scenario, system: System) -> Difference | None:
    """The comparison of a vehicle of the paper's loop with the controller that it lacks."""
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
    """The controller of the first vehicle."""
    found = system.components.get(loops_of(system)[0].controller)
    return _CONTROLLERS.get(_type(found)) if found else None


def _place(system: System) -> int:
    """The place of a system's controller among all."""
    controller = _controller(system)
    return [*_CONTROLLERS.values()].index(controller) if controller else 0


def _type(component: Component) -> str:
    return str(component.description.modelName)


def _check(prepared: Prepared) -> None:
    """Check that the page can run a scenario.

    Raises:
        InputError: it cannot.

    """
    plan = prepared.plan
    system, experiment, loops = plan.system, plan.experiment, prepared.loops
    most_steps = _MOST_STEPS // len(loops)
    lacking = {
        "rings of direct feedthroughs": plan.rings,
        "linear inputs": experiment.coupling == "linear",
        "a table of inputs": prepared.input_table is not None,
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
        "measured": [_measured(text, one) for one in prepared.loops],
        "components": {name: _type(part) for name, part in system.components.items()},
        "head": {
            "order": scenario.order,
            "vehicles": scenario.vehicles,
            "absent": [name for name, what in scenario.components.items() if what is False],
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
    """What makes the indices of a vehicle, and where it takes its numbers from."""
    return [
        {
            "name": reducer.name,
            "takes": [
                # JSON has nothing infinite.
                str(one) if isinstance(one, PortName) else min(one, sys.float_info.max)
                for one in sources
            ],
            "gives": [name for name, ports in reducer.results.items() for _ in ports],
        }
        for reducer, sources in looking_at(text.plan.system, loop, REDUCERS)
    ]


def _ports(text: Text, name: str) -> dict[str, list[str]]:
    """The inputs and outputs of a component, in the order of a program's rows."""
    kind = text.kind(name)
    return {group: [one.name for one in kind.ports[group]] for group in ("input", "output")}


def _restarted(text: Text, name: str) -> str:
    """What a component says when its state is started over, with braces for the time."""
    return re.sub(r"\{.*?\}", "{}", text.kind(name).said.restarted)


def _parameters(text: Text) -> Iterator[Plain]:
    """What a user may change: parameters, and inputs that nothing feeds."""
    system = text.plan.system
    for name in text.parameters:
        component = system.components[name.component]
        variable, start = component.variables[name.port], component.start(name.port)
        value = system.parameters.get(name, start)
        found: Plain = {
            "name": str(name),
            "type": variable.type,
            "description": variable.description or "",
            "default": variable.shown(start),
            "value": variable.shown(value),
        }
        if variable.unit and variable.unit != "1":
            found["unit"] = printed_unit(variable.unit)
        for end in ("min", "max"):
            if (limit := getattr(variable, end)) is not None:
                found[end] = float(limit)
        if choices := variable.items:
            found["choices"] = {choice: int(number) for choice, number in choices.items()}
        yield found


def _events(prepared: Prepared, owner: Scenario) -> dict[str, list[Plain]]:
    """All events that can happen to a system, by the scenario that has them.

    Args:
        prepared: run of the system.
        owner: the scenario of the preset.

    """
    system = replace(prepared.system, step=prepared.experiment.step)
    tables = {name: [*enumerate(events)] for name, events in _bundled_events().items()}
    tables[owner.name] = [*enumerate(owner.events)]
    return {
        name: [
            _event(number, event) | {"canEnd": not any(action in table for action in AT_ONCE)}
            for number, table in some
            for event in read_events(name, shared_events([table], system), system)
        ]
        for name, some in tables.items()
        if some
    }


@cache
def _bundled_events() -> Mapping[str, Sequence[Mapping[str, Any]]]:
    """The events of the bundle's scenarios, by their names."""
    return {name: read_scenario(name).events for name in names()}


def _event(number: int, event: Event) -> Plain:
    found = {
        "number": number,
        "text": event.text,
        "label": event.label,
        "at": event.at,
        "lasts": event.lasts,
        "repeat": event.repeat or None,
        "action": _action(event.action),
    }
    if (when := event.when) is not None:
        signal = {"signal": str(when.signal)}
        found["when"] = signal | {"comparison": when.comparison, "value": when.value}
    return {key: value for key, value in found.items() if value is not None}


def _action(action: Action) -> Plain:
    match action:
        case Alter(effect, values):
            return {"kind": "alter", "effect": effect, "values": _assigned(values)}
        case Freeze(targets):
            return {"kind": "freeze", "targets": list(map(str, targets))}
        case Release(targets):
            return {"kind": "release", "targets": list(map(str, targets))}
        case Set(parameters, inputs):
            given = {"parameters": _assigned(parameters), "inputs": _assigned(inputs)}
            return {"kind": "set", **given}
        case Reset(components):
            return {"kind": "reset", "components": list(components)}
        case Stop(why):
            return {"kind": "stop", "why": why}
    raise TypeError(f"the page does not know the event {action!r}")


def _assigned(values: Sequence[tuple[PortName, Value]]) -> list[list[Value]]:
    return [[str(target), value] for target, value in values]
