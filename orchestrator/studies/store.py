"""What has come out of a study: kept as it comes, and written whole at the end.

Outcomes go into a database beside the study's record, a transaction a block: whatever happens to
this process, it holds blocks whole and each run once. Each row has a checksum, in which the random
token of the database is: so it is told from others and from what was changed. When all runs are
there they are written to one table in their order, and the database goes.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from hashlib import sha256
from importlib import import_module
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.figures.study_values import CAUTION, FAILURE, SCENARIO
from orchestrator.machine.disk import move_aside
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.identity import differences
from orchestrator.runs.folder import Ledger, open_ledger
from orchestrator.studies.engine import Outcome
from orchestrator.studies.space import Space
from orchestrator.studies.study_result import (
    RUN,
    STUDY_RECORD,
    STUDY_TABLE,
    read_study_record,
)

#: What there is until all runs are done.
_DATABASE = "unfinished.sqlite"

#: Rows that are written at once.
_ROWS = 65_536

#: What the names of SQLite's files end with, and where the token lies in the first [bytes].
_ENDS, _PAGES = ("", "-wal", "-shm", "-journal"), 16_384

#: Only this process has the file open, so it needs no shared memory, which network file systems do
#: not have; a block that is written outlasts the process at once, and a power cut a moment later.
_SETTINGS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")


class _Row(NamedTuple):
    """An outcome as the database has it, without its checksum."""

    number: int
    indices: bytes
    failure: str | None
    cautions: str | None


class Store:
    """The outcomes of a study that is under way, or done.

    Attributes:
        ledger: of its folder.
        is_done: whether the table of all runs is there.

    """

    def __init__(self, ledger: Ledger, record: Mapping[str, Any], indices: Sequence[str]) -> None:
        """Look for a study that was begun in a folder, or begin it.

        Args:
            ledger: of the folder.
            record: of the study.
            indices: the columns of what comes out of a run.

        Raises:
            InputError: the folder holds another study, or what is there was changed.

        """
        self.ledger, self._folder, self._indices = ledger, ledger.folder, indices
        self._path = self._folder / _DATABASE
        _check_same(ledger, record)
        if not (self._folder / STUDY_RECORD).exists():
            self.write_record(record)
        self.is_done = (self._folder / STUDY_TABLE).exists()
        if self.is_done:
            self._remove_database()
            return
        if not self._path.exists():
            with ledger.writing() as unfinished:
                _make_database(unfinished / _DATABASE, ledger.token)
                (unfinished / _DATABASE).replace(self._path)
        self._database = sqlite3.connect(self._path)
        for setting in _SETTINGS:
            self._database.execute(f"PRAGMA {setting}")
        # All that was done is looked at before more is done.
        self._done = [number for number, *_ in self._rows()]

    def close(self) -> None:
        """Let go of the database."""
        if not self.is_done:
            self._database.close()

    def withdraw(self) -> None:
        """Leave nothing of the study in the folder, if no run is done."""
        with suppress(OSError, sqlite3.Error):
            if not (self.is_done or len(self)):
                self.close()
                self._remove_database()
                self.ledger.remove([STUDY_RECORD])

    def missing(self, n: int) -> Iterator[int]:
        """The numbers, of those below n, of runs that were not done when the store was opened."""
        for before, after in pairwise([-1, *self._done, n]):
            yield from range(before + 1, after)

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """Keep a block of outcomes: all of them, or none."""
        rows = ((*row, self._checksum(*row)) for row in map(self._row, outcomes))
        with explain_write_errors(self._folder), self._database:
            self._database.executemany(
                "INSERT OR IGNORE INTO outcomes VALUES (?, ?, ?, ?, ?)", rows
            )

    def __len__(self) -> int:
        """How many runs are done."""
        [(n,)] = self._database.execute("SELECT count(*) FROM outcomes")
        return int(n)

    def publish(self, space: Space) -> None:
        """Write the table of all runs, in their order; the database goes."""
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        if len(self) != len(space):
            raise InputError(f"{self._path}: damaged: it holds {len(self)} of {len(space)} runs")
        rows = self._rows()
        schema = _schema(arrow, space, self._indices)
        with (
            explain_write_errors(self._folder),
            self.ledger.changing() as unfinished,
            parquet.ParquetWriter(unfinished / STUDY_TABLE, schema) as writer,
        ):
            while block := list(islice(rows, _ROWS)):
                writer.write_batch(_batch(arrow, schema, space, block))
        self.close()
        self.is_done = True
        self._remove_database()

    def write_record(self, record: Mapping[str, Any]) -> None:
        """Write the record of the study, if it is another than before."""
        # A date is a text, as it is where a parameter is one.
        path, text = self._folder / STUDY_RECORD, json.dumps(record, indent=2, default=str) + "\n"
        if path.exists() and path.read_text(encoding="utf-8") == text:
            return
        with self.ledger.changing() as unfinished:
            (unfinished / STUDY_RECORD).write_text(text, encoding="utf-8")

    def _rows(self) -> Iterator[_Row]:
        """All outcomes, by their numbers.

        Raises:
            InputError: one is not as it was written.

        """
        with explain_write_errors(self._folder):
            for *row, checksum in self._database.execute("SELECT * FROM outcomes ORDER BY number"):
                if checksum != self._checksum(*row):
                    raise InputError(
                        f"{self._path}: damaged: run {row[0]} was changed since it was written; "
                        "move it, or let --force move the study aside and start over"
                    )
                yield _Row(*row)

    def _row(self, outcome: Outcome) -> _Row:
        values = [outcome.indices.get(name, np.nan) for name in self._indices]
        indices = np.array(values).tobytes()
        return _Row(outcome.number, indices, outcome.failure, outcome.cautions)

    def _checksum(
        self, number: int, indices: bytes, failure: str | None, cautions: str | None
    ) -> bytes:
        text = f"{self.ledger.token} {number} {failure!r} {cautions!r} {indices!r}"
        return sha256(text.encode()).digest()

    def _remove_database(self) -> None:
        if self._path.exists():
            for end in _ENDS:
                self._path.with_name(f"{_DATABASE}{end}").unlink(missing_ok=True)


def _make_database(path: Path, token: str) -> None:
    """Make an empty database that bears a token, where no other process looks for it."""
    with closing(sqlite3.connect(path)) as database, database:
        # First of all, so that the token is where :func:`_is_ours` looks.
        database.execute("CREATE TABLE study (token TEXT)")
        database.execute("INSERT INTO study VALUES (?)", (token,))
        # Indices as bytes: what is read is what was written, bit for bit.
        database.execute(
            "CREATE TABLE outcomes "
            "(number INTEGER PRIMARY KEY, indices BLOB, failure TEXT, cautions TEXT, "
            "checksum BLOB)"
        )


def _is_ours(path: Path, token: str) -> bool:
    """Whether a database bears a token; SQLite could change one that it opens."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return token.encode() in file.read(_PAGES)


@contextmanager
def open_store(
    folder: Path, record: Mapping[str, Any], indices: Sequence[str], force: bool = False
) -> Iterator[Store]:
    """Open the outcomes of a study in a folder.

    Args:
        folder: of the study, made if it does not exist.
        record: of the study; what it says under `made_of` must be what was done there before.
        indices: the columns of what comes out of a run.
        force: move aside anything else that is there, and start over.

    Raises:
        InputError: the folder holds another study, cannot be written, or is being written into.

    """
    with open_ledger(folder, force) as ledger:
        with explain_write_errors(folder):
            try:
                found = Store(ledger, record, indices)
            except (InputError, sqlite3.Error):
                if not force:
                    raise
                for name in (STUDY_RECORD, STUDY_TABLE, *(f"{_DATABASE}{end}" for end in _ENDS)):
                    if os.path.lexists(folder / name):
                        move_aside(folder / name)
                found = Store(ledger, record, indices)
        with closing(found):
            try:
                yield found
            except InputError:
                found.withdraw()
                raise


@contextmanager
def explain_write_errors(folder: Path) -> Iterator[None]:
    """Say of what cannot be written where it should have gone."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise InputError(
            f"cannot write into {folder}: {reason(error)}; choose another folder (--out DIR)"
        ) from error


def _check_same(ledger: Ledger, record: Mapping[str, Any]) -> None:
    folder = ledger.folder
    ledger.check((STUDY_RECORD, STUDY_TABLE))
    if not _is_ours(folder / _DATABASE, ledger.token):
        ledger.check(f"{_DATABASE}{end}" for end in _ENDS)
    if not (folder / STUDY_RECORD).exists():
        if (folder / STUDY_TABLE).exists() or (folder / _DATABASE).exists():
            raise InputError(f"{folder}: has runs, but no {STUDY_RECORD}; choose another folder")
        return
    # As it is read again: JSON knows no tuples and no dates.
    now = json.loads(json.dumps(record["made_of"], default=str))
    if different := _differences(read_study_record(folder)["made_of"], now):
        raise InputError(
            f"{folder} holds another study, which differs in {', '.join(different)}; choose "
            "another folder (--out DIR), or let --force move that one aside"
        )


def _differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """In what two studies differ; of the systems, what makes their runs other runs."""
    found = {key: [key] for key in {**now, **before} if now.get(key) != before.get(key)}
    old, new = before.get("systems"), now.get("systems", ())
    # Of a study that an earlier version has begun there is only their digest.
    if old != new and isinstance(old, list):
        found["systems"] = [*chain(*map(differences, old, new))] or ["systems"]
    return list(dict.fromkeys(chain(*found.values())))


def _schema(arrow: Any, space: Space, indices: Sequence[str]) -> Any:
    types = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    return arrow.schema(
        [
            (RUN, arrow.int64()),
            *([(SCENARIO, arrow.string())] * space.has_scenarios),
            *((name, types[kind]) for name, kind in space.columns.items()),
            *((name, arrow.float64()) for name in indices),
            (FAILURE, arrow.string()),
            (CAUTION, arrow.string()),
        ]
    )


def _batch(arrow: Any, schema: Any, space: Space, rows: Sequence[_Row]) -> Any:
    numbers, indices, failures, cautions = zip(*rows, strict=True)
    scenarios, chosen = zip(*map(space.chosen, numbers), strict=True)
    values = np.frombuffer(b"".join(indices)).reshape(len(rows), -1)
    columns = [
        numbers,
        *([scenarios] * space.has_scenarios),
        *([one[name] for one in chosen] for name in space.columns),
        *values.T,
        failures,
        cautions,
    ]
    arrays = [
        # What is not there is null.
        arrow.array(column, field.type, from_pandas=True)
        for column, field in zip(columns, schema, strict=True)
    ]
    return arrow.record_batch(arrays, schema=schema)
