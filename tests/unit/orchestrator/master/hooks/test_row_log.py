"""Rows that are kept in a file count as far as somebody says so."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.master.hooks.checkpoint import RowLog

ROWS = np.random.default_rng(1).normal(size=(10_000, 3))


ID = "0123456789abcdef" * 2


def digest(kept: int) -> str:
    return sha256(ROWS[:kept].tobytes()).hexdigest()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file of all rows, and of a part of one more."""
    path = tmp_path / "rows.bin"
    row_log = RowLog(path, ID, 3)
    for block in np.split(ROWS, [1, 513, 9000]):
        assert row_log.append(block) is None
    assert row_log.to_disk() == digest(10_000)
    row_log.close()
    path.write_bytes(path.read_bytes() + b"part")
    return path


def read(path: Path) -> np.ndarray:
    return np.fromfile(path, offset=64).reshape(-1, 3)


@pytest.mark.parametrize("kept", [1, 4096, 4097, 10_000])
def test_rows_that_count_are_read_again_and_gone_on_with(path: Path, kept: int):
    row_log = RowLog(path, ID, 3, kept, digest(kept))
    assert np.vstack(list(row_log.kept())).tobytes() == ROWS[:kept].tobytes()
    assert row_log.append(ROWS[kept:]) is None
    assert row_log.append(ROWS[:5]) is None
    row_log.close()
    assert read(path).tobytes() == np.vstack((ROWS, ROWS[:5])).tobytes()


def test_the_first_number_that_is_another_is_told_once(path: Path):
    row_log = RowLog(path, ID, 3, 100, digest(100))
    changed = ROWS[100:].copy()
    changed[2000, 1] += 1e-12
    changed[2001:] = 0.0
    told = [row_log.append(block) for block in np.array_split(changed, 12)]
    row_log.close()
    size = len(np.array_split(changed, 12)[0])
    assert [one for one in told if one] == [(2000 % size, 1)]
    assert read(path).tobytes() == np.vstack((ROWS[:100], changed)).tobytes()


def test_zero_is_not_minus_zero(path: Path):
    for value in (0.0, -0.0):
        row_log = RowLog(path, ID, 3, 5, digest(5))
        told = row_log.append(np.full((1, 3), value))
        row_log.close()
    assert told == (0, 0)


def test_fewer_rows_than_count_are_refused(path: Path):
    with pytest.raises(InputError, match="holds fewer than 10,001 rows"):
        RowLog(path, ID, 3, 10_001)


@pytest.mark.parametrize("place", [3, 40, 64, 64 + 8 * 3 * 99 + 23])
def test_what_counts_is_as_it_was(path: Path, place: int):
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="missing, damaged, or not of the checkpoint"):
        RowLog(path, ID, 3, 100, digest(100))


def test_a_file_of_the_users_is_not_replaced(tmp_path: Path):
    (tmp_path / "rows.bin").write_text("mine")
    with pytest.raises(FileExistsError):
        RowLog(tmp_path / "rows.bin", ID, 3)
