"""`auv-fmu check` reports all mistakes of a file at once, and surprises."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator.commands.check import examine, surprises
from orchestrator.machine.errors import Findings
from support.texts import mentions

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
    """Make an FMU of a description with replaced words."""

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


def lines_about(path: Path) -> list[str]:
    """Lines of `auv-fmu check` about an FMU, without its binary."""
    findings = Findings()
    component = examine(path, findings)
    assert (component is None) == bool(findings.problems)
    texts = {"problem": findings.problems, "note": findings.notes}
    texts["info"] = [] if component is None else list(surprises(component))
    return [f"{kind}: {text}" for kind in texts for text in texts[kind]]


def test_a_valid_fmu_has_no_problems(fmu):
    assert lines_about(fmu()) == []


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("note", ('start="1"', 'start="3"'), "start value odd.p 3"),
        ("note", ('dependencies="1"', 'dependencies="1 7"'), "variable '7'"),
        ("note", ('valueReference="1"', 'valueReference="0"'), "u p one"),
        ("note", ('<Real start="0"/>', '<Real start="0" unit="m"/>'), 'unit "m"'),
        ("note", ('causality="output"', 'causality="output" initial="exact"'), '"y"'),
        ("info", ("CommunicationStepSize", "CommunicationStep"), "steps fixed length"),
        ("info", ('canSerializeFMUstate="true"', 'needsExecutionTool="true"'), "program"),
        ("info", ('canGetAndSetFMUstate="true" canSerializeFMUstate="true"', ""), "no state"),
        ("info", (' dependencies="1"', ""), "depend all inputs"),
        (
            "info",
            ('canSerializeFMUstate="true"', 'canBeInstantiatedOnlyOncePerProcess="true"'),
            "one instance process",
        ),
        ("problem", ('fmiVersion="2.0"', 'fmiVersion="1.0"'), "1.0 2.0"),
        ("problem", ("<CoSimulation", "<ModelExchange"), "co-simulation"),
    ],
)
def test_mistakes_and_surprises_are_reported(fmu, kind, change, words):
    lines = [line for line in lines_about(fmu(change)) if line.startswith(f"{kind}: ")]
    assert any(mentions(line, words) for line in lines), lines


def test_all_mistakes_are_reported_at_once(fmu):
    changes = [('start="1"', 'start="3"'), ('dependencies="1"', 'dependencies="0"')]
    lines = lines_about(fmu(*changes))
    for word in ("odd.p", "variable '0'"):
        assert any(word in line for line in lines)


def test_a_missing_file_is_one_problem(tmp_path):
    [line] = lines_about(tmp_path / "none.fmu")
    assert line.startswith("problem: ")
