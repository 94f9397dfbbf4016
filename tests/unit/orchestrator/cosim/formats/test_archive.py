"""Violations of a schema are named with their line, in files of SSP 1.0 and of 2.0."""

from __future__ import annotations

import pytest

from orchestrator.cosim.formats.archive import SSC, SSD, SSM, SSV, violations
from support.texts import mentions

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
