"""Sequences of calls, played on FMUs and held against the model and against a second instance.

The second instance of each gets only the good calls: whatever was refused, both must be equal bit
for bit after every call.
"""

from __future__ import annotations

import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from fuzz.model import Model, keep, slot_of
from support import states
from support.calls import Call, Saved, make
from support.raw import TYPES, Host, Library, Status
from support.status_table import creations, without_an_instance
from support.trials import CREATIONS

#: After so many calls the serialised states are compared, too, and in the end.
STATES_EVERY = 10

#: Calls that make and free instances: the model of a sequence knows them beside the table.
MAKE, FREE = "fmi2Instantiate", "fmi2FreeInstance"

#: What an instance is made with where nothing is wrong.
GOOD = "everything as it should be"

#: Calls that read values, which may have to be computed first.
_READING = {f"fmi2Get{fmi_type}" for fmi_type in TYPES}

#: Calls that the rest of a run depends on, and those that save and free states.
_MOVING = {
    *(f"fmi2Set{fmi_type}" for fmi_type in TYPES),
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2DoStep",
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
}


class Action(NamedTuple):
    """A call on an instance, or on what stands in its place."""

    instance: str
    call: Call
    on: str = ""


class Calls(NamedTuple):
    """Actions, and which FMU each instance is of."""

    fmus: Mapping[str, str]
    actions: Sequence[Action]
    threads: bool = False

    def shown(self, libraries: Mapping[str, Library]) -> list[str]:
        """The sequence as lines to be read."""
        lines = [f"{name}: {fmu}" for name, fmu in self.fmus.items()]
        if self.threads:
            lines.append("each instance in a thread of its own")
        for i, (name, call, on) in enumerate(self.actions):
            text = call.shown(libraries[self.fmus[name]].description)
            lines.append(f"{i:4} {name}{f' ({on})' if on else ''}: {text}")
        return lines


class Difference(Exception):
    """An answer that is not the table's."""


@dataclass
class Side:
    """One of two instances, and the states that were saved of it."""

    host: Host
    saved: Saved = field(default_factory=Saved)
    stale: int | None = None

    def on(self, call: Call, on: str) -> Status:
        """Make a call on NULL or on the instance that was freed."""
        lives, self.host.component = self.host.component, None if on == "NULL" else self.stale
        try:
            return make(self.host, call, self.saved)
        finally:
            self.host.component = lives


class Players(ABC):
    """Two instances that a sequence is played on side by side."""

    def __init__(self, *sides: Side) -> None:
        self.sides = sides

    @abstractmethod
    def make(self, case: str) -> None:
        """Instantiate."""

    @abstractmethod
    def play(self, call: Call) -> None:
        """Make a call."""

    @abstractmethod
    def play_on(self, call: Call, on: str) -> None:
        """Make a call on NULL or on the instance that was freed."""

    @abstractmethod
    def compare_all(self) -> None:
        """Hold the two instances against each other in full."""

    @property
    def lives(self) -> bool:
        return self.sides[0].host.component is not None

    @property
    def has_lived(self) -> bool:
        return self.sides[0].stale is not None

    def free(self) -> None:
        for side in self.sides:
            side.stale = side.host.component
            side.host.free()

    def forget(self, prefix: str) -> None:
        """Take the states whose slots begin so for freed: they ended with their instance."""
        for side in self.sides:
            for slot in [slot for slot in side.saved.states if slot.startswith(prefix)]:
                side.saved.freed[slot] = side.saved.states.pop(slot)

    def applies(self, call: Call) -> bool:
        """Whether the slots that a call names are there: shrinking may have taken them away."""
        saved, arguments = self.sides[0].saved, call.arguments
        if "freed" in arguments:
            return arguments["freed"] in saved.freed
        if call.function == "fmi2GetFMUstate":
            return not arguments.get("again") or arguments["slot"] in saved.states
        wanted = arguments.get("slot") or arguments.get("bytes of")
        return wanted is None or wanted in saved.states


class Pair(Players):
    """An instance, and the one beside it that gets the good calls alone."""

    def __init__(
        self, library: Library, saved: Saved, beside: Saved, models: dict[str, Model]
    ) -> None:
        """Prepare.

        Args:
            library: of the FMU.
            saved: states of all instances of this FMU that are tried.
            beside: those of the instances beside them.
            models: what is known of the former, by slot.

        """
        self.library, self._models = library, models
        self.tried, self.beside = Side(Host(library), saved), Side(Host(library), beside)
        super().__init__(self.tried, self.beside)
        self.known = Model(library.description)
        self.count = 0

    def make(self, case: str) -> None:
        made = self.tried.host.instantiate(**CREATIONS[case])
        if made != creations(self.library.description.kind)[case]:
            said = [message.text for message in self.tried.host.messages]
            raise Difference(f"{'an' if made else 'no'} instance with {case}: {said}")
        if made and not self.beside.host.instantiate():
            raise Difference("no instance beside it")
        self.known = Model(self.library.description)

    def forget(self, prefix: str) -> None:
        super().forget(prefix)
        for slot in [slot for slot in self._models if slot.startswith(prefix)]:
            del self._models[slot]

    def play_on(self, call: Call, on: str) -> None:
        status = self.tried.on(call, on)
        if f"fmi2{status.name}" != without_an_instance()[on]:
            raise Difference(f"{status.name} on {on}")

    def play(self, call: Call) -> None:
        cell = self.known.cell(call)
        known = self.known.after(call, self._models)
        expected = cell.answer.status
        if cell.answer.name in ("OK", "new", "restored"):
            status = self._make_beside(call)
            if status != Status.OK:
                if not known.wild:
                    raise Difference(f"the instance beside it answers {status.name}")
                expected, known = f"fmi2{status.name}", self.known.refused(call, status)
        try:
            status = make(self.tried.host, call, self.tried.saved)
        except AssertionError as error:
            raise Difference(str(error)) from error
        if f"fmi2{status.name}" != expected:
            raise Difference(f"{status.name} in the state {self.known.state}, not {expected}")
        keep(self._models, call, self.known)
        self.known = known
        self.count += 1
        self.compare(cell.answer.changes_nothing, self.count % STATES_EVERY == 0)

    def _make_beside(self, call: Call) -> Status:
        """Make a call if a run depends on it, or if it may fail with wild values."""
        side = self.beside
        if call.function not in _MOVING and not (self.known.wild and call.function in _READING):
            return Status.OK
        if call.function == "fmi2SetFMUstate":
            return side.host.set_state(side.saved.states[slot_of(call)])
        return make(side.host, call, side.saved)

    def compare(self, values: bool, state: bool) -> None:
        """Hold the two instances against each other; outputs and `fault` always."""
        tried, beside = self.tried.host, self.beside.host
        try:
            if tried.outputs() != beside.outputs():
                raise Difference("other outputs than without the refused calls")
            # What overflows without any refused call raises it, too.
            if tried.fault() != (self.known.fault or beside.fault()):
                raise Difference(f"fault is {tried.fault()}")
            if values:
                ours, theirs = ({**host.values(), "fault": None} for host in (tried, beside))
                if ours != theirs:
                    changed = [name for name in ours if ours[name] != theirs[name]]
                    raise Difference(f"other values than without refused calls: {changed[:5]}")
            if state:
                contents = [states.without_fault(host.content()) for host in (tried, beside)]
                if contents[0] != contents[1]:
                    raise Difference("another state than without the refused calls")
        except AssertionError as error:
            raise Difference(str(error)) from error

    def compare_all(self) -> None:
        self.compare(values=True, state=True)


def pairs(
    sequence: Calls, libraries: Mapping[str, Library], foreign: Mapping[str, bytes]
) -> dict[str, Players]:
    """Those that hold the instances of a sequence against the model.

    Args:
        sequence: to be played.
        libraries: by the names of their FMUs.
        foreign: to each FMU, a serialised state of another.

    """
    models: dict[str, Model] = {}
    saved, beside = ({fmu: Saved(foreign=foreign[fmu]) for fmu in foreign} for _ in range(2))
    return {
        name: Pair(libraries[fmu], saved[fmu], beside[fmu], models)
        for name, fmu in sequence.fmus.items()
    }


def play(sequence: Calls, players: Mapping[str, Players]) -> None:
    """Play a sequence.

    Args:
        sequence: to be played.
        players: by the names of its instances.

    Raises:
        Difference: an answer is not the one that is expected; says after which action.

    """
    try:
        if sequence.threads:
            _play_in_threads(sequence, players)
        else:
            for i, action in enumerate(sequence.actions):
                _play_one(i, action, players[action.instance])
        for one in players.values():
            if one.lives:
                one.compare_all()
    finally:
        for one in players.values():
            one.free()


def _play_one(i: int, action: Action, players: Players) -> None:
    name, call, on = action
    try:
        if call.function == MAKE:
            if not players.lives:
                players.make(call.case)
        elif on:
            if on == "NULL" or (players.has_lived and not players.lives):
                players.play_on(call, on)
        elif not players.lives:
            pass
        elif call.function == FREE:
            players.compare_all()
            players.free()
            players.forget(f"{name}.")
        elif players.applies(call):
            players.play(call)
    except Difference as difference:
        raise Difference(f"after action {i}, {name}: {difference}") from difference


def _play_in_threads(sequence: Calls, players: Mapping[str, Players]) -> None:
    barrier = threading.Barrier(len(players))
    differences: list[Difference] = []

    def run(name: str) -> None:
        barrier.wait()
        try:
            for i, action in enumerate(sequence.actions):
                if action.instance == name:
                    _play_one(i, action, players[name])
        except Difference as difference:
            differences.append(difference)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    threads = [threading.Thread(target=run, args=(name,)) for name in players]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    sys.setswitchinterval(interval)
    if differences:
        raise differences[0]
