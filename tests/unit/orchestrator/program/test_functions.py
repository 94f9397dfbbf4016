"""Functions of CasADi against the equations that they are made from."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest

from auv_fmu import Refusal
from fmus.discovery import Source, source_of
from fmus.ports.groups import flat, reals_first
from fmus.python.slave import slave_of
from orchestrator.program import functions
from support import examples
from support.settings import NAMES

casadi = pytest.importorskip("casadi")

EXAMPLES = Path(examples.__file__).parents[2] / "examples"

#: Loops that end where a number says so cannot be unrolled.
LOOPS = {"AcousticLink", "PathPlanner", "Sea", "lqr", "stair"}
ALL = [name for name in (*NAMES, *examples.NAMES) if name not in LOOPS]

#: Steps from different states.
STEPS = 12


def source(name: str) -> Source:
    return source_of(name) if name in NAMES else examples.source(name)


@cache
def model(name: str) -> functions.Model:
    return functions.model(name if name in NAMES else EXAMPLES / name)


class Step(NamedTuple):
    """A step by Python's hooks: vectors before it, and what they give."""

    state: list[float]
    inputs: list[float]
    parameters: list[float]
    h: float
    t: float
    next: list[float]
    outputs: list[float]

    @property
    def given(self) -> tuple[Any, ...]:
        return self[:5]


def steps(name: str, seed: int = 0) -> Iterator[Step]:
    """Steps with random inputs and parameters."""
    draw, made = Random(seed), source(name)
    definition = made.definition
    behaviour, h = definition.behaviour, definition.experiment.step
    cls = slave_of(made.name, import_module(made.module))
    slave = cls(instance_name="it")
    inputs = [port for port in definition.ports if port.causality == "input"]
    outputs = [port for port in definition.ports if port.causality == "output"]
    slave.parameters = definition.parameters.of(
        {
            port.name: port.start * draw.uniform(0.98, 1.02) if port.type == "Real" else port.start
            for port in definition.parameters.ports
        }
    )
    parameters = [
        number
        for number, port in zip(flat(slave.parameters), definition.parameters.ports)
        if port.type == "Real"
    ]

    def group() -> tuple[list[Any], Any]:
        values = {port.name: _drawn(draw, port) for port in inputs}
        return [float(value) for value in values.values()], cls.unpack(
            [values[port.name] for port in reals_first(inputs)]
        )

    def shown(state: Any, held: Any, t: float) -> list[float]:
        _, values = slave.evaluate(state, None, held, t, [0.0] * behaviour.draws)
        by_name = dict(zip((port.name for port in reals_first(outputs)), values))
        return [float(by_name[port.name]) for port in outputs]

    t, state = 0.25, None
    while True:
        numbers, held = group()
        try:
            if state is None:
                state = slave.start(slave.parameters, held, t)
            after, _ = slave.advance(state, None, held, t, h, 1)
            seen = shown(state, held, t) if behaviour.is_sampled else shown(after, held, t + h)
        except (ArithmeticError, Refusal):
            state = None
            continue
        yield Step(_row(state), numbers, parameters, h, t, _row(after), seen)
        state, t = after, t + h


def _row(group: Any) -> list[float]:
    return [float(number) for number in flat(group)]


def _drawn(draw: Random, port: Any) -> Any:
    """A random value of an input."""
    if port.choices:
        return draw.choice([*port.choices.values()])
    if port.type != "Real":
        return draw.choice([False, True]) if port.type == "Boolean" else draw.randint(0, 2)
    value = port.start + draw.gauss(0.0, 0.3)
    return min(max(value, port.minimum or -np.inf), np.inf if port.maximum is None else port.maximum)


def some(name: str, seed: int = 0) -> list[Step]:
    return [step for step, _ in zip(steps(name, seed), range(STEPS))]


@pytest.mark.parametrize("name", ALL)
def test_step_has_the_numbers_of_the_equations(name):
    for step in some(name):
        found = model(name).advance(*step.given)
        for numbers, wanted in zip(found, (step.next, step.outputs), strict=True):
            np.testing.assert_allclose(numbers.full().ravel(), wanted, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ALL)
def test_derivatives_are_those_of_central_differences(name):
    step, places = some(name)[-1], (0, 1, 2)
    advance = model(name).advance
    exact = advance.jacobian()(*step.given, *advance(*step.given))
    for result in range(2):
        for place in places:
            matrix = exact[result * 5 + place].full()
            assert np.isfinite(matrix).all()
            for column, number in enumerate(step.given[place]):
                d = 1e-6 * max(1.0, abs(number))
                ends = []
                for sign in (1.0, -1.0):
                    given = [*step.given]
                    given[place] = [*given[place]]
                    given[place][column] += sign * d
                    ends.append(advance(*given)[result].full().ravel())
                difference = (ends[0] - ends[1]) / (2 * d)
                np.testing.assert_allclose(
                    matrix[:, column], difference, rtol=1e-5, atol=1e-6 * (1 + abs(difference).max()),
                    err_msg=f"{result} {place} {column}"
                )
