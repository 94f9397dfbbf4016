"""A whole system as one native FMU: its program, called by the runtime of FMUs.

For the runtime, the system is one component, with the system's open inputs, all outputs and all
parameters. Its state at a communication point is what the components have before values are passed
along connections; the passed values follow from the state and the inputs:

    derived = the whole simulation, after values were passed
    outputs = outputs of derived
    update  = one communication step of derived

A step of the host that is longer than the system's is split evenly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from functools import cached_property
from itertools import accumulate
from math import lcm
from pathlib import Path
from typing import Any, NamedTuple

from auv_fmu.paper import euler
from fmus.discovery import write_archive
from fmus.documentation import html_of, page_of
from fmus.language.types import FLOAT, INT, Scalar, Type, count
from fmus.native.emit import closed, number_in_c, quoted
from fmus.native.packaging import Parts, entries_of
from fmus.native.pieces import array, function, has_only_doubles, moves, structure
from fmus.native.tables import places_of, port_tables
from fmus.native.translator import constants, defined
from fmus.ports.definition import DefaultExperiment, Model, Origin, check_enumerations
from fmus.ports.groups import is_class, reals_first, scalars_of
from fmus.ports.port import FAULT, H_MAX, TIME, Misdeclared, Port, largest_step
from fmus.ports.terminals import terminals_of
from orchestrator.cosim import Plan, PortName
from orchestrator.machine.compilers import compiler_for
from orchestrator.machine.compilers import platforms as platforms_of
from orchestrator.machine.disk import file_name
from orchestrator.machine.errors import InputError, reason
from orchestrator.program.components import definitions_of
from orchestrator.program.writer import Text, Unsupported

_NOISE = """\
/* A generator as numbers. */
enum { NOISE_NUMBERS = GENERATOR_WORDS + 3 };

static void model_put_noise(const generator *noise, double to[]) {
    for (int i = 0; i < GENERATOR_WORDS; i++) to[i] = (int32_t)noise->words[i];
    to[GENERATOR_WORDS] = noise->place;
    to[GENERATOR_WORDS + 1] = noise->has_next;
    to[GENERATOR_WORDS + 2] = noise->next;
}

static void model_take_noise(generator *noise, const double from[]) {
    for (int i = 0; i < GENERATOR_WORDS; i++) noise->words[i] = (uint32_t)(int32_t)from[i];
    noise->place = (uint32_t)(int32_t)from[GENERATOR_WORDS];
    noise->has_next = (int)from[GENERATOR_WORDS + 1];
    noise->next = from[GENERATOR_WORDS + 2];
}
"""

#: Types of a generator's numbers in the state: words, place, `has_next` and `next`.
_NOISE_TYPES = (*[int] * 625, bool, float)

_ERRORS = """\
/* Puts the name of a component before an error. */
static void model_ascribe(Error *error, string component) {
    const message why = error->why;
    if (!error->raised) return;
    error->raised = 0;
    raise_error(error, "%s: %s", component, why.text);
}

static void model_tell(const simulation *it, Error *error) {
    if (it->call == AT_INPUT) {
        raise_error(error, "its input %s is out of range",
                    model_inputs_of[it->component][it->port]);
    }
    model_ascribe(error, model_components[it->component]);
}
"""

_PUT, _TAKE, _SET, _FEED, _RENEW = (
    f"static {head}"
    for head in (
        "void model_put(const simulation *it, double to[])",
        "void model_take(simulation *it, const double from[])",
        "void model_set(simulation *it, const model_parameters *parameters, int all, Error *error)",
        "void model_feed(simulation *it, const model_inputs *inputs)",
        "int model_renew(simulation *it, Error *error)",
    )
)

_CONSTANTS = """\
#define SYSTEM_STEP {step}

/* 1 if only steps of this length can be made, and steps after which all components have stepped. */
enum {{ ONLY_SYSTEM_STEPS = {is_slow}, SYSTEM_CYCLE = {cycle} }};"""

#: Bodies of functions that the runtime calls.
_START = """\
simulation *it = calloc(1, sizeof *it);
int found;
if (it == NULL) {
    raise_error(error, "out of memory");
    return;
}
it->start_time = t;
it->step = SYSTEM_STEP;
model_set(it, parameters, 1, error);
model_feed(it, inputs);
found = come_to_rest(it, error);
if (found < 0) {
    model_tell(it, error);
} else if (found > 0) {
    raise_error(error, "values do not come to rest at the start");
} else {
    model_put(it, state->v);
}
free(it);"""

_DERIVE = """\
simulation *it = &derived->it;
model_set(it, parameters, !derived->begun, error);
derived->begun = 1;
model_take(it, state->v);
if (model_renew(it, error)) {
    model_tell(it, error);
    return;
}
model_feed(it, inputs);"""

_PASS = "if (pass(it, it->made, t, error)) model_tell(it, error);"

_UPDATE = f"""\
simulation *it = &derived->it;
/* Hosts that subtract times make steps that differ from the system's by rounding errors. */
it->step = fabs(h - SYSTEM_STEP) <= SYSTEM_STEP * {euler.ROUNDING!r} ? SYSTEM_STEP : h;
if (ONLY_SYSTEM_STEPS && it->step != SYSTEM_STEP) {{
    raise_error(error, "step %g s: only steps of %g s can be made", h, SYSTEM_STEP);
    return;
}}
if (make_step(it, it->made, t, error)) {{
    model_tell(it, error);
    return;
}}
it->made = (it->made + 1) % SYSTEM_CYCLE;
model_put(it, state->v);"""

_HEAD = """\
/* {title}
 *
 * {n} components and the connections between them, translated from the Python text of their
 * equations: begun at the start, and stepped as its scenario has it.
 */
#include <float.h>
#include <stddef.h>
#include <stdint.h>

#include "arithmetic.h"
#include "noise.c"
"""

_PAGE = """\
# {name}

{summary}.

{n} components are one FMU, whose variables are named `component.port`:

{rows}

An output is what the component has at the communication point, after values have passed along all
connections. The step is {step:g} s; {steps}

## What it is made of

This FMU holds compiled libraries. It needs only the C library of its platform. The C sources are in
its folder `sources`. Any importer can compile them for another platform: one file includes all
others."""

_SPLIT = "a longer one is split evenly, a shorter one is made as it is."
_FIXED = "others are refused, because {slow} makes longer steps than the others."


class Part(NamedTuple):
    """A part of the state.

    Attributes:
        owner: the value in C.
        type: its type; None: it is a generator of noise.
        types: types of its numbers in Python.

    """

    owner: str
    type: Type | None
    types: Sequence[Any]

    def put(self, at: int) -> list[str]:
        """Return statements that copy the part into the state, from a place on."""
        block = "memcpy(to + {at}, &{owner}, sizeof {owner});"
        return self._moved(
            at, "model_put_noise(&{owner}, to + {at});", block, "to[{place}] = {member};"
        )

    def take(self, at: int) -> list[str]:
        """Return statements that copy the part from the state."""
        block = "memcpy(&{owner}, from + {at}, sizeof {owner});"
        return self._moved(
            at, "model_take_noise(&{owner}, from + {at});", block, "{member} = {cast}from[{place}];"
        )

    def _moved(self, at: int, generator: str, block: str, each: str) -> list[str]:
        """Return statements in one of three forms: for a generator, a block, or each number."""
        if self.type is None:
            return [generator.format(owner=self.owner, at=at)]
        if not isinstance(self.type, Scalar) and has_only_doubles(self.type):
            return [block.format(owner=self.owner, at=at)]
        return [*moves(self.type, self.owner, range(at, at + count(self.type)), each)]


class SystemModel:
    """A system as an FMI model.

    Attributes:
        text: its program.
        name: name of the model.

    """

    def __init__(self, plan: Plan, name: str, title: str) -> None:
        """Translate the system of a plan.

        Args:
            plan: plan of the FMU's run.
            name: name of the model.
            title: one line about the system.

        Raises:
            InputError: the system cannot be one FMU, with the reason.

        """
        definitions = definitions_of(plan.system)
        self.text = Text(plan, definitions, is_tuned=True, is_hosted=True)
        self.plan, self.name, self._title = self.text.plan, name, title
        fed = {connection.target for connection in self.plan.system.connections}
        #: Unconnected inputs.
        self._open = [
            name
            for name, port in self.text.ports.items()
            if port.causality == "input" and name not in fed
        ]

    # Model description

    @cached_property
    def ports(self) -> tuple[Port, ...]:
        """All ports but `fault`: open inputs, outputs, and parameters with the system's values."""
        known = self.text.ports.items()
        outputs, parameters = (
            [name for name, port in known if port.causality == causality]
            for causality in ("output", "parameter")
        )
        try:
            ports = [self._renamed(name) for name in (*self._open, *outputs, *parameters)]
            ports.append(largest_step(self.plan.experiment.step))
            taken = {FAULT.name, TIME.name}
            for port in ports:
                if port.name in taken:
                    raise Unsupported(f"two variables of the FMU are named {port.name}")
                taken.add(port.name)
            ports = [*_with_distinct_enumerations(ports)]
            check_enumerations(tuple(ports))
        except Misdeclared as error:
            raise Unsupported(str(error)) from None
        return tuple(ports)

    def _renamed(self, name: PortName) -> Port:
        port = replace(self.text.ports[name], name=str(name), array=None)
        if port.causality == "output":
            return replace(port, start=None, feedthrough=tuple(self._direct(name)), initially=None)
        return replace(port, start=self.text.start(name), feedthrough=(), initially=())

    def _direct(self, output: PortName) -> list[str]:
        """Return the open inputs on which an output depends directly."""
        if self.text.stages.passing is None:
            # Outputs change only in steps.
            return []
        sources = {wire.target: wire.source for wire in self.plan.system.connections}
        inputs: set[str] = set()
        seen, waiting = {output}, [output]
        while waiting:
            at = waiting.pop()
            for port in self.text.ports[at].feedthrough:
                name = PortName(at.component, port)
                if name not in sources:
                    inputs.add(port if port == TIME.name else str(name))
                elif sources[name] not in seen:
                    seen.add(sources[name])
                    waiting.append(sources[name])
        return [name for name in (*map(str, self._open), TIME.name) if name in inputs]

    @cached_property
    def model(self) -> Model:
        """Content of the model description."""
        experiment = self.plan.experiment
        default = DefaultExperiment(
            experiment.stop_time, experiment.step, experiment.start_time, not self.text.slow
        )
        origins = [each.origin for each in dict.fromkeys(self.text.definitions.values())]
        texts = (
            "; ".join(dict.fromkeys(filter(None, (getattr(origin, field) for origin in origins))))
            for field in Origin._fields
        )
        return Model(self.name, self._title, Origin(*texts), self.ports, default)

    # Files of the FMU

    def parts(self, fmi: str) -> Parts:
        """Return the parts of its FMU for a version of FMI."""
        system, model = self.plan.system, self.model
        places = {H_MAX: "PARAMETER_AT(h_max)"}
        for name, member in self.text.members.items():
            own_places = places_of(self.text.definitions[name], f"model.{member}")
            if self.text.kind(name).has_h_max:
                own_places[H_MAX] = f"PARAMETER_AT(model.{self._longest(member)})"
            places |= {str(PortName(name, port)): place for port, place in own_places.items()}
        types = [type_ for part in self._state for type_ in part.types]
        groups = {
            f"{name}.": [
                port
                for port in self.text.definitions[name].ports
                if port.causality != "input" or PortName(name, port.name) in self._open
            ]
            for name in system.components
        }
        rows = "\n".join(
            f"- `{name}`: {self.text.definitions[name].name}, {self.text.definitions[name].summary}"
            for name in system.components
        )
        steps = _FIXED.format(slow=", ".join(sorted(self.text.slow))) if self.text.slow else _SPLIT
        head = _PAGE.format(
            name=self.name, summary=model.summary, n=len(system.components), rows=rows,
            step=self.plan.experiment.step, steps=steps,
        )  # fmt: skip
        page = html_of(self.name, page_of(model, (head,), fmi), model.origin.citation)
        return Parts(
            model,
            self._equations(),
            port_tables(model.ports, places, types),
            {"documentation/index.html": page.encode()},
            terminals_of(groups),
        )

    def _equations(self) -> str:
        """Return the text of equations.c."""
        title, n = closed(self._title), len(self.text.components)
        parts = [_HEAD.format(title=title, n=n).strip(), *self.text.core(), *self._glue()]
        return "\n\n".join(parts) + "\n"

    # The state

    @cached_property
    def _state(self) -> list[Part]:
        """Parts of the state, on which the rest of a run depends."""
        parts = [Part("it->start_time", FLOAT, [float]), Part("it->made", INT, [int])]
        for name, member in self.text.members.items():
            kind, owner = self.text.kind(name), f"it->{member}"
            behaviour, types = kind.behaviour, kind.types
            parts.append(Part(f"{owner}.state", types["state"], [*scalars_of(behaviour.state)]))
            # Any number is accepted here: enumerations are checked where they are used.
            parts.append(Part(f"{owner}.inputs", types["inputs"], _plain_types(behaviour.inputs)))
            numbers = _plain_types(behaviour.outputs)
            parts.append(Part(f"{owner}.outputs", types["outputs"], numbers))
            if name in self.text.slow:
                parts.append(Part(f"{owner}_shown", types["outputs"], numbers))
            if kind.is_timed:
                parts.append(Part(f"{owner}.time", FLOAT, [float]))
            parts += [Part(f"{owner}.draws[{i}]", FLOAT, [float]) for i in range(behaviour.draws)]
            if behaviour.draws:
                parts.append(Part(f"{owner}.noise", None, _NOISE_TYPES))
        return [part for part in parts if part.types]

    @cached_property
    def _placed(self) -> list[tuple[Part, int]]:
        """Parts of the state, each with its first place."""
        places = accumulate((len(part.types) for part in self._state), initial=0)
        return [*zip(self._state, places, strict=False)]

    # Functions that the runtime calls

    def _glue(self) -> list[str]:
        text, members = self.text, self.text.members.items()
        is_timed = any(kind.is_timed for kind in text.kinds.values())
        outputs = self._values("output")
        answers = {
            "CHECKS_STATES": 1,
            "OUTPUTS_TAKE_PARAMETERS": 1,
            "OUTPUTS_TAKE_DERIVED": 1,
            "OUTPUTS_TAKE_INPUTS": any({*port.feedthrough} - {TIME.name} for port in outputs),
            "OUTPUTS_TAKE_TIME": is_timed,
            "UPDATE_TAKES_DERIVED": 1,
            "DERIVE_TAKES_STATE": 1,
            "DERIVE_TAKES_INPUTS": bool(self._open),
            "DERIVE_TAKES_TIME": is_timed,
        }
        parameters = [row for name, member in members for row in self._parameters(name, member)]
        n_state = sum(len(part.types) for part in self._state)
        sizes = {"inputs": len(self._open), "outputs": len(outputs), "state": n_state}
        derived = ["simulation it;", "int begun; /* if set, it has parameters */"]
        counts = ", ".join(f"MODEL_{what.upper()} = {n}" for what, n in sizes.items())
        columns = {str(name): place.text for name, place in text.columns.items()}
        bodies = {
            "check": [line for name, member in members for line in self._check(name, member)],
            "check_state": [
                line for name, member in members for line in self._check_state(name, member)
            ],
            "start": _START.splitlines(),
            "derive": [*_DERIVE.splitlines(), *([_PASS] if text.passes else [])],
            "evaluate": [
                "const simulation *it = &derived->it;",
                *(f"outputs->v[{i}] = {columns[port.name]};" for i, port in enumerate(outputs)),
            ],
            "update": _UPDATE.splitlines(),
        }
        return [
            "/* Functions that the runtime calls. */",
            structure("model_parameters", parameters),
            *(structure(f"model_{what}", [f"double v[{n or 1}];"]) for what, n in sizes.items()),
            structure("model_derived", derived),
            f"enum {{ {counts} }};",
            _CONSTANTS.format(
                step=number_in_c(self.plan.experiment.step),
                is_slow=int(bool(text.slow)),
                cycle=lcm(*self.plan.decimations.values()),
            ),
            *self._names(),
            _ERRORS.strip(),
            *([_NOISE.strip()] if text.equations.is_noisy else []),
            function(_PUT, [line for part, at in self._placed for line in part.put(at)], ()),
            function(_TAKE, self._taken(), ()),
            function(_SET, self._set(), ()),
            function(_FEED, [*self._feed()], ("it", "inputs")),
            function(_RENEW, [*self._renewed(), "return 0;"], ("it", "error")),
            constants(answers),
            *defined(bodies),
        ]

    def _values(self, causality: str) -> list[Port]:
        """Return the ports of a causality in the order of their values."""
        return reals_first([port for port in self.ports if port.causality == causality])

    def _longest(self, member: str) -> str:
        """Return the member of the parameters for a component's largest internal step."""
        name = f"{member}_h_max"
        while name in self.text.members.values():
            name += "_"
        return name

    def _parameters(self, name: str, member: str) -> Iterator[str]:
        kind = self.text.kind(name)
        if count(kind.types["parameters"]):
            yield f"{self.text.emitter.type(kind.types['parameters'])} {member};"
        if kind.has_h_max:
            yield f"double {self._longest(member)};"

    def _set(self) -> list[str]:
        """Return statements that pass all parameters, or the changed ones, to the simulation."""
        lines = ["it->full_steps = it->steps = INT_MAX;", *self.text.unsplit()]
        for name, member in self.text.members.items():
            kind, owner = self.text.kind(name), f"it->{member}"
            change, acts = "all", list[str]()
            if count(kind.types["parameters"]):
                size = f"sizeof {owner}.parameters"
                moved = f"&{owner}.parameters, &parameters->{member}, {size}"
                change, acts = f"all || memcmp({moved}) != 0", [f"memcpy({moved});"]
            acts.append(f"{kind.name}_adopt(&{owner}, error);")
            lines += [f"if ({change}) {{", *(f"    {line}" for line in acts), "}"]
            if kind.has_h_max:
                longest = f"parameters->{self._longest(member)} * (1.0 + {euler.ROUNDING!r})"
                lines.append(f"{owner}.longest_step = fmin({longest}, DBL_MAX);")
            if kind.behaviour.draws:
                lines.append(f"{owner}.is_noisy = 1;")
        return lines

    def _taken(self) -> list[str]:
        """Return statements that restore a state, and mark values that must be derived again."""
        lines = [line for part, at in self._placed for line in part.take(at)]
        for name, member in self.text.members.items():
            kind = self.text.kind(name)
            if kind.behaviour.derived and kind.derives_anew:
                lines.append(f"it->{member}.underived = 1;")
        return lines

    def _feed(self) -> Iterator[str]:
        """Yield statements that pass open inputs to the simulation."""
        columns = {str(name): place for name, place in self.text.columns.items()}
        for i, port in enumerate(self._values("input")):
            place = columns[port.name]
            cast = "" if place.type == FLOAT else "(int)"
            yield f"{place.text} = {cast}inputs->v[{i}];"
        for name in dict.fromkeys(name.component for name in self._open):
            if self.text.kind(name).derives_from_inputs:
                yield f"it->{self.text.members[name]}.underived = 1;"

    def _renewed(self) -> Iterator[str]:
        """Yield statements that compute outputs again that depend on parameters.

        These are outputs that are not computed when values are passed on, or that are read before.
        """
        stages = self.plan.arrangement.stages
        place = {name: i for i, names in enumerate(stages) for name in names}
        early = {
            wire.source.component
            for wire in self.plan.system.connections
            if place[wire.source.component] >= place[wire.target.component]
        }
        passed = {
            visit.component
            for stage in self.text.stages.passing or ()
            for visit in stage.visits
            if self.text.reads(visit)
        }
        for i, (name, member) in enumerate(self.text.members.items()):
            kind = self.text.kind(name)
            follows = kind.follows_parameters and not kind.behaviour.is_sampled
            if follows and (name not in passed or name in early):
                yield f"{kind.name}_evaluate(&it->{member}, error);"
                yield "if (error->raised) {"
                yield f"    it->component = {i};"
                yield "    return 1;"
                yield "}"

    def _check(self, name: str, member: str) -> Iterator[str]:
        """Yield statements that check the parameters of a component."""
        kind = self.text.kind(name)
        if kind.behaviour.hooks["check"]:
            call = kind.call("check", parameters=f"parameters->{member}")
            yield "if (!error->raised) {"
            yield f"    {call};"
            yield f"    model_ascribe(error, {quoted(name)});"
            yield "}"

    def _check_state(self, name: str, member: str) -> Iterator[str]:
        """Yield statements that check the state of a component."""
        kind = self.text.kind(name)
        if not kind.behaviour.hooks["check_state"]:
            return
        given = {"parameters": f"parameters->{member}", "state": "of_one"}
        yield "if (!error->raised) {"
        yield f"    {self.text.emitter.type(kind.types['state'])} of_one;"
        for part, at in self._placed:
            if part.owner == f"it->{member}.state":
                lines = part._replace(owner="of_one").take(at)
                yield from (f"    {line.replace('from', 'state->v')}" for line in lines)
        yield f"    {kind.call('check_state', **given)};"
        yield f"    model_ascribe(error, {quoted(name)});"
        yield "}"

    def _names(self) -> Iterator[str]:
        """Yield arrays with the names of components and of their inputs."""
        components = self.text.components
        yield array("string model_components", map(quoted, components))
        for i, name in enumerate(components):
            names = [quoted(port.name) for port in self.text.kind(name).ports["input"]]
            yield array(f"string model_inputs_of_{i}", names or ['""'])
        inputs = (f"model_inputs_of_{i}" for i in range(len(components)))
        yield array("string *const model_inputs_of", inputs)


def _plain_types(hint: Any) -> list[Any]:
    """Return the types of numbers, int for enumerations."""
    return [int if is_class(scalar, IntEnum) else scalar for scalar in scalars_of(hint)]


def _with_distinct_enumerations(ports: Sequence[Port]) -> Iterator[Port]:
    """Yield ports with distinct names for different enumerations."""
    taken: dict[str, Mapping[str, int]] = {}
    for port in ports:
        name = port.enumeration
        while name and taken.setdefault(name, port.choices) != port.choices:
            name += "_"
        yield replace(port, enumeration=name)


def write_fmu(
    model: SystemModel,
    folder: Path,
    fmi: str,
    platforms: str | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Write the FMU of a system.

    Args:
        model: model of the system.
        folder: target folder.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.
        platforms: platforms, separated by commas, or `all`; None: this machine.
        tell: called with a line when a library is made.

    Raises:
        InputError: the FMU cannot be made, there is no such platform, or no compiler for it.

    """
    path = folder / f"{file_name(model.name)}.fmu"
    try:
        targets = platforms_of(fmi, platforms)
        entries = entries_of(model.parts(fmi), fmi, targets, compiler_for(targets), tell)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"the FMU cannot be built: {reason(error)}") from error
    write_archive(path, entries)
    return [path]
