"""What a host reads of a component in FMI 3.0: its description, its build and its terminals.

A terminal of terminalsAndIcons.xml is a group of ports, as one thing to connect. It has the name of
its group, or of the group that it is made to take. Components call the members of a group that they
exchange the same, so a tool that joins two terminals of one name joins the right variables.
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

#: What FMI 3.0 calls the types of variables.
TYPES = {
    "Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration",
}  # fmt: skip

_VERSION = "3.0"

_CAPABILITIES = {**CAPABILITIES, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}

#: The file of a component's sources that includes all others, and what it is written in.
SOURCE, _LANGUAGE = "fmi3.c", "C99"

#: The platforms that a build is described for.
_PLATFORMS = ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")


def fmi3_description(model: Model, token: str, arrays: bool = False) -> bytes:
    """The description of a model that is a library with the name of its identifier.

    Args:
        model: that it is about.
        token: as the library knows it.
        arrays: whether vectors and matrices of one unit are variables of their own.

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
    """What an importer has to compile: one file, with any compiler and no options."""
    root = Element("fmiBuildDescription", fmiVersion=_VERSION)
    for platform in _PLATFORMS:
        built = SubElement(root, "BuildConfiguration", modelIdentifier=name, platform=platform)
        sources = SubElement(built, "SourceFileSet", language=_LANGUAGE)
        SubElement(sources, "SourceFile", name=SOURCE)
        if platform.endswith("-linux"):
            # There mathematics is apart from the C library.
            SubElement(built, "Library", name="m", external="true")
    return text(root)


def _add_type(parent: Element, kind: str, name: str, **said: str) -> Element:
    return SubElement(parent, f"{TYPES[kind]}Type", {"name": name, **said})


class _Variable(NamedTuple):
    """A scalar, or an array, which has the value reference of its first element."""

    reference: int
    port: Port
    elements: Sequence[Port]


def variables_of(ports: Sequence[Port], arrays: bool = False) -> list[_Variable]:
    """Ports as variables.

    Args:
        ports: in the order of their value references.
        arrays: whether ports of one array are one variable.

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
    """Names of scalars as those of variables, each once."""
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
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    outputs = [*dependencies([one.port for one in variables], [one.reference for one in variables])]
    structure = Element("ModelStructure")
    for name, on in (("Output", "direct"), ("InitialUnknown", "initial")):
        for output in outputs:
            known = dependent_on(getattr(output, on))
            SubElement(structure, name, known, valueReference=str(output.number))
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


def terminals_and_icons(ports: Sequence[Port], arrays: bool = False) -> bytes:
    """terminalsAndIcons.xml of a component.

    Args:
        ports: all but `fault`, which no component takes.
        arrays: whether ports of one array are one variable.

    """
    return terminals_of({"": [variable.port for variable in variables_of(ports, arrays)]})


def terminals_of(parts: Mapping[str, Sequence[Port]]) -> bytes:
    """terminalsAndIcons.xml of what has several parts.

    Args:
        parts: the ports of each, by what stands before their names, and before those of terminals.

    """
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    SubElement(graphics, "CoordinateSystem", _ICON, suggestedScalingFactorTo_mm=_SCALE)
    SubElement(graphics, "Icon", _ICON)
    terminals = SubElement(root, "Terminals")
    for causality in _MATCHING_RULE:
        of_one = {
            part: [port for port in ports if port.causality == causality]
            for part, ports in parts.items()
        }
        terminals.extend(_terminals(of_one))
    return text(root)


def _terminals(parts: Mapping[str, Sequence[Port]]) -> list[Element]:
    """The terminals of all inputs, or of all outputs, one below the other."""
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
