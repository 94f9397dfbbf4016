"""A system as one C program: its components, what goes from one to the other, and the steps.

The equations of all components are translated together, so what several of them use stands there
once. What is written here says what the FMUs' runtime and the master do, in the same order and with
the same numbers: `simulation` holds all values; `begin` sets parameters and lets values come to
rest at the start; `run` makes steps, and a row after each if it is given room. Nothing is
allocated, printed or shared.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from auv_fmu.paper import euler
from fmus.language import tree
from fmus.language.build import Program, Untranslatable
from fmus.language.types import FLOAT, Array, Type, is_whole
from fmus.native.emit import Emitter, closed, members, number_in_c
from fmus.native.names import RUNTIME, in_c
from fmus.native.pieces import Place, function, scalars, structure
from fmus.native.reducer import ReducerText
from fmus.ports.definition import Definition
from fmus.ports.port import H_MAX, Port
from fmus.ports.reducer import Reducer
from orchestrator.cosim import (
    Connection,
    Linear,
    Mapped,
    Plan,
    PortName,
    Stage,
    Visit,
)
from orchestrator.machine.errors import InputError, listed
from orchestrator.program.events import BEGINNING, tables_of, text_of_events
from orchestrator.program.kind import EULER, Kind
from orchestrator.program.reducing import Looking

#: What a component has refused, where `failure` names one.
CALLS = START, INPUT, OUTPUTS, STEP, SET = "AT_START", "AT_INPUT", "AT_OUTPUTS", "AT_STEP", "AT_SET"

#: How many numbers functions are given as they are; of more they get the address.
_MOST_COPIED = 16

#: Values go along all connections so often at the start, until they rest.
_MOST_ROUNDS = 1000

_INCLUDES = """\
#include <float.h>
#include <stddef.h>
#include <stdint.h>"""

#: What stands before functions that others call.
EXPORTED = """\
#ifndef EXPORTED
#define EXPORTED
#endif"""

#: How functions are called: those of components lie apart, and equations within them.
_HEADS = {
    False: "#ifndef APART\n#define APART static\n#endif",
    True: (
        "#if defined(__GNUC__)\n"
        "#define APART static __attribute__((noinline))\n"
        "#define WITHIN static inline __attribute__((always_inline))\n"
        "#else\n#define APART static\n#define WITHIN static inline\n#endif"
    ),
}

_FAILURE = """\
/* Where Python raises an exception, equations continue with the results of C, and the error is
 * noted, without its message. */
typedef struct {
    int raised;
} Error;

int(raise_error)(Error *error, const char *what, ...);

#define raise_error(error, ...) ((void)sizeof raise_error(error, __VA_ARGS__), (error)->raised = 1)
#define raise_if(test, error, ...)                    \\
    do {                                              \\
        if (test) raise_error(error, __VA_ARGS__);    \\
    } while (0)
"""

_CHECKS = """\
/* Partial sums that processors add side by side. */
enum { LANES = 4 };

static inline double sum_of(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    for (; i + LANES <= n; i += LANES) {
        for (j = 0; j < LANES; j++) sums[j] += values[i + j];
    }
    for (; i < n; i++) sums[0] += values[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* Whether all values are finite: their sum is, or is not only because they are large. */
static inline int are_finite(const double values[], int n) {
    int i = 0;
    if (isfinite(sum_of(values, n))) return 1;
    while (i < n && isfinite(values[i])) i++;
    return i == n;
}

static inline double sum_of_squares(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    for (; i + LANES <= n; i += LANES) {
        for (j = 0; j < LANES; j++) sums[j] += values[i + j] * values[i + j];
    }
    for (; i < n; i++) sums[0] += values[i] * values[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* Takes a value into an input: 0 where it is the same bit for bit, 1 where it is another one, and
 * 3 where that is more than a rounding error. */
static inline int take(double *input, double value) {
    const double before = *input;
    if (memcmp(&before, &value, sizeof value) == 0) return 0;
    *input = value;
    return fabs(value - before) <= 1e-12 + 1e-12 * fabs(before) ? 1 : 3;
}

static inline int take_whole(int *input, int value) {
    const int is_other = *input != value;
    *input = value;
    return is_other ? 3 : 0;
}"""

_DRAWING = """\
static inline void draw_normals(generator *noise, double draws[], int n) {
    for (int i = 0; i < n; i++) draws[i] = standard_normal(noise);
}"""

_TIMES = """\
static inline double time_after(const simulation *it, int k) {
    return k <= it->full_steps ? it->start_time + (double)k * it->step : it->stop_time;
}

/* How long n steps after the k-th last, or as many of them as are left. */
static inline double length_of(const simulation *it, int k, int n) {
    if (k + n <= it->full_steps) return (double)n * it->step;
    if (it->steps > it->full_steps) return it->stop_time - time_after(it, k);
    return (double)(it->full_steps - k) * it->step;
}

/* Notes what was refused. */
static int refused(simulation *it, int component, int call, int port) {
    it->component = component;
    it->call = call;
    it->port = port;
    return 1;
}"""

#: What keeps a file from being included twice.
_GUARD = re.compile(r"^#ifndef (\w+_[CH])\n#define \1\n|\n#endif\n\Z", re.MULTILINE)

_BEGIN = """\
/* Sets parameters, and lets values come to rest at the start; whether a component refuses. */
EXPORTED int begin(simulation *it, const double parameters[], double start_time, double step,
                   double stop_time, int full_steps, int steps)"""

_RUN = """\
/* Makes steps until so many are made, and rows if there is room for them; whether a component
 * refuses. */
EXPORTED int run(simulation *it, int until, double rows[])"""

_ACCESS = """\
EXPORTED size_t size_of_simulation(void) { return sizeof(simulation); }

/* What was refused: the component, by its number; a call; and which input; after how many steps. */
EXPORTED void failure(const simulation *it, int found[]) {
    found[0] = it->component;
    found[1] = it->call;
    found[2] = it->port;
    found[3] = it->made;
}

/* How many rows there are. */
EXPORTED int rows_shown(const simulation *it) { return it->shown; }"""


class Unsupported(InputError):
    """A system that cannot be one program; the text says why."""


class Equations:
    """The equations of components, and of indices: what programs of several systems can share.

    Attributes:
        emitter: of all of them.
        kinds: of components, by their definitions.
        reducers: that make indices, by their identities.
        is_quick: whether what is computed is checked by the program.

    """

    def __init__(
        self,
        definitions: Iterable[Definition],
        reducers: Iterable[Reducer],
        is_tuned: bool,
        is_quick: bool = False,
        foreseen: Callable[[Definition], Sequence[str]] = lambda _: (),
        feeding: Callable[[Definition], Iterable[Definition]] = lambda _: (),
    ) -> None:
        """Translate all of them together.

        Args:
            definitions: of the components.
            reducers: that make indices.
            is_tuned: whether parameters may change after the start.
            is_quick: whether what is computed is checked by the program, if it can wait for that.
            foreseen: outputs that others take before their inputs are known.
            feeding: definitions of what feeds components.

        Raises:
            Unsupported: one is outside the language of equations.

        """
        definitions, reducers = [*definitions], [*reducers]
        counts = Counter[Any]([*definitions, *map(id, reducers)])
        distinct = [*dict.fromkeys(definitions)]
        hooks = {one: one.behaviour.hooks for one in distinct}
        euler: Any = EULER
        by_identity = {id(one): one for one in reducers}
        program = Program(
            *(hook for one in distinct for hook in hooks[one].values() if hook),
            *euler,
            *(hook for one in by_identity.values() for hook in one.hooks.values()),
        )
        try:
            program.check()
        except Untranslatable as error:
            raise Unsupported(str(error).splitlines()[0]) from None
        trees = {
            one: {name: program.function(hook) for name, hook in hooks[one].items() if hook}
            for one in distinct
        }
        looks = (hook for one in by_identity.values() for hook in one.hooks.values())
        self._is_inlined = is_quick
        # What waits for a number would wait for ever for one that is none.
        waits = _waiting(program.functions.values())
        self.is_quick = is_quick and waits.isdisjoint(map(program.function, looks))
        waiting = {one for one in distinct if not waits.isdisjoint(trees[one].values())}
        checked = waiting.union(*map(feeding, waiting)) if self.is_quick else {*distinct}
        self.emitter = Emitter(program.functions.values(), _MOST_COPIED)
        self._euler = {one.__name__: program.function(one) for one in euler}
        self.kinds = {
            one: Kind(
                one,
                trees[one],
                self.emitter,
                self.emitter.unused(f"{_lower(one.name)}_component"),
                self._euler,
                is_tuned,
                one in checked,
                () if one in checked else foreseen(one),
                is_quick and counts[one] == 1,
            )
            for one in distinct
        }
        self.reducers = {
            key: ReducerText(
                one,
                program,
                self.emitter,
                self.emitter.unused(f"{_lower(one.name)}_index"),
                is_quick and counts[key] == 1,
            )
            for key, one in by_identity.items()
        }

    @property
    def is_noisy(self) -> bool:
        """Whether random numbers are drawn."""
        return any(kind.said.draws for kind in self.kinds.values())

    def text(self) -> list[str]:
        """All of it."""
        # Writing these adds to the structures.
        structures, functions = self._structures, self._functions
        equations = self.emitter.text()
        if self._is_inlined:
            equations = re.sub(r"^static (?=[\w ]+[ *]\w+\()", "WITHIN ", equations, flags=re.M)
        return [
            _HEADS[self._is_inlined],
            equations,
            _CHECKS,
            *([_DRAWING] if self.is_noisy else []),
            *structures,
            *functions,
        ]

    def apart(self) -> str:
        """All of it as a source of its own."""
        return "\n\n".join([head_of(self), *self.text()]) + "\n"

    @cached_property
    def header(self) -> str:
        """What a program has to know of what is compiled apart."""
        structures, functions = self._structures, "\n".join(self._functions)
        heads = re.findall(r"^APART ([^{]+?) \{$", functions, re.MULTILINE)
        return "\n\n".join(
            [
                head_of(self),
                *self.emitter.structures.values(),
                Emitter(self._euler.values()).text(),
                _CHECKS,
                *structures,
                *(f"{one};" for one in heads),
            ]
        )

    @cached_property
    def _structures(self) -> list[str]:
        return [
            *(one.structure() for one in self.kinds.values()),
            *(one.structure() for one in self.reducers.values()),
        ]

    @cached_property
    def _functions(self) -> list[str]:
        return [
            *(part for one in self.kinds.values() for part in one.text()),
            *(part for one in self.reducers.values() for part in one.text()),
        ]


def head_of(equations: Equations) -> str:
    """What a source with equations begins with."""
    arithmetic = (RUNTIME / "arithmetic.h").read_text(encoding="utf-8")
    noise = (RUNTIME / "noise.c").read_text(encoding="utf-8")
    arithmetic = arithmetic.replace('#include "error.h"\n', _FAILURE)
    parts = [_INCLUDES, arithmetic, *([noise] if equations.is_noisy else [])]
    return "\n\n".join(_GUARD.sub("", part).strip() for part in parts)


@dataclass
class Text:
    """The program of a system.

    Attributes:
        plan: of the run that it makes.
        definitions: of its components, by their names.
        indices: that look on.
        is_tuned: whether parameters may change after the start.
        is_hosted: whether a host says when each step begins.
        alters: whether events can happen in it.
        is_quick: whether outputs and states are checked together, once a step; that
            does not tell which component has refused.
        shared: equations that it shares with other programs; None: it has its own.

    """

    plan: Plan
    definitions: Mapping[str, Definition]
    indices: Sequence[Looking] = ()
    is_tuned: bool = False
    is_hosted: bool = False
    alters: bool = False
    is_quick: bool = False
    shared: Equations | None = None
    #: Functions of connections that map values, by what follows their names.
    mappings: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Translate the equations.

        Raises:
            Unsupported: the system has a ring of direct feedthroughs or goes back in time, or a
                component is outside the language of equations.

        """
        system = self.plan.system
        if self.plan.rings:
            names = listed(self.plan.rings[0])
            raise Unsupported(
                f"direct feedthroughs of {names} form a ring, which no program can have"
            )
        if self.plan.experiment.coupling == "linear":
            raise Unsupported("coupling linear goes back in time, which no program can")
        arrangement = self.plan.arrangement
        self.plan = replace(
            self.plan, experiment=replace(self.plan.experiment, order=arrangement.order)
        )
        self.stages = self.plan.stages()
        self.passes = self.stages.passing is not None
        self.is_tuned = self.is_tuned or self.alters
        self.components = [*system.components]
        self.members = dict(zip(self.components, _distinct(self.components), strict=True))
        self.slow = [name for name, n in self.plan.decimations.items() if n > 1]
        self.equations = self.shared or Equations(
            (self.definitions[name] for name in self.components),
            [one.reducer for one in self.indices],
            self.is_tuned,
            self.is_quick,
            self._foreseen,
            self._feeding,
        )
        self.is_quick = self.equations.is_quick
        self.emitter, self.kinds = self.equations.emitter, self.equations.kinds
        self.reducers = self.equations.reducers

    # What there is

    def kind(self, component: str) -> Kind:
        """The kind of a component."""
        return self.kinds[self.definitions[component]]

    @cached_property
    def columns(self) -> dict[PortName, Place]:
        """All inputs and outputs, as a row shows them."""
        found: dict[PortName, Place] = {}
        for name in self.components:
            found |= self._inputs(name)
            found |= self._outputs(name, "_shown" if name in self.slow else ".outputs")
        return found

    @cached_property
    def inputs(self) -> dict[PortName, int]:
        """The numbers of all inputs."""
        names = (port for name in self.components for port in self._inputs(name))
        return {port: i for i, port in enumerate(names)}

    @cached_property
    def parameters(self) -> dict[PortName, Place]:
        """All parameters, and the inputs that nothing feeds."""
        found: dict[PortName, Place] = {}
        for name in self.components:
            kind, owner = self.kind(name), f"it->{self.members[name]}"
            found |= self._named(name, "parameter", "parameters", f"{owner}.parameters")
            if kind.has_h_max:
                found[PortName(name, H_MAX)] = Place(f"{owner}.longest_step", FLOAT)
            fed = {connection.target for connection in self.plan.system.feeding[name]}
            inputs = self._inputs(name).items()
            found |= {port: place for port, place in inputs if port not in fed}
        return found

    def start(self, name: PortName) -> float | int | bool:
        """What a parameter, or an input that nothing feeds, is at the start."""
        value, port = self.plan.system.value(name), self.port(name)
        if isinstance(value, str):
            variable = self.plan.system.components[name.component].variable(name.port)
            value = int(variable.items[value])
        if value is None:
            value = port.start or 0
        types: dict[str, type[float | int | bool]] = {"Real": float, "Boolean": bool}
        return types.get(port.type, int)(value)

    def _inputs(self, name: str) -> dict[PortName, Place]:
        return self._named(name, "input", "inputs", f"it->{self.members[name]}.inputs")

    def _outputs(self, name: str, where: str = ".outputs") -> dict[PortName, Place]:
        return self._named(name, "output", "outputs", f"it->{self.members[name]}{where}")

    def _named(self, name: str, causality: str, group: str, owner: str) -> dict[PortName, Place]:
        kind = self.kind(name)
        places = scalars(kind.types[group], owner)
        return {
            PortName(name, port.name): place
            for port, place in zip(kind.ports[causality], places, strict=True)
        }

    @cached_property
    def _arrays(self) -> dict[str, str]:
        """The types of all arrays of numbers among inputs and outputs, by where they lie."""
        found: dict[str, str] = {}
        for name in self.components:
            kind, owner = self.kind(name), f"it->{self.members[name]}"
            shown = f"{owner}_shown" if name in self.slow else f"{owner}.outputs"
            for group, where in (("inputs", f"{owner}.inputs"), ("outputs", shown)):
                for text, type_ in _arrays(kind.types[group], where):
                    found[text] = f"{self.emitter.type(type_)} of {type_.n}"
        return found

    def _foreseen(self, definition: Definition) -> list[str]:
        """The outputs that others take before they pass, in a program that computes only these."""
        if not self.passes:
            return []
        sources = dict.fromkeys(one.source for one in self.plan.system.connections)
        return [
            *dict.fromkeys(
                source.port
                for source in sources
                if self.definitions[source.component] is definition
                and not self.plan.system.components[source.component].has_feedthrough(source.port)
            )
        ]

    def _feeding(self, definition: Definition) -> Iterable[Definition]:
        """The definitions of what feeds components of one."""
        return (
            self.definitions[one.source.component]
            for one in self.plan.system.connections
            if self.definitions[one.target.component] is definition
        )

    # The text

    def text(self) -> str:
        """All of it."""
        # Without the name of the system: others that are alike have the same program.
        title = closed(f"{listed(self.components)} as one program.")
        parts = [f"/* {title} */", head_of(self.equations), *self.core(), *self.calls()]
        return "\n\n".join(parts) + "\n"

    def apart(self) -> str:
        """All but the equations, of which it has the header."""
        return "\n\n".join([self.equations.header, *self._own(), *self.calls()]) + "\n"

    def core(self) -> list[str]:
        """What it is, whoever calls it: equations, components, the start, and a step."""
        return [*self.equations.text(), *self._own()]

    def _own(self) -> list[str]:
        # Writing these adds to the mappings.
        simulation, rest, steps = self._simulation(), self._rest(), self._steps()
        mappings = (head + body for body, head in self.mappings.items())
        return [simulation, _TIMES, *mappings, rest, *steps]

    def calls(self) -> list[str]:
        """What a host calls."""
        return [
            *([tables_of(self)] if self.alters else []),
            EXPORTED,
            self._begin(),
            f"enum {{ WIDTH = {1 + len(self.columns)} }};",
            self.show(),
            *self._look(),
            *self._run(),
            _ACCESS,
            *([text_of_events(self)] if self.alters else []),
        ]

    def _simulation(self) -> str:
        rows = [
            "double start_time, step, stop_time;",
            "int full_steps, steps; /* if there is one more of all steps, it is shorter */",
            "int made, shown; /* steps, and rows */",
            "int component, call, port; /* that was refused */",
            *(f"{self.kind(name).name} {member};" for name, member in self.members.items()),
        ]
        for name in self.slow:
            kind = self.kind(name)
            rows.append(f"{self.emitter.type(kind.types['outputs'])} {self.members[name]}_shown;")
        for i, (reducer, _) in enumerate(self.indices):
            rows.append(f"{self.reducers[id(reducer)].name} index_{i};")
        if self.indices:
            rows.append("double looked; /* when the last row was looked at [s] */")
        if self.alters:
            n = len(self.inputs)
            rows += [
                f"double factors[{n}], offsets[{n}]; /* of inputs */",
                f"double supplied[{n}]; /* to inputs that nothing feeds */",
                f"double started[{len(self.components)}]; /* when components were [s] */",
                "int due; /* after how many steps an event needs action */",
            ]
        whole = structure("simulation", rows)
        calls = f"enum {{ {', '.join(CALLS)} }};"
        return f"/* Everything that a run depends on. */\n{whole}\n\n{calls}"

    # The start

    def set_parameters(self) -> list[str]:
        """Take the numbers of an array as parameters."""
        values = [
            (place.text, f"parameters[{i}]" if place.type == FLOAT else f"(int)parameters[{i}]")
            for i, place in enumerate(self.parameters.values())
        ]
        return [*_copies(values)]

    def _begin(self) -> str:
        lines = [
            "Error noted = {0};",
            "memset(it, 0, sizeof *it);",
            "it->start_time = start_time;",
            "it->step = step;",
            "it->stop_time = stop_time;",
            "it->full_steps = full_steps;",
            "it->steps = steps;",
            *(BEGINNING if self.alters else self.set_parameters()),
            *self.unsplit(),
            "return come_to_rest(it, &noted) != 0;",
        ]
        return function(_BEGIN, lines, ())

    def unsplit(self) -> Iterator[str]:
        """Let components split steps that are longer than they may be, or none."""
        for name in self.components:
            kind, place = self.kind(name), f"it->{self.members[name]}.longest_step"
            if kind.has_h_max:
                yield f"{place} = fmin({place} * (1.0 + {euler.ROUNDING!r}), DBL_MAX);"
            elif kind.steps:
                yield f"{place} = DBL_MAX;"

    def _rest(self) -> str:
        """What lets values come to rest at the start."""
        system = self.plan.system
        order = [name for names in self.plan.arrangement.settling for name in names]
        turn = {name: i for i, name in enumerate(order)}
        # What feeds a component before it is its own component's turn.
        early = {
            one.source.component
            for one in system.connections
            if turn[one.source.component] >= turn[one.target.component]
        }
        settled, passed = ["int changed = 0, other;"], list[str]()
        for name in order:
            i = self.components.index(name)
            settled += [
                f"other = feed_{i}(it, it, error);",
                "changed |= other;",
                "if (other || everything) {",
                f"    if (start_{i}(it, it->start_time, error)) return -1;",
                "}",
            ]
            passed += [
                f"if (feed_{i}(it, it, error)) {{",
                *map("    {}".format, self._anew(name)),
                "}",
            ]
        starts = []
        for connection in system.connections:
            place = self.columns[connection.target]
            start = self.port(connection.target).start
            number = number_in_c(_as(place, 0 if start is None else start))
            starts.append(f"{place.text} = {number};")
        lines = [
            "int changed, rounds = 0;",
            *starts,
            *(
                f"if (start_{i}(it, it->start_time, error)) return -1;"
                for i, name in enumerate(self.components)
                if name in early
            ),
            "changed = settle(it, 1, error);",
            f"while (changed > 0 && rounds++ < {_MOST_ROUNDS}) changed = settle(it, 0, error);",
            # Of values that go on by rounding errors, the start leaves one.
            *(["if (changed == 1) return hand_on(it, error) ? -1 : 0;"] if early else []),
            "return changed;",
        ]  # fmt: skip
        handed_on = function(
            "static int hand_on(simulation *it, Error *error)", [*passed, "return 0;"]
        )
        doc = "/* Hands values on after the start; whether a component refuses. */"
        return "\n\n".join(
            (
                *(part for name in self.components for part in self._fed(name)),
                "/* Hands values along all connections once: what `take` says of all, or -1 where\n"
                " * a component refuses. */\n"
                + function(
                    "static int settle(simulation *it, int everything, Error *error)",
                    [*settled, "return changed;"],
                ),
                *([f"{doc}\n{handed_on}"] if early else []),
                "/* Lets values come to rest at the start: 0, 3 where they do not, or -1 where a\n"
                " * component refuses. */\n"
                + function(
                    "static int come_to_rest(simulation *it, Error *error)",
                    lines,
                ),
            )
        )

    def _fed(self, name: str) -> Iterator[str]:
        """What feeds a component, and what starts it."""
        i, taken = self.components.index(name), list[str]()
        member = f"it->{self.members[name]}"
        for connection in self.plan.system.feeding[name]:
            target = self.columns[connection.target]
            take = "take" if target.type == FLOAT else "take_whole"
            taken.append(f"is_other |= {take}(&{target.text}, {self.value(connection, 'now')});")
        yield (
            f"/* Lets {closed(name)} take what feeds it now; whether it is anything else. */\n"
            + function(
                f"static int feed_{i}(simulation *it, const simulation *now, Error *error)",
                ["int is_other = 0;", *taken, "return is_other;"],
                ("it", "now", "error"),
            )
        )
        yield "/* Starts it; whether it refuses. */\n" + function(
            f"static int start_{i}(simulation *it, double t, Error *error)",
            [
                *self.checked_inputs(name),
                *([f"it->started[{i}] = t;"] * self.alters),
                f"{self.kind(name).name}_start(&{member}, t, error);",
                self._refusal(name, START),
                *([f"{member}_shown = {member}.outputs;"] if name in self.slow else []),
                "return 0;",
            ],
        )

    def _anew(self, name: str) -> Iterator[str]:
        """Compute the outputs of a component that has taken other inputs at the start."""
        said, member = self.kind(name).said, f"it->{self.members[name]}"
        yield from self.checked_inputs(name)
        if said.derived and said.takes("derive", "inputs"):
            yield f"{member}.underived = 1;"
        yield f"{self.kind(name).name}_evaluate(&{member}, error);"
        yield self._refusal(name, OUTPUTS)
        if name in self.slow:
            yield f"{member}_shown = {member}.outputs;"

    def _refusal(self, name: str, call: str) -> str:
        return f"if (error->raised) return refused(it, {self.components.index(name)}, {call}, 0);"

    def port(self, name: PortName) -> Port:
        """A port of a component, as its author declared it."""
        ports = self.definitions[name.component].ports
        return next(port for port in ports if port.name == name.port)

    # What goes along connections

    def checked_inputs(self, name: str) -> Iterator[str]:
        """Refuse inputs that are out of range."""
        found, kind = self._inputs(name), self.kind(name)
        feeding = self.plan.system.feeding[name]
        # What is multiplied may become infinite, and whole numbers too large.
        changed = {
            one.target for one in feeding if self.alters or isinstance(one.transformation, Linear)
        }
        if self.alters:
            changed |= {*found}
            if any(found[one.target].type != FLOAT for one in feeding):
                number = self.components.index(name)
                yield f"if (error->raised) return refused(it, {number}, {INPUT}, -1);"
        for i, (port, (target, place)) in enumerate(
            zip(kind.ports["input"], found.items(), strict=True)
        ):
            tests = []
            if target in changed and place.type == FLOAT:
                tests.append(f"0.0 * {place.text} == 0.0")
            if port.minimum is not None:
                tests.append(f"{place.text} >= {number_in_c(_as(place, port.minimum))}")
            if port.maximum is not None:
                tests.append(f"{place.text} <= {number_in_c(_as(place, port.maximum))}")
            if port.choices:
                among = " || ".join(f"{place.text} == {int(one)}" for one in port.choices.values())
                tests.append(f"({among})")
            if tests:
                text = tests[0] if len(tests) == 1 and not port.choices else " && ".join(tests)
                number = self.components.index(name)
                yield f"if (!({text})) return refused(it, {number}, {INPUT}, {i});"

    def value(self, connection: Connection, owner: str = "it") -> str:
        """What arrives at the end of a connection, from the outputs of a simulation."""
        value = self.columns[connection.source].text.replace("it->", f"{owner}->", 1)
        target, change = connection.target, connection.transformation
        if isinstance(change, Mapped):
            value = self._mapped(target, change, value)
        if self.alters:
            i = self.inputs[target]
            value = f"it->factors[{i}] * {value} + it->offsets[{i}]"
            return value if self.columns[target].type == FLOAT else f"int_of({value}, error)"
        if isinstance(change, Linear):
            return f"{number_in_c(change.factor)} * {value} + {number_in_c(change.offset)}"
        return value

    def _mapped(self, target: PortName, change: Mapped, value: str) -> str:
        place = self.columns[target]
        of = "int" if is_whole(place.type) else "double"
        tests = "".join(
            f"    if (value == {number_in_c(float(a))}) return {number_in_c(_as(place, b))};\n"
            for a, b in change.pairs
        )
        body = f"(double value) {{\n{tests}    return ({of})value;\n}}"
        head = self.mappings.setdefault(body, f"static {of} mapped_{len(self.mappings)}")
        return f"{head.rpartition(' ')[2]}({value})"

    # Rows

    def show(self) -> str:
        """What writes a row."""
        values = [(f"row[{i}]", place.text) for i, place in enumerate(self.columns.values(), 1)]
        return "/* A row: the time, and all inputs and outputs. */\n" + function(
            "static void show(const simulation *it, double t, double row[])",
            ["row[0] = t;", *_copies(values)],
            (),
        )

    def _look(self) -> list[str]:
        """What looks at a row, and what gives the indices at the end."""
        if not self.indices:
            return []
        acts_at_end = int(self.plan.experiment.acting_row)
        lines, gives, n = ["const double h = t - it->looked;"], [], 0
        for i, (reducer, sources) in enumerate(self.indices):
            text = self.reducers[id(reducer)]
            of = dict(zip((port.name for port in reducer.ports), sources, strict=True))
            row = text.row(lambda port, of=of: self._source(of[port.name]))  # type: ignore[misc]
            look = (
                f"{text.name}_look(&it->index_{i}, {row}, {acts_at_end}, t, h, it->start_time, "
                "it->stop_time, &(Error){0});"
            )
            if reducer.last is not None:
                last = number_in_c(reducer.last)
                look = f"if (t >= time_after(it, it->steps) - {last}) {look}"
            lines.append(look)
            gives += [
                f"raised += it->index_{i}.begun < 0;",
                f"{text.name}_give(&it->index_{i}, it->looked, it->start_time, it->stop_time, "
                f"found + {n}, error);",
            ]
            n += sum(map(len, reducer.results.values()))
        lines.append("it->looked = t;")
        return [
            "/* Lets indices look at a row. */\n"
            + function("static void look(simulation *it, double t)", lines, ()),
            f"enum {{ INDICES = {n} }};\n\n"
            "/* The indices of the rows so far, what is not there is not a number; how many have\n"
            " * raised. */\n"
            + function(
                "EXPORTED int indices(const simulation *it, double found[])",
                [
                    "Error noted = {0}, *error = &noted;",
                    "int raised = 0;",
                    *gives,
                    "return raised + noted.raised;",
                ],
                (),
            ),
        ]

    def _source(self, source: PortName | float) -> str:
        if isinstance(source, PortName):
            return (self.columns.get(source) or self.parameters[source]).text
        return number_in_c(float(source))

    # Steps

    def _run(self) -> Iterator[str]:
        looks = ["look(it, t);"] * bool(self.indices)
        yield "/* Keeps the row after k steps. */\n" + function(
            "static void keep(simulation *it, int k, double rows[])",
            [
                "const double t = time_after(it, k);",
                "if (rows != NULL) show(it, t, rows + k * WIDTH);",
                *looks,
                "it->shown = k + 1;",
            ],
            ("t",),
        )
        lines = ["Error noted = {0}, *error = &noted;"]
        if self.passes:
            row = ["if (pass(it, k, time_after(it, k), error)) return 1;", "keep(it, k, rows);"]
            lines += [
                "while (it->made < until) {",
                "    const int k = it->made;",
                *(f"    {line}" for line in row),
                "    if (make_step(it, k, time_after(it, k), error)) return 1;",
                "    it->made = k + 1;",
                "}",
                "if (it->made == it->steps && it->shown == it->steps) {",
                "    const int k = it->made;",
                *(f"    {line}" for line in row),
                "}",
            ]
        else:
            lines += [
                "if (it->shown == 0) keep(it, 0, rows);",
                "while (it->made < until) {",
                "    const int k = it->made;",
                "    if (make_step(it, k, time_after(it, k), error)) return 1;",
                "    keep(it, k + 1, rows);",
                "    it->made = k + 1;",
                "}",
            ]
        # Steps look at what those before them have computed.
        yield function(_RUN, [*lines, *self._unsound(), "return 0;"], ())

    def _steps(self) -> list[str]:
        passing, parts = self.stages.passing, []
        if passing is not None:
            parts.append(self._made("pass", "Lets values of t_k pass", passing, ()))
        end = self._end("it->start_time")
        begin = ["const double h = length_of(it, k, 1);"]
        if not self.is_hosted:
            # What a host that counts its steps reaches.
            begin.append("const int is_counted = k < it->full_steps && it->start_time == 0.0;")
            end = f"is_counted ? time_after(it, k + 1) : {end}"
        begin.append(f"const double end = {end};")
        begin = [] if self.alters else begin
        doc = "Makes the step after the k-th"
        if self.is_quick:
            parts.append(self._sound())
        parts.append(self._made("make_step", doc, self.stages.stepping, begin))
        return parts

    def _unsound(self) -> list[str]:
        """What refuses what a run cannot go on from, where calls do not say so."""
        return ["if (!is_sound(it, error)) return refused(it, 0, AT_STEP, 0);"] * self.is_quick

    def _end(self, start: str) -> str:
        kind = next(iter(self.kinds.values()))
        return self.emitter.call(kind.euler["end_of_step"], [start, "t", "h"])

    def _sound(self) -> str:
        """Check outputs and states of all components."""
        tests = ["!error->raised"]
        for name, member in self.members.items():
            if (kind := self.kind(name)).is_checked:
                continue
            tests += filter(None, [kind.are_finite(f"it->{member}.outputs")])
            tests += filter(None, [kind.is_sound(f"it->{member}.state")] * kind.steps)
        lines = [f"int is_sound = {tests[0]};", *(f"is_sound &= {test};" for test in tests[1:])]
        return "/* Whether outputs and states are sound. */\n" + function(
            "static inline int is_sound(const simulation *it, const Error *error)",
            [*lines, "return is_sound;"],
        )

    def _made(self, name: str, doc: str, found: Sequence[Stage], begin: Sequence[str]) -> str:
        lines = [*begin]
        for stage in found:
            inner = list(self._stage(stage))
            if (when := stage.decimation) is not None:
                k = "(k + 1)" if when.at_end else "k"
                test = f"if ({k} % {when.every} == 0 || {k} == it->steps) {{"
                lines += [test, *(f"    {line}" for line in inner), "}"]
            else:
                lines += inner
        if found is self.stages.stepping and found[-1].decimation is not None:
            # The last stage, which looks at all, is not in every step.
            lines += self._unsound()
        return f"/* {doc}; whether a component refuses. */\n" + function(
            f"static int {name}(simulation *it, int k, double t, Error *error)",
            [*lines, "return 0;"],
            ("k", "t", "error", *(("h", "end") if begin else ())),
        )

    def _stage(self, stage: Stage) -> Iterator[str]:
        values = [(self.columns[one.target].text, self.value(one)) for one in stage.connections]
        yield from _copies(values, self._arrays)
        shown = {
            port: place
            for name in self.slow
            if any(port.component == name for port in stage.shows)
            for port, place in self._outputs(name).items()
        }
        yield from _copies(
            [(self.columns[one].text, shown[one].text) for one in stage.shows if one in shown]
        )
        for visit in stage.visits:
            yield from self._visited(visit, stage.decimation.every if stage.decimation else 1)
        if stage is self.stages.stepping[-1] and stage.decimation is None:
            # What was just written is slow to read in another way: outputs are better looked at
            # before they are computed again.
            yield from self._unsound()
        for visit in stage.visits:
            kind = self.kind(visit.component)
            is_stale = kind.follows_inputs and not (kind.said.is_sampled and visit.steps)
            if is_stale and self.reads(visit):
                is_early = bool(kind.foreseen) and visit.steps and not visit.takes
                # What is shown of a slow one may not be computed again before.
                is_early &= visit.component not in self.slow
                yield from self.evaluated(visit.component, "foresee" if is_early else "evaluate")

    def _visited(self, visit: Visit, every: int) -> Iterator[str]:
        name, kind = visit.component, self.kind(visit.component)
        member, said = f"it->{self.members[name]}", kind.said
        if visit.takes:
            yield from self.checked_inputs(name)
            if said.derived and said.takes("derive", "inputs"):
                yield f"{member}.underived = 1;"
        if not visit.steps:
            return
        if said.is_sampled:
            timed = [f"{member}.time = t;"] * kind.is_timed
            timed += [f"{member}.underived = 1;"] * bool(timed and said.takes("derive", "t"))
            anew = list(self.evaluated(name))
            lines = timed if visit.takes else [*timed, *anew]
            if timed:
                yield f"if ({member}.time != t) {{"
                yield from (f"    {line}" for line in lines)
                yield "}"
            yield from anew if visit.takes else ()
        times = ["t", "h", "end"]
        if every > 1 or self.alters:
            begun = "it->start_time"
            if self.alters:
                begun = f"it->started[{self.components.index(name)}]"
            yield "{"
            yield f"    const double h = length_of(it, k, {every});"
            times[2] = self._end(begun) if kind.is_timed else "t"
        call = f"{kind.name}_advance(&{member}, {', '.join(times)}, error);"
        if every > 1 or self.alters:
            yield f"    {call}"
            yield "}"
        else:
            yield call
        if kind.is_checked:
            yield self._refusal(name, STEP)

    def evaluated(self, name: str, how: str = "evaluate") -> Iterator[str]:
        """Compute the outputs of a component."""
        kind = self.kind(name)
        yield f"{kind.name}_{how}(&it->{self.members[name]}, error);"
        if kind.is_checked:
            yield self._refusal(name, OUTPUTS)

    def reads(self, visit: Visit) -> bool:
        """Whether one of the outputs is read that the component computes."""
        component = self.plan.system.components[visit.component]
        outputs = (port.name for port in self.kind(visit.component).ports["output"])
        return bool(visit.types_read(component, outputs))


def _waiting(functions: Iterable[tree.Function]) -> set[tree.Function]:
    """Those that may go round in a loop for ever, or call one that may.

    Args:
        functions: each after those that it calls.

    """
    found = set[tree.Function]()
    for one in functions:
        loops = any(isinstance(part, tree.While) for part in tree.statements_in(one.body))
        if loops or any(call.function in found for call in tree.calls_in(one.body)):
            found.add(one)
    return found


def _as(place: Place, value: float) -> float:
    return int(value) if is_whole(place.type) else float(value)


def _lower(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def _arrays(type_: Type, text: str) -> Iterator[tuple[str, Array]]:
    """The arrays of numbers in a value, and where they lie."""
    if isinstance(type_, Array) and not members(type_.item):
        yield text, type_
        return
    for suffix, part in members(type_):
        yield from _arrays(part, text + suffix)


#: A number of an array: the array, and its place.
_ELEMENT = re.compile(r"(\(int\))?(.+)\[(\d+)\]")


def _copies(values: Sequence[tuple[str, str]], arrays: Mapping[str, str] = {}) -> Iterator[str]:
    """Assignments, whole arrays in one and neighbours in a loop."""
    run: list[tuple[str, str]] = []
    for one in [*values, ("", "")]:
        if run and not _follows(run[-1], one):
            yield from _copied(run, arrays)
            run = []
        run.append(one)


def _follows(one: tuple[str, str], other: tuple[str, str]) -> bool:
    """Whether two assignments are of neighbours."""
    for before, after in zip(one, other, strict=True):
        a, b = _ELEMENT.fullmatch(before), _ELEMENT.fullmatch(after)
        if a is None or b is None or a.groups()[:2] != b.groups()[:2]:
            return False
        if int(b[3]) != int(a[3]) + 1:
            return False
    return True


def _copied(run: Sequence[tuple[str, str]], arrays: Mapping[str, str]) -> Iterator[str]:
    ends = [end for end in map(_ELEMENT.fullmatch, run[0]) if end]
    if len(run) == 1 or len(ends) < 2:
        yield from (f"{target} = {value};" for target, value in run if target)
        return
    whole = [end[2].removesuffix(".v") for end in ends]
    types = [arrays.get(text, text) for text in whole]
    if types[0] == types[1] and types[0].endswith(f" of {len(run)}"):
        yield f"{whole[0]} = {whole[1]};"
        return
    target, value = (f"{end[1] or ''}{end[2]}[i + {end[3]}]".replace(" + 0]", "]") for end in ends)
    yield f"for (int i = 0; i < {len(run)}; i++) {target} = {value};"


def _distinct(names: Sequence[str]) -> list[str]:
    """Names of members for components, which may have dots and the like in theirs."""
    found: list[str] = []
    for name in names:
        text = in_c(re.sub(r"\W", "_", name, flags=re.ASCII))
        text = text if text[0].isalpha() else f"of_{text}"
        while text in found or text in _TAKEN:
            text += "_"
        found.append(text)
    return found


#: Other members of the simulation.
_TAKEN = (
    "start_time", "step", "stop_time", "full_steps", "steps", "made", "shown", "component", "call",
    "port", "looked", "factors", "offsets", "supplied", "started", "due",
)  # fmt: skip
