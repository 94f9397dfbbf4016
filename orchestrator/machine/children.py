"""Modules run in processes that do not outlive this one, none of them from the current folder.

As a module it is what runs in such a process: `python -m orchestrator.machine.children MODULE ...`.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import threading
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.machine.locks import process_folder


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
) -> subprocess.CompletedProcess[str]:
    """Run a module to its end; an exception here, such as Ctrl-C, ends it at once.

    Without -P it would import from the current folder.

    Args:
        module: as after `python -m`.
        arguments: of its command line.
        folder: that it runs in; None: the current one.
        timeout: how long it may take [s]; None: as long as it wants.

    Raises:
        subprocess.TimeoutExpired: it took longer, and was ended.
        OSError: no process can be started.

    """
    # The child reads from a pipe of which only this process has the other end.
    end_of_child, end_of_ours = os.pipe()
    try:
        with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
            return subprocess.run(
                [sys.executable, "-P", "-m", __name__, module, *arguments],
                stdin=end_of_child,
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
                cwd=folder,
                timeout=timeout,
                env=os.environ | {"TMPDIR": temporary},
            )
    finally:
        os.close(end_of_child)
        os.close(end_of_ours)


def _follow() -> None:
    """End with the process that has started this one."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_follow, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
