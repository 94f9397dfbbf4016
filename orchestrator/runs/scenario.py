"""Scenarios: a title, a stop time and parameters over the closed loop, in a TOML file."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.machine.errors import InputError
from orchestrator.machine.user_files import explained, names_in, path_of, text_of
from orchestrator.master.experiment import Order
from orchestrator.runs.inputs import Inputs
from orchestrator.runs.waypoints import path_parameters
from orchestrator.system.names import PortName, file_name, flattened, port_name
from orchestrator.vehicle.signals import STANDARD

#: What a message calls a file that cannot be read.
_WHAT = "not a scenario"

FOLDER = Path(__file__).parent / "scenarios"

#: What is run besides the scenarios that come with the bundle.
_OTHERS = "a .toml, .ssp, .ssd or .fmu file, an OspSystemStructure.xml, or a folder with a .ssd"


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


def names() -> list[str]:
    """Scenarios that come with the bundle."""
    return names_in(FOLDER)


def read_scenario(name: str) -> Scenario:
    """A scenario of the bundle by its name, or any by the path of its file.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    path = path_of(name, FOLDER, "scenario", _OTHERS)
    text = text_of(path, _WHAT)
    with explained(path, _WHAT):
        return _scenario(path, text)


def check_events(where: object, tables: Sequence[Mapping[str, Any]]) -> None:
    """Check what can be checked of events without a system.

    Raises:
        Refused: an event is not written as one.

    """
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    ScenarioFile.check(where, {"events": list(tables)})


def _scenario(path: Path, text: str) -> Scenario:
    from orchestrator.runs.scenario_file import ScenarioFile  # noqa: PLC0415

    content = tomllib.loads(text)
    ScenarioFile.check(path, content)
    content["parameters"] = {
        port_name(key): value for key, value in flattened(content.get("parameters", {}))
    }
    if "path" in content:
        content["parameters"] |= _path_parameters(path, content.pop("path"), content["parameters"])
    if "inputs" in content:
        said = content["inputs"]
        content["inputs"] = Inputs(**said | {"file": path.parent / said["file"]})
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
    found = path_parameters(path.parent / said["file"], said.get("component", STANDARD.planner))
    for name in found.keys() & others.keys():
        raise InputError(f"{path}: {name} is given by {said['file']} already")
    return found
