"""Who makes which runs, and where: processes of this machine, or those of a Dask cluster.

Runs go out in blocks, which are tasks of Dask; the outcomes of a block come back together. A block
whose worker is lost is made again by another worker.
"""

from __future__ import annotations

import asyncio
import os
import pickle
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from logging import CRITICAL
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from time import monotonic
from typing import Any

from dask import config
from dask.system import CPU_COUNT
from dask.utils import parse_timedelta
from distributed import (
    Client,
    Future,
    KilledWorker,
    Nanny,
    Security,
    SpecCluster,
    WorkerPlugin,
    get_worker,
)
from distributed.comm import connect, get_address_host_port
from distributed.utils import silence_logging_cmgr

from auv_fmu import __version__
from orchestrator.machine import cache
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import without_interrupt
from orchestrator.machine.locks import process_folder
from orchestrator.studies.engine import Engine, Outcome, Point
from orchestrator.studies.sockets import LocalScheduler, LocalWorker, place_in

#: How long a block shall take [s]: long beside the millisecond that a task costs, short for who
#: waits for the last one, or loses it. One that takes so many times as long, because its runs take
#: longer than those before them, comes back with what is done.
_SECONDS, _OVERTIME = 1.5, 2.0

#: A scheduler shall not have to deal with more blocks a second than this: on large clusters they
#: get longer.
_RATE = 200.0

#: The most runs of a block, however fast they are.
_MOST_RUNS = 10_000

#: Blocks under way for each thread of the workers: the one it makes, and the one that is next.
_AHEAD = 2

#: How often workers are counted [s], and how long there may be none [s].
_GLANCE, _PATIENCE = 2.0, 120.0

#: How long a process of this machine has to leave when the study is broken off [s].
_FAREWELL = 0.5

#: How the addresses of schedulers begin that ask for certificates.
_ENCRYPTED = ("tls://", "wss://")

#: What is said of a run that no worker has survived.
FATAL = "every process that made it died"


@contextmanager
def making(
    engine: Engine,
    runs: Iterable[Point],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Iterator[Iterator[list[Outcome]]]:
    """The outcomes of runs, block by block as they are done, for the time of the context.

    Runs are taken from their iterator as they are needed. Each has one outcome; those that end the
    process which makes them have one as well, at the very end.

    Args:
        engine: what makes them.
        runs: to be made.
        scheduler: address of a Dask scheduler; None for processes of this machine.
        workers: how many processes of this machine; None for one a core.

    Raises:
        InputError: there is no such scheduler, or nobody is left to make the runs.

    """
    with silence_logging_cmgr(CRITICAL), ExitStack() as stack:
        client = stack.enter_context(
            _local(workers) if scheduler is None else _remote(scheduler, workers)
        )
        # Under a name of its own: another client may be at the same study.
        name = f"auv-fmu-{client.id}"
        try:
            client.register_plugin(_Share(engine, quiet=scheduler is None), name)
        except Exception as error:
            # Whatever is raised by a worker with other packages than this process has.
            raise InputError(f"a worker cannot take the study: {reason(error)}") from error
        if scheduler is not None:
            stack.callback(_forget, client, name)
        yield _Making(client, name).outcomes(runs)


@contextmanager
def _remote(address: str, workers: int | None) -> Iterator[Client]:
    if workers is not None:
        raise InputError(
            "--workers is for processes of this machine: those of a scheduler are started with it"
        )
    try:
        host, port = get_address_host_port(address)
        if not re.fullmatch(r"[^\s/]+", host) or not 0 < port < 2**16:
            raise ValueError("that is no host, or no port")
    except (ValueError, NotImplementedError) as error:
        raise InputError(
            f"no scheduler answers at {address or repr(address)}: {reason(error)}; an address is "
            "like tcp://HOST:PORT"
        ) from error
    # A client that cannot connect would wait for a minute to be closed.
    if failure := _failure_to_connect(address):
        raise InputError(f"no scheduler answers at {address}: {reason(failure)}") from failure
    try:
        client = Client(address, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no scheduler answers at {address}: {reason(error)}") from error
    with client:
        yield client


def _failure_to_connect(address: str) -> Exception | None:
    """Why there is no connection to a scheduler; None: there is."""
    errors: SimpleQueue[Exception | None] = SimpleQueue()

    async def connected() -> None:
        seconds = parse_timedelta(config.get("distributed.comm.timeouts.connect"))
        secrets = Security().get_connection_args("client")
        if address.startswith(_ENCRYPTED) and secrets["ssl_context"] is None:
            raise ValueError("name certificates in Dask's configuration, distributed.comm.tls")
        # Who answers need not be a scheduler, and may say nothing.
        comm = await asyncio.wait_for(connect(address, seconds, **secrets), 2 * seconds)
        comm.abort()

    def tried() -> None:
        try:
            errors.put(asyncio.run(connected()))
        except Exception as error:
            errors.put(error)

    # Where this is called, a loop may be running.
    Thread(target=tried, daemon=True).start()
    return errors.get()


@contextmanager
def _local(workers: int | None) -> Iterator[Client]:
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: must be at least 1")
    folder = str(process_folder())
    place = place_in(process_folder()) | {"security": Security(require_encryption=False)}
    options = {
        "worker_class": LocalWorker,
        "nthreads": 1,
        "memory_limit": 0,
        "silence_logs": CRITICAL,
        "env": {"TMPDIR": folder} | cache.environment(),
    }
    worker = {"cls": Nanny, "options": place | options}
    try:
        with without_interrupt(), config.set({"temporary-directory": folder}):
            cluster = SpecCluster(
                scheduler={"cls": LocalScheduler, "options": place | {"dashboard": False}},
                workers=dict.fromkeys(range(workers or CPU_COUNT), worker),
                silence_logs=CRITICAL,
            )
            client = Client(cluster, set_as_default=False)
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"no process can be started: {reason(error)} (a script needs `if __name__ == "
            "'__main__':` around what it does)"
        ) from error
    with cluster, client:
        try:
            yield client
        except BaseException:
            _end(cluster)
            raise


def _end(cluster: SpecCluster) -> None:
    """End processes whatever they do: what they have begun nobody wants any more."""
    for nanny in cluster.workers.values():
        with suppress(OSError, TimeoutError):
            cluster.sync(nanny.kill, timeout=_FAREWELL)


def _forget(client: Client, name: str) -> None:
    """Have a cluster forget what it was sent, if there is still somebody to tell."""
    with suppress(Exception):
        client.unregister_worker_plugin(name)


class _Share(WorkerPlugin):  # type: ignore[misc]
    """What every worker has of a study, those included that come while it is under way.

    The scheduler has it in its keeping: it is not lost with a worker, as scattered data would be.
    """

    def __init__(self, engine: Engine, quiet: bool) -> None:
        self._engine, self._quiet, self._version = engine, quiet, __version__

    def setup(self, worker: Any) -> None:
        # Runs of one process are made one after the other: an FMU is a library of the process.
        self._lock, self._address = Lock(), worker.address
        if self._quiet:
            # Nothing of it belongs on the terminal of who waits for the study.
            for stream in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)

    def outcomes(self, runs: list[Point], limit: float) -> tuple[float, list[Outcome]]:
        """How long runs have taken [s], and what has come out of them.

        Args:
            runs: to be made, or the first of them where all take too long.
            limit: how long that is [s].

        """
        if __version__ != self._version:
            raise InputError(
                f"the worker at {self._address} has auv-fmu {__version__}, and who sends the study "
                f"{self._version}: install the same version everywhere"
            )
        with self._lock:
            start, seconds, outcomes = monotonic(), 0.0, []
            for outcome in self._engine.outcomes(runs):
                outcomes.append(outcome)
                seconds = monotonic() - start
                if seconds > limit:
                    break
            return seconds, outcomes


def _outcomes(name: str, runs: bytes, limit: float) -> tuple[float, list[Outcome]]:
    """A task: the outcomes of some runs, pickled so that nobody looks into them on their way."""
    share: _Share = get_worker().plugins[name]
    return share.outcomes(pickle.loads(runs), limit)


class _Making:
    """Blocks of runs on their way to workers and back."""

    def __init__(self, client: Client, name: str) -> None:
        self._client, self._name = client, name
        self._pace = float("inf")  # seconds for a step
        self._threads, self._counted, self._seen = 1, float("-inf"), monotonic()

    def outcomes(self, runs: Iterable[Point]) -> Iterator[list[Outcome]]:
        """The outcomes of runs, block by block as they are done."""
        lost: list[Point] = []
        for block, outcomes in self._made(self._blocks(runs), self._room):
            if outcomes is None:
                lost.extend(block)
            else:
                yield outcomes
        # Alone, so that none is held to blame for another that ends the process of both.
        for (run,), outcomes in self._made(([run] for run in lost), lambda: 1):
            yield outcomes or [Outcome(run.number, {}, FATAL)]

    def _blocks(self, runs: Iterable[Point]) -> Iterator[list[Point]]:
        """Runs in their order, as many together as make a task of a good length."""
        block: list[Point] = []
        steps = 0.0
        for run in runs:
            block.append(run)
            steps += run.stop_time / run.step
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
        under_way: dict[Future, list[Point]] = {}
        done: SimpleQueue[Future] = SimpleQueue()
        rests: deque[list[Point]] = deque()
        while True:
            while len(under_way) < room():
                block = rests.popleft() if rests else next(blocks, None)
                if block is None:
                    break
                future = self._sent(block)
                under_way[future] = block
                future.add_done_callback(done.put)
            if not under_way:
                return
            future = self._next(done)
            block = under_way.pop(future)
            outcomes = self._result(future, block)
            if outcomes:
                n = len(outcomes)
                rests.extend(block[i : i + n] for i in range(n, len(block), n))
            yield block, outcomes

    def _sent(self, block: list[Point]) -> Future:
        limit = _OVERTIME * self._seconds
        return self._client.submit(_outcomes, self._name, pickle.dumps(block), limit, pure=False)

    @property
    def _seconds(self) -> float:
        """How long a block shall take."""
        return max(_SECONDS, self._threads / _RATE)

    def _room(self) -> int:
        self._count()
        return max(1, _AHEAD * self._threads)

    def _next(self, done: SimpleQueue[Future]) -> Future:
        while True:
            with suppress(Empty):
                return done.get(timeout=_GLANCE)
            self._count()

    def _count(self) -> None:
        """Count the workers' threads now and then.

        Raises:
            InputError: there have been none for long.

        """
        now = monotonic()
        if now - self._counted < _GLANCE:
            return
        self._counted = now
        try:
            self._threads = sum(self._client.nthreads().values())
        except OSError as error:
            raise _gone("scheduler") from error
        if self._threads:
            self._seen = now
        elif now - self._seen > _PATIENCE:
            raise _gone("last worker")

    def _result(self, future: Future, block: list[Point]) -> list[Outcome] | None:
        try:
            seconds, outcomes = future.result(_PATIENCE)
        except KilledWorker:
            return None
        except CancelledError as error:
            raise _gone("scheduler") from error
        except TimeoutError as error:
            # The worker was lost between its word that the block is done and the block.
            raise _gone("last worker") from error
        except InputError:
            raise
        except Exception as error:
            # Of the engine, or for want of a package on the other side.
            raise InputError(
                f"the cluster cannot make runs {block[0].number} to {block[-1].number}: "
                f"{reason(error)}"
            ) from error
        self._pace = seconds / sum(run.stop_time / run.step for run in block[: len(outcomes)])
        made: list[Outcome] = outcomes
        return made


def _gone(who: str) -> InputError:
    return InputError(f"the {who} is gone; what is done is kept: start the study again to go on")
