"""The paper's Fig. 2 as straight-line Python: no FMI, no master, no ports.

Tests compare loops of FMUs and compiled programs with it. It consists of the vehicle, the proposed
controller or the PD controller, the disturbance and the planner of the paper.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from auv_fmu.language.vectors import Rotation, Vector3, Vector6
from auv_fmu.paper import motion_planner, output_feedback, pd, plant
from auv_fmu.paper.attitude import rotation_from_quaternion
from auv_fmu.paper.disturbance import Disturbance, disturbance
from auv_fmu.paper.euler import STEP, internal_steps, longest_step
from auv_fmu.paper.motion_planner import Motion, PlannerState, Reference
from auv_fmu.paper.output_feedback import Gains, Measurement
from auv_fmu.paper.pd import PdGains, PdMeasurement
from auv_fmu.paper.plant import PlantOutputs, PlantState

_ZERO: Vector3 = (0.0, 0.0, 0.0)


class LongestSteps(NamedTuple):
    """Largest internal step of each component [s]; a longer step is split evenly."""

    plant: float = STEP
    controller: float = STEP
    planner: float = STEP


class Setting(NamedTuple):
    """Parameters of every block of Fig. 2, with the values of section 4.1: the run of Fig. 4.

    As in the components, each block has its own parameters, such as the distance ell.
    """

    plant: plant.Parameters = plant.Parameters()
    controller: Gains | PdGains = Gains()
    disturbance: Disturbance = Disturbance()
    planner: motion_planner.Parameters = motion_planner.Parameters()
    h_max: LongestSteps = LongestSteps()
    h: float = STEP  #: [s]


#: Section 4.1.
PAPER = Setting()


class Splits(NamedTuple):
    """Number of internal steps of each component in a step."""

    plant: int
    controller: int
    planner: int


class Vehicles(NamedTuple):
    """The vehicle and the reference: their states, attitude and accelerations."""

    plant: PlantState
    rotation: Rotation  #: body to earth
    planner: PlannerState
    moving: Motion


class Scene(NamedTuple):
    """Outputs of vehicle, reference and disturbance at one instant."""

    plant: PlantOutputs
    y: Vector3  #: measured control point [m]
    reference: Reference
    tau_w: Vector6  #: disturbance (u, v, w, p, q, r) [N, N.m]


class Sent(NamedTuple):
    """Values that arrive at other blocks one step late in Jacobi order."""

    tau: Vector3  #: command (tau_u, tau_q, tau_r) [N, N.m]
    nu_r: Vector6  #: velocity of the vehicle through the water [m/s, rad/s]


class Moment(NamedTuple):
    """State of the loop at one time t_k, which determines the rest of a run."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    controller_state: Any
    before: Sent  #: values of the step that ends there


class Instant(NamedTuple):
    """All signals of Fig. 2 at one time t_k."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    measured: Measurement | PdMeasurement  #: inputs of the controller
    controller_state: Any  #: a ControllerState, or theta_hat of the PD controller
    signals: Any  #: Signals or PdSignals
    command: Vector3  #: (tau_u, tau_q, tau_r) that reaches the actuators [N, N.m]
    tau: Vector3  #: command after the limits of (3) [N, N.m]
    tau_w: Vector6  #: disturbance that acts (u, v, w, p, q, r) [N, N.m]


# The controllers


def measurement(gains: Gains | PdGains, seen: Scene) -> Measurement | PdMeasurement:
    """Inputs of the controller; only the PD controller gets the velocity."""
    if isinstance(gains, PdGains):
        return PdMeasurement(seen.y, seen.plant.euler, *seen.reference, seen.plant.dy)
    return Measurement(seen.y, seen.plant.euler, *seen.reference)


def first_state(gains: Gains | PdGains, y: Vector3) -> Any:
    """State of the controller at the start."""
    if isinstance(gains, PdGains):
        return gains.theta_0
    return output_feedback.initial_state(gains, y)


def gated(gains: Gains | PdGains, state: Any, y: Vector3) -> Any:
    """State of the controller after the gate, which the PD controller does not have."""
    return state if isinstance(gains, PdGains) else output_feedback.gated(gains, state, y)


def evaluate(gains: Gains | PdGains, state: Any, measured: Any, h: float) -> Any:
    """Signals of the controller."""
    if isinstance(gains, PdGains):
        return pd.evaluate(gains, state, measured)
    return output_feedback.evaluate(gains, state, measured, h)


def advanced(gains: Gains | PdGains, state: Any, signals: Any, h: float) -> Any:
    """State of the controller after a step of h seconds."""
    if isinstance(gains, PdGains):
        return pd.step(state, signals, h)
    return output_feedback.step(state, signals, h)


# The loop


def splits(setting: Setting) -> Splits:
    """Number of internal steps of each component."""
    return Splits(*(internal_steps(setting.h, longest_step(one)) for one in setting.h_max))


def vehicles_at_start(setting: Setting) -> Vehicles:
    """Vehicle and reference at the start."""
    own, of_planner = setting.plant, setting.planner
    state = plant.begin(own, plant.flow(own, _ZERO))
    planner = motion_planner.initial_state(of_planner.eta0, of_planner.nu0)
    moving = motion_planner.motion(of_planner.vehicle, planner, of_planner.tau_d)
    return Vehicles(state, rotation_from_quaternion(state.quaternion), planner, moving)


def scene(setting: Setting, vehicles: Vehicles, t: float, n: Vector3) -> Scene:
    """Outputs at time t [s].

    Args:
        setting: of the loop.
        vehicles: at that time.
        t: time [s].
        n: three independent standard normal numbers, of the localisation system.

    """
    own, of_planner = setting.plant, setting.planner
    seen = plant.outputs(vehicles.plant, vehicles.rotation, own.ell, own.roll.rolls)
    return Scene(
        seen,
        plant.measure(seen.y, n, own.noise.std),
        motion_planner.reference(vehicles.planner, vehicles.moving, of_planner.ell),
        disturbance(setting.disturbance, seen.nu_r, t),
    )


def begin(setting: Setting, n: Vector3) -> Moment:
    """The start.

    Args:
        setting: of the loop.
        n: three independent standard normal numbers.

    """
    vehicles = vehicles_at_start(setting)
    seen = scene(setting, vehicles, 0.0, n)
    state = first_state(setting.controller, seen.y)
    return Moment(0.0, vehicles, seen, state, Sent(_ZERO, seen.plant.nu_r))


def act(setting: Setting, moment: Moment, parts: Splits, delayed: bool) -> Instant:
    """All signals at a moment, from which a step begins.

    Args:
        setting: of the loop.
        moment: of the loop.
        parts: numbers of internal steps.
        delayed: if set, the command and the input of the disturbance arrive one step late, as in
            Jacobi order (reading 5).

    """
    t, seen, gains = moment.t, moment.scene, setting.controller
    measured = measurement(gains, seen)
    state = gated(gains, moment.controller_state, seen.y)
    signals = evaluate(gains, state, measured, setting.h / parts.controller)
    command, tau_w = signals.tau, seen.tau_w
    if delayed and t > 0.0:
        command = moment.before.tau
        tau_w = disturbance(setting.disturbance, moment.before.nu_r, t)
    tau = plant.applied(setting.plant, command)
    return Instant(t, moment.vehicles, seen, measured, state, signals, command, tau, tau_w)


def move(
    setting: Setting, vehicles: Vehicles, tau: Vector3, tau_w: Vector6, parts: Splits
) -> Vehicles:
    """Vehicle and reference one step later.

    Args:
        setting: of the loop.
        vehicles: at the beginning of the step.
        tau: command after the limits of (3) (tau_u, tau_q, tau_r) [N, N.m].
        tau_w: disturbance that acts (u, v, w, p, q, r) [N, N.m].
        parts: numbers of internal steps.

    """
    own, of_planner = setting.plant, setting.planner
    state, rotation = vehicles.plant, vehicles.rotation
    planner, moving = vehicles.planner, vehicles.moving
    h, h_d = setting.h / parts.plant, setting.h / parts.planner
    for _ in range(parts.plant):
        flow = plant.flow(own, _ZERO)
        state = plant.advance(own, state, rotation, tau, tau_w, flow, _ZERO, h)
        rotation = rotation_from_quaternion(state.quaternion)
    for _ in range(parts.planner):
        planner = motion_planner.step(planner, moving, h_d)
        moving = motion_planner.motion(of_planner.vehicle, planner, of_planner.tau_d)
    return Vehicles(state, rotation, planner, moving)


def step(setting: Setting, instant: Instant, parts: Splits, end: float, n: Vector3) -> Moment:
    """Advance all states together (reading 5).

    Args:
        setting: of the loop.
        instant: at the beginning of the step.
        parts: numbers of internal steps.
        end: time at its end [s].
        n: three independent standard normal numbers, for the measurement then.

    """
    gains, h_c = setting.controller, setting.h / parts.controller
    state = advanced(gains, instant.controller_state, instant.signals, h_c)
    for _ in range(parts.controller - 1):
        state = advanced(gains, state, evaluate(gains, state, instant.measured, h_c), h_c)
    vehicles = move(setting, instant.vehicles, instant.tau, instant.tau_w, parts)
    sent = Sent(instant.signals.tau, instant.scene.plant.nu_r)
    return Moment(end, vehicles, scene(setting, vehicles, end, n), state, sent)


def closed_loop(count: int, setting: Setting = PAPER, delayed: bool = False) -> Iterator[Instant]:
    """The loop in the paper's Euler scheme: all signals at t_k, then all states advance.

    Args:
        count: steps to take.
        setting: of the loop.
        delayed: as for :func:`act`.

    Yields:
        The instants t_0 = 0 to t_count, one more than steps.

    """
    parts = splits(setting)
    gauss = plant.white_noise(setting.plant.noise.seed).gauss
    moment = begin(setting, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)))
    for k in range(count + 1):
        instant = act(setting, moment, parts, delayed)
        yield instant
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        moment = step(setting, instant, parts, (k + 1) * setting.h, n)
