"""An SSP 1.0 archive as a system."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy.ssp import ssd as fmpy_ssd

from orchestrator.errors import InputError, reason
from orchestrator.system.component import read_component
from orchestrator.system.names import PortName, port_name
from orchestrator.system.ssp import OSP, SSD, STRUCTURE
from orchestrator.system.structure import Connection, System
from orchestrator.system.unpacking import unpacked
from orchestrator.system.values import real, unit_of

#: How the file of a newer version begins.
_NEWER = re.compile(rb"<(\w+:)?SystemStructureDescription\b[^>]*\bversion=[\"']2\.")

#: What is not read and would change the numbers, by the names of its elements.
_UNSUPPORTED = {
    "transformations in connections": {
        "LinearTransformation",
        "BooleanMappingTransformation",
        "IntegerMappingTransformation",
        "EnumerationMappingTransformation",
    },
    "mappings of parameters": {"ParameterMapping"},
}


def read_ssp(archive: Path) -> System:
    """Read the system in an SSP archive.

    Raises:
        InputError: the archive is missing, broken, or uses what this master cannot do.

    """
    folder = unpacked(archive)
    try:
        _check_version((folder / STRUCTURE).read_bytes())
        description = fmpy_ssd.read_ssd(str(archive))
        root = ElementTree.parse(folder / STRUCTURE).getroot()
    except Exception as error:
        raise InputError(f"{archive}: not a readable SSP: {reason(error)}") from error
    _check_supported(archive, root)
    system = description.system
    components = {}
    for element in system.elements:
        if not isinstance(element, fmpy_ssd.Component):
            raise InputError(
                f"{archive}: {element.name}: only a flat system of FMUs is supported, no nested "
                "systems or signal dictionaries"
            )
        if not re.fullmatch(r"[^/\\]+", element.name):
            raise InputError(f"{archive}: component {element.name!r}: write it without slashes")
        if element.name in components:
            raise InputError(f"{archive}: two components are named {element.name}")
        components[element.name] = read_component(element.name, _inside(archive, folder, element))
    stop_time, step = _default_experiment(archive, root)
    found = System(
        name=system.name or archive.stem,
        components=components,
        connections=tuple(_connections(archive, system)),
        stop_time=stop_time,
        step=step,
    )
    return found.with_parameters(_parameters(archive, system, found))


def _check_version(structure: bytes) -> None:
    """Refuse what the schema of SSP 1.0 would take many lines to refuse."""
    if _NEWER.search(structure):
        raise ValueError("it is an SSP 2.0; this master takes SSP 1.0 with FMUs of FMI 2.0")


def _check_supported(archive: Path, root: ElementTree.Element) -> None:
    """Refuse what is not read and would change the numbers."""
    tags = {element.tag.rpartition("}")[2] for element in root.iter()}
    for what, unsupported in _UNSUPPORTED.items():
        if tags & unsupported:
            raise InputError(f"{archive}: {what} are not supported")


def _inside(archive: Path, folder: Path, element: Any) -> Path:
    """The FMU of a component, which is in the archive."""
    fmu: Path = folder / element.source
    inside = ".." not in fmu.parts and fmu.is_relative_to(folder)
    if not inside or not fmu.is_file():
        raise InputError(f"{archive}: holds no {element.source!r} for {element.name}")
    return fmu


def _connections(archive: Path, system: Any) -> Iterator[Connection]:
    kinds = {
        (element.name, connector.name): connector.kind
        for element in system.elements
        for connector in element.connectors
    }
    for connection in system.connections:
        if connection.startElement is None or connection.endElement is None:
            raise InputError(f"{archive}: connections to the system's own ports are not supported")
        start = PortName(connection.startElement, connection.startConnector)
        end = PortName(connection.endElement, connection.endConnector)
        # The standard lets a connection be written from either end.
        backwards = kinds.get((start.component, start.port)) == "input"
        yield Connection(end, start) if backwards else Connection(start, end)


def _parameters(archive: Path, described: Any, system: System) -> dict[PortName, Any]:
    """Values of the system's own bindings, then those of its components, which win."""
    values: dict[PortName, Any] = {}
    for element in (described, *described.elements):
        for parameter, name in _bound(element):
            target = port_name(name) if element is described else PortName(element.name, name)
            unit = unit_of(system.component(target.component).variable(target.port))
            if parameter.unit and unit and parameter.unit != unit:
                raise InputError(f"{archive}: {target} is in {unit}, not in {parameter.unit}")
            values[target] = parameter.value
    return values


def _bound(element: Any) -> Iterator[tuple[Any, str]]:
    for binding in element.parameterBindings:
        for parameter_set in binding.parameterValues:
            for parameter in parameter_set.parameters:
                yield parameter, f"{binding.prefix or ''}{parameter.name}"


def _default_experiment(
    archive: Path, root: ElementTree.Element
) -> tuple[float | None, float | None]:
    """Stop time and step [s], as far as they are stated."""
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    algorithm = root.find(f".//{{{OSP}}}FixedStepAlgorithm")

    def stated(element: ElementTree.Element | None, name: str) -> float | None:
        text = None if element is None else element.get(name)
        try:
            return None if text is None else real(text)
        except ValueError:
            raise InputError(f"{archive}: {name} {text!r} is no number") from None

    if stated(experiment, "startTime"):
        raise InputError(f"{archive}: starts later or earlier than 0 s, which is not supported")
    return stated(experiment, "stopTime"), stated(algorithm, "baseStepSize")
