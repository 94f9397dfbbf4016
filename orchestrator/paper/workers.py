"""Processes that work side by side on the cores, and end at once when the user says so."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any, TypeVar

from tqdm import tqdm

from orchestrator.master.interrupts import Interrupts, held_interrupts

#: How long the loop waits before it asks whether it shall stop [s].
_PATIENCE = 0.1

_Key = TypeVar("_Key", bound=Hashable)


class Workers:
    """A pool of processes, as :func:`workers` gives it."""

    def __init__(self, pool: ProcessPoolExecutor, interrupts: Interrupts) -> None:
        """Use a pool."""
        self._pool, self._interrupts = pool, interrupts

    def results(
        self, tasks: Mapping[_Key, Callable[[], Any]], unit: str
    ) -> Iterator[tuple[_Key, Any]]:
        """Keys and results of tasks, which are begun in their order, as they are done.

        Raises:
            KeyboardInterrupt: there was a signal to stop.

        """
        with _blocked_interrupt():
            keys = {self._pool.submit(task): key for key, task in tasks.items()}
        waiting: set[Future[Any]] = set(keys)
        with tqdm(total=len(keys), unit=unit, disable=None) as bar:
            while waiting:
                done, waiting = wait(waiting, _PATIENCE, FIRST_COMPLETED)
                if self._interrupts:
                    raise KeyboardInterrupt
                bar.update(len(done))
                yield from ((keys[future], future.result()) for future in done)


@contextmanager
def workers() -> Iterator[Workers]:
    """Processes for the time of the context; an exception ends them at once.

    FMUs are libraries that a process loads, so the processes are fresh ones, not copies of this.
    """
    others = set(active_children())
    with held_interrupts() as interrupts:
        pool = ProcessPoolExecutor(mp_context=get_context("spawn"), initializer=_begin)
        try:
            yield Workers(pool, interrupts)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(active_children()) - others:
                process.terminate()
            raise
        finally:
            pool.shutdown()


@contextmanager
def _blocked_interrupt() -> Iterator[None]:
    """Processes that are started here never see Ctrl-C, which is for this one to answer."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """In a new process: leave by SIGTERM as by any other exit, without temporary folders."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
