"""Connections through many connectors: the same as followed one by one, and in linear time."""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.cosim.connection import Connection, PortName, combine
from orchestrator.cosim.formats import ssp_reader as reader
from orchestrator.cosim.formats.ssp_reader import Node
from orchestrator.machine.errors import Findings, InputError
from support.archives import (
    archive,
    binding,
    component,
    connection,
    connector,
    described,
    fmu,
    system,
    variable,
)

#: Ports of the component, and connectors of the system around it.
PORTS, CONNECTORS = 6, 8

TRANSFORMATIONS = (
    "",
    '<ssc:LinearTransformation factor="0.3" offset="0.1"/>',
    '<ssc:LinearTransformation factor="1.7"/>',
    '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
    "</ssc:IntegerMappingTransformation>",
)

units = st.sampled_from(["", "m", "mm", "km", "K", "furlong"])


class OneByOne(reader._Ports):
    """Each port followed upstream by itself, and its way transformed from its beginning."""

    def __init__(self, archive, leaves, segments, given) -> None:
        self.connections, self.parameters = [], {}
        self._archive, self._leaves, self._given = archive, leaves, given
        used: set[Node] = set()
        for node in dict.fromkeys((*segments, *given)):
            leaf = leaves.get(node.way)
            if leaf is not None and leaf.component is not None:
                port = PortName(leaf.component.name, node.port)
                try:
                    self._follow(port, node, leaf, segments, used)
                except InputError as error:
                    archive.problem(error)
        lost = [str(node) for node in given if node not in used]
        if lost:
            archive.note(f"values that are given to {reader.listed(lost)} reach no component")

    def _follow(self, port, node, leaf, segments, used) -> None:
        nodes, ways = [node], []
        while (segment := segments.get(nodes[0])) is not None:
            if segment.source in nodes:
                raise InputError(f"{node}: the connections that feed it form a circle")
            nodes.insert(0, segment.source)
            ways.insert(0, segment)

        def carried(unit, first=0):
            whole = None
            for segment in ways[first:]:
                whole, unit = segment.carry(self._archive, whole, unit)
            return whole

        origin = self._leaves.get(nodes[0].way) if ways else None
        used.update(nodes[1:] if origin else nodes)
        if origin is not None:
            for passed in nodes[1:]:
                if passed in self._given:
                    self._archive.note(
                        f"{passed}: is fed by {nodes[0]}, and the value that is given to it has "
                        "no effect"
                    )
            source = PortName(origin.component.name, nodes[0].port)
            try:
                whole = carried(origin.connector(source.port).unit)
            except InputError as error:
                raise InputError(f"{source} -> {port}: {error}") from None
            self.connections.append(Connection(source, port, whole))
            return
        for i, start in enumerate(nodes):
            if start in self._given:
                value, known = self._given[start]
                try:
                    first = value.transformation(self._archive, known)
                    whole = combine(first, carried(known.unit or value.unit, i))
                except InputError as error:
                    raise InputError(f"{start}: {error}") from None
                self._set(port, leaf, reader._Arrival(start, whole=whole))
                return


def read(path: Path, ports: type[reader._Ports]):
    """What is read of an archive, right or wrong."""
    findings = Findings()
    with patch.object(reader, "_Ports", ports), findings.collecting():
        found = reader.read_ssp(path, findings=findings)
        return found.connections, found.parameters, sorted(findings.notes)
    return findings.problems, sorted(findings.notes)


@st.composite
def descriptions(draw) -> str:
    """A component in a system with connectors, any of which may feed any other once."""
    inner = [f"c{i}" for i in range(CONNECTORS)]
    ports = [f"a.u{i}" for i in range(PORTS)]
    routes = []
    for target in draw(st.permutations([*inner, *ports])):
        source = draw(st.sampled_from(["", *inner, *inner, "a.y0", "a.y1"]))
        if source:
            inside = draw(st.sampled_from(TRANSFORMATIONS[:1] * 4 + TRANSFORMATIONS))
            more = draw(st.sampled_from([{}, {}, {"suppressUnitConversion": "true"}]))
            routes.append(connection(source, target, inside, **more))
    values = dict.fromkeys(
        draw(st.lists(st.sampled_from([*inner, *ports]), max_size=5, unique=True)), 'Real value="3"'
    )
    return described(
        system(
            system(
                component("a"),
                "".join(routes),
                "".join(connector(name, "inout", draw(units)) for name in inner),
                name="inner",
                bindings=binding(values) if values else "",
            )
        )
    )


@settings(max_examples=150)
@given(description=descriptions(), unit=st.sampled_from(["m", "K", ""]))
def test_ports_get_what_each_gets_that_is_followed_by_itself(description: str, unit: str):
    with tempfile.TemporaryDirectory() as folder:
        one = fmu(
            Path(folder, "a.fmu"),
            *(variable(f"u{i}", "input", unit=unit) for i in range(PORTS)),
            *(variable(f"y{i}", "output", unit=unit) for i in range(2)),
        )
        path = archive(Path(folder, "x.ssp"), description, {"a.fmu": one})
        assert read(path, reader._Ports) == read(path, OneByOne)


def test_long_way_to_many_ports_is_gone_once(tmp_path: Path):
    """Followed port by port, this would take hours."""
    n = 3000
    chain = [f"c{i}" for i in range(n)]
    ports = [f"a.u{i}" for i in range(n)]
    routes = [connection("a.y", "c0"), *(connection(*pair) for pair in pairwise(chain))]
    routes += [connection(chain[-1], port) for port in ports]
    one = fmu(
        tmp_path / "a.fmu",
        variable("y", "output"),
        *(variable(f"u{i}", "input") for i in range(n)),
    )
    text = described(
        system(component("a"), "".join(routes), "".join(connector(c, "inout") for c in chain))
    )
    found = reader.read_ssp(archive(tmp_path / "x.ssp", text, {"a.fmu": one}))
    assert found.connections == tuple(
        Connection(PortName("a", "y"), PortName("a", f"u{i}")) for i in range(n)
    )
