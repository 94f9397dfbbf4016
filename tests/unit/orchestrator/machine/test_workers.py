"""Work done side by side, and its end."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from functools import partial
from multiprocessing import active_children

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.machine.workers import workers


def test_results_come_with_their_keys():
    tasks = {n: partial(pow, n, 2) for n in range(7)}
    with workers() as crew:
        assert dict(crew.results(tasks, "square")) == {n: n * n for n in range(7)}
    assert active_children() == []


def test_a_signal_ends_all_processes_at_once():
    """Three tasks would take ten minutes each."""
    tasks = {0: os.getpid} | dict.fromkeys((1, 2, 3), partial(time.sleep, 600))
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        _interrupted_after_the_first(tasks)
    assert active_children() == []
    assert signal.getsignal(signal.SIGINT) is before


def _interrupted_after_the_first(tasks):
    with workers() as crew:
        for _ in crew.results(tasks, "nap"):
            os.kill(os.getpid(), signal.SIGINT)


def test_a_process_that_swallows_what_ends_it_is_ended():
    with pytest.raises(KeyboardInterrupt):
        _interrupted_after_the_first({0: os.getpid, 1: _swallow})
    assert active_children() == []


def _swallow() -> None:
    """As a run does with a signal, and PythonFMU with an exception."""
    for _ in range(10):
        with suppress(BaseException):
            time.sleep(600)


def test_a_process_that_dies_is_said_in_a_line():
    with pytest.raises(InputError, match="a process died while it made a run"), workers() as w:
        list(w.results({0: partial(os._exit, 3)}, "run"))
    assert active_children() == []
