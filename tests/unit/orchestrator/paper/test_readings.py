"""The readings in short are those of the documentation."""

import re
from pathlib import Path

from orchestrator.paper.readings import READINGS, linked, section

PAGE = Path(__file__).parents[4] / "docs" / "readings.md"


def test_every_reading_is_there_by_its_heading():
    text = PAGE.read_text(encoding="utf-8")
    documented = re.findall(r"^(\d+)\. \*\*(.+?)\*\*", text, re.MULTILINE)
    assert [(int(number), heading) for number, heading in documented] == [
        (number, heading) for number, (heading, _) in READINGS.items()
    ]


def test_mentions_lead_to_their_sections():
    assert linked("see reading 6)") == "see reading [6](#reading-6))"
    assert linked("Readings 1 to 3, 7.") == (
        "Readings [1](#reading-1) to [3](#reading-3), [7](#reading-7)."
    )


def test_what_is_no_mention_stays():
    for text in ("#### Reading 6", "reading 99 is none", "readings of 3 sensors", "6 readings"):
        assert linked(text) == text
    assert linked(section()) == section()
