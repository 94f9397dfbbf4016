"""A study whose processes are killed has the same table as an undisturbed one."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

psutil = pytest.importorskip("psutil", reason="needs the extra `studies`")
parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `studies`")

DATABASE = "unfinished.sqlite"

RUNS = 1000

STUDY = f"""
scenario = "fig4"
stop_time = 5.0
[sample]
method = "random"
n = {RUNS}
seed = 7
[sample.range]
"plant.eta0.z" = [-5.0, 5.0]
"controller.lambda" = [0.5, 1.0]
"""


def sweep(out):
    """A sweep in a session of its own."""
    means = ("--kind", "native", "--workers", "2", "--out", out)
    return subprocess.Popen(
        [sys.executable, "-m", "orchestrator", "sweep", "study.toml", *means],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )


def rows(out):
    """Number of kept runs, from a copy: the process that keeps them locks the file."""
    with TemporaryDirectory() as copy:
        for file in out.glob(f"{DATABASE}*"):
            # It may have been removed.
            with suppress(FileNotFoundError):
                shutil.copy(file, copy)
        with closing(sqlite3.connect(Path(copy, DATABASE))) as database:
            try:
                blocks = database.execute("SELECT ends FROM blocks").fetchall()
            except sqlite3.Error:
                return 0
    # First number, and first one that is not in it, of each range of a block.
    ends = np.concatenate([np.frombuffer(block, dtype=np.int64) for (block,) in [(b"",), *blocks]])
    return int((ends[1::2] - ends[::2]).sum())


def in_the_middle(process, out):
    """Wait until some more runs are kept, and return their number."""
    before = rows(out)
    while (kept := rows(out)) <= before + 2:
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    return kept


def worker(process):
    """One of the processes that make runs: the one with the most to do."""
    children = psutil.Process(process.pid).children()
    return max(children, key=lambda child: sum(child.cpu_times()[:2]))


@pytest.mark.slow
def test_killed_twice_interrupted_once_and_short_of_a_worker(workplace):
    (workplace / "study.toml").write_text(STUDY)
    peace = sweep("peace")
    _, errors = peace.communicate(timeout=300)
    assert peace.returncode == 0, errors

    out = workplace / "trouble"
    for end in (signal.SIGKILL, signal.SIGINT, signal.SIGKILL):
        process = sweep("trouble")
        kept = in_the_middle(process, out)
        # Ctrl-C reaches every process of a terminal.
        (os.killpg if end == signal.SIGINT else os.kill)(process.pid, end)
        _, errors = process.communicate(timeout=60)
        assert process.returncode == (130 if end == signal.SIGINT else -end), errors
        assert kept <= rows(out) < RUNS
    process = sweep("trouble")
    in_the_middle(process, out)
    worker(process).kill()
    _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    table = parquet.read_table(out / "runs.parquet")
    assert table["run"].to_pylist() == list(range(RUNS))
    assert table.equals(parquet.read_table(workplace / "peace" / "runs.parquet"))
