"""Child processes that run modules of Python, and end with this process.

`python -m orchestrator.machine.children MODULE ...` is the child's command. No code or settings are
read from the current folder, which may belong to someone else.
"""

from __future__ import annotations

import os
import runpy
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from subprocess import PIPE, CompletedProcess, Popen
from tempfile import TemporaryFile
from typing import Any

from orchestrator.machine.disk import process_folder, temporary_folder
from orchestrator.machine.operating_system import wait_for_end


def imported_apart(module: str, file: str) -> None:
    """Import a module from another working directory if this one has a file that it would read."""
    if module in sys.modules or not os.path.lexists(file):
        return
    current = Path.cwd()
    os.chdir(process_folder())
    try:
        import_module(module)
    finally:
        os.chdir(current)


def run_module(
    module: str,
    *arguments: str,
    hear: Callable[[str], None] | None = None,
    timeout: float | None = None,
) -> CompletedProcess[str]:
    """Run a module to its end; an exception here, such as Ctrl-C, ends it at once.

    Args:
        module: its name, as after `python -m`.
        arguments: arguments of its command line.
        hear: called with each line of its output as it comes.
        timeout: its time limit [s], for calls without `hear`; None: no limit.

    Raises:
        TimeoutExpired: it took longer, and was killed.
        OSError: no process can be started.

    """
    # Without -P it would import from the current folder.
    command = [sys.executable, "-P", "-m", __name__, module, *arguments]
    with (
        _tie() as tied,
        TemporaryFile("w+", encoding="utf-8", errors="replace") as complaints,
        Popen(command, stdout=PIPE, stderr=complaints, **tied) as process,
    ):
        try:
            lines = []
            if hear is not None:
                assert process.stdout is not None
                for line in process.stdout:
                    lines.append(line)
                    hear(line.rstrip("\n"))
            rest, _ = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
        complaints.seek(0)
        output = "".join(lines) + rest
        return CompletedProcess(process.args, process.returncode, output, complaints.read())


@contextmanager
def _tie() -> Iterator[dict[str, Any]]:
    """Make the child end with this process, and remove its temporary files when it ends."""
    # The child reads from a pipe; only this process holds the other end.
    end_of_child, end_of_ours = os.pipe()
    try:
        with temporary_folder() as temporary:
            yield {
                "stdin": end_of_child,
                "encoding": "utf-8",
                "errors": "replace",
                # Windows would choose a code page that lacks many letters of file names.
                "env": os.environ | {"TMPDIR": str(temporary), "PYTHONIOENCODING": "utf-8"},
            }
    finally:
        os.close(end_of_child)
        os.close(end_of_ours)


def _follow() -> None:
    """Wait for the end of the parent process, then exit."""
    wait_for_end(sys.stdin.fileno())
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_follow, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
