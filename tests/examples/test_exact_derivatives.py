"""Examples of exact derivatives print what their page says, and keep what it promises."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auv_fmu.paper.attitude import quaternion_from_euler
from orchestrator import Result, Simulation, Simulations, read
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from support.examples import EXAMPLES
from support.markdown import DOCS, blocks

ca = pytest.importorskip("casadi")

PAGE = DOCS / "how-to" / "derivative-examples.md"

#: Times of computations, which differ from run to run.
TIMES = re.compile(r"\s+\d+\.\d ms \(\d+ ms\)|\d+ us")

#: Bounds of the mean NEES of 50 runs with 18 errors, 95 % of all: chi-squared with 900 degrees.
NEES = 16.38, 19.70

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")


def executed(name: str, run_name: str = "") -> dict[str, Any]:
    """Names of an example after it has run, by default without its last part."""
    return runpy.run_path(str(EXAMPLES / "derivatives" / f"{name}.py"), run_name=run_name)


def lines_of(text: str) -> list[str]:
    return [TIMES.sub("", line).rstrip() for line in text.splitlines()]


def distance(result: Result) -> np.ndarray:
    """Distances of the control point from its reference."""
    errors = [result[f"plant.y.{axis}"] - result[f"planner.y_d.{axis}"] for axis in "xyz"]
    return np.linalg.norm(errors, axis=0)


@pytest.mark.parametrize("planner", ["IPOPT", "one step"])
def test_prediction_goes_to_the_limits_and_is_within_half_a_metre_after_4_s(planner):
    example = executed("nonlinear_mpc")
    y_d = example["reference"](stop=8.0)
    result, _ = example["mpc"](example["functions"](), planner, y_d, {}, stop=8.0)
    commands = result.step_values("plant.tau.u", "plant.tau.q", "plant.tau.r")
    assert 79.9 < np.abs(commands).max() <= 80.0
    assert np.array_equal(commands, result.step_values(*(f"plant.tau_applied.{k}" for k in "uqr")))
    assert distance(result)[result.time > 4.1].max() < 0.5


@needs_compiler
def test_no_other_plan_nearby_is_better_in_the_simulation():
    """The simulation makes ten steps where the prediction makes one."""
    example = executed("nonlinear_mpc")
    moves, limit = example["MOVES"], example["LIMIT"]
    y_d = example["reference"](stop=0.0)[:moves]
    _, planners = example["functions"]()
    auv = Simulation("fig4", example["QUIET"])
    givens = np.concatenate((auv["plant.eta"], auv["plant.nu"], np.zeros(9), y_d.ravel()))
    plan = planners["IPOPT"](np.zeros(3 * moves), givens).full().reshape(moves, 3)
    assert (np.abs(plan) > limit - 0.01).any() and np.abs(plan).max() < limit + 0.01
    away = (
        np.random.default_rng(1).normal(size=(200, moves, 3))
        * np.geomspace(0.1, 20.0, 200)[:, None, None]
    )
    away[0] = 0.0
    plans = np.clip(plan + away, -limit, limit)
    plants = Simulations({"only": ["plant"]}, 200, {**example["QUIET"], "plant.integrator": "rk4"})
    costs = np.zeros(200)
    for k in range(moves):
        plants["plant.tau"] = plans[:, k]
        plants.step(example["HOLD"])
        costs += np.sum((plants["plant.y"] - y_d[k]) ** 2, axis=1)
    changes = np.diff(np.insert(plans, 0, 0.0, axis=1), axis=1)
    costs += np.sum(
        (example["WEIGHT"] * plans) ** 2 + (example["CHANGE"] * changes) ** 2, axis=(1, 2)
    )
    assert costs.argmin() == 0


def test_predictive_controller_as_an_fmu_is_near_the_reference(workplace, monkeypatch):
    """A run of Fig. 4, with the files and the commands of the page."""
    for path in (EXAMPLES / "derivatives").glob("*mpc*.py"):
        shutil.copy(path, workplace)
    monkeypatch.syspath_prepend(workplace)
    [code] = [block for block in blocks(PAGE, "python") if "nonlinear_mpc" in block.text]
    [scenario] = [block for block in blocks(PAGE, "toml") if "MpcController" in block.text]
    exec(compile(code.text, str(PAGE), "exec"), {})
    Path("mpc.toml").write_text(scenario.text)
    assert main(["build", "mpc_controller.py"]) == 0
    assert main(["run", "mpc.toml", "--stop-time", "10", "--no-figures"]) == 0
    result = read("results/mpc")
    assert distance(result)[result.time > 8.0].max() < 0.1
    assert "int better(" in Path("planner.c").read_text()


@pytest.mark.slow
@needs_compiler
def test_planner_in_c_gives_the_same_plan(workplace):
    example = executed("nonlinear_mpc")
    _, planners = example["functions"]()
    planners["one step"].generate("planner.c")
    build = [machines_compiler(), "-O1", "-shared", "-fPIC", "planner.c", "-o", "planner.so", "-lm"]
    subprocess.run(build, check=True)
    givens = np.concatenate(([2.0, 6.0], np.zeros(19), example["reference"](0.0)[:15].ravel()))
    plan = np.zeros(45)
    for _ in range(3):
        again = ca.external("better", "./planner.so")(plan, givens).full()
        plan = planners["one step"](plan, givens).full()
        assert again == pytest.approx(plan, abs=1e-6)


def test_step_of_the_filter_is_the_simulated_one_and_its_jacobian_agrees_with_differences():
    example = executed("kalman_filter")
    f = example["functions"]()
    eta = np.array([1.0, -2.0, 3.0, 0.3, -0.6, 2.5])
    nu, tau = np.array([0.6, -0.1, 0.2, 0.1, -0.3, 0.4]), np.array([9.0, -4.0, 5.0])
    tau_w = np.array([0.5, -0.4, 0.3, -0.2, 0.1, 0.6])
    x = np.concatenate((eta[:3], quaternion_from_euler(*eta[3:]), nu, tau_w))
    after, jacobian = example["exact"](f, x, tau)
    with Simulation({"only": ["plant"]}, {"plant.eta0": eta, "plant.nu0": nu}) as plant:
        plant["plant.tau"], plant["plant.tau_w"] = tau, tau_w
        plant.step()
        assert f["seen"](after)[0].full().ravel() == pytest.approx(plant["plant.eta"], abs=1e-12)
        assert after[7:13] == pytest.approx(plant["plant.nu"], abs=1e-12)
    _, differences = example["differences"](f, x, tau)
    assert jacobian == pytest.approx(differences, abs=1e-8)
    turned = f["moved"](x, 1e-3 * np.eye(18)[4]).full().ravel()
    turned[3:7] *= -1.0  # the same attitude
    assert f["errors"](x, turned).full().ravel() == pytest.approx(1e-3 * np.eye(18)[4], abs=1e-9)


def test_errors_of_the_filter_are_as_large_as_its_covariance_says():
    """In 50 draws of first errors, noise and disturbance."""
    example = executed("kalman_filter")
    f = example["functions"]()
    runs = [[*example["filtered"](f, seed, stop=3.0)][-1] for seed in range(50)]
    nees = [errors @ np.linalg.solve(P, errors) for _, P, errors, *_ in runs]
    assert NEES[0] < np.mean(nees) < NEES[1]
    velocity, observed = (np.sqrt(np.mean([np.sum(run[k] ** 2) for run in runs])) for k in (3, 4))
    assert velocity < 0.5 * observed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nonlinear_mpc", "kalman_filter"])
def test_page_has_what_the_example_prints(name, capsys):
    executed(name, "__main__")
    printed = lines_of(capsys.readouterr().out)
    assert printed in [lines_of(block.text) for block in blocks(PAGE, "text")]
