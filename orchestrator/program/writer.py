"""A system as one C program: its components, connections, steps, indices and events.

The equations of all components are translated together, so that functions they share occur once.
The program does the work of the FMUs' runtime and of the master, in the same order and with the
same numbers. `simulation` holds all values. `begin` sets parameters and settles values at the
start. `run` makes steps, and writes a row after each if it has memory for rows. The program
allocates, prints and shares nothing.

For a program with events, `events.c` does between two steps what
:mod:`orchestrator.cosim.hooks.events` does. It has only numbers; the page writes the texts.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

from auv_fmu.paper import euler
from fmus.language import tree
from fmus.language.build import Program, Untranslatable
from fmus.language.types import FLOAT, INT, Array, Type, is_whole
from fmus.native.emit import Emitter, closed, members, number_in_c
from fmus.native.names import RUNTIME, in_c
from fmus.native.pieces import Place, function, scalars, structure
from fmus.native.reducer import ReducerText
from fmus.ports.behaviour import EXCHANGE
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
    System,
    Visit,
)
from orchestrator.machine.errors import InputError, listed
from orchestrator.program.kind import EULER, Kind
from orchestrator.vehicle.reduction import sources_of
from orchestrator.vehicle.signals import Loop

#: Calls that a component may refuse, as `failure` reports them.
CALLS = START, INPUT, OUTPUTS, STEP, SET = "AT_START", "AT_INPUT", "AT_OUTPUTS", "AT_STEP", "AT_SET"

#: Most numbers of an argument that is passed by value; larger ones are passed by address.
_MOST_COPIED = 16

#: Most rounds in which values are passed along all connections at the start.
_MOST_ROUNDS = 1000

_INCLUDES = """\
#include <float.h>
#include <stddef.h>
#include <stdint.h>"""

#: Macro before functions that hosts call.
EXPORTED = """\
#ifndef EXPORTED
#define EXPORTED
#endif"""

#: Macros of functions: with `True`, equations are inlined into the functions of components, which
#: are not inlined themselves.
_HEADS = {
    False: "#ifndef APART\n#define APART static\n#endif",
    True: (
        "#ifdef APART\n#elif defined(__GNUC__)\n"
        "#define APART static __attribute__((noinline))\n"
        "#define WITHIN static inline __attribute__((always_inline))\n"
        "#else\n#define APART static\n#define WITHIN static inline\n#endif"
    ),
}

_FAILURE = """\
/* Where Python raises an exception, equations continue with the results of C. Only the fact is
 * recorded, not the message. */
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

#: Type of texts, for programs that keep the messages of errors.
_STRING = "typedef const char *string;"

_CHECKS = """\
/* Before a loop, where a compiler has to be told. */
#ifndef UNROLLED
#define UNROLLED
#endif

/* Partial sums, for vector instructions. */
enum { LANES = 4 };

static inline double sum_of(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    UNROLLED
    for (; i + LANES <= n; i += LANES) {
        UNROLLED
        for (j = 0; j < LANES; j++) sums[j] += values[i + j];
    }
    UNROLLED
    for (; i < n; i++) sums[0] += values[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* True if all values are finite. Usually their sum shows it; large ones may overflow. */
static inline int are_finite(const double values[], int n) {
    int i;
    if (isfinite(sum_of(values, n))) return 1;
    UNROLLED
    for (i = 0; i < n; i++) {
        if (!isfinite(values[i])) return 0;
    }
    return 1;
}

static inline double sum_of_squares(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    UNROLLED
    for (; i + LANES <= n; i += LANES) {
        UNROLLED
        for (j = 0; j < LANES; j++) sums[j] += values[i + j] * values[i + j];
    }
    UNROLLED
    for (; i < n; i++) sums[0] += values[i] * values[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

static inline int same_bits(double a, double b) {
    uint64_t x = 0, y = 0;
    memcpy(&x, &a, sizeof a);
    memcpy(&y, &b, sizeof b);
    return x == y;
}

/* Assigns a value to an input. Returns 0 if its bits are the same, 1 if it differs by a rounding
 * error, else 3. */
static inline int take(double *input, double value) {
    const double before = *input;
    if (same_bits(before, value)) return 0;
    *input = value;
    return fabs(value - before) <= 1e-12 + 1e-12 * fabs(before) ? 1 : 3;
}

static inline int take_whole(int *input, int value) {
    const int is_other = *input != value;
    *input = value;
    return is_other ? 3 : 0;
}"""

#: Draws from a generator.
DRAWING = """\
static inline void draw_normals(generator *noise, double draws[], int n) {
    for (int i = 0; i < n; i++) draws[i] = standard_normal(noise);
}"""

_TIMES = """\
static inline double time_after(const simulation *it, int k) {
    return k <= it->full_steps ? it->start_time + (double)k * it->step : it->stop_time;
}

/* Length of n steps from the k-th, or of the rest of the run if that is shorter [s]. */
static inline double length_of(const simulation *it, int k, int n) {
    if (k + n <= it->full_steps) return (double)n * it->step;
    if (it->steps > it->full_steps) return it->stop_time - time_after(it, k);
    return (double)(it->full_steps - k) * it->step;
}

/* Records a refusal. Returns 1. */
static int refused(simulation *it, int component, int call, int port) {
    it->component = component;
    it->call = call;
    it->port = port;
    return 1;
}"""

#: Include guard of a header.
_GUARD = re.compile(r"^#ifndef (\w+_[CH])\n#define \1\n|\n#endif\n\Z", re.MULTILINE)

_BEGIN = """\
EXPORTED int begin(simulation *it, const double parameters[], double start_time, double step,
                   double stop_time, int full_steps, int steps)"""


_ACCESS = """\
EXPORTED size_t size_of_simulation(void) { return sizeof(simulation); }

/* Gives the refusal: numbers of component, call and input, and of steps before it. */
EXPORTED void failure(const simulation *it, int found[]) {
    found[0] = it->component;
    found[1] = it->call;
    found[2] = it->port;
    found[3] = it->made;
}

/* Returns the number of rows. */
EXPORTED int rows_shown(const simulation *it) { return it->shown; }"""


_CHANGES, _EVENTS, _STEPPING = (
    Path(__file__).with_name(f"{name}.c") for name in ("changes", "events", "stepping")
)

_CHANGE_TABLES = """\
/* A number of the simulation. */
typedef struct {{
    size_t place;
    int is_whole;
}} number;

/* An input: its column, and the factor and offset of its connection. */
typedef struct {{
    int column, is_fed;
    double factor, offset;
}} input;

/* Something that can be set: a parameter, or an unconnected input. */
typedef struct {{
    number at;
    int component;
    int input; /* its number; -1: a parameter */
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

#: Initialisation of parameters, and of values that events alter.
_BEGINNING = (
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

#: Place of the output `fault` of a component that has refused nothing.
_NO_FAULT = Place("it->no_fault", INT)

#: Statements that take the distances of all two vehicles; they are compared as squares.
_CLOSEST = (
    "for (int i = 1; i < VEHICLES; i++) {",
    "    for (int k = 0; k < i; k++) {",
    "        const double x = at[i][0] - at[k][0], y = at[i][1] - at[k][1];",
    "        const double z = at[i][2] - at[k][2];",
    "        it->closest = smaller(it->closest, x * x + y * y + z * z);",
    "    }",
    "}",
)

#: An error within a function, and one that the simulation keeps.
_NOTED = "Error noted = {0}, *error = &noted;"
_KEPT = "Error *error = fresh(it);"

_FRESH = """\
static inline Error *fresh(simulation *it) {
    it->noted.raised = 0;
    return &it->noted;
}"""


class Unsupported(InputError):
    """A system that cannot be one program, with the reason."""


class Equations:
    """Equations of components and of indices, which programs of several systems can share.

    Attributes:
        emitter: emitter of all equations.
        kinds: components in C, by definition.
        reducers: indices in C, by `id` of the reducer.
        is_quick: if set, the program checks outputs and states instead of each component.

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
        """Translate all equations together.

        Args:
            definitions: definitions of the components.
            reducers: reducers of the indices.
            is_tuned: if set, parameters may change after the start.
            is_quick: if set, the program checks outputs and states, where that can wait.
            foreseen: outputs that other components take before the inputs are known.
            feeding: definitions of the components that feed those of a definition.

        Raises:
            Unsupported: a component is outside the language of equations.

        """
        counts, reducer_counts = Counter(definitions), Counter(map(id, reducers := [*reducers]))
        by_id = {id(reducer): reducer for reducer in reducers}
        euler: Any = EULER
        hooks = {
            definition: {
                name: hook
                for name, hook in definition.behaviour.hooks.items()
                if hook and name not in EXCHANGE
            }
            for definition in counts
        }
        index_hooks = [hook for reducer in by_id.values() for hook in reducer.hooks.values()]
        program = Program(
            *chain.from_iterable(own_hooks.values() for own_hooks in hooks.values()),
            *euler,
            *index_hooks,
        )
        try:
            program.check()
        except Untranslatable as error:
            raise Unsupported(str(error).splitlines()[0]) from None
        trees = {
            definition: {name: program.function(hook) for name, hook in own_hooks.items()}
            for definition, own_hooks in hooks.items()
        }
        self._is_inlined = is_quick
        # A loop that waits for a number to change may never end if it is NaN.
        waits = _waiting(program.functions.values())
        self.is_quick = is_quick and waits.isdisjoint(map(program.function, index_hooks))
        waiting = {
            definition for definition in trees if not waits.isdisjoint(trees[definition].values())
        }
        checked = waiting.union(*map(feeding, waiting)) if self.is_quick else {*trees}
        self.emitter = Emitter(program.functions.values(), _MOST_COPIED)
        self._euler = {equation.__name__: program.function(equation) for equation in euler}
        self.kinds = {
            definition: Kind(
                definition,
                functions,
                self.emitter,
                self.emitter.unused(f"{_lower(definition.name)}_component"),
                self._euler,
                is_tuned,
                definition in checked,
                () if definition in checked else foreseen(definition),
                is_quick and counts[definition] == 1,
            )
            for definition, functions in trees.items()
        }
        self.reducers = {
            key: ReducerText(
                reducer,
                program,
                self.emitter,
                self.emitter.unused(f"{_lower(reducer.name)}_index"),
                is_quick and reducer_counts[key] == 1,
            )
            for key, reducer in by_id.items()
        }

    @property
    def is_noisy(self) -> bool:
        """True if a component draws random numbers."""
        return any(kind.behaviour.draws for kind in self.kinds.values())

    def text(self) -> list[str]:
        """Return the parts of the text."""
        # Writing these adds to the emitter's structures.
        structures, functions = self._structures, self._functions
        equations = self.emitter.text()
        if self._is_inlined:
            head = r"^static (inline )?(?=[\w ]+[ *]\w+\()"
            equations = re.sub(head, "WITHIN ", equations, flags=re.M)
        return [
            _HEADS[self._is_inlined],
            equations,
            _CHECKS,
            *([DRAWING] if self.is_noisy else []),
            *structures,
            *functions,
        ]

    def apart(self) -> str:
        """Return the equations as a separate source."""
        return "\n\n".join([head_of(self), *self.text()]) + "\n"

    @cached_property
    def header(self) -> str:
        """Declarations for programs whose equations are a separate source."""
        structures, functions = self._structures, "\n".join(self._functions)
        heads = re.findall(r"^APART ([^{]+?) \{$", functions, re.MULTILINE)
        return "\n\n".join(
            [
                head_of(self),
                *self.emitter.structures.values(),
                Emitter(self._euler.values()).text(),
                _CHECKS,
                *structures,
                *(f"{head};" for head in heads),
            ]
        )

    @property
    def _parts(self) -> list[Kind | ReducerText]:
        return [*self.kinds.values(), *self.reducers.values()]

    @cached_property
    def _structures(self) -> list[str]:
        return [part.structure() for part in self._parts]

    @cached_property
    def _functions(self) -> list[str]:
        return [text for part in self._parts for text in part.text()]


def head_of(equations: Equations, *, keeps_messages: bool = False) -> str:
    """Return the beginning of a source with equations."""
    text, error, arithmetic, noise = (
        (RUNTIME / name).read_text(encoding="utf-8")
        for name in ("text.c", "error.h", "arithmetic.h", "noise.c")
    )
    failure = [_FAILURE]
    if keeps_messages:
        failure = [
            _STRING,
            text.replace('#include "host.h"\n', ""),
            error.replace('#include "text.c"\n', ""),
        ]
    arithmetic = arithmetic.replace('#include "error.h"\n', "")
    parts = [_INCLUDES, *failure, arithmetic, *([noise] if equations.is_noisy else [])]
    return "\n\n".join(_GUARD.sub("", part).strip() for part in parts)


class Index(NamedTuple):
    """An index of a system, and the sources of its signals.

    Attributes:
        reducer: the reducer of the index.
        sources: a port, parameter or constant for each port of its rows, in their order.

    """

    reducer: Reducer
    sources: Sequence[PortName | float]


def indices_of(system: System, loop: Loop, reducers: Iterable[Reducer]) -> Iterator[Index]:
    """Yield the indices of a loop for which a system has all signals and parameters."""
    names = [
        f"{name}.{variable.name}"
        for name, component in system.components.items()
        for causality in ("input", "output", "parameter")
        for variable in component.having(causality)
    ]
    places = {name: i for i, name in enumerate(names)}
    for reducer in reducers:
        signals = sources_of(reducer, loop, places, {})
        if not signals.missing:
            constants = {port: float(value) for port, value in signals.constants.items()}
            ports = {
                port: system.named(PortName.read(names[i])) for port, i in signals.places.items()
            }
            sources: dict[str, PortName | float] = {**constants, **ports}
            yield Index(reducer, [sources[port.name] for port in reducer.ports])


def straight(plan: Plan) -> Plan:
    """Return the plan with the order that a program has.

    Raises:
        Unsupported: the system has a ring of direct feedthroughs, or goes back in time.

    """
    if plan.rings:
        names = listed(plan.rings[0])
        raise Unsupported(f"direct feedthroughs of {names} form a ring, which no program can have")
    if plan.experiment.coupling == "linear":
        raise Unsupported("coupling linear goes back in time, which no program can")
    return replace(plan, experiment=replace(plan.experiment, order=plan.arrangement.order))


def start_of(system: System, name: PortName, port: Port) -> float | int | bool:
    """Return the value of a parameter or an unconnected input at the start.

    Args:
        system: with the value, if it is set.
        name: of the parameter or input.
        port: its declaration.

    """
    value = system.value(name)
    if isinstance(value, str):
        value = int(system.variable(name).items[value])
    if value is None:
        value = port.start or 0
    return typed(port, value)


def typed(port: Port, value: float) -> float | int | bool:
    """Return a value in the type that the equations take."""
    types: dict[str, type[float | int | bool]] = {"Real": float, "Boolean": bool}
    return types.get(port.type, int)(value)


@dataclass
class Text:
    """The program of a system.

    Attributes:
        plan: plan of its run.
        definitions: definitions of its components, by component.
        indices: indices that it computes.
        loops: vehicles; it also computes the smallest distance of several, if their positions are
            outputs.
        is_tuned: if set, parameters may change after the start.
        is_hosted: if set, a host passes the time of each step.
        has_events: if set, events can happen.
        is_stepped: if set, a host makes single steps, and changes values between them.
        is_quick: if set, outputs and states are checked together, once a step, without finding out
            which component refuses.
        shared: equations that it shares with other programs; None: its own.

    """

    plan: Plan
    definitions: Mapping[str, Definition]
    indices: Sequence[Index] = ()
    loops: Sequence[Loop] = ()
    is_tuned: bool = False
    is_hosted: bool = False
    has_events: bool = False
    is_stepped: bool = False
    is_quick: bool = False
    shared: Equations | None = None

    def __post_init__(self) -> None:
        """Translate the equations.

        Raises:
            Unsupported: the system has a ring of direct feedthroughs or goes back in time, or a
                component is outside the language of equations.

        """
        #: Functions of connections that map values: beginnings by the rest of the text.
        self._mappings: dict[str, str] = {}
        self.plan = straight(self.plan)
        self.stages = self.plan.stages()
        self.passes = self.stages.passing is not None
        #: If set, values may change between steps.
        self.alters = self.has_events or self.is_stepped
        self.is_tuned = self.is_tuned or self.alters
        self._noted = _KEPT if self.is_stepped else _NOTED
        self.components = [*self.plan.system.components]
        self.members = dict(zip(self.components, _distinct(self.components), strict=True))
        self.slow = [name for name, n in self.plan.decimations.items() if n > 1]
        self.equations = self.shared or Equations(
            (self.definitions[name] for name in self.components),
            [index.reducer for index in self.indices],
            self.is_tuned,
            self.is_quick,
            self._foreseen,
            self._feeding,
        )
        self.is_quick = self.equations.is_quick
        self.emitter, self.kinds = self.equations.emitter, self.equations.kinds
        self.reducers = self.equations.reducers

    # Components, ports and their places

    def kind(self, component: str) -> Kind:
        """Return the kind of a component."""
        return self.kinds[self.definitions[component]]

    @cached_property
    def ports(self) -> Mapping[PortName, Port]:
        """Ports of all components, as their authors declared them."""
        return {
            PortName(name, port.name): port
            for name in self.components
            for port in self.definitions[name].ports
        }

    @cached_property
    def columns(self) -> dict[PortName, Place]:
        """Places of all inputs and outputs, in the order of a row."""
        places: dict[PortName, Place] = {}
        for name in self.components:
            places |= self._inputs(name)
            places |= self._outputs(name, "_shown" if name in self.slow else ".outputs")
        # FMUs have an output for faults, too.
        return {
            port: places.get(port, _NO_FAULT)
            for port in self.plan.system.columns()
            if self.is_stepped or port in places
        }

    @cached_property
    def positions(self) -> list[list[str]]:
        """Places of the positions of several vehicles; empty if one is not an output."""
        places = {str(name): place.text for name, place in self.columns.items()}
        positions = [[places.get(name, "") for name in loop.position] for loop in self.loops]
        return positions if len(positions) > 1 and all(map(all, positions)) else []

    @cached_property
    def inputs(self) -> dict[PortName, int]:
        """Numbers of all inputs."""
        names = (port for name in self.components for port in self._inputs(name))
        return {port: i for i, port in enumerate(names)}

    @cached_property
    def parameters(self) -> dict[PortName, Place]:
        """Places of all parameters and unconnected inputs."""
        places: dict[PortName, Place] = {}
        for name in self.components:
            kind, owner = self.kind(name), f"it->{self.members[name]}"
            places |= self._named(name, "parameter", "parameters", f"{owner}.parameters")
            if kind.has_h_max:
                places[PortName(name, H_MAX)] = Place(f"{owner}.longest_step", FLOAT)
            fed = {connection.target for connection in self.plan.system.feeding[name]}
            inputs = self._inputs(name).items()
            places |= {port: place for port, place in inputs if port not in fed}
        return places

    @property
    def noises(self) -> Iterator[str]:
        """Places of the generators of random numbers."""
        for name, member in self.members.items():
            if self.kind(name).behaviour.draws:
                yield f"it->{member}.noise"

    def start(self, name: PortName, system: System | None = None) -> float | int | bool:
        """Return the value of a parameter or an unconnected input at the start.

        Args:
            name: of the parameter or input.
            system: with other values of the same parameters; None: the system of the plan.

        """
        return start_of(system or self.plan.system, name, self.ports[name])

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
        """Types of all arrays of numbers among inputs and outputs, by place."""
        types: dict[str, str] = {}
        for name in self.components:
            kind, owner = self.kind(name), f"it->{self.members[name]}"
            shown = f"{owner}_shown" if name in self.slow else f"{owner}.outputs"
            for group, where in (("inputs", f"{owner}.inputs"), ("outputs", shown)):
                for text, type_ in _arrays(kind.types[group], where):
                    types[text] = f"{self.emitter.type(type_)} of {type_.n}"
        return types

    def _foreseen(self, definition: Definition) -> list[str]:
        """Return the outputs that are passed on before the inputs of their component are known."""
        if not self.passes:
            return []
        sources = dict.fromkeys(wire.source for wire in self.plan.system.connections)
        return [
            *dict.fromkeys(
                source.port
                for source in sources
                if self.definitions[source.component] is definition
                and not self.plan.system.components[source.component].has_feedthrough(source.port)
            )
        ]

    def _feeding(self, definition: Definition) -> Iterable[Definition]:
        """Yield the definitions of components that feed components of this definition."""
        return (
            self.definitions[wire.source.component]
            for wire in self.plan.system.connections
            if self.definitions[wire.target.component] is definition
        )

    # The text

    def text(self) -> str:
        """Return the whole program."""
        # Without the name of the system, so that equal systems have the same program.
        title = closed(f"{listed(self.components)} as one program.")
        head = head_of(self.equations, keeps_messages=self.keeps_messages)
        parts = [f"/* {title} */", head, *self.core(), *self.calls()]
        return "\n\n".join(parts) + "\n"

    @property
    def keeps_messages(self) -> bool:
        """True if the program keeps the message of an error."""
        return self.is_stepped and not self.is_quick

    def apart(self) -> str:
        """Return the program without the equations, with a header for them."""
        return "\n\n".join([self.equations.header, *self._own(), *self.calls()]) + "\n"

    def core(self) -> list[str]:
        """Return the parts for all kinds of hosts: equations, components, the start, and a step."""
        return [*self.equations.text(), *self._own()]

    def _own(self) -> list[str]:
        # Writing these adds to the mappings.
        simulation, rest, steps = self._simulation(), self._settling(), self._steps()
        mappings = (head + body for body, head in self._mappings.items())
        return [simulation, _TIMES, *mappings, rest, *steps]

    def calls(self) -> list[str]:
        """Return the functions that a host calls."""
        return [
            *([self._tables_of_changes()] if self.alters else []),
            EXPORTED,
            self._begin(),
            f"enum {{ WIDTH = {1 + len(self.columns)} }};",
            self.show(),
            *self._look(),
            *self._run(),
            _ACCESS,
            *self._changes(),
        ]

    def _simulation(self) -> str:
        rows = [
            "double start_time, step, stop_time;",
            "int full_steps, steps; /* of full length, and all: one more if the last is shorter */",
            "int made, shown; /* numbers of steps, and of rows */",
            "int component, call, port; /* of a refusal */",
            *(f"{self.kind(name).name} {member};" for name, member in self.members.items()),
        ]
        for name in self.slow:
            kind = self.kind(name)
            rows.append(f"{self.emitter.type(kind.types['outputs'])} {self.members[name]}_shown;")
        for i, (reducer, _) in enumerate(self.indices):
            rows.append(f"{self.reducers[id(reducer)].name} index_{i};")
        if self.indices:
            rows.append("double looked; /* time of the last row that indices took [s] */")
        if self.positions:
            rows.append("double closest; /* smallest squared distance of two vehicles [m2] */")
        if self.alters:
            n = len(self.inputs)
            rows += [
                f"double factors[{n}], offsets[{n}]; /* of inputs */",
                f"double supplied[{n}]; /* values of unconnected inputs */",
                f"double started[{len(self.components)}]; /* start times of components [s] */",
                "int due; /* number of steps after which an event needs action */",
            ]
        if self.is_stepped:
            rows += [
                "Error noted;",
                "int is_passed; /* if set, values have passed since the last change */",
                "int has_failed; /* if set, a component has refused */",
                "int no_fault; /* 0 */",
            ]
        whole = structure("simulation", rows)
        calls = f"enum {{ {', '.join(CALLS)} }};"
        fresh = f"\n\n{_FRESH}" * self.is_stepped
        return f"/* All values of a run. */\n{whole}\n\n{calls}{fresh}"

    # The start

    def set_parameters(self) -> list[str]:
        """Return statements that set the parameters from an array."""
        values = [
            (place.text, f"parameters[{i}]" if place.type == FLOAT else f"(int)parameters[{i}]")
            for i, place in enumerate(self.parameters.values())
        ]
        return [*_copies(values)]

    def _begin(self) -> str:
        lines = [
            "memset(it, 0, sizeof *it);",
            self._noted,
            "it->start_time = start_time;",
            "it->step = step;",
            "it->stop_time = stop_time;",
            "it->full_steps = full_steps;",
            "it->steps = steps;",
            *(["it->closest = INFINITY;"] if self.positions else []),
            *(_BEGINNING if self.alters else self.set_parameters()),
            *self.unsplit(),
            "return come_to_rest(it, error) != 0;",
        ]
        doc = "Sets parameters and settles values at the start. Returns 1 if a component refuses."
        return _function(doc, _BEGIN, lines, ())

    def unsplit(self) -> Iterator[str]:
        """Yield statements that set the longest step that each component does not split."""
        for name in self.components:
            kind, place = self.kind(name), f"it->{self.members[name]}.longest_step"
            if kind.has_h_max:
                yield f"{place} = fmin({place} * (1.0 + {euler.ROUNDING!r}), DBL_MAX);"
            elif kind.steps:
                yield f"{place} = DBL_MAX;"

    def _settling(self) -> str:
        """Return the functions that settle values at the start."""
        system = self.plan.system
        order = [name for names in self.plan.arrangement.settling for name in names]
        turn = {name: i for i, name in enumerate(order)}
        # Components that feed others before their own turn.
        early = {
            wire.source.component
            for wire in system.connections
            if turn[wire.source.component] >= turn[wire.target.component]
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
                *map("    {}".format, self._evaluated_again(name)),
                "}",
            ]
        starts = []
        for connection in system.connections:
            place = self.columns[connection.target]
            start = self.ports[connection.target].start
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
            # Values may keep changing by rounding errors: the start keeps one of them.
            *(["if (changed == 1) return hand_on(it, error) ? -1 : 0;"] if early else []),
            "return changed;",
        ]  # fmt: skip
        settle = _function(
            "Passes values along all connections once. Returns the bitwise or of all results of "
            "`take`, or -1 if a component refuses.",
            "static int settle(simulation *it, int everything, Error *error)",
            [*settled, "return changed;"],
        )
        hand_on = _function(
            "Passes values on after the start. Returns 1 if a component refuses.",
            "static int hand_on(simulation *it, Error *error)",
            [*passed, "return 0;"],
        )
        come_to_rest = _function(
            "Settles values at the start. Returns 0, 3 if they do not come to rest, or -1 if a "
            "component refuses.",
            "static int come_to_rest(simulation *it, Error *error)",
            lines,
        )
        feeding = (part for name in self.components for part in self._feeding_and_start(name))
        return "\n\n".join([*feeding, settle, *([hand_on] if early else []), come_to_rest])

    def _feeding_and_start(self, name: str) -> Iterator[str]:
        """Yield the functions that feed and start a component."""
        i, taken = self.components.index(name), list[str]()
        member = f"it->{self.members[name]}"
        for connection in self.plan.system.feeding[name]:
            target = self.columns[connection.target]
            take = "take" if target.type == FLOAT else "take_whole"
            taken.append(f"is_other |= {take}(&{target.text}, {self.value(connection, 'now')});")
        yield _function(
            f"Passes the current values to {closed(name)}. Returns nonzero if any changes.",
            f"static int feed_{i}(simulation *it, const simulation *now, Error *error)",
            ["int is_other = 0;", *taken, "return is_other;"],
            ("it", "now", "error"),
        )
        yield _function(
            "Starts it. Returns 1 if it refuses.",
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

    def _evaluated_again(self, name: str) -> Iterator[str]:
        """Yield statements that compute the outputs after other inputs at the start."""
        kind, member = self.kind(name), f"it->{self.members[name]}"
        yield from self.checked_inputs(name)
        if kind.derives_from_inputs:
            yield f"{member}.underived = 1;"
        yield f"{kind.name}_evaluate(&{member}, error);"
        yield self._refusal(name, OUTPUTS)
        if name in self.slow:
            yield f"{member}_shown = {member}.outputs;"

    def _refusal(self, name: str, call: str) -> str:
        return f"if (error->raised) return refused(it, {self.components.index(name)}, {call}, 0);"

    # Values along connections

    def checked_inputs(self, name: str) -> Iterator[str]:
        """Yield statements that refuse inputs that are out of range."""
        inputs, kind = self._inputs(name), self.kind(name)
        feeding = self.plan.system.feeding[name]
        # A product may be infinite, and a whole number too large.
        changed = {
            wire.target
            for wire in feeding
            if self.alters or isinstance(wire.transformation, Linear)
        }
        if self.alters:
            changed |= {*inputs}
            if any(inputs[wire.target].type != FLOAT for wire in feeding):
                number = self.components.index(name)
                yield f"if (error->raised) return refused(it, {number}, {INPUT}, -1);"
        for i, (port, (target, place)) in enumerate(
            zip(kind.ports["input"], inputs.items(), strict=True)
        ):
            tests = []
            if target in changed and place.type == FLOAT:
                tests.append(f"0.0 * {place.text} == 0.0")
            if port.minimum is not None:
                tests.append(f"{place.text} >= {number_in_c(_as(place, port.minimum))}")
            if port.maximum is not None:
                tests.append(f"{place.text} <= {number_in_c(_as(place, port.maximum))}")
            if port.choices:
                items = port.choices.values()
                among = " || ".join(f"{place.text} == {int(item)}" for item in items)
                tests.append(f"({among})")
            if tests:
                text = tests[0] if len(tests) == 1 and not port.choices else " && ".join(tests)
                number = self.components.index(name)
                yield f"if (!({text})) return refused(it, {number}, {INPUT}, {i});"

    def value(self, connection: Connection, owner: str = "it") -> str:
        """Return the value at the end of a connection, from the outputs of a simulation."""
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
        c_type = "int" if is_whole(place.type) else "double"
        tests = "".join(
            f"    if (value == {number_in_c(float(a))}) return {number_in_c(_as(place, b))};\n"
            for a, b in change.pairs
        )
        body = f"(double value) {{\n{tests}    return ({c_type})value;\n}}"
        head = self._mappings.setdefault(body, f"static {c_type} mapped_{len(self._mappings)}")
        return f"{head.rpartition(' ')[2]}({value})"

    # Rows

    def show(self) -> str:
        """Return the function that writes a row."""
        values = [(f"row[{i}]", place.text) for i, place in enumerate(self.columns.values(), 1)]
        return _function(
            "Writes a row: the time, and all inputs and outputs.",
            "static void show(const simulation *it, double t, double row[])",
            ["row[0] = t;", *_copies(values)],
            (),
        )

    def _look(self) -> list[str]:
        """Return the functions that pass a row to the indices, and that give the indices."""
        if not self.n_indices:
            return []
        acts_at_end = int(self.plan.experiment.acting_row)
        lines, gives, n = list[str](), list[str](), 0
        if self.indices:
            lines.append("const double h = t - it->looked;")
            lines.append(f"Error errors[{len(self.indices)}] = {{{{0}}}};")
        for i, (reducer, sources) in enumerate(self.indices):
            text = self.reducers[id(reducer)]
            source_of = dict(zip((port.name for port in reducer.ports), sources, strict=True))
            row = text.row(lambda port, source_of=source_of: self._source(source_of[port.name]))  # type: ignore[misc]
            look = (
                f"{text.name}_look(&it->index_{i}, {row}, {acts_at_end}, t, h, it->start_time, "
                f"it->stop_time, &errors[{i}]);"
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
            n += reducer.n_results
        if self.indices:
            lines.append("it->looked = t;")
        if self.positions:
            positions = ", ".join(f"{{{', '.join(places)}}}" for places in self.positions)
            lines += [
                f"enum {{ VEHICLES = {len(self.positions)} }};",
                f"const double at[VEHICLES][3] = {{{positions}}};",
                *_CLOSEST,
            ]
            gives.append(f"found[{n}] = sqrt(it->closest);")
        give_lines = [
            _NOTED,
            "int raised = 0;",
            *gives,
            "return raised + noted.raised;",
        ]
        return [
            _function(
                "Passes the current row to the indices.",
                "static void look(simulation *it, double t)",
                lines,
                ("t",),
            ),
            f"enum {{ INDICES = {self.n_indices} }};",
            _function(
                "Gives the indices of the rows so far, NaN for missing ones. Returns how many have "
                "raised an error.",
                "EXPORTED int indices(const simulation *it, double found[])",
                give_lines,
                (),
            ),
        ]

    @property
    def n_indices(self) -> int:
        """Number of values of the indices; the smallest distance is the last."""
        return sum(index.reducer.n_results for index in self.indices) + bool(self.positions)

    def _source(self, source: PortName | float) -> str:
        if isinstance(source, PortName):
            return (self.columns.get(source) or self.parameters[source]).text
        return number_in_c(float(source))

    # Steps

    def _run(self) -> Iterator[str]:
        looks = ["look(it, t);"] * bool(self.n_indices)
        yield _function(
            "Writes the row after k steps, and passes it to the indices.",
            "static void keep(simulation *it, int k, double rows[])",
            [
                "const double t = time_after(it, k);",
                "if (rows != NULL) show(it, t, rows + k * WIDTH);",
                *looks,
                "it->shown = k + 1;",
            ],
            ("t",),
        )
        lines = [self._noted]
        if self.passes:
            # The host of single steps asks for the last row.
            last = " || (it->made == it->steps && it->shown == it->steps)" * (not self.is_stepped)
            known = "!it->is_passed && " * self.is_stepped
            lines += [
                f"while (it->made < until{last}) {{",
                "    const int k = it->made;",
                f"    if ({known}pass(it, k, time_after(it, k), error)) return 1;",
                "    keep(it, k, rows);",
                "    it->is_passed = 0;" if self.is_stepped else "    if (k == it->steps) break;",
                "    if (make_step(it, k, time_after(it, k), error)) return 1;",
                "    it->made = k + 1;",
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
        # Checks at the beginning of a step cover the values of the step before.
        yield _function(
            "Makes steps up to number `until`, and rows unless `rows` is NULL. Returns 1 if a "
            "component refuses.",
            "EXPORTED int run(simulation *it, int until, double rows[])",
            [*lines, *self._unsound(), "return 0;"],
            (),
        )

    def _steps(self) -> list[str]:
        passing, parts = self.stages.passing, []
        if passing is not None:
            parts.append(self._step_function("pass", "Passes values of t_k on", passing, ()))
        end = self._end("it->start_time")
        begin = ["const double h = length_of(it, k, 1);"]
        if not self.is_hosted:
            # The end of a step for a host that counts its steps.
            begin.append("const int is_counted = k < it->full_steps && it->start_time == 0.0;")
            end = f"is_counted ? time_after(it, k + 1) : {end}"
        begin.append(f"const double end = {end};")
        begin = [] if self.alters else begin
        doc = "Makes the step after the k-th"
        if self.is_quick:
            parts.append(self._sound())
        parts.append(self._step_function("make_step", doc, self.stages.stepping, begin))
        return parts

    def _unsound(self) -> list[str]:
        """Return the check of outputs and states, for a program that checks them together."""
        return ["if (!is_sound(it, error)) return refused(it, 0, AT_STEP, 0);"] * self.is_quick

    def _end(self, start: str) -> str:
        kind = next(iter(self.kinds.values()))
        return self.emitter.call(kind.euler["end_of_step"], [start, "t", "h"])

    def _sound(self) -> str:
        """Return the function that checks outputs and states of all components."""
        tests = ["!error->raised"]
        for name, member in self.members.items():
            if (kind := self.kind(name)).is_checked:
                continue
            tests += filter(None, [kind.are_finite(f"it->{member}.outputs")])
            tests += filter(None, [kind.is_sound(f"it->{member}.state")] * kind.steps)
        lines = [f"int is_sound = {tests[0]};", *(f"is_sound &= {test};" for test in tests[1:])]
        return _function(
            "Tells whether all outputs and states are sound.",
            "static inline int is_sound(const simulation *it, const Error *error)",
            [*lines, "return is_sound;"],
        )

    def _step_function(
        self, name: str, doc: str, stages: Sequence[Stage], begin: Sequence[str]
    ) -> str:
        lines = [*begin]
        for stage in stages:
            inner = list(self._stage(stage))
            if (when := stage.decimation) is not None:
                k = "(k + 1)" if when.at_end else "k"
                test = f"if ({k} % {when.every} == 0 || {k} == it->steps) {{"
                lines += [test, *(f"    {line}" for line in inner), "}"]
            else:
                lines += inner
        if stages is self.stages.stepping and stages[-1].decimation is not None:
            # The last stage, which checks the values, is not part of every step.
            lines += self._unsound()
        return _function(
            f"{doc}. Returns 1 if a component refuses.",
            f"static int {name}(simulation *it, int k, double t, Error *error)",
            [*lines, "return 0;"],
            ("k", "t", "error", *(("h", "end") if begin else ())),
        )

    def _stage(self, stage: Stage) -> Iterator[str]:
        values = [(self.columns[wire.target].text, self.value(wire)) for wire in stage.connections]
        yield from _copies(values, self._arrays)
        shown = {
            port: place
            for name in self.slow
            if any(port.component == name for port in stage.shows)
            for port, place in self._outputs(name).items()
        }
        yield from _copies(
            [(self.columns[port].text, shown[port].text) for port in stage.shows if port in shown]
        )
        for visit in stage.visits:
            yield from self._visited(visit, stage.decimation.every if stage.decimation else 1)
        if stage is self.stages.stepping[-1] and stage.decimation is None:
            # Numbers that were just written are slow to read in vectors: check outputs before they
            # are computed again.
            yield from self._unsound()
        for visit in stage.visits:
            kind = self.kind(visit.component)
            is_stale = kind.follows_inputs and not (kind.behaviour.is_sampled and visit.steps)
            if is_stale and self.reads(visit):
                is_early = bool(kind.foreseen) and visit.steps and not visit.takes
                # The shown outputs of a slow component must not be computed again before.
                is_early &= visit.component not in self.slow
                yield from self._evaluated(visit.component, "foresee" if is_early else "evaluate")

    def _visited(self, visit: Visit, every: int) -> Iterator[str]:
        name, kind = visit.component, self.kind(visit.component)
        member, behaviour = f"it->{self.members[name]}", kind.behaviour
        if visit.takes:
            yield from self.checked_inputs(name)
            if kind.derives_from_inputs:
                yield f"{member}.underived = 1;"
        if not visit.steps:
            return
        if behaviour.is_sampled:
            timed = [f"{member}.time = t;"] * kind.is_timed
            timed += [f"{member}.underived = 1;"] * bool(timed and behaviour.takes("derive", "t"))
            anew = list(self._evaluated(name))
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

    def _evaluated(self, name: str, how: str = "evaluate") -> Iterator[str]:
        """Yield statements that compute the outputs of a component."""
        kind = self.kind(name)
        yield f"{kind.name}_{how}(&it->{self.members[name]}, error);"
        if kind.is_checked:
            yield self._refusal(name, OUTPUTS)

    def reads(self, visit: Visit) -> bool:
        """Tell whether a computed output of the component is read in a visit."""
        component = self.plan.system.components[visit.component]
        outputs = (port.name for port in self.kind(visit.component).ports["output"])
        return bool(visit.types_read(component, outputs))

    # Events

    def _tables_of_changes(self) -> str:
        """Return the tables of numbers that a host and events can set or read."""
        fed = {wire.target: wire.transformation for wire in self.plan.system.connections}
        places = {name: i for i, name in enumerate(self.columns)}
        inputs = []
        for name in self.inputs:
            change = fed.get(name)
            factor, offset = Linear.UNCHANGED
            if isinstance(change, Linear):
                factor, offset = change.factor, change.offset
            numbers = f"{number_in_c(factor)}, {number_in_c(offset)}"
            inputs.append(f"    {{{places[name]}, {int(name in fed)}, {numbers}}},")
        components = {name: i for i, name in enumerate(self.components)}
        settables = [
            f"    {{{_number(place)}, {components[name.component]}, {self.inputs.get(name, -1)}}},"
            for name, place in self.parameters.items()
        ]
        return _CHANGE_TABLES.format(
            columns="\n".join(f"    {_number(place)}," for place in self.columns.values()),
            inputs="\n".join(inputs),
            settables="\n".join(settables),
            n_components=len(components),
            n_inputs=len(inputs),
            n_settables=len(settables),
        )

    def _changes(self) -> list[str]:
        """Return the parts of the program that change values between steps."""
        if not self.alters:
            return []
        passed = "pass(it, it->made, time_after(it, it->made), error)" if self.passes else "0"
        pass_now = _function(
            "Passes present values on, if any pass. Returns 1 if a component refuses.",
            "static int pass_now(simulation *it)",
            [*([self._noted] * self.passes), f"return {passed};"],
            ("it",),
        )
        reason = "it->noted.why.text" if self.keeps_messages else '""'
        defined = [
            f"enum {{ HAS_PASSING = {int(self.passes)} }};",
            f"#define REASON(it) {reason}",
        ]
        restarts = [self._restart(), self._restarts()] if self.has_events else []
        sources = [_CHANGES, *[_EVENTS] * self.has_events, *[_STEPPING] * self.is_stepped]
        texts = [path.read_text(encoding="utf-8").strip() for path in sources]
        return ["\n".join(defined), pass_now, self._retune(), *restarts, *texts]

    def _retune(self) -> str:
        """Return the function that adopts parameters of a component that changed between steps."""
        cases = {}
        for i, (name, member) in enumerate(self.members.items()):
            kind = self.kind(name)
            lines = [
                f"{kind.name}_adopt(&it->{member}, error);",
                f"if (error->raised) return refused(it, {i}, AT_SET, 0);",
            ]
            if self.passes and (kind.follows_inputs or kind.follows_parameters):
                # Outputs that depend on the parameters change at once.
                lines += self._evaluated(name)
            cases[i] = [*lines, "return 0;"]
        doc = "Adopts changed parameters of a component. Returns 1 if it refuses them."
        return _switch(doc, "retune(simulation *it, int component)", [self._noted], cases)

    def _restart(self) -> str:
        cases = {
            i: [
                f"feed_{i}(it, now, error);",
                *([f"it->{member}.has_noise = 0;"] * bool(self.kind(name).behaviour.draws)),
                f"return start_{i}(it, t, error);",
            ]
            for i, (name, member) in enumerate(self.members.items())
        }
        doc = "Restarts a component with its current inputs. Returns 1 if it refuses."
        head = "restart(simulation *it, const simulation *now, int component, double t)"
        return _switch(doc, head, [self._noted], cases)

    def _restarts(self) -> str:
        rows = (
            f"    times[{i}] = it->{member}.has_restarted ? it->{member}.restarted : -1.0;\n"
            if self.kind(name).keeps_restart
            else f"    times[{i}] = -1.0;\n"
            for i, (name, member) in enumerate(self.members.items())
        )
        return (
            "/* Gives the times at which guards first reset states [s]; -1: never. */\n"
            "EXPORTED void restarts(const simulation *it, double times[]) {\n"
            f"    (void)it;\n{''.join(rows)}}}"
        )


def _function(
    doc: str, head: str, lines: Sequence[str], arguments: Sequence[str] = ("error",)
) -> str:
    """Return a C function with a comment; arguments that it does not use are marked so."""
    comment = "\n * ".join(wrap(doc, 94))
    return f"/* {comment} */\n{function(head, lines, arguments)}"


def _number(place: Place) -> str:
    return (
        f"{{offsetof(simulation, {place.text.removeprefix('it->')}), {int(place.type != FLOAT)}}}"
    )


def _switch(doc: str, head: str, first: Sequence[str], cases: Mapping[int, Sequence[str]]) -> str:
    """Return a C function with some statements, and a case for each component."""
    before = "".join(f"    {line}\n" for line in first)
    body = "".join(
        f"    case {i}:\n" + "".join(f"        {line}\n" for line in lines)
        for i, lines in cases.items()
    )
    return (
        f"/* {doc} */\nstatic int {head} {{\n{before}"
        f"    switch (component) {{\n{body}    }}\n    return 0;\n}}"
    )


def _waiting(functions: Iterable[tree.Function]) -> set[tree.Function]:
    """Return the functions with loops that might not end, and their callers.

    Args:
        functions: functions, each after those that it calls.

    """
    waiting = set[tree.Function]()
    for each in functions:
        loops = any(isinstance(part, tree.While) for part in tree.statements_in(each.body))
        if loops or any(call.function in waiting for call in tree.calls_in(each.body)):
            waiting.add(each)
    return waiting


def _as(place: Place, value: float) -> float:
    return int(value) if is_whole(place.type) else float(value)


def _lower(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def _arrays(type_: Type, text: str) -> Iterator[tuple[str, Array]]:
    """Yield the places and types of the arrays of numbers in a value."""
    if isinstance(type_, Array) and not members(type_.item):
        yield text, type_
        return
    for suffix, part in members(type_):
        yield from _arrays(part, text + suffix)


#: An element of an array: a cast, the array, and the index.
_ELEMENT = re.compile(r"(\(int\))?(.+)\[(\d+)\]")


def _copies(values: Sequence[tuple[str, str]], arrays: Mapping[str, str] = {}) -> Iterator[str]:
    """Yield assignments: one for a whole array, and a loop for neighbours."""
    run: list[tuple[str, str]] = []
    for assignment in [*values, ("", "")]:
        if run and not _follows(run[-1], assignment):
            yield from _copied(run, arrays)
            run = []
        run.append(assignment)


def _follows(first: tuple[str, str], second: tuple[str, str]) -> bool:
    """Tell whether two assignments are of neighbours in arrays."""
    for before, after in zip(first, second, strict=True):
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
    """Return distinct names of members for components, whose names may have dots."""
    distinct: list[str] = []
    for name in names:
        text = in_c(re.sub(r"\W", "_", name, flags=re.ASCII))
        text = text if text[0].isalpha() else f"of_{text}"
        while text in distinct or text in _TAKEN:
            text += "_"
        distinct.append(text)
    return distinct


#: Other members of the simulation.
_TAKEN = (
    "start_time", "step", "stop_time", "full_steps", "steps", "made", "shown", "component", "call",
    "port", "looked", "factors", "offsets", "supplied", "started", "due",
)  # fmt: skip
