"""Systems in the formats of other tools: SSP, OSP, or one FMU that contains them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from orchestrator.errors import InputError, last_line
from orchestrator.system.ssp import ssp_bytes
from orchestrator.system.structure import System, literal

_OSP = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"


def export_ssp(system: System, step: float, folder: Path) -> list[Path]:
    """Write `NAME.ssp`; the step is part of the system."""
    path = folder / f"{system.name}.ssp"
    path.write_bytes(ssp_bytes(system))
    return [path]


def export_osp(system: System, step: float, folder: Path) -> list[Path]:
    """Write `OspSystemStructure.xml` and the FMUs beside it, for libcosim and its command line."""
    root = ElementTree.Element("OspSystemStructure", xmlns=_OSP, version="0.1")
    for name, value in (("StartTime", "0.0"), ("BaseStepSize", str(step))):
        ElementTree.SubElement(root, name).text = value
    ElementTree.SubElement(root, "Algorithm").text = "fixedStep"
    simulators = ElementTree.SubElement(root, "Simulators")
    written = []
    for component in system.components.values():
        written.append(folder / component.fmu.name)
        shutil.copyfile(component.fmu, written[-1])
        simulator = ElementTree.SubElement(
            simulators,
            "Simulator",
            name=component.name,
            source=component.fmu.name,
            stepSize=str(step),
        )
        parameters = system.parameters_of(component.name)
        if parameters:
            values = ElementTree.SubElement(simulator, "InitialValues")
            for name, value in parameters.items():
                element = ElementTree.SubElement(values, "InitialValue", variable=name)
                variable = component.variable(name)
                ElementTree.SubElement(element, variable.type, value=literal(variable, value))
    connections = ElementTree.SubElement(root, "Connections")
    for connection in system.connections:
        element = ElementTree.SubElement(connections, "VariableConnection")
        for end in (connection.source, connection.target):
            ElementTree.SubElement(element, "Variable", simulator=end.component, name=end.port)
    ElementTree.indent(root)
    path = folder / "OspSystemStructure.xml"
    path.write_bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True))
    return [path, *written]


def export_container(system: System, step: float, folder: Path) -> list[Path]:
    """Write `NAME.fmu`, one FMU that contains the whole system and shows all its outputs.

    Raises:
        InputError: the FMU manipulation toolbox is not installed, or fails.

    """
    fmus = {component.name: component.fmu.name for component in system.components.values()}
    if len(set(fmus.values())) < len(fmus):
        raise InputError("a container takes each FMU once; this system has one twice")
    content: dict[str, Any] = {
        "name": f"{system.name}.fmu",
        "step_size": step,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "auto_parameter": False,
        "fmu": list(fmus.values()),
        "link": [
            [fmus[c.source.component], c.source.port, fmus[c.target.component], c.target.port]
            for c in system.connections
        ],
        "output": [
            [component.fmu.name, variable.name, f"{component.name}.{variable.name}"]
            for component in system.components.values()
            for variable in component.description.modelVariables
            if variable.causality == "output"
        ],
        "start": [
            [fmus[name], port, value]
            for name in system.components
            for port, value in system.parameters_of(name).items()
        ],
    }
    with TemporaryDirectory(prefix="auvfmu") as work:
        for component in system.components.values():
            shutil.copyfile(component.fmu, Path(work, component.fmu.name))
        Path(work, "system.json").write_text(json.dumps(content), encoding="utf-8")
        command = ["-m", "fmu_manipulation_toolbox.cli.fmucontainer", "-container", "system.json"]
        process = subprocess.run(
            [sys.executable, "-P", *command, "-fmu-directory", work],
            cwd=work,
            capture_output=True,
            text=True,
            check=False,
        )
        built = Path(work, f"{system.name}.fmu")
        if process.returncode != 0 or not built.is_file():
            reason = last_line(process.stderr + process.stdout)
            raise InputError(
                f"the container was not built: {reason}; it needs pip install 'auv-fmu[hosts]'"
            )
        path = folder / built.name
        shutil.copyfile(built, path)
    return [path]


#: Writers by the name of their format.
FORMATS: dict[str, Callable[[System, float, Path], list[Path]]] = {
    "ssp": export_ssp,
    "osp": export_osp,
    "container": export_container,
}
