"""The FMUs in C where there is no Python: a bare root folder, Windows, ARM, and other builders."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary

from orchestrator.cosim import Experiment, System, Table
from orchestrator.machine.compilers import TARGETS, machines_compiler
from support.hosts import bare_root, libraries_of
from support.replay import compile_replay, replay
from support.runs import run, system_of
from support.settings import NAMES

#: Both controllers, so that all FMUs of the paper are run.
SCENARIOS = ("fig4", "fig5-pd")
WHOLE, SHORT = Experiment(100.0, 0.02), Experiment(20.0, 0.02)

#: Symbols that the linker and the C runtime add to every library.
_OF_THE_RUNTIME = {"__gmon_start__", "_ITM_registerTMCloneTable", "_ITM_deregisterTMCloneTable"}

NM, CMAKE, QEMU, WINE = map(shutil.which, ("nm", "cmake", "qemu-aarch64", "wine"))
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
each_scenario = pytest.mark.parametrize("scenario", SCENARIOS)


def symbols(library: Path, option: str) -> set[str]:
    """Names of dynamic symbols, without their versions."""
    command = [str(NM), "-D", option, library]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {line.split()[-1].partition("@")[0] for line in output.splitlines()}


@pytest.fixture(scope="module")
def unpacked(native: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a folder of each FMU."""
    folder = tmp_path_factory.mktemp("unpacked")
    for name in NAMES:
        fmpy.extract(native / f"{name}.fmu", unzipdir=folder / name)
    return folder


@pytest.mark.skipif(NM is None, reason="nm is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_library_needs_only_the_c_library_and_its_mathematics(unpacked: Path, name: str):
    library = unpacked / name / f"binaries/linux64/{name}.so"
    found = {path.name: path for path in libraries_of(library)}
    given = {s for n, path in found.items() if n.startswith(("libc.", "libm."))
             for s in symbols(path, "--defined-only")}  # fmt: skip
    assert symbols(library, "--undefined-only") <= given | _OF_THE_RUNTIME
    assert all(symbol.startswith("fmi2") for symbol in symbols(library, "--defined-only"))


def hold(
    system: System,
    table: Table,
    folder: str | Path,
    place: str,
    command: Sequence[str | Path],
    experiment: Experiment,
    tolerance: float = 0.0,
) -> None:
    """Compare each component of a system, run by a host in C, with a run here.

    Args:
        system: of the FMUs.
        table: of the run here.
        folder: with a folder of each FMU, as the host sees it.
        place: of a library in its folder, where {} is its name.
        command: that starts the host.
        experiment: of the run.
        tolerance: how far outputs may be off.

    """
    for name, component in system.components.items():
        fmu = component.fmu.stem
        there, here = replay(
            command, f"{folder}/{fmu}", place.format(fmu), system, name, table, experiment
        )
        assert there.shape == here.shape == (experiment.rows, len(here.T))
        np.testing.assert_allclose(there, here, rtol=0.0, atol=tolerance, err_msg=name)


@needs_compiler
@each_scenario
def test_host_runs_where_there_is_nothing_but_a_c_library(
    dist: Path, native: Path, unpacked: Path, tmp_path: Path, scenario: str
):
    """5,000 steps, bit for bit as the FMUs in Python."""
    system = system_of(native, scenario)
    host = compile_replay(tmp_path)
    for component in system.components.values():
        shutil.copytree(unpacked / component.fmu.stem, tmp_path / component.fmu.stem)
    root = bare_root(tmp_path, host, *tmp_path.glob("*/binaries/linux64/*.so"))
    table = run(system_of(dist, scenario), WHOLE.stop_time, WHOLE.step)
    hold(system, table, "", "binaries/linux64/{}.so", [*root, "/replay"], WHOLE)


def zig(machine: str) -> list[str]:
    return [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[machine]]


def here(native: Path, scenario: str) -> tuple[System, Table]:
    system = system_of(native, scenario)
    return system, run(system, SHORT.stop_time, SHORT.step)


@pytest.fixture(scope="module")
def elsewhere(release: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The libraries for Windows and for ARM that a release has."""
    folder = tmp_path_factory.mktemp("elsewhere")
    for name in NAMES:
        fmpy.extract(release["2"] / f"{name}.fmu", unzipdir=folder / name)
    return folder


@pytest.mark.slow
@needs_zig
@pytest.mark.skipif(WINE is None, reason="wine is not installed")
@each_scenario
def test_windows_gives_the_same_except_for_rounding(native: Path, elsewhere: Path, scenario: str):
    """Its C library has another sine."""
    host = compile_replay(elsewhere, zig("x86_64-windows"), "replay.exe")
    place = "binaries/win64/{}.dll"
    hold(*here(native, scenario), elsewhere, place, [str(WINE), host], SHORT, tolerance=1e-9)


@pytest.mark.slow
@needs_zig
@pytest.mark.skipif(QEMU is None, reason="qemu-aarch64 is not installed")
@pytest.mark.skipif(not ARM_LIBRARIES.is_dir(), reason="there is no C library for ARM")
@each_scenario
def test_arm_gives_the_same_bit_for_bit(native: Path, elsewhere: Path, scenario: str):
    host = compile_replay(elsewhere, zig("aarch64-linux"))
    place, command = "binaries/aarch64-linux/{}.so", [str(QEMU), "-L", ARM_LIBRARIES, host]
    hold(*here(native, scenario), elsewhere, place, command, SHORT)


@pytest.mark.slow
@pytest.mark.skipif(CMAKE is None, reason="cmake is not installed")
def test_fmpy_builds_the_same_from_the_sources(native: Path, tmp_path: Path):
    for name in {part.fmu.stem for part in system_of(native, "fig4").components.values()}:
        folder = Path(fmpy.extract(native / f"{name}.fmu", tmp_path / name))
        shutil.rmtree(folder / "binaries")
        build_platform_binary(folder)
        Path(shutil.make_archive(str(folder), "zip", folder)).rename(tmp_path / f"{name}.fmu")
    ours, theirs = (run(system_of(fmus, "fig4"), 20.0, 0.02) for fmus in (native, tmp_path))
    columns = ours.header.columns
    np.testing.assert_array_equal(ours.group(*columns), theirs.group(*columns))
