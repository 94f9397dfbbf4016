"""A reference through waypoints: straight legs at constant velocity, rounded where they meet.

Not in the paper, which requires that y_d, dy_d and ddy_d are bounded (Assumption 4), and that the
reference is a motion of (1) and (2) (Definition 1). The first holds here, the second on straight
legs only: :func:`check` refuses a rounding that the vehicle cannot follow.

The velocity of a point that runs from waypoint to waypoint at constant velocities v_k jumps at each
corner. The reference is the mean position of this point over the time T around each instant,
weighted by a parabola. So a corner at waypoint p_k, passed at t_k, becomes a rounding of the
duration T: in it, with a = (t - t_k) / T + 1/2 from 0 to 1,

    y_d = p_k + v_k (t - t_k) + (v_k+1 - v_k) T (a^3 - a^4 / 2)
    dy_d = v_k + (v_k+1 - v_k) (3 a^2 - 2 a^3)
    ddy_d = (v_k+1 - v_k) 6 a (1 - a) / T

- y_d is twice continuously differentiable, and its derivatives are exact.
- Legs that take longer than T are straight and at constant velocity between their roundings. A
  corner is cut by 3/32 |v_k+1 - v_k| T.
- The reference stays in the convex hull of the waypoints, and is never faster than its fastest leg;
  |ddy_d| is at most 3/2 of the largest |v_k+1 - v_k| / T where roundings do not overlap.
- Before the first corner and after the last one it rests: start and arrival are corners, too.
- Roundings may overlap, which smooths a curve of many close waypoints.

A spline through the waypoints would meet them exactly, but swing out beside long legs, at other
speeds.
"""

from __future__ import annotations

from math import atan2, degrees, sqrt, tan
from typing import Annotated, NamedTuple

from auv_fmu.guidance import follower
from auv_fmu.guidance.follower import Follower
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import Vector3, Vector32, add_scaled, distance, norm, sub
from auv_fmu.paper.motion_planner import STEEPEST, Reference

#: Most waypoints of a path, as many as a Vector32 holds; and zeros for those that are not used.
MOST = 32
_UNUSED = (0.0,) * 26

#: Number of intervals between the checks of a rounding. They include its middle, which is the most
#: demanding instant of a corner between equal speeds.
_INTERVALS = 32

#: Square of the steepest slope.
_STEEPEST_SLOPE = tan(STEEPEST) * tan(STEEPEST)

#: Rounding errors of the steepness of two velocities, relative to their product, and to their
#: products with the fastest one.
_OF_BOTH = 1e-9
_OF_THE_FASTEST = 1e-12

#: Instants that differ by a smaller share of a rounding are the same.
_SHORTEST = 1e-6

_AT_REST: Vector3 = (0.0, 0.0, 0.0)


#: Number of waypoints, and their places.
Count = Annotated[
    int, Variable("1", "Number of waypoints; later ones are not used", 2, MOST, name="count")
]
North = Annotated[Vector32, Variable("m", "North of the waypoint (x)", name="waypoint[{}].x")]
East = Annotated[Vector32, Variable("m", "East of the waypoint (y)", name="waypoint[{}].y")]
Down = Annotated[Vector32, Variable("m", "Depth of the waypoint (z)", name="waypoint[{}].z")]


class Waypoints(NamedTuple):
    """Waypoints and times; the defaults are a small survey near the vehicle of Fig. 4."""

    n: Count = 6
    x: North = (3.0, 15.0, 15.0, 3.0, 3.0, 15.0, *_UNUSED)
    y: East = (6.0, 6.0, 10.0, 10.0, 14.0, 14.0, *_UNUSED)
    z: Down = (0.0, 4.0, 4.0, 4.0, 4.0, 0.0, *_UNUSED)
    t: Annotated[
        Vector32,
        Variable("s", "Time at which the waypoint is passed, if `timed`", name="waypoint[{}].t"),
    ] = (3.0, 28.0, 36.0, 60.0, 68.0, 93.0, *_UNUSED)
    timed: Annotated[
        bool,
        Variable("1", "Whether waypoints are passed at their times; if not, at the cruise speed"),
    ] = False
    cruise: Annotated[float, Variable("m/s", "Speed between waypoints without times", POSITIVE)] = (
        0.5
    )
    rounding: Annotated[float, Variable("s", "Duration of the rounding of a corner", POSITIVE)] = (
        6.0
    )


class Parameters(NamedTuple):
    """All parameters of the planner."""

    waypoints: Annotated[Waypoints, Variable(name="")] = Waypoints()
    follower: Annotated[Follower, Variable(name="")] = Follower()


class Corner(NamedTuple):
    """A waypoint of the path."""

    k: int  #: number, from 0; n: after the last one
    t: float  #: time at which it would be passed without roundings [s]


class PathState(NamedTuple):
    """Position of the reference on the path."""

    start: float  #: time at which the run began [s]
    t: float  #: time [s]
    ahead: Corner  #: first corner whose rounding is not over


# The path


def waypoint(waypoints: Waypoints, k: int) -> Vector3:
    """Waypoint k [m], from 0."""
    return waypoints.x[k], waypoints.y[k], waypoints.z[k]


def duration(waypoints: Waypoints, k: int) -> float:
    """Duration of the leg to waypoint k [s]."""
    if waypoints.timed:
        return waypoints.t[k] - waypoints.t[k - 1]
    return distance(waypoint(waypoints, k - 1), waypoint(waypoints, k)) / waypoints.cruise


def velocity(waypoints: Waypoints, k: int) -> Vector3:
    """v_k of the leg to waypoint k [m/s]: zero before the first and after the last waypoint."""
    if not 0 < k < waypoints.n:
        return _AT_REST
    T = duration(waypoints, k)
    x, y, z = sub(waypoint(waypoints, k), waypoint(waypoints, k - 1))
    return x / T, y / T, z / T


def first_corner(waypoints: Waypoints, start: float) -> Corner:
    """First corner of the path; without times, its whole rounding lies ahead.

    Args:
        waypoints: of the path.
        start: time at which the run began [s].

    """
    return Corner(0, waypoints.t[0] if waypoints.timed else start + waypoints.rounding / 2)


def next_corner(waypoints: Waypoints, corner: Corner) -> Corner:
    """The next corner."""
    k = corner.k + 1
    if k >= waypoints.n:
        return Corner(waypoints.n, corner.t)
    return Corner(k, waypoints.t[k] if waypoints.timed else corner.t + duration(waypoints, k))


def corner_ahead(waypoints: Waypoints, corner: Corner, t: float) -> Corner:
    """The first corner, from a given one on, whose rounding is not over.

    Args:
        waypoints: of the path.
        corner: from which to look.
        t: time [s].

    """
    for _ in range(waypoints.n):
        if not (corner.k < waypoints.n and corner.t + waypoints.rounding / 2 <= t):
            break
        corner = next_corner(waypoints, corner)
    return corner


def initial_state(waypoints: Waypoints, t: float) -> PathState:
    """State at the start of a run, at time t [s]."""
    return PathState(t, t, corner_ahead(waypoints, first_corner(waypoints, t), t))


def advance(waypoints: Waypoints, state: PathState, t: float) -> PathState:
    """The state at another time.

    Args:
        waypoints: of the path.
        state: at some time.
        t: the other time; it may be earlier, since a host may go back [s].

    """
    corner = state.ahead if t >= state.t else first_corner(waypoints, state.start)
    return PathState(state.start, t, corner_ahead(waypoints, corner, t))


def reference(waypoints: Waypoints, corner: Corner, t: float) -> Reference:
    """y_d, dy_d/dt and d2y_d/dt2 in closed form.

    Args:
        waypoints: of the path.
        corner: the first whose rounding is not over.
        t: time [s].

    """
    T = waypoints.rounding
    k = corner.k if corner.k < waypoints.n else waypoints.n - 1
    v = velocity(waypoints, corner.k)
    y_d, dy_d, ddy_d = add_scaled(waypoint(waypoints, k), t - corner.t, v), v, _AT_REST
    for _ in range(waypoints.n):
        if not (corner.k < waypoints.n and corner.t - T / 2 < t):
            break
        a = (t - corner.t) / T + 0.5
        v_next = velocity(waypoints, corner.k + 1)
        jump = sub(v_next, v)
        y_d = add_scaled(y_d, T * a * a * a * (1.0 - a / 2), jump)
        dy_d = add_scaled(dy_d, a * a * (3.0 - 2 * a), jump)
        ddy_d = add_scaled(ddy_d, 6 * a * (1.0 - a) / T, jump)
        corner = next_corner(waypoints, corner)
        v = v_next
    return Reference(y_d, dy_d, ddy_d)


def course(waypoints: Waypoints, corner: Corner, dy_d: Vector3) -> Vector3:
    """A vector in the direction of the reference.

    At rest, that is the direction of the last leg before; at the start, of the first leg.

    Args:
        waypoints: of the path.
        corner: the first whose rounding is not over.
        dy_d: velocity of the reference [m/s].

    """
    k = corner.k
    for _ in range(waypoints.n):
        if not (norm(dy_d) == 0.0 and k > 1):
            break
        k -= 1
        dy_d = velocity(waypoints, k)
    for _ in range(waypoints.n):
        if not (norm(dy_d) == 0.0 and k < waypoints.n):
            break
        k = k + 1
        dy_d = velocity(waypoints, k)
    return dy_d


# Checks


def check(parameters: Parameters) -> None:
    """Refuse a path that the vehicle cannot follow, with the place.

    Raises:
        Refusal: the waypoints make no path, or the path exceeds a limit.

    """
    waypoints = parameters.waypoints
    follower.check(parameters.follower)
    for k in range(1, waypoints.n):
        _check_leg(waypoints, k)
    if norm(course(waypoints, first_corner(waypoints, 0.0), _AT_REST)) == 0.0:
        raise Refusal("all waypoints are the same: there is no path between them")
    _check_pitch(waypoints)
    corner = first_corner(waypoints, 0.0)
    ahead = corner
    while corner.k < waypoints.n:
        ahead = corner_ahead(waypoints, ahead, corner.t - waypoints.rounding / 2)
        _check_rounding(parameters, corner, ahead)
        corner = next_corner(waypoints, corner)


def _check_leg(waypoints: Waypoints, k: int) -> None:
    """Refuse an impossible leg to waypoint k."""
    before, behind = waypoint(waypoints, k - 1), waypoint(waypoints, k)
    x, y, z = sub(behind, before)
    if waypoints.timed and not waypoints.t[k] > waypoints.t[k - 1]:
        raise Refusal(
            f"waypoint {k + 1:d} has the time {waypoints.t[k]:g} s, and the one before it "
            f"{waypoints.t[k - 1]:g} s: times must increase"
        )
    if not waypoints.timed and distance(before, behind) == 0.0:
        raise Refusal(
            f"waypoints {k:d} and {k + 1:d} are the same; only waypoints with times can rest"
        )
    climb = atan2(abs(z), sqrt(x * x + y * y))
    if climb > STEEPEST:
        raise Refusal(
            f"the leg from waypoint {k:d} to {k + 1:d} climbs or dives at {degrees(climb):.1f} "
            f"degrees, {degrees(climb - STEEPEST):.2g} beyond the limit of {degrees(STEEPEST):g}: "
            f"(1) has a pole at 90"
        )


def _check_pitch(waypoints: Waypoints) -> None:
    """Refuse a path that is too steep in a rounding, although its legs are not.

    From one instant at which a rounding begins or ends to the next, dy_d is a cubic polynomial.
    """
    opening, closing = first_corner(waypoints, 0.0), first_corner(waypoints, 0.0)
    begin, fastest = opening.t - waypoints.rounding / 2, 0.0
    for k in range(1, waypoints.n):
        fastest = max(fastest, norm(velocity(waypoints, k)))
    while closing.k < waypoints.n:
        ahead, end = closing, closing.t + waypoints.rounding / 2
        if opening.k < waypoints.n and opening.t - waypoints.rounding / 2 < end:
            end = opening.t - waypoints.rounding / 2
            opening = next_corner(waypoints, opening)
        else:
            closing = next_corner(waypoints, closing)
        if end > begin:
            _check_pitch_between(waypoints, ahead, begin, end, fastest)
        begin = end


def _check_pitch_between(
    waypoints: Waypoints, ahead: Corner, begin: float, end: float, fastest: float
) -> None:
    """Refuse a path that is too steep between two instants; dy_d is a cubic polynomial there.

    Args:
        waypoints: of the path.
        ahead: first corner whose rounding is not over at the beginning.
        begin, end: the instants [s].
        fastest: speed of the fastest leg [m/s].

    """
    duration, done, share = end - begin, 0.0, 1.0
    early = reference(waypoints, corner_ahead(waypoints, ahead, begin), begin)
    while done < 1.0:
        t = begin + duration * (done + share)
        late = reference(waypoints, corner_ahead(waypoints, ahead, t), t)
        if _is_never_steep(early, late, duration * share, fastest):
            early = late
            done = done + share
            share = 1.0 - done
        else:
            share = share / 2
            t = begin + duration * (done + share)
            corner = corner_ahead(waypoints, ahead, t)
            (x, y, z), dy_d, _ = reference(waypoints, corner, t)
            climb = atan2(abs(dy_d[2]), sqrt(dy_d[0] * dy_d[0] + dy_d[1] * dy_d[1]))
            if _steepness(dy_d, dy_d, fastest) > 0.0:
                raise Refusal(
                    f"near waypoint {corner.k + 1:d}, at ({x:.3g}, {y:.3g}, {z:.3g}) m, the path "
                    f"climbs or dives at {degrees(climb):.1f} degrees, "
                    f"{degrees(climb - STEEPEST):.2g} beyond the limit of {degrees(STEEPEST):g}: "
                    f"(1) has a pole at 90; insert a less steep leg"
                )
            if share < _SHORTEST:
                raise Refusal(
                    f"the path turns straight back at waypoint {corner.k + 1:d}, which no "
                    f"vehicle can follow; add a waypoint to one side"
                )


def _is_never_steep(early: Reference, late: Reference, duration: float, fastest: float) -> bool:
    """True if the path is nowhere too steep between two instants.

    Its steepness there is a polynomial of sixth degree, and nowhere larger than the largest of its
    coefficients in the Bernstein basis.

    Args:
        early, late: the path at both instants, between which dy_d is a cubic polynomial.
        duration: time between them [s].
        fastest: speed of the fastest leg [m/s].

    """
    a, d = early.dy_d, late.dy_d
    b, c = add_scaled(a, duration / 3, early.ddy_d), add_scaled(d, -duration / 3, late.ddy_d)
    return (
        _steepness(a, a, fastest) <= 0.0
        and _steepness(a, b, fastest) <= 0.0
        and 2 * _steepness(a, c, fastest) + 3 * _steepness(b, b, fastest) <= 0.0
        and _steepness(a, d, fastest) + 9 * _steepness(b, c, fastest) <= 0.0
        and 2 * _steepness(b, d, fastest) + 3 * _steepness(c, c, fastest) <= 0.0
        and _steepness(c, d, fastest) <= 0.0
        and _steepness(d, d, fastest) <= 0.0
    )


def _steepness(one: Vector3, other: Vector3, fastest: float) -> float:
    """Bilinear form of velocities: steepness(v, v) > 0 where v is steeper than STEEPEST.

    A bound of the rounding errors is subtracted.

    Args:
        one, other: velocities [m/s].
        fastest: speed of the fastest leg [m/s].

    """
    m, n = norm(one), norm(other)
    steep = one[2] * other[2] - _STEEPEST_SLOPE * (one[0] * other[0] + one[1] * other[1])
    return steep - _OF_BOTH * m * n - _OF_THE_FASTEST * fastest * (m + n)


def _check_rounding(parameters: Parameters, corner: Corner, ahead: Corner) -> None:
    """Refuse a rounding that demands too much; its ends stand for the legs.

    Args:
        parameters: of the planner.
        corner: of the rounding.
        ahead: first corner whose rounding is not over at the beginning of this one.

    """
    waypoints = parameters.waypoints
    before = _AT_REST
    for i in range(_INTERVALS + 1):
        t = corner.t + waypoints.rounding * (i / _INTERVALS - 0.5)
        moment = reference(waypoints, corner_ahead(waypoints, ahead, t), t)
        dx, dy, dz = moment.dy_d
        # The pitch has been checked: a vertical velocity is a rounding error of zero.
        moves = dx * dx + dy * dy > 0.0
        if before[0] * dx + before[1] * dy + before[2] * dz < 0.0 or (
            not moves and norm(moment.ddy_d) > 0.0
        ):
            raise Refusal(
                f"the path turns straight back at waypoint {corner.k + 1:d}, which no vehicle "
                f"can follow; add a waypoint to one side"
            )
        if moves:
            follower.check_demand(
                parameters.follower,
                moment,
                "near waypoint ",
                float(corner.k + 1),
                "",
                "reduce the speed, or turn more widely with a longer rounding",
            )
        before = moment.dy_d
