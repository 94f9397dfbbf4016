"""A system as an SSP nests it: systems in systems, and connectors where a value crosses a border.

The dots of a component's name say which systems it is in: `fleet.one.part` is the element `part`
of the system `one` of the system `fleet`. A value that leaves or enters a system has one connector
there, however many inputs it feeds beyond it. It passes all borders as it is, an array as a whole:
only the last connection on its way picks an element, or transforms it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

from orchestrator.cosim.formats.ssp.hierarchy import Way
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.variables import Variable

#: The systems that a component is in, and its name there.
Place: TypeAlias = tuple[Way, str]


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
        connection: whose target it ends at; None: there is none.

    """

    start: End
    end: End
    connection: Connection | None = None


class Crossing(NamedTuple):
    """A connector of a system.

    Attributes:
        kind: input or output.
        component: whose port crosses the border there.
        variable: that port, or an element of the array that it is.

    """

    kind: str
    component: Component
    variable: Variable


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
    _crossing: dict[PortName, str] = field(default_factory=dict)

    def inner(self, name: str) -> Nest:
        """A system in it, which is made if it is not there."""
        nest = self.elements.setdefault(name, Nest())
        assert isinstance(nest, Nest)
        return nest

    def cross(self, crossing: Crossing) -> tuple[str, bool]:
        """The connector at which a port crosses the border, and whether it is a new one.

        It is named after the port in all of the system: an identifier, as OMSimulator takes no
        other, and one that no other system has, as it puts those of several systems into one.
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
    """A system, nested as the names of its components say.

    Args:
        system: it.
        offered: what crosses the border of the outermost system.

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
    """What a system offers to one around it: all outputs, and inputs without feed or value."""
    for name, component in system.components.items():
        open_inputs = set(system.open_inputs(name))
        for causality in ("input", "output"):
            ports = {variable.array: variable for variable in component.having(causality)}
            for array, variable in ports.items():
                members = {element.name for element in component.elements(array)}
                if causality == "output" or members <= open_inputs:
                    yield Crossing(causality, component, variable)


def order_of(nest: Nest) -> list[str]:
    """The names of all components in the order in which they are nested."""
    found: list[str] = []
    for element in nest.elements.values():
        found += order_of(element) if isinstance(element, Nest) else [element.name]
    return found


def _place(name: str, components: Collection[str]) -> Place:
    """Where the name of a component puts it.

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
    places: Mapping[str, Place],
    system: System,
    connection: Connection,
    is_whole: bool,
) -> None:
    """Draw the lines of a connection, from the system of its source to the one of its target."""
    source, target = connection.source, connection.target
    component = system.component(source.component)
    variable = component.variable(source.port)
    inwards, last = places[target.component]
    shared = _shared(places[source.component][0], inwards)
    start = _out(top, places[source.component], Crossing("output", component, variable), shared)
    start = _in(top, inwards, start, Crossing("input", component, variable), shared)
    end = End(last, system.component(target.component).variable(target.port).array)
    if not is_whole:
        start = start._replace(indices=_indices(system, source))
        end = end._replace(indices=_indices(system, target))
    _nests(top, inwards)[-1].lines.append(Line(start, end, connection))


def _offer(top: Nest, place: Place, offer: Crossing) -> None:
    """Draw the lines between a port and the border of the outermost system."""
    way, local = place
    name, _ = top.cross(offer)
    border = End(None, name)
    if offer.kind == "output":
        top.lines.append(Line(_out(top, place, offer, 0), border))
    else:
        end = End(local, offer.variable.array)
        _nests(top, way)[-1].lines.append(Line(_in(top, way, border, offer, 0), end))


def _out(top: Nest, place: Place, crossing: Crossing, shared: int) -> End:
    """Lead an output out of all systems that it is in but some; returns where it is then."""
    way, local = place
    nests, end = _nests(top, way), End(local, crossing.variable.array)
    for depth in range(len(way), shared, -1):
        name, is_new = nests[depth].cross(crossing)
        if is_new:
            nests[depth].lines.append(Line(end, End(None, name)))
        end = End(way[depth - 1], name)
    return end


def _in(top: Nest, way: Way, start: End, crossing: Crossing, shared: int) -> End:
    """Lead a value into all systems on a way but some; returns where it is then."""
    nests = _nests(top, way)
    for depth in range(shared, len(way)):
        name, is_new = nests[depth + 1].cross(crossing)
        if is_new:
            nests[depth].lines.append(Line(start, End(way[depth], name)))
        start = End(None, name)
    return start


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
    return port.port.removeprefix(variable.array)[1:-1].replace(",", " ")


def _whole(
    connection: Connection, system: System, connected: Collection[Connection]
) -> set[Connection]:
    """All connections between two arrays that are connected as a whole; empty: they are not."""
    start, end = connection.source, connection.target
    starts, ends = system.component(start.component), system.component(end.component)
    source, target = starts.variable(start.port), ends.variable(end.port)
    if not source.shape or source.shape != target.shape:
        return set()
    members = zip(starts.elements(source.array), ends.elements(target.array), strict=True)
    found = {
        replace(
            connection,
            source=PortName(start.component, a.name),
            target=PortName(end.component, b.name),
        )
        for a, b in members
    }
    return found if found.issubset(connected) else set()
