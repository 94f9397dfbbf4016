"""The bundle is written if it is missing or outdated, and never over files of the user."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.machine import cache
from orchestrator.machine.errors import InputError
from orchestrator.runs import bundle
from orchestrator.runs.bundle import CATEGORY, build_bundle, current_fmus, key_of, settings_of


@pytest.fixture
def folder(dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bundle, and a build that finds its FMUs up to date."""
    monkeypatch.setattr(bundle, "run_fmus", lambda module, folder, *options, hear: [])
    return shutil.copytree(dist, tmp_path / "bundle")


def test_files_that_are_up_to_date_are_not_written_again(folder: Path):
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert build_bundle(folder) == []
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before


def test_a_missing_file_is_written(folder: Path):
    whole = (folder / "auv.ssp").read_bytes()
    (folder / "auv.ssp").unlink()
    assert build_bundle(folder) == [folder / "auv.ssp"]
    assert (folder / "auv.ssp").read_bytes() == whole


def test_a_changed_file_is_the_users(folder: Path):
    (folder / "SHA256SUMS").write_text("mine")
    with pytest.raises(InputError, match="SHA256SUMS"):
        build_bundle(folder)
    assert (folder / "SHA256SUMS").read_text() == "mine"
    assert build_bundle(folder, force=True) == [folder / "SHA256SUMS"]
    assert "mine" in {path.read_bytes().decode("latin-1") for path in folder.iterdir()}


def test_checksums_are_of_all_fmus_and_the_ssp(dist: Path):
    sums = dict(line.split()[::-1] for line in (dist / "SHA256SUMS").read_text().splitlines())
    assert sums.keys() == {path.name for path in (*dist.glob("*.fmu"), dist / "auv.ssp")}
    for name, digest in sums.items():
        assert hashlib.sha256((dist / name).read_bytes()).hexdigest() == digest
    assert settings_of(dist)["kind"] == "python"


def test_a_build_that_fails_leaves_the_earlier_files(folder: Path, monkeypatch: pytest.MonkeyPatch):
    def fails(*_: object, hear: object) -> None:
        raise InputError("no compiler")

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    monkeypatch.setattr(bundle, "run_fmus", fails)
    with pytest.raises(InputError, match="no compiler"):
        build_bundle(folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_runs_share_the_fmus_of_a_kind():
    assert current_fmus("native") == current_fmus("native", "2")
    assert {path.suffix for path in current_fmus().iterdir()} == {".fmu", ".json"}
    with pytest.raises(InputError, match="'c'"):
        current_fmus("c")


@pytest.fixture
def builds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Kinds that are built, with a compiler and an empty cache."""
    built = []

    def run_fmus(module: str, folder: Path, *options: str, hear: Callable[[str], None]) -> None:
        built.append(options[1])
        hear("building 12 FMUs")
        hear("AuvPlant for linux64, FMI 2.0")
        (folder / "build.json").write_text(json.dumps({"settings": {"kind": options[1]}}))

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(bundle, "current_fmus", current_fmus.__wrapped__)
    monkeypatch.setattr(bundle, "run_fmus", run_fmus)
    monkeypatch.setattr(bundle, "compiler_for", lambda _: None)
    return built


def none(_: object) -> None:
    raise OSError("there is no C compiler")


def auto() -> str:
    return settings_of(bundle.current_fmus())["kind"]


def test_auto_builds_native_with_a_compiler_and_takes_it_afterwards_without(
    builds, monkeypatch, caplog
):
    caplog.set_level("INFO", "auv_fmu")
    assert (auto(), builds) == ("native", ["native"])
    assert caplog.messages == ["building 12 FMUs (only once) ..."]
    monkeypatch.setattr(bundle, "compiler_for", none)
    assert (auto(), builds) == ("native", ["native"])


def test_auto_is_python_without_a_compiler(builds, monkeypatch):
    monkeypatch.setattr(bundle, "compiler_for", none)
    assert (auto(), builds) == ("python", ["python"])


def test_auto_is_python_with_a_compiler_that_fails_and_says_so(builds, monkeypatch):
    build = bundle.run_fmus

    def fails(module: str, folder: Path, *options: str, hear: Callable[[str], None]) -> None:
        if "native" in options:
            raise InputError("cc makes no AuvPlant")
        build(module, folder, *options, hear=hear)

    monkeypatch.setattr(bundle, "run_fmus", fails)
    with pytest.warns(UserWarning, match="Python kind .* because cc makes no AuvPlant") as warnings:
        assert auto() == "python"
    assert len(warnings) == 1


def test_fmus_that_came_with_the_installation_are_taken_if_they_fit_it(
    builds, tmp_path, monkeypatch
):
    monkeypatch.setattr(cache, "_READY", tmp_path / "ready")
    folder = tmp_path / "ready" / CATEGORY / key_of("native", "2")
    folder.mkdir(parents=True)
    (folder / "build.json").write_text('{"settings": {"kind": "native"}}')
    assert (bundle.current_fmus(), builds) == (folder, [])
    folder.rename(folder.with_name("0"))
    assert bundle.current_fmus() != folder
    assert builds == ["native"]
