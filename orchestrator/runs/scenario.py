"""Scenarios: a title, a stop time and parameters over the closed loop, in a TOML file."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.reading import explained, text_of
from orchestrator.master.experiment import COUPLINGS, Order
from orchestrator.runs.entries import (
    Entry,
    are_names,
    check_entries,
    flattened,
    is_flag,
    is_number,
    is_table,
    is_text,
)
from orchestrator.runs.inputs import ENTRIES as INPUTS
from orchestrator.runs.inputs import Inputs
from orchestrator.runs.named import names_in, path_of
from orchestrator.runs.scenario_events import check_events
from orchestrator.runs.waypoints import ENTRIES as PATH
from orchestrator.runs.waypoints import path_parameters
from orchestrator.system.names import PortName, file_name, port_name
from orchestrator.vehicle.signals import STANDARD

#: What a file is not that cannot be read.
_WHAT = "not a scenario"

FOLDER = Path(__file__).parent / "scenarios"

#: What is run besides those that come with the bundle.
KINDS = "a .toml, .ssp, .ssd or .fmu file, an OspSystemStructure.xml, or a folder with a .ssd"


@dataclass(frozen=True)
class Scenario:
    """What to run and how to show it; :data:`ENTRIES` says what each entry means.

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
    components: Mapping[str, str] = field(default_factory=dict)
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


def _is_table_of_names(value: Any) -> bool:
    return is_table(value) and all(map(is_text, value.values()))


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and all(map(is_table, value))


def _is_table_of_wires(value: Any) -> bool:
    return is_table(value) and all(is_text(v) or v is False for v in value.values())


def _is_table_of_numbers(value: Any) -> bool:
    return is_table(value) and all(map(is_number, value.values()))


#: What a scenario file may hold, in the order of the reference page.
ENTRIES: dict[str, Entry] = {
    "title": Entry(
        "text",
        is_text,
        "Heading of the figures and of the section in the report.",
        "the name of the file",
    ),
    "label": Entry(
        "text",
        is_text,
        "Name of its lines where two runs are drawn together.",
        "the name of the file",
    ),
    "figure": Entry("text", is_text, "Which figure to draw.", "`tracking`"),
    "z_up": Entry(
        "true or false",
        is_flag,
        "Whether z is up and y west where the path is drawn, as in the paper's words (reading 16).",
        "`false`: z is down and y east",
    ),
    "compare": Entry(
        "text",
        is_text,
        "A scenario that is run and drawn together with this one: a name, or the path of a .toml "
        "file, relative to this one. It keeps its controller. Other components, the wires between "
        "them, `[path]` and the parameters of the planner are this scenario's, so that both follow "
        "one reference; what else this scenario and the command line set goes for both, as far as "
        "both have it. Where both have the same controller, it keeps all components but the "
        "planner.",
        "none",
    ),
    "stop_time": Entry("number", is_number, "End of the run [s].", "100 s"),
    "step": Entry("number", is_number, "Communication step [s].", "0.02 s"),
    "steps": Entry(
        "table of numbers",
        _is_table_of_numbers,
        "Components that take longer steps of their own, as `component = step` [s], a multiple of "
        "the communication step. Meanwhile they hold their inputs.",
        "none",
    ),
    "order": Entry(
        "name, or list of names",
        lambda value: is_text(value) or are_names(value),
        "In which components are stepped: `gauss-seidel`, `jacobi`, or the names of all of them.",
        "`gauss-seidel`",
    ),
    "coupling": Entry(
        "name",
        lambda value: value in COUPLINGS,
        "How rings of direct feedthroughs are closed: `solve`, `delay` or `linear`.",
        "`solve` where the FMUs allow it, else `delay`",
    ),
    "only": Entry(
        "list of names",
        are_names,
        "The components to keep; the wires of the others go with them.",
        "all of them",
    ),
    "remark": Entry("text", is_text, "What the report says below the figure, in Markdown.", "none"),
    "components": Entry(
        "table of names",
        _is_table_of_names,
        "FMUs that take the place of the closed loop's own, or stand beside them, as "
        '`component = "FMU"`: a name of the bundle\'s, or the path of a .fmu file, relative to '
        "this file.",
        "none",
    ),
    "wires": Entry(
        "table of names, or false",
        _is_table_of_wires,
        'Further wires, as `"component.group" = "component.group"`: every input of the group on '
        "the left takes the output of the same name in the group on the right. Where both sides "
        'name a port, that one is wired, as `"g.u[1]" = "t.y"`. `false` removes a wire.',
        "none",
    ),
    "parameters": Entry(
        "table of values",
        is_table,
        "Parameters, and inputs that nothing feeds, as `component.parameter = value`. Names with "
        'brackets are quoted: `"controller.K1[1]" = 12.0`.',
        "the FMUs' own",
    ),
    "path": Entry(
        "table",
        is_table,
        "Waypoints of a PathPlanner, from a table: [see below](#path).",
        "none",
    ),
    "events": Entry(
        "list of tables",
        _are_tables,
        "What happens during the run, each as `[[events]]`: [see below](#events).",
        "nothing",
    ),
    "inputs": Entry(
        "table",
        is_table,
        "A table of inputs over time: [see below](#inputs).",
        "inputs keep their values",
    ),
    "ours": Entry(
        "table of texts",
        is_table,
        'Which of the values above are not the paper\'s, and why: `stop_time = "why"`, '
        '`plant.noise.std = "why"`.',
        "none",
    ),
}


def names() -> list[str]:
    """Scenarios that come with the bundle."""
    return names_in(FOLDER)


def read_scenario(name: str) -> Scenario:
    """A scenario of the bundle by its name, or any by the path of its file.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    path = path_of(name, FOLDER, "scenario", KINDS)
    text = text_of(path, _WHAT)
    with explained(path, _WHAT):
        return _scenario(path, text)


def _scenario(path: Path, text: str) -> Scenario:
    content = tomllib.loads(text)
    findings = Findings()
    with findings.collecting():
        check_entries(path, content, ENTRIES)
    if _are_tables(events := content.get("events", ())):
        with findings.collecting():
            check_events(path, events)
    if "inputs" in content and is_table(content["inputs"]):
        with findings.collecting():
            content["inputs"] = _inputs(path, content["inputs"])
    findings.refuse()
    content["parameters"] = {
        port_name(key): value for key, value in flattened(content.get("parameters", {}))
    }
    if "path" in content:
        content["parameters"] |= _path_parameters(path, content.pop("path"), content["parameters"])
    content["ours"] = {key: str(why) for key, why in flattened(content.get("ours", {}))}
    content["components"] = {
        component: str(path.parent / fmu) if fmu.endswith(".fmu") else fmu
        for component, fmu in content.get("components", {}).items()
    }
    if content.get("compare", "").endswith(".toml"):
        content["compare"] = str(path.parent / content["compare"])
    return Scenario(path.stem, digest=hashlib.sha256(text.encode()).hexdigest(), **content)


def _path_parameters(
    path: Path, said: Mapping[str, str], others: Mapping[PortName, Any]
) -> dict[PortName, Any]:
    """What a path comes to, in a scenario with other parameters."""
    _check_table(path, "path", said, PATH)
    found = path_parameters(path.parent / said["file"], said.get("component", STANDARD.planner))
    for name in found.keys() & others.keys():
        raise InputError(f"{path}: {name} is given by {said['file']} already")
    return found


def _inputs(path: Path, table: Mapping[str, Any]) -> Inputs:
    _check_table(path, "inputs", table, INPUTS)
    return Inputs(**{**table, "file": path.parent / table["file"]})


def _check_table(
    path: Path, entry: str, said: Mapping[str, Any], entries: Mapping[str, Entry]
) -> None:
    """Check what a scenario says of a table in a file of its own."""
    check_entries(f"{path}: {entry}", said, entries)
    if "file" not in said:
        raise InputError(f"{path}: {entry}: name a file")
