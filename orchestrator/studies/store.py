"""Files of a study: a database while it runs, then a table of all runs and a record.

The database gets a transaction for each block of outcomes, and a row for it: whatever happens to
this process, it contains whole blocks, and each run once. The checksum of a row includes the random
token of the database, so that changed rows and rows of other databases are detected. When all runs
are done they are written into one table, sorted by number, and the database is removed. At any time
only some blocks are in memory.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestrator.figures.study_values import CAUTION, FAILURE, SCENARIO
from orchestrator.machine.disk import move_aside
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.machine.identity import differences
from orchestrator.runs.folder import Ledger, is_changed, locate, open_ledger
from orchestrator.studies.columns import Numbers, Outcomes, Texts

if TYPE_CHECKING:
    import pandas as pd

    from orchestrator.studies.space import Space

#: The table of all runs, and the record.
STUDY_TABLE, STUDY_RECORD = "runs.parquet", "study.json"

#: First column of the table.
RUN = "run"

#: The database, until all runs are done.
_DATABASE = "unfinished.sqlite"

#: Largest number of runs in a row of the database, and least number in a part of the table.
_ROWS = 65_536

#: Suffixes of SQLite's files.
_ENDS = ("", "-wal", "-shm", "-journal")

#: Size of a page of the database, the largest, for blocks of megabytes [bytes].
_PAGE = 65_536

#: Only this process opens the database, so it needs no shared memory, which network file systems
#: lack. A block outlasts the process as soon as it is written, and a power cut soon afterwards.
_SETTINGS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")


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
        self._done = Numbers()
        for block in self._blocks():
            self._done.add(Numbers.of(block.numbers))

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

    def missing(self, n: int) -> Numbers:
        """Return the numbers below n of runs that are not done."""
        return self._done.below(n)

    def add(self, outcomes: Outcomes) -> None:
        """Add a block of outcomes, all or none; a run that is done is left out."""
        order = np.argsort(outcomes.numbers)
        order = order[~self._done.has(outcomes.numbers[order])]
        if not np.array_equal(order, np.arange(len(outcomes))):
            outcomes = outcomes[order]
        parts = (outcomes[first : first + _ROWS] for first in range(0, len(outcomes), _ROWS))
        with _explained_errors(self._folder), self._database:
            self._database.executemany(
                "INSERT INTO blocks VALUES (?, ?, ?, ?, ?, ?)", map(self._row, parts)
            )
        self._done.add(Numbers.of(outcomes.numbers))

    def __len__(self) -> int:
        """Return the number of runs that are done."""
        return len(self._done)

    def publish(self, space: Space) -> None:
        """Write the table of all runs, sorted by number, and remove the database."""
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        if len(self) != len(space):
            raise InputError(f"{self._path}: damaged: it holds {len(self)} of {len(space)} runs")
        schema = _schema(arrow, space, self._indices)
        # Indices hardly ever repeat.
        repeating = [name for name in schema.names if name not in (RUN, *self._indices)]
        with (
            _explained_errors(self._folder),
            self.ledger.changing() as unfinished,
            parquet.ParquetWriter(
                unfinished / STUDY_TABLE, schema, use_dictionary=repeating
            ) as writer,
        ):
            for part in self._sorted():
                writer.write_batch(_batch(arrow, schema, space, part))
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

    def _sorted(self) -> Iterator[Outcomes]:
        """Yield all outcomes in the order of their numbers, some at a time.

        Blocks overlap where some runs were repeated by another engine.
        """
        ready, waiting = list[Outcomes](), list[Outcomes]()
        for block in chain(self._blocks(), [None]):
            ends = [
                len(each) if block is None else int(np.searchsorted(each.numbers, block.numbers[0]))
                for each in waiting
            ]
            parts = [each[:end] for each, end in zip(waiting, ends, strict=True) if end]
            if len(parts) > 1:
                both = Outcomes.joined(parts)
                parts = [both[np.argsort(both.numbers)]]
            ready += parts
            waiting = [
                each[end:] for each, end in zip(waiting, ends, strict=True) if end < len(each)
            ]
            if ready and (block is None or sum(map(len, ready)) >= _ROWS):
                yield Outcomes.joined(ready)
                ready.clear()
            if block is not None:
                waiting.append(block)

    def _blocks(self) -> Iterator[Outcomes]:
        """Yield the blocks, sorted by their first numbers.

        Raises:
            InputError: one was changed since it was written.

        """
        with _explained_errors(self._folder):
            for *row, checksum in self._database.execute("SELECT * FROM blocks ORDER BY first"):
                if checksum != self._checksum(*row):
                    raise InputError(
                        f"{self._path}: damaged: runs from {row[0]} on were changed since they "
                        "were written; move it, or let --force move the study aside and start over"
                    )
                _, ends, indices, codes, texts = row
                numbers = next(Numbers(np.frombuffer(ends, dtype=np.int64)).blocks(_ROWS))
                failures, cautions = (
                    Texts(part, known)
                    for part, known in zip(
                        np.frombuffer(codes, dtype=np.int32).reshape(2, -1),
                        json.loads(texts),
                        strict=True,
                    )
                )
                values = np.frombuffer(indices).reshape(-1, len(numbers)).T
                yield Outcomes(numbers, self._indices, values, failures, cautions)

    def _row(self, block: Outcomes) -> tuple[Any, ...]:
        """Return a block for the database; indices are the bytes of doubles, column by column."""
        row = (
            int(block.numbers[0]),
            Numbers.of(block.numbers).ends.tobytes(),
            block.arranged(self._indices).indices.T.tobytes(),
            np.stack([block.failures.codes, block.cautions.codes]).tobytes(),
            json.dumps([block.failures.known, block.cautions.known]),
        )
        return (*row, self._checksum(*row))

    def _checksum(self, first: int, ends: bytes, indices: bytes, codes: bytes, texts: str) -> bytes:
        sizes = [len(part) for part in (ends, indices, codes)]
        found = sha256(f"{self.ledger.token} {first} {sizes} {texts!r}".encode())
        for part in (ends, indices, codes):
            found.update(part)
        return found.digest()

    def _remove_database(self) -> None:
        if self._path.exists():
            for end in _ENDS:
                self._path.with_name(f"{_DATABASE}{end}").unlink(missing_ok=True)


def _make_database(path: Path, token: str) -> None:
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"PRAGMA page_size = {_PAGE}")
        # The first table, so that the token is in the second page.
        database.execute("CREATE TABLE study (token TEXT)")
        database.execute("INSERT INTO study VALUES (?)", (token,))
        # Indices are stored as bytes, so that they are read back bit for bit.
        database.execute(
            "CREATE TABLE blocks (first INTEGER PRIMARY KEY, ends BLOB, indices BLOB, codes BLOB, "
            "texts TEXT, checksum BLOB)"
        )


def _is_ours(path: Path, token: str) -> bool:
    """Return true if a database contains a token, without SQLite, which could change the file."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return token.encode() in file.read(2 * _PAGE)


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


def _batch(arrow: Any, schema: Any, space: Space, part: Outcomes) -> Any:
    points = space.points(part.numbers)
    scenarios = [case.scenario for case in points.cases]
    columns = [
        part.numbers,
        *([_texts(arrow, Texts(points.case, scenarios))] * space.has_scenarios),
        *(points.values[name] for name in space.columns),
        *part.indices.T,
        _texts(arrow, part.failures),
        _texts(arrow, part.cautions),
    ]
    arrays = [
        # Missing values become null.
        arrow.array(column, field.type, from_pandas=True)
        for column, field in zip(columns, schema, strict=True)
    ]
    return arrow.record_batch(arrays, schema=schema)


def _texts(arrow: Any, texts: Texts) -> Any:
    return arrow.array(texts.known, arrow.string()).take(arrow.array(texts.codes))


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

    `result["plant.eta0.z"]` is a column as a numpy array, read each time that it is asked for; an
    unknown name is a KeyError with a suggestion. A missing value of a run is nan.
    `result["failure"]` and `result["caution"]` are None for a run without any.

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

    def _read(self, read: Callable[[Any], Any]) -> Any:
        """Return what a function reads in the table.

        Raises:
            InputError: the table cannot be read.

        """
        path = self.folder / STUDY_TABLE
        try:
            with import_module("pyarrow.parquet").ParquetFile(locate(path)) as table:
                return read(table)
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not the table of a study: {reason(error)}") from error

    @cached_property
    def _described(self) -> tuple[int, Sequence[str]]:
        """The number of runs, and the names of columns."""
        n, names = self._read(lambda table: (table.metadata.num_rows, table.schema_arrow.names))
        if n != (stated := self.record.get("runs")):
            raise InputError(f"{self.folder / STUDY_TABLE}: holds {n} runs of {stated}")
        return n, names

    def _counts(self, name: str) -> Counter[str | None]:
        """Return how often each text is in a column, some of which is in memory at a time."""

        def count(table: Any) -> Counter[str | None]:
            counts = Counter[str | None]()
            for batch in table.iter_batches(columns=[name]):
                for each in batch.column(0).value_counts().to_pylist():
                    counts[each["values"]] += each["counts"]
            return counts

        found: Counter[str | None] = self._read(count)
        return found

    @cached_property
    def record(self) -> dict[str, Any]:
        """The content of study.json."""
        return read_study_record(self.folder)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self._described[0]

    @property
    def failed(self) -> int:
        """Number of failed runs."""
        return self.runs - self._counts(FAILURE)[None]

    @property
    def cautions(self) -> dict[str, int]:
        """Number of runs with each kind of caution."""
        found = Counter[str]()
        for text, n in (self._counts(CAUTION) if CAUTION in self else {}).items():
            found.update(dict.fromkeys(filter(None, (text or "").split(", ")), n))
        return dict(found)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the columns."""
        return iter(self._described[1])

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self._described[1])

    def __contains__(self, column: object) -> bool:
        """Return True for the name of a column."""
        return column in self._described[1]

    def __repr__(self) -> str:
        """Return one line."""
        return f"<StudyResult {self.folder.name}: {self.runs} runs, {self.failed} failed>"

    def __getitem__(self, column: str) -> np.ndarray:
        """Return the values of a column.

        Raises:
            KeyError: there is no such column; the message has a suggestion.

        """
        if column not in self:
            raise KeyError(f"no column {column!r}{did_you_mean(str(column), [*self])}")
        values = self._read(lambda table: table.read([column]))[column]
        if values.type != import_module("pyarrow").string():
            numbers: np.ndarray = values.to_numpy()
            return numbers
        # Each text once, since millions of equal ones would fill the memory.
        texts = values.combine_chunks().dictionary_encode()
        known = np.array([*texts.dictionary.to_pylist(), None], dtype=object)
        every: np.ndarray = known[texts.indices.fill_null(len(known) - 1).to_numpy()]
        return every

    def to_dataframe(self) -> pd.DataFrame:
        """Return all columns as a pandas DataFrame, indexed by the number of the run.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        frame: pd.DataFrame = self._read(lambda table: table.read()).to_pandas().set_index(RUN)
        return frame
