"""Mutated files: a few of those that `python -m fuzz files` tries."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

from fuzz import files
from support.tiers import slow

#: Files of each kind.
RUNS = 10

NAMES = (
    "description", "ssd", "scenario", "record", "table", "fmu", "ssv", "ssp", "plot", "view",
    "indices", "description3", "ssd2", "ssv2",
)  # fmt: skip


@pytest.fixture(scope="module")
def kinds() -> Iterator[dict[str, files.Kind]]:
    with files.prepared() as found:
        yield found


@pytest.mark.parametrize("name", [*NAMES[:5], *slow(*NAMES[5:])])
def test_mutated_files_are_taken_or_refused_in_one_line(kinds, name: str):
    if name not in kinds:
        pytest.skip("npm is not installed")
    for seed in range(RUNS):
        content = kinds[name].mutate(kinds[name].valid, Random(f"{name} {seed}"))
        try:
            files.attack(kinds[name], content)
        except files.Finding as finding:
            pytest.fail(f"python -m fuzz files --seed {seed} --runs 1: {name}: {finding}")


def test_all_kinds_are_tried(kinds):
    assert {*kinds} | {"view", "record", "indices"} == {*NAMES}
