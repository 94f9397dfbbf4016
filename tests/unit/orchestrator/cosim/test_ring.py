"""Rings converge to their solution, however steep they are, without a step."""

from __future__ import annotations

from dataclasses import replace
from math import cos
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from orchestrator.cosim.connection import Linear, PortName
from orchestrator.cosim.fmi.instance import ComponentFailed
from orchestrator.cosim.ring import Ring
from orchestrator.cosim.row import Row
from support.static import Function, Static, static_system
from support.texts import mentions

#: y of each is u of the other.
BACK = {"a.u": "b.y", "b.u": "a.y"}

#: The only solution of x = cos x.
DOTTIE = 0.7390851332151607


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def ring_of(folder: Path, wires=BACK, kind: str = "Real", **functions: Function):
    """A ring of a and b, with other components that feed it, its row, and all instances."""
    system = static_system(folder, list(functions), wires, kind)
    instances = {name: Static(name, function) for name, function in functions.items()}
    row = Row(system, instances)
    return Ring(["a", "b"], system, instances, row), row, instances


def value(row: Row, name: str) -> float:
    return float(row.values[row.columns[PortName.read(name)]])


SLOPES = st.lists(st.floats(-20.0, 20.0), min_size=8, max_size=8)
OFFSETS = st.lists(st.floats(-20.0, 20.0), min_size=4, max_size=4)


@given(slopes=SLOPES, offsets=OFFSETS, are_given=st.booleans())
def test_a_linear_ring_comes_to_the_solution_of_its_equations(folder, slopes, offsets, are_given):
    """Two signals go each way: (a.y, a.z) = A (b.y, b.z) + p, (b.y, b.z) = B (a.y, a.z) + q."""
    A, B = np.reshape(slopes, (2, 2, 2))
    p, q = np.reshape(offsets, (2, 2))
    assume(np.linalg.cond(np.eye(2) - A @ B) < 1e3)
    wires = {"a.u": "b.y", "a.v": "b.z", "b.u": "a.y", "b.v": "a.z"}
    system = static_system(folder, "ab", wires)
    instances = {
        name: Static(name, lambda *u, M=M, c=c: M @ u + c, M if are_given else None)
        for name, M, c in (("a", A, p), ("b", B, q))
    }
    row = Row(system, instances)
    ring = Ring("ab", system, instances, row)
    ring.close()
    assert ring.is_closed
    exact = np.linalg.solve(np.eye(2) - A @ B, A @ q + p)
    found = [value(row, "a.y"), value(row, "a.z")]
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-6)
    # The last step of Newton's method consists of rounding errors.
    assert [value(row, "b.u"), value(row, "b.v")] == pytest.approx(found, rel=1e-9, abs=1e-9)


def test_a_nonlinear_ring_comes_to_its_solution(folder):
    ring, row, _ = ring_of(folder, a=lambda u, v: (cos(u), 0.0), b=lambda u, v: (u, 0.0))
    ring.close()
    assert value(row, "a.y") == pytest.approx(DOTTIE, abs=1e-13)


def test_what_happens_to_a_value_on_its_way_counts(folder):
    """y = -3 y + 1."""
    system = static_system(folder, "ab", BACK)
    back, there = system.connections
    system = replace(system, connections=(replace(back, transformation=Linear(-3.0, 1.0)), there))
    instances = {name: Static(name, lambda u, v: (u, 0.0)) for name in "ab"}
    row = Row(system, instances)
    Ring("ab", system, instances, row).close()
    assert value(row, "b.y") == pytest.approx(0.25, abs=1e-12)


def test_whole_numbers_go_round_until_they_rest(folder):
    ring, row, _ = ring_of(
        folder, kind="Integer", a=lambda u, v: (min(u + 2, 7), 0), b=lambda u, v: (u, 0)
    )
    ring.close()
    assert (value(row, "a.u"), value(row, "b.u")) == (7, 7)


@pytest.mark.parametrize(
    ("kind", "function"),
    [
        ("Real", lambda u, v: (u + 1.0, 0.0)),
        ("Real", lambda u, v: (u * u + 1.0 + u, 0.0)),
        ("Integer", lambda u, v: (1 - u, 0)),
    ],
)
def test_a_ring_without_a_solution_is_refused_with_its_ports(folder, kind, function):
    ring, _, _ = ring_of(folder, kind=kind, a=function, b=lambda u, v: (u, 0))
    with pytest.raises(ComponentFailed) as error:
        ring.close()
    assert mentions(str(error.value), "a.u")


def test_a_ring_is_closed_again_only_after_a_change(folder):
    wires = {**BACK, "a.v": "c.y"}
    ring, row, instances = ring_of(
        folder, wires,
        a=lambda u, v: (0.5 * u + v, 0.0), b=lambda u, v: (u, 0.0), c=lambda u, v: (3.0, 0.0),
    )  # fmt: skip
    instances["c"].exchange()
    # y = y / 2 + 3
    assert ring.renew()
    assert value(row, "b.y") == pytest.approx(6.0, abs=1e-12)
    before = [instances[name].exchanged for name in "ab"]
    assert not ring.renew()
    assert [instances[name].exchanged for name in "ab"] == before
    assert ring.renew(always=True)
    row.values[row.columns[PortName.read("a.u")]] = 5.0
    assert ring.renew()
    assert value(row, "b.y") == pytest.approx(6.0, abs=1e-12)
    row.values[row.columns[PortName.read("c.y")]] = 4.0
    assert ring.renew()
    assert value(row, "b.y") == pytest.approx(8.0, abs=1e-12)


def test_what_does_not_answer_between_steps_cannot_be_solved_for(folder):
    ring, row, instances = ring_of(folder, a=lambda u, v: (2.0, 3.0), b=lambda u, v: (u * v, u))
    for instance in instances.values():
        instance.exchange()
    before = {name: value(row, name) for name in ("a.u", "a.v", "b.u", "b.v")}
    reasons = ring.unsolved()
    assert list(reasons) == ["a"] and mentions(reasons["a"], "a")
    assert {name: value(row, name) for name in before} == before
