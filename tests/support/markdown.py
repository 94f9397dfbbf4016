"""Code in Markdown pages, for tests that run it."""

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
