"""References in a formation: places, heading, exact derivatives, and what is refused."""

from __future__ import annotations

from itertools import combinations
from math import cos, dist, hypot, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu import formation, motion_planner
from auv_fmu.formation import (
    CIRCLE,
    COLUMN,
    LINE,
    TABLE,
    Estimator,
    FormationState,
    Heading,
    ImpossibleFormation,
    Known,
    Parameters,
    Stages,
    V,
)
from auv_fmu.motion_planner import Reference
from auv_fmu.path_planner import ImpossiblePath
from auv_fmu.proof import formation_bounds
from auv_fmu.proof.formation_bounds import ACCELERATION_GAIN, LAG_GAIN, RATE_GAIN

ORIGIN = (0.0, 0.0, 0.0)
DEFAULT = Parameters()
FOUR = (0.0,) * 4


def in_shape(shape: int, number: int = 2, vehicles: int = 3, **others) -> Parameters:
    return Parameters(number, vehicles, Stages()._replace(shape=(shape,) * 4), **others)


def known(y_0=ORIGIN, dy_0=ORIGIN, ddy_0=ORIGIN, psi_0=0.0, age=0.0) -> Known:
    return Known(y_0, dy_0, ddy_0, psi_0, age)


# Places


@pytest.mark.parametrize(
    ("shape", "places"),
    [
        (LINE, [(0, 0), (0, 5), (0, -5), (0, 10)]),
        (COLUMN, [(0, 0), (-5, 0), (-10, 0), (-15, 0)]),
        (V, [(0, 0), (-sqrt(12.5), sqrt(12.5)), (-sqrt(12.5), -sqrt(12.5)), (-sqrt(50), sqrt(50))]),
        (CIRCLE, [(sqrt(12.5), 0), (0, sqrt(12.5)), (-sqrt(12.5), 0), (0, -sqrt(12.5))]),
    ],
)
def test_places_of_four(shape, places):
    for number, (x, y) in enumerate(places, start=1):
        found = formation.offset(in_shape(shape, number, 4), 0)
        assert found == pytest.approx((x, y, 0.0), abs=1e-12)


@given(st.sampled_from([LINE, COLUMN, V, CIRCLE]), st.integers(2, 64), st.floats(0.1, 100.0))
def test_neighbours_are_the_spacing_apart_and_nobody_is_nearer(shape, vehicles, spacing):
    stages = Stages()._replace(shape=(shape,) * 4, spacing=(spacing,) * 4)
    places = [
        formation.offset(Parameters(number, vehicles, stages), 0)
        for number in range(1, vehicles + 1)
    ]
    distances = [dist(a, b) for a, b in combinations(places, 2)]
    assert min(distances) == pytest.approx(spacing)
    neighbours = sum(d == pytest.approx(spacing) for d in distances)
    assert neighbours >= vehicles - 1


def test_circle_of_one_is_on_the_reference():
    assert formation.offset(in_shape(CIRCLE, 1, 1), 0) == ORIGIN


coordinates = st.floats(-20.0, 20.0)


@st.composite
def tables(draw) -> Parameters:
    """Stages that no vehicle may be able to keep, with changes one after the other."""
    x, y, z = (draw(st.tuples(*(coordinates,) * 4)) for _ in "xyz")
    durations = draw(st.tuples(*(st.floats(1.0, 50.0),) * 3))
    rests = draw(st.tuples(*(st.floats(0.0, 20.0),) * 3))
    t = (rests[0], rests[0] + durations[0] + rests[1])
    t = (*t, t[1] + durations[1] + rests[2])
    stages = Stages(draw(st.integers(1, 4)), (TABLE,) * 4, FOUR, x, y, z, t, durations)
    return Parameters(stages=stages, omega_chi=draw(st.floats(0.05, 2.0)))


@given(tables(), st.floats(0.0, 250.0))
def test_place_is_twice_continuously_differentiable(parameters, t):
    """The third derivative is at most 60 |change| / T^3."""
    stages, h = parameters.stages, 1e-5
    points = [np.array(p) for p in zip(stages.x, stages.y, stages.z, strict=True)]
    jerk = max(
        60 * np.linalg.norm(b - a) / T**3
        for a, b, T in zip(points, points[1:], stages.duration, strict=False)
    )
    before, now, after = (formation.place(parameters, t + k * h) for k in (-1, 0, 1))
    most = 2 * jerk * h + 1e-6
    for low, high in ((0, 1), (1, 2)):
        slope = np.subtract(after[low], before[low]) / (2 * h)
        np.testing.assert_allclose(slope, now[high], atol=most)
    assert np.linalg.norm(np.subtract(after.ddd, before.ddd)) <= most


@given(tables())
def test_peaks_of_a_change_are_those_that_are_held_against_limits(parameters):
    stages = parameters.stages._replace(n=2)
    way = hypot(*(axis[1] - axis[0] for axis in (stages.x, stages.y, stages.z)))
    T = stages.duration[0]
    parameters = parameters._replace(stages=stages)
    moments = [formation.place(parameters, stages.t[0] + T * k / 1000) for k in range(1001)]
    assert max(hypot(*p.dd) for p in moments) == pytest.approx(1.875 * way / T, rel=1e-6)
    most = max(hypot(*p.ddd) for p in moments)
    assert most == pytest.approx(10 / sqrt(3) * way / T**2, rel=1e-4)
    assert moments[0].d == pytest.approx((stages.x[0], stages.y[0], stages.z[0]))
    assert moments[-1].d == pytest.approx((stages.x[1], stages.y[1], stages.z[1]))


# The heading


def exact(omega: float, heading: Heading, dpsi: float, h: float) -> np.ndarray:
    """(e, chi', b) after h seconds, by a power series of the matrix exponential of the filter."""
    A = np.array([[0, -1, 0, 1], [3 * omega**2, -3 * omega, 1, 0], [omega**3, 0, 0, 0], [0] * 4])
    x = np.array([heading.psi - heading.chi, heading.dchi, heading.b, dpsi])
    total, term = x.copy(), x
    for k in range(1, 60):
        term = A @ term * h / k
        total = total + term
    return total[:3]


@given(
    st.floats(0.05, 3.0),
    st.tuples(*(st.floats(-1.0, 1.0),) * 4),
    st.floats(-3.0, 3.0),
    st.floats(0.001, 2.0),
)
def test_filter_is_exact_for_a_steady_turn(omega, state, way, h):
    heading = Heading(*state)
    after = formation.turned(omega, 0.2, heading, heading.psi + way, h)
    dpsi = max(-0.2, min(0.2, way / h))
    assert after.psi - heading.psi == pytest.approx(dpsi * h, abs=1e-12)
    found = (after.psi - after.chi, after.dchi, after.b)
    np.testing.assert_allclose(found, exact(omega, heading, dpsi, h), rtol=1e-9, atol=1e-9)


def test_formation_turns_with_a_steady_turn_without_lag():
    heading, h = Heading(0.0, 0.0, 0.0, 0.0), 0.02
    for k in range(5000):
        heading = formation.turned(0.5, 0.2, heading, 0.1 * k * h, h)
    # psi reaches what was known at the beginning of the step, and chi is where psi is.
    assert heading.psi == pytest.approx(0.1 * 4999 * h)
    assert heading.chi == pytest.approx(heading.psi, abs=1e-9)
    assert heading.dchi == pytest.approx(0.1, abs=1e-9)
    assert formation.ddchi(0.5, heading) == pytest.approx(0.0, abs=1e-9)


def test_formation_turns_the_short_way_round():
    heading = Heading(3.0, 3.0, 0.0, 0.0)
    for _ in range(6000):
        heading = formation.turned(0.5, 0.2, heading, -3.0, 0.02)
    assert heading.chi == pytest.approx(2 * pi - 3.0, abs=1e-6)


def test_gains_of_the_filter_are_the_integrals_of_its_responses():
    """By the trapezoidal rule over a response, and over the slope of it, of 100 time constants."""
    t = np.linspace(0.0, 100.0, 2_000_001)
    rate, lag = (3 * t - t * t) * np.exp(-t), (1 + t - t * t) * np.exp(-t)
    assert np.trapezoid(np.abs(rate), t) == pytest.approx(RATE_GAIN, rel=1e-8)
    assert np.abs(np.diff(rate)).sum() == pytest.approx(ACCELERATION_GAIN, rel=1e-8)
    assert np.trapezoid(np.abs(lag), t) == pytest.approx(LAG_GAIN, rel=1e-8)


@given(
    st.floats(0.1, 2.0),
    st.floats(0.01, 1.0),
    st.lists(st.tuples(st.floats(-10.0, 10.0), st.integers(1, 40)), max_size=8),
    st.floats(0.01, 0.5),
)
def test_no_heading_turns_a_formation_faster_than_proven(omega, turn, headings, h):
    heading = Heading(0.5, 0.5, 0.0, 0.0)
    for psi_0, steps in headings:
        for _ in range(steps):
            heading = formation.turned(omega, turn, heading, psi_0, h)
            assert abs(heading.dchi) <= RATE_GAIN * turn * (1 + 1e-9)
            most = ACCELERATION_GAIN * omega * turn
            assert abs(formation.ddchi(omega, heading)) <= most * (1 + 1e-9)
            assert abs(heading.psi - heading.chi) <= LAG_GAIN * turn / omega * (1 + 1e-9)


def test_a_zigzag_comes_near_what_is_proven():
    """Turns one way and back when the response changes its sign: chi' then is at its bound."""
    heading, h, fastest = Heading(0.0, 0.0, 0.0, 0.0), 0.005, 0.0
    for k in range(10_000):
        t = k * h
        # The response of omega = 1 changes its sign at 3 s before the end, at 50 s.
        psi_0 = -100.0 if t < 47.0 else 100.0
        target = heading.psi + (0.2 * h if psi_0 > 0 else -0.2 * h)
        heading = formation.turned(1.0, 0.2, heading, target, h)
        fastest = max(fastest, abs(heading.dchi))
    assert fastest == pytest.approx(RATE_GAIN * 0.2, rel=0.01)


# The reference


def spiral(t: float, psi_0: float) -> Known:
    """A leader on a spiral that speeds up, with its derivatives."""
    a, b = 0.1 * t + 0.001 * t * t, 4.0 + 0.05 * t
    da, dda, db = 0.1 + 0.002 * t, 0.002, 0.05
    c, s = cos(a), sin(a)
    return known(
        (b * c, b * s, 0.1 * t),
        (db * c - b * da * s, db * s + b * da * c, 0.1),
        (
            -2 * db * da * s - b * dda * s - b * da * da * c,
            2 * db * da * c + b * dda * c - b * da * da * s,
            0.0,
        ),
        psi_0,
    )


def test_derivatives_of_the_reference_are_those_of_its_position():
    """Against differences, over two changes of place, a turn, and a jump of the heading.

    The third derivative of chi jumps where the turn does, so differences of dy_d are of first order
    there: 1 ms times omega^2, some 10 m, and the jumps of chi'''.
    """
    stages = Stages(
        3, (LINE, V, TABLE, LINE), (5.0,) * 4, FOUR, FOUR, (0.0, 0.0, 3.0, 0.0),
        (5.0, 15.0, 90.0), (8.0, 10.0, 20.0),
    )  # fmt: skip
    parameters = Parameters(3, 3, stages, omega_chi=0.5)
    h = 1e-3
    state = formation.first_state(spiral(0.0, 0.3))
    rows = []
    for k in range(30_000):
        t = k * h
        leader = spiral(t, 0.3 + 0.08 * t if t < 20.0 else -1.0)
        rows.append(formation.reference(parameters, state, leader, t))
        state = formation.steps(parameters, state, leader, h, 1)
    y, dy, ddy = (np.array([row[i] for row in rows]) for i in range(3))
    np.testing.assert_allclose((y[2:] - y[:-2]) / (2 * h), dy[1:-1], atol=1e-5)
    np.testing.assert_allclose((dy[2:] - dy[:-2]) / (2 * h), ddy[1:-1], atol=1e-3)


@given(
    tables(),
    st.lists(st.tuples(st.floats(-10.0, 10.0), st.integers(1, 60)), min_size=1, max_size=6),
    st.tuples(*(st.floats(-3.0, 3.0),) * 6),
)
def test_reference_is_within_its_bounds(parameters, headings, moving):
    """Whatever the heading does; velocity and acceleration of the leader need not fit together."""
    wide = (-1e9,) * 3, (1e9,) * 3
    parameters = parameters._replace(speed_max=1e9, turn_max=1e9, limits=wide)
    dy_0, ddy_0 = moving[:3], moving[3:]
    bounds = formation_bounds.reference_bounds(parameters, hypot(*dy_0), hypot(*ddy_0))
    y_0, t, h = (1.0, 2.0, 3.0), 0.0, 0.4
    state = formation.first_state(known(y_0))
    for psi_0, steps in headings:
        for _ in range(steps):
            leader = known(y_0, dy_0, ddy_0, psi_0)
            y_d, dy_d, ddy_d = formation.reference(parameters, state, leader, t)
            assert dist(y_d, y_0) <= bounds.distance * (1 + 1e-9) + 1e-9
            assert hypot(*dy_d) <= bounds.speed * (1 + 1e-9) + 1e-9
            assert hypot(*ddy_d) <= bounds.acceleration * (1 + 1e-9) + 1e-9
            state = formation.steps(parameters, state, leader, h, 1)
            t += h


def test_place_of_the_leader_has_its_reference():
    leader = spiral(7.0, 0.4)
    state = FormationState(Heading(0.4, 0.3, 0.1, 0.02), ORIGIN, ORIGIN)
    found = formation.reference(in_shape(COLUMN, 1), state, leader, 3.0)
    assert found == Reference(leader.y_0, leader.dy_0, leader.ddy_0)


@pytest.mark.parametrize("shape", [LINE, COLUMN, V, CIRCLE])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_places_beside_the_helix_of_the_paper_can_be_followed(shape, number):
    """From rest on: the inner places move back as the formation begins to turn."""
    parameters, of_leader = in_shape(shape, number), motion_planner.Parameters()
    moving, motion = motion_planner.begin(of_leader)
    state = None
    for k in range(3000):
        leader = known(*motion_planner.reference(moving, motion, 0.35), moving.psi)
        state = state or formation.first_state(leader)
        formation.reference(parameters, state, leader, 0.02 * k)
        state = formation.steps(parameters, state, leader, 0.02, 1)
        moving, motion = motion_planner.steps(of_leader, moving, motion, 0.02, 1)


def test_vehicle_points_along_its_reference_and_at_rest_with_the_formation():
    parameters, state = DEFAULT, FormationState(Heading(0.5, 0.5, 0.0, 0.0), ORIGIN, ORIGIN)
    rest = formation.reference(parameters, state, known(), 0.0)
    assert formation.posture(parameters, state, rest)[3:] == pytest.approx((0.0, 0.5))
    moving = formation.reference(parameters, state, known(dy_0=(-0.3, 0.3, -0.3 * sqrt(2))), 0.0)
    assert formation.posture(parameters, state, moving)[3:] == pytest.approx((pi / 4, 3 * pi / 4))


# What is refused


@pytest.mark.parametrize(
    ("stages", "why"),
    [
        (
            {"duration": (4.0, 20.0, 20.0)},
            "the change to stage 2, by 7.07 m in 4 s, takes up to 3.31 m/s, more than speed_max, "
            "2.5; give it at least 5.3 s",
        ),
        (
            {"spacing": (0.5,) * 4, "duration": (0.9, 20.0, 20.0)},
            "the change to stage 2, by 0.707 m in 0.9 s, takes up to 126 N, more than the 80 N of "
            "(3); give it more time",
        ),
        (
            {"n": 3, "t": (30.0, 40.0, 90.0)},
            "the change to stage 3 begins at 40 s, before that to stage 2 is over at 50 s; start "
            "it later",
        ),
    ],
)
def test_changes_that_no_vehicle_can_follow_are_refused(stages, why):
    shapes = {"n": 2, "shape": (LINE, COLUMN, LINE, LINE)}
    with pytest.raises(ImpossibleFormation) as refused:
        formation.check(DEFAULT._replace(stages=Stages()._replace(**{**shapes, **stages})))
    assert str(refused.value) == why


def test_other_parameters_that_do_not_fit_are_refused():
    with pytest.raises(ImpossibleFormation, match="number is 4, and there are 3 vehicles"):
        formation.check(DEFAULT._replace(number=4))
    with pytest.raises(ImpossibleFormation, match="d22 and d33 must be positive"):
        formation.check(DEFAULT._replace(vehicle=DEFAULT.vehicle._replace(d22=0.0)))
    formation.check(DEFAULT)


@pytest.mark.parametrize(
    ("leader", "why"),
    [
        (known(dy_0=(3.0, 0.0, 0.0)), "a speed of 3 m/s, 0.5 beyond the limit of 2.5"),
        (
            known(dy_0=(2.0, 0.0, 0.0), ddy_0=(1.0, 0.0, 0.0)),
            "a surge force of 85 N, 5 beyond the limit of 80",
        ),
        (
            known(dy_0=(1.0, 0.0, 0.0), ddy_0=(0.0, 4.5, 0.0)),
            "at (0, 5, 0) m the reference asks for a turn of 4.5 rad/s, 0.5 beyond the limit of 4",
        ),
    ],
)
def test_leader_that_is_too_quick_is_refused(leader, why):
    with pytest.raises(ImpossiblePath) as refused:
        formation.reference(DEFAULT, formation.first_state(leader), leader, 0.0)
    assert why in str(refused.value)
    estimated = DEFAULT._replace(estimated=True)
    formation.reference(estimated, formation.first_state(leader), leader, 0.0)


# An estimated leader


def follow(estimator: Estimator, position, received, h: float, n: int):
    """The state of a follower over time.

    Args:
        estimator: of the follower.
        position: of the leader over time.
        received: times at which messages are received, and when they were sent, in their order.
        h: step [s].
        n: how many.

    """
    parameters = Parameters(1, 1, estimated=True, estimator=estimator)
    state = formation.first_state(known(position(0.0)))
    sent, waiting = 0.0, [*received]
    for k in range(n):
        t = k * h
        while waiting and waiting[0][0] <= t + 1e-9:
            sent = waiting.pop(0)[1]
        leader = known(position(sent), age=t - sent)
        yield t, state, formation.leader(parameters, state, leader)
        state = formation.steps(parameters, state, leader, h, 1)


def every(period: float, delay: float, end: float) -> list[tuple[float, float]]:
    return [(k * period + delay, k * period) for k in range(int(end / period) + 1)]


@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_leader_at_constant_velocity_is_followed_without_lag(delay):
    def position(t):
        return (0.5 * t, -0.2 * t, 3.0 + 0.1 * t)

    *_, (t, state, leader) = follow(Estimator(), position, every(1.0, delay, 200.0), 0.02, 10_000)
    assert dist(state.y_hat, position(t)) < 1e-6
    assert leader.dy_d == pytest.approx((0.5, -0.2, 0.1), abs=1e-7)
    assert leader.ddy_d == pytest.approx(ORIGIN, abs=1e-7)


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(0.01, 30.0))
def test_constant_age_is_stable_below_the_sum_of_both_times(lambda_, k_d, age):
    """Eigenvalues of the linearised errors of position and velocity."""
    A = [[-(lambda_ + k_d), 1 + (lambda_ + k_d) * age], [-k_d * lambda_, k_d * lambda_ * age]]
    largest = max(np.linalg.eigvals(np.array(A)).real)
    limit = 1 / lambda_ + 1 / k_d
    if abs(age / limit - 1) > 1e-6:
        assert (largest < 0) == (age < limit)


@given(st.floats(0.2, 2.0), st.floats(0.2, 2.0), st.floats(0.2, 6.0), st.floats(0.0, 3.0))
@settings(max_examples=30)
def test_stability_with_a_period_is_that_of_the_scheme(lambda_, k_d, period, delay):
    """Eigenvalues of the map over a period, found by steps of Euler's scheme from small errors."""
    n = 2000
    h, columns = period / n, []
    estimator = Estimator(lambda_, k_d, 1e9, 1e9)
    parameters = Parameters(1, 1, estimated=True, estimator=estimator)
    for y, v in ((1e-7, 0.0), (0.0, 1e-7)):
        # The leader rests in the origin, where each message says it was.
        state = FormationState(Heading(0.0, 0.0, 0.0, 0.0), (y, 0.0, 0.0), (v, 0.0, 0.0))
        for k in range(n):
            state = formation.steps(parameters, state, known(age=delay + k * h), h, 1)
        columns.append((state.y_hat[0] / 1e-7, state.dy_hat_o[0] / 1e-7))
    largest = max(abs(np.linalg.eigvals(np.array(columns).T)))
    if abs(largest - 1) > 0.01:
        assert formation_bounds.is_stable(estimator, period, delay) == (largest < 1)


LINKS = [
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2)), 0.05),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2)), 0.02),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.3)), 0.02),
    (Estimator(), formation_bounds.Messages(2.0, (0.2, 0.2)), 0.02),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2), 2), 0.02),
    (Estimator(k_d=1.0), formation_bounds.Messages(1.0, (0.2, 0.2), 2), 0.02),
]
_BOUNDS = [formation_bounds.estimate_bounds(*link) for link in LINKS]


@given(
    st.integers(0, len(LINKS) - 1),
    st.lists(st.tuples(st.sampled_from([-1.0, 1.0, 0.5]), st.integers(1, 60)), max_size=20),
    st.randoms(use_true_random=False),
)
def test_no_leader_is_farther_from_its_estimate_than_proven(which, pushes, random):
    """Leaders from rest, pushed to and fro as hard as they may be, and messages that get lost."""
    (estimator, messages, most), bound = LINKS[which], _BOUNDS[which]
    h = 0.1
    signs = [sign for sign, steps in pushes for _ in range(steps)]
    n = len(signs)
    v = np.concatenate([[0.0], np.cumsum(signs) * most * h])
    y = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2) * h])

    def position(t):
        k = round(t / h)
        return (y[k], 0.0, 0.0)

    received, k = [], 0
    while k * messages.period < n * h:
        sent = k * messages.period
        received.append((sent + random.choice(messages.delay), sent))
        k += random.randint(1, messages.gap)
    for t, state, _ in follow(estimator, position, received, h, n):
        now = round(t / h)
        assert abs(y[now] - state.y_hat[0]) <= bound.position
        assert abs(v[now] - state.dy_hat_o[0]) <= bound.velocity


def test_bounds_hold_for_steps_of_a_tenth_of_a_second():
    """The test above takes these; the bounds are those of smaller steps within some per cent."""
    for link, bound in zip(LINKS, _BOUNDS, strict=True):
        assert formation_bounds.estimate_bounds(*link, h=0.1).position >= 0.9 * bound.position


def test_bounds_are_infinite_where_the_proof_does_not_reach():
    messages = formation_bounds.Messages(1.0, (0.2, 0.2), 4)
    assert formation_bounds.estimate_bounds(Estimator(), messages, 0.02).position == float("inf")


def test_follower_that_has_lost_its_leader_coasts():
    def position(t):
        return (0.5 * t, 0.0, 0.0)

    estimator = Estimator()
    rows = [*follow(estimator, position, every(1.0, 0.2, 60.0), 0.02, 5000)]
    (t, state, _), (later, after, leader) = rows[3300], rows[-1]
    assert t > 60.0 + estimator.age_max
    assert leader.ddy_d == ORIGIN
    assert leader.dy_d == after.dy_hat_o == state.dy_hat_o
    assert after.y_hat[0] == pytest.approx(state.y_hat[0] + 0.5 * (later - t), abs=0.01)


def test_follower_that_finds_its_leader_again_does_not_run_past_it():
    """The leader turns round while nobody hears it; z_max and what it stops keep the speed low."""

    def position(t):
        return (0.5 * min(t, 42.0) - 0.5 * max(0.0, t - 42.0), 0.0, 0.0)

    received = [one for one in every(1.0, 0.2, 200.0) if not 40.0 < one[1] < 70.0]
    estimator = Estimator()
    rows = [*follow(estimator, position, received, 0.02, 9000)]
    errors = [state.y_hat[0] - position(t)[0] for t, state, _ in rows]
    # From 42 s to 70.2 s both part with 1 m/s.
    assert max(errors) == pytest.approx(28.2, abs=0.5)
    assert min(error for (t, *_), error in zip(rows, errors, strict=True) if t > 75.0) > -0.1
    assert abs(errors[-1]) < 1e-3
    fastest = 0.5 * np.tanh(2.0) + 0.5 * 2.0
    for _, state, leader in rows:
        assert abs(leader.dy_d[0] - state.dy_hat_o[0]) <= fastest + 1e-12
    assert max(abs(leader.dy_d[0]) for _, _, leader in rows) < 1.3
