"""What hosts make of a refusal: none ends the run as a success, and a reset leaves nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import hypot, nan
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated
from fmpy.model_description import ModelDescription, read_model_description
from fmpy.simulation import instantiate_fmu

from fmus.kinds import NATIVE, PYTHON
from orchestrator import simulate
from orchestrator.cosim import Experiment
from orchestrator.exchange import hosts
from orchestrator.exchange.hosts import HOSTS, real_outputs
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop

#: Fixtures of the FMUs of each kind and version.
FMUS = {PYTHON: "dist", NATIVE: "native", "native-3": "dist3"}


class Refused(NamedTuple):
    """A run with a step, or an input, that the component refuses.

    Attributes:
        name: of the component.
        values: of its parameters at the start.
        inputs: that are set for the whole run.
        step: of the run [s].
        steps: that it would have; the refused one is among them.
        why: a word of the reason.

    """

    name: str
    values: Mapping[str, float] = {}
    inputs: Mapping[str, float] = {}
    step: float = 0.02
    steps: int = 10
    why: str = ""


#: By what is refused.
REFUSALS = {
    "an exception of the equations": Refused(
        "MotionPlanner", {"tau_d.q": 8.0}, step=0.5, steps=20, why="pitch"
    ),
    "a value that is not finite": Refused("Allocation", inputs={"tau.u": nan}, why="finite"),
    "a state out of bounds": Refused(
        "AuvPlant", {"m11": 1e-9}, {"tau_w.u": 1e300}, why="the state is not finite"
    ),
    "a step that is too long": Refused("AuvPlant", step=2500.0, why="2500"),
}
CASES = [pytest.param(kind, case, id=f"{kind}-{case}") for kind in FMUS for case in REFUSALS]


@pytest.fixture
def fmu(request: pytest.FixtureRequest) -> Callable[[str, str], Path]:
    return lambda kind, name: request.getfixturevalue(FMUS[kind]) / f"{name}.fmu"


def described(path: Path) -> tuple[ModelDescription, dict[str, Any]]:
    description = read_model_description(path)
    return description, {v.name: v for v in description.modelVariables}


def table(refused: Refused) -> np.ndarray | None:
    """The inputs as fmpy takes them."""
    if not refused.inputs:
        return None
    names = ["time", *refused.inputs]
    row = (0.0, *refused.inputs.values())
    return np.array([row], dtype=[(name, float) for name in names])


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_fmpy_does_not_end_the_run_as_a_success(fmu, kind: str, case: str):
    refused = REFUSALS[case]
    heard: list[str] = []
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(
            fmu(kind, refused.name),
            start_values=dict(refused.values),
            input=table(refused),
            step_size=refused.step,
            output_interval=refused.step,
            stop_time=refused.steps * refused.step,
            debug_logging=True,  # what is discarded is no error
            logger=lambda *arguments: heard.append(arguments[-1].decode()),
            # fmpy repeats a discarded step for ever, if the FMU lets it.
            timeout=60.0,
        )
    assert refused.why in heard[-1]


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_our_master_fails_with_the_reason(fmu, kind: str, case: str):
    refused = REFUSALS[case]
    given = {f"{refused.name}.{n}": v for n, v in {**refused.values, **refused.inputs}.items()}
    try:
        result = simulate(
            fmu(kind, refused.name),
            given,
            stop_time=refused.steps * refused.step,
            step=refused.step,
        )
    except ValueError as error:
        said = str(error)  # of what it knows not to be a value
    else:
        said = result.failure or ""
    assert refused.why in said


# By hand


class Driven:
    """An instance of either version of FMI, as fmpy calls it."""

    def __init__(self, path: Path) -> None:
        description, self.variables = described(path)
        self._slave = instantiate_fmu(fmpy.extract(str(path)), description)
        self.is_3 = description.fmiVersion.startswith("3")
        self.outputs = [
            v.valueReference
            for v in description.modelVariables
            if v.causality == "output" and v.type in ("Real", "Float64")
        ]

    def __enter__(self) -> Driven:
        return self

    def __exit__(self, *_: object) -> None:
        self._slave.freeInstance()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._slave, name)

    def start(self, values: Mapping[str, float] = {}) -> None:
        if not self.is_3:
            self._slave.setupExperiment(startTime=0.0)
        self.set(values)
        self._slave.enterInitializationMode()
        self._slave.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        references = [self.variables[name].valueReference for name in values]
        function = self._slave.setFloat64 if self.is_3 else self._slave.setReal
        function(references, [*values.values()])

    def step(self, k: int, h: float) -> tuple[float, ...]:
        self._slave.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)
        get = self._slave.getFloat64 if self.is_3 else self._slave.getReal
        return tuple(get(self.outputs))

    def make(self, refused: Refused) -> None:
        self.set(refused.inputs)
        for k in range(refused.steps):
            self.step(k, refused.step)

    @property
    def fault(self) -> bool:
        reference = [self.variables["fault"].valueReference]
        return bool(self._slave.getBoolean(reference)[0])

    def run(self, steps: int = 5) -> list[tuple[float, ...]]:
        return [self.step(k, 0.02) for k in range(steps)]


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_a_refusal_leaves_nothing_after_a_reset(fmu, kind: str, case: str):
    refused = REFUSALS[case]
    path = fmu(kind, refused.name)
    with Driven(path) as fresh:
        fresh.start()
        expected = fresh.run()
    with Driven(path) as driven:
        driven.start(refused.values)
        with pytest.raises(FMICallException, match=r"status 2"):
            driven.make(refused)
        assert driven.fault
        if not driven.is_3:
            with pytest.raises(FMICallException):
                driven.getBooleanStatus(fmi2Terminated)
            last = driven.getRealStatus(fmi2LastSuccessfulTime)
            taken = 13 if "tau_d.q" in refused.values else 0
            assert last == taken * refused.step, "the end of the last step that was taken"
        driven.reset()
        assert not driven.fault
        if not driven.is_3:
            assert driven.getRealStatus(fmi2LastSuccessfulTime) == 0.0
        driven.start()
        assert driven.run() == expected
        assert not driven.fault


def test_kinds_agree_on_the_largest_state_to_its_last_bit(fmu):
    random, answers = Random(1), set()
    with Driven(fmu(PYTHON, "AuvPlant")) as python, Driven(fmu(NATIVE, "AuvPlant")) as native:
        for _ in range(200):
            place = [random.uniform(0.5, 1.0) for _ in range(3)]
            scale = 1e100 / hypot(*place) * (1.0 + random.randint(-2, 2) * 2.0**-53)
            values = {f"eta0.{name}": x * scale for name, x in zip("xyz", place, strict=True)}
            said = {_starts(one, values) for one in (python, native)}
            assert len(said) == 1, values
            answers |= said
    assert answers == {True, False}


def _starts(driven: Driven, values: Mapping[str, float]) -> bool:
    driven.reset()
    try:
        driven.start(values)
    except FMICallException:
        return False
    return True


# Tools


@pytest.mark.parametrize("kind", [PYTHON, NATIVE])
@pytest.mark.parametrize("host", [name for name in HOSTS if not name.startswith("fmpy")])
@pytest.mark.slow
def test_no_tool_ends_the_run_as_a_success(fmu, host: str, kind: str):
    """The loop of Fig. 4 whose planner refuses its reference at 6.68 s."""
    if HOSTS[host].label() is None or HOSTS[host].pins:
        pytest.skip(f"{HOSTS[host].package} is not installed")
    scenario = read_scenario("fig4")
    wrong = replace(scenario, parameters={**scenario.parameters, "planner.tau_d.q": 8.0})
    system = closed_loop(fmu(kind, "AuvPlant").parent, wrong)
    experiment = Experiment(8.0, 0.02, "jacobi")
    try:
        rows, *_ = hosts._run(HOSTS[host], host, system, experiment, print)
    except InputError:
        return
    # It looks at no status. Its page says so; nothing moves after the refusal.
    assert host == "ecos"
    planned = [k for k, (name, *_) in enumerate(real_outputs(system)) if name == "planner"]
    assert (rows[334:, planned] == rows[333, planned]).all()
