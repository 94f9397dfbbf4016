"""Archives that cannot be run as described, have forbidden entries, or are damaged."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest

from orchestrator.cosim import read_component, read_ssp
from orchestrator.machine import user_files
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError
from support.archives import component, described, system
from support.texts import mentions

STRUCTURE, DESCRIPTION = "SystemStructure.ssd", "modelDescription.xml"


def entries(archive: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(archive) as content:
        return {name: content.read(name) for name in content.namelist()}


def zipped(path: Path, content: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in content.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return path


def edited(source: Path, target: Path, name: str, old: str, new: str) -> Path:
    """A copy of an archive with one text in one of its files replaced once."""
    content = entries(source)
    text = content[name].decode()
    assert old in text
    return zipped(target, {**content, name: text.replace(old, new, 1).encode()})


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('baseStepSize="0.02"', 'baseStepSize="0_1"', "baseStepSize '0_1'"),
        ('name="controller" source', 'name="plant" source', "two plant"),
        ("resources/AuvPlant.fmu", "../AuvPlant.fmu", "'../AuvPlant.fmu'"),
        ("resources/AuvPlant.fmu", "/etc/passwd", "'/etc/passwd'"),
    ],
)  # fmt: skip
def test_ssp_that_would_not_be_run_as_it_says_is_refused(dist, tmp_path, old, new, why):
    archive = edited(dist / "auv.ssp", tmp_path / "edited.ssp", STRUCTURE, old, new)
    with pytest.raises(InputError) as error:
        read_ssp(archive)
    assert mentions(str(error.value), why) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('modelIdentifier="AuvPlant"', 'modelIdentifier="../x"', "names no library"),
        ('name="eta.y"', 'name="eta.x"', "is not unique"),
        ('fmiVersion="2.0"', 'fmiVersion="7"', "FMI 7"),
    ],
)
def test_description_that_cannot_be_meant_is_refused(dist, tmp_path, old, new, why):
    fmu = edited(dist / "AuvPlant.fmu", tmp_path / "edited.fmu", DESCRIPTION, old, new)
    with pytest.raises(InputError, match=re.escape(why)):
        read_component("plant", fmu)


def test_every_mistake_in_a_description_is_reported(dist: Path, tmp_path: Path):
    content = entries(dist / "AuvPlant.fmu")
    text = content[DESCRIPTION].decode().replace('causality="output"', 'causality="outptu"')
    fmu = zipped(tmp_path / "wrong.fmu", {**content, DESCRIPTION: text.encode()})
    with pytest.raises(InputError) as error:
        read_component("plant", fmu)
    message = str(error.value)
    assert message.count("'outptu'") >= 5
    assert re.search(r"and \d+ more lines", message)
    assert "\n" not in message
    assert len(message) < 4000


@pytest.mark.parametrize(
    "name", [STRUCTURE, f"./{STRUCTURE}", "a/../../outside", "..\\outside", "/outside"]
)
def test_archive_that_tools_unpack_differently_is_refused(dist, tmp_path, name):
    archive = tmp_path / "odd.ssp"
    with zipfile.ZipFile(archive, "w") as content:
        for entry, data in entries(dist / "auv.ssp").items():
            content.writestr(zipfile.ZipInfo(entry), data)
        with pytest.warns() if name == STRUCTURE else pytest.MonkeyPatch.context():
            content.writestr(zipfile.ZipInfo(name), b"x")
    with pytest.raises(InputError, match=r"twice|outside"):
        read_ssp(archive)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_an_entry_that_is_listed_twice_alike_is_one(dist: Path, tmp_path: Path):
    """As a folder in a Reference FMU; with different contents they are refused."""
    for second, same in ((b"same", True), (b"sama", False)):
        archive = tmp_path / f"{same}.fmu"
        with zipfile.ZipFile(archive, "w") as content:
            for entry, data in entries(dist / "AuvPlant.fmu").items():
                content.writestr(zipfile.ZipInfo(entry), data)
            for data in (b"same", second):
                content.writestr(zipfile.ZipInfo("extra/"), b"")
                content.writestr(zipfile.ZipInfo("extra/a"), data)
        if same:
            assert (read_component("plant", archive).folder / "extra" / "a").read_bytes() == b"same"
        else:
            with pytest.raises(InputError, match="twice"):
                read_component("plant", archive)


def test_bomb_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A megabyte of zeros, a thousand files, a long description, beyond lowered bounds."""
    monkeypatch.setattr(user_files, "_MOST_BYTES", 500_000)
    monkeypatch.setattr(user_files, "_MOST_FILES", 100)
    monkeypatch.setattr(user_files, "_MOST_OF_A_DESCRIPTION", 1000)
    many = {str(i): b"" for i in range(1000)}
    for content, why in (
        ({"zeros": bytes(1_000_000)}, "unpacks to more than 500,000 bytes"),
        (many, "holds 1,000 files, more than 100"),
        ({DESCRIPTION: bytes(2000)}, "is longer than 1,000 bytes"),
        ({"d/" * 2000 + "x": b""}, r"holds d/…, 2,000 folders deep, more than 100$"),
    ):
        with pytest.raises(InputError, match=why):
            user_files.unpack(zipped(tmp_path / "bomb.fmu", content))


def test_bombs_in_an_archive_are_one_bomb(dist: Path, tmp_path: Path, monkeypatch):
    """Each FMU is below the bounds by itself."""
    fmu = entries(dist / "DisturbanceGenerator.fmu")
    parts = {}
    for i in range(20):
        bomb = zipped(tmp_path / "bomb.fmu", {**fmu, "resources/zeros": bytes([i]) * 900_000})
        parts[f"resources/{i}.fmu"] = bomb.read_bytes()
    components = "".join(component(f"c{i}", f"resources/{i}.fmu") for i in range(20))
    content = {STRUCTURE: described(system(components)).encode(), **parts}
    archive = zipped(tmp_path / "bomb.ssp", content)
    size = sum(len(part) for part in content.values())
    monkeypatch.setattr(user_files, "_MOST_BYTES", size + 5_000_000)
    before = sum(path.stat().st_size for path in process_folder().rglob("*"))
    with pytest.raises(InputError) as error:
        read_ssp(archive)
    assert re.search(r"c\d: resources/\d\.fmu: ", str(error.value))
    assert str(archive) in str(error.value)
    after = sum(path.stat().st_size for path in process_folder().rglob("*"))
    assert after - before <= 2 * size + 5_000_000
    # Each archive has a bound of its own, and all of a process together have one.
    user_files.unpack(zipped(tmp_path / "alone.fmu", {"zeros": bytes(size + 4_000_000)}))
    monkeypatch.setattr(user_files, "_MOST_OF_A_PROCESS", 1000)
    with pytest.raises(
        InputError, match=r"all archives of this process to [\d,]+, more than 1,000"
    ):
        user_files.unpack(zipped(tmp_path / "more.fmu", {"a": b"x"}))


def test_archive_that_cannot_be_unpacked_leaves_nothing(dist: Path, tmp_path: Path):
    archive = zipped(tmp_path / "a.ssp", entries(dist / "auv.ssp"))
    content = bytearray(archive.read_bytes())
    at = content.find(b"PK\x03\x04", 1000) + 200
    content[at] ^= 0xFF
    archive.write_bytes(content)
    place = process_folder()
    before = {*place.iterdir()}
    with pytest.raises(InputError, match="Bad CRC-32"):
        read_ssp(archive)
    assert {*place.iterdir()} == before
