"""Child processes that do not outlive this one: modules of Python, and C compilers.

Run as a module, `python -m orchestrator.machine.children MODULE ...`, it is the child: it runs
another module, and ends with its parent. Nothing here takes code or settings from the current
folder, which may be someone else's.
"""

from __future__ import annotations

import os
import runpy
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from subprocess import PIPE, CompletedProcess, Popen, TimeoutExpired, run
from tempfile import TemporaryDirectory

from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import last_line

#: C compilers: the first one that there is, is taken. :mod:`fmus.compilers` has the same, and runs
#: them in the same way: neither of the two may import the other.
COMPILERS = ("cc", "gcc", "clang")

#: How long this machine's compiler may take [s], and ziglang, which makes a C library, too.
_LIMIT, LIMIT_OF_ZIG = 60.0, 600.0

#: A compiler: a call with its arguments.
Compiler = Callable[..., CompletedProcess[str]]


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
    # The child reads from a pipe of which only this process has the other end.
    end_of_child, end_of_ours = os.pipe()
    try:
        with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
            return run(
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


def find_compiler() -> Compiler | None:
    """Find a C compiler: this machine's, or else the package ziglang's; None: there is none."""
    if found := find_fast_compiler():
        return found
    if find_spec("ziglang") is None:
        return None
    return lambda *arguments: run_module("ziglang", "cc", *arguments, timeout=LIMIT_OF_ZIG)


def find_fast_compiler() -> Compiler | None:
    """Find this machine's C compiler, if it has one: it takes a tenth of a second, zig some."""
    command = machines_compiler()
    return None if command is None else lambda *arguments: run_compiler([command, *arguments])


def machines_compiler() -> str | None:
    """The command of this machine's C compiler; None: it has none."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def compile_library(compiler: Compiler, *arguments: str) -> bytes:
    """Compile a library of sources and options, and give its bytes.

    Raises:
        OSError: it does not; the text is its first error.

    """
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        path = Path(temporary, "library")
        process = compiler(*arguments, "-o", str(path))
        if process.returncode != 0:
            errors = (line for line in process.stderr.splitlines() if "error" in line)
            raise OSError(next(errors, last_line(process.stderr)))
        return path.read_bytes()


def run_compiler(command: Sequence[str], limit: float | None = None) -> CompletedProcess[str]:
    """Run a C compiler, and end it with all that it has started if it takes too long.

    Args:
        command: with its arguments.
        limit: how long it may take [s]; None: the limit of this machine's.

    Raises:
        OSError: it does, or it cannot be started.

    """
    limit = _LIMIT if limit is None else limit
    # Ctrl-C is for this process only.
    with Popen(
        command, stdout=PIPE, stderr=PIPE, text=True, errors="replace", start_new_session=True
    ) as process:
        try:
            said, complaints = process.communicate(timeout=limit)
        except BaseException as error:
            if os.name == "posix":
                # After Ctrl-C, Python has waited for it, and it may have ended.
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            if isinstance(error, TimeoutExpired):
                raise TimeoutError(f"{command[0]} has not ended after {limit:g} s") from None
            raise
    return CompletedProcess(command, process.returncode, said, complaints)


def _follow() -> None:
    """End with the process that has started this one."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_follow, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
