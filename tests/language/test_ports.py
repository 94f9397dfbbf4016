"""Components as an engineer writes them from a textbook, in the language with few changed lines.

The files of `ports` are the textbook's, in Python's own idioms. What is refused is exchanged here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from difflib import SequenceMatcher
from inspect import signature
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any, NamedTuple

import pytest

from fmus import check
from fmus.script import source_of_script
from fmus.trial import run
from fuzz.components import difference
from orchestrator.machine.compilers import machines_compiler
from support.language import module_of
from support.tiers import slow

PORTS = Path(__file__).parent / "ports"

#: Most lines that may differ in one.
FEW = 5


class Change(NamedTuple):
    """A part of a line that is refused, and what is written instead."""

    natural: str
    written: str


#: What is changed in each, and nothing else.
CHANGES: Mapping[str, tuple[Change, ...]] = {
    "attitude": (
        Change("sum(x**2 for x in v)", "Vector(x**2 for x in v).sum()"),
        Change("min(1, abs(", "min(1.0, abs("),
    ),
    "battery_modes": (
        Change("LIMITS = {Mode.REST: 0.0, ", "LIMITS = (0.0, "),
        Change("Mode.CHARGE: 2.0, Mode.BALANCE: 0.1, Mode.DISCHARGE: 5.0}", "2.0, 0.1, 5.0)"),
        Change(
            "sum(c * soc**i for i, c in enumerate(OCV))",
            "OCV[0] + soc * (OCV[1] + soc * (OCV[2] + soc * OCV[3]))",
        ),
        Change("sum(state.soc)", "state.soc.sum()"),
        Change("max(load, 0)", "max(load, 0.0)"),
        Change("sum(x**2 for x in i)", "Vector(x**2 for x in i).sum()"),
    ),
    "ekf": (
        Change("math.hypot(x[0], x[1])", "math.sqrt(x[0] ** 2 + x[1] ** 2)"),
        Change("nis=0)", "nis=0.0)"),
        Change(
            "[a - b for a, b in zip((inputs.range, inputs.bearing), measure(x))]",
            "Vector(a - b for a, b in zip((inputs.range, inputs.bearing), measure(x)))",
        ),
        Change("y[1] = wrap(y[1])", "y = y.replaced(1, wrap(y[1]))"),
    ),
    "fault_detector": (
        Change("sum(queue) /", "queue.sum() /"),
        Change(
            "sum((x - mean) ** 2 for x in queue)", "Vector((x - mean) ** 2 for x in queue).sum()"
        ),
        Change("max(0, ", "max(0.0, "),
        Change("fault is state.fault", "fault == state.fault"),
    ),
    "gain_schedule": (
        Change("from bisect import bisect_right\n", ""),
        Change("bisect_right(grid, x)", "sum(a <= x for a in grid)"),
        Change("if inputs.on else 0\n", "if inputs.on else 0.0\n"),
    ),
    "mpc": (
        Change("-> list[Vector]:", "-> Annotated[Matrix, N + 1, 2]:"),
        Change("xs = [x]", "xs = Matrix(x for _ in range(N + 1))"),
        Change("xs.append(A @ xs[k] + B * u[k])", "xs = xs.replaced(k + 1, A @ xs[k] + B * u[k])"),
        Change("g, costate = [0.0] * N, ", "g, costate = Vector([0.0] * N), "),
        Change("g[k] = B @ costate + R * u[k]", "g = g.replaced(k, B @ costate + R * u[k])"),
    ),
}  # fmt: skip

each = pytest.mark.parametrize("name", CHANGES)

#: Together they have most of what the language has.
QUICK = ("battery_modes", "mpc")


def natural(name: str) -> str:
    return (PORTS / f"{name}.py").read_text(encoding="utf-8")


def written(name: str) -> str:
    text = natural(name)
    for change in CHANGES[name]:
        assert text.count(change.natural) == 1, change
        text = text.replace(*change)
    return text


@pytest.fixture
def script(tmp_path: Path, name: str) -> Iterator[Path]:
    """The file of a port in the language, whose folder Python forgets afterwards."""
    path, before = tmp_path / f"{name}.py", [*sys.path]
    path.write_text(written(name), encoding="utf-8")
    yield path
    sys.path[:] = before
    sys.modules.pop(name, None)


def test_every_file_is_tried():
    assert {path.stem for path in PORTS.glob("*.py")} == {*CHANGES}


@each
def test_few_lines_differ(name: str):
    one, other = natural(name).splitlines(), written(name).splitlines()
    changes = SequenceMatcher(None, one, other, autojunk=False).get_opcodes()
    changed = [max(i2 - i1, j2 - j1) for tag, i1, i2, j1, j2 in changes if tag != "equal"]
    assert 0 < sum(changed) <= FEW


@each
def test_numbers_are_those_of_the_textbook(script: Path, tmp_path: Path, name: str):
    """To rounding: Python's sum and hypot round in ways of their own."""
    textbook = module_of(natural(name), tmp_path, f"natural_{name}")
    step, random = getattr(textbook, "STEP_SIZE", 0.02), Random(name)
    inputs = [_inputs(textbook, random) for _ in range(200)]
    source_of_script(script)
    module = __import__(name)

    def at(t: float) -> Mapping[str, Any]:
        return inputs[round(t / step)]._asdict()

    seen = run(module, inputs=at, stop_time=step * (len(inputs) - 1), step=step)
    del seen["time"], seen["fault"]
    rows, expected = zip(*seen.values(), strict=True), _plain(textbook, inputs, step)
    for row, numbers in zip(rows, expected, strict=True):
        assert row == pytest.approx(numbers, rel=1e-9, abs=1e-9)
    assert any(len({*column}) > len(inputs) // 2 for column in seen.values())


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
@pytest.mark.parametrize("name", [*QUICK, *slow(*sorted(CHANGES.keys() - {*QUICK}))])
def test_both_kinds_agree_bit_for_bit(script: Path, tmp_path: Path, name: str):
    (tmp_path / "checked").mkdir()
    assert check.mistakes(script, tmp_path / "checked") == []
    assert difference(script, tmp_path, range(40)) == ""


def _inputs(module: ModuleType, random: Random) -> Any:
    """Inputs about their defaults."""
    return module.Inputs(*(_near(value, random) for value in module.Inputs()))


def _near(value: Any, random: Random) -> Any:
    if isinstance(value, tuple):
        return type(value)(_near(part, random) for part in value)
    if isinstance(value, float):
        return value + random.uniform(-0.5, 0.5)
    return random.choice([*type(value)]) if not isinstance(value, bool) else random.random() < 0.8


def _plain(module: ModuleType, inputs: list[Any], step: float) -> Iterator[list[float]]:
    """The outputs of a component with some inputs, by the rule of its form and nothing else."""
    known: dict[str, Any] = {"parameters": module.Parameters(), "h": step, "inputs": inputs[0]}

    def call(hook: Callable[..., Any]) -> Any:
        return hook(*(known[argument] for argument in signature(hook).parameters))

    known["state"] = call(module.start)
    for known["inputs"] in inputs:
        if hasattr(module, "derive"):
            known["derived"] = call(module.derive)
        yield [*_flat(call(module.outputs))]
        known["state"] = call(module.update)


def _flat(value: Any) -> Iterator[float]:
    for part in value if isinstance(value, tuple) else ():
        yield from _flat(part)
    if not isinstance(value, tuple):
        yield value
