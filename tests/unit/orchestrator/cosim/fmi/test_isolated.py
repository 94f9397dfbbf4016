"""Any answer of the process of an isolated FMU, which the FMU may have changed."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orchestrator.cosim.component import Component
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi import isolated
from orchestrator.cosim.fmi.instance import Log
from orchestrator.cosim.fmi.isolated import (
    LONGEST_NOTE,
    Channel,
    IsolatedInstance,
    Isolation,
    Served,
    sizes,
)
from orchestrator.cosim.observers import Table
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.simulation import simulate_plan
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError
from orchestrator.machine.interrupts import Interrupts
from support.others import build, system_of

#: Number of answers before the first step, including the one for the start, and number of
#: steps.
BEFORE, STEPS = 8, 5


def _json(note: Any) -> bytes:
    return json.dumps(note).encode()


WORDS = ("value", "messages", "failed", "fatal", "refused", "ended", "values", "\0base64")
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.just(10**400),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=8,
)
NOTES = (
    st.binary(max_size=40)
    | st.dictionaries(st.sampled_from(WORDS), VALUES, max_size=3).map(_json)
    | VALUES.map(_json)
)


class Answering(Channel):
    """An end of a connection that sends right answers, except one message, its last."""

    def __init__(self, connection: socket.socket, component: Component, n: int, other: bytes):
        super().__init__(connection, *sizes(component))
        self._left, self._other, self._end = n, other, connection

    def send(self, note: Any = ()) -> None:
        if self._left == 0:
            self._end.sendall(self._other)
            raise EOFError
        self._left -= 1
        super().send(note)


@contextmanager
def answering(component: Component, channel: Answering) -> Iterator[None]:
    """Start a thread that serves an FMU."""

    def serve() -> None:
        Served(component, channel).answer_all(component.folder)
        channel.close()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        thread.join()


def run(system: System, n: int, length: float, outputs: list[float], note: bytes) -> Table:
    """Make a run whose n-th answer is replaced."""
    table = Table()
    [component] = system.components.values()

    @contextmanager
    def answering_here(
        _: Any, log: Log, isolation: Isolation, interrupts: Callable[[], Interrupts]
    ) -> Iterator[Any]:
        here, there = socket.socketpair()
        other = np.array([length, *outputs]).tobytes() + note
        with here, answering(component, Answering(there, component, n, other)):
            instance = IsolatedInstance(component, here, lambda _: 0, log, 2.0, interrupts)
            try:
                instance.wait()
                yield {component.name: instance}
            finally:
                instance.leave()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolated, "isolate_instances", answering_here)
        simulate_plan(make_plan(system, Experiment(0.1 * STEPS, 0.1), Isolation()), [table])
    return table


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    return system_of(build(tmp_path_factory.mktemp("fmu")))


def test_answers_are_counted_as_they_come(system: System):
    """The first answer of a step is the first one with a row before it."""
    lengths = [len(run(system, BEFORE + k, 1e99, [0.0] * 4, b"")) for k in range(STEPS)]
    assert lengths == [1 + k for k in range(STEPS)]
    table = run(system, BEFORE + STEPS + 1, 1e99, [0.0] * 4, b"")
    assert table.failure is None
    assert len(table) == 1 + STEPS


@settings(max_examples=150)
@given(n=st.integers(0, BEFORE + STEPS), note=NOTES, change=st.sampled_from([0, 0, 0, 1, 1e9]))
@example(n=BEFORE + 2, note=b'{"messages": [[1e999, ""]]}', change=0)
@example(n=BEFORE + 2, note=b'{"messages": [[-1, ""]]}', change=0)
@example(n=BEFORE + 2, note=b'{"messages": 5}', change=0)
@example(n=BEFORE + 2, note=b'{"refused": "two\\nlines"}', change=0)
@example(n=BEFORE + 2, note=b'{"failed": "two\\nlines"}', change=0)
@example(n=BEFORE + 2, note=b'{"values": ["\\ud800"]}', change=0)
@example(n=BEFORE + 2, note=b'{"values": [1]}', change=0)
@example(n=BEFORE + 2, note=b'{"values": ["a", "b"]}', change=0)
@example(n=BEFORE + 2, note=b'{"values": 5}', change=0)
@example(n=BEFORE + 2, note=b"[" * 100_000, change=0)
@example(n=4, note=b'{"ended": "before it begins"}', change=0)
@example(n=3, note=b'{"value": {"u": "text", "mode": 1, "on": 1, "said": 0}}', change=0)
@example(n=3, note=b'{"value": {"u": 1.0, "mode": 1e99, "on": true, "said": "\\ud800"}}', change=0)
def test_whatever_is_answered_ends_in_a_line_with_the_rows_before_it(system, n, note, change):
    outputs = [1.0, 1.0, 0.0, 0.0]
    if n < BEFORE:
        # Some random bytes are valid answers.
        with suppress(InputError):
            run(system, n, len(note) + change, outputs, note)
        return
    table = run(system, n, len(note) + change, outputs, note)
    rows = n - BEFORE
    assert len(table) >= min(1 + rows, 1 + STEPS)
    assert (table["a.y"][:rows] == 101325.0).all()
    assert table.failure is None or "\n" not in table.failure
    for message in table.ending.messages:
        assert "\n" not in message
    json.dumps([table.failure, *table.ending.messages]).encode()


TEXT = b'{"values": ["text"]}'


@pytest.mark.parametrize(
    ("outputs", "length", "note"),
    [
        ([1.0, 1.5, 0.0, 0.0], len(TEXT), TEXT),
        ([1.0, 1.0, 2.0**31, 0.0], len(TEXT), TEXT),
        ([1.0, np.nan, 0.0, 0.0], len(TEXT), TEXT),
        ([1.0, 1.0, 0.0, 0.0], 0, b""),
        ([1.0, 1.0, 0.0, 0.0], 15, b'{"values": [5]}'),
        ([1.0, 1.0, 0.0, 0.0], LONGEST_NOTE + 1, TEXT),
        ([1.0, 1.0, 0.0, 0.0], np.nan, TEXT),
        ([1.0, 1.0, 0.0, 0.0], np.inf, TEXT),
    ],
)
def test_values_that_no_fmu_can_give_are_none(system: System, outputs, length, note):
    table = run(system, BEFORE + 2, length, outputs, note)
    assert table.failure is not None
    assert "a: its process sent an invalid answer in doStep" in table.failure
    assert len(table) == 3


def test_a_text_that_an_fmu_gives_is_taken(system: System):
    table = run(system, BEFORE + 2, len(TEXT), [1.0, 1.0, 0.0, 0.0], TEXT)
    assert table["a.heard"][3] == "text"


def test_an_answer_that_comes_drop_by_drop_is_not_waited_for(tmp_path: Path):
    here, there = socket.socketpair()
    done = threading.Event()

    def drip() -> None:
        there.sendall(np.array([1e6]).tobytes())
        while not done.wait(0.01):
            there.sendall(b" ")

    def waited(seconds: float) -> None:
        if seconds > 0.3:
            raise TimeoutError("waited enough")

    here.settimeout(0.1)
    thread = threading.Thread(target=drip)
    thread.start()
    with here, there:
        with pytest.raises(TimeoutError, match="waited enough"):
            Channel(here, 0, 0, waited).receive()
        done.set()
        thread.join()
