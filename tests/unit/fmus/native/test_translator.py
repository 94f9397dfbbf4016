"""The C sources of components: equations as in Python, bit for bit, and ports as declared."""

from __future__ import annotations

import re
import subprocess
import sys
from ctypes import byref, c_ulong
from enum import IntEnum
from pathlib import Path
from random import Random
from typing import Annotated, Any, NamedTuple, get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu.language.arrays import Matrix, Vector
from fmus.discovery import source_of
from fmus.language.build import Program
from fmus.language.types import type_of
from fmus.native.emit import Emitter
from fmus.native.pieces import initializer
from fmus.native.translator import deepest, translated
from fmus.ports.groups import class_of, count_values, form, hints_of, is_class, parts_of
from fmus.python.component import LONGEST_MESSAGE, Component
from fmus.script import source_of_script
from support.equations import (
    FLAGS,
    RUNTIME,
    Equations,
    Error,
    bits,
    equations,
    flat,
    is_series,
    structure,
)
from support.language import HEAD, module_of
from support.settings import EACH, NAMES

#: Magnitudes of usual numbers, and of numbers that overflow.
MAGNITUDES = (1e-3, 1.0, 1.0, 1.0, 10.0, 1e9, 1e100, 1e160, 1e308)

every = pytest.mark.parametrize("name", NAMES)
randoms = st.randoms(use_true_random=True)


@pytest.mark.parametrize("name", NAMES[:1])
def test_every_process_writes_the_same(name):
    process = subprocess.run(
        [sys.executable, "-m", "fmus.native", name],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONHASHSEED": "7"},
    )
    assert process.stdout == translated(source_of(name).definition)


@every
def test_it_has_no_memory_and_no_variable_outside_of_functions(name):
    text = translated(source_of(name).definition)
    assert not re.search(r"\b(malloc|calloc|realloc|free|alloca)\b", text)
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


def number(random: Random) -> float:
    return random.choice((0.0, -0.0, 1.0, random.uniform(-1.0, 1.0) * random.choice(MAGNITUDES)))


def value(kind: Any, random: Random, wild: float = 0.3) -> Any:
    """Something that a type of the equations can hold; most numbers are tame."""
    kind = form(kind)
    if kind is float:
        return number(random) if random.random() < wild else random.uniform(-3.0, 3.0)
    if kind in (int, bool):
        return random.randrange(3 if kind is int else 2)
    if is_class(kind, IntEnum):
        return random.choice([*kind])
    if is_series(kind):
        numbers = tuple(value(k, random, wild) for k in parts_of(kind) or ())
        return class_of(kind)(numbers) if get_origin(kind) is Annotated else numbers
    return kind(**{name: value(k, random, wild) for name, k in hints_of(kind).items()})


def agree(both: Equations, hook: str, **given: Any) -> Any:
    """Compare what a hook gives, or what it raises as a slave would say it; None: it raises."""
    result, why = None, ""
    try:
        result = both.python(hook, **given)
    except Exception as error:
        why = Component.describe(None, error)[:LONGEST_MESSAGE]  # type: ignore[arg-type]
    assert both.c(hook, **given) == (why, [] if result is None else bits(flat(result)))
    return result


@pytest.mark.parametrize("name", EACH)
@settings(max_examples=15)
@given(random=randoms)
def test_hooks(name, random):
    both, wild = equations(name), random.choice((0.0, 0.02, 0.3))
    groups = ("parameters", "inputs", "state", "derived")
    given = {what: value(both.kind(what), random, wild) for what in groups}
    given |= {"t": number(random), "h": random.random()}
    for hook in ("check", "start", "credible", "restarted", "derive", "outputs", "update"):
        if both.said.hooks[hook]:
            agree(both, hook, **given)


@given(random=randoms)
def test_states_are_refused_alike(random):
    """Most that are random, and some that a run begins with."""
    both = equations("AuvPlant")
    parameters, inputs = (value(both.kind(it), random, 0.0) for it in ("parameters", "inputs"))
    state = agree(both, "start", parameters=parameters, inputs=inputs, t=random.random())
    if state is None or random.random() < 0.5:
        state = value(both.kind("state"), random, random.choice((0.0, 0.02, 0.3)))
    agree(both, "check_state", parameters=parameters, state=state)


def test_text_of_a_restart_is_pythons():
    both = equations("ObserverController")
    assert both.library.restarted().decode() % 0.02 == both.said.restarted.format(t=0.02)


def drawn_type(random: Random, depth: int = 0) -> Any:
    """Something that `measured` may take its draws as: numbers in parts of any kind."""
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
    subprocess.run(["cc", *FLAGS, "-I", str(RUNTIME), "-o", tmp_path / "drawn", source], check=True)
    assert subprocess.run([tmp_path / "drawn"], check=False).returncode == 0


@pytest.mark.parametrize("seed", [0, 1, -1, 2**31 - 1, -(2**31)])
def test_seed_is_the_number_that_the_slave_gives_its_generator(seed):
    both = equations("AuvPlant")
    parameters = structure(both.said.parameters)()
    parameters.noise.seed = seed
    both.library.seed.restype = c_ulong
    assert both.library.seed(byref(parameters), byref(Error())) == seed % 2**32


#: Records without fields among numbers.
HOLLOW = (
    HEAD
    + """
from auv_fmu import Variable


class Part(NamedTuple):
    pass


class Parts(NamedTuple):
    a: Part
    b: tuple[Part, Part]


class Parameters(NamedTuple):
    k: Annotated[float, Variable()] = 3.0


class Inputs(NamedTuple):
    e: Part
    u: Annotated[float, Variable()] = 2.0


class State(NamedTuple):
    a: float
    e: Parts
    b: float


class Outputs(NamedTuple):
    y: Annotated[float, Variable()]
    e: Part
    z: Annotated[float, Variable()]


def start(parameters: Parameters, inputs: Inputs) -> State:
    return State(parameters.k, Parts(Part(), (Part(), Part())), inputs.u)


def update(state: State, inputs: Inputs, h: float) -> State:
    def spare(x: float) -> float:
        return x

    return State(state.a + h, state.e, state.b + inputs.u)


def outputs(state: State) -> Outputs:
    return Outputs(state.a, state.e.b[1], state.b)
"""
)


def test_records_without_fields_take_no_numbers_and_spare_functions_no_room(tmp_path):
    path = tmp_path / "hollow.py"
    path.write_text(HOLLOW)
    definition = source_of_script(path).definition
    both = Equations(definition)
    assert "spare" not in translated(definition), "nothing calls it"
    inputs = both.said.inputs((), 0.25)
    given: dict[str, Any] = {"parameters": both.said.parameters(3.0), "inputs": inputs, "h": 0.5}
    given["state"] = agree(both, "start", t=0.0, **given)
    given["state"] = agree(both, "update", **given)
    assert flat(agree(both, "outputs", **given)) == [3.5, 0.5]


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
