"""The row of all values: its layout, its gathering, and values that are refused."""

from __future__ import annotations

import math
from math import inf, nan
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cosim.component import read_component
from orchestrator.cosim.connection import Connection, Linear, Mapped, PortName
from orchestrator.cosim.row import Gathering, Overrides, Row
from orchestrator.cosim.system import System
from support.archives import fmu, variable
from support.texts import mentions


class Tied(SimpleNamespace):
    """An instance that records its part of the row."""

    def tie(self, values, parts, strings) -> None:
        self.values, self.parts = values, parts


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = fmu(
        tmp_path_factory.mktemp("fmu") / "a.fmu",
        variable("y", "output"), variable("u", "input", start="2"), variable("k", "parameter"),
        variable("n", "input", "Integer", start="3"), variable("s", "input", "String"),
        variable("v", "input", start="4"),
    )  # fmt: skip
    wire = Connection(PortName("a", "y"), PortName("b", "u"))
    return System("s", {name: read_component(name, path) for name in "ab"}, (wire,))


def made(system: System, hidden: str = "") -> tuple[Row, dict[str, Tied]]:
    instances = {name: Tied() for name in system.components}
    return Row(system, instances, hidden), instances


def test_ports_of_one_causality_and_type_are_neighbours(system: System):
    row, instances = made(system)
    assert [str(port) for port in sorted(row.columns, key=row.columns.__getitem__)] == [
        f"{component}.{port}" for component in "ab" for port in ("u", "v", "n", "s", "y")
    ]
    for k, name in enumerate("ab"):
        parts = [(part.causality, part.place) for part in instances[name].parts]
        assert parts == [
            ("input", slice(0, 2)), ("input", slice(2, 3)), ("input", slice(3, 4)),
            ("output", slice(4, 5)),
        ]  # fmt: skip
        # The part is a view: an instance writes into the row.
        instances[name].values[4] = 7.0 + k
    assert [row.values[row.columns[PortName(name, "y")]] for name in "ab"] == [7.0, 8.0]


def test_a_table_has_ports_as_declared(system: System):
    row, _ = made(system)
    names = [f"{component}.{port}" for component in "ab" for port in ("u", "n", "s", "v", "y")]
    assert [*map(str, row.columns)] == names
    for i, name in enumerate(names):
        row.values[row.columns[PortName.read(name)]] = i
    rows = np.vstack([row.shown, row.shown + 10.0])
    row.arrange(rows)
    np.testing.assert_array_equal(rows, [np.arange(10.0), np.arange(10.0, 20.0)])


def test_inputs_start_with_values_of_the_description_or_the_system(system: System):
    values = {PortName.read("a.u"): 5.0, PortName.read("a.v"): nan, PortName.read("b.k"): 1.0}
    row, _ = made(system.with_parameters({PortName.read("a.u"): 5.0}))
    row.enter(values)
    found = {str(port): row.values[column] for port, column in row.columns.items()}
    assert (found["a.u"], found["a.v"], found["a.n"]) == (5.0, 4.0, 3.0)
    assert (found["b.u"], found["b.v"], found["b.n"]) == (2.0, 4.0, 3.0)


def test_hidden_outputs_are_shown_when_they_are_copied(system: System):
    row, instances = made(system, "b")
    assert len(row.values) == len(row.shown) + 1
    place = instances["b"].parts[-1].place
    instances["b"].values[place] = 9.0
    column = row.columns[PortName("b", "y")]
    assert row.shown[column] == 0.0
    row.show("a")
    assert row.shown[column] == 0.0
    row.show("b")
    assert row.shown[column] == 9.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, None),
        ({"a.y": nan}, "a.y nan"),
        ({"a.y": inf, "b.u": inf}, "a.y inf"),
        # The source is right: the value overflows on its way.
        ({"b.u": -inf}, "b.u -inf a.y"),
        ({"a.v": nan}, "a.v nan table"),
        ({"b.n": 2.5}, "b.n 2.5 Integer"),
        ({"b.n": 2.0**31}, "b.n 2147483648 Integer"),
    ],
)
def test_the_first_value_that_cannot_be_is_named(system: System, values, words):
    row, _ = made(system)
    for name, value in values.items():
        row.values[row.columns[PortName.read(name)]] = value
    with np.errstate(all="ignore"):
        complaint = row.wrong("ab")
    assert complaint is None if words is None else mentions(complaint, words)


def test_ports_that_move_are_those_that_change_by_more_than_rounding(system: System):
    row, _ = made(system)
    before = row.values.copy()
    row.values[row.columns[PortName.read("a.u")]] *= 1.0 + 1e-15
    row.values[row.columns[PortName.read("b.v")]] += 1e-9
    assert row.moving(before) == [PortName.read("b.v")]


def test_places_are_the_columns_of_both_ends_of_each_connection(system: System):
    row, _ = made(system)
    targets, sources = row.places(system.connections)
    np.testing.assert_array_equal(targets, [row.columns[PortName.read("b.u")]])
    np.testing.assert_array_equal(sources, [row.columns[PortName.read("a.y")]])


OUT, FED, ALSO, FREE = (PortName("a", name) for name in ("out", "fed", "also", "free"))


class FourValues(SimpleNamespace):
    """Four values: an output, two inputs that it feeds, and an unconnected input."""

    def __init__(self, out: float, free: float = 7.0) -> None:
        values = np.array([out, 0.0, 0.0, free])
        columns = {OUT: 0, FED: 1, ALSO: 2, FREE: 3}
        super().__init__(values=values, columns=columns, number=float)

    def number_of(self, _: PortName, value: float) -> float:
        return value

    def places(self, connections):
        return np.array([[self.columns[c.target], self.columns[c.source]] for c in connections]).T


def gathered(out: float, free: float = 7.0, transformation=None):
    row = FourValues(out, free)
    connections = tuple(Connection(OUT, target, transformation) for target in (FED, ALSO))
    gather = Gathering.along(row, connections)
    signals = Overrides(row, [gather], connections)
    gather(row.values)
    return row, gather, signals


@pytest.mark.parametrize("is_plain", [True, False])
@pytest.mark.parametrize("value", [0.0, -0.0, 1.5, -1e308, 5e-324, math.inf])
def test_values_without_a_change_arrive_bit_for_bit(value, is_plain):
    row, gather, _ = gathered(value)
    gather.is_plain = is_plain
    row.values[1:3] = math.nan
    gather(row.values)
    assert row.values[1:3].tobytes() == np.array([value, value]).tobytes()


def test_a_single_input_is_altered_and_released():
    row, gather, signals = gathered(3.0)
    signals.bias(FED, 0.5)
    gather(row.values)
    assert list(row.values) == [3.0, 3.5, 3.0, 7.0]
    signals.override(FED, -1.0)
    gather(row.values)
    assert list(row.values) == [3.0, -1.0, 3.0, 7.0]
    signals.release(FED)
    assert gather.is_plain
    gather(row.values)
    assert list(row.values) == [3.0, 3.0, 3.0, 7.0]


def test_an_input_that_nothing_feeds_gets_back_what_it_had():
    row, _, signals = gathered(3.0)
    signals.bias(FREE, 1.0)
    signals.bias(FREE, 2.0)
    assert row.values[3] == 9.0
    signals.override(FREE, 0.0)
    assert row.values[3] == 0.0
    signals.release(FREE)
    assert row.values[3] == 7.0


def test_supplied_values_are_altered_like_fed_ones():
    row, _, signals = gathered(3.0)
    signals.bias(FREE, 1.0)
    signals.supply(FREE, 4.0)
    assert row.values[3] == 5.0
    assert signals.supplied(FREE) == 4.0
    signals.release(FREE)
    signals.supply(FREE, 6.0)
    assert row.values[3] == signals.supplied(FREE) == 6.0


@pytest.mark.parametrize("transformation", [None, Linear(2.0, 1.0), Mapped(((1.0, 5.0),))])
@pytest.mark.parametrize("component", ["a", "b"])
def test_a_component_takes_at_once_what_it_would_take_next(transformation, component):
    row, gather, signals = gathered(1.0, transformation=transformation)
    signals.bias(ALSO, 0.5)
    before = row.values.copy()
    signals.refresh(component)
    if component == "a":
        gather(before)
    assert list(row.values) == list(before)
