from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator.formats.examination import examine, surprises
from orchestrator.machine.errors import Findings

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Odd" guid="odd">
  <CoSimulation modelIdentifier="odd" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="p" valueReference="1" causality="parameter" variability="fixed">
      <Real start="1" min="0" max="2"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="3" dependencies="1"/></Outputs>
    <InitialUnknowns><Unknown index="3"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture
def fmu(tmp_path):
    """Makes an FMU of a description in which some words are others."""

    def make(*changes: tuple[str, str]) -> Path:
        text = DESCRIPTION
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "odd.fmu"
        with ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", text)
        return path

    return make


def test_good_fmu_has_no_findings(fmu):
    findings = Findings()
    component = examine(fmu(), findings)
    assert component is not None
    assert not [*findings.problems, *findings.notes, *surprises(component)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('start="1"', 'start="3"'), "start value of odd.p = 3"),
        (('dependencies="1"', 'dependencies="1 7"'), "variable '7'"),
        (('valueReference="1"', 'valueReference="0"'), "u and p are one"),
        (('<Real start="0"/>', '<Real start="0" unit="m"/>'), 'unit "m"'),
        (('causality="output"', 'causality="output" initial="exact"'), '"y"'),
    ],
)
def test_each_mistake_is_a_note(fmu, change, said):
    findings = Findings()
    examine(fmu(change), findings)
    assert any(said in note for note in findings.notes), findings.notes


def test_all_mistakes_are_said_at_once(fmu):
    findings = Findings()
    changes = [('start="1"', 'start="3"'), ('dependencies="1"', 'dependencies="0"')]
    examine(fmu(*changes), findings)
    for word in ("odd.p", "variable '0'"):
        assert any(word in note for note in findings.notes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("CommunicationStepSize", "CommunicationStep"), "steps of one length"),
        (('canSerializeFMUstate="true"', 'needsExecutionTool="true"'), "program"),
        (('canGetAndSetFMUstate="true" canSerializeFMUstate="true"', ""), "no state"),
        ((' dependencies="1"', ""), "depend on all inputs"),
        (
            ('canSerializeFMUstate="true"', 'canBeInstantiatedOnlyOncePerProcess="true"'),
            "one instance a process",
        ),
    ],
)
def test_what_surprises_is_said_and_is_no_mistake(fmu, change, said):
    component = examine(fmu(change), Findings())
    assert component is not None
    assert any(said in text for text in surprises(component))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('fmiVersion="2.0"', 'fmiVersion="1.0"'), "2.0"),
        (("<CoSimulation", "<ModelExchange"), "co-simulation"),
    ],
)
def test_what_cannot_run_at_all_is_a_problem(fmu, change, said):
    findings = Findings()
    assert examine(fmu(change), findings) is None
    assert any(said in problem for problem in findings.problems), findings.problems


def test_what_is_no_file_is_one_problem(tmp_path):
    findings = Findings()
    assert examine(tmp_path / "none.fmu", findings) is None
    assert len(findings.problems) == 1 and not findings.notes
