"""Runs of the report, their commands, and what is kept of them."""

from __future__ import annotations

import pytest

from orchestrator.paper.claims import CLAIMS
from orchestrator.paper.effects import EFFECTS
from orchestrator.paper.kept_runs import Companion, KeptRuns
from orchestrator.runs.preparation import prepare_request
from orchestrator.runs.request import Request
from support.runs import PD, InThisProcess

QUIET = Request("fig4", {"plant.noise.std": 0.0})


@pytest.mark.parametrize(
    ("run", "label"),
    [
        (Request("fig4"), "fig4"),
        (QUIET, "fig4 --set plant.noise.std=0"),
        (Request("fig5", {"controller.printed_jacobian": True}),
         "fig5 --set controller.printed_jacobian=true"),
        (Request("fig4", {"plant.noise.std": 1.23456789e-05}),
         "fig4 --set plant.noise.std=1.23456789e-05"),
        (Request("my file.toml", order="jacobi", stop_time=2.5, step=0.01),
         "'my file.toml' --stop-time 2.5 --step 0.01 --order jacobi"),
        (Request("fig4", events="fig6", steps={"controller": 0.2}),
         "fig4 --events fig6 (steps: controller = 0.2 s)"),
        (Request("fig4", events=[{"at": 1.0, "set": {"plant.noise.std": 0.0}}], loop="python"),
         "fig4 --loop python (events: {'at': 1.0, 'set': {'plant.noise.std': 0.0}})"),
        (Request("fig4", events=[]), "fig4 (events: none)"),
    ],
)  # fmt: skip
def test_label_is_what_the_user_types_and_what_has_no_option(run, label):
    assert run.label == label


def test_a_companion_is_made_by_the_command_of_its_scenario(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text('order = "jacobi"\nstop_time = 0.1\n[steps]\ncontroller = 0.2\n' + PD)
    own, companion = Request(str(own)), Companion(str(own))
    kept_runs = KeptRuns([own, companion], InThisProcess())
    assert kept_runs.label(companion) == f"{own.label} (its companion)"
    assert kept_runs[companion].metrics["scenario"] == "pd"
    assert "velocities_reaching_controller" in kept_runs[companion].metrics
    for run in (own, companion):
        assert kept_runs[run].metrics["order"] == "jacobi"
        assert kept_runs[run].table.header.experiment.stop_time == 0.1


def test_a_companion_that_is_a_scenario_as_well_is_called_like_it():
    companion = Companion("fig5")
    kept_runs = KeptRuns([companion, Request("fig5-pd")], InThisProcess(), stop_time=0.1)
    assert kept_runs.labels == ["fig5-pd --stop-time 0.1"]
    assert kept_runs[companion] is kept_runs[Request("fig5-pd")]


def test_equal_runs_are_made_once(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_text('title = "Another"\nstop_time = 100.0\n')
    slow = tmp_path / "slow.toml"
    slow.write_text("stop_time = 100.0\n[steps]\ncontroller = 0.2\n")
    default = {"plant.noise.std": 0.001}
    equal = [Request("fig4"), Request("fig4", default), Request(str(copy), default)]
    others = [
        QUIET,
        Request("fig4", order="jacobi"),
        Request("fig4", step=0.01),
        Request("fig5"),
        Request("fig5-pd"),
        Request(str(slow)),
    ]
    crew = InThisProcess()
    kept_runs = KeptRuns([*others, *equal, QUIET], crew, stop_time=0.1)
    assert len(crew.done) == 1 + len(others)
    assert kept_runs[equal[0]] is kept_runs[equal[1]] is kept_runs[equal[2]]
    assert kept_runs.label(equal[1]) == "fig4 --stop-time 0.1"
    assert len(kept_runs[QUIET].table) == 6
    assert kept_runs[QUIET].metrics["stop_time"] == 0.1


def test_a_run_that_cannot_be_made_says_why():
    broken, crew = Request("fig4", {"plant.noise.sdt": 0.0}), InThisProcess()
    kept_runs = KeptRuns([broken], crew)
    assert crew.done == []
    assert "did you mean noise.std" in kept_runs[broken].failure
    assert kept_runs.label(broken) == "fig4 --set plant.noise.sdt=0"
    assert len(kept_runs[broken].table) == 0


def test_every_run_of_claims_and_effects_can_be_made():
    for run in {run for each in (*CLAIMS, *EFFECTS) for run in each.runs}:
        prepare_request(run)
