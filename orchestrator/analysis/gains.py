"""The gain check: the conditions of Theorems 1 and 2 for a set of parameters."""

from __future__ import annotations

from typing import Any

from auv_fmu.proof.gain_conditions import Bounds, Condition, bounds, conditions
from auv_fmu.proof.sampling import observer_rate
from auv_fmu.saturation import MAXIMUM_SLOPE
from orchestrator.analysis.signals import ELL, vehicle
from orchestrator.errors import InputError
from orchestrator.system.names import port_name
from orchestrator.system.structure import System

#: What the paper says of these conditions, in Remark 4, and what they leave open.
_NOTE = """\
The conditions are sufficient, and Remark 4 calls them conservative: a run may well be stable
where they are violated. The zetas of (26) and (29) bound terms of the unknown vehicle and cannot
be computed; a condition that needs them is only shown to be possible, never met."""

_PAPER = """\
These are the paper's own gains, and they miss (30): lambda_min(K_2 Lambda) = 10 is not above 15."""


def evaluate(system: System) -> tuple[Bounds, tuple[Condition, ...]]:
    """Bounds of the vehicle and conditions on the gains, from the parameters of a system.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    system.check()

    def value(name: str) -> Any:
        return system.value(port_name(name))

    saturation = value("controller.saturation")
    if saturation not in MAXIMUM_SLOPE:
        raise InputError(
            f"controller.saturation = {saturation}: use one of {', '.join(MAXIMUM_SLOPE)}"
        )
    known = bounds(vehicle(value), value(ELL))
    K1, K2 = (tuple(value(f"controller.{K}[{i}]") for i in range(1, 4)) for K in ("K1", "K2"))
    return known, conditions(
        known,
        K1,
        K2,
        value("controller.lambda"),
        value("controller.k_d"),
        MAXIMUM_SLOPE[saturation],
    )


def check(system: System) -> str:
    """The conditions in words and numbers, for the parameters of a system.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    known, found = evaluate(system)
    lines = [
        "over all attitudes:",
        f"  lambda_m2 = {known.lambda_m2:.6g} kg, lambda_M2 = {known.lambda_M2:.6g} kg",
        f"  lambda_d2 = {known.lambda_d2:.6g} kg/s, lambda_D2 = {known.lambda_D2:.6g} kg/s",
        "",
    ]
    for condition in found:
        rest = f" + {condition.zetas}" if condition.zetas else ""
        lines += [
            f"{condition.number}  {condition.statement}",
            f"  {condition.left:.6g} > {condition.right:.6g}{rest}: {condition.verdict}",
        ]
    lines += ["", _NOTE, "", *_sampling(system)]
    if not system.parameters:
        lines += ["", _PAPER]
    return "\n".join(lines)


def _sampling(system: System) -> list[str]:
    """What the step asks of k_d."""
    lambda_, k_d, h = (
        float(system.value(port_name(f"controller.{name}")) or 0.0)
        for name in ("lambda", "k_d", "h_max")
    )
    rate = observer_rate(lambda_, k_d)
    return [
        f"Euler's scheme with internal steps of {h:g} s: the observer's fastest mode has the rate "
        f"{rate:.4g} 1/s,",
        f"h p = {h * rate:.3g}: it changes its sign in every step above 1, and grows above 2.",
    ]
