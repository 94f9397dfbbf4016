"""Scenarios: parameters and more over the closed loop in a TOML file, and the tables they name."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.model_description import ModelVariable

from auv_fmu.guidance import path_planner
from auv_fmu.guidance.path_planner import MOST, Parameters, Waypoints
from auv_fmu.paper.actuators import Limits
from auv_fmu.paper.vehicle import Vehicle
from orchestrator.cosim.experiment import Order
from orchestrator.cosim.formats.tables import read_columns, read_rows, records
from orchestrator.cosim.hooks.timing import InputTable
from orchestrator.cosim.system.names import PortName, file_name, flatten, for_each, port_name
from orchestrator.cosim.system.structure import System, is_spread
from orchestrator.cosim.system.values import (
    TYPES,
    Standing,
    StringTable,
    Value,
    cell,
    finite,
    items_of,
    type_of,
    typed,
)
from orchestrator.machine.errors import InputError
from orchestrator.machine.user_files import explain_errors, read_text
from orchestrator.runs import SCENARIOS_FOLDER, find_toml, names_in
from orchestrator.vehicle.signals import ACTUATORS, STANDARD

#: What a message calls a file that cannot be read.
_NOT_A_SCENARIO = "not a scenario"

#: The name of a scenario that has no file.
_NAMELESS = "scenario"

#: What a message calls a table that cannot be read.
_NO_INPUTS = "not a table of inputs"

#: What is run besides the scenarios that come with the bundle.
_OTHERS = "a .toml, .ssp, .ssd or .fmu file, an OspSystemStructure.xml, or a folder with a .ssd"

#: So many seconds are farther apart than two numbers can be, apart from rounding [s].
_FARTHEST = 1e308

#: The model of the planners that run through waypoints.
_PATH_PLANNER = "PathPlanner"

#: Stands for the name of each vehicle, `auv1`, `auv2`, ...; in a wire, for the same one.
EACH_VEHICLE = "auv*"

#: The columns of a table of waypoints, without times and with them.
_PLACE, _TIMED = ["x", "y", "z"], ["t", "x", "y", "z"]


def vehicle_names(n: int | None) -> list[str]:
    """Names of n vehicles; None: the components of a single one have no prefix."""
    if n is None:
        return []
    return [EACH_VEHICLE.replace("*", str(number)) for number in range(1, n + 1)]


@dataclass(frozen=True)
class Inputs:
    """A table of inputs, as a scenario or the command line names it.

    Attributes:
        file: with the table.
        between: what continuous Real inputs do between two rows, `linear` or `hold`.
        wins: over the parameters of the scenario, as a table of the command line does.

    """

    file: Path
    between: str = "linear"
    wins: bool = False
    _read: dict[Any, list[np.ndarray]] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of its columns, after the time.

        Raises:
            InputError: the table cannot be read.

        """
        return read_columns(self.file, _NO_INPUTS)

    def columns(self, variables: Sequence[ModelVariable]) -> list[np.ndarray]:
        """The times, and the columns in the types of their variables.

        Systems whose variables are alike share what was read.

        Raises:
            InputError: the table cannot be read, or holds what is not of such a type.

        """
        kinds = tuple((v.type, v.min, v.max, *items_of(v).items()) for v in variables)
        if kinds not in self._read:
            self._read[kinds] = self._columns(variables)
        return self._read[kinds]

    def _columns(self, variables: Sequence[ModelVariable]) -> list[np.ndarray]:
        strings = StringTable()
        numbers: dict[str, Callable[[object], float]] = {}
        for name, variable in zip(self.names, variables, strict=True):
            of = TYPES[variable.type]
            if of.stands or of.family in ("Boolean", "Enumeration"):
                numbers[name] = partial(_stand_in, name, variable, strings)
        blocks = read_rows(self.file, numbers, _NO_INPUTS)
        rows = np.vstack([np.empty((0, 1 + len(variables))), *blocks])
        times, *columns = rows.T
        return [times] + [
            Standing(variable.type, strings).values(column)
            if TYPES[variable.type].stands
            else column
            for variable, column in zip(variables, columns, strict=True)
        ]


def _stand_in(name: str, variable: ModelVariable, strings: StringTable, value: object) -> float:
    """The number for a cell of a table.

    Raises:
        ValueError: the variable cannot have this value.

    """
    try:
        return strings.stand_in(typed(name, variable, cell(variable, value, f"{name}:")))
    except InputError as error:
        raise ValueError(str(error)) from None


@dataclass(frozen=True)
class Scenario:
    """What to run and how to show it; :mod:`.scenario_file` says what each entry means.

    Attributes:
        name: of the file, without its ending.
        digest: SHA-256 of the file; empty for a system that has none.

    """

    name: str
    title: str = ""
    label: str = ""
    figure: str = "tracking"
    z_up: bool = False
    compare: str = ""
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
    inputs: Inputs | None = None
    digest: str = ""

    @property
    def stem(self) -> str:
        """Name of its files and folders."""
        return file_name(self.name)

    @property
    def legend(self) -> str:
        """Name of its lines where two runs are drawn together."""
        return self.label or self.name


def names() -> list[str]:
    """Scenarios that come with the bundle."""
    return names_in(SCENARIOS_FOLDER)


def read_scenario(name: str) -> Scenario:
    """A scenario of the bundle by its name, or any by the path of its file.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    path = find_toml(name, SCENARIOS_FOLDER, "scenario", _OTHERS)
    text = read_text(path, _NOT_A_SCENARIO)
    with explain_errors(path, _NOT_A_SCENARIO):
        return _scenario(path, tomllib.loads(text), text)


def scenario_of(content: Mapping[str, Any]) -> Scenario:
    """A scenario from what its file would hold; paths in it are relative to the current folder.

    Raises:
        InputError: there is a mistake in it.

    """
    return _scenario(Path(_NAMELESS), dict(content), repr(content))


def check_events(where: object, tables: Sequence[Mapping[str, Any]]) -> None:
    """Check what can be checked of events without a system.

    Raises:
        Refused: an event is not written as one.

    """
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    ScenarioFile.check(where, {"events": list(tables)})


def _scenario(path: Path, content: dict[str, Any], text: str) -> Scenario:
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    ScenarioFile.check(path, content)
    content["parameters"] = {
        port_name(key): value for key, value in flatten(content.get("parameters", {}), is_spread)
    }
    vehicles = vehicle_names(content.get("vehicles"))
    for key in content.keys() & {"components", "wires", "steps"}:
        content[key] = for_each(EACH_VEHICLE, vehicles, content[key])
    for key in content.keys() & {"order", "only"}:
        if isinstance(content[key], list):
            listed = dict.fromkeys(content[key])
            content[key] = [*for_each(EACH_VEHICLE, vehicles, listed)]
    if "path" in content:
        said, others = content.pop("path"), content["parameters"]
        component = said.get("component", STANDARD.planner)
        found = path_parameters(path.parent / said["file"], component)
        for name in found.keys() & others.keys():
            raise InputError(f"{path}: {name} is already given by {said['file']}")
        content["parameters"] |= found
    if "inputs" in content:
        said = content["inputs"]
        content["inputs"] = Inputs(**said | {"file": path.parent / said["file"]})
    content["ours"] = {key: str(why) for key, why in flatten(content.get("ours", {}))}
    content["components"] = {
        component: str(path.parent / fmu) if str(fmu).endswith(".fmu") else fmu
        for component, fmu in content.get("components", {}).items()
    }
    if content.get("compare", "").endswith(".toml"):
        content["compare"] = str(path.parent / content["compare"])
    return Scenario(path.stem, digest=hashlib.sha256(text.encode()).hexdigest(), **content)


def read_inputs(
    inputs: Inputs, system: System, given: Collection[PortName]
) -> tuple[System, InputTable]:
    """A system that begins with the first values of a table, and what follows.

    Args:
        inputs: that are wanted.
        system: that has them.
        given: ports that have values from where the table is named: it must not name them, too.

    Raises:
        InputError: the table cannot be read, or a column is not an available input.

    """
    columns = inputs.names
    with _in_file(inputs.file):
        targets = [system.named(port_name(name)) for name in columns]
        variables = [system.component(one.component).variable(one.port) for one in targets]
    times, *values = inputs.columns(variables)
    with _in_file(inputs.file):
        return with_input_table(system, targets, times, values, given, inputs.between)


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
    """A system that begins with the first values of inputs over time, and what follows.

    Args:
        system: that has the inputs.
        names: of the inputs.
        times: of their values [s].
        columns: their values, of each input in its type or as doubles.
        given: ports that have values already.
        between: what continuous Real inputs do between two rows.

    Raises:
        InputError: a column is not an available input, or cannot be followed.

    """
    targets = tuple(map(system.named, names))
    _check_rows(times, columns, targets)
    for target, column in zip(targets, columns, strict=True):
        if target in map(system.named, given):
            raise InputError(f"{target} is given both a value and a column of the table")
        _check_column(system, target, column)
    linear = [_is_linear(system, target, between) for target in targets]
    input_table = InputTable.of(targets, times, columns, linear)
    start = system.start_time or 0.0
    values = input_table.at(start, int((times <= start).sum()) - 1)
    first = {
        target: _typed(system, target, value) for target, value in zip(targets, values, strict=True)
    }
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


def _check_column(system: System, target: PortName, column: np.ndarray) -> None:
    """Check that an input can be supplied, and takes all values of its column."""
    variable = system.component(target.component).variable(target.port)
    if variable.causality != "input":
        raise InputError(f"{target} has causality {variable.causality}, not input")
    for connection in system.connections:
        if connection.target == target:
            raise InputError(f"{target} is fed by {connection.source} and cannot be set")
    is_real = type_of(variable) == "Real"
    values = np.array([column.min(), column.max()]) if is_real else np.unique(column)
    for value in values.tolist():
        _typed(system, target, value)


def _typed(system: System, target: PortName, value: Value) -> Value:
    """A value of a table in the type of an input, which takes whole doubles as integers, too."""
    variable = system.component(target.component).variable(target.port)
    return typed(str(target), variable, f"{value:.17g}" if isinstance(value, float) else value)


def _is_linear(system: System, target: PortName, between: str) -> bool:
    variable = system.component(target.component).variable(target.port)
    # In FMI, discrete variables change only at events.
    return (type_of(variable), variable.variability, between) == ("Real", "continuous", "linear")


def path_parameters(path: Path, component: str) -> dict[PortName, Any]:
    """Parameters with which a planner runs through the waypoints of a table.

    Args:
        path: CSV with a line of names, x, y, z and maybe t, and a line a waypoint.
        component: that is the planner.

    Raises:
        InputError: there is no such table, or it has a mistake.

    """
    with records(path, "not a table of waypoints", _are_of_waypoints) as (first, rows):
        names = [*map(_plain, first)]
        if not _are_of_waypoints(first):
            raise ValueError(f"its columns are {', '.join(names)}; use x, y, z or t, x, y, z")
        waypoints = [
            {n: finite(text, f"line {line}, {n}:") for n, text in zip(names, values, strict=True)}
            for line, values in rows
        ]
        if not 2 <= len(waypoints) <= MOST:
            raise ValueError(
                f"it has {len(waypoints)} waypoints, and a path has 2 to {MOST}; for more, write a "
                "planner (docs/how-to/trajectories.md)"
            )
    values: dict[str, Any] = {"count": len(waypoints), "timed": "t" in names}
    for number, waypoint in enumerate(waypoints, start=1):
        values |= {f"waypoint[{number}].{name}": value for name, value in waypoint.items()}
    return {PortName(component, port): value for port, value in values.items()}


def impossible_paths(system: System) -> Iterator[str]:
    """What PathPlanners of a system will refuse of their paths, without a run of them."""
    for name, component in system.components.items():
        if component.description.modelName != _PATH_PLANNER:
            continue
        try:
            path_planner.check(_planned({**component.starts, **system.parameters_of(name)}))
        except KeyError:
            # Another model of that name.
            continue
        except ArithmeticError as error:
            yield f"{name}: {error}"


def _planned(values: Mapping[str, Any]) -> Parameters:
    """Parameters of the equations, from the values of ports."""
    x, y, z, t = (
        tuple(values[f"waypoint[{k}].{axis}"] for k in range(1, 1 + MOST)) for axis in "xyzt"
    )
    timed, cruise, rounding = (values[name] for name in ("timed", "cruise", "rounding"))
    limits = (tuple(values[f"{end}.{name}"] for name in ACTUATORS) for end in Limits._fields)
    return Parameters(
        Waypoints(values["count"], x, y, z, t, timed, cruise, rounding),
        Vehicle(*(values[name.replace("_", ".")] for name in Vehicle._fields)),
        values["ell"],
        Limits(*limits),
        values["speed_max"],
        values["turn_max"],
    )


def _plain(name: str) -> str:
    return name.strip().lower()


def _are_of_waypoints(names: Sequence[str]) -> bool:
    return sorted(map(_plain, names)) in (_PLACE, _TIMED)
