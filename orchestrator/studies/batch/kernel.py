"""One run of the closed loop: the text that is compiled.

It makes the rows that the FMUs make: a row holds, at time t_k, what both vehicles show then, and
what the controller has computed at the beginning of the step that ends there.
"""

from __future__ import annotations

from math import cos, log, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from auv_fmu import closed_loop, plant
from auv_fmu.attitude import rotation_from_euler
from auv_fmu.closed_loop import LAWS, Instant, Law, Moment, Setting, Splits
from auv_fmu.control_point import control_point
from auv_fmu.euler import LARGEST_STATE
from auv_fmu.output_feedback import Gains
from auv_fmu.vectors import Vector3, Vector6, difference
from orchestrator.studies.batch.accumulator import RowSignals, StepSignals, take_row, take_step
from orchestrator.studies.batch.numbers import flat, nought, square
from orchestrator.vehicle.signals import AXES, DIRECTIONS, STANDARD

#: The controller's part of the loop; :mod:`.kernels` puts another one here before it compiles.
law: Law = LAWS[Gains]


#: Of the rows, after the time: the names of their columns.
COLUMNS: tuple[str, ...] = (
    *STANDARD.posture,
    *STANDARD.nu,
    *(f"plant.y.{axis}" for axis in AXES),
    *STANDARD.dy,
    *STANDARD.y_d,
    *STANDARD.dy_d,
    *(f"planner.ddy_d.{axis}" for axis in AXES),
    *STANDARD.dy_hat,
    *STANDARD.theta_hat,
    *STANDARD.tau,
    *STANDARD.commanded,
    *STANDARD.applied,
    *(f"plant.tau_w.{direction}" for direction in DIRECTIONS),
)


class RunSteps(NamedTuple):
    """The steps of a run."""

    steps: int  #: how many
    full: int  #: how many of the whole length; one more may be shorter
    h: float  #: the whole length [s]
    stop: float  #: end of the last one [s]
    parts: Splits  #: of a step of the whole length
    last_parts: Splits  #: of the shorter one
    delayed: bool  #: command and disturbance act one step late: Jacobi order


class Done(NamedTuple):
    """What was computed in a step."""

    velocity: Vector3  #: that the controller went by [m/s]
    theta_hat: Any  #: and parameters
    commanded: Vector3  #: by the controller (tau_u, tau_q, tau_r) [N, N.m]
    told: Vector3  #: to the actuators
    tau: Vector3  #: that acts
    tau_w: Vector6  #: disturbance (u, v, w, p, q, r) [N, N.m]


def run(
    setting: Setting,
    plan: RunSteps,
    generator: np.random.Generator,
    ends: np.ndarray,
    accumulators: np.ndarray,
    rows: np.ndarray,
    progress: np.ndarray,
) -> Moment:
    """Make one run.

    Args:
        setting: of the loop.
        plan: its steps.
        generator: of uniform numbers.
        ends: of the accumulators, as :data:`.accumulator.END` says.
        accumulators: to be filled.
        rows: to be filled, one more than steps; or none.
        progress: of which the first element becomes the number of steps taken. The next one is
            refused if there are fewer than planned; -1: already the start is.

    Returns:
        What the run ends with, if it makes all steps. It may not return: equations raise.

    """
    noisy = setting.plant.noise.std > 0.0
    progress[0] = -1
    n, spare = normals(generator, noisy, (False, 0.0))
    moment = closed_loop.begin(setting, law, n)
    first = closed_loop.act(setting, law, moment, plan.h, plan.parts, plan.delayed)
    driven, _ = plant.begin(setting.plant, first.tau, setting.plant.current)
    done = done_in(first, driven.tau)
    if not (is_sound(moment) and nought(done) == 0.0):
        return moment
    k = 0
    while True:
        # Here, where the controller is about to need the sines of the same attitude.
        row = row_of(setting, moment, done)
        for j in range(len(accumulators)):
            if k <= ends[j].steps:
                take_row(accumulators[j], row, ends[j])
        if len(rows):
            fill(rows[k], moment, done)
        progress[0] = k
        if k == plan.steps:
            break
        h, parts, end = part_of(plan, k)
        n, spare = normals(generator, noisy, spare)
        instant = closed_loop.act(setting, law, moment, h, parts, plan.delayed)
        begun, before = moment, done.tau
        moment = closed_loop.step(setting, law, instant, h, parts, end, n)
        done = done_in(instant, moment.vehicles.plant.tau)
        if not is_sound(moment):
            break
        miss = difference(done.velocity, begun.scene.plant.dy)
        one = StepSignals(begun.t, end, done.told, done.tau, before, miss, k == 0)
        for j in range(len(accumulators)):
            if k < ends[j].steps:
                take_step(accumulators[j], one, setting.plant.limits, ends[j])
        k += 1
    return moment


def part_of(plan: RunSteps, k: int) -> tuple[float, Splits, float]:
    """Length of step k of a run [s], what it is split into, and when it ends [s]."""
    if k < plan.full:
        return plan.h, plan.parts, (k + 1) * plan.h
    return plan.stop - k * plan.h, plan.last_parts, plan.stop


def done_in(instant: Instant, tau: Vector3) -> Done:
    """What was computed in the step that an instant begins, after which tau [N, N.m] acts."""
    velocity, theta_hat = law.estimates(instant)
    commanded = instant.signals.tau
    return Done(velocity, theta_hat, commanded, instant.command, tau, instant.tau_w)


def is_sound(moment: Moment) -> bool:
    """Whether every component accepts a step: the states that it ends with, and all outputs.

    Outputs that are finite if the states are need no look.
    """
    vehicles, scene = moment.vehicles, moment.scene
    return (
        is_bounded(vehicles.plant)
        and is_bounded(vehicles.planner)
        and is_bounded(moment.controller_state)
        and nought((scene.y, scene.plant.dy, scene.reference, moment.before)) == 0.0
    )


def is_bounded(state: Any) -> bool:
    """Whether all of a state is finite, and its norm not too large."""
    return square(state) <= LARGEST_STATE * LARGEST_STATE


def normals(
    generator: np.random.Generator, noisy: bool, spare: tuple[bool, float]
) -> tuple[Vector3, tuple[bool, float]]:
    """Three standard normal numbers, and what is left over.

    Without noise there are none drawn: they would be multiplied with zero.
    """
    if not noisy:
        return (0.0, 0.0, 0.0), spare
    n_1, spare = gauss(generator, spare)
    n_2, spare = gauss(generator, spare)
    n_3, spare = gauss(generator, spare)
    return (n_1, n_2, n_3), spare


def gauss(
    generator: np.random.Generator, spare: tuple[bool, float]
) -> tuple[float, tuple[bool, float]]:
    """What `random.gauss` makes of uniform numbers: pairs, of which one is spare."""
    there, z = spare
    if there:
        return z, (False, 0.0)
    angle = generator.random() * (2.0 * pi)
    radius = sqrt(-2.0 * log(1.0 - generator.random()))
    return cos(angle) * radius, (True, sin(angle) * radius)


def row_of(setting: Setting, moment: Moment, done: Done) -> RowSignals:
    """What the indices need of a row, as it follows from the ports."""
    seen = moment.scene.plant
    phi, theta, psi = seen.euler
    rotation = rotation_from_euler(phi, theta, psi)
    y = control_point(moment.vehicles.plant.position, rotation, setting.plant.ell)
    _, v, w, _, _, _ = seen.nu
    return RowSignals(
        moment.t,
        difference(y, moment.scene.reference.y_d),
        seen.dy,
        sqrt(v * v + w * w),
        done.theta_hat,
    )


def fill(row: np.ndarray, moment: Moment, done: Done) -> None:
    """Fill a row with the time and the values of :data:`COLUMNS`."""
    scene, seen = moment.scene, moment.scene.plant
    shown = moment.vehicles.plant.position, seen.euler, seen.nu, scene.y, seen.dy
    values = flat((moment.t, shown, scene.reference, done))
    for i in range(len(values)):
        row[i] = values[i]
