"""Whether PythonFMU can make an instance from a folder of resources.

PythonFMU 0.7 ends the process where the folder lacks the slave. The loader runs this text, which is
compiled into it, before it forwards fmi2Instantiate. It must need only Python 3.9.
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

#: Attribute of a script's module: the text that it was made from, once that was found good.
_TEXT = "__checked_text__"


class _Sound(NamedTuple):
    """A folder from which an instance can be made."""

    script: str
    guid: str
    #: What this rests on, and what these files looked like.
    files: list[str]
    stamps: list[tuple[int, int, int]]


_sound: dict[str, _Sound] = {}


def refusal(resources: str, guid: str) -> str:
    """What speaks against an instance; empty: nothing.

    Args:
        resources: path of the folder.
        guid: what the host takes the FMU's GUID for; empty: it does not say.

    """
    try:
        _check(resources, guid)
    except BaseException as error:
        what = f"{type(error).__name__}: {error}"
        return " ".join(what.encode("utf-8", "replace").decode("utf-8").split())
    return ""


def forget(resources: str) -> None:
    """Take a folder off sys.path."""
    with suppress(ValueError):
        sys.path.remove(resources)


def _check(resources: str, guid: str) -> None:
    sound = _sound.get(resources)
    if sound is None or sound.script not in sys.modules or _stamps(sound.files) != sound.stamps:
        sound = _sound[resources] = _examined(resources)
    if guid and guid.strip("{}").lower() != sound.guid.strip("{}").lower():
        raise ValueError(f"GUID {guid} does not match this FMU's, {sound.guid}")


def _stamps(files: list[str]) -> list[tuple[int, int, int]]:
    """What changes when files do."""
    found = map(os.stat, files)
    return [(it.st_ino, it.st_size, it.st_mtime_ns) for it in found]


def _examined(resources: str) -> _Sound:
    names = Path(resources, "slavemodule.txt")
    script = _content(names).decode("utf-8")
    if not script.isidentifier():
        raise ValueError(f"{names} names no module")
    path, own_guid = Path(resources, f"{script}.py"), Path(resources, "guid.txt")
    files = [str(names), str(path), str(own_guid)]
    stamps, text, guid = _stamps(files), _content(path), _content(own_guid).decode("utf-8")
    # An import reads what was compiled before, if it is there.
    cached = Path(importlib.util.cache_from_source(str(path)))
    if cached.exists() and not cached.is_file():
        raise ValueError(f"{cached} is not a regular file")
    # It tells what is wrong with a text, where an import may find the bytes of an older one.
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
    """What is in a file; from a pipe or device a read may never come back."""
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
    """Whether there is a class where PythonFMU will look for it."""
    return any(
        isinstance(found, type)
        and (name == "" or any(base.__name__ == "Fmi2Slave" for base in found.__mro__[1:]))
        for name, found in vars(module).items()
    )
