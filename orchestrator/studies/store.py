"""Files of a study: a database while it runs, then a table of all runs and a record.

The database gets a transaction for each block of outcomes: whatever happens to this process, it
contains whole blocks, and each run once. The checksum of a row includes the random token of the
database, so that changed rows and rows of other databases are detected. When all runs are done they
are written into one table, sorted by number, and the database is removed.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orchestrator.figures.study_values import CAUTION, FAILURE, SCENARIO
from orchestrator.machine.disk import move_aside
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.machine.identity import differences
from orchestrator.runs.folder import Ledger, is_changed, locate, open_ledger

if TYPE_CHECKING:
    import pandas as pd

    from orchestrator.studies.engine import Outcome
    from orchestrator.studies.space import Space

#: The table of all runs, and the record.
STUDY_TABLE, STUDY_RECORD = "runs.parquet", "study.json"

#: First column of the table.
RUN = "run"

#: The database, until all runs are done.
_DATABASE = "unfinished.sqlite"

#: Number of rows of the table that are written at once.
_ROWS = 65_536

#: Suffixes of SQLite's files, and length of the beginning of the database with the token [bytes].
_ENDS, _PAGES = ("", "-wal", "-shm", "-journal"), 16_384

#: Only this process opens the database, so it needs no shared memory, which network file systems
#: lack. A block outlasts the process as soon as it is written, and a power cut soon afterwards.
_SETTINGS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")


class _Row(NamedTuple):
    """An outcome in the database, without its checksum; indices are the bytes of doubles."""

    number: int
    indices: bytes
    failure: str | None
    cautions: str | None


class Store:
    """The outcomes of a study in its folder.

    Attributes:
        ledger: of the folder.
        is_done: True if the table of all runs is there.

    """

    def __init__(self, ledger: Ledger, record: Mapping[str, Any], indices: Sequence[str]) -> None:
        """Continue the study in a folder, or begin it.

        Args:
            ledger: of the folder.
            record: of the study.
            indices: columns of indices.

        Raises:
            InputError: the folder contains another study, or files that were changed.

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
        # Reading all rows checks them before any run is added.
        self._done = [number for number, *_ in self._rows()]

    def close(self) -> None:
        """Close the database."""
        if not self.is_done:
            self._database.close()

    def withdraw(self) -> None:
        """Remove the files of the study if no run is done."""
        with suppress(OSError, sqlite3.Error):
            if not (self.is_done or len(self)):
                self.close()
                self._remove_database()
                self.ledger.remove([STUDY_RECORD])

    def missing(self, n: int) -> Iterator[int]:
        """Yield the numbers below n of runs that were not done when the store was opened."""
        for before, after in pairwise([-1, *self._done, n]):
            yield from range(before + 1, after)

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """Add a block of outcomes: all or none."""
        rows = ((*row, self._checksum(*row)) for row in map(self._row, outcomes))
        with _explained_errors(self._folder), self._database:
            self._database.executemany(
                "INSERT OR IGNORE INTO outcomes VALUES (?, ?, ?, ?, ?)", rows
            )

    def __len__(self) -> int:
        """Return the number of runs that are done."""
        [(n,)] = self._database.execute("SELECT count(*) FROM outcomes")
        return int(n)

    def publish(self, space: Space) -> None:
        """Write the table of all runs, sorted by number, and remove the database."""
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        if len(self) != len(space):
            raise InputError(f"{self._path}: damaged: it holds {len(self)} of {len(space)} runs")
        rows = self._rows()
        schema = _schema(arrow, space, self._indices)
        with (
            _explained_errors(self._folder),
            self.ledger.changing() as unfinished,
            parquet.ParquetWriter(unfinished / STUDY_TABLE, schema) as writer,
        ):
            while block := list(islice(rows, _ROWS)):
                writer.write_batch(_batch(arrow, schema, space, block))
        self.close()
        self.is_done = True
        self._remove_database()

    def write_record(self, record: Mapping[str, Any]) -> None:
        """Write the record of the study, unless it is there already."""
        # Dates among the parameters become texts.
        path, text = self._folder / STUDY_RECORD, json.dumps(record, indent=2, default=str) + "\n"
        if path.exists() and path.read_text(encoding="utf-8") == text:
            return
        with self.ledger.changing() as unfinished:
            (unfinished / STUDY_RECORD).write_text(text, encoding="utf-8")

    def _rows(self) -> Iterator[_Row]:
        """Yield all outcomes, sorted by number.

        Raises:
            InputError: one was changed since it was written.

        """
        with _explained_errors(self._folder):
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
    with closing(sqlite3.connect(path)) as database, database:
        # The first table, so that the token is in the first pages.
        database.execute("CREATE TABLE study (token TEXT)")
        database.execute("INSERT INTO study VALUES (?)", (token,))
        # Indices are stored as bytes, so that they are read back bit for bit.
        database.execute(
            "CREATE TABLE outcomes "
            "(number INTEGER PRIMARY KEY, indices BLOB, failure TEXT, cautions TEXT, "
            "checksum BLOB)"
        )


def _is_ours(path: Path, token: str) -> bool:
    """Return true if a database contains a token, without SQLite, which could change the file."""
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
        folder: of the study; created if it does not exist.
        record: of the study; its `made_of` must equal that of a study in the folder.
        indices: columns of indices.
        force: move aside anything else that is there, and start over.

    Raises:
        InputError: the folder contains another study, cannot be written, or is in use.

    """
    with open_ledger(folder, force) as ledger:
        with _explained_errors(folder):
            try:
                store = Store(ledger, record, indices)
            except (InputError, sqlite3.Error):
                if not force:
                    raise
                for name in (STUDY_RECORD, STUDY_TABLE, *(f"{_DATABASE}{end}" for end in _ENDS)):
                    if os.path.lexists(folder / name):
                        move_aside(folder / name)
                store = Store(ledger, record, indices)
        with closing(store):
            try:
                yield store
            except InputError:
                store.withdraw()
                raise


@contextmanager
def _explained_errors(folder: Path) -> Iterator[None]:
    """Name the folder in errors of writing."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise InputError(
            f"cannot write into {folder}: {reason(error)}; choose another folder (--out DIR)"
        ) from error


def _check_same(ledger: Ledger, record: Mapping[str, Any]) -> None:
    """Raise an InputError if a folder contains another study, or the user's files."""
    folder = ledger.folder
    ledger.check((STUDY_RECORD, STUDY_TABLE))
    if not _is_ours(folder / _DATABASE, ledger.token):
        ledger.check(f"{_DATABASE}{end}" for end in _ENDS)
    if not (folder / STUDY_RECORD).exists():
        if (folder / STUDY_TABLE).exists() or (folder / _DATABASE).exists():
            raise InputError(f"{folder}: has runs, but no {STUDY_RECORD}; choose another folder")
        return
    # Through JSON, which has no tuples and no dates.
    now = json.loads(json.dumps(record["made_of"], default=str))
    if different := _differences(read_study_record(folder)["made_of"], now):
        raise InputError(
            f"{folder} holds another study, which differs in {', '.join(different)}; choose "
            "another folder (--out DIR), or let --force move that one aside"
        )


def _differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return the entries that differ; for systems, the parts that do."""
    different = {key: [key] for key in {**now, **before} if now.get(key) != before.get(key)}
    old, new = before.get("systems"), now.get("systems", ())
    # A record of an earlier version contains only a hash.
    if old != new and isinstance(old, list):
        different["systems"] = [*chain(*map(differences, old, new))] or ["systems"]
    return list(dict.fromkeys(chain(*different.values())))


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
        *([run[name] for run in chosen] for name in space.columns),
        *values.T,
        failures,
        cautions,
    ]
    arrays = [
        # Missing values become null.
        arrow.array(column, field.type, from_pandas=True)
        for column, field in zip(columns, schema, strict=True)
    ]
    return arrow.record_batch(arrays, schema=schema)


# Reading


def read_study_record(folder: Path) -> dict[str, Any]:
    """Read the record of a study.

    Raises:
        InputError: there is none.

    """
    path = folder / STUDY_RECORD
    try:
        return dict(json.loads(locate(path).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: not the record of a study: {reason(error)}") from error


class StudyResult(Mapping[str, np.ndarray]):
    """The runs of a finished study, by column.

    `result["plant.eta0.z"]` is a column as a numpy array; an unknown name is a KeyError with a
    suggestion. A missing value of a run is nan. `result["failure"]` and `result["caution"]` are
    None for a run without any.

    Attributes:
        folder: the folder of the study.

    """

    def __init__(self, folder: Path) -> None:
        """Open the table in a folder.

        Raises:
            InputError: there is none.

        """
        self.folder = folder
        for path in (folder / STUDY_TABLE, folder / STUDY_RECORD):
            if not locate(path).is_file():
                raise InputError(f"{folder}: holds no finished study: no {path.name}")
            if is_changed(path):
                raise InputError(f"{path}: damaged, or changed since the study wrote it")

    @cached_property
    def _table(self) -> Any:
        path = self.folder / STUDY_TABLE
        try:
            table = import_module("pyarrow.parquet").read_table(locate(path))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not the table of a study: {reason(error)}") from error
        if table.num_rows != (n := self.record.get("runs")):
            raise InputError(f"{path}: holds {table.num_rows} runs of {n}")
        return table

    @cached_property
    def record(self) -> dict[str, Any]:
        """The content of study.json."""
        return read_study_record(self.folder)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self._table.num_rows)

    @property
    def failed(self) -> int:
        """Number of failed runs."""
        return int(self.runs - self._table[FAILURE].null_count)

    @property
    def cautions(self) -> dict[str, int]:
        """Number of runs with each kind of caution."""
        values = self.get(CAUTION, ())
        return dict(Counter(kind for text in values if text for kind in text.split(", ")))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the columns."""
        return iter(self._table.column_names)

    def __len__(self) -> int:
        """Return the number of columns."""
        return int(self._table.num_columns)

    def __repr__(self) -> str:
        """Return one line."""
        return f"<StudyResult {self.folder.name}: {self.runs} runs, {self.failed} failed>"

    def __getitem__(self, column: str) -> np.ndarray:
        """Return the values of a column.

        Raises:
            KeyError: there is no such column; the message has a suggestion.

        """
        names = self._table.column_names
        if column not in names:
            raise KeyError(f"no column {column!r}{did_you_mean(str(column), names)}")
        values: np.ndarray = self._table[column].to_numpy()
        return values

    def to_dataframe(self) -> pd.DataFrame:
        """Return all columns as a pandas DataFrame, indexed by the number of the run.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        frame: pd.DataFrame = self._table.to_pandas().set_index(RUN)
        return frame
