"""What grows without bound is told from what only grows, and values rest before the first step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.fmi2 import fmi2Discard
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine.errors import InputError, StartError
from orchestrator.master.coupling import Coupling, Growth
from orchestrator.master.experiment import Experiment
from orchestrator.master.fmi.instance import ComponentFailed, Log
from orchestrator.master.hooks.hook import NEVER
from orchestrator.master.observers.observer import Header
from orchestrator.master.plan import make_plan
from orchestrator.master.row import Row
from orchestrator.system.names import port_name
from support.static import Static, static_system
from support.texts import mentions

PORT = port_name("b.u")


def grows(values: np.ndarray, cuts: Sequence[int] = ()) -> bool:
    """Whether growth is found in the values of a port, which come in blocks."""
    growth = Growth([PORT])
    growth.begin(Header(("a.y", "b.u"), Experiment(len(values), 1.0)))
    rows = np.column_stack((np.arange(len(values)), np.zeros(len(values)), values))
    for block in np.split(rows, sorted({*cuts} & {*range(len(values))})):
        if len(block):
            growth.take(block)
    assert not growth.found or str(PORT) in growth.found
    return bool(growth.found)


@given(
    st.sampled_from([0.4, 0.2]) | st.floats(-0.01, 0.01).map(lambda share: 3 / 256 * (1 + share)),
    st.sampled_from((1.0, -1.0)),
    st.lists(st.integers(1, 2300)),
)
def test_a_power_grows_that_doubles_three_times_in_256_steps(doublings, sign, cuts):
    """Eight intervals of 256 steps at the most, and 24 doublings in them, however rows come."""
    values = sign * 2.0 ** (doublings * np.arange(9 * 256))
    if abs(doublings - 3 / 256) > 1e-6:
        assert grows(values, cuts) == (doublings > 3 / 256)


@pytest.mark.parametrize("values", [
    lambda k: k**3, lambda k: 1e3 * np.sin(k), lambda k: 0.0 * k, lambda k: 1e300 * (k > 7),
    lambda k: 2.0 ** np.minimum(k, 8), lambda k: 1e6 * np.exp(-k / 50),
    lambda k: np.where(k < 2500, 1.0, 1e30), lambda k: (k > 0) * 2.0 ** (k * 1.5 / 256),
])  # fmt: skip
def test_what_comes_to_an_end_or_is_slow_may_grow(values):
    with np.errstate(divide="ignore"):
        assert not grows(values(np.arange(5000.0)))


def test_growth_is_looked_for_after_every_512_steps_and_the_last_one():
    growth = Growth([PORT])
    handed: list[int] = []
    run = SimpleNamespace(
        blocks=SimpleNamespace(hand_over=lambda: handed.append(run.made)),
        experiment=SimpleNamespace(rows=1301), made=0,
    )  # fmt: skip
    looks = []
    while run.made != NEVER:
        looks.append(run.made)
        run.made = growth.act(run)
    assert looks == handed == [0, 512, 1024, 1300]
    growth.found = "b.u grows"
    # As after a resumption.
    run.made = 300
    assert growth.act(run) == 512
    run.made = 512
    with pytest.raises(ComponentFailed, match=r"b\.u"):
        growth.act(run)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def coupled(folder: Path, wires, coupling: str | None = None, steps=(), **functions):
    """The coupling of such components before the start, the values of the row, and the log."""
    system = static_system(folder, list(functions), wires)
    system = replace(system, steps=dict(steps))
    instances = {name: Static(name, function) for name, function in functions.items()}
    row, log = Row(system, instances), Log()
    plan = make_plan(system, Experiment(1.0, 0.125, coupling=coupling))
    return Coupling(plan, instances, row, log), row, log


def value(row: Row, name: str) -> float:
    return float(row.values[row.columns[port_name(name)]])


def test_values_rest_before_the_first_step_whatever_the_order_of_components(folder):
    coupling, row, log = coupled(
        folder, {"c.u": "b.y", "b.u": "a.y"},
        c=lambda u, v: (u + 1.0, u), b=lambda u, v: (10.0 * u, u), a=lambda u, v: (7.0, 0.0),
    )  # fmt: skip
    coupling.initialise()
    assert [value(row, name) for name in ("a.y", "b.u", "b.y", "c.u", "c.y")] == [7, 7, 70, 70, 71]
    assert coupling.sequence == [["a"], ["b"], ["c"]]
    assert (coupling.delayed_ports(), log.messages) == ([], ())


RING = {"a.u": "b.y", "b.u": "a.y", "c.u": "a.y"}


def halved(u: float, v: float) -> tuple[float, float]:
    return 0.5 * u + 3.0, 0.0


def given_on(u: float, v: float) -> tuple[float, float]:
    return u, 0.0


@pytest.mark.parametrize("how", [None, "solve", "delay"])
def test_a_ring_rests_at_the_start_and_is_solved_unless_a_delay_is_wanted(folder, how):
    coupling, row, log = coupled(folder, RING, how, c=given_on, a=halved, b=given_on)
    coupling.initialise()
    # y = y / 2 + 3
    assert value(row, "c.y") == pytest.approx(6.0, abs=1e-9)
    if how == "delay":
        assert list(map(str, coupling.delayed_ports())) == ["a.u", "b.u"]
        assert coupling.sequence == [["a"], ["c", "b"]]
        assert mentions(" ".join(log.messages), "a b.y")
    else:
        assert (coupling.delayed_ports(), log.messages) == ([], ())
        assert coupling.sequence == [["a", "b"], ["c"]]


@pytest.mark.parametrize(
    ("part", "steps"), [(lambda u, v: (2.0, 0.0), {}), (halved, {"a": 0.25}), (halved, {"b": 0.25})]
)
def test_a_ring_that_cannot_be_solved_is_delayed_or_refused_by_name(folder, part, steps):
    parts = {"a": part, "b": given_on, "c": given_on, "steps": steps}
    coupling, _, log = coupled(folder, RING, **parts)
    coupling.initialise()
    assert list(map(str, coupling.delayed_ports())) == ["a.u", "b.u"]
    assert mentions(" ".join(log.messages), "a b.y")
    with pytest.raises(InputError) as error:
        coupled(folder, RING, "solve", **parts)[0].initialise()
    assert mentions(str(error.value), "solve a b.y")


def test_what_is_not_finite_or_was_refused_does_not_start(folder):
    with pytest.raises(StartError) as refused:
        coupled(folder, {"b.u": "a.y"}, a=lambda u, v: (np.inf, 0.0), b=given_on)[0].initialise()
    assert mentions(str(refused.value), "a.y inf")
    coupling, _, log = coupled(folder, {}, a=given_on)
    log.take(fmi2Discard, "a: takes no 5")
    with pytest.raises(InputError, match="a: takes no 5"):
        coupling.initialise()
