"""Runs made by real schedulers and worker processes, of which some are lost."""

from __future__ import annotations

import os
import signal
from itertools import count

import pytest

from support.toy_engine import Toy, outcome, run

pytest.importorskip("distributed", reason="needs the extra `studies`")

from dask import config

from orchestrator.studies.cluster import FATAL, making


def numbers_and_squares(blocks):
    return sorted((made.number, made.indices.get("square")) for block in blocks for made in block)


def expected(runs):
    return [(run.number, outcome(run).indices["square"]) for run in runs]


def test_every_run_is_made_once_by_processes_that_stay_silent(capfd):
    runs = [run(number, {"toy.talks": True}) for number in range(1000)]
    with making(Toy(), iter(runs), workers=2) as blocks:
        assert numbers_and_squares(blocks) == expected(runs)
    assert capfd.readouterr() == ("", "")


def test_runs_are_taken_as_they_are_needed():
    """A study of any number of runs has a bounded number of them under way."""
    taken = count()
    with making(Toy(0.2), (run(next(taken)) for _ in count()), workers=2) as blocks:
        next(blocks)
        assert next(taken) < 20


def test_a_worker_that_is_killed_costs_no_run():
    runs = [run(number) for number in range(200)]
    with making(Toy(0.02), runs, workers=2) as blocks:
        first = next(blocks)
        os.kill(int(first[0].indices["process"]), signal.SIGKILL)
        assert numbers_and_squares([first, *blocks]) == expected(runs)


def test_a_run_that_ends_every_process_is_the_only_one_that_fails():
    runs = [run(number, {"toy.fatal": number == 17}) for number in range(40)]
    with (
        config.set({"distributed.scheduler.allowed-failures": 0}),
        making(Toy(), runs, workers=2) as blocks,
    ):
        made = {made.number: made for block in blocks for made in block}
    assert sorted(made) == [run.number for run in runs]
    assert [n for n, made in made.items() if made.failure] == [17]
    assert made[17].failure == FATAL and not made[17].indices
