"""Rows in a file that grows, from which they are read again to the last bit.

The file begins with the identity of the checkpoint that it belongs to: so it is told from a file of
the user's that has its name.
"""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from itertools import repeat
from pathlib import Path

import numpy as np

from orchestrator.machine.atomic import to_disk
from orchestrator.machine.errors import InputError

#: A number in the file.
_NUMBER = np.dtype("<f8")

#: Rows that are read at once.
_ROWS = 4096

#: The first bytes of a file, before an identity, and how long both are together.
_TITLE, _BEGIN = b"auv-fmu rows ", 64


def begins(path: Path, identity: str) -> bool:
    """Whether a file of rows bears an identity."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(_BEGIN) == _head(identity)


def _head(identity: str) -> bytes:
    return (_TITLE + identity.encode()).ljust(_BEGIN - 1) + b"\n"


class RowLog:
    """A file of rows, number after number, without anything between them.

    Rows that are there after those that count are compared with what comes in their place.
    """

    def __init__(
        self, path: Path, identity: str, width: int, kept: int = 0, digest: str = ""
    ) -> None:
        """Make the file, or go on after the first rows of one that is there.

        Args:
            path: of the file.
            identity: that it begins with.
            width: numbers in a row.
            kept: how many of its rows count.
            digest: of these.

        Raises:
            InputError: they are not there, or not as they were.

        """
        self._path, self._width, self._kept = path, width, kept
        self._digest = sha256()
        if not kept:
            self._file = path.open("x+b")
            self._file.write(_head(identity))
            self._after = 0
            return
        row = width * _NUMBER.itemsize
        if is_whole := begins(path, identity):
            for rows in self.kept():
                self._digest.update(rows.astype(_NUMBER, copy=False).tobytes())
        if not is_whole or self._digest.hexdigest() != digest:
            raise InputError(
                f"{path}: missing, damaged, or not of the checkpoint beside it; move both, or let "
                "--force move them aside"
            )
        self._file = path.open("r+b")
        there = (path.stat().st_size - _BEGIN) // row
        # A part of a row may follow.
        self._file.truncate(_BEGIN + there * row)
        self._file.seek(_BEGIN + kept * row)
        self._after = there - kept

    def append(self, rows: np.ndarray) -> tuple[int, int] | None:
        """Write some rows.

        Returns:
            Row and column of the first number that is not what was there; None: all are.

        """
        content = rows.astype(_NUMBER, copy=False).tobytes()
        different = self._different(content) if self._after else None
        self._file.write(content)
        self._digest.update(content)
        if different is None:
            return None
        self._after = 0
        self._file.truncate()
        return divmod(different, self._width)

    def _different(self, content: bytes) -> int | None:
        """Which number, as it stands in the file, is the first that is not what is to be there."""
        place = self._file.tell()
        there = np.frombuffer(self._file.read(len(content)), np.uint64)
        self._file.seek(place)
        # Bit for bit: zero is not minus zero.
        changed = np.flatnonzero(there != np.frombuffer(content, np.uint64)[: len(there)])
        self._after -= len(there) // self._width
        return int(changed[0]) if len(changed) else None

    def kept(self) -> Iterator[np.ndarray]:
        """The rows that were there before, some thousand at a time."""
        whole, rest = divmod(self._kept, _ROWS)
        with self._path.open("rb") as file:
            file.seek(_BEGIN)
            for n in (*repeat(_ROWS, whole), *([rest] * (rest > 0))):
                numbers = np.fromfile(file, _NUMBER, n * self._width)
                if len(numbers) < n * self._width:
                    raise InputError(f"{self._path}: holds fewer than {self._kept:,} rows")
                yield numbers.astype(float, copy=False).reshape(n, self._width)

    def to_disk(self) -> str:
        """Have all rows outlast the process, and a power cut; their digest is given back."""
        self._file.flush()
        to_disk(self._path)
        return self._digest.hexdigest()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
