"""The wheel, the built bundle, and the archives of a release."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

from auv_fmu import __version__
from fmus.kinds import FMI_VERSIONS
from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.live import assembly, module
from orchestrator.machine.compilers import platforms
from orchestrator.runs import bundle
from ready_wheel import write_programs, write_wheel
from support.live import needs_npm, needs_zig
from support.machine import contents
from support.settings import NAMES, REPRESENTATIVES, WITH_INPUTS

ROOT = Path(__file__).parents[2]

#: First bytes of libraries, and numbers of processors by the names of FMI 3.0: from elf.h, the
#: format of PE, and Apple's mach/machine.h.
ELF, PE, MACH_O, UNIVERSAL = b"\x7fELF\x02\x01", b"PE\0\0", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"
PROCESSORS = {
    ELF: {62: "x86_64-linux", 183: "aarch64-linux"},
    PE: {0x8664: "x86_64-windows"},
    MACH_O: {0x01000007: "x86_64-darwin", 0x0100000C: "aarch64-darwin"},
}

each_version = pytest.mark.parametrize("fmi", FMI_VERSIONS)


@pytest.mark.slow
def test_wheel_builds_the_bundle_and_runs_fig4_in_an_empty_folder(tmp_path: Path):
    wheels, packages, empty = tmp_path / "wheels", tmp_path / "packages", tmp_path / "empty"
    empty.mkdir()
    pip = [sys.executable, "-m", "pip", "--quiet"]
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", wheels, ROOT],
        check=True,
        cwd=tmp_path,
    )
    [wheel] = wheels.iterdir()
    subprocess.run([*pip, "install", "--no-deps", "--target", packages, wheel], check=True)
    # Packages of the wheel come before the environment's.
    environment = {**os.environ, "PYTHONPATH": str(packages)}
    where = subprocess.run(
        [sys.executable, "-P", "-c", "import fmus, orchestrator; print(orchestrator.__file__)"],
        env=environment, cwd=empty, check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert where.stdout.startswith(str(packages))
    # Pages that the report needs are in the wheel; they name no test, since it has no tests.
    assert {path.name for path in packages.rglob("pages/*.md")} == {"paper.md", "readings.md"}
    for path in packages.rglob("*.*"):
        assert path.suffix not in (".md", ".py", ".toml") or b"tests/" not in path.read_bytes()
    command = [sys.executable, "-P", "-m", "orchestrator", "run", "fig4"]
    # The second needs everything for a translation to C.
    for options in ([], ["--kind", "native", "--no-figures", "--out", "results/native"]):
        subprocess.run(
            [*command, "--stop-time", "1", *options],
            env=environment, cwd=empty, check=True, capture_output=True,
        )  # fmt: skip
    assert (empty / "results/fig4/fig4.png").is_file()
    tables = {(empty / "results" / name / "result.csv").read_bytes() for name in ("fig4", "native")}
    assert len(tables) == 1
    assert [path.name for path in empty.iterdir()] == ["results"]


@pytest.mark.slow
@needs_npm
@needs_zig
@pytest.mark.usefixtures("script")
def test_wheel_with_all_ready_runs_fig4_without_a_compiler_and_builds_nothing(
    ready: Path, tmp_path: Path
):
    whole = shutil.copytree(ready, tmp_path / "ready")
    write_programs(whole)
    # CI tries the wheel in Windows, too.
    wheel = write_wheel(Path(os.environ.get("WHEELS", tmp_path)), whole)
    assert wheel.name.endswith("-py3-none-any.whl")
    packages, cache, empty = tmp_path / "packages", tmp_path / "cache", tmp_path / "empty"
    empty.mkdir()
    install = [sys.executable, "-m", "pip", "--quiet", "install", "--no-deps", "--target", packages]
    subprocess.run([*install, wheel], check=True)
    environment = {"PYTHONPATH": str(packages), "PATH": str(empty), "XDG_CACHE_HOME": str(cache)}
    # The table of the checkout's FMUs in Python.
    expected = simulate("fig4", kind="python").save(tmp_path / "expected")
    command = [sys.executable, "-P", "-m", "orchestrator", "run", "fig4", "--no-figures"]
    for kind, ran in (("auto", "native"), ("python", "python")):
        subprocess.run(
            [*command, "--kind", kind, "--out", kind],
            env=environment, cwd=empty, check=True, capture_output=True,
        )  # fmt: skip
        record = json.loads((empty / kind / "run.json").read_text())
        assert {fmu["kind"] for fmu in record["fmus"].values()} == {ran}
        assert record["loop"] == "compiled"
        table = (empty / kind / "result.csv").read_bytes()
        assert table == (expected / "result.csv").read_bytes()
    subprocess.run(
        [*command[:4], "live", "--out", "live.html"],
        env=environment, cwd=empty, check=True, capture_output=True,
    )  # fmt: skip
    assert (empty / "live.html").stat().st_size > 100_000
    for category in ("fmus", module.CATEGORY, assembly.CATEGORY):
        assert not (cache / "auv-fmu" / category).exists()


@pytest.mark.slow
def test_bundle_built_again_elsewhere_is_the_same_to_the_last_byte(dist: Path, tmp_path: Path):
    bundle.build_bundle(tmp_path / "elsewhere")
    kept = {name: text for name, text in contents(dist).items() if not name.startswith(".")}
    assert contents(tmp_path / "elsewhere") == kept


def machines(library: bytes) -> set[str]:
    """The machines that a library is for."""

    def number(place: int, size: int, order: str = "little") -> int:
        return int.from_bytes(library[place : place + size], order)  # type: ignore[arg-type]

    if library.startswith(ELF):
        return {PROCESSORS[ELF][number(18, 2)]}
    if library.startswith(MACH_O):
        return {PROCESSORS[MACH_O][number(4, 4)]}
    if library.startswith(UNIVERSAL):
        places = [number(16 + 20 * i, 4, "big") for i in range(number(4, 4, "big"))]
        return {machine for place in places for machine in machines(library[place:])}
    head = number(0x3C, 4)
    assert (library[:2], library[head : head + 4]) == (b"MZ", PE)
    return {PROCESSORS[PE][number(head + 4, 2)]}


@pytest.mark.slow
@needs_zig
@each_version
def test_release_is_what_its_papers_say(release: dict[str, Path], fmi: str):
    folder = release[fmi]
    files = {path for path in contents(folder) if path != "SHA256SUMS"}
    assert files == {
        *(f"{name}.fmu" for name in NAMES), "auv.ssp", "README.md",
        *(f"licenses/{name}.txt" for name in ("auv-fmu", "zig", "mingw-w64")),
        *(f"reference/{name}_in.csv" for name in WITH_INPUTS),
        *(f"reference/{name}_ref.{end}" for name in (*NAMES, "auv") for end in ("csv", "opt")),
    }  # fmt: skip
    sums = dict(line.split()[::-1] for line in (folder / "SHA256SUMS").read_text().splitlines())
    assert sums == {
        file: hashlib.sha256((folder / file).read_bytes()).hexdigest() for file in files
    }
    if command := shutil.which("sha256sum"):
        subprocess.run([command, "--check", "--quiet", "SHA256SUMS"], cwd=folder, check=True)
    page = (folder / "README.md").read_text()
    assert all(f"`{name}.fmu`" in page for name in NAMES)
    assert "$" not in page
    for name, holder in (("auv-fmu", "MIT License"), ("mingw-w64", "mingw-w64 project")):
        assert holder in (folder / "licenses" / f"{name}.txt").read_text()


@pytest.mark.slow
@needs_zig
@each_version
def test_fmus_of_a_release_are_valid_and_have_a_library_for_every_platform(
    release: dict[str, Path], fmi: str
):
    expected = {platform.name: {*platform.machines} for platform in platforms(fmi, "all")}
    for name in NAMES:
        with zipfile.ZipFile(release[fmi] / f"{name}.fmu") as archive:
            libraries = [file for file in archive.namelist() if file.startswith("binaries/")]
            found = {Path(file).parts[1]: machines(archive.read(file)) for file in libraries}
        assert found == expected
    for name in REPRESENTATIVES:
        assert validate_fmu(str(release[fmi] / f"{name}.fmu")) == []


@pytest.mark.slow
@needs_zig
@each_version
@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_fmu_of_a_release_gives_its_reference_results_in_fmpy(
    release: dict[str, Path], fmi: str, name: str
):
    """To 1e-9: other machines may differ in the last place."""
    folder = release[fmi]
    inputs = folder / "reference" / f"{name}_in.csv"
    expected = read_csv(folder / "reference" / f"{name}_ref.csv")
    found = fmpy.simulate_fmu(
        str(folder / f"{name}.fmu"), stop_time=expected["time"][-1], step_size=0.02,
        output_interval=0.02, input=read_csv(inputs) if inputs.is_file() else None,
        output=expected.dtype.names[1:],
    )  # fmt: skip
    for port in expected.dtype.names:
        np.testing.assert_allclose(found[port], expected[port], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@needs_zig
@each_version
def test_ssp_of_a_release_holds_its_fmus(release: dict[str, Path], fmi: str):
    folder = release[fmi]
    with zipfile.ZipFile(folder / "auv.ssp") as archive:
        names = {name for name in archive.namelist() if name.endswith(".fmu")}
        assert len(names) == 4
        for name in names:
            assert archive.read(name) == (folder / Path(name).name).read_bytes()
    assert main(["check", str(folder / "auv.ssp")]) == 0
    if fmi == "2":
        read_ssd(str(folder / "auv.ssp"))
        assert len(simulate_ssp(str(folder / "auv.ssp"), stop_time=1.0, step_size=0.02)) >= 50


def test_release_without_ziglang_is_refused(
    workplace: Path, refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch
):
    Path("sitecustomize.py").write_text("import sys; sys.modules['ziglang'] = None\n")
    monkeypatch.setenv("PYTHONPATH", str(workplace))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    message = refused("release", "--out", "archives")
    assert "no C compiler for " in message and "pip install 'auv-fmu[native]'" in message


def test_release_replaces_no_file_of_the_users(workplace: Path, refused: Callable[..., str]):
    [name, _] = (f"auv-fmu-{__version__}-fmi{fmi}.zip" for fmi in FMI_VERSIONS)
    Path(name).write_text("mine")
    assert name in refused("release", "--out", ".")
