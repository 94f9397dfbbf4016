"""The tables of ports in C say what the declaration says, and where the equations look for it."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

import pytest

from fmus.discovery import components
from fmus.native.tables import tables
from fmus.ports.port import FAULT, H_MAX, Port

PACKAGES = [*components().values()]

ROW = re.compile(
    r'\{"(?P<name>.+?)", (?P<kind>[A-Z]+), (?P<causality>[A-Z]+), (?P<variability>[A-Z]+), '
    r"(?P<place>[^,]+), (?P<start>[^,]+), (?P<minimum>[^,]+), (?P<maximum>[^,]+), "
    r"(?P<choices>\w+), (?P<n>\d+)\},"
)

each_package = pytest.mark.parametrize("package", PACKAGES)


def rows(package: str) -> list[dict[str, str]]:
    return [found.groupdict() for found in ROW.finditer(tables(package))]


def ports(package: str) -> list[Port]:
    return [*import_module(f"{package}.ports").PORTS, FAULT]


@each_package
def test_ports_are_those_of_the_declaration(package: str):
    for row, port in zip(rows(package), ports(package), strict=True):
        assert (row["name"], row["kind"]) == (port.name, port.kind.upper())
        assert row["causality"] == port.causality.upper()
        assert row["variability"] == port.variability.upper()
        for bound, none in (("minimum", "-DBL_MAX"), ("maximum", "DBL_MAX")):
            limit = getattr(port, bound)
            assert row[bound] == none if limit is None else float(row[bound]) == limit
        if port.kind != "String":
            assert float(row["start"]) == float(port.start or 0.0)


@each_package
def test_inputs_and_outputs_lie_in_their_order(package: str):
    declared, text = ports(package), tables(package)
    for causality in ("INPUT", "OUTPUT"):
        places = [
            int(row["place"])
            for row in rows(package)
            if (row["causality"], row["kind"]) == (causality, "REAL")
        ]
        assert places == [*range(len(places))]
        [found] = re.findall(rf"{causality.lower()}_references\[\] = \{{(.*)\}};", text)
        names = [declared[int(n)].name for n in re.findall(r"FIRST_REFERENCE \+ (\d+)", found)]
        if places:
            real = [p.name for p in declared if p.causality.upper() == causality and p is not FAULT]
            assert names == real


@each_package
def test_parameters_lie_where_the_equations_look_for_them(package: str):
    """Each port gets another value, which is then found at its place."""
    declared = import_module(f"{package}.ports").PARAMETERS
    values = {
        port.name: next(iter(port.choices)) if port.choices else float(i)
        for i, port in enumerate(declared.ports)
    }
    model = declared.of(values)
    parameters = [row for row in rows(package) if row["causality"] == "PARAMETER"]
    for row in parameters:
        [member] = re.findall(r"^PARAMETER_AT\((.*)\)$", row["place"])
        if row["name"] == H_MAX.name:
            assert member == "h_max"
        elif row["kind"] != "STRING":
            assert at(model, member.removeprefix("model.")) == values[row["name"]]
    assert len({row["place"] for row in parameters}) == len(parameters)


def at(structure: Any, member: str) -> Any:
    """A member as C names it: a tuple of Python is one with an array `v`."""
    for field, place in re.findall(r"(\w+)(?:\.v\[(\d+)\])?", member):
        structure = getattr(structure, field)
        structure = structure[int(place)] if place else structure
    return structure


def test_choices_are_the_texts_and_the_numbers_of_the_equations():
    text = tables("fmus.observer_controller")
    described = [row for row in rows("fmus.observer_controller") if row["kind"] == "STRING"]
    declared = [port for port in ports("fmus.observer_controller") if port.kind == "String"]
    for row, port in zip(described, declared, strict=True):
        [choices] = re.findall(rf"choice {row['choices']}\[\] = \{{(.*)\}};", text)
        numbers = re.findall(r'\{"(\w+)", (\d+)\}', choices)
        found = {name: int(number) for name, number in numbers}
        assert found == dict(port.choices)
        assert float(row["start"]) == found[str(port.start)]
        assert int(row["n"]) == len(found)
