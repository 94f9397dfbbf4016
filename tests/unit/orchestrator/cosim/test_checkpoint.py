"""A resumed run has the same rows as a run without interruption."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cosim.checkpoint import Checkpoints, RowLog
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.observers import Table
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.simulation import simulate_plan
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError
from support.linear import SINE, Part, linear, system_of

STEP = 0.125
OURS: Mapping[str, str] = {"system": "sine"}


def parts(folder: Path, **how: bool) -> System:
    """A sine, and its integral."""
    parts = {"sine": SINE, "integral": Part(B=1.0, C=1.0)}
    return system_of(dict.fromkeys(parts, linear(folder, **how)), parts, {"integral.u0": "sine.y0"})


def run(system: System, stop_time: float, *checkpoints: Checkpoints) -> Table:
    table = Table()
    # Checkpoints come first, since they repeat the rows for other observers.
    plan = make_plan(system, Experiment(stop_time, STEP))
    simulate_plan(plan, [*checkpoints, table], hooks=checkpoints)
    return table


def test_a_resumed_run_has_the_rows_of_one_that_was_not(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    whole = run(system, 2.0)
    first = Checkpoints(folder, OURS, 0.375, resume=False)
    run(system, 1.0, first)
    assert (first.time, Checkpoints.interval_in(folder)) == (0.75, 0.375)
    second = Checkpoints(folder, OURS, 0.375, resume=True)
    assert second.time == 0.75
    again = run(system, 2.0, second)
    np.testing.assert_array_equal(again.rows, whole.rows)
    second.remove()
    assert not folder.exists()


def test_what_is_there_is_neither_overwritten_nor_mistaken(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    run(system, 1.0, Checkpoints(folder, OURS, 0.375, resume=False))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for identity, resume, word in ((OURS, False, "0.75 s"), ({"system": "cosine"}, True, "system")):
        with pytest.raises(InputError, match=word):
            Checkpoints(folder, identity, 0.375, resume)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    forced = Checkpoints(folder, OURS, 0.375, resume=False, force=True)
    assert forced.time is None
    # Existing files are moved to another name.
    assert {path.read_bytes() for path in folder.iterdir()} == set(before.values())


def test_a_damaged_checkpoint_is_refused_with_its_name(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    run(system, 1.0, Checkpoints(folder, OURS, 0.375, resume=False))
    [state] = folder.glob("*.json")
    state.write_text(state.read_text().replace("0.75", "0.85"))
    with pytest.raises(InputError, match=state.name):
        Checkpoints(folder, OURS, 0.375, resume=True)


@pytest.mark.parametrize("every", [0.0, -1.0, np.nan, np.inf])
def test_an_interval_is_positive_and_finite(tmp_path: Path, every: float):
    with pytest.raises(InputError, match=f"{every:g} s"):
        Checkpoints(tmp_path, OURS, every, resume=False)
    assert Checkpoints.interval_in(tmp_path) is None


ROWS = np.random.default_rng(1).normal(size=(10_000, 3))

ID = "0123456789abcdef" * 2


def digest(kept: int) -> str:
    return sha256(ROWS[:kept].tobytes()).hexdigest()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file of complete rows and a part of the next."""
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
def test_valid_rows_are_read_again_and_continued(path: Path, kept: int):
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
    answers = [row_log.append(block) for block in np.array_split(changed, 12)]
    row_log.close()
    size = len(np.array_split(changed, 12)[0])
    assert [answer for answer in answers if answer] == [(2000 % size, 1)]
    assert read(path).tobytes() == np.vstack((ROWS[:100], changed)).tobytes()


def test_zero_is_not_minus_zero(path: Path):
    for value in (0.0, -0.0):
        row_log = RowLog(path, ID, 3, 5, digest(5))
        answer = row_log.append(np.full((1, 3), value))
        row_log.close()
    assert answer == (0, 0)


def test_fewer_rows_than_count_are_refused(path: Path):
    with pytest.raises(InputError, match="holds fewer than 10,001 rows"):
        RowLog(path, ID, 3, 10_001)


@pytest.mark.parametrize("place", [3, 40, 64, 64 + 8 * 3 * 99 + 23])
def test_what_counts_is_as_it_was(path: Path, place: int):
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="missing, damaged, or from another checkpoint"):
        RowLog(path, ID, 3, 100, digest(100))


def test_a_file_of_the_users_is_not_replaced(tmp_path: Path):
    (tmp_path / "rows.bin").write_text("mine")
    with pytest.raises(FileExistsError):
        RowLog(tmp_path / "rows.bin", ID, 3)
