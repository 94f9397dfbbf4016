"""What happens to a run from outside: at a time, or when a signal crosses a value.

An event acts between two steps, at the first t_k that its time is not after, or after the first
step at whose end its condition has become true. The step that begins there is the first that it
acts on, in every order and loop. In feedthrough order the row of that time shows what it does.

Several events may act on one signal or parameter: the latest counts, and when it ends, the one
before it counts again.
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

#: How often the same event is listed: a condition may chatter for ever.
MOST_LISTED = 1000


@dataclass(frozen=True)
class Condition:
    """A signal, as the row shows it, compared with a number."""

    #: Comparisons, as a scenario writes them.
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
        """Whether it is true of a row."""
        return self.COMPARISONS[self.comparison](row.value(self.signal), self.value)

    def __str__(self) -> str:
        """As a scenario writes it."""
        return f"{self.signal} {self.comparison} {self.value:g}"


class Layer(NamedTuple):
    """What an event does at one place.

    Attributes:
        event: its number; :data:`_GROUND` stands for the value before any event.
        effect: a key of :data:`_EFFECTS`.
        value: that goes with it.

    """

    event: int
    effect: str
    value: Any


_GROUND = -1


def _tune(run: Run, target: PortName, value: Value) -> None:
    instance = run.instances[target.component]
    instance.tune({target.port: value})
    held = instance.read([target.port])[target.port]
    if not same(value, held):
        raise ComponentFailed(
            f"{target} was set to {literal(value)}, but the FMU holds {literal(held)}"
        )
    if run.passing is not None:
        # Outputs that follow from it are of now.
        instance.exchange()


_EFFECTS: Mapping[str, Callable[[Run, PortName, Any], None]] = {
    "override": lambda run, target, value: run.overrides.override(target, value),
    "bias": lambda run, target, value: run.overrides.bias(target, value),
    "release": lambda run, target, _: run.overrides.release(target),
    "supply": lambda run, target, value: run.overrides.supply(target, value),
    "tune": _tune,
}

#: Kinds that give an input or a parameter its value; the others alter what an input has or takes.
_SETTING = ("supply", "tune")


class Layers:
    """What events do at all places, one upon the other."""

    def __init__(self) -> None:
        """Begin with none."""
        self._at: dict[tuple[PortName, bool], list[Layer]] = {}

    def put(self, run: Run, target: PortName, layer: Layer) -> None:
        """Lay something upon whatever acts at a place."""
        place = target, layer.effect in _SETTING
        layers = self._at.setdefault(place, [])
        if not layers:
            layers.append(_ground(run, target, layer.effect))
        layers[:] = [other for other in layers if other.event != layer.event] + [layer]
        _EFFECTS[layer.effect](run, target, layer.value)

    def take(self, run: Run, event: int) -> None:
        """Undo what an event does."""
        for (target, _), layers in self._at.items():
            if layers[-1].event == event:
                _EFFECTS[layers[-2].effect](run, target, layers[-2].value)
            layers[:] = [layer for layer in layers if layer.event != event]

    def release(self, run: Run, target: PortName) -> None:
        """Take away all that alters a signal."""
        if self._at.pop((target, False), None):
            run.overrides.release(target)

    def tuned(self, component: str) -> dict[str, Value]:
        """Values that events have given to parameters of a component."""
        return {
            target.port: layers[-1].value
            for (target, _), layers in self._at.items()
            if target.component == component and layers[-1].effect == "tune"
        }

    def state(self) -> list[Any]:
        """What there is, as JSON has it."""
        return [
            (*vars(target).values(), sets, layers) for (target, sets), layers in self._at.items()
        ]

    def restore(self, state: Sequence[Any]) -> None:
        """Restore the saved state; events in progress continue."""
        self._at = {
            (PortName(component, port), sets): [Layer(*layer) for layer in layers]
            for component, port, sets, layers in state
        }


def _ground(run: Run, target: PortName, effect: str) -> Layer:
    """What there is where no event acts."""
    if effect == "tune":
        return Layer(
            _GROUND, effect, run.instances[target.component].read([target.port])[target.port]
        )
    if effect == "supply":
        return Layer(_GROUND, effect, run.overrides.supplied(target))
    return Layer(_GROUND, "release", None)


class Action(Protocol):
    """What an event does."""

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it.

        Args:
            run: to act on.
            event: its number.
            layers: take what can end.

        """


@dataclass(frozen=True)
class Alter:
    """Override or bias inputs.

    Attributes:
        effect: `override` or `bias`.
        values: for each input.

    """

    effect: str
    values: tuple[tuple[PortName, Value], ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
        for target, value in self.values:
            layers.put(run, target, Layer(event, self.effect, value))


@dataclass(frozen=True)
class Freeze:
    """Let inputs keep what they have."""

    targets: tuple[PortName, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
        for target in self.targets:
            value = float(run.row.values[run.row.columns[target]])
            layers.put(run, target, Layer(event, "override", value))


@dataclass(frozen=True)
class Release:
    """Let inputs take what feeds them, whatever events have done to them."""

    targets: tuple[PortName, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
        for target in self.targets:
            layers.release(run, target)


@dataclass(frozen=True)
class Set:
    """Give values to tunable parameters, and to inputs that nothing feeds."""

    parameters: tuple[tuple[PortName, Value], ...]
    inputs: tuple[tuple[PortName, Value], ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
        for target, value in self.parameters:
            layers.put(run, target, Layer(event, "tune", value))
        for target, value in self.inputs:
            layers.put(run, target, Layer(event, "supply", value))


@dataclass(frozen=True)
class Reset:
    """Start components over, with their current parameters."""

    components: tuple[str, ...]

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
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
    """End the run, which has not failed."""

    why: str

    def act(self, run: Run, event: int, layers: Layers) -> None:
        """Do it."""
        raise Ended(self.why)


@dataclass(frozen=True)
class Event:
    """Something that happens.

    Attributes:
        text: what, in words.
        action: that it is.
        label: its name in figures.
        at: when [s]; None: at a condition.
        when: the condition; it must have been false before.
        repeat: whether it happens each time that the condition becomes true, or only the first.
        lasts: for how long [s]; None: for good.

    """

    text: str
    action: Action
    label: str
    at: float | None = None
    when: Condition | None = None
    repeat: bool = False
    lasts: float | None = None

    def __str__(self) -> str:
        """With its time or condition."""
        when = f"at {self.at:g} s" if self.at is not None else f"when {self.when}"
        return f"{self.text}, {when}"


def occurrence(event: Event, number: int, time: float, n: int, *, ends: bool) -> Occurrence:
    """An event that begins or ends.

    Args:
        event: that does.
        number: of it.
        time: of now [s].
        n: how often it has begun or ended until now; at most :data:`MOST_LISTED`.
        ends: whether it ends.

    """
    text = f"{event.text}, ended" if ends else event.text
    if n == MOST_LISTED:
        text += "; later occurrences are not listed"
    return Occurrence(time, text, "" if ends else event.label, number)


@dataclass
class _Progress:
    """How far an event has come.

    Attributes:
        happened: whether it has.
        was_true: whether its condition was when it was last looked at.
        end: after how many steps it ends.
        listed: how often something about it was.

    """

    happened: bool = False
    was_true: bool = True
    end: int = NEVER
    listed: int = 0


class Events:
    """A hook that has events happen."""

    def __init__(self, events: Sequence[Event]) -> None:
        """Take events, in the order in which they act at the same time."""
        self._events = events
        self._progress = [_Progress() for _ in events]
        self._layers = Layers()
        self._happened: list[Occurrence] = []

    def act(self, run: Run) -> int:
        """End what ends now, then begin what begins now."""
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
        """How far they have come, as JSON has it."""
        progress = [tuple(vars(progress_of).values()) for progress_of in self._progress]
        return progress, self._layers.state(), self._happened

    def restore(self, state: Any) -> None:
        """Be as far again."""
        progress, layers, happened = state
        self._progress = [_Progress(*progress_of) for progress_of in progress]
        self._layers.restore(layers)
        self._happened = [Occurrence(*one) for one in happened]

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
        """After how many steps an event needs action."""
        begin = _due(run, self._events[number]) if self._waits(number) else NEVER
        return min(begin, self._progress[number].end)


def _due(run: Run, event: Event) -> int:
    """After how many steps to look at an event."""
    return run.made + 1 if event.at is None else run.experiment.reaching(event.at)
