"""The FMUs in C under sanitizers: memory, leaks, arithmetic, threads."""

from __future__ import annotations

import subprocess
from itertools import chain
from pathlib import Path

import pytest

from support.all_types import build
from support.hosts import GCC, MEMORY, THREADS, arguments_of, sanitized, sanitized_host
from support.settings import REPRESENTATIVES

pytestmark = [pytest.mark.slow, pytest.mark.skipif(GCC is None, reason="gcc is not installed")]

#: Calls of a host that makes them at random, and the seeds of its runs.
CALLS, SEEDS = 20_000, range(2)


def said_by(host: Path, *arguments: str) -> str:
    """Output of a host that has ended well."""
    options = {"ASAN_OPTIONS": "allocator_may_return_null=1"}
    process = subprocess.run(
        [host, *arguments], env=options, capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stdout[-1000:] + process.stderr[-3000:]
    return process.stdout


@pytest.fixture(params=[MEMORY])
def fmus(request: pytest.FixtureRequest, shared: Path, native: Path) -> dict[str, list[str]]:
    """Arguments of a host for each FMU."""
    return {
        name: arguments_of(sanitized(shared, native, name, request.param))
        for name in REPRESENTATIVES
    }


def test_nothing_is_wrong_and_nothing_stays_of_a_run_side_by_side(fmus, tmp_path: Path):
    """With states that are saved, serialised, restored and freed."""
    assert said_by(sanitized_host("host", tmp_path), *chain(*fmus.values())).endswith(
        f"{len(REPRESENTATIVES)} FMUs, 1000 steps each\n"
    )


@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_nothing_is_wrong_whatever_a_host_calls(fmus, tmp_path: Path, name: str):
    """Right and wrong calls in any order."""
    host = sanitized_host("random_calls", tmp_path)
    for seed in SEEDS:
        assert "fatal 0," in said_by(host, *fmus[name], str(seed), str(CALLS))


def test_nothing_is_wrong_with_ports_and_states_of_all_types(tmp_path: Path):
    all_types = arguments_of(build.sanitized(tmp_path / build.NAME))
    assert "1000 steps" in said_by(sanitized_host("host", tmp_path), *all_types)
    host = sanitized_host("random_calls", tmp_path)
    for seed in SEEDS:
        assert "fatal 0," in said_by(host, *all_types, str(seed), str(CALLS))


@pytest.mark.parametrize("fmus", [THREADS], indirect=True)
def test_threads_do_not_touch_the_same(fmus, tmp_path: Path):
    """Each FMU in a thread, and each library in four."""
    host = sanitized_host("threads", tmp_path, THREADS)
    assert said_by(host, *chain(*fmus.values())) == f"{len(REPRESENTATIVES)} threads\n"
    for arguments in fmus.values():
        assert said_by(host, *arguments * 4) == "4 threads\n"
