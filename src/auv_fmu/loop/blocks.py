"""The blocks of the paper's Fig. 2 of which there are several, and what each does in the loop.

A loop has a controller, a planner, a vehicle and the water around it. The type of its parameters
says which one a block is. What it does are functions of the language of equations, so a loop of any
of them can be compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

from auv_fmu.guidance import path_planner
from auv_fmu.guidance.path_planner import PathState
from auv_fmu.language.vectors import Rotation, Vector3, Vector4, Vector6
from auv_fmu.paper import motion_planner, output_feedback, pd, plant
from auv_fmu.paper.actuators import Limits
from auv_fmu.paper.attitude import rotation_from_quaternion
from auv_fmu.paper.motion_planner import Motion, PlannerState, Reference
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.paper.pd import PdGains, PdMeasurement, PdSignals
from auv_fmu.paper.plant import PlantOutputs, PlantState
from auv_fmu.remus import allocation, remus100
from auv_fmu.remus.allocation import Allocated
from auv_fmu.remus.remus100 import RemusState
from auv_fmu.water import ocean_current, sea
from auv_fmu.water.ocean_current import Variation
from auv_fmu.water.sea import Sea, WaterMotion
from auv_fmu.water.waves import Components

#: Of water that flows steadily: its acceleration [m/s2].
_STEADY: Vector3 = (0.0, 0.0, 0.0)

_NO_VELOCITY: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

#: Before the first instant.
_NO_COMMAND: Vector3 = (0.0, 0.0, 0.0)

_UNLIMITED = Limits((-inf, -inf, -inf), (inf, inf, inf))

#: What there is nothing of.
Nothing = tuple[()]


class Scene(NamedTuple):
    """What vehicle, reference and water show at one instant."""

    plant: PlantOutputs
    y: Vector3  #: measured control point [m]
    reference: Reference
    tau_w: Vector6  #: disturbance (u, v, w, p, q, r) [N, N.m]
    water: WaterMotion  #: at the vehicle, beside its parameter `current`


# The controllers


class Law(NamedTuple):
    """A controller in the loop: what it is told, how it starts, what it commands, how it goes on.

    Before it commands, it may restart. What it goes by is what it has estimated, or been told.
    """

    measurement: Callable[[Scene], Any]
    start: Callable[[Any, Any], Any]
    gated: Callable[[Any, Any, Any], Any]
    evaluate: Callable[[Any, Any, Any, float], Any]
    step: Callable[[Any, Any, float], Any]
    estimates: Callable[[Scene, Any, Any], tuple[Vector3, Vector4]]


def measurement(seen: Scene) -> Measurement:
    """What the proposed controller is told."""
    y_d, dy_d, ddy_d = seen.reference
    return Measurement(seen.y, seen.plant.euler, y_d, dy_d, ddy_d)


def start(gains: Gains, measured: Measurement) -> ControllerState:
    """State of the proposed controller at the start."""
    return output_feedback.initial_state(gains, measured.y)


def gated(gains: Gains, state: ControllerState, measured: Measurement) -> ControllerState:
    """What the proposed controller goes on from at an instant."""
    return output_feedback.gated(gains, state, measured.y)


def estimates(seen: Scene, state: ControllerState, signals: Signals) -> tuple[Vector3, Vector4]:
    """Velocity and parameters that the proposed controller goes by: dy_hat and theta_hat."""
    return signals.dy_hat, state.theta_hat


def pd_measurement(seen: Scene) -> PdMeasurement:
    """What the PD controller is told."""
    y_d, dy_d, ddy_d = seen.reference
    return PdMeasurement(seen.y, seen.plant.euler, y_d, dy_d, ddy_d, seen.plant.dy)


def pd_start(gains: PdGains, measured: PdMeasurement) -> Vector4:
    """State of the PD controller at the start."""
    return gains.theta_0


def pd_gated(gains: PdGains, theta_hat: Vector4, measured: PdMeasurement) -> Vector4:
    """The PD controller has no gate."""
    return theta_hat


def pd_evaluate(gains: PdGains, theta_hat: Vector4, measured: PdMeasurement, h: float) -> PdSignals:
    """The signals of the PD controller, which know no step."""
    return pd.evaluate(gains, theta_hat, measured)


def pd_estimates(seen: Scene, theta_hat: Vector4, signals: PdSignals) -> tuple[Vector3, Vector4]:
    """Velocity and parameters that the PD controller goes by; it is told the velocity."""
    return seen.plant.dy, theta_hat


#: The controller that goes with a set of gains.
LAWS: dict[type, Law] = {
    Gains: Law(
        measurement, start, gated, output_feedback.evaluate, output_feedback.step, estimates
    ),
    PdGains: Law(pd_measurement, pd_start, pd_gated, pd_evaluate, pd.step, pd_estimates),
}


# The planners


class PlannerBlock(NamedTuple):
    """A planner in the loop; what follows from its state goes along with it.

    All but `parts` take its parameters first. A step is one of h seconds from a time on; `parts`
    says how many a communication step is split into, of those that it may be.
    """

    begin: Callable[[Any], tuple[Any, Any]]
    parts: Callable[[int], int]
    step: Callable[[Any, Any, Any, float, float], tuple[Any, Any]]
    reference: Callable[[Any, Any, Any], Reference]


def helix_begin(parameters: motion_planner.Parameters) -> tuple[PlannerState, Motion]:
    """The reference vehicle at the start, and its motion."""
    state = motion_planner.initial_state(parameters.eta0, parameters.nu0)
    return state, motion_planner.motion(parameters.vehicle, state, parameters.tau_d)


def helix_parts(n: int) -> int:
    """The reference vehicle moves in all of them."""
    return n


def helix_step(
    parameters: motion_planner.Parameters, state: PlannerState, moving: Motion, t: float, h: float
) -> tuple[PlannerState, Motion]:
    """The reference vehicle after a step, and its motion."""
    state = motion_planner.step(state, moving, h)
    return state, motion_planner.motion(parameters.vehicle, state, parameters.tau_d)


def helix_reference(
    parameters: motion_planner.Parameters, state: PlannerState, moving: Motion
) -> Reference:
    """The reference that the reference vehicle makes."""
    return motion_planner.reference(state, moving, parameters.ell)


def path_begin(parameters: path_planner.Parameters) -> tuple[PathState, Nothing]:
    """The start of a path."""
    return path_planner.initial_state(parameters.waypoints, 0.0), ()


def path_parts(n: int) -> int:
    """The reference on a path is known at any time."""
    return 1


def path_step(
    parameters: path_planner.Parameters, state: PathState, derived: Nothing, t: float, h: float
) -> tuple[PathState, Nothing]:
    """The reference on a path after a step."""
    return path_planner.advance(parameters.waypoints, state, t + h), derived


def path_reference(
    parameters: path_planner.Parameters, state: PathState, derived: Nothing
) -> Reference:
    """The reference on a path."""
    return path_planner.reference(parameters.waypoints, state.ahead, state.t)


#: The planner that goes with a set of parameters.
PLANNERS: dict[type, PlannerBlock] = {
    motion_planner.Parameters: PlannerBlock(helix_begin, helix_parts, helix_step, helix_reference),
    path_planner.Parameters: PlannerBlock(path_begin, path_parts, path_step, path_reference),
}


# The water


class SeaWaves(NamedTuple):
    """A sea, and the waves that it is a sum of; they do not change during a run."""

    sea: Sea
    waves: Components


class WaterBlock(NamedTuple):
    """Water in the loop: its state at the start, its motion at a place and time, its state later.

    All take its parameters first.
    """

    begin: Callable[[Any], Any]
    motion: Callable[[Any, Any, Vector3, float], WaterMotion]
    later: Callable[[Any, Any, float], Any]


def sea_waves(parameters: Sea) -> SeaWaves:
    """A sea by its parameters."""
    return SeaWaves(parameters, sea.regular_waves(parameters))


def sea_begin(water: SeaWaves) -> Variation:
    """What varies in a sea, at the start."""
    return ocean_current.begin(water.sea.current)


def sea_motion(water: SeaWaves, state: Variation, position: Vector3, t: float) -> WaterMotion:
    """How the water of a sea moves at a position [m] and a time [s]."""
    return sea.water(water.sea, water.waves, state, position, t)


def sea_later(water: SeaWaves, state: Variation, h: float) -> Variation:
    """What varies in a sea, h seconds later."""
    return ocean_current.advance(water.sea.current, state, h)


def steady_begin(water: Vector3) -> Nothing:
    """Nothing varies in steady water."""
    return ()


def steady_motion(water: Vector3, state: Nothing, position: Vector3, t: float) -> WaterMotion:
    """Steady water moves with one velocity [m/s] everywhere."""
    return WaterMotion(water, _STEADY, 0.0)


def steady_later(water: Vector3, state: Nothing, h: float) -> Nothing:
    """Nothing varies in steady water."""
    return state


#: The water that goes with a velocity, or with a sea.
WATERS: dict[type, WaterBlock] = {
    tuple: WaterBlock(steady_begin, steady_motion, steady_later),
    SeaWaves: WaterBlock(sea_begin, sea_motion, sea_later),
}


# The vehicles


class VehicleBlock(NamedTuple):
    """A vehicle in the loop; what follows from its state goes along with it.

    Between the commanded (tau_u, tau_q, tau_r) and the vehicle there may be an allocation, whose
    outputs are what is allocated. What drives the vehicle follows from either.

    Attributes:
        begin: state at the start, from the velocity of the water.
        outputs: what is seen of it.
        disturbed: the velocity that the disturbance is told, of that through the water.
        idle: what is allocated before the first instant.
        allocate: of a command, with the velocity through the water.
        driving: what drives it, from the command that reaches it and what is allocated.
        step: one of h seconds, with what drives it, the disturbance and the water.
        acting: force and moments (tau_u, tau_q, tau_r) that act, with what drives it [N, N.m].
        limits: of a command.

    """

    begin: Callable[[Any, Vector3], tuple[Any, Any]]
    outputs: Callable[[Any, Any, Any], PlantOutputs]
    disturbed: Callable[[Vector6], Vector6]
    idle: Callable[[], Any]
    allocate: Callable[[Any, Vector3, Vector6], Any]
    driving: Callable[[Any, Vector3, Any], Vector3]
    step: Callable[[Any, Any, Any, Vector3, Vector6, WaterMotion, float], tuple[Any, Any]]
    acting: Callable[[Any, Any, Vector3], Vector3]
    limits: Callable[[Any], Limits]


def plant_begin(parameters: plant.Parameters, water: Vector3) -> tuple[PlantState, Rotation]:
    """The paper's vehicle at the start, and its attitude."""
    state = plant.begin(parameters, plant.flow(parameters, water))
    return state, rotation_from_quaternion(state.quaternion)


def plant_outputs(
    parameters: plant.Parameters, state: PlantState, rotation: Rotation
) -> PlantOutputs:
    """What is seen of the paper's vehicle."""
    return plant.outputs(state, rotation, parameters.ell, parameters.roll.rolls)


def plant_disturbed(nu_r: Vector6) -> Vector6:
    """The disturbance is told the velocity of the paper's vehicle through the water."""
    return nu_r


def plant_idle() -> Nothing:
    """The paper's vehicle has no allocation."""
    return ()


def plant_allocate(allocating: None, tau: Vector3, nu_r: Vector6) -> Nothing:
    """The paper's vehicle has no allocation."""
    return ()


def plant_driving(parameters: plant.Parameters, tau: Vector3, allocated: Nothing) -> Vector3:
    """What the limits (3) leave of a command (tau_u, tau_q, tau_r) [N, N.m]."""
    return plant.applied(parameters, tau)


def plant_step(
    parameters: plant.Parameters,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
    water: WaterMotion,
    h: float,
) -> tuple[PlantState, Rotation]:
    """The paper's vehicle after a step, and its attitude."""
    flow, dwater = plant.flow(parameters, water.velocity), water.acceleration
    state = plant.advance(parameters, state, rotation, tau, tau_w, flow, dwater, h)
    return state, rotation_from_quaternion(state.quaternion)


def plant_acting(parameters: plant.Parameters, state: PlantState, tau: Vector3) -> Vector3:
    """What the actuators of the paper's vehicle give."""
    return plant.actuation(parameters, state, tau)


def plant_limits(parameters: plant.Parameters) -> Limits:
    """The limits (3)."""
    return parameters.limits


def remus_begin(parameters: remus100.Parameters, water: Vector3) -> tuple[RemusState, Nothing]:
    """The REMUS 100 at the start."""
    return remus100.begin(parameters, water), ()


def remus_outputs(
    parameters: remus100.Parameters, state: RemusState, derived: Nothing
) -> PlantOutputs:
    """What is seen of the REMUS 100."""
    y, dy = remus100.control(state, parameters.ell)
    return PlantOutputs(state.euler, y, dy, state.nu, remus100.through_water(state))


def remus_disturbed(nu_r: Vector6) -> Vector6:
    """The disturbance has nothing to do with the REMUS 100, and is told nothing of it."""
    return _NO_VELOCITY


def remus_idle() -> Allocated:
    """Nothing is allocated yet."""
    return Allocated(_NO_COMMAND, _NO_COMMAND)


def remus_allocate(allocating: allocation.Parameters, tau: Vector3, nu_r: Vector6) -> Allocated:
    """Fins and propeller for a force and two moments."""
    return allocation.evaluate(allocating, tau, (nu_r[0], nu_r[1], nu_r[2]))


def remus_driving(parameters: remus100.Parameters, tau: Vector3, allocated: Allocated) -> Vector3:
    """Commands of fins and propeller (delta_r, delta_s, n) [rad, rad, rad/s]."""
    return allocated.command


def remus_step(
    parameters: remus100.Parameters,
    state: RemusState,
    derived: Nothing,
    drive: Vector3,
    tau_w: Vector6,
    water: WaterMotion,
    h: float,
) -> tuple[RemusState, Nothing]:
    """The REMUS 100 after a step; no disturbance acts on it."""
    flow, dwater = water.velocity, water.acceleration
    return remus100.advance(parameters, state, drive, flow, dwater, h), derived


def remus_acting(parameters: remus100.Parameters, state: RemusState, drive: Vector3) -> Vector3:
    """What fins and propeller give."""
    tau = remus100.tail_forces(parameters.tail, state)
    return tau[0], tau[4], tau[5]


def remus_limits(parameters: remus100.Parameters) -> Limits:
    """The REMUS 100 limits no force or moment."""
    return _UNLIMITED


#: The vehicle that goes with a set of parameters.
VEHICLES: dict[type, VehicleBlock] = {
    plant.Parameters: VehicleBlock(
        plant_begin,
        plant_outputs,
        plant_disturbed,
        plant_idle,
        plant_allocate,
        plant_driving,
        plant_step,
        plant_acting,
        plant_limits,
    ),
    remus100.Parameters: VehicleBlock(
        remus_begin,
        remus_outputs,
        remus_disturbed,
        remus_idle,
        remus_allocate,
        remus_driving,
        remus_step,
        remus_acting,
        remus_limits,
    ),
}


class Blocks(NamedTuple):
    """Which blocks a loop has."""

    controller: Law
    planner: PlannerBlock
    vehicle: VehicleBlock
    water: WaterBlock
