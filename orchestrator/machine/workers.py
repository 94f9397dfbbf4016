"""Processes that work side by side on the cores, and end at once when the user says so."""

from __future__ import annotations

import logging
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path
from shutil import rmtree
from typing import Any, TypeVar

from tqdm import tqdm

from orchestrator.machine import cache
from orchestrator.machine.children import imported_apart
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.machine.operating_system import most_processes, without_interrupt

#: How long the loop waits before it asks whether it shall stop [s].
_PATIENCE = 0.1

#: How often a process is told to leave before it is ended.
_REMINDERS = 8

_Key = TypeVar("_Key", bound=Hashable)


class Workers:
    """Some processes, as :func:`workers` gives them, or threads.

    Attributes:
        n: how many.

    """

    def __init__(self, n: int, fresh: Callable[[], Executor], interrupts: Interrupts) -> None:
        """Start none yet.

        Args:
            n: how many there may be.
            fresh: gives a pool of them.
            interrupts: signals to stop.

        """
        self.n = n
        self._fresh, self._interrupts = fresh, interrupts
        self._others = set(active_children())
        self._pool = fresh()

    def renew(self) -> None:
        """End all processes, of which one has died: what follows is done by others."""
        self.close(at_once=True)
        self._pool = self._fresh()

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a process do something.

        Raises:
            InputError: none can be started.

        """
        try:
            with without_interrupt():
                return self._pool.submit(task, *arguments)
        except BrokenProcessPool as error:
            # One has died that had nothing to do: that is said where the task is waited for.
            future: Future[Any] = Future()
            future.set_exception(error)
            return future
        except (OSError, RuntimeError) as error:
            raise InputError(f"no process can be started: {reason(error)}") from error

    def done(self, futures: Iterable[Future[Any]]) -> set[Future[Any]]:
        """Wait until one of some tasks is done.

        Raises:
            KeyboardInterrupt: there was a signal to stop.

        """
        found: set[Future[Any]] = set()
        while not found:
            found, _ = wait(futures, _PATIENCE, FIRST_COMPLETED)
            if self._interrupts:
                raise KeyboardInterrupt
        return found

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
                for key, task in islice(left, self.n - len(keys)):
                    keys[self.submit(task)] = key
                if not keys:
                    return
                for future in self.done(keys):
                    bar.update()
                    yield keys.pop(future), _result(future, unit)

    def close(self, at_once: bool = False) -> None:
        """End all processes, when they are done with what they have been given or at once."""
        if at_once:
            _end(set(active_children()) - self._others)
        self._pool.shutdown(cancel_futures=True)


def _result(future: Future[Any], unit: str) -> Any:
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise InputError(
            f"a process died while it made a {unit}: an FMU crashed, or memory ran out"
        ) from error


@contextmanager
def workers(n: int | None = None, setup: Callable[[], object] = bool) -> Iterator[Workers]:
    """Processes for the time of the context; an exception ends them at once.

    FMUs are libraries that a process loads, so the processes are fresh ones, not copies of this.

    Args:
        n: how many; None: one for each core.
        setup: called first in each of them.

    """
    # What a killed process leaves goes with the folder of this one.
    environment = {"TMPDIR": str(process_folder())} | cache.environment()
    begin, n = partial(_begin, environment, setup), min(n or cores(), most_processes())
    with held_interrupts() as interrupts:
        pool = partial(ProcessPoolExecutor, n, get_context("spawn"), begin)
        crew = Workers(n, pool, interrupts)
        try:
            yield crew
        except BaseException:
            crew.close(at_once=True)
            raise
        crew.close()


def cores() -> int:
    """How many cores this process may use."""
    n = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    # The share of a container; "max" where there is no limit.
    with suppress(OSError, ValueError):
        quota, period = map(int, Path("/sys/fs/cgroup/cpu.max").read_text().split())
        n = min(n, -(-quota // period))
    return n


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


def _begin(environment: Mapping[str, str], setup: Callable[[], object]) -> None:
    """In a new process: leave by SIGTERM as by any other exit, without temporary folders."""
    os.environ.update(environment)
    tempfile.tempdir = environment["TMPDIR"]
    signal.signal(signal.SIGTERM, _leave)
    if hasattr(signal, "SIGHUP"):
        # The end of the terminal is for the process to answer that has started this one.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()
    # As in the process that has started this one.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    imported_apart("matplotlib", "matplotlibrc")
    setup()


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
