"""Check the English of the pages: words to avoid, and how long the sentences are.

`python tools/prose.py` reads all pages, the Markdown of notebooks, the docstrings of the public
names of `orchestrator`, the messages in its code and the text of the live page.
`python tools/prose.py PATH...` reads some pages, or all in a folder. It prints a line for each
finding, with the words to write instead. Then it prints the lengths of the sentences of each page,
in words. It fails if there is a finding, or an average above 20 words.

The words are in `tools/prose.toml`; others come from proselint, which the extra `dev` installs.
Code, the targets of links and comments are not read. Lengths are of whole sentences in paragraphs
and lists; headings, cells of tables and other items of lists are read for their words only.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cache
from inspect import getdoc
from itertools import accumulate
from pathlib import Path
from statistics import mean
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.token import Token
from proselint.checks import __register__ as library_checks
from proselint.config import DEFAULT
from proselint.registry import CheckRegistry
from proselint.tools import LintFile

import orchestrator

ROOT = Path(__file__).parents[1]

#: The words to avoid.
WORDS = Path(__file__).with_suffix(".toml")

#: The live page, without its script.
LIVE_PAGE = ROOT / "orchestrator" / "live" / "web" / "page.html"

#: How many words the sentences of a page have at most, on average.
LIMIT = 20

#: What proselint does not check: marks that Markdown has in ASCII, numbers that are no dates, and
#: what the file of words has too.
_OFF = ("annotations", "dates_times", "typography", "weasel_words")

#: What stands for code within a sentence.
_CODE = "`…`"

#: What keeps blocks apart where they are read as one text: no rule passes over it.
_BETWEEN = "\n\n¶\n\n"

_MARKDOWN = MarkdownIt("commonmark").enable("table")

#: Where sentences end, the end of an item that is one, and what has a full stop within one.
_END = re.compile(
    r"""[.!?]["')\]]*\s+(?=["'(\[]*(?:[A-Z0-9`§λγστε]|ecos|fmpy|libcosim|pip|theta_hat))"""
)
_SENTENCE = re.compile(r"""[.!?:]["')\]]*$""")
_ABBREVIATION = re.compile(
    r"\b(?:e\.g|i\.e|cf|vs|[Ee]qs?|[Ff]igs?|[Ss]ecs?|[Rr]efs?|Nos?|approx|resp|al)$"
)


class Block(NamedTuple):
    """A paragraph, heading, item, cell or message: its first line, and whether it is sentences."""

    line: int
    text: str
    is_prose: bool


class Page(NamedTuple):
    """A page or a module, by its path, or a public name."""

    name: str
    blocks: Sequence[Block]


class Rule(NamedTuple):
    """Words to avoid, what to write instead, and within what they are right."""

    find: re.Pattern[str]
    write: str
    unless: re.Pattern[str] | None

    def spans(self, text: str) -> Iterator[tuple[int, int]]:
        """Where a text has the words: from, to."""
        right = list(self.unless.finditer(text)) if self.unless else []
        for match in self.find.finditer(text):
            if not any(other.start() <= match.start() < other.end() for other in right):
                yield match.span()


def pages(paths: Sequence[Path]) -> Iterator[Page]:
    """The pages among some files and folders."""
    for path in paths:
        files = sorted([*path.rglob("*.md"), *path.rglob("*.ipynb")]) if path.is_dir() else [path]
        for file in files:
            text = file.read_text(encoding="utf-8")
            blocks = notebook_blocks(text) if file.suffix == ".ipynb" else markdown_blocks(text)
            name = file.relative_to(ROOT) if file.is_relative_to(ROOT) else file
            yield Page(name.as_posix(), list(blocks))


def all_pages() -> Iterator[Page]:
    """All pages of the repository, the interface in Python, and the messages of the program."""
    yield from pages([*sorted(ROOT.glob("*.md")), ROOT / "docs"])
    for name in orchestrator.__all__:
        shown = getattr(orchestrator, name)
        members = vars(shown).items() if isinstance(shown, type) else ()
        texts = [shown, *(member for key, member in members if not key.startswith("_"))]
        blocks = [Block(1, getdoc(text) or "", False) for text in texts]
        yield Page(f"orchestrator.{name}", blocks)
    for file in sorted(ROOT.glob("orchestrator/**/*.py")):
        blocks = list(message_blocks(file.read_text(encoding="utf-8")))
        yield Page(file.relative_to(ROOT).as_posix(), blocks)
    blocks = list(html_blocks(LIVE_PAGE.read_text(encoding="utf-8")))
    yield Page(LIVE_PAGE.relative_to(ROOT).as_posix(), blocks)


def html_blocks(text: str) -> Iterator[Block]:
    """The texts between the tags of a page."""
    for between in re.finditer(r">([^<>]*\w\s+\w[^<>]*)<", text):
        yield Block(1 + text.count("\n", 0, between.start(1)), between[1], False)


def message_blocks(text: str) -> Iterator[Block]:
    """The texts in a module that a user may read: errors, help, labels, and not docstrings."""
    tree = ast.parse(text)
    hidden = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            hidden |= set(map(id, node.values))
            words = "".join(
                str(part.value) if isinstance(part, ast.Constant) else _CODE for part in node.values
            )
        elif isinstance(node, ast.Constant) and id(node) not in hidden:
            words = str(node.value)
        else:
            continue
        if " " in words:
            yield Block(node.lineno, words, False)


def notebook_blocks(text: str) -> Iterator[Block]:
    """The texts in the Markdown of a notebook, by lines of the file."""
    for cell in json.loads(text)["cells"]:
        if cell["cell_type"] == "markdown" and cell["source"]:
            first = json.dumps(cell["source"][0], ensure_ascii=False)
            above = text.count("\n", 0, text.index(first))
            for block in markdown_blocks("".join(cell["source"])):
                yield block._replace(line=above + block.line)


def markdown_blocks(text: str) -> Iterator[Block]:
    """The texts of a page, by its lines."""
    line = 1
    within: list[str] = []
    for token in _MARKDOWN.parse(text):
        line = token.map[0] + 1 if token.map else line
        if token.nesting > 0:
            within.append(token.type)
        elif token.nesting < 0:
            within.pop()
        elif token.type == "inline":
            children = token.children or []
            words = spoken(children)
            is_sentence = "list_item_open" not in within or _SENTENCE.search(words) is not None
            yield Block(line, words, bool(words) and within[-1] == "paragraph_open" and is_sentence)
            alternatives = (child.content for child in children if child.type == "image")
            yield from (Block(line, alternative, False) for alternative in alternatives)


def spoken(tokens: Sequence[Token]) -> str:
    """What a reader reads of a text."""
    instead = {"code_inline": _CODE, "softbreak": "\n", "hardbreak": "\n"}
    parts = (instead.get(t.type, t.content if t.type == "text" else "") for t in tokens)
    return "".join(parts)


def sentences(text: str) -> Iterator[str]:
    """The sentences of a paragraph."""
    begin = 0
    for end in _END.finditer(text):
        if not _ABBREVIATION.search(text, begin, end.start()):
            yield text[begin : end.end()].strip()
            begin = end.end()
    yield text[begin:].strip()


def length(sentence: str) -> int:
    """How many words a sentence has."""
    return sum(word.startswith(_CODE) or any(map(str.isalnum, word)) for word in sentence.split())


@cache
def rules() -> Sequence[Rule]:
    """The words to avoid that the file lists."""
    return [
        Rule(
            pattern(rf"(?<!\w)(?:{rule['find']})(?!\w)"),
            rule["write"],
            pattern("|".join(rule["unless"])) if "unless" in rule else None,
        )
        for rule in tomllib.loads(WORDS.read_text(encoding="utf-8"))["rule"]
    ]


def pattern(text: str) -> re.Pattern[str]:
    """A regular expression in which a space is any white space."""
    return re.compile(text.replace(" ", r"\s+"), re.IGNORECASE)


def findings(page: Page) -> Iterator[str]:
    """A line for each place of a page where something else should be written."""
    text = _BETWEEN.join(block.text for block in page.blocks)
    begins = [0, *accumulate(len(block.text) + len(_BETWEEN) for block in page.blocks)]
    found = [(*span, rule.write) for rule in rules() for span in rule.spans(text)]
    for begin, end, write in sorted([*found, *library_findings(text)]):
        number = bisect_right(begins, begin) - 1
        block = page.blocks[number]
        first = begin - begins[number]
        line = block.line + block.text.count("\n", 0, first)
        quoted = quotation(block.text, first, end - begins[number])
        yield f'{page.name}:{line}: "{quoted}" -> {write}'


def library_findings(text: str) -> Iterator[tuple[int, int, str]]:
    """Where proselint finds something in a text, from and to, and what it says."""
    registry = CheckRegistry()
    if not registry.checks:
        registry.register_many(library_checks)
    selected = DEFAULT["checks"] | dict.fromkeys(_OFF, False)
    for result in LintFile("text", f"{text}\n").lint({**DEFAULT, "checks": selected}):
        # It puts a line in front.
        begin, end = (place - 1 for place in result.check_result.span)
        # It finds "for ever" in "for every".
        if not text[end - 1 : end + 1].isalpha():
            yield begin, end, result.check_result.message


def quotation(text: str, begin: int, end: int) -> str:
    """A part of a text with up to four words before it and after it."""
    before = re.search(r"(?:\S+\s+){0,4}\S*\Z", text[:begin])
    after = re.match(r"\S*(?:\s+\S+){0,4}", text[end:])
    assert before and after
    return " ".join(f"{before.group()}{text[begin:end]}{after.group()}".split())


def main() -> int:
    """Print findings and lengths; the exit status."""
    command = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    command.add_argument("path", nargs="*", type=Path, help="page or folder; default: all")
    paths = [path.resolve() for path in command.parse_args().path]
    table = [f"{'page':44} {'findings':>8} {'sentences':>9} {'average':>7} {'longest':>7}"]
    failed = False
    for page in pages(paths) if paths else all_pages():
        found = list(findings(page))
        texts = (block.text for block in page.blocks if block.is_prose)
        words = [length(sentence) for text in texts for sentence in sentences(text)]
        if words and mean(words) > LIMIT:
            found.append(f"{page.name}: {mean(words):.1f} words a sentence -> at most {LIMIT}")
        for line in found:
            print(line)
        failed |= bool(found)
        if words:
            numbers = f"{len(words):9} {mean(words):7.1f} {max(words):7}"
            table.append(f"{page.name:44} {len(found):8} {numbers}")
    print("\n".join(table))
    return failed


if __name__ == "__main__":
    sys.exit(main())
