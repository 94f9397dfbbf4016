"""The same calls on both kinds of an FMU: whatever one answers, the other answers."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from ctypes import byref, c_double, c_int
from typing import Any

from fmus.kinds import KINDS, NATIVE, PYTHON
from fuzz.player import STATES_EVERY, Calls, Difference, Players, Side
from support import states
from support.calls import Call, Saved, make
from support.raw import LAST_SUCCESSFUL_TIME_KIND, TERMINATED_KIND, Host, Library, Status
from support.status_table import creations
from support.trials import CREATIONS

#: Steps that are taken from a state, and once more when it is restored, and their length [s].
STEPS, H = 3, 0.02

#: What is wrong with bytes depends on their format.
_REFUSED_STATE = "state refused: "

#: One function PythonFMU spells in its own way.
_OWN_WORDS = re.compile("fmi2?GetRealOutputDerivatives")

#: Nothing that is said is longer [characters].
_LONGEST = 500


class Twins(Players):
    """An instance of each kind."""

    def __init__(self, *sides: Side) -> None:
        super().__init__(*sides)
        self._count = 0

    def make(self, case: str) -> None:
        # Only one of the kinds has resources, and who refuses says so in its own words.
        if creations(PYTHON)[case] == creations(NATIVE)[case]:
            what = f"instances with {case}"
            self._expect_equal(what, lambda s: s.host.instantiate(**CREATIONS[case]))
            self._expect_equal("messages", lambda s: [m.status for m in s.host.messages])
            self._forget_messages()

    def play_on(self, call: Call, on: str) -> None:
        self._expect_equal("statuses", lambda side: side.on(call, on).name)

    def play(self, call: Call) -> None:
        self._expect_equal("statuses", lambda side: make(side.host, call, side.saved).name)
        self._count += 1
        self._compare()
        if self._count % STATES_EVERY == 0:
            self._expect_equal("states", _state)

    def compare_all(self) -> None:
        self._compare()
        self._expect_equal("states", _state)
        self._expect_equal("ways on from the state", _ways_on)
        self._compare()

    def _compare(self) -> None:
        self._expect_equal("values", lambda side: side.host.values())
        self._expect_equal("times of the last step", lambda side: _progress(side.host))
        self._expect_equal("messages", lambda side: _messages(side.host))
        self._forget_messages()

    def _forget_messages(self) -> None:
        for side in self.sides:
            side.host.messages.clear()

    def _expect_equal(self, what: str, answer: Callable[[Side], Any]) -> None:
        ours, theirs = (_outcome(answer, side) for side in self.sides)
        # As text: it tells -0.0 from 0.0, and nan is nan.
        if repr(ours) != repr(theirs):
            parts = (_part(ours, theirs), _part(theirs, ours))
            said = (f"{kind} {part}" for kind, part in zip(KINDS, parts, strict=True))
            raise Difference(f"{what}, {'; '.join(said)}: {what} differ")


def _outcome(answer: Callable[[Side], Any], side: Side) -> Any:
    try:
        return answer(side)
    except AssertionError as error:
        return str(error)


def _messages(host: Host) -> list[tuple[Status, str]]:
    """All but those of refused states: the same words are not told twice, and these differ."""
    return [
        (message.status, _shared(message.text))
        for message in host.messages
        if _REFUSED_STATE not in message.text
    ]


def _shared(text: str) -> str:
    """What is said, without the words that each kind has of its own."""
    return _OWN_WORDS.sub("", text[:_LONGEST])


def _part(value: Any, other: Any) -> str:
    """What of a value is not the other's."""
    if isinstance(value, dict) and isinstance(other, dict):
        value = {key: v for key, v in value.items() if repr(v) != repr(other.get(key, ()))}
    return f"{value!r:.300}"


def _state(side: Side) -> Any:
    """What a state says, but for the bytes that it is written in and the kind it belongs to."""
    said = states.read(side.host.content())
    if said is None:
        return None
    return {key: value for key, value in said.items() if key not in states.OF_THE_KIND}


def _progress(host: Host) -> tuple[Any, ...]:
    """What is known of steps without asking for values."""
    time, over = c_double(), c_int()
    return (
        host.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME_KIND, byref(time)).name, time.value,
        host.call("fmi2GetBooleanStatus", TERMINATED_KIND, byref(over)).name, over.value,
    )  # fmt: skip


def _ways_on(side: Side) -> list[tuple[Status, list[float]]]:
    """What follows from a state, and from the same state once it is restored."""
    host = side.host
    state = host.get_state()
    found = []
    for _ in range(2):
        for k in range(STEPS):
            found.append((host.step(k * H, H), host.outputs()))
        assert host.set_state(state) == Status.OK
    assert host.free_state(state) == Status.OK
    return found


def twins(
    sequence: Calls,
    kinds: tuple[Mapping[str, Library], Mapping[str, Library]],
    foreign: tuple[Mapping[str, bytes], Mapping[str, bytes]],
) -> dict[str, Players]:
    """Those that hold the instances of a sequence against each other.

    Args:
        sequence: to be played.
        kinds: libraries of each kind, by the names of their FMUs.
        foreign: to each FMU of each kind, a serialised state of another.

    """
    saved = [{fmu: Saved(foreign=content[fmu]) for fmu in content} for content in foreign]
    return {
        name: Twins(
            *(Side(Host(of[fmu]), states[fmu]) for of, states in zip(kinds, saved, strict=True))
        )
        for name, fmu in sequence.fmus.items()
    }
