"""Reducers over made-up rows."""

from __future__ import annotations

from enum import IntEnum
from math import inf, nan
from types import ModuleType
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from auv_fmu import Variable
from fmus.ports.reducer import read_reducer
from orchestrator.cosim import Experiment, Header, Order, PortName
from orchestrator.machine.errors import InputError
from orchestrator.vehicle import reduction
from orchestrator.vehicle.cautions import WATCHED
from orchestrator.vehicle.indices import INDICES
from orchestrator.vehicle.reduction import Reduction, library_of, reductions_of, sources_of
from orchestrator.vehicle.signals import STANDARD, AllocatedLoop, Loop

N = 21


class Mode(IntEnum):
    """Two modes."""

    OFF = 0
    ON = 3


class Inputs(NamedTuple):
    """Inputs of every type, and one that a run may lack."""

    x: Annotated[float, Variable("m", "A signal", name="plant.x")]
    n: Annotated[int, Variable(description="A whole number", name="plant.n")]
    is_on: Annotated[bool, Variable(description="A truth", name="plant.is_on")]
    mode: Annotated[Mode, Variable(description="A mode", name="plant.mode")]
    k: Annotated[float, Variable("m", "A gain", name="controller.k")]
    lag: Annotated[float, Variable("s", "A lag", name="plant.actuator.T.u")] = 7.0


class State(NamedTuple):
    """All arguments of the hooks."""

    rows: tuple[float, ...]
    seen: tuple[object, ...] = ()


class Outputs(NamedTuple):
    """Two numbers."""

    total: Annotated[float, Variable("m", "A sum")]
    rest: Annotated[tuple[float, float], Variable("1", "Others")]


class Step(NamedTuple):
    """Arguments of a step."""

    inputs: Inputs
    before: float
    acting: float
    t: float
    h: float


def start(inputs: Inputs, t: float, begin: float, end: float) -> State:
    """Begin with the first row."""
    return State((inputs.x,), ((t, begin, end),))


def update(
    state: State, inputs: Inputs, before: Inputs, acting: Inputs, t: float, h: float
) -> State:
    """Add a row."""
    if inputs.x == 13.0 and inputs.k == 13.0:
        raise ValueError("thirteen")
    step = Step(inputs, before.x, acting.x, t, h)
    return State((*state.rows, inputs.x), (*state.seen, step))


def outputs(state: State, t: float) -> Outputs:
    """Return the results."""
    return Outputs(sum(state.rows), (t, nan))


def reducer_with(last: float | None = None):
    module = ModuleType("own")
    vars(module).update(
        start=start, update=update, outputs=outputs, **({} if last is None else {"LAST": last})
    )
    # The language has no tuples of any length, and these hooks are not translated.
    State.__annotations__.update(rows="tuple[float, float]", seen="tuple[float, float]")
    return read_reducer(module)


def header(order: Order = "feedthrough", k: float = 1.0, loop: Loop = STANDARD) -> Header:
    columns = tuple(loop.port(f"plant.{name}") for name in ("n", "x", "is_on"))
    values = {loop.port("plant.mode"): "on", loop.port("controller.k"): k}
    parameters = {PortName.read(name): value for name, value in values.items()}
    return Header(columns, Experiment(10.0, 0.5, order, -1.0), parameters)


def rows() -> np.ndarray:
    k = np.arange(N)
    return np.column_stack((0.5 * k - 1.0, k % 4, 1.0 * k, k % 2))


def reduced(head: Header, blocks: int = 1, last: float | None = None) -> Reduction:
    [fold] = reductions_of([reducer_with(last)], [STANDARD], head)[STANDARD].values()
    for block in np.array_split(rows(), blocks):
        fold.take(block)
    return fold


def state(fold: Reduction) -> State:
    # These hooks are outside the language, so they run in Python.
    return fold._reducing._state


@pytest.mark.parametrize("blocks", [1, 4, N])
@pytest.mark.parametrize("order", ["feedthrough", "gauss-seidel"])
def test_hooks_receive_the_values_of_rows(order, blocks):
    first, *steps = state(reduced(header(order), blocks)).seen
    assert first == (-1.0, -1.0, 10.0)
    assert len(steps) == N - 1
    for k, step in enumerate(steps, start=1):
        assert step.inputs == Inputs(float(k), k % 4, bool(k % 2), Mode.ON, 1.0, 7.0)
        assert type(step.inputs.n) is int and type(step.inputs.is_on) is bool
        assert step.inputs.mode is Mode.ON
        assert (step.before, step.acting) == (k - 1.0, k - 1.0 if order == "feedthrough" else k)
        assert (step.t, step.h) == (0.5 * k - 1.0, 0.5)


def test_not_a_number_is_kept_only_next_to_numbers():
    found = reduced(header()).found()
    assert found["total"] == [N * (N - 1) / 2]
    assert found["rest"][0] == 9.0 and np.isnan(found["rest"][1])


@pytest.mark.parametrize("blocks", [1, 4, N])
def test_only_the_last_seconds_count(blocks):
    """The run ends at 9 s: the rows of 7.5, 8, 8.5 and 9 s count."""
    assert reduced(header(), blocks, 1.5).found()["total"] == [17.0 + 18.0 + 19.0 + 20.0]


@pytest.mark.parametrize("blocks", [1, 4, N])
@pytest.mark.parametrize("last", [None, 100.0])
def test_exception_of_a_hook_is_reported_with_its_time(blocks, last):
    fold = reduced(header(k=13.0), blocks, last)
    assert fold.found() == {}
    assert fold.failure == "own: at t = 5.5 s: ValueError: thirteen"


def test_inputs_have_the_names_of_the_loop():
    fleet = AllocatedLoop("a.plant", "a.law", "a.planner", allocation="a.fins")
    head = header(loop=fleet)
    values = {str(name): value for name, value in head.parameters.items()}
    found = sources_of(reducer_with(), fleet, head.place, values)
    assert found.places == {"plant.x": 2, "plant.n": 1, "plant.is_on": 3}
    # With an allocation the applied signal follows from a state.
    assert found.constants == {"plant.mode": 3, "controller.k": 1.0, "plant.actuator.T.u": inf}
    assert fleet.port("plant.tau.u") == "a.fins.tau.u"
    assert fleet.port("sea.depth") == "sea.depth"
    found = sources_of(reducer_with(), STANDARD, head.place, values)
    assert found.missing == [
        "plant.x", "plant.n", "plant.is_on", "plant.mode", "controller.k"
    ]  # fmt: skip
    assert reductions_of([reducer_with()], [STANDARD], head) == {STANDARD: {}}


def test_a_parameter_that_is_not_a_number_is_refused():
    with pytest.raises(InputError, match=r"controller\.k is 'soft', not a number"):
        reduced(header(k="soft"))  # type: ignore[arg-type]


@pytest.mark.parametrize("order", ["feedthrough", "gauss-seidel"])
@pytest.mark.parametrize("blocks", [1, 3])
def test_compiled_indices_equal_their_hooks_in_python(order, blocks, monkeypatch):
    reducers = [*dict.fromkeys(index.reducer for index in INDICES), *WATCHED]
    names = sorted({port.name for reducer in reducers for port in reducer.ports})
    fixed = {STANDARD.ell: 0.3, "plant.roll": False}
    signals = [name for name in names if name not in (*STANDARD.limits, *fixed)]
    random = np.random.default_rng(7)
    values = np.column_stack((0.5 * np.arange(N) - 1.0, random.normal(size=(N, len(signals)))))
    limits = dict.fromkeys(STANDARD.lower_limits, -1.0) | dict.fromkeys(STANDARD.upper_limits, 0.5)
    parameters = {PortName.read(name): value for name, value in {**limits, **fixed}.items()}
    head = Header(tuple(signals), Experiment(9.0, 0.5, order, -1.0), parameters)

    def found() -> list[dict[str, list[float]]]:
        made = reductions_of(reducers, [STANDARD], head)[STANDARD]
        assert len(made) == len(reducers)
        for fold in made.values():
            for block in np.array_split(values, blocks):
                fold.take(block)
        return [fold.found() for fold in made.values()]

    compiled = found()
    monkeypatch.setattr(reduction, "library_of", lambda reducer: None)
    assert repr(compiled) == repr(found())


def test_compiled_indices_are_found_without_translating_them_again(monkeypatch):
    [reducer] = {index.reducer for index in INDICES if index.name == "final_error"}
    if library_of(reducer) is None:
        pytest.skip("there is no C compiler")
    monkeypatch.setattr(reduction, "_text", None)
    assert library_of.__wrapped__(reducer)
