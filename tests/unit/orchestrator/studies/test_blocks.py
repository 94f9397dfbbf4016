"""Runs made by processes of this machine, some of which die."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from itertools import count
from multiprocessing import active_children

import pytest

from orchestrator.machine import workers
from orchestrator.studies import blocks as blocks_module
from orchestrator.studies.blocks import FATAL
from orchestrator.studies.sweep import making_runs
from support.toy_engine import Toy, expected, many, numbers_and_squares, run


def test_every_run_is_made_once_by_processes_that_stay_silent(capfd):
    runs = [run(number, {"toy.talks": True}) for number in range(1000)]
    with making_runs(Toy(), many(runs), workers=2) as blocks:
        assert numbers_and_squares(blocks) == expected(runs)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_runs_are_taken_as_they_are_needed():
    """A study of any number of runs has a bounded number of them under way."""
    taken = count()
    with making_runs(Toy(0.2), many(run(next(taken)) for _ in count()), workers=2) as blocks:
        next(blocks)
        assert next(taken) < 20


@pytest.mark.slow
def test_runs_that_take_longer_than_those_before_come_in_smaller_blocks(monkeypatch):
    monkeypatch.setattr(blocks_module, "_SECONDS", 0.2)
    slow, longest = 0.05, 0.4
    runs = [run(number, {"toy.seconds": slow * (number >= 300)}) for number in range(360)]
    with making_runs(Toy(), many(runs, len(runs)), workers=2) as blocks:
        made = list(blocks)
    assert numbers_and_squares(made) == expected(runs)
    for block in made:
        assert sum(outcome.number >= 300 for outcome in block) <= longest / slow + 1


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_run():
    runs = [run(number) for number in range(200)]
    with making_runs(Toy(0.02), many(runs), workers=2) as blocks:
        first = next(blocks)
        os.kill(int(next(iter(first)).indices["process"]), signal.SIGKILL)
        assert numbers_and_squares([first, *blocks]) == expected(runs)


@pytest.mark.slow
def test_a_run_that_ends_every_process_is_the_only_one_that_fails():
    runs = [run(number, {"toy.fatal": number == 17}) for number in range(40)]
    with making_runs(Toy(), many(runs), workers=2) as blocks:
        made = {made.number: made for block in blocks for made in block}
    assert sorted(made) == [run.number for run in runs]
    assert [n for n, made in made.items() if made.failure] == [17]
    assert made[17].failure == FATAL and not made[17].indices


def interrupted_after_the_first(runs):
    with making_runs(Toy(), many(runs), workers=2) as blocks:
        for _ in blocks:
            os.kill(os.getpid(), signal.SIGINT)


def test_interrupt_ends_processes_that_are_busy():
    runs = [run(number, {"toy.seconds": 600.0 * (number > 0)}) for number in range(4)]
    with pytest.raises(KeyboardInterrupt):
        interrupted_after_the_first(runs)
    assert active_children() == []


@pytest.mark.slow
def test_script_without_a_guard_is_told_what_it_needs(tmp_path):
    """Also if the engine is longer than what a pipe holds."""
    script = tmp_path / "script.py"
    script.write_text(
        "from orchestrator.studies.sweep import making_runs\n"
        "from support.toy_engine import Toy\n"
        "with making_runs(Toy('x' * 1_000_000), [], workers=1): pass\n"
    )
    process = subprocess.run(
        [sys.executable, script],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}, capture_output=True, text=True,
        timeout=60, check=False,
    )  # fmt: skip
    assert process.returncode == 1
    assert "(a script needs `if __name__ == '__main__':`" in process.stderr.splitlines()[-1]


@pytest.mark.parametrize("name", ["x" * 150, "a:b [c] %41"])
@pytest.mark.slow
def test_temporary_folders_have_any_name(tmp_path, monkeypatch, name):
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.setattr(workers, "process_folder", lambda: folder)
    runs = [run(number) for number in range(20)]
    with making_runs(Toy(), many(runs), workers=1) as blocks:
        assert numbers_and_squares(blocks) == expected(runs)
