"""Line-of-sight guidance along straight legs between waypoints, in three dimensions.

Not in the paper. The laws come from

- LOS: T. I. Fossen (2021), Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed.,
  Wiley;
- ILOS: E. Boerhaug, A. Pavlov and K. Y. Pettersen (2008), Integral LOS control for path following
  of underactuated marine surface vessels in the presence of constant ocean currents, 47th IEEE
  Conference on Decision and Control, 4984-4991;
- ALOS: T. I. Fossen (2023), An adaptive line-of-sight (ALOS) guidance law for path following of
  aircraft and marine craft, IEEE Transactions on Control Systems Technology 31(6), 2887-2894; in
  three dimensions T. I. Fossen and P. Aguiar (2024), Automatica 163, 111556.

They agree with the functions `LOSchi`, `ILOSpsi`, `ALOSpsi`, `ALOS3D` and `LOSobserver` of the
Marine Systems Simulator (MSS, github.com/cybergalactic/MSS, commit 736a3d1), with these departures:

- A leg ends at a distance along it, in three dimensions. `ILOSpsi` and `ALOSpsi` do the same in
  two; `ALOS3D` waits for a sphere around the waypoint, which a vehicle can miss.
- :func:`rate` is in rad/s. `LOSobserver` returns T_f times it, as an angle.
- ILOS in the vertical plane is the horizontal law with the sign of z; MSS does not have it.

On each leg, with its azimuth pi_h, its elevation pi_v, and the errors (x_e, y_e, z_e) across it:

    psi   = pi_h - a(y_e)      theta = pi_v + a(z_e)
    LOS:    a(e) = atan(e / Delta)
    ILOS:   a(e) = atan((e + kappa m) / Delta)   dm/dt = Delta e / (Delta^2 + (e + kappa m)^2)
    ALOS:   a(e) = m + atan(e / Delta)           dm/dt = gamma Delta e / sqrt(Delta^2 + e^2)

m is what the law has learnt: in ILOS an integral, in ALOS the crab angle, held within a limit.
"""

from __future__ import annotations

from enum import IntEnum
from math import atan, atan2, cos, degrees, exp, pi, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.guidance.path_planner import Count, Down, East, North
from auv_fmu.language.quantities import POSITION
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import Vector3, add_scaled, distance, sub
from auv_fmu.paper.actuators import limit
from auv_fmu.paper.motion_planner import STEEPEST

_UNUSED = (0.0,) * 28


class Law(IntEnum):
    """A law of guidance."""

    PROPORTIONAL = 0  #: LOS: no memory, and an offset in a current
    INTEGRAL = 1  #: ILOS
    ADAPTIVE = 2  #: ALOS


class Path(NamedTuple):
    """Waypoints; the defaults are two lines of a survey. The first dives."""

    n: Count = 4
    x: North = (0.0, 100.0, 100.0, 0.0, *_UNUSED)
    y: East = (0.0, 0.0, 20.0, 20.0, *_UNUSED)
    z: Down = (2.0, 10.0, 10.0, 10.0, *_UNUSED)


class Parameters(NamedTuple):
    """All parameters of the guidance."""

    path: Annotated[Path, Variable(name="")] = Path()
    law: Annotated[Law, Variable("1", "Law of guidance, in both planes")] = Law.ADAPTIVE
    Delta_h: Annotated[
        float, Variable("m", "Look-ahead distance in the horizontal plane", POSITIVE, tunable=True)
    ] = 5.0
    Delta_v: Annotated[
        float, Variable("m", "Look-ahead distance in the vertical plane", POSITIVE, tunable=True)
    ] = 5.0
    kappa: Annotated[
        float, Variable("m/s", "Integral gain of the integral law", 0.0, tunable=True)
    ] = 0.25
    gamma_h: Annotated[
        float,
        Variable("rad/(m.s)", "Gain of the adaptive law, horizontal plane", 0.0, tunable=True),
    ] = 0.01
    gamma_v: Annotated[
        float,
        Variable("rad/(m.s)", "Gain of the adaptive law, vertical plane", 0.0, tunable=True),
    ] = 0.01
    crab_max: Annotated[
        float, Variable("rad", "Largest crab angle that the adaptive law learns", 0.0, pi / 2)
    ] = 0.5
    K_f: Annotated[
        float, Variable("1/s", "Gain of the observer of desired angles", POSITIVE, tunable=True)
    ] = 1.0
    radius: Annotated[
        float, Variable("m", "Distance along a leg before its end at which the next begins", 0.0)
    ] = 3.0
    speed: Annotated[float, Variable("m/s", "Desired speed", 0.0, tunable=True)] = 1.0


class Leg(NamedTuple):
    """A straight line from a waypoint."""

    begin: Vector3  #: the waypoint [m]
    azimuth: float  #: pi_h, from north to east [rad]
    elevation: float  #: pi_v, positive upwards [rad]
    length: float  #: [m]


class Angle(NamedTuple):
    """A desired angle that follows a commanded one without jumps."""

    angle: float  #: not wrapped [rad]
    late: float  #: the same angle through a lag of T_f [rad]


class State(NamedTuple):
    """Progress of the guidance, and what it has learnt."""

    k: int  #: waypoint at which the leg begins, from 1
    learnt_h: float  #: m of the horizontal plane: [s] for the integral law, [rad] for the adaptive
    learnt_v: float  #: m of the vertical plane
    psi: Angle
    theta: Angle


def ssa(angle: float) -> float:
    """The same angle from -pi to pi [rad]."""
    return (angle + pi) % (2.0 * pi) - pi


# The path


def waypoint(path: Path, k: int) -> Vector3:
    """Waypoint k [m], from 1."""
    return path.x[k - 1], path.y[k - 1], path.z[k - 1]


def leg(path: Path, k: int) -> Leg:
    """The leg from waypoint k; from the last one, on level and in the direction of the leg before.

    Args:
        path: the waypoints.
        k: from 1 to their number.

    """
    before = k if k < path.n else path.n - 1
    begin, end = waypoint(path, before), waypoint(path, before + 1)
    dx, dy, dz = sub(end, begin)
    azimuth = atan2(dy, dx)
    if k >= path.n:
        return Leg(end, azimuth, 0.0, 0.0)
    return Leg(begin, azimuth, atan2(-dz, sqrt(dx * dx + dy * dy)), distance(begin, end))


def errors(line: Leg, place: Vector3) -> Vector3:
    """Place in the frame of a leg: along it, across it to starboard, and below it [m].

    Args:
        line: the leg.
        place: in the earth frame [m].

    """
    cos_h, sin_h = cos(line.azimuth), sin(line.azimuth)
    cos_v, sin_v = cos(line.elevation), sin(line.elevation)
    dx, dy, dz = sub(place, line.begin)
    ahead = dx * cos_h + dy * sin_h
    return (
        ahead * cos_v - dz * sin_v,
        -dx * sin_h + dy * cos_h,
        ahead * sin_v + dz * cos_v,
    )


def abeam(line: Leg, x_e: float) -> Vector3:
    """The point of a leg at a distance along it [m], earth frame."""
    level = cos(line.elevation)
    along = level * cos(line.azimuth), level * sin(line.azimuth), -sin(line.elevation)
    return add_scaled(line.begin, x_e, along)


def depth(path: Path, k: int, z: float) -> float:
    """A depth of leg k, limited to the depths of its ends [m]."""
    begin, end = path.z[k - 1], path.z[k if k < path.n else k - 1]
    return limit(z, min(begin, end), max(begin, end))


def next_leg(path: Path, k: int, radius: float, x_e: float) -> int:
    """The number of the leg after a step.

    Args:
        path: the waypoints.
        k: number of the leg.
        radius: distance before its end at which the next one begins [m].
        x_e: distance along it [m].

    """
    return k + 1 if k < path.n and leg(path, k).length - x_e < radius else k


def check(path: Path, radius: float) -> None:
    """Refuse waypoints between which there is no guidance.

    Raises:
        Refusal: a leg is too short or too steep.

    """
    for k in range(1, path.n):
        line = leg(path, k)
        if not radius < line.length:
            raise Refusal(
                f"waypoints {k:d} and {k + 1:d} are {line.length:g} m apart, which must be more "
                f"than radius = {radius:g} m"
            )
        if abs(line.elevation) > STEEPEST:
            raise Refusal(
                f"the leg from waypoint {k:d} to {k + 1:d} climbs or dives at "
                f"{degrees(abs(line.elevation)):.1f} degrees, and the limit is "
                f"{degrees(STEEPEST):g}"
            )


# The laws


def aim(law: Law, Delta: float, kappa: float, m: float, e: float) -> float:
    """a(e): the angle towards the leg [rad].

    Args:
        law: of guidance.
        Delta: look-ahead distance [m].
        kappa: gain of the integral law [m/s].
        m: what the law has learnt [s, rad].
        e: error across the leg [m].

    """
    if law == Law.INTEGRAL:
        return atan((e + kappa * m) / Delta)
    if law == Law.ADAPTIVE:
        return m + atan(e / Delta)
    return atan(e / Delta)


def learn(
    law: Law, Delta: float, kappa: float, gamma: float, crab_max: float, m: float, e: float
) -> float:
    """dm/dt: how the law learns [1, rad/s].

    The adaptive law's crab angle does not grow beyond its limit: MSS's projection, whose factor
    1 - c is zero.

    Args:
        law: of guidance.
        Delta: look-ahead distance [m].
        kappa: gain of the integral law [m/s].
        gamma: gain of the adaptive law [rad/(m.s)].
        crab_max: limit of the crab angle [rad].
        m: what the law has learnt [s, rad].
        e: error across the leg [m].

    """
    if law == Law.INTEGRAL:
        ahead = e + kappa * m
        return Delta * e / (Delta * Delta + ahead * ahead)
    if law == Law.ADAPTIVE and not (abs(m) > crab_max and m * e > 0.0):
        return gamma * Delta * e / sqrt(Delta * Delta + e * e)
    return 0.0


def command(parameters: Parameters, state: State, line: Leg, e: Vector3) -> tuple[float, float]:
    """Commanded heading and pitch [rad], which jump where a leg begins.

    Args:
        parameters: of the guidance.
        state: what it has learnt.
        line: the leg.
        e: errors in its frame [m].

    """
    law, kappa = parameters.law, parameters.kappa
    return (
        line.azimuth - aim(law, parameters.Delta_h, kappa, state.learnt_h, e[1]),
        line.elevation + aim(law, parameters.Delta_v, kappa, state.learnt_v, e[2]),
    )


# The observer of desired angles


def lag(K_f: float) -> float:
    """T_f, with which the observer is critically damped at K_f + sqrt(K_f) [s]."""
    return 1.0 / (K_f + 2.0 * sqrt(K_f) + 1.0)


def rate(K_f: float, desired: Angle) -> float:
    """Rate of a desired angle, filtered [rad/s]."""
    return (desired.angle - desired.late) / lag(K_f)


def observe(K_f: float, desired: Angle, commanded: float, h: float) -> Angle:
    """A desired angle after a step: it turns the shorter way to the commanded one.

    Args:
        K_f: gain of the observer [1/s].
        desired: the angle.
        commanded: the angle that it follows [rad].
        h: step [s].

    """
    angle, late = desired
    kept = exp(-h / lag(K_f))
    return Angle(
        angle + h * ((angle - late) + K_f * ssa(commanded - angle)),
        kept * late + (1.0 - kept) * angle,
    )


# The guidance


def begin(parameters: Parameters, place: Vector3) -> State:
    """State at the start: on the first leg, with the angles commanded there.

    Args:
        parameters: of the guidance.
        place: of the vehicle [m], earth frame.

    """
    line, still = leg(parameters.path, 1), Angle(0.0, 0.0)
    state = State(1, 0.0, 0.0, still, still)
    psi, theta = command(parameters, state, line, errors(line, place))
    return state._replace(psi=Angle(psi, psi), theta=Angle(theta, theta))


def advance(parameters: Parameters, state: State, line: Leg, e: Vector3, h: float) -> State:
    """State after a step by Euler's scheme.

    Args:
        parameters: of the guidance.
        state: at its beginning.
        line: the leg.
        e: errors in its frame [m].
        h: step [s].

    """
    law, kappa, crab_max = parameters.law, parameters.kappa, parameters.crab_max
    psi, theta = command(parameters, state, line, e)
    faster_h = learn(
        law, parameters.Delta_h, kappa, parameters.gamma_h, crab_max, state.learnt_h, e[1]
    )
    faster_v = learn(
        law, parameters.Delta_v, kappa, parameters.gamma_v, crab_max, state.learnt_v, e[2]
    )
    return State(
        next_leg(parameters.path, state.k, parameters.radius, e[0]),
        state.learnt_h + h * faster_h,
        state.learnt_v + h * faster_v,
        observe(parameters.K_f, state.psi, psi, h),
        observe(parameters.K_f, state.theta, theta, h),
    )


class Position(NamedTuple):
    """The measured position."""

    y: Annotated[Vector3, Variable(POSITION, "Position of the vehicle, as measured")]


class Posture(NamedTuple):
    """Desired depth and attitude."""

    z: Annotated[float, Variable("m", "Desired depth, limited to the depths of the leg's ends")]
    theta: Annotated[float, Variable("rad", "Desired pitch, without jumps")]
    psi: Annotated[float, Variable("rad", "Desired heading, without jumps: not wrapped")]


class Motion(NamedTuple):
    """Desired speed and rates."""

    u: Annotated[float, Variable("m/s", "Desired speed")]
    q: Annotated[float, Variable("rad/s", "Rate of the desired pitch")]
    r: Annotated[float, Variable("rad/s", "Rate of the desired heading")]


class Guided(NamedTuple):
    """Desired motion, and errors across the path."""

    y_d: Annotated[
        Vector3, Variable(POSITION, "Point of the leg abeam of the vehicle, not ahead of it")
    ]
    eta_d: Posture
    nu_d: Motion
    x_e: Annotated[float, Variable("m", "Distance along the leg from its first waypoint")]
    y_e: Annotated[float, Variable("m", "Cross-track error, positive to starboard of the leg")]
    z_e: Annotated[float, Variable("m", "Vertical-track error, positive below the leg")]
    beta_hat: Annotated[
        float, Variable("rad", "Crab angle that the law makes up for, horizontal plane")
    ]
    alpha_hat: Annotated[float, Variable("rad", "The same in the vertical plane")]
    active: Annotated[
        int,
        Variable("1", "Waypoint at which the leg begins, from 1; `count`: all are passed"),
    ]


def guided(parameters: Parameters, state: State, line: Leg, e: Vector3) -> Guided:
    """Desired motion, and errors.

    Args:
        parameters: of the guidance.
        state: of the guidance.
        line: the leg.
        e: errors in its frame [m].

    """
    law, kappa, K_f = parameters.law, parameters.kappa, parameters.K_f
    y_d = abeam(line, e[0])
    return Guided(
        y_d,
        Posture(depth(parameters.path, state.k, y_d[2]), state.theta.angle, state.psi.angle),
        Motion(parameters.speed, rate(K_f, state.theta), rate(K_f, state.psi)),
        e[0],
        e[1],
        e[2],
        aim(law, parameters.Delta_h, kappa, state.learnt_h, 0.0),
        aim(law, parameters.Delta_v, kappa, state.learnt_v, 0.0),
        state.k,
    )
