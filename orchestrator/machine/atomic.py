"""Files that outlast a power cut, and records that carry a checksum over themselves."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

#: The entry with the checksum.
_SEAL = "sha256"


def sealed(content: Mapping[str, Any]) -> str:
    """The text of a record, with its checksum."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def unsealed(text: str) -> dict[str, Any]:
    """The content of a record that is as it was written.

    Raises:
        ValueError: it is not, or is no such record.

    """
    content = json.loads(text)
    if not isinstance(content, dict) or _SEAL not in content:
        raise ValueError("it has no checksum of its own")
    if content.pop(_SEAL) != _checksum(content) or sealed(content) != text:
        raise ValueError("it is damaged: its checksum differs")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content).encode()).hexdigest()


#: What file systems answer that know no fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)


def write_new(path: Path, text: str) -> None:
    """Write a text into a file that is not there yet; nor may a link be, which could lead anywhere.

    Raises:
        OSError: it is there, or cannot be written.

    """
    with path.open("x", encoding="utf-8") as file:
        file.write(text)


def write_whole(path: Path, text: str, partial: Path) -> None:
    """Have a file hold a text: whatever happens meanwhile, it is the one before or this one.

    Args:
        path: of the file.
        text: that it shall hold.
        partial: beside it, a name that nobody else has: what a killed process left there is ours.

    Raises:
        OSError: it cannot be written.

    """
    partial.unlink(missing_ok=True)
    write_new(partial, text)
    to_disk(partial)
    partial.replace(path)
    to_disk(path.parent)


def to_disk(path: Path) -> None:
    """Have a file, or the names in a folder, outlast a power cut.

    Raises:
        OSError: it is not all there; some file systems say so only now.

    """
    if os.name != "posix":
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    finally:
        os.close(descriptor)
