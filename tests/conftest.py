"""Fixtures shared by all tests."""

from __future__ import annotations

import logging
import os
import re
import shutil
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from hypothesis import Phase, settings
from platformdirs import user_cache_path

from fmus.kinds import FMI_VERSIONS, NATIVE, PYTHON
from orchestrator.commands.main import main
from orchestrator.exchange.release import write_release
from orchestrator.machine.disk import hold_lock
from orchestrator.runs import bundle
from ready_wheel import write_fmus

# Slow machines pass, and the same tree gives the same result every time.
settings.register_profile("patient", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("patient")
# More of the same examples, together with the slow tests.
settings.register_profile("thorough", settings.get_profile("patient"), max_examples=200)
# New examples every time, and many.
settings.register_profile("search", deadline=None, max_examples=2000)
# For mutmut: no smaller examples once a mutant is dead.
settings.register_profile(
    "mutants",
    settings.get_profile("patient"),
    max_examples=100,
    phases=[Phase.explicit, Phase.generate],
)
# For tests/fuzz/test_keeping.py: thousands of folders, and of files with a changed bit.
settings.register_profile("attack", settings.get_profile("search"), max_examples=7150)

# Tests that a shell or nohup has started in the background ignore signals, and so do their
# children.
signal.signal(signal.SIGINT, signal.default_int_handler)
if os.name == "posix":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# A command builds FMUs first, and says so, only if no earlier test has built them.
logging.getLogger("auv_fmu").setLevel(logging.WARNING)

#: Words of a reason around the name of the missing thing.
_MISSING = re.compile(r"^(there is |there are )?no | (is|are) not installed$")

#: Key of the skipped tests in pytest's cache.
_SKIPPED = "auv-fmu/skipped"


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Note the requirements of a test."""
    for mark in item.iter_markers("skipif"):
        needed, found = _MISSING.subn("", mark.kwargs["reason"])
        item.user_properties += [("needs", needed)] * found


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests that the last run skipped, for `-m skipped`."""
    if cache := getattr(config, "cache", None):
        skipped = {*cache.get(_SKIPPED, [])}
        for item in items:
            if not skipped.isdisjoint((item.nodeid, item.location[0])):
                item.add_marker("skipped")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Report requirements of the tests that ran, and reasons for the skipped ones."""
    passed, skipped = (terminalreporter.stats.get(name, []) for name in ("passed", "skipped"))
    if cache := getattr(terminalreporter.config, "cache", None):
        nodes = sorted({report.nodeid for report in skipped})
        cache.set(_SKIPPED, nodes)
    needs = Counter(need for report in passed for _, need in report.user_properties)
    reasons = Counter(report.longrepr[2].removeprefix("Skipped: ") for report in skipped)
    for what, counter in (("ran with", needs), (f"skipped {len(skipped)}", reasons)):
        if counter:
            counts = ", ".join(f"{name} {n}" for name, n in counter.most_common())
            terminalreporter.write_line(f"{what}: {counts}")


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of this run of the tests, the same one for all workers of pytest-xdist."""
    root = tmp_path_factory.getbasetemp()
    folder = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "shared"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def _own_cache(shared: Path) -> None:
    """Keep FMUs that the tests build out of the user's cache; runs may share another one."""
    # Compiled C libraries of that compiler take minutes to make again.
    os.environ.setdefault("ZIG_GLOBAL_CACHE_DIR", str(user_cache_path("zig", appauthor=False)))
    os.environ["XDG_CACHE_HOME"] = os.environ.get("TESTS_CACHE") or str(shared / "cache")


@pytest.fixture(autouse=True)
def _same_imports() -> Iterator[None]:
    """Restore `sys.path`: later tests may import modules of the same names."""
    before = [*sys.path], [*sys.path_hooks]
    yield
    sys.path[:], sys.path_hooks[:] = before


def _copy(fmus: Path, module: str, folder: Path, *options: str, **_: object) -> None:
    """Copy FMUs instead of building them again."""
    shutil.copytree(fmus, folder, dirs_exist_ok=True)


def _built(shared: Path, kind: str, fmi: str = FMI_VERSIONS[0]) -> Path:
    """Make a bundle of the FMUs that runs take, unless another worker has done so."""
    folder = shared / f"{kind}{fmi}"
    with hold_lock(shared, wait=True), pytest.MonkeyPatch.context() as patch:
        if not folder.exists():
            fmus = bundle.current_fmus(kind, fmi)
            patch.setattr(bundle, "run_fmus", partial(_copy, fmus))
            bundle.build_bundle(folder, kind=kind, fmi=fmi)
    return folder


@pytest.fixture(scope="session")
def dist(shared: Path) -> Path:
    """A folder with the built bundle, to be read only."""
    return _built(shared, PYTHON)


@pytest.fixture(scope="session")
def native(shared: Path) -> Path:
    """A folder with the FMUs in C, to be read only."""
    return _built(shared, NATIVE)


@pytest.fixture(scope="session")
def dist3(shared: Path) -> Path:
    """A folder with the FMUs in C of FMI 3.0, to be read only."""
    return _built(shared, NATIVE, "3")


@pytest.fixture(scope="session")
def plain(shared: Path) -> Path:
    """A folder with the FMUs in Python without the native loader, to be read only."""
    folder = shared / "plain"
    with hold_lock(shared, wait=True):
        if not folder.exists():
            bundle.build_bundle(folder, loader="plain")
    return folder


@pytest.fixture(scope="session")
def ready(shared: Path) -> Path:
    """FMUs for all platforms, as a wheel carries them, which take minutes; to be read only."""
    folder = shared / "ready"
    folder.mkdir(exist_ok=True)
    with hold_lock(folder, wait=True):
        if not (folder / bundle.CATEGORY).exists():
            write_fmus(folder)
    return folder


def _copy_ready(ready: Path, module: str, folder: Path, *options: str, **_: object) -> None:
    """Copy FMUs for all platforms instead of building them again."""
    kind, fmi = (options[options.index(name) + 1] for name in ("--kind", "--fmi"))
    _copy(ready / bundle.CATEGORY / bundle.key_of(kind, fmi), module, folder)


@pytest.fixture(scope="session")
def release(shared: Path, ready: Path) -> dict[str, Path]:
    """Folders from the archives of a release, by versions of FMI; to be read only."""
    folder = shared / "release"
    folder.mkdir(exist_ok=True)
    with hold_lock(folder, wait=True), pytest.MonkeyPatch.context() as patch:
        if not (folder / "archives").exists():
            patch.setattr(bundle, "run_fmus", partial(_copy_ready, ready))
            for archive in write_release(folder / "archives", print):
                shutil.unpack_archive(archive, folder)
    return {fmi: next(folder.glob(f"auv-fmu-*-fmi{fmi}")) for fmi in FMI_VERSIONS}


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder as the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., str]:
    """A function that returns the one line with which `auv-fmu` refuses arguments."""

    def line_of(*arguments: str, status: int = 2) -> str:
        capsys.readouterr()
        before = {*tmp_path.rglob("*")}
        assert main([*arguments]) == status
        assert {*tmp_path.rglob("*")} == before
        out, line = capsys.readouterr()
        assert out == ""
        assert line.startswith("auv-fmu: ") and line.endswith("\n")
        assert line[:-1].isprintable()
        assert len(line) < 600
        return str(line)

    return line_of
