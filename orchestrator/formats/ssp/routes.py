"""Connections between components, followed through the connectors of the systems around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive
from orchestrator.formats.ssp.hierarchy import (
    GIVES,
    TAKES,
    Bus,
    Connector,
    Group,
    Leaf,
    Node,
    converts_units,
    transformation_of,
)
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.system.units import Linear, Transformation, Unit, chained

#: Parts of arrays and the like, which FMI 2.0 does not have.
_UNSUPPORTED = ("startIndices", "endIndices")


@dataclass(frozen=True)
class Segment:
    """One connection of a file, which ends in a node.

    Attributes:
        source: where its value comes from.
        unit: of its target; None: it is the one that arrives.
        stated: transformation of the value, after its unit has been converted.
        converts: whether its unit is converted.

    """

    source: Node
    unit: Unit | None
    stated: Transformation | None
    converts: bool

    def carry(
        self, archive: Archive, whole: Transformation | None, unit: Unit | None
    ) -> tuple[Transformation | None, Unit | None]:
        """What has happened to a value at the segment's end, and the unit that it has there.

        Args:
            archive: whose connection it is.
            whole: what has happened to it before.
            unit: in which it comes.

        Raises:
            InputError: units do not fit, or transformations cannot follow each other.

        """
        step = self.stated
        if self.converts:
            step = chained(archive.conversion(unit, self.unit), step)
            # What a transformation makes of a value is in the target's unit, or unknown.
            unit = self.unit or (unit if self.stated is None else None)
        else:
            # Said even where it changes nothing: the units at its ends may differ.
            step, unit = step or Linear(), self.unit
        return chained(whole, step), unit


@dataclass(frozen=True, eq=False)
class Route:
    """How a value comes to a node; routes share what they have in common.

    Attributes:
        node: where it comes to.
        origin: where it comes from: the node itself, if nothing feeds that.
        before: how it comes to the end of the last segment; None: nothing feeds the node.
        segment: the last one.

    """

    node: Node
    origin: Node
    before: Route | None = None
    segment: Segment | None = None


class Routes:
    """All connections of a system and of those in it, by their targets."""

    def __init__(self, archive: Archive, top: Group) -> None:
        """Read them; what is wrong with them becomes problems of the archive."""
        self._archive = archive
        self._segments: dict[Node, Segment] = {}
        self._routes: dict[Node, Route] = {}
        self._circling: set[Node] = set()
        self._read(top)

    def targets(self) -> Iterator[Node]:
        """All nodes that are fed, in the order in which the file has their connections."""
        yield from self._segments

    def route(self, node: Node) -> Route:
        """Follow a port upstream.

        Raises:
            InputError: its connections lead in a circle.

        """
        # What another port has been followed through is known: all of them take linear time.
        upstream: dict[Node, Segment] = {}
        at = node
        while at not in self._routes and (segment := self._segments.get(at)) is not None:
            if at in upstream or segment.source in self._circling:
                self._circling.update(upstream, [at])
                raise InputError(f"{node}: the connections that feed it lead in a circle")
            upstream[at] = segment
            at = segment.source
        route = self._routes.setdefault(at, Route(at, at))
        for target, segment in reversed(upstream.items()):
            route = self._routes[target] = Route(target, route.origin, route, segment)
        return route

    def _read(self, group: Group) -> None:
        for connection in group.content.findall("Connections/Connection"):
            try:
                self._add(group, connection)
            except InputError as error:
                self._archive.problem(error)
        for element in group.members.values():
            if isinstance(element, Group):
                self._read(element)

    def _add(self, group: Group, connection: Element) -> None:
        start, end = (_End.of(group, connection, which) for which in ("start", "end"))
        named = f"{start.node} -> {end.node}"
        if any(connection.get(name) for name in _UNSUPPORTED):
            raise InputError(f"{named}: connections of elements of arrays are not supported")
        # The standard lets a connection be written from either end.
        backwards = start.takes or end.gives
        if (start.takes and end.takes) or (start.gives and end.gives):
            both = "take their value from elsewhere" if start.takes else "give one"
            raise InputError(f"{named}: cannot be connected, as both {both}")
        source, target = (end, start) if backwards else (start, end)
        before = self._segments.get(target.node)
        if before is not None:
            raise InputError(
                f"{target.node} is fed by {before.source} and by {source.node}; an input takes one "
                "connection"
            )
        try:
            stated = transformation_of(connection, source.connector.items, target.connector.items)
        except InputError as error:
            raise InputError(f"{named}: {error}") from None
        self._segments[target.node] = Segment(
            source.node, target.connector.unit, stated, converts_units(connection)
        )


@dataclass(frozen=True)
class _End:
    """An end of a connection, as the system sees it in which the connection is.

    Attributes:
        node: where it is.
        connector: what is known of it.
        gives, takes: which way its value goes; neither: both are possible.

    """

    node: Node
    connector: Connector
    gives: bool
    takes: bool

    @classmethod
    def of(cls, group: Group, connection: Element, which: str) -> _End:
        """The start or the end of a connection."""
        # Some writers leave it empty where it is the system itself.
        name, port = connection.get(f"{which}Element") or None, connection.get(f"{which}Connector")
        if not port:
            raise InputError(f"a <{connection.tag}> without {which}Connector")
        element: Leaf | Bus | Group | None = group if name is None else group.members.get(name)
        if element is None:
            raise InputError(
                f"a connection to {Node((*group.way, name or ''), port)}: "
                f"there is no element {name!r}{did_you_mean(name or '', group.members)}"
            )
        connector = element.connector(port)
        if connector is None:
            if isinstance(element, Leaf) and element.component is not None:
                element.component.variable(port)
            raise InputError(
                f"a connection to {Node(element.way, port)}, which is not there"
                f"{did_you_mean(port, element.connectors)}"
            )
        outwards, inwards = connector.causality in GIVES, connector.causality in TAKES
        # Seen from within, a system's inputs give and its outputs take.
        gives, takes = (inwards, outwards) if element is group else (outwards, inwards)
        return cls(Node(element.way, port), connector, gives, takes)
