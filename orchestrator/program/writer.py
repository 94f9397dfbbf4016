"""A system as one C program: its components, what goes from one to the other, and the steps.

The equations of all components are translated together, so what several of them use stands there
once. What is written here says what the FMUs' runtime and the master do, in the same order and with
the same numbers: `simulation` holds all values; `begin` sets parameters and lets values come to
rest at the start; `run` makes steps, and a row after each if it is given room. Nothing is
allocated, printed or shared.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from auv_fmu.paper import euler
from fmus.language.build import Program
from fmus.language.tree import Function
from fmus.language.types import FLOAT, Array, Scalar, Type, count, is_whole, scalars_in, type_of
from fmus.native.emit import Emitter, closed, lines_of, members, number_in_c, unbroken
from fmus.native.names import RUNTIME, in_c
from fmus.ports.definition import Definition
from fmus.ports.groups import Nothing
from fmus.ports.port import H_MAX, Port
from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import FEEDTHROUGH, GAUSS_SEIDEL
from orchestrator.master.plan import Plan, stages
from orchestrator.program.reducing import Looking, ReducerText
from orchestrator.master.stages import DIRECT, ONLY_STATES, STATES, Stage, Stages, Visit, stages_of
from orchestrator.system.connection import Connection
from orchestrator.system.graph import rings
from orchestrator.system.names import PortName
from orchestrator.system.units import Linear, Mapped

#: What a call of the program comes to: all is well, or what was refused of which component.
CALLS = START, INPUT, OUTPUTS, STEP = "AT_START", "AT_INPUT", "AT_OUTPUTS", "AT_STEP"

#: What stands in the equations of the time step.
_EULER = (euler.internal_steps, euler.end_of_step)

#: From so many numbers on, a loop checks them.
_MANY = 4

_FAILURE = """\
/* Where Python raises, an equation goes on with what C gives; only that something was raised is
 * noted. What it says, Python says of the same step. */
typedef struct {
    int raised;
} Error;

#define raise_error(error, ...) ((void)((error)->raised = 1))
"""

#: What is said of a step that is refused, where there is somebody to hear it.
_NOT_FINITE, _UNSOUND, _TOO_MANY = (
    f"raise_error(error, {unbroken(why)});"
    for why in (
        "an output is not finite",
        f"the state is not finite, or exceeds {euler.LARGEST_STATE:g}",
        f"the step needs more than {euler.MOST_INTERNAL_STEPS} internal steps; take shorter ones, "
        "or raise h_max",
    )
)

_CHECKS = """\
/* Partial sums that processors add side by side. */
enum { LANES = 4 };

/* Times zero, what is finite is zero and what is not is NaN. */
static inline int are_finite(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    for (; i + LANES <= n; i += LANES) {
        for (j = 0; j < LANES; j++) sums[j] += 0.0 * values[i + j];
    }
    for (; i < n; i++) sums[0] += 0.0 * values[i];
    return sums[0] + sums[1] + sums[2] + sums[3] == 0.0;
}

static inline double sum_of_squares(const double values[], int n) {
    double sums[LANES] = {0.0};
    int i = 0, j;
    for (; i + LANES <= n; i += LANES) {
        for (j = 0; j < LANES; j++) sums[j] += values[i + j] * values[i + j];
    }
    for (; i < n; i++) sums[0] += values[i] * values[i];
    return sums[0] + sums[1] + sums[2] + sums[3];
}

/* Whether a value that an input takes is another one, bit for bit. */
static inline int take(double *input, double value) {
    const int is_other = memcmp(input, &value, sizeof value) != 0;
    *input = value;
    return is_other;
}

static inline int take_whole(int *input, int value) {
    const int is_other = *input != value;
    *input = value;
    return is_other;
}
"""

_DRAWING = """\
static inline void draw_normals(generator *noise, double draws[], int n) {
    for (int i = 0; i < n; i++) draws[i] = standard_normal(noise);
}
"""

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

/* Notes what refused. */
static int refused(simulation *it, int component, int call, int port) {
    it->component = component;
    it->call = call;
    it->port = port;
    return 1;
}
"""


class Unsupported(InputError):
    """A system that cannot be one program; the text says why."""


class Place(NamedTuple):
    """A number of the program: where it lies, and its type."""

    text: str  #: after the name of the simulation
    type: Scalar


def scalars(type_: Type, text: str) -> Iterator[Place]:
    """All numbers in a value, in their order."""
    if isinstance(type_, Scalar):
        yield Place(text, type_)
    for suffix, part in members(type_):
        yield from scalars(part, text + suffix)


@dataclass
class _Kind:
    """A component of which the system may have several.

    Attributes:
        definition: of it.
        functions: its hooks as trees.
        emitter: of all equations.
        name: of its structure, and what its functions begin with.
        euler: functions of the time step.
        is_tuned: whether parameters may change after the start.

    """

    definition: Definition
    functions: Mapping[str, Function]
    emitter: Emitter
    name: str
    euler: Mapping[str, Function]
    is_tuned: bool = False

    def __post_init__(self) -> None:
        said = self.definition.behaviour
        self.said, self.types = said, {
            "parameters": type_of(said.parameters),
            "inputs": type_of(said.inputs),
            "state": type_of(said.state),
            "outputs": type_of(said.outputs),
            "derived": type_of(said.derived or Nothing),
        }
        self.is_timed = said.takes("outputs", "t") or said.takes("derive", "t")
        self.follows_inputs = said.takes("outputs", "inputs")
        self.derives_anew = any(said.takes("derive", one) for one in ("state", "inputs", "t"))
        self.has_h_max = said.h_max is not None

    def ports(self, causality: str) -> list[Port]:
        """Its ports of a causality, in the order of the numbers of their group."""
        found = [port for port in self.definition.ports if port.causality == causality]
        return [port for port in found if port.name != H_MAX or causality != "parameter"]

    def text(self) -> Iterator[str]:
        """Its structure and its functions."""
        yield self._structure()
        yield self._evaluate()
        yield self._start()
        yield self._advance()

    def call(self, hook: str, **given: str) -> str:
        """The call of a hook, with other arguments than those of the component if they are given."""
        function = self.functions[hook]
        known = {
            "parameters": "it->parameters", "inputs": "it->inputs", "state": "it->state",
            "derived": "it->derived", "t": "it->time", **given,
        }  # fmt: skip
        return self.emitter.call(function, [known[name] for name in function.arguments])

    def _structure(self) -> str:
        rows = [
            f"{self.emitter.type(self.types[what])} {what};"
            for what in ("parameters", "inputs", "state", "outputs")
        ]
        if self.said.derived:
            rows.append(f"{self.emitter.type(self.types['derived'])} derived;")
            rows.append("int underived; /* whether it is to be derived again before it is used */")
        if self.said.hooks["update"]:
            rows.append("double longest_step; /* that is not split [s] */")
        if self.is_timed:
            rows.append("double time; /* of the state [s] */")
        if self.said.draws:
            rows += [
                f"double draws[{self.said.draws}];",
                "int is_noisy; /* whether it makes a difference what is drawn */",
                "generator noise;",
            ]
        body = "\n".join(f"    {row}" for row in rows)
        return f"/* {closed(self.definition.summary)} */\ntypedef struct {{\n{body}\n}} {self.name};"

    def _function(self, name: str, arguments: str, body: Sequence[str]) -> str:
        text = "\n".join(line for part in body for line in lines_of(part, "    "))
        head = f"static void {self.name}_{name}({self.name} *it{arguments}, Error *error) {{"
        unused = [
            f"    (void){argument};\n"
            for argument in ("error", *re.findall(r"(\w+)(?:,|$)", arguments.lstrip(", ")))
            if not re.search(rf"\b{argument}\b", text)
        ]
        return f"{head}\n{''.join(unused)}{text}\n}}"

    def _derive(self, state: str = "it->state", time: str = "it->time") -> list[str]:
        if not self.said.derived:
            return []
        derived = f"it->derived = {self.call('derive', state=state, t=time)};"
        return ["if (it->underived) {", f"    {derived}", "    it->underived = error->raised;", "}"]

    def _guarded(self, state: str) -> list[str]:
        if not self.said.hooks["credible"]:
            return []
        test = self.call("credible", state=state)
        return [f"if (!{test}) {state} = {self.call('restarted', state=state)};"]

    def _evaluate(self) -> str:
        state, body = "it->state", []
        if self.said.hooks["credible"]:
            state = "state"
            body += [f"{self.emitter.type(self.types['state'])} state = it->state;"]
            body += self._guarded(state)
        if self.said.takes("outputs", "derived"):
            body += self._derive(state)
        body.append(f"it->outputs = {self.call('outputs', state=state)};")
        if self.said.draws:
            group = f"it->outputs.{in_c(self.said.noisy)}"
            body.append(f"{group} = {self._measured('it->draws', group)};")
        body.append(f"if (!({self._finite()})) {_NOT_FINITE}")
        return self._function("evaluate", "", body)

    def _measured(self, draws: str, group: str) -> str:
        type_ = self.functions["measured"].arguments["n"]
        places = iter(f"{draws}[{i}]" for i in range(self.said.draws))
        n = next(places) if isinstance(type_, Scalar) else self._made(type_, places)
        return self.call("measured", **{"n": n, self.said.noisy: group})

    def _made(self, type_: Type, places: Iterator[str]) -> str:
        return f"({self.emitter.type(type_)}){self._initial(type_, places)}"

    def _initial(self, type_: Type, places: Iterator[str]) -> str:
        if isinstance(type_, Scalar):
            return next(places)
        parts = ", ".join(self._initial(part, places) for _, part in members(type_))
        return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"

    def _finite(self) -> str:
        """Whether all outputs are finite."""
        return _over(self.types["outputs"], "it->outputs", "are_finite", "0.0 * {}", "== 0.0", "1")

    def _sound(self, state: str) -> str:
        """Whether a run can go on from a state."""
        found = _over(
            self.types["state"], state, "sum_of_squares", "{0} * {0}",
            f"<= {number_in_c(euler.LARGEST_STATE**2)}", "1", is_sum=True,
        )  # fmt: skip
        members_of = [
            f"({' || '.join(f'{place.text} == {int(one)}' for one in place.type.made)})"
            for place in scalars(self.types["state"], state)
            if place.type.made is not None
        ]
        return " && ".join([*members_of, found])

    def _start(self) -> str:
        body = []
        if self.said.hooks["check"]:
            body.append(f"{self.call('check')};")
        if self.is_timed:
            body.append("it->time = t;")
        if self.said.derived:
            body.append("it->underived = 1;")
        if self.said.draws:
            body.append(f"seed_generator(&it->noise, (uint32_t){self.call('seed')});")
            body.append(f"draw_normals(&it->noise, it->draws, {self.said.draws});")
        if self.said.hooks["start"]:
            body.append(f"it->state = {self.call('start', t='t')};")
            body.append(f"if (!({self._sound('it->state')})) {_UNSOUND}")
        body.append(f"{self.name}_evaluate(it, error);")
        if self.said.draws:
            body += ["it->is_noisy = 1;"] if self.is_tuned else self._needs_noise()
        return self._function("start", ", double t", body)

    def _needs_noise(self) -> list[str]:
        """What finds out whether noise is multiplied by zero: then none need be drawn."""
        n, group = self.said.draws, self.functions["measured"].returns
        name = self.emitter.type(group)
        draws = f"{{{', '.join(['HUGE_DRAW'] * n)}}}"
        return [
            f"const double large[{n}] = {draws};".replace("HUGE_DRAW", "1e300"),
            f"const {name} none = {'0.0' if isinstance(group, Scalar) else '{0}'};",
            f"const {name} all = {self._measured('large', 'none')};",
            "it->is_noisy = memcmp(&all, &none, sizeof all) != 0;",
            f"if (!it->is_noisy) memset(it->draws, 0, sizeof it->draws);",
        ]

    def _advance(self) -> str:
        said, body = self.said, []
        if self.is_timed:
            anew = "it->underived = 1; " if said.takes("derive", "t") else ""
            change = f"{{ it->time = t; {anew}}}" if anew else "it->time = t;"
            body.append(f"if (it->time != t) {change}")
        if said.hooks["update"]:
            body.append(f"{self.emitter.type(self.types['state'])} state = it->state;")
            body += self._guarded("state")
            split = self.emitter.call(self.euler["internal_steps"], ["h", "it->longest_step"])
            body += [
                "int n = 1;",
                "if (h > it->longest_step) {",
                f"    if (h / it->longest_step > {float(euler.MOST_INTERNAL_STEPS)!r}) {{",
                f"        {_TOO_MANY}",
                "        return;",
                "    }",
                f"    n = {split};",
                "}",
                "const double step = h / n;",
                "for (int i = 0; i < n && !error->raised; i++) {",
            ]
            time = "t + i * step"
            if said.takes("update", "derived"):
                body += [f"    {line}" for line in self._derive("state", time)]
            body.append(f"    state = {self.call('update', state='state', t=time, h='step')};")
            if said.takes("derive", "state") or said.takes("derive", "t"):
                body.append("    it->underived = 1;")
            body += [
                "}",
                f"if (!({self._sound('state')})) {_UNSOUND}",
                "if (error->raised) return;",
                "it->state = state;",
            ]
        if self.is_timed:
            end = self.emitter.call(self.euler["end_of_step"], ["start", "t", "h"])
            body.append(f"it->time = {end};")
        if said.draws:
            body.append(f"if (it->is_noisy) draw_normals(&it->noise, it->draws, {said.draws});")
        if not said.is_sampled and not self.follows_inputs:
            body.append(f"{self.name}_evaluate(it, error);")
        return self._function("advance", ", double start, double t, double h", body)


def _over(
    type_: Type, text: str, function: str, term: str, test: str, nothing: str, is_sum: bool = False
) -> str:
    """A test of all floats in a value; whole numbers pass it."""
    places = [place for place in scalars(type_, text) if place.type == FLOAT]
    whole = [place for place in scalars(type_, text) if place.type != FLOAT]
    if not places:
        return nothing
    if len(places) >= _MANY and not whole:
        made = f"{function}((const double *)&{text}, {len(places)})"
        return f"{made} {test}" if is_sum else made
    return f"{' + '.join(term.format(place.text) for place in places)} {test}"


@dataclass
class Text:
    """The program of a system.

    Attributes:
        plan: of the run that it makes.
        definitions: of its components, by their names.
        indices: that look on.
        is_tuned: whether parameters may change after the start.

    """

    plan: Plan
    definitions: Mapping[str, Definition]
    indices: Sequence[Looking] = ()
    is_tuned: bool = False
    mappings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        system = self.plan.system
        if closed_rings := rings(system):
            names = ", ".join(closed_rings[0])
            raise Unsupported(f"{names}: direct feedthroughs form a ring, which a program cannot have")
        experiment = self.plan.experiment
        if experiment.order is None:
            self.plan = _with_order(self.plan)
        self.components = [*system.components]
        kinds = [*dict.fromkeys(self.definitions.values())]
        hooks = {one: one.behaviour.hooks for one in kinds}
        program = Program(
            *(hook for one in kinds for hook in hooks[one].values() if hook),
            *_EULER,
            *(hook for one in self.indices for hook in one.reducer.hooks.values()),
        )
        program.check()
        self.emitter = Emitter(program.functions.values())
        self.kinds = {
            one: _Kind(
                one,
                {name: program.function(hook) for name, hook in hooks[one].items() if hook},
                self.emitter,
                self.emitter.unused(f"{_lower(one.name)}_component"),
                {one.__name__: program.function(one) for one in _EULER},
                self.is_tuned,
            )
            for one in kinds
        }
        self.reducers = {
            key: ReducerText(
                one, program, self.emitter, self.emitter.unused(f"{_lower(one.name)}_index")
            )
            for key, one in {id(one.reducer): one.reducer for one in self.indices}.items()
        }
        self.members = dict(zip(self.components, _distinct(self.components)))
        self.slow = {name for name, n in self.plan.decimations.items() if n > 1}

    # What there is

    def kind(self, component: str) -> _Kind:
        """The kind of a component."""
        return self.kinds[self.definitions[component]]

    def _group(self, component: str, group: str, causality: str) -> dict[PortName, Place]:
        kind, owner = self.kind(component), f"it->{self.members[component]}.{group}"
        type_ = kind.types["outputs" if causality == "output" else group]
        return {
            PortName(component, port.name): place
            for port, place in zip(kind.ports(causality), scalars(type_, owner), strict=True)
        }

    @cached_property
    def columns(self) -> dict[PortName, Place]:
        """All inputs and outputs, as a row shows them."""
        found: dict[PortName, Place] = {}
        for name in self.components:
            found |= self._group(name, "inputs", "input")
            shown = "outputs" if name not in self.slow else "outputs_shown"
            if name in self.slow:
                owner = f"it->{self.members[name]}_shown"
                kind = self.kind(name)
                found |= {
                    PortName(name, port.name): place
                    for port, place in zip(
                        kind.ports("output"), scalars(kind.types["outputs"], owner), strict=True
                    )
                }
            else:
                found |= self._group(name, shown, "output")
        return found

    @cached_property
    def parameters(self) -> dict[PortName, Place]:
        """All parameters, and the inputs that nothing feeds."""
        system, found = self.plan.system, dict[PortName, Place]()
        for name in self.components:
            kind, owner = self.kind(name), self.members[name]
            places = scalars(kind.types["parameters"], f"it->{owner}.parameters")
            ports = [p for p in kind.definition.parameters.ports]
            found |= {
                PortName(name, port.name): place
                for port, place in zip(ports, places, strict=True)
            }
            if kind.has_h_max:
                found[PortName(name, H_MAX)] = Place(f"it->{owner}.longest_step", FLOAT)
            fed = {connection.target for connection in system.feeding[name]}
            found |= {
                port: place
                for port, place in self._group(name, "inputs", "input").items()
                if port not in fed
            }
        return found

    @cached_property
    def sequence(self) -> list[list[str]]:
        """The components in the order in which they are stepped."""
        return stages(self.plan.system, self.plan.experiment.order or FEEDTHROUGH)

    @cached_property
    def stages(self) -> Stages:
        """What happens in a step."""
        return stages_of(self.plan, self.sequence)

    # The text

    def text(self) -> str:
        """All of it."""
        arithmetic = (RUNTIME / "arithmetic.h").read_text(encoding="utf-8")
        noise = (RUNTIME / "noise.c").read_text(encoding="utf-8")
        names = f"{len(self.components)} components"
        parts = [
            f"/* {closed(self.plan.system.name)}: {names} as one program. */\n#include <float.h>\n#include <stddef.h>\n#include <stdint.h>\n\n"
            "#ifndef EXPORTED\n#define EXPORTED\n#endif",
            arithmetic.replace('#include "error.h"\n', _FAILURE).strip(),
            *([noise.strip()] if self.is_noisy else []),
            *self.core(),
            self._begin(),
            self._show(),
            *self._look(),
            self._run(),
        ]
        return "\n\n".join(parts) + "\n"

    @property
    def is_noisy(self) -> bool:
        """Whether random numbers are drawn."""
        return any(kind.said.draws for kind in self.kinds.values())

    def core(self) -> list[str]:
        """What it is whoever calls it: equations, components, the start, and a step."""
        # Writing these adds to the structures and the mappings.
        parts = [part for kind in self.kinds.values() for part in kind.text()]
        parts += [part for one in self.reducers.values() for part in one.text()]
        simulation, rest, steps = self._simulation(), self.rest(), self._steps()
        return [
            self.emitter.text(),
            _CHECKS.strip(),
            *([_DRAWING.strip()] if self.is_noisy else []),
            *parts,
            simulation,
            _TIMES.strip(),
            *self.mappings,
            rest,
            *steps,
        ]

    def _simulation(self) -> str:
        rows = [
            f"{self.kind(name).name} {member};" for name, member in self.members.items()
        ]
        rows += [
            f"{self.emitter.type(self.kind(name).types['outputs'])} {self.members[name]}_shown;"
            for name in self.components
            if name in self.slow
        ]
        rows += [
            f"{self.reducers[id(one.reducer)].name} index_{i};" for i, one in enumerate(self.indices)
        ]
        if self.indices:
            rows.append("double looked; /* when the last row was looked at [s] */")
        body = "\n".join(f"    {row}" for row in rows)
        calls = ", ".join(CALLS)
        return (
            "/* All that a run depends on. */\n"
            "typedef struct {\n"
            "    double start_time, step, stop_time;\n"
            "    int full_steps, steps; /* if there is one more of all steps, it is shorter */\n"
            "    int made;\n"
            "    int component, call, port; /* that has refused */\n"
            f"{body}\n}} simulation;\n\n"
            f"enum {{ {calls} }};"
        )

    def _begin(self) -> str:
        lines = []
        for i, (name, place) in enumerate(self.parameters.items()):
            value = f"parameters[{i}]"
            if place.type != FLOAT:
                value = f"(int){value}"
            elif name.port == H_MAX:
                value = f"fmin({value} * (1.0 + {euler.ROUNDING!r}), DBL_MAX)"
            lines.append(f"    {place.text} = {value};")
        for name in self.components:
            kind = self.kind(name)
            if kind.said.hooks["update"] and not kind.has_h_max:
                lines.append(f"    it->{self.members[name]}.longest_step = DBL_MAX;")
        return "\n".join(
            [
                "/* Sets parameters, and lets values come to rest at the start; whether a component refuses. */",
                "EXPORTED int begin(simulation *it, const double parameters[], double start_time, double step,",
                "                   double stop_time, int full_steps, int steps) {",
                "    Error noted = {0};",
                "    memset(it, 0, sizeof *it);",
                "    it->start_time = start_time;",
                "    it->step = step;",
                "    it->stop_time = stop_time;",
                "    it->full_steps = full_steps;",
                "    it->steps = steps;",
                *lines,
                "    return come_to_rest(it, &noted) != 0;",
                "}",
            ]
        )

    def rest(self) -> str:
        """What lets values come to rest at the start."""
        lines: list[str] = []
        for connection in self.plan.system.connections:
            # What an input has that is fed, until it is.
            port = self._port(connection.target)
            place = self.columns[connection.target]
            lines.append(f"    {place.text} = {number_in_c(_start(port, place))};")
        order = [name for names in stages(self.plan.system, GAUSS_SEIDEL) for name in names]
        turn = {name: i for i, name in enumerate(order)}
        ahead = {
            one.source.component
            for one in self.plan.system.connections
            if turn[one.source.component] >= turn[one.target.component]
        }
        started = [
            f"    {line}"
            for name in self.components
            if name in ahead
            for line in self._started(name)
        ]
        settled = []
        for name in order:
            settled.append("    is_other = 0;")
            for connection in self.plan.system.feeding[name]:
                target = self.columns[connection.target]
                function = "take" if target.type == FLOAT else "take_whole"
                value = self._value(connection)
                settled.append(f"    is_other |= {function}(&{target.text}, {value});")
            settled.append("    if (is_other || everything) {")
            settled += [f"        {line}" for line in self._checked_inputs(name)]
            settled += [f"        {line}" for line in self._started(name)]
            settled += ["        changed = 1;", "    }"]
        return "\n".join(
            [
                "/* Hands values along all connections once, at the start; whether one has changed: 0, 1,",
                " * or -1 where a component refuses. */",
                "static int settle(simulation *it, int everything, Error *error) {",
                "    const double t = it->start_time;",
                "    int changed = 0, is_other;",
                "    (void)error;",
                *[line.replace("return refused", "return -refused") for line in settled],
                "    return changed;",
                "}",
                "",
                "/* Lets values come to rest at the start: 0, 1 where they do not, or -1 where a component",
                " * refuses. */",
                "static int come_to_rest(simulation *it, Error *error) {",
                "    const double t = it->start_time;",
                "    int changed, rounds = 0;",
                "    (void)t;",
                *lines,
                *[line.replace("return refused", "return -refused") for line in started],
                "    changed = settle(it, 1, error);",
                f"    while (changed > 0 && rounds++ < {_MOST_ROUNDS}) changed = settle(it, 0, error);",
                "    return changed;",
                "}",
            ]
        )

    def _started(self, name: str) -> list[str]:
        i, kind, member = self.components.index(name), self.kind(name), self.members[name]
        return [
            f"{kind.name}_start(&it->{member}, t, error);",
            f"if (error->raised) return refused(it, {i}, {START}, 0);",
            *([f"it->{member}_shown = it->{member}.outputs;"] if name in self.slow else []),
        ]

    def _port(self, name: PortName) -> Port:
        return next(
            port
            for port in self.definitions[name.component].ports
            if port.name == name.port
        )

    def _checked_inputs(self, name: str) -> Iterator[str]:
        """Refuse inputs that are out of range."""
        transformed = {
            one.target for one in self.plan.system.feeding[name] if one.transformation is not None
        }
        i, found = self.components.index(name), self._group(name, "inputs", "input")
        for number, (port, (target, place)) in enumerate(
            zip(self.kind(name).ports("input"), found.items(), strict=True)
        ):
            tests = []
            if port.minimum is not None:
                tests.append(f"{place.text} >= {number_in_c(_as(place, port.minimum))}")
            if port.maximum is not None:
                tests.append(f"{place.text} <= {number_in_c(_as(place, port.maximum))}")
            if port.choices:
                choices = " || ".join(f"{place.text} == {int(c)}" for c in port.choices.values())
                tests.append(f"({choices})" if tests else choices)
            if target in transformed and place.type == FLOAT:
                tests.append(f"0.0 * {place.text} == 0.0")
            if tests:
                yield f"if (!({' && '.join(tests)})) return refused(it, {i}, {INPUT}, {number});"

    def _value(self, connection: Connection) -> str:
        """What arrives at the end of a connection."""
        value = self.columns[connection.source].text
        match connection.transformation:
            case Linear(factor, offset):
                return f"{number_in_c(factor)} * {value} + {number_in_c(offset)}"
            case Mapped(pairs):
                whole = self.columns[connection.target].type != FLOAT
                name = f"mapped_{len(self.mappings)}"
                of = "int" if whole else "double"
                tests = "".join(
                    f"    if (value == {number_in_c(float(a))}) return {number_in_c(int(b) if whole else float(b))};\n"
                    for a, b in pairs
                )
                self.mappings.append(
                    f"static {of} {name}(double value) {{\n{tests}    return ({of})value;\n}}"
                )
                return f"{name}({value})"
        return value

    def _show(self) -> str:
        lines = [
            f"    row[{i + 1}] = {place.text};" for i, place in enumerate(self.columns.values())
        ]
        head = "static void show(const simulation *it, double t, double row[]) {\n    row[0] = t;"
        return "\n".join(["/* A row: the time, and all inputs and outputs. */", head, *lines, "}"])

    def _look(self) -> list[str]:
        """What looks at a row, and what gives the indices at the end."""
        if not self.indices:
            return []
        acts_at_end = int(self.plan.experiment.acting_row)
        lines, gives, n = [], [], 0
        for i, (reducer, sources) in enumerate(self.indices):
            text = self.reducers[id(reducer)]
            of = dict(zip((port.name for port in reducer.ports), sources, strict=True))
            row = text.row(lambda port: self._source(of[port.name]))
            look = (
                f"{text.name}_look(&it->index_{i}, {row}, {acts_at_end}, t, h, it->start_time, "
                "it->stop_time);"
            )
            if reducer.last is not None:
                last = number_in_c(reducer.last)
                look = f"if (t >= time_after(it, it->steps) - {last}) {look}"
            lines.append(look)
            gives.append(
                f"{text.name}_give(&it->index_{i}, it->looked, it->start_time, it->stop_time, "
                f"found + {n});"
            )
            n += sum(map(len, reducer.results.values()))
        return [
            "/* Lets indices look at a row. */\n"
            "static void look(simulation *it, double t) {\n"
            "    const double h = t - it->looked;\n"
            + "".join(f"    {line}\n" for line in lines)
            + "    it->looked = t;\n}",
            f"enum {{ INDICES = {n} }};\n\n"
            "/* The indices of the rows so far; what is not there is not a number. */\n"
            "EXPORTED void indices(const simulation *it, double found[]) {\n"
            + "".join(f"    {line}\n" for line in gives)
            + "}",
        ]

    def _source(self, source: PortName | float) -> str:
        if isinstance(source, PortName):
            return (self.columns.get(source) or self.parameters[source]).text
        return number_in_c(float(source))

    def _steps(self) -> list[str]:
        found, parts = self.stages, []
        if found.passing is not None:
            parts.append(self._made("pass", "Lets values of t_k pass", found.passing))
        parts.append(self._made("make_step", "Makes the step after the k-th", found.stepping))
        return parts

    def _run(self) -> str:
        found = self.stages
        shown = (
            "if (rows != NULL) show(it, t, rows + k * WIDTH);"
        )
        looks = ["look(it, {});"] * bool(self.indices)
        passing = [
            "if (pass(it, k, t, error)) return 1;",
            shown,
            *(line.format("t") for line in looks),
        ]
        before = passing if found.passing is not None else []
        after = (
            [
                "if (rows != NULL) show(it, time_after(it, k + 1), rows + (k + 1) * WIDTH);",
                *(line.format("time_after(it, k + 1)") for line in looks),
            ]
            if found.passing is None
            else []
        )
        last = (
            [
                "if (it->made == it->steps) {",
                "    const int k = it->made;",
                "    const double t = time_after(it, k);",
                *[f"    {line}" for line in passing],
                "}",
            ]
            if found.passing is not None
            else []
        )
        first = (
            [
                "if (it->made == 0) {",
                "    if (rows != NULL) show(it, it->start_time, rows);",
                *(f"    {line.format('it->start_time')}" for line in looks),
                "}",
            ]
            if found.passing is None
            else []
        )
        body = [
            "Error noted = {0}, *error = &noted;",
            *first,
            "while (it->made < until) {",
            "    const int k = it->made;",
            "    const double t = time_after(it, k);",
            *[f"    {line}" for line in before],
            "    if (make_step(it, k, t, error)) return 1;",
            *[f"    {line}" for line in after],
            "    it->made = k + 1;",
            "}",
            *last,
            "return 0;",
        ]
        text = "\n".join(f"    {line}" for line in body)
        return (
            f"enum {{ WIDTH = {1 + len(self.columns)} }};\n\n"
            "/* Makes steps until so many are made, and a row after each if there are rows; whether a\n"
            " * component refuses. */\n"
            f"EXPORTED int run(simulation *it, int until, double rows[]) {{\n{text}\n}}\n\n"
            "EXPORTED size_t size_of_simulation(void) { return sizeof(simulation); }\n\n"
            "/* What has refused: the component, by its number, what was called, and which input. */\n"
            "EXPORTED void failure(const simulation *it, int found[]) {\n"
            "    found[0] = it->component;\n    found[1] = it->call;\n    found[2] = it->port;\n"
            "    found[3] = it->made;\n}"
        )

    def _made(self, name: str, doc: str, found: Sequence[Stage]) -> str:
        lines: list[str] = []
        for stage in found:
            inner = list(self._stage(stage))
            if (when := stage.decimation) is not None:
                k = "k + 1" if when.at_end else "k"
                test = f"({k}) % {when.every} == 0" if when.at_end else f"k % {when.every} == 0"
                end = " || k + 1 == it->steps" if when.at_end else " || k == it->steps"
                lines += [f"if ({test}{end}) {{", *(f"    {line}" for line in inner), "}"]
            else:
                lines += inner
        text = "\n".join(part for line in lines for part in lines_of(line.lstrip(), "    " + " " * (len(line) - len(line.lstrip()))))
        return (
            f"/* {doc}; whether a component refuses. */\n"
            f"static int {name}(simulation *it, int k, double t, Error *error) {{\n"
            f"    (void)k;\n    (void)t;\n    (void)error;\n{text}\n    return 0;\n}}"
        )

    def _stage(self, stage: Stage) -> Iterator[str]:
        for connection in stage.connections:
            target = self.columns[connection.target]
            yield f"{target.text} = {self._value(connection)};"
        for port in stage.shows:
            if port.component in self.slow:
                hidden = self._group(port.component, "outputs", "output")
                if port in hidden:
                    yield f"{self.columns[port].text} = {hidden[port].text};"
        visits = [visit for visit in stage.visits if isinstance(visit, Visit)]
        every = stage.decimation.every if stage.decimation else 1
        for visit in visits:
            yield from self._visited(visit, every)
        for visit in visits:
            kind = self.kind(visit.component)
            is_stale = kind.follows_inputs and not (kind.said.is_sampled and visit.steps)
            if is_stale and self.reads(visit):
                yield from self._evaluated(visit.component)

    def _visited(self, visit: Visit, every: int) -> Iterator[str]:
        name, kind = visit.component, self.kind(visit.component)
        member, i = f"it->{self.members[name]}", self.components.index(visit.component)
        if visit.takes:
            yield from self._checked_inputs(name)
            if kind.said.derived and kind.said.takes("derive", "inputs"):
                yield f"{member}.underived = 1;"
        if not visit.steps:
            return
        if kind.said.is_sampled:
            anew = f" {member}.underived = 1;" * kind.said.takes("derive", "t")
            if visit.takes:
                if kind.is_timed:
                    yield f"if ({member}.time != t) {{ {member}.time = t;{anew} }}"
                yield from self._evaluated(name)
            elif kind.is_timed:
                yield f"if ({member}.time != t) {{"
                yield f"    {member}.time = t;{anew}"
                yield from (f"    {line}" for line in self._evaluated(name))
                yield "}"
        yield (
            f"{kind.name}_advance(&{member}, it->start_time, t, length_of(it, k, {every}), error);"
        )
        yield f"if (error->raised) return refused(it, {i}, {STEP}, 0);"

    def _evaluated(self, name: str) -> Iterator[str]:
        kind, i = self.kind(name), self.components.index(name)
        yield f"{kind.name}_evaluate(&it->{self.members[name]}, error);"
        yield f"if (error->raised) return refused(it, {i}, {OUTPUTS}, 0);"

    def reads(self, visit: Visit) -> bool:
        """Whether one of the outputs is read that the component computes."""
        component = self.plan.system.components[visit.component]
        computed = {port.name for port in self.kind(visit.component).ports("output")}
        types: dict[str, set[bool]] = {}
        for variable in component.having("output"):
            if variable.name in computed:
                types.setdefault(variable.type, set()).add(
                    bool(component.has_feedthrough(variable.name))
                )
        has_states = [kinds for kinds in types.values() if False in kinds]
        if visit.reads == DIRECT:
            return any(True in kinds for kinds in types.values())
        if visit.reads == STATES:
            return bool(has_states)
        if visit.reads == ONLY_STATES:
            return any(True not in kinds for kinds in has_states)
        return bool(types)


#: Values go along all connections so often, until they rest.
_MOST_ROUNDS = 1000


def _as(place: Place, value: float) -> float:
    return int(value) if is_whole(place.type) else float(value)


def _start(port: Port, place: Place) -> float:
    return _as(place, port.start or 0)


def _with_order(plan: Plan) -> Plan:
    from dataclasses import replace

    return replace(plan, experiment=replace(plan.experiment, order=FEEDTHROUGH))


def _lower(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


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
_TAKEN = ("start_time", "step", "stop_time", "full_steps", "steps", "made", "component", "call", "port")
