"""Events of a run: at a time, or when a signal crosses a value.

An event acts between two steps: at the first t_k at or after its time, or after the first step at
whose end its condition has become true. The step that begins there is the first one with the event,
in every order and loop. In feedthrough order the row of that time shows its effect.

If several events act on one signal or parameter, the latest counts; when it ends, the one before it
counts again.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.fmi.instance import ComponentFailed, Ended
from orchestrator.cosim.hooks import NEVER, Run
from orchestrator.cosim.observers import Occurrence
from orchestrator.cosim.row import Row
from orchestrator.cosim.variables import Value, same
from orchestrator.machine.texts import literal

#: Limit for listing the same event: a condition may chatter endlessly.
MOST_LISTED = 1000


@dataclass(frozen=True)
class Condition:
    """A comparison of a signal, as the row shows it, with a number."""

    #: Comparisons in scenarios.
    COMPARISONS: ClassVar[Mapping[str, Callable[[Any, float], bool]]] = {
        "<=": operator.le,
        ">=": operator.ge,
        "<": operator.lt,
        ">": operator.gt,
    }

    signal: PortName
    comparison: str
    value: float

    def holds(self, row: Row) -> bool:
        """Return True if the condition holds for a row."""
        return self.COMPARISONS[self.comparison](row.value(self.signal), self.value)

    def __str__(self) -> str:
        """Format as in a scenario."""
        return f"{self.signal} {self.comparison} {self.value:g}"


class Layer(NamedTuple):
    """The effect of an event at one place.

    Attributes:
        event: its number; :data:`_GROUND` for the value without events.
        effect: a key of :data:`_EFFECTS`.
        value: of the effect.

    """

    event: int
    effect: str
    value: Any


_GROUND = -1


def tune(run: Run, target: PortName, value: Value) -> None:
    """Set a tunable parameter.

    Raises:
        ComponentFailed: the FMU refuses the value, or does not keep it.

    """
    instance = run.instances[target.component]
    instance.tune({target.port: value})
    held = instance.read([target.port])[target.port]
    if not same(value, held):
        raise ComponentFailed(
            f"{target} was set to {literal(value)}, but the FMU holds {literal(held)}"
        )
    if run.passing is not None:
        # Outputs that follow from the parameter must show its new value.
        instance.exchange()


_EFFECTS: Mapping[str, Callable[[Run, PortName, Any], None]] = {
    "override": lambda run, target, value: run.overrides.override(target, value),
    "bias": lambda run, target, value: run.overrides.bias(target, value),
    "release": lambda run, target, _: run.overrides.release(target),
    "supply": lambda run, target, value: run.overrides.supply(target, value),
    "tune": tune,
}

#: Effects that give an input or a parameter a value; the others change what an input takes.
_SETTING = ("supply", "tune")


class Layers:
    """Effects of events at all places, in layers."""

    def __init__(self) -> None:
        """Start empty."""
        self._at: dict[tuple[PortName, bool], list[Layer]] = {}

    def put(self, run: Run, target: PortName, layer: Layer) -> None:
        """Put an effect on top of the others at a place."""
        place = target, layer.effect in _SETTING
        layers = self._at.setdefault(place, [])
        if not layers:
            layers.append(_ground(run, target, layer.effect))
        layers[:] = [other for other in layers if other.event != layer.event] + [layer]
        _EFFECTS[layer.effect](run, target, layer.value)

    def take(self, run: Run, event: int) -> None:
        """Remove the effects of an event."""
        for (target, _), layers in self._at.items():
            if layers[-1].event == event:
                _EFFECTS[layers[-2].effect](run, target, layers[-2].value)
            layers[:] = [layer for layer in layers if layer.event != event]

    def release(self, run: Run, target: PortName) -> None:
        """Remove all changes of a signal."""
        if self._at.pop((target, False), None):
            run.overrides.release(target)

    def tuned(self, component: str) -> dict[str, Value]:
        """Return the values that events have given to parameters of a component."""
        return {
            target.port: layers[-1].value
            for (target, _), layers in self._at.items()
            if target.component == component and layers[-1].effect == "tune"
        }

    def state(self) -> list[Any]:
        """Return the layers as JSON."""
        return [
            (*vars(target).values(), sets, layers) for (target, sets), layers in self._at.items()
        ]

    def restore(self, state: Sequence[Any]) -> None:
        """Restore saved layers; events in progress continue."""
        self._at = {
            (PortName(component, port), sets): [Layer(*layer) for layer in layers]
            for component, port, sets, layers in state
        }


def _ground(run: Run, target: PortName, effect: str) -> Layer:
    """Return the value without events."""
    if effect == "tune":
        return Layer(
            _GROUND, effect, run.instances[target.component].read([target.port])[target.port]
        )
    if effect == "supply":
        return Layer(_GROUND, effect, run.overrides.supplied(target))
    return Layer(_GROUND, "release", None)


class Action(Protocol):
    """The action of an event."""

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run.

        Args:
            run: to act on.
            event: number of the event.
            layers: take effects that can end.

        """


@dataclass(frozen=True)
class Alter:
    """Override or bias inputs.

    Attributes:
        effect: `override` or `bias`.
        values: by input.

    """

    effect: str
    values: tuple[tuple[PortName, Value], ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        for target, value in self.values:
            layers.put(run, target, Layer(event, self.effect, value))


@dataclass(frozen=True)
class Freeze:
    """Keep the present values of inputs."""

    targets: tuple[PortName, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        for target in self.targets:
            value = float(run.row.values[run.row.columns[target]])
            layers.put(run, target, Layer(event, "override", value))


@dataclass(frozen=True)
class Release:
    """Undo all effects of events on inputs."""

    targets: tuple[PortName, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        for target in self.targets:
            layers.release(run, target)


@dataclass(frozen=True)
class Set:
    """Set tunable parameters and unconnected inputs."""

    parameters: tuple[tuple[PortName, Value], ...]
    inputs: tuple[tuple[PortName, Value], ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        for target, value in self.parameters:
            layers.put(run, target, Layer(event, "tune", value))
        for target, value in self.inputs:
            layers.put(run, target, Layer(event, "supply", value))


@dataclass(frozen=True)
class Reset:
    """Restart components with their current parameters."""

    components: tuple[str, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        for name in self.components:
            instance = run.instances[name]
            values = {**run.system.parameters_of(name), **layers.tuned(name)}
            run.refresh(name)
            instance.reset()
            instance.enter_initialization(values, run.time)
            instance.exchange()
            instance.exit_initialization()
            instance.exchange()


@dataclass(frozen=True)
class Stop:
    """End the run without a failure."""

    why: str

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Act on a run."""
        raise Ended(self.why)


@dataclass(frozen=True)
class Event:
    """An event of a run.

    Attributes:
        text: description.
        action: of the event.
        label: name in figures.
        at: time [s]; None: it has a condition.
        when: condition, which must have been false before.
        repeat: if set, the event happens each time that the condition becomes true, else only the
            first time.
        lasts: duration [s]; None: to the end of the run.

    """

    text: str
    action: Action
    label: str
    at: float | None = None
    when: Condition | None = None
    repeat: bool = False
    lasts: float | None = None

    def __str__(self) -> str:
        """Format with the time or the condition."""
        when = f"at {self.at:g} s" if self.at is not None else f"when {self.when}"
        return f"{self.text}, {when}"


def occurrence(event: Event, number: int, time: float, n: int, *, ends: bool) -> Occurrence:
    """Describe the begin or the end of an event.

    Args:
        event: that begins or ends.
        number: of the event.
        time: present time [s].
        n: number of its begins and ends until now; at most :data:`MOST_LISTED`.
        ends: True if it ends.

    """
    text = f"{event.text}, ended" if ends else event.text
    if n == MOST_LISTED:
        text += "; later occurrences are not listed"
    return Occurrence(time, text, "" if ends else event.label, number)


@dataclass
class _Progress:
    """The progress of an event.

    Attributes:
        happened: True once it has happened.
        was_true: value of its condition at the last test.
        end: number of steps after which it ends.
        listed: number of its entries in the list.

    """

    happened: bool = False
    was_true: bool = True
    end: int = NEVER
    listed: int = 0


class Events:
    """A hook that makes events happen."""

    def __init__(self, events: Sequence[Event]) -> None:
        """Take events; events of the same time act in this order."""
        self._events = events
        self._progress = [_Progress() for _ in events]
        self._layers = Layers()
        self._happened: list[Occurrence] = []

    def act(self, run: Run) -> int:
        """End events that are over, then begin those that are due."""
        run.happened = self._happened
        if run.made >= run.experiment.rows - 1:
            # No step follows.
            return NEVER
        for number, progress_of in enumerate(self._progress):
            if progress_of.end <= run.made:
                self._end(run, number)
        for number in range(len(self._events)):
            if self._begins(run, number):
                self._begin(run, number)
        return min((self._next(run, number) for number in range(len(self._events))), default=NEVER)

    def state(self) -> Any:
        """Return the progress as JSON."""
        progress = [tuple(vars(progress_of).values()) for progress_of in self._progress]
        return progress, self._layers.state(), self._happened

    def restore(self, state: Any) -> None:
        """Restore the progress."""
        progress, layers, happened = state
        self._progress = [_Progress(*progress_of) for progress_of in progress]
        self._layers.restore(layers)
        # The run has this list.
        self._happened[:] = [Occurrence(*fields) for fields in happened]

    def _begins(self, run: Run, number: int) -> bool:
        event, progress_of = self._events[number], self._progress[number]
        if not self._waits(number):
            return False
        if event.when is None:
            return _due(run, event) <= run.made
        was_true = progress_of.was_true
        with run.ahead():
            progress_of.was_true = event.when.holds(run.row)
        return progress_of.was_true and not was_true

    def _waits(self, number: int) -> bool:
        return self._events[number].repeat or not self._progress[number].happened

    def _begin(self, run: Run, number: int) -> None:
        event, progress_of = self._events[number], self._progress[number]
        progress_of.happened = True
        self._say(run, number)
        event.action.act(run, number, self._layers)
        if event.lasts is not None:
            progress_of.end = max(run.experiment.reaching(run.time + event.lasts), run.made + 1)

    def _end(self, run: Run, number: int) -> None:
        self._progress[number].end = NEVER
        self._layers.take(run, number)
        self._say(run, number, ends=True)

    def _say(self, run: Run, number: int, *, ends: bool = False) -> None:
        progress_of = self._progress[number]
        progress_of.listed += 1
        if progress_of.listed <= MOST_LISTED:
            event, n = self._events[number], progress_of.listed
            self._happened.append(occurrence(event, number, run.time, n, ends=ends))

    def _next(self, run: Run, number: int) -> int:
        """Return the number of steps after which an event needs action."""
        begin = _due(run, self._events[number]) if self._waits(number) else NEVER
        return min(begin, self._progress[number].end)


def _due(run: Run, event: Event) -> int:
    """Return the number of steps after which to test an event."""
    return run.made + 1 if event.at is None else run.experiment.reaching(event.at)
