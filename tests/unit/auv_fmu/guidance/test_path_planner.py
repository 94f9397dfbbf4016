"""The reference through waypoints: its definition, its smoothness, and refused paths."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.guidance import path_planner
from auv_fmu.guidance.follower import Follower, demand, posture
from auv_fmu.guidance.path_planner import MOST, Parameters, Waypoints, check
from auv_fmu.paper import motion_planner
from auv_fmu.paper.actuators import Limits
from auv_fmu.paper.motion_planner import Reference
from auv_fmu.paper.vehicle import Vehicle, accelerations
from support.helix import helix_after

VEHICLE, ELL = Vehicle(), 0.35

#: Two points integrate polynomials of the third degree exactly.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(2)


def path(*points, t=None, **others) -> Waypoints:
    """Waypoints (x, y, z), at times if there are any."""
    rest = MOST - len(points)
    x, y, z = ((*map(float, axis), *(0.0,) * rest) for axis in zip(*points, strict=True))
    times = (*t, *(0.0,) * rest) if t else (0.0,) * MOST
    return Waypoints(len(points), x, y, z, times, timed=bool(t), **others)


def at(waypoints: Waypoints, t: float) -> Reference:
    first = path_planner.first_corner(waypoints, 0.0)
    return path_planner.reference(waypoints, path_planner.corner_ahead(waypoints, first, t), t)


def mean(waypoints: Waypoints, t: float) -> Reference:
    """The definition: integrals of the motion on straight legs, over the time around t."""
    n, T = waypoints.n, waypoints.rounding
    points = np.array([waypoints.x[:n], waypoints.y[:n], waypoints.z[:n]])
    lengths = np.linalg.norm(np.diff(points), axis=0)
    passed = T / 2 + np.cumsum([0.0, *lengths]) / waypoints.cruise
    times = np.array(waypoints.t[:n]) if waypoints.timed else passed
    velocities = np.diff(points) / np.diff(times)
    inner = [s for s in (times - t) / T if -0.5 < s < 0.5]
    integral = np.zeros((3, 3))
    for a, b in pairwise([-0.5, *sorted(inner), 0.5]):
        for node, weight in zip(NODES, WEIGHTS * (b - a) / 2, strict=True):
            s = (a + b) / 2 + node * (b - a) / 2
            now, leg = t + T * s, int(np.searchsorted(times, t + T * s)) - 1
            y = [np.interp(now, times, axis) for axis in points]
            v = velocities[:, leg] if 0 <= leg < n - 1 else np.zeros(3)
            parabola, slope = 1.5 * (1.0 - 4.0 * s * s), -12.0 * s
            integral += weight * np.array([parabola * np.array(y), parabola * v, -slope / T * v])
    return Reference(*map(tuple, integral))


coordinates = st.tuples(*(st.floats(-50.0, 50.0),) * 3)


@st.composite
def timed(draw) -> tuple[Waypoints, float]:
    """A path and a moment, often one at which a rounding begins, is halfway, or ends."""
    points = draw(st.lists(coordinates, min_size=2, max_size=MOST))
    gaps = draw(st.lists(st.floats(0.1, 20.0), min_size=len(points), max_size=len(points)))
    T = draw(st.floats(0.1, 30.0))
    times = np.cumsum(gaps).tolist()
    moment = draw(st.sampled_from(times)) + draw(st.sampled_from([-T / 2, 0.0, T / 2]))
    anywhere = draw(st.floats(-T, times[-1] + T))
    return path(*points, t=times, rounding=T), draw(st.sampled_from([moment, anywhere]))


@given(timed())
def test_reference_is_the_mean_of_the_motion_on_straight_legs(drawn):
    waypoints, t = drawn
    speeds = [hypot(*path_planner.velocity(waypoints, k)) for k in range(waypoints.n + 1)]
    rounding = 1e-9 * (1.0 + max(speeds) / waypoints.rounding)
    for found, expected in zip(at(waypoints, t), mean(waypoints, t), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=rounding)


@given(timed())
def test_reference_is_twice_continuously_differentiable(drawn):
    """ddy_d cannot change faster than the third derivative, at most 6 jumps / T^2, allows."""
    waypoints, t = drawn
    legs = [np.array(path_planner.velocity(waypoints, k)) for k in range(waypoints.n + 1)]
    jumps = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(legs))
    h, T = 1e-6, waypoints.rounding
    before, after = at(waypoints, t - h), at(waypoints, t + h)
    most = 12 * jumps / T**2 * h + 1e-7 * (1.0 + jumps / T)
    assert np.linalg.norm(np.subtract(after.ddy_d, before.ddy_d)) <= most
    for low, high in ((0, 1), (1, 2)):
        slope = np.subtract(after[low], before[low]) / (2 * h)
        np.testing.assert_allclose(slope, np.add(after[high], before[high]) / 2, atol=most)


@given(timed())
def test_reference_is_never_faster_than_its_fastest_leg_nor_outside_of_its_waypoints(drawn):
    waypoints, t = drawn
    y_d, dy_d, _ = at(waypoints, t)
    legs = [path_planner.velocity(waypoints, k) for k in range(1, waypoints.n)]
    assert hypot(*dy_d) <= max(hypot(*v) for v in legs) * (1 + 1e-9)
    for value, axis in zip(y_d, (waypoints.x, waypoints.y, waypoints.z), strict=True):
        used = axis[: waypoints.n]
        assert min(used) - 1e-9 <= value <= max(used) + 1e-9


def test_reference_rests_at_both_ends_and_is_straight_and_steady_between_roundings():
    waypoints = path((0, 0, 0), (30, 40, 0), (30, 80, 0), cruise=0.5, rounding=10.0)
    still = ((0.0,) * 3,) * 2
    assert at(waypoints, -1.0) == ((0.0, 0.0, 0.0), *still)
    assert at(waypoints, 0.0) == ((0.0, 0.0, 0.0), *still)
    assert at(waypoints, 190.0 + 1e-9) == at(waypoints, 1e6) == ((30.0, 80.0, 0.0), *still)
    for t in (10.0, 55.0, 99.0):
        y_d, dy_d, ddy_d = at(waypoints, t)
        assert y_d == pytest.approx((0.3 * (t - 5.0), 0.4 * (t - 5.0), 0.0), abs=1e-12)
        assert (dy_d, ddy_d) == (pytest.approx((0.3, 0.4, 0.0), abs=1e-15), (0.0, 0.0, 0.0))


def test_corner_is_cut_by_three_32ths_of_the_jump_and_its_time():
    waypoints = path((0, 0, 0), (10, 0, 0), (10, 10, 0), cruise=0.5, rounding=6.0)
    y_d, _, ddy_d = at(waypoints, 3.0 + 20.0)
    assert y_d == pytest.approx((10.0 - 0.28125, 0.28125, 0.0), abs=1e-12)
    assert hypot(*ddy_d) == pytest.approx(1.5 * 0.5 * sqrt(2.0) / 6.0)


def test_waypoints_of_a_circle_turn_as_the_circle_does():
    """On the average exactly, at each moment to 12 %, where roundings are over three of them."""
    n, V, R = MOST - 1, 0.4, 5.0
    around = [(R * cos(2 * pi * k / n), R * sin(2 * pi * k / n), 0.0) for k in range(n + 1)]
    leg = 2 * R * sin(pi / n) / V
    waypoints = path(*around, cruise=V, rounding=3 * leg)
    turns = [
        demand(VEHICLE, ELL, at(waypoints, t)).turn
        for t in np.arange(5 * leg, (n - 2) * leg - 1e-9, leg / 50)
    ]
    assert turns == pytest.approx([2 * pi / n / leg] * len(turns), rel=0.12)
    assert np.mean(turns) == pytest.approx(2 * pi / n / leg, rel=1e-3)


@given(speed=st.floats(0.05, 1.5), radius=st.floats(1.0, 50.0))
def test_vehicle_under_what_a_level_circle_asks_for_goes_round_it(speed, radius):
    """(2) under what is asked for settles at the speed and the turn of the path."""
    r = speed / radius
    moment = Reference((0.0,) * 3, (speed, 0.0, 0.0), (0.0, speed * r, 0.0))
    asked = demand(VEHICLE, ELL, moment)
    assert (asked.speed, asked.turn) == (pytest.approx(speed), pytest.approx(r))
    nu = (speed, 0.0, 0.0, 0.0, r)
    for _ in range(2000):
        rates = accelerations(VEHICLE, nu, 0.0, asked.tau, (0.0,) * 5)
        nu = tuple(x + 0.02 * dx for x, dx in zip(nu, rates, strict=True))
    u, v, w, q, turned = nu
    assert hypot(u, v + ELL * turned, w - ELL * q) == pytest.approx(speed, rel=1e-6)
    assert turned == pytest.approx(r, rel=1e-6)


def test_helix_of_fig_4_asks_for_the_torques_that_drive_it():
    """To 1 %: it climbs as the path does, and the vehicle drifts a little."""
    asked = demand(VEHICLE, ELL, motion_planner.reference(*helix_after(5000), ELL))
    assert asked.tau == pytest.approx((5.0, 1.0, 2.0), rel=0.01)


def test_surge_that_speeds_up_is_paid_for():
    straight = Reference((0.0,) * 3, (0.0, 0.5, 0.0), (0.0, 0.1, 0.0))
    assert demand(VEHICLE, ELL, straight).tau == pytest.approx((25 * 0.1 + 30 * 0.5, 0.0, 0.0))


def test_climb_needs_a_moment_against_the_righting_moment():
    climb = Reference((0.0,) * 3, (0.4, 0.0, -0.3), (0.0, 0.0, 0.0))
    assert demand(VEHICLE, ELL, climb).tau == pytest.approx((15.0, 5.0 * 0.6, 0.0))


CORNER = path((0, 0, 0), (20, 0, 0), (20, 20, 0))

#: After a climb at 80 degrees.
UP_80 = (10, 0, 10 * tan(radians(80.0)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"waypoints": CORNER, "follower": Follower(speed_max=0.4)},
            r"near waypoint 1, .* a speed of 0\.4.* 0\.4;",
        ),
        (
            {"waypoints": CORNER, "follower": Follower(turn_max=0.4)},
            r"near waypoint 2, at \(19.* a turn of 0\.4",
        ),
        ({"waypoints": path((0, 0, 0), (20, 0, 0), rounding=0.2)}, "waypoint 1.* surge force of"),
        ({"waypoints": CORNER._replace(rounding=1.0)}, r"at \(19\..*more tightly than .* 0.35 m"),
        ({"waypoints": path((0, 0, 0), (9, 0, 0), (0, 0, 0))}, "straight back at waypoint 2"),
        ({"waypoints": path((0, 0, 0), (9, 0, 0), (0, 0, 1e-12))}, "straight back"),
        (
            {"waypoints": path((0, 0, 0), (9, 0, 0), (1, 0, 0), t=(9.0, 29.0, 39.0))},
            "turns straight back at waypoint 2",
        ),
        ({"waypoints": path((0, 0, 0), (0, 0, 9))}, "from waypoint 1 to 2 climbs or dives at 90"),
        ({"waypoints": path((0, 0, 0), (9, 0, 0), (9, 0, 0))}, "waypoints 2 and 3 are the same"),
        (
            {"waypoints": path((0, 0, 0), (9, 0, 0), t=(3.0, 3.0))},
            "waypoint 2 has the time 3 s, and the one before it 3 s",
        ),
        ({"waypoints": path((1, 1, 1), (1, 1, 1), t=(3.0, 9.0))}, "there is no path between them"),
        (
            {"waypoints": path((0, 0, 0), UP_80, (0, 0, 20 * tan(radians(80.0))))},
            r"near waypoint 2, at \(9\.9, 0, 56\.7\) m, the path climbs or dives at 90\.0 degrees, "
            "5 beyond the limit of 85",
        ),
        (
            {"waypoints": path((0, 0, 0), UP_80, (0, 1, 110), t=(9.0, 159.0, 309.0))},
            r"near waypoint 2, .* climbs or dives at 89\.\d degrees, 4\.\d+ beyond",
        ),
        ({"waypoints": path((0, 0, 0), (1, 0, 5), (0, 0, 10))}, "waypoint 2, .* at 90.0 degrees"),
        (
            {"follower": Follower(speed_max=0.49999999)},
            r"a speed of 0\.5 m/s, 1e-08 beyond the limit of 0\.5; reduce",
        ),
        ({"follower": Follower(Vehicle(d33=0.0))}, "d22 and d33 must be positive"),
    ],
)  # fmt: skip
def test_path_that_cannot_be_followed_is_refused_where_it_cannot(changes, message):
    with pytest.raises(Refusal, match=message):
        check(Parameters(**changes))


def is_too_steep(waypoints: Waypoints) -> bool:
    try:
        path_planner._check_pitch(waypoints)
    except Refusal as error:
        assume("climbs or dives" in str(error))  # or it turns back
        return True
    return False


@st.composite
def steep(draw) -> Waypoints:
    """A path of legs that are let pass, steep ones among them."""
    points = [(0.0, 0.0, 0.0)]
    for _ in range(draw(st.integers(1, 5))):
        length, turn = draw(st.floats(0.1, 30.0)), draw(st.floats(0.0, 2 * pi))
        climb = radians(draw(st.floats(70.0, 85.0)) * draw(st.sampled_from([1.0, -1.0, 0.1])))
        leg = (cos(climb) * cos(turn), cos(climb) * sin(turn), sin(climb))
        points.append(tuple(p + length * e for p, e in zip(points[-1], leg, strict=True)))
    gaps = draw(st.lists(st.floats(0.1, 30.0), min_size=len(points), max_size=len(points)))
    times = np.cumsum(gaps).tolist() if draw(st.booleans()) else None
    return path(*points, t=times, rounding=draw(st.floats(0.3, 30.0)))


def steepest(waypoints: Waypoints) -> float:
    """The steepest of many moments [rad], from sums over all corners at once."""
    n, T = waypoints.n, waypoints.rounding
    points = np.array([waypoints.x[:n], waypoints.y[:n], waypoints.z[:n]]).T
    ways = np.diff(points, axis=0)
    gaps = np.linalg.norm(ways, axis=1) / waypoints.cruise
    times = np.array(waypoints.t[:n]) if waypoints.timed else np.cumsum([0.0, *gaps])
    legs = ways / np.diff(times)[:, None]
    jumps = np.diff(np.vstack([np.zeros(3), legs, np.zeros(3)]), axis=0)
    moments = (times[:, None] + T * np.linspace(-0.5, 0.5, 4001)).ravel()
    a = np.clip((moments[:, None] - times) / T + 0.5, 0.0, 1.0)
    x, y, z = (a * a * (3.0 - 2.0 * a) @ jumps).T
    # Slower than that, rounding errors decide its direction.
    moves = x * x + y * y + z * z > 1e-12 * np.max(legs * legs)
    return float(np.max(np.arctan2(np.abs(z), np.hypot(x, y)), where=moves, initial=0.0))


@settings(max_examples=60)
@given(steep())
def test_path_is_refused_where_its_pitch_is_beyond_its_limit_and_nowhere_else(waypoints):
    """Also where roundings overlap."""
    found = steepest(waypoints)
    # Between two moments it may be a little steeper.
    assume(not motion_planner.STEEPEST - radians(0.1) < found <= motion_planner.STEEPEST + 1e-9)
    assert is_too_steep(waypoints) == (found > motion_planner.STEEPEST)


@given(first=st.floats(60.0, 84.99), second=st.floats(60.0, 84.99), turn=st.floats(0.0, 180.0))
def test_pitch_of_one_corner_is_refused_where_the_closest_pass_by_the_vertical_is_beyond(
    first, second, turn
):
    """Velocities in a rounding are on the straight line from one to the other."""
    legs = [
        np.array([cos(climb) * cos(psi), cos(climb) * sin(psi), sin(climb)])
        for climb, psi in ((radians(first), 0.0), (radians(second), radians(turn)))
    ]
    points = [np.zeros(3), 40 * legs[0], 40 * (legs[0] + legs[1])]
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    x, y, z = ((1 - shares) * legs[0] + shares * legs[1]).T
    steepest = float(np.max(np.arctan2(z, np.hypot(x, y))))
    assume(abs(steepest - motion_planner.STEEPEST) > 1e-3)
    assert is_too_steep(path(*map(tuple, points))) == (steepest > motion_planner.STEEPEST)


def test_path_at_the_steepest_is_let_pass():
    slope = tan(motion_planner.STEEPEST) * (1.0 - 1e-15)
    for times in (None, (9.0, 99.0, 299.0)):
        waypoints = path((0, 0, 0), (1, 0, slope), (3, 0, 3 * slope), t=times)
        assert not is_too_steep(waypoints)
        assert steepest(waypoints) == pytest.approx(motion_planner.STEEPEST, rel=1e-9)


def test_a_rest_may_separate_two_opposite_ways():
    check(Parameters(path((0, 0, 0), (9, 0, 0), (9, 0, 0), (0, 1, 0), t=(3.0, 30.0, 40.0, 70.0))))


@pytest.mark.parametrize(("axis", "k"), [("u", 0), ("q", 1), ("r", 2)])
@pytest.mark.parametrize("sign", [1, -1])
def test_path_is_let_pass_up_to_each_limit_of_3(axis, k, sign):
    """The default path, whose greatest demands are looked for in steps of 20 ms."""
    default, given_limits = Parameters(), Limits()
    asked = [
        sign * demand(VEHICLE, ELL, moment).tau[k]
        for moment in (at(default.waypoints, 0.05 + 0.02 * i) for i in range(4800))
        if hypot(*moment.dy_d) > 1e-6
    ]
    most = max(asked)
    name = "tau_max" if sign > 0 else "tau_min"

    def limited(limit):
        limits = list(getattr(given_limits, name))
        limits[k] = sign * limit
        changed = given_limits._replace(**{name: tuple(limits)})
        return default._replace(follower=Follower(limits=changed))

    check(limited(most * 1.01 + 1e-9))
    if most > 1e-6:
        with pytest.raises(Refusal, match=r"near waypoint \d"):
            check(limited(most * 0.99))


@given(timed())
def test_posture_points_along_the_path_and_carries_the_control_point(drawn):
    waypoints, t = drawn
    first = path_planner.first_corner(waypoints, 0.0)
    corner = path_planner.corner_ahead(waypoints, first, t)
    y_d, dy_d, _ = path_planner.reference(waypoints, corner, t)
    along = path_planner.course(waypoints, corner, dy_d)
    assume(hypot(*along) > 1e-6)
    x, y, z, theta, psi = posture(y_d, along, ELL)
    e1 = np.array([cos(theta) * cos(psi), cos(theta) * sin(psi), -sin(theta)])
    np.testing.assert_allclose(np.array([x, y, z]) + ELL * e1, y_d, atol=1e-9)
    np.testing.assert_allclose(np.cross(e1, along), 0.0, atol=1e-9 * hypot(*along))
    assert e1 @ along > 0.0


def test_course_at_rest_follows_the_leg_before_or_the_first():
    waypoints = path((0, 0, 0), (9, 0, 0), (9, 0, 0), (9, 9, 0), t=(10.0, 20.0, 40.0, 50.0))
    for t, direction in ((0.0, (1, 0, 0)), (30.0, (1, 0, 0)), (99.0, (0, 1, 0))):
        first = path_planner.first_corner(waypoints, 0.0)
        corner = path_planner.corner_ahead(waypoints, first, t)
        along = path_planner.course(waypoints, corner, (0.0, 0.0, 0.0))
        assert along == pytest.approx(np.multiply(direction, 0.9))
