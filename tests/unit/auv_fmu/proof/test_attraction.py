"""(33), (40), (42) and (47): the largest region that the theorems cover."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper import motion_planner
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.attraction import alpha_1_at_most, alphas, ball, reach, stretch, theorem
from auv_fmu.proof.gain_conditions import Bounds, Zetas, bounds, conditions, coupling
from support.helix import helix_after
from support.strategies import speeds, vectors

ELL = 0.35
#: A vehicle for which Theorem 1 may hold, and gains that meet (30).
DAMPED, QUICK = Vehicle(d11=500.0, d55=200.0, d66=200.0), Gains(lambda_=2.1)
positive, units = st.floats(0.1, 100.0), st.floats(0.01, 2.0)
three = vectors(speeds, 3)
gains = st.builds(
    lambda k_1, k_2, lambda_, k_d: Gains((k_1,) * 3, (k_2,) * 3, lambda_, k_d), *[positive] * 4
)


@given(gains=gains)
def test_alphas_are_those_below_40(gains):
    found = theorem(Vehicle(), ELL, gains, 1.0)
    known, zetas = found.bounds, found.zetas
    k_1, k_2, lambda_ = gains.K1[0], gains.K2[0], gains.lambda_
    expected = (
        k_2 * lambda_ - 0.5 * k_2 * lambda_ - k_2,
        k_2 * lambda_ - 0.5 * k_2 * lambda_ - 0.5 * k_2,
        known.lambda_d2 - k_1 - 0.5 * k_2 - 0.5 * zetas.zeta_1_2,
        gains.k_d * known.lambda_m2 - 2.0 * k_1 - k_2 - 0.5 * zetas.zeta_3_4,
    )
    assert found.alphas == pytest.approx(expected)


@given(
    t_ez=three, t_z=three, r_1=three, r_2=three, gains=gains, damping=vectors(positive, 3),
    inertia=vectors(positive, 3), v0=units,
)  # fmt: skip
def test_alphas_bound_what_is_known_of_37(t_ez, t_z, r_1, r_2, gains, damping, inertia, v0):
    """The terms of (37) without chi, xi and theta, for any D_2 and M_2, against (40).

    Tanh(e - z) and Tanh(z) are any vectors here, and v0 any unit of speed: 1 m/s is as printed.
    """
    t_ez, t_z, r_1, r_2 = map(np.array, (t_ez, t_z, r_1, r_2))
    k_1, k_2, lambda_ = gains.K1[0], gains.K2[0], gains.lambda_
    pulled = k_1 * np.tanh(r_1 - r_2)
    exact = (
        -k_2 * lambda_ * (t_ez @ t_ez + t_z @ t_z - t_ez @ t_z)
        - r_1 @ (damping * r_1)
        - gains.k_d * r_2 @ (inertia * r_2)
        - (r_1 + r_2) @ pulled
        - k_2 * (r_1 @ t_z + 2.0 * r_2 @ t_ez)
    )
    known = Bounds(min(inertia), max(inertia), min(damping), max(damping))
    found = alphas(known, conditions(known, Zetas(0.0, 0.0), *gains[:4], 1.0, v0), gains, v0)
    x = (t_ez, t_z, r_1 / v0, r_2 / v0)
    bound = -sum(alpha * (part @ part) for alpha, part in zip(found, x, strict=True))
    assert exact <= bound + 1e-9 * (1.0 + abs(bound) + abs(exact))


def test_alphas_of_the_paper():
    """Without the zetas -5, 0, 15 and 1220: (33) is empty before they are known."""
    found = theorem(Vehicle(), ELL, Gains(), 1.0)
    free = [a + 0.5 * z for a, z in zip(found.alphas, (0.0, 0.0, *found.zetas), strict=True)]
    assert free == pytest.approx([-5.0, 0.0, 15.0, 1220.0])
    assert found.radius == 0.0


@given(gains=gains)
def test_no_gains_meet_31_as_printed_with_the_vehicle_of_the_paper(gains):
    found = theorem(Vehicle(), ELL, gains, 1.0)
    assert found.conditions[1].verdict == "violated"
    assert found.alphas.alpha_3 < found.bounds.lambda_d2 - found.zeta_of_any_gains < 0.0
    assert found.radius == 0.0


@given(lambda_=st.floats(0.2401, 100.0), v0=st.floats(1e-6, 1e3))
def test_31_asks_for_a_small_lambda_in_any_unit(lambda_, v0):
    """Below 4 lambda_d2 / k = 0.24 m/s, with k_1 and k_2 as small as one likes."""
    none = Gains((1e-9,) * 3, (1e-9,) * 3, lambda_)
    found = theorem(Vehicle(), ELL, none, 1.0, v0)
    assert found.conditions[1].verdict == "violated"
    assert 2.0 * found.speed_of_any_gains == pytest.approx(0.2401)


def test_31_asks_for_a_slow_reference_in_any_unit():
    """zeta_1 is k |dy_d| at least. Section 4.1 has 0.167 m/s, once it is on its way."""
    speed = np.linalg.norm(motion_planner.reference(*helix_after(2500), ELL).dy_d)
    assert speed == pytest.approx(0.167, abs=5e-4)
    known, k = bounds(Vehicle(), ELL), coupling(Vehicle(), ELL)
    found = theorem(Vehicle(), ELL, Gains(), 1.0)
    assert 0.5 * k * found.speed_of_any_gains == pytest.approx(known.lambda_d2)
    assert 0.5 * k * speed > 41.0 > known.lambda_d2


def test_units_in_which_the_conditions_leave_room():
    """At v0 = 0.05 m/s and lambda just above 0.1 m/s; a k_d of 3.4 would not do."""
    k = 25.0 * 15.0 / (17.5 * ELL**3)
    slow = Gains((1e-9,) * 3, (1e-9,) * 3, 0.10001)
    found = theorem(Vehicle(), ELL, slow._replace(k_d=3.4), 1.0, 0.05)
    assert [condition.verdict for condition in found.conditions] == ["met", "open", "violated"]
    assert found.conditions[1].margin == pytest.approx(30.0 - k * 0.05 * np.sqrt(5.0) / 4, rel=1e-4)
    assert theorem(Vehicle(), ELL, slow._replace(k_d=3.6), 1.0, 0.05).conditions[2].margin > 0.0
    assert found.x_of_any_gains == pytest.approx(2.0 * 30.0 / (k * 0.05)) == pytest.approx(2.401)


@given(gains=gains, lambda_=st.floats(0.001, 0.24), k_2=st.floats(1e-4, 10.0), v0=units)
def test_alpha_1_is_small_in_any_unit_where_31_holds(gains, lambda_, k_2, v0):
    gains = gains._replace(K1=(1e-9,) * 3, K2=(k_2,) * 3, lambda_=lambda_)
    found = theorem(Vehicle(), ELL, gains, 1.0, v0)
    most = found.alpha_1_of_any_gains
    assert found.conditions[1].verdict == "violated" or found.alphas.alpha_1 <= most


def test_alpha_1_at_most_is_attained():
    """By the best of many gains and units; and 3 eps_t is above it for eps_t of 0.0101 W and up."""
    k = coupling(Vehicle(), ELL)
    v0, over = np.meshgrid(np.linspace(0.001, 0.1, 1000), np.linspace(2.0, 20.0, 1000))
    room = 30.0 - 0.25 * k * v0 * np.hypot(1.0, over)
    found = np.max(2.0 * v0 * np.maximum(room, 0.0) * v0 * (0.5 * over - 1.0))
    assert found == pytest.approx(alpha_1_at_most(30.0, k), rel=1e-4)
    assert alpha_1_at_most(30.0, k) < 3.0 * 0.0101


@given(gains=gains, more=st.floats(1.0, 10.0))
def test_no_gain_makes_alpha_3_larger(gains, more):
    """It has gains only with a minus: the region does not grow with them."""
    alpha_3 = theorem(DAMPED, ELL, gains, 1.0).alphas.alpha_3
    for name in ("K1", "K2", "lambda_", "k_d"):
        larger = gains._replace(**{name: np.multiply(more, getattr(gains, name))})
        found = theorem(DAMPED, ELL, larger, 1.0)
        assert found.alphas.alpha_3 <= alpha_3
        assert found.x_at_most <= found.x_of_any_gains


def test_the_control_point_must_be_far_ahead():
    """(31) with vanishing gains: above 0.56 m, and not at the paper's 0.35 m."""
    none = Gains((1e-9,) * 3, (1e-9,) * 3, 1e-9)
    verdicts = [theorem(Vehicle(), ell, none, 1.0).conditions[1].verdict for ell in (0.56, 0.57)]
    assert verdicts == ["violated", "open"]


def test_a_vehicle_and_gains_that_the_theorem_may_cover():
    found = theorem(DAMPED, ELL, QUICK, 1.0)
    assert [condition.verdict for condition in found.conditions] == ["met", "open", "open"]
    assert 0.0 < found.radius == found.x_at_most / found.stretch


@given(theta=st.floats(0.0, 300.0), eps_t=positive, mu_sigma=st.floats(1e-4, 0.1))
def test_ball_of_44_at_the_best_kappa(theta, eps_t, mu_sigma):
    """No kappa makes it smaller, and one comes close; it falls as Sigma grows."""
    square = np.geomspace(0.500001, 1e6, 20_000)
    gamma = 0.5 * mu_sigma * square * theta**2 + 3.0 * eps_t
    least = np.sqrt(np.min(gamma / (mu_sigma * (1.0 - 0.5 / square))))
    found = ball(theta, eps_t, mu_sigma)
    assert found <= least * (1.0 + 1e-12)
    assert found == pytest.approx(least, rel=1e-3)
    assert ball(theta, eps_t, 2.0 * mu_sigma) < found


@given(e_z=three, z=three)
def test_ball_of_44_holds_every_error(e_z, z):
    """With the values of section 4.1 and theta known beforehand, which makes it smallest."""
    assert np.linalg.norm(np.tanh([*e_z, *z])) <= np.sqrt(6.0) < ball(0.0, 1.0, 0.001)


def test_41_needs_the_largest_entry_of_sigma():
    """At kappa = 1, half-way to theta_0 in the entry that is forgotten a hundred times faster."""
    sigma, away = np.array([0.001, 0.001, 0.001, 0.1]), np.array([0.0, 0.0, 0.0, 1.0])
    tilde = 0.5 * away
    left = tilde @ (sigma * (away - tilde))  # theta_hat - theta_0 = away - tilde
    assert left == pytest.approx(0.025)
    assert -min(sigma) * 0.5 * (tilde @ tilde) + 0.5 * min(sigma) * (away @ away) < 0.0004


@given(
    sigma=vectors(st.floats(1e-4, 1.0), 4),
    away=vectors(speeds, 4),
    tilde=vectors(speeds, 4),
    square=st.floats(0.51, 100.0),
)
def test_41_holds_with_the_largest_entry_of_sigma(sigma, away, tilde, square):
    sigma, away, tilde = map(np.array, (sigma, away, tilde))
    bound = -min(sigma) * (1.0 - 0.5 / square) * (tilde @ tilde)
    bound += 0.5 * max(sigma) * square * (away @ away)
    assert tilde @ (sigma * (away - tilde)) <= bound + 1e-9


@given(room=positive, k=positive, share=st.floats(0.0, 1.0))
def test_no_zetas_reach_further(room, k, share):
    """(26) as chi_1 = k |x|^2 / 2 needs it at |x|, and (42) with alpha_3: not both beyond."""
    x = 1.001 * reach(room, k)
    zeta_1 = share * k * x / 2.0
    zeta_2 = (k * x / 2.0 - zeta_1) / x
    twice_alpha_3 = 2.0 * room - (zeta_1 + zeta_2)
    assert not twice_alpha_3 > zeta_1 + zeta_2 * x**2


@given(room=positive, k=positive, zeta_2=st.floats(0.0, 100.0), x=st.floats(0.0, 1.0))
def test_no_ball_is_left_for_a_reference_that_moves(room, k, zeta_2, x):
    """Faster than room / k, half of the bound of (31): zeta_1 is k |dy_d| at least."""
    speed = 0.5001 * reach(room, k)
    zeta_1 = k * speed
    assert not 2.0 * room - (zeta_1 + zeta_2) > zeta_1 + zeta_2 * x**2


def test_zetas_that_reach_as_far_are_there():
    """zeta_1 = k |x| / 2 and zeta_2 = 0, for states up to |x|."""
    x = 0.999 * reach(30.0, 500.0)
    assert 2.0 * 30.0 - 500.0 * x / 2.0 > 500.0 * x / 2.0


@given(u=st.floats(0.0, 10.0), theta=st.floats(0.0, 10.0), gamma=positive)
def test_33_needs_the_max_for_47(u, theta, gamma):
    """The sum in (47) is bounded by stretch^2 |vartheta|^2, and by no smaller multiple."""
    known, gains = bounds(Vehicle(), ELL), Gains(gamma=gamma)
    lambda_x, lambda_u = min(5.0, known.lambda_m2 / 2), max(5.0, known.lambda_M2 / 2)
    factors = np.array([lambda_u / lambda_x, 0.5 / gamma / lambda_x])
    assert stretch(known, gains, 1.0) ** 2 == pytest.approx(factors.max())
    needed = factors @ [u * u, theta * theta]
    assert needed <= factors.max() * (u * u + theta * theta) * (1.0 + 1e-12)


def test_33_as_printed_admits_starts_that_47_excludes():
    """On the boundary of (33) with min, all of vartheta in u: (47) is missed by (13.6)^2."""
    known, zeta, alpha_m = bounds(Vehicle(), ELL), 1.0, 10.0
    lambda_x, lambda_u = min(5.0, known.lambda_m2 / 2), max(5.0, known.lambda_M2 / 2)
    factors = (lambda_u / lambda_x, 0.5 / lambda_x)
    square = (2.0 * alpha_m - 2.0 * zeta) / (2.0 * zeta * min(factors))
    asked = 0.5 * (2.0 * zeta) + 0.5 * (2.0 * zeta) * factors[0] * square
    assert alpha_m < asked
    assert np.sqrt(max(factors) / min(factors)) == pytest.approx(13.6, abs=0.05)
