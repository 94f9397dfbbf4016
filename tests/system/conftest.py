"""Fixtures for tests of whole systems."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from orchestrator.commands.main import main
from orchestrator.cosim import System
from orchestrator.live.assembly import live_script
from orchestrator.machine.errors import InputError
from orchestrator.runs.wiring import closed_loop


@pytest.fixture(scope="session")
def system(dist: Path) -> System:
    """The closed loop, wired and with the values of Fig. 4."""
    return closed_loop(dist)


@pytest.fixture(scope="session")
def script() -> dict[str, Path]:
    """The script of the live page; a machine without npm's registry skips what needs it."""
    try:
        return live_script()
    except InputError as error:
        if "CI" in os.environ or "npm ci: " not in str(error):
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def page(script: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The live page, as the command writes it."""
    path = tmp_path_factory.mktemp("page") / "live.html"
    assert main(["live", "--out", str(path)]) == 0
    return path
