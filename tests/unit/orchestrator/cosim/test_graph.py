"""What depends on what in a system, and the orders that follow, against definitions on sets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import TypeAlias

from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.connection import Connection, PortName
from orchestrator.cosim.system import System

NAMES = "abcdefg"

Edge: TypeAlias = tuple[str, str]

#: Outputs `g` follow from inputs at once, outputs `x` from a state.
_COMPONENT = SimpleNamespace(has_feedthrough=lambda port: port == "g")


def system_of(names: Iterable[str], through: Iterable[Edge], states: Iterable[Edge] = ()) -> System:
    edges = [(*edge, "g") for edge in through] + [(*edge, "x") for edge in states]
    connections = [
        Connection(PortName(source, port), PortName(target, f"{port} of {source}"))
        for source, target, port in edges
    ]
    return System("s", dict.fromkeys(names, _COMPONENT), tuple(connections))


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[str], set[Edge], set[Edge]]:
    """Components in any order, connections with feedthrough, and others."""
    names = draw(st.permutations(NAMES[: draw(st.integers(1, 7))]))
    name = st.sampled_from(names)
    through, states = (draw(st.sets(st.tuples(name, name), max_size=14)) for _ in range(2))
    return names, through, states


def reached(names: Iterable[str], edges: set[Edge]) -> set[Edge]:
    """Which component reaches which, by paths of one edge and more."""
    found = set(edges)
    for middle in names:
        found |= {(a, d) for a, b in found for c, d in found if b == c == middle}
    return found


def strong_parts(names: Sequence[str], edges: set[Edge]) -> set[frozenset[str]]:
    """Components that reach each other, or themselves."""
    paths = reached(names, edges)
    return {
        frozenset({a} | {b for b in names if (a, b) in paths and (b, a) in paths})
        for a in names
        if (a, a) in paths
    }


def opened(names: Sequence[str], edges: set[Edge]) -> set[Edge]:
    """The edges that come late: of each ring what feeds its first component, until none is left."""
    late: set[Edge] = set()
    while parts := strong_parts(names, edges - late):
        for part in parts:
            first = min(part, key=names.index)
            late |= {(source, first) for source in part} & edges
    return late


def ends(connections: Iterable[Connection]) -> list[Edge]:
    return sorted((c.source.component, c.target.component) for c in connections)


@given(graphs(), st.sets(st.sampled_from(NAMES)))
def test_rings_are_the_components_that_reach_each_other(graph, some):
    names, through, states = graph
    system = system_of(names, through, states)
    found = system.rings()
    assert {frozenset(ring) for ring in found} == strong_parts(names, through)
    assert len(found) == len(strong_parts(names, through))
    assert all(ring[0] == min(ring, key=names.index) for ring in found)
    within = {edge for edge in through if some.issuperset(edge)}
    assert {frozenset(ring) for ring in system.rings(some)} == strong_parts(names, within)


@given(graphs())
def test_only_what_opens_a_ring_is_late_in_the_derived_order(graph):
    names, through, states = graph
    system = system_of(names, through, states)
    order = system.derived_order()
    assert sorted(order) == sorted(names)
    late = {(a, b) for a, b in through if order.index(a) >= order.index(b)}
    assert late == opened(names, through)
    assert ends(system.delayed_connections(order)) == sorted(late)


@given(graphs())
def test_nothing_is_late_where_rings_are_solved(graph):
    names, through, states = graph
    system = system_of(names, through, states)
    solved = system.rings()
    order = system.derived_order(solved)
    assert sorted(order) == sorted(names)
    assert system.delayed_connections(order, solved) == []
    for ring in solved:
        first = order.index(ring[0])
        assert order[first : first + len(ring)] == ring


@given(graphs(), st.randoms(use_true_random=False), st.booleans())
def test_stages_keep_the_order_of_every_feedthrough(graph, random, are_solved):
    names, through, states = graph
    system = system_of(names, through, states)
    solved = system.rings() if are_solved else []
    order = system.derived_order(solved)
    if not are_solved:
        random.shuffle(order)
    stages = system.in_stages(order, solved)
    stage_of = {name: i for i, stage in enumerate(stages) for name in stage}
    assert sorted(name for stage in stages for name in stage) == sorted(names)
    one = {frozenset(ring) for ring in solved}
    for a, b in through:
        if not any({a, b} <= ring for ring in one) and order.index(a) < order.index(b):
            assert stage_of[a] < stage_of[b]
    for ring in one:
        assert len({stage_of[name] for name in ring}) == 1
    members = frozenset().union(*one)
    assert all(members.issuperset(stage) or members.isdisjoint(stage) for stage in stages)
    if not are_solved:
        assert [name for stage in stages for name in stage] == order
        # A new stage is begun only where a component takes what the one before has computed.
        for before, stage in pairwise(stages):
            assert any((a, stage[0]) in through for a in before)


def test_what_reaches_a_component_is_followed_upstream_to_where_it_may_go():
    system = system_of("abcde", [("a", "b"), ("b", "c"), ("c", "b")], [("d", "a"), ("c", "e")])
    assert ends(system.reaching("c", set())) == [("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")]
    assert ends(system.reaching("c", {"b"})) == [("b", "c")]
    assert ends(system.reaching("d", set())) == []
