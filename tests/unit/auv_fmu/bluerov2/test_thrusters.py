"""Thrusters of the BlueROV2 Heavy, against what Blue Robotics measured and against Fossen."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal, Vector
from auv_fmu.bluerov2.thrusters import Curve, Layout, check, command_of, forces, thrust
from support import bluerov_oracle as oracle

CURVE, LAYOUT = Curve(), Layout()


def test_thrust_is_what_blue_robotics_measured_at_16_v():
    """As the docstring of the module says: the largest error is at full command."""
    fitted = np.array([thrust(CURVE, (pulse - 1500.0) / 400.0) for pulse in oracle.PULSES])
    error = np.abs(fitted - oracle.T200 * oracle.KGF)
    assert error.argmax() == 40
    assert error.max() == pytest.approx(1.9, abs=0.05)
    assert np.delete(error, (0, 40)).max() < 1.0
    assert sqrt((error**2).mean()) == pytest.approx(0.5, abs=0.05)


def test_commands_in_the_dead_band_give_no_thrust_and_all_others_some():
    for command in (0.0, 0.05, -0.07):
        assert thrust(CURVE, command) == 0.0
    assert 0.0 < thrust(CURVE, 0.071) < 0.1
    assert -0.1 < thrust(CURVE, -0.071) < 0.0
    # The table has its first thrusts at 1468 and 1532 us.
    assert (oracle.T200[np.abs(oracle.PULSES - 1500.0) < 30.0] == 0.0).all()


@pytest.mark.parametrize("beyond", [1.0, 1.5, 1e300])
def test_commands_are_limited(beyond):
    assert thrust(CURVE, beyond) == thrust(CURVE, 1.0)
    assert thrust(CURVE, -beyond) == thrust(CURVE, -1.0)


@given(command=st.floats(-1.0, 1.0))
def test_the_command_of_a_thrust_gives_it(command):
    force = thrust(CURVE, command)
    assert thrust(CURVE, command_of(CURVE, force)) == pytest.approx(force, rel=1e-9, abs=1e-12)
    if abs(command) > 0.071:
        assert command_of(CURVE, force) == pytest.approx(command, rel=1e-9)


def test_no_thrust_takes_no_command():
    assert command_of(CURVE, 0.0) == 0.0
    assert command_of(CURVE, 1e-12) == pytest.approx(0.07)
    assert command_of(CURVE, -1e-12) == pytest.approx(-0.07)


def test_a_curve_may_be_a_line():
    line = Curve(0.0, 40.0, 0.0, 20.0, 0.0)
    assert (command_of(line, 10.0), command_of(line, -10.0)) == (0.25, -0.5)


@given(thrusts=st.lists(st.floats(-50.0, 50.0), min_size=8, max_size=8))
def test_forces_follow_from_the_published_positions_and_directions(thrusts):
    given_ = forces(LAYOUT, Vector(thrusts))
    assert given_ == pytest.approx(oracle.effect() @ thrusts, rel=1e-9, abs=1e-9)


def test_positions_are_mirrored_and_their_published_angles_are_rounded():
    """Two digits after the point of an angle leave up to 1.3 mm at 0.25 m; it is 0.8 mm."""
    ours = np.array((LAYOUT.x, LAYOUT.y, LAYOUT.z)).T
    assert ours == pytest.approx(oracle.positions(), abs=1e-12)
    assert ours == pytest.approx(oracle.published_positions(), abs=0.9e-3)


def test_a_direction_of_another_length_is_refused():
    check(LAYOUT)
    with pytest.raises(Refusal, match=r"thruster\[5\] .* is of length 0.5, not 1"):
        check(LAYOUT._replace(e_z=LAYOUT.e_z.replaced(4, -0.5)))
