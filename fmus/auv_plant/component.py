"""Autonomous underwater vehicle with limited actuators and noisy position sensor."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import ACCELERATION, ETA, NU, POSITION, TAU, TAU_W, VELOCITY
from auv_fmu.language.vectors import Rotation, Vector3, Vector6
from auv_fmu.paper import plant
from auv_fmu.paper.attitude import rotation_from_quaternion
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.plant import Parameters, PlantOutputs, PlantState

H_MAX = STEP

#: Error of the squared length of a normalised quaternion, and the share of its range by which an
#: actuator with a lag may exceed its limits.
_ROUNDING = 2e-12


class Inputs(NamedTuple):
    """Commanded force and moments, the disturbance, and the motion of the water."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments")]
    tau_w: Annotated[Vector6, Variable(TAU_W, "Disturbance, with the sign of (2)")]
    water: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water in the earth frame, added to current")
    ]
    dwater: Annotated[
        Vector3, Variable(ACCELERATION, "Acceleration of the water in the earth frame")
    ]


class Seen(NamedTuple):
    """Values derived from the state."""

    rotation: Rotation  #: body to earth
    motion: PlantOutputs


class Margins(NamedTuple):
    """Distances from the limits at which the equations switch."""

    tau: Annotated[Vector3, Variable(TAU, "Distance of the command from the limits of (3)")]


class Outputs(NamedTuple):
    """Motion of the vehicle, and the applied force and moments."""

    eta: Annotated[
        Vector6,
        Variable(
            ETA, "Position of the centre of mass and Euler angles", feedthrough=(), initially=()
        ),
    ]
    nu: Annotated[Vector6, Variable(NU, "Velocity in the body frame", feedthrough=(), initially=())]
    y: Annotated[
        Vector3,
        Variable(POSITION, "Measured control point, with noise", feedthrough=(), initially=()),
    ]
    dy: Annotated[
        Vector3,
        Variable(VELOCITY, "True velocity of the control point", feedthrough=(), initially=()),
    ]
    tau_applied: Annotated[
        Vector3,
        Variable(
            TAU,
            "Force and moments after the limits of (3)",
            feedthrough=("tau.{}",),
            initially=(),
        ),
    ]
    nu_r: Annotated[
        Vector6,
        Variable(
            NU,
            "Velocity through the water in the body frame",
            feedthrough=(),
            initially=("water",),
        ),
    ]


def check(parameters: Parameters) -> None:
    """Refuse empty ranges of actuators, and a start with a roll that is held at zero."""
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


def start(parameters: Parameters, inputs: Inputs) -> PlantState:
    """Return the state at the start."""
    return plant.begin(parameters, plant.flow(parameters, inputs.water))


def derive(parameters: Parameters, state: PlantState) -> Seen:
    """Return the rotation and the outputs that follow from the state."""
    rotation = rotation_from_quaternion(state.quaternion)
    rolls = parameters.roll.rolls
    return Seen(rotation, plant.outputs(state, rotation, parameters.ell, rolls))


def update(
    parameters: Parameters, state: PlantState, derived: Seen, inputs: Inputs, h: float
) -> PlantState:
    """Return the state after a step."""
    tau, water = plant.applied(parameters, inputs.tau), plant.flow(parameters, inputs.water)
    return plant.advance(
        parameters, state, derived.rotation, tau, inputs.tau_w, water, inputs.dwater, h
    )


def outputs(parameters: Parameters, state: PlantState, derived: Seen, inputs: Inputs) -> Outputs:
    """Return the outputs; y has no noise yet."""
    euler, y, dy, nu, nu_r = derived.motion
    tau = plant.actuation(parameters, state, plant.applied(parameters, inputs.tau))
    return Outputs((*state.position, *euler), nu, y, dy, tau, nu_r)


def seed(parameters: Parameters) -> int:
    """Return the seed of the noise."""
    return parameters.noise.seed


def measured(parameters: Parameters, y: Vector3, n: Vector3) -> Vector3:
    """Add noise to the output y, from three independent standard normal numbers."""
    return plant.measure(y, n, parameters.noise.std)


def rates(parameters: Parameters, state: PlantState, derived: Seen, inputs: Inputs) -> PlantState:
    """Return the rates of the state."""
    tau, water = plant.applied(parameters, inputs.tau), plant.flow(parameters, inputs.water)
    return plant.state_rates(
        parameters, state, derived.rotation, tau, inputs.tau_w, water, inputs.dwater
    )


def switches(parameters: Parameters, inputs: Inputs) -> Margins:
    """Return the distances from the limits of (3)."""
    return Margins(plant.margins(parameters, inputs.tau))


def event(parameters: Parameters, state: PlantState, derived: Seen, inputs: Inputs) -> PlantState:
    """Return the same motion over ground, in water whose velocity may have jumped."""
    return plant.immersed(state, derived.rotation, plant.flow(parameters, inputs.water))


def check_state(parameters: Parameters, state: PlantState) -> None:
    """Refuse an invalid quaternion, a roll that is held at zero, and forces beyond the limits."""
    a, b, c, d = state.quaternion
    if not abs(a * a + b * b + c * c + d * d - 1.0) <= _ROUNDING:
        raise Refusal("its quaternion is not of length one")
    lower, upper = parameters.limits
    for k in range(3):
        slack = _ROUNDING * (upper[k] - lower[k])
        if not lower[k] - slack <= state.tau[k] <= upper[k] + slack:
            raise Refusal("its actuators are beyond their limits")
    if not parameters.roll.rolls:
        # The starboard axis is level.
        rotation = rotation_from_quaternion(state.quaternion)
        if state.nu_r[3] or not abs(rotation[1][2]) <= _ROUNDING:
            raise Refusal("its roll, which is held at zero, is not zero")
