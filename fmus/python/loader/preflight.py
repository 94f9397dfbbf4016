"""Check that PythonFMU can make an instance from a folder of resources.

PythonFMU 0.7 ends the process if the folder lacks the slave. The loader contains the text of this
module, and runs it before it forwards fmi2Instantiate. It may use only Python 3.9.
"""

from __future__ import annotations

import importlib.util
import os
import stat
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

#: Attribute of a script's module: its text, once that was checked.
_TEXT = "__checked_text__"


class _Sound(NamedTuple):
    """A folder that was checked."""

    script: str
    guid: str
    #: The files that were checked, and their stamps.
    files: list[str]
    stamps: list[tuple[int, int, int]]


_sound: dict[str, _Sound] = {}


def refusal(resources: str, guid: str) -> str:
    """Return the reason why no instance can be made, or an empty text.

    Args:
        resources: path of the folder.
        guid: GUID that the host passes, or an empty text.

    """
    try:
        _check(resources, guid)
    except BaseException as error:
        what = f"{type(error).__name__}: {error}"
        return " ".join(what.encode("utf-8", "replace").decode("utf-8").split())
    return ""


def forget(resources: str) -> None:
    """Remove a folder from sys.path."""
    with suppress(ValueError):
        sys.path.remove(resources)


def _check(resources: str, guid: str) -> None:
    sound = _sound.get(resources)
    if sound is None or sound.script not in sys.modules or _stamps(sound.files) != sound.stamps:
        sound = _sound[resources] = _examined(resources)
    if guid and guid.strip("{}").lower() != sound.guid.strip("{}").lower():
        raise ValueError(f"GUID {guid} does not match this FMU's, {sound.guid}")


def _stamps(files: list[str]) -> list[tuple[int, int, int]]:
    """Return numbers of files that differ after a change."""
    stats = map(os.stat, files)
    return [(stat.st_ino, stat.st_size, stat.st_mtime_ns) for stat in stats]


def _examined(resources: str) -> _Sound:
    names = Path(resources, "slavemodule.txt")
    script = _content(names).decode("utf-8")
    if not script.isidentifier():
        raise ValueError(f"{names} names no module")
    path, own_guid = Path(resources, f"{script}.py"), Path(resources, "guid.txt")
    files = [str(names), str(path), str(own_guid)]
    stamps, text, guid = _stamps(files), _content(path), _content(own_guid).decode("utf-8")
    # An import reads the cached byte code, if there is any.
    cached = Path(importlib.util.cache_from_source(str(path)))
    if cached.exists() and not cached.is_file():
        raise ValueError(f"{cached} is not a regular file")
    # Report syntax errors, which an import with older byte code would not find.
    compile(text, path, "exec")
    module = _imported(script, resources)
    if _TEXT not in vars(module) and Path(str(module.__file__)).read_bytes() == text:
        if not _has_slave(module):
            raise ValueError(f"{path} holds no slave")
        setattr(module, _TEXT, text)
    if vars(module).get(_TEXT) != text:
        raise ValueError(f"another module {script} is loaded in this process")
    return _Sound(script, guid, files, stamps)


def _content(path: Path) -> bytes:
    """Read a regular file: reading a pipe or device could block."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise ValueError(f"{path} is not a regular file")
        return file.read()


def _imported(script: str, resources: str) -> ModuleType:
    importlib.invalidate_caches()
    sys.path.insert(0, resources)
    try:
        return importlib.import_module(script)
    finally:
        forget(resources)


def _has_slave(module: ModuleType) -> bool:
    """Return True if a class is where PythonFMU looks for it."""
    return any(
        isinstance(value, type)
        and (name == "" or any(base.__name__ == "Fmi2Slave" for base in value.__mro__[1:]))
        for name, value in vars(module).items()
    )
