"""The table and the record of a study that is done, as they are read."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestrator.figures.study_values import CAUTION, FAILURE
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.runs.folder import is_changed, locate

if TYPE_CHECKING:
    import pandas as pd

#: The table of all runs, and the record beside it.
STUDY_TABLE, STUDY_RECORD = "runs.parquet", "study.json"

#: The first column of the table.
RUN = "run"


def read_study_record(folder: Path) -> dict[str, Any]:
    """The record of a study.

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
        """Number of runs in which to be wary of something, by what it is."""
        values = self.get(CAUTION, ())
        return dict(Counter(kind for text in values if text for kind in text.split(", ")))

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
