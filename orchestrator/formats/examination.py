"""FMUs examined without loading them: what is wrong with them, and what they cannot do."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from xml.etree import ElementTree

from fmpy.model_description import ModelVariable
from fmpy.validation import validate_fmu

from orchestrator.formats.ssp.archive import listed
from orchestrator.machine.archives import unpacked
from orchestrator.machine.errors import Findings, InputError, reason
from orchestrator.system.component import Component, read_component
from orchestrator.system.names import PortName
from orchestrator.system.structure import System

#: What surprises the user of an FMU, by the flag of its description and what that is then.
_SURPRISES = {
    ("canBeInstantiatedOnlyOncePerProcess", True): "one instance a process: a further one gets a "
    "process of its own",
    ("needsExecutionTool", True): "needs the program that it was made with",
    ("canHandleVariableCommunicationStepSize", False): "takes steps of one length only: the stop "
    "time must be a multiple of the step",
    ("canRunAsynchronuously", True): "may compute a step while its host goes on",
    ("canGetAndSetFMUstate", False): "gives no state: a run of it cannot be resumed",
}


def examine(fmu: Path, findings: Findings) -> Component | None:
    """Take note of all that is wrong with an FMU.

    Args:
        fmu: the file.
        findings: take it.

    Returns:
        The FMU; None: it is none that can be run.

    """
    with findings.collecting():
        # What is read of a description with references to nothing depends on the reader.
        for text in list(_dangling(fmu)) or _flaws(fmu):
            findings.note(text)
        component = read_component(fmu.stem, fmu)
        for name in component.variables:
            try:
                component.start(name)
            except InputError as error:
                findings.note(f"start value of {error}")
        seen: dict[tuple[str, int], str] = {}
        for variable in (*component.having("input"), *component.having("parameter")):
            other = seen.setdefault((variable.type, variable.valueReference), variable.name)
            if other != variable.name:
                findings.note(f"{other} and {variable.name} are one: to set one sets both")
        return component
    return None


def surprises(component: Component) -> Iterator[str]:
    """What an FMU cannot do, or does in another way than most."""
    for (flag, value), text in _SURPRISES.items():
        if getattr(component.description.coSimulation, flag) is value:
            yield text
    if component.having("input") and all(
        unknown.dependencies is None for unknown in component.description.outputs
    ):
        yield "does not say what its outputs depend on: each is taken to depend on all inputs"


def open_inputs(system: System, settled: Collection[PortName] = ()) -> str | None:
    """The inputs that nothing feeds or sets, in words, with wires that could feed them.

    Args:
        system: that is looked at.
        settled: inputs that are set during a run.

    Returns:
        One line; None: there is no such input.

    """
    fed = {connection.target for connection in system.connections}
    taken = {*fed, *system.parameters, *system.left_open, *settled}
    labels: list[str] = []
    wires: list[str] = []
    for name, component in system.components.items():
        groups: dict[str, list[ModelVariable]] = {}
        for variable in component.having("input"):
            groups.setdefault(variable.name.rpartition(".")[0], []).append(variable)
        for group, members in groups.items():
            found = [v for v in members if PortName(name, v.name) not in taken]
            if not group or len(found) < len(members):
                labels += [f"{name}.{variable.name}" for variable in found]
                continue
            labels.append(f"{name}.{group}.*")
            sources = [
                other
                for other, source in system.components.items()
                if other != name and all(_could_feed(source, variable) for variable in members)
            ]
            if len(sources) == 1:
                wires.append(f'"{name}.{group}" = "{sources[0]}.{group}"')
    if not labels:
        return None
    wanted = f"; wire {listed(wires)}" if wires else ""
    return f"nothing feeds or sets {listed(labels)}{wanted}"


def _could_feed(source: Component, variable: ModelVariable) -> bool:
    """Whether a component has an output of the name and type of an input."""
    output = source.variables.get(variable.name)
    return output is not None and (output.causality, output.type) == ("output", variable.type)


def _flaws(fmu: Path) -> list[str]:
    """What the standard's schema and rules have against the description."""
    if not (unpacked(fmu).folder / "modelDescription.xml").is_file():
        # What reads the FMU says so.
        return []
    try:
        return [str(problem) for problem in validate_fmu(str(fmu))]
    except Exception as error:
        return [reason(error)]


def _dangling(fmu: Path) -> Iterator[str]:
    """References in the structure of the model to variables that do not exist."""
    try:
        root = ElementTree.parse(unpacked(fmu).folder / "modelDescription.xml").getroot()
    except (OSError, ElementTree.ParseError):
        return
    known = range(1, 1 + len(root.findall("ModelVariables/ScalarVariable")))
    for unknown in root.iterfind("ModelStructure//Unknown"):
        for index in (unknown.get("index", ""), *unknown.get("dependencies", "").split()):
            if not (index.isascii() and index.isdecimal()) or int(index) not in known:
                yield f"its model structure names variable {index!r}; there are {len(known)}"
