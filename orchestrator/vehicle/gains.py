"""The gain check: Theorem 1 or 2 for a set of parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from auv_fmu.control_point import ELL as CONTROL_POINT
from auv_fmu.output_feedback import Gains
from auv_fmu.proof.attraction import Theorem, theorem
from auv_fmu.proof.gain_conditions import observer_rate
from auv_fmu.saturation import MAXIMUM_SLOPE
from auv_fmu.vehicle import Vehicle
from orchestrator.machine.errors import InputError
from orchestrator.system.names import port_name
from orchestrator.system.structure import System
from orchestrator.vehicle.cautions import gain_of_a_step
from orchestrator.vehicle.signals import STANDARD, Loop, loops_of, vehicle

#: What the paper says of these conditions, in Remark 4, and what they leave open.
_NOTE = """\
The conditions are sufficient, and Remark 4 calls them conservative: a run may well be stable
where they are violated. The zetas of (26) and (29) are known from below only, by states of a level
vehicle. C_2 has a pole at the vertical, so that no finite zetas hold at all attitudes: open means
that a condition may hold for pitches that keep off it. The report has the proofs, under "What is
wrong in the paper"; so has docs/paper.md."""

_PAPER = """\
These are the paper's own gains: as printed they miss (30), and (31) in any unit of speed."""


def evaluate(system: System, loop: Loop = STANDARD) -> Theorem:
    """The theorem for the parameters of a loop.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    system.check()

    def value(name: str) -> Any:
        return system.value(port_name(name))

    def of(name: str) -> Any:
        return value(f"{loop.controller}.{name}")

    saturation = of("saturation")
    if saturation not in MAXIMUM_SLOPE:
        raise InputError(
            f"{loop.controller}.saturation = {saturation}: use one of {', '.join(MAXIMUM_SLOPE)}"
        )
    K1, K2 = (tuple(of(f"{K}[{i}]") for i in range(1, 4)) for K in ("K1", "K2"))
    gains = Gains(K1=K1, K2=K2, lambda_=of("lambda"), k_d=of("k_d"), gamma=of("gamma"))
    return theorem(vehicle(value, loop), value(loop.ell), gains, MAXIMUM_SLOPE[saturation])


def check(system: System) -> str:
    """The theorem in words and numbers, for the parameters of each loop of a system.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    loops = loops_of(system)
    lines: list[str] = []
    for loop in loops:
        found = evaluate(system, loop)
        if len(loops) > 1:
            lines += [f"{loop.vehicle}:", ""]
        lines += [*stated(found), "", _NOTE, "", *_sampling(system, loop)]
        if found == theorem(Vehicle(), CONTROL_POINT, Gains(), MAXIMUM_SLOPE["tanh"]):
            lines += ["", _PAPER]
        lines.append("")
    return "\n".join(lines[:-1])


def stated(found: Theorem) -> Iterator[str]:
    """Bounds, conditions, alphas and region of attraction, in lines."""
    known, zetas, alphas = found.bounds, found.zetas, found.alphas
    yield "over all attitudes:"
    yield f"  lambda_m2 = {known.lambda_m2:.6g} kg, lambda_M2 = {known.lambda_M2:.6g} kg"
    yield f"  lambda_d2 = {known.lambda_d2:.6g} kg/s, lambda_D2 = {known.lambda_D2:.6g} kg/s"
    yield ""
    yield "as printed, with speeds in m/s:"
    yield f"  zeta_1 + zeta_2 >= {zetas.zeta_1_2:.4g} kg/s"
    yield f"  zeta_3 + zeta_4 >= {zetas.zeta_3_4:.4g} kg/s"
    for condition in found.conditions:
        least = f" + {condition.zetas}, at least {condition.right + condition.least:.4g}"
        yield f"  {condition.number}  {condition.statement}"
        yield (
            f"    {condition.left:.6g} > {condition.right:.6g}{least if condition.zetas else ''}: "
            f"{condition.verdict}"
        )
    if found.zeta_of_any_gains >= known.lambda_d2:
        least = f"{known.lambda_d2:.6g} > 0.5 (zeta_1 + zeta_2), at least "
        yield f"  (31), (53)  with any gains: {least}{found.zeta_of_any_gains:.4g}: violated"
    yield (
        f"  (40)  alpha_1 = {alphas.alpha_1:.4g}, alpha_2 = {alphas.alpha_2:.4g}, "
        f"alpha_3 <= {alphas.alpha_3:.4g}, alpha_4 <= {alphas.alpha_4:.4g}"
    )
    yield (
        f"  (33)  R_A lies within |vartheta| < {found.radius:.3g}"
        if found.radius
        else "  (33)  R_A is empty"
    )
    yield (
        "  (42)  with (26) asked for on a ball of x only: holds for "
        f"|x| < {found.x_at_most:.3g} at most, with any gains for |x| < {found.x_of_any_gains:.3g}"
    )
    yield ""
    yield "with any gains, and with speeds in any unit:"
    yield (
        f"  (31), (53)  asks for lambda < {2.0 * found.speed_of_any_gains:.3g} m/s and "
        f"|dy_d| < {found.speed_of_any_gains:.3g} m/s"
    )
    yield f"  (40)  alpha_1 < {found.alpha_1_of_any_gains:.3g} W, where (31) holds"
    yield f"  (42)  holds for |r_1| < {found.speed_of_any_gains:.3g} m/s at most"


def _sampling(system: System, loop: Loop) -> list[str]:
    """What the step asks of k_d."""
    lambda_, h = (
        float(system.value(port_name(f"{loop.controller}.{name}")) or 0.0)
        for name in ("lambda", "h_max")
    )
    rate = observer_rate(lambda_, gain_of_a_step(system, h, loop.controller))
    return [
        f"Euler's scheme with internal steps of {h:g} s: the observer's fastest mode has the rate "
        f"{rate:.4g} 1/s,",
        f"h p = {h * rate:.3g}: it changes its sign in every step above 1, and grows above 2.",
    ]
