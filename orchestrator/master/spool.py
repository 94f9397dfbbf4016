"""Rows in a file that grows, from which they are read again to the last bit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

import numpy as np

from orchestrator.errors import InputError
from orchestrator.system.atomic import to_disk

#: A number in the file.
_NUMBER = np.dtype("<f8")

#: Rows that are read at once.
_ROWS = 4096


class Spool:
    """A file of rows, number after number, without anything between them.

    Rows that are there behind those that count are compared with what comes in their place.
    """

    def __init__(self, path: Path, width: int, kept: int = 0) -> None:
        """Make the file, or go on behind the first rows of one that is there.

        Args:
            path: of the file.
            width: numbers in a row.
            kept: how many of its rows count.

        Raises:
            InputError: it has fewer.

        """
        self._path, self._width, self._kept = path, width, kept
        row = width * _NUMBER.itemsize
        there = path.stat().st_size // row if kept and path.is_file() else 0
        if there < kept:
            raise InputError(f"{path}: holds fewer than {kept:,} rows")
        self._file = path.open("r+b" if kept else "wb")
        # A part of a row may follow.
        self._file.truncate(there * row)
        self._file.seek(kept * row)
        self._behind = there - kept

    def append(self, rows: np.ndarray) -> tuple[int, int] | None:
        """Write some rows.

        Returns:
            Row and column of the first number that is not what was there; None: all are.

        """
        content = rows.astype(_NUMBER, copy=False).tobytes()
        different = self._different(content) if self._behind else None
        self._file.write(content)
        if different is None:
            return None
        self._behind = 0
        self._file.truncate()
        return divmod(different, self._width)

    def _different(self, content: bytes) -> int | None:
        """Which number, as it stands in the file, is the first that is not what is to be there."""
        place = self._file.tell()
        there = np.frombuffer(self._file.read(len(content)), np.uint64)
        self._file.seek(place)
        # Bit for bit: zero is not minus zero.
        changed = np.flatnonzero(there != np.frombuffer(content, np.uint64)[: len(there)])
        self._behind -= len(there) // self._width
        return int(changed[0]) if len(changed) else None

    def kept(self) -> Iterator[np.ndarray]:
        """The rows that were there before, some thousand at a time."""
        whole, rest = divmod(self._kept, _ROWS)
        with self._path.open("rb") as file:
            for n in (*repeat(_ROWS, whole), *([rest] * (rest > 0))):
                numbers = np.fromfile(file, _NUMBER, n * self._width)
                yield numbers.astype(float, copy=False).reshape(n, self._width)

    def to_disk(self) -> None:
        """Have all rows outlast the process, and a power cut."""
        self._file.flush()
        to_disk(self._path)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
