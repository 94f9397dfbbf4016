"""Sequences of calls out of a seed: most of them sensible, many not, some on purpose extreme."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import inf
from random import Random

from fuzz.model import Model, keep
from fuzz.player import FREE, GOOD, MAKE, Action, Calls
from support.calls import CASES, Call, Draw, Item
from support.raw import Description, Variable
from support.settings import trials_of
from support.status_table import creations, rows
from support.trials import CREATIONS

#: Actions of one sequence.
LEAST, MOST = 4, 45

#: Shares of sequences with several instances, and with a thread for each.
INTERLEAVED, THREADED = 0.3, 0.06

#: Shares of calls that are sensible where they are made, and of values that are extreme.
SENSIBLE, EXTREME = 0.7, 0.03

#: How much more often than other good calls these are made.
_WEIGHTS = {
    ("fmi2DoStep", "a step"): 40,
    ("fmi2DoStep", "a step of another length"): 6,
    ("fmi2SetReal", "all inputs"): 15,
    ("fmi2SetReal", "an input"): 6,
    ("fmi2SetReal", "a tunable parameter"): 6,
    ("fmi2SetReal", "a fixed parameter"): 6,
    ("fmi2SetReal", "n = 2^60"): 0.2,
    ("fmi2SetReal", "100,000 times the same"): 0.02,
    ("fmi2GetReal", "100,000 times the same"): 0.02,
    ("fmi2EnterInitializationMode", ""): 25,
    ("fmi2ExitInitializationMode", ""): 25,
    ("fmi2SetupExperiment", "start"): 6,
    ("fmi2GetFMUstate", ""): 6,
    ("fmi2SetFMUstate", "a state"): 3,
    ("fmi2SetFMUstate", "a state that was serialised"): 3,
    ("fmi2Reset", ""): 0.5,
    ("fmi2Terminate", ""): 0.7,
}

#: Rows that need values of their own; extreme values bring them about.
_NOT_DRAWN = {
    ("fmi2DoStep", "values that the equations overflow with"),
    ("fmi2ExitInitializationMode", "values that give no start"),
    ("fmi2GetReal", "outputs of values that give no start"),
}

_ALPHABET = [key for key in rows() if key not in _NOT_DRAWN]

#: Calls that are made on what is no instance: those that need no more than it.
_ON_NOTHING = ("fmi2DoStep", "fmi2Reset", "fmi2EnterInitializationMode", "fmi2GetReal")


class _World:
    """What a sequence has come to, as far as the model knows."""

    def __init__(self, random: Random, fmus: Mapping[str, Description]) -> None:
        self.random, self.fmus = random, fmus
        self.known: dict[str, Model | None] = dict.fromkeys(fmus)
        self.freed_once: set[str] = set()
        self.models: dict[str, Model] = {}
        self.freed: set[str] = set()
        self.actions: list[Action] = []

    def add(self, name: str, call: Call, on: str = "") -> None:
        self.actions.append(Action(name, call, on))
        if on:
            return
        if call.function == MAKE:
            of = self.fmus[name]
            self.known[name] = Model(of) if creations(of.kind)[call.case] else None
        elif call.function == FREE:
            self.known[name] = None
            self.freed_once.add(name)
            gone = {slot for slot in self.models if slot.startswith(f"{name}.")}
            self.models = {slot: m for slot, m in self.models.items() if slot not in gone}
            self.freed |= gone
        else:
            self._follow(name, call)

    def _follow(self, name: str, call: Call) -> None:
        known = self.known[name]
        assert known is not None
        before = set(self.models)
        self.known[name] = known.after(call, self.models)
        keep(self.models, call, known)
        self.freed = (self.freed | before) - set(self.models)

    def draw(self, name: str, others: bool) -> Draw:
        known = self.known[name]
        same = {n for n, description in self.fmus.items() if description is self.fmus[name]}
        own = sorted(slot for slot in self.models if slot.startswith(f"{name}."))
        foreign = sorted(s for s in self.models if s not in own and s.split(".")[0] in same)
        freed = sorted(
            s
            for s in self.freed
            if (s.split(".")[0] in same if others else s.startswith(f"{name}."))
        )
        return Draw(
            self.random,
            self.fmus[name],
            own,
            foreign if others else [],
            freed,
            0.0 if known is None else known.time,
            inf if known is None else known.stop,
            f"{name}.",
            {} if known is None else known.values,
        )


def generated(seed: int, fmu: str, descriptions: Mapping[str, Description]) -> Calls:
    """The sequence of a seed.

    Args:
        seed: of everything that is drawn.
        fmu: that it is about.
        descriptions: of this FMU and those that may run beside it.

    """
    random = Random(f"{seed} {fmu}")
    threads = random.random() < THREADED
    count = random.randrange(2, 5) if threads or random.random() < INTERLEAVED else 1
    fmus = {"a": fmu}
    for name in "bcd"[: count - 1]:
        fmus[name] = fmu if random.random() < 0.6 else random.choice([*descriptions])
    world = _World(random, {name: descriptions[of] for name, of in fmus.items()})
    for _ in range(random.randrange(LEAST, MOST) * (1 + count) // 2):
        name = random.choice([*fmus])
        if world.known[name] is None:
            _add_without_an_instance(world, name)
        elif random.random() < 0.01:
            world.add(name, Call(FREE, "", {}))
        elif random.random() < 0.01:
            world.add(name, _call_on_nothing(world, name), "NULL")
        else:
            world.add(name, _call(world, name, others=not threads))
    return Calls(fmus, world.actions, threads)


def _add_without_an_instance(world: _World, name: str) -> None:
    if name in world.freed_once and world.random.random() < 0.5:
        world.add(name, _call_on_nothing(world, name), "an instance that was freed")
    else:
        good = world.random.random() < SENSIBLE
        world.add(name, Call(MAKE, GOOD if good else world.random.choice([*CREATIONS]), {}))


def _call_on_nothing(world: _World, name: str) -> Call:
    function = world.random.choice(_ON_NOTHING)
    cases = {"fmi2DoStep": "a step", "fmi2GetReal": "n = 0, with NULL"}
    arguments = CASES[function, cases.get(function, "")](world.draw(name, False))
    assert arguments is not None
    return Call(function, cases.get(function, ""), arguments)


def _call(world: _World, name: str, others: bool) -> Call:
    random, known = world.random, world.known[name]
    assert known is not None
    draw = world.draw(name, others)
    if random.random() < EXTREME:
        call = _extreme(draw)
        if call is not None:
            return call
    keys, weights = _ALPHABET, _RARELY
    if random.random() < SENSIBLE:
        stuck = known.in_error or known.mode == "terminated"
        keys, weights = _good_keys(known.state), _weights(known.state, stuck)
    while True:
        [key] = random.choices(keys, weights)
        arguments = CASES[key](draw)
        if arguments is not None:
            return Call(*key, arguments)


@cache
def _good_keys(state: str) -> list[tuple[str, str]]:
    """What is answered well in a state."""
    good = ("OK", "new", "restored")
    return [key for key in _ALPHABET if rows()[key].cells[state].answer.name in good]


@cache
def _weights(state: str, stuck: bool) -> list[float]:
    """How likely each of these is; where an instance is stuck, what gets it out is likelier."""
    out = {("fmi2Reset", ""): 10.0, ("fmi2SetFMUstate", "a state"): 10.0}
    return [_WEIGHTS.get(key, 1.0) + stuck * out.get(key, 0.0) for key in _good_keys(state)]


#: Where anything may come, nothing comes often.
_RARELY = [min(_WEIGHTS.get(key, 1.0), 1.0) for key in _ALPHABET]


def _extreme(draw: Draw) -> Call | None:
    """A legal value that is very large or very small."""
    name = draw.description.name
    settings = [*filter(None, (trials_of(name).overflow, trials_of(name).no_start))]
    if settings and draw.random.random() < 0.3:
        setting = draw.random.choice(settings)
        values = {**setting.at_start, **setting.values}
        port = draw.description.find(draw.random.choice([*values]))
        value = values[port.name]
    else:
        ports = [v for v in draw.settable("Real") if v.name != "h_max"]
        port = draw.random.choice(ports)
        value = _edge(draw.random, port)
    case = "an input" if port.causality == "input" else f"a {port.variability} parameter"
    return Call("fmi2SetReal", case, {"items": [Item(port.reference, value)]})


def _edge(random: Random, port: Variable) -> float:
    value = random.choice((1e308, -1e308, 1e155, -1e155, 1e20, 5e-324, 1e-200, -0.0))
    value = value if port.minimum is None else max(value, port.minimum)
    return value if port.maximum is None else min(value, port.maximum)
