"""The guide to your own component, followed literally, and its FMUs where there is no Python."""

from __future__ import annotations

import io
import re
import shlex
import shutil
import sys
from contextlib import redirect_stdout
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

import fmpy
import numpy as np
import pytest

from auv_fmu import Variable
from fmus import check
from fmus.ports.behaviour import HOOKS
from orchestrator.commands.main import main
from orchestrator.cosim import Experiment
from orchestrator.machine.compilers import TARGETS, machines_compiler
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.result import read_result
from support.examples import EXAMPLES
from support.markdown import DOCS, blocks
from support.patches import patch
from support.replay import compile_replay, replay
from support.runs import whole

PAGE = DOCS / "tutorials" / "your-own-component.md"
FORM = DOCS / "explanation" / "component.md"

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

QEMU, WINE = map(shutil.which, ("qemu-aarch64", "wine"))
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")

#: Commands that need packages which are not everywhere.
EXTRAS = {" hosts ": ("libcosimpy", "ecospy"), "policy": ("onnx",)}


def network(path: Path) -> None:
    """A trained policy."""
    onnx, random = pytest.importorskip("onnx"), np.random.default_rng(1)
    make, row = onnx.helper, onnx.TensorProto.FLOAT
    known = [
        onnx.numpy_helper.from_array(random.normal(size=size).astype(np.float32), name)
        for name, size in (("W1", (8, 4)), ("b1", 8), ("W2", (2, 8)), ("b2", 2))
    ]
    nodes = [
        make.make_node("Gemm", ["observation", "W1", "b1"], ["z"], transB=1),
        make.make_node("Tanh", ["z"], ["a"]),
        make.make_node("Gemm", ["a", "W2", "b2"], ["action"], transB=1),
    ]
    graph = make.make_graph(
        nodes,
        "policy",
        [make.make_tensor_value_info("observation", row, [1, 4])],
        [make.make_tensor_value_info("action", row, [1, 2])],
        known,
    )
    onnx.save(make.make_model(graph, ir_version=8), str(path))


def test_example_of_the_form_is_a_component(tmp_path: Path):
    text, *_ = (text for _, text in blocks(FORM, "python"))
    (tmp_path / "heater.py").write_text(text, encoding="utf-8")
    assert check.mistakes(tmp_path / "heater.py", tmp_path) == []


def test_page_of_the_form_names_all_of_it():
    page = FORM.read_text(encoding="utf-8")
    for name, taken in HOOKS.items():
        assert f"`{name}({', '.join(taken)}" in page
    constants = ("RESTARTED", "SAMPLED", "H_MAX", "STEP_SIZE", "STOP_TIME")
    for name in (*constants, *(field.name for field in fields(Variable))):
        assert re.search(rf"`{name}\b", page), name


# Once in a process: the page makes a module that is then known, and refuses a second of its name.
@pytest.fixture(scope="session")
def followed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder in which everything on the page was done, and the output."""
    folder, output = tmp_path_factory.mktemp("component"), io.StringIO()
    before = [*sys.path]
    with pytest.MonkeyPatch.context() as here, redirect_stdout(output):
        here.chdir(folder)
        # An example has that name, too, and other tests import it.
        here.delitem(sys.modules, "pid", raising=False)
        here.setattr(sys, "path", [p for p in sys.path if EXAMPLES not in Path(p).parents])
        for language, text in blocks(PAGE, "sh", "diff", "python"):
            if language == "diff":
                patch(folder, text)
            elif language == "python":
                exec(compile(text, str(PAGE), "exec"), {})
            for line in text.splitlines() if language == "sh" else ():
                needed = [package for part, packages in EXTRAS.items() for package in packages
                          if part in line]  # fmt: skip
                if not all(map(find_spec, needed)):
                    continue
                if "policy.onnx" in line:
                    network(folder / "policy.onnx")
                assert main(shlex.split(line)[1:]) == 0, line
    # Others have components of this name, too.
    sys.path[:] = before
    sys.modules.pop("pid", None)
    return folder, output.getvalue()


def test_both_kinds_give_the_same_table(followed: tuple[Path, str]):
    folder, _ = followed
    python, native = (folder / f"{kind}-kind/result.csv" for kind in ("python", "native"))
    assert python.read_bytes() == native.read_bytes()
    command = read_result(python.parent)[1]["Pid.command"]
    # The proportional part of 1.5 (0.2 - 0) at the start, and the integral after it.
    assert command[0] == pytest.approx(0.3, rel=1e-15)
    assert command[-1] == pytest.approx(0.3 * (1.0 + 10.0 / 5.0), rel=5e-3)


def test_other_hosts_give_the_same_numbers(followed: tuple[Path, str]):
    """In fmpy; the table on the page has the deviations of other hosts."""
    folder, output = followed
    rows = [
        fmpy.simulate_fmu(
            str(path), stop_time=10.0, step_size=0.02, output_interval=0.02,
            start_values={"set_point": 0.2}, output=["command"],
        )["command"]
        for path in (
            folder / "pid/Pid.fmu", folder / "native/Pid.fmu", folder / "native/fmi3/Pid.fmu"
        )
    ]  # fmt: skip
    # fmpy takes the difference of two times for the step, which is off by a rounding error.
    table = read_result(folder / "native-kind")[1]["Pid.command"]
    for row in rows:
        np.testing.assert_array_equal(row, rows[0])
        # A sampled component holds its outputs after a step, and fmpy reads them then.
        np.testing.assert_allclose(row, [table[0], *table[:-1]], rtol=1e-12)
    if all(map(find_spec, EXTRAS[" hosts "])):
        lines = [line.split() for line in output.splitlines()]
        found = {words[0]: words for words in lines if words[:1] and "0.0e+00" in words}
        assert found.keys() >= {"libcosim-ssp", "ecos", "fmpy"}, output


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
@pytest.mark.parametrize(
    ("machine", "platform", "ending", "tool", "tolerance"),
    [
        ("aarch64-linux", "aarch64-linux", ".so", QEMU, 0.0),
        ("x86_64-windows", "win64", ".dll", WINE, 1e-9),
    ],
    ids=["qemu", "wine"],
)
def test_other_machines_give_the_same_numbers(
    followed: tuple[Path, str], release: dict[str, Path], tmp_path: Path, machine: str,
    platform: str, ending: str, tool: str | None, tolerance: float,
):  # fmt: skip
    """A host in C, without Python."""
    if tool is None or (tool == QEMU and not ARM_LIBRARIES.is_dir()):
        pytest.skip(f"nothing runs programs of {machine} here")
    folder, _ = followed
    command = ["build", str(folder / "pid/pid.py"), "--kind", "native", "--out", str(tmp_path)]
    assert main([*command, "--platforms", platform]) == 0
    fmpy.extract(tmp_path / "Pid.fmu", unzipdir=tmp_path / "Pid")
    _, system = load_scenario(str(folder / "native/Pid.fmu"))
    system = system.with_parameters({"Pid.set_point": 0.2})
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[machine]]
    host = compile_replay(tmp_path, zig, "replay.exe" if ending == ".dll" else "replay")
    run = [tool, "-L", ARM_LIBRARIES, host] if tool == QEMU else [tool, host]
    experiment = Experiment(10.0, 0.02)
    table = whole(system, experiment)
    place = f"binaries/{platform}/Pid{ending}"
    rows, expected = replay(run, tmp_path / "Pid", place, system, "Pid", table, experiment)
    np.testing.assert_allclose(rows, expected, rtol=0.0, atol=tolerance)
    here = read_result(folder / "native-kind")[1]["Pid.command"]
    np.testing.assert_array_equal(expected[:, 0], here)
