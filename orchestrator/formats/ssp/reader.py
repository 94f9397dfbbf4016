"""An SSP archive as a system, and the experiment that it states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp import LEFT_OPEN
from orchestrator.formats.ssp.archive import Archive, listed
from orchestrator.formats.ssp.bindings import Bindings, Values
from orchestrator.formats.ssp.hierarchy import Builder, Leaf, Node, Way, definitions_of
from orchestrator.formats.ssp.routes import Route, Routes
from orchestrator.machine.errors import Findings, InputError, shortened
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.system.units import Transformation, Unit, chained
from orchestrator.system.values import BOOLEANS, Value, real, typed

#: Elements and attributes of annotations that hold the step of a whole system: those of libcosim
#: and ecos, of Vico, and of OMSimulator.
_STEPS = (
    ("FixedStepAlgorithm", "baseStepSize"),
    ("FixedStepMaster", "baseStepSize"),
    ("FixedStepMaster", "stepSize"),
    ("SimulationInformation", "fixedStepSize"),
)

#: The same of a component.
_STEP_OF_A_COMPONENT = ("StepSizeHint", "value")


class Times(NamedTuple):
    """The experiment of a description [s]; None: it does not say."""

    start_time: float | None
    stop_time: float | None
    step: float | None


def times_of(archive: Archive, root: Element) -> Times:
    """The experiment that a description asks for."""
    experiment = root.find("DefaultExperiment")
    stated = (
        archive.number(element, attribute, None)
        for name, attribute in _STEPS
        for place in (experiment, root.find("System"), root)
        for element in annotated(place, name)
    )
    return Times(
        archive.number(experiment, "startTime", None),
        archive.number(experiment, "stopTime", None),
        next((step for step in stated if step is not None), None),
    )


def step_of(archive: Archive, leaf: Leaf) -> float | None:
    """The step that a component asks for [s]; None, as zero does: it has no wish."""
    name, attribute = _STEP_OF_A_COMPONENT
    for element in annotated(leaf.content, name):
        return archive.number(element, attribute, None) or None
    return None


def annotated(element: Element | None, name: str) -> Iterator[Element]:
    """Elements of a name in the annotations of an element itself."""
    if element is not None:
        for annotations in element.findall("Annotations"):
            yield from annotations.iter(name)


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
        system = _read(archive, root)
    except RecursionError:
        raise InputError(f"{path}: not a readable SSP: nested too deeply") from None
    findings.refuse()
    return system


def _read(archive: Archive, root: Element) -> System:
    definitions = definitions_of(archive, root)
    [content] = root.findall("System")[:1]
    top = Builder(archive, definitions).group(content)
    leaves = {leaf.way: leaf for leaf in top.leaves()}
    ports = _Ports(
        archive, leaves, Routes(archive, top), Bindings(archive, definitions).values(top)
    )
    components: dict[str, Component] = {}
    for leaf in leaves.values():
        name = ".".join(leaf.way)
        if name in components:
            archive.problem(f"two components are named {name}")
        if leaf.component is not None:
            components[name] = leaf.component
    times = times_of(archive, root)
    steps = {".".join(way): step_of(archive, leaf) for way, leaf in leaves.items()}
    system = System(
        name=content.get("name") or archive.path.resolve().stem,
        components=components,
        connections=tuple(ports.connections),
        parameters=ports.parameters,
        start_time=times.start_time,
        stop_time=times.stop_time,
        step=times.step,
        steps={name: step for name, step in steps.items() if step is not None},
        left_open={
            PortName(element.get("component", ""), element.get("name", ""))
            for left_open in annotated(root.find("DefaultExperiment"), LEFT_OPEN)
            for element in left_open
        },
    )
    if not leaves:
        archive.problem("holds no component: there is nothing to run")
    for problem in system.problems():
        archive.problem(problem)
    return system


@dataclass(frozen=True)
class _Arrival:
    """What is known of a value at a node.

    Attributes:
        start: where it sets out: at a component's port, or where it is given; None: there is none.
        whole: what has happened to it since.
        unit: that it has.
        error: why it cannot come so far.

    """

    start: Node | None
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
        self, archive: Archive, leaves: Mapping[Way, Leaf], routes: Routes, given: Values
    ) -> None:
        """Follow each port upstream."""
        self.connections: list[Connection] = []
        self.parameters: dict[PortName, Value] = {}
        self._archive, self._leaves, self._given = archive, leaves, given
        self._used: set[Node] = set()
        self._arrivals: dict[Node, _Arrival] = {}
        for node in dict.fromkeys((*routes.targets(), *given)):
            leaf = leaves.get(node.way)
            if leaf is not None and leaf.component is not None:
                port = PortName(leaf.component.name, node.port)
                try:
                    self._enter(port, routes.route(node), leaf)
                except InputError as error:
                    archive.problem(error)
        lost = [str(node) for node in given if node not in self._used]
        if lost:
            archive.note(f"values that are given to {listed(lost)} reach no component")

    def _enter(self, port: PortName, route: Route, leaf: Leaf) -> None:
        """Enter what arrives at a port: another's value, or the outermost that is given."""
        origin = self._leaves.get(route.origin.way) if route.segment else None
        arrival = self._arrival(route) if route.segment else self._given_to(route.node)
        if origin is None:
            self._set(port, leaf, arrival)
        elif origin.component is not None:
            source = PortName(origin.component.name, route.origin.port)
            if arrival.error is not None:
                raise InputError(f"{source} -> {port}: {arrival.error}")
            self.connections.append(Connection(source, port, arrival.whole))

    def _arrival(self, route: Route) -> _Arrival:
        """What is known of a value at the end of a route; each segment is looked at once."""
        ahead: list[Route] = []
        at: Route | None = route
        while at is not None and at.node not in self._arrivals:
            ahead.append(at)
            at = at.before
        for one in reversed(ahead):
            self._arrivals[one.node] = self._arrival_by(one)
        return self._arrivals[route.node]

    def _arrival_by(self, route: Route) -> _Arrival:
        """The same, where it is known of the course before."""
        origin = self._leaves.get(route.origin.way)
        if route.before is None or route.segment is None:
            if origin is None:
                return self._given_to(route.node)
            connector = None if origin.component is None else origin.connector(route.node.port)
            return _Arrival(route.node, unit=connector.unit if connector else None)
        before = self._arrivals[route.before.node]
        if before.start is None:
            return self._given_to(route.node)
        self._used.add(route.node)
        if origin is not None and route.node in self._given:
            self._archive.note(
                f"{route.node}: is fed by {route.origin}, and the value that is given to it has "
                "no effect"
            )
        if before.error is not None or (origin is not None and origin.component is None):
            return before
        try:
            whole, unit = route.segment.carry(self._archive, before.whole, before.unit)
        except InputError as error:
            return _Arrival(before.start, error=error)
        return _Arrival(before.start, whole, unit)

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
            whole = chained(whole, arrival.whole)
        except InputError as error:
            raise InputError(f"{arrival.start}: {error}") from None
        component, connector = leaf.component, leaf.connector(port.port)
        if component is None or connector is None:
            return
        if not component.is_settable(port.port):
            self._archive.note(
                f"{port}: is of causality {connector.causality} and cannot be set; the value that "
                "is given to it has no effect"
            )
            return
        items = {**connector.items, **given.items}
        value: object = items.get(given.text, given.text)
        if whole is not None:
            value = whole(_number(port, str(value)))
        if isinstance(value, float) and value.is_integer() and connector.type != "Real":
            value = int(value)
        self.parameters[port] = typed(str(port), component.variable(port.port), value)


def _number(port: PortName, text: str) -> float:
    """A value that is transformed, as a number."""
    try:
        return float(BOOLEANS[text]) if text in BOOLEANS else real(text)
    except ValueError:
        raise InputError(
            f"{port} = {shortened(text)}: not a number, so it can be neither converted nor "
            "transformed"
        ) from None
