"""What PythonFMU calls to pass values, and how a refusal is told: values, faults and messages.

No exception leaves a callback: PythonFMU would report fmi2Fatal and release its objects twice. A
refusal is logged, raises `fault`, and ends the next step with fmi2Discard.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import isfinite
from typing import Any, Callable, ClassVar

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from fmus.ports.port import Port, Refusal, Value
from fmus.slave.store import MISSING, Store

INSTANTIATED, INITIALISING, STEPPING = "instantiated", "initialising", "stepping"


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

    # Faults and messages

    def _report(self, message: str, key: str | None = None) -> None:
        """Raise `fault` and log."""
        self._store.fault = True
        self.say(message, Fmi2Status.discard, key)

    def say(self, message: str, status: Fmi2Status, key: str | None = None) -> None:
        """Log a message, the first time only that its key, or else its text, comes up.

        The host adds the name of the instance.
        """
        if (key or message) not in self._said:
            self._said.add(key or message)
            # FMI defines a log message as a format: a host would take a % for a directive.
            self.log(message.replace("%", "%%"), status)

    def _guarded(self, action: str, function: Callable[[], None]) -> None:
        """Run a callback's body; whatever it raises is reported instead."""
        try:
            function()
        except BaseException as error:
            self._report(f"{action}: {type(error).__name__}: {error}")

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
                self._report(str(refusal))
                values.append(MISSING[kind])
        return values

    def _set(self, vrs: list[int], values: Sequence[Value], kind: str) -> None:
        for reference, value in zip(vrs, values):
            try:
                port = self._store.port(reference, kind)
                if port.causality == "input":
                    self._store.accept(port, value)
                    self._store.set_input(reference, float(value))
                else:
                    self._set_parameter(port, value)
                self._stale = self._mode == INITIALISING
            except BaseException as error:
                self._report(str(error))

    def _set_parameter(self, port: Port, value: Value) -> None:
        if port.causality != "parameter":
            raise Refusal(f"{port.name} is an output and cannot be set")
        if port.variability == "fixed" and self._mode == STEPPING:
            raise Refusal(f"{port.name} is fixed and cannot be set after the initialisation")
        store = self._store
        store.accept(port, value)
        parameters = {**store.parameters, port.name: value}
        if self._mode != STEPPING:
            store.parameters = parameters
            return
        try:
            self._retune(parameters)
        except Exception as error:
            store.refused[port.name] = str(error)
            raise
