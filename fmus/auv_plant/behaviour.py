"""How AuvPlant runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import plant
from auv_fmu.attitude import rotation_from_quaternion
from auv_fmu.plant import Parameters, PlantState
from auv_fmu.vectors import Rotation, Vector3, Vector6
from fmus.ports.port import Refusal

#: By how much the square of the length of a normalised quaternion is off.
_ROUNDING = 2e-12


class Inputs(NamedTuple):
    """Commanded force and moments, the disturbance, and how the water moves."""

    tau: Vector3
    tau_w: Vector6
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


def check(parameters: Parameters) -> None:
    """Refuse limits that leave an actuator nothing, and a start with a roll that is held."""
    lower, upper = parameters.limits
    _check_limits("u", lower[0], upper[0])
    _check_limits("q", lower[1], upper[1])
    _check_limits("r", lower[2], upper[2])
    if not parameters.roll.rolls:
        _check_roll("eta0.phi", parameters.eta0[3])
        _check_roll("nu0.p", parameters.nu0[3])


def _check_limits(k: str, tau_min: float, tau_max: float) -> None:
    if not tau_min < tau_max:
        raise Refusal(f"tau_min.{k} = {tau_min:g} must be below tau_max.{k} = {tau_max:g}")


def _check_roll(name: str, value: float) -> None:
    if value:
        raise Refusal(f"{name} = {value:g} must be 0 where roll is false")


def begin(parameters: Parameters, inputs: Inputs) -> tuple[PlantState, Rotation, Outputs]:
    """State, its attitude and outputs at the start."""
    tau, water = plant.applied(parameters, inputs.tau), plant.flow(parameters, inputs.water)
    state, rotation = plant.begin(parameters, tau, water)
    return state, rotation, _seen(parameters, state, rotation)


def derive(state: PlantState) -> Rotation:
    """What a step needs of the state, and the outputs before it have needed already."""
    return rotation_from_quaternion(state.quaternion)


def advance(
    parameters: Parameters, state: PlantState, derived: Rotation, inputs: Inputs, h: float, n: int
) -> tuple[PlantState, Rotation, Outputs]:
    """State, its attitude and outputs after n steps of h seconds."""
    tau, water = plant.applied(parameters, inputs.tau), plant.flow(parameters, inputs.water)
    state, derived = plant.steps(
        parameters, state, derived, tau, inputs.tau_w, water, inputs.dwater, h, n
    )
    return state, derived, _seen(parameters, state, derived)


def seed(parameters: Parameters) -> int:
    """Of the noise."""
    return parameters.noise.seed


def measured(parameters: Parameters, y: Vector3, n: Vector3) -> Vector3:
    """The output y with noise, of three independent standard normal numbers."""
    return plant.measure(y, n, parameters.noise.std)


def expected(parameters: Parameters, state: PlantState, outputs: Outputs) -> Outputs:
    """The outputs that belong to a state and to what else some outputs show."""
    a, b, c, d = state.quaternion
    if not abs(a * a + b * b + c * c + d * d - 1.0) <= _ROUNDING:
        raise Refusal("its quaternion is not of length one")
    rotation = rotation_from_quaternion(state.quaternion)
    if not parameters.roll.rolls:
        _check_level(state, rotation)
    seen = _seen(parameters, state, rotation)
    return {
        "eta": seen["eta"],
        "nu": seen["nu"],
        "y": plant.measurable(seen["y"], outputs["y"], parameters.noise.std),
        "dy": seen["dy"],
        "tau_applied": plant.applied(parameters, seen["tau_applied"]),
        "nu_r": seen["nu_r"],
    }


def _check_level(state: PlantState, rotation: Rotation) -> None:
    """Refuse a state that rolls: the starboard axis is no longer level."""
    if state.nu_r[3] or not abs(rotation[1][2]) <= _ROUNDING:
        raise Refusal("its roll, which is held at zero, is not zero")


def _seen(parameters: Parameters, state: PlantState, rotation: Rotation) -> Outputs:
    euler, y, dy, nu, nu_r = plant.outputs(state, rotation, parameters.ell, parameters.roll.rolls)
    return {
        "eta": (*state.position, *euler),
        "nu": nu,
        "y": y,
        "dy": dy,
        "tau_applied": state.tau,
        "nu_r": nu_r,
    }
