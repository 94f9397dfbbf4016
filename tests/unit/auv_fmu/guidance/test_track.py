"""The reference through the rows of a table, and refused tracks."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.guidance import track
from auv_fmu.guidance.follower import Follower
from auv_fmu.guidance.track import Row

#: Position and velocity over time.
Motion = Callable[[float], tuple[tuple[float, float, float], tuple[float, float, float]]]

#: Factors of 1, t, t^2 and t^3.
cubics = st.tuples(*(st.floats(-2.0, 2.0),) * 4)


def rows(motion: Motion, *times: float) -> list[Row]:
    return [Row(float(t), *motion(float(t))) for t in times]


def check(motion: Motion, *times: float) -> None:
    table = rows(motion, *times)
    moved = Row(table[0].t, table[0].y, (0.0, 0.0, 0.0))
    for before, after in pairwise(table):
        moved = track.check(Follower(), before, after, moved, "a.csv: at t = ")


def circle(radius: float, speed: float) -> Motion:
    w = speed / radius
    return lambda t: (
        (radius * cos(w * t), radius * sin(w * t), 5.0),
        (-speed * sin(w * t), speed * cos(w * t), 0.0),
    )


def straight(psi: float, climb: float, way: Callable[[float], tuple[float, float]]) -> Motion:
    """A straight line with a position and a velocity along it."""
    x, y, z = cos(psi) * cos(climb), sin(psi) * cos(climb), -sin(climb)

    def motion(t: float):
        s, ds = way(t)
        return (s * x, s * y, s * z), (ds * x, ds * y, ds * z)

    return motion


@given(cubics, cubics, cubics, st.floats(1.0, 3.5))
def test_between_two_rows_cubic_polynomials_are_exact(x, y, z, t):
    polynomials = [np.polynomial.Polynomial(factors) for factors in (x, y, z)]

    def motion(t: float):
        return tuple(p(t) for p in polynomials), tuple(p.deriv()(t) for p in polynomials)

    found = track.reference(*rows(motion, 1.0, 3.5), t)
    for order, values in enumerate(found):
        expected = [p.deriv(order)(t) if order else p(t) for p in polynomials]
        np.testing.assert_allclose(values, expected, rtol=1e-11, atol=1e-11)


def test_reference_rests_outside_of_the_rows():
    before, after = rows(circle(9.0, 0.5), 1.0, 2.0)
    assert track.reference(before, after, 0.999) == (before.y, (0.0,) * 3, (0.0,) * 3)
    assert track.reference(before, after, 2.001) == (after.y, (0.0,) * 3, (0.0,) * 3)


@pytest.mark.parametrize(
    ("motion", "why"),
    [
        # Beyond 80 N from t on, if 25 kg * 1 m/s2 + 30 kg/s * 1 m/s2 * t.
        (
            straight(0.3, 0.0, lambda t: (t * t / 2, t)),
            r"t = 1\.8375 s, .* force of 80\.1 N, 0\.12 ",
        ),
        # 25 kg * 3.5 m/s2 at once, and 30 kg/s * 0.02 m/s.
        (straight(2.0, 0.0, lambda t: (1.75 * t * t, 3.5 * t)), r"t = 0 s, .* of 88\.1 N, 8\.1 "),
        (
            straight(0.0, radians(86.0), lambda t: (0.4 * t, 0.4)),
            r"dives at 86\.0 degrees, 1 beyond",
        ),
        (straight(0.0, pi / 2, lambda t: (0.05 * t, 0.05)), "climbs or dives at 90.0 degrees"),
        (circle(0.2, 0.3), "more tightly than .*, 0.35 m ahead"),
        (circle(9.0, 2.6), r"a speed of 2\.6 m/s, 0\.1 beyond the limit of 2\.5"),
    ],
)
def test_track_that_cannot_be_followed_is_refused_when_it_cannot(motion, why):
    with pytest.raises(Refusal, match=f"^a.csv: at .*{why}"):
        check(motion, *np.linspace(0.0, 6.0, 61))


@pytest.mark.parametrize("rows_apart", [0.1, 1.0, 10.0])
def test_way_straight_back_is_refused_without_a_rest(rows_apart):
    """Close and far rows give the same answer; the path is slower than 0.1 m/s from 8 s to 12 s."""
    back = straight(1.0, 0.2, lambda t: (0.5 * t - 0.025 * t * t, 0.5 - 0.05 * t))
    times = np.arange(0.0, 20.0 + rows_apart / 2, rows_apart)
    with pytest.raises(Refusal, match=r"at t = 12\.?\d* s, .* straight back"):
        check(back, *times)

    def rested(t: float):
        return back(min(t, 10.0) + max(t - 11.2, 0.0))

    check(rested, *np.arange(0.0, 21.0, 0.1))


def test_slow_reference_may_have_any_course():
    """Such as measured positions at rest, which differ by millimetres."""
    random = np.random.default_rng(1)
    places = random.uniform(-1e-3, 1e-3, (99, 3))
    speeds = random.uniform(-5e-3, 5e-3, (99, 3))
    check(lambda t: (tuple(places[round(t)]), tuple(speeds[round(t)])), *range(99))
