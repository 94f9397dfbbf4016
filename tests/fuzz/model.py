"""The FMI 2.0 state machine of one instance, as fmi-answers.md says it, and nothing beyond."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

from support.calls import BEYOND, ODD_TRUTH, SAME, Call
from support.raw import Description, Status, Variable
from support.settings import trials_of
from support.status_table import ERROR, MODES, Cell, rows

_FIXED, _STEP = "a fixed parameter", "a step"

#: By which share of a time a step may end after the stop time.
ROUNDING = 1e-9

#: Beyond these sizes values are legal, but where the equations lead with them is not foretold.
LARGEST_TAME, SMALLEST_TAME = 1e4, 1e-6


@dataclass
class Model:
    """What is known of an instance.

    Attributes:
        mode: of the four that a sound instance has.
        in_error: whether it is in the state error.
        fault: whether something was discarded since the beginning.
        values: of the ports that were set, by name.
        wild: whether it was told values that the equations may overflow with, or that may not go
            with others.
        time: where the next step begins [s].
        start, stop: of the run; infinite: no stop time [s].

    """

    description: Description
    mode: str = MODES[0]
    in_error: bool = False
    fault: bool = False
    values: Mapping[str, Any] = field(default_factory=dict)
    wild: bool = False
    time: float = 0.0
    start: float = 0.0
    stop: float = inf

    @property
    def state(self) -> str:
        """The column of the tables."""
        return ERROR if self.in_error else self.mode

    def cell(self, call: Call) -> Cell:
        """What the table says to a call."""
        case = call.case
        if case in (_FIXED, SAME, ODD_TRUTH):
            [item] = call.arguments["items"]
            port = self._port_of(call, item.reference)
            same = _meant(port, item.value) == self.values.get(port.name, port.start)
            case = SAME if same else _FIXED
        if call.function == "fmi2DoStep" and (case == BEYOND or self._is_beyond(call)):
            case = BEYOND if self._is_beyond(call) else _STEP
        return rows()[call.function, case].cells[self.state]

    def after(self, call: Call, saved: Mapping[str, Model]) -> Model:
        """What is known once a call was answered as the table says.

        Args:
            call: that was made.
            saved: what was known when states were saved, by slot.

        """
        answer, leads_to = self.cell(call)
        if answer.name == "new":
            return Model(self.description)
        if answer.name == "restored":
            return saved[slot_of(call)]
        known = replace(self, fault=self.fault or answer.raises_fault)
        known.in_error = leads_to == ERROR
        if leads_to != ERROR:
            known.mode = leads_to
        if answer.name == "OK":
            known._take(call)
        return known

    def refused(self, call: Call, status: Status) -> Model:
        """What is known once a call was refused that the table has nothing against."""
        fails = status == Status.Error and not call.function.startswith("fmi2Get")
        return replace(self, in_error=self.in_error or fails)

    def _is_beyond(self, call: Call) -> bool:
        end = call.arguments["time"] + call.arguments["h"]
        return bool(end > self.stop + ROUNDING * max(abs(self.start), abs(self.stop)))

    def _port_of(self, call: Call, reference: int) -> Variable:
        kind = call.function.removeprefix("fmi2Set")
        return self.description.find(self.description.names[reference, kind])

    def _take(self, call: Call) -> None:
        if call.function == "fmi2SetupExperiment":
            start, stop = call.arguments["start"], call.arguments["stop"]
            self.time = self.start = start
            self.stop = stop if stop is not None and stop > start else inf
        elif call.function == "fmi2DoStep":
            self.time = call.arguments["time"] + call.arguments["h"]
        elif call.function.startswith("fmi2Set") and "items" in call.arguments:
            for item in call.arguments["items"]:
                port = self._port_of(call, item.reference)
                self.values = {**self.values, port.name: _meant(port, item.value)}
                wild = trials_of(self.description.name).wild.get(port.name)
                self.wild = self.wild or _meant(port, item.value) == wild
                self.wild = self.wild or not _is_tame(port, item.value)


def slot_of(call: Call) -> str:
    """The slot of the state that a call is about."""
    slot: str = call.arguments.get("slot") or call.arguments["bytes of"]
    return slot


def keep(saved: dict[str, Model], call: Call, known: Model) -> None:
    """Keep what is known when a call saves a state, and forget it when one is freed.

    Args:
        saved: by slot; changed.
        call: that is made.
        known: before it.

    """
    if known.cell(call).answer.name != "OK":
        return
    if call.function == "fmi2GetFMUstate":
        saved[slot_of(call)] = replace(known, in_error=False)
    elif call.function == "fmi2FreeFMUstate" and "slot" in call.arguments:
        del saved[slot_of(call)]


def _meant(port: Variable, value: Any) -> Any:
    return bool(value) if port.type == "Boolean" else value


def _is_tame(port: Variable, value: object) -> bool:
    """Whether no run can overflow with a value, and no other parameter can speak against it."""
    if not isinstance(value, float):
        return True
    if value in (port.minimum, port.maximum):
        return False
    # Only what is drawn to be extreme is -0.0, where a way may come back to itself.
    return repr(value) == "0.0" or SMALLEST_TAME <= abs(value) <= LARGEST_TAME
