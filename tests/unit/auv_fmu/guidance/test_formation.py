"""References in a formation: places, heading, exact derivatives, and refusals."""

from __future__ import annotations

from itertools import combinations, islice
from math import cos, dist, hypot, pi, sin, sqrt
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.guidance import formation
from auv_fmu.guidance.follower import Follower
from auv_fmu.guidance.formation import (
    Estimator,
    FormationState,
    Heading,
    Known,
    Parameters,
    Shape,
    Stages,
)
from auv_fmu.loop import closed_loop
from auv_fmu.loop.closed_loop import PAPER
from auv_fmu.paper import motion_planner
from auv_fmu.paper.motion_planner import Reference
from auv_fmu.paper.vehicle import Vehicle
from support.formations import FOUR, ORIGIN, every, follow, known, tables
from support.helix import helix

DEFAULT = Parameters()

#: Shapes that follow from a number.
SHAPES = [shape for shape in Shape if shape != Shape.TABLE]


def in_shape(shape: Shape, number: int = 2, vehicles: int = 3, **others) -> Parameters:
    return Parameters(number, vehicles, Stages()._replace(shape=(shape,) * 4), **others)


# Places


@pytest.mark.parametrize(
    ("shape", "places"),
    [
        (Shape.LINE, [(0, 0), (0, 5), (0, -5), (0, 10)]),
        (Shape.COLUMN, [(0, 0), (-5, 0), (-10, 0), (-15, 0)]),
        (
            Shape.V,
            [(0, 0), (-sqrt(12.5), sqrt(12.5)), (-sqrt(12.5), -sqrt(12.5)), (-sqrt(50), sqrt(50))],
        ),
        (Shape.CIRCLE, [(sqrt(12.5), 0), (0, sqrt(12.5)), (-sqrt(12.5), 0), (0, -sqrt(12.5))]),
    ],
)
def test_places_of_four(shape, places):
    for number, (x, y) in enumerate(places, start=1):
        found = formation.offset(in_shape(shape, number, 4), 0)
        assert found == pytest.approx((x, y, 0.0), abs=1e-12)


@given(st.sampled_from(SHAPES), st.integers(2, 64), st.floats(0.1, 100.0))
def test_neighbours_are_the_spacing_apart_and_no_vehicle_is_nearer(shape, vehicles, spacing):
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
    assert formation.offset(in_shape(Shape.CIRCLE, 1, 1), 0) == ORIGIN


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
def test_peaks_of_a_change_are_the_ones_compared_with_limits(parameters):
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


def test_derivatives_of_the_reference_are_its_positions():
    """Against differences, over two changes of place, a turn, and a jump of the heading.

    The third derivative of chi jumps where the turn does, so differences of dy_d are of first order
    there: 1 ms times omega^2, some 10 m, and the jumps of chi'''.
    """
    stages = Stages(
        3, (Shape.LINE, Shape.V, Shape.TABLE, Shape.LINE), (5.0,) * 4, FOUR, FOUR,
        (0.0, 0.0, 3.0, 0.0),
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
        state = formation.step(parameters, state, leader, h)
    y, dy, ddy = (np.array([row[i] for row in rows]) for i in range(3))
    np.testing.assert_allclose((y[2:] - y[:-2]) / (2 * h), dy[1:-1], atol=1e-5)
    np.testing.assert_allclose((dy[2:] - dy[:-2]) / (2 * h), ddy[1:-1], atol=1e-3)


def test_place_of_the_leader_has_its_reference():
    leader = spiral(7.0, 0.4)
    state = FormationState(Heading(0.4, 0.3, 0.1, 0.02), ORIGIN, ORIGIN)
    found = formation.reference(in_shape(Shape.COLUMN, 1), state, leader, 3.0)
    assert found == Reference(leader.y_0, leader.dy_0, leader.ddy_0)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("number", [1, 2, 3])
def test_places_beside_the_helix_of_the_paper_can_be_followed(shape, number):
    """From rest on: the inner places move back as the formation begins to turn."""
    parameters, state = in_shape(shape, number), None
    for k, (moving, motion) in enumerate(islice(helix(), 3000)):
        leader = known(*motion_planner.reference(moving, motion, 0.35), moving.psi)
        state = state or formation.first_state(leader)
        formation.reference(parameters, state, leader, 0.02 * k)
        state = formation.step(parameters, state, leader, 0.02)


def test_three_vehicles_keep_their_line_beside_the_helix_of_the_paper():
    """With plants, controllers and disturbances as in Fig. 4, each at rest at its own place.

    The distances are within the errors that each has: all planners have the same heading.
    """
    h, parts, moments = PAPER.h, closed_loop.splits(PAPER), []
    moving, motion = next(helix())
    leader = known(*motion_planner.reference(moving, motion, 0.35), moving.psi)
    planners = [in_shape(Shape.LINE, number) for number in (1, 2, 3)]
    states = [formation.first_state(leader)] * 3
    noise = Random(1).gauss
    for planner, state in zip(planners, states, strict=True):
        x, y, z = formation.reference(planner, state, leader, 0.0).y_d
        begun = PAPER._replace(plant=PAPER.plant._replace(eta0=(x - 0.35, y, z, 0.0, 0.0, 0.0)))
        moments.append(closed_loop.begin(begun, ORIGIN))
    for k, (moving, motion) in enumerate(islice(helix(), 3000)):
        leader = known(*motion_planner.reference(moving, motion, 0.35), moving.psi)
        errors, positions = [], []
        for i, planner in enumerate(planners):
            wanted = formation.reference(planner, states[i], leader, k * h)
            moment = moments[i]._replace(scene=moments[i].scene._replace(reference=wanted))
            instant = closed_loop.act(PAPER, moment, parts, delayed=False)
            n = (noise(0.0, 1.0), noise(0.0, 1.0), noise(0.0, 1.0))
            moments[i] = closed_loop.step(PAPER, instant, parts, (k + 1) * h, n)
            states[i] = formation.step(planner, states[i], leader, h)
            errors.append(dist(moment.scene.plant.y, wanted.y_d))
            positions.append(moment.scene.plant.y)
            assert instant.tau == instant.command  # no actuator is at its limit
        for (i, a), (j, b) in combinations(enumerate(positions), 2):
            d = dist(formation.offset(planners[i], 0), formation.offset(planners[j], 0))
            assert abs(dist(a, b) - d) <= errors[i] + errors[j] + 1e-9
        assert max(errors) < (0.2 if k * h > 40.0 else 1.5)


def test_vehicle_points_along_its_reference_and_at_rest_with_the_formation():
    parameters, state = DEFAULT, FormationState(Heading(0.5, 0.5, 0.0, 0.0), ORIGIN, ORIGIN)
    rest = formation.reference(parameters, state, known(), 0.0)
    assert formation.posture(parameters, state, rest)[3:] == pytest.approx((0.0, 0.5))
    moving = formation.reference(parameters, state, known(dy_0=(-0.3, 0.3, -0.3 * sqrt(2))), 0.0)
    assert formation.posture(parameters, state, moving)[3:] == pytest.approx((pi / 4, 3 * pi / 4))


# Refusals


@pytest.mark.parametrize(
    ("stages", "why"),
    [
        ({"duration": (4.0, 20.0, 20.0)}, "the change to stage 2, by 7.07 m in 4 s, takes up to 3"),
        ({"spacing": (0.5,) * 4, "duration": (0.9, 20.0, 20.0)}, "the change to stage 2, by 0.707"),
        ({"n": 3, "t": (30.0, 40.0, 90.0)}, "the change to stage 3 begins at 40 s, before that to"),
    ],
)  # fmt: skip
def test_changes_that_no_vehicle_can_follow_are_refused(stages, why):
    shapes = {"n": 2, "shape": (Shape.LINE, Shape.COLUMN, Shape.LINE, Shape.LINE)}
    with pytest.raises(Refusal) as refused:
        formation.check(DEFAULT._replace(stages=Stages()._replace(**{**shapes, **stages})))
    assert str(refused.value).startswith(why)


def test_other_parameters_that_do_not_fit_are_refused():
    with pytest.raises(Refusal, match="number is 4, and there are 3 vehicles"):
        formation.check(DEFAULT._replace(number=4))
    with pytest.raises(Refusal, match="d22 and d33 must be positive"):
        formation.check(DEFAULT._replace(follower=Follower(Vehicle(d22=0.0))))
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
            "at t = 0 s, at (0, 5, 0) m, the path asks for a turn of 4.5 rad/s, 0.5 beyond the "
            "limit of 4",
        ),
    ],
)
def test_leader_that_is_too_quick_is_refused(leader, why):
    with pytest.raises(Refusal) as refused:
        formation.reference(DEFAULT, formation.first_state(leader), leader, 0.0)
    assert why in str(refused.value)
    estimated = DEFAULT._replace(estimated=True)
    formation.reference(estimated, formation.first_state(leader), leader, 0.0)


# An estimated leader


@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_leader_at_constant_velocity_is_followed_without_lag(delay):
    def position(t):
        return (0.5 * t, -0.2 * t, 3.0 + 0.1 * t)

    *_, (t, state, leader) = follow(Estimator(), position, every(1.0, delay, 200.0), 0.02, 10_000)
    assert dist(state.y_hat, position(t)) < 1e-6
    assert leader.dy_d == pytest.approx((0.5, -0.2, 0.1), abs=1e-7)
    assert leader.ddy_d == pytest.approx(ORIGIN, abs=1e-7)


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


@pytest.mark.parametrize(
    ("z_max", "speed", "duration", "past"),
    [(2.0, "1.23", "58", "0.04"), (4.0, "2.09", "20", "0.12"), (1e9, "14.00", "11", "0.71")],
)
def test_follower_that_finds_its_leader_again(z_max, speed, duration, past):
    """The numbers of formation.md: the leader turns back just as the link fails."""

    def position(t):
        return (0.5 * min(t, 42.0) - 0.5 * max(0.0, t - 42.0), 0.0, 0.0)

    received = [message for message in every(1.0, 0.2, 200.0) if not 40.0 < message[1] < 70.0]
    estimator = Estimator(z_max=z_max)
    rows = [*follow(estimator, position, received, 0.02, 9000)]
    errors = [(t, state.y_hat[0] - position(t)[0]) for t, state, _ in rows]
    assert f"{max(error for _, error in errors):.0f}" == "28"
    assert f"{max(abs(leader.dy_d[0]) for *_, leader in rows):.2f}" == speed
    assert f"{max(t for t, error in errors if abs(error) > 0.5) - 70.2:.0f}" == duration
    assert f"{-min(error for t, error in errors if t > 75.0):.2f}" == past
    most = 0.5 * np.tanh(z_max) + 0.5 * z_max
    for _, state, leader in rows:
        assert abs(leader.dy_d[0] - state.dy_hat_o[0]) <= most * (1 + 1e-12)
