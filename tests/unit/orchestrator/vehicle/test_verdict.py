"""The verdict on a run says what its indices say, and no more."""

from __future__ import annotations

from math import nan

import pytest

from orchestrator.vehicle.verdict import verdict

ACTUATORS = ("u", "q", "r")
CALM = {"saturated_fraction": (0.0, 0.0, 0.0)}


def tracking(x: float, settled: float | None = None, **more: tuple[float, ...]) -> dict:
    """Indices of a vehicle with an error along x only."""
    times = {} if settled is None else {"time_to_settle": (settled,)}
    return {"final_error": (x, 0.0, 0.0), **times, **more}


@pytest.mark.parametrize(
    ("vehicles", "apart", "text"),
    [
        ([{}], nan, ""),
        ([CALM], nan, "no saturation"),
        # Times and lengths are rounded up: an error of 5.21 cm is not within 5.2 cm.
        (
            [tracking(0.0521, 9.74, **CALM)], nan,
            "within 1 m of the reference from 9.8 s on, within 5.3 cm at the end, no saturation",
        ),
        (
            [tracking(0.0009, 0.0)], nan,
            "within 1 m of the reference from the start, within 0.9 mm at the end",
        ),
        ([tracking(25.53)], nan, "up to 26 m from the reference at the end"),
        (
            [{"saturated_fraction": (0.8053, 0.9999, 1e-5)}], nan,
            "saturation in 81 % (u), 99 % (q), under 0.1 % (r) of the steps",
        ),
        # The worst of several vehicles; distances are rounded down.
        (
            [tracking(0.3, 3.0), tracking(0.2, 4.0)], 4.39,
            "all within 1 m of their references from 4 s on, within 30 cm at the end, vehicles at "
            "least 4.3 m apart",
        ),
        (
            [tracking(0.3, 3.0), tracking(7.0)], nan,
            "1 of 2 vehicles up to 7 m from their references at the end",
        ),
        ([tracking(0.3, 3.0), CALM], nan, ""),
    ],
)  # fmt: skip
def test_a_verdict_is_true_and_short(vehicles, apart, text):
    assert verdict(vehicles, ACTUATORS, apart) == text
