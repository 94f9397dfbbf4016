"""Line-of-sight guidance: MSS's functions number by number, and analytic solutions."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from math import asin, atan2, cos, exp, hypot, inf, pi, sin, sqrt, tan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from auv_fmu import Refusal
from auv_fmu.guidance import los
from auv_fmu.guidance.los import Angle, Law, Leg, Parameters, State, ssa
from auv_fmu.guidance.path_planner import MOST

#: Relative to a metre and a radian; MSS puts the end of its last leg 1e10 m away.
CLOSE = {"rel": 1e-12, "abs": 1e-12}

STILL = Angle(0.0, 0.0)


@cache
def table() -> dict[tuple[str, int], list[list[float]]]:
    """Calls of MSS's functions, by the function and the number of its run."""
    found: dict[tuple[str, int], list[list[float]]] = {}
    with (Path(__file__).parent / "mss" / "table.csv").open(encoding="utf-8") as file:
        for name, run, *values in csv.reader(file):
            found.setdefault((name, int(run)), []).append([*map(float, values)])
    return found


def path(points: list[list[float]], flat: bool = False) -> los.Path:
    rest = (0.0,) * (MOST - len(points))
    x, y, z = ((*axis, *rest) for axis in zip(*points, strict=True))
    return los.Path(len(points), x, y, (0.0,) * MOST if flat else z)


def runs(name: str) -> list[tuple[los.Path, list[list[float]]]]:
    """The paths and calls of a function."""
    return [
        (path(table()["waypoint", run], flat=name != "ALOS3D"), calls)
        for (function, run), calls in table().items()
        if function == name
    ]


# MSS, number by number


def follow_calls(
    law: Law, calls: list[tuple[los.Path, list[list[float]]]], names: tuple[str, ...]
) -> Iterator[tuple[State, float, float, list[float]]]:
    """Call the guidance as MSS was called: state, heading, cross-track error, and MSS's results."""
    for waypoints, rows in calls:
        state = State(1, 0.0, 0.0, STILL, STILL)
        for x, y, *values in rows:
            given_ = dict(zip(names, values, strict=False))
            h = given_.pop("h", 0.0)
            parameters = Parameters(waypoints, law, crab_max=inf, **given_)
            line = los.leg(waypoints, state.k)
            e = los.errors(line, (x, y, 0.0))
            psi, _ = los.command(parameters, state, line, e)
            state = los.advance(parameters, state, line, e, h)
            yield state, psi, e[1], values[len(names) :]
        assert state.k == waypoints.n


def test_los_agrees_with_mss():
    calls = [*follow_calls(Law.PROPORTIONAL, runs("LOSchi"), ("Delta_h", "radius"))]
    assert len(calls) == 140
    for _, psi, y_e, results in calls:
        assert [psi, y_e] == pytest.approx(results, **CLOSE)


def test_integral_law_agrees_with_mss():
    names = "Delta_h", "kappa", "h", "radius"
    for _, psi, y_e, results in follow_calls(Law.INTEGRAL, runs("ILOSpsi"), names):
        assert [psi, y_e] == pytest.approx(results, **CLOSE)


def test_adaptive_law_agrees_with_mss():
    """With its estimate of the crab angle, and its waypoint after each call."""
    names, before = ("Delta_h", "gamma_h", "h", "radius"), 0.0
    for state, psi, y_e, results in follow_calls(Law.ADAPTIVE, runs("ALOSpsi"), names):
        before = 0.0 if results[2] == 0.0 else before
        assert [psi, y_e, before, state.k] == pytest.approx(results, **CLOSE)
        before = state.learnt_h


def test_adaptive_law_in_three_dimensions_agrees_with_mss():
    """A leg ends where MSS's ends: at a sphere around its waypoint, not at a distance along it."""
    held = 0
    for waypoints, rows in runs("ALOS3D"):
        state = State(1, 0.0, 0.0, STILL, STILL)
        for x, y, z, Delta_h, Delta_v, gamma_h, gamma_v, crab_max, h, radius, *results in rows:
            parameters = Parameters(
                waypoints, Law.ADAPTIVE, Delta_h, Delta_v, 0.0, gamma_h, gamma_v, crab_max
            )
            line = los.leg(waypoints, state.k)
            e = los.errors(line, (x, y, z))
            psi, theta = los.command(parameters, state, line, e)
            expected = [psi, theta, e[1], e[2], state.learnt_v, state.learnt_h]
            assert expected == pytest.approx(results, **CLOSE)
            held += max(abs(state.learnt_h), abs(state.learnt_v)) > crab_max
            ends = state.k < waypoints.n and (
                hypot(*np.subtract(los.waypoint(waypoints, state.k + 1), (x, y, z))) < radius
            )
            state = los.advance(parameters, state, line, e, h)._replace(k=state.k + ends)
        assert state.k == waypoints.n
    assert held > 10


def test_observer_agrees_with_mss():
    """It returns T_f times the rate, which is an angle; :func:`los.rate` is the rate."""
    for run in (1, 2, 3):
        for angle, scaled, commanded, h, K_f, *results in table()["LOSobserver", run]:
            after = los.observe(K_f, Angle(angle, angle - scaled), commanded, h)
            found = [after.angle, los.lag(K_f) * los.rate(K_f, after)]
            assert found == pytest.approx(results, **CLOSE)


def test_errors_agree_with_mss():
    """Only y_e of crosstrackWpt3D: an element of its R_z has a wrong sign, so lengths change."""
    for run in range(1, 21):
        (x2, y2, x1, y1, x, y, y_e), [angle, wrapped] = (
            table()[name, run][0] for name in ("crosstrackWpt", "ssa")
        )
        line = Leg((x1, y1, 0.0), atan2(y2 - y1, x2 - x1), 0.0, 1.0)
        assert los.errors(line, (x, y, 0.0))[1] == pytest.approx(y_e, **CLOSE)
        assert ssa(angle) == pytest.approx(wrapped, **CLOSE)
        values = table()["crosstrackWpt3D", run][0]
        end, begin, place, result = (values[i : i + 3] for i in (0, 3, 6, 9))
        line = los.leg(path([begin, end]), 1)
        e = los.errors(line, tuple(place))
        assert e[1] == pytest.approx(result[1], **CLOSE)
        away = hypot(*np.subtract(place, begin))
        assert hypot(*e) == pytest.approx(away)
        assert hypot(*result) != pytest.approx(away, abs=1e-3)


# The path


places = st.tuples(*(st.floats(-1e3, 1e3),) * 3)


@given(places, places, places)
def test_errors_and_the_point_abeam_are_projections_on_a_line(begin, end, place):
    """Against the projection on a line by vectors."""
    way = np.subtract(end, begin)
    if np.linalg.norm(way) < 1.0:
        return
    line = los.leg(path([[*begin], [*end]]), 1)
    along = way / np.linalg.norm(way)
    away = np.subtract(place, begin)
    x_e, y_e, z_e = los.errors(line, place)
    np.testing.assert_allclose(x_e, away @ along, atol=1e-9)
    np.testing.assert_allclose(los.abeam(line, x_e), begin + (away @ along) * along, atol=1e-9)
    np.testing.assert_allclose(hypot(y_e, z_e), np.linalg.norm(away - x_e * along), atol=2e-5)


def test_a_leg_ends_for_a_vehicle_that_misses_its_waypoint():
    """It passes 10 m beside a waypoint with a radius of 3 m."""
    waypoints = path([[0.0, 0.0, 0.0], [50.0, 0.0, 5.0], [100.0, 0.0, 5.0]])
    k = 1
    for x in np.arange(0.0, 90.0, 0.5):
        k = los.next_leg(waypoints, k, 3.0, los.errors(los.leg(waypoints, k), (x, 10.0, 5.0))[0])
    assert k == 2
    assert los.next_leg(waypoints, 2, 3.0, 47.1) == 3
    assert los.next_leg(waypoints, 3, 3.0, 1e9) == 3


def test_desired_depth_is_limited_to_the_depths_of_the_ends():
    waypoints = path([[0.0, 0.0, 2.0], [50.0, 0.0, 7.0], [100.0, 0.0, 4.0]])
    assert [los.depth(waypoints, k, z) for k, z in ((1, 0.0), (1, 5.0), (2, 9.0), (3, 0.0))] == [
        2.0, 5.0, 7.0, 4.0,
    ]  # fmt: skip


def test_last_leg_continues_on_level():
    waypoints = path([[0.0, 0.0, 2.0], [30.0, 40.0, 9.0]])
    line = los.leg(waypoints, 2)
    assert (line.begin, line.elevation) == ((30.0, 40.0, 9.0), 0.0)
    assert line.azimuth == pytest.approx(atan2(40.0, 30.0))


@pytest.mark.parametrize(
    ("points", "why"),
    [
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "waypoints 1 and 2 are 0 m apart"),
        ([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 2.9, 0.0]], "2 and 3 are 2.9 m apart"),
        ([[0.0, 0.0, 0.0], [0.1, 0.0, 9.0]], "dives at 89.4 degrees"),
    ],
)
def test_impossible_paths_are_refused(points, why):
    with pytest.raises(Refusal, match=why):
        los.check(path(points), 3.0)


# The laws, with a vehicle that has its heading at once


CRAB, SPEED, DELTA = 0.3, 1.2, 6.0
KAPPA, GAMMA = SPEED / 4.0, SPEED / (4.0 * DELTA * DELTA)
LEARNT = {Law.PROPORTIONAL: 0.0, Law.INTEGRAL: DELTA * tan(asin(CRAB / SPEED)) / KAPPA,
          Law.ADAPTIVE: asin(CRAB / SPEED)}  # fmt: skip
NORTH = path([[0.0, 0.0, 0.0], [1e4, 0.0, 0.0]])


def drift(law: Law) -> Callable[[float, np.ndarray], list[float]]:
    """Rates of (y_e, m) of a vehicle with a speed through water that moves across its path."""

    def rates(_: float, x: np.ndarray) -> list[float]:
        y_e, m = x
        psi = -{
            Law.PROPORTIONAL: atan2(y_e, DELTA),
            Law.INTEGRAL: atan2(y_e + KAPPA * m, DELTA),
            Law.ADAPTIVE: m + atan2(y_e, DELTA),
        }[law]
        learns = {
            Law.PROPORTIONAL: 0.0,
            Law.INTEGRAL: DELTA * y_e / (DELTA**2 + (y_e + KAPPA * m) ** 2),
            Law.ADAPTIVE: GAMMA * DELTA * y_e / hypot(DELTA, y_e),
        }[law]
        return [SPEED * sin(psi) + CRAB, learns]

    return rates


def steered(law: Law, y_e: float, until: float, h: float) -> np.ndarray:
    """(t, y_e, m) of the same vehicle by the guidance, in steps by Euler's scheme."""
    parameters = Parameters(NORTH, law, DELTA, DELTA, KAPPA, GAMMA, GAMMA)
    x, y, state = 0.0, y_e, State(1, 0.0, 0.0, STILL, STILL)
    rows = []
    for i in range(round(until / h) + 1):
        line = los.leg(NORTH, 1)
        e = los.errors(line, (x, y, 0.0))
        rows.append((i * h, e[1], state.learnt_h))
        psi, _ = los.command(parameters, state, line, e)
        state = los.advance(parameters, state, line, e, h)
        x, y = x + h * SPEED * cos(psi), y + h * (SPEED * sin(psi) + CRAB)
    return np.array(rows)


@pytest.mark.parametrize("law", Law)
def test_laws_converge_as_their_differential_equations(law: Law):
    """Euler's scheme differs by O(h): half the step, half the difference."""
    away = []
    for h in (0.02, 0.01):
        rows = steered(law, 8.0, 60.0, h)
        exact = solve_ivp(drift(law), (0.0, 60.0), [8.0, 0.0], rtol=1e-10, atol=1e-12,
                          t_eval=rows[:, 0].clip(0.0, 60.0))  # fmt: skip
        away.append(np.abs(rows[:, 1] - exact.y[0]).max())
    assert away[0] < 0.02
    assert away[0] / away[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("law", Law)
def test_offset_in_a_current(law: Law):
    """Delta tan(asin(v / U)) without memory, none with it; then the crab angle is asin(v / U)."""
    _, y_e, m = steered(law, 0.0, 300.0, 0.02)[-1]
    offset = DELTA * tan(asin(CRAB / SPEED)) if law == Law.PROPORTIONAL else 0.0
    assert [y_e, m] == pytest.approx([offset, LEARNT[law]], abs=1e-8)
    if law != Law.PROPORTIONAL:
        assert los.aim(law, DELTA, KAPPA, m, 0.0) == pytest.approx(asin(CRAB / SPEED), abs=1e-8)


@pytest.mark.parametrize("law", [Law.INTEGRAL, Law.ADAPTIVE])
def test_stated_gains_are_critically_damped(law: Law):
    """kappa = U / 4 and gamma = U / (4 Delta^2): both poles at -U / (2 Delta), near the leg."""
    small = 1e-7
    columns = [
        (
            -SPEED * sin(los.aim(law, DELTA, KAPPA, m, y_e)),
            los.learn(law, DELTA, KAPPA, GAMMA, 1.0, m, y_e),
        )
        for y_e, m in small * np.eye(2)
    ]
    pole = -SPEED / (2.0 * DELTA)
    found = np.poly(np.transpose(columns) / small)
    np.testing.assert_allclose(found, np.poly([pole, pole]), rtol=1e-5)


@given(st.floats(-30.0, 30.0), st.sampled_from(Law))
def test_vehicle_never_leaves_the_corridor(y_e, law):
    """In still water it is never farther from the leg than at the start, and comes to it."""
    parameters = Parameters(NORTH, law, DELTA, DELTA, KAPPA, GAMMA, GAMMA)
    y, state, widest = y_e, State(1, 0.0, 0.0, STILL, STILL), 0.0
    for _ in range(600):
        line = los.leg(NORTH, 1)
        e = los.errors(line, (0.0, y, 0.0))
        psi, _ = los.command(parameters, state, line, e)
        state = los.advance(parameters, state, line, e, 0.1)
        y += 0.1 * SPEED * sin(psi)
        widest = max(widest, abs(y))
    assert widest <= abs(y_e)
    assert abs(y) < 0.03 * max(1.0, abs(y_e))


def test_crab_angle_is_held_within_its_limit():
    """It passes the limit by one step at most, and comes back at once."""
    arguments = Law.ADAPTIVE, 5.0, 0.0, 0.1, 0.2
    assert los.learn(*arguments, 0.21, 1.0) == 0.0
    assert los.learn(*arguments, 0.21, -1.0) < 0.0
    assert los.learn(*arguments, -0.21, -1.0) == 0.0
    assert los.learn(*arguments, 0.19, 1.0) == pytest.approx(0.1 * 5.0 / sqrt(26.0))


# Desired angles


def test_observer_has_the_stated_poles():
    """Both at -(K_f + sqrt(K_f)); against the exact step response of its transfer function."""
    K_f, h = 0.5, 1e-4
    w = K_f + sqrt(K_f)
    T_f = los.lag(K_f)
    desired = Angle(0.0, 0.0)
    for i in range(1, 60001):
        desired = los.observe(K_f, desired, 1.0, h)
        if i % 10000 == 0:
            t = i * h
            exact = 1.0 - exp(-w * t) * (1.0 + w * t) + w * w * T_f * t * exp(-w * t)
            assert desired.angle == pytest.approx(exact, abs=3e-4)


def test_rate_of_a_ramp_is_its_slope():
    """By its exact discretisation a little more, a / (1 - exp(-a)) with a = h / T_f."""
    desired, K_f, h = Angle(0.0, 0.0), 0.5, 0.01
    for i in range(6000):
        desired = los.observe(K_f, desired, 0.05 * i * h, h)
    a = h / los.lag(K_f)
    assert los.rate(K_f, desired) == pytest.approx(0.05 * a / (1.0 - exp(-a)), rel=1e-9)
    assert a / (1.0 - exp(-a)) < 1.015


@pytest.mark.parametrize("turns", [1, -1])
def test_desired_heading_does_not_jump(turns: int):
    """Around a square twice it goes on to two turns."""
    corners = [[0.0, 0.0], [40.0, 0.0], [40.0, turns * 40.0], [0.0, turns * 40.0]]
    points = [[*corner, 0.0] for corner in (*corners, *corners, corners[0])]
    parameters = Parameters(path(points), Law.PROPORTIONAL, radius=2.0)
    x, y, found = 0.0, 0.0, []
    state = los.begin(parameters, (0.0, 0.0, 0.0))
    for _ in range(3300):
        line = los.leg(parameters.path, state.k)
        e = los.errors(line, (x, y, 0.0))
        found.append(los.guided(parameters, state, line, e).eta_d.psi)
        state = los.advance(parameters, state, line, e, 0.1)
        x, y = x + 0.1 * cos(state.psi.angle), y + 0.1 * sin(state.psi.angle)
    assert state.k == len(points)
    assert found[-1] == pytest.approx(turns * 3.5 * pi, abs=0.1)
    assert max(abs(b - a) for a, b in pairwise(found)) < 0.2
