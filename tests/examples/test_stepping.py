"""Each example of stepping prints what its page says, and agrees with something independent."""

from __future__ import annotations

import re
import runpy
from time import perf_counter
from typing import Any

import numpy as np
import pytest

from orchestrator import Result, simulate
from orchestrator.machine.compilers import machines_compiler
from support.examples import EXAMPLES
from support.markdown import DOCS, blocks

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

PAGE = DOCS / "how-to" / "step-examples.md"

#: Outputs of the examples.
FILTER, MPC, HARDWARE, FAULTS = (block.text.splitlines() for block in blocks(PAGE, "text"))


def executed(name: str, run_name: str = "__main__") -> dict[str, Any]:
    """Names of an example after it has run."""
    return runpy.run_path(str(EXAMPLES / "stepping" / f"{name}.py"), run_name=run_name)


def distance(result: Result) -> np.ndarray:
    """Distances of the control point from its reference."""
    errors = [result[f"plant.y.{axis}"] - result[f"planner.y_d.{axis}"] for axis in "xyz"]
    return np.linalg.norm(errors, axis=0)


@pytest.mark.parametrize("path", sorted((EXAMPLES / "stepping").glob("*.py")), ids=lambda p: p.stem)
def test_is_short(path):
    assert len([line for line in path.read_text().splitlines() if line]) < 60


def test_unscented_filter_finds_mass_and_damping_within_its_deviations(capsys):
    estimate = executed("unscented_filter")["estimate"]
    assert capsys.readouterr().out.splitlines() == FILTER
    truth = simulate("fig4", stop_time=0.02).parameters
    for line in FILTER:
        m11, d11 = (re.search(rf"{name} = (\S+) ± (\S+)", line).groups() for name in ("m11", "d11"))
        assert abs(float(m11[0]) - truth["plant.m11"]) < 3.0 * float(m11[1])
        assert abs(float(d11[0]) - truth["plant.d11"]) < 3.0 * float(d11[1])
    [[*_, d11, _]] = estimate([20.0], {"disturbance.A_f": 0.0})
    assert f"the estimate is {d11:.1f} kg/s" in PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_errors_of_the_unscented_filter_are_as_large_as_it_says():
    """In other draws of the noise, without the friction that it takes for damping."""
    estimate = executed("unscented_filter", "")["estimate"]
    rows = np.array([*(next(estimate([20.0], {"disturbance.A_f": 0.0}, k)) for k in range(20))])
    ratios = (rows[:, [1, 3]] - (25.0, 30.0)) / rows[:, [2, 4]]
    rms = np.sqrt((ratios**2).mean(axis=0))
    assert ((rms > 0.2) & (rms < 1.2)).all()


def test_mpc_is_near_the_reference_first_and_within_the_limits(capsys, tmp_path):
    results = executed("mpc")["results"]
    assert capsys.readouterr().out.splitlines() == MPC
    commands = results["MPC"].step_values("plant.tau.u", "plant.tau.q", "plant.tau.r")
    assert np.abs(commands).max() <= 80.0
    last = {name: result.time[distance(result) > 0.5][-1] for name, result in results.items()}
    assert min(last, key=last.get) == "MPC"
    # The same commands from a table, with the FMUs.
    table = np.column_stack((results["MPC"].step_start, commands))
    header = "time,plant.tau.u,plant.tau.q,plant.tau.r"
    np.savetxt(tmp_path / "tau.csv", table, "%.17g", ",", header=header, comments="")
    again = simulate(
        {
            "components": {"controller": False},
            "parameters": {"plant.noise.std": 0.0},
            "inputs": {"file": str(tmp_path / "tau.csv"), "between": "hold"},
        },
        stop_time=60.0,
    )
    assert np.allclose(distance(again), distance(results["MPC"]), rtol=0.0, atol=1e-9)


def test_vehicle_with_its_controller_outside_moves_as_in_one_process_in_real_time(capsys):
    begun = perf_counter()
    result = executed("hardware_in_the_loop")["result"]
    assert perf_counter() - begun > 2.0
    assert capsys.readouterr().out.splitlines()[1:] == HARDWARE[1:]
    lockstep = simulate("fig4", stop_time=2.0)
    assert np.array_equal(distance(result), distance(lockstep))


#: Faults as events. What is frozen by hand is the value at 80 s; an event takes the one before.
EVENTS = {
    "position off by 1 m": {"at": 80.0, "for": 5.0, "bias": {"controller.y": 1.0}},
    "position frozen": {"at": 80.02, "for": 4.98, "freeze": "controller.y"},
    "no yaw moment": {"at": 80.0, "for": 5.0, "lose": "controller.tau.r"},
}


def test_faults_by_hand_and_as_events_have_the_same_errors(capsys):
    campaign = executed("fault_campaign")["campaign"]
    assert capsys.readouterr().out.splitlines() == FAULTS
    errors = {name: errors for name, *errors in campaign()}
    for name, event in EVENTS.items():
        result = simulate("fig4", events=[event])
        away = distance(result)
        expected = away[result.time >= 80.0].max(), away[result.time >= 95.0].max()
        assert errors[name] == pytest.approx(expected, rel=1e-9), name
