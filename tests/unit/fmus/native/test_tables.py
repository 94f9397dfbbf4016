"""The tables of ports and of the state in C, for types that the bundle lacks."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import NamedTuple

from fmus.native.tables import names_of_choices, tables
from fmus.ports.groups import ParameterSet
from fmus.ports.port import Port
from support.all_types import build


class One(NamedTuple):
    odd: int


def chosen(name: str, choices: dict[str, int]) -> Port:
    """A parameter whose value is one of some numbers."""
    return Port(name, "parameter", "fixed", "Enumeration", "", start=0, choices=choices)


def row_of(name: str) -> list[str]:
    """Columns of the table of ports after a name."""
    [row] = re.findall(rf'    {{"{re.escape(name)}", (.*)}},\n', tables(build.definition()))
    return row.split(", ")


def test_parameters_have_places_in_the_structures_of_the_equations():
    places = {
        "K[2,1]": "model.K.v[1].v[0]",
        "offset[3]": "model.offset.v[2]",
        "limits.default": "model.limits.default_",
        "mixed.n": "model.mixed.n",
        "mixed.x": "model.mixed.x",
        "mode": "model.mode",
    }
    for name, place in places.items():
        assert row_of(name)[3] == f"PARAMETER_AT({place})"


def test_reals_lie_before_all_others_in_the_order_of_their_ports():
    inputs = sorted(("k", "u", "go", "v[1]", "A[2,2]", "pair[2]"), key=lambda name: row_of(name)[3])
    assert {name: int(row_of(name)[3]) for name in inputs} == {
        "u": 0, "v[1]": 1, "A[2,2]": 7, "k": 8, "go": 9, "pair[2]": 11,
    }  # fmt: skip
    assert (row_of("x")[3], row_of("n")[3], row_of("fault")[3]) == ("0", "11", "0")


def test_inputs_start_with_values_in_ranges():
    assert row_of("k")[4:7] == ["3.0", "-5.0", "2147483647.0"]
    assert row_of("go")[4] == "1.0"


def test_a_start_of_minus_zero_stays_one():
    port = Port("u.x", "input", "continuous", "Real", "Place", "m", -0.0)
    definition = replace(build.definition(), ports=(port,))
    assert '"u.x", REAL, INPUT, CONTINUOUS, 0, -0.0, ' in tables(definition)


def test_names_of_choices_are_texts_in_c():
    odd = {'a"b\\': 0, "??/": -(2**31)}
    definition = replace(build.definition(), ports=(chosen("odd", odd),))
    definition = replace(definition, parameters=ParameterSet(One, definition.ports[:1]))
    definition = replace(definition, behaviour=definition.behaviour._replace(parameters=One))
    assert r'{{"a\"b\\", 0}, {"\?\?/", -2147483648}};' in tables(definition)


def test_members_of_enumerations_are_choices_of_ports_and_states():
    text = tables(build.definition())
    choices = '{{"off", 0}, {"heat", 2}, {"cool", -7}};'
    for name in ("choices_of_mode", "choices_of_limits_kind"):
        assert f"static const choice {name}[] = {choices}" in text
    assert f"static const choice members_0[] = {choices.upper()}" in text
    assert row_of("limits.kind")[-2:] == ["choices_of_limits_kind", "3"]
    assert '{INTEGER, 1, "Mode", members_0, 3}, {REAL, 9, NULL' in text


def test_choices_of_two_ports_whose_names_differ_in_a_dot_are_two_tables():
    """Names in C have no dots."""
    ports = [chosen(name, {"a": 0}) for name in ("kind.x", "kind_x", "kind")]
    assert names_of_choices(ports) == {
        "kind.x": "choices_of_kind_x",
        "kind_x": "choices_of_kind_x_",
        "kind": "choices_of_kind",
    }
