"""Random components, a few of those that `python -m fuzz components` tries, and the benchmark's."""

from __future__ import annotations

from pathlib import Path

import pytest

from fuzz.components import difference, findings, text_of
from orchestrator.benchmark import contest
from orchestrator.machine.compilers import machines_compiler
from support.tiers import slow

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

#: Tasks of the benchmark's course.
TASKS = ("HELIX", "STEP", "PATH", "CURRENT", "SEA", "SENSOR_LOSS")


@needs_compiler
@pytest.mark.parametrize("seed", [*range(2), *slow(*range(2, 5))])
def test_what_check_passes_is_built_and_does_the_same_in_both_kinds(seed):
    assert findings(seed) == []


def test_a_seed_is_a_component():
    assert text_of(6) == text_of(6) != text_of(8)


@needs_compiler
@pytest.mark.parametrize(
    ("name", "task"),
    [("limiter", ""), *slow(("sensors", ""), *(("course", task) for task in TASKS))],
)
def test_components_of_the_benchmark_do_the_same_in_both_kinds(tmp_path: Path, name, task):
    text = (Path(contest.__file__).parent / "components" / f"{name}.py").read_text()
    script = tmp_path / f"benchmarks_{name}_{task}.py"
    script.write_text(text.replace("= Task.HELIX", f"= Task.{task}"))
    assert difference(script, tmp_path, range(100)) == ""
