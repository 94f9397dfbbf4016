"""Events of a program: the part of its text that they need, and what they are in numbers.

Between two steps, `events.c` does what :mod:`orchestrator.master.hooks.events` does. It knows
numbers only: what happened is put into words here, or by the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from fmus.language.types import FLOAT
from fmus.native.emit import number_in_c
from fmus.native.pieces import Place
from orchestrator.master.experiment import Experiment
from orchestrator.master.hooks.events import (
    MOST_LISTED,
    Action,
    Alter,
    Event,
    Freeze,
    Release,
    Reset,
    Set,
    Stop,
    occurrence,
)
from orchestrator.master.observers.observer import Occurrence
from orchestrator.master.plan import Plan
from orchestrator.master.row import FACTOR, OFFSET
from orchestrator.program.kind import Kind
from orchestrator.system.names import PortName
from orchestrator.system.units import Linear

_SOURCE = Path(__file__).with_name("events.c")

#: Numbers that stand for what an action is, and for a comparison, in events.c.
_OVERRIDE, _BIAS, _FREEZE, _RELEASE, _SET, _RESET, _END = range(7)
_COMPARISONS = ("<", "<=", ">", ">=")

#: How many numbers an event, an action, and something that has happened are.
EVENT, ACTION, LISTED = 13, 4, 3

_TABLES = """\
/* A number of the simulation. */
typedef struct {{
    size_t place;
    int is_whole;
}} number;

/* An input: its column, and how it takes what feeds it. */
typedef struct {{
    int column, is_fed;
    double factor, offset;
}} input;

/* What can be set: a parameter, or an input that nothing feeds. */
typedef struct {{
    number at;
    int component;
    int input; /* -1: it is a parameter */
}} settable;

static const number columns[] = {{
{columns}
}};

static const input inputs[] = {{
{inputs}
}};

static const settable settables[] = {{
{settables}
}};

enum {{
    COMPONENTS = {n_components}, INPUTS = {n_inputs}, SETTABLES = {n_settables}
}};

static double get(const simulation *it, number of) {{
    const char *place = (const char *)it + of.place;
    double value;
    int whole;
    if (!of.is_whole) {{
        memcpy(&value, place, sizeof value);
        return value;
    }}
    memcpy(&whole, place, sizeof whole);
    return whole;
}}

static void put(simulation *it, number of, double value) {{
    char *place = (char *)it + of.place;
    const int whole = of.is_whole ? (int)value : 0;
    if (of.is_whole) {{
        memcpy(place, &whole, sizeof whole);
    }} else {{
        memcpy(place, &value, sizeof value);
    }}
}}"""

#: What a simulation begins with: its parameters, and what events alter.
BEGINNING = (
    "for (int i = 0; i < SETTABLES; i++) put(it, settables[i].at, parameters[i]);",
    "for (int i = 0; i < SETTABLES; i++) {",
    "    if (settables[i].input >= 0) it->supplied[settables[i].input] = parameters[i];",
    "}",
    "for (int i = 0; i < INPUTS; i++) {",
    "    it->factors[i] = inputs[i].factor;",
    "    it->offsets[i] = inputs[i].offset;",
    "}",
    "for (int i = 0; i < COMPONENTS; i++) it->started[i] = start_time;",
)

#: Whether values pass before a row shows them.
_PASSING = {
    True: "enum { HAS_PASSING = 1 };\n\n#define PASS(it, k, t) pass(it, k, t, &(Error){0})",
    False: "enum { HAS_PASSING = 0 };\n\n#define PASS(it, k, t) 0",
}


class Text(Protocol):
    """What has to be known of the text of a program: see :class:`.writer.Text`."""

    plan: Plan
    components: list[str]
    members: dict[str, str]
    passes: bool

    @property
    def columns(self) -> Mapping[PortName, Place]:
        """All inputs and outputs."""

    @property
    def inputs(self) -> Mapping[PortName, int]:
        """The numbers of all inputs."""

    @property
    def parameters(self) -> Mapping[PortName, Place]:
        """All parameters, and the inputs that nothing feeds."""

    def kind(self, component: str) -> Kind:
        """The kind of a component."""

    def evaluated(self, name: str) -> Iterator[str]:
        """Compute the outputs of a component."""


def tables_of(text: Text) -> str:
    """Where the numbers are that a host and events can set or see."""
    fed = {one.target: one.transformation for one in text.plan.system.connections}
    places = {name: i for i, name in enumerate(text.columns)}
    inputs = []
    for name in text.inputs:
        change = fed.get(name)
        factor, offset = FACTOR, OFFSET
        if isinstance(change, Linear):
            factor, offset = change.factor, change.offset
        numbers = f"{number_in_c(factor)}, {number_in_c(offset)}"
        inputs.append(f"    {{{places[name]}, {int(name in fed)}, {numbers}}},")
    components = {name: i for i, name in enumerate(text.components)}
    settables = [
        f"    {{{_number(place)}, {components[name.component]}, {text.inputs.get(name, -1)}}},"
        for name, place in text.parameters.items()
    ]
    return _TABLES.format(
        columns="\n".join(f"    {_number(place)}," for place in text.columns.values()),
        inputs="\n".join(inputs),
        settables="\n".join(settables),
        n_components=len(components),
        n_inputs=len(inputs),
        n_settables=len(settables),
    )


def text_of_events(text: Text) -> str:
    """The part of the text that has events happen."""
    source = _SOURCE.read_text(encoding="utf-8").strip()
    changes = (_retune(text), _restart(text), _restarts(text))
    return "\n\n".join([_PASSING[text.passes], *changes, source])


def _number(place: Place) -> str:
    return (
        f"{{offsetof(simulation, {place.text.removeprefix('it->')}), {int(place.type != FLOAT)}}}"
    )


def _switch(doc: str, head: str, cases: Mapping[int, Sequence[str]]) -> str:
    """A function that does something for one of the components."""
    body = "".join(
        f"    case {i}:\n" + "".join(f"        {line}\n" for line in lines)
        for i, lines in cases.items()
    )
    return (
        f"/* {doc} */\nstatic int {head} {{\n    Error noted = {{0}}, *error = &noted;\n"
        f"    switch (component) {{\n{body}    }}\n    return 0;\n}}"
    )


def _retune(text: Text) -> str:
    """What follows when parameters of a component have changed between two steps."""
    cases = {}
    for i, (name, member) in enumerate(text.members.items()):
        kind = text.kind(name)
        lines = [
            f"{kind.name}_adopt(&it->{member}, error);",
            f"if (error->raised) return refused(it, {i}, AT_SET, 0);",
        ]
        if text.passes and (kind.follows_inputs or kind.said.takes("outputs", "parameters")):
            # Outputs that follow from them are of now.
            lines += text.evaluated(name)
        cases[i] = [*lines, "return 0;"]
    doc = "Lets parameters of a component act from now on; whether it refuses them."
    return _switch(doc, "retune(simulation *it, int component)", cases)


def _restart(text: Text) -> str:
    cases = {
        i: [
            f"feed_{i}(it, now, error);",
            *([f"it->{member}.is_seeded = 0;"] * bool(text.kind(name).said.draws)),
            f"return start_{i}(it, t, error);",
        ]
        for i, (name, member) in enumerate(text.members.items())
    }
    doc = "Starts a component over, with its inputs of now; whether it refuses."
    head = "restart(simulation *it, const simulation *now, int component, double t)"
    return _switch(doc, head, cases)


def _restarts(text: Text) -> str:
    rows = (
        f"    times[{i}] = it->{member}.has_restarted ? it->{member}.restarted : -1.0;\n"
        if text.kind(name).tells
        else f"    times[{i}] = -1.0;\n"
        for i, (name, member) in enumerate(text.members.items())
    )
    return (
        "/* When guards of components first started states over [s]; less than 0: none did. */\n"
        "EXPORTED void restarts(const simulation *it, double times[]) {\n"
        f"    (void)it;\n{''.join(rows)}}}"
    )


# In numbers


class Agenda(NamedTuple):
    """What is to happen, as events.c has it, with how far it has come.

    Attributes:
        events, actions: a row each.
        happened: their number, then a row each.

    """

    events: np.ndarray
    actions: np.ndarray
    happened: np.ndarray


def agenda_of(text: Text, events: Sequence[Event]) -> Agenda:
    """What is to happen in a run of a program."""
    columns = {name: i for i, name in enumerate(text.columns)}
    found, actions = np.zeros((len(events), EVENT)), list[tuple[float, float, float, float]]()
    for row, event in zip(found, events, strict=True):
        first = len(actions)
        actions += _actions(text, event.action)
        when: tuple[float, ...] = (0.0, 0.0, 0.0)
        if event.when is not None:
            comparison = _COMPARISONS.index(event.when.comparison)
            when = columns[event.when.signal], comparison, event.when.value
        at = 0.0 if event.at is None else event.at
        times = event.at is not None, at, *when, event.repeat, event.lasts or 0.0
        row[: len(times) + 2] = *times, first, len(actions)
    return Agenda(
        found,
        np.array(actions, dtype=float).reshape(-1, ACTION),
        np.zeros(1 + len(events) * MOST_LISTED * LISTED),
    )


def _actions(text: Text, action: Action) -> Iterator[tuple[float, float, float, float]]:
    parameters = {name: i for i, name in enumerate(text.parameters)}
    match action:
        case Alter(effect, values):
            kind = _BIAS if effect == "bias" else _OVERRIDE
            for target, value in values:
                yield kind, text.inputs[target], float(value), 0.0
        case Freeze(targets):
            yield from ((_FREEZE, text.inputs[target], 0.0, 0.0) for target in targets)
        case Release(targets):
            yield from ((_RELEASE, text.inputs[target], 0.0, 0.0) for target in targets)
        case Set(tuned, supplied):
            for target, value in (*tuned, *supplied):
                yield _SET, parameters[target], float(value), 0.0
        case Reset(components):
            for name in components:
                yield _RESET, text.components.index(name), 0.0, 0.0
        case Stop():
            yield _END, 0.0, 0.0, 0.0
        case _:
            raise TypeError(f"a program does not know the event {action!r}")


def occurrences(
    events: Sequence[Event], happened: np.ndarray, experiment: Experiment
) -> list[Occurrence]:
    """What has happened in a run, in words."""
    rows: Any = happened[1:].reshape(-1, LISTED)[: int(happened[0])].astype(int).tolist()
    listed = [0] * len(events)
    found = []
    for number, step, ends in rows:
        listed[number] += 1
        time, n = experiment.time(step), listed[number]
        found.append(occurrence(events[number], number, time, n, ends=bool(ends)))
    return found
