"""Remarks on scenarios with random seas, links and noise are also true for other seeds."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.runs.scenario import read_scenario
from page_numbers import over_seeds
from support.tiers import slow

#: Medians over seeds, and what 5 % and 95 % are below, by scenario, controller (PD or not) and
#: number.
ERROR_FROM_25 = "error from 25 s to 120 s [m]"
EXPECTED = {
    ("sea", False): {
        "error from 60 s to 100 s [m]": (0.43, 0.23, 0.83),
        "peak command u [N]": (86, 63, 117),
    },
    ("sea", True): {
        "error from 60 s to 100 s [m]": (0.56, 0.26, 1.07),
        "peak command u [N]": (46, 35, 57),
    },
    ("formation-v", False): {ERROR_FROM_25: (0.27, 0.27, 0.27), "peak command u [N]": (74, 72, 77)},
    ("formation-v", True): {ERROR_FROM_25: (0.44, 0.44, 0.44), "peak command u [N]": (31, 31, 31)},
    ("formation-change", False): {ERROR_FROM_25: (0.39, 0.38, 0.39)},
    ("formation-change", True): {ERROR_FROM_25: (0.56, 0.56, 0.56)},
    ("formation-lost-link", False): {
        ERROR_FROM_25: (1.76, 1.70, 1.81),
        "error from 100 s to 120 s [m]": (0.12, 0.11, 0.22),
        "peak command u [N]": (404, 390, 441),
        "steps beyond the limits, u [%]": (9.6, 9.0, 10.1),
    },
    ("formation-lost-link", True): {
        ERROR_FROM_25: (2.23, 2.22, 2.28),
        "error from 100 s to 120 s [m]": (0.11, 0.08, 0.24),
        "peak command u [N]": (185, 183, 200),
        "steps beyond the limits, u [%]": (1.4, 1.3, 1.5),
    },
    ("remus", False): {
        "error from 120 s to 280 s [m]": (0.183, 0.182, 0.183),
        "steps beyond the limits, r [%]": (44, 44, 45),
    },
    ("remus-prestero", False): {
        "error from 50 s to 280 s [m]": (0.34, 0.32, 0.36),
        "steps beyond the limits, q [%]": (27, 26, 27),
        "steps beyond the limits, r [%]": (4, 4, 5),
    },
    ("bluerov", False): {
        "error from 20 s to 50 s [m]": (0.38, 0.38, 0.38),
        "peak command u [N]": (32, 32, 33),
    },
    ("bluerov", True): {
        "error from 20 s to 50 s [m]": (0.75, 0.75, 0.75),
        "peak command u [N]": (33, 33, 33),
    },
}

#: Half a unit of the last stated digit.
_ROUNDING = {"[m]": 0.0051, "[N]": 0.51, "[%]": 0.051}


#: All runs for the bands of two scenarios, whose seeds decide most; of the others a few.
RUNS = [
    ("sea", False, 3),
    *slow(*((*case, 60 if case[0] in ("sea", "formation-lost-link") else 3) for case in EXPECTED)),
]


@pytest.mark.parametrize(("scenario", "pd", "n"), RUNS)
def test_runs_with_other_seeds_are_within_the_bands_that_are_said(scenario, pd, n):
    """All bands to their last digit; a few runs lie within three times the band."""
    found = over_seeds(scenario, pd, n)
    for name, (middle, low, high) in EXPECTED[scenario, pd].items():
        others = found[name][1:]
        rounding = _ROUNDING[name.split()[-1]] * (10 if scenario.startswith("remus") else 1)
        if n == 60:
            actual = np.percentile(others, (50, 5, 95))
            assert actual == pytest.approx((middle, low, high), abs=rounding), name
        else:
            wide = high - low + 2 * rounding
            assert low - wide <= others.min() and others.max() <= high + wide, name
    if (scenario, n) == ("sea", 60):
        saturated = found["steps beyond the limits, u [%]"][1:] > 0
        assert np.mean(saturated) == pytest.approx(0.0 if pd else 0.62, abs=0.01)


def test_remarks_say_these_numbers():
    for scenario, wanted in {
        "sea": ("0.43 m (0.23 to 0.83 m", "0.56 m (0.26 to 1.07 m", "86 N", "46 N", "62 %"),
        "formation-v": ("0.27 m", "0.44 m", "74 N (72 to 77 N", "31 N"),
        "formation-change": ("(0.38 to 0.39 m", "0.56 m"),
        "remus-prestero": ("0.34 m at most (0.32 to 0.36 m", "0.30 m"),
        "bluerov": ("0.38 m", "0.75 m"),
        "formation-lost-link": (
            "1.76 m", "2.23 m", "0.12 m (0.11 to 0.22 m", "0.11 m (0.08 to 0.24 m", "404 N",
            "185 N", "9.6 %", "1.4 %",
        ),
    }.items():  # fmt: skip
        remark = read_scenario(scenario).remark
        for number in wanted:
            assert number in remark, (scenario, number)
