"""Another user of this machine can neither feed a cache, forge a result, nor reach a sweep."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp
from uuid import uuid4

import pytest

from orchestrator.cosim import loop
from orchestrator.machine.cache import read_cached, write_cached
from orchestrator.machine.disk import process_folder, sealed
from orchestrator.runs.folder import LEDGER, Ledger, Taken, is_changed, locate
from orchestrator.studies.sweep import making_runs
from support.machine import called
from support.texts import mentions
from support.toy_engine import Toy, many, outcome, run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which("useradd") is None, reason="only root makes users"
    ),
]

#: A library that leaves a mark when it is loaded.
LIBRARY = """
#include <fcntl.h>
__attribute__((constructor)) static void mark(void) { open("MARK", O_CREAT, 0600); }
int advance(void) { return 0; }
"""


@pytest.fixture(scope="module")
def other() -> Iterator[int]:
    """Another user."""
    name = f"auv-{uuid4().hex[:12]}"
    subprocess.run(["useradd", "--no-create-home", "--shell", "/bin/false", name], check=True)
    try:
        yield int(subprocess.check_output(["id", "-u", name]))
    finally:
        subprocess.run(["userdel", name], check=True, capture_output=True)


@pytest.fixture
def open_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that everybody can write into, for the cache."""
    folder = Path(mkdtemp())
    folder.chmod(0o1777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    yield folder
    shutil.rmtree(folder)


def done_by(user: int, what: Callable[[], object]) -> bool:
    """True if another user can do something, in a copy of this process."""
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setresgid(user, user, user)
            os.setresuid(user, user, user)
            what()
            os._exit(0)
        except BaseException:
            os._exit(1)
    return os.waitpid(child, 0)[1] == 0


@pytest.fixture
def planted(open_folder: Path, other: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of another user's that looks like ours; the file that its library makes."""
    mark = tmp_path / "mark"
    source = tmp_path / "planted.c"
    source.write_text(LIBRARY.replace("MARK", str(mark)))
    subprocess.run(["cc", "-shared", "-fPIC", "-o", tmp_path / "planted.so", source], check=True)
    forged = Path(mkdtemp())
    monkeypatch.setenv("XDG_CACHE_HOME", str(forged))
    write_cached("loop", loop.key_of(), {"stepper.so": (tmp_path / "planted.so").read_bytes()})
    monkeypatch.setenv("XDG_CACHE_HOME", str(open_folder))
    for path in (forged, *forged.rglob("*")):
        path.chmod(0o777)

    def plant() -> None:
        for folder in (forged / "auv-fmu").iterdir():
            shutil.copytree(folder, open_folder / "auv-fmu" / folder.name)

    # The folder was made with umask 0, or by the other user.
    (open_folder / "auv-fmu").mkdir()
    (open_folder / "auv-fmu").chmod(0o777)
    assert done_by(other, plant)
    shutil.rmtree(forged)
    return mark


@pytest.mark.parametrize("owner", ["root", "other"])
def test_files_of_another_user_in_the_cache_are_not_run(
    dist, workplace, planted, open_folder, other, owner
):
    if owner == "other":
        os.chown(open_folder / "auv-fmu", other, other)
    run = ("run", str(dist / "auv.ssp"), "--stop-time", "0.1", "--no-figures")
    status, [line] = called(*run, "--loop", "compiled")
    assert status == 0
    assert mentions(line, f"auv-fmu: warning: {open_folder / 'auv-fmu'}")
    assert not planted.exists()
    with pytest.warns(UserWarning, match="only you can write"):
        assert not read_cached("loop", loop.key_of())


def test_files_of_another_user_are_not_run_after_the_folder_is_mended(planted, open_folder):
    subprocess.run(["chmod", "-R", "go-w", open_folder / "auv-fmu"], check=True)
    for folder in (open_folder / "auv-fmu").iterdir():
        os.chown(folder, 0, 0)
    assert loop.load_stepper() is None
    assert loop.compile_stepper().advance
    assert not planted.exists()


def test_a_folder_cannot_be_made_before_us(open_folder, other):
    assert done_by(other, lambda: (open_folder / "auv-fmu").mkdir(0o755))
    with pytest.warns(UserWarning, match="only you can write"):
        [path] = write_cached("loop", "0", {"a": b""})
    assert path.is_relative_to(process_folder())


def test_a_ledger_of_another_user_is_ignored(open_folder, other):
    """In a folder that all can write, above a file of this user's with or without a ledger."""
    forged = {"ours/a": sha256(b"forged").hexdigest()}
    content = {"identity": "0" * 32, "files": forged, "moving": forged}

    def plant() -> None:
        waiting = open_folder / (".auv-fmu-" + "0" * 32) / ".earlier" / "ours"
        waiting.mkdir(parents=True)
        (waiting / "a").write_text("forged")
        (open_folder / LEDGER).write_text(sealed(content))

    file = open_folder / "ours" / "a"
    file.parent.mkdir()
    file.write_text("ours")
    assert done_by(other, plant)
    assert locate(file) == file
    assert not is_changed(file)
    with pytest.raises(Taken, match="damaged or not from auv-fmu"):
        Ledger(open_folder)
    # A folder that belongs to the other user is read as it is.
    for path in (open_folder, file.parent, file):
        os.chown(path, other, other)
    assert locate(file).read_text() == "forged"


def test_a_sweep_cannot_be_reached(other):
    psutil = pytest.importorskip("psutil", reason="needs the extra `studies`")
    this, runs = psutil.Process(), [run(number) for number in range(400)]

    def connections():
        processes = [this, *this.children(recursive=True)]
        return [each for process in processes for each in process.net_connections("all")]

    # Other tests may have left some.
    before = connections()
    with making_runs(Toy(0.001), many(runs), workers=2) as blocks:
        made = list(next(blocks))
        open_to = [each for each in connections() if each not in before]
        assert not [connection for connection in open_to if connection.status == psutil.CONN_LISTEN]
        assert not [
            connection
            for connection in open_to
            if connection.family == socket.AF_UNIX and connection.laddr
        ]
        assert not done_by(other, lambda: list(process_folder().iterdir()))
        made += [result for block in blocks for result in block]
    expected = [outcome(run).indices["square"] for run in runs]
    assert [
        result.indices["square"] for result in sorted(made, key=lambda result: result.number)
    ] == expected
