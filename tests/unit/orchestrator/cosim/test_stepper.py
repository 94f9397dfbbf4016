"""The compiled loop is compiled once, completely, and by any compiler."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from ctypes import CDLL
from pathlib import Path

import pytest

from orchestrator.cosim import loop
from orchestrator.cosim.experiment import Experiment
from orchestrator.machine import compilers
from orchestrator.machine.cache import write_cached
from orchestrator.machine.compilers import FLAGS
from orchestrator.machine.errors import InputError
from support.machine import eventually, members
from support.tiers import slow

#: Warnings are errors, and the language is standard C.
STRICT = ["-Wall", "-Wextra", "-pedantic", "-Werror"]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder."""
    # zig compiles its own libraries for seconds; all tests share them.
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(Path(os.environ["XDG_CACHE_HOME"], "zig")))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "auv-fmu" / "loop"


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(compilers, "find_spec", lambda _: None)


needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def steps(n: int) -> Experiment:
    return Experiment(float(n), 1.0)


@needs_compiler
def test_auto_compiles_for_many_steps_and_then_takes_it_for_fewer(cache):
    assert loop.choose_loop("auto", steps(100)).name == "python"
    assert not cache.exists()
    assert loop.choose_loop("auto", steps(100_000)).name == "compiled"
    assert len(list(cache.iterdir())) == 1
    assert loop.choose_loop("auto", steps(100)).name == "compiled"
    assert loop.choose_loop("auto", steps(1)).name == "python"


def test_without_a_compiler_auto_is_silent_and_compiled_says_what_to_install(no_compiler):
    assert loop.choose_loop("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=r"install gcc or clang, or `pip install ziglang`$"):
        loop.choose_loop("compiled", steps(1))


@needs_compiler
def test_a_cache_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert loop.choose_loop("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=r"the loop cannot be compiled: .*/file") as error:
        loop.choose_loop("compiled", steps(1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("complaint", "quoted"), [("no licence", "no licence"), (r"\377 licence", "\ufffd licence")]
)
def test_a_compiler_that_fails_is_quoted(tmp_path, cache, monkeypatch, complaint, quoted):
    """Even if its message is not text."""
    compiler = tmp_path / "cc"
    compiler.write_text(f"#!/bin/sh\necho first >&2\nprintf '{complaint}' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert loop.choose_loop("auto", steps(100_000)).name == "python"
    with pytest.raises(InputError, match=f"the loop cannot be compiled: {quoted}"):
        loop.choose_loop("compiled", steps(1))
    assert list(cache.iterdir()) == []


@needs_compiler
@pytest.mark.parametrize("length", [3000, *slow(0, 100, -1)])
def test_a_truncated_library_is_not_loaded_but_compiled_again(cache, length, monkeypatch):
    # In another process, since this one keeps the library loaded.
    code = "from orchestrator.cosim import loop; print(loop.compile_stepper()._name)"
    [place] = map(Path, subprocess.check_output([sys.executable, "-c", code]).decode().split())
    content = place.read_bytes()
    place.write_bytes(content[:length])
    loaded = []
    monkeypatch.setattr(compilers, "CDLL", lambda path: loaded.append(path) or CDLL(path))
    assert loop.load_stepper() is None
    assert loop.compile_stepper().advance
    assert loaded and str(place) not in loaded
    # A file that is not ours is not overwritten.
    assert place.read_bytes() == content[:length]


@needs_compiler
def test_a_library_without_the_function_is_not_loaded(cache, tmp_path):
    source = tmp_path / "other.c"
    source.write_text("int other(void) { return 0; }")
    other = tmp_path / "other.so"
    subprocess.run(["cc", "-shared", "-o", other, source], check=True)
    write_cached("loop", loop.key_of(), {"stepper.so": other.read_bytes()})
    assert loop.load_stepper() is None
    assert loop.compile_stepper().advance


@needs_compiler
def test_what_others_have_in_the_cache_stays(cache):
    own = [cache / ".partial-mine" / "notes", cache / "stepper.so", cache / "thesis.tex"]
    for path in own:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.write_text("mine")
    loop.compile_stepper()
    assert [path.read_text() for path in own] == ["mine"] * 3


@pytest.mark.parametrize("script", ["sleep 1000", *slow("exec sleep 1000", "sleep 1000 >&- 2>&-")])
def test_a_compiler_that_hangs_is_ended_with_its_children(tmp_path, monkeypatch, script):
    compiler = tmp_path / "cc"
    compiler.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/session\n{script}\necho\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr("orchestrator.machine.compilers._LIMIT", 0.5)
    with pytest.raises(InputError, match=r"cannot be compiled: .*/cc has not ended after 0\.5 s$"):
        loop.compile_stepper()
    session = int((tmp_path / "session").read_text())
    assert eventually(lambda: not members(session))


@needs_compiler
@pytest.mark.slow
def test_processes_that_compile_at_once_do_so_once(tmp_path, cache):
    (tmp_path / "cc").write_text(
        f'#!/bin/sh\necho compiled >> {tmp_path}/log\nexec {shutil.which("cc")} "$@"\n'
    )
    (tmp_path / "cc").chmod(0o755)
    code = "from orchestrator.cosim import loop; loop.compile_stepper().advance"
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
        pytest.skip(f"{command} is not installed")
    arguments = [*FLAGS, *STRICT, loop.SOURCE, "-o", tmp_path / "library"]
    subprocess.run([command, *arguments], check=True)


@pytest.mark.slow
def test_zig_compiles_it_where_there_is_no_other(tmp_path, cache, monkeypatch):
    pytest.importorskip("ziglang", reason="ziglang is not installed")
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(InputError):
        loop.compile_stepper(in_no_time=True)
    assert loop.compile_stepper().advance
    assert loop.load_stepper() is not None
