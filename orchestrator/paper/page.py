"""Markdown of the report: numbers, tables, pages of docs/ in it, and the HTML page."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import chain, count, groupby, pairwise
from operator import itemgetter
from pathlib import Path
from string import Template
from typing import NamedTuple
from urllib.parse import unquote

from markdown_it import MarkdownIt
from markdown_it.token import Token
from PIL import Image

from auv_fmu.language.quantities import TAU
from orchestrator.figures.style import printed_unit
from orchestrator.machine.mathematics import typeset

_TEMPLATE = Path(__file__).with_name("report.html")

_MARKDOWN = MarkdownIt("commonmark", {"html": False}).enable("table")

#: Folders of the pages: of an installed package, or of the repository.
_FOLDERS = Path(__file__).with_name("pages"), Path(__file__).parents[2] / "docs" / "explanation"

#: Type and tag of the token that opens a chapter.
_CHAPTER = ("heading_open", "h2")

#: Heading of the column of verdicts.
VERDICT = "verdict"

#: Anchors in the report for links to its pages; other links become text.
_ANCHORS = {"paper.md": "#what-is-wrong-in-the-paper", "readings.md": "#readings"}

#: Code, and an option in it, which lines do not divide.
_CODE, _OPTION = re.compile(r"<code>[^<]*</code>"), re.compile(r"--\w+")

_LINK = re.compile(r"\[([^\]]+)\]\(([\w./-]+\.md)(?:#[\w-]+)?\)")
_FILLED = re.compile(r"<!-- (?:filled: \w+|/) -->")
_READING = re.compile(r"^#+ Reading (\d+)$", re.MULTILINE)

#: Mentions of readings outside headings.
_MENTION = re.compile(r"(?<!# )\b[Rr]eadings? \d+(?:(?:, | to | and )\d+)*")


def numbers(values: Sequence[float]) -> str:
    """Return values as text with three digits."""
    return ", ".join(f"{value:.3g}" for value in values)


def actuator_values(values: Sequence[float], times: str = "") -> str:
    """Return values of u, q and r with their units, N or N·m, followed by a factor `times`."""
    return values_with_units(values, [f"{printed_unit(unit)}{times}" for unit in TAU.values()])


def values_with_units(values: Sequence[float], units: Iterable[str]) -> str:
    """Return values with units; equal units of neighbours are written once."""
    shared = groupby(zip(values, units, strict=True), key=itemgetter(1))
    parts = ((numbers([value for value, _ in pairs]), unit) for unit, pairs in shared)
    return "; ".join(" ".join(filter(None, part)) for part in parts)


def escape_markdown(text: str) -> str:
    """Escape the marks of Markdown in a text, and join its lines."""
    # An underscore in a name is not emphasis.
    marks = r"[\\`*{}\[\]<>#|&]|(?<![^\W_])_|_(?![^\W_])"
    return re.sub(marks, r"\\\g<0>", " ".join(text.split()))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown with cells in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(title: str, file: str) -> str:
    """Return a picture in Markdown that is a link to its file."""
    return f"[![{title}]({file})]({file})"


class Heading(NamedTuple):
    """A heading of a text.

    Attributes:
        level: 1 for the title.
        title: in Markdown.
        anchor: target of links, as GitHub names it.

    """

    level: int
    title: str
    anchor: str


def _headings(tokens: Sequence[Token]) -> Iterator[Heading]:
    """Yield the headings among tokens, and set their anchors."""
    seen: Counter[str] = Counter()
    for token, inline in pairwise(tokens):
        if token.type == "heading_open":
            words = "".join(part.content for part in inline.children or ())
            anchor = re.sub(r"[^\w -]", "", words.lower()).replace(" ", "-")
            seen[anchor] += 1
            if seen[anchor] > 1:
                anchor += f"-{seen[anchor] - 1}"
            token.attrSet("id", anchor)
            yield Heading(int(token.tag[1:]), inline.content, anchor)


def contents(text: str) -> str:
    """Return links to the headings of a text of levels 2 and 3."""
    return "\n".join(
        f"{'  ' * (heading.level - 2)}- [{heading.title}](#{heading.anchor})"
        for heading in _headings(_MARKDOWN.parse(text))
        if 1 < heading.level <= 3
    )


def html(text: str, folder: Path) -> str:
    """Return a text in Markdown as an HTML page with the pictures of a folder embedded.

    Links to the headings are folded, above the first heading of level 2.
    """
    tokens = _MARKDOWN.parse(text)
    [title, *_] = _headings(tokens)
    _embed_pictures(tokens, folder)
    _label_cells(tokens)
    chapters = (i for i, token in enumerate(tokens) if (token.type, token.tag) == _CHAPTER)
    first = next(chapters, len(tokens))
    start, body = (
        typeset(_MARKDOWN.renderer.render(part, _MARKDOWN.options, {}))
        for part in (tokens[:first], tokens[first:])
    )
    body = _CODE.sub(lambda code: _OPTION.sub(r"<span>\g<0></span>", code[0]), body)
    links = typeset(_MARKDOWN.render(contents(text)))
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=title.title, start=start, contents=links, body=body
    )


def _label_cells(tokens: Sequence[Token]) -> None:
    """Give each cell the heading of its column, for narrow screens, and a verdict its colour."""
    header: list[str] = []
    column = count()
    for token, inline in pairwise(tokens):
        if token.type == "thead_open":
            header = []
        elif token.type == "tr_open":
            column = count()
        elif token.type == "th_open":
            header.append("".join(part.content for part in inline.children or ()))
        elif token.type == "td_open":
            name = header[next(column)]
            token.attrSet("data-label", name)
            if name == VERDICT and (kind := re.match(r"agrees|\*\*", inline.content)):
                token.attrSet("class", "agrees" if kind[0] == "agrees" else "differs")


def _embed_pictures(tokens: Sequence[Token], folder: Path) -> None:
    """Embed the pictures of a folder; any other picture is replaced by its title."""
    for part in chain.from_iterable(token.children or () for token in tokens):
        if part.type == "image":
            file = (folder / unquote(str(part.attrGet("src")))).resolve()
            if file.is_relative_to(folder.resolve()) and file.is_file():
                content = base64.b64encode(file.read_bytes()).decode()
                with Image.open(file) as opened:
                    # Links to headings below lead there before the picture is drawn.
                    size = {"width": opened.width, "height": opened.height}
                part.attrs |= {"loading": "lazy", "src": f"data:image/png;base64,{content}", **size}
            else:
                part.type = "text"


def without_pictures(text: str) -> str:
    """Return Markdown of a user with pictures and HTML as text, since viewers would fetch them."""
    return text.replace("<", "&lt;").replace("![", "&#33;[")


def errata() -> str:
    """Return the errors of the paper in Markdown, with headings of levels 3 and 4."""
    _, _, text = _page_of_docs("paper.md").partition("\n")
    points, _, _ = text.partition("\n## The theorem in numbers\n")
    return _deeper(points, 1)


def readings() -> str:
    """Return the readings in Markdown, each with a heading of level 3."""
    _, first, text = _page_of_docs("readings.md").partition("\n## ")
    return _deeper(first + text, 1)


def linked(text: str) -> str:
    """Return Markdown with a link to its section for every mention of a reading."""
    known = _READING.findall(_page_of_docs("readings.md"))

    def link(number: re.Match[str]) -> str:
        return f"[{number[0]}](#reading-{number[0]})" if number[0] in known else number[0]

    return _MENTION.sub(lambda mention: re.sub(r"\d+", link, mention[0]), text)


@cache
def _page_of_docs(name: str) -> str:
    """Return a page without marks of filled parts, and without links to pages not in the report."""
    folder = next(folder for folder in _FOLDERS if (folder / name).is_file())
    text = _FILLED.sub("", (folder / name).read_text(encoding="utf-8"))
    return _LINK.sub(_local, text)


def _local(link: re.Match[str]) -> str:
    text, page = link.groups()
    return f"[{text}]({_ANCHORS[page]})" if page in _ANCHORS else text


def _deeper(text: str, levels: int) -> str:
    return re.sub("^(?=#)", levels * "#", text.strip(), flags=re.MULTILINE)
