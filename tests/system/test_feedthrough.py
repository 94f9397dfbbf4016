"""Feedthrough order: values pass through, a row records them, then all components are stepped."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator import Result, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import (
    Checkpoints,
    Experiment,
    Run,
    System,
    Table,
    make_plan,
    simulate_plan,
    write_ssp,
)
from support.linear import Part, linear, system_of
from support.texts import mentions

H, STEPS = 0.1, 30

#: A law with direct feedthrough, a plant with an output of either sort, a filter that is only a
#: state, and a gauge that takes longer steps.
PARTS = {
    "filter": Part(B=[[1.0, 0.0]], C=1.0),
    "gauge": Part(D=[[0.0, 0.0], [1.0, 0.0]]),
    "plant": Part(B=[[1.0, 1.0]], C=[[1.0, 0.0], [1.0, 0.0]], D=[[0.0, 0.0], [0.0, 0.5]], x=[1.0]),
    "law": Part(D=[[0.0, 0.0], [-1.0, 1.0]]),
}
WIRES = {
    "filter.u0": "law.y1",
    "gauge.u0": "law.y1",
    "plant.u0": "law.y1",
    "plant.u1": "filter.y0",
    "law.u0": "plant.y0",
}

EVENTS: list[dict[str, Any]] = [
    {"when": "law.y1 > 0.42", "bias": {"filter.u0": 0.25}, "for": 0.2},
    {"at": 0.5, "set": {"law.D10": -3.0}, "for": 0.5},
    {"at": 0.7, "override": {"plant.u0": 0.4}, "for": 0.3},
    {"at": 1.1, "drop": "law.u0", "for": 0.3},
    {"at": 1.6, "reset": "filter"},
    {"at": 2.0, "set": {"plant.C00": 2.0}},
]

WAYS: list[dict[str, Any]] = [{"loop": "python"}, {"loop": "compiled"}, {"isolate": True}]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("feedthrough")


def steered(folder: Path, **kind: Any) -> System:
    fmu = linear(folder, tunable=True, **kind)
    return system_of(dict.fromkeys(PARTS, fmu), PARTS, WIRES, steps={"gauge": 3 * H})


def straight() -> Iterator[dict[str, float]]:
    """The same in Python, with EVENTS."""
    x, f, gauge, held, biased = 1.0, 0.0, 0.0, 0.0, 0
    for k in range(STEPS + 1):
        seen = x * (2.0 if k >= 20 else 1.0)
        if not 11 <= k < 14:
            held = seen
        y1 = held * (-3.0 if 5 <= k < 10 else -1.0) + 0.2 * k * H
        if y1 > 0.42 and not biased:
            biased = k + 2
        if k == 16:
            f = 0.0
        if k % 3 == 0:
            gauge = y1
        row = {"law.u0": held, "law.y1": y1, "filter.y0": f, "gauge.y1": gauge, "plant.y0": seen}
        row |= {"plant.u0": 0.4 if 7 <= k < 10 else y1, "plant.u1": f}
        row |= {"filter.u0": y1 + (0.25 if k < biased else 0.0), "plant.y1": x + 0.5 * f}
        yield row
        x += H * (row["plant.u0"] + f)
        f += H * row["filter.u0"]


def with_events(folder: Path, tmp_path: Path, **how: Any) -> Result:
    table = tmp_path / "wish.csv"
    table.write_text(f"time,law.u1\n0.0,0.0\n{STEPS * H},{0.2 * STEPS * H}\n")
    return simulate(
        steered(folder), step=H, stop_time=STEPS * H, inputs=table, events=EVENTS, **how
    )


def test_every_row_shows_what_is_true_at_its_time(folder, tmp_path):
    """Also what events do at that time."""
    result = with_events(folder, tmp_path, **WAYS[0])
    expected = list(straight())
    for name in expected[0]:
        np.testing.assert_allclose(result[name], [row[name] for row in expected], atol=1e-12)
    assert len({event.event for event in result.events}) == len(EVENTS)


def test_ways_make_the_same_rows_bit_for_bit(folder, tmp_path):
    first, *others = (with_events(folder, tmp_path, **way) for way in WAYS)
    for other in others:
        np.testing.assert_array_equal(
            other.group(*other.columns), first.group(*first.columns), strict=True
        )


class _Cut:
    """A hook that interrupts a run after some steps."""

    def __init__(self, steps: int) -> None:
        self._steps = steps

    def act(self, run: Run) -> int:
        if run.made >= self._steps:
            raise KeyboardInterrupt
        return self._steps


@pytest.mark.parametrize("made", [7, STEPS])
def test_a_run_continues_from_its_checkpoint(folder, tmp_path, made):
    """Also during a longer step of a component, and at the last row."""
    plan = make_plan(steered(folder), Experiment(STEPS * H, H))
    whole, resumed = Table(), Table()

    def checkpoints(resume: bool) -> Checkpoints:
        return Checkpoints(tmp_path / "c", plan.identity(), made * H, resume)

    simulate_plan(plan, [whole])
    first = checkpoints(False)
    simulate_plan(plan, [first], hooks=[first, _Cut(made)])
    assert first.time == pytest.approx(made * H)
    second = checkpoints(True)
    ending = simulate_plan(plan, [second, resumed], hooks=[second])
    assert (ending.failure, ending.messages) == (None, ())
    assert resumed.rows.tobytes() == whole.rows.tobytes()


@pytest.mark.parametrize(
    ("kind", "order", "why"),
    [
        ({}, "feedthrough", None),
        ({"cached": True}, "gauss-seidel", "no Real output of law follows"),
    ],
)
def test_the_order_that_is_taken_is_measured_and_recorded(
    workplace, folder, capsys, kind, order, why
):
    [ssp] = write_ssp(steered(folder, **kind), Path())
    options = ["run", str(ssp), "--stop-time", "1", "--step", "0.1", "--no-figures", "--out", "r"]
    assert main(options) == 0
    assert json.loads(Path("r/metrics.json").read_text())["order"] == order
    capsys.readouterr()
    assert main([*options, "--force", "--order", "feedthrough"]) == (2 if why else 0)
    if why:
        line = capsys.readouterr().err.splitlines()[-1]
        assert mentions(line, f"order feedthrough: {why}")
