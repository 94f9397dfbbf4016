"""The FMI 2.0 state machine of one instance, as docs/status.md says it, and nothing beyond."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from support.calls import Call
from support.raw import Description, Variable
from support.status_table import ERROR, MODES, SOUND, Cell, rows

_WHILE_REFUSED = ("fmi2DoStep", "anything, while a refusal is not mended")

#: Beyond these sizes values are legal, but where the equations lead with them is not foretold.
LARGEST_TAME, SMALLEST_TAME = 1e4, 1e-6

#: What no good value mends.
_REFERENCE = "value reference"


@dataclass
class Model:
    """What is known of an instance.

    Attributes:
        mode: of the four that a sound instance has.
        in_error: whether it is in the state error.
        fault: whether something was refused since the beginning.
        blocks: what was refused and is not mended: value references, and functions.
        wild: whether it was told values that the equations may overflow with, or that may not go
            with others.
        time: where the next step begins [s].

    """

    description: Description
    mode: str = MODES[0]
    in_error: bool = False
    fault: bool = False
    blocks: frozenset[str] = field(default_factory=frozenset)
    wild: bool = False
    time: float = 0.0

    @property
    def state(self) -> str:
        """The column of the tables."""
        return ERROR if self.in_error else self.mode

    def cell(self, call: Call) -> Cell:
        """What the table says to a call."""
        if call.function == "fmi2DoStep" and self.blocks and not self.in_error:
            return rows()[_WHILE_REFUSED].cells[self.state]
        return rows()[call.function, call.case].cells[self.state]

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
        if leads_to not in (ERROR, SOUND):
            known.mode = leads_to
        if answer.blocks:
            known.blocks |= self._refused(call, bad_only=answer.name == "partly")
        if answer.name in ("OK", "partly"):
            known._take(call)
        return known

    def _port_of(self, call: Call, reference: int) -> str:
        kind = call.function.removeprefix("fmi2Set")
        return self.description.names.get((reference, kind), _REFERENCE)

    def _refused(self, call: Call, bad_only: bool) -> set[str]:
        if "items" not in call.arguments:
            return {call.function}
        items = call.arguments["items"]
        return {self._port_of(call, i.reference) for i in items if not (bad_only and i.good)}

    def _take(self, call: Call) -> None:
        if call.function == "fmi2SetupExperiment":
            self.blocks -= {call.function}
            self.time = call.arguments["start"]
        elif call.function == "fmi2DoStep":
            self.time = call.arguments["time"] + call.arguments["h"]
        elif call.function.startswith("fmi2Set") and "items" in call.arguments:
            for item in call.arguments["items"]:
                if item.good:
                    name = self._port_of(call, item.reference)
                    self.blocks -= {name}
                    self.wild = self.wild or not _is_tame(self.description.find(name), item.value)


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


def _is_tame(port: Variable, value: object) -> bool:
    """Whether no run can overflow with a value, and no other parameter can speak against it."""
    if not isinstance(value, float):
        return True
    if value in (port.minimum, port.maximum):
        return False
    return value == 0.0 or SMALLEST_TAME <= abs(value) <= LARGEST_TAME
