"""The sea at a vehicle: waves and current together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import ocean_current, sea, waves
from auv_fmu.ocean_current import Variation
from auv_fmu.sea import ImpossibleSea, Sea

VARIATION = Variation(0.03, -0.02, 1.0)


@given(z=st.floats(-3.0, 60.0), t=st.floats(0.0, 1e4), depth=st.sampled_from((0.0, 20.0, 50.0)))
def test_water_moves_with_waves_and_current_and_only_waves_speed_it_up(z, t, depth):
    parameters = Sea(depth=depth)
    rows, place = sea.regular_waves(parameters), (3.0, -7.0, z)
    actual = sea.water(parameters, rows, VARIATION, place, t)
    swell = waves.motion(parameters.waves, rows, depth, place, t)
    inside = min(max(z, 0.0), depth or np.inf)
    flow = ocean_current.velocity(parameters.current, VARIATION, inside, depth)
    np.testing.assert_allclose(actual.velocity, np.add(swell.velocity, flow), atol=1e-15)
    assert actual[1:] == swell[1:]


def test_current_of_a_sea_without_waves():
    parameters = Sea(waves.Waves(spectrum=waves.NONE), depth=0.0)
    actual = sea.water(parameters, sea.regular_waves(parameters), VARIATION, (0.0,) * 3, 5.0)
    assert actual.velocity == (0.1 + 0.03, -0.02, 0.0)
    assert actual[1:] == ((0.0,) * 3, 0.0)


def test_waves_that_would_break_are_refused():
    """Of 7 s, in deep water: lambda = g T^2 / (2 pi) = 76.5 m, and 0.142 of it 10.9 m."""
    deep = Sea(depth=0.0)
    sea.check(deep._replace(waves=deep.waves._replace(Hs=10.8)))
    with pytest.raises(ImpossibleSea, match=r"waves\.Hs = 11 m is more than 10\.9 m, .* reduce"):
        sea.check(deep._replace(waves=deep.waves._replace(Hs=11.0)))
    with pytest.raises(ImpossibleSea):
        sea.check(Sea(depth=1.0))
    sea.check(Sea(waves.Waves(spectrum=waves.NONE, Hs=11.0)))
