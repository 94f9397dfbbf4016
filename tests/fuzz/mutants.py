"""Mutated states: what is taken must be a state that an instance can go on from."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from random import Random
from typing import Any

from support import states
from support.calls import Draw
from support.raw import Host, Library, Status, instance

#: Steps of the runs whose states are mutated, and their length [s].
STEPS, H = 4, 0.02

#: Runs whose states are mutated.
RUNS = 6

#: What no state of those runs has, to tell an instance that has taken none.
_MARK = 123.5


class Taken(Exception):
    """A state that should have been refused, or that did harm."""


def reached(library: Library, seed: int) -> list[bytes]:
    """States that legal calls lead to: one in each mode, one with a refusal."""
    random = Random(seed)
    found: list[bytes] = []
    with instance(library) as host:
        draw = Draw(random, host.description)
        found.append(host.content())
        host.setup(random.choice((0.0, 2.0)))
        for variable in draw.settable("Real"):
            if random.random() < 0.5:
                host.set("Real", [variable.reference], [draw.good_value(variable)])
        host.enter()
        found.append(host.content())
        host.exit()
        for k in range(STEPS):
            inputs = host.description.of("input")
            host.set("Real", [v.reference for v in inputs], [draw.good_value(v) for v in inputs])
            assert host.step(k * H, H) == Status.OK
            found.append(host.content())
        assert host.step(STEPS * H, -H) == Status.Discard
        found.append(host.content())
        host.call("fmi2Terminate")
        found.append(host.content())
    return found


class Trials:
    """Mutated states of one FMU, one after the other, on one instance."""

    def __init__(self, library: Library, others: Sequence[bytes] = ()) -> None:
        """Prepare an instance in a state that no other is like.

        Args:
            library: of the FMU.
            others: states of another FMU, parts of which may come in.

        """
        self.bases = [content for seed in range(RUNS) for content in reached(library, seed)]
        self._lenders = [*filter(None, map(states.read, [*self.bases, *others]))]
        self._host = host = Host(library)
        assert host.instantiate()
        host.setup(_MARK)
        ports = [*host.description.of("input"), *host.description.of("parameter", "Real")]
        host.set("Real", [ports[0].reference], [_MARK])
        assert host.enter() == host.exit() == host.step(_MARK, H) == Status.OK
        self._marked, self._content = host.get_state(), host.content()

    def __call__(self, seed: int) -> None:
        """Try the mutant of a seed.

        Raises:
            Taken: it was taken, or did harm.

        """
        random = Random(seed)
        self.hold(states.mutant(random.choice(self.bases), random, self._lenders))

    def hold(self, mutant: states.Mutant) -> None:
        """Hold the instance against a mutant; afterwards it is as it was before.

        Raises:
            Taken: the mutant was taken, or did harm.

        """
        try:
            self._try(mutant.content)
        except Exception as error:
            raise Taken(f"{mutant.said}: {type(error).__name__}: {error}") from error
        finally:
            assert self._host.set_state(self._marked) == Status.OK
            assert not self._host.fault()

    def _try(self, content: bytes) -> None:
        host = self._host
        status, state = host.deserialised(content)
        if state is None:
            assert status == Status.Error, status.name
            return
        assert status == Status.OK, status.name
        status = host.set_state(state)
        assert host.free_state(state) == Status.OK
        if status == Status.OK:
            self._check_taken()
        else:
            assert status == Status.Error, status.name
            assert host.content() == self._content, "changed, though refused"
            assert host.step(_MARK + H, H) == Status.Error, "a step after a refused state"

    def _check_taken(self) -> None:
        host = self._host
        self._check_values("taken")
        said = states.read(host.content())
        if said is not None:
            self._check_start(said)
        # A step of few internal steps, whatever h_max has become.
        longest = [v for v in host.description.variables if v.name == "h_max"]
        h = min([H, *(10.0 * host.value(v) for v in longest)])
        status = host.step(0.0, h)
        if said is None:
            assert status != Status.Fatal
        elif said["mode"] == "stepping" and h <= said["stop_time"]:
            assert status in (Status.OK, Status.Discard), status.name
        else:
            assert status == Status.Error, status.name
        self._check_values("a step")

    def _check_values(self, when: str) -> None:
        """Values are finite, and those that can be set are within their ranges."""
        values = self._host.values()
        for port in self._host.description.variables:
            value = values[port.name]
            if not isinstance(value, float):
                continue
            assert isfinite(value), f"{port.name} = {value} after {when}"
            if port.causality in ("input", "parameter"):
                low, high = port.minimum, port.maximum
                is_within = (low is None or low <= value) and (high is None or value <= high)
                assert is_within, f"{port.name} = {value} after {when}"

    def _check_start(self, said: dict[str, Any]) -> None:
        """Before the first step all follows from what can be set: it is set on a new instance."""
        mode, description = said["mode"], self._host.description
        if mode not in ("instantiated", "initialising"):
            return
        inputs = dict(zip((v.name for v in description.of("input")), said["inputs"], strict=True))
        with instance(self._host.library) as host:
            host.setup(said["start_time"])
            for name, value in {**inputs, **said["parameters"]}.items():
                variable = description.find(name)
                host.set(variable.type, [variable.reference], [value])
            if mode == "initialising":
                host.enter()
            assert not host.fault(), "taken with values that are refused"
            made = states.without_fault(host.content())
            assert made == states.without_fault(self._host.content()), (
                f"taken with another start than its values have ({mode})"
            )
