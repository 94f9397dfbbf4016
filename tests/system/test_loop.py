"""The compiled loop has the rows and messages of the Python loop."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.cosim import (
    Alter,
    Event,
    Events,
    Experiment,
    Isolation,
    Linear,
    PortName,
    System,
    Table,
    make_plan,
    simulate_plan,
)
from orchestrator.machine.errors import StartError
from orchestrator.runs.wiring import closed_loop
from support.machine import LOOPS
from support.mixed import ACTS, CALLS, Shape, altered, system_of, systems
from support.runs import run_table
from support.texts import mentions

#: Step [s].
H = 0.5

#: Orders for any system; None: feedthrough, or Gauss-Seidel if its FMUs need that.
ANY = (None, "gauss-seidel", "jacobi")

ISOLATED = pytest.param({"loop": "python", "isolation": Isolation(20.0)}, marks=pytest.mark.slow)
HERE = [{"loop": loop} for loop in LOOPS]
WAYS = pytest.mark.parametrize("way", [*HERE, ISOLATED], ids=["python", "compiled", "isolated"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mixed")


def run(
    system: System,
    experiment: Experiment,
    loop: str,
    events: Sequence[Event] = (),
    isolation: Isolation | None = None,
) -> Table:
    table = run_table(system, experiment, loop, isolation, [Events(events)])
    assert table.header.loop == loop
    return table


def same(system: System, experiment: Experiment, events: Sequence[Event] = ()) -> Table:
    """A run, which is the same in both loops."""
    python, compiled = (run(system, experiment, loop, events) for loop in LOOPS)
    assert compiled.rows.tobytes() == python.rows.tobytes()
    assert compiled.ending == python.ending
    assert compiled.header == python.header
    return python


@settings(max_examples=30)
@given(
    arguments=systems(),
    step=st.floats(1e-3, 1.0),
    n=st.integers(1, 80),
    rest=st.sampled_from([0.0, 0.3]),
    order=st.sampled_from(ANY),
    rows=st.integers(1, 100),
)
def test_random_systems_give_the_same_rows_and_the_same_failures(
    folder, arguments, step, n, rest, order, rows
):
    with patch("orchestrator.cosim.observers._ROWS", rows):
        same(system_of(folder, **arguments), Experiment((n + rest) * step, step, order))


@settings(max_examples=40)
@given(data=st.data(), arguments=systems(), order=st.sampled_from(ANY))
def test_values_of_any_size_on_their_ways_give_the_same_rows_and_the_same_failures(
    folder, data, arguments, order
):
    """However large they get: all rows are finite, and a run that ends early says why."""
    system, events = data.draw(altered(system_of(folder, **arguments)))
    experiment = Experiment(10.0, H, order)
    try:
        table = same(system, experiment, events)
    except StartError:
        return
    assert np.isfinite(table.rows).all()
    assert (table.failure is None) == (len(table) == experiment.rows)


@pytest.mark.parametrize("order", ANY)
def test_the_bundle_gives_the_same_rows(dist: Path, order: str):
    assert len(same(closed_loop(dist), Experiment(5.0, 0.03, order))) > 160


#: Two components that feed each other.
PAIR = {
    "shapes": {name: Shape((1, 0, 0, 1), (1, 1, 0, 1)) for name in ("bad", "good")},
    "connections": {
        "bad.input.Real0": "good.output.Real0",
        "good.input.Real0": "bad.output.Real0",
        "good.input.Boolean0": "bad.output.Boolean0",
    },
}


def pair(folder: Path, act: str, call: str = "STEP", milliseconds: int = 0) -> System:
    """The two; the first misbehaves in its seventh step."""
    values = {"act": ACTS[act], "call": CALLS[call], "at": 7, "milliseconds": milliseconds}
    return system_of(folder, **PAIR, parameters={f"bad.{k}": v for k, v in values.items()})


@WAYS
@pytest.mark.parametrize(
    ("act", "call", "rows", "words"),
    [
        ("DISCARD", "SET", 8, "3.5 s: bad: inputs 2 discard"),
        ("DISCARD", "GET", 7, "3 s: bad: outputs 2 discard"),
        ("FAIL", "STEP", 7, "3 s: bad: doStep 3 error"),
        ("BELOW_ALL", "SET", 8, "3.5 s: bad: inputs -1 illegal"),
        ("BEYOND_ALL", "STEP", 7, "3 s: bad: doStep 6 illegal"),
        ("BEYOND_ALL", "GET", 7, "3 s: bad: outputs 6 illegal"),
        ("FATAL", "STEP", 7, "3 s: bad: doStep 4 fatal"),
        ("SAYS", "STEP", 7, "3 s: bad: tired"),
        ("NOT_A_NUMBER", "STEP", 7, "3.5 s: bad.output.Real0 nan"),
        ("INFINITE", "STEP", 7, "3.5 s: bad.output.Real0 inf"),
    ],
)
def test_a_step_that_fails_is_named_and_the_rows_before_it_kept(
    folder, way, act, call, rows, words
):
    table = run(pair(folder, act, call), Experiment(100.0, H), **way)
    assert mentions(table.failure, words)
    assert np.array_equal(table.time, np.arange(rows) * H)
    assert table.ending.messages == (("bad: step 7", "bad: tired") if act == "SAYS" else ())


#: An Integer and a Real of the first feed the second, whose outputs are finite for any inputs.
FED = {
    "shapes": {"a": Shape((1, 0, 0, 0), (1, 1, 0, 0)), "b": Shape((1, 1, 0, 0), (0, 1, 0, 0))},
    "connections": {"b.input.Real0": "a.output.Real0", "b.input.Integer0": "a.output.Integer0"},
}


@pytest.mark.parametrize("way", HERE, ids=LOOPS)
@pytest.mark.parametrize("order", Experiment.ORDERS)
@pytest.mark.parametrize(
    ("factor", "target", "bias", "words"),
    [
        (1e306, None, 0.0, "b.input.Real0 inf, a.output.Real0"),
        (1e300, "b.input.Real0", -1.7e308, "b.input.Real0 -inf, a.output.Real0"),
        (1.0, "a.input.Real0", 1.7e308, "a.input.Real0 inf, event"),
        (1.0, "b.input.Integer0", 2.0**31, "b.input.Integer0 Integer a."),
    ],
)
def test_an_input_that_its_type_cannot_hold_ends_the_run(
    folder, way, order, factor, target, bias, words
):
    """All outputs are finite; the rows before it are kept."""
    system = system_of(folder, **FED, parameters={})
    real, integer = system.connections
    real = replace(real, transformation=Linear(factor, -1.7e308 if bias < 0.0 else 0.0))
    system = replace(system, connections=(real, integer)).with_parameters(
        {PortName("a", "input.Real0"): 1.7e308 if factor == 1.0 else 0.0}
    )
    events = []
    if target is not None:
        where = PortName(*target.split(".", 1))
        events = [Event("bias", Alter("bias", ((where, bias),)), "bias", at=3.0)]
    table = run(system, Experiment(200.0, H, order), **way, events=events)
    assert mentions(table.failure, words)
    assert np.isfinite(table.rows).all()
    assert table.failure.startswith(f"stopped at t = {len(table) * H:g} s: ")
    # The row of its time, or of the end of the step, shows it; an integer is too large when it is
    # set, after the row.
    at_once = order == "feedthrough" and "Integer" not in words
    assert len(table) == 7 - at_once if target else 7 < len(table) < 400


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("order", Experiment.ORDERS)
@pytest.mark.parametrize("act", ["ROUNDS", "FLUSHES"])
def test_the_mode_of_an_fmu_changes_no_number_of_the_others(folder, loop, order, act):
    """The FMU changes the floating-point mode in the call that gets its outputs."""
    there = replace(pair(folder, act, "GET"), connections=())
    wires = [
        replace(connection, transformation=Linear(0.1, 1e-3))
        for connection in pair(folder, act).connections
        if connection.target.port == "input.Real0"
    ]
    there = replace(there, connections=tuple(wires))
    behaves = there.with_parameters({PortName("bad", "act"): ACTS["BEHAVE"]})
    experiment = Experiment(10.0, 0.1, order)
    found, expected = (run(system, experiment, loop) for system in (there, behaves))
    assert found.rows.tobytes() == expected.rows.tobytes()
    assert len(found) == 101


@pytest.mark.parametrize("loop", LOOPS)
def test_an_interrupt_ends_a_run_of_slow_steps_soon(folder, loop):
    """The signal comes in the seventh step."""
    system = pair(folder, "INTERRUPT", milliseconds=40)
    table = run(system, Experiment(100.0, H), loop)
    assert 8 <= len(table) <= 9
    assert table.failure == f"interrupted at t = {table.time[-1]:g} s"
    assert np.array_equal(table.time, np.arange(len(table)) * H)
    assert len(table.ending.interrupts) == 1


@pytest.mark.parametrize("loop", LOOPS)
def test_observers_of_slow_steps_are_told_meanwhile(folder, loop):
    """Steps of 40 ms: at least every eighth. Warnings do not end the run."""
    counts = []

    class Counts(Table):
        def take(self, rows: np.ndarray) -> None:
            super().take(rows)
            counts.append(len(rows))

    table, experiment = Counts(), Experiment(10.0, H)
    system = pair(folder, "WARN", milliseconds=40)
    simulate_plan(make_plan(system, experiment, loop=loop), [table])
    assert len(table) == 21
    assert max(counts) <= 8


@pytest.mark.parametrize("loop", LOOPS)
def test_rows_that_cannot_be_kept_end_a_run(folder, loop):
    class Full(Table):
        def take(self, rows: np.ndarray) -> None:
            if len(self) > 1000:
                raise OSError(errno.ENOSPC, "No space left on device")
            super().take(rows)

    whole, full = Table(), Full()
    system, experiment = pair(folder, "BEHAVE"), Experiment(1000.0, H)
    ending = simulate_plan(make_plan(system, experiment, loop=loop), [full, whole])
    assert ending.failure is not None
    assert ending.failure == (
        f"stopped at t = {whole.time[-1]:g} s: [Errno 28] No space left on device"
    )
    assert 1000 < len(full) < len(whole) < 2001
    assert np.array_equal(whole.time, np.arange(len(whole)) * H)
