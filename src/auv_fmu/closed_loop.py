"""The paper's Fig. 2 as one straight line of Python: no FMI, no master, no ports.

Everything else that runs this loop is held against it. What happens at an instant and between two
of them is written as functions of the language of equations, so that it can be compiled;
:func:`closed_loop` puts them in a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from auv_fmu import motion_planner, output_feedback, pd, plant
from auv_fmu.disturbance import Disturbance, disturbance
from auv_fmu.euler import STEP, internal_steps, longest_step
from auv_fmu.motion_planner import Motion, PlannerState, Reference
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.pd import PdGains, PdMeasurement, PdSignals
from auv_fmu.plant import PlantOutputs, PlantState
from auv_fmu.vectors import Rotation, Vector3, Vector4, Vector6

#: Before the first instant.
_NO_COMMAND: Vector3 = (0.0, 0.0, 0.0)
_UNDISTURBED: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

#: Acceleration of the water [m/s2]: the loop of Fig. 2 has only a constant current.
_STEADY: Vector3 = (0.0, 0.0, 0.0)


class LongestSteps(NamedTuple):
    """Largest internal step of each component [s]; a longer step is split evenly."""

    plant: float = STEP
    controller: float = STEP
    planner: float = STEP


class Setting(NamedTuple):
    """Parameters of every block of Fig. 2, with the values of section 4.1: the run of Fig. 4.

    Each block has its own, the distance ell and the vehicle too, as the components have.
    """

    plant: plant.Parameters = plant.Parameters()
    controller: Gains | PdGains = Gains()  #: the proposed controller, or the PD one
    disturbance: Disturbance = Disturbance()
    planner: motion_planner.Parameters = motion_planner.Parameters()
    h_max: LongestSteps = LongestSteps()
    h: float = STEP  #: [s]


#: Section 4.1.
PAPER = Setting()


class Splits(NamedTuple):
    """How many internal steps each component makes of a step."""

    plant: int
    controller: int
    planner: int


def splits(setting: Setting, h: float) -> Splits:
    """How a step of h seconds is split."""
    longest = setting.h_max
    return Splits(
        internal_steps(h, longest_step(longest.plant)),
        internal_steps(h, longest_step(longest.controller)),
        internal_steps(h, longest_step(longest.planner)),
    )


class Vehicles(NamedTuple):
    """The vehicle, and the reference vehicle."""

    plant: PlantState
    rotation: Rotation  #: attitude of the first, body to earth
    planner: PlannerState
    moving: Motion  #: of the second


class Scene(NamedTuple):
    """What both show at one instant."""

    plant: PlantOutputs
    y: Vector3  #: measured control point [m]
    reference: Reference
    tau_w: Vector6  #: disturbance (u, v, w, p, q, r) [N, N.m]


def vehicles_at_start(setting: Setting) -> Vehicles:
    """Both vehicles at the start."""
    state, rotation = plant.begin(setting.plant, _NO_COMMAND, setting.plant.current)
    planned, moving = motion_planner.begin(setting.planner)
    return Vehicles(state, rotation, planned, moving)


def scene(setting: Setting, vehicles: Vehicles, t: float, n: Vector3) -> Scene:
    """What is seen of both vehicles at time t [s].

    Args:
        setting: of the loop.
        vehicles: at that time.
        t: time [s].
        n: three independent standard normal numbers, of the localisation system.

    """
    _, rotation, planner, moving = vehicles
    seen = plant.outputs(vehicles.plant, rotation, setting.plant.ell, setting.plant.roll.rolls)
    return Scene(
        seen,
        plant.measure(seen.y, n, setting.plant.noise.std),
        motion_planner.reference(planner, moving, setting.planner.ell),
        disturbance(setting.disturbance, seen.nu_r, t),
    )


def move(
    setting: Setting, vehicles: Vehicles, tau: Vector3, tau_w: Vector6, h: float, parts: Splits
) -> Vehicles:
    """Both vehicles one step later.

    Args:
        setting: of the loop.
        vehicles: at the beginning of the step.
        tau: (tau_u, tau_q, tau_r) after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].
        parts: that the step is split into.

    """
    _, rotation, planner, moving = vehicles
    water, n, n_d = setting.plant.current, parts.plant, parts.planner
    state, rotation = plant.steps(
        setting.plant, vehicles.plant, rotation, tau, tau_w, water, _STEADY, h / n, n
    )
    planner, moving = motion_planner.steps(setting.planner, planner, moving, h / n_d, n_d)
    return Vehicles(state, rotation, planner, moving)


class Moment(NamedTuple):
    """All that the rest of a run depends on, at one time t_k."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    controller_state: Any
    before: tuple[Vector3, Vector6]  #: command and disturbance of the step that ends there


class Instant(NamedTuple):
    """All signals of Fig. 2 at one time t_k."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    measured: Any  #: what the controller is told: Measurement or PdMeasurement
    controller_state: Any  #: a ControllerState; of the PD controller theta_hat
    signals: Any  #: Signals or PdSignals
    command: Vector3  #: (tau_u, tau_q, tau_r) as it reaches the actuators [N, N.m]
    tau: Vector3  #: what the limits of (3) leave of it [N, N.m]
    tau_w: Vector6  #: disturbance that acts (u, v, w, p, q, r) [N, N.m]


# The controllers in the loop


def measurement(seen: Scene) -> Measurement:
    """What the proposed controller is told."""
    y_d, dy_d, ddy_d = seen.reference
    return Measurement(seen.y, seen.plant.euler, y_d, dy_d, ddy_d)


def start(gains: Gains, measured: Measurement) -> ControllerState:
    """State of the proposed controller at the start."""
    return output_feedback.initial_state(gains, measured.y)


def command(
    gains: Gains, state: ControllerState, measured: Measurement, h: float
) -> tuple[ControllerState, Signals]:
    """What the proposed controller goes on from at an instant, and its signals."""
    state = output_feedback.gated(gains, state, measured.y)
    return state, output_feedback.evaluate(gains, state, measured, h)


def estimates(instant: Instant) -> tuple[Vector3, Vector4]:
    """Velocity and parameters that the proposed controller goes by: dy_hat and theta_hat."""
    return instant.signals.dy_hat, instant.controller_state.theta_hat


def pd_measurement(seen: Scene) -> PdMeasurement:
    """What the PD controller is told."""
    y_d, dy_d, ddy_d = seen.reference
    return PdMeasurement(seen.y, seen.plant.euler, y_d, dy_d, ddy_d, seen.plant.dy)


def pd_start(gains: PdGains, measured: PdMeasurement) -> Vector4:
    """State of the PD controller at the start."""
    return gains.theta_0


def pd_command(
    gains: PdGains, theta_hat: Vector4, measured: PdMeasurement, h: float
) -> tuple[Vector4, PdSignals]:
    """What the PD controller goes on from at an instant, and its signals."""
    return theta_hat, pd.evaluate(gains, theta_hat, measured)


def pd_estimates(instant: Instant) -> tuple[Vector3, Vector4]:
    """Velocity and parameters that the PD controller goes by; it is told the velocity."""
    return instant.scene.plant.dy, instant.controller_state


class Law(NamedTuple):
    """A controller in the loop: what it is told, how it starts, what it commands, how it goes on.

    What it goes by is what it has estimated, or been told.
    """

    measurement: Callable[[Scene], Any]
    start: Callable[[Any, Any], Any]
    command: Callable[[Any, Any, Any, float], tuple[Any, Any]]
    steps: Callable[[Any, Any, Any, Any, float, int], Any]
    estimates: Callable[[Instant], tuple[Vector3, Vector4]]


#: The controller that goes with a set of gains.
LAWS: dict[type, Law] = {
    Gains: Law(measurement, start, command, output_feedback.steps, estimates),
    PdGains: Law(pd_measurement, pd_start, pd_command, pd.steps, pd_estimates),
}


# The loop


def begin(setting: Setting, law: Law, n: Vector3) -> Moment:
    """The start.

    Args:
        setting: of the loop.
        law: its controller.
        n: three independent standard normal numbers.

    """
    vehicles = vehicles_at_start(setting)
    seen = scene(setting, vehicles, 0.0, n)
    state = law.start(setting.controller, law.measurement(seen))
    return Moment(0.0, vehicles, seen, state, (_NO_COMMAND, _UNDISTURBED))


def act(
    setting: Setting, law: Law, moment: Moment, h: float, parts: Splits, delayed: bool
) -> Instant:
    """All signals at a moment, from which a step begins.

    Args:
        setting: of the loop.
        law: its controller.
        moment: of the loop.
        h: the step [s].
        parts: that it is split into.
        delayed: the command and the disturbance act one step late, as in Jacobi order (reading 5).

    """
    t, vehicles, scene, controller_state, before = moment
    h_c = h / parts.controller
    measured = law.measurement(scene)
    state, signals = law.command(setting.controller, controller_state, measured, h_c)
    told, tau_w = before if delayed and t > 0.0 else (signals.tau, scene.tau_w)
    tau = plant.applied(setting.plant, told)
    return Instant(t, vehicles, scene, measured, state, signals, told, tau, tau_w)


def step(
    setting: Setting, law: Law, instant: Instant, h: float, parts: Splits, end: float, n: Vector3
) -> Moment:
    """All states advance together (reading 5).

    Args:
        setting: of the loop.
        law: its controller.
        instant: that the step begins with.
        h: step [s].
        parts: that it is split into.
        end: time at its end [s].
        n: three independent standard normal numbers, for what is measured then.

    """
    _, vehicles, _, measured, controller_state, signals, _, tau, tau_w = instant
    n_c = parts.controller
    state = law.steps(setting.controller, controller_state, signals, measured, h / n_c, n_c)
    vehicles = move(setting, vehicles, tau, tau_w, h, parts)
    now = signals.tau, instant.scene.tau_w
    return Moment(end, vehicles, scene(setting, vehicles, end, n), state, now)


def closed_loop(count: int, setting: Setting = PAPER, delayed: bool = False) -> Iterator[Instant]:
    """The loop in the paper's Euler scheme: all signals at t_k, then all states advance.

    Args:
        count: steps to take.
        setting: of the loop.
        delayed: as for :func:`act`.

    Yields:
        The instants t_0 = 0 to t_count, one more than steps.

    """
    law, h, parts = LAWS[type(setting.controller)], setting.h, splits(setting, setting.h)
    gauss = plant.white_noise(setting.plant.noise.seed).gauss
    moment = begin(setting, law, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)))
    for k in range(count + 1):
        instant = act(setting, law, moment, h, parts, delayed)
        yield instant
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        moment = step(setting, law, instant, h, parts, (k + 1) * h, n)
