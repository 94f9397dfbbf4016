"""The FMUs in C under sanitizers: memory, leaks, arithmetic, threads."""

from __future__ import annotations

import subprocess
from pathlib import Path

import fmpy
import pytest

from support.sanitizers import GCC, MEMORY, THREADS, sanitize, sanitized_host
from support.settings import NAMES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(GCC is None, reason="gcc is not installed"),
]

#: Calls of a host that makes them at random, and how often it starts anew.
CALLS, SEEDS = 5_000, range(2)


def sanitized(native: Path, folder: Path, what: str = MEMORY) -> list[str]:
    """Library and resource location of every FMU, as arguments of a host."""
    arguments = []
    for name in NAMES:
        fmpy.extract(native / f"{name}.fmu", unzipdir=folder / name)
        library = sanitize(folder / name, what)
        arguments += [str(library), (folder / name / "resources").as_uri()]
    return arguments


def said_by(host: Path, *arguments: str) -> str:
    """What a host has said that has ended well."""
    # The runtime looks at how deep the stack is, which lies elsewhere for the other one.
    options = {"ASAN_OPTIONS": "allocator_may_return_null=1:detect_stack_use_after_return=0"}
    process = subprocess.run(
        [host, *arguments], env=options, capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stdout[-1000:] + process.stderr[-3000:]
    return process.stdout


@pytest.fixture(scope="module")
def fmus(native: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return sanitized(native, tmp_path_factory.mktemp("memory"))


def test_nothing_is_wrong_and_nothing_stays_of_a_run_side_by_side(fmus, tmp_path: Path):
    """With states that are saved, serialised, restored and freed."""
    assert said_by(sanitized_host("host", tmp_path), *fmus).endswith(
        f"{len(NAMES)} FMUs, 1000 steps each\n"
    )


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_wrong_whatever_a_host_calls(fmus: list[str], tmp_path: Path, name: str):
    """Right and wrong calls in any order."""
    place = 2 * NAMES.index(name)
    host = sanitized_host("random_calls", tmp_path)
    for seed in SEEDS:
        assert "fatal 0," in said_by(host, *fmus[place : place + 2], str(seed), str(CALLS))


def test_nothing_stays_of_a_logger_that_does_not_come_back(fmus: list[str], tmp_path: Path):
    assert said_by(sanitized_host("leaving", tmp_path), *fmus[:2]) == "left 52 times\n"


def test_threads_do_not_touch_the_same(native: Path, tmp_path: Path):
    """Each FMU in a thread, and each library in four."""
    fmus, host = sanitized(native, tmp_path, THREADS), sanitized_host("threads", tmp_path, THREADS)
    assert said_by(host, *fmus) == f"{len(NAMES)} threads\n"
    for place in range(0, len(fmus), 2):
        assert said_by(host, *fmus[place : place + 2] * 4) == "4 threads\n"
