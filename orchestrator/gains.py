"""The gain check: the conditions of Theorems 1 and 2 for a set of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auv_fmu.proof.gain_conditions import Bounds, Condition, bounds, conditions
from auv_fmu.saturation import MAXIMUM_SLOPE
from orchestrator import bundle
from orchestrator.errors import InputError
from orchestrator.system import PortName, System, typed
from orchestrator.vehicle_parameters import vehicle

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
        InputError: a parameter does not exist, is of the wrong type, or belongs to neither the
            plant nor the controller.

    """
    system.check()

    def value(component: str, name: str) -> Any:
        variable = system.component(component).variable(name)
        port = PortName(component, name)
        return typed(str(port), variable, system.parameters.get(port, variable.start))

    saturation = value("controller", "saturation")
    if saturation not in MAXIMUM_SLOPE:
        raise InputError(
            f"controller.saturation = {saturation}: use one of {', '.join(MAXIMUM_SLOPE)}"
        )
    plant = vehicle(lambda name: float(value("plant", name)))
    known = bounds(plant, value("plant", "ell"))
    K1, K2 = (
        (
            value("controller", f"{K}[1]"),
            value("controller", f"{K}[2]"),
            value("controller", f"{K}[3]"),
        )
        for K in ("K1", "K2")
    )
    return known, conditions(
        known,
        K1,
        K2,
        value("controller", "lambda"),
        value("controller", "k_d"),
        MAXIMUM_SLOPE[saturation],
    )


def check(changes: Mapping[PortName, Any]) -> str:
    """The conditions in words and numbers, for the paper's gains with some changes.

    Raises:
        InputError: a parameter does not exist or is of the wrong type.

    """
    bundle.build(bundle.DEFAULT_FOLDER)
    system = bundle.closed_loop(bundle.DEFAULT_FOLDER).with_parameters(changes)
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
    lines += ["", _NOTE]
    if not changes:
        lines += ["", _PAPER]
    return "\n".join(lines)
