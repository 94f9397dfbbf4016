"""The paper's Fig. 2 as one straight line of Python: no FMI, no master, no ports.

Everything else that runs this loop is held against it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from auv_fmu import motion_planner, output_feedback, plant
from auv_fmu.actuators import Limits, limit_all
from auv_fmu.attitude import rotation_from_quaternion
from auv_fmu.disturbance import Disturbance, disturbance
from auv_fmu.euler import STEP
from auv_fmu.motion_planner import ETA_D0, TAU_D, PlannerState, Reference
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.plant import ETA_0, NU_0, Localisation, PlantOutputs, PlantState, RollAxis
from auv_fmu.types import Vector3, Vector5, Vector6
from auv_fmu.vehicle import Vehicle


class Setting(NamedTuple):
    """Parameters of every block of Fig. 2, with the values of section 4.1: the run of Fig. 4."""

    vehicle: Vehicle = Vehicle()  #: also the planner's
    roll: RollAxis = RollAxis()
    limits: Limits = Limits()
    eta_0: Vector6 = ETA_0  #: initial posture (x, y, z, phi, theta, psi) [m, rad]
    nu_0: Vector6 = NU_0  #: initial velocity (u, v, w, p, q, r) [m/s, rad/s]
    localisation: Localisation = Localisation()
    disturbance: Disturbance = Disturbance()
    gains: Gains = Gains()  #: with the distance ell of all control points
    tau_d: Vector3 = TAU_D  #: drives the reference (u, q, r) [N, N.m]
    eta_d0: Vector5 = ETA_D0  #: initial posture of the reference (x, y, z, theta, psi) [m, rad]
    h: float = STEP  #: [s]


#: Section 4.1.
PAPER = Setting()


class Instant(NamedTuple):
    """All signals of Fig. 2 at one time t_k."""

    t: float  #: [s]
    plant_state: PlantState
    plant_outputs: PlantOutputs
    planner_state: PlannerState
    reference: Reference
    measurement: Measurement
    controller_state: ControllerState
    signals: Signals
    tau: Vector3  #: applied (tau_u, tau_q, tau_r), after the limits of (3) [N, N.m]
    tau_w: Vector6  #: disturbance (u, v, w, p, q, r) [N, N.m]


def closed_loop(steps: int, setting: Setting = PAPER) -> Iterator[Instant]:
    """The loop in the paper's Euler scheme: all signals at t_k, then all states advance.

    Args:
        steps: to take.
        setting: of the loop.

    Yields:
        The instants t_0 = 0 to t_steps, one more than steps.

    """
    vehicle, gains, tau_d, h = setting.vehicle, setting.gains, setting.tau_d, setting.h
    roll, waves = setting.roll, setting.disturbance
    tau_min, tau_max = setting.limits
    std, seed = setting.localisation
    gauss = plant.white_noise(seed).gauss
    state = plant.initial_state(setting.eta_0[:3], setting.eta_0[3:], setting.nu_0)
    planned = motion_planner.initial_state(setting.eta_d0)
    for k in range(steps + 1):
        rotation = rotation_from_quaternion(state.quaternion)
        seen = plant.outputs(state, rotation, gains.ell)
        y = plant.measure(seen.y, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)), std)
        moving = motion_planner.motion(vehicle, planned, tau_d)
        reference = motion_planner.reference(planned, moving, gains.ell)
        measurement = Measurement(y, seen.euler, *reference)
        if k == 0:
            control = output_feedback.initial_state(gains, y)
        control = output_feedback.gated(gains, control, y)
        signals = output_feedback.evaluate(gains, control, measurement)
        tau = limit_all(signals.tau, tau_min, tau_max)
        tau_w = disturbance(waves, state.nu, k * h)
        yield Instant(
            k * h, state, seen, planned, reference, measurement, control, signals, tau, tau_w
        )
        control = output_feedback.step(control, signals, h)
        state = plant.step(vehicle, roll, state, rotation, tau, tau_w, h)
        planned = motion_planner.step(planned, moving, h)
