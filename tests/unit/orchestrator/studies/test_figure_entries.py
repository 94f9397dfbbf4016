"""Figures of a study file: what is wrong with one is said before any run."""

from __future__ import annotations

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.studies.figure_entries import read_figures

VARIED = {"plant.eta0.z": float, "controller.k_d": float, "controller.observer": str}


def plans(is_compared=True, **figures):
    return read_figures("mine.toml", figures, VARIED, is_compared)


def test_names_may_stand_alone_or_in_lists():
    figure = {"kind": "bands", "x": "plant.eta0.z", "show": ["late_error", "lost"]}
    labels = {"plant": {"eta0": {"z": "depth [m]"}}}
    [plan] = plans(far={**figure, "limits": {"late_error": 1.0}}, labels=labels)
    assert (plan.name, plan.x, plan.show) == ("far", ["plant.eta0.z"], ["late_error", "lost"])
    assert plan.limits == {"late_error": 1.0}
    assert plan.labels == {"plant.eta0.z": "depth [m]"}


def test_scenarios_are_told_apart_unless_the_file_says_otherwise():
    front = {"kind": "front", "x": "peak_command", "y": "late_error"}
    assert plans(f=front)[0].by == ["scenario"]
    assert plans(f={**front, "by": []})[0].by == []
    assert plans(is_compared=False, f=front)[0].by == []


def test_a_file_that_says_nothing_has_a_figure_of_all_numbers_that_vary():
    [plan] = plans()
    assert plan.kind == "influence"
    assert plan.x == ["plant.eta0.z", "controller.k_d"]
    assert read_figures("mine.toml", {}, {}, False) == ()


BANDS = {"kind": "bands", "x": "plant.eta0.z", "show": "late_error"}


@pytest.mark.parametrize(
    ("figure", "complaint"),
    [
        (
            {**BANDS, "show": "late_errors"},
            "show: runs have no number 'late_errors'; did you mean",
        ),
        ({**BANDS, "x": "plant.eta0.x"}, "x: runs have no number 'plant.eta0.x'"),
        ({**BANDS, "x": "controller.observer"}, "x: runs have no number 'controller.observer'"),
        ({**BANDS, "by": "controller.observe"}, "by: runs have no column 'controller.observe'"),
        ({**BANDS, "where": {"step": 0.1}}, "where: runs have no column 'step'"),
    ],
)
def test_mistakes_are_told_in_a_line(figure, complaint):
    with pytest.raises(InputError, match=f"^mine.toml: figures: f: .*{complaint}") as error:
        plans(f=figure)
    assert "\n" not in str(error.value)


def test_a_figure_is_named_as_a_file_can_be():
    with pytest.raises(InputError, match="is no name of a file"):
        plans(**{"../mine": BANDS})
