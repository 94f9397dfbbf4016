"""Warnings after a run, against the pitch integrated from its rows."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.vehicle.cautions import VERTICAL, Watch

FIVE = {"plant.roll": False, "plant.noise.std": 0.0}


def pitch(result):
    """Integrate the pitch of (1), whose rate is q, by Euler's scheme with a step for each row."""
    q = result["plant.nu.q"]
    return np.concatenate(([0.0], 0.02 * np.cumsum(q[:-1])))


@pytest.mark.parametrize(
    ("scenario", "parameters", "stop_time"),
    [
        ("fig5", FIVE, 20.0),
        ("fig5-pd", FIVE, 20.0),
        ("fig5-pd", {}, 20.0),
        ("fig4", FIVE, 40.0),
        ("fig5-pd", FIVE, 0.5),
    ],
)
def test_passing_the_vertical_without_roll_is_reported(scenario, parameters, stop_time):
    result = simulate(scenario, parameters, stop_time=stop_time, kind="native")
    beyond = pitch(result) > np.pi / 2
    watch = Watch()
    watch.begin(result.header)
    watch.take(result.rows)
    texts = [caution.text for caution in watch.found() if caution.kind == VERTICAL]
    if "plant.roll" in parameters and beyond.any():
        time = result.time[beyond.argmax()]
        [line] = texts
        assert f"by t = {time:g} s, where (1) has a pole" in line and "plant.roll" in line
    else:
        assert not texts
    assert beyond.any() == (scenario != "fig4" and stop_time > 1.0)
