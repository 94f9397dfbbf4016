"""Pages of docs/ that the report holds too: what is wrong in the paper, and the readings."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

#: Where the pages are: with the package that was built, or in the repository.
_FOLDERS = Path(__file__).with_name("pages"), Path(__file__).parents[2] / "docs"

#: Where links between pages lead in the report, which has no others.
_ANCHORS = {"paper.md": "#what-is-wrong-in-the-paper", "readings.md": "#readings"}

_LINK = re.compile(r"\[([^\]]+)\]\(([\w/-]+\.md)(?:#[\w-]+)?\)")
_PLACE = re.compile(r"<!-- (?:filled: \w+|/) -->")
_READING = re.compile(r"^#+ Reading (\d+)$", re.MULTILINE)

#: Mentions outside headings.
_MENTION = re.compile(r"(?<!# )\b[Rr]eadings? \d+(?:(?:, | to | and )\d+)*")


def errata() -> str:
    """What is wrong in the paper, in Markdown, with headings of the third and fourth level."""
    _, _, text = _page("paper.md").partition("\n")
    points, _, _ = text.partition("\n## The theorem in numbers\n")
    return _deeper(points, 1)


def readings() -> str:
    """The readings in Markdown, with a heading of the fourth level each."""
    _, first, text = _page("readings.md").partition("\n## ")
    return _deeper(first + text, 2)


def linked(text: str) -> str:
    """Markdown in which every mention of a reading leads to its section."""
    known = _READING.findall(_page("readings.md"))

    def link(number: re.Match[str]) -> str:
        return f"[{number[0]}](#reading-{number[0]})" if number[0] in known else number[0]

    return _MENTION.sub(lambda mention: re.sub(r"\d+", link, mention[0]), text)


@cache
def _page(name: str) -> str:
    """A page, without marks of what is filled in, and without links to pages that are elsewhere."""
    folder = next(folder for folder in _FOLDERS if (folder / name).is_file())
    text = _PLACE.sub("", (folder / name).read_text(encoding="utf-8"))
    return _LINK.sub(_local, text)


def _local(link: re.Match[str]) -> str:
    text, page = link.groups()
    return f"[{text}]({_ANCHORS[page]})" if page in _ANCHORS else text


def _deeper(text: str, levels: int) -> str:
    return re.sub("^(?=#)", levels * "#", text.strip(), flags=re.MULTILINE)
