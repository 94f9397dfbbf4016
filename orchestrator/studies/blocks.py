"""Runs in blocks: how many together, what makes them, and what comes back.

Processes of this machine make them, or threads where the engine leaves Python, or the workers of a
Dask cluster (:mod:`.cluster`). A block whose process is lost is made again by another one.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from threading import Event
from time import monotonic
from typing import NamedTuple, Protocol

from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import held_interrupts
from orchestrator.machine.workers import Workers, cores
from orchestrator.machine.workers import workers as workers_of
from orchestrator.studies.engine import Engine, Outcome, Point

#: How long a block shall take [s]: long beside the millisecond that a task costs, short for a user
#: who waits for the last one, or loses it. One that takes so many times as long, because its runs
#: take longer than the runs before them, comes back with what is done.
_SECONDS, _OVERTIME = 1.5, 2.0

#: A scheduler shall not have to deal with more blocks a second than this: on large clusters they
#: get longer.
_RATE = 200.0

#: The most runs of a block, however fast they are.
_MOST_RUNS = 10_000

#: How often a block may lose its process on this machine before it is put aside.
_LOSSES = 1

#: What is said of a run that no worker has survived.
FATAL = "every process that ran it died"

#: What this process makes runs with, if it is a worker of this machine.
_engine: list[Engine] = []

#: How long a block has taken [s], and the outcomes of its runs, or of the first of them where all
#: took too long.
Answer = tuple[float, list[Outcome]]


class Crew(Protocol):
    """The workers that make blocks of runs.

    Attributes:
        threads: how many runs are made at a time.
        ahead: how many blocks may be under way for each of them.

    """

    ahead: int

    @property
    def threads(self) -> int: ...

    def send(self, block: list[Point], limit: float) -> None:
        """Have a block made, or what of it takes no longer than a limit [s]."""

    def receive(self) -> tuple[list[Point], Answer | None]:
        """Wait for a block that was sent, and what has come of it.

        Returns:
            The block, and None where every process that made it has died.

        Raises:
            InputError: no worker is left to make the runs, or the engine cannot.

        """
        ...


@contextmanager
def local_workers(n: int | None, engine: Engine) -> Iterator[Crew]:
    """Processes of this machine, for the time of the context.

    Args:
        n: how many; None for one a core.
        engine: makes the runs.

    Raises:
        InputError: none can be started.

    """
    with workers_of(n, partial(_set_up, engine)) as workers:
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
    """A block that was sent, and how many more processes it may lose."""

    block: list[Point]
    limit: float
    left: int


class _Local:
    """Processes of this machine, or threads of this one, and the task that makes a block there."""

    ahead = 1

    def __init__(self, workers: Workers, task: Callable[[list[Point], float], Answer]) -> None:
        self._workers, self._task, self.threads = workers, task, workers.n
        self._under_way: dict[Future[Answer], _Sent] = {}
        self._put_aside: list[list[Point]] = []

    def send(self, block: list[Point], limit: float, left: int = _LOSSES) -> None:
        future = self._workers.submit(self._task, block, limit)
        self._under_way[future] = _Sent(block, limit, left)

    def receive(self) -> tuple[list[Point], Answer | None]:
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
        """Have what was under way made by other processes: all end with the one that has died."""
        self._workers.renew()
        lost = [future for future in self._under_way if future.exception() is not None]
        for block, limit, left in [self._under_way.pop(future) for future in lost]:
            if left:
                self.send(block, limit, left - 1)
            else:
                self._put_aside.append(block)


@contextmanager
def local_threads(n: int | None, engine: Engine) -> Iterator[Crew]:
    """Threads of this process, for the time of the context: for an engine that leaves Python.

    Args:
        n: how many; None for one a core.
        engine: makes the runs; several threads use it at the same time.

    """
    n, ends = n or cores(), Event()
    with held_interrupts() as interrupts:
        threads = Workers(n, partial(ThreadPoolExecutor, n), interrupts)
        try:
            yield _Local(threads, partial(answer, engine, ends=ends))
        finally:
            # With the runs that are under way.
            ends.set()
            threads.close()


def _set_up(engine: Engine) -> None:
    _engine.append(engine)
    # Nothing of it belongs on the terminal where the study was started.
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def _task(block: list[Point], limit: float) -> Answer:
    return answer(_engine[0], block, limit)


def answer(engine: Engine, points: list[Point], limit: float, ends: Event | None = None) -> Answer:
    """Make runs, or the first of them where all take longer than a limit [s], or nobody waits."""
    start, seconds, outcomes = monotonic(), 0.0, []
    for outcome in engine.outcomes(points):
        outcomes.append(outcome)
        seconds = monotonic() - start
        if seconds > limit or (ends is not None and ends.is_set()):
            break
    return seconds, outcomes


def cannot_make(block: list[Point], error: Exception) -> InputError:
    """Return what is said of an engine that raises, or that lacks a package on the other side."""
    if isinstance(error, InputError):
        return error
    numbers = f"{block[0].number} to {block[-1].number}"
    return InputError(f"runs {numbers} cannot be made: {reason(error)}")


class Making:
    """Blocks of runs on their way to workers and back."""

    def __init__(self, crew: Crew) -> None:
        self._crew = crew
        self._pace = float("inf")  # seconds for a step

    def outcomes(self, points: Iterable[Point]) -> Iterator[list[Outcome]]:
        """The outcomes of runs, block by block as they are done."""
        lost: list[Point] = []
        for block, outcomes in self._made(self._blocks(points), self._room):
            if outcomes is None:
                lost.extend(block)
            else:
                yield outcomes
        # One by one, so that none is blamed for another that ends the process of both.
        for (point,), outcomes in self._made(([point] for point in lost), lambda: 1):
            yield outcomes or [Outcome(point.number, {}, FATAL)]

    def _blocks(self, points: Iterable[Point]) -> Iterator[list[Point]]:
        """Runs in their order, as many together as make a task of a good length."""
        block: list[Point] = []
        steps = 0.0
        for point in points:
            block.append(point)
            steps += point.steps
            if steps * self._pace >= self._seconds or len(block) == _MOST_RUNS:
                yield block
                block, steps = [], 0.0
        if block:
            yield block

    def _made(
        self, blocks: Iterator[list[Point]], room: Callable[[], int]
    ) -> Iterator[tuple[list[Point], list[Outcome] | None]]:
        """Blocks as they are done and their outcomes, or None where each worker has died.

        Args:
            blocks: of runs.
            room: how many blocks may be under way.

        """
        under_way = 0
        rests: deque[list[Point]] = deque()
        done: list[tuple[list[Point], list[Outcome] | None]] = []
        while True:
            while under_way < room():
                block = rests.popleft() if rests else next(blocks, None)
                if block is None:
                    break
                self._crew.send(block, _OVERTIME * self._seconds)
                under_way += 1
            # Now, when there is work again for the workers that have made them.
            yield from done
            if not under_way:
                return
            block, answer = self._crew.receive()
            under_way -= 1
            done = [(block, answer and answer[1])]
            if answer:
                seconds, outcomes = answer
                n = len(outcomes)
                rests.extend(block[i : i + n] for i in range(n, len(block), n))
                self._pace = seconds / sum(point.steps for point in block[:n])

    def _room(self) -> int:
        return max(1, self._crew.ahead * self._crew.threads)

    @property
    def _seconds(self) -> float:
        """How long a block shall take."""
        return max(_SECONDS, self._crew.threads / _RATE)
