"""Serialised states that were tampered with: by their bytes, and by what they say.

States in JSON are changed by a grammar: a value becomes something else, a key comes, goes or is
renamed, a part is taken from another state. Words of a state of an FMU in C become others. The
checksum is left as it is or made to fit again; with one that fits, what the state says is all that
speaks against it.
"""

from __future__ import annotations

import json
from binascii import crc32
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from math import inf, nan
from random import Random
from struct import pack, unpack
from typing import Any, NamedTuple

CHECKSUM = "checksum"

#: How a state of an FMU in C begins: the length of a text, and it.
_MAGIC = b"FMU state 3"
_HEAD = pack("<I", len(_MAGIC)) + _MAGIC

Json = Any


def read(content: bytes) -> dict[str, Json] | None:
    """The object that a state in JSON is, if these are the bytes of one."""
    try:
        said = json.loads(content)
    except (ValueError, RecursionError):
        return None
    return said if isinstance(said, dict) else None


def is_native(content: bytes) -> bool:
    """Whether these are the bytes of a state of an FMU in C."""
    return content.startswith(_HEAD)


def without_fault(content: bytes) -> Json:
    """Parts that two states share of which one is that of a run with refusals."""
    if is_native(content):
        return content[:-8]  # the last words are the fault and the checksum
    said = read(content)
    if said is None:
        return None
    return {key: value for key, value in said.items() if key not in ("fault", CHECKSUM)}


def sealed(said: dict[str, Json]) -> bytes:
    """Bytes of a state in JSON with a checksum that fits."""
    rest = {key: value for key, value in said.items() if key != CHECKSUM}
    return _written({**rest, CHECKSUM: crc32(_written(rest))})


def _written(said: Json) -> bytes:
    return json.dumps(said).encode()


def resealed(content: bytes) -> bytes:
    """Bytes of a state in C with a checksum that fits in the place of the one that they have."""
    return content[:-4] + pack("<I", crc32(content[:-4]))


def with_mode(content: bytes, mode: int) -> bytes:
    """A state in C in another mode, which is the word after two texts."""
    [length] = unpack("<I", content[len(_HEAD) : len(_HEAD) + 4])
    return _with(content, len(_HEAD) + 4 + length, pack("<I", mode))


def _with(content: bytes, place: int, more: bytes) -> bytes:
    return resealed(content[:place] + more + content[place + len(more) :])


class Mutant(NamedTuple):
    """The bytes of a changed state, and what was done to it."""

    content: bytes
    said: str


# Changes of bytes


def _noise(content: bytes, random: Random) -> bytes:
    return random.choice(
        (
            random.randbytes(random.randrange(1, 200)),
            b"\xff\xfe" + content,
            b"[" * random.choice((10, 2000, 100_000)),
            b'{"a":' * 2000,
            b"null",
            b"{}",
            b"[]",
            b"1e999",
            b"9" * 5000,
            content + content,
        )
    )


def _cut(content: bytes, random: Random) -> bytes:
    return content[: random.randrange(1, len(content))]


def _flipped(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 1, 3, 20))):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _appended(content: bytes, random: Random) -> bytes:
    return content + random.choice((b"x", b"\0", b"}", content[:50], b"\xff", b"{}"))


def _inserted(content: bytes, random: Random) -> bytes:
    place = random.randrange(len(content))
    more = random.choice((b"\0", b"\xff", b"9", b"e", b'"', b"NaN", b"-", b"[", b"}"))
    return content[:place] + more + content[place:]


BYTES: dict[str, Callable[[bytes, Random], bytes]] = {
    "noise": _noise,
    "cut": _cut,
    "bits flipped": _flipped,
    "appended": _appended,
    "inserted": _inserted,
}

#: Numbers that stand for something else in the bytes of a state: lengths, kinds, texts, Reals.
_ODD_BYTES = (
    *(pack("<I", word) for word in (0, 1, 2, 5, 11, 12, 2**16, 2**31 - 1, 2**31, 2**32 - 1)),
    *(pack("<d", real) for real in (nan, inf, -inf, 1e308, -1e308, 1e-320, -0.0, 0.0, 1.0, -1.0)),
)  # fmt: skip


def _overwritten(content: bytes, random: Random) -> bytes:
    """Words become others; all parts of a state are words, and texts before them."""
    for _ in range(random.choice((1, 1, 2, 4))):
        back = 4 * random.randrange(2, len(content) // 4)
        content = _with(content, len(content) - back, random.choice(_ODD_BYTES))
    return content


# Changes of what is said

_ODD: tuple[Json, ...] = (
    nan, inf, -inf, 1e308, -1e308, 1e-320, -0.0, 0, 1, -1, 5, 2**31, 2**63, 10**400, -(10**400),
    "", "tanh", "bogus", "NaN", "\ud800", "x" * 1000, True, False, None, [], {}, [[]], {"a": 1},
    [0.0], ["a"], "stepping", "terminated", "instantiated", "initialising",
)  # fmt: skip


def _nested() -> Json:
    deep: Json = []
    for _ in range(100):
        deep = [deep]
    return deep


def places(said: Json, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value."""
    if path:
        yield path
    if isinstance(said, dict):
        for key in said:
            yield from places(said[key], (*path, key))
    elif isinstance(said, list):
        for i, value in enumerate(said):
            yield from places(value, (*path, i))


def at(said: Json, path: Sequence[Any]) -> Json:
    for key in path:
        said = said[key]
    return said


def _place(said: Json, random: Random, kinds: type | tuple[type, ...] = object) -> Any:
    """A path, with every key of the top as likely as any other, however much it holds."""
    top = random.choice([key for key in said if key != CHECKSUM])
    found = [(top, *rest) for rest in [(), *places(said[top])]]
    fitting = [path for path in found if isinstance(at(said, path), kinds)]
    return random.choice(fitting) if fitting else None


def _put(said: Json, path: Sequence[Any], value: Json) -> None:
    at(said, path[:-1])[path[-1]] = value


def _replaced(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    path = _place(said, random)
    value = random.choice((*_ODD, _nested()))
    _put(said, path, deepcopy(value))
    return f"{_dotted(path)} = {value!r:.40}"


def _nudged(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    path = _place(said, random, (float, int))
    if path is None:
        return None
    value = at(said, path)
    changed = random.choice((-value, value + 1, value * 1e10, value * 1e200, float(value) + 1e-3))
    _put(said, path, changed)
    return f"{_dotted(path)} = {changed!r:.40} for {value!r:.40}"


def _removed(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    path = _place(said, random)
    del at(said, path[:-1])[path[-1]]
    return f"{_dotted(path)} removed"


def _added(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    path = random.choice([(), _place(said, random, (dict, list))])
    if path is None:
        return None
    whole, value = at(said, path), deepcopy(random.choice(_ODD))
    if isinstance(whole, dict):
        key = random.choice(("more", "", "fault", "unusable", "identity", "m11", "__class__"))
        whole[key] = value
        return f"{_dotted(path)}.{key} = {value!r:.40}"
    whole.insert(random.randrange(len(whole) + 1), value)
    return f"{_dotted(path)} with {value!r:.40} more"


def _renamed(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    path = _place(said, random, dict) if random.random() < 0.5 else ()
    if path is None or not at(said, path):
        return None
    whole = at(said, path)
    key = random.choice([*whole])
    new = random.choice((key.upper(), key + "_", "", "état"))
    if new in whole:
        return None
    whole[new] = whole.pop(key)
    return f"{_dotted(path)}.{key} renamed {new!r}"


def _exchanged(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    one, other = _place(said, random), _place(said, random)
    if one[: len(other)] == other or other[: len(one)] == one:
        return None
    first, second = at(said, one), at(said, other)
    _put(said, one, second)
    _put(said, other, first)
    return f"{_dotted(one)} and {_dotted(other)} exchanged"


def _grafted(said: Json, random: Random, others: Sequence[Json]) -> str | None:
    """A part of another state, of this FMU or another, in its place."""
    if not others:
        return None
    other = random.choice(others)
    path = _place(said, random)
    try:
        value = at(other, path)
    except (LookupError, TypeError):
        return None
    _put(said, path, deepcopy(value))
    return f"{_dotted(path)} of another state: {value!r:.40}"


VALUES: dict[str, Callable[[Json, Random, Sequence[Json]], str | None]] = {
    "replaced": _replaced,
    "nudged": _nudged,
    "removed": _removed,
    "added": _added,
    "renamed": _renamed,
    "exchanged": _exchanged,
    "grafted": _grafted,
}


def _dotted(path: Sequence[Any]) -> str:
    return ".".join(map(str, path)) or "the state"


def _with_a_key_twice(content: bytes, random: Random) -> Mutant:
    said = read(content)
    assert said is not None
    key = random.choice([*said])
    value = random.choice(_ODD)
    text = f'{{"{key}": {json.dumps(value)}, '.encode() + content[1:]
    if random.random() < 0.5:
        text = content[:-1] + f', "{key}": {json.dumps(value)}}}'.encode()
    return Mutant(text, f"{key} twice, once {value!r:.40}")


def mutant(content: bytes, random: Random, lenders: Sequence[Json] = ()) -> Mutant:
    """A state that was tampered with; what other states say may take the place of its parts."""
    if is_native(content) and random.random() < 0.8:
        return Mutant(_overwritten(content, random), "words overwritten; the checksum fits")
    said = read(content)
    if said is None or random.random() < 0.2:
        name = random.choice([*BYTES])
        return Mutant(BYTES[name](content, random), name)
    if random.random() < 0.05:
        return _with_a_key_twice(content, random)
    done: list[str] = []
    fits = random.random() < 0.8
    try:
        for _ in range(random.choice((1, 1, 1, 1, 2, 4))):
            one = VALUES[random.choice([*VALUES])](said, random, lenders)
            done += [one] if one else []
        changed = sealed(said) if fits else _written(said)
    except (OverflowError, ValueError):
        # Integers that no float holds, or with too many digits to be written.
        return Mutant(_flipped(content, random), "bits flipped")
    what = "; ".join(done) or "nothing"
    return Mutant(changed, what if fits else f"{what}; the checksum as it was")


# What the cases of docs/reference/fmi-answers.md need


def _impossible(content: bytes, random: Random) -> bytes:
    """Values that no run leads to, with a checksum that fits."""
    if is_native(content):
        fault = _with(content, len(content) - 8, pack("<I", 2))
        return random.choice((fault, with_mode(content, 7), with_mode(content, 2**31)))
    said = read(content)
    if said is None:
        return _noise(content, random)
    parameters, outputs = said["parameters"], said["outputs"]
    first = next(iter(parameters))
    change = random.choice(
        (
            {"mode": "bogus"},
            {"start_time": nan},
            {"fault": "no"},
            {"fault": 2},
            {"stop_time": nan},
            {"stop_time": said["start_time"]},
            *([{"outputs": [*outputs, 0.0]}, {"outputs": [inf, *outputs[1:]]}] if outputs else []),
            {"parameters": {}},
            {"parameters": {**parameters, first: []}},
            {"parameters": {**parameters, first: nan}},
            {"inputs": None},
            {"state": 5.0},
        )
    )
    return sealed({**said, **change})


def _changed_values(content: bytes, random: Random) -> bytes:
    """Bytes that say something else than their checksum."""
    before = read(content)
    changed = content
    # A digit beyond a number's precision changes nothing.
    while changed == content or (before is not None and read(changed) == before):
        changed = random.choice((_flipped, _appended, _inserted))(content, random)
    return changed


def changed(content: bytes, change: str, seed: int) -> bytes:
    """Bytes that are to be refused.

    Args:
        content: of a good state.
        change: `noise`, `cut`, `changed` or `impossible`.
        seed: of the change.

    """
    kinds = {"cut": _cut, "changed": _changed_values, "impossible": _impossible}
    if change != "noise":
        return kinds[change](content, Random(seed))
    random = Random(seed)
    return random.choice((b"{}", b"null", b"[" * 5000, b"\xff\xfe", random.randbytes(50)))
