"""Only what a ledger proves to be ours is replaced or removed."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine.disk import sealed, unsealed
from orchestrator.machine.file_names import file_name
from orchestrator.machine.ledger import LEDGER, RECORD, Ledger, Taken, is_changed, move_aside
from support.machine import contents


def write(folder: Path, text: str, *names: str, force: bool = False) -> Ledger:
    ledger = Ledger(folder, force)
    with ledger.changing() as unfinished:
        for name in names:
            (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (unfinished / name).write_text(text)
    return ledger


def test_what_was_written_is_replaced_and_what_was_changed_is_not(tmp_path: Path):
    write(tmp_path, "first", "a", "below/b")
    write(tmp_path, "second", "a", "below/b")
    assert contents(tmp_path) == {"a": b"second", "below/b": b"second"}
    (tmp_path / "below/b").write_text("mine")
    assert is_changed(tmp_path / "below/b")
    assert not is_changed(tmp_path / "a")
    before = contents(tmp_path)
    with pytest.raises(Taken, match=r"below/b is not a file that auv-fmu wrote, or was changed"):
        write(tmp_path, "third", "a", "below/b")
    assert contents(tmp_path) == before
    write(tmp_path, "third", "a", "below/b", force=True)
    assert contents(tmp_path) == {"a": b"third", "below/b": b"third", "below/b.~1~": b"mine"}


def test_folder_that_is_in_the_way_is_called_one(tmp_path: Path):
    (tmp_path / "a").mkdir()
    with pytest.raises(Taken, match="/a is a folder: move it"):
        write(tmp_path, "ours", "a")
    write(tmp_path, "ours", "a", force=True)
    assert (tmp_path / "a.~1~").is_dir()


def test_what_was_changed_is_not_removed(tmp_path: Path):
    ledger = write(tmp_path, "ours", "a", "b", "below/c")
    (tmp_path / "a").write_text("mine")
    ledger.remove(["a", "b", "below/c"])
    assert contents(tmp_path) == {"a": b"mine"}
    assert not (tmp_path / LEDGER).exists()


@pytest.mark.parametrize("name", ["a", "below/a"])
def test_links_lead_nowhere(tmp_path: Path, name):
    """Neither of a file nor of a folder, though there is what was written."""
    folder, elsewhere = tmp_path / "r", tmp_path / "elsewhere"
    folder.mkdir()
    write(folder, "ours", name)
    (folder / Path(name).parts[0]).rename(elsewhere)
    (folder / Path(name).parts[0]).symlink_to(elsewhere)
    before = contents(tmp_path)
    with pytest.raises(Taken):
        write(folder, "new", name)
    Ledger(folder).remove([name])
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "content",
    ["mine", "{}", "[]", '{"identity": "0", "files": {}}', sealed({"identity": "x"})],
)
def test_a_list_that_is_none_of_ours_proves_nothing(tmp_path: Path, content):
    (tmp_path / LEDGER).write_text(content)
    with pytest.raises(Taken, match="its own files are unknown"):
        Ledger(tmp_path)
    Ledger(tmp_path, force=True)
    assert (tmp_path / f"{LEDGER}.~1~").read_text() == content


@pytest.mark.parametrize("name", ["../precious", "/etc/hostname", "below/../../precious"])
@pytest.mark.parametrize("entry", ["files", "moving", "leaving"])
def test_a_forged_ledger_does_not_lead_out_of_the_folder(tmp_path: Path, name, entry):
    content = {"identity": "0" * 32, "files": {}, "moving": {}, "leaving": []}
    content[entry] = [name] if entry == "leaving" else {name: "0" * 64}
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / LEDGER).write_text(sealed(content))
    with pytest.raises(Taken, match="damaged or not from auv-fmu"):
        Ledger(tmp_path / "r")


@pytest.mark.parametrize("link", ["unfinished", "below", "file"])
def test_a_forged_ledger_moves_nothing_from_elsewhere(tmp_path: Path, link):
    """Somebody's folder may come with a ledger, and with links to files of the user's."""
    folder, elsewhere = tmp_path / "r", tmp_path / "elsewhere"
    unfinished = folder / (".auv-fmu-" + "0" * 32)
    for place in (folder, elsewhere / "below"):
        place.mkdir(parents=True)
    (elsewhere / "below" / "key").write_text("mine")
    if link == "unfinished":
        unfinished.symlink_to(elsewhere)
    elif link == "below":
        unfinished.mkdir()
        (unfinished / "below").symlink_to(elsewhere / "below")
    else:
        (unfinished / "below").mkdir(parents=True)
        (unfinished / "below" / "key").symlink_to(elsewhere / "below" / "key")
    moving = {"below/key": sha256(b"mine").hexdigest()}
    content = {"identity": "0" * 32, "files": {}, "moving": moving, "leaving": []}
    (folder / LEDGER).write_text(sealed(content))
    with suppress(OSError):
        write(folder, "ours", "a")
    assert (elsewhere / "below" / "key").read_text() == "mine"
    assert not (folder / "below" / "key").exists()


def test_no_link_is_written_through(tmp_path: Path):
    """The token of a ledger that somebody brings is known to that somebody."""
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "r").mkdir()
    content = {"identity": "0" * 32, "files": {}, "moving": {}, "leaving": []}
    (tmp_path / "r" / LEDGER).write_text(sealed(content))
    (tmp_path / "r" / (".auv-fmu-" + "0" * 32 + ".json")).symlink_to("../precious")
    write(tmp_path / "r", "ours", "a")
    assert (tmp_path / "precious").read_text() == "mine"
    assert (tmp_path / "r" / "a").read_text() == "ours"


@pytest.mark.parametrize("when", range(8))
@pytest.mark.parametrize("kept", [["a", RECORD], ["a", "b", "below/c", "new", RECORD]])
def test_files_that_cannot_take_their_places_leave_all_as_it_was(tmp_path, monkeypatch, kept, when):
    """Whichever rename fails; and the next one succeeds."""
    write(tmp_path, "first", "a", "b", "below/c", RECORD)
    before, replace, calls = contents(tmp_path), Path.replace, iter(range(99))

    def failing(path: Path, target: Path) -> Path:
        if target.name != LEDGER and next(calls) == when:
            raise PermissionError(1, "Operation not permitted", str(path))
        return replace(path, target)

    def publish(text: str) -> None:
        ledger = Ledger(tmp_path)
        with ledger.writing() as unfinished:
            for name in kept:
                (unfinished / name).parent.mkdir(exist_ok=True)
                (unfinished / name).write_text(text)
            ledger.publish(["a", "b", "below/c", RECORD])

    monkeypatch.setattr(Path, "replace", failing)
    with suppress(PermissionError):
        publish("second")
        assert next(calls) <= when
    monkeypatch.setattr(Path, "replace", replace)
    assert contents(tmp_path) in (before, dict.fromkeys(kept, b"second"))
    assert not list(tmp_path.glob(".auv-fmu-*"))
    publish("third")
    assert contents(tmp_path) == dict.fromkeys(kept, b"third")


def test_a_huge_ledger_is_not_read(tmp_path: Path):
    (tmp_path / "a").write_text("mine")
    with (tmp_path / LEDGER).open("wb") as file:
        file.truncate(2**40)
    assert is_changed(tmp_path / "a")
    with pytest.raises(Taken, match="damaged or not from auv-fmu"):
        Ledger(tmp_path)


@pytest.mark.slow
def test_no_bit_of_a_ledger_is_changed_unseen(tmp_path: Path):
    write(tmp_path, "ours", "a")
    text = (tmp_path / LEDGER).read_bytes()
    for bit in range(8 * len(text)):
        changed = bytearray(text)
        changed[bit // 8] ^= 1 << bit % 8
        (tmp_path / LEDGER).write_bytes(changed)
        with pytest.raises(Taken):
            Ledger(tmp_path)


def test_what_is_moved_aside_replaces_nothing(tmp_path: Path):
    for text in ("first", "second"):
        (tmp_path / "a").write_text(text)
        move_aside(tmp_path / "a")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").write_text("third")
    move_aside(tmp_path / "a")
    (tmp_path / "a").symlink_to("nowhere")
    move_aside(tmp_path / "a")
    assert contents(tmp_path) == {"a.~1~": b"first", "a.~2~": b"second", "a.~3~/b": b"third"}
    assert os.readlink(tmp_path / "a.~4~") == "nowhere"  # noqa: PTH115  # not what it leads to


names = st.one_of(
    st.text(max_size=300),
    st.sampled_from(["", ".", "..", ".git", "con", "NUL.txt", "a/b", "a\\b", "a:b", "x ", "x."]),
)


@given(names, names)
def test_names_of_anything_become_names_of_files(one, other):
    name = file_name(one)
    assert name == file_name(one)
    assert not set(name) & set('/\\:*?"<>|\0\n')
    assert not name.startswith(".")
    assert 0 < len(name.encode()) < 200
    assert (file_name(other) == name) == (other == one)
    taken = file_name(one, [name.upper(), f"{name}_"])
    assert taken.casefold() not in (name.casefold(), f"{name}_".casefold())
    assert len({file_name(text) for text in ("con", "CON", "Con.txt")} & {"con", "CON"}) == 0


def test_names_of_the_bundle_stay_as_they_are():
    for name in ("fig4", "fig5-pd", "my law (2)", "Größe_1", "v1.2+x"):
        assert file_name(name) == name


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(st.dictionaries(st.text().filter(lambda key: key != "sha256"), values))
def test_sealed_records_read_back(content):
    assert json.dumps(unsealed(sealed(content))) == json.dumps(content)
