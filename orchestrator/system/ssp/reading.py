"""An SSP 1.0 archive as a system."""

from __future__ import annotations

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


def read_ssp(archive: Path) -> System:
    """Read the system in an SSP archive.

    Raises:
        InputError: the archive is missing, broken, or uses what this master cannot do.

    """
    folder = unpacked(archive)
    try:
        description = fmpy_ssd.read_ssd(str(archive))
    except Exception as error:
        raise InputError(f"{archive}: not a readable SSP: {reason(error)}") from error
    system = description.system
    components = {}
    for element in system.elements:
        if not isinstance(element, fmpy_ssd.Component):
            raise InputError(
                f"{archive}: {element.name}: only a flat system of FMUs is supported, no nested "
                "systems or signal dictionaries"
            )
        if not (folder / element.source).is_file():
            raise InputError(f"{archive}: holds no {element.source} for {element.name}")
        components[element.name] = read_component(element.name, folder / element.source)
    stop_time, step = _default_experiment(folder / STRUCTURE)
    found = System(
        name=system.name or archive.stem,
        components=components,
        connections=tuple(_connections(archive, system)),
        stop_time=stop_time,
        step=step,
    )
    return found.with_parameters(dict(_parameters(system)))


def _connections(archive: Path, system: Any) -> Iterator[Connection]:
    for connection in system.connections:
        if getattr(connection, "linearTransformation", None) is not None:
            raise InputError(f"{archive}: transformations in connections are not supported")
        if connection.startElement is None or connection.endElement is None:
            raise InputError(f"{archive}: connections to the system's own ports are not supported")
        start = PortName(connection.startElement, connection.startConnector)
        end = PortName(connection.endElement, connection.endConnector)
        kinds = {
            (element.name, connector.name): connector.kind
            for element in system.elements
            for connector in element.connectors
        }
        # The standard lets a connection be written from either end.
        backwards = kinds.get((start.component, start.port)) == "input"
        yield Connection(end, start) if backwards else Connection(start, end)


def _parameters(system: Any) -> Iterator[tuple[PortName, Any]]:
    """Values of the system's own bindings, then those of its components, which win."""
    for binding in system.parameterBindings:
        for parameter_set in binding.parameterValues:
            for parameter in parameter_set.parameters:
                yield port_name(f"{binding.prefix or ''}{parameter.name}"), parameter.value
    for component in system.elements:
        for binding in component.parameterBindings:
            for parameter_set in binding.parameterValues:
                for parameter in parameter_set.parameters:
                    name = f"{binding.prefix or ''}{parameter.name}"
                    yield PortName(component.name, name), parameter.value


def _default_experiment(structure: Path) -> tuple[float | None, float | None]:
    root = ElementTree.parse(structure).getroot()
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    algorithm = root.find(f".//{{{OSP}}}FixedStepAlgorithm")
    stop_time = None if experiment is None else experiment.get("stopTime")
    step = None if algorithm is None else algorithm.get("baseStepSize")
    try:
        return (
            None if stop_time is None else float(stop_time),
            None if step is None else float(step),
        )
    except ValueError as error:
        raise InputError(f"{STRUCTURE}: stop time {stop_time}, step {step}: {error}") from error
