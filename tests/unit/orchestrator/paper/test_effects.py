"""Effects in words and figures, from runs whose numbers are known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.cosim import Table
from orchestrator.paper import effects
from orchestrator.paper.claims import KeptRun
from orchestrator.paper.effects import EFFECTS, LAMBDAS, NOISE_LEVELS, STEPS, show_effect
from orchestrator.paper.report import make_runs
from support.runs import InThisProcess
from support.texts import tells


@pytest.fixture(scope="module")
def tables() -> dict[str, list[Table]]:
    """The first steps of the runs of each effect."""
    runs = make_runs([run for effect in EFFECTS for run in effect.runs], InThisProcess(), 0.2)
    return {effect.name: [runs[run].table for run in effect.runs] for effect in EFFECTS}


def made(tables, *metrics):
    return [KeptRun(values, table) for values, table in zip(metrics, tables, strict=True)]


def test_names_differ():
    assert len({effect.name for effect in EFFECTS}) == len(EFFECTS)


@pytest.mark.parametrize(
    ("name", "metrics", "numbers"),
    [
        (
            "effect-disturbance",
            [{"final_error": (0, i / 10, 0), "peak_command": (60 + i, 20, 20)} for i in (1, 2, 3)],
            [(0.1, 0.2, 0.3), (61, 62, 63)],
        ),
        (
            # 5 is the figure.
            "effect-jacobian",
            [
                {"saturated_fraction": (0.0, 0.0, 0.0), "final_error": (1.0, 2.0, 3.0)},
                {"saturated_fraction": (0.1, 0.25, 0.0), "final_error": (4.0, 5.0, 6.0)},
            ],
            [(25, 5, 4, 5, 6, 0, 1, 2, 3)],
        ),
        (
            "effect-order",
            [{"total_variation": (i, i, i)} for i in (1.0, 2.0, 3.0, 136.0)],
            [(1, 1, 1, 2, 2, 2), (3, 3, 3, 136, 136, 136)],
        ),
        (
            "effect-saturation",
            [
                {"l2_effort": (1.0, 2.0, 3.0), "final_error": (0.1, 0.2, 0.3)},
                {"l2_effort": (4.0, 5.0, 6.0), "final_error": (0.4, 0.5, 0.6)},
            ],
            [(1, 2, 3, 4, 5, 6), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)],
        ),
    ],
)
def test_the_text_has_the_numbers(tables, name, metrics, numbers):
    [effect] = [effect for effect in EFFECTS if effect.name == name]
    assert tells(effect.show(*made(tables[name], *metrics))[0], *numbers)


def test_step(tables):
    """The proposed controller moves by 5 %; tau_q of the PD controller falls from 8 to 5."""
    proposed = [{"l2_effort": (100.0 - 5.0 * (i > 0), 1.0, 2.0)} for i in range(len(STEPS))]
    pd = [{"l2_effort": (9.0, 8.0 - i, 7.0)} for i in range(len(STEPS))]
    exact = {"l2_effort": (9.0, 4.25, 7.0)}
    text, figure = effects.step(*made(tables["effect-step"], *proposed, *pd, exact))
    assert tells(text, (4.25, 20), (8, 7, 6, 5), (5,))
    [line, *_] = figure.axes[0].lines
    assert dict(zip(*line.get_data(), strict=True)) == {
        0.02: 100.0,
        0.01: 95.0,
        0.005: 95.0,
        0.002: 95.0,
    }


def test_noise(tables):
    def metrics(level):
        # 1 mm: peaks of 1; 1 cm: peaks of 10.
        values = tuple(level * 1e3 * np.ones(3) + 1e-9)
        return {"l2_effort": values, "peak_command": values, "saturated_fraction": (0.0, level, 0)}

    text, figure = effects.noise(*made(tables["effect-noise"], *map(metrics, NOISE_LEVELS)))
    assert tells(text, (1, 1, 1, 1, 10, 10, 10, 1)), "1 cm, and 1 % of the steps"
    [line, *_] = figure.axes[0].lines
    np.testing.assert_allclose(line.get_xdata(), line.get_ydata(), atol=1e-8)


def test_condition_30(tables):
    """A peak of 10 lambda, and an error of 1 / lambda."""
    runs = [
        {
            "peak_command": (10.0 * value, value, value),
            "final_error": (1.0 / value,) * 3,
            "saturated_fraction": (0.0, 0.01 * value, 0.0),
        }
        for value in LAMBDAS
    ]
    text, figure = effects.condition_30(*made(tables["effect-lambda"], *runs))
    assert tells(text, (10, 1, 1, 1, 21, 2.1), (2.1, 1, 1, 1, 0.476))
    [line, *_] = figure.axes[0].lines
    np.testing.assert_allclose(line.get_ydata(), 10.0 * line.get_xdata())


def test_certificates(tables):
    [table] = tables["certificates"]
    figure = effects.certificates_along_a_run(KeptRun({}, table))[1]
    # A value for each step: at t = 0 the margin is 80 minus the command.
    u, *_ = figure.axes[2].lines
    assert len(u.get_xdata()) == len(table) - 1
    assert u.get_ydata()[0] == pytest.approx(80.0 - abs(table.step_values("plant.tau.u")[0, 0]))


def test_an_effect_is_drawn_or_says_why_not(tables, tmp_path):
    [table] = tables["certificates"]
    text = show_effect("certificates", [KeptRun({}, table)], tmp_path)
    assert f"({tmp_path.name}/certificates.png)" in text
    assert (tmp_path / "certificates.png").stat().st_size > 10_000
    failed = [KeptRun({"failure": "the sea is dry"}, table)]
    assert show_effect("certificates", failed, tmp_path).endswith("the sea is dry")
