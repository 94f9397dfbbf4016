"""modelDescription.xml of FMI 2.0.

PythonFMU and we ourselves write a description's frame each in their own way; what is in it follows
from the ports.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from fmus.ports.description import (
    ABOUT,
    CAPABILITIES,
    GENERATION_TOOL,
    UNITS,
    bounds,
    default_experiment,
    dependencies,
    literal,
    log_categories,
    text,
    unit_definitions,
    units_of,
    variable_attributes,
)
from fmus.ports.port import FAULT, Port

_CAPABILITIES = {
    **CAPABILITIES,
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "canNotUseMemoryManagementFunctions": "true",
}

#: The file of a component's sources that includes all others.
SOURCE = "fmi2.c"


def fmi2_description(name: str, description: str, guid: str, ports: Sequence[Port]) -> bytes:
    """The description of a component that is a library.

    Args:
        name: of the component, and of the library.
        description: one line.
        guid: as the library knows it.
        ports: all but `fault`, in the order of their value references.

    """
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": name,
            "guid": guid,
            "description": description,
            **ABOUT,
            "generationTool": GENERATION_TOOL,
            "variableNamingConvention": "structured",
        },
    )
    implementation = SubElement(root, "CoSimulation", modelIdentifier=name)
    SubElement(SubElement(implementation, "SourceFiles"), "File", name=SOURCE)
    root.extend((log_categories("fmi2"), default_experiment()))
    SubElement(root, "ModelVariables")
    SubElement(root, "ModelStructure")
    return text(complete(root, (*ports, FAULT)))


def complete(root: Element, ports: Sequence[Port]) -> Element:
    """Fill in what the ports of a component say.

    Args:
        root: fmiModelDescription with the elements CoSimulation, ModelVariables and
            ModelStructure.
        ports: all, in the order of their value references.

    """
    implementation = root.find("CoSimulation")
    variables = root.find("ModelVariables")
    structure = root.find("ModelStructure")
    assert implementation is not None and variables is not None and structure is not None
    implementation.attrib.update(_CAPABILITIES)
    variables[:] = [_variable(reference, port) for reference, port in enumerate(ports)]
    structure[:] = _structure(ports)
    units = units_of(ports)
    root.insert(1, unit_definitions(units))
    root.insert(2, _type_definitions(units))
    return root


def _variable(reference: int, port: Port) -> Element:
    variable = Element("ScalarVariable", variable_attributes(reference, port))
    value = SubElement(variable, port.kind)
    if port.unit is not None:
        value.set("declaredType", UNITS[port.unit].type_name)
        value.set("unit", port.unit)
    if port.start is not None:
        value.set("start", literal(port.start))
    value.attrib.update(bounds(port))
    return variable


def _type_definitions(units: Sequence[str]) -> Element:
    definitions = Element("TypeDefinitions")
    for unit in units:
        name = UNITS[unit].type_name
        simple_type = SubElement(definitions, "SimpleType", name=name)
        SubElement(simple_type, "Real", quantity=name, unit=unit)
    return definitions


def _structure(ports: Sequence[Port]) -> tuple[Element, Element]:
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    outputs, initial_unknowns = Element("Outputs"), Element("InitialUnknowns")
    for output in dependencies(ports):
        for parent, known in ((outputs, output.direct), (initial_unknowns, output.initial)):
            SubElement(
                parent,
                "Unknown",
                # FMI 2.0 counts variables from one.
                index=str(output.place),
                dependencies=" ".join(map(str, known)),
                dependenciesKind=" ".join(["dependent"] * len(known)),
            )
    return outputs, initial_unknowns
