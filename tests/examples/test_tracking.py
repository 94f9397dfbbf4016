"""The learned policy: its native FMU in the loop of Fig. 4 makes the rollout of the environment."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from auv_fmu import simulate
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from support.examples import EXAMPLES
from support.markdown import DOCS, blocks

onnx, gymnasium = pytest.importorskip("onnx"), pytest.importorskip("gymnasium")

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

ID = "orchestrator.bridges.gymnasium:auv_fmu/Tracking-v0"

#: Length of the rollout [s].
END = 30.0


def policy(path: Path):
    """The network as a function of an observation, in double precision; actions within [-1, 1]."""
    arrays = map(onnx.numpy_helper.to_array, onnx.load(path).graph.initializer)
    W1, b1, W2, b2, W3, b3 = (array.astype(float) for array in arrays)
    return lambda o: np.clip(W3 @ np.tanh(W2 @ np.tanh(W1 @ o + b1) + b2) + b3, -1.0, 1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, with the FMU of its policy."""
    folder = tmp_path_factory.mktemp("tracking")
    for name in ("policy.onnx", "tracking.toml", "compare.py"):
        shutil.copy(EXAMPLES / "tracking" / name, folder)
    made, network = str(folder / "made"), str(folder / "policy.onnx")
    assert main(["new", "component", "policy", made, "--from", network]) == 0
    assert main(["build", f"{made}/policy.py", "--kind", "native", "--out", str(folder)]) == 0
    return folder


def test_fmu_of_the_policy_repeats_the_rollout_of_the_environment(folder: Path):
    """In double precision, except for the order of sums; and it comes near to the reference."""
    env = gymnasium.make(ID, duration=END, every=1, offset=0.0, turn=0.0)
    seen, parameters = env.reset(seed=1)
    act, rollout, ended = policy(folder / "policy.onnx"), [seen], False
    while not ended:
        seen, _, _, ended, _ = env.step(act(seen))
        rollout.append(seen)
    result = simulate(folder / "tracking.toml", parameters, stop_time=END)
    names = [f"controller.o[{i}]" for i in range(1, 13)]
    assert result.group(*names) == pytest.approx(np.array(rollout), rel=0, abs=1e-9)
    assert max(result.metrics()["final_error"]) < 0.1


@pytest.mark.slow
def test_comparison_with_both_controllers_is_on_the_page(folder: Path):
    command = [sys.executable, folder / "compare.py"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    [table] = blocks(DOCS / "how-to/learn.md", "console")
    assert printed == table.text
