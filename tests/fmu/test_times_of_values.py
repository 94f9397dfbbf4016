"""Values belong to their time: get calls after inputs and after steps, in both kinds."""

from __future__ import annotations

from pathlib import Path

import fmpy
import numpy as np
import pytest

from auv_fmu.water.ocean_current import begin
from auv_fmu.water.sea import Sea, regular_waves, water
from fmus.kinds import KINDS
from orchestrator.machine.compilers import machines_compiler
from support.own import built
from support.raw import Host, Library, Status, initialised, instance

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

#: An integrator whose outputs show its input and the time, too.
SCRIPT = '''\
"""An integrator."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable


class Inputs(NamedTuple):
    """What it integrates."""

    u: Annotated[float, Variable("1", "Rate")] = 2.0


class State(NamedTuple):
    """The integral."""

    x: float


class Outputs(NamedTuple):
    """What is seen."""

    y: Annotated[float, Variable("1", "Integral and rate")]
    at: Annotated[float, Variable("s", "Time of this")]


def start() -> State:
    """At the start."""
    return State(1.0)


def update(state: State, inputs: Inputs, h: float) -> State:
    """A step."""
    return State(state.x + h * inputs.u)


def outputs(state: State, inputs: Inputs, t: float) -> Outputs:
    """What is seen, if the rate is not zero."""
    if inputs.u == 0.0:
        raise Refusal("no rate")
    return Outputs(state.x + inputs.u, t)
'''

U, Y, AT = 0, 1, 2


def library(folder: Path, kind: str, name: str, text: str) -> Library:
    script = folder / f"{name}_{kind}.py"
    script.write_text(text, encoding="utf-8")
    return Library(built(script, kind, folder / name))


@pytest.fixture(scope="module", params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def continuous(kind: str, tmp_path_factory: pytest.TempPathFactory) -> Library:
    return library(tmp_path_factory.mktemp(kind), kind, "followed", SCRIPT)


@pytest.fixture(scope="module")
def sampled(kind: str, tmp_path_factory: pytest.TempPathFactory) -> Library:
    return library(tmp_path_factory.mktemp(kind), kind, "held", f"{SCRIPT}\n\nSAMPLED = True\n")


def put(host: Host, u: float) -> None:
    assert host.set("Real", [U], [u]) == Status.OK


def seen(host: Host) -> tuple[Status, list[float]]:
    return host.get("Real", [Y, AT])


def test_outputs_follow_inputs_at_once(continuous: Library):
    with initialised(continuous) as host:
        assert seen(host) == (Status.OK, [3.0, 0.0])
        put(host, 3.0)
        assert seen(host) == (Status.OK, [4.0, 0.0])
        assert host.step(0.0, 0.5) == Status.OK
        assert seen(host) == (Status.OK, [5.5, 0.5])
        put(host, 1.0)
        assert seen(host) == (Status.OK, [3.5, 0.5])


def test_sampled_outputs_are_held_until_inputs_come(sampled: Library):
    with initialised(sampled) as host:
        put(host, 3.0)
        assert host.step(0.0, 0.5) == Status.OK
        assert seen(host) == (Status.OK, [4.0, 0.0])
        assert host.step(0.5, 0.5) == Status.OK
        assert seen(host) == (Status.OK, [5.5, 0.5])
        put(host, 1.0)
        assert seen(host) == (Status.OK, [5.0, 1.0])
        assert host.step(1.0, 0.5) == Status.OK
        assert seen(host) == (Status.OK, [5.0, 1.0])


def test_outputs_that_are_refused_leave_the_last_ones_and_are_told_once(continuous: Library):
    with initialised(continuous) as host:
        put(host, 0.0)
        for _ in range(2):
            assert seen(host) == (Status.Error, [3.0, 0.0])
        assert host.fault()
        assert host.step(0.0, 0.5) == Status.OK, "a step does not ask for them"
        assert seen(host) == (Status.Error, [3.0, 0.0])
        assert [message.text for message in host.messages] == ["outputs refused: no rate"]
        put(host, 2.0)
        assert seen(host) == (Status.OK, [3.0, 0.5])


def test_sample_that_is_refused_is_a_refused_step_and_changes_nothing(sampled: Library):
    with initialised(sampled) as host:
        put(host, 0.0)
        assert host.step(0.0, 0.5) == Status.Discard
        [message] = host.messages
        assert message.text == "step refused at t = 0 s: no rate"
        put(host, 2.0)
        assert seen(host) == (Status.OK, [3.0, 0.0])


@pytest.mark.parametrize("serialised", [False, True])
def test_restored_instance_holds_its_sample(sampled: Library, serialised: bool):
    """It takes another one in the next step."""
    with initialised(sampled) as host, initialised(sampled) as other:
        assert host.step(0.0, 0.5) == Status.OK
        state = host.get_state()
        if serialised:
            _, state = other.deserialised(host.serialised(state))
            host = other
        else:
            assert host.step(0.5, 0.5) == Status.OK
        assert host.set_state(state) == Status.OK
        assert seen(host) == (Status.OK, [3.0, 0.0])
        assert host.step(0.5, 0.5) == Status.OK
        assert seen(host) == (Status.OK, [4.0, 0.5])


def test_time_is_the_time_of_a_host_that_counts_its_steps(continuous: Library):
    """After a jump, the time is the sum of the steps."""
    start, h = 0.3, 0.1
    with instance(continuous) as host:
        assert host.setup(start) == host.enter() == host.exit() == Status.OK
        for k in range(1000):
            assert host.step(start + k * h, h) == Status.OK
            assert seen(host)[1][1] == start + (k + 1) * h
        t = start + 1000.5 * h
        assert host.step(t, h) == Status.OK
        assert seen(host)[1][1] == t + h


@pytest.mark.parametrize("bundle", ["dist", "native", "dist3"])
def test_a_long_step_of_the_sea_ends_with_the_elevation_of_its_end(request, bundle: str):
    """A tool that steps only this FMU, once a second, shows at t the value at t."""
    fmu = request.getfixturevalue(bundle) / "Sea.fmu"
    table = fmpy.simulate_fmu(
        str(fmu), stop_time=20.0, step_size=1.0, output_interval=1.0, output=["elevation"]
    )
    given = Sea()
    components, begun = regular_waves(given), begin(given.current)
    expected = [
        water(given, components, begun, (0.0, 0.0, 0.0), t).elevation for t in table["time"]
    ]
    assert max(map(abs, expected)) > 0.1
    np.testing.assert_allclose(table["elevation"], expected, rtol=0.0, atol=1e-12)
