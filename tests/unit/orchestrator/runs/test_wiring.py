"""Wires join ports, groups of ports, and terminals, by the names of their members."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator.commands.check import surprises
from orchestrator.cosim import read_component
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import Scenario
from orchestrator.runs.wiring import closed_loop
from support.small_fmus import description_of_fmi3, write
from support.texts import mentions

#: Ports of either FMU, by causality: what one gives, the other takes.
_PORTS = {"a": ("output", "input"), "b": ("input", "output")}

_START = {"input": ' start="0"', "output": ""}


def _fmu(folder: Path, name: str, terminals: str) -> Path:
    out, back = _PORTS[name]
    variables = "".join(
        f'<Float64 name="{name}_{port}" valueReference="{n}" causality="{causality}"'
        f"{_START[causality]}>{inside}</Float64>"
        for n, (port, causality, inside) in enumerate(
            (("p", out, ""), ("q", out, '<Dimension start="2"/>'), ("r", back, ""))
        )
    )
    fmu = write(folder / f"{name}.fmu", description_of_fmi3(name, variables))
    with ZipFile(fmu, "a") as archive:
        archive.writestr(
            "terminalsAndIcons/terminalsAndIcons.xml",
            f'<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{terminals}</Terminals>'
            "</fmiTerminalsAndIcons>",
        )
    return fmu


def _terminal(name: str, rule: str, inside: str = "", /, **members: str) -> str:
    listed = "".join(
        f'<TerminalMemberVariable variableName="{variable}" memberName="{member}" '
        'variableKind="signal"/>'
        for member, variable in members.items()
    )
    return f'<Terminal name="{name}" matchingRule="{rule}">{listed}{inside}</Terminal>'


def _wires(folder: Path, terminals: dict[str, str], wire: tuple[str, str]) -> dict[str, str]:
    """Sources by targets of the connections that one wire makes."""
    fmus = {name: str(_fmu(folder, name, text)) for name, text in terminals.items()}
    scenario = Scenario("s", components=fmus, wires=dict([wire]), only=("a", "b"))
    return {str(c.target): str(c.source) for c in closed_loop(folder, scenario).connections}


_PLUG = {
    "a": _terminal("t", "plug", p="a_p", q="a_q", r="a_r"),
    "b": _terminal("s", "plug", r="b_r", p="b_p", q="b_q"),
}
_WHOLE = {"b.b_p": "a.a_p", "b.b_q[1]": "a.a_q[1]", "b.b_q[2]": "a.a_q[2]", "a.a_r": "b.b_r"}


@pytest.mark.parametrize("wire", [("b.s", "a.t"), ("a.t", "b.s")])
def test_plugs_are_joined_in_both_directions_from_either_end(tmp_path: Path, wire):
    assert _wires(tmp_path, _PLUG, wire) == _WHOLE


def test_a_bus_takes_what_both_have_and_a_sequence_goes_by_places(tmp_path: Path):
    bus = {
        "a": _terminal("t", "bus", _terminal("in", "sequence", x="a_p", y="a_r"), p="a_p", n="a_q"),
        "b": _terminal("t", "bus", _terminal("in", "sequence", y="b_p", x="b_r"), p="b_p", m="b_q"),
    }
    assert _wires(tmp_path, bus, ("b.t", "a.t")) == {"b.b_p": "a.a_p"}
    pairs = {"b.b_p": "a.a_p", "a.a_r": "b.b_r"}
    assert _wires(tmp_path, bus, ("b.t.in", "a.t.in")) == pairs
    component = read_component("a", tmp_path / "a.fmu")
    assert any(mentions(text, "terminals t t.in") for text in surprises(component))


@pytest.mark.parametrize(
    ("of_b", "why"),
    [
        (_terminal("s", "plug", p="b_p", q="b_q"), "b.s a.t r"),
        (_terminal("s", "bus", p="b_p", q="b_q"), "b.s a.t r"),
        (_terminal("s", "sequence", p="b_p", q="b_q", r="b_r"), "b.s a.t 0"),
        (_terminal("s", "com.x", p="b_p", q="b_q", r="b_r"), "b.s a.t 'com.x'"),
        (_terminal("s", "plug", p="b_q", q="b_q", r="b_r"), "b.s a.t p 1 2"),
        (_terminal("s", "plug", p="b_r", q="b_q", r="b_r"), "a.a_p b.b_r output"),
        (_terminal("s", "plug", p="b_z", q="b_q", r="b_r"), "b b_z"),
        (_PLUG["b"].replace('"signal"', '"inflow"', 1), "b.s a.t b_r signals"),
        ("<Terminal", "b terminalsAndIcons.xml XML"),
    ],
)
def test_terminals_that_do_not_fit_are_refused_by_name(tmp_path: Path, of_b: str, why: str):
    with pytest.raises(InputError) as error:
        _wires(tmp_path, {**_PLUG, "b": of_b}, ("b.s", "a.t"))
    assert mentions(str(error.value), why)
