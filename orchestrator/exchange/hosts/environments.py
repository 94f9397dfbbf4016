"""Environments of tools in the user's cache folder, each made when it is first needed.

Some tools want versions of packages that do not go together, and some are large.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from sysconfig import get_path

from tqdm import tqdm

from orchestrator.machine.cache import category_folder
from orchestrator.machine.disk import hold_lock
from orchestrator.machine.errors import InputError, reason

#: What environments are in the user's cache folder.
_CATEGORY = "hosts"

#: A file that is in an environment once all is installed in it.
_WHOLE = "auv-fmu-whole"

#: pip would try again for minutes where there is no network.
_PIP = ("-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--retries", "1")

#: What pip says where it reaches nothing, before it says that there is no such package.
_UNREACHED = "connection broken by"

#: Letters of a line of pip that are shown while it works.
_SHOWN = 60


def folder_of(requirements: Sequence[str]) -> Path:
    """The folder of the environment that has some packages; it need not be there.

    Raises:
        OSError: the cache folder cannot be made.

    """
    whole = "\n".join((platform.python_version(), sys.base_prefix, *requirements))
    return category_folder(_CATEGORY) / sha256(whole.encode()).hexdigest()[:16]


def is_whole(folder: Path) -> bool:
    """Whether all is installed in an environment."""
    return (folder / _WHOLE).is_file()


def python_with(requirements: Sequence[str], told: Callable[[], object] = bool) -> Path:
    """The Python of the environment that has some packages, which is made if it is not there.

    Args:
        requirements: as pip has them.
        told: called before it is made.

    Raises:
        InputError: it cannot be made.

    """
    try:
        folder = folder_of(requirements)
        python = Path(get_path("scripts", "venv", {"base": str(folder)}), "python")
        folder.mkdir(0o700, exist_ok=True)
        # Not the folder itself, which is cleared.
        with hold_lock(folder.parent, wait=True):
            if not is_whole(folder):
                told()
                _run([sys.executable, "-I", "-m", "venv", "--clear", str(folder)])
                _run([str(python), "-I", *_PIP, *requirements])
                (folder / _WHOLE).touch()
    except OSError as error:
        raise InputError(f"cannot be installed: {reason(error)}") from error
    return python


def _run(command: Sequence[str]) -> None:
    """Run a command, and show its last line while it works.

    Raises:
        InputError: it fails.

    """
    lines = ["no reason given"]
    with (
        tqdm(bar_format="{desc}", disable=None, leave=False) as bar,
        subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
        ) as process,
    ):
        assert process.stdout is not None
        try:
            for line in filter(None, map(str.strip, process.stdout)):
                lines.append(line)
                bar.set_description_str(line[:_SHOWN])
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        unreached = any(_UNREACHED in line for line in lines)
        why = "pip cannot reach a package index" if unreached else lines[-1].removeprefix("ERROR: ")
        raise InputError(f"cannot be installed: {why}")
