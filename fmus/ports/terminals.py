"""terminalsAndIcons.xml of FMI 3.0: the groups of ports, each as one thing to connect.

A terminal has the name of its group, or of the group that it is made to take. Components call the
members of a group that they exchange the same, so a tool that joins two terminals of one name joins
the right variables.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from fmus.ports.description import text
from fmus.ports.groups import slices
from fmus.ports.port import Port
from fmus.ports.quantities import member_of

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
    """The file of a component.

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
