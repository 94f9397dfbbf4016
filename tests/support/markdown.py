"""Code and tables in Markdown pages, for tests that run or hold them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt

DOCS = Path(__file__).parents[2] / "docs"


class Block(NamedTuple):
    """A fenced block of code: its language, and what is in it."""

    language: str
    text: str


def blocks(page: Path, *languages: str) -> list[Block]:
    """The fenced blocks of a page in some languages, in their order."""
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    return [
        Block(token.info, token.content)
        for token in tokens
        if token.type == "fence" and token.info in languages
    ]


class Section(NamedTuple):
    """A heading and the table below it, cell by cell."""

    heading: str
    header: list[str]
    rows: list[list[str]]


def sections(page: Path) -> list[Section]:
    """The sections of a page that have a table."""
    found: list[Section] = []
    heading, rows = "", []
    tokens = iter(MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8")))
    for token in tokens:
        if token.type == "heading_open":
            heading = next(tokens).content
        elif token.type == "tr_open":
            rows.append([])
        elif token.type in ("th_open", "td_open"):
            rows[-1].append(next(tokens).content)
        elif token.type == "table_close":
            found.append(Section(heading, rows[0], rows[1:]))
            rows = []
    return found
