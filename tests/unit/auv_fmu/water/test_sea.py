"""The sea at a vehicle: waves and current together."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from auv_fmu.paper import plant
from auv_fmu.paper.attitude import rotation_from_quaternion
from auv_fmu.remus import remus100
from auv_fmu.water import ocean_current, sea, waves
from auv_fmu.water.ocean_current import Variation
from auv_fmu.water.sea import ImpossibleSea, Sea

VARIATION = Variation(0.03, -0.02, 1.0)

STEADY = Variation(0.0, 0.0, 1.0)

NONE = (0.0, 0.0, 0.0)

times, depths = st.floats(0.0, 1e4), st.sampled_from((0.0, 20.0, 50.0))


@given(z=st.floats(-3.0, 60.0), t=times, depth=depths)
def test_water_moves_with_waves_and_current(z, t, depth):
    parameters = Sea(depth=depth)
    rows, place = sea.regular_waves(parameters), (3.0, -7.0, z)
    actual = sea.water(parameters, rows, VARIATION, place, t)
    swell = waves.motion(parameters.waves, rows, depth, place, t)
    inside = min(max(z, 0.0), depth or np.inf)
    share = ocean_current.profile(parameters.current.root, inside, depth)
    flow = np.multiply(share, (0.1 + 0.03, -0.02, 0.0))
    np.testing.assert_allclose(actual.velocity, np.add(swell.velocity, flow), atol=1e-15)
    assert actual.elevation == swell.elevation


@given(
    z=st.floats(-2.0, 19.0), t=times, depth=depths, Hs=st.floats(0.1, 3.0),
    s=st.sampled_from((0.0, 2.0, 10.0)), speed=st.floats(0.0, 2.0),
    root=st.sampled_from((0.0, 2.0, 7.0)), seed=st.integers(0, 1000),
)  # fmt: skip
def test_acceleration_follows_the_water_on_its_way(z, t, depth, Hs, s, speed, root, seed):
    """Central differences of the velocity, along the way that it goes: du/dt + (u . grad) u."""
    assume(abs(z) > 0.01)  # there the vertical gradient jumps
    sea_waves = waves.Waves(Hs=Hs, s=s, direction=0.4, seed=seed)
    parameters = Sea(sea_waves, ocean_current.Current(speed, 2.0, root), depth)
    rows, h = sea.regular_waves(parameters), 1e-4

    def velocity(place, t):
        moved = sea.water(parameters, rows, VARIATION, tuple(map(float, place)), t)
        return np.array(moved.velocity)

    place = np.array((3.0, -7.0, z))
    way = h * velocity(place, t)
    expected = (velocity(place + way, t + h) - velocity(place - way, t - h)) / (2 * h)
    actual = sea.water(parameters, rows, VARIATION, (3.0, -7.0, z), t).acceleration
    np.testing.assert_allclose(actual, expected, atol=1e-6)


@given(t=times, z=st.sampled_from((0.0, 50.0, 60.0)))
def test_acceleration_is_finite_at_the_surface_and_on_the_bottom(t, z):
    """The water does not rise at an infinite slope of the profile."""
    parameters = Sea()
    rows = sea.regular_waves(parameters)
    moved = sea.water(parameters, rows, VARIATION, (0.0, 0.0, z), t)
    assert np.isfinite(moved.acceleration).all()
    if z > 0.0:
        assert moved.acceleration[2] == pytest.approx(0.0, abs=1e-12)


# A vehicle that nothing drives


def way_of_water(parameters, place, duration, h):
    """Path of the water from a place: its velocity, integrated by Runge-Kutta's scheme."""
    rows = sea.regular_waves(parameters)

    def velocity(x, t):
        return np.array(sea.water(parameters, rows, STEADY, tuple(map(float, x)), t).velocity)

    x, found = np.array(place), [np.array(place)]
    for t in np.arange(round(duration / h)) * h:
        one = velocity(x, t)
        two = velocity(x + h / 2 * one, t + h / 2)
        three = velocity(x + h / 2 * two, t + h / 2)
        x = x + h / 6 * (one + 2 * two + 2 * three + velocity(x + h * three, t + h))
        found.append(x)
    return np.array(found)


def auv_adrift(eta0, nu0, water, duration, h):
    """Positions of an AuvPlant without drive or disturbance."""
    parameters = plant.Parameters(eta0=eta0, nu0=nu0)
    state = plant.begin(parameters, nu0[:3])
    found = [state.position]
    for t in (np.arange(round(duration / h)) * h).tolist():
        flow, dflow, _ = water(state.position, t)
        rotation = rotation_from_quaternion(state.quaternion)
        still = NONE, (*NONE, *NONE)
        state = plant.advance(parameters, state, rotation, *still, flow, dflow, h)
        found.append(state.position)
    return np.array(found)


def remus_adrift(eta0, nu0, water, duration, h):
    """Positions of a Remus100 without drive."""
    parameters = remus100.Parameters(eta0=eta0, nu0=nu0)
    state = remus100.begin(parameters, nu0[:3])
    found = [state.position]
    for t in (np.arange(round(duration / h)) * h).tolist():
        flow, dflow, _ = water(state.position, t)
        state = remus100.advance(parameters, state, NONE, flow, dflow, h)
        found.append(state.position)
    return np.array(found)


def adrift(way, parameters, place, duration, h):
    rows = sea.regular_waves(parameters)

    def water(position, t):
        return sea.water(parameters, rows, STEADY, position, t)

    start = (*water(place, 0.0).velocity, *NONE)
    return way((*place, *NONE), start, water, duration, h)


@pytest.mark.parametrize(("way", "apart"), [(auv_adrift, 0.01), (remus_adrift, 0.1)])
def test_a_vehicle_adrift_follows_the_water(way, apart):
    """In the default sea, at 3 m, where the water goes 6 m on and the vehicle needs no force.

    What is left is of first order in the step. The water sinks by 0.24 m. With du/dt at a fixed
    place for the acceleration, the AuvPlant would sink by 0.61 m and the Remus100 by 2.9 m.
    """
    place, h = (0.0, 0.0, 3.0), 0.02
    water = way_of_water(Sea(), place, 60.0, 5 * h)
    vehicle = adrift(way, Sea(), place, 60.0, h)[::5]
    assert np.linalg.norm(water[-1] - water[0]) > 5.0
    assert np.linalg.norm(vehicle - water, axis=1).max() < apart


def test_a_vehicle_adrift_has_the_drift_of_stokes():
    """a^2 omega k exp(-2 k z) below a regular wave in deep water, of second order in its slope."""
    z = 6.0
    still = ocean_current.Current(speed=0.0)
    parameters = Sea(waves.Waves(n=1, s=0.0, Hs=0.8), still, depth=0.0)
    [omega, k, *_] = sea.regular_waves(parameters)[0]
    a = waves.amplitude(parameters.waves)
    periods, h = 10, 2 * np.pi / omega / 300
    vehicle = adrift(auv_adrift, parameters, (0.0, 0.0, z), periods * 300 * h, h)
    # The mean depth differs from the start: from a crest the vehicle comes down.
    mean = vehicle[:, 2].mean()
    speed = (vehicle[-1, 0] - vehicle[0, 0]) / (periods * 300 * h)
    assert speed == pytest.approx(a * a * omega * k * np.exp(-2 * k * mean), rel=0.03)


def test_current_of_a_sea_without_waves():
    parameters = Sea(waves.Waves(spectrum=waves.Spectrum.NONE), depth=0.0)
    actual = sea.water(parameters, sea.regular_waves(parameters), VARIATION, (0.0,) * 3, 5.0)
    assert actual.velocity == (0.1 + 0.03, -0.02, 0.0)
    assert not any(actual.acceleration) and actual.elevation == 0.0


def test_waves_that_would_break_are_refused():
    """A wave of 7 s in deep water: lambda = g T^2 / (2 pi) = 76.5 m, and 0.142 of it 10.9 m."""
    deep = Sea(depth=0.0)
    sea.check(deep._replace(waves=deep.waves._replace(Hs=10.8)))
    with pytest.raises(ImpossibleSea, match=r"waves\.Hs = 11 m is more than 10\.9 m, .* reduce"):
        sea.check(deep._replace(waves=deep.waves._replace(Hs=11.0)))
    with pytest.raises(ImpossibleSea):
        sea.check(Sea(depth=1.0))
    sea.check(Sea(waves.Waves(spectrum=waves.Spectrum.NONE, Hs=11.0)))
