"""Scenarios: changes to the closed loop in a TOML file, its tables of inputs and waypoints, events.

:mod:`.scenario_file` declares the entries of the file. It is imported only to read one, because
pydantic takes a tenth of a second.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from auv_fmu.guidance.path_planner import MOST
from orchestrator.cosim import (
    Alter,
    Condition,
    Event,
    Experiment,
    Freeze,
    Header,
    InputTable,
    Linear,
    Mapped,
    Order,
    PortName,
    Release,
    Reset,
    Set,
    Stop,
    System,
    Table,
    Value,
    Variable,
)
from orchestrator.machine.disk import file_name
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.texts import finite, flatten, literal
from orchestrator.machine.user_files import explain_errors, read_text
from orchestrator.runs import SCENARIOS_FOLDER, find_toml, names_in
from orchestrator.runs.tables import read_columns, read_rows, records
from orchestrator.vehicle.signals import STANDARD

#: Messages for files that cannot be read.
_NOT_A_SCENARIO, _NO_INPUTS = "not a scenario", "not a table of inputs"

#: Name of a scenario without a file.
_NAMELESS = "scenario"

#: Files that can be run instead of the bundle's scenarios.
_OTHERS = "a .toml, .ssp, .ssd or .fmu file, an OspSystemStructure.xml, or a folder with a .ssd"

#: Largest difference of times, so that it can be computed [s].
_FARTHEST = 1e308

#: Stands for the name of each vehicle, `auv1`, `auv2`, ...; in a wire, for the same vehicle.
EACH_VEHICLE = "auv*"

#: Columns of a table of waypoints, without times and with them.
_PLACE, _TIMED = ["x", "y", "z"], ["t", "x", "y", "z"]

_CONDITION = re.compile(rf"(\S+)\s*({'|'.join(Condition.COMPARISONS)})\s*(\S+)")


def for_each_vehicle(n: int | None, table: Mapping[str, Any]) -> dict[str, Any]:
    """Replace each entry for `auv*` by one for each of n vehicles; entries for one vehicle win.

    A text that is the value of an entry is for the same vehicle as its key. None: entries stay as
    they are.
    """
    if n is None:
        return dict(table)
    replaced = {
        key.replace(EACH_VEHICLE, name): (
            value.replace(EACH_VEHICLE, name) if isinstance(value, str) else value
        )
        for name in (EACH_VEHICLE.replace("*", str(number)) for number in range(1, n + 1))
        for key, value in table.items()
        if EACH_VEHICLE in key
    }
    return replaced | {key: value for key, value in table.items() if EACH_VEHICLE not in key}


@dataclass(frozen=True)
class Inputs:
    """A table of inputs of a scenario or of the command line.

    Attributes:
        file: the table.
        between: interpolation of continuous Real inputs between two rows, `linear` or `hold`.
        wins: True for a table of the command line, which wins over parameters of the scenario.

    """

    file: Path
    between: str = "linear"
    wins: bool = False
    _read: dict[Any, list[np.ndarray]] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of its columns, after the time.

        Raises:
            InputError: the table cannot be read.

        """
        return read_columns(self.file, _NO_INPUTS)

    def columns(self, variables: Sequence[Variable]) -> list[np.ndarray]:
        """Return the times, and the columns in the types of their variables.

        They are read once for systems whose variables are alike.

        Raises:
            InputError: the table cannot be read, or a value has another type.

        """
        kinds = tuple((v.type, v.min, v.max, *v.items.items()) for v in variables)
        if kinds not in self._read:
            self._read[kinds] = self._columns(variables)
        return self._read[kinds]

    def _columns(self, variables: Sequence[Variable]) -> list[np.ndarray]:
        named = dict(zip(self.names, variables, strict=True))
        types = {
            name: variable.type for name, variable in named.items() if variable.type in Header.TYPES
        }
        header = Header(self.names, Experiment(1.0, 1.0), types=types)
        encoders = header.encoders
        numbers = {
            name: partial(_number, name, variable, encoders.get(name, float))
            for name, variable in named.items()
            if name in types or variable.family in ("Boolean", "Enumeration")
        }
        blocks = read_rows(self.file, numbers, _NO_INPUTS)
        table = Table.of(header, np.vstack([np.empty((0, 1 + len(variables))), *blocks]))
        return [table.time, *(table[name] for name in self.names)]


def _number(name: str, variable: Variable, encode: Callable[[Any], float], value: object) -> float:
    """Return the number in a row for a cell of a table; a ValueError names a wrong value."""
    try:
        return encode(variable.typed(variable.cell(value, f"{name}:"), name))
    except InputError as error:
        raise ValueError(str(error)) from None


@dataclass(frozen=True)
class Difference:
    """Entries of `[compare]`: what differs in the second run of a scenario."""

    name: str
    label: str = ""
    components: Mapping[str, str | bool] = field(default_factory=dict)
    wires: Mapping[str, str | bool] = field(default_factory=dict)
    parameters: Mapping[PortName, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Scenario:
    """A system to run and how to show it; :mod:`.scenario_file` explains each entry.

    Attributes:
        name: of the file, without its ending.
        digest: SHA-256 of the file; empty for a system without one.

    """

    name: str
    title: str = ""
    label: str = ""
    figure: str = "tracking"
    z_up: bool = False
    compare: Difference | None = None
    stop_time: float | None = None
    step: float | None = None
    steps: Mapping[str, float] = field(default_factory=dict)
    order: Order | None = None
    coupling: str | None = None
    only: Sequence[str] = ()
    remark: str = ""
    vehicles: int | None = None
    components: Mapping[str, str | bool] = field(default_factory=dict)
    wires: Mapping[str, str | bool] = field(default_factory=dict)
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    ours: Mapping[str, str] = field(default_factory=dict)
    events: Sequence[Mapping[str, Any]] = ()
    inputs: Sequence[Inputs] = ()
    digest: str = ""

    @property
    def stem(self) -> str:
        """Name of its files and folders."""
        return file_name(self.name)

    @property
    def legend(self) -> str:
        """Name of its lines in a comparison of two runs."""
        return self.label or self.name


def names() -> list[str]:
    """Return the names of the scenarios of the bundle."""
    return names_in(SCENARIOS_FOLDER)


def read_scenario(name: str) -> Scenario:
    """Read a scenario of the bundle by its name, or any by the path of its file.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    if name.endswith(".py"):
        raise InputError(
            f"{name}: a script is not run by itself; build its FMU (auv-fmu build {name}), and run "
            "that or a scenario with it"
        )
    path = find_toml(name, SCENARIOS_FOLDER, "scenario", _OTHERS)
    text = read_text(path, _NOT_A_SCENARIO)
    with explain_errors(path, _NOT_A_SCENARIO):
        return _scenario(path, tomllib.loads(text), text)


def scenario_of(content: Mapping[str, Any]) -> Scenario:
    """Read a scenario from the content of a file; paths in it are relative to the current folder.

    Raises:
        InputError: there is a mistake in it.

    """
    return _scenario(Path(_NAMELESS), dict(content), repr(content))


def check_events(where: object, tables: Sequence[Mapping[str, Any]]) -> None:
    """Check tables of events without a system; Refused names all mistakes."""
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    ScenarioFile.check(where, {"events": list(tables)})


def _scenario(path: Path, content: dict[str, Any], text: str) -> Scenario:
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    if isinstance(compared := content.get("compare"), str):
        raise InputError(
            f"{path}: compare = {compared!r}: write as a table what differs from this scenario, "
            f'such as {{ name = "{path.stem}-pd", components.controller = "PdController", '
            'wires."controller.dy" = "plant.dy" }'
        )
    ScenarioFile.check(path, content)
    vehicles = content.get("vehicles")
    _read_system(content, path.parent, vehicles)
    if "compare" in content:
        _read_system(content["compare"], path.parent, vehicles)
        content["compare"] = Difference(**content["compare"])
    for key in content.keys() & {"order", "only"}:
        if isinstance(content[key], list):
            listed = dict.fromkeys(content[key])
            content[key] = [*for_each_vehicle(vehicles, listed)]
    if "path" in content:
        waypoints = content.pop("path")
        component = waypoints.get("component", STANDARD.planner)
        parameters = path_parameters(path.parent / waypoints["file"], component)
        for name in parameters.keys() & content["parameters"].keys():
            raise InputError(f"{path}: {name} is already given by {waypoints['file']}")
        content["parameters"] |= parameters
    if "inputs" in content:
        tables = content["inputs"]
        content["inputs"] = [
            Inputs(**table | {"file": path.parent / table["file"]})
            for table in (tables if isinstance(tables, list) else [tables])
        ]
    content["ours"] = {key: str(why) for key, why in flatten(content.get("ours", {}))}
    return Scenario(path.stem, digest=hashlib.sha256(text.encode()).hexdigest(), **content)


def _read_system(content: dict[str, Any], folder: Path, vehicles: int | None) -> None:
    """Resolve names, paths and stars in the entries about the system."""
    content["parameters"] = {
        PortName.read(key): value
        for key, value in flatten(content.get("parameters", {}), System.is_spread)
    }
    for key in content.keys() & {"components", "wires", "steps"}:
        content[key] = for_each_vehicle(vehicles, content[key])
    content["components"] = {
        component: str(folder / fmu) if str(fmu).endswith((".fmu", ".py", ".csv")) else fmu
        for component, fmu in content.get("components", {}).items()
    }


def read_inputs(
    inputs: Sequence[Inputs],
    system: System,
    given: Collection[PortName],
    stated: Collection[PortName] = (),
) -> tuple[System, tuple[InputTable, ...]]:
    """Read tables of inputs for :func:`with_input_table`.

    Args:
        inputs: the tables.
        system: with the inputs.
        given: ports whose values come from the command line; no table may name them.
        stated: ports whose values come from the scenario; only tables that win may name them.

    Raises:
        InputError: a table cannot be read, or a column is not an available input, or is in another
            table, too.

    """
    tables, files = [], dict[PortName, Path]()
    for each in inputs:
        columns = each.names
        with _in_file(each.file):
            targets = [system.named(PortName.read(name)) for name in columns]
            variables = [system.variable(target) for target in targets]
            for target in targets:
                if target in files:
                    raise InputError(f"{target} is a column of {files[target]}, too")
        files |= dict.fromkeys(targets, each.file)
        times, *values = each.columns(variables)
        taken = given if each.wins else [*given, *stated]
        with _in_file(each.file):
            system, table = with_input_table(system, targets, times, values, taken, each.between)
        tables.append(table)
    return system, tuple(tables)


@contextmanager
def _in_file(file: Path) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def with_input_table(
    system: System,
    names: Sequence[PortName],
    times: np.ndarray,
    columns: Sequence[np.ndarray],
    given: Collection[PortName] = (),
    between: str = "linear",
) -> tuple[System, InputTable]:
    """Start a system with the first values of inputs over time, and make the table of all.

    Args:
        system: with the inputs.
        names, times, columns: of the inputs; columns have the types of the inputs, or doubles.
        given: ports whose values come from the same file or command; the table must not name them.
        between: interpolation of continuous Real inputs between two rows.

    Raises:
        InputError: a column is not an available input, or has values that it cannot take.

    """
    targets = tuple(map(system.named, names))
    variables = [system.variable(target) for target in targets]
    _check_rows(times, columns, targets)
    fed = {connection.target: connection.source for connection in system.connections}
    for target, variable, column in zip(targets, variables, columns, strict=True):
        if target in map(system.named, given):
            raise InputError(f"{target} is given both a value and a column of the table")
        if variable.causality != "input":
            raise InputError(f"{target} has causality {variable.causality}, not input")
        if target in fed:
            raise InputError(f"{target} is fed by {fed[target]} and cannot be set")
        is_real = variable.family == "Real"
        values = np.array([column.min(), column.max()]) if is_real else np.unique(column)
        for value in values.tolist():
            _typed(variable, target, value)
    # In FMI, discrete variables change only at events.
    steady = ("Real", "continuous", "linear")
    linear = [(v.family, v.variability, between) == steady for v in variables]
    input_table = InputTable.of(targets, times, columns, linear)
    start = system.start_time or 0.0
    row = input_table.at(start, int((times <= start).sum()) - 1)
    first = dict(zip(targets, map(_typed, variables, targets, row), strict=True))
    return replace(system, parameters={**system.parameters, **first}), input_table


def _check_rows(
    times: np.ndarray, columns: Sequence[np.ndarray], targets: tuple[PortName, ...]
) -> None:
    if not len(times) or not targets:
        raise InputError("holds no inputs: write a column time, one for each input, and rows")
    if len(set(targets)) < len(targets):
        raise InputError("two columns have the same name")
    numbers = [times, *(column for column in columns if column.dtype.kind == "f")]
    if not all(np.isfinite(column).all() for column in numbers):
        raise InputError("all times and values must be finite")
    if (times[1:] < times[:-1]).any():
        raise InputError("times must not decrease")
    if times[-1] / 2 - times[0] / 2 > _FARTHEST / 2:
        raise InputError(f"times must be less than {_FARTHEST:g} s apart")


def _typed(variable: Variable, port: PortName, value: Value) -> Value:
    """Convert a value of a table to the type of an input; integers may be whole doubles."""
    return variable.typed(f"{value:.17g}" if isinstance(value, float) else value, str(port))


def path_parameters(path: Path, component: str) -> dict[PortName, Any]:
    """Read a table of waypoints, x, y, z and possibly t, as the parameters of a planner.

    Raises:
        InputError: there is no such table, or it has a mistake.

    """
    with records(path, "not a table of waypoints", _are_of_waypoints) as (first, rows):
        names = [name.strip().lower() for name in first]
        if not _are_of_waypoints(first):
            raise ValueError(f"its columns are {', '.join(names)}; use x, y, z or t, x, y, z")
        waypoints = [
            {n: finite(text, f"line {line}, {n}:") for n, text in zip(names, values, strict=True)}
            for line, values in rows
        ]
        if not 2 <= len(waypoints) <= MOST:
            raise ValueError(
                f"it has {len(waypoints)} waypoints, and a path has 2 to {MOST}; with a column t, "
                f'longer tables are tracks: planner = "{path.name}" under [components]'
            )
    # A planner without times has no parameter of the name.
    values: dict[str, Any] = {"count": len(waypoints), **({"timed": True} if "t" in names else {})}
    for number, waypoint in enumerate(waypoints, start=1):
        values |= {f"waypoint[{number}].{name}": value for name, value in waypoint.items()}
    return {PortName(component, port): value for port, value in values.items()}


def _are_of_waypoints(names: Sequence[str]) -> bool:
    return sorted(name.strip().lower() for name in names) in (_PLACE, _TIMED)


# Events


def read_events(
    where: object,
    tables: Sequence[Mapping[str, Any]],
    system: System,
    followed: Collection[PortName] = (),
) -> tuple[Event, ...]:
    """Read the events of a run.

    Args:
        where: name of the file of the tables, for messages.
        tables: checked by :func:`check_events`.
        system: to act on.
        followed: inputs that follow a table.

    Raises:
        InputError: an event cannot happen to this system.

    """
    findings, events = Findings(), []
    for number, table in enumerate(tables, start=1):
        try:
            events.append(_event(table, system, followed))
        except InputError as error:
            findings.problem(f"{where}: event {number}: {error}")
    findings.refuse()
    return tuple(events)


def shared_events(
    tables: Sequence[Mapping[str, Any]], system: System
) -> tuple[Mapping[str, Any], ...]:
    """Return the events of a scenario that can also happen to another system."""
    shared = []
    for table in tables:
        with suppress(InputError):
            _event(table, system, ())
            shared.append(table)
    return tuple(shared)


def _event(table: Mapping[str, Any], system: System, followed: Collection[PortName]) -> Event:
    [key] = [key for key in table if key in ACTIONS]
    start = system.start_time or 0.0
    if table.get("at", start) < start:
        raise InputError(f"at = {table['at']}: before the run begins, at {start:g} s")
    text = "stop" if key == "stop" else f"{key} {', '.join(_targets(table[key]))}"
    action = ACTIONS[key](table[key], system)
    for port, _ in action.inputs if isinstance(action, Set) else ():
        if port in followed:
            raise InputError(f"{port} follows a table of inputs: override it")
    return Event(
        text,
        action,
        table.get("label", text),
        table.get("at"),
        _condition(table["when"], system) if "when" in table else None,
        table.get("repeat", False),
        table.get("for"),
    )


def _targets(value: Any) -> Iterator[str]:
    """Yield the targets of an event, with their values."""
    if isinstance(value, Mapping):
        yield from (f"{name} = {_shown(each)}" for name, each in flatten(value))
    else:
        yield from [value] if isinstance(value, str) else value


def _shown(value: Any) -> str:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:g}" if is_number else literal(value)


def _condition(text: str, system: System) -> Condition:
    match = _CONDITION.fullmatch(text.strip())
    if match is None:
        raise InputError(
            f'when = {text!r}: write a signal, < or >, and a number: "plant.eta.z > 5"'
        )
    name, comparison, number = match.groups()
    [signal] = _ports(system, name, ("input", "output"), single=True)
    try:
        return Condition(signal, comparison, finite(number, f"when = {text!r}:"))
    except ValueError as error:
        raise InputError(str(error)) from None


# Signals of events


def _ports(
    system: System, text: str, causalities: Sequence[str], single: bool = False
) -> list[PortName]:
    """Return the port of a name, or the ports of a group; a star stands for several components.

    Raises:
        InputError: there is none with one of the causalities, or, if `single`, there are several.

    """
    several = system.expand(PortName.read(text))
    if len(several) > 1:
        if single:
            raise InputError(f"{text} are {len(several)} signals; name one of them")
        return [port for name in several for port in _ports(system, str(name), causalities)]
    port = system.named(several[0])
    if not system.has(port) and not single and (members := system.members(text, causalities)):
        return members
    variable = system.variable(port)
    if variable.causality not in causalities:
        raise InputError(
            f"{port} has causality {variable.causality}, not {' or '.join(causalities)}"
        )
    if variable.family == "String" and "parameter" not in causalities:
        raise InputError(f"{port} is a String: events act only on numbers and Booleans")
    return [port]


def routes(system: System, port: PortName) -> list[tuple[PortName, (Linear | Mapped) | None]]:
    """Return the inputs that a port feeds, each with its transformation; an input feeds itself."""
    if system.variable(port).causality == "input":
        return [(port, None)]
    routes = [(c.target, c.transformation) for c in system.connections if c.source == port]
    if not routes:
        raise InputError(f"{port} feeds nothing here: to change it would have no effect")
    return routes


def _inputs(names: Any, system: System) -> tuple[PortName, ...]:
    """Return the inputs that signals reach."""
    return tuple(
        target
        for name in _targets(names)
        for port in _ports(system, name, ("input", "output"))
        for target, _ in routes(system, port)
    )


def _members(name: str, value: Any, ports: Sequence[PortName]) -> Iterator[tuple[PortName, Any]]:
    """Pair the ports of a group with their values: one for all, or a list with one for each."""
    return System.paired(name, ports, value if isinstance(value, list) else [value] * len(ports))


# Actions of events


def _altered(
    values: Mapping[str, Any],
    system: System,
    arriving: Callable[[System, PortName, Any, (Linear | Mapped) | None], Value],
) -> tuple[tuple[PortName, Value], ...]:
    """Return the inputs that signals reach, with the values that arrive there."""
    altered = []
    for name, value in flatten(values):
        for port, each in _members(name, value, _ports(system, name, ("input", "output"))):
            for target, change in routes(system, port):
                arrived = arriving(system, port, each, change)
                if isinstance(arrived, float) and not isfinite(arrived):
                    raise InputError(
                        f"{port}: {each!r} is {arrived:g} where it arrives, at {target}"
                    )
                altered.append((target, arrived))
    return tuple(altered)


def _value(system: System, port: PortName, value: Any, change: (Linear | Mapped) | None) -> Value:
    """Convert the value of an overridden signal to the value of an input."""
    variable = system.variable(port)
    taken = variable.typed(_text(value), str(port))
    if change is None:
        return taken
    assert not isinstance(taken, str)
    return change(taken)


def _offset(system: System, port: PortName, value: Any, change: (Linear | Mapped) | None) -> float:
    """Convert the bias of a signal to the bias of an input."""
    added = system.variable(port).difference(value, str(port))
    if isinstance(change, Mapped):
        raise InputError(f"{port} is mapped by its connection: nothing can be added to it")
    return change.factor * added if isinstance(change, Linear) else added


def _text(value: Any) -> Any:
    return literal(value) if isinstance(value, bool) else value


def _set(values: Mapping[str, Any], system: System) -> _Action:
    fed = {connection.target: connection.source for connection in system.connections}
    parameters, inputs = [], []
    for name, value in flatten(values):
        for port, each in _members(name, value, _ports(system, name, ("parameter", "input"))):
            variable = system.variable(port)
            if port in fed:
                raise InputError(f"{port} is fed by {fed[port]}: override it")
            if variable.causality == "input":
                inputs.append((port, variable.typed(_text(each), str(port))))
            elif variable.variability != "tunable":
                raise InputError(
                    f"{port} is a {variable.variability} parameter: it cannot change during a run"
                )
            else:
                parameters.append((port, variable.typed(_text(each), str(port))))
    return Set(tuple(parameters), tuple(inputs))


def _reset(names: Any, system: System) -> _Action:
    for name in _targets(names):
        if system.steps.get(system.component(name).name, system.step) != system.step:
            raise InputError(f"{name} takes longer steps: it cannot be reset within one")
    return Reset(tuple(_targets(names)))


#: Any action of an event.
_Action = Alter | Freeze | Release | Reset | Set | Stop

#: Actions of events, by the key of their table.
ACTIONS: Mapping[str, Callable[[Any, System], _Action]] = {
    "set": _set,
    "override": lambda values, system: Alter("override", _altered(values, system, _value)),
    "bias": lambda values, system: Alter("bias", _altered(values, system, _offset)),
    "freeze": lambda names, system: Freeze(_inputs(names, system)),
    "drop": lambda names, system: Freeze(_inputs(names, system)),
    "lose": lambda names, system: Alter(
        "override", _altered(dict.fromkeys(_targets(names), 0), system, _value)
    ),
    "release": lambda names, system: Release(_inputs(names, system)),
    "reset": _reset,
    "stop": lambda _, __: Stop("stop"),
}
