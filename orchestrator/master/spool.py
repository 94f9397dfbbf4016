"""Rows in a file that grows, from which they are read again to the last bit."""

from __future__ import annotations

import os
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
    """A file of rows, number after number, without anything between them."""

    def __init__(self, path: Path, width: int, kept: int = 0) -> None:
        """Make the file, or go on behind the first rows of one that is there.

        Args:
            path: of the file.
            width: numbers in a row.
            kept: how many of its rows count; whatever is behind them goes.

        Raises:
            InputError: it has fewer.

        """
        self._path, self._width, self._kept = path, width, kept
        length = kept * width * _NUMBER.itemsize
        if kept and (not path.is_file() or path.stat().st_size < length):
            raise InputError(f"{path}: holds fewer than {kept:,} rows")
        self._file = path.open("r+b" if kept else "wb")
        self._file.truncate(length)
        self._file.seek(0, os.SEEK_END)

    def append(self, rows: np.ndarray) -> None:
        """Write some rows."""
        self._file.write(rows.astype(_NUMBER, copy=False).tobytes())

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
