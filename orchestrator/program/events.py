"""Events of a program: the part of its text that they need, and what they are in numbers.

Between two steps, `events.c` does what :mod:`orchestrator.master.hooks.events` does. It knows
numbers only: what happened is put into words here, or by the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.language.types import FLOAT
from fmus.native.emit import number_in_c
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
from orchestrator.master.row import FACTOR, OFFSET
from orchestrator.system.names import PortName
from orchestrator.system.units import Linear

if TYPE_CHECKING:
    from orchestrator.program.kind import Place
    from orchestrator.program.writer import Text

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
}} parameter;

{passing}

static const number columns[] = {{
{columns}
}};

static const input inputs[] = {{
{inputs}
}};

static const parameter parameters[] = {{
{parameters}
}};"""


#: Whether values pass before a row shows them.
_PASSING = {
    True: "enum { HAS_PASSING = 1 };\n\n#define PASS(it, k, t) pass(it, k, t, &(Error){0})",
    False: "enum { HAS_PASSING = 0 };\n\n#define PASS(it, k, t) 0",
}


def beginning(text: Text) -> Iterator[str]:
    """What the simulation begins with, for events to alter."""
    for name, i in text.inputs.items():
        factor, offset = _change(text, name)
        yield f"it->factors[{i}] = {number_in_c(factor)};"
        yield f"it->offsets[{i}] = {number_in_c(offset)};"
    for i, name in enumerate(text.parameters):
        if name in text.inputs:
            yield f"it->supplied[{text.inputs[name]}] = parameters[{i}];"
    n = len(text.components)
    yield f"for (int i = 0; i < {n}; i++) it->started[i] = start_time;"


def text_of_events(text: Text) -> str:
    """The part of the text that has events happen."""
    columns = [f"    {_number(place)}," for place in text.columns.values()]
    places = {name: i for i, name in enumerate(text.columns)}
    inputs = []
    for name in text.inputs:
        factor, offset = map(number_in_c, _change(text, name))
        is_fed = int(name in _fed(text))
        inputs.append(f"    {{{places[name]}, {is_fed}, {factor}, {offset}}},")
    parameters = [
        f"    {{{_number(place)}, {text.components.index(name.component)}, "
        f"{text.inputs.get(name, -1)}}},"
        for name, place in text.parameters.items()
    ]
    tables = _TABLES.format(
        passing=_PASSING[text.passes],
        columns="\n".join(columns),
        inputs="\n".join(inputs),
        parameters="\n".join(parameters),
    )
    return "\n\n".join([tables, _retune(text), _restart(text), _SOURCE.read_text().strip()])


def _fed(text: Text) -> Mapping[PortName, object]:
    return {one.target: one.transformation for one in text.plan.system.connections}


def _change(text: Text, name: PortName) -> tuple[float, float]:
    """What an input multiplies by, and adds to, what feeds it."""
    change = _fed(text).get(name)
    return (change.factor, change.offset) if isinstance(change, Linear) else (FACTOR, OFFSET)


def _number(place: Place) -> str:
    return (
        f"{{offsetof(simulation, {place.text.removeprefix('it->')}), {int(place.type != FLOAT)}}}"
    )


def _switch(doc: str, head: str, cases: Mapping[int, Sequence[str]]) -> str:
    body = "".join(
        f"    case {i}:\n{''.join(f'        {line}{chr(10)}' for line in lines)}        break;\n"
        for i, lines in cases.items()
    )
    return (
        f"/* {doc} */\nstatic int {head} {{\n    Error noted = {{0}}, *error = &noted;\n"
        f"    (void)error;\n    switch (component) {{\n{body}    }}\n    return 0;\n}}"
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
        cases[i] = lines
    doc = "Lets parameters of a component act from now on; whether it refuses them."
    return _switch(doc, "retune(simulation *it, int component)", cases)


def _restart(text: Text) -> str:
    cases = {}
    for i, (name, member) in enumerate(text.members.items()):
        lines = [
            f"{text.columns[one.target].text} = {text.value(one, 'now')};"
            for one in text.plan.system.feeding[name]
        ]
        lines += [
            *text.checked_inputs(name),
            f"it->started[{i}] = t;",
            *([f"it->{member}.is_seeded = 0;"] * bool(text.kind(name).said.draws)),
            f"{text.kind(name).name}_start(&it->{member}, t, error);",
            f"if (error->raised) return refused(it, {i}, AT_START, 0);",
        ]
        cases[i] = lines
    doc = "Starts a component over, with what feeds it now; whether it refuses."
    head = "restart(simulation *it, const simulation *now, int component, double t)"
    return _switch(doc, head, cases).replace("(void)error;", "(void)now;\n    (void)error;")


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
