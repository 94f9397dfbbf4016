"""A whole system as one native FMU: its program, called by the runtime of FMUs.

To the runtime it is one component. Its open inputs are the inputs, all outputs the outputs, all
parameters the parameters. The state at a communication point is what components have before values
pass; what passes follows from that and from the inputs, and a step begins with it. So

    derived = the whole simulation, after values have passed
    outputs = those of derived
    update  = one communication step of derived

A step of the host that is longer than the system's is split evenly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from functools import cached_property
from math import lcm
from pathlib import Path
from typing import Any, NamedTuple

from auv_fmu.paper import euler
from fmus.compilers import compiler_for
from fmus.discovery import write_archive
from fmus.documentation import html_of, page_of
from fmus.kinds import platforms as platforms_of
from fmus.language.types import FLOAT, Type, count
from fmus.native.emit import closed, lines_of, number_in_c, quoted
from fmus.native.numbers import has_only_doubles, moves
from fmus.native.packaging import Parts, entries_of
from fmus.native.pieces import function, structure
from fmus.native.tables import places_of, port_tables
from fmus.native.translator import constants, defined
from fmus.ports.definition import DefaultExperiment, Definition, Model, Origin, check_enumerations
from fmus.ports.description_fmi3 import terminals_of
from fmus.ports.groups import is_class, reals_first, scalars_of
from fmus.ports.port import FAULT, H_MAX, TIME, Misdeclared, Port, largest_step
from orchestrator.machine.errors import InputError, reason
from orchestrator.master.plan import Plan
from orchestrator.master.stages import Visit
from orchestrator.program.writer import Text, Unsupported
from orchestrator.system.names import PortName, file_name

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

#: The numbers of a generator as the state has them: words, place, whether there is a next, and it.
_NOISE_TYPES = (*[int] * 625, bool, float)

_TOLD = """\
/* Says whose an error is. */
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

_PUT, _TAKE, _SET, _FEED = (
    f"static void model_{head}"
    for head in (
        "put(const simulation *it, double to[])",
        "take(simulation *it, const double from[])",
        "set(simulation *it, const model_parameters *parameters, int all, Error *error)",
        "feed(simulation *it, const model_inputs *inputs)",
    )
)

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
    """Some numbers of the state.

    Attributes:
        owner: what holds them.
        types: of the numbers, in Python.
        put, take: statements that move them from what holds them, or to it, by their first place.

    """

    owner: str
    types: Sequence[Any]
    put: Callable[[int], list[str]]
    take: Callable[[int], list[str]]


class SystemModel:
    """A system as a model of FMI.

    Attributes:
        text: its program.
        name: of the model.

    """

    def __init__(
        self, plan: Plan, definitions: Mapping[str, Definition], name: str, title: str
    ) -> None:
        """Look at the system of a plan.

        Args:
            plan: of the run that the FMU makes.
            definitions: of the components, by their names.
            name: of the model.
            title: one line about it.

        Raises:
            InputError: it cannot be one FMU; the text says why.

        """
        self.text, self.name = Text(plan, definitions, is_tuned=True, is_hosted=True), name
        self.plan, self._definitions, self._title = self.text.plan, definitions, title

    # What the description says

    @cached_property
    def _open(self) -> list[PortName]:
        """The inputs that nothing feeds."""
        system = self.plan.system
        fed = {connection.target for connection in system.connections}
        return [name for name in self._ports_of("input") if name not in fed]

    def _ports_of(self, causality: str) -> list[PortName]:
        return [
            PortName(name, port.name)
            for name in self.plan.system.components
            for port in self._definitions[name].ports
            if port.causality == causality
        ]

    def _port(self, name: PortName) -> Port:
        return self._known[name]

    @cached_property
    def _known(self) -> dict[PortName, Port]:
        """The ports of the components."""
        return {
            PortName(name, port.name): port
            for name in self.plan.system.components
            for port in self._definitions[name].ports
        }

    @cached_property
    def ports(self) -> tuple[Port, ...]:
        """All but `fault`: open inputs, outputs, and parameters, which have the system's values."""
        names = {
            "input": self._open,
            "output": self._ports_of("output"),
            "parameter": self._ports_of("parameter"),
        }
        try:
            found = [self._renamed(name) for named in names.values() for name in named]
            found.append(largest_step(self.plan.experiment.step))
            taken = {FAULT.name, TIME.name}
            for port in found:
                if port.name in taken:
                    raise Unsupported(f"two variables of the FMU are named {port.name}")
                taken.add(port.name)
            found = [*_apart(found)]
            check_enumerations(tuple(found))
        except Misdeclared as error:
            raise Unsupported(str(error)) from None
        return tuple(found)

    def _renamed(self, name: PortName) -> Port:
        port = self._port(name)
        direct = tuple(self._direct(name)) if port.causality == "output" else ()
        return replace(
            port,
            name=str(name),
            start=None if port.causality == "output" else self.text.start(name),
            feedthrough=direct,
            initially=None if port.causality == "output" else (),
            array=None,
        )

    def _direct(self, output: PortName) -> list[str]:
        """The open inputs that an output depends on without a state between."""
        if self.text.stages.passing is None:
            # An output is what it has become in the step.
            return []
        sources = {one.target: one.source for one in self.plan.system.connections}
        found: set[str] = set()
        seen, waiting = {output}, [output]
        while waiting:
            at = waiting.pop()
            for port in self._port(at).feedthrough:
                name = PortName(at.component, port)
                if name not in sources:
                    found.add(port if port == TIME.name else str(name))
                elif sources[name] not in seen:
                    seen.add(sources[name])
                    waiting.append(sources[name])
        return [name for name in (*map(str, self._open), TIME.name) if name in found]

    @cached_property
    def model(self) -> Model:
        """What its description says."""
        experiment = self.plan.experiment
        said = DefaultExperiment(
            experiment.stop_time, experiment.step, experiment.start_time, not self.text.slow
        )
        origins = [one.origin for one in dict.fromkeys(self._definitions.values())]
        texts = (
            "; ".join(dict.fromkeys(filter(None, (getattr(one, field) for one in origins))))
            for field in Origin._fields
        )
        return Model(self.name, self._title, Origin(*texts), self.ports, said)

    # What it is made of

    def parts(self, fmi: str) -> Parts:
        """What its FMU is made of, in a version of FMI."""
        system, model = self.plan.system, self.model
        places = {H_MAX: "PARAMETER_AT(h_max)"}
        for name, member in self.text.members.items():
            of_one = places_of(self._definitions[name], f"model.{member}")
            if self.text.kind(name).has_h_max:
                of_one[H_MAX] = f"PARAMETER_AT(model.{self._longest(member)})"
            places |= {str(PortName(name, port)): place for port, place in of_one.items()}
        types = [type_ for part in self._state for type_ in part.types]
        groups = {
            f"{name}.": [
                port
                for port in self._definitions[name].ports
                if port.causality != "input" or PortName(name, port.name) in self._open
            ]
            for name in system.components
        }
        rows = "\n".join(
            f"- `{name}`: {self._definitions[name].name}, {self._definitions[name].summary}"
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
        """The file equations.c."""
        title, n = closed(self._title), len(self.text.components)
        parts = [_HEAD.format(title=title, n=n).strip(), *self.text.core(), *self._glue()]
        return "\n\n".join(parts) + "\n"

    # The state

    @cached_property
    def _state(self) -> list[Part]:
        """The numbers of the state, which are all that the rest of a run depends on."""
        found = [_number("it->start_time", float), _number("it->made", int)]
        for name, member in self.text.members.items():
            kind, owner = self.text.kind(name), f"it->{member}"
            said = kind.said
            found.append(_numbers(f"{owner}.state", kind.types["state"], said.state))
            # Of these, any number is taken, as it has no consequence.
            holders = {f"{owner}.inputs": "inputs", f"{owner}.outputs": "outputs"}
            if name in self.text.slow:
                holders[f"{owner}_shown"] = "outputs"
            for holder, group in holders.items():
                hint = getattr(said, group)
                part = _numbers(holder, kind.types[group], hint)
                found.append(part._replace(types=[*map(_plain, part.types)]))
            if kind.is_timed:
                found.append(_number(f"{owner}.time", float))
            if said.draws:
                found += [
                    *(_number(f"{owner}.draws[{i}]", float) for i in range(said.draws)),
                    _generator(f"{owner}.noise"),
                ]
        return [part for part in found if part.types]

    def _moved(self, way: str) -> list[str]:
        """Statements that move the whole state."""
        return [line for part, place in self._placed.values() for line in getattr(part, way)(place)]

    @cached_property
    def _placed(self) -> dict[str, tuple[Part, int]]:
        """The parts of the state and their first places, by what holds them."""
        found, place = {}, 0
        for part in self._state:
            found[part.owner] = part, place
            place += len(part.types)
        return found

    # What the runtime calls

    def _glue(self) -> list[str]:
        text, step = self.text, number_in_c(self.plan.experiment.step)
        members = text.members.items()
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
        types = [
            structure("model_parameters", parameters),
            *(structure(f"model_{what}", [f"double v[{n or 1}];"]) for what, n in sizes.items()),
            "typedef struct {\n    simulation it;\n    int begun; /* whether it has parameters */\n"
            "} model_derived;",
        ]
        counts = ", ".join(f"MODEL_{what.upper()} = {n}" for what, n in sizes.items())
        cycle = lcm(*self.plan.decimations.values())
        mine = "simulation *it = &derived->it;"
        refuse = "model_tell(it, error);"
        passing = text.stages.passing is not None
        slow = [
            f"if (it->step != {step}) {{",
            f'    raise_error(error, "step %g s: only steps of {self.plan.experiment.step:g} s can '
            'be made", h);',
            "    return;",
            "}",
        ] if text.slow else []  # fmt: skip
        bodies = {
            "check": [line for name, member in members for line in self._check(name, member)],
            "check_state": [
                line for name, member in members for line in self._check_state(name, member)
            ],
            "start": [
                "simulation *it = calloc(1, sizeof *it);",
                "int found;",
                "if (it == NULL) {",
                '    raise_error(error, "out of memory");',
                "    return;",
                "}",
                "it->start_time = t;",
                f"it->step = {step};",
                "model_set(it, parameters, 1, error);",
                *self._feed_call(),
                "found = come_to_rest(it, error);",
                "if (found < 0) {",
                f"    {refuse}",
                "} else if (found > 0) {",
                '    raise_error(error, "values do not come to rest at the start");',
                "} else {",
                "    model_put(it, state->v);",
                "}",
                "free(it);",
            ],
            "derive": [
                mine,
                "model_set(it, parameters, !derived->begun, error);",
                "derived->begun = 1;",
                "model_take(it, state->v);",
                *self._anew(refuse),
                *self._feed_call(),
                *([f"if (pass(it, it->made, t, error)) {refuse}"] if passing else []),
            ],
            "evaluate": [
                "const simulation *it = &derived->it;",
                *(
                    f"outputs->v[{i}] = {text.columns[self._named[port.name]].text};"
                    for i, port in enumerate(outputs)
                ),
            ],
            "update": [
                mine,
                # Hosts that subtract times have steps that nearly are the system's.
                f"it->step = fabs(h - {step}) <= {step} * {euler.ROUNDING!r} ? {step} : h;",
                *slow,
                "if (make_step(it, it->made, t, error)) {",
                f"    {refuse}",
                "    return;",
                "}",
                f"it->made = (it->made + 1) % {cycle};",
                "model_put(it, state->v);",
            ],
        }
        return [
            "/* What the runtime calls. */",
            *types,
            f"enum {{ {counts} }};",
            *self._names(),
            _TOLD.strip(),
            *([_NOISE.strip()] if text.equations.is_noisy else []),
            function(_PUT, self._moved("put"), ()),
            function(_TAKE, self._taken(), ()),
            function(_SET, self._set(), ()),
            *self._feed(),
            constants(answers),
            *defined(bodies),
        ]

    @cached_property
    def _named(self) -> dict[str, PortName]:
        """The ports of components by their names in the FMU."""
        return {str(name): name for name in self._known}

    def _values(self, causality: str) -> list[Port]:
        """Ports in the order of their values."""
        return reals_first([port for port in self.ports if port.causality == causality])

    def _longest(self, member: str) -> str:
        """The name of the largest internal step of a component among the parameters."""
        found = f"{member}_h_max"
        while found in self.text.members.values():
            found += "_"
        return found

    def _parameters(self, name: str, member: str) -> Iterator[str]:
        kind = self.text.kind(name)
        if count(kind.types["parameters"]):
            yield f"{self.text.emitter.type(kind.types['parameters'])} {member};"
        if kind.has_h_max:
            yield f"double {self._longest(member)};"

    def _set(self) -> list[str]:
        """Hand parameters over where they have changed, or all."""
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
            if kind.said.draws:
                lines.append(f"{owner}.is_noisy = 1;")
        return lines

    def _taken(self) -> list[str]:
        """Take a state, from which some is to be derived."""
        lines = self._moved("take")
        for name, member in self.text.members.items():
            kind = self.text.kind(name)
            if kind.said.derived and kind.derives_anew:
                lines.append(f"it->{member}.underived = 1;")
        return lines

    def _feed(self) -> list[str]:
        """The function that hands open inputs over."""
        lines = []
        for i, port in enumerate(self._values("input")):
            place = self.text.columns[self._named[port.name]]
            cast = "" if place.type == FLOAT else "(int)"
            lines.append(f"{place.text} = {cast}inputs->v[{i}];")
        for name in dict.fromkeys(name.component for name in self._open):
            said = self.text.kind(name).said
            if said.derived and said.takes("derive", "inputs"):
                lines.append(f"it->{self.text.members[name]}.underived = 1;")
        return [function(_FEED, lines, ())] if lines else []

    def _feed_call(self) -> list[str]:
        return ["model_feed(it, inputs);"] if self._open else []

    def _anew(self, refuse: str) -> Iterator[str]:
        """Outputs that nothing computes again as values pass, and that follow parameters."""
        sequence = self.text.sequence
        place = {name: i for i, names in enumerate(sequence) for name in names}
        early = {
            one.source.component
            for one in self.plan.system.connections
            if place[one.source.component] >= place[one.target.component]
        }
        passed = {
            visit.component
            for stage in self.text.stages.passing or ()
            for visit in stage.visits
            if isinstance(visit, Visit) and self.text.reads(visit)
        }
        for i, (name, member) in enumerate(self.text.members.items()):
            kind = self.text.kind(name)
            follows = kind.said.takes("outputs", "parameters") and not kind.said.is_sampled
            if follows and (name not in passed or name in early):
                yield f"{kind.name}_evaluate(&it->{member}, error);"
                yield "if (error->raised) {"
                yield f"    it->component = {i};"
                yield f"    {refuse}"
                yield "    return;"
                yield "}"

    def _check(self, name: str, member: str) -> Iterator[str]:
        """Check the parameters of a component."""
        kind = self.text.kind(name)
        if kind.said.hooks["check"]:
            call = kind.call("check", parameters=f"parameters->{member}")
            yield "if (!error->raised) {"
            yield f"    {call};"
            yield f"    model_ascribe(error, {quoted(name)});"
            yield "}"

    def _check_state(self, name: str, member: str) -> Iterator[str]:
        """Check the state of a component."""
        kind = self.text.kind(name)
        if not kind.said.hooks["check_state"]:
            return
        given = {"parameters": f"parameters->{member}", "state": "of_one"}
        yield "if (!error->raised) {"
        yield f"    {self.text.emitter.type(kind.types['state'])} of_one;"
        if found := self._placed.get(f"it->{member}.state"):
            part = _numbers("of_one", kind.types["state"], kind.said.state)
            yield from (f"    {line.replace('from', 'state->v')}" for line in part.take(found[1]))
        yield f"    {kind.call('check_state', **given)};"
        yield f"    model_ascribe(error, {quoted(name)});"
        yield "}"

    def _names(self) -> list[str]:
        """The names of components and of their inputs."""
        inputs, names = [], []
        for i, name in enumerate(self.text.components):
            ports = [port.name for port in self.text.kind(name).ports["input"]] or [""]
            texts = ", ".join(map(quoted, ports))
            inputs += lines_of(f"static const string model_inputs_of_{i}[] = {{{texts}}};", "")
            names.append(f"model_inputs_of_{i}")
        found = ", ".join(map(quoted, self.text.components))
        return [
            "\n".join(
                [
                    *lines_of(f"static const string model_components[] = {{{found}}};", ""),
                    *inputs,
                    *lines_of(
                        f"static const string *const model_inputs_of[] = {{{', '.join(names)}}};",
                        "",
                    ),
                ]
            )
        ]


def _numbers(owner: str, type_: Type, hint: Any) -> Part:
    """The numbers of a structure."""
    n = count(type_)
    if has_only_doubles(type_):
        return Part(
            owner,
            [*scalars_of(hint)],
            lambda at: [f"memcpy(to + {at}, &{owner}, sizeof {owner});"],
            lambda at: [f"memcpy(&{owner}, from + {at}, sizeof {owner});"],
        )

    def moved(text: str) -> Callable[[int], list[str]]:
        return lambda at: [*moves(type_, owner, range(at, at + n), text)]

    put, take = "to[{place}] = {member};", "{member} = {cast}from[{place}];"
    return Part(owner, [*scalars_of(hint)], moved(put), moved(take))


def _number(owner: str, type_: type) -> Part:
    """A number."""
    cast = "" if type_ is float else "(int)"
    return Part(
        owner,
        [type_],
        lambda at: [f"to[{at}] = {owner};"],
        lambda at: [f"{owner} = {cast}from[{at}];"],
    )


def _generator(owner: str) -> Part:
    """The numbers of a generator of noise."""
    return Part(
        owner,
        _NOISE_TYPES,
        lambda at: [f"model_put_noise(&{owner}, to + {at});"],
        lambda at: [f"model_take_noise(&{owner}, from + {at});"],
    )


def _plain(scalar: Any) -> Any:
    """A type of numbers without what its values are called."""
    return int if is_class(scalar, IntEnum) else scalar


def _apart(ports: Sequence[Port]) -> Iterator[Port]:
    """Ports whose enumerations have names that no other has."""
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
        model: of the system.
        folder: that it is written into.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.
        platforms: with commas between them, or `all`; None: this machine.
        tell: called with a line when a library is made.

    Raises:
        InputError: it cannot be made, there is no such platform, or no compiler for it.

    """
    path = folder / f"{file_name(model.name)}.fmu"
    try:
        wanted = platforms_of(fmi, platforms)
        entries = entries_of(model.parts(fmi), fmi, wanted, compiler_for(wanted), tell)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"the FMU cannot be built: {reason(error)}") from error
    write_archive(path, entries)
    return [path]
