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

from fmus.compilers import machines_compiler
from fmus.kinds import TARGETS
from orchestrator.exchange import c_host
from orchestrator.exchange.verify import verify
from orchestrator.master.experiment import Experiment
from orchestrator.system.component import Component
from orchestrator.system.structure import System
from support.hosts import bare_root, libraries_of
from support.runs import run, system_of
from support.settings import NAMES

#: Both controllers, so that all FMUs of the paper are run.
SCENARIOS = ("fig4", "fig5-pd")
WHOLE, SHORT = Experiment(100.0, 0.02), Experiment(20.0, 0.02)

#: What the linker and the C runtime put into every library.
_OF_THE_RUNTIME = {"__gmon_start__", "_ITM_registerTMCloneTable", "_ITM_deregisterTMCloneTable"}

NM, CMAKE, QEMU, WINE = map(shutil.which, ("nm", "cmake", "qemu-aarch64", "wine"))
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
each_scenario = pytest.mark.parametrize("scenario", SCENARIOS)


def symbols(library: Path, option: str) -> set[str]:
    """Names of dynamic symbols, without their versions."""
    command = [str(NM), "-D", option, library]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {line.split()[-1].partition("@")[0] for line in said.splitlines()}


@pytest.fixture(scope="module")
def unpacked(native: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a folder of each FMU."""
    folder = tmp_path_factory.mktemp("unpacked")
    for name in NAMES:
        fmpy.extract(native / f"{name}.fmu", unzipdir=folder / name)
    return folder


def place(folder: Path, platform: str, ending: str) -> c_host.LibraryOf:
    """Where the libraries of a platform are below a folder."""

    def library(component: Component) -> Path:
        name = component.fmu.stem
        return folder / name / "binaries" / platform / f"{name}{ending}"

    return library


@pytest.mark.skipif(NM is None, reason="nm is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_library_needs_the_c_library_and_its_mathematics_alone(unpacked: Path, name: str):
    library = place(unpacked, "linux64", ".so")(Component(name, Path(name), None, ""))
    found = {path.name: path for path in libraries_of(library)}
    given = {s for n, path in found.items() if n.startswith(("libc.", "libm."))
             for s in symbols(path, "--defined-only")}  # fmt: skip
    assert symbols(library, "--undefined-only") <= given | _OF_THE_RUNTIME
    assert all(symbol.startswith("fmi2") for symbol in symbols(library, "--defined-only"))


@needs_compiler
@each_scenario
def test_host_runs_where_there_is_nothing_but_a_c_library(
    dist: Path, native: Path, unpacked: Path, tmp_path: Path, scenario: str
):
    """5,000 steps; the table is that of the FMUs in Python, with tolerance 0."""
    system = system_of(native, scenario)
    host = c_host.compile_host(tmp_path, system, WHOLE, place(Path("/"), "linux64", ".so"))
    for component in system.components.values():
        shutil.copytree(unpacked / component.fmu.stem, tmp_path / component.fmu.stem)
    root = bare_root(tmp_path, host, *tmp_path.glob("*/binaries/linux64/*.so"))
    c_host.run_host([*root, "/host"], tmp_path, WHOLE.full_steps, [])
    said = verify(tmp_path / c_host.TABLE_FILE, system_of(dist, scenario), 0.0)
    assert "to 100 s, in feedthrough order" in said


def zig(machine: str) -> list[str]:
    return [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[machine]]


def run_elsewhere(
    system: System,
    folder: Path,
    machine: str,
    library: c_host.LibraryOf,
    command: Sequence[str | Path],
    name: str = "host",
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of all Reals on another machine, where the command runs a program, and here."""
    here = run(system, SHORT.stop_time, SHORT.step)
    names = [name for name in here.header.columns if not name.endswith(".fault")]
    program = c_host.compile_host(folder, system, SHORT, library, zig(machine), name)
    rows, _ = c_host.run_host([*command, program], folder, SHORT.full_steps, names)
    return rows, here.group(*names)


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
def test_windows_gives_the_same_but_for_rounding(native: Path, elsewhere: Path, scenario: str):
    """Its C library has another sine."""
    library = place(elsewhere, "win64", ".dll")
    there, here = run_elsewhere(
        system_of(native, scenario), elsewhere, "x86_64-windows", library, [str(WINE)], "host.exe"
    )
    np.testing.assert_allclose(there, here, rtol=0.0, atol=1e-9)


@pytest.mark.slow
@needs_zig
@pytest.mark.skipif(QEMU is None, reason="qemu-aarch64 is not installed")
@pytest.mark.skipif(not ARM_LIBRARIES.is_dir(), reason="there is no C library for ARM")
@each_scenario
def test_arm_gives_the_same_bit_for_bit(native: Path, elsewhere: Path, scenario: str):
    library, command = place(elsewhere, "aarch64-linux", ".so"), [str(QEMU), "-L", ARM_LIBRARIES]
    there, here = run_elsewhere(
        system_of(native, scenario), elsewhere, "aarch64-linux", library, command
    )
    np.testing.assert_array_equal(there, here)


@pytest.mark.slow
@pytest.mark.skipif(CMAKE is None, reason="cmake is not installed")
def test_fmpy_builds_the_same_from_the_sources_alone(native: Path, tmp_path: Path):
    for name in NAMES:
        folder = Path(fmpy.extract(native / f"{name}.fmu", tmp_path / name))
        shutil.rmtree(folder / "binaries")
        build_platform_binary(folder)
        Path(shutil.make_archive(str(folder), "zip", folder)).rename(tmp_path / f"{name}.fmu")
    for scenario in SCENARIOS:
        ours, theirs = (run(system_of(fmus, scenario), 20.0, 0.02) for fmus in (native, tmp_path))
        columns = ours.header.columns
        np.testing.assert_array_equal(ours.group(*columns), theirs.group(*columns))
