"""The closed loop as one straight line of Python: no FMI, no master, no ports.

It calls the same equations in the order of the paper's Euler scheme: everything is evaluated
from the states and measurements at t_k, then all states advance together.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import NamedTuple

from auv_fmu import disturbance, motion_planner, output_feedback, plant
from auv_fmu.actuators import limit_all
from auv_fmu.disturbance import Disturbance
from auv_fmu.motion_planner import PlannerState, Reference
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.plant import PlantOutputs, PlantState, RollAxis
from auv_fmu.types import Vector3, Vector6
from auv_fmu.vehicle import Vehicle

#: Section 4.1, and what the paper leaves open as the components choose it.
LIMIT = (80.0, 80.0, 80.0)
NOISE_STD, NOISE_SEED = 0.001, 1
TAU_D = (5.0, 1.0, 2.0)
STEP = 0.02
PAPER = Gains()


class Instant(NamedTuple):
    """All values at one time."""

    plant_state: PlantState
    plant_outputs: PlantOutputs
    measured: Vector3
    tau_applied: Vector3
    controller_state: ControllerState
    signals: Signals
    measurement: Measurement
    tau_w: Vector6
    planner_state: PlannerState
    reference: Reference


def closed_loop(
    steps: int, noise_std: float = NOISE_STD, gains: Gains = PAPER, h: float = STEP
) -> Iterator[Instant]:
    """Fig. 4: the values at the start, then after every step.

    As in the table of a run, the controller, the disturbance and the applied torque belong to
    the beginning of the step that ends at the instant.
    """
    vehicle, roll, waves = Vehicle(), RollAxis(), Disturbance()
    lower = (-LIMIT[0], -LIMIT[1], -LIMIT[2])
    gauss = Random(NOISE_SEED).gauss
    state = plant.initial_state((2.0, 6.0, 0.0), (0.0, 0.0, 0.0), (0.0,) * 6)
    planned = PlannerState((0.0, 0.0, -2.0), 0.0, 0.0, (0.0,) * 5)
    seen = plant.outputs(state, gains.ell)
    y = plant.measure(seen.y, noise_std, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)))
    moving = motion_planner.motion(vehicle, planned, TAU_D)
    reference = motion_planner.reference(planned, moving, gains.ell)
    measurement = Measurement(y, seen.euler, *reference)
    control = output_feedback.initial_state(gains, y)
    signals = output_feedback.evaluate(gains, control, measurement)
    tau_w = disturbance.disturbance(waves, state.nu, 0.0)
    tau = limit_all(signals.tau, lower, LIMIT)
    yield Instant(state, seen, y, tau, control, signals, measurement, tau_w, planned, reference)
    for k in range(steps):
        control = output_feedback.gated(gains, control, y)
        measurement = Measurement(y, seen.euler, *reference)
        signals = output_feedback.evaluate(gains, control, measurement)
        tau_w = disturbance.disturbance(waves, state.nu, k * h)
        tau = limit_all(signals.tau, lower, LIMIT)
        evaluated = control
        control = output_feedback.step(control, signals, h)
        state = plant.step(vehicle, roll, state, tau, tau_w, h)
        planned = motion_planner.step(planned, moving, h)
        moving = motion_planner.motion(vehicle, planned, TAU_D)
        seen = plant.outputs(state, gains.ell)
        y = plant.measure(seen.y, noise_std, (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)))
        reference = motion_planner.reference(planned, moving, gains.ell)
        yield Instant(
            state, seen, y, tau, evaluated, signals, measurement, tau_w, planned, reference
        )
