"""(17), (19), (34) and (55) in the matrices of the paper, and the bounds (35)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.adaptation import robust_force
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.saturation import Saturation, saturation
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.gain_conditions import bounds
from auv_fmu.proof.lyapunov import Errors, composite_errors, kinetic, lyapunov
from support.control_point_model import M_2
from support.strategies import angles, lengths, pitch_angles, speeds, vectors

VEHICLE, K2 = Vehicle(), (10.0, 20.0, 30.0)
three = vectors(speeds, 3)
bounds_of_xi, widths = st.floats(0.0, 100.0), st.floats(0.1, 10.0)


@given(theta=pitch_angles, psi=angles, r=three, ell=lengths)
def test_kinetic_term_has_the_matrix_m_2(theta, psi, r, ell):
    expected = 0.5 * np.array(r) @ M_2(VEHICLE, theta, psi, ell) @ np.array(r)
    found = kinetic(VEHICLE, rotation_from_euler(0.0, theta, psi), r, ell)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(dy=three, dy_d=three, dy_hat=three, e_z=three, z=three)
def test_composite_errors_are_17_and_19(dy, dy_d, dy_hat, e_z, z):
    """r_1 = de + Lambda Tanh(e - z) and r_2 = dz + Lambda Tanh(z)."""
    s = Saturation.TANH
    r_1, r_2 = composite_errors(dy, dy_d, dy_hat, e_z, z, 0.7, s)
    de, dz = np.subtract(dy, dy_d), np.subtract(dy, dy_hat)
    np.testing.assert_allclose(r_1, de + 0.7 * np.tanh(e_z), atol=1e-14)
    np.testing.assert_allclose(r_2, dz + 0.7 * np.tanh(z), atol=1e-14)


@given(dy=three, dy_d=three, dy_hat=three, e_z=three, z=three)
def test_remark_5_leaves_out_twice_the_rate_of_z(dy, dy_d, dy_hat, e_z, z):
    """r_1 + r_2 less the estimate below (21), and |dz/dt| within (1 + lambda) |x|."""
    r_1, r_2 = composite_errors(dy, dy_d, dy_hat, e_z, z, 0.7, Saturation.TANH)
    estimated = np.subtract(dy_hat, dy_d) + 0.7 * np.tanh(e_z) + 0.7 * np.tanh(z)
    dz = np.subtract(dy, dy_hat)
    np.testing.assert_allclose(np.add(r_1, r_2) - estimated, 2.0 * dz, atol=1e-13)
    x = np.linalg.norm([*np.tanh(e_z), *np.tanh(z), *r_1, *r_2])
    assert np.linalg.norm(dz) <= 1.7 * x + 1e-12


@given(estimated=three, dz=three, rho=bounds_of_xi, rho_hat=bounds_of_xi, eps_t=widths)
def test_what_remark_5_leaves_out(estimated, dz, rho, rho_hat, eps_t):
    """In the derivative of (34), with a xi of |xi| = rho along r_1 + r_2.

    Where the estimate is exact these terms are 3 eps_t at most, as below (39). What (38) leaves out
    is within 2 (sqrt(3) rho_hat + rho) |dz/dt|, and 2 rho |dz/dt| where the estimate is zero and
    theta_hat = theta.
    """
    estimated, dz = np.array(estimated), np.array(dz)

    def terms(estimated, rho_hat):
        exact = estimated + 2.0 * dz
        robust = np.array(robust_force(rho_hat, tuple(estimated), eps_t))
        adaptive = (rho - rho_hat) * np.linalg.norm(estimated)
        return -exact @ robust + rho * np.linalg.norm(exact) - adaptive

    size = np.linalg.norm(dz)
    left_out = 2.0 * (np.sqrt(3.0) * rho_hat + rho) * size
    assert terms(estimated, rho_hat) <= 3.01 * eps_t + left_out + 1e-9 * (1.0 + left_out)
    assert terms(np.zeros(3), rho) == pytest.approx(2.0 * rho * size)


@pytest.mark.parametrize("s", Saturation)
@given(euler=vectors(angles, 3), e=three, z=three, r_1=three, r_2=three, ell=lengths)
def test_bounds_35_of_the_lyapunov_function(s, euler, e, z, r_1, r_2, ell):
    """With the largest slope s'_M = 1, and without the terms in theta."""
    errors = Errors(e, z, r_1, r_2)
    V = lyapunov(VEHICLE, rotation_from_euler(*euler), errors, K2, s, ell)
    known = bounds(VEHICLE, ell)
    e_z = tuple(np.subtract(e, z))
    r_square = np.dot(r_1, r_1) + np.dot(r_2, r_2)
    s_ez, s_z = (np.array(saturation(s, x)) for x in (e_z, z))
    lower = 0.5 * np.dot(K2, s_ez**2 + s_z**2) + 0.5 * known.lambda_m2 * r_square
    upper = 0.5 * max(K2) * (np.dot(e_z, e_z) + np.dot(z, z)) + 0.5 * known.lambda_M2 * r_square
    assert lower * (1 - 1e-12) - 1e-12 <= V <= upper * (1 + 1e-12) + 1e-12
