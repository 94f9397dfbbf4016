"""Results that runs have left in folders."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.figures.style import Drawn
from orchestrator.figures.visible import VisibleRows
from orchestrator.formats.tables import read_columns, read_rows
from orchestrator.machine.errors import InputError
from orchestrator.machine.ledger import RECORD, is_changed, located
from orchestrator.machine.user_files import explained, text_of
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Header
from orchestrator.runs.record import TABLES, read_ending, read_header, read_loops

#: What a file is not that cannot be read.
_WHAT = "not the record of a run"

#: Chooses the columns that are drawn among those that there are.
Choice = Callable[[Sequence[str]], Collection[str]]


def read_result(path: Path, watched: Choice | None = None) -> Drawn:
    """What can be seen of a stored result, by its name.

    Args:
        path: a folder that a run has written, or a table in CSV or Parquet. Of a table without a
            record beside it, no parameters are known.
        watched: which columns will be drawn; None: the ones in the paper's figures.

    Raises:
        InputError: there is no result, or it cannot be read.

    """
    file = table_in(path)
    record = read_record(file)
    texts = record.get("texts", [])
    place = located(file)
    columns = tuple(name for name in read_columns(place) if name not in texts)
    blocks = read_rows(place, texts)
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{file}: has no rows")
    loops = read_loops(record)
    drawn = {name for loop in loops for name in loop.drawn()}
    table = VisibleRows(drawn if watched is None else watched(columns))
    table.begin(_header(record, columns, first, file))
    table.take(first)
    for rows in blocks:
        table.take(rows)
    table.end(read_ending(record))
    label = str(record.get("label") or record.get("scenario") or file.stem)
    return Drawn(label, table, bool(record.get("z_up")), loops)


def table_in(path: Path) -> Path:
    """The file with the table of a result.

    Raises:
        InputError: there is none.

    """
    with explained(path, "not the name of a result"):
        for file in (path, *(path / name for name in TABLES)):
            if located(file).is_file():
                return file
    raise InputError(f"{path}: holds no result.csv or result.parquet")


def changed_files(table: Path) -> list[Path]:
    """The table of a result and its record, as far as they are not what the run wrote."""
    return [file for file in (table, table.with_name(RECORD)) if is_changed(file)]


def read_record(table: Path) -> dict[str, Any]:
    """The record of the run that has written a table; empty if none beside it names the table.

    Raises:
        InputError: it is broken.

    """
    file = located(table.with_name(RECORD))
    if not file.exists():
        return {}
    with explained(file, _WHAT):
        record = json.loads(text_of(file, _WHAT))
        try:
            if table.name not in record["files"]:
                return {}
            header, *_ = read_header(record, ()), read_ending(record), read_loops(record)
            frozenset(record.get("texts", []))
        except (KeyError, TypeError, AttributeError):
            raise ValueError("it lacks what a run writes") from None
        except InputError as error:
            raise ValueError(str(error)) from None
        if not all(map(_is_value, header.parameters.values())):
            raise ValueError("it holds parameters that no run has")
    return dict(record)


def _is_value(value: object) -> bool:
    return isinstance(value, float | int | str) and (
        not isinstance(value, float) or isfinite(value)
    )


def _header(
    record: dict[str, Any], columns: tuple[str, ...], rows: np.ndarray, file: Path
) -> Header:
    """The header of a table, with its first rows; where no record tells the step, the first is."""
    if record:
        return read_header(record, columns)
    step = float(rows[1, 0] - rows[0, 0]) if len(rows) > 1 else 1.0
    if not 0.0 < step < inf:
        raise InputError(f"{file}: times must grow")
    return Header(columns, Experiment(step, step))
