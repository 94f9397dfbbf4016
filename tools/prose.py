"""Check the English of pages and of code: words to avoid, openings, lengths of sentences.

`python tools/prose.py` reads all pages, the Markdown of notebooks, the text of the live page, and
the docstrings, comments, messages and test names of all code. `python tools/prose.py PATH...` reads
some files, or all in a folder. It prints a line for each finding, with the words to write instead.
Then it prints the lengths of the sentences of each page, in words. It fails if there is a finding,
or an average above 20 words.

The words are in `tools/prose.toml`; others come from proselint, which the extra `dev` installs.
Code within texts and the targets of links are not read. Lengths are of whole sentences in
paragraphs and lists of pages; everything else is read for its words only.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
import tokenize
import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cache
from inspect import cleandoc
from io import StringIO
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

ROOT = Path(__file__).parents[1]

#: The words to avoid.
WORDS = Path(__file__).with_suffix(".toml")

#: Folders of code, and those in which texts are read that a user may see.
CODE = ("benchmarks", "examples", "fmus", "orchestrator", "src", "tests", "tools")
PRODUCT = ("fmus", "orchestrator", "src")

#: Largest average number of words in the sentences of a page.
LIMIT = 20

#: Checks of proselint that are off: about ASCII marks, which Markdown needs, about dates, which it
#: sees in other numbers, and about words of our own list.
_OFF = ("annotations", "dates_times", "typography", "weasel_words")

#: Stands for code within a sentence.
_CODE = "`…`"

#: Separates blocks that are checked as one text: no rule matches across it.
_BETWEEN = "\n\n¶\n\n"

_MARKDOWN = MarkdownIt("commonmark").enable("table")

#: Ends of sentences, the end of an item that is one, and abbreviations with a full stop.
_END = re.compile(
    r"""[.!?]["')\]]*\s+(?=["'(\[$]*(?:[A-Z0-9`§λγστε]|ecos|fmpy|libcosim|pip|theta_hat))"""
)
_SENTENCE = re.compile(r"""[.!?:]["')\]]*$""")
_ABBREVIATION = re.compile(
    r"\b(?:e\.g|i\.e|cf|vs|[Ee]qs?|[Ff]igs?|[Ss]ecs?|[Rr]efs?|Nos?|approx|resp|al)$"
)


#: Parts of a docstring that are not prose: code in backquotes, and examples.
_INLINE = re.compile(
    r"(?::\w+:)?``?[^`]+``?(?:__?)?|^ *>>> .*$|^( +)\.\. math::.*\n(?:\1 +.*\n|\n)*", re.M
)
_INDENTED = re.compile(
    r"(?<=::\n)(?:\n| {4}.*(?:\n|\Z))+|(?:(?<=\n\n) {4}.*(?:\n|\Z))(?: {4}.*(?:\n|\Z)|\n)*"
)

#: Comments for tools.
_ORDER = re.compile(r"!|fmt:|noqa|type:|pragma|mypy:|clang-format|eslint|@ts-|prettier")

#: Comments in C and TypeScript, and strings, which may contain their signs.
_C_COMMENT = re.compile(
    r'"(?:\\.|[^"\\\n])*"|/\*(?P<block>.*?)\*/|(?<!:)//(?P<line>[^\n]*(?:\n[ \t]*//[^\n]*)*)', re.S
)


class Block(NamedTuple):
    """A paragraph, heading, item, cell, docstring, comment or message."""

    line: int
    text: str
    #: True if its sentences are counted.
    is_prose: bool
    #: True if it describes code.
    is_inside: bool = False
    #: True for a value in code, which may be shown to a user.
    is_message: bool = False


class Page(NamedTuple):
    """A page or a module, by its path, or a public name."""

    name: str
    blocks: Sequence[Block]


class Rule(NamedTuple):
    """Words to avoid, words to write instead, and texts within which they are right."""

    find: re.Pattern[str]
    write: str
    unless: re.Pattern[str] | None
    #: True if the words are avoided only at the beginning of docstrings and comments.
    opens: bool

    def spans(self, text: str) -> Iterator[tuple[int, int]]:
        """Places of the words in a text: from, to."""
        right = list(self.unless.finditer(text)) if self.unless else []
        for match in self.find.finditer(text):
            if not any(other.start() <= match.start() < other.end() for other in right):
                yield match.span()


def pages(paths: Sequence[Path]) -> Iterator[Page]:
    """Yield the pages and modules among some files and folders."""
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if (read := READERS.get(file.suffix)) and not _FOREIGN.intersection(file.parts):
                name = file.relative_to(ROOT) if file.is_relative_to(ROOT) else file
                blocks = read(file.read_text(encoding="utf-8"))
                is_product = name.parts[0] in PRODUCT
                yield Page(name.as_posix(), [b for b in blocks if is_product or not b.is_message])


def all_pages() -> Iterator[Page]:
    """Yield all pages and modules of the repository."""
    yield from pages(sorted(ROOT.glob("*.md")))
    yield from pages([ROOT / folder for folder in ("docs", *CODE)])


def html_blocks(text: str) -> Iterator[Block]:
    """Yield the texts between the tags of a page, without styles and scripts."""
    for within in (r"<style.*?</style>", r"<script.*?</script>"):
        text = re.sub(within, lambda code: "\n" * code[0].count("\n"), text, flags=re.DOTALL)
    for between in re.finditer(r">([^<>]*\w\s+\w[^<>]*)<", text):
        yield Block(1 + text.count("\n", 0, between.start(1)), between[1], False)


def python_blocks(text: str) -> Iterator[Block]:
    """Yield the docstrings, comments, messages and names of tests of a module."""
    tree = ast.parse(text)
    hidden = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield Block(node.lineno, node.name.removeprefix("test_").replace("_", " "), False)
        if isinstance(node, ast.JoinedStr):
            hidden |= set(map(id, node.values))
            words = "".join(
                str(part.value) if isinstance(part, ast.Constant) else _CODE for part in node.values
            )
        elif isinstance(node, ast.Constant) and id(node) not in hidden:
            words = str(node.value)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            if isinstance(node.value.value, str):
                yield Block(node.lineno, without_code(node.value.value), False, is_inside=True)
            continue
        else:
            continue
        if " " in words:
            yield Block(node.lineno, words, False, is_message=True)
    yield from comment_blocks(text)


def comment_blocks(text: str) -> Iterator[Block]:
    """Yield the comments of a module, those on lines that follow each other as one."""
    comments: list[tuple[int, list[str]]] = []
    for token in tokenize.generate_tokens(StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line, words = token.start[0], token.string.lstrip("#: ")
            is_whole_line = token.line.lstrip().startswith("#")
            if comments and is_whole_line and line == comments[-1][0] + len(comments[-1][1]):
                comments[-1][1].append(words)
            else:
                comments.append((line, [words]))
    for line, lines in comments:
        if not _ORDER.match(lines[0]):
            yield Block(line, without_code("\n".join(lines)), False, is_inside=True)


def c_blocks(text: str) -> Iterator[Block]:
    """Yield the comments of a file in C or TypeScript."""
    for comment in _C_COMMENT.finditer(text):
        words = comment["block"] or comment["line"]
        if words and not _ORDER.match(words.strip()):
            words = re.sub(r"(?m)^[ \t]*(?://|\*+(?!/))?[ \t]?", "", words)
            line = 1 + text.count("\n", 0, comment.start())
            yield Block(line, without_code(words.lstrip("*! \t")), False, is_inside=True)


def without_code(text: str) -> str:
    """Return a docstring with a sign in place of code, on the same lines."""
    first, *rest = text.split("\n", 1)
    text = "\n".join([first, *(cleandoc(f"\n.\n{rest[0]}").split("\n", 1)[1:] if rest else [])])
    for code in (_INDENTED, _INLINE):
        text = code.sub(lambda match: _CODE + "\n" * match[0].count("\n"), text)
    return text


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
    """Readable part of a text."""
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
    """Number of words in a sentence."""
    return sum(word.startswith(_CODE) or any(map(str.isalnum, word)) for word in sentence.split())


@cache
def rules() -> Sequence[Rule]:
    """Rules of the file."""
    return [
        Rule(
            pattern(rf"(?<!\w)(?:{rule['find']})(?!\w)"),
            rule["write"],
            pattern("|".join(rule["unless"])) if "unless" in rule else None,
            rule.get("opens", False),
        )
        for rule in tomllib.loads(WORDS.read_text(encoding="utf-8"))["rule"]
    ]


def pattern(text: str) -> re.Pattern[str]:
    """A regular expression in which a space is any white space."""
    return re.compile(text.replace(" ", r"\s+"), re.IGNORECASE)


def findings(page: Page) -> Iterator[str]:
    """Findings on a page, one line each."""
    text = _BETWEEN.join(block.text for block in page.blocks)
    begins = [0, *accumulate(len(block.text) + len(_BETWEEN) for block in page.blocks)]
    found = [(*span, rule.write) for rule in rules() if not rule.opens for span in rule.spans(text)]
    for rule in (rule for rule in rules() if rule.opens):
        for begin, block in zip(begins, page.blocks, strict=False):
            if block.is_inside and (match := rule.find.match(text, begin)):
                found.append((*match.span(), rule.write))
    for begin, end, write in sorted([*found, *library_findings(text)]):
        number = bisect_right(begins, begin) - 1
        block = page.blocks[number]
        first = begin - begins[number]
        line = block.line + block.text.count("\n", 0, first)
        quoted = quotation(block.text, first, end - begins[number])
        yield f'{page.name}:{line}: "{quoted}" -> {write}'


def library_findings(text: str) -> Iterator[tuple[int, int, str]]:
    """Findings of proselint in a text: from, to, and the message."""
    registry = CheckRegistry()
    if not registry.checks:
        registry.register_many(library_checks)
    selected = DEFAULT["checks"] | dict.fromkeys(_OFF, False)
    for result in LintFile("text", f"{text}\n").lint({**DEFAULT, "checks": selected}):
        # LintFile inserts a line at the beginning.
        begin, end = (place - 1 for place in result.check_result.span)
        # False findings: "for ever" in "for every", repeated numbers and symbols, a type of C.
        is_cut = text[end - 1 : end + 1].isalpha()
        if not is_cut and not re.fullmatch(r"(\w|[\d.]+)\s+(\w|[\d.]+)|long long", text[begin:end]):
            yield begin, end, result.check_result.message


def quotation(text: str, begin: int, end: int) -> str:
    """A part of a text with up to four words before it and after it."""
    before = re.search(r"(?:\S+\s+){0,4}\S*\Z", text[:begin])
    after = re.match(r"\S*(?:\s+\S+){0,4}", text[end:])
    assert before and after
    return " ".join(f"{before.group()}{text[begin:end]}{after.group()}".split())


#: Readers by kind of file, and folders that are skipped.
READERS = {
    ".md": markdown_blocks,
    ".ipynb": notebook_blocks,
    ".html": html_blocks,
    ".py": python_blocks,
    ".c": c_blocks,
    ".h": c_blocks,
    ".ts": c_blocks,
}
_FOREIGN = {"node_modules", "__pycache__"}


def main() -> int:
    """Print findings and lengths, and return the exit status."""
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
