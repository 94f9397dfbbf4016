"""What a host reads of a component in FMI 3.0: its description, its build and its terminals.

A terminal of terminalsAndIcons.xml is a group of ports, as one thing to connect. It has the name of
its group, or of the group that it is made to take. Components call the members of a group that they
exchange the same, so a tool that joins two terminals of one name joins the right variables.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from auv_fmu.quantities import member_of
from fmus.ports.definition import Definition
from fmus.ports.description import (
    CAPABILITIES,
    add_items,
    default_experiment,
    dependencies,
    dependent_on,
    enumerations_of,
    log_categories,
    root_of,
    text,
    unit_definitions,
    units_of,
    value_attributes,
    variable_attributes,
)
from fmus.ports.groups import slices
from fmus.ports.port import FAULT, TIME, Port
from fmus.ports.units import unit_of

#: What FMI 3.0 calls the types of variables.
TYPES = {
    "Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration",
}  # fmt: skip

_VERSION = "3.0"

_CAPABILITIES = {**CAPABILITIES, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}

#: The file of a component's sources that includes all others, and what it is written in.
SOURCE, _LANGUAGE = "fmi3.c", "C99"

#: What is linked besides the C library, by platform: mathematics may be apart from it.
_LIBRARIES = {
    "x86_64-linux": ("m",),
    "aarch64-linux": ("m",),
    "x86_64-windows": (),
    "x86_64-darwin": (),
    "aarch64-darwin": (),
}


def fmi3_description(definition: Definition, token: str) -> bytes:
    """The description of a component that is a library of the same name.

    Args:
        definition: of the component.
        token: as the library knows it.

    """
    variables = (*definition.ports, FAULT, TIME)
    units = units_of(variables)
    root = root_of(_VERSION, definition, instantiationToken=token)
    SubElement(root, "CoSimulation", _CAPABILITIES, modelIdentifier=definition.name)
    root.extend(
        (
            unit_definitions(units),
            _type_definitions(variables),
            log_categories("fmi3"),
            default_experiment(definition.behaviour),
            _variables(variables),
            _structure(variables),
        )
    )
    return text(root)


def fmi3_build_description(name: str) -> bytes:
    """What an importer has to compile: one file, with any compiler and no options."""
    root = Element("fmiBuildDescription", fmiVersion=_VERSION)
    for platform, libraries in _LIBRARIES.items():
        built = SubElement(root, "BuildConfiguration", modelIdentifier=name, platform=platform)
        sources = SubElement(built, "SourceFileSet", language=_LANGUAGE)
        SubElement(sources, "SourceFile", name=SOURCE)
        for library in libraries:
            SubElement(built, "Library", name=library, external="true")
    return text(root)


def _type_definitions(ports: Sequence[Port]) -> Element:
    definitions = Element("TypeDefinitions")
    for unit in units_of(ports):
        name = unit_of(unit).type_name
        SubElement(definitions, "Float64Type", name=name, quantity=name, unit=unit)
    for name, choices in enumerations_of(ports).items():
        add_items(SubElement(definitions, "EnumerationType", name=name), choices)
    return definitions


def _variables(ports: Sequence[Port]) -> Element:
    variables = Element("ModelVariables")
    for place, port in enumerate(ports, start=1):
        attributes = {**variable_attributes(place, port), **value_attributes(port)}
        SubElement(variables, TYPES[port.type], attributes)
    return variables


def _structure(ports: Sequence[Port]) -> Element:
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    outputs = list(dependencies(ports))
    structure = Element("ModelStructure")
    for out in outputs:
        SubElement(structure, "Output", dependent_on(out.direct), valueReference=str(out.place))
    for out in outputs:
        known = dependent_on(out.initial)
        SubElement(structure, "InitialUnknown", known, valueReference=str(out.place))
    return structure


# Terminals

#: All members of an input have to come from somewhere. Not all of an output's need to go there:
#: a controller takes only the angles of the posture. Each terminal's rule is its own.
_MATCHING_RULE = {"input": "plug", "output": "bus"}

#: Outputs for inputs of other names: friction is against the velocity through the water.
_TAKES = {"nu": "nu_r"}

#: Corners of the icon, and how many millimetres its units are on a screen.
_ICON = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
_SCALE = "0.1"

#: Where the terminals of inputs and of outputs begin, from left to right, and how large they are.
_LEFT_EDGE = {"input": -110, "output": 100}
_SIZE = 10

#: What lines between signals look like in Modelica.
_COLOUR = "0 0 127"

#: The picture of a terminal, beside the file, without its suffix .png.
_PICTURE = "terminal"


def terminals_and_icons(ports: Sequence[Port]) -> bytes:
    """terminalsAndIcons.xml of a component.

    Args:
        ports: all but `fault`, which no component takes.

    """
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    SubElement(graphics, "CoordinateSystem", _ICON, suggestedScalingFactorTo_mm=_SCALE)
    SubElement(graphics, "Icon", _ICON)
    terminals = SubElement(root, "Terminals")
    for causality in _MATCHING_RULE:
        terminals.extend(_terminals([port for port in ports if port.causality == causality]))
    return text(root)


def _terminals(ports: Sequence[Port]) -> list[Element]:
    """The terminals of all inputs, or of all outputs, one below the other."""
    groups = {name: ports[place] for name, place in slices(ports).items()}
    return [
        _terminal(name, members, 100 - round(200 * (i + 0.5) / len(groups)))
        for i, (name, members) in enumerate(groups.items())
    ]


def _terminal(name: str, members: Sequence[Port], centre: int) -> Element:
    causality = members[0].causality
    name = _TAKES.get(name, name) if causality == "input" else name
    terminal = Element("Terminal", name=name, matchingRule=_MATCHING_RULE[causality])
    for port in members:
        SubElement(
            terminal,
            "TerminalMemberVariable",
            variableName=port.name,
            memberName=member_of(port.name),
            variableKind="signal",
        )
    left, lower = _LEFT_EDGE[causality], centre - _SIZE // 2
    SubElement(
        terminal,
        "TerminalGraphicalRepresentation",
        defaultConnectionColor=_COLOUR,
        x1=str(left),
        y1=str(lower),
        x2=str(left + _SIZE),
        y2=str(lower + _SIZE),
        iconBaseName=_PICTURE,
    )
    return terminal
