"""Cached files are executed, so only unchanged files that no other user can write are read."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orchestrator.machine.cache import category_folder, read_cached, write_cached
from orchestrator.machine.disk import process_folder

CONTENT = {"a.so": b"library", "b": b""}

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root has other users")

#: Another user.
STRANGER = 65534


@pytest.fixture(autouse=True)
def users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that the user's cache folder is in."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def contents(files: dict[Path, bytes]) -> dict[str, bytes]:
    return {path.name: content for path, content in files.items()}


def is_refused(users: Path, culprit: Path) -> None:
    """Check that nothing is read from the user's folder, and that one warning gives the reason."""
    with pytest.warns(UserWarning, match="only you can write") as warnings:
        found = read_cached("kind", "0")
    assert not any(path.is_relative_to(users) for path in found)
    assert str(culprit) in str(warnings[0].message)
    with pytest.warns(UserWarning, match="only you can write"):
        [*paths] = write_cached("kind", "0", CONTENT)
    assert all(path.is_relative_to(process_folder()) for path in paths)


def test_kept_files_are_found_again(users):
    assert read_cached("kind", "0") == {}
    assert not users.exists()
    paths = write_cached("kind", "0", CONTENT)
    assert read_cached("kind", "0") == dict(zip(paths, CONTENT.values(), strict=True))
    assert read_cached("kind", "1") == read_cached("other", "0") == {}
    assert all(path.is_relative_to(users / "auv-fmu" / "kind") for path in paths)


@pytest.mark.parametrize("umask", [0, 0o002, 0o022, 0o077, 0o777])
def test_only_the_user_may_enter_for_any_umask(users, umask):
    before = os.umask(umask)
    try:
        write_cached("kind", "0", CONTENT)
    finally:
        os.umask(before)
    for path in (users, *users.rglob("*")):
        assert path.stat().st_mode & 0o077 == 0, path
    assert contents(read_cached("kind", "0")) == CONTENT


@pytest.mark.parametrize("mode", [0o770, 0o702, 0o777, 0o1777])
@pytest.mark.parametrize("folder", ["", "kind"])
def test_a_folder_that_others_can_write_is_not_used(users, folder, mode):
    write_cached("kind", "0", CONTENT)
    (users / "auv-fmu" / folder).chmod(mode)
    is_refused(users, users / "auv-fmu" / folder)


def test_a_folder_that_others_could_rename_is_not_used(users):
    write_cached("kind", "0", CONTENT)
    users.chmod(0o777)
    is_refused(users, users)
    # In folders such as /tmp they cannot.
    users.chmod(0o1777)
    assert contents(read_cached("kind", "0")) == CONTENT


@needs_root
@pytest.mark.parametrize("folder", [".", "auv-fmu", "auv-fmu/kind"])
def test_a_folder_of_another_user_is_not_used(users, folder):
    write_cached("kind", "0", CONTENT)
    os.chown(users / folder, STRANGER, STRANGER)
    is_refused(users, users / folder)


@needs_root
@pytest.mark.parametrize("pattern", ["auv-fmu/kind/0-*", "auv-fmu/kind/*/a.so", "**/*.json"])
@pytest.mark.parametrize("harm", ["owner", "mode"])
def test_a_file_of_another_user_is_not_used(users, pattern, harm):
    write_cached("kind", "0", CONTENT)
    [path] = users.glob(pattern)
    if harm == "owner":
        os.chown(path, STRANGER, STRANGER)
    else:
        path.chmod(0o666)
    assert read_cached("kind", "0") == {}


@pytest.mark.parametrize("folder", ["", "kind"])
def test_links_are_not_followed_out_of_it(users, tmp_path, folder):
    write_cached("kind", "0", CONTENT)
    place = users / "auv-fmu" / folder
    place.rename(tmp_path / "elsewhere")
    place.symlink_to(tmp_path / "elsewhere")
    is_refused(users, place)


def test_the_users_own_links_to_it_are_followed(users, tmp_path, monkeypatch):
    (tmp_path / "disk").mkdir(0o700)
    users.symlink_to("disk")
    write_cached("kind", "0", CONTENT)
    assert contents(read_cached("kind", "0")) == CONTENT
    assert (tmp_path / "disk" / "auv-fmu").is_dir()
    (tmp_path / "disk").chmod(0o777)
    is_refused(users, tmp_path / "disk")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(data=st.data())
def test_changed_files_are_not_found_and_stay(users, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("cache")
    os.environ["XDG_CACHE_HOME"] = str(folder)
    paths = write_cached("kind", "0", CONTENT)
    [record] = folder.rglob(".*.json")
    path = data.draw(st.sampled_from([*paths, record]))
    old = path.read_bytes()
    new = data.draw(
        st.one_of(
            st.binary(max_size=60),
            st.integers(0, max(0, len(old) - 1)).map(lambda n: old[:n]),
            st.sampled_from([b"[]", b"{}", b"[" * 9999, b'{"..": ""}', b"\0"]),
        ).filter(lambda content: content != old)
    )
    path.write_bytes(new)
    assert read_cached("kind", "0") == {}
    assert write_cached("kind", "0", CONTENT) != paths
    assert contents(read_cached("kind", "0")) == CONTENT
    assert path.read_bytes() == new


def test_digests_lead_nowhere_else(users, tmp_path):
    write_cached("kind", "0", CONTENT)
    [digests] = users.rglob(".*.json")
    content = json.loads(digests.read_text())
    (tmp_path / "a.so").write_bytes(CONTENT["a.so"])
    for name in ("../../../../a.so", str(tmp_path / "a.so")):
        assert (digests.parent / name).read_bytes() == CONTENT["a.so"]
        digests.write_text(json.dumps({name: content["a.so"]}))
        assert read_cached("kind", "0") == {}


def test_links_that_lead_to_each_other_are_reported_on_writing(users):
    users.symlink_to("other")
    users.with_name("other").symlink_to(users.name)
    assert read_cached("kind", "0") == {}
    with pytest.raises(OSError, match="symbolic links"):
        write_cached("kind", "0", CONTENT)


def test_a_fifo_does_not_block(users):
    paths = write_cached("kind", "0", CONTENT)
    paths[0].unlink()
    os.mkfifo(paths[0])
    assert read_cached("kind", "0") == {}


@pytest.mark.parametrize("variables", [{"XDG_CACHE_HOME": "cache"}, {"HOME": "home"}, {"HOME": ""}])
def test_the_current_folder_is_never_the_cache(workplace, monkeypatch, variables):
    monkeypatch.delenv("XDG_CACHE_HOME")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    code = (
        "from orchestrator.machine.cache import category_folder, read_cached\n"
        "read_cached('loop', '0')\n"
        "try: print(category_folder('loop'))\n"
        "except OSError: pass\n"
    )
    command = [sys.executable, "-W", "ignore", "-c", code]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert str(workplace) not in output
    assert not list(workplace.iterdir())


def test_a_cache_that_cannot_be_written_raises(users):
    users.write_text("")
    assert read_cached("kind", "0") == {}
    with pytest.raises(OSError, match="cache"):
        category_folder("kind")
    with pytest.raises(OSError, match="cache"):
        write_cached("kind", "0", CONTENT)
