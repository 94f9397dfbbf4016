"""Parallel worker processes, which end at once when the user stops the program."""

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

#: Polling interval for signals to stop [s].
_PATIENCE = 0.1

#: Number of SIGTERMs that a process gets before it is killed.
_REMINDERS = 8

_Key = TypeVar("_Key", bound=Hashable)


class Workers:
    """A pool of up to `n` processes from :func:`workers`, or of threads."""

    def __init__(self, n: int, fresh: Callable[[], Executor], interrupts: Interrupts) -> None:
        """Make a pool with `fresh`; no process is started yet."""
        self.n = n
        self._fresh, self._interrupts = fresh, interrupts
        self._others = set(active_children())
        self._pool = fresh()

    def renew(self) -> None:
        """Replace all processes after one of them has died."""
        self.close(at_once=True)
        self._pool = self._fresh()

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Pass a task to a process.

        Raises:
            InputError: no process can be started.

        """
        try:
            with without_interrupt():
                return self._pool.submit(task, *arguments)
        except BrokenProcessPool as error:
            # An idle process has died: report it where the result is waited for.
            future: Future[Any] = Future()
            future.set_exception(error)
            return future
        except (OSError, RuntimeError) as error:
            raise InputError(f"no process can be started: {reason(error)}") from error

    def done(self, futures: Iterable[Future[Any]]) -> set[Future[Any]]:
        """Wait until at least one task is done, and return the finished ones.

        Raises:
            KeyboardInterrupt: there was a signal to stop.

        """
        finished: set[Future[Any]] = set()
        while not finished:
            finished, _ = wait(futures, _PATIENCE, FIRST_COMPLETED)
            if self._interrupts:
                raise KeyboardInterrupt
        return finished

    def results(
        self, tasks: Mapping[_Key, Callable[[], Any]], unit: str
    ) -> Iterator[tuple[_Key, Any]]:
        """Yield keys and results of tasks as they finish; tasks begin in their order.

        Raises:
            InputError: a process has died, or could not be started.
            KeyboardInterrupt: there was a signal to stop.

        """
        left = iter(tasks.items())
        keys: dict[Future[Any], _Key] = {}
        with tqdm(total=len(tasks), unit=unit, disable=None) as bar:
            while True:
                # Submit only as many as can begin: a submitted task cannot be withdrawn.
                for key, task in islice(left, self.n - len(keys)):
                    keys[self.submit(task)] = key
                if not keys:
                    return
                for future in self.done(keys):
                    bar.update()
                    yield keys.pop(future), _result(future, unit)

    def close(self, at_once: bool = False) -> None:
        """End all processes, at once or when their tasks are done."""
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
    """Provide processes for the context; an exception ends them at once.

    They are spawned, not forked, since a fork would inherit the libraries of loaded FMUs.

    Args:
        n: number of processes; None: one for each core.
        setup: called first in each process.

    """
    # Their temporary files are in this process's folder, so they are always removed.
    environment = {"TMPDIR": str(process_folder())} | cache.environment()
    begin, n = partial(_begin, environment, setup), min(n or cores(), most_processes())
    with held_interrupts() as interrupts:
        pool = partial(ProcessPoolExecutor, n, get_context("spawn"), begin)
        processes = Workers(n, pool, interrupts)
        try:
            yield processes
        except BaseException:
            processes.close(at_once=True)
            raise
        processes.close()


def cores() -> int:
    """Return the number of cores that this process may use."""
    n = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    # The quota of a container; "max" if there is none.
    with suppress(OSError, ValueError):
        quota, period = map(int, Path("/sys/fs/cgroup/cpu.max").read_text().split())
        n = min(n, -(-quota // period))
    return n


def _end(processes: Collection[BaseProcess]) -> None:
    """Stop processes: first ask (a run takes the first signal to end), then kill."""
    for _ in range(_REMINDERS):
        for process in processes:
            process.terminate()
        time.sleep(_PATIENCE)
        if not any(process.is_alive() for process in processes):
            return
    for process in processes:
        process.kill()


def _begin(environment: Mapping[str, str], setup: Callable[[], object]) -> None:
    """Set up a new process, which on SIGTERM removes its temporary folders and exits."""
    os.environ.update(environment)
    tempfile.tempdir = environment["TMPDIR"]
    signal.signal(signal.SIGTERM, _leave)
    if hasattr(signal, "SIGHUP"):
        # Only the parent process handles the end of the terminal.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()
    # As in the main process.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    imported_apart("matplotlib", "matplotlibrc")
    setup()


def _follow() -> None:
    """Exit when the parent process ends, even if that is killed."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    for _ in range(_REMINDERS):
        # A run takes the first signal to end.
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)
    # An exception of SIGTERM may be lost in a callback.
    os._exit(1)


def _leave(*_: Any) -> None:
    # Without an exception, which the pool would take for the result of a task.
    rmtree(process_folder(), ignore_errors=True)
    os._exit(1)
