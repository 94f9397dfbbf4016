"""Child processes that do not outlive this one, and run modules of Python.

Run as a module, `python -m orchestrator.machine.children MODULE ...`, it is the child: it runs
another module, and ends with its parent. Nothing here takes code or settings from the current
folder, which may be someone else's.
"""

from __future__ import annotations

import os
import runpy
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from subprocess import PIPE, CompletedProcess, Popen, run
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any

from orchestrator.machine.disk import process_folder
from orchestrator.machine.operating_system import wait_for_end


def imported_apart(module: str, file: str) -> None:
    """Import a module now, and elsewhere, if the current folder has a file that it would read.

    Args:
        module: to be imported.
        file: that it looks for in the current folder.

    """
    if module in sys.modules or not os.path.lexists(file):
        return
    current = Path.cwd()
    os.chdir(process_folder())
    try:
        import_module(module)
    finally:
        os.chdir(current)


def run_module(
    module: str, *arguments: str, folder: Path | None = None, timeout: float | None = None
) -> CompletedProcess[str]:
    """Run a module to its end; an exception here, such as Ctrl-C, ends it at once.

    Without -P it would import from the current folder.

    Args:
        module: as after `python -m`.
        arguments: of its command line.
        folder: that it runs in; None: the current one.
        timeout: how long it may take [s]; None: without limit.

    Raises:
        TimeoutExpired: it took longer, and was ended.
        OSError: no process can be started.

    """
    with _tie() as tied:
        command = _command(module, arguments)
        return run(command, capture_output=True, check=False, cwd=folder, timeout=timeout, **tied)


def listen_to_module(
    hear: Callable[[str], None], module: str, *arguments: str
) -> CompletedProcess[str]:
    """Run a module to its end, and hear each line of its output as it comes.

    Raises:
        OSError: no process can be started.

    """
    with (
        _tie() as tied,
        TemporaryFile("w+", encoding="utf-8", errors="replace") as complaints,
        Popen(_command(module, arguments), stdout=PIPE, stderr=complaints, **tied) as process,
    ):
        try:
            assert process.stdout is not None
            lines = []
            for line in process.stdout:
                lines.append(line)
                hear(line.rstrip("\n"))
            status = process.wait()
        except BaseException:
            process.kill()
            raise
        complaints.seek(0)
        return CompletedProcess(process.args, status, "".join(lines), complaints.read())


def _command(module: str, arguments: Sequence[str]) -> list[str]:
    return [sys.executable, "-P", "-m", __name__, module, *arguments]


@contextmanager
def _tie() -> Iterator[dict[str, Any]]:
    """Tie a child to this process, and its temporary files to its end."""
    # The child reads from a pipe of which only this process has the other end.
    end_of_child, end_of_ours = os.pipe()
    try:
        with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
            yield {
                "stdin": end_of_child,
                "encoding": "utf-8",
                "errors": "replace",
                # Windows would choose a code page, which has few letters for the names of files.
                "env": os.environ | {"TMPDIR": temporary, "PYTHONIOENCODING": "utf-8"},
            }
    finally:
        os.close(end_of_child)
        os.close(end_of_ours)


def _follow() -> None:
    """End with the process that has started this one."""
    wait_for_end(sys.stdin.fileno())
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_follow, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
