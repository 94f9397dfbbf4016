"""A component runs as plain Python, with the checks of its FMU."""

from __future__ import annotations

import bdb
from functools import partial
from math import exp
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from auv_fmu import Refusal
from fmus.trial import run
from support.own import imported

ONCE = {"stop_time": 1.0, "step": 0.25}


@pytest.fixture
def lag(monkeypatch, tmp_path):
    return partial(imported, monkeypatch, tmp_path)


def test_result_has_the_time_and_all_outputs(lag):
    result = run(lag(), {"T": 1.0, "x0": 4.0}, **ONCE)
    assert result["time"] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert result["x"] == pytest.approx([4.0 * exp(-t) for t in result["time"]])
    assert result["fault"] == [False] * 5


def test_inputs_are_held_or_follow_the_time(lag):
    own = lag()
    held = run(own, {"x0": 0}, {"u": 1}, **ONCE)
    assert held["x"][1] == pytest.approx(1.0 - exp(-0.5))
    late = run(own, {"x0": 0}, lambda t: {"u": float(t >= 0.5)}, **ONCE)
    assert late["x"][:3] == [0.0, 0.0, 0.0]
    assert late["x"][3] == held["x"][1]


def test_outputs_follow_the_inputs_of_their_time(lag):
    own = lag(
        ("def outputs(state: State)", "def outputs(state: State, inputs: Inputs, t: float)"),
        ("return Outputs(state.x)", "return Outputs(inputs.u + 100.0 * t + 0.0 * state.x)"),
    )
    result = run(own, {}, lambda t: {"u": t * t}, **ONCE)
    assert result["x"] == [t * t + 100.0 * t for t in result["time"]]


def test_the_run_may_begin_later(lag):
    result = run(lag(), stop_time=3.0, step=0.5, start_time=2.0)
    assert result["time"] == [2.0, 2.5, 3.0]


VECTOR = (
    ('float, Variable("m", "Set point")] = 0.0', 'tuple[float, float], Variable("m", "Places")]'),
    ("inputs.u", "inputs.u[1]"),
)  # fmt: skip


@pytest.mark.parametrize("given", [{"u": (7.0, 1.0)}, {"u[1]": 7.0, "u[2]": np.float64(1.0)}])
def test_a_vector_is_set_whole_or_by_its_elements(lag, given):
    result = run(lag(*VECTOR), {"x0": 0.0}, given, **ONCE)
    assert result["x"][1] == pytest.approx(1.0 - exp(-0.5))


@pytest.mark.parametrize(
    ("parameters", "inputs", "why"),
    [
        ({"T": -1.0}, {}, "T = -1: must be at least 1e-09"),
        ({}, {"u": float("inf")}, "u = inf: must be finite"),
        ({"x0": 101.0}, {}, "x0 is too far away"),
    ],
)
def test_refusals_are_raised(lag, parameters, inputs, why):
    with pytest.raises(Refusal, match=why):
        run(lag(), parameters, inputs, **ONCE)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"parameters": {"q": 1.0}}, "no parameter 'q'; there are: T, x0"),
        ({"inputs": {"x0": 1.0}}, "no input 'x0'; there are: u"),
        ({"inputs": {"u": "1"}}, "u = '1': must be a Real"),
        ({"step": 0.0}, "no run from 0 s to 1 s by steps of 0 s"),
        ({"stop_time": -1.0}, "no run from 0 s to -1 s by steps of 0.25 s"),
    ],
)
def test_what_makes_no_run_is_refused(lag, given, why):
    with pytest.raises((ValueError, Refusal), match=why):
        run(lag(), **{**ONCE, **given})


def test_too_few_elements_are_refused(lag):
    with pytest.raises(ValueError, match="u: 1 values for 2 ports"):
        run(lag(*VECTOR), {}, {"u": (1.0,)}, **ONCE)


@pytest.mark.parametrize("place", ["Outputs(state.x)", "State(parameters.x0)", "State(state.x - "])
def test_what_a_component_raises_goes_on_to_the_caller(lag, place):
    own = lag((place, place.replace("state.x", "[][1]").replace("parameters.x0", "[][1]")))
    with pytest.raises(IndexError) as caught:
        run(own, **ONCE)
    assert caught.traceback[-1].path.name == "own_lag.py"


STEP = "    return State(state.x - (inputs.u - state.x) * expm1(-h / parameters.T))"


def test_a_debugger_stops_in_each_step_and_sees_the_values(lag):
    own, seen = lag(), []

    class Debugger(bdb.Bdb):
        def user_line(self, frame: FrameType) -> None:
            if self.break_here(frame):
                seen.append((frame.f_locals["state"].x, frame.f_locals["h"]))
            self.set_continue()

    lines = Path(own.__file__).read_text().splitlines()
    debugger = Debugger()
    debugger.set_break(own.__file__, 1 + lines.index(STEP))
    result = debugger.runcall(run, own, **ONCE)
    assert seen == [(x, 0.25) for x in result["x"][:-1]]
