"""The text of a program as CUDA, for a graphics card: the same equations, and kernels around them.

A card has no headers and a compiler of C++, and it is quick only with values in registers. So each
part of a simulation is a variable of its own in a thread, to which the simulation refers, and
parameters that are the same in all runs are constants. Operations are not contracted, as in C;
sine, tanh and the like are CUDA's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from fmus.native.emit import number_in_c
from orchestrator.program.library import Source
from orchestrator.program.writer import DRAWING

#: Options of NVRTC: no contracted operations, and functions for the card without a mark.
OPTIONS: tuple[str, ...] = (
    "--std=c++20", "--fmad=false", "--device-as-default-execution-space", "--disable-warnings",
)  # fmt: skip

_HEAD, _KERNELS = (Path(__file__).with_name(name) for name in ("card.cuh", "kernels.cu"))

_INCLUDE = re.compile(r"^#include .*\n", re.MULTILINE)

#: A structure made within an expression, and the address of one.
_MADE = re.compile(r"\((\w*[A-Z]\w*)\)\{")
_ADDRESSED = re.compile(rf"&(?={_MADE.pattern})")

#: The structure of all values of a run, a declaration in it, and a name with its length.
_SIMULATION = re.compile(
    r"typedef struct \{\n(?P<members>(?:(?!typedef struct).)*?)\n\} simulation;", re.DOTALL
)
_DECLARATION = re.compile(r"^ +(\w+) ([^;]+);", re.MULTILINE)
_NAME = re.compile(r"(\w+)(\[\w+\])?")

#: A structure that begins with parameters, which steps do not change.
_WITH_PARAMETERS = re.compile(
    r"typedef struct \{\n +\w+ parameters;(?:(?!typedef struct).)*?\n\} (\w+);", re.DOTALL
)

#: Types of members that are numbers.
_NUMBERS = ("double", "int")

#: Members that steps do not change.
_UNCHANGED = {"start_time", "step", "stop_time", "full_steps", "steps", "factors", "offsets",
              "supplied", "started"}  # fmt: skip

_DRAWING = """\
/* Draws apart, in a copy: an address would keep the whole component out of the registers. */
static __noinline__ void draw_apart(generator *noise, double draws[], int n) {
    for (int i = 0; i < n; i++) draws[i] = standard_normal(noise);
}

template <int N>
static __forceinline__ void draw_normals(generator *noise, double (&draws)[N], int n) {
    generator copy = *noise;
    double drawn[N];
    draw_apart(&copy, drawn, n);
    *noise = copy;
    UNROLLED
    for (int i = 0; i < N; i++) draws[i] = drawn[i];
}

static __noinline__ void seed_apart(generator *noise, uint32_t seed) {
    seed_generator(noise, seed);
}

static __forceinline__ void seed_copy(generator *noise, uint32_t seed) {
    generator copy = *noise;
    seed_apart(&copy, seed);
    *noise = copy;
}"""

#: Passages about generators, which have their words, and for a card, where neighbours share memory:
#: of each pair of words.
_OWN = (
    "typedef uint32_t *word_places;",
    "uint32_t words[GENERATOR_WORDS];",
    DRAWING,
    "seed_generator(&it->noise",
)
_SHARED = (
    """\
struct word_places {
    uint32_t *first;
    size_t apart; /* half the words from a pair to the next one */
    uint32_t &operator[](size_t i) const { return first[(i & ~(size_t)1) * apart + (i & 1)]; }
    word_places operator+(size_t i) const { return {first + i * apart, apart}; } /* an even i */
};""",
    "word_places words;",
    _DRAWING,
    "seed_copy(&it->noise",
)

_MEMORY = """\
enum {{ WORDS = sizeof(whole) / sizeof(uint64_t) }};

/* Numbers of 8 bytes, and perhaps one of 4 at the end. */
template <int SIZE>
static __forceinline__ void copy_in(void *to, const uint64_t from[], size_t n, size_t i) {{
    UNROLLED
    for (int w = 0; w < SIZE / 8; w++) ((uint64_t *)to)[w] = from[w * n + i];
    if (SIZE % 8) ((uint32_t *)to)[SIZE / 8 * 2] = (uint32_t)from[SIZE / 8 * n + i];
}}

template <int SIZE, int FIRST = 0>
static __forceinline__ void copy_out(const void *from, uint64_t to[], size_t n, size_t i) {{
    UNROLLED
    for (int w = FIRST / 8; w < SIZE / 8; w++) to[w * n + i] = ((const uint64_t *)from)[w];
    if (SIZE % 8) to[SIZE / 8 * n + i] = ((const uint32_t *)from)[SIZE / 8 * 2];
}}

static __forceinline__ void fetch(simulation *it, const uint64_t memory[], size_t n, size_t i) {{
{fetch}
}}

static __forceinline__ void store(const simulation *it, uint64_t memory[], size_t n, size_t i) {{
{store}
}}

/* Stores what steps change. */
static __forceinline__ void store_steps(const simulation *it, uint64_t memory[], size_t n,
                                        size_t i) {{
{store_steps}
}}

/* Tells generators where their words are. */
static __forceinline__ void attach(simulation *it, uint32_t words[], size_t n, size_t i) {{
{attach}
}}

/* Sets the parameters that are the same in all runs. */
static __forceinline__ void keep_same(simulation *it) {{
{same}
}}"""


class CardText(NamedTuple):
    """The two sources of a program.

    Attributes:
        steps: makes the steps.
        rest: begins runs, and gives their results.

    """

    steps: str
    rest: str


class _Member(NamedTuple):
    """A member of the simulation: its type, its name, and the length of an array as C writes it."""

    type: str
    name: str
    length: str


def in_cuda(source: Source, same: Mapping[int, float] = {}) -> CardText:
    """Return a program as CUDA.

    Args:
        source: of the program.
        same: values of parameters that are the same in all runs, by their places among all; steps
            take no others.

    """
    text = _INCLUDE.sub("", source.text)
    text = _MADE.sub(r"\1{", _ADDRESSED.sub("address_of() + ", text))
    text = text.replace("memset(it, 0, sizeof *it);", "")
    for own, shared in zip(_OWN, _SHARED, strict=True):
        text = text.replace(own, shared)
    return CardText(*(_source(source, text, same, is_hot) for is_hot in (True, False)))


def _source(source: Source, text: str, same: Mapping[int, float], is_hot: bool) -> str:
    """Return the source of some kernels."""
    if is_hot:
        text = text.replace("offsetof(simulation,", "offsetof(whole,")
    structure = _SIMULATION.search(text)
    assert structure is not None
    members = [
        _Member(type_, name, length)
        for type_, names in _DECLARATION.findall(re.sub(r"/\*.*?\*/", "", structure["members"]))
        for name, length in _NAME.findall(names)
    ]
    whole = "\n".join(f"    alignas(8) {m.type} {m.name}{m.length};" for m in members)
    types, run = f"typedef struct {{\n{whole}\n}} whole;", "simulation name = {}"
    if is_hot:
        # Each part is a variable of its own, so that one with arrays that are indexed by a variable
        # does not keep all others out of the registers.
        parts = [each for each in members if each.type not in _NUMBERS]
        refers = "\n".join(
            f"    {each.type} {'&' * (each in parts)}{each.name}{each.length};" for each in members
        )
        types += f"\n\ntypedef struct {{\n{refers}\n}} simulation;"
        run = "; ".join(
            [
                *(f"{each.type} its_{each.name} = {{}}" for each in parts),
                f"simulation name = {{{', '.join(map('.{0.name} = its_{0.name}'.format, parts))}}}",
            ]
        )
    else:
        types += "\n\ntypedef whole simulation;"
    defines = {
        "HOT": int(is_hot),
        "STEPPED": int(source.is_stepped),
        "PARAMETERS": len(source.parameters) or 1,
        "FOUND": source.n_indices or 1,
        "RUN(name)": run,
    }
    return "\n\n".join(
        [
            "\n".join(f"#define {name} {value}" for name, value in defines.items()),
            _HEAD.read_text(encoding="utf-8"),
            text[: structure.start()] + types + text[structure.end() :],
            _memory(source, members, same if is_hot else {}),
            _KERNELS.read_text(encoding="utf-8"),
        ]
    )


def _memory(source: Source, members: list[_Member], same: Mapping[int, float]) -> str:
    """Return the functions that copy runs from memory and back."""
    calls: dict[str, list[str]] = {"copy_in": [], "copy_out": [], "steps": []}
    with_parameters = {*_WITH_PARAMETERS.findall(source.text)}
    for each in members:
        size = f"sizeof(whole::{each.name})"
        place = f"memory + offsetof(whole, {each.name}) / 8 * n, n, i);"
        calls["copy_in"].append(f"    copy_in<{size}>(&it->{each.name}, {place}")
        calls["copy_out"].append(f"    copy_out<{size}>(&it->{each.name}, {place}")
        if each.name not in _UNCHANGED:
            if each.type in with_parameters:
                size += f", sizeof(whole::{each.name}.parameters)"
            calls["steps"].append(f"    copy_out<{size}>(&it->{each.name}, {place}")
    apart = "{0}.words = {{words + {1} * GENERATOR_WORDS * n + 2 * i, n}};"
    return _MEMORY.format(
        fetch="\n".join(calls["copy_in"]),
        store="\n".join(calls["copy_out"]),
        store_steps="\n".join(calls["steps"]),
        attach="\n".join(f"    {apart.format(noise, i)}" for i, noise in enumerate(source.noises)),
        same="\n".join(
            f"    {source.places[i]} = {number_in_c(value)};"
            for i, value in same.items()
            if source.places[i]
        ),
    )
