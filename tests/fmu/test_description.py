"""The descriptions of the native kind, in both versions of FMI, against the Python kind."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import attrs
import fmpy
import pytest
from fmpy import read_model_description
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from lxml import etree

from auv_fmu.language.quantities import group_name
from fmus.discovery import components, source_of
from fmus.kinds import NATIVE, PYTHON
from fmus.ports.description import (
    fmi2_description,
    fmi3_build_description,
    fmi3_description,
)
from fmus.ports.port import TIME
from fmus.ports.terminals import terminals_of
from orchestrator.machine.identity import package_folder
from support.raw import Library, Status, instance
from support.settings import ports_of

GUID = "{00000000-0000-0000-0000-000000000000}"

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"

#: Types of FMI 3.0 by the names of FMI 2.0, and what both versions say of a variable.
TYPES = {"Float64": "Real", "Int32": "Integer"}
SAID = (
    "name", "valueReference", "description", "causality", "variability", "initial", "type",
    "declaredType", "unit", "start", "min", "max",
)  # fmt: skip

#: In what the kinds differ, and in what else if the native one has model exchange.
ITS_OWN = {"instantiationToken", "generationTool", "buildConfigurations"}
OF_EXCHANGE = {
    "modelExchange", "modelVariables", "derivatives", "outputs", "initialUnknowns",
    "numberOfContinuousStates", "numberOfEventIndicators", "typeDefinitions", "unitDefinitions",
}  # fmt: skip


def everything(description: ModelDescription) -> dict[str, Any]:
    """Everything that a host reads, without the layout of the file."""
    return attrs.asdict(description, filter=lambda field, _: field.name != "sourceline")


@pytest.fixture(scope="module", params=components())
def python(request, dist: Path) -> ModelDescription:
    return read_model_description(str(dist / f"{request.param}.fmu"))


@pytest.fixture(scope="module")
def fmi2(python: ModelDescription, tmp_path_factory) -> Path:
    """A folder with the description of the native kind in FMI 2.0."""
    return written(tmp_path_factory.mktemp("fmi2"), fmi2_description, python.modelName)


@pytest.fixture(scope="module")
def fmi3(python: ModelDescription, tmp_path_factory) -> Path:
    """A folder with the description of the native kind in FMI 3.0."""
    name = python.modelName
    path = written(tmp_path_factory.mktemp("fmi3"), fmi3_description, name)
    for file, content in (
        ("sources/buildDescription.xml", fmi3_build_description(name)),
        ("terminalsAndIcons/terminalsAndIcons.xml", terminals_of({"": ports_of(name)})),
    ):
        (path / file).parent.mkdir()
        (path / file).write_bytes(content)
    return path


def written(path: Path, describe: Callable[..., bytes], name: str) -> Path:
    """The folder, with the description of a component."""
    content = describe(source_of(name).definition, GUID)
    (path / "modelDescription.xml").write_bytes(content)
    return path


def test_descriptions_are_valid(fmi2: Path, fmi3: Path):
    """In FMI 3.0 buildDescription.xml, too, against its schema."""
    assert validate_fmu(str(fmi2)) == validate_fmu(str(fmi3)) == []


def test_both_kinds_say_the_same(python: ModelDescription, fmi2: Path):
    first, second = everything(python), everything(read_model_description(str(fmi2)))
    assert len(first["modelVariables"]) == len(ports_of(python.modelName)) + 1
    local = [v for v in second["modelVariables"] if v["causality"] == "local"]
    twins = [*first["modelVariables"], *local]
    for variable, twin in zip(twins, second["modelVariables"], strict=True):
        assert variable == twin
    assert second.keys() == first.keys()
    differ = {key for key in second if second[key] != first[key]}
    assert differ - (OF_EXCHANGE if local else set()) == ITS_OWN


def test_native_kind_tells_what_it_is(fmi2: Path):
    native = read_model_description(str(fmi2))
    assert native.guid == GUID
    assert native.generationTool == f"auv-fmu {version('auv-fmu')}"
    assert native.generationDateAndTime is None
    [[sources]] = [build.sourceFileSets for build in native.buildConfigurations]
    assert sources.sourceFiles == ["fmi2.c"]


def test_sources_of_fmi3_are_one_file(fmi3: Path):
    description = read_model_description(str(fmi3))
    assert description.buildConfigurations
    for build in description.buildConfigurations:
        assert build.modelIdentifier == description.modelName
        assert [files.sourceFiles for files in build.sourceFileSets] == [["fmi3.c"]]


def values_of(variable: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a variable that both versions of FMI have, by their names in FMI 2.0."""
    variable = {key: variable[key] for key in SAID}
    variable["type"] = TYPES.get(variable["type"], variable["type"])
    variable["declaredType"] = (variable["declaredType"] or {}).get("name")
    return variable


def test_both_versions_have_the_same_variables(fmi2: Path, fmi3: Path):
    older, newer = (
        everything(read_model_description(str(p)))["modelVariables"] for p in (fmi2, fmi3)
    )
    time = newer[sum(v["causality"] != "local" for v in older)]
    twins = [v for v in newer if v != time]
    assert (time["causality"], time["variability"], time["unit"], time["start"]) == (
        "independent", "continuous", "s", None
    )  # fmt: skip
    # In their order: some hosts take them for indices. Only in FMI 3.0 they begin at 1.
    assert [v["valueReference"] for v in newer] == [*range(1, len(newer) + 1)]
    for variable, twin in zip(older, twins, strict=True):
        reference = variable["valueReference"] + 1 + (variable["causality"] == "local")
        assert values_of({**variable, "valueReference": reference}) == values_of(twin)


def edges(description: ModelDescription, part: str) -> dict[str, set[str] | None]:
    """The dependencies of each unknown, except the time; None: on everything."""
    return {
        unknown.variable.name: None
        if unknown.dependencies is None
        else {v.name for v in unknown.dependencies} - {"time"}
        for unknown in getattr(description, part)
    }


@pytest.mark.parametrize("part", ["outputs", "initialUnknowns"])
def test_both_versions_have_the_same_dependencies(fmi2: Path, fmi3: Path, part: str):
    first, second = (edges(read_model_description(str(path)), part) for path in (fmi2, fmi3))
    assert first
    assert first == second


def test_only_outputs_that_declare_the_time_depend_on_it(fmi3: Path):
    """In this vehicle, only the disturbance."""
    description = read_model_description(str(fmi3))
    found = {
        group_name(unknown.variable.name)
        for unknown in (*description.outputs, *description.initialUnknowns)
        if "time" in {known.name for known in unknown.dependencies or ()}
    }
    ports = ports_of(description.modelName)
    assert found == {group_name(port.name) for port in ports if TIME.name in port.feedthrough}
    assert (found == {"tau_w"}) == (description.modelName == "DisturbanceGenerator")


def terminals(name: str) -> dict[str, tuple[str, dict[str, str]]]:
    """The rule of each terminal of a component, and the variables of its members."""
    root = etree.fromstring(terminals_of({"": ports_of(name)}))
    etree.XMLSchema(file=str(SCHEMA)).assertValid(root)
    return {
        terminal.get("name"): (
            terminal.get("matchingRule"),
            {
                m.get("memberName"): m.get("variableName")
                for m in terminal
                if "memberName" in m.attrib
            },
        )
        for terminal in root.iter("Terminal")
    }


def test_terminals_are_the_groups_of_inputs_and_outputs(fmi3: Path):
    description = read_model_description(str(fmi3))
    causality = {variable.name: variable.causality for variable in description.modelVariables}
    joined = []
    for name, (_, members) in terminals(description.modelName).items():
        (side,) = {causality[variable] for variable in members.values()}
        # Friction takes the velocity through the water, by its own name for it.
        takes = side == "input" and description.modelName == "DisturbanceGenerator"
        group = "nu" if takes and name == "nu_r" else name
        for member, variable in members.items():
            # A scalar is a group of its own.
            scalar = (group,) if member == group else ()
            assert variable in (f"{group}.{member}", f"{group}[{member}]", *scalar)
        joined += members.values()
    connectable = [name for name in causality if causality[name] in ("input", "output")]
    assert sorted([*joined, "fault"]) == sorted(connectable)


def test_connecting_terminals_by_name_wires_the_closed_loop():
    content = (package_folder("orchestrator") / "runs" / "closed_loop.toml").read_text()
    loop = tomllib.loads(content)
    components_of = loop["components"]
    fed = set()
    wires = {sink: source for sink, source in loop["wires"].items() if source}
    for sink, source in wires.items():
        (component, _), (other, group) = sink.split("."), source.split(".")
        rule, members = terminals(components_of[component])[group]
        _, offered = terminals(components_of[other])[group]
        # A plug needs all of its members.
        assert rule == "plug"
        assert members.keys() <= offered.keys()
        fed |= {(component, variable) for variable in members.values()}
    assert fed == {
        (component, port.name)
        for component, name in components_of.items()
        for port in ports_of(name)
        if port.causality == "input" and f"{component}.{group_name(port.name)}" in wires
    }


@pytest.mark.parametrize("name", components())
def test_starts_and_bounds_are_the_declared_ones_and_can_be_set(
    dist: Path, native: Path, tmp_path: Path, name: str
):
    """To the bit, and at the bounds, which a text with fewer digits may exceed."""
    ports = {port.name: port for port in ports_of(name)}
    for kind, fmus in ((PYTHON, dist), (NATIVE, native)):
        library = Library(Path(fmpy.extract(str(fmus / f"{name}.fmu"), tmp_path / kind)))
        with instance(library) as host:
            for variable in library.description.variables:
                port = ports.get(variable.name)
                if port is None or variable.type != "Real" or variable.causality == "output":
                    continue
                assert variable.start.hex() == float(port.start or 0.0).hex()
                for read, declared in (
                    (variable.minimum, port.minimum), (variable.maximum, port.maximum),
                ):  # fmt: skip
                    assert read == declared
                    if read is not None:
                        assert host.set("Real", [variable.reference], [read]) == Status.OK
