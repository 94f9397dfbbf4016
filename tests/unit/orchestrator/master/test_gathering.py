"""Values on their way from outputs to inputs."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.master.row import Gathering, Overrides
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection
from orchestrator.system.units import Linear, Mapped

OUT, FED, ALSO, FREE = (PortName("a", name) for name in ("out", "fed", "also", "free"))


class Row(SimpleNamespace):
    """Four values: an output, two inputs that it feeds, and one that nothing feeds."""

    def __init__(self, out: float, free: float = 7.0) -> None:
        values = np.array([out, 0.0, 0.0, free])
        super().__init__(values=values, columns={OUT: 0, FED: 1, ALSO: 2, FREE: 3})

    def places(self, connections):
        return np.array([[self.columns[c.target], self.columns[c.source]] for c in connections]).T


def made(out: float, free: float = 7.0, transformation=None):
    row = Row(out, free)
    connections = tuple(Connection(OUT, target, transformation) for target in (FED, ALSO))
    gather = Gathering.along(row, connections)
    signals = Overrides(row, [gather], connections)
    gather(row.values)
    return row, gather, signals


@pytest.mark.parametrize("is_plain", [True, False])
@pytest.mark.parametrize("value", [0.0, -0.0, 1.5, -1e308, 5e-324, math.inf])
def test_what_nobody_alters_arrives_bit_for_bit(value, is_plain):
    row, gather, _ = made(value)
    gather.is_plain = is_plain
    row.values[1:3] = math.nan
    gather(row.values)
    assert row.values[1:3].tobytes() == np.array([value, value]).tobytes()


def test_an_input_alone_is_altered_and_released():
    row, gather, signals = made(3.0)
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
    row, _, signals = made(3.0)
    signals.bias(FREE, 1.0)
    signals.bias(FREE, 2.0)
    assert row.values[3] == 9.0
    signals.override(FREE, 0.0)
    assert row.values[3] == 0.0
    signals.release(FREE)
    assert row.values[3] == 7.0


def test_what_is_supplied_is_altered_as_what_is_fed():
    row, _, signals = made(3.0)
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
    row, gather, signals = made(1.0, transformation=transformation)
    signals.bias(ALSO, 0.5)
    before = row.values.copy()
    signals.refresh(component)
    if component == "a":
        gather(before)
    assert list(row.values) == list(before)
