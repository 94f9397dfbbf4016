"""Workers of a Dask cluster, which make blocks of runs; each block is a task of Dask."""

from __future__ import annotations

import asyncio
import pickle
import re
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from logging import CRITICAL
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from time import monotonic
from typing import Any

from dask import config
from dask.utils import parse_timedelta
from distributed import Client, Future, KilledWorker, Security, WorkerPlugin, get_worker
from distributed.comm import connect, get_address_host_port
from distributed.utils import silence_logging_cmgr

from auv_fmu import __version__
from orchestrator.machine.errors import InputError, reason
from orchestrator.studies.blocks import Answer, BlockWorkers, answer, cannot_make
from orchestrator.studies.columns import Points
from orchestrator.studies.engine import Engine

#: Interval between counts of the workers, and time that there may be none [s].
_GLANCE, _PATIENCE = 2.0, 120.0

#: Beginnings of addresses of schedulers that require certificates.
_ENCRYPTED = ("tls://", "wss://")


@contextmanager
def cluster(address: str, engine: Engine) -> Iterator[BlockWorkers]:
    """Use the workers of a scheduler for the context.

    Args:
        address: of the scheduler.
        engine: makes the runs.

    Raises:
        InputError: there is no such scheduler, or a worker cannot take the engine.

    """
    with silence_logging_cmgr(CRITICAL), _connected(address) as client:
        # Under a unique name: another client may run the same study.
        name = f"auv-fmu-{client.id}"
        try:
            client.register_plugin(_Share(engine), name)
        except Exception as error:
            # A worker with other packages than this process may raise anything.
            raise InputError(f"a worker cannot take the study: {reason(error)}") from error
        try:
            yield _Cluster(client, name)
        finally:
            # If it can still be reached.
            with suppress(Exception):
                client.unregister_worker_plugin(name)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    try:
        host, port = get_address_host_port(address)
        if not re.fullmatch(r"[^\s/]+", host) or not 0 < port < 2**16:
            raise ValueError("not a host, or not a port")
    except (ValueError, NotImplementedError) as error:
        raise InputError(
            f"no scheduler answers at {address or repr(address)}: {reason(error)}; an address is "
            "like tcp://HOST:PORT"
        ) from error
    # A client that cannot connect would take a minute to close.
    if failure := _failure_to_connect(address):
        raise InputError(f"no scheduler answers at {address}: {reason(failure)}") from failure
    try:
        client = Client(address, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no scheduler answers at {address}: {reason(error)}") from error
    with client:
        yield client


def _failure_to_connect(address: str) -> Exception | None:
    """Return the error of a connection to a scheduler, or None if it succeeds."""
    errors: SimpleQueue[Exception | None] = SimpleQueue()

    async def connected() -> None:
        seconds = parse_timedelta(config.get("distributed.comm.timeouts.connect"))
        secrets = Security().get_connection_args("client")
        if address.startswith(_ENCRYPTED) and secrets["ssl_context"] is None:
            raise ValueError("name certificates in Dask's configuration, distributed.comm.tls")
        # The other end may be no scheduler, and never answer.
        comm = await asyncio.wait_for(connect(address, seconds, **secrets), 2 * seconds)
        comm.abort()

    def tried() -> None:
        try:
            errors.put(asyncio.run(connected()))
        except Exception as error:
            errors.put(error)

    # In a thread, since the caller may have a running event loop.
    Thread(target=tried, daemon=True).start()
    return errors.get()


class _Share(WorkerPlugin):  # type: ignore[misc]
    """The engine on every worker, including those that join later.

    The scheduler keeps it: unlike scattered data, it is not lost with a worker.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine, self._version = engine, __version__

    def setup(self, worker: Any) -> None:
        # One run at a time in each process: an FMU is a library of the process.
        self._lock, self._address = Lock(), worker.address

    def answer(self, points: Points, limit: float) -> Answer:
        if __version__ != self._version:
            raise InputError(
                f"the worker at {self._address} has auv-fmu {__version__}, and the sender of the "
                f"study {self._version}: install the same version everywhere"
            )
        with self._lock:
            return answer(self._engine, points, limit)


def _task(name: str, points: bytes, limit: float) -> Answer:
    """Make runs, which are pickled so that Dask does not traverse them."""
    share: _Share = get_worker().plugins[name]
    return share.answer(pickle.loads(points), limit)


class _Cluster:
    """The workers of a scheduler."""

    #: The block that a thread makes, and the next.
    ahead = 2

    def __init__(self, client: Client, name: str) -> None:
        self._client, self._name = client, name
        self._threads, self._counted, self._seen = 1, float("-inf"), monotonic()
        self._under_way: dict[Future, Points] = {}
        self._done: SimpleQueue[Future] = SimpleQueue()

    @property
    def threads(self) -> int:
        self._count()
        return self._threads

    def send(self, block: Points, limit: float) -> None:
        future = self._client.submit(_task, self._name, pickle.dumps(block), limit, pure=False)
        self._under_way[future] = block
        future.add_done_callback(self._done.put)

    def receive(self) -> tuple[Points, Answer | None]:
        future = self._next()
        block = self._under_way.pop(future)
        try:
            return block, future.result(_PATIENCE)
        except KilledWorker:
            return block, None
        except CancelledError as error:
            raise _gone("scheduler") from error
        except TimeoutError as error:
            # The worker was lost after it had reported the block as done.
            raise _gone("last worker") from error
        except Exception as error:
            raise cannot_make(block, error) from error

    def _next(self) -> Future:
        while True:
            with suppress(Empty):
                return self._done.get(timeout=_GLANCE)
            self._count()

    def _count(self) -> None:
        """Count the workers' threads, if the last count is old.

        Raises:
            InputError: there have been none for too long.

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


def _gone(what: str) -> InputError:
    return InputError(
        f"the {what} is gone; finished runs are kept: start the study again to continue"
    )
