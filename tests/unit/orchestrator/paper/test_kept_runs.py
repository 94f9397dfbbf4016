"""Runs, their commands, and what is kept of them."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.paper.claims import CLAIMS
from orchestrator.paper.effects import EFFECTS
from orchestrator.paper.kept_runs import KeptRuns, key_of
from orchestrator.paper.sections import as_request
from orchestrator.runs.preparation import prepare_request, with_companion
from orchestrator.runs.request import Request
from support.runs import InThisProcess

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
    ],
)  # fmt: skip
def test_label_is_what_the_user_types(run, label):
    assert run.command_line == label


def companions(run):
    own, *rest = with_companion(prepare_request(run), run)
    return [as_request(one, own, run) for one in rest]


def test_a_companion_that_changes_nothing_is_the_scenario_itself():
    assert companions(Request("fig5")) == [Request("fig5-pd")]
    assert companions(Request("fig4")) == []


def test_what_is_set_goes_for_the_companion_too():
    [companion] = companions(Request("fig5", {"controller.eps_t": 1.0, "controller.k_d": 40.0}))
    assert companion == Request("fig5-pd", {"controller.eps_t": 1.0})
    assert companions(Request("fig5", order="jacobi")) == [Request("fig5-pd", order="jacobi")]


def test_a_scenario_and_its_companion_are_run_as_it_says(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(
        'compare = "fig5-pd"\norder = "jacobi"\nstop_time = 1.0\n[steps]\ncontroller = 0.2\n'
    )
    run = Request(str(own))
    [companion] = companions(run)
    for one in (prepare_request(run), prepare_request(companion)):
        assert one.experiment.order == "jacobi"
        assert one.system.steps == {"controller": 0.2}
    [as_one] = with_companion(prepare_request(run), run)[1:]
    assert prepare_request(companion).identity == as_one.identity
    assert companion.command_line == (
        "fig5-pd --stop-time 1 --order jacobi --set planner.eta0.z=-2 (steps: controller = 0.2 s)"
    )


def test_keys_tell_what_is_run_and_not_how_it_is_called(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_text('title = "Another"\nstop_time = 100.0\n')
    slow = tmp_path / "slow.toml"
    slow.write_text("stop_time = 100.0\n[steps]\ncontroller = 0.2\n")
    key = key_of(prepare_request(Request("fig4")))
    assert key_of(prepare_request(Request("fig4", {"plant.noise.std": 0.001}))) == key
    assert key_of(prepare_request(Request(str(copy), {"plant.noise.std": 0.001}))) == key
    others = [
        QUIET,
        Request("fig4", order="jacobi"),
        Request("fig4", stop_time=50.0),
        Request("fig4", step=0.01),
        Request("fig5"),
        Request("fig5-pd"),
        Request(str(slow)),
    ]
    assert len({key, *(key_of(prepare_request(run)) for run in others)}) == 1 + len(others)


def test_equal_runs_are_made_once_and_used_again(tmp_path):
    runs = [QUIET, Request("fig4", {"plant.noise.std": 0.001}), Request("fig4"), QUIET]
    first, crew = KeptRuns(tmp_path / "runs", stop_time=0.1), InThisProcess()
    first.make(runs, crew)
    assert len(crew.done) == 2
    assert first[runs[1]] is first[runs[2]]
    assert first.label(runs[1]) == "fig4 --stop-time 0.1"
    assert len(first[QUIET].table) == 6
    assert first[QUIET].metrics["stop_time"] == 0.1

    again, idle = KeptRuns(tmp_path / "runs", stop_time=0.1), InThisProcess()
    again.make(runs, idle)
    assert idle.done == []
    made, read = first[QUIET], again[QUIET]
    assert read.metrics == made.metrics
    assert read.table.columns == made.table.columns
    assert read.table.parameters == made.table.parameters
    np.testing.assert_array_equal(read.table.rows, made.table.rows)


def test_a_file_that_was_changed_is_refused(tmp_path):
    KeptRuns(tmp_path, 0.1).make([QUIET], InThisProcess())
    [file] = tmp_path.glob("*.npz")
    before = file.read_bytes()
    file.write_bytes(before[:100])
    crew = InThisProcess()
    with pytest.raises(InputError, match=rf"{file.name} is not a file that auv-fmu wrote"):
        KeptRuns(tmp_path, 0.1).make([QUIET], crew)
    assert file.read_bytes() == before[:100]
    kept_runs = KeptRuns(tmp_path, 0.1, force=True)
    kept_runs.make([QUIET], crew)
    assert len(crew.done) == 1
    assert kept_runs[QUIET].failure is None
    assert file.with_name(f"{file.name}.~1~").read_bytes() == before[:100]


def test_what_no_run_needs_is_forgotten(tmp_path):
    KeptRuns(tmp_path, 0.1).make([QUIET], InThisProcess())
    (tmp_path / "0123.npz").write_bytes(b"mine")
    kept_runs = KeptRuns(tmp_path, 0.2)
    kept_runs.make([QUIET], InThisProcess())
    assert len(list(tmp_path.glob("*.npz"))) == 3
    kept_runs.forget_others()
    assert len(list(tmp_path.glob("*.npz"))) == 2
    assert (tmp_path / "0123.npz").read_bytes() == b"mine"


def test_a_run_that_cannot_be_made_says_why(tmp_path):
    broken = Request("fig4", {"plant.noise.sdt": 0.0})
    kept_runs, crew = KeptRuns(tmp_path), InThisProcess()
    kept_runs.make([broken], crew)
    assert crew.done == []
    assert "did you mean noise.std" in kept_runs[broken].failure
    assert kept_runs.label(broken) == "fig4 --set plant.noise.sdt=0"
    assert len(kept_runs[broken].table) == 0


def test_every_run_of_claims_and_effects_can_be_made():
    for run in {run for each in (*CLAIMS, *EFFECTS) for run in each.runs}:
        prepare_request(run)
