"""Functions of CasADi against the equations that they are made from."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from itertools import islice, pairwise
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest

from auv_fmu import Refusal, simulate
from fmus.discovery import Source, source_of
from fmus.ports.groups import flat, reals_first, scalars_of
from fmus.ports.port import Port
from fmus.python.slave import slave_of
from fmus.script import source_of_script
from fuzz import components
from orchestrator.machine.errors import InputError
from orchestrator.program import functions
from orchestrator.runs.scenario import SCENARIOS_FOLDER
from support import examples
from support.settings import NAMES
from support.tiers import slow

casadi = pytest.importorskip("casadi")

FIG4 = SCENARIOS_FOLDER / "fig4.toml"

#: Loops that end where a number says so cannot be unrolled.
LOOPS = {"AcousticLink", "Sea", "lqr", "stair"}
SMALL = [name for name in (*NAMES, *examples.NAMES) if name not in {*LOOPS, "NavigationFilter"}]

#: With one of 188,672 operations.
ALL = [*SMALL, *slow("NavigationFilter")]

#: Components that draw random numbers in a step, which jump with the state of their generator.
SENSORS = {"AttitudeSensor", "DepthSensor", "Dvl", "Imu", "PositionFix"}

#: Steps from different states.
STEPS = 8


def source(name: str) -> Source:
    return source_of(name) if name in NAMES else examples.source(name)


@cache
def model(name: str) -> functions.Model:
    return functions.model(name if name in NAMES else examples.EXAMPLES / name)


class Step(NamedTuple):
    """A step by Python's hooks: vectors before it, and what they give."""

    state: list[float]
    inputs: list[float]
    parameters: list[float]
    h: float
    t: float
    next: list[float]
    outputs: list[float]

    @property
    def given(self) -> tuple[Any, ...]:
        return self[:5]


def steps(made: Source, seed: int = 0, spread: float = 0.02) -> Iterator[Step]:
    """Steps with random inputs, and with parameters that differ from their defaults by a share."""
    draw, definition = Random(seed), made.definition
    behaviour, h = definition.behaviour, definition.experiment.step
    cls = slave_of(made.name, import_module(made.module))
    slave = cls(instance_name="it")
    inputs = [port for port in definition.ports if port.causality == "input"]
    outputs = [port for port in definition.ports if port.causality == "output"]
    slave.parameters = definition.parameters.of(
        {
            port.name: port.start * draw.uniform(1.0 - spread, 1.0 + spread)
            if port.type == "Real"
            else port.start
            for port in definition.parameters.ports
        }
    )
    parameters = [
        number
        for number, port in zip(flat(slave.parameters), definition.parameters.ports, strict=True)
        if port.type == "Real"
    ]

    def group() -> tuple[list[Any], Any]:
        values = {port.name: _drawn(draw, port) for port in inputs}
        return [float(value) for value in values.values()], cls.unpack(
            [values[port.name] for port in reals_first(inputs)]
        )

    def shown(state: Any, held: Any, t: float) -> list[float]:
        _, values = slave.evaluate(state, None, held, t, [0.0] * behaviour.draws)
        by_name = dict(zip((port.name for port in reals_first(outputs)), values, strict=True))
        return [float(by_name[port.name]) for port in outputs]

    t, state = 0.25, None
    for _ in range(200):
        numbers, held = group()
        try:
            if state is None:
                state = slave.start(slave.parameters, held, t)
            after, _ = slave.advance(state, None, held, t, h, 1)
            seen = shown(state, held, t) if behaviour.is_sampled else shown(after, held, t + h)
        except (ArithmeticError, AssertionError, Refusal):
            state = None
            continue
        yield Step(_row(state), numbers, parameters, h, t, _row(after), seen)
        state, t = after, t + h


def _row(group: Any) -> list[float]:
    return [float(number) for number in flat(group)]


def _drawn(draw: Random, port: Port) -> Any:
    """A random value of an input."""
    if port.choices:
        return draw.choice([*port.choices.values()])
    if port.type != "Real":
        return draw.choice([False, True]) if port.type == "Boolean" else draw.randint(0, 2)
    value = port.start + draw.gauss(0.0, 0.3)
    return min(
        max(value, port.minimum or -np.inf), np.inf if port.maximum is None else port.maximum
    )


def some(name: str) -> list[Step]:
    return [*islice(steps(source(name)), STEPS)]


def check(made: functions.Model, found: Iterator[Step]) -> None:
    for step in found:
        for numbers, wanted in zip(made.advance(*step.given), step[5:], strict=True):
            np.testing.assert_allclose(numbers.full().ravel(), wanted, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ALL)
def test_step_has_the_numbers_of_the_equations(name):
    check(model(name), iter(some(name)))


def test_loop_is_unrolled_where_its_parameters_are_fixed():
    made = functions.model("Sea", free=[])
    check(
        made, (step._replace(parameters=[]) for step in islice(steps(source("Sea"), spread=0.0), 2))
    )


@pytest.mark.parametrize("seed", range(0, 30, 6))
def test_random_components_have_the_numbers_of_their_equations(seed, tmp_path):
    files = components.files_of(seed)
    for file, text in files.items():
        text = text.replace("while True:", "for _ in range(8):")
        (tmp_path / file).write_text(text + "    return x\n" * text.startswith("def "))
        sys.modules.pop(Path(file).stem, None)
    script = tmp_path / f"random_{seed}.py"
    made = functions.model(script)
    check(made, islice(steps(source_of_script(script), seed), STEPS))


def is_smooth(port: Port, value: float) -> bool:
    """True for a number with neighbours on both sides."""
    return port.type == "Real" and value not in (port.minimum, port.maximum)


@pytest.mark.parametrize("name", [name for name in SMALL if name not in SENSORS])
def test_derivatives_agree_with_central_differences(name):
    step, made = some(name)[-1], model(name)
    definition = source(name).definition
    ports = {port.name: port for port in definition.ports}
    smooth = [
        [scalar is float for scalar in scalars_of(definition.behaviour.state)],
        [
            is_smooth(ports[name], value)
            for name, value in zip(made.inputs, step.inputs, strict=True)
        ],
        [
            is_smooth(ports[name], value)
            for name, value in zip(made.parameters, step.parameters, strict=True)
        ],
    ]
    exact = made.advance.jacobian()(*step.given, step.next, step.outputs)
    for group, columns in enumerate(smooth):
        matrix = np.vstack([exact[group].full(), exact[group + 5].full()])
        assert np.isfinite(matrix).all()
        for column in np.flatnonzero(columns):
            d = 1e-6 * max(1.0, abs(step[group][column]))
            ends = []
            for change in (d, -d):
                given = [*map(list, step[:3]), *step[3:5]]
                given[group][column] += change
                ends.append(np.vstack([part.full() for part in made.advance(*given)]).ravel())
            slopes = (ends[0] - ends[1]) / (2.0 * d)
            bound = 1e-6 * (1.0 + abs(slopes).max(initial=0.0))
            np.testing.assert_allclose(matrix[:, column], slopes, rtol=1e-5, atol=bound)


@pytest.mark.parametrize("name", ALL)
def test_derivatives_at_the_start_are_numbers(name):
    """At rest, where norms of velocities have no derivative."""
    made = model(name)
    state = made.start(made.default_inputs, made.default_parameters, 0.0)
    given = (state, made.default_inputs, made.default_parameters, 0.02, 0.0)
    symbols = [casadi.SX.sym("x", *made.advance.size_in(i)) for i in range(3)]
    found, inputs = casadi.vertcat(*made.advance(*symbols, *given[3:])), casadi.vertcat(*symbols)
    directions = [casadi.SX.ones(*each.shape) for each in (inputs, found)]
    both = casadi.Function(
        "both",
        symbols,
        [casadi.jtimes(found, inputs, d, k == 1) for k, d in enumerate(directions)],
    )
    for derivatives in both(*given[:3]):
        assert np.isfinite(derivatives.full()).all()


def test_observe_gives_the_outputs_of_a_state():
    made = model("AuvPlant")
    step = some("AuvPlant")[0]
    found = made.observe(step.next, step.inputs, step.parameters, step.t + step.h)
    np.testing.assert_allclose(found.full().ravel(), step.outputs, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ALL)
def test_rates_are_what_the_hook_gives(name):
    made, definition = model(name), source(name).definition
    behaviour = definition.behaviour
    hook = behaviour.hooks.get("rates")
    if hook is None:
        with pytest.raises(InputError, match="has no hook rates"):
            made.rates  # noqa: B018
        return
    cls = slave_of(definition.name, import_module(source(name).module))
    inputs = [port for port in definition.ports if port.causality == "input"]
    known = {
        "parameters": definition.parameters.of(
            {port.name: port.start for port in definition.parameters.ports}
        ),
        "inputs": cls.unpack([port.start for port in reals_first(inputs)]),
        "t": 0.0,
    }
    known["state"] = cls(instance_name="it").start(known["parameters"], known["inputs"], 0.0)
    if derive := behaviour.hooks["derive"]:
        taken = behaviour.arguments("derive")
        known["derived"] = derive(*(known[argument] for argument in taken))
    wanted = hook(*(known[argument] for argument in behaviour.arguments("rates")))
    found = made.rates(_row(known["state"]), made.default_inputs, made.default_parameters, 0.0)
    rates = dict(zip(made.state, found.full().ravel(), strict=True))
    fields = {
        field: [rate for path, rate in rates.items() if re.split(r"[.\[]", path)[1] == field]
        for field in behaviour.state._fields
    }
    for field, values in fields.items():
        same = _row(getattr(wanted, field)) if hasattr(wanted, field) else [0.0] * len(values)
        np.testing.assert_allclose(values, same, rtol=1e-12, atol=1e-13)


# Systems

#: Scenarios, and parameters that are free, if not all.
SYSTEMS = (("fig4", None), ("fig5-pd", ["controller"]), ("remus", []))


@pytest.mark.parametrize(("name", "free"), SYSTEMS)
def test_system_gives_the_rows_of_simulate(name, free):
    values = {"plant.noise.std": 0.0}
    run = simulate(name, values, stop_time=1.0, kind="native")
    made = functions.model(name, values, free)
    given = made.default_inputs, made.default_parameters
    state = made.start(*given, 0.0)
    rows = [made.observe(state, *given, 0.0)]
    for t, end in pairwise(run.time):
        state, row = made.advance(state, *given, end - t, t)
        rows.append(row)
    wanted = np.array([run[name] for name in made.outputs]).T
    np.testing.assert_allclose(np.array([row.full().ravel() for row in rows]), wanted, atol=1e-9)


@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_another_order_gives_the_rows_of_simulate(order):
    values = {"plant.noise.std": 0.0}
    settings = {**tomllib.loads(FIG4.read_text()), "order": order, "stop_time": 1.0}
    run = simulate(settings, values, kind="native")
    made = functions.model(settings, values, [])
    given = made.default_inputs, made.default_parameters
    state = made.start(*given, 0.0)
    for k, (t, end) in enumerate(pairwise(run.time)):
        state, row = made.advance(state, *given, end - t, t)
        wanted = [run[name][k + 1] for name in made.outputs]
        np.testing.assert_allclose(row.full().ravel(), wanted, atol=1e-9)
    with pytest.raises(InputError, match="observe: outputs in the order"):
        made.observe  # noqa: B018


# Requests


def test_parameters_are_defaults_or_choose_equations():
    euler, rk4 = model("AuvPlant"), functions.model("AuvPlant", {"integrator": "rk4", "m11": 99.0})
    assert euler.parameters == rk4.parameters
    assert rk4.default_parameters[rk4.parameters.index("m11")] == 99.0
    assert rk4.advance.n_instructions() > 1.5 * euler.advance.n_instructions()
    few = functions.model("AuvPlant", {"m11": 99.0}, free=["tau_max", "ell"])
    assert few.parameters == ["ell", "tau_max.u", "tau_max.q", "tau_max.r"]
    state = few.start(few.default_inputs, few.default_parameters, 0.0)
    wanted = functions.model("AuvPlant", {"m11": 99.0})
    step = (state, [1.0] * len(few.inputs))
    for one, other in zip(
        few.advance(*step, few.default_parameters, 0.02, 0.0),
        wanted.advance(*step, wanted.default_parameters, 0.02, 0.0),
        strict=True,
    ):
        np.testing.assert_allclose(one.full(), other.full(), rtol=1e-14)


@pytest.mark.parametrize(
    ("source", "parameters", "free", "why"),
    [
        ("AuvPlan", {}, None, "AuvPlan: no such component or scenario; did you mean AuvPlant?"),
        ("AuvPlant", {"m1": 1.0}, None, "m1: no such parameter; did you mean m11"),
        ("AuvPlant", {"integrator": "rk5"}, None, "integrator = 'rk5': use one of euler, rk4"),
        ("AuvPlant", {"m11": -1.0}, None, "m11 = -1: must be at least"),
        ("AuvPlant", {"h_max": 1.0}, None, "h_max: a step of a function is one internal step"),
        ("AuvPlant", {"tau_min.u": -0.0, "tau_max.u": 0.0}, None, "must be below tau_max.u"),
        ("AuvPlant", {}, ["noise.seed"], "noise.seed: no such Real parameter"),
        ("stair", {}, None, "stair.py:53: the end of a while depends on a symbol"),
        ("fault-sensor", {}, None, "a function has no events and no tables of inputs"),
    ],
)
def test_what_cannot_be_a_function_is_told_in_a_line(source, parameters, free, why):
    source = examples.EXAMPLES / source if source in examples.NAMES else source
    refusal = functions.refusal(source, parameters, free)
    assert why in refusal
    assert "\n" not in refusal
    with pytest.raises(InputError):
        functions.function(source, parameters, free)


def test_refusal_is_empty_for_a_function():
    assert functions.refusal(examples.EXAMPLES / "pid") == ""


def test_missing_casadi_is_told_in_a_line(monkeypatch):
    monkeypatch.setattr("orchestrator.machine.lazy.find_spec", lambda name: None)
    assert "pip install 'auv-fmu[casadi]'" in functions.refusal("AuvPlant")
