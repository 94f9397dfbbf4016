"""One run of the closed loop, and its indices on the way: the text that is compiled.

It makes the rows that the FMUs make: a row holds all signals of its time. The indices equal
:data:`orchestrator.vehicle.indices.INDICES` of these rows bit for bit: sums go on row by row, in
the same order.
"""

from __future__ import annotations

from math import cos, inf, isnan, log, nan, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.vectors import Vector3, Vector4, norm, sub
from auv_fmu.loop import closed_loop
from auv_fmu.loop.blocks import Blocks
from auv_fmu.loop.closed_loop import PAPER, Instant, Moment, Setting, Splits, blocks_of
from auv_fmu.paper.actuators import Limits
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point
from auv_fmu.paper.euler import LARGEST_STATE
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import AXES, DIRECTIONS, Loop

#: What stands in the loop; `.compilation` puts other blocks here before it compiles.
blocks: Blocks = blocks_of(PAPER)


def columns(loop: Loop) -> tuple[str, ...]:
    """Of the rows, after the time: the names of their columns, whether or not a loop has them."""
    return (
        *loop.posture,
        *loop.nu,
        *(f"{loop.vehicle}.y.{axis}" for axis in AXES),
        *loop.dy,
        *loop.y_d,
        *loop.dy_d,
        *(f"{loop.planner}.ddy_d.{axis}" for axis in AXES),
        *loop.applied,
        *computed(loop),
    )


def computed(loop: Loop) -> tuple[str, ...]:
    """Of these columns, those that follow from others of the same time at once."""
    return (
        *loop.dy_hat,
        *loop.theta_hat,
        *loop.tau,
        *loop.commanded,
        *(f"{loop.vehicle}.tau_w.{direction}" for direction in DIRECTIONS),
    )


class RunSteps(NamedTuple):
    """The steps of a run."""

    steps: int  #: how many
    full: int  #: how many of the whole length; one more may be shorter
    h: float  #: the whole length [s]
    stop: float  #: end of the last one [s]
    parts: Splits  #: of a step of the whole length
    last_parts: Splits  #: of the shorter one
    delayed: bool  #: what blocks tell others acts one step late: Jacobi order


def run(
    setting: Setting,
    run_steps: RunSteps,
    generator: np.random.Generator,
    ends: np.ndarray,
    accumulators: np.ndarray,
    rows: np.ndarray,
    progress: np.ndarray,
) -> Moment:
    """Make one run.

    Args:
        setting: of the loop.
        run_steps: its steps.
        generator: of uniform numbers.
        ends: of the accumulators, as :data:`END` says.
        accumulators: to be filled.
        rows: to be filled, one more than steps; or none.
        progress: of which the first element becomes the number of steps taken. The next one is
            refused if there are fewer than planned; -1: already the start is.

    Returns:
        What the run ends with, if it makes all steps. It may not return: equations raise.

    """
    noisy = setting.plant.noise.std > 0.0
    limits = blocks.vehicle.limits(setting.plant)
    progress[0] = -1
    n, spare = normals(generator, noisy, (False, 0.0))
    moment = closed_loop.begin(setting, blocks, n)
    if not is_sound(moment):
        return moment
    before = (0.0, 0.0, 0.0)
    k = 0
    while True:
        # Here, where the controller is about to need the sines of the same attitude.
        row = row_of(setting, moment)
        for j in range(len(accumulators)):
            if k <= ends[j].steps:
                take_row(accumulators[j], row, ends[j])
        h, parts, end = part_of(run_steps, k)
        instant = closed_loop.act(setting, blocks, moment, h, parts, run_steps.delayed)
        if nought(instant.now) != 0.0:
            break
        if len(rows):
            fill(rows[k], setting, instant)
        progress[0] = k
        if k == run_steps.steps:
            break
        n, spare = normals(generator, noisy, spare)
        moment = closed_loop.step(setting, blocks, instant, h, parts, end, n)
        if not is_sound(moment):
            break
        k += 1
        progress[0] = k
        one = signals_of(setting, instant, moment, before)
        for j in range(len(accumulators)):
            if k <= ends[j].steps:
                take_step(accumulators[j], one, limits, ends[j])
        before = one.tau
    return moment


def part_of(run_steps: RunSteps, k: int) -> tuple[float, Splits, float]:
    """Length of step k of a run [s], what it is split into, and when it ends [s].

    A step that would follow the last one has the whole length.
    """
    if k < run_steps.full or k == run_steps.steps:
        return run_steps.h, run_steps.parts, (k + 1) * run_steps.h
    return run_steps.stop - k * run_steps.h, run_steps.last_parts, run_steps.stop


def is_sound(moment: Moment) -> bool:
    """Whether every component accepts a step: the states that it ends with, and what they show.

    Outputs that are finite if the states are need no look.
    """
    vehicles, scene = moment.vehicles, moment.scene
    return (
        is_bounded(vehicles.plant)
        and is_bounded(vehicles.planner)
        and is_bounded(vehicles.water)
        and is_bounded(moment.controller_state)
        and nought((scene.y, scene.plant.dy, scene.reference)) == 0.0
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


def row_of(setting: Setting, moment: Moment) -> RowSignals:
    """What the indices need of a time, as it follows from the ports."""
    seen = moment.scene.plant
    phi, theta, psi = seen.euler
    rotation = rotation_from_euler(phi, theta, psi)
    y = control_point(moment.vehicles.plant.position, rotation, setting.plant.ell)
    _, v, w, _, _, _ = seen.nu
    return RowSignals(
        moment.t,
        cos(theta),
        sub(y, moment.scene.reference.y_d),
        seen.dy,
        sqrt(v * v + w * w),
    )


def signals_of(setting: Setting, instant: Instant, moment: Moment, before: Vector3) -> StepSignals:
    """What the indices need of a step from an instant to a moment.

    Args:
        setting: of the loop.
        instant: that it begins with.
        moment: that it ends with.
        before: what was applied in the step before [N, N.m].

    """
    scene = instant.scene
    velocity, theta_hat = blocks.controller.estimates(
        scene, instant.controller_state, instant.signals
    )
    return StepSignals(
        instant.t,
        moment.t,
        instant.command,
        blocks.vehicle.acting(setting.plant, moment.vehicles.plant, instant.tau),
        before,
        sub(velocity, scene.plant.dy),
        theta_hat,
    )


def fill(row: np.ndarray, setting: Setting, instant: Instant) -> None:
    """Fill a row with the time and the values of :func:`columns`."""
    scene, state = instant.scene, instant.vehicles.plant
    seen = scene.plant
    shown = state.position, seen.euler, seen.nu, scene.y, seen.dy
    estimates = blocks.controller.estimates(scene, instant.controller_state, instant.signals)
    computed = estimates, instant.signals.tau, instant.command, instant.tau_w
    given = blocks.vehicle.acting(setting.plant, state, instant.tau)
    values = flat((instant.t, shown, scene.reference, given, computed))
    for i in range(len(values)):
        row[i] = values[i]


#: Up to where an accumulator goes.
END = np.dtype(
    [
        ("steps", int),
        ("late", float),  # when half of the time is over [s]
        ("last", float),  # when the last seconds of it begin [s]
    ]
)

#: What is kept of a run until then.
ACCUMULATOR = np.dtype(
    [
        ("square", float, 3),  # integral of the square of the applied signal
        ("variation", float, 3),
        ("peak", float, 3),
        ("outside", int, 3),  # steps whose command is beyond the limits
        ("final", float, 3),  # largest |e| of each axis in the last seconds [m]
        ("reached", float),  # [s]
        ("late", float),  # largest |e| since half of the time [m]
        ("miss", float, 3),  # sum of (dy_hat - dy)^2 since half of the time
        ("instants", int),  # that it is a sum of
        ("half", float, 4),  # theta_hat at half of the time
        ("end", float, 4),
        ("speed", float),
        ("drift", float),
        ("rho_hat", float),  # largest theta_hat[1] [N]
        ("upright", float),  # cosine of the pitch at the start
        ("vertical", float),  # when the pitch had passed 90 degrees [s]
    ]
)


class RowSignals(NamedTuple):
    """What of a row of the table the indices follow from."""

    t: float  #: [s]
    cos_pitch: float
    e: Vector3  #: y - y_d with the true control point [m]
    dy: Vector3  #: velocity of the control point [m/s]
    drift: float  #: |(v, w)| [m/s]


class StepSignals(NamedTuple):
    """What of a step the indices follow from."""

    begun: float  #: [s]
    ended: float  #: [s]
    command: Vector3  #: (tau_u, tau_q, tau_r), as it reached the actuators [N, N.m]
    tau: Vector3  #: applied [N, N.m]
    before: Vector3  #: applied in the step before [N, N.m]
    miss: Vector3  #: dy_hat - dy at its beginning [m/s]
    theta_hat: Vector4


def new_accumulators(n: int) -> np.ndarray:
    """Accumulators of nothing yet."""
    accumulators = np.zeros(n, ACCUMULATOR)
    accumulators["reached"] = accumulators["half"] = accumulators["upright"] = nan
    accumulators["rho_hat"], accumulators["vertical"] = -inf, inf
    return accumulators


def take_row(accumulator: Any, row: RowSignals, end: Any) -> None:
    """Take a row into account."""
    error = norm(row.e)
    if isnan(accumulator.reached) and error <= REACHED:
        accumulator.reached = row.t
    accumulator.speed = max(accumulator.speed, norm(row.dy))
    accumulator.drift = max(accumulator.drift, row.drift)
    if isnan(accumulator.upright):
        accumulator.upright = row.cos_pitch
    if row.cos_pitch * accumulator.upright <= 0.0:
        accumulator.vertical = min(accumulator.vertical, row.t)
    if row.t >= end.late:
        accumulator.late = max(accumulator.late, error)
    if row.t >= end.last:
        for i in range(3):
            accumulator.final[i] = max(accumulator.final[i], abs(row.e[i]))


def take_step(accumulator: Any, step: StepSignals, limits: Limits, end: Any) -> None:
    """Take a step into account."""
    h = step.ended - step.begun
    for i in range(3):
        accumulator.square[i] += step.tau[i] * step.tau[i] * h
        if step.begun > 0.0:
            accumulator.variation[i] += abs(step.tau[i] - step.before[i])
        accumulator.peak[i] = max(accumulator.peak[i], abs(step.command[i]))
        if not limits.tau_min[i] <= step.command[i] <= limits.tau_max[i]:
            accumulator.outside[i] += 1
    accumulator.rho_hat = max(accumulator.rho_hat, step.theta_hat[0])
    is_half = step.ended >= end.late and isnan(accumulator.half[0])
    for i in range(4):
        accumulator.end[i] = step.theta_hat[i]
        if is_half:
            accumulator.half[i] = step.theta_hat[i]
    if step.begun >= end.late:
        accumulator.instants += 1
        for i in range(3):
            accumulator.miss[i] += step.miss[i] * step.miss[i]


def flat(value: Any) -> tuple[float, ...]:
    """The numbers of a tuple of numbers and tuples, in their order."""
    if isinstance(value, tuple):
        return tuple(number for part in value for number in flat(part))
    return (value,)


def square(value: Any) -> float:
    """The sum of their squares."""
    return sum(x * x for x in flat(value))


def nought(value: Any) -> float:
    """Zero, if all of them are finite; if not, no number."""
    return sum(0.0 * x for x in flat(value))
