"""Sources of FMUs, and contents of FMUs."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import pytest

import auv_fmu
import fmus
from fmus import build, discovery
from fmus.kinds import NATIVE
from support.settings import NAMES


def test_every_source_is_part_of_the_fingerprint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folders = {}
    for package in (auv_fmu, fmus):
        [folder] = package.__path__
        folders[package.__name__] = tmp_path / package.__name__
        shutil.copytree(
            folder, folders[package.__name__], ignore=shutil.ignore_patterns("dist", "__pycache__")
        )
    monkeypatch.setattr(discovery, "package_folder", folders.__getitem__)
    fingerprints = {discovery.fingerprint(NATIVE)}
    sources = [path for path in sorted(tmp_path.rglob("*")) if path.is_file()][::8]
    for path in sources:
        path.write_bytes(path.read_bytes() + b"\n")
        fingerprints.add(discovery.fingerprint(NATIVE))
    assert len(fingerprints) == 1 + len(sources)


@pytest.mark.parametrize("name", NAMES)
def test_fmu_contains_what_runs_in_it_and_no_more(dist: Path, name: str):
    with zipfile.ZipFile(dist / f"{name}.fmu") as archive:
        parts = [Path(entry).parts for entry in archive.namelist()]
    ours = {
        (part[1].rsplit("_", 1)[0], part[2])
        for part in parts
        if part[0] == "resources" and len(part) > 2 and not part[1].startswith("pythonfmu_")
    }
    components = {folder for package, folder in ours if package == "fmus"}
    assert len(components - {"__init__.py", "ports", "python"}) == 1
    assert {package for package, _ in ours} == {"auv_fmu", "fmus"}
    assert ours.isdisjoint({("auv_fmu", "proof"), ("auv_fmu", "loop")})


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", "null", "[" * 100_000, "\0", '{"sha256": {}}',
     '{"sha256": [], "settings": {}}', '{"sha256": {}, "settings": "other"}'],
)  # fmt: skip
def test_manifest_that_is_none_counts_as_none(tmp_path: Path, content: str):
    manifest = tmp_path / build.MANIFEST
    assert build.built_before(manifest) == {}
    manifest.write_text(content)
    assert build.built_before(manifest) == {}
