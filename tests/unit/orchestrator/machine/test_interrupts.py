"""Signals are collected, not raised."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from orchestrator.machine.interrupts import Interrupts, held_interrupts, orderly_end


def test_signals_are_collected_and_announced_at_once():
    urgent: list[bool] = []
    with held_interrupts(lambda interrupts: urgent.append(interrupts.urgent)) as interrupts:
        assert not interrupts
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts
    assert urgent == [False, True]


def test_signals_of_a_batch_system_are_urgent():
    with held_interrupts() as interrupts:
        os.kill(os.getpid(), signal.SIGTERM)
        assert interrupts.urgent


def test_inner_context_shares_the_signals_of_the_outer_one():
    with held_interrupts() as outer, held_interrupts() as inner:
        os.kill(os.getpid(), signal.SIGINT)
        assert inner is outer


def test_handlers_are_restored():
    before = signal.getsignal(signal.SIGINT)
    with held_interrupts():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_collect_nothing():
    found: list[Interrupts] = []

    def work() -> None:
        with held_interrupts() as interrupts:
            found.append(interrupts)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert not found[0]


def test_ignored_signals_stay_ignored():
    """nohup ignores SIGHUP."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with held_interrupts() as interrupts:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not interrupts
    finally:
        signal.signal(signal.SIGHUP, before)


def test_if_no_thread_starts_only_the_third_signal_is_lost(monkeypatch):
    def cannot(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", cannot)
    with held_interrupts() as interrupts, interrupts.insistence(lambda: None):
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts


def test_only_signals_within_the_context_are_counted():
    given_up: list[str] = []
    with held_interrupts() as interrupts:
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGINT)
        with interrupts.insistence(lambda: given_up.append("now")):
            os.kill(os.getpid(), signal.SIGINT)
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGINT)
    assert given_up == []


def test_many_signals_at_once_leave_a_step_time_to_return():
    given_up: list[str] = []
    with (
        held_interrupts() as interrupts,
        interrupts.insistence(lambda: given_up.append("now")),
    ):
        for _ in range(20):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
    assert given_up == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("of_process", [False, True])
def test_signals_after_the_last_context_change_nothing(number, of_process):
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        with orderly_end(of_process):
            with held_interrupts(is_last=True) as interrupts:
                os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
        if of_process:
            os.kill(os.getpid(), number)
        else:
            assert {n: signal.getsignal(n) for n in before} == before
    finally:
        for n, handler in before.items():
            signal.signal(n, handler)
    assert interrupts.numbers == [number]
