"""Fixtures shared by all tests."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import Phase, settings
from platformdirs import user_cache_path

from orchestrator.experiments import bundle

# A slow machine is no error, and what CI checks does not change from run to run.
settings.register_profile("patient", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("patient")
# For mutmut: the same examples every time, and no smaller ones once a mutant is dead.
settings.register_profile(
    "mutants",
    settings.get_profile("patient"),
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
)
# For tests/fuzz/test_keeping.py: thousands of folders, and of files with a changed bit.
settings.register_profile("attack", settings.get_profile("patient"), max_examples=7150)

# Where a shell has started the tests in the background, or nohup has, they ignore signals, and so
# does all that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep FMUs that the tests build out of the user's cache."""
    # What that compiler has made of the C libraries takes minutes to make again.
    os.environ.setdefault("ZIG_GLOBAL_CACHE_DIR", str(user_cache_path("zig", appauthor=False)))
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the built bundle."""
    folder = tmp_path_factory.mktemp("dist")
    bundle.build(folder)
    return folder


@pytest.fixture(scope="session")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs in C."""
    folder = tmp_path_factory.mktemp("native")
    bundle.build(folder, kind="native")
    return folder


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder as the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
