"""A system as an SSP archive: 1.0, or 2.0 where there are FMUs of FMI 3.0 in it."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement
from zipfile import ZipFile, ZipInfo

from orchestrator.cosim.formats.ssp import LEFT_OPEN, OMS, ORDER, OSP, SSC, SSD, SSV, STRUCTURE
from orchestrator.cosim.formats.ssp.nesting import End, Line, Nest, nested, offers, order_of
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.units import BASE_UNITS, Linear, Mapped, Unit, defined, unit_of_port
from orchestrator.cosim.system.values import Value
from orchestrator.cosim.system.variables import Variable
from orchestrator.machine.disk import file_name, plain_file_names
from orchestrator.machine.errors import InputError, shortened
from orchestrator.machine.texts import literal
from orchestrator.machine.user_files import read_archive

#: Name of every parameter set: ecos applies the sets of the one name that it is given.
PARAMETER_SET = "scenario"

#: Libcosim and OMSimulator accept no other prefixes than these.
_PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS}

#: Whose annotations libcosim and ecos look for.
_LIBCOSIM = "com.opensimulationplatform"

#: What marks annotations of this master.
_OURS = "auv-fmu"

#: Types of parameters that get no connectors.
_WITHOUT_CONNECTORS = ("String", "Enumeration")

#: What XML 1.0 cannot hold.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

#: Where tools draw the components: size of a box, and the distance to the next.
_BOX, _GAP = (40.0, 60.0), 30.0

#: The oldest time a zip archive can hold: the same system gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_ssp(
    system: System, folder: Path, flat: bool = False, connectors: bool = False
) -> list[Path]:
    """Write `NAME.ssp`; the step is part of the system; arguments as of :func:`ssp_bytes`."""
    path = folder / f"{file_name(system.name)}.ssp"
    path.write_bytes(ssp_bytes(system, flat, connectors))
    return [path]


def ssp_bytes(system: System, flat: bool = False, connectors: bool = False) -> bytes:
    """The archive of a system: its structure and its FMUs, the same bytes every time.

    Args:
        system: to write.
        flat: for tools that know no systems in systems, or make one instance of an FMU only: names
            have no dots, and each component has a copy of its FMU.
        connectors: for tools that take it as one component: the system has connectors, of what it
            :func:`offers <.nesting.offers>`.

    """
    system = system.flattened() if flat else system
    sources = _sources(system, flat)
    archive = BytesIO()
    with ZipFile(archive, "w") as content:
        structure = structure_xml(system, sources, connectors)
        content.writestr(ZipInfo(STRUCTURE, _EPOCH), structure)
        for name, source in _parameter_sources(system).items():
            values = parameter_set_xml(system.components[name], system.parameters_of(name))
            content.writestr(ZipInfo(source, _EPOCH), values)
        fmus = {sources[name]: component for name, component in system.components.items()}
        # In the order of their paths, as before there were copies.
        for source, component in sorted(fmus.items(), key=lambda one: one[1].fmu):
            fmu = read_archive(component.fmu, component.digest)
            content.writestr(ZipInfo(source, _EPOCH), fmu)
    return archive.getvalue()


def _sources(system: System, copied: bool = False) -> dict[str, str]:
    """Where the archive has the FMU of each component.

    Args:
        system: whose FMUs they are.
        copied: whether each component has one of its own.

    """
    names = system.fmus()
    taken, found = list(names.values()), dict[str, str]()
    first: dict[Path, str] = {}
    for name, component in system.components.items():
        file = names[component.fmu]
        if first.setdefault(component.fmu, name) != name and copied:
            [file] = plain_file_names([f"{name}.fmu"], *taken)
            taken.append(file)
        found[name] = f"resources/{file}"
    return found


def _parameter_sources(system: System) -> dict[str, str]:
    """Where the archive has the parameter set of each component that has one."""
    having = [name for name in system.components if system.parameters_of(name)]
    names = plain_file_names(f"{name}.ssv" for name in having)
    return {name: f"parameters/{file}" for name, file in zip(having, names, strict=True)}


def parameter_set_xml(
    component: Component, values: Mapping[str, Value], name: str = PARAMETER_SET
) -> bytes:
    """Values of one component by the names of its variables, as an SSV."""
    root = Element(_tag("ssv:ParameterSet"), name=name, version=_version(component))
    parameters = _add(root, "ssv:Parameters")
    for port in dict.fromkeys(component.variable(port).array for port in values):
        members = component.elements(port)
        element = _add(parameters, "ssv:Parameter", name=port)
        texts = [_text(component, member, values) for member in members]
        # Choices are numbers, which OMSimulator takes and at which no other tool ends.
        is_choice = members[0].family == "Enumeration"
        value = _add(element, f"ssv:{'Integer' if is_choice else members[0].type}")
        if not members[0].shape or members[0].family != "String":
            value.set("value", " ".join(texts))
        else:
            for text in texts:
                _add(value, "ssv:Value", value=text)
        _add_dimensions(element, members[0])
    return serialised(root, component.name)


def _text(component: Component, variable: Variable, values: Mapping[str, Value]) -> str:
    """A value as a parameter set has it."""
    value = values.get(variable.name, component.start(variable.name))
    if value is None:
        raise InputError(
            f"{component.name}.{variable.name} has no value, and an SSP holds whole arrays only"
        )
    if isinstance(value, float) and not isfinite(value):
        raise InputError(
            f"{component.name}.{variable.name} = {literal(value)}: an SSP holds finite numbers only"
        )
    return literal(value)


def _add_dimensions(parent: Element, variable: Variable) -> None:
    for length in variable.shape:
        _add(parent, "ssc:Dimension", size=str(length))


def _tag(name: str) -> str:
    prefix, colon, local = name.partition(":")
    return f"{{{_PREFIXES[prefix]}}}{local}" if colon else name


def _add(parent: Element, tag: str, /, **attributes: str) -> Element:
    return SubElement(parent, _tag(tag), attributes)


def serialised(root: Element, whose: str = "") -> bytes:
    """An element as a file of XML.

    Args:
        root: the element.
        whose: it is, for the message.

    Raises:
        InputError: it holds a character that XML has no words for.

    """
    _check_characters(root, whose)
    for prefix, namespace in _PREFIXES.items():
        ElementTree.register_namespace(prefix, namespace)
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return content


def _check_characters(element: Element, where: str) -> None:
    for value in element.attrib.values():
        if (found := _FORBIDDEN.search(value)) is not None:
            place = _FORBIDDEN.sub("?", where) or "the system"
            raise InputError(
                f"{place}: {shortened(value)!r} holds the character {found[0]!r}, which XML cannot "
                "hold"
            )
    for child in element:
        _check_characters(child, ".".join(filter(None, (where, child.get("name", "")))))


def structure_xml(
    system: System, sources: Mapping[str, str] | None = None, connectors: bool = False
) -> bytes:
    """SystemStructure.ssd; connectors and units come from the FMUs' own descriptions.

    libcosim and OMSimulator each need the step in an annotation of their own.

    Args:
        system: to write.
        sources: where the archive has the FMU of each component; None: each FMU once.
        connectors: as of :func:`ssp_bytes`.

    """
    version = max(map(_version, system.components.values()))
    root = Element(_tag("ssd:SystemStructureDescription"), name=system.name, version=version)
    offered = list(offers(system)) if connectors else []
    structure, nest = _add(root, "ssd:System", name=system.name), nested(system, offered)
    fed = {
        PortName(offer.component.name, element.name)
        for offer in offered
        for element in offer.component.elements(offer.variable.array)
    }
    given = _Given(
        system,
        sources or _sources(system),
        _parameter_sources(system),
        _clear_units(system),
        set(system.left_open) - fed,
    )
    _add_border(structure, nest, given.units)
    _fill(structure, nest, given)
    if system.step is not None:
        _add_master(structure, system.step)
    _add_enumerations(root, system)
    _add_units(root, system)
    _add_experiment(root, system, order_of(nest))
    return serialised(root)


class _Given(NamedTuple):
    """What all systems of a description are written from.

    Attributes:
        system: all of it.
        sources: of the FMUs of components.
        parameter_sources: of the parameter sets of components.
        units: that the description can define.
        left_out: inputs that nothing feeds, and that have no connectors.

    """

    system: System
    sources: Mapping[str, str]
    parameter_sources: Mapping[str, str]
    units: Collection[Unit]
    left_out: Collection[PortName]


def _fill(structure: Element, nest: Nest, given: _Given) -> None:
    """Write what is in a system, and in those in it; its element has its connectors already."""
    system = given.system
    elements = _add(structure, "ssd:Elements")
    for position, (name, component) in enumerate(nest.elements.items()):
        if isinstance(component, Nest):
            inner = _add(elements, "ssd:System", name=name)
            _add_border(inner, component, given.units)
            _add_geometry(inner, position)
            _fill(inner, component, given)
            continue
        source = given.sources[component.name]
        element = _add_component(elements, name, component, position, source, given.left_out)
        if component.name in given.parameter_sources:
            bindings = _add(element, "ssd:ParameterBindings")
            source = given.parameter_sources[component.name]
            media_type = "application/x-ssp-parameter-set"
            _add(bindings, "ssd:ParameterBinding", source=source, type=media_type)
        if component.name in system.steps:
            hint = str(system.steps[component.name])
            _add(_annotation(element, _LIBCOSIM), "osp:StepSizeHint", value=hint)
    # The schema has no empty list of connections.
    if nest.lines:
        connections = _add(structure, "ssd:Connections")
        for line in nest.lines:
            _add_line(connections, line, system)


def _add_border(structure: Element, nest: Nest, units: Collection[Unit]) -> None:
    """The connectors of a system."""
    if not nest.connectors:
        return
    connectors = _add(structure, "ssd:Connectors")
    for name, (kind, component, variable) in nest.connectors.items():
        unit = unit_of_port(component, variable.name)
        _add_connector(
            connectors, name, kind, variable, unit.name if unit and unit in units else None
        )


def _clear_units(system: System) -> set[Unit]:
    """The units that all FMUs define alike, with which values can be stated beside the FMUs."""
    found: dict[str, set[Unit]] = {}
    for component in {part.fmu: part for part in system.components.values()}.values():
        for unit in component.description.unitDefinitions:
            found.setdefault(unit.name, set()).add(defined(component, unit.name))
    return {unit for units in found.values() if len(units) == 1 for unit in units}


def _end(which: str, end: End) -> dict[str, str]:
    """The attributes of an end of a connection, which may be an element of an array."""
    stated = {"Element": end.element, "Connector": end.connector, "Indices": end.indices}
    return {f"{which}{name}": text for name, text in stated.items() if text is not None}


def _add_line(connections: Element, line: Line, system: System) -> None:
    start, end = _end("start", line.start), _end("end", line.end)
    element = _add(connections, "ssd:Connection", **start, **end)
    if line.connection is None:
        return
    source, made = line.connection.source, line.connection.transformation
    if made is not None:
        # Where units differ, it has been made of them.
        element.set("suppressUnitConversion", "true")
    if isinstance(made, Linear) and made != Linear():
        numbers = {"factor": str(made.factor), "offset": str(made.offset)}
        _add(element, "ssc:LinearTransformation", **numbers)
    elif isinstance(made, Mapped) and made.pairs:
        fmi_type = system.component(source.component).variable(source.port).family
        of = bool if fmi_type == "Boolean" else int
        # Numbers of an enumeration are integers as well.
        name = "BooleanMapping" if of is bool else "IntegerMapping"
        table = _add(element, f"ssc:{name}Transformation")
        for before, after in made.pairs:
            pair = {"source": literal(of(before)), "target": literal(of(after))}
            _add(table, "ssc:MapEntry", **pair)


def _add_master(structure: Element, step: float) -> None:
    """The step, as OMSimulator looks for it: in Python the attributes, in C++ the child.

    Components without a solver of their own get the one of this name. The tolerances are its own
    defaults: those that are missing it takes for zero.
    """
    annotations = _add(_annotation(structure, "org.openmodelica"), "oms:Annotations")
    method = {"name": "oms_ma_default", "method": "oms_ma", "fixedStepSize": str(step)}
    information = _add(annotations, "oms:SimulationInformation", **method)
    tolerances = dict.fromkeys(("absoluteTolerance", "relativeTolerance"), "0.0001")
    master = {"description": "oms-ma", "stepSize": str(step), **tolerances}
    _add(information, "oms:FixedStepMaster", **master)


def _annotation(element: Element, of: str) -> Element:
    """An annotation of an element, of some tool's."""
    annotations = element.find(_tag("ssd:Annotations"))
    if annotations is None:
        annotations = _add(element, "ssd:Annotations")
    return _add(annotations, "ssc:Annotation", type=of)


def _version(component: Component) -> str:
    """The first version of SSP that has words for the types of a component's ports."""
    return "1.0" if component.description.fmiVersion == "2.0" else "2.0"


def _add_component(
    elements: Element,
    own_name: str,
    component: Component,
    position: int,
    source: str,
    left_out: Collection[PortName],
) -> Element:
    media_type = "application/x-fmu-sharedlibrary"
    element = _add(elements, "ssd:Component", name=own_name, source=source, type=media_type)
    connectors = _add(element, "ssd:Connectors")
    written = set[str]()
    for variable in component.variables.values():
        name = variable.array
        # OMSimulator knows no connectors of texts, libcosim none of enumerations, and fmpy feeds an
        # input that no connection ends at from another's source. Parameter sets reach variables
        # without a connector.
        is_plain = variable.causality != "parameter" or variable.family not in _WITHOUT_CONNECTORS
        is_out = PortName(component.name, variable.name) in left_out or name in written
        if variable.causality in ("input", "output", "parameter") and is_plain and not is_out:
            written.add(name)
            _add_connector(connectors, name, variable.causality, variable, variable.unit)
    _add_geometry(element, position)
    return element


def _add_connector(
    connectors: Element, name: str, kind: str, variable: Variable, unit: str | None
) -> None:
    connector = _add(connectors, "ssd:Connector", name=name, kind=kind)
    stated = {"unit": unit} if unit else {}
    if variable.enumeration is not None:
        stated = {"name": variable.enumeration}
    _add(connector, f"ssc:{variable.type}", **stated)
    _add_dimensions(connector, variable)


def _add_geometry(element: Element, position: int) -> None:
    width, height = _BOX
    left = position * (width + _GAP)
    corners = {"x1": str(left), "y1": "0.0", "x2": str(left + width), "y2": str(height)}
    _add(element, "ssd:ElementGeometry", **corners)


def _add_enumerations(root: Element, system: System) -> None:
    enumerations = {
        variable.enumeration: variable.items
        for component in system.components.values()
        for variable in component.variables.values()
        if variable.enumeration is not None
    }
    if not enumerations:
        return
    parent = _add(root, "ssd:Enumerations")
    for name in sorted(enumerations):
        element = _add(parent, "ssc:Enumeration", name=name)
        for item, value in enumerations[name].items():
            _add(element, "ssc:Item", name=item, value=value)


def _add_units(root: Element, system: System) -> None:
    units = {
        unit.name: unit.baseUnit
        for component in system.components.values()
        for unit in component.description.unitDefinitions
    }
    if not units:
        return
    parent = _add(root, "ssd:Units")
    for name in sorted(units):
        base = _add(_add(parent, "ssc:Unit", name=name), "ssc:BaseUnit")
        for attribute, otherwise in (*((of, 0) for of in BASE_UNITS), ("factor", 1), ("offset", 0)):
            stated = getattr(units[name], attribute, otherwise)
            if stated != otherwise:
                base.set(attribute, str(stated))


def _add_experiment(root: Element, system: System, order: Sequence[str]) -> None:
    start_time = str(system.start_time or 0.0)
    experiment = _add(root, "ssd:DefaultExperiment", startTime=start_time)
    if system.stop_time is not None:
        experiment.set("stopTime", str(system.stop_time))
    if system.step is not None:
        algorithm = _add(_annotation(experiment, _LIBCOSIM), "osp:Algorithm")
        _add(algorithm, "osp:FixedStepAlgorithm", baseStepSize=str(system.step))
    if system.left_open:
        # Not beside the components: OMSimulator ends at an annotation there that it does not know.
        left_open = _add(_annotation(experiment, _OURS), LEFT_OPEN)
        for component, name in sorted((port.component, port.port) for port in system.left_open):
            _add(left_open, "Input", component=component, name=name)
    if list(system.components) != order:
        stated = _add(_annotation(experiment, _OURS), ORDER)
        for component in system.components:
            _add(stated, "Component", name=component)
