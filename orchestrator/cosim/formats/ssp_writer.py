"""Write a system as an SSP archive: 1.0, or 2.0 if it contains FMUs of FMI 3.0.

The dots of a component's name give its place: `fleet.one.part` is the element `part` of the system
`one` in the system `fleet`. A value that leaves or enters a system has one connector there, however
many inputs it feeds. It passes all borders unchanged, an array as a whole: only the last connection
on its way picks an element, or transforms the value.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import NamedTuple, TypeAlias
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement
from zipfile import ZipFile, ZipInfo

from orchestrator.cosim.component import Component
from orchestrator.cosim.connection import (
    BASE_UNITS,
    Connection,
    Linear,
    Mapped,
    PortName,
    Unit,
    defined,
    unit_of_port,
)
from orchestrator.cosim.formats.archive import LEFT_OPEN, OMS, ORDER, OSP, SSC, SSD, SSV, STRUCTURE
from orchestrator.cosim.formats.ssp_reader import SystemPath
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import Value, Variable
from orchestrator.machine.disk import file_name, has_slash, plain_file_names
from orchestrator.machine.errors import InputError, shortened
from orchestrator.machine.texts import literal
from orchestrator.machine.user_files import read_archive

#: Names of the systems around a component, and its name in the innermost.
Place: TypeAlias = tuple[SystemPath, str]


class End(NamedTuple):
    """An end of a connection in the file.

    Attributes:
        element: None: a connector of the system itself.
        connector: of the element.
        indices: of an element of an array; None: a whole array, or a scalar.

    """

    element: str | None
    connector: str
    indices: str | None = None


class Line(NamedTuple):
    """A connection in the file.

    Attributes:
        start, end: its ends.
        connection: of the system, which ends with this line; None: the line is on the way.

    """

    start: End
    end: End
    connection: Connection | None = None


class Crossing(NamedTuple):
    """A connector of a system.

    Attributes:
        kind: `input` or `output`.
        component: with the port that crosses the border.
        variable: the port, or an element of the array.

    """

    kind: str
    component: Component
    variable: Variable


@dataclass
class Nest:
    """A system in the file.

    Attributes:
        elements: components and systems in it, by their names there.
        connectors: of the system, by name.
        lines: connections within it.

    """

    elements: dict[str, Component | Nest] = field(default_factory=dict)
    connectors: dict[str, Crossing] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)
    _crossing: dict[PortName, str] = field(default_factory=dict)

    def inner(self, name: str) -> Nest:
        """Return a system in it, which is created if it is missing."""
        nest = self.elements.setdefault(name, Nest())
        assert isinstance(nest, Nest)
        return nest

    def cross(self, crossing: Crossing) -> tuple[str, bool]:
        """Return the connector for a port that crosses the border, and True if it is new.

        Its name is that of the port in the whole system, as an identifier, since OMSimulator
        accepts no other. It is unique, since OMSimulator merges the names of several systems.
        """
        port = PortName(crossing.component.name, crossing.variable.array)
        if port in self._crossing:
            return self._crossing[port], False
        name = re.sub(r"\W", "_", str(port), flags=re.ASCII)
        while name in self.connectors or name in self.elements:
            name += "_"
        self._crossing[port] = name
        self.connectors[name] = crossing
        return name, True


def nested(system: System, offered: Iterable[Crossing] = ()) -> Nest:
    """Nest a system by the names of its components.

    Args:
        system: to nest.
        offered: connectors of the outermost system.

    """
    top = Nest()
    places = {name: _place(name, system.components) for name in system.components}
    for name, (way, local) in places.items():
        nest = top
        for part in way:
            nest = nest.inner(part)
        nest.elements[local] = system.components[name]
    connected, written = set(system.connections), set[Connection]()
    for connection in system.connections:
        if connection not in written:
            whole = _whole(connection, system, connected)
            written |= whole
            _route(top, places, system, connection, bool(whole))
    for offer in offered:
        _offer(top, places[offer.component.name], offer)
    return top


def offers(system: System) -> Iterator[Crossing]:
    """Yield the connectors that a system can offer: all outputs, and open inputs."""
    for name, component in system.components.items():
        open_inputs = set(system.open_inputs(name))
        for causality in ("input", "output"):
            ports = {variable.array: variable for variable in component.having(causality)}
            for array, variable in ports.items():
                members = {element.name for element in component.elements(array)}
                if causality == "output" or members <= open_inputs:
                    yield Crossing(causality, component, variable)


def order_of(nest: Nest) -> list[str]:
    """Return the names of all components in the order in which they are nested."""
    names: list[str] = []
    for element in nest.elements.values():
        names += order_of(element) if isinstance(element, Nest) else [element.name]
    return names


def _place(name: str, components: Collection[str]) -> Place:
    """Split the name of a component into its place.

    A part without letters does not name a system, nor does the name of another component.
    """
    way: list[str] = []
    begin = 0
    for end, character in enumerate(name):
        if character == "." and begin < end < len(name) - 1 and name[:end] not in components:
            way.append(name[begin:end])
            begin = end + 1
    return tuple(way), name[begin:]


def _route(
    top: Nest,
    places: Mapping[str, Place],
    system: System,
    connection: Connection,
    is_whole: bool,
) -> None:
    """Add the lines of a connection, from the system of the source to the one of the target."""
    source, target = connection.source, connection.target
    component = system.component(source.component)
    variable = component.variable(source.port)
    inwards, last = places[target.component]
    shared = _shared(places[source.component][0], inwards)
    start = _out(top, places[source.component], Crossing("output", component, variable), shared)
    start = _in(top, inwards, start, Crossing("input", component, variable), shared)
    end = End(last, system.variable(target).array)
    if not is_whole:
        start = start._replace(indices=_indices(system, source))
        end = end._replace(indices=_indices(system, target))
    _nests(top, inwards)[-1].lines.append(Line(start, end, connection))


def _offer(top: Nest, place: Place, offer: Crossing) -> None:
    """Add the lines between a port and the border of the outermost system."""
    way, local = place
    name, _ = top.cross(offer)
    border = End(None, name)
    if offer.kind == "output":
        top.lines.append(Line(_out(top, place, offer, 0), border))
    else:
        end = End(local, offer.variable.array)
        _nests(top, way)[-1].lines.append(Line(_in(top, way, border, offer, 0), end))


def _out(top: Nest, place: Place, crossing: Crossing, shared: int) -> End:
    """Lead an output out of its systems, except the shared ones, and return its end there."""
    way, local = place
    nests, end = _nests(top, way), End(local, crossing.variable.array)
    for depth in range(len(way), shared, -1):
        name, is_new = nests[depth].cross(crossing)
        if is_new:
            nests[depth].lines.append(Line(end, End(None, name)))
        end = End(way[depth - 1], name)
    return end


def _in(top: Nest, way: SystemPath, start: End, crossing: Crossing, shared: int) -> End:
    """Lead a value into the systems of a way, except the shared ones, and return its end there."""
    nests = _nests(top, way)
    for depth in range(shared, len(way)):
        name, is_new = nests[depth + 1].cross(crossing)
        if is_new:
            nests[depth].lines.append(Line(start, End(way[depth], name)))
        start = End(None, name)
    return start


def _shared(first: SystemPath, second: SystemPath) -> int:
    """Return the number of systems that two ways share."""
    same = (a == b for a, b in zip(first, second, strict=False))
    return next((n for n, is_same in enumerate(same) if not is_same), min(len(first), len(second)))


def _nests(top: Nest, way: SystemPath) -> list[Nest]:
    """Return the systems of a way, from the outermost on."""
    nests = [top]
    for part in way:
        nests.append(nests[-1].inner(part))
    return nests


def _indices(system: System, port: PortName) -> str | None:
    """Return the indices of an element of an array, as in SSP 2.0; None: it is a scalar."""
    variable = system.variable(port)
    if not variable.shape:
        return None
    return port.port.removeprefix(variable.array)[1:-1].replace(",", " ")


def _whole(
    connection: Connection, system: System, connected: Collection[Connection]
) -> set[Connection]:
    """Return all connections of two arrays that are connected as a whole; empty: they are not."""
    start, end = connection.source, connection.target
    starts, ends = system.component(start.component), system.component(end.component)
    source, target = starts.variable(start.port), ends.variable(end.port)
    if not source.shape or source.shape != target.shape:
        return set()
    members = zip(starts.elements(source.array), ends.elements(target.array), strict=True)
    connections = {
        replace(
            connection,
            source=PortName(start.component, a.name),
            target=PortName(end.component, b.name),
        )
        for a, b in members
    }
    return connections if connections.issubset(connected) else set()


#: Libcosim and OMSimulator accept no other prefixes.
_PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS}

#: Type of the annotations of libcosim and ecos.
_LIBCOSIM = "com.opensimulationplatform"

#: Type of our annotations.
_OURS = "auv-fmu"

#: Types of parameters without connectors.
_WITHOUT_CONNECTORS = ("String", "Enumeration")

#: Characters that XML 1.0 cannot hold.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

#: Layout in tools: size of a box, and gap to the next.
_BOX, _GAP = (40.0, 60.0), 30.0

#: The earliest time in a zip archive, so that the same system gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_ssp(
    system: System,
    folder: Path,
    flat: bool = False,
    connectors: bool = False,
    parameter_set: str = "scenario",
) -> list[Path]:
    """Write `NAME.ssp`; the step is part of the system.

    Args:
        system: to write.
        folder: for the file.
        flat, connectors: as of :func:`ssp_bytes`.
        parameter_set: name of every parameter set; ecos applies the sets of one name.

    """
    path = folder / f"{file_name(system.name)}.ssp"
    path.write_bytes(ssp_bytes(system, flat, connectors, parameter_set))
    return [path]


def ssp_bytes(
    system: System, flat: bool = False, connectors: bool = False, parameter_set: str = "scenario"
) -> bytes:
    """Return the archive of a system: its structure and its FMUs, always with the same bytes.

    Args:
        system: to write.
        flat: for tools without nested systems, or with one instance of an FMU only: names have no
            dots, and each component has a copy of its FMU.
        connectors: for tools that use it as one component: the system gets the connectors of
            :func:`offers`.
        parameter_set: name of every parameter set.

    """
    system = system.flattened() if flat else system
    sources = _sources(system, flat)
    archive = BytesIO()
    with ZipFile(archive, "w") as content:
        structure = structure_xml(system, sources, connectors)
        content.writestr(ZipInfo(STRUCTURE, _EPOCH), structure)
        for name, source in _parameter_sources(system).items():
            values = parameter_set_xml(
                system.components[name], system.parameters_of(name), parameter_set
            )
            content.writestr(ZipInfo(source, _EPOCH), values)
        fmus = {sources[name]: component for name, component in system.components.items()}
        # Sorted by path, so that the archive's bytes do not depend on names.
        for source, component in sorted(fmus.items(), key=lambda item: item[1].fmu):
            fmu = read_archive(component.fmu, component.digest)
            content.writestr(ZipInfo(source, _EPOCH), fmu)
    return archive.getvalue()


def _sources(system: System, copied: bool = False) -> dict[str, str]:
    """Return the path of each component's FMU in the archive.

    Args:
        system: with the FMUs.
        copied: if set, each component has a copy of its own.

    """
    names = system.fmus()
    taken, sources = list(names.values()), dict[str, str]()
    first: dict[Path, str] = {}
    for name, component in system.components.items():
        file = names[component.fmu]
        if first.setdefault(component.fmu, name) != name and copied:
            [file] = plain_file_names([f"{name}.fmu"], *taken)
            taken.append(file)
        sources[name] = f"resources/{file}"
    return sources


def _parameter_sources(system: System) -> dict[str, str]:
    """Return the paths of the parameter sets in the archive, by component."""
    having = [name for name in system.components if system.parameters_of(name)]
    names = plain_file_names(f"{name}.ssv" for name in having)
    return {name: f"parameters/{file}" for name, file in zip(having, names, strict=True)}


def parameter_set_xml(component: Component, values: Mapping[str, Value], name: str) -> bytes:
    """Write values of a component as an SSV."""
    root = Element(_tag("ssv:ParameterSet"), name=name, version=_version(component))
    parameters = _add(root, "ssv:Parameters")
    for port in dict.fromkeys(component.variable(port).array for port in values):
        members = component.elements(port)
        element = _add(parameters, "ssv:Parameter", name=port)
        texts = [_text(component, member, values) for member in members]
        # Written as integers: OMSimulator reads them, and other tools accept them.
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
    """Format a value for a parameter set."""
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
    """Format an element as an XML file.

    Args:
        root: the element.
        whose: element, for the message.

    Raises:
        InputError: it contains a character that XML cannot hold.

    """
    _check_characters(root, whose)
    for prefix, namespace in _PREFIXES.items():
        ElementTree.register_namespace(prefix, namespace)
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return content


def _check_characters(element: Element, where: str) -> None:
    for value in element.attrib.values():
        if (match := _FORBIDDEN.search(value)) is not None:
            place = _FORBIDDEN.sub("?", where) or "the system"
            raise InputError(
                f"{place}: {shortened(value)!r} holds the character {match[0]!r}, which XML cannot "
                "hold"
            )
    for child in element:
        _check_characters(child, ".".join(filter(None, (where, child.get("name", "")))))


def structure_xml(
    system: System, sources: Mapping[str, str] | None = None, connectors: bool = False
) -> bytes:
    """Write SystemStructure.ssd, with connectors and units from the FMUs' descriptions.

    libcosim and OMSimulator need the step in different annotations.

    Args:
        system: to write.
        sources: path of each component's FMU in the archive; None: each FMU once.
        connectors: as of :func:`ssp_bytes`.

    Raises:
        InputError: a name of a component contains a slash, which :func:`.read_ssp` refuses.

    """
    for name in system.components:
        if has_slash(name):
            raise InputError(f"component {name!r}: names in an SSP have no slashes")
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
    """Data for all systems of a description.

    Attributes:
        system: to write.
        sources: paths of the FMUs, by component.
        parameter_sources: paths of the parameter sets, by component.
        units: that the description can define.
        left_out: unconnected inputs without connectors.

    """

    system: System
    sources: Mapping[str, str]
    parameter_sources: Mapping[str, str]
    units: Collection[Unit]
    left_out: Collection[PortName]


def _fill(structure: Element, nest: Nest, given: _Given) -> None:
    """Write the contents of a system and of those in it; its connectors are there already."""
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
    # The schema does not allow an empty list of connections.
    if nest.lines:
        connections = _add(structure, "ssd:Connections")
        for line in nest.lines:
            _add_line(connections, line, system)


def _add_border(structure: Element, nest: Nest, units: Collection[Unit]) -> None:
    """Write the connectors of a system."""
    if not nest.connectors:
        return
    connectors = _add(structure, "ssd:Connectors")
    for name, (kind, component, variable) in nest.connectors.items():
        unit = unit_of_port(component, variable.name)
        _add_connector(
            connectors, name, kind, variable, unit.name if unit and unit in units else None
        )


def _clear_units(system: System) -> set[Unit]:
    """Return the units that all FMUs define alike, so that the description can define them."""
    units_by_name: dict[str, set[Unit]] = {}
    for component in {part.fmu: part for part in system.components.values()}.values():
        for unit in component.description.unitDefinitions:
            units_by_name.setdefault(unit.name, set()).add(defined(component, unit.name))
    return {unit for units in units_by_name.values() if len(units) == 1 for unit in units}


def _end(which: str, end: End) -> dict[str, str]:
    """Return the attributes of an end of a connection, which may be an element of an array."""
    stated = {"Element": end.element, "Connector": end.connector, "Indices": end.indices}
    return {f"{which}{name}": text for name, text in stated.items() if text is not None}


def _add_line(connections: Element, line: Line, system: System) -> None:
    start, end = _end("start", line.start), _end("end", line.end)
    element = _add(connections, "ssd:Connection", **start, **end)
    if line.connection is None:
        return
    source, made = line.connection.source, line.connection.transformation
    if made is not None:
        # The transformation includes the conversion of units.
        element.set("suppressUnitConversion", "true")
    if isinstance(made, Linear) and made != Linear():
        numbers = {"factor": str(made.factor), "offset": str(made.offset)}
        _add(element, "ssc:LinearTransformation", **numbers)
    elif isinstance(made, Mapped) and made.pairs:
        fmi_type = system.variable(source).family
        convert = bool if fmi_type == "Boolean" else int
        # Items of an enumeration are also integers.
        name = "BooleanMapping" if convert is bool else "IntegerMapping"
        table = _add(element, f"ssc:{name}Transformation")
        for before, after in made.pairs:
            pair = {"source": literal(convert(before)), "target": literal(convert(after))}
            _add(table, "ssc:MapEntry", **pair)


def _add_master(structure: Element, step: float) -> None:
    """Write the step for OMSimulator: attributes for its Python version, a child for C++.

    Components without a solver of their own get the one of this name. The tolerances are
    OMSimulator's defaults, since it takes missing ones for zero.
    """
    annotations = _add(_annotation(structure, "org.openmodelica"), "oms:Annotations")
    method = {"name": "oms_ma_default", "method": "oms_ma", "fixedStepSize": str(step)}
    information = _add(annotations, "oms:SimulationInformation", **method)
    tolerances = dict.fromkeys(("absoluteTolerance", "relativeTolerance"), "0.0001")
    master = {"description": "oms-ma", "stepSize": str(step), **tolerances}
    _add(information, "oms:FixedStepMaster", **master)


def _annotation(element: Element, tool: str) -> Element:
    """Add an annotation of a tool to an element."""
    annotations = element.find(_tag("ssd:Annotations"))
    if annotations is None:
        annotations = _add(element, "ssd:Annotations")
    return _add(annotations, "ssc:Annotation", type=tool)


def _version(component: Component) -> str:
    """Return the first version of SSP that supports the types of a component's ports."""
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
        # OMSimulator does not support connectors of texts, libcosim none of enumerations, and
        # fmpy feeds an unconnected input from the source of another one. Parameter sets reach
        # variables without a connector.
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
        for attribute in (*BASE_UNITS, "factor", "offset"):
            default = 1 if attribute == "factor" else 0
            stated = getattr(units[name], attribute, default)
            if stated != default:
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
        # Not at the components, where OMSimulator fails on an unknown annotation.
        left_open = _add(_annotation(experiment, _OURS), LEFT_OPEN)
        for component, name in sorted((port.component, port.port) for port in system.left_open):
            _add(left_open, "Input", component=component, name=name)
    if list(system.components) != order:
        stated = _add(_annotation(experiment, _OURS), ORDER)
        for component in system.components:
            _add(stated, "Component", name=component)
