"""Environments of hosts: with a package made here, and without a package index."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator.exchange import hosts
from orchestrator.exchange.hosts import folder_of, is_whole, python_with
from orchestrator.machine.errors import InputError


@pytest.fixture(autouse=True)
def _alone(tmp_path: Path, monkeypatch):
    """Use an empty cache, and no network."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")


def wheel(folder: Path) -> str:
    """Write a package with one module."""
    path = folder / "tiny-1.0-py3-none-any.whl"
    with ZipFile(path, "w") as archive:
        archive.writestr("tiny.py", "ANSWER = 42\n")
        info = "tiny-1.0.dist-info"
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: tiny\nVersion: 1.0\n")
        tags = "Root-Is-Purelib: true\nTag: py3-none-any\n"
        archive.writestr(f"{info}/WHEEL", f"Wheel-Version: 1.0\n{tags}")
        archive.writestr(f"{info}/RECORD", "")
    return str(path)


def test_environment_is_made_once_and_again_if_it_was_not_finished(monkeypatch):
    made: list[Sequence[str]] = []

    def run(command: Sequence[str]) -> None:
        made.append(command)
        if len(made) == 2:
            raise InputError("no such package")

    monkeypatch.setattr(hosts, "_run_command", run)
    pins = ["a==1", "b==2"]
    with pytest.raises(InputError, match="no such package"):
        python_with(pins)
    assert not is_whole(folder_of(pins))
    python = python_with(pins)
    assert python_with(pins) == python
    assert is_whole(folder_of(pins))
    assert len(made) == 4
    assert "venv" in made[2] and made[2][-1] == str(folder_of(pins))
    assert made[3][0] == str(python) and [*made[3][-2:]] == pins


def test_other_packages_have_another_environment():
    assert folder_of(["a==1"]) != folder_of(["a==2"])


@pytest.mark.slow
def test_package_is_in_its_environment_only(tmp_path: Path):
    code = [python_with([wheel(tmp_path)]), "-I", "-c", "import tiny; print(tiny.ANSWER)"]
    assert subprocess.run(code, capture_output=True, check=True).stdout.strip() == b"42"
    assert find_spec("tiny") is None


@pytest.mark.slow
def test_failed_installation_is_refused_with_the_reason(monkeypatch):
    with pytest.raises(InputError, match="No matching distribution found for nothing"):
        python_with(["nothing"])
    monkeypatch.delenv("PIP_NO_INDEX")
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    with pytest.raises(InputError, match="cannot reach a package index"):
        python_with(["nothing"])
