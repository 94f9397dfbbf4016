"""What the page of a loop holds as plain data: FMUs, scenarios beside their comparisons, events.

Names and meanings are the ones of `web/src/types.ts`. What a plan decides is decided here: which
stages a step has, which parameters a comparison shares, and to which inputs an event gets.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

from fmpy.model_description import ModelVariable

from auv_fmu.language.quantities import POSITION, TAU, THETA, VELOCITY
from fmus.discovery import components
from fmus.kinds import NATIVE
from orchestrator.figures.style import printed_unit, reference_colours, vehicle_colours
from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import FEEDTHROUGH, GAUSS_SEIDEL, LINEAR, Order
from orchestrator.master.hooks.events import (
    Action,
    Alter,
    Event,
    Freeze,
    Release,
    Reset,
    Set,
    Stop,
)
from orchestrator.master.plan import gathered_connections, stages
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import Prepared, prepare, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario, names, read_scenario
from orchestrator.runs.scenario_events import read_events, shared_events
from orchestrator.runs.scenario_file import AT_ONCE
from orchestrator.system.component import Component, read_component
from orchestrator.system.connection import Connection
from orchestrator.system.graph import rings
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import Value, items_of, named
from orchestrator.vehicle.distances import SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL
from orchestrator.vehicle.index.final_error import LAST as LAST_SECONDS
from orchestrator.vehicle.indices import metrics
from orchestrator.vehicle.signals import STANDARD, AllocatedLoop, Loop, loops_of


class _Controller(NamedTuple):
    """What a comparison needs to know of a controller.

    Attributes:
        label: where a scenario names none.
        other: a scenario with the other controller and nothing else of its own, for scenarios that
            name no comparison.
        allocated: the same for a vehicle whose actuators are allocated.

    """

    label: str
    other: str
    allocated: str


Plain = dict[str, Any]

#: In the order in which they are drawn.
_CONTROLLERS = {
    "ObserverController": _Controller("proposed", "path-pd", "remus-pd"),
    "PdController": _Controller("PD", "path", "remus"),
}

#: Groups of signals that have charts, with the units of their members.
_CHARTS = {"e": POSITION, "tau": TAU, "dy": VELOCITY, "theta_hat": THETA}

#: The page keeps all rows of a run in its memory, and refuses more steps of all vehicles together.
_MOST_STEPS = 200_000

#: Paths of more are hard to tell apart.
_MOST_VEHICLES = 10

#: What there is of several vehicles together.
_TOGETHER: Plain = {
    "name": SMALLEST_DISTANCE,
    "label": SMALLEST_DISTANCE_LABEL,
    "meaning": "smallest distance between the centres of mass of any two vehicles",
    "units": {"": "m"},
}


def page_data(opened: str) -> Plain:
    """All presets, the opened one among them.

    Args:
        opened: a scenario of the bundle, or the path of a file.

    Raises:
        InputError: there is no such scenario, or it or the page cannot run it.

    """
    both = runs_of(opened)
    first = _preset(opened, both)
    for run in both:
        # What an FMU refuses is refused here, before there is a page.
        run.run([])
    others = [preset(name) for name in names() if name != first["name"]]
    return {
        "opened": first["name"],
        "mostSteps": _MOST_STEPS,
        "lastSeconds": LAST_SECONDS,
        "units": {group: _printed(units) for group, units in _CHARTS.items()},
        "fmus": {name: _fmu(component) for name, component in bundle().items()},
        "presets": sorted([first, *others], key=itemgetter("name")),
        "indices": [
            {"name": one.name, "label": one.label, "meaning": one.meaning}
            | {"units": _printed(one.units)}
            for one in metrics()
        ]
        + [_TOGETHER],
    }


def _printed(units: Mapping[Any, str]) -> dict[str, str]:
    return {str(member): printed_unit(unit) for member, unit in units.items()}


def preset(name: str) -> Plain:
    """A scenario, and what it is compared with.

    Raises:
        InputError: there is no such scenario, or the page cannot run it.

    """
    return _preset(name, runs_of(name))


def _preset(name: str, both: Sequence[Prepared]) -> Plain:
    scenario, experiment = both[0].scenario, both[0].plan.experiment
    loops = [_loop(one, scenario) for one in both]
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
    compare = scenario.compare or _other(system)
    both = with_companion(replace(own, scenario=replace(scenario, compare=compare)), request)
    for one in both:
        _check(one)
    if len({len(one.loops) for one in both}) > 1:
        raise InputError(
            f"{scenario.name}: the live page cannot run a comparison with another number of "
            "vehicles"
        )
    return both


def _other(system: System) -> str:
    """The scenario with the controller that a single vehicle lacks; empty: it has neither."""
    controller, loops = _controller(system), loops_of(system)
    if controller is None or len(loops) > 1 or loops[0].controller != STANDARD.controller:
        return ""
    is_allocated = isinstance(loops[0], AllocatedLoop)
    return controller.allocated if is_allocated else controller.other


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
    ours = {part.digest for part in bundle().values()}
    foreign = [name for name, part in system.components.items() if part.digest not in ours]
    lacking = {
        f"third-party FMUs ({', '.join(foreign)})": foreign,
        "rings of direct feedthroughs": rings(system),
        "linear inputs": experiment.coupling == LINEAR,
        "components with longer steps": any(n > 1 for n in plan.decimations.values()),
        "transformations of values": any(c.transformation for c in system.connections),
        "a table of inputs": prepared.input_table is not None,
        "a start time other than 0": experiment.start_time != 0.0,
        f"a system without the {loops[0].vehicle}": loops[0].vehicle not in system.components,
        f"more than {_MOST_VEHICLES} vehicles": len(loops) > _MOST_VEHICLES,
        f"more than {most_steps:,} steps": experiment.rows - 1 > most_steps,
    }
    for what, is_there in lacking.items():
        if is_there:
            raise InputError(f"{prepared.scenario.name}: the live page cannot run {what}")


def _loop(prepared: Prepared, owner: Scenario) -> Plain:
    scenario, plan = prepared.scenario, prepared.plan
    system, order = plan.system, plan.experiment.order or FEEDTHROUGH
    controller = _controller(system)
    return {
        "label": scenario.label or (controller.label if controller else scenario.name),
        "vehicles": list(map(_vehicle, prepared.loops)),
        "components": {name: _type(part) for name, part in system.components.items()},
        "head": {
            "order": scenario.order,
            "vehicles": scenario.vehicles,
            "absent": [name for name, what in scenario.components.items() if what is False],
            "only": [*scenario.only],
            "wires": {**scenario.wires},
        },
        "initial": [
            _stage([name], system.feeding[name])
            for names in stages(system, GAUSS_SEIDEL)
            for name in names
        ],
        **_step(system, order),
        "actingRow": replace(plan.experiment, order=order).acting_row,
        "parameters": list(_parameters(system)),
        "events": _events(prepared, owner),
    }


def _step(system: System, order: Order) -> Plain:
    """What passes before a row shows it, what is stepped, and what of that is read at once."""
    sequence = stages(system, order)
    gathered = gathered_connections(system, sequence, order=order)
    if order != FEEDTHROUGH:
        made = list(map(_stage, sequence, gathered))
        return {"passing": [], "stages": made, "read": [*system.components]}
    direct = {
        name
        for name, part in system.components.items()
        if any(part.has_feedthrough(output.name) for output in part.having("output"))
    }
    place = {name: i for i, names in enumerate(sequence) for name in names}
    # What passes is read there, and before only where something takes it before.
    early = {
        one.source.component
        for one in system.connections
        if place[one.source.component] >= place[one.target.component]
    }
    return {
        "passing": [
            _stage([name for name in names if name in direct], connections)
            for names, connections in zip(sequence, gathered, strict=True)
        ],
        "stages": [_stage([*place], [])],
        "read": [name for name in place if name not in direct or name in early],
    }


def _vehicle(loop: Loop) -> dict[str, str]:
    return {"name": loop.name, "allocation": "", **asdict(loop)}


def _stage(names: Sequence[str], connections: Iterable[Connection]) -> Plain:
    return {
        "connections": [[str(one.target), str(one.source)] for one in connections],
        "components": list(names),
    }


def _parameters(system: System) -> Iterator[Plain]:
    """What a user may change: parameters, and inputs that nothing feeds."""
    for name, component in system.components.items():
        fed = {connection.target.port for connection in system.feeding[name]}
        for variable in component.variables.values():
            is_input = variable.causality == "input" and variable.name not in fed
            if variable.causality != "parameter" and not is_input:
                continue
            start = component.start(variable.name)
            value = system.parameters.get(PortName(name, variable.name), start)
            found: Plain = {
                "name": f"{name}.{variable.name}",
                "type": variable.type,
                "description": variable.description or "",
                "default": named(variable, start),
                "value": named(variable, value),
            }
            if variable.unit and variable.unit != "1":
                found["unit"] = printed_unit(variable.unit)
            for end in ("min", "max"):
                if (text := getattr(variable, end)) is not None:
                    found[end] = float(text)
            if choices := items_of(variable):
                found["choices"] = list(choices)
            yield found


def _fmu(component: Component) -> Plain:
    return {
        "guid": component.description.guid,
        "variables": [_variable(component, one) for one in component.variables.values()],
    }


def _variable(component: Component, variable: ModelVariable) -> Plain:
    start = component.start(variable.name)
    choices = {name: int(number) for name, number in items_of(variable).items()}
    return {
        "name": variable.name,
        "type": variable.type,
        "reference": variable.valueReference,
        "causality": variable.causality,
        **({} if start is None else {"start": start}),
        **({"choices": choices} if choices else {}),
    }


@cache
def bundle() -> Mapping[str, Component]:
    """The FMUs that the module is made of, by their names."""
    folder = current_fmus(NATIVE)
    return {name: read_component(name, folder / f"{name}.fmu") for name in components()}


def _events(prepared: Prepared, owner: Scenario) -> dict[str, list[Plain]]:
    """All events that can happen to a system, by the scenario that has them.

    Args:
        prepared: run of the system.
        owner: the scenario of the preset: its events may be the comparison's own.

    """
    system = replace(prepared.system, step=prepared.experiment.step)
    tables = {name: [*enumerate(events)] for name, events in _bundled_events().items()}
    # A comparison lacks some of the scenario's events, or has its own, which the page cannot edit.
    places = {id(table): number for number, table in enumerate(owner.events)}
    tables[owner.name] = [
        (places.get(id(table), len(places) + number), table)
        for number, table in enumerate(prepared.scenario.events)
    ]
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
