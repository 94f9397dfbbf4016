"""The base of all components: their runs.

PythonFMU turns a Python class into an FMU. What it leaves to the class is done here, once:

- Inputs, outputs and parameters reach the component as the groups that equations are written in.
- Outputs are evaluated when they are read, until something has changed that they depend on.
- A step is a transaction: all changes together, after everything was computed and found finite.
- The state of the FMU is complete and exact, in memory and serialised.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite
from random import Random
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu.enums import Fmi2Status

from auv_fmu.euler import (
    LARGEST_STATE,
    MOST_INTERNAL_STEPS,
    end_of_step,
    internal_steps,
    latest_end,
    longest_step,
)
from fmus.ports.behaviour import Behaviour
from fmus.ports.definition import Definition
from fmus.ports.description import complete
from fmus.ports.port import H_MAX, Refusal, Value
from fmus.python.callbacks import (
    INITIALISING,
    INSTANTIATED,
    STEPPING,
    TERMINATED,
    Callbacks,
    describe_error,
)
from fmus.python.noise import Noise
from fmus.python.state import Snapshot, checked, from_bytes, to_bytes

#: Longest step of a component that has no internal steps [s].
_NO_LIMIT = 1e300


class Component(Callbacks):
    """Base of all components; :func:`fmus.python.slave.slave_of` makes the class of one.

    The methods that call hooks may raise: what they raise becomes a refusal.
    """

    definition: ClassVar[Definition]
    behaviour: ClassVar[Behaviour]
    #: Of which of `inputs`, `parameters`, `t` and `state` outputs are made, and what is derived.
    outputs_of: ClassVar[frozenset[str]]
    derived_of: ClassVar[frozenset[str]]
    #: Whether a step evaluates the outputs at its end: those that follow no inputs.
    is_prompt: ClassVar[bool]
    #: What makes groups of the values of all inputs, and gives the norm of a state.
    unpack: Callable[[Sequence[Value]], Any]
    norm: Callable[[Any], float]
    #: The parameters as they are now.
    parameters: Any

    # What calls the hooks

    def check(self, parameters: Any) -> None:
        """Raise Refusal if parameters, each of which is good, do not fit together."""

    def check_state(self, parameters: Any, state: Any) -> None:
        """Raise Refusal for a state that no run can have led to."""

    def seed(self, parameters: Any) -> int:
        """The seed of the noise."""
        return 0

    @abstractmethod
    def start(self, parameters: Any, inputs: Any, t: float) -> Any:
        """The state at the start time."""

    @abstractmethod
    def evaluate(
        self, state: Any, derived: Any, inputs: Any, t: float, draws: Sequence[float]
    ) -> tuple[Any, list[Value]]:
        """What is derived of a state, None if it is still to be, and the values of the outputs."""

    @abstractmethod
    def advance(
        self, state: Any, derived: Any, inputs: Any, t: float, h: float, n: int
    ) -> tuple[Any, Any]:
        """The state after n internal steps of h seconds, and what still is derived."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._state: Any = None
        #: What `derive` has returned; None: it is to be called.
        self._derived: Any = None
        self._noise: Noise | None = None
        self._draws: tuple[float, ...] = ()
        self._longest_step = 0.0
        self._set_experiment(0.0, inf)
        self._time = 0.0

    # Experiment

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        if self._follows("fmi2SetupExperiment", INSTANTIATED):
            if isfinite(start_time):
                is_later = stop_time is not None and stop_time > start_time
                self._set_experiment(start_time, stop_time if is_later else inf)
                self._time = start_time
            else:
                self._fail(f"start time {start_time}: must be finite")

    def _set_experiment(self, start_time: float, stop_time: float) -> None:
        self._start_time, self._stop_time = start_time, stop_time
        self._latest_end = latest_end(start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        if self._follows("fmi2EnterInitializationMode", INSTANTIATED):
            self._mode = INITIALISING
            self._stale, self._fresh = True, False

    def exit_initialization_mode(self) -> None:
        if self._follows("fmi2ExitInitializationMode", INITIALISING):
            why = self._refresh()
            if why:
                self._fail(why)
            else:
                self._mode = STEPPING

    def terminate(self) -> None:
        self._mode = TERMINATED

    def begin(self) -> None:
        """Compute state and outputs at the start time; raise what speaks against them."""
        store, t = self._store, self._start_time
        self._adopt(store.parameters, self._meaning(store.parameters))
        noise = self._new_noise()
        draws = noise.draw() if noise else ()
        inputs = self.unpack(store.inputs)
        state = self.start(self.parameters, inputs, t)
        self._check_size(state)
        self._derived, store.outputs = self.evaluate(state, None, inputs, t, draws)
        self._state, self._noise, self._draws, self._time = state, noise, draws, t
        self._stale, self._fresh = False, True

    def _new_noise(self) -> Noise | None:
        if not self.behaviour.draws:
            return None
        # Random takes the magnitude of its seed: a negative one is the number 2^32 above it.
        return Noise(Random(self.seed(self.parameters) % 2**32), self.behaviour.draws)

    def _check_size(self, state: Any) -> None:
        if not self.norm(state) <= LARGEST_STATE:
            raise Refusal(f"the state is not finite, or exceeds {LARGEST_STATE:g}")

    def _meaning(self, values: dict[str, Value]) -> tuple[Any, float]:
        """What the values of all parameters come to, and the longest step with them [s]."""
        parameters = self.definition.parameters.of(values)
        self.check(parameters)
        return parameters, longest_step(float(values.get(H_MAX, _NO_LIMIT)))

    def _retune(self, parameters: dict[str, Value]) -> None:
        self._adopt(parameters, self._meaning(parameters))

    def _adopt(self, values: dict[str, Value], meaning: tuple[Any, float]) -> None:
        self._store.parameters = values
        self.parameters, self._longest_step = meaning

    # Outputs

    def _refresh(self) -> str:
        store = self._store
        if self._stale:
            try:
                self.begin()
            except BaseException as error:
                self._state, store.outputs = None, store.no_outputs()
                return f"initialisation refused: {describe_error(error)}"
        elif not self._fresh:
            try:
                self.renew_outputs()
            except BaseException as error:
                store.fault = True
                return f"outputs refused: {describe_error(error)}"
        return ""

    def renew_outputs(self) -> None:
        """Evaluate the outputs; raise what speaks against them."""
        store = self._store
        self._derived, store.outputs = self.evaluate(
            self._state, self._derived, self.unpack(store.inputs), self._time, self._draws
        )
        self._fresh = True

    def _forget(self, what: str) -> None:
        if self._mode == STEPPING:
            if what in self.outputs_of:
                self._fresh = False
            if what in self.derived_of:
                self._derived = None
        elif self._mode == INITIALISING:
            self._stale, self._fresh = True, False

    # Steps

    def do_step(self, current_time: float, step_size: float) -> bool:
        if self._mode != STEPPING:
            return self._follows("fmi2DoStep", STEPPING)
        end = current_time + step_size
        if end > self._latest_end:
            self._fail(
                f"step from {current_time:g} s to {end:g} s: "
                f"the stop time is {self._stop_time:g} s"
            )
            return False
        try:
            if self._untold:
                raise Refusal(self._untold)
            self.step(current_time, step_size)
        except BaseException as error:
            what = describe_error(error)
            self._store.fault = True
            said = f"step refused at t = {current_time:g} s: {what}"
            self._answer(Fmi2Status.discard, said, key=what)
            return False
        return True

    def step(self, t: float, h: float) -> None:
        """Advance by one communication step; raise what speaks against it, and change nothing.

        A step longer than `h_max` is split evenly, a zero step changes nothing, a negative one
        is refused.
        """
        if 0.0 < h <= self._longest_step and isfinite(t):
            n = 1
        else:
            n = self._internal_steps(t, h)
            if n == 0:
                return
        store, noise = self._store, self._noise
        derived, fresh, outputs = self._derived, self._fresh, store.outputs
        if t != self._time:
            fresh = fresh and "t" not in self.outputs_of
            derived = None if "t" in self.derived_of else derived
        inputs = self.unpack(store.inputs)
        if self.behaviour.is_sampled and not fresh:
            derived, outputs = self.evaluate(self._state, derived, inputs, t, self._draws)
        state, derived = self.advance(self._state, derived, inputs, t, h / n, n)
        self._check_size(state)
        end = end_of_step(self._start_time, t, h)
        draws = noise.draw() if noise else ()
        if self.is_prompt:
            try:
                derived, outputs = self.evaluate(state, derived, inputs, end, draws)
            except BaseException:
                if noise:
                    noise.take_back()
                raise
        self._state, self._derived, self._draws, self._time = state, derived, draws, end
        store.outputs, self._fresh = outputs, self.is_prompt or self.behaviour.is_sampled

    def _internal_steps(self, t: float, h: float) -> int:
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
        """Names class and version: the modules of a built FMU carry a hash of their contents."""
        return f"{type(self).__module__}.{type(self).__qualname__}"

    def _get_fmu_state(self) -> Mapping[str, Any]:
        if self._stale:
            self._refresh()
        store = self._store
        has_noise = self._noise is not None and self._state is not None
        return Snapshot(
            identity=self._identity(),
            mode=self._mode,
            start_time=self._start_time,
            stop_time=self._stop_time,
            time=self._time,
            parameters=dict(store.parameters),
            inputs=list(store.inputs),
            outputs=list(store.outputs) if self.behaviour.is_sampled else [],
            fresh=self.behaviour.is_sampled and self._fresh,
            state=self._state,
            draws=self._draws if has_noise else (),
            generator=self._noise.state if has_noise else None,
            fault=store.fault,
        )

    def _set_fmu_state(self, state: Mapping[str, Any]) -> None:
        try:
            self._restore(state)
        except BaseException as error:
            self._fail(f"state refused: {describe_error(error)}")

    def _restore(self, saved: Mapping[str, Any]) -> None:
        store = self._store
        wanted = checked(saved, self._identity(), store, self.behaviour)
        noise = None
        if wanted["state"] is None:
            store.parameters = wanted["parameters"]
        else:
            meaning = self._meaning(wanted["parameters"])
            if not self.norm(wanted["state"]) <= LARGEST_STATE:
                raise Refusal(f"it exceeds {LARGEST_STATE:g}")
            self.check_state(meaning[0], wanted["state"])
            if self.behaviour.draws:
                noise = Noise.restored(wanted["generator"], self.behaviour.draws)
            # Nothing of this instance has changed so far, and nothing can fail after this.
            self._adopt(wanted["parameters"], meaning)
        self._state, self._derived = wanted["state"], None
        self._noise, self._draws = noise, wanted["draws"]
        store.inputs, store.fault = wanted["inputs"], wanted["fault"]
        store.outputs = wanted["outputs"] or store.no_outputs()
        self._untold = ""
        self._set_experiment(wanted["start_time"], wanted["stop_time"])
        self._mode, self._time = wanted["mode"], wanted["time"]
        # Before the first step all follows from parameters and inputs, and is computed once more.
        self._stale = self._mode == INITIALISING
        self._fresh = not self._stale and (self._state is None or wanted["fresh"])

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = staticmethod(from_bytes)

    # Description

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        root: Element = super().to_xml()
        # Two builds of the same sources must be the same bytes; the time of the build is not in
        # them.
        del root.attrib["generationDateAndTime"]
        return complete(root, self._store.ports)
