"""Work in a process of its own, which may crash or hang: FMUs are native code."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Generic, NamedTuple, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

#: No worker may take more address space than this [bytes], unless AddressSanitizer wants all of it.
MOST_MEMORY = 4 << 30
_SANITIZED = "ASAN_OPTIONS"


class Lost(NamedTuple):
    """A process that came to no answer."""

    why: str


class Worker(Generic[Task, Result]):
    """A process that does tasks one after the other; a new one takes the place of one that dies."""

    def __init__(self, start: Callable[..., Callable[[Task], Result]], *arguments: Any) -> None:
        """Prepare, without starting anything.

        Args:
            start: called in the process, gives what does a task; importable by its name.
            arguments: of `start`.

        """
        self._start, self._arguments = start, arguments
        self._process: Any = None

    def ask(self, task: Task, timeout: float) -> Result | Lost:
        """What a task comes to, or how the process was lost over it."""
        if self._process is None:
            self._begin()
        try:
            self._connection.send(task)
            if not self._connection.poll(timeout):
                self.close()
                return Lost(f"hangs: no answer within {timeout:g} s")
            done, answer = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode
            self._process = None
            return Lost(signal.Signals(-code).name if code < 0 else f"exit {code}")
        if not done:
            raise RuntimeError(answer)
        result: Result = answer
        return result

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(theirs, self._start, self._arguments), daemon=True
        )
        self._process.start()
        theirs.close()

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._connection.close()
            self._process = None

    def __enter__(self) -> Worker[Task, Result]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _serve(connection: Connection, start: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # FMUs have nobody else to tell of calls on what is no instance.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if _SANITIZED not in os.environ:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    do = start(*arguments)
    while True:
        try:
            task = connection.recv()
        except EOFError:
            return
        try:
            connection.send((True, do(task)))
        except Exception as error:
            connection.send((False, f"{type(error).__name__}: {error}"))
