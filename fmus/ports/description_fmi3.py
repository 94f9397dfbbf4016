"""XML files of FMI 3.0: modelDescription, buildDescription and terminalsAndIcons.

A terminal is a group of ports that a tool connects as one. It has the name of its group, or of the
group that it is meant to be connected with. Groups that components exchange have the same members,
so a tool that connects terminals of one name connects the right variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from auv_fmu.language.quantities import member_of
from fmus.ports.definition import Model
from fmus.ports.description import (
    CAPABILITIES,
    capabilities_of,
    default_experiment,
    dependencies,
    dependent_on,
    log_categories,
    root_of,
    text,
    type_definitions,
    unit_definitions,
    units_of,
    value_attributes,
    variable_attributes,
)
from fmus.ports.groups import slices
from fmus.ports.port import FAULT, TIME, Port

#: Names of types in FMI 3.0.
TYPES = {
    "Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration",
}  # fmt: skip

_VERSION = "3.0"

_CAPABILITIES = {**CAPABILITIES, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}

#: The source file that includes all others, and its language.
SOURCE, _LANGUAGE = "fmi3.c", "C99"

#: The platforms in the build description.
_PLATFORMS = ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")


def fmi3_description(model: Model, token: str, arrays: bool = False) -> bytes:
    """Write the description of a model; its library is named after its identifier.

    Args:
        model: the model.
        token: the instantiation token that is compiled into the library.
        arrays: True to make vectors and matrices of one unit array variables.

    """
    ports = (*model.ports, FAULT, TIME)
    variables = variables_of(ports, arrays)
    root = root_of(_VERSION, model, instantiationToken=token)
    said = capabilities_of(model, _CAPABILITIES)
    SubElement(root, "CoSimulation", said, modelIdentifier=model.identifier)
    root.extend(
        (
            unit_definitions(units_of(ports)),
            type_definitions(ports, _add_type),
            log_categories("fmi3"),
            default_experiment(model.experiment),
            _variables(variables),
            _structure(variables),
        )
    )
    return text(root)


def fmi3_build_description(name: str) -> bytes:
    """Write the build description: one file to compile, with any compiler and no options."""
    root = Element("fmiBuildDescription", fmiVersion=_VERSION)
    for platform in _PLATFORMS:
        built = SubElement(root, "BuildConfiguration", modelIdentifier=name, platform=platform)
        sources = SubElement(built, "SourceFileSet", language=_LANGUAGE)
        SubElement(sources, "SourceFile", name=SOURCE)
        if platform.endswith("-linux"):
            # On Linux the mathematical library is separate.
            SubElement(built, "Library", name="m", external="true")
    return text(root)


def _add_type(parent: Element, kind: str, name: str, **said: str) -> Element:
    return SubElement(parent, f"{TYPES[kind]}Type", {"name": name, **said})


class _Variable(NamedTuple):
    """A scalar or an array; an array has the value reference of its first element."""

    reference: int
    port: Port
    elements: Sequence[Port]


def variables_of(ports: Sequence[Port], arrays: bool = False) -> list[_Variable]:
    """Return ports as variables.

    Args:
        ports: ports in the order of their value references.
        arrays: True to join the ports of an array into one variable.

    """
    if not arrays:
        ports = [replace(port, array=None) for port in ports]
    names = {port.name: port.array.name if port.array else port.name for port in ports}
    keyed = [(names[port.name], place, port) for place, port in enumerate(ports, start=1)]
    variables = []
    for name, found in groupby(keyed, itemgetter(0)):
        members = [*found]
        _, reference, first = members[0]
        elements = [port for _, _, port in members]
        described = first.array.description if first.array else first.description
        direct = tuple(_names(names, (name for port in elements for name in port.feedthrough)))
        initial = _names(names, (name for port in elements for name in port.initially or ()))
        later = tuple(one for one in initial if one not in direct)
        whole = replace(
            first,
            name=name,
            description=described,
            feedthrough=direct,
            initially=None if first.initially is None else later,
        )
        variables.append(_Variable(reference, whole, elements))
    return variables


def _names(names: Mapping[str, str], found: Iterable[str]) -> dict[str, None]:
    """Return the names of variables for names of scalars, each once."""
    return dict.fromkeys(names.get(one, one) for one in found)


def _variables(variables: Sequence[_Variable]) -> Element:
    root = Element("ModelVariables")
    for reference, port, elements in variables:
        attributes = {**variable_attributes(reference, port), **value_attributes(port)}
        if port.start is not None:
            attributes["start"] = " ".join(value_attributes(one)["start"] for one in elements)
        variable = SubElement(root, TYPES[port.type], attributes)
        for size in port.array.shape if port.array else ():
            SubElement(variable, "Dimension", start=str(size))
    return root


def _structure(variables: Sequence[_Variable]) -> Element:
    """Write Outputs with direct feedthrough, and InitialUnknowns with parameters, too."""
    outputs = [*dependencies([one.port for one in variables], [one.reference for one in variables])]
    structure = Element("ModelStructure")
    for name, on in (("Output", "direct"), ("InitialUnknown", "initial")):
        for output in outputs:
            known = dependent_on(getattr(output, on))
            SubElement(structure, name, known, valueReference=str(output.number))
    return structure


# Terminals

#: All members of an input must be connected. Members of an output may stay unconnected: a
#: controller takes only the angles of the posture. The rule applies to one end of a connection.
_MATCHING_RULE = {"input": "plug", "output": "bus"}

#: Outputs for inputs of other names: friction depends on the velocity through the water.
_TAKES = {"nu": "nu_r"}

#: Corners of the icon, and the size of its unit on a screen [mm].
_ICON = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
_SCALE = "0.1"

#: Left edges of the terminals of inputs and outputs, and their size.
_LEFT_EDGE = {"input": -110, "output": 100}
_SIZE = 10

#: Colour of connections between signals in Modelica.
_COLOUR = "0 0 127"

#: The picture of a terminal, in the folder of the file, without the suffix .png.
_PICTURE = "terminal"


def terminals_and_icons(ports: Sequence[Port], arrays: bool = False) -> bytes:
    """Write terminalsAndIcons.xml of a component.

    Args:
        ports: all ports but `fault`, which no component takes.
        arrays: True to join the ports of an array into one variable.

    """
    return terminals_of({"": [variable.port for variable in variables_of(ports, arrays)]})


def terminals_of(parts: Mapping[str, Sequence[Port]]) -> bytes:
    """Write terminalsAndIcons.xml of a model with several parts.

    Args:
        parts: ports of the parts, by the prefix of the names of their variables and terminals.

    """
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    SubElement(graphics, "CoordinateSystem", _ICON, suggestedScalingFactorTo_mm=_SCALE)
    SubElement(graphics, "Icon", _ICON)
    terminals = SubElement(root, "Terminals")
    for causality in _MATCHING_RULE:
        chosen = {
            part: [port for port in ports if port.causality == causality]
            for part, ports in parts.items()
        }
        terminals.extend(_terminals(chosen))
    return text(root)


def _terminals(parts: Mapping[str, Sequence[Port]]) -> list[Element]:
    """Write the terminals of all inputs, or of all outputs, one below the other."""
    groups = [
        (part, name, ports[place])
        for part, ports in parts.items()
        for name, place in slices(ports).items()
    ]
    return [
        _terminal(part, name, members, 100 - round(200 * (i + 0.5) / len(groups)))
        for i, (part, name, members) in enumerate(groups)
    ]


def _terminal(part: str, name: str, members: Sequence[Port], centre: int) -> Element:
    causality = members[0].causality
    name = _TAKES.get(name, name) if causality == "input" else name
    terminal = Element("Terminal", name=part + name, matchingRule=_MATCHING_RULE[causality])
    for port in members:
        SubElement(
            terminal,
            "TerminalMemberVariable",
            variableName=part + port.name,
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
