"""Files are read by local names; what a careful reader would stumble over is a note."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from orchestrator.cosim.formats.archive import SSC, SSD, SSM, SSV, read_document, violations
from support.texts import mentions


def read(text: str) -> tuple[ElementTree.Element, list[str]]:
    notes: list[str] = []
    return read_document(text.encode(), notes.append), notes


def test_elements_bear_their_local_names_whatever_the_prefixes():
    texts = (
        f'<a:System xmlns:a="{SSD}" xmlns:b="{SSC}" name="x"><b:Real unit="m"/></a:System>',
        f'<System xmlns="{SSD}" name="x"><Real xmlns="{SSC}" unit="m"/></System>',
    )
    for text in texts:
        root, notes = read(text)
        plain = b'<System name="x"><Real unit="m" /></System>'
        assert (ElementTree.tostring(root), notes) == (plain, [])


def test_prefix_that_is_not_declared_is_a_note():
    root, notes = read(f'<System xmlns="{SSD}"><ssc:Real/></System>')
    assert [child.tag for child in root] == ["Real"]
    assert notes == ["the prefix 'ssc' is not declared"]


def test_declaration_of_a_prefix_ends_with_its_element():
    text = f'<System xmlns="{SSD}"><Real xmlns:b="{SSC}"/><b:Real/></System>'
    assert read(text)[1] == ["the prefix 'b' is not declared"]


def test_foreign_namespace_is_a_note_but_in_annotations():
    text = '<System xmlns="{}"><Annotations><x:Any xmlns:x="urn:x"/></Annotations></System>'
    assert read(text.format(SSD))[1] == []
    assert (
        "elements are in the namespace 'urn:y', which is not SSP's" in read(text.format("urn:y"))[1]
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("<a><b></a>", "not well-formed XML: mismatched tag"),
        ("", "not well-formed XML: no element found"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "it has a DOCTYPE"),
        ("<!DOCTYPE a><a/>", "it has a DOCTYPE"),
    ],
)
def test_what_is_no_xml_or_could_unfold_is_refused(text: str, why: str):
    with pytest.raises(ValueError, match=why):
        read(text)


_NAMESPACES = f'xmlns:ssd="{SSD}" xmlns:ssc="{SSC}" xmlns:ssv="{SSV}" xmlns:ssm="{SSM}"'

_METADATA = """<ssc:MetaData kind="general" type="text/plain"><ssc:Content>x<y/></ssc:Content>
<ssc:Signature role="authenticity" type="x"/></ssc:MetaData><ssc:Signature role="suitability"
type="x"/>"""

_DESCRIPTION = f"""<ssd:SystemStructureDescription {_NAMESPACES} version="2.0" name="x">
<ssd:System name="s"><ssd:Connectors>
<ssd:Connector name="a" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>
<ssd:Connector name="b" kind="local"><ssc:Float64 unit="m"/><ssc:Dimension size="3"/>
<ssc:Dimension sizeConnector="a"/><ssd:Clock name="c"/>
<ssd:ConnectorGeometry x="0" y="1" systemInnerX="1"/></ssd:Connector>
<ssd:Connector name="c" kind="unspecified"><ssc:Clock intervalVariability="triggered"/>
</ssd:Connector></ssd:Connectors>
<ssd:Elements><ssd:Component name="d" implementation="ScheduledExecution"/></ssd:Elements>
<ssd:Connections><ssd:Connection startConnector="b" startIndices="1 2" endElement="d"
 endConnector="e" endIndices="1"><ssc:IntegerMappingTransformation>
<ssc:MapEntry source="18446744073709551615" target="-9223372036854775808"/>
</ssc:IntegerMappingTransformation></ssd:Connection></ssd:Connections></ssd:System>
<ssd:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit></ssd:Units>
<ssd:DefaultExperiment stopTime="1"/>{_METADATA}
</ssd:SystemStructureDescription>"""

_VALUES = f"""<ssv:ParameterSet {_NAMESPACES} version="2.0" name="x"><ssv:Parameters>
<ssv:Parameter name="a"><ssv:Float32 value="1 2 3" unit="m"/><ssc:Dimension size="3"/>
</ssv:Parameter><ssv:Parameter name="b"><ssv:UInt64 value="18446744073709551615"/></ssv:Parameter>
<ssv:Parameter name="c"><ssv:String><ssv:Value value="x y"/></ssv:String>
<ssc:Dimension size="1"/></ssv:Parameter></ssv:Parameters>{_METADATA}</ssv:ParameterSet>"""

_MAPPING = f"""<ssm:ParameterMapping {_NAMESPACES} version="2.0">
<ssm:MappingEntry source="a" target="b"/>{_METADATA}</ssm:ParameterMapping>"""

_FILES = {
    "SystemStructureDescription": _DESCRIPTION,
    "ParameterSet": _VALUES,
    "ParameterMapping": _MAPPING,
}


@pytest.mark.parametrize("root", _FILES)
def test_words_of_ssp_2_are_valid_there_and_not_in_1(root: str):
    text = _FILES[root]
    assert violations(root, text.encode()) == []
    assert violations(root, text.replace('version="2.0"', 'version="1.0"').encode())


@pytest.mark.parametrize(
    ("root", "right", "wrong", "why"),
    [
        ("SystemStructureDescription", 'name="d"', 'named="d"', "line 9 named"),
        ("SystemStructureDescription", "<ssc:UInt64/>", "<ssc:UInt65/>", "line 3 UInt65"),
        ("SystemStructureDescription", 'stopTime="1"', 'stopTime="x"', "line 15 stopTime"),
        ("ParameterSet", 'value="1 2 3"', 'value="x 2 3"', "line 2 x"),
        ("ParameterMapping", 'target="b"', "", "line 2 target"),
    ],
)
def test_what_ssp_2_does_not_allow_is_said_with_its_line(
    root: str, right: str, wrong: str, why: str
):
    assert right in _FILES[root]
    first, *_ = violations(root, _FILES[root].replace(right, wrong).encode())
    assert mentions(first, why)
