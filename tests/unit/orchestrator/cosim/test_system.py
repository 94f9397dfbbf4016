"""Names of ports in a system; dependencies of components, and orders that follow from them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.component import read_component
from orchestrator.cosim.connection import Connection, Linear, PortName
from orchestrator.cosim.system import System, _is_like
from orchestrator.machine.errors import InputError
from support.archives import fmu, variable


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    folder: Path = tmp_path_factory.mktemp("fmus")
    path = fmu(
        folder / "a.fmu", variable("k", "parameter"), variable("p.q", "parameter"),
        variable("y", "output"),
    )  # fmt: skip
    return System("s", {name: read_component(name, path) for name in ("a", "a.b", "c d")}, ())


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> System:
    """A component with groups, whose members are not declared in the order of their names."""
    variables = [variable(f"v[{i}]", "parameter") for i in (3, 1, 2)]
    variables += [variable(f"y[{i}]", "output") for i in (1, 2)]
    path = fmu(tmp_path_factory.mktemp("b") / "b.fmu", *variables, variable("w", "parameter"))
    return System("s", {"a.b": read_component("a.b", path)}, ())


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("a.k", ("a", "k")),
        ("a.b.k", ("a.b", "k")),
        ("a.p.q", ("a", "p.q")),
        ("a.b.p.q", ("a.b", "p.q")),
        ("c d.p.q", ("c d", "p.q")),
    ],
)
def test_name_belongs_to_the_longest_component_that_has_such_a_port(system, text, port):
    assert system.named(PortName.read(text)) == PortName(*port)
    assert system.has(PortName.read(text))
    changed = system.with_parameters({PortName.read(text): 3})
    assert changed.parameters == {PortName(*port): 3.0}
    assert changed.value(PortName.read(text)) == 3.0
    changed.check()


def test_two_ports_of_one_name_are_refused(system, tmp_path: Path):
    fmu(tmp_path / "q.fmu", variable("q", "parameter"))
    again = System("s", {**system.components, "a.p": read_component("a.p", tmp_path / "q.fmu")}, ())
    with pytest.raises(InputError, match=r"two ports are named a\.p\.q"):
        again.check()


def test_name_of_no_port_is_refused(system):
    assert not system.has(PortName.read("a.b.x"))
    with pytest.raises(InputError, match=r"a\.b has no port or parameter 'x'"):
        system.with_parameters({PortName.read("a.b.x"): 1})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("auv1.plnt.eta.x", r"no component 'auv1\.plnt'; .*; did you mean auv1\.plant"),
        ("auv1.plant.eta.w", r"auv1\.plant has no port or parameter 'eta\.w'"),
        ("auv2.k", r"no component 'auv2'; it has auv1\.a, .* and 1 more"),
        ("other.plant.k", r"no component 'other'; it has"),
    ],
)
def test_what_was_meant_is_said_of_components_in_systems(tmp_path: Path, text: str, words: str):
    path = fmu(tmp_path / "a.fmu", variable("k", "parameter"), variable("eta.x", "parameter"))
    names = [f"auv1.{name}" for name in ("a", "b", "c", "d", "e", "plant")]
    system = System("s", {name: read_component(name, path) for name in names}, ())
    with pytest.raises(InputError, match=words):
        system.with_parameters({text: 1})


def test_name_without_a_component_is_refused_with_those_that_have_it(system):
    with pytest.raises(InputError, match=r"'k': .*; did you mean a\.k or a\.b\.k or c d\.k\?"):
        system.with_parameters({"k": 1})
    with pytest.raises(InputError, match=r"'z': write COMPONENT\.PORT or COMPONENT\.PARAMETER$"):
        system.with_parameters({"z": 1})


def test_output_that_is_calculated_cannot_be_set(system):
    with pytest.raises(InputError, match=r"a\.y has causality output and cannot be set"):
        system.with_parameters({PortName.read("a.y"): 1.0}).check()


@given(st.lists(st.integers(-9, 9), min_size=1, max_size=6), st.booleans())
def test_list_for_a_group_has_a_value_for_each_member(several, values, as_text):
    """In the order of declaration; a list of another length is refused."""
    given = ", ".join(map(str, values)) if as_text else values
    name = PortName.read("a.b.v")
    if len(values) == 3:
        members = [PortName("a.b", f"v[{i}]") for i in (3, 1, 2)]
        changed = several.with_parameters({PortName.read("a.b.w"): 1.0, name: given})
        assert changed.parameters == dict(zip(members, map(float, values), strict=True)) | {
            PortName("a.b", "w"): 1.0
        }
    else:
        # A text with one number is not a list.
        is_one = as_text and len(values) == 1
        what = r"a list of 3 values, for a\.b\.v\[3\]" if is_one else f"3 values, not {len(values)}"
        with pytest.raises(InputError, match=rf"a\.b\.v: takes {what}"):
            several.with_parameters({name: given})


def test_last_value_of_a_port_wins(several):
    group, member = PortName.read("a.b.v"), PortName.read("a.b.v[1]")
    for values, wanted in (
        ({group: [1, 2, 3], member: 9}, 9.0),
        ({member: 9, group: [1, 2, 3]}, 2.0),
    ):
        assert several.with_parameters(values).value(member) == wanted


def test_outputs_and_single_ports_take_no_list(several):
    for name in ("a.b.y", "a.b.w", "a.b.none", "c.v"):
        with pytest.raises(InputError):
            several.with_parameters({PortName.read(name): [1.0, 2.0]})


def test_array_without_dimensions_is_one_value(several):
    assert (
        several.with_parameters({PortName.read("a.b.w"): np.array(2.0)}).value(
            PortName.read("a.b.w")
        )
        == 2.0
    )
    with pytest.raises(InputError, match="a list of 3 values"):
        several.with_parameters({PortName.read("a.b.v"): np.array(2.0)})


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> System:
    """Three components of one name in systems of their own, and one outside."""
    parameters = [variable(name, "parameter") for name in ("k", "v[1]", "v[2]")]
    path = fmu(tmp_path_factory.mktemp("fleet") / "a.fmu", *parameters)
    names = ("auv1.a", "auv2.a", "auv10.a", "a", "auv1.b.a")
    return System("s", {name: read_component(name, path) for name in names}, ())


@pytest.mark.parametrize(
    ("values", "k"),
    [
        ({"auv*.a.k": 3.0}, {"auv1.a": 3.0, "auv2.a": 3.0, "auv10.a": 3.0}),
        ({"auv2.a.k": 4.0, "auv*.a.k": 3.0}, {"auv1.a": 3.0, "auv2.a": 4.0, "auv10.a": 3.0}),
        (
            {"auv*.a.k": {"first": 1, "step": 0.5}},
            {"auv1.a": 1.0, "auv2.a": 1.5, "auv10.a": 2.0},
        ),
        ({"auv*.a.k": {"each": [7, 8, 9]}}, {"auv1.a": 7.0, "auv2.a": 8.0, "auv10.a": 9.0}),
        ({"*.b.a.k": 2.0}, {"auv1.b.a": 2.0}),
        ({"*.k": 2.0}, {"a": 2.0}),
    ],
)
def test_a_star_stands_for_a_part_of_a_component_s_name(fleet, values, k):
    expected = {PortName(component, "k"): value for component, value in k.items()}
    assert fleet.with_parameters(values).parameters == expected
    assert fleet.with_parameters({PortName.read(n): v for n, v in values.items()}).parameters == (
        expected
    )


@given(
    st.text("ab?[.", max_size=9).map(lambda text: f"a{text}"),
    st.text("ab?[.*", max_size=9),
)
def test_stars_stand_for_text_without_dots(name, pattern):
    """Compared with regular expressions."""
    words = "".join("[^.]*" if letter == "*" else re.escape(letter) for letter in pattern)
    assert _is_like(name, pattern) == bool(re.fullmatch(words, name))


def test_many_stars_are_matched_at_once():
    """A search that doubles with each star would not end."""
    assert not _is_like(100 * "a", 60 * "a*" + "b")


def test_a_list_for_a_group_of_several_components_is_of_each(fleet):
    found = fleet.with_parameters({"auv*.a.v": [1.0, 2.0]}).parameters
    of_each = {PortName("auv2.a", "v[1]"): 1.0, PortName("auv2.a", "v[2]"): 2.0}
    assert len(found) == 6 and of_each.items() <= found.items()
    assert fleet.named(PortName.read("auv*.a.k")) == PortName("auv1.a", "k")
    assert not fleet.has(PortName.read("auv*.c.k"))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"each": [1.0]}, "3 values"),
        ({"each": 1.0}, "3 values"),
        ({"first": "x", "step": 1.0}, "finite"),
        ({"first": 1.0, "step": float("nan")}, "finite"),
    ],
)
def test_values_of_several_components_must_be_as_many(fleet, value, words):
    with pytest.raises(InputError, match=rf"auv\*\.a\.k.*{words}"):
        fleet.with_parameters({"auv*.a.k": value})


# Other names for components


def chain_of(folder: Path, *names: str) -> System:
    ports = variable("u.x", "input"), variable("y", "output"), variable("k", "parameter")
    path = fmu(folder / "a.fmu", *ports)
    first, last = names[0], names[-1]
    return System(
        "s",
        {name: read_component(name, path) for name in names},
        (Connection(PortName(first, "y"), PortName(last, "u.x"), Linear(2.0)),),
        {PortName(last, "k"): 3.0},
        steps={first: 0.5},
        left_open={PortName(first, "u.x")},
    )


def test_a_renamed_component_has_its_new_name_everywhere(tmp_path: Path):
    system = chain_of(tmp_path, "a", "b", "c").renamed({"a": "v.a", "c": "a"})
    assert [(name, part.name) for name, part in system.components.items()] == [
        ("v.a", "v.a"), ("b", "b"), ("a", "a"),
    ]  # fmt: skip
    assert system.connections == (
        Connection(PortName("v.a", "y"), PortName("a", "u.x"), Linear(2.0)),
    )
    assert system.parameters == {PortName("a", "k"): 3.0}
    assert system.steps == {"v.a": 0.5}
    assert system.left_open == {PortName("v.a", "u.x")}
    assert system.parameters_of("a") == {"k": 3.0} and system.open_inputs("a") == []


def test_flat_names_are_distinct(tmp_path: Path):
    names = ["v.a", "v_a", "v.a_", "w", "v_.a", "v.b.c", "v.b_c"]
    system = chain_of(tmp_path, *names).flattened()
    assert list(system.components) == ["v_a_", "v_a", "v_a__", "w", "v__a", "v_b_c", "v_b_c_"]
    flat = chain_of(tmp_path, "a", "b_c")
    assert flat.flattened() is flat


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
    """Components in random order, connections with feedthrough, and others."""
    names = draw(st.permutations(NAMES[: draw(st.integers(1, 7))]))
    name = st.sampled_from(names)
    through, states = (draw(st.sets(st.tuples(name, name), max_size=14)) for _ in range(2))
    return names, through, states


def reached(names: Iterable[str], edges: set[Edge]) -> set[Edge]:
    """Compute which component reaches which, by paths of one edge or more."""
    found = set(edges)
    for middle in names:
        found |= {(a, d) for a, b in found for c, d in found if b == c == middle}
    return found


def strong_parts(names: Sequence[str], edges: set[Edge]) -> set[frozenset[str]]:
    """Compute the components that reach each other, or themselves."""
    paths = reached(names, edges)
    return {
        frozenset({a} | {b for b in names if (a, b) in paths and (b, a) in paths})
        for a in names
        if (a, a) in paths
    }


def opened(names: Sequence[str], edges: set[Edge]) -> set[Edge]:
    """Compute the late edges: those into the first component of each ring, until none is left."""
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
def test_only_connections_that_open_a_ring_are_late_in_the_derived_order(graph):
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
    rings = {frozenset(ring) for ring in solved}
    for a, b in through:
        if not any({a, b} <= ring for ring in rings) and order.index(a) < order.index(b):
            assert stage_of[a] < stage_of[b]
    for ring in rings:
        assert len({stage_of[name] for name in ring}) == 1
    members = frozenset().union(*rings)
    assert all(members.issuperset(stage) or members.isdisjoint(stage) for stage in stages)
    if not are_solved:
        assert [name for stage in stages for name in stage] == order
        # A new stage begins only where a component takes a value of the stage before.
        for before, stage in pairwise(stages):
            assert any((a, stage[0]) in through for a in before)


def test_what_reaches_a_component_is_followed_upstream_to_where_it_may_go():
    system = system_of("abcde", [("a", "b"), ("b", "c"), ("c", "b")], [("d", "a"), ("c", "e")])
    assert ends(system.reaching("c", set())) == [("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")]
    assert ends(system.reaching("c", {"b"})) == [("b", "c")]
    assert ends(system.reaching("d", set())) == []
