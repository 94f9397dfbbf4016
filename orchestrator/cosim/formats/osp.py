"""The configuration of libcosim, read and written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isclose
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from orchestrator.cosim.component import Component, read_component
from orchestrator.cosim.connection import Connection, Linear, PortName, conversion, unit_of_port
from orchestrator.cosim.formats.archive import Archive
from orchestrator.cosim.formats.ssp_writer import serialised
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import Value
from orchestrator.machine.errors import Findings, InputError, listed, reason
from orchestrator.machine.texts import literal
from orchestrator.machine.user_files import check_file, is_folder, read_archive

#: Versions of FMI that libcosim supports and we can write.
_TAKEN = ("2.0",)

#: Name of libcosim's file, and its defaults: a step [s] and an algorithm.
OSP_STRUCTURE = "OspSystemStructure.xml"
_STEP, _ALGORITHM = 0.1, "fixedStep"

#: Relative difference below which a step is a multiple of the communication step.
_ROUNDING = 1e-9

_OSP = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"


def write_osp(system: System, folder: Path) -> list[Path]:
    """Write `OspSystemStructure.xml` and the FMUs next to it, for libcosim.

    Raises:
        InputError: libcosim cannot open an FMU, or the format does not support a connection.

    """
    for connection in system.connections:
        # libcosim does not convert units.
        if connection.transformation not in (None, Linear()):
            raise InputError(
                f"{connection.source} -> {connection.target}: is transformed; write an SSP"
            )
    if choices := [*map(str, system.changed("Enumeration"))]:
        raise InputError(
            f"{listed(choices)}: libcosim sets no parameter of type Enumeration; leave the values "
            "as they are in the FMU"
        )
    for component in system.components.values():
        version = component.description.fmiVersion
        if version not in _TAKEN:
            raise InputError(
                f"{component.name}: libcosim takes no FMU of FMI {version}; write an SSP, or FMUs "
                "with --fmi 2"
            )
    root = Element("OspSystemStructure", xmlns=_OSP, version="0.1")
    for tag, text in (
        ("StartTime", str(system.start_time or 0.0)),
        ("BaseStepSize", str(system.step)),
        ("Algorithm", _ALGORITHM),
    ):
        SubElement(root, tag).text = text
    simulators = SubElement(root, "Simulators")
    fmus = system.fmus(OSP_STRUCTURE)
    digests = {component.fmu: component.digest for component in system.components.values()}
    for fmu, name in fmus.items():
        (folder / name).write_bytes(read_archive(fmu, digests[fmu]))
    for name, component in system.components.items():
        step = str(system.steps.get(name, system.step))
        named = {"name": name, "source": fmus[component.fmu], "stepSize": step}
        simulator = SubElement(simulators, "Simulator", named)
        parameters = [
            (port, component.variable(port), value)
            for port, value in system.parameters_of(name).items()
            # libcosim does not support them.
            if component.variable(port).type != "Enumeration"
        ]
        if parameters:
            values = SubElement(simulator, "InitialValues")
            for port, variable, value in parameters:
                element = SubElement(values, "InitialValue", variable=port)
                SubElement(element, variable.type, value=literal(value))
    connections = SubElement(root, "Connections")
    for connection in system.connections:
        element = SubElement(connections, "VariableConnection")
        for end in (connection.source, connection.target):
            SubElement(element, "Variable", simulator=end.component, name=end.port)
    path = folder / OSP_STRUCTURE
    path.write_bytes(serialised(root))
    return [path, *(folder / name for name in fmus.values())]


def read_osp(path: Path, findings: Findings | None = None) -> System:
    """Read a system for libcosim.

    Args:
        path: of the file, or of its folder.
        findings: receives problems and notes.

    Raises:
        InputError: the file is missing, broken, or uses unsupported features.

    """
    path = path / OSP_STRUCTURE if is_folder(path) else path
    archive = Archive(path, Findings() if findings is None else findings)
    root = _root(path)
    components = _components(archive, root)
    # Missing components would cause further problems.
    archive.findings.refuse()
    connections = tuple(_connections(archive, root, components))
    algorithm = root.findtext("Algorithm", _ALGORITHM).strip()
    if algorithm != _ALGORITHM:
        archive.note(f"asks for the algorithm {algorithm!r}; fixed steps are used instead")
    step = _number(archive, root, "BaseStepSize") or _STEP
    system = System(
        name=archive.folder.name,
        components=components,
        connections=connections,
        parameters=_parameters(archive, root, components, connections),
        start_time=_number(archive, root, "StartTime"),
        stop_time=_number(archive, root, "EndTime"),
        step=step,
        steps=_steps(archive, root, step),
    )
    for problem in system.problems():
        archive.problem(problem)
    archive.findings.refuse()
    return system


def _root(path: Path) -> Element:
    """Return the root element, with local names of all tags."""
    check_file(path)
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except Exception as error:
        raise InputError(f"{path}: not a readable {OSP_STRUCTURE}: {reason(error)}") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != Path(OSP_STRUCTURE).stem:
        raise InputError(f"{path}: not a readable {OSP_STRUCTURE}: it describes a <{root.tag}>")
    return root


def _number(archive: Archive, root: Element, name: str) -> float | None:
    text = root.findtext(name)
    return None if text is None else archive.number(Element(name, {name: text}), name, None)


def _simulators(root: Element) -> list[tuple[str, Element]]:
    return [(element.get("name", ""), element) for element in root.iterfind("Simulators/Simulator")]


def _components(archive: Archive, root: Element) -> dict[str, Component]:
    components: dict[str, Component] = {}
    for name, simulator in _simulators(root):
        if not name or name in components:
            archive.problem(f"two simulators are named {name}" if name else "one has no name")
            continue
        fmu = archive.file(archive.required(simulator, "source", name), name)
        try:
            if fmu is not None:
                components[name] = read_component(name, fmu, findings=archive.findings)
        except InputError as error:
            archive.problem(f"{name}: {error}")
    if not components:
        archive.problem("holds no simulator: there is nothing to run")
    return components


def _steps(archive: Archive, root: Element, step: float) -> dict[str, float]:
    """Return the steps of components, as libcosim rounds them to multiples of the step."""
    steps = {}
    for name, simulator in _simulators(root):
        own = archive.number(simulator, "stepSize", 0.0)
        if own > 0.0 < step:
            multiple = max(1, round(own / step)) * step
            steps[name] = own if isclose(own, multiple, rel_tol=_ROUNDING) else multiple
            if steps[name] != own:
                archive.note(f"{name}: its step of {own:g} s becomes {multiple:g} s, a multiple")
    return steps


def _connections(
    archive: Archive, root: Element, components: Mapping[str, Component]
) -> Iterator[Connection]:
    """Yield the connections of variables, direct or through a linear transformation."""
    functions: dict[str, Linear | None] = {}
    signals: dict[tuple[str, str], list[PortName]] = {}
    for element in root.iterfind("Functions/*"):
        name = element.get("name", "")
        functions[name] = Linear(
            archive.number(element, "factor", 1.0), archive.number(element, "offset", 0.0)
        )
        if element.tag != "LinearTransformation":
            functions[name] = None
            archive.problem(f"function {name}: a <{element.tag}> is not supported")
    for element in root.iterfind("Connections/*"):
        variables, signal = element.findall("Variable"), element.find("Signal")
        ends = [PortName(end.get("simulator", ""), end.get("name", "")) for end in variables]
        if element.tag == "VariableConnection" and len(ends) == 2:
            yield _connection(archive, components, *ends)
        elif element.tag == "SignalConnection" and len(ends) == 1 and signal is not None:
            function = signal.get("function", "")
            if function not in functions:
                archive.problem(f"{ends[0]}: there is no function {function!r}")
            signals.setdefault((function, signal.get("name", "")), []).extend(ends)
        else:
            archive.problem(f"a <{element.tag}> of {len(ends)} variables is not supported")
    for name, transformation in functions.items():
        sources = signals.get((name, "in"), [])
        if transformation is not None and len(sources) != 1:
            archive.problem(f"function {name}: takes one variable, and has {len(sources)}")
        elif transformation is not None:
            for target in signals.get((name, "out"), []):
                yield Connection(sources[0], target, transformation)


def _connection(
    archive: Archive, components: Mapping[str, Component], *ends: PortName
) -> Connection:
    """Make a connection, which may be written from either end; units are not converted."""
    try:
        owners = [components[end.component] for end in ends]
        causality = owners[0].variable(ends[0].port).causality
        source, target = ends if causality in ("output", "calculatedParameter") else ends[::-1]
        units = [unit_of_port(owner, end.port) for owner, end in zip(owners, ends, strict=True)]
    except (KeyError, InputError):
        # The check of the system reports wrong names.
        return Connection(ends[0], ends[1])
    try:
        if conversion(*units) is None:
            return Connection(source, target)
    except InputError:
        pass
    names = " and ".join(unit.name for unit in units if unit)
    archive.note(f"{source} -> {target}: units differ, {names}; values are taken as they are")
    return Connection(source, target, Linear())


def _parameters(
    archive: Archive,
    root: Element,
    components: Mapping[str, Component],
    connections: tuple[Connection, ...],
) -> dict[PortName, Value]:
    """Return the initial values that have an effect."""
    fed = {connection.target: connection.source for connection in connections}
    parameters: dict[PortName, Value] = {}
    for name, simulator in _simulators(root):
        for element in simulator.iterfind("InitialValues/InitialValue"):
            port = PortName(name, archive.required(element, "variable", name))
            stated = next(iter(element), None)
            try:
                variable = components[name].variable(port.port)
                if stated is None or stated.get("value") is None:
                    raise InputError(f"{port}: an initial value without a value")
                value = variable.typed(stated.get("value"), str(port))
            except InputError as error:
                archive.problem(error)
                continue
            if port in fed or not components[name].is_settable(port.port):
                why = f"has causality {variable.causality} and cannot be set"
                why = f"is fed by {fed[port]}" if port in fed else why
                archive.note(f"{port}: {why}; the value that is given to it has no effect")
                continue
            if stated.tag != variable.family:
                archive.note(
                    f"{port}: is given a {stated.tag}, but is a {variable.type} in its FMU"
                )
            parameters[port] = value
    return parameters
