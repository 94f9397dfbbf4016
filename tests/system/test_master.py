"""The master: checks before a run, order, times, and rows after a failure."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator import simulate
from orchestrator.cosim import (
    Connection,
    Experiment,
    PortName,
    System,
    Table,
    make_plan,
    read_component,
    simulate_plan,
)
from orchestrator.cosim.fmi.binary import check_place
from orchestrator.cosim.stages import arrange
from orchestrator.machine.errors import InputError
from orchestrator.machine.user_files import unpack
from support.machine import LOOPS
from support.runs import run
from support.texts import mentions
from support.tiers import slow


def port(text: str) -> PortName:
    return PortName(*text.split(".", 1))


def with_connection(system: System, source: str, target: str) -> System:
    """The system with one more connection, in place of the one that feeds the target."""
    kept = tuple(c for c in system.connections if c.target != port(target))
    return replace(system, connections=(*kept, Connection(port(source), port(target))))


def test_gauss_seidel_order_follows_the_declared_feedthrough(system: System):
    first, second = (arrange(system, order).stages for order in ("gauss-seidel", "jacobi"))
    assert first == [["controller", "disturbance", "planner"], ["plant"]]
    assert second == [["plant", "controller", "disturbance", "planner"]]


@pytest.mark.parametrize(
    ("source", "target", "reason"),
    [
        ("plant.y.w", "controller.y.x", "'y.w' y.x"),
        ("plante.y.x", "controller.y.x", "'plante' plant, controller"),
        ("plant.tau.u", "controller.y.x", "plant.tau.u input output"),
        ("plant.y.x", "controller.e.x", "controller.e.x output input"),
        ("plant.fault", "controller.y.x", "Boolean Real"),
        ("plant.nu.u", "controller.y.x", "units m/s m"),
    ],
)
def test_connection_that_does_not_fit_is_refused(system, source, target, reason):
    with pytest.raises(InputError) as error:
        run(with_connection(system, source, target), 1.0, 0.02)
    assert mentions(str(error.value), reason)
    twice = replace(system, connections=(*system.connections, system.connections[0]))
    with pytest.raises(InputError, match=str(system.connections[0].target)):
        run(twice, 1.0, 0.02)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("plant.m1", 1, "m11"),
        ("plant.m11", -1, "m11 = -1"),
        ("plant.m11", "nan", "must be finite"),
        ("plant.noise.seed", 1.5, "not an integer"),
        ("controller.printed_jacobian", "perhaps", "not a Boolean"),
        ("plant.tau_min.q", 0.0, None),
        ("plant.y.x", 1, "plant.y.x .* output"),
        ("plant.tau.u", 1, "controller.tau.u"),
        ("pilot.mood", 1, "'pilot'"),
    ],
)
def test_wrong_parameter_is_refused_in_one_line(system, name, value, reason):
    values = {port(name): value}
    if reason is None:
        values[port("plant.tau_max.q")] = 0.0
        reason = "must be below tau_max.q"
    with pytest.raises(InputError, match=reason) as error:
        run(system.with_parameters(values), 1.0, 0.02)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("loop", LOOPS)
def test_time_is_computed_and_the_last_step_ends_at_the_stop_time(system: System, loop: str):
    result = run(system, 1.0, 0.03, loop=loop)
    assert np.array_equal(result.time[:-1], np.arange(34) * 0.03)
    assert result.time[-1] == 1.0
    assert len(run(system, 0.3, 0.1, loop=loop).time) == 4


class Impatient(Table):
    """A table that presses Ctrl-C when it gets rows."""

    def take(self, rows: np.ndarray) -> None:
        super().take(rows)
        os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("loop", LOOPS)
def test_interrupt_keeps_the_rows_and_does_not_reach_the_fmus(system: System, loop: str):
    """In a run that would take minutes."""
    result, experiment = Impatient(), Experiment(1e4, 0.02)
    simulate_plan(make_plan(system, experiment, loop=loop), [result])
    assert result.failure is not None
    assert "interrupted at t =" in result.failure
    assert 1 < len(result) < 500_000
    assert np.isfinite(result.rows).all()


#: A run, one that is refused, and one that fails.
_RUNS_AND_FAILS = """
import sys
from pathlib import Path
from orchestrator import load, simulate
system = load(sys.argv[1])
simulate(system, stop_time=0.1)
try:
    simulate(system, {"plant.m11": -1.0}, stop_time=0.1)
except ValueError:
    pass
assert simulate(system, {"plant.d11": 1e4}, stop_time=50.0).failure
"""


def python(code: str, *arguments: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """A process of its own whose temporary files go into a folder."""
    return subprocess.run(
        [sys.executable, "-P", "-c", code, *map(str, arguments)],
        env={**os.environ, "TMPDIR": str(folder)}, check=False, capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.parametrize("loop", ["python", *slow("compiled")])
def test_runs_in_several_threads_share_what_is_loaded(dist: Path, tmp_path: Path, loop: str):
    """Six threads from a cold start; one folder for each FMU and the archive."""
    code = """
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import gettempdir
from orchestrator import load, simulate
system = load(sys.argv[1])
with ThreadPoolExecutor(6) as pool:
    runs = list(pool.map(lambda _: simulate(system, stop_time=0.5, loop=sys.argv[2]), range(6)))
assert all((run.rows == runs[0].rows).all() for run in runs)
[folder] = Path(gettempdir()).iterdir()
print(sum(path.is_dir() for path in folder.iterdir()))
"""
    process = python(code, dist / "auv.ssp", loop, folder=tmp_path)
    assert process.stdout == "5\n", process.stderr
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_ends_a_script_that_simulates(dist: Path, tmp_path: Path):
    code = """
import os, signal, sys, threading
from orchestrator import load, simulate
system = load(sys.argv[1])
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
for _ in range(1000):
    simulate(system, stop_time=20.0, loop="compiled")
"""
    process = python(code, dist / "auv.ssp", folder=tmp_path)
    assert "KeyboardInterrupt" in process.stderr
    assert process.returncode != 0


@pytest.mark.parametrize("name", ["a+b", *slow("größe", "a%2Bb", "(x) & 'y' #1?")])
def test_a_temporary_folder_of_any_name_is_left_empty(dist: Path, tmp_path: Path, name: str):
    """Our loader decodes what PythonFMU does not; without it such a folder is refused."""
    folder = tmp_path / name
    folder.mkdir()
    process = python(_RUNS_AND_FAILS, dist / "auv.ssp", folder=folder)
    assert process.returncode == 0, process.stderr
    assert list(folder.iterdir()) == []


def test_temporary_folder_that_would_crash_a_plain_fmu_is_refused(dist: Path, tmp_path: Path):
    plain, system = unpack(dist / "AuvPlant.fmu").folder, tmp_path / "a+b"
    shutil.copytree(plain, system)
    check_place(system)
    for library in system.glob("binaries/*/*_pythonfmu.*"):
        library.unlink()
    with pytest.raises(InputError, match=r"'\+' .*TMPDIR"):
        check_place(system)
    system.rename(tmp_path / "a b")
    check_place(tmp_path / "a b")


def test_broken_and_missing_fmus_are_refused(tmp_path: Path, dist: Path):
    with pytest.raises(InputError, match=r"missing\.fmu"):
        read_component("plant", tmp_path / "missing.fmu")
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"not a zip")
    with pytest.raises(InputError, match=r"broken\.fmu: .*zip"):
        read_component("plant", broken)
    hollow = tmp_path / "hollow.fmu"
    with zipfile.ZipFile(dist / "AuvPlant.fmu") as full, zipfile.ZipFile(hollow, "w") as archive:
        archive.writestr("modelDescription.xml", full.read("modelDescription.xml"))
    alone = System("alone", {"plant": read_component("plant", hollow)}, ())
    with pytest.raises(InputError, match=r"hollow\.fmu"):
        run(alone, 1.0, 0.02)


_ALONE = """\
import sys
from pathlib import Path

from orchestrator.cosim import Experiment, Table, make_plan, read_ssp, simulate_plan

table = Table()
plan = make_plan(read_ssp(Path(sys.argv[1])), Experiment(stop_time=1.0, step=0.02))
ending = simulate_plan(plan, [table])
assert ending.failure is None, ending.failure
tops = {name.partition(".")[0] for name in sys.modules}
assert tops.isdisjoint(("auv_fmu", "fmus", "matplotlib", "pandas")), tops
print(*(value.hex() for value in table.rows[-1].tolist()))
"""


def test_an_ssp_runs_with_the_two_lowest_rooms_only(native: Path, tmp_path: Path):
    source, copy = Path(orchestrator.__file__).parent, tmp_path / "orchestrator"
    for room in ("machine", "cosim"):
        shutil.copytree(source / room, copy / room)
    (copy / "__init__.py").touch()
    (tmp_path / "run.py").write_text(_ALONE)
    done = subprocess.run(
        [sys.executable, "run.py", str(native / "auv.ssp")],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    expected = simulate(native / "auv.ssp", stop_time=1.0, step=0.02).rows[-1]
    assert np.array_equal([float.fromhex(text) for text in done.stdout.split()], expected)
