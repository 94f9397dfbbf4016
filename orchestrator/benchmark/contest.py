"""Laws and vehicles of the benchmark, and the runs of each law with each vehicle.

A law is a component with outputs tau and some of the inputs in :data:`SENSORS` and
:data:`REFERENCES`. In the loop of a vehicle it takes the place of the controller. Runs of a law
with a vehicle are a study: every task with each of the same draws.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from fmus.discovery import digest_at
from fmus.kinds import PYTHON
from orchestrator.cosim import Component, PortName, System, read_component
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.program.components import definitions_of
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.made_components import with_fmus
from orchestrator.runs.scenario import Scenario, read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.studies.batch_engine import ADVICE, REFUSED
from orchestrator.studies.engine import outcomes_of
from orchestrator.studies.store import StudyResult
from orchestrator.studies.study import FMU, Range, Study, read_study
from orchestrator.studies.sweep import Means, Ready, complete_study, prepare_study

_HERE = Path(__file__).parent

#: Inputs that a law may have from sensors, and what each sensor measures; and from the task.
SENSORS: Mapping[str, str] = {"y": "position", "eta": "attitude", "dy": "velocity"}
REFERENCES = ("y_d", "dy_d", "ddy_d")

#: Members of these groups, and of the command.
_XYZ, _ANGLES, _ACTUATORS = ("x", "y", "z"), ("phi", "theta", "psi"), ("u", "q", "r")
_INPUTS = {
    f"{group}.{member}"
    for group in (*SENSORS, *REFERENCES)
    for member in (_ANGLES if group == "eta" else _XYZ)
}
_COMMAND = tuple(f"tau.{member}" for member in _ACTUATORS)

#: Parameters of a law that a vehicle sets, and where they are in its loop.
_KNOWN = {"ell": "plant.ell", **{f"tau_max.{k}": f"limiter.tau_max.{k}" for k in _ACTUATORS}}

#: The parameter of the task.
TASK = "planner.task"

#: The component of a law in a loop, and the name of its ranges of gains in a script.
LAW, GAINS = "controller", "GAINS"

#: Gains by the names of vehicles, of laws, and of the gains.
Gains = Mapping[str, Mapping[str, Mapping[str, float]]]


class Law(NamedTuple):
    """A law.

    Attributes:
        name: in tables and in names of folders.
        label: in figures and tables.
        component: name of a bundled component, or path of a script.
        gains: ranges that are searched, by the names of parameters or of groups.

    """

    name: str
    label: str
    component: str
    gains: Mapping[str, Range]

    @property
    def digest(self) -> str:
        """Hash of its script; the name of a bundled component."""
        return digest_at(Path(self.component)) or self.component


class Vehicle(NamedTuple):
    """A vehicle.

    Attributes:
        name: stem of its files.
        scenario: its loop.
        study: what is drawn at random.
        known: what laws know of it: values of groups of parameters.

    """

    name: str
    scenario: Scenario
    study: Study
    known: Mapping[str, Sequence[float]]

    @property
    def tasks(self) -> Sequence[str]:
        """Names of the tasks."""
        return self.study.vary[TASK]


# Laws


def laws() -> dict[str, Law]:
    """Return the laws of the benchmark, by name."""
    found = {}
    for name, entry in tomllib.loads((_HERE / "laws.toml").read_text(encoding="utf-8")).items():
        if script := entry.get("script"):
            law = law_of(_laws_folder() / script, name, entry["label"])
        else:
            gains = {key: Range(*ends) for key, ends in entry.get("gains", {}).items()}
            law = Law(name, entry["label"], entry["component"], gains)
        found[name] = law
    return found


def _laws_folder() -> Path:
    """Return the folder of the scripts: of an installed package, or of the repository."""
    installed = _HERE / "laws"
    return installed if installed.is_dir() else _HERE.parents[1] / "examples"


def law_of(script: Path, name: str = "", label: str = "") -> Law:
    """Return the law in a script.

    Raises:
        InputError: there is no such script, or its `GAINS` are not ranges.

    """
    if script.suffix != ".py" or not script.is_file():
        raise InputError(f"{script}: no such Python file; a law is a component in one .py")
    name = name or script.stem
    return Law(name, label or name, str(script), _gains_of(script))


def _gains_of(script: Path) -> dict[str, Range]:
    """Read `GAINS` in a script without running it; empty if there is none."""
    why = f'{script}: {GAINS}: write {{"name": (low, high)}} with 0 < low < high'
    try:
        statements = ast.parse(script.read_bytes(), script.name).body
    except (SyntaxError, ValueError) as error:
        raise InputError(f"{script}: {reason(error)}") from None
    for node in statements:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if not any(isinstance(each, ast.Name) and each.id == GAINS for each in targets):
            continue
        try:
            table = ast.literal_eval(getattr(node, "value"))  # noqa: B009
            gains = {str(key): Range(float(low), float(high)) for key, (low, high) in table.items()}
        except (AttributeError, TypeError, ValueError):
            raise InputError(why) from None
        if not all(0.0 < low < high and isfinite(high) for low, high, _ in gains.values()):
            raise InputError(why)
        return gains
    return {}


def component_of(law: Law) -> Component:
    """Return the component of a law.

    Raises:
        InputError: it is not one that can be a law.

    """
    return _component(law.component, law.digest, Path.cwd())


@cache
def _component(component: str, digest: str, where: Path) -> Component:
    """Return a component, read once while its script does not change."""
    folder = current_fmus(PYTHON)
    scenario = Scenario(Path(component).stem, components={LAW: component})
    made = str(with_fmus(scenario, folder, PYTHON).components[LAW])
    file = Path(made) if made.endswith(".fmu") else folder / f"{made}.fmu"
    law = read_component(LAW, file)
    _check(component, law)
    return law


def _check(name: str, law: Component) -> None:
    """Refuse a component that cannot be a law."""
    outputs = {variable.name for variable in law.having("output")}
    if missing := [port for port in _COMMAND if port not in outputs]:
        raise InputError(f"{name}: has no output {missing[0]}; a law has {', '.join(_COMMAND)}")
    for variable in law.having("input"):
        if variable.name not in _INPUTS:
            groups = ", ".join((*SENSORS, *REFERENCES))
            raise InputError(
                f"{name}: the input {variable.name} is unknown: a law may have {groups}"
                f"{did_you_mean(variable.name, sorted(_INPUTS))}"
            )
    definitions_of(System(name, {LAW: law}, ()))


def sensors_of(law: Law) -> list[str]:
    """Return what the sensors measure that a law uses."""
    groups = _groups(component_of(law))
    return [what for group, what in SENSORS.items() if group in groups]


def _groups(law: Component) -> set[str]:
    return {variable.name.partition(".")[0] for variable in law.having("input")}


# Vehicles


def vehicles() -> dict[str, Vehicle]:
    """Return the vehicles, by name."""
    known = tomllib.loads((_HERE / "known.toml").read_text(encoding="utf-8"))
    return {
        name: Vehicle(
            name,
            read_scenario(str(_HERE / "vehicles" / f"{name}.toml")),
            read_study(str(_HERE / "draws" / f"{name}.toml")),
            values,
        )
        for name, values in known.items()
    }


def loop_of(law: Law, vehicle: Vehicle, gains: Mapping[str, float]) -> tuple[Scenario, System]:
    """Return the loop of a vehicle with a law.

    Args:
        law: in place of the controller.
        vehicle: of the loop.
        gains: values of the law's parameters, or of all members of a group.

    Raises:
        InputError: the law cannot be in this loop, or lacks a gain.

    """
    component, folder = component_of(law), current_fmus(PYTHON)
    groups, wires = _groups(component), dict(vehicle.scenario.wires)
    for group in (*SENSORS, *REFERENCES):
        wire = f"{LAW}.{group}"
        if group not in groups:
            wires.pop(wire, None)
            # Only wires of the usual loop can be removed.
            wires |= {} if group == "dy" else {wire: False}
        elif group in SENSORS:
            wires[wire] = f"sensors.{group}"
    scenario = replace(
        vehicle.scenario,
        name=f"{vehicle.name} {law.name}",
        components={**vehicle.scenario.components, LAW: str(component.fmu)},
        wires=wires,
    )
    system = closed_loop(folder, with_fmus(scenario, folder, PYTHON))
    known: dict[str, Any] = {
        f"{LAW}.{name}": system.value(PortName.read(place))
        for name, place in _KNOWN.items()
        if name in component.variables
    }
    for name, values in vehicle.known.items():
        ports = system.members(f"{LAW}.{name}", ("parameter",))
        known |= zip(map(str, ports), values, strict=False)
    system = system.with_parameters({**known, **members(law, gains)})
    return replace(scenario, parameters=system.expanded(scenario.parameters)), system


def members(law: Law, gains: Mapping[str, float]) -> dict[str, float]:
    """Return gains by the parameters of the loop; all members of a group have its value.

    Raises:
        InputError: the law has no such parameter.

    """
    parameters = [variable.name for variable in component_of(law).having("parameter")]
    values = dict[str, float]()
    for name, value in gains.items():
        found = [
            port for port in parameters if port == name or port.startswith((f"{name}.", f"{name}["))
        ]
        if not found:
            hint = did_you_mean(name, parameters)
            raise InputError(f"{law.component}: {GAINS}: there is no parameter {name!r}{hint}")
        values |= {f"{LAW}.{port}": value for port in found}
    return values


# Runs


def study_of_law(law: Law, vehicle: Vehicle, n: int) -> Study:
    """Return the study of a law with a vehicle, with n draws."""
    name = f"{vehicle.name} {law.name}"
    return replace(
        vehicle.study.with_points(n),
        name=name,
        scenario=(name,),
        indices=(_HERE / "score.py",),
        draws=False,
        explains=False,
    )


def prepared(
    law: Law, vehicle: Vehicle, study: Study, gains: Mapping[str, float], means: Means
) -> Ready:
    """Return the study of a law with a vehicle and some gains, ready for runs.

    Raises:
        InputError: the runs cannot be made.

    """
    systems = {study.name: loop_of(law, vehicle, gains)}
    with clear_refusals(law):
        return prepare_study(study, replace(means, kind=PYTHON), given=systems)


def runs_of(
    law: Law,
    vehicle: Vehicle,
    n: int,
    gains: Mapping[str, float],
    out: Path,
    command: Sequence[str],
    means: Means,
    say: Callable[[str], None] = lambda _: None,
    progress: bool = False,
) -> StudyResult:
    """Make the missing runs of a law with a vehicle.

    Args:
        law, vehicle: of the runs.
        n: number of draws.
        gains: of the law.
        out: folder of the benchmark.
        command: for the record.
        means: of making runs.
        say: receives notes for the user.
        progress: show a bar.

    Raises:
        InputError: the runs cannot be made, or the folder has others.

    """
    study = study_of_law(law, vehicle, n)
    with clear_refusals(law):
        return complete_study(
            study,
            replace(means, kind=PYTHON),
            out / vehicle.name / law.name,
            command,
            say,
            progress,
            systems={study.name: loop_of(law, vehicle, gains)},
        )


def refusal_in(
    result: StudyResult, law: Law, vehicle: Vehicle, n: int, gains: Mapping[str, float]
) -> str:
    """Return a line on the runs that were refused, with the reason of the first; empty if none.

    Args:
        result: the runs.
        law, vehicle, n, gains: of :func:`runs_of`.

    """
    refused = result["run"][result["failure"] == REFUSED]
    if not len(refused):
        return ""
    # Only FMUs give a reason.
    ready = prepared(law, vehicle, study_of_law(law, vehicle, n), gains, Means(engine=FMU))
    [outcome] = outcomes_of(ready.engine, ready.space.points(refused[:1]))
    return (
        f"{law.component}: {len(refused)} of {result.runs} runs with {vehicle.name} were refused; "
        f"the first: {outcome.failure}"
    )


@contextmanager
def clear_refusals(law: Law) -> Iterator[None]:
    """Name the law in a refusal of the engine, without the advice to take another engine."""
    try:
        yield
    except InputError as error:
        text = str(error)
        if text.endswith(ADVICE):
            text = text.removesuffix(f"; {ADVICE}").partition(": ")[2]
            is_named = Path(law.component).name in text
            text = text if is_named else f"{law.component}: {text}"
        raise InputError(text) from None


def read_gains(path: Path) -> dict[str, Any]:
    """Read a file of gains; empty if there is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a file of gains: {error}") from None


#: The gains that come with the program.
OWN_GAINS = _HERE / "gains.toml"
