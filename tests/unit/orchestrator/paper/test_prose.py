"""Mentions of readings in the report."""

import re

from orchestrator.paper.prose import linked, readings


def test_mentions_lead_to_their_sections():
    assert linked("see reading 6)") == "see reading [6](#reading-6))"
    assert linked("Readings 1 to 3, 7.") == (
        "Readings [1](#reading-1) to [3](#reading-3), [7](#reading-7)."
    )


def test_what_is_no_mention_stays():
    for text in ("#### Reading 6", "reading 99 is none", "readings of 3 sensors", "6 readings"):
        assert linked(text) == text


def test_readings_are_numbered():
    numbers = re.findall(r"^#### Reading (\d+)$", readings(), re.MULTILINE)
    assert numbers == [str(n) for n in range(1, 17)]
