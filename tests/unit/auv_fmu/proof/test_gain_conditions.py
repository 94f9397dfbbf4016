"""(30) to (32), (52) to (54), their assumptions, and the rates that the step must follow."""

import re
from math import hypot, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu.paper import output_feedback
from auv_fmu.paper.adaptation import robust_force
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.gain_conditions import (
    Bounds,
    Zetas,
    at_least,
    bounds,
    conditions,
    coupling,
    observer_rate,
    robust_rate,
)
from support.control_point_model import C_2, D_2, M_2, chi_1, chi_2
from support.strategies import angles, lengths, pitch_angles

NO_ZETAS = Zetas(0.0, 0.0)
PAPER = ((10.0, 10.0, 10.0), (10.0, 10.0, 10.0), 1.0, 50.0, 1.0)


@given(theta=pitch_angles, psi=angles, ell=lengths)
def test_bounds_are_the_extreme_eigenvalues_at_every_attitude(theta, psi, ell):
    known = bounds(Vehicle(), ell)
    inertia = np.linalg.eigvalsh(M_2(Vehicle(), theta, psi, ell))
    damping = np.linalg.eigvalsh(D_2(Vehicle(), theta, psi, ell))
    found = [inertia[0], inertia[-1], damping[0], damping[-1]]
    np.testing.assert_allclose(found, known, rtol=1e-7)


def test_the_papers_gains_miss_conditions_30_and_31():
    first, second, third = conditions(
        bounds(Vehicle(), 0.35), at_least(Vehicle(), 0.35, 1.0), *PAPER
    )
    assert (first.left, first.right, first.verdict) == (10.0, 15.0, "violated")
    assert (second.left, second.right, second.room, second.verdict) == (30, 15, 15, "violated")
    assert (third.left, third.right, third.verdict) == (50.0, pytest.approx(30.0 / 25.0), "open")


def evaluated(formula, symbols):
    """A formula as the paper writes it, without signs for its products."""
    product = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", formula.replace("'", ""))
    return eval(product, {}, symbols)


@given(values=st.lists(st.floats(0.1, 9.0), min_size=19, max_size=19))
def test_statements_are_the_conditions(values):
    """Each inequality, read as a formula, has the sides that were computed for it."""
    K_1, K_2 = values[0:3], values[3:6]
    known, (Lambda, k_d, s_MM), zetas = Bounds(*values[6:10]), values[10:13], values[13:17]
    least = Zetas(*values[17:19])
    symbols = {
        "lambda_d2": known.lambda_d2,
        "lambda_m2": known.lambda_m2,
        "lambda_min": min,
        "Lambda": np.array(Lambda),
        "K_2": np.array(K_2),
        "k_1max": max(K_1),
        "k_2max": max(K_2),
        "k_d": k_d,
        "s_MM": s_MM,
        **{f"zeta_{i}": zeta for i, zeta in enumerate(zetas, start=1)},
    }
    found = conditions(known, least, K_1, K_2, Lambda, k_d, s_MM)
    assert [condition.number for condition in found] == ["(30), (52)", "(31), (53)", "(32), (54)"]
    for condition in found:
        left, right = condition.statement.replace(" lambda ", " Lambda ").split(" > ")
        assert evaluated(left, symbols) == pytest.approx(condition.left)
        unknown = evaluated(f"({condition.zetas}+0.0)", symbols)
        assert evaluated(right, symbols) == pytest.approx(condition.right + unknown)
        of_least = {"zeta_1": least.zeta_1_2, "zeta_3": least.zeta_3_4, "zeta_2": 0, "zeta_4": 0}
        unknown = evaluated(f"({condition.zetas}+0.0)", symbols | of_least)
        assert unknown == pytest.approx(condition.least)


def test_condition_30_can_be_met_by_a_larger_lambda():
    """K2 lambda > 0.5 K2 lambda + K2 for equal gains means lambda > 2."""
    known = bounds(Vehicle(), 0.35)
    K1, K2, _, k_d, slope = PAPER
    assert conditions(known, NO_ZETAS, K1, K2, 2.0, k_d, slope)[0].verdict == "violated"
    assert conditions(known, NO_ZETAS, K1, K2, 2.01, k_d, slope)[0].verdict == "met"


@given(v0=st.floats(0.01, 10.0))
def test_another_unit_of_speed_is_other_units_throughout(v0):
    """Numbers counted in s / v0 for s, all but the slope of Tanh(dy_o - dy_r): as printed."""
    known, (K1, K2, lambda_, k_d, slope) = bounds(Vehicle(), 0.35), PAPER
    found = conditions(known, Zetas(20.0, 30.0), *PAPER, v0)
    m, d = np.array(known[:2]), np.array(known[2:]) / v0
    counted = Bounds(*m, *d)
    K1, K2 = (tuple(np.array(K) / v0**2) for K in (K1, K2))
    zetas = Zetas(20.0 / v0, 30.0 / v0)
    printed = conditions(counted, zetas, K1, K2, lambda_ / v0, k_d / v0, slope * v0)
    for condition, other, unit in zip(found, printed, (v0**3, v0, v0), strict=True):
        assert condition.margin == pytest.approx(other.margin * unit)


def test_theorem_2_weighs_k1_with_the_largest_slope():
    known = bounds(Vehicle(), 0.35)
    _, second, third = conditions(known, NO_ZETAS, *PAPER[:-1], 2.0)
    assert second.right == 2.0 * 10.0 + 0.5 * 10.0
    assert third.right == pytest.approx((2.0 * 2.0 * 10.0 + 10.0) / 25.0)


STILL, YAW = np.zeros(2), 0.7
vehicles = st.builds(Vehicle, *[st.floats(5.0, 50.0)] * 11)
distances, lambdas, units = st.floats(0.2, 1.0), st.floats(0.0, 4.0), st.floats(0.01, 2.0)


def turned(x):
    """From ahead, starboard and down to the earth frame."""
    return np.column_stack(rotation_from_euler(0.0, 0.0, YAW)) @ x


def chis(vehicle, ell, lambda_, s_e, r_1, r_2=(0.0, 0.0, 0.0), v0=1.0):
    """chi_1 and chi_2 of a level vehicle, by (16) with a reference at rest and z = 0; and |x|.

    r_1, r_2 and |chi_i| in the unit v0.
    """
    s_e, r_1, r_2 = map(np.array, (s_e, r_1, r_2))
    at, dy_r = (vehicle, 0.0, YAW, STILL), -lambda_ * s_e
    x = np.linalg.norm(np.concatenate([s_e, r_1, r_2]))
    dy_r, r_1, r_2 = map(turned, (dy_r, v0 * r_1, v0 * r_2))
    return chi_1(*at, dy_r, r_1, ell) / v0, chi_2(*at, dy_r, r_1, r_2, ell) / v0, x


@given(vehicle=vehicles, ell=distances, size=st.floats(0.01, 10.0))
def test_chi_1_is_half_the_coupling_times_the_square_of_r_1(vehicle, ell, size):
    """Whatever the size of r_1 and the gains: dy_r = 0."""
    half = size / sqrt(2.0)
    found = [
        np.linalg.norm(chis(vehicle, ell, 1.0, (0.0, 0.0, 0.0), r_1)[0])
        for r_1 in ((half, half, 0.0), (half, 0.0, half))
    ]
    assert max(found) == pytest.approx(0.5 * coupling(vehicle, ell) * size**2)


@given(vehicle=vehicles, ell=distances, speed=st.floats(0.0, 1.0), size=st.floats(0.01, 10.0))
def test_chi_1_is_the_coupling_times_a_reference_ahead(vehicle, ell, speed, size):
    """In proportion to r_1, so that zeta_1 is k |dy_r| at least. Ahead it damps, astern it drives.

    No gain is in it but lambda, and that not where e = z. Without P2.3, chi_1 has C_2(r_1) dy_r for
    C_2(dy_r) r_1: it is as large with the two directions exchanged.
    """
    at, ahead = (vehicle, 0.0, YAW, STILL), turned((speed, 0.0, 0.0))
    k = coupling(vehicle, ell)
    # Products that chi_1 adds up.
    rounding = 1e-13 * k * (speed + size) * size
    for sign in (1.0, -1.0):
        found, work = [], []
        for r_1 in (turned((0.0, size, 0.0)), turned((0.0, 0.0, size))):
            chi = chi_1(*at, sign * ahead, r_1, ell)
            found.append(np.linalg.norm(chi))
            work.append(sign * chi @ r_1)
        assert max(found) == pytest.approx(k * speed * size, abs=rounding)
        assert max(work) <= rounding * size
    found = []
    for dy_r in (turned((0.0, speed, 0.0)), turned((0.0, 0.0, speed))):
        r_1 = turned((size, 0.0, 0.0))
        crossed = C_2(*at[:3], dy_r, ell) @ r_1 - C_2(*at[:3], r_1, ell) @ dy_r
        found.append(np.linalg.norm(chi_1(*at, dy_r, r_1, ell) + crossed))
    assert max(found) == pytest.approx(k * speed * size, abs=rounding)


@given(vehicle=vehicles, ell=distances, lambda_=lambdas, v0=units)
def test_bound_on_chi_1_is_attained_at_norm_one(vehicle, ell, lambda_, v0):
    a, c = np.array([v0, lambda_]) / hypot(v0, lambda_) / sqrt(2.0)
    b = 1.0 / sqrt(2.0)
    found = []
    for r_1 in ((a, b, 0.0), (a, 0.0, b)):
        chi, _, x = chis(vehicle, ell, lambda_, (-c, 0.0, 0.0), r_1, v0=v0)
        assert x == pytest.approx(1.0)
        found.append(np.linalg.norm(chi))
    assert max(found) == pytest.approx(at_least(vehicle, ell, lambda_, v0).zeta_1_2)


@settings(max_examples=30)
@given(vehicle=vehicles, ell=distances, lambda_=lambdas, v0=units)
def test_bound_on_chi_2_is_reached_at_norm_one(vehicle, ell, lambda_, v0):
    """By the largest of some shares of r_1 in x."""
    found = []
    for mass, axis in ((vehicle.m22, (0.0, 1.0, 0.0)), (vehicle.m33, (0.0, 0.0, 1.0))):
        share = lambda_ * (2.0 - vehicle.m11 / mass)
        for angle in np.linspace(0.0, np.pi / 2.0, 16):
            a, c = np.cos(angle) * np.array([v0, share]) / hypot(v0, share)
            r_1 = np.sin(angle) * np.array(axis)
            _, chi, x = chis(vehicle, ell, lambda_, (c, 0.0, 0.0), r_1, (a, 0.0, 0.0), v0)
            assert x == pytest.approx(1.0)
            found.append(abs(chi @ turned(axis)))
    least = at_least(vehicle, ell, lambda_, v0).zeta_3_4
    assert max(found) <= least * (1.0 + 1e-12)
    assert max(found) == pytest.approx(least, rel=0.01)


def test_the_vehicle_of_the_paper():
    """By hand: 0.25 m11 m66 / (m22 ell^3) = 124.9 kg/s, which lambda = 1 stretches by sqrt(2)."""
    k = 25.0 * 15.0 / (17.5 * 0.35**3)
    assert coupling(Vehicle(), 0.35) == pytest.approx(k)
    assert 0.5 * at_least(Vehicle(), 0.35, 0.0).zeta_1_2 == pytest.approx(124.9, abs=0.1)
    assert at_least(Vehicle(), 0.35, 1.0).zeta_1_2 == pytest.approx(0.5 * k * sqrt(2.0))
    assert at_least(Vehicle(), 0.35, 2.0).zeta_1_2 == pytest.approx(0.5 * k * sqrt(5.0))
    assert at_least(Vehicle(), 0.35, 0.1, 0.05).zeta_1_2 == pytest.approx(
        0.5 * k * 0.05 * sqrt(5.0)
    )


ORIGIN = (0.0, 0.0, 0.0)


@given(lambda_=st.floats(0.1, 5.0), k_d=st.floats(1.0, 500.0))
def test_observer_rate_is_an_eigenvalue_of_its_linearisation(lambda_, k_d):
    """States z and dy_hat_o of an axis: (50) with y at rest, (51) with Remark 3."""
    dy_hat = np.array([lambda_ + k_d, 1.0])
    A = np.array([-dy_hat, -lambda_ * dy_hat + [k_d * lambda_, 0.0]])
    assert observer_rate(lambda_, k_d) == pytest.approx(-np.linalg.eigvals(A).real.min())


@pytest.mark.parametrize(("k_d", "grows"), [(95.0, False), (101.0, True)])
def test_observer_is_unstable_where_a_step_is_longer_than_2_over_its_rate(k_d, grows):
    """The controller's own observer, vehicle and reference at rest, z(0) = 1e-9 m, h = 20 ms."""
    gains, h = Gains(k_d=k_d, theta_0=(0.0,) * 4), 0.02
    assert (h * observer_rate(gains.lambda_, k_d) > 2.0) is grows
    state = ControllerState((1e-9, 0.0, 0.0), ORIGIN, gains.theta_0, 0.0)
    measurement = Measurement(ORIGIN, ORIGIN, ORIGIN, ORIGIN, ORIGIN)
    for _ in range(500):
        signals = output_feedback.evaluate(gains, state, measurement, h)
        state = output_feedback.step(state, signals, h)
    assert (abs(state.y_hat[0]) > 1e-9) is grows


@given(rho_hat=st.floats(1.0, 100.0), eps_t=st.floats(0.1, 10.0))
def test_robust_rate_is_the_slope_of_the_robust_term_over_the_inertia(rho_hat, eps_t):
    r = 1e-6 * eps_t / rho_hat
    force, *_ = robust_force(rho_hat, (r, 0.0, 0.0), eps_t)
    assert robust_rate(rho_hat, eps_t, 25.0) == pytest.approx(force / r / 25.0, rel=1e-6)
