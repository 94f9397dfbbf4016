"""(59) and e_f on signals whose integrals are known."""

from math import pi, sqrt

import numpy as np
import pytest

from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName
from orchestrator.vehicle.indices import Metrics, metrics_of


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
    """3 sin(2 pi t) over 4 s, cut off at +-2: its norm, RMS, variation and share beyond."""
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


def test_indices_do_not_depend_on_the_blocks_in_which_rows_come():
    """To the last bit, on numbers that round."""
    random = np.random.default_rng(1)
    columns = {
        f"plant__{signal}__{k}": random.normal(scale=3.0, size=7001)
        for signal in ("tau", "tau_applied")
        for k in "uqr"
    }
    columns |= {f"plant__eta__{k}": random.normal(size=7001)
                for k in ("x", "y", "z", "phi", "theta", "psi")}  # fmt: skip
    columns |= {f"planner__y_d__{k}": random.normal(size=7001) for k in "xyz"}
    table = table_of(**columns)
    found = Metrics()
    found.begin(table.header)
    for start, end in ((0, 1), (1, 2), (2, 700), (700, 6000), (6000, 7001)):
        found.take(table.rows[start:end])
    found.end(Ending())
    assert found.found() == metrics_of(table).found()
