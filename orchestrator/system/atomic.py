"""Files that outlast a power cut."""

from __future__ import annotations

import errno
import os
from pathlib import Path

#: What file systems answer that know no fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)


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
