"""A system as libcosim's own configuration."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

from orchestrator.errors import InputError
from orchestrator.system.structure import System
from orchestrator.system.values import literal

#: The versions of FMI that libcosim knows and we can write.
_TAKEN = ("2.0",)

_STRUCTURE = "OspSystemStructure.xml"

_OSP = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"


def write_osp(system: System, folder: Path) -> list[Path]:
    """Write `OspSystemStructure.xml` and the FMUs beside it, for libcosim and its command line.

    Raises:
        InputError: there is an FMU that libcosim cannot open, or a connection that this format has
            no words for.

    """
    for connection in system.connections:
        if connection.transformation is not None:
            raise InputError(
                f"{connection.source} -> {connection.target}: is transformed; write an SSP"
            )
    for component in system.components.values():
        version = component.description.fmiVersion
        if version not in _TAKEN:
            raise InputError(
                f"{component.name}: libcosim takes no FMU of FMI {version}; write an SSP, or FMUs "
                "with --fmi 2"
            )
    root = ElementTree.Element("OspSystemStructure", xmlns=_OSP, version="0.1")
    for tag, text in (
        ("StartTime", str(system.start_time or 0.0)),
        ("BaseStepSize", str(system.step)),
    ):
        ElementTree.SubElement(root, tag).text = text
    ElementTree.SubElement(root, "Algorithm").text = "fixedStep"
    simulators = ElementTree.SubElement(root, "Simulators")
    fmus = system.fmus(_STRUCTURE)
    for fmu, name in fmus.items():
        shutil.copyfile(fmu, folder / name)
    for component in system.components.values():
        simulator = ElementTree.SubElement(
            simulators,
            "Simulator",
            name=component.name,
            source=fmus[component.fmu],
            stepSize=str(system.steps.get(component.name, system.step)),
        )
        parameters = system.parameters_of(component.name)
        if parameters:
            values = ElementTree.SubElement(simulator, "InitialValues")
            for name, value in parameters.items():
                element = ElementTree.SubElement(values, "InitialValue", variable=name)
                kind = component.variable(name).type
                ElementTree.SubElement(element, kind, value=literal(value))
    connections = ElementTree.SubElement(root, "Connections")
    for connection in system.connections:
        element = ElementTree.SubElement(connections, "VariableConnection")
        for end in (connection.source, connection.target):
            ElementTree.SubElement(element, "Variable", simulator=end.component, name=end.port)
    ElementTree.indent(root)
    path = folder / _STRUCTURE
    path.write_bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True))
    return [path, *(folder / name for name in fmus.values())]
