"""Blocks of runs: their sizes, the workers that make them, and their outcomes.

Workers are processes of this machine, threads if the engine releases Python's lock, or workers of a
Dask cluster (:mod:`.cluster`). If a worker dies, another one repeats its block.
"""

from __future__ import annotations

import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from math import inf
from pathlib import Path
from threading import Event
from time import monotonic
from typing import NamedTuple, Protocol

import numpy as np

from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import held_interrupts
from orchestrator.machine.workers import Workers, cores
from orchestrator.machine.workers import workers as workers_of
from orchestrator.studies.columns import Outcome, Outcomes, Points
from orchestrator.studies.engine import Engine

#: Intended duration of a block [s], much longer than the millisecond that a task costs, but short
#: for a user who waits for the last block, or loses it. A block that takes longer than this
#: multiple is returned with the runs that are done.
_SECONDS, _OVERTIME = 1.5, 2.0

#: Largest number of blocks per second that a scheduler gets: on large clusters they are longer.
_RATE = 200.0

#: Number of times that a block is repeated on this machine before its runs are made one by one.
_LOSSES = 1

#: Failure of a run that no worker has survived.
FATAL = "every process that ran it died"

#: The engine of this process, if it is a worker of this machine.
_engine: list[Engine] = []

#: Duration of a block [s], and the outcomes of its runs, or of the first ones if it took too long.
Answer = tuple[float, Outcomes]


class BlockWorkers(Protocol):
    """Workers that make blocks of runs.

    Attributes:
        threads: number of blocks that they make at the same time.
        ahead: number of blocks that may be under way for each thread.

    """

    ahead: int

    @property
    def threads(self) -> int: ...

    def send(self, block: Points, limit: float) -> None:
        """Start a block; after `limit` seconds the runs that are done are returned."""

    def receive(self) -> tuple[Points, Answer | None]:
        """Wait for a block; return it with its answer, or None if all its processes died.

        Raises:
            InputError: no worker is left to make the runs, or the engine cannot.

        """
        ...


@contextmanager
def local_workers(n: int | None, engine: Engine) -> Iterator[BlockWorkers]:
    """Start processes of this machine for the context.

    Args:
        n: number of processes; None for one per core.
        engine: makes the runs.

    Raises:
        InputError: none can be started.

    """
    with temporary_folder() as folder:
        # In a file, since a process that ends at once would never read it from a pipe.
        (file := folder / "engine").write_bytes(pickle.dumps(engine))
        with workers_of(n, partial(_set_up, file)) as workers:
            try:
                workers.done([first := workers.submit(bool)])
                first.result()
            except BrokenProcessPool:
                raise InputError(
                    "no process can be started (a script needs `if __name__ == '__main__':` around "
                    "what it does)"
                ) from None
            yield _Local(workers, _task)


class _Sent(NamedTuple):
    """A block under way, its limit [s], and how many more times it may be repeated."""

    block: Points
    limit: float
    left: int


class _Local:
    """Processes of this machine, or threads of this process, and their task for a block."""

    ahead = 1

    def __init__(self, workers: Workers, task: Callable[[Points, float], Answer]) -> None:
        self._workers, self._task, self.threads = workers, task, workers.n
        self._under_way: dict[Future[Answer], _Sent] = {}
        self._put_aside: list[Points] = []

    def send(self, block: Points, limit: float, left: int = _LOSSES) -> None:
        future = self._workers.submit(self._task, block, limit)
        self._under_way[future] = _Sent(block, limit, left)

    def receive(self) -> tuple[Points, Answer | None]:
        while not self._put_aside:
            future = next(iter(self._workers.done(self._under_way)))
            try:
                answer = future.result()
                return self._under_way.pop(future).block, answer
            except BrokenProcessPool:
                self._renew()
            except Exception as error:
                raise cannot_make(self._under_way[future].block, error) from error
        return self._put_aside.pop(), None

    def _renew(self) -> None:
        """Replace all processes, which end with the one that died, and repeat their blocks."""
        self._workers.renew()
        lost = [future for future in self._under_way if future.exception() is not None]
        for block, limit, left in [self._under_way.pop(future) for future in lost]:
            if left:
                self.send(block, limit, left - 1)
            else:
                self._put_aside.append(block)


@contextmanager
def local_threads(n: int | None, engine: Engine) -> Iterator[BlockWorkers]:
    """Start threads for the context, for an engine that releases Python's lock.

    Args:
        n: number of threads; None for one per core.
        engine: makes the runs, in several threads at the same time.

    """
    n, ends = n or cores(), Event()
    with held_interrupts() as interrupts:
        threads = Workers(n, partial(ThreadPoolExecutor, n), interrupts)
        try:
            yield _Local(threads, partial(answer, engine, ends=ends))
        finally:
            # Blocks stop after the run under way.
            ends.set()
            threads.close()


def _set_up(file: Path) -> None:
    _engine.append(pickle.loads(file.read_bytes()))
    # FMUs must not print to the terminal of the study.
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def _task(block: Points, limit: float) -> Answer:
    return answer(_engine[0], block, limit)


def answer(engine: Engine, points: Points, limit: float, ends: Event | None = None) -> Answer:
    """Make runs; stop after `limit` seconds, or if `ends` is set, and return what is done."""
    start, seconds, made = monotonic(), 0.0, list[Outcomes]()
    for outcomes in engine.outcomes(points):
        made.append(outcomes)
        seconds = monotonic() - start
        if seconds > limit or (ends is not None and ends.is_set()):
            break
    return seconds, Outcomes.joined(made)


def cannot_make(block: Points, error: Exception) -> InputError:
    """Return the error for an engine that raises, or that lacks a package on a worker."""
    if isinstance(error, InputError):
        return error
    numbers = f"{block.numbers[0]} to {block.numbers[-1]}"
    return InputError(f"runs {numbers} cannot be made: {reason(error)}")


class Blocks:
    """Blocks of runs, sent to workers and received."""

    def __init__(self, workers: BlockWorkers, engine: Engine) -> None:
        self._workers, self._engine = workers, engine
        self._pace = inf  # seconds per step

    def outcomes(self, points: Iterable[Points]) -> Iterator[Outcomes]:
        """Yield the outcomes of runs, block by block as they are done."""
        lost: list[Points] = []
        for block, outcomes in self._made(self._blocks(points), self._room):
            if outcomes is None:
                lost.append(block)
            else:
                yield outcomes
        # One by one, so that only the run that ends its process fails.
        single = (block[i : i + 1] for block in lost for i in range(len(block)))
        for block, outcomes in self._made(single, lambda: 1):
            [number] = block.numbers.tolist()
            yield outcomes or Outcomes.of([Outcome(number, {}, FATAL)])

    def _blocks(self, points: Iterable[Points]) -> Iterator[Points]:
        """Yield runs in their order, in blocks of the intended duration."""
        least, most = self._engine.least_runs, self._engine.most_runs
        for some in points:
            steps, first = some.steps.cumsum(), 0
            while first < len(some):
                before = steps[first - 1] if first else 0.0
                room = self._seconds / self._pace if self._pace else inf
                n = 1 + int(np.searchsorted(steps[first:], before + room))
                n = min(max(n, least), most)
                yield some[first : first + n]
                first += n

    def _made(
        self, blocks: Iterator[Points], room: Callable[[], int]
    ) -> Iterator[tuple[Points, Outcomes | None]]:
        """Yield blocks as they are done with their outcomes, or None if each worker died.

        `room` returns the number of blocks that may be under way.
        """
        under_way = 0
        rests: deque[Points] = deque()
        done: list[tuple[Points, Outcomes | None]] = []
        while True:
            while under_way < room():
                block = rests.popleft() if rests else next(blocks, None)
                if block is None:
                    break
                self._workers.send(block, _OVERTIME * self._seconds)
                under_way += 1
            # Only now, when the workers have work again.
            yield from done
            if not under_way:
                return
            block, answer = self._workers.receive()
            under_way -= 1
            done = [(block, answer and answer[1])]
            if answer:
                seconds, outcomes = answer
                n = len(outcomes)
                rests.extend(block[i : i + n] for i in range(n, len(block), n))
                self._pace = seconds / float(block[:n].steps.sum())

    def _room(self) -> int:
        return max(1, self._workers.ahead * self._workers.threads)

    @property
    def _seconds(self) -> float:
        """Intended duration of a block [s]."""
        return max(_SECONDS, self._workers.threads / _RATE)
