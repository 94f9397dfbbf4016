"""Values that figures show, compared with loops over the runs."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.figures.study_values import Values, is_known
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
def test_a_verdict_is_true_of_the_right_runs(verdict, true_of):
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
def test_a_value_is_known_if_runs_have_its_columns(value, known):
    assert is_known(value, tuple(columns())) is known


def test_runs_without_a_value_are_a_part():
    legends = {"fig5": "proposed", "fig5-pd": "PD"}
    values = Values(columns(), legends=legends)
    texts, places = values.parts(["scenario", "controller.k_d"])
    assert texts == [
        "proposed, controller.k_d 10", "PD", "proposed, controller.k_d 20",
        "proposed, controller.k_d 30",
    ]  # fmt: skip
    assert values["step"][places == texts.index("PD")].tolist() == [0.02, 0.04, 0.06]
    texts, places = values.parts([])
    assert (texts, places.tolist()) == ([""], [0] * N)


def test_where_keeps_runs_with_the_values():
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


def test_parameters_have_the_units_of_their_fmus():
    values = Values(columns(), units={"controller.k_d": "1/s", "plant.m11": "kg.m2"})
    assert values.label("controller.k_d") == "controller.k_d [1/s]"
    assert values.where({}).label("plant.m11") == "plant.m11 [kg·m²]"
