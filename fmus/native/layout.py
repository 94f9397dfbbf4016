"""How statements and comments of C are laid out as lines."""

from __future__ import annotations

import re
import textwrap
import tokenize
from functools import cache

from fmus.native.shapes import strip_sphinx_marks

LINE_WIDTH = 98
INDENT = "    "

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')

#: Spaces that no line is broken at.
_UNBROKEN = re.compile(r"(?<!,) (?!(?:[-+?:]|&&|\|\|) )")

#: What stands for a space that no line is broken at, and for brackets and commas that are text.
_KEPT = str.maketrans(" (){},", "\x01\x02\x03\x04\x05\x06")
_BACK = str.maketrans("\x01\x02\x03\x04\x05\x06", " (){},")


def laid_out(text: str, indent: str) -> list[str]:
    """A statement as lines."""
    protected = _STRINGS.sub(lambda string: string.group().translate(_KEPT), text)
    return [line.translate(_BACK) for line in _lines(protected, indent)]


def quoted(text: str) -> str:
    """A text in C."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    escaped = re.sub(r"[\x00-\x1f\x7f]", lambda found: f"\\{ord(found[0]):03o}", escaped)
    # Two question marks may begin a trigraph.
    escaped = escaped.replace("?", "\\?") if "??" in escaped else escaped
    return f'"{escaped}"'


def _lines(text: str, indent: str) -> list[str]:
    if len(indent) + len(text) <= LINE_WIDTH:
        return [indent + text]
    start, end = _widest(text)
    # Inside of a short bracket there is nothing to gain.
    if end - start < len(text) // 2 or "{" not in text[start:end]:
        return _wrapped(text, indent)
    # Two of them around the same are opened as one.
    while text[start + 1] == "{" and _closing(text, start + 1) == end - 1:
        start, end = start + 1, end - 1
    *items, last = _split(text[start + 1 : end])
    after = [f"{last},", text[end:]] if text[start] == "{" else [f"{last}{text[end:]}"]
    lines = [indent + text[: start + 1]]
    for item in (*(f"{item}," for item in items), after[0]):
        lines += _lines(item, indent + INDENT)
    return lines + [indent + closing for closing in after[1:]]


def _wrapped(text: str, indent: str) -> list[str]:
    """Lines that end after commas and before operators."""
    wrapper = textwrap.TextWrapper(
        LINE_WIDTH,
        initial_indent=indent,
        subsequent_indent=indent + INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return wrapper.wrap(_UNBROKEN.sub("\x01", text))


def _closing(text: str, start: int) -> int:
    """Where a bracket is closed; its own place if it is not."""
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] in "({") - (text[i] in ")}")
        if depth == 0:
            return i
    return start


def _widest(text: str) -> tuple[int, int]:
    """The outermost pair of brackets that holds the most."""
    spans, i = [(0, 0)], 0
    while i < len(text):
        if text[i] in "({":
            spans.append((i, _closing(text, i)))
            i = spans[-1][1]
        i += 1
    return max(spans, key=lambda span: span[1] - span[0])


def _split(text: str) -> list[str]:
    """The items of a list, at the commas that are in no bracket."""
    items, depth, start = [], 0, 0
    for i, character in enumerate(text):
        depth += (character in "({") - (character in ")}")
        if character == "," and depth == 0:
            items.append(text[start:i].strip())
            start = i + 1
    return [*items, text[start:].strip()]


@cache
def comments_of(path: str) -> dict[int, str]:
    """The comments of a file after code, by line."""
    with tokenize.open(path) as file:
        return {
            token.start[0]: token.string.lstrip("#: ")
            for token in tokenize.generate_tokens(file.readline)
            if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip()
        }


def annotated(lines: list[str], comment: str, indent: str) -> list[str]:
    """Lines with a comment at the end, or before them."""
    if len(lines) == 1 and len(lines[0]) + 1 + len(comment) <= LINE_WIDTH:
        return [f"{lines[0]} {comment}"]
    return [f"{indent}{comment}", *lines]


def comment_of(docstring: str | None) -> list[str]:
    if not docstring:
        return []
    lines = strip_sphinx_marks(textwrap.dedent(docstring)).rstrip().splitlines() or [""]
    if len(lines) == 1:
        return [f"/* {lines[0]} */"]
    return [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]
