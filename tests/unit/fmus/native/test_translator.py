"""The C sources of components; tests/system/test_kinds.py compares their numbers with Python."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from random import Random
from typing import Annotated, Any, NamedTuple

import pytest

from auv_fmu.language.arrays import Matrix, Vector
from fmus.discovery import source_of
from fmus.language.build import Program
from fmus.language.types import type_of
from fmus.native.emit import Emitter
from fmus.native.names import RUNTIME
from fmus.native.pieces import initializer
from fmus.native.translator import deepest, translated
from fmus.ports.groups import count_values
from support.language import HEAD, module_of
from support.settings import NAMES


def test_every_process_writes_the_same():
    process = subprocess.run(
        [sys.executable, "-m", "fmus.native", "AuvPlant"],
        capture_output=True, text=True, check=True, env={"PYTHONHASHSEED": "7"},
    )  # fmt: skip
    assert process.stdout == translated(source_of("AuvPlant").definition)


@pytest.mark.parametrize("name", NAMES)
def test_it_has_no_memory_and_no_variable_outside_of_functions(name):
    text = translated(source_of(name).definition)
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    assert not re.search(r"\b(malloc|calloc|realloc|free|alloca)\b", code)
    outside = [
        line for line in text.splitlines() if re.match(r"static (?!const\b).*[^{;]*=.*;", line)
    ]
    assert outside == []


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("def begin(parameters: A) -> A:\n    return begin(parameters)\n", "begin calls itself"),
        ("def begin(parameters: A) -> A:\n    return A(parameters.y)\n", "10: y is not a field"),
        ("def begin(parameters: A) -> A:\n    return A(1.0, 2.0)\n", "10: A takes x"),
        ("def begin(state: A) -> A:\n    x, y = state\n    return A(x)\n", "2 names for 1 values"),
        ("def begin(parameters: A, t: int) -> A:\n    return A(parameters[t])\n",
         "10: a computed subscript of something other than a tuple of parts of one type"),
        ("def begin(state: tuple[float, float], t: float) -> A:\n    return A(state[t])\n",
         "10: a subscript that is a float, not an int"),
        ("def begin(parameters: list[float]) -> A:\n    return A(1.0)\n", "is not a type"),
    ],
)  # fmt: skip
def test_untranslatable_parts_are_named(tmp_path: Path, text, why):
    package = tmp_path / "own"
    package.mkdir()
    (package / "__init__.py").touch()
    head = "from __future__ import annotations\n\nfrom typing import NamedTuple\n\n\n"
    head += "class A(NamedTuple):\n    x: float\n\n"
    (package / "behaviour.py").write_text(head + text)
    code = (
        "from fmus.language.build import Program\n"
        "from own.behaviour import begin\n"
        "Program(begin).check()"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert why in process.stderr.splitlines()[-1]


FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function",
         "-I", str(RUNTIME))  # fmt: skip


def drawn_type(random: Random, depth: int = 0) -> Any:
    """A type for the draws of `measured`: numbers in parts of any kind."""
    kind = random.randrange(3 if depth > 2 else 6)
    if kind < 3:
        sizes = random.randint(1, 3), random.randint(1, 3)
        vector, matrix = Annotated[Vector, sizes[0]], Annotated[Matrix, sizes[0], sizes[1]]
        return (float, vector, matrix)[kind]
    parts = [drawn_type(random, depth + 1) for _ in range(random.randint(1, 4))]
    if kind == 3:
        return tuple[tuple(parts)]
    if kind == 4:
        return tuple[tuple(parts[:1] * len(parts))]
    name = f"Drawn{random.randrange(10**9)}"
    return NamedTuple(name, [(f"x{i}", part) for i, part in enumerate(parts)])


def test_draws_keep_their_order_in_every_type(tmp_path):
    emitter, lines, calls = Emitter([]), [], []
    for i in range(60):
        hint = drawn_type(Random(i))
        name, n = emitter.type(type_of(hint)), count_values(hint)
        text = initializer(type_of(hint), map("draws[{}]".format, range(n)))
        lines += [f"static {name} f{i}(const double draws[]) {{",
                  f"    const {name} it = {text};", "    return it;", "}"]  # fmt: skip
        calls.append(
            f"    const {name} x{i} = f{i}(numbers);\n"
            f"    if (sizeof x{i} != {n} * sizeof(double)) return {i + 1};\n"
            f"    if (memcmp(&x{i}, numbers, sizeof x{i}) != 0) return {i + 1};"
        )
    numbers = ", ".join(map(str, range(1, 500)))
    main = ["int main(void) {", f"    const double numbers[] = {{{numbers}}};", *calls]
    main += ["    return 0;", "}"]
    structures = "\n".join(emitter.structures.values())
    source = tmp_path / "drawn.c"
    source.write_text("\n".join(['#include "arithmetic.h"', structures, *lines, *main]))
    subprocess.run(["cc", *FLAGS, "-o", tmp_path / "drawn", source], check=True)
    assert subprocess.run([tmp_path / "drawn"], check=False).returncode == 0


#: Functions within each other.
DEEP = """
M = Matrix((0.0 for _ in range(100)) for _ in range(10))


def own_sum(a: Annotated[Vector, 100], b: Annotated[Vector, 100]) -> Annotated[Vector, 100]:
    c, d = a, b
    return c


def start(x: Annotated[Vector, 100]) -> Annotated[Vector, 10]:
    y = own_sum(own_sum(x, x), x)
    return M @ y
"""


def test_depth_includes_calls_within_calls(tmp_path):
    """start holds x, y, its result, two sums and a product; own_sum two arguments, c and d.

    The matrix is not copied.
    """
    module = module_of(HEAD + DEEP, tmp_path, "deep")
    size, function = deepest(Program(module.start).functions.values())
    assert function is not None and function.name == "start"
    assert size == 8 * (100 + 100 + 10 + 2 * 100 + 10 + 2 * 100 + 2 * 100)
