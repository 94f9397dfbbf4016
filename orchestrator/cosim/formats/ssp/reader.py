"""An SSP archive as a system, and the experiment that it states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from urllib.parse import quote
from xml.etree.ElementTree import Element, SubElement

from orchestrator.cosim.formats.ssp import LEFT_OPEN, ORDER
from orchestrator.cosim.formats.ssp.archive import Archive
from orchestrator.cosim.formats.ssp.hierarchy import (
    Builder,
    Definitions,
    Leaf,
    Node,
    Way,
    definitions_of,
)
from orchestrator.cosim.formats.ssp.origins import Bindings, Segment, Values, segments_of
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.units import Mapped, Transformation, Unit, combine
from orchestrator.cosim.system.values import Value
from orchestrator.machine.errors import Findings, InputError, listed, shortened
from orchestrator.machine.texts import BOOLEANS, integer, real

#: Elements and attributes of annotations that hold the step of a whole system: those of libcosim
#: and ecos, of Vico, and of OMSimulator.
_STEPS = (
    ("FixedStepAlgorithm", "baseStepSize"),
    ("FixedStepMaster", "baseStepSize"),
    ("FixedStepMaster", "stepSize"),
    ("SimulationInformation", "fixedStepSize"),
)

#: The same of a component.
_STEPS_OF_COMPONENTS = (("StepSizeHint", "value"),)

_ROOT = "SystemStructureDescription"


def read_ssp(path: Path, variant: str | None = None, findings: Findings | None = None) -> System:
    """Read the system in an SSP archive, or in the folder of one that is unpacked.

    Args:
        path: of the archive, the folder, or a description in it.
        variant: which of its descriptions; None: the default.
        findings: takes all that is wrong with it.

    Raises:
        InputError: the archive is missing, broken, or uses what this master cannot do.

    """
    findings = Findings() if findings is None else findings
    archive = Archive(path, findings)
    root = archive.structure(variant)
    content = root.find("System")
    if root.tag != _ROOT or content is None:
        raise InputError(f"{path}: not a readable SSP: it describes no system")
    try:
        system = _read(archive, root, content)
    except RecursionError:
        raise InputError(f"{path}: not a readable SSP: nested too deeply") from None
    findings.refuse()
    return system


def bind_parameter_set(fmu: Path, name: str, parameters: Path, findings: Findings) -> System:
    """A system of one FMU that a parameter set is bound to, without a prefix or a mapping.

    Args:
        fmu: the file.
        name: of the component.
        parameters: the SSV.
        findings: takes all that is wrong with it.

    Raises:
        InputError: the set cannot be read, or a value is not of the type of its variable.

    """
    root = Element(_ROOT)
    content = SubElement(root, "System", name=name)
    source = quote(str(fmu.resolve()))
    component = SubElement(SubElement(content, "Elements"), "Component", name=name, source=source)
    bindings = SubElement(component, "ParameterBindings")
    SubElement(bindings, "ParameterBinding", source=quote(parameters.name))
    system = _read(Archive(parameters.parent, findings), root, content)
    findings.refuse()
    return system


def _read(archive: Archive, root: Element, content: Element) -> System:
    definitions = definitions_of(archive, root, Definitions())
    experiment = root.find("DefaultExperiment")
    top = Builder(archive, definitions).group(content)
    leaves = {leaf.way: leaf for leaf in top.elements() if isinstance(leaf, Leaf)}
    segments = segments_of(archive, top)
    ports = _Ports(archive, leaves, segments, Bindings(archive, definitions).values(top))
    components: dict[str, Component] = {}
    for leaf in leaves.values():
        name = ".".join(leaf.way)
        if name in components:
            archive.problem(f"two components are named {name}")
        if leaf.component is not None:
            components[name] = leaf.component
    stated = _annotated(experiment, ORDER)
    ordered = [element.get("name", "") for order in stated for element in order]
    components = {name: components[name] for name in (*ordered, *components) if name in components}
    # A component whose step is zero has no wish.
    steps = {
        ".".join(way): step
        for way, leaf in leaves.items()
        if (step := _step(archive, _STEPS_OF_COMPONENTS, leaf.content))
    }
    system = System(
        name=content.get("name") or archive.path.resolve().stem,
        components=components,
        connections=tuple(ports.connections),
        parameters=ports.parameters,
        start_time=archive.number(experiment, "startTime", None),
        stop_time=archive.number(experiment, "stopTime", None),
        step=_step(archive, _STEPS, experiment, content, root),
        steps=steps,
        left_open={
            PortName(element.get("component", ""), element.get("name", ""))
            for left_open in _annotated(experiment, LEFT_OPEN)
            for element in left_open
        },
    )
    if not leaves:
        archive.problem("holds no component: there is nothing to run")
    for problem in system.problems():
        archive.problem(problem)
    return system


def _annotated(element: Element | None, name: str) -> Iterator[Element]:
    """Elements of a name in the annotations of an element itself."""
    if element is not None:
        for annotations in element.findall("Annotations"):
            yield from annotations.iter(name)


def _step(
    archive: Archive, words: Iterable[tuple[str, str]], *places: Element | None
) -> float | None:
    """The step that the annotations of some places ask for [s]; None: they do not say."""
    for name, attribute in words:
        for element in chain.from_iterable(_annotated(place, name) for place in places):
            if (step := archive.number(element, attribute, None)) is not None:
                return step
    return None


@dataclass(frozen=True)
class _Arrival:
    """What is known of a value at a node.

    Attributes:
        start: where it sets out: at a component's port, or where it is given; None: there is none.
        leaf: the component that it comes from; None: it is given.
        whole: its transformation since.
        unit: that it has.
        error: why it cannot come so far.

    """

    start: Node | None
    leaf: Leaf | None = None
    whole: Transformation | None = None
    unit: Unit | None = None
    error: InputError | None = None


class _Ports:
    """What feeds and what sets the ports of components.

    Attributes:
        connections: between components.
        parameters: values of ports that nothing feeds, in the types of their variables.

    """

    def __init__(
        self,
        archive: Archive,
        leaves: Mapping[Way, Leaf],
        segments: Mapping[Node, Segment],
        given: Values,
    ) -> None:
        """Follow each port upstream."""
        self.connections: list[Connection] = []
        self.parameters: dict[PortName, Value] = {}
        self._archive, self._leaves = archive, leaves
        self._segments, self._given = segments, given
        self._used: set[Node] = set()
        self._arrivals: dict[Node, _Arrival] = {}
        self._circling: set[Node] = set()
        for node in dict.fromkeys((*segments, *given)):
            leaf = leaves.get(node.way)
            if leaf is not None and leaf.component is not None:
                try:
                    self._enter(PortName(leaf.component.name, node.port), node, leaf)
                except InputError as error:
                    archive.problem(error)
        lost = [str(node) for node in given if node not in self._used]
        if lost:
            archive.note(f"values that are given to {listed(lost)} reach no component")

    def _enter(self, port: PortName, node: Node, leaf: Leaf) -> None:
        """Enter what arrives at a port: another's value, or the outermost that is given."""
        arrival = self._arrival(node) if node in self._segments else self._given_to(node)
        if arrival.leaf is None:
            self._set(port, leaf, arrival)
        elif arrival.start is not None and arrival.leaf.component is not None:
            source = PortName(arrival.leaf.component.name, arrival.start.port)
            if arrival.error is not None:
                raise InputError(f"{source} -> {port}: {arrival.error}")
            self.connections.append(Connection(source, port, arrival.whole))

    def _arrival(self, node: Node) -> _Arrival:
        """What is known of a value at a node.

        It is followed upstream to what another port has been followed through: so all of them take
        linear time.

        Raises:
            InputError: its connections lead in a circle.

        """
        upstream: dict[Node, Segment] = {}
        at = node
        while at not in self._arrivals and (segment := self._segments.get(at)) is not None:
            if at in upstream or segment.source in self._circling:
                self._circling.update(upstream, [at])
                raise InputError(f"{node}: the connections that feed it form a circle")
            upstream[at] = segment
            at = segment.source
        arrival = self._arrivals.get(at) or self._setting_out(at)
        self._arrivals[at] = arrival
        for target, segment in reversed(upstream.items()):
            arrival = self._arrivals[target] = self._carried(arrival, target, segment)
        return arrival

    def _setting_out(self, node: Node) -> _Arrival:
        """A node that no connection ends in."""
        leaf = self._leaves.get(node.way)
        if leaf is None:
            return self._given_to(node)
        connector = leaf.connector(node.port)
        return _Arrival(node, leaf, unit=connector.unit if connector else None)

    def _carried(self, before: _Arrival, node: Node, segment: Segment) -> _Arrival:
        """What arrives at the end of a connection."""
        if before.start is None:
            return self._given_to(node)
        self._used.add(node)
        if before.leaf is not None and node in self._given:
            self._archive.note(
                f"{node}: is fed by {before.start}, and the value that is given to it has no effect"
            )
        if before.error is not None or (before.leaf and before.leaf.component is None):
            return before
        try:
            whole, unit = segment.carry(self._archive, before.whole, before.unit)
        except InputError as error:
            return replace(before, error=error)
        return replace(before, whole=whole, unit=unit)

    def _given_to(self, node: Node) -> _Arrival:
        """A node that no value has come to before: there begins the one that is given to it."""
        self._used.add(node)
        if node not in self._given:
            return _Arrival(None)
        given, connector = self._given[node]
        return _Arrival(node, unit=connector.unit or given.unit)

    def _set(self, port: PortName, leaf: Leaf, arrival: _Arrival) -> None:
        """Give a port the value that arrives, if any does."""
        if arrival.start is None:
            return
        given, target = self._given[arrival.start]
        try:
            whole = given.transformation(self._archive, target)
            if arrival.error is not None:
                raise arrival.error
            whole = combine(whole, arrival.whole)
        except ValueError as error:
            raise InputError(f"{arrival.start}: {error}") from None
        component, connector = leaf.component, leaf.connector(port.port)
        if component is None or connector is None:
            return
        if connector.causality == "structuralParameter":
            self._keep_size(port, component, given.text)
            return
        if not component.is_settable(port.port):
            self._archive.note(
                f"{port}: has causality {connector.causality} and cannot be set; the value that "
                "is given to it has no effect"
            )
            return
        items = {**connector.items, **given.items}
        value: object = items.get(given.text, given.text)
        if whole is not None:
            value = whole(_number(port, str(value), isinstance(whole, Mapped)))
        if isinstance(value, float) and value.is_integer() and connector.type != "Real":
            value = int(value)
        self.parameters[port] = component.variable(port.port).typed(value, str(port))

    def _keep_size(self, port: PortName, component: Component, text: str) -> None:
        """Refuse another size of arrays than the one that their FMU describes."""
        if component.variable(port.port).typed(text, str(port)) != component.start(port.port):
            raise InputError(f"{port} = {shortened(text)}: sizes of arrays cannot be changed")


def _number(port: PortName, text: str, is_mapped: bool) -> float:
    """A value that is transformed, as a number; one that is mapped is exact."""
    if is_mapped:
        with suppress(ValueError):
            return integer(text)
    try:
        return float(BOOLEANS[text]) if text in BOOLEANS else real(text)
    except ValueError:
        raise InputError(
            f"{port} = {shortened(text)}: not a number, so it can be neither converted nor "
            "transformed"
        ) from None
