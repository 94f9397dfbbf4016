"""A step whose noise is refused draws nothing from the generator, in both kinds."""

from __future__ import annotations

import pytest

from fmus.kinds import KINDS
from orchestrator.machine.compilers import machines_compiler
from support.own import built
from support.raw import Host, Library, Status, initialised

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

#: Its noise is refused above a limit, and its outputs may be as large as numbers are.
SCRIPT = '''\
"""A noisy component."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, Vector


class Parameters(NamedTuple):
    """What may be set."""

    limit: Annotated[float, Variable("1", "Limit", tunable=True)] = 1e3
    scale: Annotated[float, Variable("1", "Scale", tunable=True)] = 1.0
    at: Annotated[float, Variable("1", "Where it is", tunable=True)] = 0.0


class State(NamedTuple):
    """What it remembers."""

    x: float


class Outputs(NamedTuple):
    """What is seen."""

    y: Annotated[Vector, 3, Variable("1", "Noisy")]


def start() -> State:
    """At the start."""
    return State(0.0)


def update(state: State, h: float) -> State:
    """A step."""
    return State(state.x + h)


def outputs(parameters: Parameters) -> Outputs:
    """Three times the same."""
    x = parameters.at
    return Outputs(Vector((x, x, x)))


def seed() -> int:
    """Of the noise."""
    return 7


def measured(
    parameters: Parameters, n: Annotated[Vector, 3], y: Annotated[Vector, 3]
) -> Annotated[Vector, 3]:
    """With its noise."""
    if n[0] > parameters.limit:
        raise Refusal(f"the noise is {n[0]:g}")
    return Vector((y[i] + parameters.scale * n[i] for i in range(3)))
'''


@pytest.fixture(scope="module", params=KINDS)
def library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("noisy")
    script = folder / f"noisy_{request.param}.py"
    script.write_text(SCRIPT, encoding="utf-8")
    return Library(built(script, request.param, folder / "fmu"))


def put(host: Host, name: str, value: float) -> None:
    assert host.set("Real", [host.library.description.find(name).reference], [value]) == Status.OK


def test_noise_of_refused_steps_is_not_lost(library: Library):
    """Refused by the equations, and for an overflow; past several renewals of the generator."""
    refused = 0
    with initialised(library) as straight, initialised(library) as refusing:
        for k in range(800):
            t = 0.02 * k
            assert straight.step(t, 0.02) == Status.OK
            if k % 5 == 0 or 200 < k < 220:
                name, wild, good = ("limit", -1e3, 1e3) if k % 2 else ("scale", 1.7e308, 1.0)
                state = refusing.get_state()
                put(refusing, name, wild)
                statuses = {refusing.step(t, 0.02) for _ in range(2)}
                put(refusing, name, good)
                refused += statuses == {Status.Discard}
                if Status.OK in statuses:
                    # These numbers are small enough.
                    assert name == "scale"
                    assert refusing.set_state(state) == Status.OK
                assert refusing.free_state(state) == Status.OK
            assert refusing.step(t, 0.02) == Status.OK
            assert refusing.outputs()[:3] == straight.outputs()[:3], k
    assert refused > 100


def test_each_sample_is_finite_though_their_sum_is_not(library: Library):
    with initialised(library) as host:
        put(host, "at", 1.2e308)
        assert host.step(0.0, 0.02) == Status.OK
        assert all(value >= 1.19e308 for value in host.outputs()[:3])
        put(host, "scale", 1.7e308)
        statuses = [host.step(0.02, 0.02) for _ in range(3)]
        assert len({*statuses}) == 1, "the same noise is drawn each time"
