"""Machines that lack something, and processes that are ended at a bad time."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from orchestrator.machine.disk import LOCK
from orchestrator.runs.folder import LEDGER

#: Numbers from <linux/prctl.h> and <linux/capability.h>: what lets root write where it may not,
#: and exceed limits.
_PR_CAPBSET_DROP = 24
_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH, _CAP_FOWNER, _CAP_SYS_RESOURCE = 1, 2, 3, 24

#: The loops, each of which has to do as the other.
LOOPS = ("python", "compiled")

#: Longest time for processes to notice that they must end [s].
PATIENCE = 20.0

#: Calls before which a crash can come.
_CALLS = ("replace", "rename", "unlink", "rmdir", "mkdir", "fsync")


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path]:
    """A file system with room for so many bytes, mounted on a folder; skips where that fails."""
    folder.mkdir()
    options = f"size={size}"
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "none", folder], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("no tmpfs can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def start(
    *arguments: str,
    limits: Mapping[int, int] | None = None,
    environment: Mapping[str, str | None] | None = None,
    before: Callable[[], object] = lambda: None,
) -> subprocess.Popen[str]:
    """The command line in a session of its own.

    Args:
        arguments: after `auv-fmu`.
        limits: of its resources, by their numbers in the module `resource`.
        environment: what is different in it; None: a variable that is not set.
        before: called in the new process.

    """

    def prepare() -> None:
        for number, limit in (limits or {}).items():
            resource.setrlimit(number, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        before()

    changed = {**os.environ, **(environment or {})}
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "orchestrator", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={name: value for name, value in changed.items() if value is not None},
        preexec_fn=prepare,  # noqa: PLW1509  # no threads here
        start_new_session=True,
    )


def called(*arguments: str, **how: object) -> tuple[int, list[str]]:
    """Exit status and lines of standard error of the command line."""
    process = start(*arguments, **how)  # type: ignore[arg-type]
    _, error = process.communicate(timeout=120)
    return process.returncode, error.splitlines()


def without_privileges() -> None:
    """Let root be bound by permissions; to be called before the program starts."""
    if os.getuid() == 0:
        prctl = ctypes.CDLL(None).prctl
        for power in (_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH, _CAP_FOWNER, _CAP_SYS_RESOURCE):
            prctl(_PR_CAPBSET_DROP, power, 0, 0, 0)


def members(session: int) -> set[int]:
    """The processes of a session that still run."""
    found = set()
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        state, _parent, _group, its_session = fields[:4]
        if int(its_session) == session and state != "Z":
            found.add(int(status.parent.name))
    return found


def is_over(session: int) -> bool:
    """True if all processes of a session end before patience does."""
    return eventually(lambda: not members(session))


def eventually(condition: Callable[[], object]) -> bool:
    """True if something comes true before patience ends."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return bool(condition())


def forked(work: Callable[[], object]) -> int:
    """A copy of this process, in a session of its own, that does some work and exits.

    Without what Python does at the end: that is for the process that it is a copy of.
    """
    pid = os.fork()
    if pid:
        return pid
    os.setsid()
    status = 70
    try:
        status = int(work() or 0)  # type: ignore[call-overload]
    except SystemExit as end:
        status = int(end.code or 0)
    finally:
        os._exit(status)


def ended(pid: int) -> int:
    """Exit status of a copy; -N if signal N has ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def killed_at(n: int, work: Callable[[], object], calls: Sequence[str] = _CALLS) -> bool:
    """Do some work in a copy that is killed before its n-th call that changes a file system.

    Returns:
        Whether it came so far.

    """

    def doomed() -> None:
        left = [n]

        def counted(call: Callable[..., object]) -> Callable[..., object]:
            def wrapper(*arguments: object, **options: object) -> object:
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                return call(*arguments, **options)

            return wrapper

        for name in calls:
            setattr(os, name, counted(getattr(os, name)))
        work()
        os._exit(0)

    return ended(forked(doomed)) == -signal.SIGKILL


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder, also hidden ones, except locks and ledgers, which all differ."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (LEDGER, LOCK)
    }
