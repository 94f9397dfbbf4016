"""Values rest before the first step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import fmi2Discard

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.coupling import Coupling
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.instance import Log
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.row import Row
from orchestrator.machine.errors import InputError, StartError
from support.static import Static, static_system
from support.texts import mentions


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def coupled(folder: Path, wires, coupling: str | None = None, steps=(), **functions):
    """Coupling of such components before the start, the values of the row, and the log."""
    system = static_system(folder, list(functions), wires)
    system = replace(system, steps=dict(steps))
    instances = {name: Static(name, function) for name, function in functions.items()}
    row, log = Row(system, instances), Log()
    plan = make_plan(system, Experiment(1.0, 0.125, coupling=coupling))
    return Coupling(plan, instances, row, log), row, log


def value(row: Row, name: str) -> float:
    return float(row.values[row.columns[PortName.read(name)]])


def test_values_rest_before_the_first_step_whatever_the_order_of_components(folder):
    coupling, row, log = coupled(
        folder, {"c.u": "b.y", "b.u": "a.y"},
        c=lambda u, v: (u + 1.0, u), b=lambda u, v: (10.0 * u, u), a=lambda u, v: (7.0, 0.0),
    )  # fmt: skip
    coupling.initialise()
    assert [value(row, name) for name in ("a.y", "b.u", "b.y", "c.u", "c.y")] == [7, 7, 70, 70, 71]
    assert coupling.plan.arrangement.stages == [["a"], ["b"], ["c"]]
    assert log.messages == ()


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
        assert coupling.plan.arrangement.stages == [["a"], ["c", "b"]]
        assert mentions(" ".join(log.messages), "a b.y")
    else:
        assert log.messages == ()
        assert coupling.plan.arrangement.stages == [["a", "b"], ["c"]]


@pytest.mark.parametrize(
    ("part", "steps"), [(lambda u, v: (2.0, 0.0), {}), (halved, {"a": 0.25}), (halved, {"b": 0.25})]
)
def test_a_ring_that_cannot_be_solved_is_delayed_or_refused_by_name(folder, part, steps):
    parts = {"a": part, "b": given_on, "c": given_on, "steps": steps}
    coupling, _, log = coupled(folder, RING, **parts)
    coupling.initialise()
    assert mentions(" ".join(log.messages), "a b.y")
    with pytest.raises(InputError) as error:
        coupled(folder, RING, "solve", **parts)[0].initialise()
    assert mentions(str(error.value), "solve a b.y")


def test_a_run_does_not_start_with_infinite_or_refused_values(folder):
    with pytest.raises(StartError) as refused:
        coupled(folder, {"b.u": "a.y"}, a=lambda u, v: (np.inf, 0.0), b=given_on)[0].initialise()
    assert mentions(str(refused.value), "a.y inf")
    coupling, _, log = coupled(folder, {}, a=given_on)
    log.take(fmi2Discard, "a: takes no 5")
    with pytest.raises(InputError, match="a: takes no 5"):
        coupling.initialise()
