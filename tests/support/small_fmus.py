"""Small FMUs that are made for tests: descriptions, and libraries from one source in C each."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import pytest

from orchestrator.cosim import Connection, PortName, System, Value, read_component

_HERE = Path(__file__).parent

_STARTS = {"Boolean": "false", "String": "x"}


def variable(
    name: str,
    reference: int | str,
    causality: str,
    kind: str = "Real",
    start: object = None,
    inside: str = "",
    **more: str,
) -> str:
    """A variable of a description.

    Args:
        name: of it.
        reference: its value reference.
        causality: of it.
        kind: its type.
        start: as text; None: zero or the like of an input or a parameter, none of an output.
        inside: further attributes of its type.
        more: attributes of its own; its variability follows from causality and type if not given.

    """
    if start is None and causality != "output":
        start = _STARTS.get(kind, "0")
    if start is not None:
        inside += f' start="{start}"'
    usual = "continuous" if kind == "Real" else "discrete"
    more.setdefault("variability", "fixed" if causality == "parameter" else usual)
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    return (
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}"'
        f"{attributes}><{kind}{inside}/></ScalarVariable>"
    )


def unknown(index: int, dependencies: str | None = None) -> str:
    """An output of the structure, by its place among the variables, from 1 on."""
    stated = "" if dependencies is None else f' dependencies="{dependencies}"'
    return f'<Unknown index="{index}"{stated}/>'


def enumeration(name: str, items: Mapping[str, int]) -> str:
    listed = "".join(f'<Item name="{item}" value="{value}"/>' for item, value in items.items())
    return f'<SimpleType name="{name}"><Enumeration>{listed}</Enumeration></SimpleType>'


def constants(source: Path, first: str) -> dict[str, int]:
    """The constants of the enumeration in a C source that begins with one, by their names."""
    found = re.search(rf"enum {{\s*({first}\b[^}}]*)}}", source.read_text(encoding="utf-8"))
    assert found is not None
    values, value = {}, 0
    for entry in found[1].rstrip(", \n").split(","):
        name, _, given = entry.partition("=")
        value = int(given or value)
        values[name.strip()] = value
        value += 1
    return values


def description(
    identifier: str,
    variables: Iterable[str],
    unknowns: Iterable[str] = (),
    attributes: str = 'canHandleVariableCommunicationStepSize="true"',
    definitions: str = "",
    experiment: str = "",
) -> str:
    """A modelDescription.xml.

    Args:
        identifier: of the model, its GUID, and, capitalised, its name.
        variables: made by :func:`variable`.
        unknowns: made by :func:`unknown`; none: the structure does not even name the outputs.
        attributes: of the element CoSimulation.
        definitions: of units and types.
        experiment: the element DefaultExperiment.

    """
    listed = "".join(unknowns)
    outputs = f"<Outputs>{listed}</Outputs>" if listed else ""
    return (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" '
        f'modelName="{identifier.capitalize()}" guid="{identifier}">'
        f'<CoSimulation modelIdentifier="{identifier}" '
        f"{attributes}/>{definitions}{experiment}<ModelVariables>\n{''.join(variables)}"
        f"</ModelVariables><ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def description_of_fmi3(
    identifier: str, variables: str, structure: str = "", attributes: str = ""
) -> str:
    """A modelDescription.xml of FMI 3.0.

    Args:
        identifier: of the model, its token, and its name.
        variables: elements in ModelVariables.
        structure: elements in ModelStructure.
        attributes: of the element CoSimulation, besides its identifier.

    """
    return (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" '
        f'modelName="{identifier}" instantiationToken="{identifier}">'
        f'<CoSimulation modelIdentifier="{identifier}" {attributes}/>'
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


@cache
def _library_of(source: Path, *options: str) -> bytes:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    with TemporaryDirectory() as folder:
        library = Path(folder, source.stem)
        common = ("-shared", "-fPIC", "-O1", "-w", "-ffp-contract=off", f"-I{_HERE}")
        files = (source, _HERE / "defaults.c", "-lm")
        subprocess.run([compiler, *common, *options, "-o", library, *files], check=True)
        return library.read_bytes()


def connected(
    name: str,
    fmus: Mapping[str, Path],
    wires: Mapping[str, str] | None = None,
    parameters: Mapping[str, Value] | None = None,
    **others: Any,
) -> System:
    """A system of FMUs.

    Args:
        name: of the system.
        fmus: by the names of the components, in their order.
        wires: sources by targets.
        parameters: by `component.parameter`.
        others: further attributes of the system.

    """
    components = {component: read_component(component, fmu) for component, fmu in fmus.items()}
    connections = tuple(
        Connection(PortName.read(s), PortName.read(t)) for t, s in (wires or {}).items()
    )
    values = {PortName.read(parameter): value for parameter, value in (parameters or {}).items()}
    return System(name, components, connections, **others).with_parameters(values)


def write(
    fmu: Path,
    text: str,
    source: Path | None = None,
    *options: str,
    resources: Mapping[str, str] = {"nothing.txt": ""},
    platform: str = "linux64",
) -> Path:
    """Write an FMU; the test is skipped where there is no compiler.

    Args:
        fmu: where.
        text: its description.
        source: of its library, whose name is the identifier; None: it has none.
        options: of the compiler.
        resources: files by their names.
        platform: for which the library is said to be.

    """
    with ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        if source is not None:
            library = _library_of(source, *options)
            archive.writestr(f"binaries/{platform}/{source.stem}.so", library)
            for name, file in resources.items():
                archive.writestr(f"resources/{name}", file)
    return fmu
