"""How Remus100 runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import plant, remus100
from auv_fmu.remus100 import Parameters, RemusState
from auv_fmu.vectors import Vector3, Vector6
from fmus.ports.port import Refusal

#: Largest diameter of a hull per length: near 1, Lamb's factors are differences of equal numbers.
_THICKEST = 0.9


class Inputs(NamedTuple):
    """Commands of fins and propeller, and how the water moves."""

    command: Vector3
    water: Vector3
    dwater: Vector3


class Outputs(TypedDict):
    """What is seen of the vehicle; y has no noise yet."""

    eta: Vector6
    nu: Vector6
    y: Vector3
    dy: Vector3
    tau_applied: Vector3
    nu_r: Vector6
    actuator: Vector3


def check(parameters: Parameters) -> None:
    """Refuse a hull that is no slender one, or that is heavier at its top."""
    hull = parameters.hull
    if not hull.diameter <= _THICKEST * hull.length:
        raise Refusal(
            f"diameter = {hull.diameter:g} must be at most {_THICKEST:g} times length = "
            f"{hull.length:g}: the added mass is that of a slender hull"
        )
    if not hull.r_bg[2] > 0.0:
        raise Refusal(
            f"r_bg.z = {hull.r_bg[2]:g} must be above 0: a vehicle with its centre of mass on top "
            "capsizes"
        )


def begin(parameters: Parameters, inputs: Inputs) -> tuple[RemusState, Outputs]:
    """State and outputs at the start."""
    state = remus100.begin(parameters, inputs.water)
    return state, _seen(parameters, state)


def advance(
    parameters: Parameters, state: RemusState, inputs: Inputs, h: float, n: int
) -> tuple[RemusState, Outputs]:
    """State and outputs after n steps of h seconds."""
    command, water, dwater = inputs
    state = remus100.steps(parameters, state, command, water, dwater, h, n)
    return state, _seen(parameters, state)


def seed(parameters: Parameters) -> int:
    """Of the noise."""
    return parameters.noise.seed


def measured(parameters: Parameters, y: Vector3, n: Vector3) -> Vector3:
    """The output y with noise, of three independent standard normal numbers."""
    return plant.measure(y, n, parameters.noise.std)


def expected(parameters: Parameters, state: RemusState, outputs: Outputs) -> Outputs:
    """The outputs that belong to a state and to the noise of y."""
    delta_r, delta_s, n = state.actuator
    delta_max, n_max = parameters.tail.delta_max, parameters.tail.n_max
    if not (abs(delta_r) <= delta_max and abs(delta_s) <= delta_max and abs(n) <= n_max):
        raise Refusal("its fins or its propeller are beyond their limits")
    remus100.check_speed(state)
    seen = _seen(parameters, state)
    return {
        "eta": seen["eta"],
        "nu": seen["nu"],
        "y": plant.measurable(seen["y"], outputs["y"], parameters.noise.std),
        "dy": seen["dy"],
        "tau_applied": seen["tau_applied"],
        "nu_r": seen["nu_r"],
        "actuator": seen["actuator"],
    }


def _seen(parameters: Parameters, state: RemusState) -> Outputs:
    y, dy = remus100.control(state, parameters.ell)
    tau = remus100.tail_forces(parameters.tail, state)
    return {
        "eta": (*state.position, *state.euler),
        "nu": state.nu,
        "y": y,
        "dy": dy,
        "tau_applied": (tau[0], tau[4], tau[5]),
        "nu_r": remus100.through_water(state),
        "actuator": state.actuator,
    }
