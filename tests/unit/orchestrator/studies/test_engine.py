"""Runs of studies with FMUs."""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import threading

import pytest

from orchestrator import simulate
from orchestrator.studies.columns import Point
from orchestrator.studies.engine import FmuEngine, outcomes_of
from support.runs import prepared

CHANGES = {"plant.eta0.y": 3.0, "controller.eps_t": 2.0, "plant.noise.seed": 7}


@pytest.fixture(scope="module")
def engine():
    return FmuEngine({name: prepared(name) for name in ("fig5", "fig5-pd")})


@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("scenario", ["fig5", "fig5-pd"])
def test_an_outcome_equals_the_run_by_simulate(engine, scenario, order):
    [outcome] = outcomes_of(engine, [Point(3, scenario, CHANGES, 6.0, 0.015, order)])
    alone = simulate(
        scenario, CHANGES, stop_time=6.0, step=0.015, order=order, kind="native", loop="python"
    )
    assert (outcome.number, outcome.failure) == (3, None)
    metrics = alone.metrics()
    for name, value in outcome.indices.items():
        group, _, member = name.partition(".")
        if member:
            members = "xyz" if group == "final_error" else "uqr"
            assert value == metrics[group][members.index(member)], name
    for i in range(1, 5):
        assert (
            outcome.indices[f"theta_hat_end[{i}]"]
            == alone.step_values(f"controller.theta_hat[{i}]")[-1]
        )


def test_failure_is_an_outcome_and_the_next_run_is_made(engine):
    fine = Point(2, "fig5", {}, 1.0, 0.02)
    refused = Point(0, "fig5", {"plant.ell": -1.0}, 1.0, 0.02)
    stopped = Point(1, "fig5", {"plant.nu0.u": 1e60, "plant.nu0.r": 1e60}, 1.0, 0.02)
    no_time = Point(3, "fig5", {}, 0.0, 0.02)
    runs = [refused, stopped, fine, no_time, fine]
    first, second, third, fourth, last = outcomes_of(engine, runs)
    assert [first.number, second.number, third.number, fourth.number] == [0, 1, 2, 3]
    assert "plant.ell = -1.0: must be at least" in first.failure
    assert second.failure.startswith("stopped at t = 0")
    assert "must be positive" in fourth.failure
    assert first.indices == second.indices == fourth.indices == {}
    assert third.failure is None
    assert last == third


def test_fmus_travel_with_the_engine(tmp_path, native):
    for name in ("ObserverController", "AuvPlant"):
        shutil.copy(native / f"{name}.fmu", tmp_path)
    (tmp_path / "own.toml").write_text(
        '[components]\nplant = "AuvPlant.fmu"\ncontroller = "ObserverController.fmu"\n'
    )
    engine = FmuEngine({"own": prepared(tmp_path / "own.toml")})
    sent = pickle.dumps(engine)
    shutil.rmtree(tmp_path)
    runs = [Point(0, "own", CHANGES, 1.0, 0.02)]
    arrived = pickle.loads(sent)
    [outcome] = outcomes_of(arrived, runs)
    assert outcome.failure is None
    assert [outcome] == list(outcomes_of(FmuEngine({"own": prepared("fig4")}), runs))
    # An engine that was unpickled can be pickled.
    assert list(outcomes_of(pickle.loads(pickle.dumps(arrived)), runs)) == [outcome]
    assert arrived.digest == pickle.loads(sent).digest


def test_an_interrupt_is_not_a_failure(engine):
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        list(outcomes_of(engine, [Point(i, "fig5", {}, 1e5, 0.02) for i in range(2)]))
    timer.join()
