"""Systems as SSP 1.0 archives: what the master runs and what other hosts open."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import BadZipFile, ZipFile, ZipInfo

from fmpy.ssp import ssd as fmpy_ssd

from orchestrator.errors import InputError
from orchestrator.system.structure import (
    Component,
    Connection,
    PortName,
    System,
    literal,
    port_name,
    read_component,
)

STRUCTURE = "SystemStructure.ssd"

_SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
_SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
_SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"

#: Name of every parameter set: ecos applies the sets of the one name that it is given.
PARAMETER_SET = "scenario"

#: Where tools draw the components: size of a box, and the distance to the next.
_BOX, _GAP = (40.0, 60.0), 30.0

#: The oldest time a zip archive can hold: the same system gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def read_ssp(archive: Path, folder: Path) -> System:
    """Read the system in an SSP archive.

    Args:
        archive: the .ssp file.
        folder: where to unpack its FMUs; the system refers to them there.

    Raises:
        InputError: the archive is missing, broken, or uses what this master cannot do.

    """
    try:
        with ZipFile(archive) as content:
            content.extractall(folder)
        description = fmpy_ssd.read_ssd(str(archive))
    except (OSError, BadZipFile) as error:
        raise InputError(f"{archive}: cannot be opened: {error}") from error
    except Exception as error:
        lines = str(error).strip().splitlines() or [repr(error)]
        raise InputError(f"{archive}: not a readable SSP: {' '.join(lines[:2])}") from error
    system = description.system
    components = {}
    for element in system.elements:
        if not isinstance(element, fmpy_ssd.Component):
            raise InputError(
                f"{archive}: {element.name}: only a flat system of FMUs is supported, no nested "
                "systems or signal dictionaries"
            )
        components[element.name] = read_component(element.name, folder / element.source)
    stop_time, step = _default_experiment(folder / STRUCTURE)
    return System(
        name=system.name or archive.stem,
        components=components,
        connections=tuple(_connections(archive, system)),
        parameters=dict(_parameters(system)),
        stop_time=stop_time,
        step=step,
    )


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
    experiment = root.find(f"{{{_SSD}}}DefaultExperiment")
    algorithm = root.find(f".//{{{_OSP}}}FixedStepAlgorithm")
    stop_time = None if experiment is None else experiment.get("stopTime")
    step = None if algorithm is None else algorithm.get("baseStepSize")
    try:
        return (
            None if stop_time is None else float(stop_time),
            None if step is None else float(step),
        )
    except ValueError as error:
        raise InputError(f"{STRUCTURE}: stop time {stop_time}, step {step}: {error}") from error


def ssp_bytes(system: System) -> bytes:
    """The archive of a system: its structure and its FMUs, the same bytes every time."""
    archive = BytesIO()
    with ZipFile(archive, "w") as content:
        content.writestr(ZipInfo(STRUCTURE, _EPOCH), structure_xml(system))
        for component in system.components.values():
            if system.parameters_of(component.name):
                values = parameter_set_xml(system, component)
                content.writestr(ZipInfo(_parameter_source(component), _EPOCH), values)
        for fmu in sorted({component.fmu for component in system.components.values()}):
            content.writestr(ZipInfo(_source(fmu), _EPOCH), fmu.read_bytes())
    return archive.getvalue()


def _source(fmu: Path) -> str:
    return f"resources/{fmu.name}"


def _parameter_source(component: Component) -> str:
    return f"parameters/{component.name}.ssv"


def parameter_set_xml(system: System, component: Component) -> bytes:
    """The values that a system sets in one component, as an SSV."""
    _register_prefixes()
    root = ElementTree.Element(f"{{{_SSV}}}ParameterSet", name=PARAMETER_SET, version="1.0")
    parameters = ElementTree.SubElement(root, f"{{{_SSV}}}Parameters")
    for name, value in system.parameters_of(component.name).items():
        variable = component.variable(name)
        element = ElementTree.SubElement(parameters, f"{{{_SSV}}}Parameter", name=name)
        ElementTree.SubElement(
            element, f"{{{_SSV}}}{variable.type}", value=literal(variable, value)
        )
    return _serialised(root)


def _register_prefixes() -> None:
    """Libcosim accepts no other prefixes than these."""
    for prefix, namespace in (("ssd", _SSD), ("ssc", _SSC), ("ssv", _SSV), ("osp", _OSP)):
        ElementTree.register_namespace(prefix, namespace)


def _serialised(root: ElementTree.Element) -> bytes:
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return content


def structure_xml(system: System) -> bytes:
    """SystemStructure.ssd; connectors and units come from the FMUs' own descriptions.

    libcosim needs its step size as an annotation.
    """
    _register_prefixes()
    root = ElementTree.Element(_ssd("SystemStructureDescription"), name=system.name, version="1.0")
    structure = ElementTree.SubElement(root, _ssd("System"), name=system.name)
    elements = ElementTree.SubElement(structure, _ssd("Elements"))
    for position, component in enumerate(system.components.values()):
        _add_component(elements, component, position, bool(system.parameters_of(component.name)))
    # The schema has no empty list of connections.
    connections = ElementTree.Element(_ssd("Connections"))
    if system.connections:
        structure.append(connections)
    for connection in system.connections:
        ElementTree.SubElement(
            connections,
            _ssd("Connection"),
            startElement=connection.source.component,
            startConnector=connection.source.port,
            endElement=connection.target.component,
            endConnector=connection.target.port,
        )
    _add_units(root, system)
    _add_experiment(root, system)
    return _serialised(root)


def _ssd(tag: str) -> str:
    return f"{{{_SSD}}}{tag}"


def _ssc(tag: str) -> str:
    return f"{{{_SSC}}}{tag}"


def _add_component(
    elements: ElementTree.Element, component: Component, position: int, has_parameters: bool
) -> None:
    element = ElementTree.SubElement(
        elements,
        _ssd("Component"),
        name=component.name,
        source=_source(component.fmu),
        type="application/x-fmu-sharedlibrary",
    )
    connectors = ElementTree.SubElement(element, _ssd("Connectors"))
    for variable in component.description.modelVariables:
        if variable.causality in ("input", "output", "parameter"):
            connector = ElementTree.SubElement(
                connectors, _ssd("Connector"), name=variable.name, kind=variable.causality
            )
            unit = {"unit": variable.unit} if variable.unit else {}
            ElementTree.SubElement(connector, _ssc(variable.type), unit)
    width, height = _BOX
    left = position * (width + _GAP)
    ElementTree.SubElement(
        element,
        _ssd("ElementGeometry"),
        {"x1": str(left), "y1": "0.0", "x2": str(left + width), "y2": str(height)},
    )
    if has_parameters:
        bindings = ElementTree.SubElement(element, _ssd("ParameterBindings"))
        ElementTree.SubElement(
            bindings,
            _ssd("ParameterBinding"),
            source=_parameter_source(component),
            type="application/x-ssp-parameter-set",
        )


def _add_units(root: ElementTree.Element, system: System) -> None:
    units = {
        unit.name: unit.baseUnit
        for component in system.components.values()
        for unit in component.description.unitDefinitions
    }
    parent = ElementTree.SubElement(root, _ssd("Units"))
    for name in sorted(units):
        element = ElementTree.SubElement(parent, _ssc("Unit"), name=name)
        exponents = {
            base: str(exponent)
            for base in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
            if (exponent := getattr(units[name], base, 0))
        }
        ElementTree.SubElement(element, _ssc("BaseUnit"), exponents)


def _add_experiment(root: ElementTree.Element, system: System) -> None:
    experiment = ElementTree.SubElement(root, _ssd("DefaultExperiment"), startTime="0.0")
    if system.stop_time is not None:
        experiment.set("stopTime", str(system.stop_time))
    if system.step is not None:
        annotations = ElementTree.SubElement(experiment, _ssd("Annotations"))
        annotation = ElementTree.SubElement(
            annotations, _ssc("Annotation"), type="com.opensimulationplatform"
        )
        algorithm = ElementTree.SubElement(annotation, f"{{{_OSP}}}Algorithm")
        ElementTree.SubElement(
            algorithm, f"{{{_OSP}}}FixedStepAlgorithm", baseStepSize=str(system.step)
        )
