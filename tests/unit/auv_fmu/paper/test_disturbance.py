"""(56)."""

from math import sin

from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.disturbance import Disturbance, disturbance


def test_friction_opposes_each_direction_and_vanishes_at_rest():
    calm = Disturbance(A_f=2.0, A_d=0.0)
    moving = (1.0, -1.0, 3.0, 1e-300, -1e-300, -3.0)
    assert disturbance(calm, moving, 7.0) == (2.0, -2.0, 2.0, 2.0, -2.0, -2.0)
    assert disturbance(calm, (0.0, -0.0) * 3, 7.0) == (0.0,) * 6


@given(t=st.floats(0, 1e4), A_d=st.floats(-10, 10), omega_d=st.floats(0, 10))
def test_waves_are_one_sine_in_every_direction(t, A_d, omega_d):
    waves = disturbance(Disturbance(0.5, A_d, omega_d), (0.0,) * 6, t)
    assert waves == (A_d * sin(omega_d * t),) * 6
