"""What has come out of a study: kept as it comes, and written whole at the end.

Outcomes go into a database beside the study's record, a transaction a block: whatever happens to
this process, it holds blocks whole and each run once. When all runs are there they are written to
one table in their order, and the database goes.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestrator.errors import InputError, did_you_mean, reason
from orchestrator.experiments.folder import locked
from orchestrator.studies.engine import INDICES, Outcome
from orchestrator.studies.space import Space
from orchestrator.system.atomic import whole

if TYPE_CHECKING:
    import pandas as pd

#: The table of all runs, the record beside it, and what there is until all runs are done.
TABLE, RECORD, _DATABASE = "runs.parquet", "study.json", "unfinished.sqlite"

#: Columns of the table before and behind what varies and the indices.
RUN, SCENARIO, FAILURE = "run", "scenario", "failure"

#: Rows that are written at once.
_ROWS = 65_536

#: Only this process has the file open, so it needs no shared memory, which network file systems do
#: not have; a block that is written outlasts the process at once, and a power cut a moment later.
_SETTINGS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")


class Store:
    """The outcomes of a study that is under way."""

    def __init__(self, folder: Path, database: sqlite3.Connection) -> None:
        """Use a database in the folder of the study."""
        self._folder, self._database = folder, database
        for setting in _SETTINGS:
            database.execute(f"PRAGMA {setting}")
        # Indices as bytes: what is read is what was written, bit for bit.
        database.execute(
            "CREATE TABLE IF NOT EXISTS outcomes "
            "(number INTEGER PRIMARY KEY, indices BLOB, failure TEXT)"
        )

    def missing(self, n: int) -> Iterator[int]:
        """The numbers, of those below n, of runs that are not done.

        Blocks that are added meanwhile change nothing.
        """
        found = self._database.execute("SELECT number FROM outcomes ORDER BY number")
        done = np.fromiter((number for (number,) in found), dtype=np.int64)
        for before, after in pairwise(np.concatenate(([-1], done, [n])).tolist()):
            yield from range(before + 1, after)

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """Keep a block of outcomes: all of them, or none."""
        with written(self._folder), self._database:
            self._database.executemany(
                "INSERT OR IGNORE INTO outcomes VALUES (?, ?, ?)", map(_row, outcomes)
            )

    def __len__(self) -> int:
        """How many runs are done."""
        [(n,)] = self._database.execute("SELECT count(*) FROM outcomes")
        return int(n)

    def publish(self, space: Space) -> None:
        """Write the table of all runs, in their order; the database goes."""
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        rows = self._database.execute("SELECT * FROM outcomes ORDER BY number")
        schema = _schema(arrow, space)
        with written(self._folder):
            with (
                whole(self._folder / TABLE) as partial,
                parquet.ParquetWriter(partial, schema) as writer,
            ):
                while block := list(islice(rows, _ROWS)):
                    writer.write_batch(_batch(arrow, schema, space, block))
            self._database.close()
            _remove_database(self._folder)


@contextmanager
def store(folder: Path, record: Mapping[str, Any]) -> Iterator[Store | None]:
    """The outcomes of a study in a folder; None: the study is done.

    Args:
        folder: of the study, made if it does not exist.
        record: of the study; what it says under `made_of` must be what was done there before.

    Raises:
        InputError: the folder holds another study, cannot be written, or is being written into.

    """
    with ExitStack() as stack:
        with written(folder):
            folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(folder))
            _check_same(folder, record)
            if not (folder / RECORD).exists():
                write_record(folder, record)
            if (folder / TABLE).exists():
                _remove_database(folder)
                yield None
                return
            database = stack.enter_context(closing(sqlite3.connect(folder / _DATABASE)))
            opened = Store(folder, database)
        yield opened


@contextmanager
def written(folder: Path) -> Iterator[None]:
    """Say of what cannot be written where it should have gone."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise InputError(
            f"cannot write into {folder}: {reason(error)}; choose another folder (--out DIR)"
        ) from error


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the record of a study into its folder."""
    with written(folder), whole(folder / RECORD) as partial:
        partial.write_text(_json(record) + "\n", encoding="utf-8")


def _json(content: Mapping[str, Any]) -> str:
    # A date is a text, as it is where a parameter is one.
    return json.dumps(content, indent=2, default=str)


def read_record(folder: Path) -> dict[str, Any]:
    """The record of a study.

    Raises:
        InputError: there is none.

    """
    path = folder / RECORD
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not the record of a study: {reason(error)}") from error


def _check_same(folder: Path, record: Mapping[str, Any]) -> None:
    if not (folder / RECORD).exists():
        if (folder / TABLE).exists() or (folder / _DATABASE).exists():
            raise InputError(f"{folder}: has runs, but no {RECORD}; choose another folder")
        return
    before, now = read_record(folder).get("made_of"), record["made_of"]
    if not isinstance(before, dict):
        raise InputError(f"{folder / RECORD}: not the record of a study")
    # As it is read again: JSON knows no tuples.
    now = json.loads(_json(now))
    different = [key for key in {**now, **before} if now.get(key) != before.get(key)]
    if different:
        raise InputError(
            f"{folder} holds another study, which differs in {', '.join(different)}; choose "
            "another folder (--out DIR), or remove that one"
        )


def _remove_database(folder: Path) -> None:
    for path in folder.glob(f"{_DATABASE}*"):
        path.unlink()


def _row(outcome: Outcome) -> tuple[int, bytes, str | None]:
    values = [outcome.indices.get(name, np.nan) for name in INDICES]
    return outcome.number, np.array(values).tobytes(), outcome.failure


def _schema(arrow: Any, space: Space) -> Any:
    types = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    return arrow.schema(
        [
            (RUN, arrow.int64()),
            *([(SCENARIO, arrow.string())] * space.has_scenarios),
            *((name, types[kind]) for name, kind in space.columns.items()),
            *((name, arrow.float64()) for name in INDICES),
            (FAILURE, arrow.string()),
        ]
    )


def _batch(arrow: Any, schema: Any, space: Space, rows: Sequence[tuple[int, bytes, str]]) -> Any:
    numbers, indices, failures = zip(*rows, strict=True)
    scenarios, points = zip(*map(space.point, numbers), strict=True)
    values = np.frombuffer(b"".join(indices)).reshape(len(rows), len(INDICES))
    columns = [
        numbers,
        *([scenarios] * space.has_scenarios),
        *([point[name] for point in points] for name in space.columns),
        *values.T,
        failures,
    ]
    arrays = [
        # What is not there is null.
        arrow.array(column, field.type, from_pandas=True)
        for column, field in zip(columns, schema, strict=True)
    ]
    return arrow.record_batch(arrays, schema=schema)


class StudyResult(Mapping[str, np.ndarray]):
    """The runs of a study that is done, by column.

    `result["plant.eta0.z"]` is a column as a numpy array; an unknown name is a KeyError with a
    suggestion. What a run does not have is nan; `result["failure"]` is None where a run came to its
    end.

    Attributes:
        folder: that holds them.

    """

    def __init__(self, folder: Path) -> None:
        """Open the table in a folder.

        Raises:
            InputError: there is none.

        """
        self.folder = folder
        if not (folder / TABLE).is_file():
            raise InputError(f"{folder}: holds no study that is done: no {TABLE}")

    @cached_property
    def _table(self) -> Any:
        return import_module("pyarrow.parquet").read_table(self.folder / TABLE)

    @cached_property
    def record(self) -> dict[str, Any]:
        """What study.json holds."""
        return read_record(self.folder)

    @property
    def runs(self) -> int:
        """How many there are."""
        return int(self._table.num_rows)

    @property
    def failed(self) -> int:
        """How many of them have failed."""
        return int(self.runs - self._table[FAILURE].null_count)

    def __iter__(self) -> Iterator[str]:
        """The names of the columns."""
        return iter(self._table.column_names)

    def __len__(self) -> int:
        """How many columns there are."""
        return int(self._table.num_columns)

    def __repr__(self) -> str:
        """One line."""
        return f"<StudyResult {self.folder.name}: {self.runs} runs, {self.failed} failed>"

    def __getitem__(self, column: str) -> np.ndarray:
        """The values of one column.

        Raises:
            KeyError: there is no such column; the text has a suggestion.

        """
        names = self._table.column_names
        if column not in names:
            raise KeyError(f"no column {column!r}{did_you_mean(str(column), names)}")
        values: np.ndarray = self._table[column].to_numpy()
        return values

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas DataFrame, with the number of the run as its index.

        Raises:
            ImportError: pandas is not installed.

        """
        if find_spec("pandas") is None:
            raise ImportError("to_dataframe needs pandas: pip install pandas")
        frame: pd.DataFrame = self._table.to_pandas().set_index(RUN)
        return frame
