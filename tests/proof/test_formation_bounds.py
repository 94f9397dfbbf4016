"""Bounds of references in a formation: their derivation, and that nothing exceeds them."""

from __future__ import annotations

import re
from math import dist, hypot, inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu.guidance import formation
from auv_fmu.guidance.follower import Follower
from auv_fmu.guidance.formation import Estimator, FormationState, Heading, Parameters
from auv_fmu.paper.actuators import Limits
from support import formation_bounds
from support.formation_bounds import ACCELERATION_GAIN, LAG_GAIN, RATE_GAIN, Messages
from support.formations import follow, known, tables


def trapezoid(y: np.ndarray, t: np.ndarray) -> float:
    return float(np.sum((y[1:] + y[:-1]) / 2 * np.diff(t)))


def test_gains_of_the_filter_are_the_integrals_of_its_responses():
    """By the trapezoidal rule over a response, and over the slope of it, of 100 time constants."""
    t = np.linspace(0.0, 100.0, 2_000_001)
    rate, lag = (3 * t - t * t) * np.exp(-t), (1 + t - t * t) * np.exp(-t)
    assert trapezoid(np.abs(rate), t) == pytest.approx(RATE_GAIN, rel=1e-8)
    assert np.abs(np.diff(rate)).sum() == pytest.approx(ACCELERATION_GAIN, rel=1e-8)
    assert trapezoid(np.abs(lag), t) == pytest.approx(LAG_GAIN, rel=1e-8)


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
    """Turn one way and back when the response changes its sign: then chi' reaches its bound."""
    heading, h, fastest = Heading(0.0, 0.0, 0.0, 0.0), 0.005, 0.0
    for k in range(10_000):
        t = k * h
        # The response of omega = 1 changes its sign at 3 s before the end, at 50 s.
        psi_0 = -100.0 if t < 47.0 else 100.0
        target = heading.psi + (0.2 * h if psi_0 > 0 else -0.2 * h)
        heading = formation.turned(1.0, 0.2, heading, target, h)
        fastest = max(fastest, abs(heading.dchi))
    assert fastest == pytest.approx(RATE_GAIN * 0.2, rel=0.01)


@given(
    tables(),
    st.lists(st.tuples(st.floats(-10.0, 10.0), st.integers(1, 60)), min_size=1, max_size=6),
    st.tuples(*(st.floats(-3.0, 3.0),) * 6),
)
def test_reference_is_within_its_bounds(parameters, headings, moving):
    """With any heading; velocity and acceleration of the leader need not fit together."""
    wide = Limits((-1e9,) * 3, (1e9,) * 3)
    strong = Follower(speed_max=1e9, turn_max=1e9, limits=wide)
    parameters = parameters._replace(follower=strong)
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
            state = formation.step(parameters, state, leader, h)
            t += h


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
def test_stability_with_a_period_agrees_with_the_scheme(lambda_, k_d, period, delay):
    """Eigenvalues of the map over a period, found by steps of Euler's scheme from small errors."""
    n = 2000
    h, columns = period / n, []
    estimator = Estimator(lambda_, k_d, 1e9, 1e9)
    parameters = Parameters(1, 1, estimated=True, estimator=estimator)
    for y, v in ((1e-7, 0.0), (0.0, 1e-7)):
        # The leader rests in the origin, where each message says it was.
        state = FormationState(Heading(0.0, 0.0, 0.0, 0.0), (y, 0.0, 0.0), (v, 0.0, 0.0))
        for k in range(n):
            state = formation.step(parameters, state, known(age=delay + k * h), h)
        columns.append((state.y_hat[0] / 1e-7, state.dy_hat_o[0] / 1e-7))
    largest = max(abs(np.linalg.eigvals(np.array(columns).T)))
    if abs(largest - 1) > 0.01:
        assert formation_bounds.is_stable(estimator, period, delay) == (largest < 1)


LINKS = [
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2), 1), 0.05),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2), 1), 0.02),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.3), 1), 0.02),
    (Estimator(), formation_bounds.Messages(2.0, (0.2, 0.2), 1), 0.02),
    (Estimator(), formation_bounds.Messages(1.0, (0.2, 0.2), 2), 0.02),
    (Estimator(k_d=1.0), formation_bounds.Messages(1.0, (0.2, 0.2), 2), 0.02),
]
H = 0.1
BOUNDS = [formation_bounds.estimate_bounds(*link, h=H) for link in LINKS]


@given(
    st.integers(0, len(LINKS) - 1),
    st.lists(st.tuples(st.sampled_from([-1.0, 1.0, 0.5]), st.integers(1, 60)), max_size=20),
    st.randoms(use_true_random=False),
)
def test_no_leader_is_farther_from_its_estimate_than_proven(which, pushes, random):
    """With leaders from rest, at any acceleration within the bound, and lost messages."""
    (estimator, messages, most), bound, h = LINKS[which], BOUNDS[which], H
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


def test_bounds_are_infinite_where_the_proof_does_not_reach():
    messages = formation_bounds.Messages(1.0, (0.2, 0.2), 4)
    assert formation_bounds.estimate_bounds(Estimator(), messages, 0.02).position == inf


def test_page_has_the_gains_and_the_bounds():
    """The tables on the filter and on the estimate in formation.md."""
    page = (Path(__file__).parents[2] / "docs/explanation/formation.md").read_text("utf-8")
    assert rf"(1 + 10 e^{{-3}})\, r = {RATE_GAIN:.3f}\, r`" in page
    assert rf"| $`{ACCELERATION_GAIN:.3f}\, \omega r`$ |" in page
    assert rf"| $`{LAG_GAIN:.3f}\, r / \omega`$ |" in page
    rows = re.findall(
        r"^\| (\d) s \| (none|one) \| ([\d.]+) m/s² \| (.*) m \| (.*) m/s \|$", page, re.M
    )
    assert len(rows) == 4
    for period, lost, most, position, velocity in rows:
        messages = Messages(float(period), (0.2, 0.2), ["none", "one"].index(lost) + 1)
        found = formation_bounds.estimate_bounds(Estimator(), messages, float(most))
        assert (f"{found.position:.2f}", f"{found.velocity:.2f}") == (position, velocity)


@pytest.mark.parametrize(
    ("period", "gap", "most", "reached"),
    [
        (1.0, 1, 0.02, "0.13"),
        (1.0, 1, 0.05, "0.34"),
        (2.0, 1, 0.02, "0.19"),
        (1.0, 2, 0.02, "0.19"),
    ],
)
def test_leaders_that_are_pushed_to_and_fro_reach_what_the_page_says(period, gap, most, reached):
    h, n, worst = 0.1, 1200, 0.0
    received = [(k * period + 0.2, k * period) for k in range(0, int(n * h / period), gap)]
    for half in range(5, 150, 5):
        signs = np.array([1.0 if (k // half) % 2 == 0 else -1.0 for k in range(n + half // 2)])
        for first in (0, half // 2):
            v = np.concatenate([[0.0], np.cumsum(signs[first : first + n]) * most * h])
            y = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2) * h])
            rows = follow(Estimator(), lambda t, y=y: (y[round(t / h)], 0.0, 0.0), received, h, n)
            errors = (abs(y[round(t / h)] - state.y_hat[0]) for t, state, _ in rows)
            worst = max(worst, *errors)
    assert f"{worst:.2f}" == reached
