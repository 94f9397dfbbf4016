"""The values of an instance, what PythonFMU calls to pass them, and how calls are refused.

No exception leaves a callback: PythonFMU would report fmi2Fatal and release its objects twice. Nor
does PythonFMU learn that a call was refused; it answers fmi2OK. The native loader learns it by a
log entry of its own category, and answers fmi2Discard or fmi2Error to that very call. Without a
loader every step after a call that failed is discarded, until a reset or a state that is restored.

Verbs are those of `fmus/native/runtime/host.h`: check, refuse, fail, log.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from math import inf, isfinite
from struct import pack
from typing import Any, ClassVar

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from auv_fmu.language.variable import Refusal
from fmus.ports.port import FAULT, Port, Value
from fmus.python.loading import ANSWER, MISSING, has_loader, place
from fmus.python.noise import Noise

#: Types of ports, by those of the calls that pass their values; no port is a text.
_PASSED = {
    "Real": ("Real",),
    "Integer": ("Integer", "Enumeration"),
    "Boolean": ("Boolean",),
    "String": (),
}

#: Values of ports that have none.
_NOTHING = {**MISSING, "Enumeration": 0}

#: Modes of an instance.
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


class Illegal(Refusal):
    """A value that the standard does not let a port be set to, now or ever."""


class Store:
    """Values of all ports, and what else a run is made of.

    A port's value reference is its place among the ports. All inputs and all outputs lie in lists
    of their own, Reals first and in their order, so that a host that passes these all in one call
    costs one comparison instead of one look-up a value.

    Attributes:
        ports: of the component, `fault` last.
        inputs, outputs: values of all but `fault`.
        input_references, output_references: of them, in the order of their values.
        all_outputs: the references of all outputs but `fault`.
        real_outputs: the references of the Reals among them.
        free_inputs: the references of the Real inputs, if none of them has a range; else None.
        only_inputs, only_outputs: these, if there are no others; else None.
        parameters: by name.
        fault: whether a value or a step was discarded.
        fresh: whether the outputs are up to date: nothing has changed that they depend on.
        held: whether they are those of the beginning of the last step; the next evaluates its own.
        groups: the inputs as the equations take them.
        state: of the component; None before the initialisation.
        derived: what was derived of it; None: it is to be derived when it is needed.
        start_time, stop_time, time: where the run begins, where it ends, and where it is [s].
        noise, draws: the generator of the noise of outputs, None without it, and what it has given.

    """

    def __init__(self, ports: Sequence[Port]) -> None:
        self.ports = (*ports, FAULT)
        references = [*range(len(ports))]
        references.sort(key=lambda reference: ports[reference].type != "Real")
        self.input_references = [r for r in references if ports[r].causality == "input"]
        self.output_references = [r for r in references if ports[r].causality == "output"]
        self.all_outputs = frozenset(self.output_references)
        real_inputs = [r for r in self.input_references if ports[r].type == "Real"]
        limits = [limit for r in real_inputs for limit in (ports[r].minimum, ports[r].maximum)]
        self.free_inputs = real_inputs if all(limit is None for limit in limits) else None
        self.only_inputs = self.free_inputs if real_inputs == self.input_references else None
        self.real_outputs = [r for r in self.output_references if ports[r].type == "Real"]
        has_others = self.real_outputs != self.output_references
        self.only_outputs = None if has_others else self.real_outputs
        self.fault_references = [len(ports)]
        self.inputs: list[Value] = [
            _NOTHING[ports[r].type] if ports[r].start is None else ports[r].start
            for r in self.input_references
        ]
        self.outputs = self.no_outputs()
        self._places = {
            reference: place
            for found in (self.input_references, self.output_references)
            for place, reference in enumerate(found)
        }
        self.parameters: dict[str, Value] = {
            port.name: port.start
            for port in ports
            if port.causality == "parameter" and port.start is not None
        }
        self.fault = False
        self.fresh = True
        self.held = False
        self.groups: Any = None
        self.state: Any = None
        self.derived: Any = None
        self.start_time = self.time = 0.0
        self.stop_time = inf  # there is none
        self.noise: Noise | None = None
        self.draws: tuple[float, ...] = ()

    def no_outputs(self) -> list[Value]:
        """The outputs where there is no state."""
        return [_NOTHING[self.ports[reference].type] for reference in self.output_references]

    def check_outputs(self, values: Sequence[Value]) -> None:
        """Refuse outputs that are not finite.

        Raises:
            Refusal: one of them is not.

        """
        for reference, value in zip(self.output_references, values):
            self.ports[reference].sound(value)

    def place(self, reference: int) -> int:
        """Where the value of an input or an output lies."""
        return self._places[reference]

    def port(self, reference: int, fmi_type: str) -> Port:
        """The port that has a value reference, if its values are passed by the calls for a type.

        Raises:
            Refusal: there is none.

        """
        if 0 <= reference < len(self.ports):
            port = self.ports[reference]
            if port.type in _PASSED[fmi_type]:
                return port
        # PythonFMU hands references from 2^31 over as negative numbers.
        raise Refusal(f"no {fmi_type} has the value reference {reference % 2**32}")

    def get(self, reference: int, fmi_type: str) -> Value:
        """The value of a port. Hosts read all outputs with fmi2GetReal.

        Raises:
            Refusal: no port with the reference has a value of this type.

        """
        if fmi_type == "Real" and 0 <= reference < len(self.ports):
            return float(self._value(reference, self.ports[reference]))
        return self._value(reference, self.port(reference, fmi_type))

    def _value(self, reference: int, port: Port) -> Value:
        if port is FAULT:
            return self.fault
        if port.causality == "parameter":
            return self.parameters[port.name]
        if port.causality == "input":
            return self.inputs[self._places[reference]]
        return self.outputs[self._places[reference]]


class Callbacks(Fmi2Slave):  # type: ignore[misc]
    """A slave whose values lie in a :class:`Store`."""

    #: Ports without `fault`, inputs first, then outputs, then parameters.
    ports: ClassVar[tuple[Port, ...]]

    #: What makes groups of the values of all inputs.
    unpack: Callable[[Sequence[Value]], Any]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._store = Store(self.ports)
        self._store.groups = self.unpack(self._store.inputs)
        self._mode = INSTANTIATED
        #: Whether a value has changed that the state at the start time depends on.
        self._stale = False
        self._logged: set[str] = set()
        #: Whether inputs change the outputs, and what is derived, before the next step.
        self._outputs_follow = self._derived_follows = True
        self._has_loader = has_loader(self.resources)
        #: Why a call failed, which PythonFMU has answered with fmi2OK; without a loader only.
        self._failure = ""

    @abstractmethod
    def _refresh(self) -> str:
        """Bring the outputs up to date, and before a run the state at the start time, too.

        Returns:
            Why that cannot be; empty: they are.

        """

    @abstractmethod
    def _retune(self, parameters: dict[str, Value]) -> None:
        """Let parameters act from now on; raise what speaks against them."""

    @abstractmethod
    def _forget(self, what: str) -> None:
        """Discard what has been computed of `inputs` or `parameters`, which have changed."""

    # Refusals and messages

    def _refuse(self, status: Fmi2Status, why: str, key: str | None = None) -> None:
        """Answer the call with a status, and log why."""
        self.log_once(why, status, key)
        if self._has_loader:
            self.log("", status, ANSWER)

    def _fail(self, why: str, status: Fmi2Status = Fmi2Status.error) -> None:
        """Refuse a call that changes the run: without a loader, all steps from now on."""
        self._refuse(status, why)
        if not self._has_loader:
            self._failure = self._failure or why

    def _pass_time(self, time: float) -> None:
        """Let the native loader know a time that the arguments of the call do not lead to."""
        if self._has_loader:
            self.log(pack(">d", time).hex(), Fmi2Status.ok, ANSWER)

    def describe(self, error: BaseException) -> str:
        """Give the reason in an exception; one that is not a Refusal is named by its type."""
        if isinstance(error, Refusal):
            return str(error)
        return f"{place(error)}{type(error).__name__}: {error}"

    def log_once(self, message: str, status: Fmi2Status, key: str | None = None) -> None:
        """Log a message only the first time that its key, or else its text, occurs.

        The host adds the name of the instance.
        """
        key = (key or message)[:LONGEST_MESSAGE]
        if key in self._logged or len(self._logged) >= MOST_MESSAGES:
            return
        self._logged.add(key)
        if len(self._logged) == MOST_MESSAGES:
            message += "; further messages are not logged"
        # FMI defines a log message as a format: a host would take a % for a directive.
        self.log(message[:LONGEST_MESSAGE].replace("%", "%%"), status)

    def _check_mode(self, call: str, mode: str) -> bool:
        """Whether a call comes in the one mode that it is allowed in; else it fails."""
        if self._mode != mode:
            self._fail(f"{call} is not allowed when {self._mode}")
        return self._mode == mode

    # Values

    def get_real(self, vrs: list[int]) -> list[Any]:
        store = self._store
        if vrs != store.real_outputs:
            if not store.fresh:
                self._refresh_outputs(vrs)
            return self._get(vrs, "Real")
        if not store.fresh and (why := self._refresh()):
            self._refuse(Fmi2Status.error, why)
        # PythonFMU reads the list and lets go of it, so it need not be a copy.
        return store.outputs if store.only_outputs else store.outputs[: len(vrs)]

    def get_integer(self, vrs: list[int]) -> list[int]:
        if not self._store.fresh:
            self._refresh_outputs(vrs)
        return self._get(vrs, "Integer")

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        store = self._store
        if vrs == store.fault_references:
            return [store.fault]
        if not store.fresh:
            self._refresh_outputs(vrs)
        return self._get(vrs, "Boolean")

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get(vrs, "String")

    def set_real(self, vrs: list[int], values: list[Any]) -> None:
        store = self._store
        # A sum is finite only if every value is; _set finds out which one was not.
        if vrs == store.only_inputs and self._mode == STEPPING and isfinite(sum(values)):
            store.inputs, store.groups = values, self.unpack(values)
            if self._outputs_follow:
                store.fresh = False
            if self._derived_follows:
                store.derived = None
        elif vrs == store.free_inputs and self._mode == STEPPING and isfinite(sum(values)):
            self._take_inputs([*values, *store.inputs[len(values) :]])
        else:
            self._set(vrs, values, "Real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(vrs, values, "Integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(vrs, values, "Boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set(vrs, values, "String")

    def _refresh_outputs(self, vrs: list[int]) -> None:
        if not self._store.all_outputs.isdisjoint(vrs) and (why := self._refresh()):
            self._refuse(Fmi2Status.error, why)

    def _get(self, vrs: list[int], fmi_type: str) -> list[Any]:
        values: list[Value] = []
        for reference in vrs:
            try:
                values.append(self._store.get(reference, fmi_type))
            except Refusal as refusal:
                self._refuse(Fmi2Status.error, str(refusal))
                values.append(MISSING[fmi_type])
        return values

    def _set(self, vrs: list[int], values: Sequence[Any], fmi_type: str) -> None:
        """Take all values of a call, or none."""
        if self._mode == TERMINATED:
            self._check_mode(f"fmi2Set{fmi_type}", STEPPING)
            return
        try:
            ports = [self._store.port(reference, fmi_type) for reference in vrs]
        except Refusal as refusal:
            self._fail(str(refusal))
            return
        try:
            self._take(ports, vrs, values)
        except Illegal as refusal:
            self._fail(str(refusal))
        except BaseException as error:
            # A run with another parameter than the host asked for must not begin.
            begins = self._mode != STEPPING and any(p.causality == "parameter" for p in ports)
            self._store.fault = True
            self._fail(self.describe(error), Fmi2Status.error if begins else Fmi2Status.discard)

    def _take(self, ports: list[Port], vrs: list[int], values: Sequence[Value]) -> None:
        store = self._store
        inputs, parameters = list(store.inputs), store.parameters
        for port, reference, value in zip(ports, vrs, values):
            if port.causality == "output":
                raise Illegal(f"{port.name} is an output and cannot be set")
            if port.variability == "fixed" and self._mode == STEPPING:
                if value != parameters[port.name]:
                    raise Illegal(f"{port.name} is fixed and cannot change after initialisation")
                continue
            port.checked(value)
            if port.causality == "input":
                inputs[store.place(reference)] = float(value) if port.type == "Real" else value
            else:
                parameters = {**parameters, port.name: value}
        if parameters is not store.parameters:
            if self._mode == STEPPING:
                self._retune(parameters)
            store.parameters = parameters
            self._forget("parameters")
        if any(port.causality == "input" for port in ports):
            self._take_inputs(inputs)

    def _take_inputs(self, values: list[Value]) -> None:
        self._store.inputs, self._store.groups = values, self.unpack(values)
        self._forget("inputs")
