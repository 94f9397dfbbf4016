"""The base of all components: what one implements, and its steps.

PythonFMU turns a Python class into an FMU. What it leaves to the class is done here, once:

- Inputs, outputs and parameters reach the component as the groups that equations are written in.
- A step is a transaction: state and outputs change together, after everything was computed and
  found finite.
- The state of the FMU is complete and exact, in memory and serialised.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, ClassVar, Generic, TypeVar, get_args, get_origin
from xml.etree.ElementTree import Element

from pythonfmu import DefaultExperiment
from pythonfmu.enums import Fmi2Status

from auv_fmu.euler import LARGEST_STATE, MOST_INTERNAL_STEPS, internal_steps, longest_step
from fmus.ports.description import EXPERIMENT, complete
from fmus.ports.groups import ParameterSet, packing, unpacking
from fmus.ports.port import H_MAX, Refusal, Value
from fmus.python.callbacks import (
    INITIALISING,
    INSTANTIATED,
    STEPPING,
    TERMINATED,
    Callbacks,
    describe_error,
)
from fmus.python.state import (
    Snapshot,
    checked,
    from_bytes,
    measuring,
    nearly_equal,
    to_bytes,
    unusable,
)

#: Longest step of a component that has no internal steps [s].
_NO_LIMIT = 1e300

State = TypeVar("State")
Inputs = TypeVar("Inputs")
Outputs = TypeVar("Outputs")
Parameters = TypeVar("Parameters")


def _class_of(base: Any) -> Any:
    """The class that a base is, with types in brackets or without."""
    return get_origin(base) or base


class Component(Callbacks, Generic[State, Inputs, Outputs, Parameters]):
    """Base of all components.

    A component names its four types: NamedTuples of its state, of its groups of inputs and of its
    parameters, and a TypedDict of its groups of outputs. It declares its ports and implements
    :meth:`begin` and :meth:`advance`. These may raise: what they raise becomes a refusal.
    """

    default_experiment = DefaultExperiment(*EXPERIMENT)

    #: What the parameters mean to the equations; `h_max` is not among them.
    parameter_set: ParameterSet[Parameters]
    #: Fields of the inputs that bear another name than their group of ports.
    group_of: ClassVar[Mapping[str, str]] = {}
    #: The parameters as they are now.
    parameters: Parameters

    def check(self, parameters: Parameters) -> None:
        """Raise Refusal if parameters, each of which is good, do not fit together."""

    @abstractmethod
    def begin(self, inputs: Inputs, t: float) -> tuple[State, Outputs]:
        """State and outputs at the start time."""

    @abstractmethod
    def advance(
        self, state: State, inputs: Inputs, t: float, h: float, n: int
    ) -> tuple[State, Outputs]:
        """State and outputs after n internal steps of h seconds with held inputs."""

    def sample(self, values: list[Any]) -> Sequence[float]:
        """Change outputs in place once a communication point, after all were found finite.

        Returns:
            What was put into them.

        """
        return ()

    def unsample(self) -> None:
        """Take back what the last :meth:`sample` changed besides the outputs."""

    def expected(self, parameters: Parameters, state: State, outputs: Outputs) -> Outputs | None:
        """The outputs that belong to a state that is restored; None: that cannot be told.

        As :meth:`fmus.ports.behaviour.Hooks.expected`.
        """
        return None

    def hidden_state(self) -> Any:
        """What a component keeps outside its state: JSON-safe, immutable."""
        return None

    def restore_hidden_state(self, hidden: Any) -> None:
        """Take back what :meth:`hidden_state` gave; raise, and change nothing, if it did not."""
        if hidden is not None:
            raise Refusal("this component keeps nothing outside its state")

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Hold the types of the component against its ports."""
        super().__init_subclass__(**kwargs)
        [types] = [get_args(b) for b in cls.__orig_bases__ if issubclass(_class_of(b), Component)]
        cls._state_type, inputs, outputs, _ = types
        if isinstance(inputs, TypeVar):
            return  # a base of components, which has no ports yet
        ports = {
            causality: [port for port in cls.ports if port.causality == causality]
            for causality in ("input", "output", "parameter")
        }
        cls._unpack = staticmethod(unpacking(inputs, ports["input"], cls.group_of))
        cls._pack = staticmethod(packing(outputs, ports["output"]))
        cls._unpack_outputs = staticmethod(unpacking(outputs, ports["output"], {}))
        cls._norm = staticmethod(measuring(cls._state_type))
        cls._samples = cls.sample is not Component.sample
        # PythonFMU looks methods up by names that miss Python's cache: the first class has them.
        for name in ("do_step", "get_real", "set_real", "get_boolean"):
            setattr(cls, name, getattr(cls, name))
        meant = {port.name for port in cls.parameter_set.ports}
        if {port.name for port in ports["parameter"]} - {H_MAX.name} != meant:
            raise TypeError(f"{cls.__name__}: not every parameter has a meaning, or a port")

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._state: State | None = None
        #: What was derived of the state with the parameters as they are; None: it is to be derived.
        self._derived: Any = None
        self._next: Any = None  #: what goes with a state that may yet be refused
        self._start_time = 0.0
        self._longest_step = 0.0

    # Experiment

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        if self._follows("fmi2SetupExperiment", INSTANTIATED):
            if isfinite(start_time):
                self._start_time = start_time
            else:
                self._fail(f"start time {start_time}: must be finite")

    def enter_initialization_mode(self) -> None:
        if self._follows("fmi2EnterInitializationMode", INSTANTIATED):
            self._mode = INITIALISING
            self._stale = True

    def exit_initialization_mode(self) -> None:
        if self._follows("fmi2ExitInitializationMode", INITIALISING):
            why = self._refresh()
            if why:
                self._fail(why)
            else:
                self._mode = STEPPING

    def terminate(self) -> None:
        self._mode = TERMINATED

    def _refresh(self) -> str:
        if self._stale:
            try:
                self._begin()
            except BaseException as error:
                self._state, self._store.outputs = None, self._store.no_outputs()
                return f"initialisation refused: {describe_error(error)}"
            self._stale = False
        return ""

    def _begin(self) -> None:
        store = self._store
        self._adopt(store.parameters, self._meaning(store.parameters))
        state, outputs = self.begin(self._unpack(store.inputs), self._start_time)
        self._accept(state, self._pack(outputs))

    def _meaning(self, values: dict[str, Value]) -> tuple[Parameters, float]:
        """What the values of all parameters come to, and the longest step with them [s]."""
        parameters = self.parameter_set.of(values)
        self.check(parameters)
        return parameters, longest_step(float(values.get(H_MAX.name, _NO_LIMIT)))

    def _retune(self, parameters: dict[str, Value]) -> None:
        self._adopt(parameters, self._meaning(parameters))

    def _adopt(self, values: dict[str, Value], meaning: tuple[Parameters, float]) -> None:
        self._store.parameters = values
        self.parameters, self._longest_step = meaning
        self._derived = None

    # Steps

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by one communication step.

        A step longer than `h_max` is split evenly, a zero step changes nothing, a negative one
        is refused. After a refusal everything is as it was before the step.
        """
        if self._mode != STEPPING:
            return self._follows("fmi2DoStep", STEPPING)
        try:
            store = self._store
            if self._untold:
                raise Refusal(self._untold)
            if 0.0 < step_size <= self._longest_step and isfinite(current_time):
                n = 1
            else:
                n = self._internal_steps(current_time, step_size)
                if n == 0:
                    return True
            state, outputs = self.advance(
                self._state,  # type: ignore[arg-type]
                self._unpack(store.inputs),
                current_time,
                step_size / n,
                n,
            )
            self._accept(state, self._pack(outputs))
        except BaseException as error:
            what = describe_error(error)
            self._store.fault = True
            said = f"step refused at t = {current_time:g} s: {what}"
            self._answer(Fmi2Status.discard, said, key=what)
            return False
        return True

    def _accept(self, state: State, values: list[Any]) -> None:
        """Take over state and outputs, if no number of theirs is out of bounds."""
        if not self._norm(state) <= LARGEST_STATE:
            raise Refusal(f"the state is not finite, or exceeds {LARGEST_STATE:g}")
        if not isfinite(sum(values)):
            # What is finite may still be too large to be added up.
            for reference, value in zip(self._store.output_references, values):
                self._store.ports[reference].sound(value)
        if self._samples:
            self._measure(values)
        self._state, self._derived, self._store.outputs = state, self._next, values

    def _measure(self, values: list[Any]) -> None:
        """Sample outputs; a refusal takes nothing of what the samples are made from."""
        try:
            samples = self.sample(values)
            if not isfinite(sum(samples)) and not all(map(isfinite, samples)):
                raise Refusal("a sampled output is not finite")
        except BaseException:
            self.unsample()
            raise

    def _internal_steps(self, current_time: float, step_size: float) -> int:
        if not isfinite(current_time) or not isfinite(step_size):
            raise Refusal(f"time {current_time} and step {step_size} must be finite")
        if step_size < 0.0:
            raise Refusal(f"step {step_size:g} s is negative")
        if step_size / self._longest_step > MOST_INTERNAL_STEPS:
            raise Refusal(
                f"step {step_size:g} s needs more than {MOST_INTERNAL_STEPS} internal steps; "
                "take shorter ones, or raise h_max"
            )
        return internal_steps(step_size, self._longest_step)

    # State

    def _identity(self) -> str:
        """Names class and version: the modules of a built FMU carry a hash of their contents."""
        return f"{type(self).__module__}.{type(self).__qualname__}"

    def _get_fmu_state(self) -> Mapping[str, Any]:
        self._refresh()
        store = self._store
        try:
            hidden = self.hidden_state()
        except BaseException as error:
            return unusable(describe_error(error))
        return Snapshot(
            identity=self._identity(),
            mode=self._mode,
            start_time=self._start_time,
            parameters=dict(store.parameters),
            inputs=list(store.inputs),
            outputs=list(store.outputs),
            state=self._state,
            hidden=hidden,
            fault=store.fault,
        )

    def _set_fmu_state(self, state: Mapping[str, Any]) -> None:
        try:
            self._restore(state)
        except BaseException as error:
            self._fail(f"state refused: {describe_error(error)}")

    def _restore(self, saved: Mapping[str, Any]) -> None:
        store = self._store
        wanted = checked(saved, self._identity(), store, self._state_type)
        if wanted["state"] is None:
            self._state, store.parameters = None, wanted["parameters"]
        else:
            meaning = self._meaning(wanted["parameters"])
            if not self._norm(wanted["state"]) <= LARGEST_STATE:
                raise Refusal(f"it exceeds {LARGEST_STATE:g}")
            self._check_outputs(meaning[0], wanted["state"], wanted["outputs"])
            # Nothing of this instance has changed so far, and nothing can fail after this.
            self.restore_hidden_state(wanted["hidden"])
            self._adopt(wanted["parameters"], meaning)
            self._state = wanted["state"]
        store.inputs, store.outputs = wanted["inputs"], wanted["outputs"]
        store.fault = wanted["fault"]
        self._untold = ""
        self._mode, self._start_time = wanted["mode"], wanted["start_time"]
        # Before the first step all follows from parameters and inputs, and is computed once more.
        self._stale = self._mode == INITIALISING

    def _check_outputs(self, parameters: Parameters, state: State, values: list[Any]) -> None:
        expected = self.expected(parameters, state, self._unpack_outputs(values))
        if expected is None:
            return
        packed, n = self._pack(expected), len(self._store.real_outputs)
        if packed[n:] != values[n:] or not nearly_equal(packed[:n], values[:n]):
            raise Refusal("its outputs do not match its state")

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = staticmethod(from_bytes)

    # Description

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        root: Element = super().to_xml()
        # Two builds of the same sources must be the same bytes; the time of the build is not in
        # them.
        del root.attrib["generationDateAndTime"]
        return complete(root, self._store.ports)
