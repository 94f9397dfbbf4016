"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from orchestrator import bundle

# A slow machine is no error; with CI set, hypothesis also stops drawing at random.
settings.register_profile(
    "patient", settings.get_profile(settings.get_current_profile_name()), deadline=None
)
settings.load_profile("patient")


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the built bundle."""
    folder = tmp_path_factory.mktemp("dist")
    bundle.build(folder)
    return folder
