"""Disks that are full, folders that may not be written, limits, signals, kills, clocks that jump.

What was computed is kept, what was good stays good, and nothing half-written is taken for whole.
"""

from __future__ import annotations

import errno
import json
import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.commands.streams import INTERRUPTED
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.result import read_result
from orchestrator.runs.tables import read_rows
from support.machine import (
    called,
    contents,
    eventually,
    is_over,
    members,
    small_disk,
    start,
    without_privileges,
)
from support.texts import mentions

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("workplace")]


@pytest.fixture(autouse=True)
def temporary(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files of child processes."""
    folder = tmp_path_factory.mktemp("temporary")
    current_fmus()
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def rows(folder: Path, ending: str = "csv") -> np.ndarray:
    return np.vstack(list(read_rows(folder / f"result.{ending}")))


def failure(folder: Path) -> str:
    return str(json.loads((folder / "run.json").read_text())["failure"])


RUN = ["run", "fig4", "--no-figures", "--stop-time"]


@pytest.mark.parametrize(("ending", "loop"), [("csv", "python"), ("parquet", "compiled")])
def test_full_disk_ends_a_run_early_and_keeps_the_rows(workplace, capsys, ending, loop):
    """There is room for some of a million rows."""
    if ending == "parquet":
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    with small_disk(workplace / "disk", 14_000_000) as disk:
        out = ["--out", str(disk / "r"), "--format", ending, "--loop", loop]
        assert main([*RUN, "0.1", *out]) == 0
        before = contents(disk)
        capsys.readouterr()
        assert main([*RUN, "20000", *out]) == 1
        [where, why] = capsys.readouterr().err.splitlines()
        assert str(disk / "r") in where
        assert why.startswith("auv-fmu: fig4 stopped at t = ")
        assert why.endswith("No space left on device")
        after = contents(disk)
        incomplete = disk / "r" / "incomplete"
        assert {name: after[name] for name in after if "incomplete" not in name} == before
        kept = rows(incomplete, ending)
        assert len(kept) > 1000
        assert np.array_equal(kept, simulate("fig4", stop_time=(len(kept) - 1) * 0.02).rows)
        assert read_result(incomplete)[1].failure == why.removeprefix("auv-fmu: fig4 ")


@pytest.mark.parametrize("size", [60_000, 150_000, 900_000])
def test_full_disk_at_any_stage(workplace, capsys, size):
    """The table takes 0.2 MB, figures another 0.9 MB."""
    with small_disk(workplace / "disk", size) as disk:
        folder = disk / "r"
        status = main(["run", "fig4", "--stop-time", "2", "--out", str(folder)])
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1
        assert "No space left on device" in lines[0]
        if status == 2:
            # There was no room even before the first row.
            assert contents(disk) == {}
            return
        assert status == 1
        assert failure(folder) in lines[0]
        whole = simulate("fig4", stop_time=2.0).rows
        kept = rows(folder)
        assert np.array_equal(kept, whole[: len(kept)])
        assert len(kept) == len(whole) or size < 300_000
        names = contents(folder).keys()
        assert names >= {"run.json", "metrics.json", "result.csv"}
        assert not [name for name in names if name.startswith(".") or name.endswith("g")]


def test_no_room_for_the_folder_of_a_companion(workplace, capsys, monkeypatch):
    """The first run stays, with its record."""
    mkdir = Path.mkdir

    def full(path: Path, *arguments: Any, **options: Any) -> None:
        if path.name == "fig5-pd":
            raise OSError(errno.ENOSPC, "No space left on device")
        mkdir(path, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", full)
    assert main(["run", "fig5", "--stop-time", "0.1", "--no-figures", "--out", "r"]) == 1
    assert mentions(capsys.readouterr().err, "could not be written in full: No space left")
    assert len(rows(Path("r"))) == 6
    assert "No space left" in failure(Path("r"))


@pytest.mark.parametrize("variable", ["TMPDIR", "XDG_CACHE_HOME"])
def test_full_folder_is_named_and_left_empty(workplace, variable):
    """For temporary files, and the cache."""
    with small_disk(workplace / "disk", 300_000) as disk:
        status, lines = called(*RUN, "0.1", environment={variable: str(disk)})
        assert status == 2
        assert mentions(lines[-1], f"{disk} No space left")
        assert not list(disk.glob("auv*/*/*"))


def test_limit_of_the_size_of_files_is_like_a_full_disk(workplace):
    """An unpacked FMU has files of 200 kB."""
    limit = {resource.RLIMIT_FSIZE: 1_000_000}
    status, [line] = called(*RUN, "20000", limits=limit)
    assert status == 1
    assert line.startswith("auv-fmu: fig4 stopped at t = ")
    assert line.endswith("File too large")
    kept = rows(workplace / "results" / "fig4")
    assert np.array_equal(kept, simulate("fig4", stop_time=(len(kept) - 1) * 0.02).rows)
    assert len(kept) > 500


def test_short_memory_is_said_and_loses_no_rows(workplace):
    """Python and numpy need 150 MB of address space, figures 300."""
    limit = {resource.RLIMIT_AS: 235 * 10**6}
    status, lines = called("run", "fig4", "--stop-time", "1", limits=limit)
    assert status in (1, 2)
    assert not [line for line in lines if "Traceback" in line]
    if status == 1 and lines[-1].startswith("auv-fmu: fig4"):
        assert len(rows(workplace / "results" / "fig4")) == 51
        assert failure(workplace / "results" / "fig4") in lines[-1]


def test_folders_that_may_not_be_written(workplace):
    sealed = workplace / "sealed"
    assert main([*RUN, "0.1", "--out", "sealed/r"]) == 0
    before = contents(sealed)
    for path in (sealed, sealed / "r"):
        path.chmod(0o500)
    try:
        for arguments in (
            [*RUN, "0.1", "--out", "sealed/r"],
            ["export", "fig4", "--out", "sealed/new"],
            ["plot", "sealed/r", "--out", "sealed/r/plot.png"],
        ):
            status, [line] = called(*arguments, before=without_privileges)
            assert status == 2
            assert "Permission denied" in line
            assert "; choose " in line
        assert contents(sealed) == before
        # `plot` without a file only reads.
        status, lines = called("plot", "sealed/r", before=without_privileges)
        assert (status, lines) == (0, [])
    finally:
        for path in (sealed, sealed / "r"):
            path.chmod(0o700)


def test_home_that_may_not_be_written(workplace):
    (workplace / "home").mkdir(mode=0o500)
    home = {"HOME": str(workplace / "home"), "XDG_CACHE_HOME": None, "XDG_CONFIG_HOME": None}
    status, [line] = called(*RUN, "0.1", environment=home, before=without_privileges)
    assert status == 2
    assert mentions(line, "auv-fmu: XDG_CACHE_HOME")


def test_no_home_and_no_temporary_folder(workplace):
    status, lines = called(*RUN, "0.1", environment={"HOME": None, "TMPDIR": "/nonexistent"})
    assert (status, lines) == (0, [])


def under_way(folder: Path) -> bool:
    """True if a run writes rows into a folder."""
    return any(path.stat().st_size > 1e5 for path in folder.glob(".auv-fmu-*/result.csv"))


def running(loop: str = "auto") -> subprocess.Popen[str]:
    """A run of hours that has begun to write rows."""
    process = start("run", "fig4", "--stop-time", "200000", "--loop", loop)
    assert eventually(lambda: under_way(Path("results/fig4"))), process.communicate()[1]
    return process


@pytest.mark.parametrize(
    ("signals", "loop"),
    [
        ([signal.SIGTERM], "python"),
        ([signal.SIGHUP], "compiled"),
        ([signal.SIGINT] * 5, "python"),
        ([signal.SIGINT] * 5, "compiled"),
    ],
)
def test_signals_end_a_run_and_lose_nothing(workplace, temporary, signals, loop):
    process = running(loop)
    for number in signals:
        process.send_signal(number)
        time.sleep(0.05)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "Traceback" not in error
    folder = workplace / "results" / "fig4"
    assert "fig4 interrupted at t = " in error.splitlines()[-1]
    assert failure(folder).startswith("interrupted at t = ")
    assert signals[0] == signal.SIGINT or not list(folder.glob("*.png"))
    kept = rows(folder)
    assert np.array_equal(kept[:, 0], 0.02 * np.arange(len(kept)))
    assert not [name for name in contents(folder) if name.startswith(".")]
    assert list(temporary.iterdir()) == []


def test_a_killed_run_leaves_the_earlier_result_as_it_was(workplace):
    assert main([*RUN, "0.1"]) == 0
    before = contents(workplace)
    process = running()
    process.kill()
    process.communicate()
    after = contents(workplace)
    assert {name: after[name] for name in after if ".auv-fmu-" not in name} == before
    assert len(after) > len(before)
    assert main([*RUN, "0.1"]) == 0
    assert contents(workplace).keys() == before.keys()


HANGING = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Hanging(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        self.y = t + h
        if t > 9.99:
            open("hangs", "w").close()
        while t > 9.99:
            {hang}
        return True
"""


@pytest.mark.parametrize(
    ("hang", "loop"),
    [("pass", "python"), ("import ctypes; ctypes.CDLL(None).poll(None, 0, -1)", "compiled")],
    ids=["Python", "C"],
)
def test_the_third_signal_ends_an_fmu_that_hangs_and_keeps_the_rows(workplace, hang, loop):
    Path("hanging.py").write_text(HANGING.format(hang=hang))
    assert main(["build", "hanging.py"]) == 0
    Path("hanging.toml").write_text('stop_time = 20.0\n[components]\nhanging = "Hanging.fmu"\n')
    process = start("run", "hanging.toml", "--no-figures", "--loop", loop)
    folder = workplace / "results" / "hanging"
    assert eventually(Path("hangs").exists)
    for _ in range(3):
        process.send_signal(signal.SIGINT)
        time.sleep(0.3)
    error = process.communicate(timeout=20)[1]
    assert process.returncode == 1
    assert "hanging" in error.splitlines()[-1]
    assert "return" in failure(folder)
    assert len(rows(folder)) == 501


def test_the_end_of_the_terminal_means_nothing_under_nohup(workplace):
    process = start(*RUN, "2", before=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    while process.poll() is None:
        process.send_signal(signal.SIGHUP)
        time.sleep(0.1)
    assert process.communicate()[1] == ""
    assert process.returncode == 0
    assert len(rows(workplace / "results" / "fig4")) == 101


def busy(process: subprocess.Popen[str], temporary: Path) -> bool:
    """True if a process has children, which have begun to write temporary files."""
    return len(members(process.pid)) > 1 and any(temporary.glob("auvfmu-*/*/*"))


@pytest.mark.parametrize(
    ("command", "number"), [("build", signal.SIGKILL), ("report", signal.SIGHUP)]
)
def test_children_end_with_their_parent(workplace, temporary, command, number):
    """Earlier files stay as they were; the next command removes temporary files."""
    out = workplace / "out"
    out.mkdir()
    for name in ("mine.ssp", "mine.html", "mine.json"):
        (out / name).write_text("{}")
    before = contents(out)
    process = start(command, "--out", str(out))
    assert eventually(lambda: busy(process, temporary))
    process.send_signal(number)
    error = process.communicate(timeout=60)[1]
    assert is_over(process.pid)
    assert process.returncode in (-number, 128 + number, INTERRUPTED)
    assert "Traceback" not in error
    if number == signal.SIGKILL:
        # Any command that needs a temporary folder.
        assert called(*RUN, "0.1", "--out", "other") == (0, [])
        assert main(["export", "fig4", "--out", str(out)]) == 0
        (out / "fig4.ssp").unlink()
    after = contents(out)
    assert {name: after[name] for name in after if not name.startswith("runs/")} == before
    assert list(temporary.iterdir()) == []


def test_a_folder_that_is_moved_away_ends_the_run_early(workplace):
    process = running()
    Path("results/fig4").rename("moved")
    # A run that came far has warned of chatter before.
    *_, line = process.communicate(timeout=60)[1].splitlines()
    assert process.returncode == 2
    [left] = Path("moved").glob(".auv-fmu-*")
    assert line == (
        "auv-fmu: results/fig4 was moved or deleted while it was written, along "
        f"with the results in {left.name}"
    )
    assert rows(left)[0, 0] == 0.0
