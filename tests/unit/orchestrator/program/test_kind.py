"""Noise that is a term of a sum, and noise that is not."""

from __future__ import annotations

import pytest

from fmus.language.build import Program
from orchestrator.program.kind import is_added
from support.language import module_of

TEXT = """
from typing import NamedTuple
from math import sqrt

class Parameters(NamedTuple):
    std: float
    on: bool
    power: int

def scaled(x: float, by: float) -> float:
    made = 0.0
    for k in range(3):
        last = made
        made = last + x * by
    return made

def measured(parameters: Parameters, y: float, n: tuple[float, float]) -> float:
    a, b = n
    std = parameters.std
    BODY
"""

ADDED = (
    "return y + std * a",
    "return (y - a * b * std) / std",
    "return y * y + (a if parameters.on else b) / 2.0",
    "return sqrt(abs(y)) - scaled(b, std)",
    "return scaled(y + a, std)",
    "return y",
)

NOT_ADDED = (
    "return y * (1.0 + std * a)",
    "return y + std * abs(a)",
    "return min(y, a)",
    "return y / (1.0 + a * a)",
    "return y + (std if a > 0.0 else 0.0)",
    "return a * std if y > 0.0 else y",
    "return y + n[int(y)]",
    "return scaled(y, std * a)",
    "return scaled(a, y)",
    "if y > 1.0:\n        return y + a\n    return y",
    "for k in range(int(y)):\n        std = std + a\n    return std",
)


@pytest.mark.parametrize(
    ("body", "wanted"), [*((body, True) for body in ADDED), *((body, False) for body in NOT_ADDED)]
)
def test_noise_is_added_as_a_term_that_depends_on_nothing_else(body, wanted, tmp_path):
    module = module_of(TEXT.replace("BODY", body), tmp_path)
    program = Program(module.measured)
    program.check()
    assert is_added(program.function(module.measured), "n", "y") is wanted
