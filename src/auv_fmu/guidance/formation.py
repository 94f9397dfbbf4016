"""The reference of one vehicle in a formation, from the leader's reference and the vehicle's place.

Not in the paper. The vehicle's place is an offset d from the leader's reference y_0, forward,
to starboard and down in a horizontal frame that is turned by chi:

    y_d = y_0 + R d
    dy_d = dy_0 + R (d' + chi' S d)
    ddy_d = ddy_0 + R (d'' + 2 chi' S d' + chi'' S d - chi'^2 d_h)

with R = R_z(chi), S d = (-d_y, d_x, 0) and d_h = (d_x, d_y, 0): exact derivatives.

- A reference has a heading psi_0, but not its derivatives, and the heading from a link jumps. So
  chi follows psi, which turns towards psi_0 at no more than `turn_chi`, through a filter of third
  order, which has no error at a constant rate of turn:

      chi'' = -3 omega chi' + 3 omega^2 e + b,  b' = omega^3 e,  e = psi - chi

- d changes from stage to stage by 10 a^3 - 15 a^4 + 6 a^5, a from 0 to 1 over the change: twice
  continuously differentiable, with at most 15/8 of the mean speed, and 10 / sqrt(3) |change| / T^2.
- If the leader's reference is not known, the observer (23), (51) of the paper estimates it from the
  position in messages that are `age` old:

      z = y_0 + age dy_hat_o - y_hat
      dy_hat = dy_hat_o + Lambda s(z) + k_d z     (23)
      ddy_hat_o = k_d Lambda s(z)                 (51), for an unknown acceleration

  Its y_hat, dy_hat and ddy_hat_o then stand for y_0, dy_0 and ddy_0.
"""

from __future__ import annotations

from enum import IntEnum
from math import atan2, cos, exp, pi, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.guidance import follower
from auv_fmu.guidance.follower import Follower
from auv_fmu.language.quantities import ACCELERATION, POSITION, VELOCITY
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import (
    Vector3,
    Vector4,
    Vector5,
    add,
    add_scaled,
    add_two_scaled,
    distance,
    norm,
    sub,
    sub_scaled,
)
from auv_fmu.paper import observer
from auv_fmu.paper.motion_planner import Reference
from auv_fmu.paper.saturation import TANH, saturation

#: Most stages, as many as a Vector4 holds.
MOST = 4

#: Most vehicles of a formation.
_CROWD = 64

#: Largest first and second derivative of a change of unit length and duration.
PEAK_SPEED = 1.875
PEAK_ACCELERATION = 10.0 / sqrt(3.0)

#: Share of the spacing that a neighbour in a V is astern and to the side.
_DIAGONAL = sqrt(0.5)

_NOWHERE: Vector3 = (0.0, 0.0, 0.0)


class Shape(IntEnum):
    """The shape of a formation."""

    LINE = 0  #: abreast: places 2, 4, 6 ... to starboard of the leader, 3, 5, 7 ... to port
    COLUMN = 1  #: astern, one after the other
    V = 2  #: as in a line, and as far astern as to the side
    CIRCLE = 3  #: around the leader's reference; place 1 is ahead, the next to starboard of it
    TABLE = 4  #: at the offset


#: Module-level names, which Python looks up faster than members of the class.
LINE, COLUMN, V, CIRCLE, TABLE = Shape


class Stages(NamedTuple):
    """Formations, one after the other; the first one holds from the start."""

    n: Annotated[
        int, Variable("1", "Number of stages; later ones are not used", 1, MOST, name="stages")
    ] = 1
    shape: Annotated[
        tuple[Shape, Shape, Shape, Shape],
        Variable(
            "1",
            "Shape: line (abreast), column (astern), v, circle, or table (the offset)",
            name="stage[{}].shape",
        ),
    ] = (Shape.LINE, Shape.LINE, Shape.LINE, Shape.LINE)
    spacing: Annotated[
        Vector4,
        Variable("m", "Distance of neighbours, except in a table", 0.0, name="stage[{}].spacing"),
    ] = (5.0, 5.0, 5.0, 5.0)
    x: Annotated[
        Vector4, Variable("m", "Offset of a table: forward", name="stage[{}].offset.x")
    ] = (0.0, 0.0, 0.0, 0.0)
    y: Annotated[
        Vector4, Variable("m", "Offset of a table: to starboard", name="stage[{}].offset.y")
    ] = (0.0, 0.0, 0.0, 0.0)
    z: Annotated[Vector4, Variable("m", "Offset of a table: down", name="stage[{}].offset.z")] = (
        0.0,
        0.0,
        0.0,
        0.0,
    )
    t: Annotated[
        Vector3,
        Variable("s", "When the change to the stage begins", members=(2, 3, 4), name="stage[{}].t"),
    ] = (30.0, 60.0, 90.0)
    duration: Annotated[
        Vector3,
        Variable(
            "s",
            "How long the change takes",
            POSITIVE,
            members=(2, 3, 4),
            name="stage[{}].duration",
        ),
    ] = (20.0, 20.0, 20.0)


class Estimator(NamedTuple):
    """Estimator of the leader's reference; the defaults suit a message every one or two seconds."""

    lambda_: Annotated[
        float,
        Variable(
            "m/s",
            "Bound of the speed that corrects the estimate on each axis (lambda)",
            POSITIVE,
            name="lambda",
        ),
    ] = 0.5
    k_d: Annotated[float, Variable("1/s", "Gain of the observer (k_d)", POSITIVE)] = 0.5
    age_max: Annotated[float, Variable("s", "Age from which y_0 is not used any more", 0.0)] = 4.0
    z_max: Annotated[
        float, Variable("m", "Largest error that is corrected at once, on each axis", POSITIVE)
    ] = 2.0


class Parameters(NamedTuple):
    """All parameters of the planner."""

    number: Annotated[int, Variable("1", "Place of this vehicle", 1, _CROWD)] = 2
    vehicles: Annotated[int, Variable("1", "Number of vehicles", 1, _CROWD)] = 3
    stages: Annotated[Stages, Variable(name="")] = Stages()
    omega_chi: Annotated[
        float, Variable("rad/s", "Frequency of the filter of the heading (omega)", POSITIVE)
    ] = 0.3
    turn_chi: Annotated[
        float, Variable("rad/s", "Fastest turn that the formation follows", 0.0)
    ] = 0.2
    estimated: Annotated[
        bool,
        Variable(
            "1",
            "Whether the leader is known by y_0, eta_0 and age only, and estimated by (23), (51)",
        ),
    ] = False
    estimator: Annotated[Estimator, Variable(name="")] = Estimator()
    follower: Annotated[Follower, Variable(name="")] = Follower()


class Known(NamedTuple):
    """Information about the leader's reference."""

    y_0: Annotated[
        Vector3,
        Variable(POSITION, "Control point of the leader's reference, or as a link brings it"),
    ]
    dy_0: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the leader's reference, unless `estimated`")
    ]
    ddy_0: Annotated[
        Vector3,
        Variable(ACCELERATION, "Acceleration of the leader's reference, unless `estimated`"),
    ]
    psi_0: Annotated[float, Variable("rad", "Heading of the leader's path", name="eta_0.psi")]
    age: Annotated[float, Variable("s", "Age of y_0, if `estimated`")]


class Heading(NamedTuple):
    """State of the filter of the heading."""

    psi: float  #: input of the filter: heading of the path without fast turns [rad]
    chi: float  #: [rad]
    dchi: float  #: [rad/s]
    b: float  #: state of the integrator [rad/s2]


class FormationState(NamedTuple):
    """State of the planner."""

    heading: Heading
    y_hat: Vector3  #: estimated control point of the leader [m]
    dy_hat_o: Vector3  #: state of (23) and (51) [m/s]


class Place(NamedTuple):
    """An offset from the leader: forward, starboard, down."""

    d: Vector3  #: [m]
    dd: Vector3  #: its first derivative [m/s]
    ddd: Vector3  #: its second derivative [m/s2]


# The place in the formation


def offset(parameters: Parameters, k: int) -> Vector3:
    """The place (forward, starboard, down) in stage k, from 0 [m].

    In each shape, neighbours are the spacing apart.
    """
    stages = parameters.stages
    shape, spacing = stages.shape[k], stages.spacing[k]
    if shape == TABLE:
        return stages.x[k], stages.y[k], stages.z[k]
    if shape == CIRCLE:
        if parameters.vehicles == 1:
            return _NOWHERE
        part = pi / parameters.vehicles
        radius = spacing / (2 * sin(part))
        around = 2 * part * (parameters.number - 1)
        return radius * cos(around), radius * sin(around), 0.0
    if shape == COLUMN:
        return -spacing * (parameters.number - 1), 0.0, 0.0
    far = spacing * (parameters.number // 2)
    side = far if parameters.number % 2 == 0 else -far
    if shape == V:
        return -_DIAGONAL * far, _DIAGONAL * side, 0.0
    return 0.0, side, 0.0


def place(parameters: Parameters, t: float) -> Place:
    """The place at a time [s], and its derivatives."""
    stages = parameters.stages
    before = offset(parameters, 0)
    d, dd, ddd = before, _NOWHERE, _NOWHERE
    for k in range(1, stages.n):
        if t > stages.t[k - 1]:
            T = stages.duration[k - 1]
            a = (t - stages.t[k - 1]) / T
            after = offset(parameters, k)
            change = sub(after, before)
            if a < 1.0:
                b = a * (1.0 - a)
                d = add_scaled(d, a * a * a * (10.0 + a * (6.0 * a - 15.0)), change)
                dd = add_scaled(dd, 30.0 * b * b / T, change)
                ddd = add_scaled(ddd, 60.0 * b * (1.0 - 2.0 * a) / (T * T), change)
            else:
                d, dd, ddd = after, _NOWHERE, _NOWHERE
            before = after
    return Place(d, dd, ddd)


# The heading of the formation


def ddchi(omega: float, heading: Heading) -> float:
    """chi'' [rad/s2].

    Args:
        omega: of the filter [rad/s].
        heading: state of the filter.

    """
    e = heading.psi - heading.chi
    return 3 * omega * (omega * e - heading.dchi) + heading.b


def turned(omega: float, turn: float, heading: Heading, psi_0: float, h: float) -> Heading:
    """State of the filter after h seconds, solved exactly.

    Over the step psi turns at a constant rate towards the heading of the path. With x = (e, chi' -
    psi', b / omega - 3 psi'), x' = (-omega + N) x, and N^3 = 0, as the filter has a triple pole at
    -omega: exp((-omega + N) h) = exp(-omega h) (1 + N h + N^2 h^2 / 2).

    Args:
        omega: of the filter [rad/s].
        turn: fastest turn of psi [rad/s].
        heading: state of the filter at the beginning.
        psi_0: heading of the path [rad].
        h: step [s], not zero.

    """
    way = psi_0 - heading.psi
    way = max(-turn * h, min(turn * h, atan2(sin(way), cos(way))))  # the shorter way round
    dpsi = way / h
    e, rate, c = heading.psi - heading.chi, heading.dchi - dpsi, heading.b / omega - 3 * dpsi
    p = omega * e - rate  # N x
    q = omega * (3 * omega * e - 2 * rate + c)
    r = omega * (omega * e + c)
    pp = omega * p - q  # N^2 x
    qq = omega * (3 * omega * p - 2 * q + r)
    rr = omega * (omega * p + r)
    decay = exp(-omega * h)
    psi = heading.psi + way
    return Heading(
        psi,
        psi - decay * (e + h * (p + h / 2 * pp)),
        dpsi + decay * (rate + h * (q + h / 2 * qq)),
        omega * (3 * dpsi + decay * (c + h * (r + h / 2 * rr))),
    )


# The leader


def innovation(estimator: Estimator, state: FormationState, known: Known) -> Vector3:
    """z [m]: difference of the last message and the estimate; zero if the message is too old.

    Each component is limited, and so is the speed at which a vehicle that has lost its leader
    catches up with it.
    """
    if known.age > estimator.age_max:
        return _NOWHERE
    z = sub(add_scaled(known.y_0, known.age, state.dy_hat_o), state.y_hat)
    most = estimator.z_max
    return (
        max(-most, min(most, z[0])),
        max(-most, min(most, z[1])),
        max(-most, min(most, z[2])),
    )


def acceleration(estimator: Estimator, z: Vector3) -> Vector3:
    """ddy_hat_o of (51) [m/s2]; zero in directions in which z is at its limit.

    Otherwise the estimated velocity would grow for as long as the vehicle catches up with its
    leader, and carry it past the leader.
    """
    most, lambda_, k_d = estimator.z_max, estimator.lambda_, estimator.k_d
    a = observer.rate(observer.EULER, _NOWHERE, saturation(TANH, z), lambda_, k_d)
    return (
        a[0] if abs(z[0]) < most else 0.0,
        a[1] if abs(z[1]) < most else 0.0,
        a[2] if abs(z[2]) < most else 0.0,
    )


def leader(parameters: Parameters, state: FormationState, known: Known) -> Reference:
    """The leader's reference, given or estimated."""
    if not parameters.estimated:
        return Reference(known.y_0, known.dy_0, known.ddy_0)
    estimator = parameters.estimator
    z = innovation(estimator, state, known)
    dy_hat = add_two_scaled(
        state.dy_hat_o, estimator.lambda_, saturation(TANH, z), estimator.k_d, z
    )  # (23)
    return Reference(state.y_hat, dy_hat, acceleration(estimator, z))


# A run


def first_state(known: Known) -> FormationState:
    """State at the start: at the leader's position and heading, and at rest."""
    dy_hat_o = observer.initial_dy_hat_o(_NOWHERE, _NOWHERE, 1.0, 1.0)
    return FormationState(Heading(known.psi_0, known.psi_0, 0.0, 0.0), known.y_0, dy_hat_o)


def step(parameters: Parameters, state: FormationState, known: Known, h: float) -> FormationState:
    """State after a step, with held inputs.

    The heading is solved exactly, the observer by Euler's scheme, as in the paper.

    Args:
        parameters: of the planner.
        state: at the beginning.
        known: of the leader.
        h: step [s].

    """
    heading = turned(parameters.omega_chi, parameters.turn_chi, state.heading, known.psi_0, h)
    if parameters.estimated:
        _, dy_hat, ddy_hat_o = leader(parameters, state, known)
        y_hat = add_scaled(state.y_hat, h, dy_hat)
        return FormationState(heading, y_hat, add_scaled(state.dy_hat_o, h, ddy_hat_o))
    return FormationState(heading, known.y_0, state.dy_hat_o)


def reference(parameters: Parameters, state: FormationState, known: Known, t: float) -> Reference:
    """y_d, dy_d/dt and d2y_d/dt2.

    Args:
        parameters: of the planner.
        state: of the planner.
        known: of the leader.
        t: time [s].

    Raises:
        Refusal: the leader is known, and the vehicle cannot keep its place.

    """
    y_0, dy_0, ddy_0 = leader(parameters, state, known)
    d, dd, ddd = place(parameters, t)
    _, chi, dchi, _ = state.heading
    turning = ddchi(parameters.omega_chi, state.heading)
    velocity = add_scaled(dd, dchi, across(d))
    faster = add_two_scaled(ddd, 2 * dchi, across(dd), turning, across(d))
    level = (d[0], d[1], 0.0)
    wanted = Reference(
        add(y_0, ahead(chi, d)),
        add(dy_0, ahead(chi, velocity)),
        add(ddy_0, ahead(chi, sub_scaled(faster, dchi * dchi, level))),
    )
    if not parameters.estimated:
        check_reference(parameters.follower, wanted, t)
    return wanted


def across(d: Vector3) -> Vector3:
    """S d: the horizontal part of a vector, turned to starboard by a right angle."""
    return -d[1], d[0], 0.0


def ahead(chi: float, d: Vector3) -> Vector3:
    """R_z(chi) d: a vector (forward, starboard, down) in the earth frame."""
    c, s = cos(chi), sin(chi)
    return c * d[0] - s * d[1], s * d[0] + c * d[1], d[2]


def posture(parameters: Parameters, state: FormationState, wanted: Reference) -> Vector5:
    """Posture of a vehicle that points along its reference; at rest, along the formation.

    Args:
        parameters: of the planner.
        state: of the planner.
        wanted: reference of the vehicle.

    """
    along = wanted.dy_d
    if norm(along) == 0.0:
        along = ahead(state.heading.chi, (1.0, 0.0, 0.0))
    return follower.posture(wanted.y_d, along, parameters.follower.ell)


# Limits of the vehicle


def check_reference(vehicle: Follower, wanted: Reference, t: float) -> None:
    """Refuse a reference, at a time [s], that the vehicle cannot follow.

    The vehicle can follow it if it could with any heading, or else by a steady motion along the
    path. The first criterion is for formations that start to move and turn: places on the inner
    side then move back, so their course turns round at low speed, which no steady motion does.

    Raises:
        Refusal: a limit is exceeded.

    """
    if not follower.is_easy(vehicle, wanted):
        follower.check_demand(
            vehicle,
            wanted,
            "at t = ",
            t,
            " s",
            "lead more slowly or in wider turns, or take a place nearer to the leader",
        )


def check(parameters: Parameters) -> None:
    """Refuse changes of stage that the vehicle cannot make.

    Raises:
        Refusal: a change is too fast, or begins before the one before is over.

    """
    stages, (vehicle, _, limits, speed_max, _) = parameters.stages, parameters.follower
    if parameters.number > parameters.vehicles:
        raise Refusal(
            f"number is {parameters.number:d}, and there are {parameters.vehicles:d} vehicles: "
            f"raise vehicles or choose an earlier place"
        )
    follower.check(parameters.follower)
    most = min(limits.tau_max[0], -limits.tau_min[0])
    for k in range(1, stages.n):
        t, T = stages.t[k - 1], stages.duration[k - 1]
        if k > 1 and t < stages.t[k - 2] + stages.duration[k - 2]:
            raise Refusal(
                f"the change to stage {k + 1:d} begins at {t:g} s, before that to stage {k:d} "
                f"is over at {stages.t[k - 2] + stages.duration[k - 2]:g} s; start it later"
            )
        way = distance(offset(parameters, k), offset(parameters, k - 1))
        speed = PEAK_SPEED * way / T
        if speed > speed_max:
            raise Refusal(
                f"the change to stage {k + 1:d}, by {way:.3g} m in {T:g} s, takes up to "
                f"{speed:.3g} m/s, more than speed_max, {speed_max:g}; give it at "
                f"least {PEAK_SPEED * way / speed_max:.3g} s"
            )
        force = vehicle.m11 * PEAK_ACCELERATION * way / (T * T)
        if force > most:
            raise Refusal(
                f"the change to stage {k + 1:d}, by {way:.3g} m in {T:g} s, takes up to "
                f"{force:.3g} N, more than the {most:g} N of (3); give it more time"
            )
