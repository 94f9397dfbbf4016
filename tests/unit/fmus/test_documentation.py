"""The pages in the repository are those in the FMUs."""

from __future__ import annotations

from pathlib import Path

import pytest

from fmus.documentation import page
from support.settings import NAMES

PAGES = Path(__file__).parents[3] / "docs" / "components"


@pytest.mark.parametrize("name", NAMES)
def test_page_in_the_repository_is_the_one_in_the_fmu(name: str):
    assert (PAGES / f"{name}.md").read_text(encoding="utf-8") == page(name), "run: auv-fmu docs"
