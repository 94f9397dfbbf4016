"""The hardened slave that every component of the bundle extends.

PythonFMU turns a Python class into an FMU. What it leaves to the class is done here, once:

- Values live in one indexed store. A host that passes all inputs or all outputs of a component
  in one call, in their order, costs one comparison instead of one accessor a value.
- No exception of the component leaves a callback: PythonFMU would report fmi2Fatal and release
  its objects twice. A refusal is logged, raises `fault`, and ends the next step with
  fmi2Discard.
- A step is a transaction: state and outputs change together, after everything was computed and
  found finite.
- The state of the FMU is complete and exact, in memory and serialised.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import ceil, isfinite
from typing import Any, Callable, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu import DefaultExperiment, Fmi2Slave
from pythonfmu.enums import Fmi2Status

from auv_fmu import __version__
from fmus.ports.description import describe
from fmus.ports.port import FAULT, Port, Refusal, Value

#: A step may exceed `h_max` by this share without being split: hosts round their time.
ROUNDING = 1e-9

#: Longest step of a component that has no internal steps [s].
_NO_LIMIT = 1e300

#: More internal steps than this in one communication step are taken for a mistake.
MOST_INTERNAL_STEPS = 1_000_000

_INSTANTIATED, _INITIALISING, _STEPPING = "instantiated", "initialising", "stepping"
_MISSING = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}


def _frozen(value: Any) -> Any:
    """Lists, as JSON gives them, back to the tuples that states are made of."""
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value


class Component(Fmi2Slave):  # type: ignore[misc]
    """Base of all components.

    A component declares `ports` and `state_type` and implements :meth:`configure`,
    :meth:`begin` and :meth:`advance`. These may raise: what they raise becomes a refusal.
    """

    author = "auv-fmu"
    license = "MIT"
    version = __version__
    default_experiment = DefaultExperiment(0.0, 100.0, 0.02)

    #: Ports without `fault`, inputs first, then outputs, then parameters.
    ports: ClassVar[tuple[Port, ...]] = ()
    #: NamedTuple of the component's state.
    state_type: ClassVar[Any] = tuple

    def configure(self, values: dict[str, Any]) -> None:
        """Take the values of all parameters, by name; raise Refusal if they do not fit."""
        raise NotImplementedError

    def begin(self, inputs: Sequence[float], t: float) -> tuple[Any, list[float]]:
        """State and Real outputs at the start time."""
        raise NotImplementedError

    def advance(
        self, state: Any, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[Any, list[float]]:
        """State and Real outputs after n internal steps of h seconds with held inputs."""
        raise NotImplementedError

    def sample(self, outputs: list[float]) -> None:
        """Change outputs in place once a communication point, after the step was accepted."""

    def hidden_state(self) -> Any:
        """What a component keeps outside its state: JSON-safe, immutable."""
        return None

    def restore_hidden_state(self, hidden: Any) -> None:
        """Take back what :meth:`hidden_state` gave."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._ports = (*self.ports, FAULT)
        self._input_vrs = self._references("input", "Real")
        self._output_vrs = self._references("output", "Real")
        self._fault_vrs = [len(self._ports) - 1]
        self._inputs = [0.0] * len(self._input_vrs)
        self._outputs = [0.0] * len(self._output_vrs)
        self._parameters: dict[str, Any] = {
            port.name: port.start for port in self.ports if port.causality == "parameter"
        }
        self._state: Any = None
        self._mode = _INSTANTIATED
        self._stale = False
        self._start_time = 0.0
        self._longest_step = 0.0
        self._fault = False
        self._refused: dict[str, str] = {}
        self._said: set[str] = set()

    def _references(self, causality: str, kind: str) -> list[int]:
        return [
            reference
            for reference, port in enumerate(self._ports)
            if port.causality == causality and port.kind == kind
        ]

    # Faults and messages

    def _report(self, message: str, key: str | None = None) -> None:
        """Raise `fault` and log."""
        self._fault = True
        self.say(message, Fmi2Status.discard, key)

    def say(self, message: str, status: Fmi2Status, key: str | None = None) -> None:
        """Log a message, the first time only that its key, or else its text, comes up.

        The host adds the name of the instance.
        """
        if (key or message) not in self._said:
            self._said.add(key or message)
            # FMI defines a log message as a format: a host would take a % for a directive.
            self.log(message.replace("%", "%%"), status)

    def _guarded(self, action: str, function: Callable[[], None]) -> bool:
        """Run a callback's body; whatever it raises is reported instead."""
        try:
            function()
        except BaseException as error:
            self._report(f"{action}: {type(error).__name__}: {error}")
            return False
        return True

    # Experiment

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        if isfinite(start_time):
            self._start_time = start_time
        else:
            self._report(f"start time {start_time}: must be finite")

    def enter_initialization_mode(self) -> None:
        self._mode = _INITIALISING
        self._stale = True

    def exit_initialization_mode(self) -> None:
        self._refresh()
        self._mode = _STEPPING

    def _refresh(self) -> None:
        """Compute state and outputs at the start time, if a value they depend on has changed."""
        if self._stale:
            self._stale = False
            self._guarded("initialisation refused", self._begin)

    def _begin(self) -> None:
        self._refused.pop("initialisation", None)
        try:
            self._configure(self._parameters)
            state, outputs = self.begin(self._inputs, self._start_time)
            if not isfinite(sum(outputs)):
                raise Refusal("an output is not finite")
        except Exception as error:
            self._refused["initialisation"] = str(error)
            raise
        self._state, self._outputs = state, outputs
        self.sample(outputs)

    def _configure(self, parameters: dict[str, Any]) -> None:
        self.configure(parameters)
        self._longest_step = parameters.get("h_max", _NO_LIMIT) * (1.0 + ROUNDING)

    # Steps

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by one communication step.

        A step longer than `h_max` is split evenly, a zero step changes nothing, a negative one
        is refused. After a refusal everything is as it was before the step.
        """
        try:
            if self._refused or self._mode != _STEPPING:
                raise Refusal("; ".join(self._refused.values()) or "not initialised")
            if 0.0 < step_size <= self._longest_step and isfinite(current_time):
                n = 1
            else:
                n = self._internal_steps(current_time, step_size)
                if n == 0:
                    return True
            state, outputs = self.advance(self._state, self._inputs, current_time, step_size / n, n)
            if not isfinite(sum(outputs)):
                raise Refusal("an output is no longer finite")
            self._state, self._outputs = state, outputs
            self.sample(outputs)
        except BaseException as error:
            what = str(error) if isinstance(error, Refusal) else f"{type(error).__name__}: {error}"
            self._report(f"step refused at t = {current_time:g} s: {what}", key=what)
            return False
        return True

    def _internal_steps(self, current_time: float, step_size: float) -> int:
        if not isfinite(current_time) or not isfinite(step_size):
            raise Refusal(f"time {current_time} and step {step_size} must be finite")
        if step_size < 0.0:
            raise Refusal(f"step {step_size:g} s is negative")
        n = ceil(step_size / self._longest_step)
        if n > MOST_INTERNAL_STEPS:
            raise Refusal(f"step {step_size:g} s needs {n} internal steps; raise h_max")
        return n

    # Values

    def get_real(self, vrs: list[int]) -> list[float]:
        if self._stale:
            self._refresh()
        # PythonFMU reads the list and lets go of it, so it need not be a copy.
        return self._outputs if vrs == self._output_vrs else self._get(vrs, "Real")

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get(vrs, "Integer")

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        if self._stale:
            self._refresh()
        return [self._fault] if vrs == self._fault_vrs else self._get(vrs, "Boolean")

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get(vrs, "String")

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        # A sum is finite only if every value is; _set finds out which one was not.
        if (
            vrs == self._input_vrs
            and self._mode == _STEPPING
            and not self._refused
            and isfinite(sum(values))
        ):
            self._inputs = values
        else:
            self._set(vrs, values, "Real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(vrs, values, "Integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(vrs, values, "Boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set(vrs, values, "String")

    def _port(self, reference: int, kind: str) -> Port:
        if not 0 <= reference < len(self._ports) or self._ports[reference].kind != kind:
            raise Refusal(f"no {kind} has the value reference {reference}")
        return self._ports[reference]

    def _get(self, vrs: list[int], kind: str) -> list[Any]:
        values: list[Any] = []
        for reference in vrs:
            try:
                values.append(self._value(reference, self._port(reference, kind)))
            except Refusal as refusal:
                self._report(str(refusal))
                values.append(_MISSING[kind])
        return values

    def _value(self, reference: int, port: Port) -> Value:
        if port is FAULT:
            return self._fault
        if port.causality == "parameter":
            value: Value = self._parameters[port.name]
            return value
        if port.causality == "input":
            return self._inputs[self._input_vrs.index(reference)]
        return self._outputs[self._output_vrs.index(reference)]

    def _set(self, vrs: list[int], values: Sequence[Value], kind: str) -> None:
        for reference, value in zip(vrs, values):
            try:
                port = self._port(reference, kind)
                if port.causality == "input":
                    self._set_input(reference, port, value)
                else:
                    self._set_parameter(port, value)
            except BaseException as error:
                self._report(str(error))

    def _set_input(self, reference: int, port: Port, value: Value) -> None:
        self._accept(port, value)
        # The list may belong to the caller of the fast path of set_real.
        self._inputs = list(self._inputs)
        self._inputs[self._input_vrs.index(reference)] = float(value)

    def _set_parameter(self, port: Port, value: Value) -> None:
        if port.causality != "parameter":
            raise Refusal(f"{port.name} is an output and cannot be set")
        if port.variability == "fixed" and self._mode == _STEPPING:
            raise Refusal(f"{port.name} is fixed and cannot be set after the initialisation")
        self._accept(port, value)
        parameters = {**self._parameters, port.name: value}
        if self._mode == _STEPPING:
            try:
                self._configure(parameters)
            except Exception as error:
                self._refused[port.name] = str(error)
                raise
        self._parameters = parameters

    def _accept(self, port: Port, value: Value) -> None:
        """Remember a refused value, so that no step is made until a good one has come."""
        try:
            port.checked(value)
        except Refusal as refusal:
            self._refused[port.name] = str(refusal)
            raise
        self._refused.pop(port.name, None)
        self._stale = self._mode == _INITIALISING

    # State

    def _identity(self) -> str:
        """Names class and version: the modules of a built FMU carry a hash of their contents."""
        return f"{type(self).__module__}.{type(self).__qualname__}"

    def _get_fmu_state(self) -> dict[str, Any]:
        self._refresh()
        return {
            "identity": self._identity(),
            "mode": self._mode,
            "start_time": self._start_time,
            "parameters": dict(self._parameters),
            "inputs": list(self._inputs),
            "outputs": list(self._outputs),
            "state": self._state,
            "hidden": self.hidden_state(),
            "fault": self._fault,
            "refused": dict(self._refused),
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._guarded("state refused", lambda: self._restore(state))

    def _restore(self, saved: dict[str, Any]) -> None:
        if saved.get("identity") != self._identity():
            raise Refusal(f"not a state of {self._identity()}")
        parameters, state = dict(saved["parameters"]), saved["state"]
        inputs, outputs = ([float(x) for x in saved[key]] for key in ("inputs", "outputs"))
        mode, start_time = str(saved["mode"]), float(saved["start_time"])
        fault, refused = bool(saved["fault"]), dict(saved["refused"])
        if (len(inputs), len(outputs), parameters.keys()) != (
            len(self._inputs),
            len(self._outputs),
            self._parameters.keys(),
        ):
            raise Refusal("a state with other ports")
        if state is not None:
            state = self.state_type._make(_frozen(state))
            try:
                self._configure(parameters)
                self.restore_hidden_state(_frozen(saved["hidden"]))
            except Exception:
                self._configure(self._parameters)
                raise
        self._parameters, self._state = parameters, state
        self._inputs, self._outputs = inputs, outputs
        self._mode, self._start_time = mode, start_time
        self._fault, self._refused = fault, refused
        self._stale = False

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return json.dumps(state).encode("utf-8")

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            saved = json.loads(state)
        except ValueError:
            saved = None
        # What is no state at all is refused when it is set: nothing can be reported from here.
        return saved if isinstance(saved, dict) else {}

    # Description

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        return describe(self, self._ports, super().to_xml)
