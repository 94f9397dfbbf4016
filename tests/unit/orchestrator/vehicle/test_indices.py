"""The indices of a run of a study."""

from __future__ import annotations

from functools import partial
from math import exp, log, pi, sqrt

import numpy as np
import pytest

from orchestrator import simulate as run
from orchestrator.figures.study_values import Values
from orchestrator.master.experiment import Experiment
from orchestrator.master.loop import chosen
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.simulation import simulate
from orchestrator.runs.preparation import loaded
from orchestrator.studies.fmu_engine import FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.store import StudyResult, store
from orchestrator.studies.study import study_of
from orchestrator.system.names import port_name
from orchestrator.vehicle import indices as table_of_indices
from orchestrator.vehicle.indices import Fold, Index, Indices, index_columns, largest
from orchestrator.vehicle.signals import AXES, EULER, Loop

T, H, ELL = 10.0, 0.02, 0.35

#: Signals over time, in the plane of zero attitude: y is eta + (ell, 0, 0).
SIGNALS = {
    "plant.eta.x": lambda t: 10.0 * np.exp(-t) - ELL + np.cos(t),
    "plant.eta.y": np.sin,
    "plant.eta.z": lambda t: 0.0 * t,
    **{f"plant.eta.{angle}": lambda t: 0.0 * t for angle in EULER},
    "planner.y_d.x": np.cos,
    "planner.y_d.y": np.sin,
    "planner.y_d.z": lambda t: 0.0 * t,
    "plant.dy.x": lambda t: 3.0 * np.cos(t),
    "plant.dy.y": lambda t: 4.0 * np.cos(t),
    "plant.dy.z": lambda t: 0.0 * t,
    "plant.nu.v": lambda t: 3.0 * t / T,
    "plant.nu.w": lambda t: -4.0 * t / T,
    # A controller is sampled: a row holds what it made of the instant a step before.
    "controller.dy_hat.x": lambda t: 3.0 * np.cos(t - H) + np.sin(2.0 * pi * (t - H)),
    "controller.dy_hat.y": lambda t: 4.0 * np.cos(t - H),
    "controller.dy_hat.z": lambda t: 0.0 * t + 2.0,
    **{f"controller.theta_hat[{i}]": lambda t, i=i: i * t for i in range(1, 5)},
}
TIME = H * np.arange(round(T / H) + 1)


def indices(signals=SIGNALS, blocks=1):
    header = Header(tuple(signals), Experiment(T, H), {port_name("plant.ell"): ELL})
    rows = np.column_stack([TIME, *(signal(TIME) for signal in signals.values())])
    observer = Indices()
    observer.begin(header)
    for block in np.array_split(rows, blocks):
        observer.take(block)
    observer.end(Ending())
    return observer.values()


def test_indices_of_signals_that_are_known():
    found = indices()
    # 10 exp(-t) is one metre at t = log 10, between two rows.
    assert log(10.0) < found.pop("time_to_reach") < log(10.0) + H
    expected = {
        "final_error.x": 10.0 * exp(-5.0),
        "final_error.y": 0.0,
        "final_error.z": 0.0,
        "late_error": 10.0 * exp(-0.5 * T),
        # Whole periods of the sine, and two in z.
        "estimate_error": sqrt(0.5 + 4.0),
        **{f"theta_hat_half[{i}]": 0.5 * T * i for i in range(1, 5)},
        **{f"theta_hat_end[{i}]": T * i for i in range(1, 5)},
        "largest_speed": 5.0,
        "largest_drift": 5.0,
    }
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("blocks", [2, 7, 251, len(TIME)])
def test_blocks_in_which_rows_come_change_nothing(blocks):
    assert indices(blocks=blocks) == indices()


@pytest.mark.parametrize(
    ("group", "without"),
    [
        (
            "controller.theta_hat",
            [name for name in index_columns() if name.startswith("theta_hat")],
        ),
        ("controller.dy_hat", ["estimate_error"]),
        ("plant.nu", ["largest_drift"]),
        ("planner", ["late_error", "time_to_reach", *(f"final_error.{axis}" for axis in AXES)]),
    ],
)
def test_what_a_system_has_no_ports_for_is_not_there(group, without):
    rest = {name: signal for name, signal in SIGNALS.items() if not name.startswith(group)}
    assert indices().keys() - indices(rest).keys() == set(without)


def test_what_is_never_reached_is_not_there():
    away = {**SIGNALS, "plant.eta.z": lambda t: 0.0 * t + 1.01}
    assert indices().keys() - indices(away).keys() == {"time_to_reach"}


def test_closed_loop_has_all_of_them():
    _, system = loaded("fig4", "native")
    experiment, observer = Experiment(4.0, 0.02), Indices()
    simulate(system, experiment, [observer], loop=chosen("auto", experiment))
    found = observer.values().keys()
    assert set(index_columns()) - {"time_to_reach"} <= found <= set(index_columns())


def test_a_new_index_is_one_entry(monkeypatch, tmp_path):
    """It is in metrics.json, in the table of a study, and in the labels of its figures."""
    pytest.importorskip("pyarrow", reason="needs the extra studies")
    depth = Index(
        "largest_depth",
        "largest depth",
        {"": "m"},
        "largest z of the centre of mass",
        Loop.for_control_point,
        partial(Fold, lambda rows: rows.at(rows.loop.position[2]), largest),
        is_metric=True,
    )
    monkeypatch.setattr(table_of_indices, "INDICES", (*table_of_indices.INDICES, depth))
    result = run("fig4", {"plant.nu0.w": 1.0}, stop_time=1.0, kind="native")
    deepest = result["plant.eta.z"].max()
    assert deepest > 0.1
    assert result.metrics()["largest_depth"] == deepest

    study = {"scenario": "fig4", "stop_time": 1.0, "vary": {"plant.nu0.w": [1.0]}}
    space = Space(study_of("own", study), {"fig4": loaded("fig4", "native")})
    with store(tmp_path, {"made_of": {}, "runs": 1}, space.indices) as kept:
        kept.add(list(FmuEngine(space.prepared).outcomes([space[0]])))
        kept.publish(space)
    made = StudyResult(tmp_path)
    assert made["largest_depth"].tolist() == [deepest]
    assert Values(made).label("largest_depth") == "largest depth [m]"
