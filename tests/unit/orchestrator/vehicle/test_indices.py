"""(59), e_f and the indices of a study, on signals whose integrals are known."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from math import exp, log, pi, sqrt
from pkgutil import iter_modules

import numpy as np
import pytest

from fmus.language.build import Program
from fmus.ports.reducer import read_reducer
from orchestrator import simulate as run
from orchestrator.cosim import (
    Ending,
    Experiment,
    Header,
    PortName,
    Table,
    make_plan,
    simulate_plan,
)
from orchestrator.figures.study_values import Values
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies.engine import FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.store import StudyResult, open_store
from orchestrator.studies.study import study_of
from orchestrator.vehicle import index
from orchestrator.vehicle import indices as table_of_indices
from orchestrator.vehicle.indices import Index, Indices, index_columns, metrics_of
from orchestrator.vehicle.signals import AXES, EULER, STANDARD
from support import largest_depth
from support.tables import at_its_time

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
    "controller.dy_hat.x": lambda t: 3.0 * np.cos(t) + np.sin(2.0 * pi * t),
    "controller.dy_hat.y": lambda t: 4.0 * np.cos(t),
    "controller.dy_hat.z": lambda t: 0.0 * t + 2.0,
    # Outputs of a step have the time of its end.
    **{f"controller.theta_hat[{i}]": lambda t, i=i: i * (t + H) for i in range(1, 5)},
}
ESTIMATES = (*STANDARD.dy_hat, *STANDARD.theta_hat)
TIME = H * np.arange(round(T / H) + 1)


def table_with(signals=SIGNALS, order="feedthrough", more=()) -> Table:
    ends = dict.fromkeys(STANDARD.lower_limits, -2.0) | dict.fromkeys(STANDARD.upper_limits, 2.0)
    values = {STANDARD.ell: ELL, **ends, **dict(more)}
    parameters = {PortName.read(name): value for name, value in values.items()}
    header = Header(tuple(signals), Experiment(T, H, order), parameters)
    return Table.of(header, np.column_stack([TIME, *(signal(TIME) for signal in signals.values())]))


def indices_of(table: Table, blocks=1):
    observer = Indices()
    observer.begin(table.header)
    for block in np.array_split(table.rows, blocks):
        observer.take(block)
    observer.end(Ending())
    return observer.values()


def indices(signals=SIGNALS, blocks=1):
    return indices_of(table_with(signals), blocks)


def noise() -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Return noise for every signal of the indices, so that sums round."""
    random = np.random.default_rng(1)
    values = {
        name: random.normal(scale=3.0, size=len(TIME))
        for name in (*SIGNALS, *STANDARD.commanded, *STANDARD.applied)
    }
    return {name: lambda t, signal=signal: signal for name, signal in values.items()}


def test_indices_of_known_signals():
    found = indices()
    # 10 exp(-t) is one metre at t = log 10, between two rows.
    reached = found.pop("time_to_reach")
    assert log(10.0) < reached < log(10.0) + H
    assert found.pop("time_to_settle") == reached
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
def test_sizes_of_blocks_change_nothing(blocks):
    """Results are equal to the last bit, although sums round."""
    signals = noise()
    assert indices(signals).keys() >= set(index_columns()) - {"time_to_reach", "time_to_settle"}
    assert indices(signals, blocks) == indices(signals)


@pytest.mark.parametrize("blocks", [1, 7, len(TIME)])
def test_the_order_of_a_run_changes_nothing(blocks):
    """Results are equal to the last bit; in one order, values of the last row are never used."""
    lagged = table_with(noise(), "gauss-seidel")
    acting = (*ESTIMATES, *STANDARD.commanded, *STANDARD.applied)
    assert indices_of(at_its_time(lagged, acting), blocks) == indices_of(lagged)


def test_for_actuators_with_a_lag_the_end_of_a_step_counts():
    """Their output is a state, so it is in the row of its time."""
    lagged = table_with(noise(), "gauss-seidel", {"plant.actuator.T.q": 0.1}.items())
    u, q, r = STANDARD.applied
    moved = at_its_time(lagged, (*ESTIMATES, *STANDARD.commanded, u, r))
    assert indices_of(moved) == indices_of(lagged)


@pytest.mark.parametrize(
    ("group", "without"),
    [
        (
            "controller.theta_hat",
            [name for name in index_columns() if name.startswith("theta_hat")],
        ),
        ("controller.dy_hat", ["estimate_error"]),
        ("plant.nu", ["largest_drift"]),
        (
            "planner",
            [
                "late_error",
                "time_to_settle",
                "time_to_reach",
                *(f"final_error.{axis}" for axis in AXES),
            ],
        ),
    ],
)
def test_indices_without_ports_are_left_out(group, without):
    rest = {name: signal for name, signal in SIGNALS.items() if not name.startswith(group)}
    assert indices().keys() - indices(rest).keys() == set(without)


def test_an_index_that_is_never_reached_is_left_out():
    away = {**SIGNALS, "plant.eta.z": lambda t: 0.0 * t + 1.01}
    assert indices().keys() - indices(away).keys() == {"time_to_reach", "time_to_settle"}


def test_a_vehicle_that_leaves_its_reference_has_not_settled():
    """It reaches its reference at once, and leaves it for a while, or at the end."""
    near = {name: signal for name, signal in SIGNALS.items() if name != "plant.eta.x"}
    on = {**near, "plant.eta.x": lambda t: np.cos(t) - ELL}
    assert (indices(on)["time_to_reach"], indices(on)["time_to_settle"]) == (0.0, 0.0)
    between = {**on, "plant.eta.z": lambda t: 2.0 * ((t > 3.0) & (t < 4.0))}
    assert indices(between)["time_to_reach"] == 0.0
    assert indices(between)["time_to_settle"] == pytest.approx(4.0)
    at_the_end = {**on, "plant.eta.z": lambda t: 2.0 * (t > 9.0)}
    assert indices(at_the_end)["time_to_reach"] == 0.0
    assert "time_to_settle" not in indices(at_the_end)


def test_closed_loop_has_all_indices():
    _, system = load_scenario("fig4", "native")
    experiment, observer = Experiment(4.0, 0.02), Indices()
    simulate_plan(make_plan(system, experiment, loop="auto"), [observer])
    found = observer.values().keys()
    assert (
        set(index_columns()) - {"time_to_reach", "time_to_settle"} <= found <= set(index_columns())
    )


@pytest.mark.parametrize("module", [*iter_modules(index.__path__)], ids=lambda module: module.name)
def test_an_index_is_in_the_language_of_equations(module):
    reducer = read_reducer(import_module(f"{index.__name__}.{module.name}"))
    assert Program(*reducer.hooks.values()).mistakes == []


def test_a_new_index_is_one_entry(monkeypatch, tmp_path):
    """It appears in metrics.json, in the table of a study, and in the labels of its figures."""
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    depth = Index("largest_depth", "largest depth", read_reducer(largest_depth), is_metric=True)
    monkeypatch.setattr(table_of_indices, "INDICES", (*table_of_indices.INDICES, depth))
    result = run("fig4", {"plant.nu0.w": 1.0}, stop_time=1.0, kind="native")
    deepest = result["plant.eta.z"].max()
    assert deepest > 0.1
    assert result.metrics()["largest_depth"] == deepest

    study = {"scenario": "fig4", "stop_time": 1.0, "vary": {"plant.nu0.w": [1.0]}}
    space = Space(study_of("own", study), {"fig4": load_scenario("fig4", "native")})
    with open_store(tmp_path, {"made_of": {}, "runs": 1}, space.indices) as kept:
        [outcomes] = FmuEngine(space.prepared).outcomes(space.points(np.arange(1)))
        kept.add(outcomes)
        kept.publish(space)
    made = StudyResult(tmp_path)
    assert made["largest_depth"].tolist() == [deepest]
    assert Values(made).label("largest_depth") == "largest depth [m]"


def table_of(**columns: np.ndarray) -> Table:
    names = tuple(name.replace("__", ".") for name in columns)
    n = len(next(iter(columns.values())))
    parameters = {
        PortName("plant", f"{limit}.{k}"): value
        for limit, value in (("tau_min", -2.0), ("tau_max", 2.0))
        for k in "uqr"
    }
    parameters[PortName("plant", "ell")] = 0.35
    rows = np.column_stack([np.arange(n) * 0.001, *columns.values()])
    return Table.of(Header(names, Experiment((n - 1) * 0.001, 0.001), parameters), rows)


def test_effort_of_a_known_signal():
    """For 3 sin(2 pi t) over 4 s, clipped at +-2: norm, RMS, variation and saturated share."""
    t = np.arange(4001) * 0.001
    command = 3.0 * np.sin(2 * pi * t)
    applied = np.clip(command, -2.0, 2.0)
    zeros = np.zeros_like(t)
    found = metrics_of(
        table_of(
            plant__tau__u=command, plant__tau__q=zeros, plant__tau__r=command / 3,
            plant__tau_applied__u=applied, plant__tau_applied__q=zeros,
            plant__tau_applied__r=command / 3,
        )
    ).found()  # fmt: skip
    a = np.arcsin(2 / 3)
    # Mean square of a clipped sine: 2/pi (9 (a/2 - sin(2a)/4) + 4 (pi/2 - a)).
    mean_square = 2 / pi * (9 * (a / 2 - np.sin(2 * a) / 4) + 4 * (pi / 2 - a))
    assert found["rms_effort"] == pytest.approx([sqrt(mean_square), 0.0, sqrt(0.5)], rel=1e-3)
    assert found["l2_effort"] == pytest.approx([2 * sqrt(mean_square), 0.0, sqrt(2)], rel=1e-3)
    assert found["total_variation"] == pytest.approx([4 * 4 * 2, 0.0, 4 * 4 * 1], rel=1e-2)
    assert found["peak_command"] == pytest.approx([3.0, 0.0, 1.0], rel=1e-4)
    share = 1 - 2 * a / pi
    assert found["saturated_fraction"] == pytest.approx([share, 0.0, 0.0], abs=2e-3)


def test_final_error_is_the_largest_of_the_last_5_seconds():
    """The control point lies ell ahead; an error of 9 m before the window does not count."""
    t = np.arange(8001) * 0.001
    zeros, ones = np.zeros_like(t), np.ones_like(t)
    far = np.where(t < 2.9, 9.0, 0.0)
    found = metrics_of(
        table_of(
            plant__eta__x=far, plant__eta__y=ones, plant__eta__z=-2 * t, plant__eta__phi=zeros,
            plant__eta__theta=zeros, plant__eta__psi=zeros, planner__y_d__x=0.35 * ones,
            planner__y_d__y=zeros, planner__y_d__z=zeros,
        )
    ).found()  # fmt: skip
    assert found["final_error"] == pytest.approx([0.0, 1.0, 16.0])
