"""SSP archives are read as the standard says; unsupported features are refused by name."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch
from zipfile import ZipFile

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orchestrator.cosim.connection import Connection, Linear, Mapped, PortName, combine
from orchestrator.cosim.formats import ssp_reader as reader
from orchestrator.cosim.formats.ssp_reader import Node, read_ssp
from orchestrator.cosim.system import System
from orchestrator.machine.errors import Findings, InputError
from support.archives import (
    archive,
    binding,
    component,
    connection,
    connector,
    described,
    fmu,
    fmu3,
    mapping,
    parameter_set,
    system,
    variable,
)
from support.texts import mentions

Read = Callable[..., System]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs: one with ports of all kinds, and one for each unit of length."""
    folder = tmp_path_factory.mktemp("fmus")
    kinds = ("Real", "Integer", "Boolean", "String", "Enumeration")
    found = {
        "a.fmu": fmu(
            folder / "a.fmu",
            variable("u", "input", start="101325"),
            variable("v", "input"),
            variable("y", "output"),
            variable("k", "parameter"),
            variable("x", "output", initial="exact"),
            variable("l", "local", initial="approx"),
            variable("c", "local", variability="constant"),
            *(variable(f"{kind}.in", "input", kind) for kind in kinds),
            *(variable(f"{kind}.out", "output", kind) for kind in kinds),
            *(variable(f"{kind}.k", "parameter", kind) for kind in kinds),
        )
    }
    for unit in ("m", "mm", "km", "K", "degC"):
        found[f"{unit}.fmu"] = fmu(
            folder / f"{unit}.fmu",
            variable("u", "input", unit=unit),
            variable("y", "output", unit=unit),
            variable("k", "parameter", unit=unit),
        )
    return {**found, "3.fmu": fmu3(folder / "3.fmu")}


@pytest.fixture
def read(files: dict[str, Path], tmp_path: Path) -> Read:
    """A function that reads a description, with the FMUs and other files next to it."""

    def reader(
        text: str, findings: Findings | None = None, /, version: str = "1.0", **more: str
    ) -> System:
        named = {name.replace("__", "."): content for name, content in more.items()}
        path = archive(tmp_path / "test.ssp", described(text, version), {**files, **named})
        return read_ssp(path, None, findings)

    return reader


def routes(found: System) -> dict[str, str]:
    return {str(segment.target): str(segment.source) for segment in found.connections}


def parameters(found: System) -> dict[str, object]:
    return {str(name): value for name, value in found.parameters.items()}


def notes(read: Read, text: str, **files: str) -> list[str]:
    findings = Findings()
    read(text, findings, **files)
    return [note.partition("test.ssp: ")[2] for note in findings.notes]


def problem(read: Read, text: str, **files: str) -> str:
    with pytest.raises(InputError) as error:
        read(text, **files)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_connections_are_followed_through_systems_of_any_depth(read: Read):
    inner = system(
        component("c"), connection("u", "c.u") + connection("c.y", "y") + connection("u", "out"),
        connector("u", "input") + connector("y", "output") + connector("out", "output"),
        name="inner",
    )  # fmt: skip
    middle = system(
        inner + component("d"),
        connection("u", "inner.u") + connection("inner.y", "d.u") + connection("inner.out", "w")
        + connection("d.y", "y"),
        connector("u", "input") + connector("y", "output") + connector("w", "output"),
        name="middle",
    )  # fmt: skip
    found = read(
        system(
            middle + component("a") + component("b"),
            connection("a.y", "middle.u") + connection("middle.y", "b.u")
            + connection("middle.w", "b.v"),
        )
    )  # fmt: skip
    assert list(found.components) == ["middle.inner.c", "middle.d", "a", "b"]
    assert routes(found) == {
        "middle.inner.c.u": "a.y",
        "middle.d.u": "middle.inner.c.y",
        "b.u": "middle.d.y",
        "b.v": "a.y",
    }


BUS = (
    '<ssd:SignalDictionaryReference name="{}" dictionary="bus"><ssd:Connectors>'
    + connector("s", "inout")
    + "</ssd:Connectors></ssd:SignalDictionaryReference>"
)


@pytest.mark.parametrize(
    ("inside", "name", "around", "more"),
    [
        ((component("b"), connection("b.u", "u"), connector("u", "input")), "inner.u", "", ""),
        # Some tools leave the name of an element empty for the system itself.
        (
            (component("b"), connection("u", "b.u").replace(
                "<ssd:Connection ", '<ssd:Connection startElement="" '), connector("u", "input")),
            "inner.u", "", "",
        ),
        (
            (component("b") + BUS.format("there"), connection("there.s", "b.u")),
            "here.s", BUS.format("here"),
            '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"/></ssd:SignalDictionaries>',
        ),
    ],
    ids=["from either end", "empty name of an element", "signal dictionary"],
)  # fmt: skip
def test_connections_are_followed_as_they_may_be_written(read: Read, inside, name, around, more):
    elements = system(*inside, name="inner") + component("a") + around
    for ends in (("a.y", name), (name, "a.y")):
        found = read(system(elements, connection(*ends), more=more))
        assert routes(found) == {"inner.b.u": "a.y"}


LENGTHS = {"m": 1.0, "mm": 1e-3, "km": 1e3}


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    ends=st.tuples(st.sampled_from(list(LENGTHS)), st.sampled_from(list(LENGTHS))),
    way=st.lists(
        st.tuples(
            st.sampled_from(["", *LENGTHS]),
            st.none() | st.tuples(st.integers(-3, 3).filter(bool), st.integers(-2, 2)),
        ),
        max_size=4,
    ),
    last=st.none() | st.tuples(st.integers(1, 3), st.integers(-2, 2)),
)
def test_units_and_transformations_of_a_long_way_follow_from_each_hop(read: Read, ends, way, last):
    """Compared with a conversion and transformation from connector to connector."""
    source, target = ends
    hops = [*way, (target, last)]
    inside, unit, value = component("b", f"{target}.fmu"), source, 7.0
    for to, transformation in hops:
        if to:
            value = value * LENGTHS[unit] / LENGTHS[to]
            unit = to
        if transformation is not None:
            value = transformation[0] * value + transformation[1]
            if not to:
                # Its unit is unknown from there on, so that it cannot be converted.
                return
    texts = [
        "" if hop is None else f'<ssc:LinearTransformation factor="{hop[0]}" offset="{hop[1]}"/>'
        for _, hop in hops
    ]
    name = "b"
    for depth, (outer, text) in enumerate(zip(reversed(way), reversed(texts), strict=False)):
        inner_end = f"{name}.u"
        inside = system(
            inside, connection("u", inner_end, text), connector("u", "input", outer[0]),
            name=f"s{depth}",
        )  # fmt: skip
        name = f"s{depth}"
    top = system(component("a", f"{source}.fmu") + inside, connection("a.y", f"{name}.u", texts[0]))
    [segment] = read(top).connections
    arrived = 7.0 if segment.transformation is None else segment.transformation(7.0)
    assert arrived == pytest.approx(value, rel=1e-12, abs=1e-9)


def test_a_value_that_nothing_changes_arrives_bit_for_bit(read: Read):
    elements = component("a", "m.fmu") + component("b", "m.fmu") + component("c")
    [first, second] = read(
        system(elements, connection("a.y", "b.u") + connection("c.y", "a.u"))
    ).connections
    assert first.transformation is None and second.transformation is None


def test_temperature_is_shifted_and_scaled(read: Read):
    top = system(component("a", "degC.fmu") + component("b", "K.fmu"), connection("a.y", "b.u"))
    [segment] = read(top).connections
    assert isinstance(segment.transformation, Linear)
    assert segment.transformation(20.0) == pytest.approx(293.15, rel=1e-15)


def test_suppressed_conversion_leaves_the_number_as_it_is(read: Read):
    elements = component("a", "km.fmu") + component("b", "m.fmu")
    double = '<ssc:LinearTransformation factor="2"/>'
    for inside, expected in (("", 7.0), (double, 14.0)):
        top = system(elements, connection("a.y", "b.u", inside, suppressUnitConversion="true"))
        [segment] = read(top).connections
        assert segment.transformation is not None
        assert segment.transformation(7.0) == expected


@pytest.mark.parametrize(
    ("kind", "text", "pairs"),
    [
        ("Boolean", '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
         "</ssc:BooleanMappingTransformation>", {(1, 0)}),
        ("Integer", '<ssc:IntegerMappingTransformation><ssc:MapEntry source="3" target="-4"/>'
         '<ssc:MapEntry source="5" target="6"/></ssc:IntegerMappingTransformation>',
         {(3, -4), (5, 6)}),
        ("Enumeration", '<ssc:EnumerationMappingTransformation><ssc:MapEntry source="slow" '
         'target="fast"/></ssc:EnumerationMappingTransformation>', {(2, 5)}),
    ],
)  # fmt: skip
def test_tables_of_values_become_numbers(read: Read, kind: str, text: str, pairs: set):
    top = system(component("a") + component("b"), connection(f"a.{kind}.out", f"b.{kind}.in", text))
    [segment] = read(top).connections
    assert isinstance(segment.transformation, Mapped)
    assert set(segment.transformation.pairs) == pairs
    # Values without an entry stay as they are.
    assert segment.transformation(17.0) == 17.0


@pytest.mark.parametrize("kind", ["Real", "Integer", "Boolean", "String", "Enumeration"])
def test_ports_of_all_kinds_are_connected_and_set(read: Read, kind: str):
    written, value = {
        "Real": ("0.1", 0.1), "Integer": ("-3", -3), "Boolean": ("true", True),
        "String": ("a b", "a b"), "Enumeration": ("fast", 5),
    }[kind]  # fmt: skip
    found = read(
        system(
            component("a")
            + component("b", bindings=binding({f"{kind}.k": f'{kind} value="{written}"'})),
            connection(f"a.{kind}.out", f"b.{kind}.in"),
        )
    )
    assert routes(found) == {f"b.{kind}.in": f"a.{kind}.out"}
    assert parameters(found) == {f"b.{kind}.k": value}


def test_outer_systems_and_later_sets_win(read: Read):
    """Section 5.4.3: by level of the hierarchy, then by position."""
    one, two, three, four = (f'Real value="{i}"' for i in (1, 2, 3, 4))
    inner = system(
        component("c", bindings=binding({"k": one, "u": one, "l": one, "x": one})
                  + binding({"u": two, "l": two})),
        name="inner",
        bindings=binding({"c.l": three}),
    )  # fmt: skip
    found = read(system(inner, bindings=binding({"inner.c.l": four})))
    assert parameters(found) == {
        "inner.c.k": 1.0, "inner.c.u": 2.0, "inner.c.l": 4.0, "inner.c.x": 1.0,
    }  # fmt: skip


def test_prefix_mapping_and_files_reach_what_they_name(read: Read):
    """A set for one component, applied at the top, is renamed and transformed."""
    entries = mapping(
        'source="s.gain" target="s.c.k"|<ssc:LinearTransformation factor="4" offset="5"/>',
        'source="s.gain" target="s.c.u"',
    )
    found = read(
        system(
            system(component("c"), name="s"),
            bindings='<ssd:ParameterBinding source="deep%20in/set.ssv" prefix="s.">'
            '<ssd:ParameterMapping source="map.ssm"/></ssd:ParameterBinding>',
        ),
        **{
            "deep in/set__ssv": parameter_set({"gain": 'Real value="2"', "c.v": 'Real value="9"'}),
            "map__ssm": entries,
        },
    )
    assert parameters(found) == {"s.c.k": 13.0, "s.c.u": 2.0}


def test_values_of_system_connectors_go_down_to_the_components(read: Read):
    """The outermost value counts, with the units and transformations on the way."""
    inner = system(
        component("c", "m.fmu"),
        connection("u", "c.u", '<ssc:LinearTransformation offset="1"/>') + connection("p", "c.k"),
        connector("u", "input", "m") + connector("p", "parameter", "mm"),
        name="inner",
        bindings=binding({"u": 'Real value="5"', "p": 'Real value="500"'}),
    )  # fmt: skip
    top = system(
        inner,
        connection("U", "inner.u"),
        connector("U", "input", "km"),
        bindings=binding({"U": 'Real value="300" unit="m"'}),
    )
    assert parameters(read(top)) == {"inner.c.u": 301.0, "inner.c.k": 0.5}
    without = top.replace('value="300" unit="m"', 'value="x"').replace(
        'name="U"><ssv', 'name="V"><ssv'
    )
    assert parameters(read(without)) == {"inner.c.u": 6.0, "inner.c.k": 0.5}


def test_times_and_steps_are_read_from_annotations_of_all_tools(files, tmp_path: Path):
    hint = (
        "<ssd:Annotations><ssc:Annotation type='com.opensimulationplatform'>"
        "<StepSizeHint value='0.5'/></ssc:Annotation></ssd:Annotations></ssd:Component>"
    )
    elements = component("a").replace("</ssd:Component>", hint) + component("b")
    for tag, attribute in (
        ("FixedStepAlgorithm", "baseStepSize"),
        ("FixedStepMaster", "baseStepSize"),
        ("FixedStepMaster", "stepSize"),
        ("SimulationInformation", "fixedStepSize"),
    ):
        after = (
            "<ssd:DefaultExperiment startTime='-2' stopTime='3'><ssd:Annotations><ssc:Annotation "
            f"type='x'><Any><{tag} {attribute}='0.25'/></Any></ssc:Annotation></ssd:Annotations>"
            "</ssd:DefaultExperiment>"
        )
        text = described(system(elements), after=after)
        found = read_ssp(archive(tmp_path / "times.ssp", text, files))
        assert (found.start_time, found.stop_time, found.step) == (-2.0, 3.0, 0.25)
        assert found.steps == {"a": 0.5}


def test_variant_is_another_description_of_the_archive(files, tmp_path: Path):
    other = described(system(component("other")))
    path = archive(
        tmp_path / "v.ssp", described(system(component("one"))), {**files, "B.ssd": other}
    )
    assert list(read_ssp(path).components) == ["one"]
    for name in ("B", "B.ssd"):
        assert list(read_ssp(path, name).components) == ["other"]
    with pytest.raises(InputError, match=r"C\.ssd.* B, SystemStructure"):
        read_ssp(path, "C")


@pytest.mark.parametrize("source", ["a%20b/a.fmu", "./a%20b/../a%20b/a.fmu", "a b/a.fmu"])
def test_source_is_an_address(read: Read, files, tmp_path: Path, source: str):
    text = described(system(component("a", source)))
    found = read_ssp(archive(tmp_path / "s.ssp", text, {"a b/a.fmu": files["a.fmu"]}))
    assert list(found.components) == ["a"]


def test_parameter_set_inside_an_fmu(files, tmp_path: Path):
    """Its address is relative to the component, if stated."""
    holder = fmu(tmp_path / "holder.fmu", variable("k", "parameter"))
    with ZipFile(holder, "a") as content:
        content.writestr("resources/set.ssv", parameter_set({"k": 'Real value="4"'}))
    text = described(
        system(
            component(
                "a", "holder.fmu", binding(source="resources/set.ssv", sourceBase="component")
            )
        )
    )
    found = read_ssp(archive(tmp_path / "h.ssp", text, {"holder.fmu": holder}))
    assert parameters(found) == {"a.k": 4.0}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (system(component("a"), connection("a.y", "a.z")), "a 'z'"),
        (system(component("a"), connection("a.y", "b.u")), "'b'"),
        (system(component("a"), connection("a.y", "U")), " U,"),
        (system(component("a"), connection("aa.y", "a.u")), "'aa' a?"),
        (system(component("a"), connection("a.y", "a.U")), "'U' u?"),
        (system(component("a"), connection("a.y", "up"), connector("u", "output")),
         "up, u?"),
        (system(component("a"), connection("a.y", "a.x")), "a.y a.x"),
        (system(component("a"), connection("a.y", "a.u") + connection("a.x", "a.u")),
         "a.u a.y a.x"),
        (system(component("a"), connection("a.y", "a.k")), "a.k parameter"),
        (system(component("a"), connection("a.l", "a.u")), "a.l local"),
        (system(component("a"), connection("a.y", "a.Boolean.in")), "Real Boolean"),
        (system(component("a", "m.fmu") + component("b", "K.fmu"), connection("a.y", "b.u")),
         "a.y b.u m K"),
        (system(component("a", "m.fmu", binding({"k": 'Real value="1" unit="K"'}))),
         "a.k K m"),
        (system(component("a"), connection("a.y", "a.u", startIndices="1")), "a y[1]"),
        *(
            (system(component("a"), connection(
                f"a.{kind}.out", f"a.{kind}.in",
                f'<ssc:IntegerMappingTransformation><ssc:MapEntry source="3" target="{target}"/>'
                "</ssc:IntegerMappingTransformation>")), why)
            for kind, target, why in (
                ("Integer", "1.5", "'1.5'"),
                ("Integer", "1_0", "'1_0'"),
                ("Integer", "1e400", "'1e400'"),
                ("Integer", "2147483648", "2147483648 Integer"),
                ("Enumeration", "-2147483649", "-2147483649 Enumeration"),
                ("Boolean", "2", "2, Boolean"),
            )
        ),
        (system(component("a"), connection("a.String.out", "a.String.in",
                                           '<ssc:LinearTransformation factor="2"/>')),
         "String"),
        (system(component("a") + component("a")), "two a"),
        (system(component("a.b") + system(component("b"), name="a")), "two a.b"),
        (system(component("a/b")), "a/b"),
        (system(component("a", "b.fmu")), "'b.fmu'"),
        (system(component("a", "../a.fmu")), "'../a.fmu'"),
        (system(component("a", "/etc/passwd")), "'/etc/passwd'"),
        (system(component("a", "http://x/a.fmu")), "'http://x/a.fmu'"),
        (system(component("a", "//[x/a.fmu")), "'//[x/a.fmu' URI"),
        (system(component("a", type="text/x-modelica")), "'text/x-modelica'"),
        (system(component("a", implementation="ModelExchange")), "ModelExchange"),
        (system('<ssd:Component name="a"/>'), "source"),
        (system('<ssd:SignalDictionaryReference name="a" dictionary="b"/>'), "'b'"),
        (system(system(name="inner")), "component"),
        (system(component("a", bindings=binding({"k": 'Real value="x"'}))), "a.k x"),
        (system(component("mm", "mm.fmu", binding({"k": 'Real value="1,5" unit="m"'}))),
         "mm.k 1,5"),
        (system(component("a", bindings=binding({"k": 'String value="much"'}, mapping(
            'source="k" target="k"|<ssc:LinearTransformation factor="2"/>')))),
         "a.k much"),
        (system(component("a", bindings=binding({"k": 'Integer value="1_0"'}, mapping(
            'source="k" target="Integer.k"|<ssc:IntegerMappingTransformation>'
            '<ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>')))),
         "a.Integer.k 1_0"),
        (system(component("a", bindings=binding({"k": "Real"}))), "k: value"),
        (system(component("a", bindings=binding(source="none.ssv"))), "'none.ssv'"),
        (system(component("a", bindings=binding(source="a.csv", type="text/csv"))), "'text/csv'"),
        (system(component("a", bindings=binding({"k": 'Real value="1"'}, mapping('source="k"')))),
         "<MappingEntry> target"),
        (system(component("a"), connection(
            "a.Enumeration.out", "a.Enumeration.in",
            '<ssc:EnumerationMappingTransformation><ssc:MapEntry source="slow" target="up"/>'
            "</ssc:EnumerationMappingTransformation>")), "'up'"),
        (system(component("a") + system(
            connectors=connector("u", "input") + connector("y", "output"),
            connections=connection("u", "y"), name="s"),
            connection("s.y", "s.u") + connection("s.y", "a.u")), "circle"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_said_by_name(read: Read, text: str, why: str):
    assert mentions(problem(read, text), why)


def test_a_parameter_set_without_xml_is_named_once(read: Read):
    text = problem(read, system(component("a", bindings=binding(source="s.ssv"))), s__ssv="k = 1")
    assert text.count("test.ssp") == 1 and mentions(text, "s.ssv XML")


def test_all_problems_are_collected(read: Read):
    findings = Findings()
    with pytest.raises(InputError, match="2 more"):
        read(system(component("a", "b.fmu") + component("c", "d.fmu") + component("e/f")), findings)
    assert len(findings.problems) == 3


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (system(component("a", bindings=binding({"n": 'Real value="1"', "o": 'Real value="1"'}))),
         "a n, o"),
        (system(component("a", bindings=binding({"c": 'Real value="1"'}))),
         "a.c local"),
        (system(component("a", bindings=binding({"u": 'Real value="1"'})),
                connection("a.y", "a.u")),
         "a.u a.y"),
        (system(component("a"), connectors=connector("U", "input"),
                bindings=binding({"U": 'Real value="1"'})),
         "U"),
        (system(component("a", "m.fmu", binding({"k": 'Real value="1" unit="[m]"'}))),
         "[m] m"),
        (system(component("a").replace("><", f"><ssd:Connectors>{connector('n', 'input')}"
                                       "</ssd:Connectors><", 1)),
         "a: n"),
        (system(component("a").replace("><", f"><ssd:Connectors>{connector('y', 'input')}"
                                       "</ssd:Connectors><", 1)),
         "a.y input output"),
        (system(component("a", delay="1")),
         "1 'Component' 'delay'"),
    ],
)  # fmt: skip
def test_what_is_harmless_is_a_note_and_a_problem_for_the_strict(read: Read, text: str, why: str):
    [note] = notes(read, text)
    assert mentions(note, why)
    with pytest.raises(InputError) as error:
        read(text, Findings(strict=True))
    assert note in str(error.value)


def test_valid_files_have_no_findings(read: Read):
    top = system(component("a", bindings=binding({"k": 'Real value="1"'})) + component("b"),
                 connection("a.y", "b.u"))  # fmt: skip
    assert notes(read, top) == []


def _array(name: str, kind: str, *sizes: int) -> str:
    """A connector of SSP 2.0 for an array."""
    lengths = "".join(f'<ssc:Dimension size="{size}"/>' for size in sizes)
    stated = connector(name, kind, type_="Float64")
    return stated.replace("</ssd:Connector>", f"{lengths}</ssd:Connector>")


def test_arrays_are_connected_element_by_element_through_systems(read: Read):
    inner = system(
        component("c", "3.fmu"), connection("in", "c.u") + connection("c.y", "out"),
        _array("in", "input", 3) + _array("out", "output", 3), name="inner",
    )  # fmt: skip
    text = system(
        component("a", "3.fmu") + inner + component("b", "3.fmu") + component("d"),
        connection("a.y", "inner.in") + connection("inner.out", "b.u")
        + connection("inner.out", "b.x", startIndices="2")
        + connection("a.z", "a.u", endIndices="3") + connection("a.z", "d.u")
        + connection("d.y", "a.x"),
    )  # fmt: skip
    findings = Findings()
    found = read(text, findings, version="2.0")
    assert routes(found) == {
        **{f"inner.c.u[{n}]": f"a.y[{n}]" for n in (1, 2, 3)},
        **{f"b.u[{n}]": f"inner.c.y[{n}]" for n in (1, 2, 3)},
        "b.x": "inner.c.y[2]", "a.u[3]": "a.z", "d.u": "a.z", "a.x": "d.y",
    }  # fmt: skip
    assert findings.notes == []


def test_values_of_arrays_and_of_the_types_of_fmi_3(read: Read):
    values = {
        "B": 'Float64 value="1 2\n3 4"/><ssc:Dimension size="2"/><ssc:Dimension size="2"',
        "c.s": 'String><ssv:Value value="x y"/><ssv:Value value=""/></ssv:String>'
        '<ssc:Dimension size="2"',
        "c.u": 'Float64 value="0.5 1.5 2.5"/><ssc:Dimension size="3"',
        "c.i": 'Int64 value="9007199254740993"',
        "c.n": 'UInt64 value="3"',
        "c.k": 'Int32 value="-5"',
    }
    renamed = mapping(
        'source="B" target="c.A"|<ssc:LinearTransformation factor="2"/>',
        *(f'source="{name}" target="{name}"' for name in values if name != "B"),
    )
    bindings = binding(source="s.ssv", mapped=renamed)
    findings = Findings()
    text = system(component("c", "3.fmu"), bindings=bindings)
    found = read(text, findings, version="2.0", s__ssv=parameter_set(values, "2.0"))
    assert parameters(found) == {
        "c.A[1,1]": 2.0, "c.A[1,2]": 4.0, "c.A[2,1]": 6.0, "c.A[2,2]": 8.0,
        "c.s[1]": "x y", "c.s[2]": "", "c.u[1]": 0.5, "c.u[2]": 1.5, "c.u[3]": 2.5,
        "c.i": 9007199254740993, "c.k": -5,
    }  # fmt: skip
    assert findings.notes == []


_TWO = '/><ssc:Dimension size="2"'


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (system(component("a", "3.fmu"), connection("a.c", "a.b")), "a c Binary"),
        (system(component("a", "3.fmu"), connection("a.z", "a.t")), "a t Clock"),
        (system(component("a", "3.fmu"), connection("a.z", "a.u")), "a.z a.u dimensions"),
        (system(component("a", "3.fmu"), connection("a.z", "a.v")), "Float64 Float32"),
        (system(component("a", "3.fmu"), connection("a.y", "a.x", startIndices="4")), "y[4]"),
        (system(component("a", "3.fmu"), connection("a.y", "s"), _array("s", "output", 2)),
         "a.y s dimensions"),
        (system(component("a", "3.fmu"), connectors=_array("s", "input", 0)), "top.s array"),
        (system(component("a", "3.fmu"), connectors=_array("s", "input", 10**9, 10**9)), "top.s"),
        (system(component("a", "3.fmu"), connectors=_array("s", "input", 3).replace(
            'size="3"', 'sizeConnector="n"')), "top.s size stated"),
        *(
            (system(component("a", "3.fmu", binding({name: value}))), why)
            for name, value, why in (
                ("u", 'Float64 value="1"', "a.u 1 values 3"),
                ("u", f'Float64 value="1 2"{_TWO}', "a.u 2 values 3"),
                ("A", f'Float64 value="1 2"{_TWO}', "a.A 2 values 4"),
                ("x", f'Float64 value="1 2"{_TWO}', "a.x 2 values 1"),
                ("u", f'Float64 value="1 2 3"{_TWO}', "a u 3 values 2"),
                ("u", 'Float64 value="1"/><ssc:Dimension', "u size"),
                ("n", 'UInt64 value="4"', "a.n 4 sizes"),
                ("b", 'Binary value="00"', "a.b Binary"),
                ("k", 'Int64 value="2147483648"', "a.k 2147483647"),
            )
        ),
    ],
)  # fmt: skip
def test_what_of_ssp_2_cannot_be_run_is_said_by_name(read: Read, text: str, why: str):
    assert mentions(problem(read, text, version="2.0"), why)


#: Ports of the component, and connectors of the system around it.
PORTS, CONNECTORS = 6, 8

TRANSFORMATIONS = (
    "",
    '<ssc:LinearTransformation factor="0.3" offset="0.1"/>',
    '<ssc:LinearTransformation factor="1.7"/>',
    '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
    "</ssc:IntegerMappingTransformation>",
)

units = st.sampled_from(["", "m", "mm", "km", "K", "furlong"])


class OneByOne(reader._Ports):
    """Follows each port by itself, and transforms its value from the beginning."""

    def __init__(self, archive, leaves, segments, given) -> None:
        self.connections, self.parameters = [], {}
        self._archive, self._leaves, self._given = archive, leaves, given
        used: set[Node] = set()
        for node in dict.fromkeys((*segments, *given)):
            leaf = leaves.get(node.way)
            if leaf is not None and leaf.component is not None:
                port = PortName(leaf.component.name, node.port)
                try:
                    self._follow(port, node, leaf, segments, used)
                except InputError as error:
                    archive.problem(error)
        lost = [str(node) for node in given if node not in used]
        if lost:
            archive.note(f"values that are given to {reader.listed(lost)} reach no component")

    def _follow(self, port, node, leaf, segments, used) -> None:
        nodes, ways = [node], []
        while (segment := segments.get(nodes[0])) is not None:
            if segment.source in nodes:
                raise InputError(f"{node}: the connections that feed it form a circle")
            nodes.insert(0, segment.source)
            ways.insert(0, segment)

        def carried(unit, first=0):
            whole = None
            for segment in ways[first:]:
                whole, unit = segment.carry(self._archive, whole, unit)
            return whole

        origin = self._leaves.get(nodes[0].way) if ways else None
        used.update(nodes[1:] if origin else nodes)
        if origin is not None:
            for passed in nodes[1:]:
                if passed in self._given:
                    self._archive.note(
                        f"{passed}: is fed by {nodes[0]}, and the value that is given to it has "
                        "no effect"
                    )
            source = PortName(origin.component.name, nodes[0].port)
            try:
                whole = carried(origin.connector(source.port).unit)
            except InputError as error:
                raise InputError(f"{source} -> {port}: {error}") from None
            self.connections.append(Connection(source, port, whole))
            return
        for i, start in enumerate(nodes):
            if start in self._given:
                value, known = self._given[start]
                try:
                    first = value.transformation(self._archive, known)
                    whole = combine(first, carried(known.unit or value.unit, i))
                except InputError as error:
                    raise InputError(f"{start}: {error}") from None
                self._set(port, leaf, reader._Arrival(start, whole=whole))
                return


def read_with(path: Path, ports: type[reader._Ports]):
    """Read an archive and return the result, right or wrong."""
    findings = Findings()
    with patch.object(reader, "_Ports", ports), findings.collecting():
        found = reader.read_ssp(path, findings=findings)
        return found.connections, found.parameters, sorted(findings.notes)
    return findings.problems, sorted(findings.notes)


@st.composite
def descriptions(draw) -> str:
    """A component in a system with connectors, any of which may feed any other once."""
    inner = [f"c{i}" for i in range(CONNECTORS)]
    ports = [f"a.u{i}" for i in range(PORTS)]
    routes = []
    for target in draw(st.permutations([*inner, *ports])):
        source = draw(st.sampled_from(["", *inner, *inner, "a.y0", "a.y1"]))
        if source:
            inside = draw(st.sampled_from(TRANSFORMATIONS[:1] * 4 + TRANSFORMATIONS))
            more = draw(st.sampled_from([{}, {}, {"suppressUnitConversion": "true"}]))
            routes.append(connection(source, target, inside, **more))
    values = dict.fromkeys(
        draw(st.lists(st.sampled_from([*inner, *ports]), max_size=5, unique=True)), 'Real value="3"'
    )
    return described(
        system(
            system(
                component("a"),
                "".join(routes),
                "".join(connector(name, "inout", draw(units)) for name in inner),
                name="inner",
                bindings=binding(values) if values else "",
            )
        )
    )


@settings(max_examples=150)
@given(description=descriptions(), unit=st.sampled_from(["m", "K", ""]))
def test_ports_get_what_each_gets_that_is_followed_by_itself(description: str, unit: str):
    with tempfile.TemporaryDirectory() as folder:
        file = fmu(
            Path(folder, "a.fmu"),
            *(variable(f"u{i}", "input", unit=unit) for i in range(PORTS)),
            *(variable(f"y{i}", "output", unit=unit) for i in range(2)),
        )
        path = archive(Path(folder, "x.ssp"), description, {"a.fmu": file})
        assert read_with(path, reader._Ports) == read_with(path, OneByOne)


def test_long_way_to_many_ports_is_gone_once(tmp_path: Path):
    """Followed port by port, it would take hours."""
    n = 3000
    chain = [f"c{i}" for i in range(n)]
    ports = [f"a.u{i}" for i in range(n)]
    routes = [connection("a.y", "c0"), *(connection(*pair) for pair in pairwise(chain))]
    routes += [connection(chain[-1], port) for port in ports]
    file = fmu(
        tmp_path / "a.fmu",
        variable("y", "output"),
        *(variable(f"u{i}", "input") for i in range(n)),
    )
    text = described(
        system(component("a"), "".join(routes), "".join(connector(c, "inout") for c in chain))
    )
    found = reader.read_ssp(archive(tmp_path / "x.ssp", text, {"a.fmu": file}))
    assert found.connections == tuple(
        Connection(PortName("a", "y"), PortName("a", f"u{i}")) for i in range(n)
    )
