"""modelDescription.xml of a few ports, and what the versions of FMI require for them."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from xml.etree import ElementTree

from hypothesis import example, given
from hypothesis import strategies as st

from auv_fmu import __version__
from fmus.ports.definition import DefaultExperiment, Model, Origin
from fmus.ports.description import (
    complete,
    dependencies,
    fmi3_build_description,
    fmi3_description,
    value_attributes,
    variables_of,
)
from fmus.ports.port import FAULT, TIME, Array, Port
from orchestrator.machine.compilers import TARGETS

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


def test_description_of_fmi_2_follows_from_the_ports():
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
    names = ["start", "min", "max", "unit"]
    assert [
        [value_attributes(port).get(name) for name in names] for port in ports[:2]
    ] == [["3", "-5", None, None], ["true", None, None, None]]  # fmt: skip


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3).map(sorted))
@example([-0.0, 0.1 + 0.2, pi / 2])
def test_numbers_are_read_back_bit_for_bit(numbers: list[float]):
    low, start, high = numbers
    attributes = value_attributes(Port("k", "input", *REAL, "Gain", "1", start, low, high))
    read = [float(attributes[name]).hex() for name in ("min", "start", "max")]
    assert read == [low.hex(), start.hex(), high.hex()]


# FMI 3.0

PORTS_3 = (
    Port("a.x", "input", *REAL, "Place: x", "m", 0.0),
    Port("y.x", "output", *REAL, "Output: x", "m", feedthrough=("a.x", "time")),
    Port("k", "parameter", "tunable", "Real", "Gain", "1", 0.25, 0.0, 1e3),
    Port("n", "parameter", "fixed", "Integer", "Number", start=-3),
    Port("on", "parameter", "fixed", "Boolean", "Switch", start=True),
    Port(
        "kind",
        "parameter",
        "fixed",
        "Enumeration",
        "Kind",
        start=1,
        choices={"soft": 1, "hard": 4},
        enumeration="Kind",
    ),
)

DESCRIPTION_3 = """
<fmiModelDescription fmiVersion="3.0" modelName="It" instantiationToken="{1}"
  description="A thing. From a book" author="Me" version="1.2" license="MIT"
  generationTool="auv-fmu VERSION"
  variableNamingConvention="structured">
  <CoSimulation modelIdentifier="It" needsExecutionTool="false"
    canBeInstantiatedOnlyOncePerProcess="false" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <UnitDefinitions>
    <Unit name="1"><BaseUnit factor="1"/></Unit>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="s"><BaseUnit s="1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <Float64Type name="Dimensionless" quantity="Dimensionless" unit="1"/>
    <Float64Type name="Length" quantity="Length" unit="m"/>
    <Float64Type name="Time" quantity="Time" unit="s"/>
    <EnumerationType name="Kind"><Item name="soft" value="1"/><Item name="hard" value="4"/>
    </EnumerationType>
  </TypeDefinitions>
  <LogCategories>
    <Category name="logStatusWarning" description="Log messages with fmi3Warning status."/>
    <Category name="logStatusDiscard" description="Log messages with fmi3Discard status."/>
    <Category name="logStatusError" description="Log messages with fmi3Error status."/>
    <Category name="logStatusFatal" description="Log messages with fmi3Fatal status."/>
    <Category name="logAll" description="Log all messages."/>
  </LogCategories>
  <DefaultExperiment startTime="0.0" stopTime="3600.0" stepSize="10.0"/>
  <ModelVariables>
    <Float64 name="a.x" valueReference="1" description="Place: x" causality="input"
      variability="continuous" declaredType="Length" unit="m" start="0"/>
    <Float64 name="y.x" valueReference="2" description="Output: x" causality="output"
      variability="continuous" initial="calculated" declaredType="Length" unit="m"/>
    <Float64 name="k" valueReference="3" description="Gain" causality="parameter"
      variability="tunable" initial="exact" declaredType="Dimensionless" unit="1" start="0.25"
      min="0" max="1000"/>
    <Int32 name="n" valueReference="4" description="Number" causality="parameter"
      variability="fixed" initial="exact" start="-3"/>
    <Boolean name="on" valueReference="5" description="Switch" causality="parameter"
      variability="fixed" initial="exact" start="true"/>
    <Enumeration name="kind" valueReference="6" description="Kind" causality="parameter"
      variability="fixed" initial="exact" declaredType="Kind" start="1"/>
    <Boolean name="fault" valueReference="7" description="FAULT" causality="output"
      variability="discrete" initial="calculated"/>
    <Float64 name="time" valueReference="8" description="Time" causality="independent"
      variability="continuous" declaredType="Time" unit="s"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="2" dependencies="1 8" dependenciesKind="dependent dependent"/>
    <Output valueReference="7" dependencies="" dependenciesKind=""/>
    <InitialUnknown valueReference="2" dependencies="1 8 3 4 5 6"
      dependenciesKind="dependent dependent dependent dependent dependent dependent"/>
    <InitialUnknown valueReference="7" dependencies="" dependenciesKind=""/>
  </ModelStructure>
</fmiModelDescription>
""".replace("FAULT", FAULT.description).replace("VERSION", __version__)

BUILD = """
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="It" platform="x86_64-linux">
    <SourceFileSet language="C99"><SourceFile name="fmi3.c"/></SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
  <BuildConfiguration modelIdentifier="It" platform="aarch64-linux">
    <SourceFileSet language="C99"><SourceFile name="fmi3.c"/></SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
  <BuildConfiguration modelIdentifier="It" platform="x86_64-windows">
    <SourceFileSet language="C99"><SourceFile name="fmi3.c"/></SourceFileSet>
  </BuildConfiguration>
  <BuildConfiguration modelIdentifier="It" platform="x86_64-darwin">
    <SourceFileSet language="C99"><SourceFile name="fmi3.c"/></SourceFileSet>
  </BuildConfiguration>
  <BuildConfiguration modelIdentifier="It" platform="aarch64-darwin">
    <SourceFileSet language="C99"><SourceFile name="fmi3.c"/></SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def canonical(content: str | bytes) -> str:
    return ElementTree.canonicalize(content, strip_text=True)


def test_description_of_fmi_3_follows_from_the_ports():
    origin = Origin("Me", "MIT", "1.2", "From a book")
    experiment = DefaultExperiment(3600.0, 10.0)
    model = Model("It", "A thing", origin, PORTS_3, experiment)
    found = fmi3_description(model, "{1}")
    assert canonical(found) == canonical(DESCRIPTION_3)


def test_build_description_names_the_one_file():
    assert canonical(fmi3_build_description("It")) == canonical(BUILD)
    named = [element.get("platform") for element in ElementTree.fromstring(BUILD)]
    assert named == [*TARGETS], "each machine that libraries are built for, once"


def test_arrays_have_the_dependencies_of_their_elements():
    arrays = [Array(name, f"The {name}", (2,)) for name in "uy"]
    ports = (
        *(Port(f"u.{k}", "input", *REAL, f"The u: {k}", "m", 0.5, array=arrays[0]) for k in "ab"),
        Port("k", "parameter", "fixed", "Real", "Gain", "1", 1.0),
        *(
            Port(f"y.{k}", "output", *REAL, f"The y: {k}", "m", None, feedthrough=through,
                 initially=at, array=arrays[1])
            for k, through, at in (("a", ("u.a", "time"), ()), ("b", (), ("u.b",)))
        ),
    )  # fmt: skip
    found = variables_of((*ports, TIME), arrays=True)
    assert [(whole.reference, whole.port.name, len(whole.elements)) for whole in found] == [
        (1, "u", 2), (3, "k", 1), (4, "y", 2), (6, "time", 1),
    ]  # fmt: skip
    assert found[2].port.description == "The y"
    assert (found[2].port.feedthrough, found[2].port.initially) == (("u", "time"), ())
    assert [variable.port for variable in variables_of(ports)] == [
        replace(port, array=None) for port in ports
    ]
