"""What PythonFMU calls to pass values, and how a refusal is told: values, modes and messages.

No exception leaves a callback: PythonFMU would report fmi2Fatal and release its objects twice. It
cannot be told that a call was refused either, so every refusal means the same: it is logged,
`fault` rises, nothing else changes, and steps end with fmi2Discard until it is mended; a value by a
good value of the same port, everything by a reset or by a state that is restored.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import isfinite
from typing import Any, Callable, ClassVar

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from fmus.ports.port import Port, Refusal, Value
from fmus.slave.scripts import place
from fmus.slave.store import MISSING, Store

INSTANTIATED, INITIALISING, STEPPING, TERMINATED = MODES = (
    "instantiated",
    "initialising",
    "stepping",
    "terminated",
)

#: Different messages that an instance logs: a host may step on after a refusal for ever.
MOST_MESSAGES = 100

#: Characters of a message: some hosts have a buffer of 1 or 2 kB for them.
LONGEST_MESSAGE = 500

#: What is refused, where it is neither a port nor a call: a reference that belongs to no port, and
#: the initialisation with the values that there are.
REFERENCE, INITIALISATION = "value reference", "initialisation"

#: Calls that are refused in the wrong mode, or with arguments that do not fit.
REFUSED_CALLS = (
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2SetFMUstate",
)


class Callbacks(Fmi2Slave):  # type: ignore[misc]
    """A slave whose values lie in a :class:`~fmus.slave.store.Store`."""

    #: Ports without `fault`, inputs first, then outputs, then parameters.
    ports: ClassVar[tuple[Port, ...]]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._store = Store(self.ports)
        self._mode = INSTANTIATED
        #: Whether a value has changed that state and outputs at the start time depend on.
        self._stale = False
        self._said: set[str] = set()

    @abstractmethod
    def _refresh(self) -> None:
        """Compute state and outputs at the start time, if a value they depend on has changed."""

    @abstractmethod
    def _retune(self, parameters: dict[str, Value]) -> None:
        """Let parameters act from the next step; raise what speaks against them."""

    # Refusals and messages

    def _refuse(self, what: str, why: str) -> None:
        """Take no step until what was refused is mended."""
        self._store.refused[what] = why[:LONGEST_MESSAGE]
        self._report(why)

    def _report(self, message: str, key: str | None = None) -> None:
        """Raise `fault` and log."""
        self._store.fault = True
        self.say(message, Fmi2Status.discard, key)

    def say(self, message: str, status: Fmi2Status, key: str | None = None) -> None:
        """Log a message, the first time only that its key, or else its text, comes up.

        The host adds the name of the instance.
        """
        said = (key or message)[:LONGEST_MESSAGE]
        if said in self._said or len(self._said) >= MOST_MESSAGES:
            return
        self._said.add(said)
        if len(self._said) == MOST_MESSAGES:
            message += "; what comes after this is not logged"
        # FMI defines a log message as a format: a host would take a % for a directive.
        self.log(message[:LONGEST_MESSAGE].replace("%", "%%"), status)

    def _attempt(self, what: str, refused: str, action: Callable[[], None]) -> None:
        """Do something that is refused if it raises, and mended if it does not."""
        try:
            action()
        except BaseException as error:
            self._refuse(what, f"{refused}: {explained(error)}")
        else:
            self._store.refused.pop(what, None)

    def _follows(self, call: str, mode: str) -> bool:
        """Whether a call comes in the one mode that it is allowed in; else it is refused."""
        if self._mode != mode:
            self._refuse(call, f"{call} is not allowed when {self._mode}")
        return self._mode == mode

    # Values

    def get_real(self, vrs: list[int]) -> list[float]:
        if self._stale:
            self._refresh()
        store = self._store
        # PythonFMU reads the list and lets go of it, so it need not be a copy.
        return store.outputs if vrs == store.output_references else self._get(vrs, "Real")

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get(vrs, "Integer")

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        if self._stale:
            self._refresh()
        store = self._store
        return [store.fault] if vrs == store.fault_references else self._get(vrs, "Boolean")

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get(vrs, "String")

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        store = self._store
        # A sum is finite only if every value is; _set finds out which one was not.
        if (
            vrs == store.input_references
            and self._mode == STEPPING
            and not store.refused
            and isfinite(sum(values))
        ):
            store.inputs = values
        else:
            self._set(vrs, values, "Real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(vrs, values, "Integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(vrs, values, "Boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set(vrs, values, "String")

    def _get(self, vrs: list[int], kind: str) -> list[Any]:
        values: list[Value] = []
        for reference in vrs:
            try:
                values.append(self._store.get(reference, kind))
            except Refusal as refusal:
                self._refuse(REFERENCE, str(refusal))
                values.append(MISSING[kind])
        return values

    def _set(self, vrs: list[int], values: Sequence[Value], kind: str) -> None:
        for reference, value in zip(vrs, values):
            name = REFERENCE
            try:
                port = self._store.port(reference, kind)
                name = port.name
                self._change(port, reference, value)
            except BaseException as error:
                self._refuse(name, explained(error))
            else:
                self._store.refused.pop(name, None)
                self._stale = self._mode == INITIALISING

    def _change(self, port: Port, reference: int, value: Value) -> None:
        if port.causality == "output":
            raise Refusal(f"{port.name} is an output and cannot be set")
        if self._mode == TERMINATED:
            raise Refusal(f"{port.name} cannot be set after fmi2Terminate")
        if port.variability == "fixed" and self._mode == STEPPING:
            raise Refusal(f"{port.name} is fixed and cannot be set after the initialisation")
        store = self._store
        port.checked(value)
        if port.causality == "input":
            store.set_input(reference, float(value))
            return
        parameters = {**store.parameters, port.name: value}
        if self._mode == STEPPING:
            self._retune(parameters)
        else:
            store.parameters = parameters


def explained(error: BaseException) -> str:
    """What speaks against something; what is no refusal of ours is named as what it is."""
    if isinstance(error, Refusal):
        return str(error)
    return f"{place(error)}{type(error).__name__}: {error}"
