"""How many communication steps each component takes in one of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from math import gcd, isfinite, lcm
from numbers import Real

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import MOST_STEPS, ROUNDING
from orchestrator.system.component import Component
from orchestrator.system.structure import System

#: So many times a common measure of steps may go into the smallest of them.
_MOST_PARTS = 1000


def paces(system: System, step: float) -> dict[str, int]:
    """How many communication steps each component takes in one of its own.

    Args:
        system: that says which steps its components want.
        step: the communication step [s].

    Raises:
        InputError: a component's step is no multiple of it.

    """
    found = dict.fromkeys(system.components, 1)
    for name, own in system.steps.items():
        system.component(name)
        number = isinstance(own, Real) and not isinstance(own, bool)
        if not (number and isfinite(own) and own > 0.0):
            raise InputError(f"step of {name} {own!r}: must be a positive number of seconds")
        n = max(round(min(own / step, MOST_STEPS + 1.0)), 1)
        if abs(own / step - n) > ROUNDING * n:
            raise InputError(
                f"{name} wants steps of {own:g} s, which are no multiple of the communication "
                f"step of {step:g} s"
            )
        found[name] = n
    return found


def with_common_step(system: System) -> System:
    """A system that names no communication step with the longest that all components' fit.

    They are those that it names for them, or else the FMUs name; it names none if nobody does.

    Raises:
        InputError: they have none in common.

    """
    own = {name: step_of(component) for name, component in system.components.items()}
    steps = {name: step for name, step in own.items() if step is not None} | dict(system.steps)
    if not steps:
        return system
    return replace(system, steps=steps, step=_common_measure(steps.values()))


def step_of(component: Component) -> float | None:
    """The step that an FMU was made for [s]; None: it does not say."""
    step = component.experiment("stepSize")
    return step if step is not None and step > 0.0 else None


def _common_measure(steps: Iterable[float]) -> float:
    """The longest step of which all are multiples [s]: of the numbers as they are written."""
    exact = [Fraction(str(step)) for step in steps]
    denominator = lcm(*(step.denominator for step in exact))
    common = Fraction(gcd(*(int(step * denominator) for step in exact)), denominator)
    if min(exact) > _MOST_PARTS * common:
        listed = ", ".join(f"{float(step):g}" for step in sorted(set(exact)))
        raise InputError(
            f"the components want steps of {listed} s, which have no step in common; say which "
            "communication step to take, of which theirs are multiples"
        )
    return float(common)
