"""How much of a thread's stack a translation takes, read from its C text.

Structures are passed and returned by value, so a function that adds large vectors keeps each sum on
the stack. Nothing calls itself, and all sizes are fixed: what lies there at most can be added up.
Compilers keep no more than this, but for a tenth, and less if they optimise.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

#: Bytes that a number takes, alone in a structure.
NUMBER = 8

_TYPE = re.compile(r"typedef (?:struct|union) \{\n((?: .*\n)*)\} (\w+);|typedef (\w+) (\w+);")
_MEMBER = re.compile(r"(\w+) \*?\w+(?:\[(\d+)\])?;")
_FUNCTION = re.compile(r"^static ([\w ]+?) \*?(\w+)\(([^{;]*?)\) \{\n(.*?)^\}", re.M | re.S)
_WORD = re.compile(r"[A-Za-z_]\w*")


class _Frame(NamedTuple):
    """What a function keeps on the stack: bytes of its own, and for each call of another one."""

    own: int
    calls: Mapping[str, int]


def deepest(text: str) -> tuple[int, str]:
    """The most bytes that lie on the stack in a call from outside, and in the call of what.

    Args:
        text: of a translation.

    """
    # What looks like a type or a call in a comment or a text is none.
    text = re.sub(r'/\*.*?\*/|"(?:\\.|[^"\\])*"', "", text, flags=re.S)
    sizes = _sizes(text)
    found = {name: (returns, given, body) for returns, name, given, body in _FUNCTION.findall(text)}
    results = {name: sizes.get(returns, 0) for name, (returns, _, _) in found.items()}
    passed = {name: _declared(given, sizes) for name, (_, given, _) in found.items()}
    frames: dict[str, _Frame] = {}
    for name, (_, _, body) in found.items():
        words = [(word[0], body[word.end() :]) for word in _WORD.finditer(body)]
        calls = [word for word, after in words if word in found and after.startswith("(")]
        local = sum(_local(after, sizes[word]) for word, after in words if word in sizes)
        own = local + sum(results[call] for call in calls)
        frames[name] = _Frame(own, {call: passed[call] for call in calls})

    @cache
    def depth(name: str) -> int:
        own, calls = frames[name]
        return own + max((given + depth(call) for call, given in calls.items()), default=0)

    return max(((depth(name), name) for name in frames), default=(0, ""))


def _sizes(text: str) -> dict[str, int]:
    """The bytes of all structures, by their names."""
    sizes: dict[str, int] = {}
    for members, name, known, alias in _TYPE.findall(text):
        if name:
            parts = _MEMBER.findall(members)
            sizes[name] = sum(sizes.get(kind, NUMBER) * int(n or 1) for kind, n in parts)
        elif known in sizes:
            sizes[alias] = sizes[known]
    return sizes


def _declared(given: str, sizes: Mapping[str, int]) -> int:
    """The bytes of the arguments that a function takes by value."""
    parts = [part.split() for part in given.split(",")]
    return sum(sizes.get(part[-2], 0) for part in parts if len(part) > 1 and "*" not in part[-1])


def _local(after: str, size: int) -> int:
    """The bytes of what begins with the name of a structure: variables, or a value that is made."""
    if after.startswith("){"):
        return size
    if not after.startswith(" ") or after.startswith(" *"):
        return 0
    names, depth = 1, 0
    for character in after:
        depth += (character in "({[") - (character in ")}]")
        if character == ";" and depth == 0:
            break
        names += character == "," and depth == 0
    return names * size
