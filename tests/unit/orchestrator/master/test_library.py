"""The compiled loop is made once, whole, and by whatever compiler there is."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.errors import InputError
from orchestrator.master import library, loop
from orchestrator.master.experiment import Experiment

#: Warnings are errors, and C is that of the standard.
STRICT = ["-Wall", "-Wextra", "-pedantic", "-Werror"]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder in which nothing is kept."""
    # What zig has made of its own takes seconds, and serves all tests.
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(Path(os.environ["XDG_CACHE_HOME"], "zig")))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "auv-fmu" / "loop"


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library.shutil, "which", lambda _: None)
    monkeypatch.setattr(library, "find_spec", lambda _: None)


needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def steps(n: int) -> Experiment:
    return Experiment(float(n), 1.0)


@needs_compiler
def test_auto_compiles_for_many_steps_and_then_takes_it_for_fewer(cache):
    assert loop.chosen("auto", steps(100)).name == "python"
    assert not cache.exists()
    assert loop.chosen("auto", steps(100_000)).name == "compiled"
    assert len(list(cache.iterdir())) == 1
    assert loop.chosen("auto", steps(100)).name == "compiled"
    assert loop.chosen("auto", steps(1)).name == "python"


def test_without_a_compiler_auto_is_silent_and_compiled_says_what_to_install(no_compiler):
    assert loop.chosen("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=r"install gcc or clang, or `pip install ziglang`$"):
        loop.chosen("compiled", steps(1))


@needs_compiler
def test_a_cache_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert loop.chosen("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=r"the loop cannot be compiled: .*/file") as error:
        loop.chosen("compiled", steps(1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("said", "heard"), [("no licence", "no licence"), (r"\377 licence", "\ufffd licence")]
)
def test_a_compiler_that_fails_is_quoted(tmp_path, cache, monkeypatch, said, heard):
    """Also where what it says is no text."""
    compiler = tmp_path / "cc"
    compiler.write_text(f"#!/bin/sh\necho first >&2\nprintf '{said}' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert loop.chosen("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=f"the loop cannot be compiled: {heard}"):
        loop.chosen("compiled", steps(1))
    assert list(cache.iterdir()) == []


@needs_compiler
@pytest.mark.parametrize("broken", [b"", b"\x7fELF nonsense"])
def test_a_library_that_was_broken_is_made_anew(cache, broken):
    cache.mkdir(parents=True)
    library._place().write_bytes(broken)
    assert library.kept() is None
    assert library.made().advance
    assert [path.stat().st_size > 1000 for path in cache.iterdir()] == [True]


@needs_compiler
def test_what_a_killed_process_has_left_goes(cache):
    (cache / ".partial-left").mkdir(parents=True)
    library.made()
    assert [path.suffix for path in cache.iterdir()] == [".so"]


@needs_compiler
def test_processes_that_compile_at_once_do_so_once(tmp_path, cache):
    (tmp_path / "cc").write_text(
        f'#!/bin/sh\necho compiled >> {tmp_path}/log\nexec {shutil.which("cc")} "$@"\n'
    )
    (tmp_path / "cc").chmod(0o755)
    code = "from orchestrator.master import library; library.made().advance"
    environment = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    processes = [
        subprocess.Popen([sys.executable, "-P", "-c", code], env=environment) for _ in range(4)
    ]
    assert [process.wait() for process in processes] == [0] * 4
    assert (tmp_path / "log").read_text() == "compiled\n"
    assert len(list(cache.iterdir())) == 1


@pytest.mark.parametrize("command", ["gcc", "clang"])
def test_compilers_have_nothing_to_say(tmp_path, command):
    if shutil.which(command) is None:
        pytest.skip(f"no {command}")
    arguments = [*library._FLAGS, *STRICT, library._SOURCE, "-o", tmp_path / "library"]
    subprocess.run([command, *arguments], check=True)


def test_zig_compiles_it_where_there_is_no_other(tmp_path, cache, monkeypatch):
    pytest.importorskip("ziglang")
    monkeypatch.setattr(library.shutil, "which", lambda _: None)
    with pytest.raises(InputError):
        library.made(in_no_time=True)
    assert library.made().advance
    assert library.kept() is not None
