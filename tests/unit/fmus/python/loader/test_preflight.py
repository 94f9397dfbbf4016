"""The checks before an instance is made, on folders without a library."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fmus.python.loader.preflight import refusal

SCRIPT = "preflighted"
SLAVE = "class Fmi2Slave: pass\nclass Slave(Fmi2Slave): pass\n"
GUID = "{01234567abcdef}"


@pytest.fixture
def resources(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "slavemodule.txt").write_text(SCRIPT)
    (tmp_path / "guid.txt").write_text(GUID)
    (tmp_path / f"{SCRIPT}.py").write_text(SLAVE)
    before = list(sys.path)
    yield tmp_path
    sys.modules.pop(SCRIPT, None)
    assert sys.path == before


@pytest.mark.parametrize("guid", ["", GUID, GUID.strip("{}"), GUID.upper(), "01234567ABCDEF"])
def test_sound_folder_is_sound_again(resources: Path, guid: str):
    assert [refusal(str(resources), guid) for _ in range(3)] == ["", "", ""]


def test_wrong_guid_is_refused_whenever_it_comes(resources: Path):
    for _ in range(2):
        assert "does not match this FMU's" in refusal(str(resources), "{89abcdef}")
        assert refusal(str(resources), GUID) == ""


@pytest.mark.parametrize("name", ["slavemodule.txt", "guid.txt", f"{SCRIPT}.py"])
def test_folder_that_has_changed_is_looked_at_again(resources: Path, name: str):
    assert refusal(str(resources), "") == ""
    (resources / name).unlink()
    assert name in refusal(str(resources), "")


def test_text_that_has_changed_is_another_module(resources: Path):
    assert refusal(str(resources), "") == ""
    (resources / f"{SCRIPT}.py").write_text(SLAVE + "x = 1\n")
    assert "another module" in refusal(str(resources), "")


def test_copy_of_a_folder_that_is_gone_is_the_same_module(resources: Path, tmp_path: Path):
    """Hosts unpack an FMU again and again, and remove what they have unpacked."""
    first = tmp_path / "first"
    first.mkdir()
    for path in list(resources.glob("*.*")):
        (first / path.name).write_bytes(path.read_bytes())
    assert refusal(str(first), "") == ""
    for path in first.glob("*.*"):
        path.unlink()
    assert refusal(str(resources), "") == ""


def test_words_of_an_exception_are_one_line_that_can_be_encoded(resources: Path):
    (resources / f"{SCRIPT}.py").write_text("raise ValueError('a\\n\\udcff')")
    assert refusal(str(resources), "") == "ValueError: a ?"
    assert SCRIPT not in sys.modules
