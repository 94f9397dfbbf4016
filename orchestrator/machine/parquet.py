"""Parquet, which pyarrow reads and writes."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from orchestrator.machine.errors import InputError

#: Rows that are read at once, and that are written to Parquet at once.
ROWS_AT_ONCE = 8192


def parquet() -> Any:
    """Return the module that reads and writes Parquet.

    Raises:
        InputError: it is not installed.

    """
    if find_spec("pyarrow") is None:
        raise InputError("Parquet needs pyarrow: pip install 'auv-fmu[parquet]'")
    return import_module("pyarrow.parquet")
