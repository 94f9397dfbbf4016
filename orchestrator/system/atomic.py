"""Files that appear whole or not at all, and outlast a power cut."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from orchestrator.system.leftovers import claimed, remove_left

#: How the name of a file begins that is being written.
_PARTIAL = ".partial-"

#: What file systems answer that know no fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A file to write instead of another, whose place it takes at the end.

    An exception in the context leaves the other as it was.
    """
    remove_left(path.parent, f"{_PARTIAL}*")
    # Ends as the other does: some writers tell the format by that.
    partial = path.with_name(f"{_PARTIAL}{uuid4().hex}{path.suffix}")
    try:
        partial.touch()
        with claimed(partial):
            yield partial
            to_disk(partial)
            partial.replace(path)
        to_disk(path.parent)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


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
