"""The hull of the REMUS 100, compared with mechanics and Lamb."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.attitude import rotate, rotation_from_euler
from auv_fmu.remus.hull import (
    Drag,
    Hull,
    coriolis,
    cross_flow,
    inertia,
    lift_and_drag,
    restoring,
)

DRAG = Drag()
velocities = st.tuples(*(st.floats(-2.0, 2.0),) * 6)


def test_added_mass_of_a_sphere_is_half_of_the_water_it_displaces():
    """Lamb's factors of a spheroid that is all but a sphere; a sphere turns without any."""
    m = 1026 * 4 / 3 * pi * 0.5**3
    mass = inertia(Hull(length=1.0 + 1e-3, diameter=1.0, mass=m))
    assert mass.a_11 == pytest.approx(m / 2, rel=2e-3)
    assert mass.a_22 == pytest.approx(m / 2, rel=2e-3)
    assert mass.a_55 == pytest.approx(0.0, abs=1e-4 * m)


def test_added_mass_of_a_slender_hull_is_a_cylinders_across_and_none_along():
    mass = inertia(Hull(length=20.0, diameter=0.1, mass=1.0))
    assert mass.a_11 == pytest.approx(0.0, abs=1e-3)
    assert mass.a_22 == pytest.approx(1.0, abs=1e-3)
    assert mass.a_55 == pytest.approx(mass.i_y, rel=2e-3)


@given(r_bg=st.tuples(*(st.floats(-0.3, 0.3),) * 3), nu=velocities)
def test_mass_matrix_is_the_kinetic_energy(r_bg, nu):
    """Inertia of the hull, moved to its centre of mass, and of the water around it."""
    mass, m = inertia(Hull(r_bg=r_bg)), Hull().mass
    v, omega = np.array(nu[:3]), np.array(nu[3:])
    at_centre = v + np.cross(omega, r_bg)
    hull = m * at_centre @ at_centre + omega @ np.diag([mass.i_x, mass.i_y, mass.i_y]) @ omega
    water = v @ np.diag([mass.a_11, mass.a_22, mass.a_22]) @ v
    water += omega @ np.diag([mass.a_44, mass.a_55, mass.a_55]) @ omega
    M = np.array(mass.M)
    assert np.array_equal(M, M.T)
    assert np.array(nu) @ M @ np.array(nu) == pytest.approx(hull + water, rel=1e-9, abs=1e-9)


@given(nu=velocities, r_bg=st.tuples(*(st.floats(-0.3, 0.3),) * 3))
def test_coriolis_forces_do_no_work(nu, r_bg):
    hull = Hull(r_bg=r_bg)
    force = coriolis(hull, inertia(hull), nu)
    assert sum(f * x for f, x in zip(force, nu, strict=True)) == pytest.approx(0.0, abs=1e-9)


@given(phi=st.floats(-1.5, 1.5), theta=st.floats(-1.5, 1.5))
def test_righting_moment_is_the_slope_of_the_potential_energy(phi, theta):
    """The weight hangs below the centre of buoyancy, z = -m g (R r_bg)_3 with z down."""
    hull = Hull(r_bg=(0.01, -0.02, 0.05))
    x, y, z = hull.r_bg
    down = np.array([-sin(theta), cos(theta) * sin(phi), cos(theta) * cos(phi)])
    moment = np.cross((x, y, z), hull.mass * hull.gravity * down)
    assert restoring(hull, phi, theta)[1] == pytest.approx(moment, abs=1e-9)


@given(phi=st.floats(-3.0, 3.0), theta=st.floats(-1.5, 1.5), psi=st.floats(-3.0, 3.0))
def test_buoyancy_beyond_the_weight_pulls_up_in_any_attitude(phi, theta, psi):
    force = restoring(Hull(net_buoyancy=7.0), phi, theta)[0]
    in_earth = rotate(rotation_from_euler(phi, theta, psi), force)
    assert in_earth == pytest.approx((0.0, 0.0, -7.0), abs=1e-12)


def test_strips_of_the_cross_flow_are_the_integral_and_one_more():
    """21 strips of a twentieth of the length: at a pure sway, 5 % more than the hull is long."""
    force, moment = cross_flow(Hull(), DRAG, 1026.0, 0.4, 0.0)
    whole = 0.5 * 1026 * 0.19 * 1.6 * DRAG.c_d_across * 0.4**2
    assert force == pytest.approx(-1.05 * whole)
    assert moment == pytest.approx(0.0, abs=1e-12)


@given(u=st.floats(0.1, 2.5), w=st.floats(-0.5, 0.5))
def test_lift_and_drag_brake(u, w):
    x, _, z = lift_and_drag(Hull(), DRAG, 1026.0, u, 0.0, w)
    assert x * u + z * w < 0.0


def test_drag_along_the_hull_is_the_drag_of_its_front():
    x, _, z = lift_and_drag(Hull(), DRAG, 1026.0, 2.0, 0.0, 0.0)
    assert (x, z) == pytest.approx((-0.5 * 1026 * 4.0 * 0.42 * pi * 0.095**2, 0.0))
