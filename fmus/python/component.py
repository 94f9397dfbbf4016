"""The base class of all components: the callbacks of PythonFMU, and runs.

PythonFMU turns a Python class into an FMU. This class does what PythonFMU leaves to the slave:

- It converts inputs, outputs and parameters to and from the groups of the equations.
- It evaluates outputs when they are read, if something that they depend on has changed.
- It makes each step a transaction: changes are stored together, after all results are finite.
- It makes the state of the FMU complete and exact, in memory and serialised.

No exception leaves a callback: PythonFMU would report fmi2Fatal and release its objects twice.
PythonFMU also answers fmi2OK to refused calls. The native loader recognises them by a log entry of
a special category, and answers fmi2Discard or fmi2Error to the same call. Without a loader, all
steps after a failed call are discarded, until a reset or a restored state.

The verbs check, refuse, fail and log have the same meaning as in `fmus/native/runtime/host.h`.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite
from random import Random
from struct import pack
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from auv_fmu import __version__
from auv_fmu.language.variable import Refusal
from auv_fmu.paper.euler import (
    LARGEST_STATE,
    MOST_INTERNAL_STEPS,
    end_of_step,
    internal_steps,
    latest_end,
    longest_step,
)
from fmus.ports.definition import Definition
from fmus.ports.description import complete
from fmus.ports.port import H_MAX, Port, Value
from fmus.python.loading import ANSWER, MISSING, has_loader, place
from fmus.python.noise import Noise
from fmus.python.state import (
    INITIALISING,
    INSTANTIATED,
    STEPPING,
    TERMINATED,
    Snapshot,
    Store,
    checked,
    from_bytes,
    to_bytes,
)

#: Limit for messages of an instance, without repeated ones: a host may continue after refusals.
MOST_MESSAGES = 100

#: Largest length of a message: some hosts have buffers of 1 or 2 kB.
LONGEST_MESSAGE = 500

#: Longest step of a component without internal steps [s].
_NO_LIMIT = sys.float_info.max


class Illegal(Refusal):
    """An attempt to set a port that the standard forbids to set, now or at any time."""


class Component(Fmi2Slave):  # type: ignore[misc]
    """Base class of all components; :func:`fmus.python.slave.slave_of` makes the subclasses.

    Methods that call hooks may raise; the exceptions become refusals.
    """

    definition: ClassVar[Definition]
    #: Ports without `fault`, inputs first, then outputs, then parameters.
    ports: ClassVar[tuple[Port, ...]]
    #: Makes groups from the values of all inputs.
    unpack: Callable[[Sequence[Value]], Any]
    #: Dependencies of outputs and of derived values: `inputs`, `parameters`, `t` or `state`.
    outputs_of: ClassVar[frozenset[str]]
    derived_of: ClassVar[frozenset[str]]
    #: Returns the square of the norm of a state.
    square: Callable[[Any], float]
    #: The present parameters.
    parameters: Any

    # Methods that call hooks

    def check(self, parameters: Any) -> None:
        """Raise Refusal if parameters that are valid one by one contradict each other."""

    def check_state(self, parameters: Any, state: Any) -> None:
        """Raise Refusal for a state that no run can have led to."""

    def seed(self, parameters: Any) -> int:
        """Return the seed of the noise."""
        return 0

    @abstractmethod
    def start(self, parameters: Any, inputs: Any, t: float) -> Any:
        """Return the state at the start time."""

    @abstractmethod
    def evaluate(
        self, state: Any, derived: Any, inputs: Any, t: float, draws: Sequence[float]
    ) -> tuple[Any, list[Value]]:
        """Return the derived values, or None if not needed yet, and the values of the outputs."""

    @abstractmethod
    def advance(
        self, state: Any, derived: Any, inputs: Any, t: float, h: float, n: int
    ) -> tuple[Any, Any]:
        """Return the state after n internal steps of h seconds, and its derived values."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        behaviour = self.definition.behaviour
        self._store = Store(self.ports)
        self._store.groups = self.unpack(self._store.inputs)
        self._mode = INSTANTIATED
        #: True if a value has changed that the state at the start time depends on.
        self._stale = False
        self._logged: set[str] = set()
        self._longest_step, self._latest_end = 0.0, inf
        #: True if inputs change the outputs, or derived values, before the next step.
        self._outputs_follow = "inputs" in self.outputs_of
        self._derived_follows = "inputs" in self.derived_of
        self._is_timed = "t" in self.outputs_of | self.derived_of
        self._is_sampled = behaviour.is_sampled
        #: True if a step evaluates the outputs at its end, since no input changes them.
        self._is_prompt = not (behaviour.is_sampled or self._outputs_follow)
        self._has_loader = has_loader(self.resources)
        #: Reason of a failed call that PythonFMU answered with fmi2OK; without a loader only.
        self._failure = ""

    # Refusals and messages

    def _refuse(self, status: Fmi2Status, why: str, key: str | None = None) -> None:
        """Answer the call with a status, and log the reason."""
        self.log_once(why, status, key)
        if self._has_loader:
            self.log("", status, ANSWER)

    def _fail(self, why: str, status: Fmi2Status = Fmi2Status.error) -> None:
        """Refuse a call that changes the run; without a loader, also all later steps."""
        self._refuse(status, why)
        if not self._has_loader:
            self._failure = self._failure or why

    def _pass_time(self, time: float) -> None:
        """Tell the native loader a time that it cannot compute from the arguments of the call."""
        if self._has_loader:
            self.log(pack(">d", time).hex(), Fmi2Status.ok, ANSWER)

    def describe(self, error: BaseException) -> str:
        """Return the message of an exception, with the type unless it is a Refusal."""
        if isinstance(error, Refusal):
            return str(error)
        return f"{place(error)}{type(error).__name__}: {error}"

    def log_once(self, message: str, status: Fmi2Status, key: str | None = None) -> None:
        """Log a message, only the first time that its key, or else its text, occurs.

        The host adds the name of the instance.
        """
        key = (key or message)[:LONGEST_MESSAGE]
        if key in self._logged or len(self._logged) >= MOST_MESSAGES:
            return
        self._logged.add(key)
        if len(self._logged) == MOST_MESSAGES:
            message += "; further messages are not logged"
        # In FMI a log message is a format string, so each % is doubled.
        self.log(message[:LONGEST_MESSAGE].replace("%", "%%"), status)

    def _check_mode(self, call: str, mode: str) -> bool:
        """Return True if a call is allowed in the present mode; otherwise let it fail."""
        if self._mode != mode:
            self._fail(f"{call} is not allowed when {self._mode}")
        return self._mode == mode

    # Values

    def get_real(self, vrs: list[int]) -> list[Any]:
        store = self._store
        if vrs != store.real_outputs:
            return self._get(vrs, "Real")
        if not store.fresh:
            self._refuse_outdated()
        # PythonFMU only reads the list, so it need not be a copy.
        return store.outputs if store.only_outputs else store.outputs[: len(vrs)]

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get(vrs, "Integer")

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        store = self._store
        return [store.fault] if vrs == store.fault_references else self._get(vrs, "Boolean")

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get(vrs, "String")

    def set_real(self, vrs: list[int], values: list[Any]) -> None:
        store = self._store
        # A sum is finite only if every value is; _set finds the value that is not.
        if vrs == store.free_inputs and self._mode == STEPPING and isfinite(sum(values)):
            if not store.has_only_reals:
                values = [*values, *store.inputs[len(values) :]]
            store.inputs, store.groups = values, self.unpack(values)
            if self._outputs_follow:
                store.fresh = False
            if self._derived_follows:
                store.derived = None
        else:
            self._set(vrs, values, "Real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(vrs, values, "Integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(vrs, values, "Boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set(vrs, values, "String")

    def _refuse_outdated(self) -> None:
        """Refuse a call for outputs that cannot be evaluated."""
        if why := self._refresh():
            self._refuse(Fmi2Status.error, why)

    def _get(self, vrs: list[int], fmi_type: str) -> list[Any]:
        store, values = self._store, []
        if not store.fresh and fmi_type != "String" and not store.all_outputs.isdisjoint(vrs):
            self._refuse_outdated()
        for reference in vrs:
            try:
                values.append(store.get(reference, fmi_type))
            except Refusal as refusal:
                self._refuse(Fmi2Status.error, str(refusal))
                values.append(MISSING[fmi_type])
        return values

    def _set(self, vrs: list[int], values: Sequence[Any], fmi_type: str) -> None:
        """Accept all values of a call, or none."""
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
            # A run must not begin with another parameter than the host wanted.
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
                inputs[store.places[reference]] = float(value) if port.type == "Real" else value
            else:
                parameters = {**parameters, port.name: value}
        if parameters is not store.parameters:
            if self._mode == STEPPING:
                self._adopt(parameters, self._meaning(parameters))
            store.parameters = parameters
            self._forget("parameters")
        if any(port.causality == "input" for port in ports):
            store.inputs, store.groups = inputs, self.unpack(inputs)
            self._forget("inputs")

    # Experiment

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        if self._check_mode("fmi2SetupExperiment", INSTANTIATED):
            if isfinite(start_time):
                if stop_time is None or not stop_time > start_time:
                    stop_time = inf
                self._set_experiment(start_time, stop_time)
                self._store.time = start_time
            else:
                self._fail(f"start time {start_time}: must be finite")

    def _set_experiment(self, start_time: float, stop_time: float) -> None:
        self._store.start_time, self._store.stop_time = start_time, stop_time
        self._latest_end = latest_end(start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        if self._check_mode("fmi2EnterInitializationMode", INSTANTIATED):
            self._mode = INITIALISING
            self._stale, self._store.fresh = True, False

    def exit_initialization_mode(self) -> None:
        if self._check_mode("fmi2ExitInitializationMode", INITIALISING):
            why = self._refresh()
            if why:
                self._fail(why)
            else:
                self._mode = STEPPING

    def terminate(self) -> None:
        self._mode = TERMINATED

    def _begin(self) -> None:
        """Compute the state and the outputs at the start time."""
        store = self._store
        self._adopt(store.parameters, self._meaning(store.parameters))
        count = self.definition.behaviour.draws
        # Random uses the magnitude of its seed, so a negative seed is made positive modulo 2^32.
        noise = Noise(Random(self.seed(self.parameters) % 2**32), count) if count else None
        draws = noise.draw() if noise else ()
        inputs, t = store.groups, store.start_time
        state = self.start(self.parameters, inputs, t)
        self.check_size(state)
        store.derived, store.outputs = self.evaluate(state, None, inputs, t, draws)
        store.state, store.noise, store.draws, store.time = state, noise, draws, t

    def check_size(self, state: Any) -> None:
        """Raise Refusal for a state that is too large, or not finite."""
        if not self.square(state) <= LARGEST_STATE * LARGEST_STATE:
            raise Refusal(f"the state is not finite, or exceeds {LARGEST_STATE:g}")

    def _meaning(self, values: dict[str, Value]) -> tuple[Any, float]:
        """Return the parameter set of the equations, and the longest internal step [s]."""
        parameters = self.definition.parameters.of(values)
        self.check(parameters)
        h_max = float(values.get(H_MAX, _NO_LIMIT))
        return parameters, min(longest_step(h_max), _NO_LIMIT)

    def _adopt(self, values: dict[str, Value], meaning: tuple[Any, float]) -> None:
        self._store.parameters = values
        self.parameters, self._longest_step = meaning

    # Outputs

    def _refresh(self) -> str:
        """Bring the outputs up to date, and before a run also the state at the start time.

        Returns:
            The reason of a failure; empty if there is none.

        """
        store = self._store
        if store.fresh:
            return ""
        try:
            if self._stale:
                self._begin()
            else:
                store.derived, store.outputs = self.evaluate(
                    store.state, store.derived, store.groups, store.time, store.draws
                )
        except BaseException as error:
            why = self.describe(error)
            if self._stale:
                store.state, store.outputs = None, store.no_outputs()
                return f"initialisation refused: {why}"
            store.fault = True
            return f"outputs refused: {why}"
        self._stale, store.fresh, store.held = False, True, False
        return ""

    def _forget(self, what: str) -> None:
        """Discard results that depend on `inputs` or `parameters`, which have changed."""
        if self._mode == STEPPING:
            if what in self.outputs_of:
                self._store.fresh = False
            if what in self.derived_of:
                self._store.derived = None
        elif self._mode == INITIALISING:
            self._stale, self._store.fresh = True, False

    # Steps

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by one communication step.

        A step longer than `h_max` is split evenly, a zero step changes nothing, a negative one is
        refused. A refused step changes nothing.
        """
        t, h, end = current_time, step_size, current_time + step_size
        if self._mode != STEPPING or end > self._latest_end:
            return self._fail_step(t, end)
        store = self._store
        state, derived = store.state, store.derived
        outputs, draws = store.outputs, store.draws
        try:
            if 0.0 < h <= self._longest_step and isfinite(t) and not self._failure:
                n = 1
            else:
                n = self._internal_steps(t, h)
                if n == 0:
                    return True
            fresh = store.fresh
            if self._is_timed:
                end = end_of_step(store.start_time, t, h)
                if t != store.time:
                    fresh = fresh and "t" not in self.outputs_of
                    derived = None if "t" in self.derived_of else derived
            inputs = store.groups
            if self._is_sampled and (store.held or not fresh):
                derived, outputs = self.evaluate(state, derived, inputs, t, draws)
            state, derived = self.advance(state, derived, inputs, t, h / n, n)
            if store.noise:
                draws = store.noise.draw()
            if self._is_prompt:
                derived, outputs = self.evaluate(state, derived, inputs, end, draws)
        except BaseException as error:
            if store.noise and draws is not store.draws:
                store.noise.take_back()
            what = self.describe(error)
            store.fault = True
            why = f"step refused at t = {t:g} s: {what}"
            self._refuse(Fmi2Status.discard, why, key=what)
            return False
        store.state, store.derived = state, derived
        store.outputs, store.draws = outputs, draws
        store.time, store.held = end, self._is_sampled
        store.fresh = self._is_prompt or self._is_sampled
        if end != t + h:
            self._pass_time(end)
        return True

    def _fail_step(self, t: float, end: float) -> bool:
        """Refuse a step in another mode, or beyond the stop time."""
        if self._check_mode("fmi2DoStep", STEPPING):
            stop = self._store.stop_time
            self._fail(f"step from {t:g} s to {end:g} s: the stop time is {stop:g} s")
        return False

    def _internal_steps(self, t: float, h: float) -> int:
        if self._failure:
            raise Refusal(self._failure)
        if not isfinite(t) or not isfinite(h):
            raise Refusal(f"time {t} and step {h} must be finite")
        if h < 0.0:
            raise Refusal(f"step {h:g} s is negative")
        if h / self._longest_step > MOST_INTERNAL_STEPS:
            raise Refusal(
                f"step {h:g} s needs more than {MOST_INTERNAL_STEPS} internal steps; "
                "take shorter ones, or raise h_max"
            )
        return internal_steps(h, self._longest_step)

    # State

    def _identity(self) -> str:
        """Return class and version: names of modules in an FMU contain a hash of its contents."""
        return f"{type(self).__module__}.{type(self).__qualname__}"

    def _get_fmu_state(self) -> Mapping[str, Any]:
        if self._stale:
            self._refresh()
        store, is_begun = self._store, self._store.state is not None
        keeps = is_begun and self._is_sampled
        noise = store.noise if is_begun else None
        return Snapshot(
            identity=self._identity(),
            mode=self._mode,
            start_time=store.start_time,
            stop_time=store.stop_time,
            time=store.time,
            parameters=dict(store.parameters),
            inputs=list(store.inputs),
            outputs=list(store.outputs) if keeps else [],
            fresh=keeps and store.fresh,
            held=keeps and store.fresh and store.held,
            state=store.state,
            draws=store.draws if noise else (),
            generator=noise.state if noise else None,
            fault=store.fault,
        )

    def _set_fmu_state(self, state: Mapping[str, Any]) -> None:
        try:
            self._restore(state)
        except BaseException as error:
            self._fail(f"state refused: {self.describe(error)}")

    def _restore(self, saved: Mapping[str, Any]) -> None:
        store, behaviour = self._store, self.definition.behaviour
        wanted = checked(saved, self._identity(), store, behaviour)
        state, noise = wanted["state"], None
        if state is None:
            store.parameters = wanted["parameters"]
        else:
            meaning = self._meaning(wanted["parameters"])
            if not self.square(state) <= LARGEST_STATE * LARGEST_STATE:
                raise Refusal(f"it exceeds {LARGEST_STATE:g}")
            self.check_state(meaning[0], state)
            if behaviour.draws:
                noise = Noise.restored(wanted["generator"], behaviour.draws)
            # The instance is unchanged up to here, and nothing after this can fail.
            self._adopt(wanted["parameters"], meaning)
        store.inputs, store.groups = wanted["inputs"], self.unpack(wanted["inputs"])
        store.outputs = wanted["outputs"] or store.no_outputs()
        store.state, store.derived = state, None
        self._set_experiment(wanted["start_time"], wanted["stop_time"])
        store.time = wanted["time"]
        store.noise, store.draws, store.fault = noise, wanted["draws"], wanted["fault"]
        self._mode, self._failure = wanted["mode"], ""
        # Before the first step, the state follows from parameters and inputs, and is recomputed.
        self._stale = self._mode == INITIALISING
        store.fresh = not self._stale and (state is None or wanted["fresh"])
        store.held = wanted["held"]
        self._pass_time(store.time)

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = staticmethod(from_bytes)

    # Description

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        root: Element = super().to_xml()
        # Builds of the same sources must be equal, so the time of the build is removed.
        del root.attrib["generationDateAndTime"]
        root.set("generationTool", f"auv-fmu {__version__} with {root.get('generationTool')}")
        return complete(root, self._store.ports)
