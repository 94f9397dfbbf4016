"""A system as an SSP archive: 1.0, or 2.0 where there are FMUs of FMI 3.0 in it."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

from orchestrator.system.component import Component
from orchestrator.system.ssp import OSP, SSC, SSD, SSV, STRUCTURE
from orchestrator.system.structure import System
from orchestrator.system.values import literal

#: Name of every parameter set: ecos applies the sets of the one name that it is given.
PARAMETER_SET = "scenario"

#: Where tools draw the components: size of a box, and the distance to the next.
_BOX, _GAP = (40.0, 60.0), 30.0

#: The oldest time a zip archive can hold: the same system gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_ssp(system: System, folder: Path) -> list[Path]:
    """Write `NAME.ssp`; the step is part of the system."""
    path = folder / f"{system.name}.ssp"
    path.write_bytes(ssp_bytes(system))
    return [path]


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
    root = ElementTree.Element(
        f"{{{SSV}}}ParameterSet", name=PARAMETER_SET, version=_version(component)
    )
    parameters = ElementTree.SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in system.parameters_of(component.name).items():
        kind = component.variable(name).type
        element = ElementTree.SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
        ElementTree.SubElement(element, f"{{{SSV}}}{kind}", value=literal(value))
    return _serialised(root)


def _register_prefixes() -> None:
    """Libcosim accepts no other prefixes than these."""
    for prefix, namespace in (("ssd", SSD), ("ssc", SSC), ("ssv", SSV), ("osp", OSP)):
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
    root = ElementTree.Element(
        _ssd("SystemStructureDescription"),
        name=system.name,
        version=max(map(_version, system.components.values())),
    )
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


def _version(component: Component) -> str:
    """The first version of SSP that has words for the types of a component's ports."""
    return "1.0" if component.description.fmiVersion == "2.0" else "2.0"


def _ssd(tag: str) -> str:
    return f"{{{SSD}}}{tag}"


def _ssc(tag: str) -> str:
    return f"{{{SSC}}}{tag}"


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
    if not units:
        return
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
        algorithm = ElementTree.SubElement(annotation, f"{{{OSP}}}Algorithm")
        ElementTree.SubElement(
            algorithm, f"{{{OSP}}}FixedStepAlgorithm", baseStepSize=str(system.step)
        )
