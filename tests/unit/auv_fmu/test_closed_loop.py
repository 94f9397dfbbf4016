"""The loop of Fig. 2; tests/system holds the loop of FMUs against it."""

import numpy as np
import pytest

from auv_fmu.closed_loop import Setting, closed_loop
from auv_fmu.output_feedback import Gains
from auv_fmu.plant import Localisation
from auv_fmu.saturation import algebraic, hyperbolic_tangent

QUIET = Localisation(std=0.0)


def test_loop_starts_where_section_4_1_says():
    """At rest, level and without noise; sin(0) = sign(0) = 0 leave nothing of (56)."""
    [start] = closed_loop(0, Setting(localisation=QUIET))
    assert start.t == 0.0
    assert start.measurement.y == (2.35, 6.0, 0.0)
    assert start.reference.y_d == (0.35, 0.0, -2.0)
    assert start.signals.e == (2.0, 6.0, 2.0)
    assert start.signals.z == (0.0, 0.0, 0.0)
    assert start.tau_w == (0.0,) * 6


def test_first_step_moves_no_position_but_all_velocities():
    """Euler from rest: positions follow one step after the velocities."""
    start, first = closed_loop(1, Setting(localisation=QUIET))
    assert first.t == 0.02
    assert first.plant_state.position == start.plant_state.position
    tau_u, tau_q, tau_r = start.tau
    expected = (0.02 * tau_u / 25.0, 0.0, 0.0, 0.0, 0.02 * tau_q / 22.5, 0.02 * tau_r / 15.0)
    assert first.plant_state.nu == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("s", [hyperbolic_tangent, algebraic])
def test_closed_loop_of_either_saturation_function_converges(s):
    """Theorem 2: the tracking error ends in a ball; 10 cm in 60 s from 6 m for our numbers."""
    *_, last = closed_loop(3000, Setting(gains=Gains(s=s), localisation=QUIET))
    assert np.abs(last.signals.e).max() < 0.1
