"""What is written is what was read, and valid."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest
from fmpy.ssp.ssd import read_ssd, read_ssv
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from orchestrator.cosim.formats.osp import write_osp
from orchestrator.cosim.formats.ssp import OMS
from orchestrator.cosim.formats.ssp.reader import read_ssp
from orchestrator.cosim.formats.ssp.writer import write_ssp
from orchestrator.cosim.system.component import read_component
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.units import Linear, Mapped
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
    """A system with all that a system may have, two of whose FMUs have one name."""
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
        {name: part.fmu.read_bytes() for name, part in one.components.items()}
        for one in (found, again)
    ]
    assert contents[0] == contents[1]


@pytest.mark.parametrize("step", [None, 0.02])
def test_what_is_written_is_valid(found: System, tmp_path: Path, step: float | None):
    """fmpy holds it against the schemas of SSP 1.0."""
    [path] = write_ssp(replace(found, step=step), tmp_path)
    read_ssd(str(path))
    with ZipFile(path) as content:
        sets = [name for name in content.namelist() if name.endswith(".ssv")]
    assert len(sets) == 2
    for name in sets:
        read_ssv(str(path), name)


def test_choices_are_numbers_without_connectors(found: System, tmp_path: Path):
    """Other tools end at an Enumeration there, or do not set it."""
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
    """fmpy takes for a connector without a connection the source of the one before."""
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
    """Its Python side takes the attributes, its C++ side the child, by literal prefixes."""
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
    # Without libcosim's annotation it is what is left to be read.
    other = text.replace("FixedStepAlgorithm", "Another")
    with ZipFile(path) as content:
        files = {name: content.read(name) for name in content.namelist() if name.count("/")}
    assert read_ssp(archive(tmp_path / "other.ssp", other, files)).step == step


def test_a_format_without_words_for_a_transformation_refuses_it(found: System, tmp_path: Path):
    with pytest.raises(InputError, match="write an SSP"):
        write_osp(found, tmp_path)


def test_fmus_of_one_name_stay_apart(tmp_path: Path):
    """Also where names differ in case only, or one is that of the format's own file."""
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
    """A system of FMI 2.0 and 3.0, with arrays connected as wholes and in parts."""
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
    """Held against the schemas of SSP 2.0, which that package has."""
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


#: What XML 1.0 can hold, and what it cannot.
_PLAIN = st.characters(codec="utf-8", exclude_categories=["Cc"], exclude_characters="\ufffe\uffff")
LEGAL = st.text(_PLAIN | st.sampled_from("\t\n\r<>&\"' \x85\u2028"), max_size=8)
ILLEGAL = st.sampled_from("\x01\x08\x0b\x0c\x0e\x1f\ufffe\uffff")

#: Names of components; a dot would put one into another system.
LEGAL_NAMES = LEGAL.filter(lambda text: text.strip() and "." not in text)

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
            Connection(PortName(first, f"y_{of}"), PortName(first, f"u_{of}"), how)
            for of, how in wires.items()
        ),
        **{"start_time": start, "stop_time": stop, "step": step, "steps": {second: 2 * step}},
    )
    assert not list(system.problems())
    with TemporaryDirectory() as folder:
        [path] = write_ssp(system, Path(folder))
        again = read_ssp(path, findings=Findings(strict=True))
    assert list(again.components) == names
    for one, other in zip(again.connections, system.connections, strict=True):
        assert (one.source, one.target) == (other.source, other.target)
        # No file has an empty table, which changes nothing.
        how = Linear() if other.transformation == Mapped(()) else other.transformation
        assert repr(one.transformation) == repr(how)
    # Of an array, all elements are written.
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
    # The start time may be minus zero, which is zero.
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


@pytest.mark.parametrize("start", ["INF", "-1e999", "NaN"])
def test_an_array_with_a_start_that_is_not_finite_is_refused_by_name(tmp_path: Path, start: str):
    text = typed.text().replace('start="1 2 3 4 5 6"', f'start="1 2 {start} 4 5 6"')
    made = small_fmus.connected("a", {"lag": small_fmus.write(tmp_path / "a.fmu", text)})
    with pytest.raises(InputError) as error:
        write_ssp(replace(made, parameters={PortName("lag", "M[1,1]"): 2.0}), tmp_path)
    assert mentions(str(error.value), "lag.M[1,3] finite")


@pytest.mark.parametrize("write", [write_ssp, write_osp])
def test_an_fmu_that_has_changed_since_it_was_read_is_refused(tmp_path: Path, write):
    """As by every other command that takes it along."""
    path = fmu(tmp_path / "a.fmu", variable("u", "input"), variable("y", "output"))
    system = replace(small_fmus.connected("a", {"a": path, "b": path}), step=0.1)
    (tmp_path / "out").mkdir()
    path.write_bytes(path.read_bytes() + b"more")
    with pytest.raises(InputError) as error:
        write(system, tmp_path / "out")
    assert mentions(str(error.value), "a.fmu changed")
