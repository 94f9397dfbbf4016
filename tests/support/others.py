"""FMUs as tools of others make them: one source in C, compiled with one peculiarity or another."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import ZipFile

from orchestrator.master.experiment import Experiment
from orchestrator.master.fmi.isolated import Isolation
from orchestrator.master.observers.table import Table
from orchestrator.system.component import read_component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from support.compiled import library_of
from support.runs import run_table

_SOURCE = Path(__file__).with_name("others.c")

#: Ways to run a system, as arguments of :func:`run`.
WAYS = {
    "python": {"loop": "python"},
    "compiled": {"loop": "compiled"},
    "isolated": {"isolation": Isolation(20.0)},
}

_VARIABLES = """
<ScalarVariable name="u" valueReference="0" causality="input"><Real/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed">
  <Real start="1"/></ScalarVariable>
<ScalarVariable name="stubborn" valueReference="3" causality="parameter" variability="fixed">
  <Real start="1"/></ScalarVariable>
<ScalarVariable name="mode" valueReference="0" causality="input" variability="discrete">
  <Enumeration declaredType="Mode" start="1"/></ScalarVariable>
<ScalarVariable name="mode_y" valueReference="1" causality="output" variability="discrete">
  <Enumeration declaredType="Mode"/></ScalarVariable>
<ScalarVariable name="on" valueReference="0" causality="input" variability="discrete">
  <Boolean start="false"/></ScalarVariable>
<ScalarVariable name="fault" valueReference="1" causality="output" variability="discrete">
  <Boolean/></ScalarVariable>
<ScalarVariable name="count" valueReference="4" causality="parameter" variability="fixed">
  <Integer start="0"/></ScalarVariable>
<ScalarVariable name="said" valueReference="0" causality="input" variability="discrete">
  <String start="start"/></ScalarVariable>
<ScalarVariable name="heard" valueReference="1" causality="output" variability="discrete">
  <String/></ScalarVariable>
"""

#: Outputs, by their places among the variables.
_OUTPUTS = (2, 6, 8, 11)


def _description(attributes: str) -> str:
    outputs = "".join(f'<Unknown index="{index}" dependencies=""/>' for index in _OUTPUTS)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="Others" guid="others">'
        f'<CoSimulation modelIdentifier="others" {attributes}/>'
        '<TypeDefinitions><SimpleType name="Mode"><Enumeration>'
        '<Item name="calm" value="1"/><Item name="storm" value="4"/>'
        "</Enumeration></SimpleType></TypeDefinitions>"
        f"<ModelVariables>{_VARIABLES}</ModelVariables>"
        f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
    )


def build(
    folder: Path,
    peculiarity: str = "",
    attributes: str = 'canHandleVariableCommunicationStepSize="true"',
    platform: str = "linux64",
    change: tuple[str, str] = ("", ""),
) -> Path:
    """An FMU; the test is skipped where there is no compiler.

    Args:
        folder: for it.
        peculiarity: one of the names that the source looks for; none: it has none.
        attributes: of the element CoSimulation of its description.
        platform: for which its library is said to be.
        change: a text in its description, and what stands there instead.

    """
    fmu = folder / f"{peculiarity or 'plain'}.fmu"
    define = [f"-D{peculiarity}"] * bool(peculiarity)
    with ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", _description(attributes).replace(*change))
        archive.writestr(f"binaries/{platform}/others.so", library_of(_SOURCE, *define))
    return fmu


def system_of(fmu: Path, names: str = "a", wires: dict[str, str] | None = None) -> System:
    """Instances of an FMU with names of one letter, and what feeds what, by the targets."""
    connections = [
        Connection(PortName(*source.split(".")), PortName(*target.split(".")))
        for target, source in (wires or {}).items()
    ]
    components = {name: read_component(name, fmu) for name in names}
    return System("others", components, tuple(connections))


def run(
    system: System, stop_time: float = 1.0, step: float = 0.1, order: str = "jacobi", **how: Any
) -> Table:
    """All rows of a run."""
    return run_table(system, Experiment(stop_time, step, order), **how)
