"""A trained network in place of the controller, made as its script says."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from support.examples import EXAMPLES


@pytest.mark.slow
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_network_finds_the_helix_of_fig_4(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Within 20 cm and the limits."""
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(EXAMPLES / "policy/policy.toml", "policy.toml")
    # Several threads for such small matrices only wait for each other.
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    train = [sys.executable, EXAMPLES / "policy/train.py"]
    subprocess.run(train, env=environment, check=True)
    assert main(["new", "component", "policy", "--from", "policy.npz"]) == 0
    assert main(["build", "policy/policy.py", "--kind", "native", "--out", "."]) == 0
    assert main(["run", "policy.toml", "--no-figures", "--out", "results"]) == 0
    metrics = json.loads(Path("results/metrics.json").read_text())
    assert max(metrics["final_error"]) < 0.2
    assert metrics["saturated_fraction"] == [0.0, 0.0, 0.0]
