"""The master runs an SSP where nothing else of this product is."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

import orchestrator
from auv_fmu import simulate

SCRIPT = """\
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
    (tmp_path / "run.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "run.py", str(native / "auv.ssp")],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    expected = simulate(native / "auv.ssp", stop_time=1.0, step=0.02).rows[-1]
    assert np.array_equal([float.fromhex(text) for text in done.stdout.split()], expected)
