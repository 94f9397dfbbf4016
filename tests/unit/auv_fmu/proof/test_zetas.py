"""The lower bounds on the zetas, against chi_1 and chi_2 in matrices."""

from math import hypot, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.proof.control_point_model import C_2
from auv_fmu.proof.error_dynamics import chi_1, chi_2
from auv_fmu.proof.zetas import at_least, coupling
from auv_fmu.vehicle import Vehicle

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
    # Of the products that chi_1 adds up.
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
