"""The reference and its derivatives."""

from math import nextafter, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper import motion_planner
from auv_fmu.paper.motion_planner import Parameters, PlannerState, SteepReference
from auv_fmu.paper.vehicle import Vehicle, accelerations
from support.helix import helix
from support.strategies import angles, forces, lengths, speeds, vectors

VEHICLE = Vehicle()


def stepped(state, tau_d, h):
    return motion_planner.step(state, motion_planner.motion(VEHICLE, state, tau_d), h)


@given(
    theta=st.floats(-1.2, 1.2),
    psi=angles,
    nu=vectors(speeds, 5),
    tau_d=vectors(forces, 3),
    ell=lengths,
)
def test_closed_form_derivatives_agree_with_differences_of_the_trajectory(
    theta, psi, nu, tau_d, ell
):
    """Euler steps of +-h differ from the trajectory by O(h^2) that central differences cancel."""
    state, h = PlannerState((1.0, 2.0, 3.0), theta, psi, nu), 1e-5

    def at(dt):
        moved = stepped(state, tau_d, dt)
        return motion_planner.reference(moved, motion_planner.motion(VEHICLE, moved, tau_d), ell)

    now, after, before = at(0.0), at(h), at(-h)
    difference = np.subtract(after.y_d, before.y_d) / (2 * h)
    np.testing.assert_allclose(now.dy_d, difference, rtol=1e-6, atol=1e-5)
    difference = np.subtract(after.dy_d, before.dy_d) / (2 * h)
    np.testing.assert_allclose(now.ddy_d, difference, rtol=1e-5, atol=1e-4)


@given(theta=st.floats(-1.2, 1.2), psi=angles, nu=vectors(speeds, 5), tau_d=vectors(forces, 3))
def test_reference_vehicle_obeys_equation_2_undisturbed(theta, psi, nu, tau_d):
    moving = motion_planner.motion(VEHICLE, PlannerState((0.0,) * 3, theta, psi, nu), tau_d)
    expected = accelerations(VEHICLE, nu, sin(theta), tau_d, (0.0,) * 5)
    np.testing.assert_allclose(moving.dnu, expected, rtol=1e-14, atol=1e-14)


def test_reference_starts_in_its_posture_at_rest_or_in_motion():
    eta0, nu0 = (1.0, 2.0, 3.0, 0.4, 0.5), (0.1, 0.2, 0.3, 0.4, 0.5)
    at_rest, _ = next(helix(Parameters(eta0=eta0)))
    assert at_rest == ((1.0, 2.0, 3.0), 0.4, 0.5, (0.0,) * 5)
    moving, _ = next(helix(Parameters(eta0=eta0, nu0=nu0)))
    assert moving == ((1.0, 2.0, 3.0), 0.4, 0.5, nu0)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_reference_stays_five_degrees_away_from_the_pole_of_equation_1(up):
    """On either side of 90 degrees; the steepest pitch itself is allowed."""
    steepest = up * radians(85.0)

    def motion(theta):
        state = PlannerState((0.0,) * 3, theta, 0.0, (0.0,) * 5)
        return motion_planner.motion(VEHICLE, state, (0.0,) * 3)

    assert motion(steepest).rotation[0][2] == pytest.approx(-sin(steepest))
    with pytest.raises(SteepReference, match=rf"{up * 85:.1f} degrees.* within 85$"):
        motion(nextafter(steepest, up * pi))


def test_steady_turn_is_an_equilibrium_of_equation_2():
    """Under constant yaw moment without pitch, (2) rests where its right side is zero."""
    state = PlannerState((0.0,) * 3, 0.0, 0.0, (0.0,) * 5)
    for _ in range(10_000):
        state = stepped(state, (20.0, 0.0, 4.0), 0.02)
    u, v, w, q, r = state.nu
    assert (w, q) == (0.0, 0.0)
    assert v == pytest.approx(-VEHICLE.m11 * u * r / VEHICLE.d22, rel=1e-9)
    assert VEHICLE.d11 * u == pytest.approx(VEHICLE.m22 * v * r + 20.0, rel=1e-9)
    assert VEHICLE.d66 * r == pytest.approx((VEHICLE.m11 - VEHICLE.m22) * u * v + 4.0, rel=1e-9)


def test_reference_at_rest_accelerates_by_the_driving_torques():
    """At rest ddy_d = J M_1^-1 tau_d, which is (14) without velocities."""
    state = PlannerState((0.0, 0.0, -2.0), 0.0, 0.0, (0.0,) * 5)
    moving = motion_planner.motion(VEHICLE, state, (5.0, 1.0, 2.0))
    reference = motion_planner.reference(state, moving, 0.35)
    assert reference.y_d == (0.35, 0.0, -2.0)
    assert reference.dy_d == (0.0, 0.0, 0.0)
    assert reference.ddy_d == pytest.approx((5.0 / 25.0, 0.35 * 2.0 / 15.0, -0.35 * 1.0 / 22.5))
