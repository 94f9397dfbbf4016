"""What a host reads of a component in FMI 3.0: modelDescription.xml and buildDescription.xml."""

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
from fmus.ports.port import FAULT, TIME, Port

#: What FMI 3.0 calls the types of variables.
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}

_VERSION = "3.0"

_CAPABILITIES = {**CAPABILITIES, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}

#: The file of a component's sources that includes all others, and what it is written in.
SOURCE, _LANGUAGE = "fmi3.c", "C99"

#: Platforms where mathematics is in a library apart from the C library.
_LIBM_APART = ("x86_64-linux", "aarch64-linux")


def fmi3_description(name: str, description: str, token: str, ports: Sequence[Port]) -> bytes:
    """The description of a component.

    Args:
        name: of the component, and of the library.
        description: one line.
        token: as the library knows it.
        ports: all but `fault`, in the order of their value references.

    """
    variables = (*ports, FAULT, TIME)
    units = units_of(variables)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": _VERSION,
            "modelName": name,
            "instantiationToken": token,
            "description": description,
            **ABOUT,
            "generationTool": GENERATION_TOOL,
            "variableNamingConvention": "structured",
        },
    )
    SubElement(root, "CoSimulation", _CAPABILITIES, modelIdentifier=name)
    root.extend(
        (
            unit_definitions(units),
            _type_definitions(units),
            log_categories("fmi3"),
            default_experiment(),
            _variables(variables),
            _structure(variables),
        )
    )
    return text(root)


def fmi3_build_description(name: str) -> bytes:
    """What an importer has to compile: one file, with any compiler and no options."""
    root = Element("fmiBuildDescription", fmiVersion=_VERSION)
    _configuration(root, modelIdentifier=name)
    for platform in _LIBM_APART:
        linked = _configuration(root, modelIdentifier=name, platform=platform)
        SubElement(linked, "Library", name="m", external="true")
    return text(root)


def _configuration(root: Element, **attributes: str) -> Element:
    configuration = SubElement(root, "BuildConfiguration", attributes)
    sources = SubElement(configuration, "SourceFileSet", language=_LANGUAGE)
    SubElement(sources, "SourceFile", name=SOURCE)
    return configuration


def _type_definitions(units: Sequence[str]) -> Element:
    definitions = Element("TypeDefinitions")
    for unit in units:
        name = UNITS[unit].type_name
        SubElement(definitions, "Float64Type", name=name, quantity=name, unit=unit)
    return definitions


def _variables(ports: Sequence[Port]) -> Element:
    variables = Element("ModelVariables")
    for place, port in enumerate(ports, start=1):
        variable = SubElement(variables, TYPES[port.kind], variable_attributes(place, port))
        if port.unit is not None:
            variable.set("declaredType", UNITS[port.unit].type_name)
            variable.set("unit", port.unit)
        if isinstance(port.start, str):
            SubElement(variable, "Start", value=port.start)
        elif port.start is not None:
            variable.set("start", literal(port.start))
        variable.attrib.update(bounds(port))
    return variables


def _structure(ports: Sequence[Port]) -> Element:
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    known = list(dependencies(ports))
    structure = Element("ModelStructure")
    for output in known:
        structure.append(_unknown("Output", output.place, output.direct))
    for output in known:
        structure.append(_unknown("InitialUnknown", output.place, output.initial))
    return structure


def _unknown(tag: str, place: int, known: Sequence[int]) -> Element:
    return Element(
        tag,
        valueReference=str(place),
        dependencies=" ".join(map(str, known)),
        dependenciesKind=" ".join(["dependent"] * len(known)),
    )
