"""terminalsAndIcons.xml of FMI 3.0.

A terminal is a group of ports that a tool connects as one. It has the name of its group, unless an
input declares another. Groups that components exchange have the same members, so a tool that
connects terminals of one name connects the right variables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from auv_fmu.language.quantities import member_of
from fmus.ports.description import document
from fmus.ports.groups import slices
from fmus.ports.port import Port

#: All members of an input must be connected. Members of an output may stay unconnected: a
#: controller takes only the angles of the posture. The rule applies to one end of a connection.
_MATCHING_RULE = {"input": "plug", "output": "bus"}

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


def terminals_of(parts: Mapping[str, Sequence[Port]]) -> bytes:
    """Write terminalsAndIcons.xml of a model with several parts, by the prefix of their names."""
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
    return document(root)


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
    causality, name = members[0].causality, members[0].terminal or name
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
