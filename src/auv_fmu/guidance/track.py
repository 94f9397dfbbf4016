"""A reference through the rows of a table: a cubic spline over time.

Not in the paper, which requires that y_d, dy_d and ddy_d are bounded (Assumption 4). They are: the
spline is twice continuously differentiable. Before the first row and after the last one the
reference rests.

With positions p and velocities v in two successive rows, T apart, m = (p_1 - p_0) / T and the time
s since the first of them:

    y_d = p_0 + s (v_0 + s (b + s c))
    b = (3 m - 2 v_0 - v_1) / T
    c = (v_0 + v_1 - 2 m) / T^2

v makes ddy_d continuous in all rows.
"""

from __future__ import annotations

from math import atan2, ceil, degrees, sqrt
from typing import NamedTuple

from auv_fmu.guidance import follower
from auv_fmu.guidance.follower import Follower
from auv_fmu.language.variable import Refusal
from auv_fmu.language.vectors import Vector3, norm, scale
from auv_fmu.paper.motion_planner import STEEPEST, Reference

#: Speed up to which a reference has no course [m/s].
SLOW = 0.02

#: Speed up to which the vehicle may follow with any heading [m/s].
_GENTLE = 0.1

#: Shortest time at such a speed between two opposite courses [s].
_REST = 5.0

#: Longest interval between two instants that are checked [s], and the number of them between two
#: rows.
_BETWEEN, _LEAST, _MOST = 0.25, 8, 256

_AT_REST: Vector3 = (0.0, 0.0, 0.0)


class Row(NamedTuple):
    """A row of the table, or another instant."""

    t: float  #: [s]
    y: Vector3  #: position of the control point [m], earth frame
    dy: Vector3  #: its velocity [m/s]


def reference(before: Row, after: Row, t: float) -> Reference:
    """y_d, dy_d/dt and d2y_d/dt2 between two successive rows; outside of them, at rest.

    Args:
        before, after: the rows.
        t: time [s].

    """
    if t < before.t:
        return Reference(before.y, _AT_REST, _AT_REST)
    if t > after.t:
        return Reference(after.y, _AT_REST, _AT_REST)
    (t_0, p_0, v_0), (t_1, p_1, v_1) = before, after
    T, s = t_1 - t_0, t - t_0
    x = _piece(T, s, p_0[0], p_1[0], v_0[0], v_1[0])
    y = _piece(T, s, p_0[1], p_1[1], v_0[1], v_1[1])
    z = _piece(T, s, p_0[2], p_1[2], v_0[2], v_1[2])
    return Reference((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))


def _piece(T: float, s: float, p_0: float, p_1: float, v_0: float, v_1: float) -> Vector3:
    """A coordinate of the spline between two rows, and its two derivatives.

    Args:
        T: time between the rows [s].
        s: time since the first of them [s].
        p_0, p_1: positions in the rows [m].
        v_0, v_1: velocities in the rows [m/s].

    """
    m = (p_1 - p_0) / T
    b, c = (3.0 * m - 2.0 * v_0 - v_1) / T, (v_0 + v_1 - 2.0 * m) / (T * T)
    return (
        p_0 + s * (v_0 + s * (b + s * c)),
        v_0 + s * (2.0 * b + s * 3.0 * c),
        2.0 * b + s * 6.0 * c,
    )


def check(vehicle: Follower, before: Row, after: Row, moved: Row, head: str) -> Row:
    """Refuse a reference that the vehicle cannot follow between two successive rows.

    At each instant there must be a steady motion along the path; at low speed, it is enough if the
    vehicle could follow with any heading.

    Args:
        vehicle: that follows.
        before, after: the rows.
        moved: last instant before at which the reference was faster than that.
        head: beginning of the message, before the time.

    Returns:
        The last such instant so far.

    Raises:
        Refusal: a limit is exceeded, or the path is too steep or turns straight back.

    """
    T = after.t - before.t
    n = max(_LEAST, min(_MOST, ceil(min(T, _MOST * _BETWEEN) / _BETWEEN)))
    for i in range(n + 1):
        t = before.t + T * i / n
        moment = reference(before, after, t)
        speed, a = norm(moment.dy_d), norm(moment.ddy_d)
        easy = speed <= _GENTLE and follower.is_easy(vehicle, moment)
        if speed <= SLOW:
            if easy or a == 0.0:
                continue
            # It sets out in the direction of its acceleration.
            moment = moment._replace(dy_d=scale(SLOW / a, moment.ddy_d))
        (x, y, z), (dx, dy, dz), _ = moment
        u, v, w = moved.dy
        climb = atan2(abs(dz), sqrt(dx * dx + dy * dy))
        if climb > STEEPEST:
            raise Refusal(
                f"{head}{t:g} s, at ({x:.3g}, {y:.3g}, {z:.3g}) m, the path climbs or dives at "
                f"{degrees(climb):.1f} degrees, {degrees(climb - STEEPEST):.2g} beyond the limit "
                f"of {degrees(STEEPEST):g}: (1) has a pole at 90"
            )
        if speed > _GENTLE and t - moved.t < _REST and u * dx + v * dy + w * dz < 0.0:
            raise Refusal(
                f"{head}{t:g} s, at ({x:.3g}, {y:.3g}, {z:.3g}) m, the path turns straight back; "
                f"let it turn to one side, or rest for {_REST:g} s"
            )
        if not easy:
            follower.check_demand(
                vehicle, moment, head, t, " s", "give the rows more time, or smooth them"
            )
        if speed > _GENTLE:
            moved = Row(t, moment.y_d, moment.dy_d)
    return moved
