"""Systems are read as they were written, and files are valid."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest
from fmpy.ssp.ssd import read_ssd, read_ssv
from hypothesis import assume, given
from hypothesis import strategies as st
from lxml import etree

from orchestrator.cosim.component import Component, read_component
from orchestrator.cosim.connection import Connection, Linear, Mapped, PortName
from orchestrator.cosim.formats.archive import OMS
from orchestrator.cosim.formats.osp import write_osp
from orchestrator.cosim.formats.ssp_reader import read_ssp
from orchestrator.cosim.formats.ssp_writer import ssp_bytes, structure_xml, write_ssp
from orchestrator.cosim.system import System
from orchestrator.machine.disk import plain_file_names
from orchestrator.machine.errors import Findings, InputError
from support import small_fmus, typed
from support.archives import (
    archive,
    binding,
    component,
    connection,
    connector,
    described,
    fmu,
    fmu3,
    system,
    variable,
)
from support.texts import mentions


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> System:
    """A system with every feature, two of whose FMUs have the same name."""
    folder = tmp_path_factory.mktemp("fmus")
    (folder / "other").mkdir()
    ports = (
        variable("y", "output", unit="degC"), variable("n", "output", "Enumeration"),
        variable("b", "output", "Boolean"), variable("m", "input", "Enumeration"),
        variable("c", "input", "Boolean"), variable("k", "parameter", "Enumeration"),
        variable("t", "parameter", "String"),
    )  # fmt: skip
    files = {
        "a.fmu": fmu(folder / "a.fmu", variable("u", "input", unit="K"), *ports),
        "x/a.fmu": fmu(folder / "other" / "a.fmu", variable("u", "input", unit="degC"), *ports),
    }
    hint = '<ssd:Annotations><ssc:Annotation type="x"><StepSizeHint value="0.5"/></ssc:Annotation>'
    inner = system(
        component("a b", "x/a.fmu", binding({"k": 'Enumeration value="fast"'})).replace(
            "</ssd:Component>", f"{hint}</ssd:Annotations></ssd:Component>"
        ),
        connection("u", "a b.u"), connector("u", "input", "K"), name="inner",
    )  # fmt: skip
    top = system(
        component("a", bindings=binding({"t": 'String value="x &amp; y"'})) + inner,
        connection("a.y", "inner.u", '<ssc:LinearTransformation factor="2"/>')
        + connection("a.y", "a.u", suppressUnitConversion="true")
        + connection(
            "a.n", "a.m",
            '<ssc:IntegerMappingTransformation><ssc:MapEntry source="2" target="5"/>'
            "</ssc:IntegerMappingTransformation>")
        + connection(
            "a.b", "a.c",
            '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
            "</ssc:BooleanMappingTransformation>"),
    )  # fmt: skip
    text = described(top, after='<ssd:DefaultExperiment startTime="2" stopTime="3"/>')
    return read_ssp(archive(folder / "all.ssp", text, files))


def test_system_that_is_written_and_read_is_the_same(found: System, tmp_path: Path):
    [path] = write_ssp(found, tmp_path)
    findings = Findings(strict=True)
    again = read_ssp(path, findings=findings)
    assert again.connections == found.connections
    assert again.parameters == found.parameters
    assert again.steps == found.steps == {"inner.a b": 0.5}
    assert (again.start_time, again.stop_time) == (2.0, 3.0)
    contents = [
        {name: part.fmu.read_bytes() for name, part in version.components.items()}
        for version in (found, again)
    ]
    assert contents[0] == contents[1]


@pytest.mark.parametrize("step", [None, 0.02])
def test_what_is_written_is_valid(found: System, tmp_path: Path, step: float | None):
    """fmpy checks it with the schemas of SSP 1.0."""
    [path] = write_ssp(replace(found, step=step), tmp_path)
    read_ssd(str(path))
    with ZipFile(path) as content:
        sets = [name for name in content.namelist() if name.endswith(".ssv")]
    assert len(sets) == 2
    for name in sets:
        read_ssv(str(path), name)


def test_choices_are_numbers_without_connectors(found: System, tmp_path: Path):
    """Other tools fail at an Enumeration, or do not set it."""
    [path] = write_ssp(found, tmp_path)
    with ZipFile(path) as content:
        [of_k] = [name for name in content.namelist() if name.startswith("parameters/inner")]
        assert b'<ssv:Integer value="5" />' in content.read(of_k)
        written = ElementTree.fromstring(content.read("SystemStructure.ssd"))
    kinds = {(c.get("name"), c.get("kind")) for c in written.iterfind(".//{*}Connector")}
    assert ("n", "output") in kinds and not {("k", "parameter"), ("t", "parameter")} & kinds


def test_choices_that_libcosim_does_not_set_are_not_written_for_it(tmp_path: Path):
    path = fmu(
        tmp_path / "a.fmu", variable("y", "output"), variable("k", "parameter", "Enumeration")
    )
    (tmp_path / "out").mkdir()
    system = replace(small_fmus.connected("s", {"a": path}, {}, {"a.k": "slow"}), step=0.1)
    structure, _ = write_osp(system, tmp_path / "out")
    assert "InitialValue" not in structure.read_text()
    with pytest.raises(InputError) as error:
        write_osp(system.with_parameters({PortName("a", "k"): "fast"}), tmp_path / "out")
    assert mentions(str(error.value), "a.k Enumeration libcosim")


def test_inputs_that_are_open_on_purpose_have_no_connector_and_stay_so(
    found: System, tmp_path: Path
):
    """fmpy feeds a connector without a connection from the source of the previous one."""
    left_open = {PortName("inner.a b", "c")}
    system = replace(found, left_open=left_open)
    [path] = write_ssp(system, tmp_path)
    outer, group = read_ssd(str(path)).system.elements
    named = {part.name: {c.name for c in part.connectors} for part in (outer, *group.elements)}
    assert "c" in named["a"] and "c" not in named["a b"]
    again = read_ssp(path)
    assert again.left_open == left_open
    assert again.steps == found.steps
    assert "inner.a b.c" in str(found.unfed_inputs())
    assert "inner.a b.c" not in str(again.unfed_inputs())


@pytest.mark.parametrize("step", [0.02, 0.0125])
def test_omsimulator_is_told_the_step_where_it_looks_for_it(
    found: System, tmp_path: Path, step: float
):
    """Its Python version reads the attributes, its C++ version the child, by literal prefixes."""
    [path] = write_ssp(replace(found, step=step), tmp_path)
    with ZipFile(path) as content:
        text = content.read("SystemStructure.ssd").decode()
    root = ElementTree.fromstring(text)
    way = "./{*}System/{*}Annotations/{*}Annotation[@type='org.openmodelica']/{*}Annotations/"
    [information] = root.findall(f"{way}{{{OMS}}}SimulationInformation")
    assert information.attrib == {
        "name": "oms_ma_default", "method": "oms_ma", "fixedStepSize": str(step),
    }  # fmt: skip
    [master] = information
    assert master.tag == f"{{{OMS}}}FixedStepMaster"
    assert (master.get("description"), float(master.get("stepSize", ""))) == ("oms-ma", step)
    for element in ("ssd:System ", "ssc:Annotation ", "oms:Annotations>", "oms:FixedStepMaster "):
        assert f"<{element}" in text
    assert f'<osp:FixedStepAlgorithm baseStepSize="{step}" />' in text
    root_element = text[text.index("<ssd:SystemStructureDescription") :].partition(">")[0]
    assert "xmlns:osp=" in root_element and "xmlns:oms=" in root_element
    # Without libcosim's annotation, the one of OMSimulator is read.
    other = text.replace("FixedStepAlgorithm", "Another")
    with ZipFile(path) as content:
        files = {name: content.read(name) for name in content.namelist() if name.count("/")}
    assert read_ssp(archive(tmp_path / "other.ssp", other, files)).step == step


def test_a_format_without_words_for_a_transformation_refuses_it(found: System, tmp_path: Path):
    with pytest.raises(InputError, match="write an SSP"):
        write_osp(found, tmp_path)


def test_fmus_of_one_name_stay_apart(tmp_path: Path):
    """Even if names differ only in case, or equal the name of the format's own file."""
    names = ("a/M.fmu", "b/M.fmu", "b/m.fmu", "c/2_M.fmu", "c/OspSystemStructure.xml")
    components = {}
    for i, name in enumerate(names):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        components[f"c{i}"] = read_component(f"c{i}", fmu(file, variable(f"y{i}", "output")))
    given = System("s", components, (), step=0.1)
    contents = {name: part.fmu.read_bytes() for name, part in components.items()}

    structure, *files = write_osp(given, tmp_path)
    root = ElementTree.parse(structure).getroot()
    sources = {s.get("name"): s.get("source", "") for s in root.iterfind(".//{*}Simulator")}
    assert {name: (tmp_path / file).read_bytes() for name, file in sources.items()} == contents
    assert len({file.name.lower() for file in (structure, *files)}) == 1 + len(names)

    again = read_ssp(write_ssp(given, tmp_path)[0])
    assert {name: part.fmu.read_bytes() for name, part in again.components.items()} == contents


def test_plain_names_are_distinct_and_kept_where_they_can_be():
    assert plain_file_names(["M.fmu", "m.fmu", "2_M.fmu", "M.fmu"]) == [
        "M.fmu", "1_m.fmu", "2_M.fmu", "3_M.fmu",
    ]  # fmt: skip
    assert plain_file_names(["2_M.fmu", "M.fmu", "M.fmu", "ä b", "x"], "X") == [
        "2_M.fmu", "M.fmu", "3_M.fmu", "__b", "4_x",
    ]  # fmt: skip


@pytest.fixture
def mixed(tmp_path: Path) -> System:
    """A system of FMI 2.0 and 3.0, with arrays connected as a whole and in parts."""
    files = {
        "3.fmu": fmu3(tmp_path / "3.fmu"),
        "2.fmu": fmu(tmp_path / "2.fmu", variable("u", "input"), variable("y", "output")),
    }
    values = binding({
        "A": 'Float64 value="1 2 3 4.5"/><ssc:Dimension size="2"/><ssc:Dimension size="2"',
        "s": 'String><ssv:Value value="x  y"/><ssv:Value value=""/></ssv:String>'
        '<ssc:Dimension size="2"',
        "i": 'Int64 value="9007199254740993"',
        "v": 'Float32 value="0.1"',
    })  # fmt: skip
    text = system(
        component("a", "3.fmu", values) + component("b", "3.fmu") + component("c", "2.fmu"),
        connection("a.y", "b.u") + connection("b.y", "a.u", startIndices="1", endIndices="3")
        + connection("c.y", "a.u", endIndices="1") + connection("b.y", "c.u", startIndices="2"),
    )  # fmt: skip
    return read_ssp(archive(tmp_path / "mixed.ssp", described(text, "2.0"), files))


def test_ssp_2_that_is_written_and_read_is_the_same(mixed: System, tmp_path: Path):
    (tmp_path / "out").mkdir()
    [path] = write_ssp(mixed, tmp_path / "out")
    again = read_ssp(path, findings=Findings(strict=True))
    assert set(again.connections) == set(mixed.connections)
    assert again.parameters == mixed.parameters and len(again.parameters) == 8
    with ZipFile(path) as content:
        written = ElementTree.fromstring(content.read("SystemStructure.ssd"))
    ends = [dict(element.attrib) for element in written.iterfind(".//{*}Connection")]
    assert len(ends) == 4
    whole = {"startElement": "a", "startConnector": "y", "endElement": "b", "endConnector": "u"}
    assert ends[0] == whole


@pytest.mark.skipif(find_spec("pyssp_standard") is None, reason="pyssp_standard is not installed")
def test_ssp_2_that_is_written_is_valid(mixed: System, tmp_path: Path):
    """Checked with the schemas of SSP 2.0 in pyssp_standard."""
    found = find_spec("pyssp_standard")
    assert found is not None and found.origin is not None
    schemas = Path(found.origin).with_name("resources") / "ssp2"
    (tmp_path / "out").mkdir()
    [path] = write_ssp(replace(mixed, step=0.1), tmp_path / "out")
    with ZipFile(path) as content:
        for name in content.namelist():
            if name.endswith((".ssd", ".ssv")):
                what = "Description" if name.endswith(".ssd") else "ParameterValues"
                schema = etree.parse(schemas / f"SystemStructure{what}.xsd")
                etree.XMLSchema(schema).assertValid(etree.fromstring(content.read(name)))


#: Characters that XML 1.0 can hold, and others.
_PLAIN = st.characters(codec="utf-8", exclude_categories=["Cc"], exclude_characters="\ufffe\uffff")
LEGAL = st.text(_PLAIN | st.sampled_from("\t\n\r<>&\"' \x85\u2028"), max_size=8)
ILLEGAL = st.sampled_from("\x01\x08\x0b\x0c\x0e\x1f\ufffe\uffff")

#: Names of components; a dot would nest them, and slashes are refused.
LEGAL_NAMES = LEGAL.filter(lambda text: text.strip() and not set("./\\") & set(text))

NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from([-0.0, 2.0**63])
WIDE = st.integers(0, 2**64 - 1) | st.sampled_from([2**53 + 1, 2**63, 2**64 - 1])
GIVEN = st.fixed_dictionaries(
    {},
    optional={
        "u_Float64": NUMBERS,
        "u_Int64": st.sampled_from([-(2**63), 2**63 - 1, -(2**53) - 1]),
        "counts_from": WIDE,
        "complains": st.booleans(),
        "u_Enumeration": st.sampled_from([1, 4]),
        "names[2]": LEGAL,
        "u_String": LEGAL,
        "M[1,2]": NUMBERS,
    },
)


@pytest.fixture(scope="module")
def every_type(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_fmus.write(tmp_path_factory.mktemp("typed") / "typed.fmu", typed.text())


@given(
    names=st.lists(LEGAL_NAMES, min_size=2, max_size=2, unique=True),
    values=GIVEN,
    change=st.builds(Linear, NUMBERS, NUMBERS),
    pairs=st.dictionaries(WIDE, WIDE, max_size=3),
    times=st.tuples(st.floats(-1e9, 0.0), st.floats(0.0, 1e9), st.floats(5e-324, 1e300)),
)
def test_numbers_texts_and_names_are_read_as_they_were(
    every_type: Path, names, values, change, pairs, times
):
    first, second = names
    start, stop, step = times
    made = small_fmus.connected("a", dict.fromkeys(names, every_type))
    wires = {"Float64": change, "UInt64": Mapped(tuple(pairs.items()))}
    system = replace(
        made,
        parameters={PortName(second, port): value for port, value in values.items()},
        connections=tuple(
            Connection(PortName(first, f"y_{kind}"), PortName(first, f"u_{kind}"), how)
            for kind, how in wires.items()
        ),
        **{"start_time": start, "stop_time": stop, "step": step, "steps": {second: 2 * step}},
    )
    assert not list(system.problems())
    with TemporaryDirectory() as folder:
        [path] = write_ssp(system, Path(folder))
        again = read_ssp(path, findings=Findings(strict=True))
    assert list(again.components) == names
    for wire, twin in zip(again.connections, system.connections, strict=True):
        assert (wire.source, wire.target) == (twin.source, twin.target)
        # Files have no empty mappings, which change nothing.
        how = Linear() if twin.transformation == Mapped(()) else twin.transformation
        assert repr(wire.transformation) == repr(how)
    # All elements of an array are written.
    elements = {"names[2]": ["a", "b"], "M[1,2]": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]}
    expected = dict(values)
    for element, starts in elements.items():
        if element in values:
            array = made.components[second].elements(element.partition("[")[0])
            for other, value in zip(array, starts, strict=True):
                expected.setdefault(other.name, value)
    found = {name.port: value for name, value in again.parameters.items()}
    assert {port: repr(value) for port, value in found.items()} == {
        port: repr(value) for port, value in expected.items()
    }
    # The start time may be minus zero, which equals zero.
    assert (again.start_time, again.stop_time, again.step) == (start, stop, step)
    assert again.steps == system.steps


@given(before=LEGAL, character=ILLEGAL, where=st.sampled_from(["u_String", "names[1]", "name"]))
def test_what_xml_cannot_hold_is_refused_by_name(every_type: Path, before, character, where):
    text = f"{before}{character}"
    name = text if where == "name" else "lag"
    values = {} if where == "name" else {PortName(name, where): text}
    system = replace(small_fmus.connected("a", {name: every_type}), parameters=values)
    with TemporaryDirectory() as folder, pytest.raises(InputError) as error:
        write_ssp(system, Path(folder))
    assert repr(character) in str(error.value)
    assert where == "name" or str(error.value).startswith(f"lag.{where.partition('[')[0]}: ")


@pytest.mark.parametrize("name", ["a/b", "a\\b"])
def test_a_name_with_a_slash_is_refused(every_type: Path, tmp_path: Path, name: str):
    with pytest.raises(InputError) as error:
        write_ssp(small_fmus.connected("a", {name: every_type}), tmp_path)
    assert repr(name) in str(error.value)


@pytest.mark.parametrize("start", ["INF", "-1e999", "NaN"])
def test_an_array_with_a_start_that_is_not_finite_is_refused_by_name(tmp_path: Path, start: str):
    text = typed.text().replace('start="1 2 3 4 5 6"', f'start="1 2 {start} 4 5 6"')
    made = small_fmus.connected("a", {"lag": small_fmus.write(tmp_path / "a.fmu", text)})
    with pytest.raises(InputError) as error:
        write_ssp(replace(made, parameters={PortName("lag", "M[1,1]"): 2.0}), tmp_path)
    assert mentions(str(error.value), "lag.M[1,3] finite")


@pytest.mark.parametrize("write", [write_ssp, write_osp])
def test_an_fmu_that_has_changed_since_it_was_read_is_refused(tmp_path: Path, write):
    """Like every other command that copies it."""
    path = fmu(tmp_path / "a.fmu", variable("u", "input"), variable("y", "output"))
    system = replace(small_fmus.connected("a", {"a": path, "b": path}), step=0.1)
    (tmp_path / "out").mkdir()
    path.write_bytes(path.read_bytes() + b"more")
    with pytest.raises(InputError) as error:
        write(system, tmp_path / "out")
    assert mentions(str(error.value), "a.fmu changed")


#: Ports of an FMU of FMI 2.0: two Reals in one unit, one in another, a number, and a parameter.
PORTS = (
    variable("u.x", "input", unit="m"), variable("v", "input", unit="km"),
    variable("n", "input", "Integer"), variable("y.x", "output", unit="m"),
    variable("m", "output", "Integer"), variable("k", "parameter"),
)  # fmt: skip


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Component]:
    """A component of each FMU: of FMI 2.0, of FMI 3.0 with arrays, and one whose m is a foot."""
    folder = tmp_path_factory.mktemp("fmus")
    foot = fmu(folder / "foot.fmu", *PORTS)
    with ZipFile(foot) as content:
        text = content.read("modelDescription.xml").decode()
    with ZipFile(foot, "w") as content:
        meter = '<Unit name="m"><BaseUnit m="1"/>'
        assert meter in text
        feet = text.replace(meter, meter.replace('m="1"', 'm="1" factor="0.3048"'))
        content.writestr("modelDescription.xml", feet)
    files = {"2": fmu(folder / "2.fmu", *PORTS), "3": fmu3(folder / "3.fmu"), "foot": foot}
    return {name: read_component(name, file) for name, file in files.items()}


def system_of(
    parts: dict[str, Component],
    kinds: dict[str, str],
    wires: dict[str, str],
    made: dict[str, (Linear | Mapped)] | None = None,
    **others: object,
) -> System:
    """Make a system of components by the kinds of their FMUs, and targets by their sources.

    Args:
        parts: components by kind.
        kinds: by name.
        wires: sources by targets, each a component and a port with a colon between them.
        made: transformations by targets.
        others: further attributes of the system.

    """

    def port(text: str) -> PortName:
        component, _, name = text.partition(":")
        return PortName(component, name)

    return System(
        "nested",
        {name: replace(parts[kind], name=name) for name, kind in kinds.items()},
        tuple(
            Connection(port(source), port(target), (made or {}).get(target))
            for target, source in wires.items()
        ),
        **{"start_time": 0.0, **others},
    )


def round_trip(system: System, offered: bool = False) -> System:
    with TemporaryDirectory() as folder:
        [path] = write_ssp(system, Path(folder), connectors=offered)
        return read_ssp(path, findings=Findings(strict=True))


def check_same(again: System, system: System) -> None:
    assert list(again.components) == list(system.components)
    digests = [{n: c.digest for n, c in version.components.items()} for version in (again, system)]
    assert digests[0] == digests[1]
    # Each input has one connection, so that their order does not matter.
    assert len(again.connections) == len(system.connections)
    assert set(again.connections) == set(system.connections)
    assert again.parameters == system.parameters
    assert (again.steps, again.left_open) == (system.steps, system.left_open)
    experiments = [
        (version.start_time, version.stop_time, version.step) for version in (again, system)
    ]
    assert experiments[0] == experiments[1]


def structure(system: System, offered: bool = False) -> ElementTree.Element:
    with TemporaryDirectory() as folder:
        [path] = write_ssp(system, Path(folder), connectors=offered)
        with ZipFile(path) as content:
            text = content.read("SystemStructure.ssd").decode()
    root = ElementTree.fromstring(text)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    [found] = root.findall("System")
    return found


def connectors(element: ElementTree.Element) -> list[tuple[str, str]]:
    """Return names and kinds of the connectors of a system."""
    found = element.findall("Connectors/Connector")
    return [(connector.get("name", ""), connector.get("kind", "")) for connector in found]


def lines(element: ElementTree.Element) -> set[tuple[str, str]]:
    """Return the connections in a system, ends with a colon between element and connector."""
    return {
        (
            f"{connection.get('startElement', '')}:{connection.get('startConnector')}",
            f"{connection.get('endElement', '')}:{connection.get('endConnector')}",
        )
        for connection in element.findall("Connections/Connection")
    }


def test_values_cross_borders_by_one_connector_for_each_output(parts: dict[str, Component]):
    system = system_of(
        parts,
        {"a.p": "2", "a.c": "2", "b.p": "2", "b.in.p": "2", "top": "2"},
        {
            "a.c:u.x": "a.p:y.x", "b.p:u.x": "a.p:y.x", "b.in.p:u.x": "a.p:y.x",
            "top:u.x": "a.p:y.x", "a.p:n": "top:m", "a.p:u.x": "b.in.p:y.x",
        },
    )  # fmt: skip
    outer = structure(system)
    a, b, _ = outer.find("Elements") or ()
    inner = b.find("Elements/System")
    assert inner is not None
    assert (a.get("name"), b.get("name"), inner.get("name")) == ("a", "b", "in")
    assert [element.get("name") for element in a.findall("Elements/Component")] == ["p", "c"]
    assert connectors(outer) == []
    assert set(connectors(a)) == {
        ("a_p_y_x", "output"), ("top_m", "input"), ("b_in_p_y_x", "input"),
    }  # fmt: skip
    assert set(connectors(b)) == {("a_p_y_x", "input"), ("b_in_p_y_x", "output")}
    assert set(connectors(inner)) == {("a_p_y_x", "input"), ("b_in_p_y_x", "output")}
    assert lines(outer) == {
        ("a:a_p_y_x", "b:a_p_y_x"), ("a:a_p_y_x", "top:u.x"), ("top:m", "a:top_m"),
        ("b:b_in_p_y_x", "a:b_in_p_y_x"),
    }  # fmt: skip
    assert lines(a) == {
        ("p:y.x", "c:u.x"), ("p:y.x", ":a_p_y_x"), (":top_m", "p:n"), (":b_in_p_y_x", "p:u.x"),
    }  # fmt: skip
    assert lines(b) == {
        (":a_p_y_x", "p:u.x"), (":a_p_y_x", "in:a_p_y_x"), ("in:b_in_p_y_x", ":b_in_p_y_x"),
    }  # fmt: skip
    assert lines(inner) == {(":a_p_y_x", "p:u.x"), ("p:y.x", ":b_in_p_y_x")}
    units = {
        element.get("unit") for element in outer.iterfind(".//System/Connectors/Connector/Real")
    }
    assert units == {"m"}
    check_same(round_trip(system), system)


def test_flat_system_has_no_system_in_it(parts: dict[str, Component]):
    outer = structure(system_of(parts, {"a": "2", "b": "3"}, {"b:x": "a:y.x"}))
    assert outer.findall(".//System") == []


def test_no_two_connectors_of_a_system_are_one_nor_one_an_element(parts: dict[str, Component]):
    """The elements here have the names that connectors would get."""
    system = system_of(
        parts,
        {"a.p": "2", "a.a_p_m": "2", "a.q.p": "2", "a.q_p": "2", "b": "2", "c": "2"},
        {
            "b:u.x": "a.p:y.x", "b:n": "a.p:m", "c:u.x": "a.q.p:y.x", "c:n": "a.q_p:m",
            "a.p:u.x": "a.q_p:y.x", "b:v": "a.q_p:y.x",
        },
        {"b:v": Linear()},
    )  # fmt: skip
    outer = structure(system)
    names = [name for name, _ in connectors((outer.find("Elements") or [])[0])]
    assert sorted(names) == ["a_p_m_", "a_p_y_x", "a_q_p_m", "a_q_p_y_x", "a_q_p_y_x_"]
    check_same(round_trip(system), system)


def test_connectors_with_dots_can_be_read(parts: dict[str, Component], tmp_path: Path):
    """As in archives of earlier versions."""
    system = system_of(parts, {"a.p": "2", "b.c.p": "2"}, {"b.c.p:u.x": "a.p:y.x"})
    text = structure_xml(system).decode()
    assert 'name="a_p_y_x"' in text
    files = {"resources/2.fmu": parts["2"].fmu}
    older = archive(tmp_path / "older.ssp", text.replace("a_p_y_x", "p_y.x"), files)
    check_same(read_ssp(older, findings=Findings(strict=True)), system)


def test_a_name_that_begins_another_component_stays_one(parts: dict[str, Component]):
    """Parts of names without letters, too."""
    kinds = dict.fromkeys(("a", "a.b", "a.b.c.d", "x..y", "x.y", ".z", "w.", "v.1"), "2")
    targets = list(kinds)
    wires = {
        f"{target}:u.x": f"{source}:y.x"
        for target, source in zip(targets, targets[3:] + targets[:3], strict=True)
    }
    system = system_of(parts, kinds, wires)
    found = [element.get("name") for element in structure(system).findall("Elements/*")]
    assert found == ["a", "a.b", "a.b.c", "x", ".z", "w.", "v"]
    check_same(round_trip(system), system)


def test_arrays_cross_borders_as_a_whole(parts: dict[str, Component]):
    whole = {f"b.{name}:u[{i}]": f"a.p:y[{i}]" for name in ("p", "q") for i in (1, 2, 3)}
    parted = {"c.p:u[3]": "a.p:y[1]", "c.p:u[1]": "a.p:z", "a.p:x": "a.p:y[2]"}
    system = system_of(parts, dict.fromkeys(("a.p", "b.p", "b.q", "c.p"), "3"), {**whole, **parted})
    outer = structure(system)
    assert lines(outer) == {
        ("a:a_p_y", "b:a_p_y"), ("a:a_p_y", "c:a_p_y"), ("a:a_p_z", "c:a_p_z"),
    }  # fmt: skip
    sizes = [
        element.get("size")
        for element in outer.iterfind(".//System/Connectors/Connector/Dimension")
    ]
    assert sizes == ["3"] * 3
    check_same(round_trip(system), system)


def test_what_happens_to_a_value_on_its_way_is_read_as_it_was(parts: dict[str, Component]):
    """In the unit of the output, even if two FMUs define a metre differently."""
    made: dict[str, (Linear | Mapped)] = {
        "b.c.p:v": Linear(0.001, 2.0), "b.c.p:n": Mapped(((1.0, 2.0),)), "a.q:u.x": Linear(),
        "b.p:u.x": Linear(0.3048),
    }  # fmt: skip
    system = system_of(
        parts,
        {"a.p": "2", "b.c.p": "2", "b.p": "2", "a.q": "2", "b.f": "foot", "a.f": "foot"},
        {
            "b.c.p:v": "a.p:y.x", "b.c.p:n": "a.p:m", "a.q:u.x": "b.f:y.x", "b.p:u.x": "a.f:y.x",
            "b.f:u.x": "a.f:y.x", "a.f:u.x": "b.f:y.x",
        },
        made,
    )  # fmt: skip
    check_same(round_trip(system), system)


def test_parameters_steps_open_inputs_and_order_are_read_as_they_were(
    parts: dict[str, Component],
):
    """The components of two systems alternate."""
    system = system_of(
        parts,
        {"a.p": "2", "b.p": "3", "a.q": "2", "b.in.q": "2", "a.in.q": "3"},
        {"a.q:u.x": "a.p:y.x"},
        parameters={
            PortName("a.p", "k"): 2.5, PortName("b.in.q", "k"): -1.0, PortName("a.p", "n"): 3,
            **{PortName("b.p", f"A[{i},{j}]"): 1.0 * i + j for i in (1, 2) for j in (1, 2)},
        },
        steps={"b.in.q": 0.5},
        left_open={PortName("b.in.q", "v")},
        start_time=1.0, stop_time=3.0, step=0.25,
    )  # fmt: skip
    check_same(round_trip(system), system)
    # No annotation is needed if nesting keeps the order.
    assert b"<Order" not in ssp_bytes(system_of(parts, {"a.p": "2", "a.q": "2", "b": "2"}, {}))


@pytest.mark.parametrize("offered", [False, True])
def test_fmpy_finds_the_schema_kept(parts: dict[str, Component], tmp_path: Path, offered: bool):
    system = system_of(
        parts, {"a.p": "2", "b.c.p": "2"}, {"b.c.p:u.x": "a.p:y.x"}, step=0.1, stop_time=1.0
    )
    [path] = write_ssp(system, tmp_path, connectors=offered)
    top = read_ssd(str(path)).system
    assert [element.name for element in top.elements] == ["a", "b"]


@pytest.mark.skipif(find_spec("pyssp_standard") is None, reason="pyssp_standard is not installed")
@pytest.mark.parametrize("offered", [False, True])
def test_nested_ssp_2_is_valid(parts: dict[str, Component], offered: bool):
    """Checked with the schema of SSP 2.0 in pyssp_standard."""
    found = find_spec("pyssp_standard")
    assert found is not None and found.origin is not None
    schema = Path(found.origin).with_name("resources") / "ssp2" / "SystemStructureDescription.xsd"
    wires = {f"b.c.q:u[{i}]": f"a.p:y[{i}]" for i in (1, 2, 3)}
    wires |= {"b.r:v": "a.p:z", "a.in.p:x": "b.c.q:y[2]"}
    kinds = {"a.p": "3", "b.r": "2", "b.c.q": "3", "a.in.p": "3"}
    made = {"b.r:v": Linear(0.001)}
    system = system_of(parts, kinds, wires, made, step=0.1, stop_time=1.0)
    text = structure_xml(system, connectors=offered)
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.fromstring(text))


def test_a_system_offers_its_outputs_and_open_inputs(parts: dict[str, Component]):
    """An array as a whole, if it is open as a whole."""
    system = system_of(
        parts,
        {"a.p": "2", "b": "3", "c": "3"},
        {"a.p:u.x": "a.p:y.x", "b:u[2]": "c:z"},
        parameters={PortName("a.p", "n"): 3},
        left_open={PortName("a.p", "v"), PortName("a.p", "n"), PortName("c", "x")},
    )  # fmt: skip
    outer = structure(system, offered=True)
    offered = {
        "a_p_v": "input", "b_x": "input", "b_v": "input", "c_u": "input", "c_x": "input",
        "c_v": "input", "a_p_y_x": "output", "a_p_m": "output", "b_y": "output", "b_z": "output",
        "c_y": "output", "c_z": "output",
    }  # fmt: skip
    assert dict(connectors(outer)) == offered and len(connectors(outer)) == len(offered)
    ends = lines(outer)
    assert {
        (":a_p_v", "a:a_p_v"),
        ("a:a_p_y_x", ":a_p_y_x"),
        (":c_u", "c:u"),
        ("c:z", ":c_z"),
    } < ends
    # Ports without a connection have no connector.
    [inner] = outer.findall(".//System/Elements/Component")
    assert dict(connectors(inner)) == {
        "u.x": "input", "v": "input", "y.x": "output", "m": "output", "k": "parameter",
    }  # fmt: skip


#: OMSimulator's rule in `ComRef.cpp` for names of systems' connectors.
IDENT = re.compile("[a-zA-Z][a-zA-Z0-9_-]*")

NAMES = st.lists(
    st.lists(st.sampled_from("abc"), min_size=1, max_size=4).map(".".join),
    min_size=1, max_size=8, unique=True,
)  # fmt: skip

MADE = st.sampled_from([None, Linear(), Linear(2.0, -1.0)])


@st.composite
def nested_systems(draw: st.DrawFn, parts: dict[str, Component]) -> System:
    names = draw(NAMES)
    kinds = {name: draw(st.sampled_from(["2", "3"])) for name in names}
    outputs = {
        "2": [("y.x", "Real", "m"), ("m", "Integer", "")],
        "3": [(f"y[{i}]", "Real", "") for i in (1, 2, 3)] + [("z", "Real", "")],
    }
    inputs = {
        "2": [("u.x", "Real", "m"), ("v", "Real", "km"), ("n", "Integer", "")],
        "3": [(f"u[{i}]", "Real", "") for i in (1, 2, 3)] + [("x", "Real", "")],
    }
    sources = [(f"{name}:{port}", *rest) for name in names for port, *rest in outputs[kinds[name]]]
    wires: dict[str, str] = {}
    made: dict[str, (Linear | Mapped)] = {}
    for name in names:
        for port, kind, unit in inputs[kinds[name]]:
            fitting = [source for source in sources if source[1] == kind]
            source = draw(st.none() | st.sampled_from(fitting)) if fitting else None
            if source is None:
                continue
            target = f"{name}:{port}"
            wires[target] = source[0]
            change = draw(MADE) if kind == "Real" else None
            if change is None and unit and source[2] and unit != source[2]:
                change = Linear(0.001)
            if change is not None:
                made[target] = change
    return system_of(parts, kinds, wires, made, stop_time=1.0)


@given(st.data(), st.booleans())
def test_random_systems_are_read_as_they_were(
    parts: dict[str, Component], data: st.DataObject, offered: bool
):
    """Connectors of nested systems have names that OMSimulator accepts."""
    system = data.draw(nested_systems(parts))
    # Ports of two components may have the same name, which is refused.
    assume(not list(system.problems()))
    check_same(round_trip(system, offered), system)
    outer = structure(system, offered)
    names = [
        name for element in (outer, *outer.iterfind(".//System")) for name, _ in connectors(element)
    ]
    assert all(map(IDENT.fullmatch, names))
