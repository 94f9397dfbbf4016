"""Rows written to files as they come."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from importlib import import_module
from io import BufferedWriter, RawIOBase, StringIO
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from orchestrator.cosim.observers.observer import Ending, Header
from orchestrator.machine.lazy import ROWS_AT_ONCE, parquet
from orchestrator.machine.operating_system import is_still

#: What Parquet needs at most: bytes of a value, and bytes that describe a column of the rows that
#: are written at once.
_BYTES, _CHUNK_BYTES = 9, 1024


class _Output(RawIOBase):
    """A new file to write to, which is opened again where an FMU in this process has closed it."""

    def __init__(self, path: Path) -> None:
        """Make it."""
        self._path, self._at = path, 0
        self._descriptor = self._opened(os.O_CREAT | os.O_TRUNC)
        self._status = os.fstat(self._descriptor)

    def check_place(self) -> None:
        """Check that it is still where it was made.

        Raises:
            OSError: the output would go nowhere.

        """
        try:
            is_there = os.path.samestat(self._path.stat(), self._status)
        except FileNotFoundError:
            is_there = False
        if not is_there:
            raise FileNotFoundError(f"{self._path} was moved or deleted while it was written")

    def fileno(self) -> int:
        """Its descriptor."""
        return self._descriptor

    def writable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """How much was written [bytes]."""
        return self._at

    def write(self, content: Any) -> int:
        """Write some of what there is to write."""
        self._reopen()
        os.lseek(self._descriptor, self._at, os.SEEK_SET)
        n = os.write(self._descriptor, content)
        self._at += n
        return n

    def truncate(self, size: int | None = None) -> int:
        """Cut it off."""
        self._at = self._at if size is None else size
        self._reopen()
        os.ftruncate(self._descriptor, self._at)
        return self._at

    def close(self) -> None:
        """Close it, if that is still to be done."""
        if not self.closed:
            super().close()
            if is_still(self._descriptor, self._status):
                os.close(self._descriptor)

    def _reopen(self) -> None:
        """Open it again if an FMU has closed it, or the owner of a file that an FMU has closed."""
        if not is_still(self._descriptor, self._status):
            self._descriptor = self._opened()

    def _opened(self, flags: int = 0) -> int:
        return os.open(self._path, os.O_WRONLY | getattr(os, "O_BINARY", 0) | flags, 0o666)


class CsvLines:
    """A file of CSV that ends with a whole line, whenever and however writing ends."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        """Make the file and write the names of its columns."""
        self._file = _Output(path)
        self.write([names])

    def write(self, lines: Sequence[Sequence[object]]) -> None:
        """Write some lines, numbers so that they read back exactly.

        Raises:
            OSError: not all of them could be written; those that could are there.

        """
        self._file.check_place()
        text = _in_csv(lines)
        if "\r" in text:
            # Readers take one outside quotes for the end of a line, and Python puts it in none.
            text = _in_csv(lines, csv.QUOTE_NONNUMERIC)
        content = text.encode()
        begin, n = self._file.tell(), 0
        try:
            while n < len(content):
                n += self._file.write(memoryview(content)[n:])
        except OSError:
            self._file.truncate(begin + content.rfind(b"\n", 0, n) + 1)
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _in_csv(lines: Sequence[Sequence[object]], quoting: Any = csv.QUOTE_MINIMAL) -> str:
    text = StringIO(newline="")
    csv.writer(text, lineterminator="\n", quoting=quoting).writerows(lines)
    return text.getvalue()


class CsvFile:
    """An observer that writes CSV; numbers are written so that they read back exactly."""

    def __init__(self, path: Path) -> None:
        """Write into a file, which is made when the run begins."""
        self._path = path

    def begin(self, header: Header) -> None:
        """Write the names of the columns."""
        self._lines = CsvLines(self._path, ("time", *header.columns))
        self._standing = header.places()

    def take(self, rows: np.ndarray) -> None:
        """Write some rows."""
        lines = rows.tolist()
        for place, standing in self._standing:
            for line, value in zip(lines, standing.values(rows[:, place]).tolist(), strict=True):
                line[place] = value
        self._lines.write(lines)

    def end(self, ending: Ending) -> None:
        """Close the file."""
        self._lines.close()


class ParquetFile:
    """An observer that writes Apache Parquet: doubles, texts, and integers of 64 bits.

    Without what is written last, nothing of such a file can be read: there is always room for that,
    and for the rows that wait.
    """

    def __init__(self, path: Path) -> None:
        """Write into a file, which is made when the run begins.

        Raises:
            InputError: pyarrow is not installed.

        """
        self._parquet = parquet()
        self._path = path

    def begin(self, header: Header) -> None:
        """Make the file and its schema."""
        self._arrow: Any = import_module("pyarrow")
        self._standing = header.places()
        kinds = [self._arrow.float64()] * (1 + len(header.columns))
        for place, standing in self._standing:
            kinds[place] = (
                self._arrow.string()
                if standing.c_type is None
                else self._arrow.from_numpy_dtype(np.dtype(standing.c_type))
            )
        self._schema = self._arrow.schema(list(zip(("time", *header.columns), kinds, strict=True)))
        self._output = _Output(self._path)
        self._file = BufferedWriter(self._output)
        self._writer = self._parquet.ParquetWriter(self._file, self._schema)
        self._waiting = [np.empty((0, len(self._schema)))]
        self._n, self._room = 0, min(header.experiment.rows, ROWS_AT_ONCE)
        self._take_room()

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, when there are enough of them: always as many at once."""
        self._waiting.append(rows.copy())
        while sum(map(len, self._waiting)) >= ROWS_AT_ONCE:
            waiting = np.vstack(self._waiting)
            self._waiting = [waiting[ROWS_AT_ONCE:]]
            self._write(waiting[:ROWS_AT_ONCE])
            self._take_room()

    def end(self, ending: Ending) -> None:
        """Write the rest and close the file."""
        self._output.check_place()
        if len(rest := np.vstack(self._waiting)):
            self._write(rest)
        self._writer.close()
        self._file.truncate()
        self._file.close()

    def _write(self, rows: np.ndarray) -> None:
        columns = [self._arrow.array(column) for column in rows.T]
        for place, standing in self._standing:
            values = standing.values(rows[:, place])
            columns[place] = self._arrow.array(values, self._schema.types[place])
        self._writer.write_batch(self._arrow.record_batch(columns, schema=self._schema))
        self._n += 1

    def _take_room(self) -> None:
        """Take the room that the file needs until the next time, if it can be had.

        Raises:
            OSError: there is not enough.

        """
        self._output.check_place()
        self._file.flush()
        if hasattr(os, "posix_fallocate"):
            columns = len(self._schema)
            needed = columns * (self._room * _BYTES + (self._n + 2) * _CHUNK_BYTES)
            os.posix_fallocate(self._file.fileno(), self._file.tell(), needed)


#: Writers by the ending of their files.
TableFormat: TypeAlias = Literal["csv", "parquet"]
TABLE_FORMATS: dict[TableFormat, type[CsvFile] | type[ParquetFile]] = {
    "csv": CsvFile,
    "parquet": ParquetFile,
}
