"""Systems of small FMUs in C."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from zipfile import ZipFile

from orchestrator.system.component import read_component
from orchestrator.system.names import port_name
from orchestrator.system.structure import Connection, System
from support.compiled import library_of

_SOURCE = Path(__file__).with_name("relay.c")

#: Ports in the order of the C source: outputs after two inputs, then parameters.
INPUTS, OUTPUTS, PARAMETERS = ("u", "v"), ("g", "y", "t", "h"), ("a", "c")

_VARIABILITY = {"input": "continuous", "output": "continuous", "parameter": "fixed"}
_START = {"input": ' start="0"', "output": "", "parameter": ' start="0"'}


def _description(declares: bool, step: float | None) -> str:
    causes = [*(("input", name) for name in INPUTS), *(("output", name) for name in OUTPUTS)]
    causes += [("parameter", name) for name in PARAMETERS]
    variables = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{_VARIABILITY[causality]}"><Real{_START[causality]}/></ScalarVariable>'
        for reference, (causality, name) in enumerate(causes)
    )
    # Only g follows from an input, the first one, at once.
    said = [' dependencies="1"', *[' dependencies=""'] * 3] if declares else [""] * 4
    unknowns = "".join(f'<Unknown index="{3 + i}"{text}/>' for i, text in enumerate(said))
    experiment = "" if step is None else f'<DefaultExperiment stepSize="{step}"/>'
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="Relay" guid="relay">'
        '<CoSimulation modelIdentifier="relay" canHandleVariableCommunicationStepSize="true"/>'
        f"{experiment}<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )


def relay(folder: Path, declares: bool = True, step: float | None = None) -> Path:
    """The FMU.

    Args:
        folder: for it.
        declares: whether it says what its outputs depend on.
        step: that it was made for [s].

    """
    fmu = folder / f"relay-{declares:d}-{step}.fmu"
    if not fmu.exists():
        with ZipFile(fmu, "w") as archive:
            archive.writestr("modelDescription.xml", _description(declares, step))
            archive.writestr("binaries/linux64/relay.so", library_of(_SOURCE, "-ffp-contract=off"))
    return fmu


def system_of(
    fmus: Mapping[str, Path],
    wires: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
    **others: object,
) -> System:
    """A system of such FMUs.

    Args:
        fmus: by the names of the components.
        wires: sources by targets.
        parameters: by `component.parameter`.
        others: further attributes of the system.

    """
    components = {name: read_component(name, fmu) for name, fmu in fmus.items()}
    connections = tuple(Connection(port_name(s), port_name(t)) for t, s in (wires or {}).items())
    values = {port_name(name): value for name, value in (parameters or {}).items()}
    system = System("relays", components, connections, **others)  # type: ignore[arg-type]
    return system.with_parameters(values)
