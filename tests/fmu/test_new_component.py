"""A component is a folder: one that nothing names is built, described, run and tested."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus.discovery import components
from orchestrator.machine.compilers import machines_compiler
from reference import STEP, STOP_TIME, write_component_reference

ROOT = Path(__file__).parents[2]
NAME, FOLDER = "FirstOrderLag", "first_order_lag"

#: Files in that folder.
WRITTEN = {"component.py", "page.md"}

#: The only other component in the copy.
OTHER = "fmus.disturbance_generator.component"

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")


def python(tree: Path, *arguments: str) -> str:
    """Run Python in a tree whose packages come before all others, and return what it prints."""
    process = subprocess.run(
        [sys.executable, *arguments],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree with a new component and one of the others."""
    tree = tmp_path_factory.mktemp("tree")
    left_out = [package.split(".")[1] for package in components().values() if package != OTHER]
    ignored = shutil.ignore_patterns("__pycache__", "dist", *left_out)
    shutil.copytree(ROOT / "fmus", tree / "fmus", ignore=ignored)
    # Both packages come from one folder, as in any installation.
    shutil.copytree(ROOT / "src/auv_fmu", tree / "auv_fmu", ignore=ignored)
    shutil.copytree(Path(__file__).parent / FOLDER, tree / "fmus" / FOLDER, ignore=ignored)
    for kind in ("python", "native"):
        python(tree, "-m", "fmus.build", "--kind", kind, "--out", f"dist/{kind}")
        assert (tree / f"dist/{kind}/{NAME}.fmu").is_file()
    return tree


def test_folder_has_no_other_files(tree: Path):
    assert {path.name for path in (tree / "fmus" / FOLDER).glob("*.*")} == WRITTEN


@pytest.mark.parametrize("kind", ["python", "native"])
def test_both_kinds_describe_themselves_well(tree: Path, kind: str):
    assert validate_fmu(str(tree / f"dist/{kind}/{NAME}.fmu")) == []


def test_page_has_the_ports(tree: Path):
    page = python(
        tree,
        "-c",
        f"from fmus.discovery import source_of; from fmus.documentation import component_page; "
        f"print(component_page(source_of({NAME!r})))",
    )
    assert page.startswith("# FirstOrderLag\n\nA lag of first order")
    assert page.index("| `y` | m | Value, measured |") < page.index("## Equations")


def test_both_kinds_give_the_same_numbers_and_they_are_right(tree: Path):
    """The exponential, and the noise: 3,000 numbers with a deviation of 1 cm, up to 5 %."""
    python, native = (
        fmpy.simulate_fmu(
            str(tree / f"dist/{kind}/{NAME}.fmu"), stop_time=30.0, step_size=0.01,
            output_interval=0.01, output=["x", "y"],
        )
        for kind in ("python", "native")
    )  # fmt: skip
    assert python.tobytes() == native.tobytes()
    np.testing.assert_allclose(python["x"], np.exp(-python["time"] / 0.5), rtol=1e-10)
    noise = python["y"] - python["x"]
    assert np.std(noise) == pytest.approx(0.01, rel=0.05)
    assert abs(np.mean(noise)) < 4.0 * 0.01 / np.sqrt(len(noise))


def test_reference_is_written_for_it(tree: Path, tmp_path: Path):
    """With u held through a step, x(t + h) = u + (x(t) - u) exp(-h / T)."""
    written = write_component_reference(tree / f"dist/native/{NAME}.fmu", tmp_path)
    related = {"default_out.csv", "experiments.exp", "fmi-ls-manifest.xml"}
    assert {p.name for p in written} == related | {
        f"{NAME}_{n}" for n in ("in.csv", "ref.csv", "ref.opt")
    }
    u, x = (
        np.genfromtxt(tmp_path / f"{NAME}_{which}.csv", delimiter=",", names=True, deletechars="")
        for which in ("in", "ref")
    )
    assert x["time"][-1] == STOP_TIME
    held, before = u["u"][:-1], x["x"][:-1]
    expected = held + (before - held) * np.exp(-STEP / 0.5)
    np.testing.assert_allclose(x["x"][1:], expected, rtol=1e-9)
