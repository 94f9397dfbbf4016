"""Processes that work side by side on the cores, and end at once when the user says so."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from shutil import rmtree
from typing import Any, TypeVar

from tqdm import tqdm

from orchestrator.machine.children import imported_apart
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts, held_interrupts, without_interrupt
from orchestrator.machine.locks import process_folder

#: How long the loop waits before it asks whether it shall stop [s].
_PATIENCE = 0.1

#: How often a process is told to leave before it is ended.
_REMINDERS = 50

_Key = TypeVar("_Key", bound=Hashable)


class Workers:
    """Some processes, as :func:`workers` gives them."""

    def __init__(self, pool: ProcessPoolExecutor, n: int, interrupts: Interrupts) -> None:
        """Use a pool of n processes."""
        self._pool, self._n, self._interrupts = pool, n, interrupts

    def results(
        self, tasks: Mapping[_Key, Callable[[], Any]], unit: str
    ) -> Iterator[tuple[_Key, Any]]:
        """Keys and results of tasks, which are begun in their order, as they are done.

        Raises:
            InputError: a process has died, or none could be started.
            KeyboardInterrupt: there was a signal to stop.

        """
        left = iter(tasks.items())
        keys: dict[Future[Any], _Key] = {}
        with tqdm(total=len(tasks), unit=unit, disable=None) as bar:
            while True:
                # No more than can be begun: what a process has been given it cannot give back.
                with without_interrupt(), _started():
                    for key, task in islice(left, self._n - len(keys)):
                        keys[self._pool.submit(task)] = key
                if not keys:
                    return
                done, _ = wait(keys, _PATIENCE, FIRST_COMPLETED)
                if self._interrupts:
                    raise KeyboardInterrupt
                for future in done:
                    bar.update()
                    yield keys.pop(future), _result(future, unit)


def _result(future: Future[Any], unit: str) -> Any:
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise InputError(
            f"a process has died while it made a {unit}: an FMU has crashed, or memory was short"
        ) from error


@contextmanager
def workers() -> Iterator[Workers]:
    """Processes for the time of the context; an exception ends them at once.

    FMUs are libraries that a process loads, so the processes are fresh ones, not copies of this.
    """
    others = set(active_children())
    n = os.cpu_count() or 1
    with held_interrupts() as interrupts:
        pool = ProcessPoolExecutor(n, get_context("spawn"), _begin)
        try:
            yield Workers(pool, n, interrupts)
        except BaseException:
            _end(set(active_children()) - others)
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _end(processes: Collection[BaseProcess]) -> None:
    """Have processes leave: a run takes the first word to end, and an FMU may hear none."""
    for _ in range(_REMINDERS):
        for process in processes:
            process.terminate()
        time.sleep(_PATIENCE)
        if not any(process.is_alive() for process in processes):
            return
    for process in processes:
        process.kill()


@contextmanager
def _started() -> Iterator[None]:
    """Processes that cannot be started, in words."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise InputError(f"no process can be started: {reason(error)}") from error


def _begin() -> None:
    """In a new process: leave by SIGTERM as by any other exit, without temporary folders."""
    signal.signal(signal.SIGTERM, _leave)
    if hasattr(signal, "SIGHUP"):
        # The end of the terminal is for the process to answer that has started this one.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()
    # As in the process that has started this one.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    imported_apart("matplotlib", "matplotlibrc")


def _follow() -> None:
    """Leave with the process that has started this one, which may have been killed."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    for _ in range(_REMINDERS):
        # A run takes the first one to end.
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)
    # What SIGTERM raises may be lost in a callback.
    os._exit(1)


def _leave(*_: Any) -> None:
    # At once: what a task raises, the pool takes for its result, and goes on with the next.
    rmtree(process_folder(), ignore_errors=True)
    os._exit(1)
