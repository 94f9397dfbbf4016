"""A system as an SSP nests it: systems in systems, and connectors where a value crosses a border.

The dots of a component's name say which systems it is in: `fleet.one.part` is the element `part`
of the system `one` of the system `fleet`. A value that leaves or enters a system has one connector
there, however many inputs it feeds beyond it. It passes all borders as it is, an array as a whole:
only the last connection on its way picks an element, or transforms it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fmpy.model_description import ModelVariable

from orchestrator.formats.ssp.hierarchy import Way
from orchestrator.system.component import Component
from orchestrator.system.connection import Connection
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.variables import array_of, element_names


class End(NamedTuple):
    """An end of a line.

    Attributes:
        element: None: it is at the border of the system itself.
        connector: of the element.
        indices: of one element of an array; None: it is all of it, or a scalar.

    """

    element: str | None
    connector: str
    indices: str | None = None


class Line(NamedTuple):
    """A connection within one system.

    Attributes:
        start, end: its ends.
        connection: whose target it ends at; None: it ends at a border.

    """

    start: End
    end: End
    connection: Connection | None = None


class Crossing(NamedTuple):
    """A connector of a system.

    Attributes:
        kind: input or output.
        component: whose output crosses the border there.
        variable: that output, or an element of the array that it is.

    """

    kind: str
    component: Component
    variable: ModelVariable


@dataclass
class Nest:
    """A system.

    Attributes:
        elements: components and systems in it, by their names there.
        connectors: of its border, by their names.
        lines: connections within it.

    """

    elements: dict[str, Component | Nest] = field(default_factory=dict)
    connectors: dict[str, Crossing] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)
    _taken: set[str] = field(default_factory=set)
    _crossing: dict[PortName, str] = field(default_factory=dict)

    def inner(self, name: str) -> Nest:
        """A system in it, which is made if it is not there."""
        nest = self.elements.setdefault(name, Nest())
        assert isinstance(nest, Nest)
        return nest

    def cross(self, output: PortName, label: str, crossing: Crossing) -> tuple[str, bool]:
        """The connector at which an output crosses the border, and whether it is a new one.

        Args:
            output: of a component, as a whole.
            label: what the connector is called if nothing else is.
            crossing: what it is.

        """
        if output in self._crossing:
            return self._crossing[output], False
        shape = crossing.variable.shape or ()
        # Tools take for a port of an element what begins with its name.
        while (
            not self._taken.isdisjoint(names := {label, *element_names(label, shape)})
            or label in self.elements
            or any(label[:i] in self.elements for i, c in enumerate(label) if c == ".")
        ):
            label = f"_{label}"
        self._taken |= names
        self._crossing[output] = label
        self.connectors[label] = crossing
        return label, True


def nested(system: System) -> Nest:
    """A system, nested as the names of its components say."""
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
    return top


def order_of(nest: Nest) -> list[str]:
    """The names of all components in the order in which they are nested."""
    found: list[str] = []
    for element in nest.elements.values():
        found += order_of(element) if isinstance(element, Nest) else [element.name]
    return found


def _place(name: str, components: Collection[str]) -> tuple[Way, str]:
    """The systems that a component is in, and its name there.

    A part without letters names no system, nor does one that is the name of another component.
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
    places: Mapping[str, tuple[Way, str]],
    system: System,
    connection: Connection,
    is_whole: bool,
) -> None:
    """Draw the lines of a connection, from the system of its source to the one of its target."""
    source, target = connection.source, connection.target
    component = system.component(source.component)
    variable = component.variable(source.port)
    array = array_of(variable)
    output = PortName(source.component, array)
    (outwards, element), (inwards, last) = places[source.component], places[target.component]
    path = (*outwards, element)
    shared = _shared(outwards, inwards)
    leaving, entering = _nests(top, outwards), _nests(top, inwards)
    start = End(element, array)
    for depth in range(len(outwards), shared, -1):
        label = f"{'_'.join(path[depth:])}_{array}"
        crossing = Crossing("output", component, variable)
        name, is_new = leaving[depth].cross(output, label, crossing)
        if is_new:
            leaving[depth].lines.append(Line(start, End(None, name)))
        start = End(outwards[depth - 1], name)
    for depth in range(shared, len(inwards)):
        label = f"{'_'.join(path[shared:])}_{array}"
        crossing = Crossing("input", component, variable)
        name, is_new = entering[depth + 1].cross(output, label, crossing)
        if is_new:
            entering[depth].lines.append(Line(start, End(inwards[depth], name)))
        start = End(None, name)
    end = End(last, array_of(system.component(target.component).variable(target.port)))
    if not is_whole:
        start = start._replace(indices=_indices(system, source))
        end = end._replace(indices=_indices(system, target))
    entering[-1].lines.append(Line(start, end, connection))


def _shared(one: Way, other: Way) -> int:
    """How many systems two ways share."""
    same = (a == b for a, b in zip(one, other, strict=False))
    return next((n for n, is_same in enumerate(same) if not is_same), min(len(one), len(other)))


def _nests(top: Nest, way: Way) -> list[Nest]:
    """The systems on a way, the outermost first."""
    found = [top]
    for part in way:
        found.append(found[-1].inner(part))
    return found


def _indices(system: System, port: PortName) -> str | None:
    """The place of an element in its array, as SSP 2.0 writes it; None: it is a scalar."""
    variable = system.component(port.component).variable(port.port)
    if not variable.shape:
        return None
    return port.port.removeprefix(array_of(variable))[1:-1].replace(",", " ")


def _whole(
    connection: Connection, system: System, connected: Collection[Connection]
) -> set[Connection]:
    """All connections between two arrays that are connected as a whole; empty: they are not."""
    start, end = connection.source, connection.target
    starts, ends = system.component(start.component), system.component(end.component)
    source, target = starts.variable(start.port), ends.variable(end.port)
    if not source.shape or source.shape != target.shape:
        return set()
    members = zip(starts.elements(array_of(source)), ends.elements(array_of(target)), strict=True)
    found = {
        replace(
            connection,
            source=PortName(start.component, a.name),
            target=PortName(end.component, b.name),
        )
        for a, b in members
    }
    return found if found.issubset(connected) else set()
