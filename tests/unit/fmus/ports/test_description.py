"""modelDescription.xml of a few ports, compared with FMI 2.0."""

from __future__ import annotations

from math import pi
from xml.etree import ElementTree

from hypothesis import example, given
from hypothesis import strategies as st

from fmus.ports.description import complete, dependencies, value_attributes
from fmus.ports.port import FAULT, Port

REAL = ("continuous", "Real")
PORTS = (
    Port("a.x", "input", *REAL, "Place: x", "m", 0.0),
    Port("b[1]", "input", *REAL, "Force: 1", "N", 0.0),
    Port("y.x", "output", *REAL, "Output: x", "m", feedthrough=("b[1]",)),
    Port("k", "parameter", "tunable", "Real", "Gain", "1", 0.25, 0.0, 1e3),
    Port("big", "parameter", "fixed", "Real", "Large", "1", 1.25e300),
    Port("n", "parameter", "fixed", "Integer", "Number", start=-3),
    Port("on", "parameter", "fixed", "Boolean", "Switch", start=True),
    Port(
        "kind", "parameter", "fixed", "Enumeration", "Kind", start=1,
        choices={"soft": 1, "hard": 4}, enumeration="Kind",
    ),
    FAULT,
)  # fmt: skip

BEFORE = """
<fmiModelDescription guid="1">
  <CoSimulation modelIdentifier="it" canGetAndSetFMUstate="false"/>
  <ModelVariables><ScalarVariable name="of another"/></ModelVariables>
  <ModelStructure><Outputs/></ModelStructure>
</fmiModelDescription>
"""

AFTER = """
<fmiModelDescription guid="1">
  <CoSimulation modelIdentifier="it" needsExecutionTool="false"
    canBeInstantiatedOnlyOncePerProcess="false" canNotUseMemoryManagementFunctions="true"
    canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    canSerializeFMUstate="true"/>
  <UnitDefinitions>
    <Unit name="1"><BaseUnit factor="1"/></Unit>
    <Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
    <Unit name="m"><BaseUnit m="1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Dimensionless"><Real quantity="Dimensionless" unit="1"/></SimpleType>
    <SimpleType name="Force"><Real quantity="Force" unit="N"/></SimpleType>
    <SimpleType name="Length"><Real quantity="Length" unit="m"/></SimpleType>
    <SimpleType name="Kind"><Enumeration>
      <Item name="soft" value="1"/><Item name="hard" value="4"/>
    </Enumeration></SimpleType>
  </TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="a.x" valueReference="0" description="Place: x" causality="input"
      variability="continuous"><Real declaredType="Length" unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="b[1]" valueReference="1" description="Force: 1" causality="input"
      variability="continuous"><Real declaredType="Force" unit="N" start="0"/></ScalarVariable>
    <ScalarVariable name="y.x" valueReference="2" description="Output: x" causality="output"
      variability="continuous" initial="calculated"><Real declaredType="Length" unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="k" valueReference="3" description="Gain" causality="parameter"
      variability="tunable" initial="exact"><Real declaredType="Dimensionless" unit="1"
      start="0.25" min="0" max="1000"/></ScalarVariable>
    <ScalarVariable name="big" valueReference="4" description="Large" causality="parameter"
      variability="fixed" initial="exact"><Real declaredType="Dimensionless" unit="1"
      start="1.25e+300"/></ScalarVariable>
    <ScalarVariable name="n" valueReference="5" description="Number" causality="parameter"
      variability="fixed" initial="exact"><Integer start="-3"/></ScalarVariable>
    <ScalarVariable name="on" valueReference="6" description="Switch" causality="parameter"
      variability="fixed" initial="exact"><Boolean start="true"/></ScalarVariable>
    <ScalarVariable name="kind" valueReference="7" description="Kind" causality="parameter"
      variability="fixed" initial="exact"><Enumeration declaredType="Kind" start="1"/>
    </ScalarVariable>
    <ScalarVariable name="fault" valueReference="8" description="FAULT" causality="output"
      variability="discrete" initial="calculated"><Boolean/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="3" dependencies="2" dependenciesKind="dependent"/>
      <Unknown index="9" dependencies="" dependenciesKind=""/>
    </Outputs>
    <InitialUnknowns>
      <Unknown index="3" dependencies="2 4 5 6 7 8"
        dependenciesKind="dependent dependent dependent dependent dependent dependent"/>
      <Unknown index="9" dependencies="" dependenciesKind=""/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
""".replace("FAULT", FAULT.description)


def test_description_says_what_the_ports_are():
    found = ElementTree.tostring(complete(ElementTree.fromstring(BEFORE), PORTS), "unicode")
    expected, actual = (ElementTree.canonicalize(xml, strip_text=True) for xml in (AFTER, found))
    assert actual == expected


def test_integers_and_truth_values_depend_as_reals_do():
    """All but `fault`, which is false at the start."""
    ports = (
        Port("k", "input", "discrete", "Integer", "Number", start=3, minimum=-5),
        Port("on", "input", "discrete", "Boolean", "Switch", start=True),
        Port("n", "output", "discrete", "Integer", "Number", feedthrough=("k",)),
        Port("full", "output", "discrete", "Boolean", "Whether", initially=("on",)),
        Port("gain", "parameter", "fixed", "Real", "Gain", "1", 1.0),
        FAULT,
    )
    assert [*dependencies(ports)] == [(3, [1], [1, 5]), (4, [], [2, 5]), (6, [], [])]
    said = ["start", "min", "max", "unit"]
    assert [
        [value_attributes(port).get(name) for name in said] for port in ports[:2]
    ] == [["3", "-5", None, None], ["true", None, None, None]]  # fmt: skip


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3).map(sorted))
@example([-0.0, 0.1 + 0.2, pi / 2])
def test_numbers_are_read_back_bit_for_bit(numbers: list[float]):
    low, start, high = numbers
    said = value_attributes(Port("k", "input", *REAL, "Gain", "1", start, low, high))
    read = [float(said[name]).hex() for name in ("min", "start", "max")]
    assert read == [low.hex(), start.hex(), high.hex()]
