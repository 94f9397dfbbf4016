"""docs/ready-studies.md: as the studies' files say, with a picture for each figure and no other."""

from __future__ import annotations

import re

from orchestrator.studies.ready_page import PICTURES, ready_page
from support.markdown import DOCS

PAGE = DOCS / "ready-studies.md"


def test_page_is_what_the_files_say():
    assert ready_page() == PAGE.read_text(encoding="utf-8"), "run `auv-fmu docs`"


def test_every_picture_is_on_the_page_and_small():
    named = set(re.findall(r"\((images/[^)]+)\)", PAGE.read_text(encoding="utf-8")))
    files = [*(DOCS / PICTURES).iterdir()]
    assert named == {file.relative_to(DOCS).as_posix() for file in files}
    assert all(file.stat().st_size < 150_000 for file in files)
