"""The paper's Fig. 2 as one straight line of Python: no FMI, no master, no ports.

Everything else that runs this loop is held against it. What happens at an instant and between two
of them is written as functions of the language of equations, so that it can be compiled;
:func:`closed_loop` puts them in a row. What stands in the loop follows from the setting; not in the
paper, and off by default, are a path through waypoints, a sea, and another vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from auv_fmu.guidance import path_planner
from auv_fmu.language.vectors import Vector3, Vector6
from auv_fmu.loop.blocks import LAWS, PLANNERS, VEHICLES, WATERS, Blocks, Scene, SeaWaves
from auv_fmu.paper import motion_planner, plant
from auv_fmu.paper.disturbance import Disturbance, disturbance
from auv_fmu.paper.euler import STEP, internal_steps, longest_step
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.pd import PdGains
from auv_fmu.remus import allocation, remus100
from auv_fmu.water.sea import WaterMotion

#: Before the first instant.
_NO_COMMAND: Vector3 = (0.0, 0.0, 0.0)


class LongestSteps(NamedTuple):
    """Largest internal step of each component [s]; a longer step is split evenly."""

    plant: float = STEP
    controller: float = STEP
    planner: float = STEP


class Setting(NamedTuple):
    """Parameters of every block of Fig. 2, with the values of section 4.1: the run of Fig. 4.

    Each block has its own, the distance ell and the vehicle too, as the components have.
    """

    plant: plant.Parameters | remus100.Parameters = plant.Parameters()  #: the vehicle
    controller: Gains | PdGains = Gains()  #: the proposed controller, or the PD one
    disturbance: Disturbance = Disturbance()
    planner: motion_planner.Parameters | path_planner.Parameters = motion_planner.Parameters()
    h_max: LongestSteps = LongestSteps()
    h: float = STEP  #: [s]
    #: The sea, or the velocity of the water [m/s], earth frame; either is added to `current`.
    water: Vector3 | SeaWaves = (0.0, 0.0, 0.0)
    allocation: allocation.Parameters | None = None  #: of a REMUS 100


#: Section 4.1.
PAPER = Setting()


def blocks_of(setting: Setting) -> Blocks:
    """Which blocks stand in the loop."""
    return Blocks(
        LAWS[type(setting.controller)],
        PLANNERS[type(setting.planner)],
        VEHICLES[type(setting.plant)],
        WATERS[type(setting.water)],
    )


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
    """The vehicle, the reference, and the water: their states, and what follows from these."""

    plant: Any  #: state of the vehicle: a PlantState or a RemusState
    rotation: Any  #: attitude of a plant, body to earth; of a REMUS 100 there is nothing here
    planner: Any  #: a PlannerState or a PathState
    moving: Any  #: motion of the reference vehicle; on a path there is nothing here
    water: Any  #: the Variation of a sea; of steady water there is nothing here


class Sent(NamedTuple):
    """What blocks pass on to others, whom it reaches one step late in Jacobi order."""

    tau: Vector3  #: command (tau_u, tau_q, tau_r) [N, N.m]
    nu_r: Vector6  #: velocity of the vehicle through the water [m/s, rad/s]
    position: Vector3  #: of the vehicle [m]
    allocated: Any  #: an Allocated


def vehicles_at_start(setting: Setting, blocks: Blocks) -> Vehicles:
    """All at the start."""
    varying = blocks.water.begin(setting.water)
    x, y, z, _, _, _ = setting.plant.eta0
    water = blocks.water.motion(setting.water, varying, (x, y, z), 0.0)
    state, derived = blocks.vehicle.begin(setting.plant, water.velocity)
    planned, moving = blocks.planner.begin(setting.planner)
    return Vehicles(state, derived, planned, moving, varying)


def scene(setting: Setting, blocks: Blocks, vehicles: Vehicles, t: float, n: Vector3) -> Scene:
    """What is seen at time t [s].

    Args:
        setting: of the loop.
        blocks: that stand in it.
        vehicles: at that time.
        t: time [s].
        n: three independent standard normal numbers, of the localisation system.

    """
    state = vehicles.plant
    seen = blocks.vehicle.outputs(setting.plant, state, vehicles.rotation)
    return Scene(
        seen,
        plant.measure(seen.y, n, setting.plant.noise.std),
        blocks.planner.reference(setting.planner, vehicles.planner, vehicles.moving),
        disturbance(setting.disturbance, blocks.vehicle.disturbed(seen.nu_r), t),
        blocks.water.motion(setting.water, vehicles.water, state.position, t),
    )


class Moment(NamedTuple):
    """All that the rest of a run depends on, at one time t_k."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    controller_state: Any
    before: Sent  #: in the step that ends there


class Instant(NamedTuple):
    """All signals of Fig. 2 at one time t_k."""

    t: float  #: [s]
    vehicles: Vehicles
    scene: Scene
    measured: Any  #: what the controller is told: Measurement or PdMeasurement
    controller_state: Any  #: a ControllerState; of the PD controller theta_hat
    signals: Any  #: Signals or PdSignals
    now: Sent  #: what this instant passes on
    command: Vector3  #: (tau_u, tau_q, tau_r) of it, at the actuators or their allocation [N, N.m]
    tau: Vector3  #: what the limits of (3) leave of it [N, N.m]; of a REMUS 100 what is allocated
    tau_w: Vector6  #: disturbance that acts (u, v, w, p, q, r) [N, N.m]
    water: WaterMotion  #: that acts


# The loop


def begin(setting: Setting, blocks: Blocks, n: Vector3) -> Moment:
    """The start.

    Args:
        setting: of the loop.
        blocks: that stand in it.
        n: three independent standard normal numbers.

    """
    vehicles = vehicles_at_start(setting, blocks)
    seen = scene(setting, blocks, vehicles, 0.0, n)
    state = blocks.controller.start(setting.controller, blocks.controller.measurement(seen))
    still = Sent(_NO_COMMAND, seen.plant.nu_r, vehicles.plant.position, blocks.vehicle.idle())
    return Moment(0.0, vehicles, seen, state, still)


def act(
    setting: Setting, blocks: Blocks, moment: Moment, h: float, parts: Splits, delayed: bool
) -> Instant:
    """All signals at a moment, from which a step begins.

    Args:
        setting: of the loop.
        blocks: that stand in it.
        moment: of the loop.
        h: the step [s].
        parts: that it is split into.
        delayed: what blocks pass on arrives one step late, as in Jacobi order (reading 5): the
            command, what is allocated, and what the disturbance and the water are told.

    """
    t, vehicles, scene, controller_state, before = moment
    law, vehicle = blocks.controller, blocks.vehicle
    h_c = h / parts.controller
    measured = law.measurement(scene)
    state = law.gated(setting.controller, controller_state, measured)
    signals = law.evaluate(setting.controller, state, measured, h_c)
    tau_w, water = scene.tau_w, scene.water
    late = delayed and t > 0.0
    if late:
        tau_w = disturbance(setting.disturbance, vehicle.disturbed(before.nu_r), t)
        water = blocks.water.motion(setting.water, vehicles.water, before.position, t)
    told = before.tau if late else signals.tau
    allocated = vehicle.allocate(setting.allocation, told, scene.plant.nu_r)
    now = Sent(signals.tau, scene.plant.nu_r, vehicles.plant.position, allocated)
    tau = vehicle.driving(setting.plant, told, before.allocated if late else allocated)
    return Instant(t, vehicles, scene, measured, state, signals, now, told, tau, tau_w, water)


def move(setting: Setting, blocks: Blocks, instant: Instant, h: float, parts: Splits) -> Vehicles:
    """All one step later.

    Args:
        setting: of the loop.
        blocks: that stand in it.
        instant: that the step begins with.
        h: step [s].
        parts: that it is split into.

    """
    t, vehicles = instant.t, instant.vehicles
    state, rotation = vehicles.plant, vehicles.rotation
    planner, moving = vehicles.planner, vehicles.moving
    n, n_d = parts.plant, blocks.planner.parts(parts.planner)
    for _ in range(n):
        state, rotation = blocks.vehicle.step(
            setting.plant, state, rotation, instant.tau, instant.tau_w, instant.water, h / n
        )
    for i in range(n_d):
        h_d = h / n_d
        planner, moving = blocks.planner.step(setting.planner, planner, moving, t + i * h_d, h_d)
    water = blocks.water.later(setting.water, vehicles.water, h)
    return Vehicles(state, rotation, planner, moving, water)


def step(
    setting: Setting,
    blocks: Blocks,
    instant: Instant,
    h: float,
    parts: Splits,
    end: float,
    n: Vector3,
) -> Moment:
    """All states advance together (reading 5).

    Args:
        setting: of the loop.
        blocks: that stand in it.
        instant: that the step begins with.
        h: step [s].
        parts: that it is split into.
        end: time at its end [s].
        n: three independent standard normal numbers, for what is measured then.

    """
    gains, measured, h_c = setting.controller, instant.measured, h / parts.controller
    law = blocks.controller
    state = law.step(instant.controller_state, instant.signals, h_c)
    for _ in range(parts.controller - 1):
        state = law.step(state, law.evaluate(gains, state, measured, h_c), h_c)
    vehicles = move(setting, blocks, instant, h, parts)
    return Moment(end, vehicles, scene(setting, blocks, vehicles, end, n), state, instant.now)


def closed_loop(count: int, setting: Setting = PAPER, delayed: bool = False) -> Iterator[Instant]:
    """The loop in the paper's Euler scheme: all signals at t_k, then all states advance.

    Args:
        count: steps to take.
        setting: of the loop.
        delayed: as for :func:`act`.

    Yields:
        The instants t_0 = 0 to t_count, one more than steps.

    """
    blocks, h, parts = blocks_of(setting), setting.h, splits(setting, setting.h)
    gauss = plant.white_noise(setting.plant.noise.seed).gauss
    moment = begin(setting, blocks, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)))
    for k in range(count + 1):
        instant = act(setting, blocks, moment, h, parts, delayed)
        yield instant
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        moment = step(setting, blocks, instant, h, parts, (k + 1) * h, n)
