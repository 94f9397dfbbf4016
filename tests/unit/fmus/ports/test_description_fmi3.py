"""The requirements of FMI 3.0, and the descriptions of a few ports."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

from auv_fmu import __version__
from fmus.ports.definition import DefaultExperiment, Definition, Origin
from fmus.ports.description_fmi3 import (
    fmi3_build_description,
    fmi3_description,
    terminals_and_icons,
    variables_of,
)
from fmus.ports.port import FAULT, TIME, Array, Port
from orchestrator.machine.platforms import TARGETS

REAL = ("continuous", "Real")
PORTS = (
    Port("a.x", "input", *REAL, "Place: x", "m", 0.0),
    Port("y.x", "output", *REAL, "Output: x", "m", feedthrough=("a.x", "time")),
    Port("k", "parameter", "tunable", "Real", "Gain", "1", 0.25, 0.0, 1e3),
    Port("n", "parameter", "fixed", "Integer", "Number", start=-3),
    Port("on", "parameter", "fixed", "Boolean", "Switch", start=True),
    Port(
        "kind", "parameter", "fixed", "Enumeration", "Kind", start=1,
        choices={"soft": 1, "hard": 4}, enumeration="Kind",
    ),
)  # fmt: skip

DESCRIPTION = """
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


def test_description_says_what_the_ports_are():
    nothing: Any = None
    origin = Origin("Me", "MIT", "1.2", "From a book")
    experiment = DefaultExperiment(3600.0, 10.0)
    it = Definition("It", "A thing", origin, PORTS, experiment, nothing, (), nothing)
    found = fmi3_description(it, "{1}")
    assert canonical(found) == canonical(DESCRIPTION)


def test_build_description_names_the_one_file():
    assert canonical(fmi3_build_description("It")) == canonical(BUILD)
    named = [one.get("platform") for one in ElementTree.fromstring(BUILD)]
    assert named == [*TARGETS], "each machine that libraries are built for, once"


GROUPS = (
    Port("tau.u", "input", *REAL, "Command: u", "N", 0.0),
    Port("tau.q", "input", *REAL, "Command: q", "N.m", 0.0),
    Port("y.x", "input", *REAL, "Place: x", "m", 0.0),
    Port("theta[1]", "output", *REAL, "Parameters: 1", "N"),
    Port("theta[2]", "output", *REAL, "Parameters: 2", "kg/s"),
    Port("k", "parameter", "fixed", "Real", "Gain", "1", 1.0),
)


def terminals() -> list[ElementTree.Element]:
    return [*ElementTree.fromstring(terminals_and_icons(GROUPS)).iterfind("Terminals/Terminal")]


def test_only_groups_of_inputs_and_outputs_are_terminals():
    assert [
        (
            terminal.get("name"),
            terminal.get("matchingRule"),
            [
                (member.get("variableName"), member.get("memberName"), member.get("variableKind"))
                for member in terminal.iterfind("TerminalMemberVariable")
            ],
        )
        for terminal in terminals()
    ] == [
        ("tau", "plug", [("tau.u", "u", "signal"), ("tau.q", "q", "signal")]),
        ("y", "plug", [("y.x", "x", "signal")]),
        ("theta", "bus", [("theta[1]", "1", "signal"), ("theta[2]", "2", "signal")]),
    ]


def test_inputs_are_on_the_left_and_outputs_on_the_right_of_the_icon():
    icon = ElementTree.fromstring(terminals_and_icons(GROUPS)).find("GraphicalRepresentation/Icon")
    assert icon is not None
    corners = [
        {key: int(value) for key, value in picture.attrib.items() if key in icon.attrib}
        for terminal in terminals()
        for picture in terminal.iterfind("TerminalGraphicalRepresentation")
    ]
    left, right = int(icon.attrib["x1"]), int(icon.attrib["x2"])
    upper, lower, output = corners
    assert upper["x2"] == lower["x2"] == left
    assert output["x1"] == right
    assert upper["y1"] > lower["y2"]
    assert output["y1"] == -output["y2"]


def test_arrays_have_the_dependencies_of_their_elements():
    arrays = [Array(name, f"The {name}", (2,)) for name in "uy"]
    ports = (
        *(Port(f"u.{k}", "input", *REAL, f"The u: {k}", "m", 0.5, array=arrays[0]) for k in "ab"),
        Port("k", "parameter", "fixed", "Real", "Gain", "1", 1.0),
        *(
            Port(f"y.{k}", "output", *REAL, f"The y: {k}", "m", None, feedthrough=of, initially=at,
                 array=arrays[1])
            for k, of, at in (("a", ("u.a", "time"), ()), ("b", (), ("u.b",)))
        ),
    )  # fmt: skip
    found = variables_of((*ports, TIME), arrays=True)
    assert [(it.reference, it.port.name, len(it.elements)) for it in found] == [
        (1, "u", 2), (3, "k", 1), (4, "y", 2), (6, "time", 1),
    ]  # fmt: skip
    assert found[2].port.description == "The y"
    assert (found[2].port.feedthrough, found[2].port.initially) == (("u", "time"), ())
    assert [it.port for it in variables_of(ports)] == [replace(one, array=None) for one in ports]
