"""A system as an SSP archive: 1.0, or 2.0 where there are FMUs of FMI 3.0 in it."""

from __future__ import annotations

from collections.abc import Collection
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

from orchestrator.formats.ssp import LEFT_OPEN, OMS, OSP, SSC, SSD, SSV, STRUCTURE
from orchestrator.system.component import Component
from orchestrator.system.names import PortName, file_name, plain
from orchestrator.system.structure import Connection, System
from orchestrator.system.units import BASES, Linear, Mapped
from orchestrator.system.values import Value, literal, type_of

#: Name of every parameter set: ecos applies the sets of the one name that it is given.
PARAMETER_SET = "scenario"

#: Whose annotations libcosim and ecos look for.
_LIBCOSIM = "com.opensimulationplatform"

#: What marks annotations of this master.
_OURS = "auv-fmu"

#: Where tools draw the components: size of a box, and the distance to the next.
_BOX, _GAP = (40.0, 60.0), 30.0

#: The oldest time a zip archive can hold: the same system gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_ssp(system: System, folder: Path) -> list[Path]:
    """Write `NAME.ssp`; the step is part of the system."""
    path = folder / f"{file_name(system.name)}.ssp"
    path.write_bytes(ssp_bytes(system))
    return [path]


def ssp_bytes(system: System) -> bytes:
    """The archive of a system: its structure and its FMUs, the same bytes every time."""
    archive = BytesIO()
    with ZipFile(archive, "w") as content:
        content.writestr(ZipInfo(STRUCTURE, _EPOCH), structure_xml(system))
        for name, source in _parameter_sources(system).items():
            values = parameter_set_xml(system, system.components[name])
            content.writestr(ZipInfo(source, _EPOCH), values)
        for fmu, source in _sources(system).items():
            content.writestr(ZipInfo(source, _EPOCH), fmu.read_bytes())
    return archive.getvalue()


def _sources(system: System) -> dict[Path, str]:
    """Where the archive has each FMU."""
    return {fmu: f"resources/{name}" for fmu, name in system.fmus().items()}


def _parameter_sources(system: System) -> dict[str, str]:
    """Where the archive has the parameter set of each component that has one."""
    having = [name for name in system.components if system.parameters_of(name)]
    names = plain(f"{name}.ssv" for name in having)
    return {name: f"parameters/{file}" for name, file in zip(having, names, strict=True)}


def parameter_set_xml(system: System, component: Component) -> bytes:
    """The values that a system sets in one component, as an SSV."""
    _register_prefixes()
    root = ElementTree.Element(
        f"{{{SSV}}}ParameterSet", name=PARAMETER_SET, version=_version(component)
    )
    parameters = ElementTree.SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in system.parameters_of(component.name).items():
        element = ElementTree.SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
        fmi_type = component.variable(name).type
        ElementTree.SubElement(
            element, f"{{{SSV}}}{fmi_type}", value=_literal(component, name, value)
        )
    return _serialised(root)


def _literal(component: Component, name: str, value: Value) -> str:
    """A value as an SSV has it, where values of an enumeration have names."""
    declared = component.variable(name).declaredType
    items = () if declared is None else declared.items
    return next((str(item.name) for item in items if int(item.value) == value), literal(value))


def _register_prefixes() -> None:
    """Libcosim and OMSimulator accept no other prefixes than these."""
    prefixes = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS}
    for prefix, namespace in prefixes.items():
        ElementTree.register_namespace(prefix, namespace)


def _serialised(root: ElementTree.Element) -> bytes:
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return content


def structure_xml(system: System) -> bytes:
    """SystemStructure.ssd; connectors and units come from the FMUs' own descriptions.

    libcosim and OMSimulator each need the step in an annotation of their own.
    """
    _register_prefixes()
    root = ElementTree.Element(
        _ssd("SystemStructureDescription"),
        name=system.name,
        version=max(map(_version, system.components.values())),
    )
    structure = ElementTree.SubElement(root, _ssd("System"), name=system.name)
    elements = ElementTree.SubElement(structure, _ssd("Elements"))
    sources, parameter_sources = _sources(system), _parameter_sources(system)
    for position, component in enumerate(system.components.values()):
        element = _add_component(
            elements, component, position, sources[component.fmu], system.left_open
        )
        if component.name in parameter_sources:
            bindings = ElementTree.SubElement(element, _ssd("ParameterBindings"))
            ElementTree.SubElement(
                bindings,
                _ssd("ParameterBinding"),
                source=parameter_sources[component.name],
                type="application/x-ssp-parameter-set",
            )
        if component.name in system.steps:
            hint = {"value": str(system.steps[component.name])}
            ElementTree.SubElement(_annotation(element, _LIBCOSIM), f"{{{OSP}}}StepSizeHint", hint)
    # The schema has no empty list of connections.
    connections = ElementTree.Element(_ssd("Connections"))
    if system.connections:
        structure.append(connections)
    for connection in system.connections:
        element = ElementTree.SubElement(
            connections,
            _ssd("Connection"),
            startElement=connection.source.component,
            startConnector=connection.source.port,
            endElement=connection.target.component,
            endConnector=connection.target.port,
        )
        if connection.transformation is not None:
            # Where units differ, it has been made of them.
            element.set("suppressUnitConversion", "true")
            _add_transformation(element, connection, system)
    if system.step is not None:
        _add_master(structure, system.step)
    _add_enumerations(root, system)
    _add_units(root, system)
    _add_experiment(root, system)
    return _serialised(root)


def _add_transformation(
    element: ElementTree.Element, connection: Connection, system: System
) -> None:
    made = connection.transformation
    if isinstance(made, Linear) and made != Linear():
        numbers = {"factor": str(made.factor), "offset": str(made.offset)}
        ElementTree.SubElement(element, _ssc("LinearTransformation"), numbers)
    elif isinstance(made, Mapped):
        source = connection.source
        fmi_type = type_of(system.component(source.component).variable(source.port))
        of = bool if fmi_type == "Boolean" else int
        # Numbers of an enumeration are integers as well.
        name = "BooleanMapping" if of is bool else "IntegerMapping"
        table = ElementTree.SubElement(element, _ssc(f"{name}Transformation"))
        for start, end in made.pairs:
            pair = {"source": literal(of(start)), "target": literal(of(end))}
            ElementTree.SubElement(table, _ssc("MapEntry"), pair)


def _add_master(structure: ElementTree.Element, step: float) -> None:
    """The step, as OMSimulator looks for it: in Python the attributes, in C++ the child.

    Components without a solver of their own get the one of this name. The tolerances are its own
    defaults: those that are missing it takes for zero.
    """
    annotation = _annotation(structure, "org.openmodelica")
    information = ElementTree.SubElement(
        ElementTree.SubElement(annotation, f"{{{OMS}}}Annotations"),
        f"{{{OMS}}}SimulationInformation",
        {"name": "oms_ma_default", "method": "oms_ma", "fixedStepSize": str(step)},
    )
    tolerances = dict.fromkeys(("absoluteTolerance", "relativeTolerance"), "0.0001")
    master = {"description": "oms-ma", "stepSize": str(step), **tolerances}
    ElementTree.SubElement(information, f"{{{OMS}}}FixedStepMaster", master)


def _annotation(element: ElementTree.Element, of: str) -> ElementTree.Element:
    """An annotation of an element, of some tool's."""
    annotations = element.find(_ssd("Annotations"))
    if annotations is None:
        annotations = ElementTree.SubElement(element, _ssd("Annotations"))
    return ElementTree.SubElement(annotations, _ssc("Annotation"), type=of)


def _version(component: Component) -> str:
    """The first version of SSP that has words for the types of a component's ports."""
    return "1.0" if component.description.fmiVersion == "2.0" else "2.0"


def _ssd(tag: str) -> str:
    return f"{{{SSD}}}{tag}"


def _ssc(tag: str) -> str:
    return f"{{{SSC}}}{tag}"


def _add_component(
    elements: ElementTree.Element,
    component: Component,
    position: int,
    source: str,
    left_open: Collection[PortName],
) -> ElementTree.Element:
    element = ElementTree.SubElement(
        elements,
        _ssd("Component"),
        name=component.name,
        source=source,
        type="application/x-fmu-sharedlibrary",
    )
    connectors = ElementTree.SubElement(element, _ssd("Connectors"))
    for variable in component.description.modelVariables:
        # OMSimulator knows no connectors of texts, and fmpy feeds an input that no connection ends
        # at from another's source. Parameter sets reach variables without a connector.
        is_text = variable.causality == "parameter" and variable.type == "String"
        left_out = is_text or PortName(component.name, variable.name) in left_open
        if variable.causality in ("input", "output", "parameter") and not left_out:
            connector = ElementTree.SubElement(
                connectors, _ssd("Connector"), name=variable.name, kind=variable.causality
            )
            stated = {"unit": variable.unit} if variable.unit else {}
            if type_of(variable) == "Enumeration" and variable.declaredType is not None:
                stated = {"name": variable.declaredType.name}
            ElementTree.SubElement(connector, _ssc(variable.type), stated)
    width, height = _BOX
    left = position * (width + _GAP)
    ElementTree.SubElement(
        element,
        _ssd("ElementGeometry"),
        {"x1": str(left), "y1": "0.0", "x2": str(left + width), "y2": str(height)},
    )
    return element


def _add_enumerations(root: ElementTree.Element, system: System) -> None:
    enumerations = {
        variable.declaredType.name: variable.declaredType.items
        for component in system.components.values()
        for variable in component.description.modelVariables
        if type_of(variable) == "Enumeration" and variable.declaredType is not None
    }
    if not enumerations:
        return
    parent = ElementTree.SubElement(root, _ssd("Enumerations"))
    for name in sorted(enumerations):
        element = ElementTree.SubElement(parent, _ssc("Enumeration"), name=name)
        for item in enumerations[name]:
            ElementTree.SubElement(element, _ssc("Item"), name=item.name, value=str(item.value))


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
        base = ElementTree.SubElement(element, _ssc("BaseUnit"))
        for attribute, otherwise in (*((of, 0) for of in BASES), ("factor", 1), ("offset", 0)):
            stated = getattr(units[name], attribute, otherwise)
            if stated != otherwise:
                base.set(attribute, str(stated))


def _add_experiment(root: ElementTree.Element, system: System) -> None:
    start_time = str(system.start_time or 0.0)
    experiment = ElementTree.SubElement(root, _ssd("DefaultExperiment"), startTime=start_time)
    if system.stop_time is not None:
        experiment.set("stopTime", str(system.stop_time))
    if system.step is not None:
        annotation = _annotation(experiment, _LIBCOSIM)
        algorithm = ElementTree.SubElement(annotation, f"{{{OSP}}}Algorithm")
        ElementTree.SubElement(
            algorithm, f"{{{OSP}}}FixedStepAlgorithm", baseStepSize=str(system.step)
        )
    if system.left_open:
        # Not beside the components: OMSimulator ends at an annotation there that it does not know.
        left_open = ElementTree.SubElement(_annotation(experiment, _OURS), LEFT_OPEN)
        for component, name in sorted((port.component, port.port) for port in system.left_open):
            ElementTree.SubElement(left_open, "Input", component=component, name=name)
