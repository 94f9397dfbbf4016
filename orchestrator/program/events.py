"""Events of a program: the part of its text that they need.

Between two steps, `events.c` does what :mod:`orchestrator.cosim.events` does. It knows
numbers only: what happened is put into words by the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from fmus.language.types import FLOAT
from fmus.native.emit import number_in_c
from fmus.native.pieces import Place
from orchestrator.cosim import Linear, Plan, PortName
from orchestrator.program.kind import Kind

_SOURCE = Path(__file__).with_name("events.c")

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
        factor, offset = Linear.UNCHANGED
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
            *([f"it->{member}.has_noise = 0;"] * bool(text.kind(name).said.draws)),
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
