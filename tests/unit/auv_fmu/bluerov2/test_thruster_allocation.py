"""Allocation to the thrusters of the BlueROV2 Heavy, against numpy's pseudo-inverse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.bluerov2.thruster_allocation import (
    Parameters,
    Wanted,
    check,
    derive,
    effect,
    evaluate,
)
from auv_fmu.bluerov2.thrusters import Layout, thrust
from support import bluerov_oracle as oracle

PARAMETERS, LAYOUT = Parameters(), Layout()
DERIVED = derive(PARAMETERS)
LARGEST, SMALLEST = thrust(PARAMETERS.curve, 1.0), thrust(PARAMETERS.curve, -1.0)

forces = st.floats(-200.0, 200.0)
moments = st.floats(-30.0, 30.0)


def wanted(tau):
    """Inputs for a force and a moment."""
    u, v, w, p, q, r = tau
    return Wanted((u, q, r), (v, w, p))


def test_the_pseudo_inverse_is_numpys():
    assert np.array(effect(LAYOUT)) == pytest.approx(oracle.effect(), abs=1e-11)
    assert np.array(DERIVED.P) == pytest.approx(np.linalg.pinv(oracle.effect()), abs=1e-9)


@given(tau=st.tuples(forces, forces, forces, moments, moments, moments))
def test_a_wanted_force_is_attained_or_scaled_to_the_limits(tau):
    """The largest multiple, at most one, whose thrusts by numpy are within the limits."""
    found = evaluate(PARAMETERS, DERIVED, wanted(tau))
    thrusts = np.linalg.pinv(oracle.effect()) @ tau
    share = min(1.0, *(
        (LARGEST if f > 0.0 else SMALLEST) / f for f in thrusts if abs(f) > 1e-9
    ), 1.0)  # fmt: skip
    assert found.tau_attained == pytest.approx(share * np.array(tau), abs=1e-7)
    assert np.abs(found.command).max() <= 1.0 + 1e-12


def test_the_largest_force_ahead_takes_two_thrusters_ahead_and_two_astern():
    """The pitch that it makes below the centre of mass takes the vertical thrusters."""
    found = evaluate(PARAMETERS, DERIVED, wanted((1e6, 0.0, 0.0, 0.0, 0.0, 0.0)))
    most = 4.0 * np.sqrt(0.5) * -SMALLEST
    assert found.tau_attained == pytest.approx((most, 0.0, 0.0, 0.0, 0.0, 0.0), abs=1e-6)
    assert found.command[2] == pytest.approx(-1.0)
    assert sum(found.command[k] > 0.0 for k in (6, 7)) == 2


def test_nothing_wanted_commands_nothing():
    found = evaluate(PARAMETERS, DERIVED, wanted((0.0,) * 6))
    assert (*found.command, *found.tau_attained) == (0.0,) * 14


@given(sign=st.sampled_from((-1.0, 1.0)), force=st.floats(1e-9, 1e-3))
def test_the_dead_band_is_compensated(sign, force):
    found = evaluate(PARAMETERS, DERIVED, wanted((0.0, 0.0, sign * force, 0.0, 0.0, 0.0)))
    assert found.command[4:] == pytest.approx((-sign * 0.07,) * 4, abs=1e-4)
    assert found.tau_attained[2] == pytest.approx(sign * force, rel=1e-6)


@pytest.mark.parametrize("arm", [0.0, 1e-12, 1e-4])
def test_thrusters_that_do_not_reach_all_directions_are_refused(arm):
    """Without a thruster ahead or below, nothing gives pitch; nor two equal rows of B both."""
    check(LAYOUT)
    level = LAYOUT._replace(x=LAYOUT.x * arm, z=LAYOUT.z * 0.0)
    alike = LAYOUT._replace(e_y=LAYOUT.e_x, e_x=LAYOUT.e_x)
    for layout in (level, alike):
        with pytest.raises(Refusal, match="do not reach all six directions"):
            check(layout)
