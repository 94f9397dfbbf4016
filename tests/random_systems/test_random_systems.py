"""Random systems have the evaluator's rows; `python -m fuzz random_systems` runs thousands."""

from __future__ import annotations

import pytest

from random_systems.comparison import EQUAL, UNDECIDED, outcomes
from support.tiers import slow

#: Systems, and how many of them a test runs: tests go to several processes.
SYSTEMS, BLOCK = 40, 8
FIRST = range(0, SYSTEMS, BLOCK)


@pytest.mark.parametrize("first", [*FIRST[:1], *slow(*FIRST[1:])])
def test_every_value_of_every_row_is_the_right_one(first):
    runs = [run for seed in range(first, first + BLOCK) for run in outcomes(seed)]
    assert len([run for run in runs if run.what == EQUAL]) > 4 * BLOCK
    assert [run for run in runs if run.what not in (EQUAL, UNDECIDED)] == []
