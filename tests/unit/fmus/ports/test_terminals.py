"""terminalsAndIcons.xml of a few ports."""

from __future__ import annotations

from typing import Annotated, NamedTuple
from xml.etree import ElementTree

from auv_fmu import Variable, Vector
from fmus.ports.fields import declared
from fmus.ports.port import Port
from fmus.ports.terminals import terminals_of

REAL = ("continuous", "Real")
GROUPS = (
    Port("tau.u", "input", *REAL, "Command: u", "N", 0.0),
    Port("tau.q", "input", *REAL, "Command: q", "N.m", 0.0),
    Port("y.x", "input", *REAL, "Place: x", "m", 0.0),
    Port("theta[1]", "output", *REAL, "Parameters: 1", "N"),
    Port("theta[2]", "output", *REAL, "Parameters: 2", "kg/s"),
    Port("k", "parameter", "fixed", "Real", "Gain", "1", 1.0),
)


def terminals() -> list[ElementTree.Element]:
    return [*ElementTree.fromstring(terminals_of({"": GROUPS})).iterfind("Terminals/Terminal")]


def test_only_groups_of_inputs_and_outputs_are_terminals():
    assert [
        (
            terminal.get("name"),
            terminal.get("matchingRule"),
            [
                (member.get("variableName"), member.get("memberName"), member.get("variableKind"))
                for member in terminal.iterfind("TerminalMemberVariable")
            ],
        )
        for terminal in terminals()
    ] == [
        ("tau", "plug", [("tau.u", "u", "signal"), ("tau.q", "q", "signal")]),
        ("y", "plug", [("y.x", "x", "signal")]),
        ("theta", "bus", [("theta[1]", "1", "signal"), ("theta[2]", "2", "signal")]),
    ]


def test_a_terminal_has_the_name_that_an_input_declares():
    class Inputs(NamedTuple):
        nu: Annotated[Vector, 6, Variable("m/s", "Velocity", terminal="nu_r")]
        y: Annotated[float, Variable("m", "Place")]

    [[*nu], [*y]] = declared(Inputs, "input").values()
    root = ElementTree.fromstring(terminals_of({"": [*nu, *y]}))
    assert [terminal.get("name") for terminal in root.iter("Terminal")] == ["nu_r", "y"]


def test_inputs_are_on_the_left_and_outputs_on_the_right_of_the_icon():
    icon = ElementTree.fromstring(terminals_of({"": GROUPS})).find("GraphicalRepresentation/Icon")
    assert icon is not None
    corners = [
        {key: int(value) for key, value in picture.attrib.items() if key in icon.attrib}
        for terminal in terminals()
        for picture in terminal.iterfind("TerminalGraphicalRepresentation")
    ]
    left, right = int(icon.attrib["x1"]), int(icon.attrib["x2"])
    upper, lower, output = corners
    assert upper["x2"] == lower["x2"] == left
    assert output["x1"] == right
    assert upper["y1"] > lower["y2"]
    assert output["y1"] == -output["y2"]
