"""The examples of identification and of gains by gradient agree with runs of `simulate`."""

from __future__ import annotations

import re
import runpy
from functools import cache
from typing import Any

import numpy as np
import pytest

from orchestrator import Result, simulate
from orchestrator.machine.compilers import machines_compiler
from support.examples import EXAMPLES
from support.markdown import DOCS, blocks

pytest.importorskip("casadi")
pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

PAGE = DOCS / "how-to" / "derivative-examples.md"


def executed(name: str, run_name: str = "") -> dict[str, Any]:
    """Names of an example after it has run."""
    return runpy.run_path(str(EXAMPLES / "derivatives" / f"{name}.py"), run_name=run_name)


def output(word: str) -> list[str]:
    """Lines of the output on the page that a word occurs in."""
    [text] = (block.text for block in blocks(PAGE, "text") if word in block.text)
    return text.splitlines()


@pytest.fixture(scope="module")
def identification() -> dict[str, Any]:
    return executed("identification")


def changed(names: list[str], values: np.ndarray) -> dict[str, float]:
    return {f"plant.{name}": value for name, value in zip(names, values, strict=True)}


def test_derivatives_agree_with_differences_of_the_compiled_plant(identification):
    names, tau, record = (identification[name] for name in ("NAMES", "TAU", "record"))
    run, slopes = identification["run_of"](tau)
    theta = identification["TRUTH"] * np.linspace(0.9, 1.1, len(names))
    assert run(theta).full()[:, 0] == pytest.approx(record(tau, changed(names, theta)), abs=1e-9)
    exact = slopes(theta)[0].full()
    for k in (0, 4, 10, 11):
        push = 1e-4 * theta[k] * np.eye(len(names))[k]
        pair = (record(tau, changed(names, theta + sign * push)) for sign in (1.0, -1.0))
        difference = np.subtract(*pair) / (2.0 * push[k])
        assert exact[:, k] == pytest.approx(difference, abs=1e-6 * np.abs(difference).max()), k


def test_fit_to_a_run_without_noise_finds_the_true_parameters(identification):
    tau = identification["TAU"]
    run, slopes = identification["run_of"](tau)
    measured = identification["record"](tau)
    found, _ = identification["fit"](measured, run, lambda theta: slopes(theta)[0].full())
    assert found.x == pytest.approx(identification["TRUTH"], rel=1e-6)


def test_run_with_parameters_and_forces_doubled_is_the_same(identification):
    names, tau, record = (identification[name] for name in ("NAMES", "TAU", "record"))
    doubled = record(2.0 * tau, changed(names, 2.0 * identification["TRUTH"]))
    assert doubled == pytest.approx(record(tau), abs=1e-9)


def test_page_says_which_parameters_a_run_identifies(identification):
    names, tau, record = (identification[name] for name in ("NAMES", "TAU", "record"))
    truth = simulate("fig4", stop_time=0.02).parameters
    rows = {line.split()[0]: line for line in output("righting")[2:] if " ± " in line}
    assert [*rows] == names
    for name, line in rows.items():
        numbers = re.findall(r"-(?= |$)|\d+\.?\d*", line.removeprefix(name))
        estimate, half, true, covered = map(float, numbers[:4])
        assert true == truth[f"plant.{name}"]
        assert abs(estimate - true) < 2.0 * half
        assert 88 <= covered <= 100
        for on, number in zip(identification["COMMANDS"].values(), numbers[4:], strict=True):
            given = tau * np.array([on]).T
            moved = record(given, {f"plant.{name}": 1.1 * true}) - record(given)
            assert (np.abs(moved).max() < 1e-9) == (number == "-"), (name, on)


@pytest.mark.slow
def test_identification_prints_what_its_page_says(capsys):
    executed("identification", "__main__")
    printed = capsys.readouterr().out.splitlines()
    without_time = [re.sub(r"[\d.]+ s(, away by \S+ deviations)?", "", line) for line in printed]
    page = output("righting")
    assert without_time == [
        re.sub(r"[\d.]+ s(, away by \S+ deviations)?", "", line) for line in page
    ]


@cache
def run(gains: tuple[tuple[str, float], ...]) -> Result:
    return simulate("fig5", {"planner.eta0.z": -2.0, **dict(gains)})


def late_error(result: Result) -> float:
    """Largest error in the second half of a run without noise."""
    errors = np.linalg.norm(result["plant.y"] - result["planner.y_d"], axis=1)
    return float(errors[result.time >= 50.0].max())


def test_gradient_of_the_late_error_agrees_with_differences_of_simulate():
    example = executed("gains_by_gradient")
    names, paper, last = example["LOOP"].parameters, example["PAPER"], example["LATE"]
    values, slopes = example["run_of"]()
    errors = values(paper).full()[:last, 0]
    exact = slopes(paper).full()[np.argmax(errors)]
    assert errors.max() == pytest.approx(late_error(run(())), rel=1e-9)
    for name in ("controller.lambda", "controller.gamma", "controller.K2[2]"):
        k = names.index(name)
        pair = (run(((name, float(np.exp(paper[k] + push))),)) for push in (1e-7, -1e-7))
        difference = np.subtract(*map(late_error, pair)) / 2e-7
        assert exact[k] == pytest.approx(difference, rel=1e-4), name


def test_gains_of_the_page_have_the_errors_and_the_commands_of_the_page():
    text = "\n".join(output("lambda"))
    searches = re.findall(r"^ *(\d+)  .*? ([\d.]+) cm +([\d.]+)", text, re.MULTILINE)
    best = re.findall(r"^ +K1\[1\] .*", text, re.MULTILINE)
    limits = dict.fromkeys(float(limit) for limit, *_ in searches)
    for limit, line in zip(limits, best, strict=True):
        found = run(
            tuple(
                (f"controller.{name}", float(gain))
                for name, gain in re.findall(r"([\w\[\]]+) ([\d.e-]+)", line)
            )
        )
        row = late_error(found), np.abs(found["controller.tau"]).max()
        rows = [(float(e) / 100.0, float(c)) for of, e, c in searches if float(of) == limit]
        assert row[1] < 1.01 * limit
        assert any(np.allclose(row, one, rtol=0.01) for one in rows)
        assert row[0] < 1.01 * min(e for e, c in rows if c < 1.01 * limit)
