"""The wheel, and the papers of the built bundle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from orchestrator import simulate
from orchestrator.runs import bundle
from ready_wheel import write_wheel
from support.machine import contents

ROOT = Path(__file__).parents[2]

needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")


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
    # The packages of the wheel come before those of this environment.
    environment = {**os.environ, "PYTHONPATH": str(packages)}
    where = subprocess.run(
        [sys.executable, "-P", "-c", "import fmus, orchestrator; print(orchestrator.__file__)"],
        env=environment, cwd=empty, check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert where.stdout.startswith(str(packages))
    # What the report takes from pages is in the wheel, and names no test, of which it has none.
    assert {path.name for path in packages.rglob("pages/*.md")} == {"paper.md", "readings.md"}
    for path in packages.rglob("*.*"):
        assert path.suffix not in (".md", ".py", ".toml") or b"tests/" not in path.read_bytes()
    command = [sys.executable, "-P", "-m", "orchestrator", "run", "fig4"]
    # The second has all that a translation to C needs.
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
@needs_zig
def test_wheel_with_all_ready_runs_fig4_without_a_compiler_and_builds_nothing(tmp_path: Path):
    once, again = (write_wheel(tmp_path / name) for name in ("once", "again"))
    assert once.name.endswith("-py3-none-any.whl")
    assert once.read_bytes() == again.read_bytes()
    packages, cache, empty = tmp_path / "packages", tmp_path / "cache", tmp_path / "empty"
    empty.mkdir()
    install = [sys.executable, "-m", "pip", "--quiet", "install", "--no-deps", "--target", packages]
    subprocess.run([*install, once], check=True)
    environment = {"PYTHONPATH": str(packages), "PATH": str(empty), "XDG_CACHE_HOME": str(cache)}
    subprocess.run(
        [sys.executable, "-P", "-m", "orchestrator", "run", "fig4", "--no-figures"],
        env=environment, cwd=empty, check=True, capture_output=True,
    )  # fmt: skip
    assert not (cache / "auv-fmu" / "fmus").exists()
    result = empty / "results" / "fig4"
    record = json.loads((result / "run.json").read_text())
    assert {fmu["kind"] for fmu in record["fmus"].values()} == {"native"}
    assert record["loop"] == "compiled"
    # The table of the checkout's FMUs in Python.
    expected = simulate("fig4", kind="python").save(tmp_path / "expected")
    assert (result / "result.csv").read_bytes() == (expected / "result.csv").read_bytes()


def test_bundle_built_again_elsewhere_is_the_same_to_the_last_byte(dist: Path, tmp_path: Path):
    bundle.build_bundle(tmp_path / "elsewhere")
    assert contents(tmp_path / "elsewhere") == contents(dist)
