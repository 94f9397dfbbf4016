"""(3)."""

import numpy as np
from hypothesis import given

from auv_fmu.actuators import limit, limit_all
from support.strategies import forces, vectors


@given(tau=forces, limits=vectors(forces, 2))
def test_actuator_stays_within_its_limits_and_is_linear_between_them(tau, limits):
    tau_min, tau_max = sorted(limits)
    limited = limit(tau, tau_min, tau_max)
    assert tau_min <= limited <= tau_max
    assert limited == tau or tau != np.clip(tau, tau_min, tau_max)


def test_limits_of_each_actuator_are_its_own():
    tau_min, tau_max = (-1.0, -2.0, -3.0), (1.0, 2.0, 3.0)
    assert limit_all((9.0, 9.0, 9.0), tau_min, tau_max) == tau_max
    assert limit_all((-9.0, -9.0, -9.0), tau_min, tau_max) == tau_min
    assert limit_all((0.5, -0.5, 2.5), tau_min, tau_max) == (0.5, -0.5, 2.5)
