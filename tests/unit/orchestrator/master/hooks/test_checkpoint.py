"""A run that was ended and resumed has the rows of one that was not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import Experiment
from orchestrator.master.hooks.checkpoint import Checkpoints, check_gives_states, interval_in
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import planned
from orchestrator.master.simulation import simulate
from orchestrator.system.structure import System
from support.linear import SINE, Part, linear, system_of

STEP = 0.125
OURS: Mapping[str, str] = {"system": "sine"}


def parts(folder: Path, **how: bool) -> System:
    """A sine, and its integral."""
    parts = {"sine": SINE, "integral": Part(B=1.0, C=1.0)}
    return system_of(dict.fromkeys(parts, linear(folder, **how)), parts, {"integral.u0": "sine.y0"})


def run(system: System, stop_time: float, *checkpoints: Checkpoints) -> Table:
    table = Table()
    # They come first: what others are told, they can tell again.
    plan = planned(system, Experiment(stop_time, STEP))
    simulate(plan, [*checkpoints, table], hooks=checkpoints)
    return table


def test_a_resumed_run_has_the_rows_of_one_that_was_not(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    whole = run(system, 2.0)
    first = Checkpoints(folder, OURS, 0.375, resume=False)
    run(system, 1.0, first)
    assert (first.time, interval_in(folder)) == (0.75, 0.375)
    second = Checkpoints(folder, OURS, 0.375, resume=True)
    assert second.time == 0.75
    again = run(system, 2.0, second)
    np.testing.assert_array_equal(again.rows, whole.rows)
    second.remove()
    assert not folder.exists()


def test_what_is_there_is_neither_overwritten_nor_mistaken(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    run(system, 1.0, Checkpoints(folder, OURS, 0.375, resume=False))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for identity, resume, word in ((OURS, False, "0.75 s"), ({"system": "cosine"}, True, "system")):
        with pytest.raises(InputError, match=word):
            Checkpoints(folder, identity, 0.375, resume)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    forced = Checkpoints(folder, OURS, 0.375, resume=False, force=True)
    assert forced.time is None
    # What was there has another name now.
    assert {path.read_bytes() for path in folder.iterdir()} == set(before.values())


def test_a_damaged_checkpoint_is_refused_with_its_name(tmp_path: Path):
    system, folder = parts(tmp_path), tmp_path / "kept"
    run(system, 1.0, Checkpoints(folder, OURS, 0.375, resume=False))
    [state] = folder.glob("*.json")
    state.write_text(state.read_text().replace("0.75", "0.85"))
    with pytest.raises(InputError, match=state.name):
        Checkpoints(folder, OURS, 0.375, resume=True)


@pytest.mark.parametrize("every", [0.0, -1.0, np.nan, np.inf])
def test_an_interval_is_positive_and_finite(tmp_path: Path, every: float):
    with pytest.raises(InputError, match=f"{every:g} s"):
        Checkpoints(tmp_path, OURS, every, resume=False)
    assert interval_in(tmp_path) is None


def test_an_fmu_without_a_state_is_named(tmp_path: Path):
    check_gives_states(parts(tmp_path))
    with pytest.raises(InputError, match="sine"):
        check_gives_states(parts(tmp_path, can=False))
