"""Values that figures show, held against loops over the runs."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.figures.study_values import Values, bins_of, grouped, is_known, is_logarithmic
from orchestrator.vehicle.indices import index_columns

N = 6


def columns(**changes):
    """Six runs of two scenarios: one fails, one is far off, one saturates."""
    made = {name: np.zeros(N) for name in index_columns()}
    made |= {
        "scenario": np.array(["fig5", "fig5-pd"] * 3, dtype=object),
        "controller.k_d": np.array([10.0, np.nan, 20.0, np.nan, 30.0, np.nan]),
        "step": np.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]),
        "late_error": np.array([0.5, np.nan, 1.0, 1.5, 0.1, 0.2]),
        "saturated_fraction.q": np.array([0.0, np.nan, 0.0, 0.0, 0.25, 0.0]),
        "failure": np.array([None, "stopped", None, None, None, None], dtype=object),
    }
    return made | changes


@pytest.mark.parametrize(
    ("verdict", "true_of"), [("failed", [1]), ("lost", [1, 3]), ("saturated", [4])]
)
def test_verdicts_are_those_of_each_run(verdict, true_of):
    assert np.flatnonzero(Values(columns())[verdict]).tolist() == true_of


def test_values_are_made_of_columns():
    peaks = {f"peak_command.{k}": np.random.default_rng(i).random(N) for i, k in enumerate("uqr")}
    values = Values(columns(**peaks))
    norm = values["|peak_command.u, peak_command.q|"]
    for i in range(N):
        u, q, r = (peaks[f"peak_command.{k}"][i] for k in "uqr")
        assert values["peak_command"][i] == max(u, q, r)
        assert norm[i] == pytest.approx((u * u + q * q) ** 0.5, rel=1e-15)
        assert values["peak_command.u * step"][i] == u * values["step"][i]


@pytest.mark.parametrize(
    ("value", "known"),
    [
        ("step", True),
        ("theta_hat_end", True),
        ("lost", True),
        ("controller.k_d * step", True),
        ("|final_error.x, final_error.y|", True),
        ("stop", False),
        ("step * stop", False),
        ("|final_error.x, final_error.u|", False),
        ("final", False),
    ],
)
def test_only_what_runs_have_is_known(value, known):
    assert is_known(value, tuple(columns())) is known


def test_runs_that_lack_a_value_are_a_part_of_their_own():
    legends = {"fig5": "proposed", "fig5-pd": "PD"}
    parts = dict(Values(columns(), legends=legends).parts(["scenario", "controller.k_d"]))
    assert list(parts) == [
        "proposed, controller.k_d 10", "PD", "proposed, controller.k_d 20",
        "proposed, controller.k_d 30",
    ]  # fmt: skip
    assert parts["PD"]["step"].tolist() == [0.02, 0.04, 0.06]
    [(name, everything)] = Values(columns()).parts([])
    assert name == ""
    assert len(everything["step"]) == N


def test_where_keeps_what_fits():
    values = Values(columns()).where({"scenario": "fig5", "controller.k_d": 20.0})
    assert values["step"].tolist() == [0.03]
    assert len(Values(columns()).where({})["step"]) == N


@pytest.mark.parametrize(
    ("value", "label"),
    [
        ("peak_command.q", "peak command q [N·m]"),
        ("late_error", "largest late error [m]"),
        ("theta_hat_end[2]", r"$\hat{\theta}_2$, estimate at the end [kg/s]"),
        ("controller.k_d * step", "$k_{d}$ [1/s] · step"),
        ("failed", "share of failed runs"),
        ("my.parameter", "my.parameter"),
    ],
)
def test_labels_name_the_unit(value, label):
    values = Values(columns(), {"controller.k_d": "k_d [1/s]"})
    assert values.label(value) == label
    assert values.name(value) == label.rsplit(" [", 1)[0] or " · " in label


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.geomspace(1.0, 20.0, 50), True),
        (np.geomspace(1.0, 9.0, 50), False),
        ([0.0, *np.geomspace(1.0, 20.0, 50)], False),
        ([-1.0, 20.0], False),
        ([1e-9, *np.linspace(5.0, 20.0, 50)], False),
        ([1.0, np.nan, 100.0], True),
        ([np.nan], False),
    ],
)
def test_axis_is_logarithmic_where_a_linear_one_would_hide_most(values, expected):
    assert is_logarithmic(np.array(values)) is expected


@pytest.mark.parametrize("grid", [np.geomspace(0.5, 64.0, 7), np.linspace(-3.0, 5.0, 4), [2.0]])
def test_each_value_of_a_grid_has_a_bin(grid):
    bins = bins_of(np.repeat(grid, 3), 24)
    np.testing.assert_allclose(bins.centres, grid, rtol=1e-12)
    assert bins.places(np.array(grid)).tolist() == list(range(len(grid)))
    assert all(np.diff(bins.edges) > 0.0)


def test_axis_of_a_log_spaced_value_is_logarithmic_however_narrow():
    narrow = np.random.default_rng(4).uniform(1.0, 3.0, 100)
    assert bins_of(narrow, 10, is_wide=True).is_logarithmic
    assert not bins_of(narrow, 10).is_logarithmic
    assert bins_of(np.geomspace(1.0, 3.0, 5), 10).is_logarithmic
    assert not bins_of(np.linspace(1.0, 3.0, 5), 10).is_logarithmic


def test_parameters_have_the_units_of_their_fmus():
    values = Values(columns(), units={"controller.k_d": "1/s", "plant.m11": "kg.m2"})
    assert values.label("controller.k_d") == "controller.k_d [1/s]"
    assert values.where({}).label("plant.m11") == "plant.m11 [kg·m²]"


def test_bins_of_anything_else_are_equally_wide_or_equally_full():
    values = np.random.default_rng(1).lognormal(0.0, 2.0, 1000)
    full = bins_of(values, 10, are_full=True)
    assert full.is_logarithmic
    assert np.bincount(full.places(values)).tolist() == [100] * 10
    wide = bins_of(values, 10)
    np.testing.assert_allclose(np.diff(np.log(wide.edges)), np.ptp(np.log(values)) / 10)


def test_groups_are_the_finite_values_of_each_bin():
    random = np.random.default_rng(2)
    places, values = random.integers(0, 5, 40), random.normal(size=40)
    values[::7] = np.nan
    places[places == 3] = 4
    for place, group in enumerate(grouped(places, values, 6)):
        expected = [v for p, v in zip(places, values, strict=True) if p == place and np.isfinite(v)]
        assert sorted(group) == sorted(expected)
