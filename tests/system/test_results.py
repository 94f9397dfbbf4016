"""Results of runs of any length and with any end."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.machine.user_files import unpack
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.tables import read_columns, read_rows
from support.others import build, system_of
from support.texts import mentions

pytestmark = pytest.mark.usefixtures("workplace")


def rows(path: str) -> np.ndarray:
    return np.vstack(list(read_rows(Path(path))))


def test_interval_and_columns_choose_from_the_same_numbers():
    assert main(["run", "fig4", "--stop-time", "2", "--no-figures", "--out", "all"]) == 0
    some = ["--interval", "0.5", "--columns", "plant.y,controller.tau.*"]
    assert main(["run", "fig4", "--stop-time", "2", "--no-figures", "--out", "some", *some]) == 0
    whole, columns = rows("all/result.csv"), read_columns(Path("all/result.csv"))
    kept = read_columns(Path("some/result.csv"))
    assert kept == (*(f"plant.y.{k}" for k in "xyz"), *(f"controller.tau.{k}" for k in "uqr"))
    places = [0, *(1 + columns.index(name) for name in kept)]
    assert np.array_equal(rows("some/result.csv"), whole[::25, places])
    # Indices use all steps, whichever are kept.
    assert Path("some/metrics.json").read_text() == Path("all/metrics.json").read_text()
    outputs = ["--stop-time", "0.1", "--no-figures", "--columns", "outputs", "--out", "outputs"]
    assert main(["run", "fig4", *outputs]) == 0
    names = read_columns(Path("outputs/result.csv"))
    assert "plant.y.x" in names and "plant.tau.u" not in names


def test_columns_are_in_the_order_of_the_descriptions(native: Path):
    """NavigationFilter has Booleans between numbers."""
    command = "run navigation-pd-true --kind native --stop-time 0.1 --no-figures --out mixed"
    assert main(command.split()) == 0
    _, system = load_scenario("navigation-pd-true", "native")
    assert read_columns(Path("mixed/result.csv")) == tuple(
        f"{name}.{variable.get('name')}"
        for name, component in system.components.items()
        for causality in ("input", "output")
        for variable in ElementTree.parse(component.folder / "modelDescription.xml").iter(
            "ScalarVariable"
        )
        if variable.get("causality") == causality
    )


def test_parquet_holds_the_same_numbers():
    pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    assert main(["run", "fig4", "--stop-time", "1", "--no-figures"]) == 0
    text = rows("results/fig4/result.csv")
    assert main(["run", "fig4", "--stop-time", "1", "--no-figures", "--format", "parquet"]) == 0
    assert np.array_equal(rows("results/fig4/result.parquet"), text)
    assert not Path("results/fig4/result.csv").exists(), "of the earlier run"


def with_another_content(fmu: Path) -> None:
    """Overwrite an FMU; its name, inode, size and time stay."""
    before = fmu.stat()
    build(fmu.parent, change=('modelName="Others"', 'modelName="Theirs"'))
    os.utime(fmu, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = fmu.stat()
    assert (after.st_ino, after.st_size, after.st_mtime_ns) == (
        before.st_ino, before.st_size, before.st_mtime_ns,
    )  # fmt: skip


def replace_by_another(fmu: Path) -> None:
    other = build(fmu.parent, "REMEMBERS")
    other.replace(fmu)


@pytest.mark.parametrize("change", [replace_by_another, with_another_content, Path.unlink])
def test_record_names_the_fmu_that_ran(workplace: Path, change: Callable[[Path], object]):
    """Whatever happens to the file after it was read, and during the run."""
    fmu = build(workplace)
    digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    system = system_of(fmu)
    change(fmu)
    result = simulate(system, stop_time=0.2)
    assert (result["a.y"] == 101325.0).all()
    record = json.loads((result.save("r") / "run.json").read_text())
    assert record["fmus"]["a"] == {"file": fmu.name, "sha256": digest, "kind": "native"}


def test_an_fmu_with_another_content_is_unpacked_again(workplace: Path):
    """Also where it has the name, the place, the size and the time of the one before."""
    fmu = build(workplace)
    folder, digest = unpack(fmu)
    assert unpack(fmu) == (folder, digest)
    with_another_content(fmu)
    again = unpack(fmu)
    assert again.digest == hashlib.sha256(fmu.read_bytes()).hexdigest() != digest
    assert b"Theirs" in (again.folder / "modelDescription.xml").read_bytes()
    copy = workplace / "copy.fmu"
    copy.write_bytes(fmu.read_bytes())
    assert unpack(copy) == again


def peak_memory(*arguments: str) -> int:
    """Peak memory of a run on the command line [bytes]."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "orchestrator", "run", "fig4", *arguments],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_maxrss * 1024


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length_of_a_run():
    """30,000 rows of 95 values are 23 MB: none of it is kept."""
    short = peak_memory("--stop-time", "20", "--no-figures")
    long = peak_memory("--stop-time", "600", "--no-figures", "--interval", "1")
    assert long - short < 8e6


@pytest.mark.slow
def test_simulate_again_and_again_in_one_process_in_flat_memory():
    """100 runs; 50 before, in which Python and the FMUs fill their caches."""

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    for _ in range(50):
        simulate("fig4", stop_time=0.1)
    before = resident()
    for _ in range(100):
        simulate("fig4", stop_time=0.1)
    assert resident() - before < 1e6


def test_gains_that_the_step_cannot_follow_are_told(capsys: pytest.CaptureFixture[str]):
    """h p = 0.02 s * 501 1/s is far beyond 2; with steps of 2 ms it is 1."""
    fast = ["run", "fig4", "--no-figures", "--set", "controller.k_d=500", "--stop-time", "0.1"]
    assert main(fast) == 0
    assert "warning: fig4: controller.k_d = 500 1/s" in capsys.readouterr().err
    for cure in (["--step", "0.002"], ["--set", "controller.observer=exact"]):
        assert main([*fast, *cure]) == 0
        assert "warning" not in capsys.readouterr().err


def test_chatter_of_the_robust_term_is_told(capsys: pytest.CaptureFixture[str]):
    quiet = ["run", "fig4", "--no-figures", "--loop", "compiled"]
    quiet += ["--stop-time", "60", "--set", "plant.noise.std=0"]
    assert main(quiet) == 0
    assert "warning" not in capsys.readouterr().err
    assert main([*quiet, "--set", "controller.eps_t=0.01"]) == 0
    assert mentions(capsys.readouterr().err, "warning: fig4: chatters")
