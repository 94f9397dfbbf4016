"""(30) to (32), (52) to (54), and the bounds of P2.1 and P2.6 they stand on."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.proof.control_point_model import D_2, M_2
from auv_fmu.proof.gain_conditions import Bounds, bounds, conditions
from auv_fmu.proof.zetas import Zetas, at_least
from auv_fmu.vehicle import Vehicle
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
