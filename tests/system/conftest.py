"""What several tests of whole systems share."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.runs.wiring import closed_loop
from orchestrator.system.structure import System


@pytest.fixture(scope="session")
def system(dist: Path) -> System:
    """The closed loop, wired and with the values of Fig. 4."""
    return closed_loop(dist)
