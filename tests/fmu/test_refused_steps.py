"""Refusals in hosts: none ends the run as a success, and a reset leaves no trace."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import byref, c_double
from dataclasses import replace
from math import hypot, nan
from pathlib import Path
from random import Random
from typing import NamedTuple

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from fmus.kinds import KINDS, NATIVE, PYTHON
from orchestrator import simulate
from orchestrator.cosim import Experiment
from orchestrator.exchange import hosts
from orchestrator.exchange.hosts import HOSTS, real_outputs
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from support.fmi3 import Fmi3Library
from support.raw import LAST_SUCCESSFUL_TIME_KIND, Host, Library, Status, instance

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


#: Runs by the reason of the refusal.
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
    messages: list[str] = []
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(
            fmu(kind, refused.name),
            start_values=dict(refused.values),
            input=table(refused),
            step_size=refused.step,
            output_interval=refused.step,
            stop_time=refused.steps * refused.step,
            debug_logging=True,  # else only errors are logged
            logger=lambda *arguments: messages.append(arguments[-1].decode()),
            # fmpy repeats a discarded step without end if the FMU lets it.
            timeout=60.0,
        )
    assert refused.why in messages[-1]


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
        message = str(error)  # refused before the run
    else:
        message = result.failure or ""
    assert refused.why in message


# By hand


def put(host: Host, values: Mapping[str, float]) -> Status:
    references = [host.description.find(name).reference for name in values]
    return host.set("Real", references, [*values.values()])


def started(host: Host, values: Mapping[str, float] = {}) -> Status:
    host.setup()
    put(host, values)
    return max(host.enter(), host.exit())


def ran(host: Host) -> list[tuple[Status, list[float]]]:
    return [(host.step(0.02 * k, 0.02), host.outputs()) for k in range(5)]


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_a_refusal_leaves_nothing_after_a_reset(fmu, tmp_path: Path, kind: str, case: str):
    refused = REFUSALS[case]
    folder = Path(fmpy.extract(str(fmu(kind, refused.name)), tmp_path))
    opened = Fmi3Library(folder) if kind == "native-3" else Library(folder)
    with instance(opened) as fresh, instance(opened) as host:
        assert started(fresh) == started(host, refused.values) == Status.OK
        status, taken = put(host, refused.inputs), 0
        while status == Status.OK:
            status = host.step(taken * refused.step, refused.step)
            taken += status == Status.OK
        assert (status, taken) == (Status.Discard, 13 if "tau_d.q" in refused.values else 0)
        assert host.fault()
        last = c_double()
        if kind != "native-3":
            assert host.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME_KIND, byref(last)) == 0
            assert last.value == taken * refused.step, "the end of the last step that was taken"
        assert host.call("fmi2Reset") == started(host) == Status.OK
        assert not host.fault()
        assert ran(host) == ran(fresh)


def test_kinds_agree_on_the_largest_state_to_its_last_bit(fmu, tmp_path: Path):
    random, answers = Random(1), set()
    folders = [fmpy.extract(str(fmu(kind, "AuvPlant")), tmp_path / kind) for kind in KINDS]
    python, native = (Library(Path(folder)) for folder in folders)
    with instance(python) as first, instance(native) as second:
        for _ in range(200):
            place = [random.uniform(0.5, 1.0) for _ in range(3)]
            scale = 1e100 / hypot(*place) * (1.0 + random.randint(-2, 2) * 2.0**-53)
            values = {f"eta0.{name}": x * scale for name, x in zip("xyz", place, strict=True)}
            outcomes = set()
            for host in (first, second):
                host.call("fmi2Reset")
                outcomes.add(started(host, values) == Status.OK)
            assert len(outcomes) == 1, values
            answers |= outcomes
    assert answers == {True, False}


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
