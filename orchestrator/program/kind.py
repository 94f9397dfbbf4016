"""A component in C, as a part of a program: its structure, start, outputs and step.

This is the work of the FMUs' runtime for one component, without the calls that only hosts need.
Noise that parameters multiply by zero is not drawn.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from auv_fmu.paper import euler
from fmus.language import tree
from fmus.language.tree import ADD, DIVIDE, MULTIPLY, NEGATIVE, OVER, SUBTRACT, Function
from fmus.language.types import FLOAT, Scalar, Type, type_of
from fmus.native.emit import Emitter, closed, members, number_in_c, unbroken
from fmus.native.names import in_c
from fmus.native.pieces import function, initializer, scalars, structure
from fmus.ports.definition import Definition
from fmus.ports.groups import Nothing
from fmus.ports.port import H_MAX, Port

#: Equations of the time step.
EULER = (euler.internal_steps, euler.end_of_step)

#: Refusals of a step, with messages for programs that keep them.
_NOT_FINITE, _UNSOUND, _TOO_MANY = (
    f"raise_error(error, {unbroken(why)});"
    for why in (
        "an output is not finite",
        f"the state is not finite, or exceeds {euler.LARGEST_STATE:g}",
        f"the step needs more than {euler.MOST_INTERNAL_STEPS} internal steps; take shorter ones, "
        "or raise h_max",
    )
)

#: Least number of values that a loop checks.
_MANY = 4

#: Most numbers in a state of a component whose functions are inlined: calls of larger ones take a
#: small part of their time, and a compiler takes long for many copies of them.
_MOST_INLINED = 128

#: A number so large that its product with any parameter but zero shows in the outputs.
_LARGE = 1e300

#: Arguments of `measured` that a value depends on, besides parameters.
Dependence = frozenset[str]

_NOTHING: Dependence = frozenset()


@dataclass
class Kind:
    """A kind of component in C; a system may have several components of a kind.

    Attributes:
        definition: its definition.
        functions: its hooks as trees.
        emitter: emitter of all equations.
        name: name of its structure, and prefix of its functions.
        euler: equations of the time step.
        is_tuned: if set, parameters may change after the start.
        is_checked: if set, each call checks the values that it has computed.
        foreseen: outputs that are passed on before the inputs are known, if only these are.
        is_alone: if set, the program has one component of this kind, so that its functions may be
            inlined.

    """

    definition: Definition
    functions: Mapping[str, Function]
    emitter: Emitter
    name: str
    euler: Mapping[str, Function]
    is_tuned: bool
    is_checked: bool
    foreseen: Sequence[str] = ()
    is_alone: bool = False

    def __post_init__(self) -> None:
        behaviour = self.behaviour = self.definition.behaviour
        self.types = {
            "parameters": type_of(behaviour.parameters),
            "inputs": type_of(behaviour.inputs),
            "state": type_of(behaviour.state),
            "outputs": type_of(behaviour.outputs),
            "derived": type_of(behaviour.derived or Nothing),
        }
        self.is_timed = behaviour.takes("outputs", "t") or behaviour.takes("derive", "t")
        self.follows_inputs = behaviour.takes("outputs", "inputs")
        self.follows_parameters = behaviour.takes("outputs", "parameters")
        self.derives_from_inputs = bool(behaviour.derived) and behaviour.takes("derive", "inputs")
        derived_from = ("state", "inputs", "t")
        self.derives_anew = any(behaviour.takes("derive", name) for name in derived_from)
        self.steps = behaviour.hooks["update"] is not None
        self.is_guarded = behaviour.hooks["credible"] is not None
        self.has_h_max = behaviour.h_max is not None

    @cached_property
    def ports(self) -> Mapping[str, Sequence[Port]]:
        """Its ports by causality, in the order of the numbers in their group."""
        ports: dict[str, list[Port]] = {"input": [], "output": [], "parameter": []}
        for port in self.definition.ports:
            if port.name != H_MAX or not self.has_h_max:
                ports[port.causality].append(port)
        return ports

    def text(self) -> Iterator[str]:
        """Yield its functions."""
        if self.behaviour.draws:
            yield self._draw()
        yield self._evaluate()
        if self.foreseen:
            yield self._foresee()
        yield self._start()
        yield self._advance()
        if self.is_tuned:
            yield self._adopt()

    def are_finite(self, outputs: str) -> str:
        """Return a test that all outputs are finite; empty: there are no floats."""
        return _of_all(self.types["outputs"], outputs, "are_finite", "0.0 * {}", "== 0.0")

    def is_sound(self, state: str) -> str:
        """Return a test that a run can continue from a state; empty: there are no numbers."""
        limit = f"<= {number_in_c(euler.LARGEST_STATE**2)}"
        size = _of_all(self.types["state"], state, "sum_of_squares", "{0} * {0}", limit)
        among = [
            f"({' || '.join(f'{place.text} == {int(value)}' for value in place.type.made)})"
            for place in scalars(self.types["state"], state)
            if place.type.made is not None
        ]
        return " && ".join([*among, *([size] if size else [])])

    def _type(self, group: str) -> str:
        return self.emitter.type(self.types[group])

    def call(self, hook: str, **given: str) -> str:
        """Return a call of a hook with the component's own arguments, except the given ones."""
        called = self.functions[hook]
        known = {
            "parameters": "it->parameters", "inputs": "it->inputs", "state": "it->state",
            "derived": "it->derived", "t": "it->time", **given,
        }  # fmt: skip
        return self.emitter.call(called, [known[name] for name in called.arguments])

    def _function(self, name: str, arguments: str, lines: Sequence[str]) -> str:
        is_inlined = self.is_alone and self._is_small and name != "start"
        macro = "WITHIN" if is_inlined else "APART"
        head = f"{macro} void {self.name}_{name}({self.name} *it{arguments}, Error *error)"
        names = re.findall(r"(\w+)(?=,|$)", arguments)
        return function(head, lines, ["error", *filter(None, names)])

    @cached_property
    def _is_small(self) -> bool:
        """True if its state has few numbers."""
        return len([*scalars(self.types["state"], "")]) <= _MOST_INLINED

    def structure(self) -> str:
        """Return its structure."""
        rows = [f"{self._type(what)} {what};" for what in ("parameters", "inputs", "state")]
        rows.append(f"{self._type('outputs')} outputs;")
        if self.behaviour.derived:
            rows.append(f"{self._type('derived')} derived;")
            rows.append("int underived; /* if set, it must be derived again before use */")
        if self.steps:
            rows.append("double longest_step; /* longer ones are split [s] */")
        if self.is_timed:
            rows.append("double time; /* of the state [s] */")
        if self.keeps_restart:
            rows.append("double restarted; /* time at which a guard first reset the state [s] */")
            rows.append("int has_restarted;")
        if self.behaviour.draws:
            rows.append(f"double draws[{self.behaviour.draws}];")
            rows.append("int is_noisy; /* if set, draws make a difference */")
            rows.append("int has_noise; /* if set, the noise has begun */")
            rows.append("int undrawn; /* number of draws that are still to be made */")
            rows.append("generator noise;")
        return f"/* {closed(self.definition.summary)} */\n{structure(self.name, rows)}"

    def _derive(self, state: str, time: str) -> list[str]:
        if not self.behaviour.derived:
            return []
        derived = f"it->derived = {self.call('derive', state=state, t=time)};"
        return ["if (it->underived) {", f"    {derived}", "    it->underived = error->raised;", "}"]

    @property
    def keeps_restart(self) -> bool:
        """True if it keeps the time at which a guard first reset its state."""
        return self.is_tuned and self.is_guarded

    def _guarded(self, *, keeps_restart: bool = False) -> list[str]:
        """Return statements that copy the state, and reset it if a guard says so."""
        lines = [f"{self._type('state')} state = it->state;"]
        if self.is_guarded:
            lines.append(f"if (!{self.call('credible', state='state')}) {{")
            lines.append(f"    state = {self.call('restarted', state='state')};")
            if keeps_restart:
                lines.append("    if (!it->has_restarted) it->restarted = t;")
                lines.append("    it->has_restarted = 1;")
            lines.append("}")
        return lines

    def _computed(self) -> list[str]:
        """Return statements that compute the outputs."""
        lines, state = (self._guarded(), "state") if self.is_guarded else ([], "it->state")
        if self.behaviour.takes("outputs", "derived"):
            lines += self._derive(state, "it->time")
        lines.append(f"{self._type('outputs')} outputs = {self.call('outputs', state=state)};")
        if self.behaviour.draws:
            group = f"outputs.{in_c(self.behaviour.noisy)}"
            type_ = self.functions["measured"].returns
            lines.append(f"const {self.emitter.type(type_)} exact = {group};")
            measured = f"{group} = {self._measured('it->draws', 'exact')};"
            lines.append(measured)
            floats = [place.text for place in scalars(type_, group) if place.type == FLOAT]
            if self._may_skip and floats:
                # Noise of zero may still change the sign of a zero.
                zeros = " || ".join(f"{text} == 0.0" for text in floats)
                lines += [
                    f"if (it->undrawn > 0 && ({zeros})) {{",
                    f"    {self.name}_draw(it);",
                    f"    {measured}",
                    "}",
                ]
        return lines

    def _evaluate(self) -> str:
        finite = self.are_finite("outputs")
        check = [f"if (!({finite})) {_NOT_FINITE}"] * bool(finite and self.is_checked)
        return self._function("evaluate", "", [*self._computed(), *check, "it->outputs = outputs;"])

    def _foresee(self) -> str:
        places = zip(
            self.ports["output"],
            scalars(self.types["outputs"], "it->outputs"),
            scalars(self.types["outputs"], "outputs"),
            strict=True,
        )
        lines = [
            f"{target.text} = {source.text};"
            for port, target, source in places
            if port.name in self.foreseen
        ]
        return self._function("foresee", "", [*self._computed(), *lines])

    def _measured(self, draws: str, group: str) -> str:
        type_ = self.functions["measured"].arguments["n"]
        n = initializer(type_, (f"{draws}[{i}]" for i in range(self.behaviour.draws)))
        n = n if isinstance(type_, Scalar) else f"({self.emitter.type(type_)}){n}"
        return self.call("measured", **{"n": n, self.behaviour.noisy: group})

    def _start(self) -> str:
        behaviour, lines = self.behaviour, list[str]()
        if behaviour.hooks["check"]:
            lines.append(f"{self.call('check')};")
        if self.is_timed:
            lines.append("it->time = t;")
        if behaviour.derived:
            lines.append("it->underived = 1;")
        if behaviour.draws:
            lines += ["if (!it->has_noise) {", *(f"    {line}" for line in self._seed()), "}"]
        if behaviour.hooks["start"]:
            lines.append(f"it->state = {self.call('start', t='t')};")
            if sound := self.is_sound("it->state"):
                lines.append(f"if (!({sound})) {_UNSOUND}")
        lines.append(f"{self.name}_evaluate(it, error);")
        if not self.is_checked and (finite := self.are_finite("it->outputs")):
            lines.append(f"if (!({finite})) {_NOT_FINITE}")
        return self._function("start", ", double t", lines)

    @cached_property
    def _may_skip(self) -> bool:
        """True if noise that is multiplied by zero need not be drawn."""
        # Changed parameters may make it count, as may a product with the measured values.
        return not self.is_tuned and is_added(self.functions["measured"], "n", self.behaviour.noisy)

    def _seed(self) -> list[str]:
        """Return statements that begin the noise, and find out whether it makes a difference."""
        n, type_ = self.behaviour.draws, self.functions["measured"].returns
        name = self.emitter.type(type_)
        # All differ: a difference of equal numbers would be zero.
        large = ", ".join(f"{_LARGE / (1.0 + 0.37 * i)!r}" for i in range(n))
        differing = [
            f"!same_bits({a.text}, {b.text})" if a.type == FLOAT else f"{a.text} != {b.text}"
            for a, b in zip(scalars(type_, "all"), scalars(type_, "none"), strict=True)
        ]
        noisy = [
            "Error other = {0}, *error = &other;",
            "(void)error;",
            f"const double large[{n}] = {{{large}}};",
            f"const {name} none = {'0.0' if isinstance(type_, Scalar) else '{0}'};",
            f"const {name} all = {self._measured('large', 'none')};",
            f"it->is_noisy = {' || '.join(differing) or '0'};",
        ]
        return [
            "it->has_noise = 1;",
            "it->noise.place = 0; /* not seeded yet */",
            "it->undrawn = 1;",
            *(
                ["{", *(f"    {line}" for line in noisy), "}"]
                if self._may_skip
                else ["it->is_noisy = 1;"]
            ),
            f"if (it->is_noisy) {self.name}_draw(it);",
        ]

    def _draw(self) -> str:
        """Return the function that makes the draws that are still to be made."""
        return function(
            f"static inline void {self.name}_draw({self.name} *it)",
            [
                "if (it->noise.place == 0) {",
                f"    seed_generator(&it->noise, (uint32_t){self.call('seed')});",
                "}",
                "for (; it->undrawn > 0; it->undrawn--) {",
                f"    draw_normals(&it->noise, it->draws, {self.behaviour.draws});",
                "}",
            ],
            (),
        )

    def _advance(self) -> str:
        behaviour, lines = self.behaviour, list[str]()
        if self.is_timed:
            anew = " it->underived = 1;" * behaviour.takes("derive", "t")
            lines += ["if (it->time != t) {", f"    it->time = t;{anew}", "}"]
        if self.steps:
            split = self.emitter.call(self.euler["internal_steps"], ["h", "it->longest_step"])
            lines += [
                *self._guarded(keeps_restart=self.keeps_restart),
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
            if behaviour.takes("update", "derived"):
                lines += [f"    {line}" for line in self._derive("state", time)]
            lines.append(f"    state = {self.call('update', state='state', t=time, h='step')};")
            if behaviour.takes("derive", "state") or behaviour.takes("derive", "t"):
                lines.append("    it->underived = 1;")
            lines.append("}")
            if self.is_checked:
                sound = self.is_sound("state")
                lines += [f"if (!({sound})) {_UNSOUND}"] * bool(sound)
                lines.append("if (error->raised) return;")
            lines.append("it->state = state;")
        if self.is_timed:
            lines.append("it->time = end;")
            if behaviour.takes("derive", "t") and not self.steps:
                lines.append("it->underived = 1;")
        if behaviour.draws:
            lines += ["it->undrawn++;", f"if (it->is_noisy) {self.name}_draw(it);"]
        if not behaviour.is_sampled and not self.follows_inputs:
            lines.append(f"{self.name}_evaluate(it, error);")
        return self._function("advance", ", double t, double h, double end", lines)

    def _adopt(self) -> str:
        """Return the function that adopts changed parameters."""
        lines = [f"{self.call('check')};"] if self.behaviour.hooks["check"] else []
        lines += ["it->underived = 1;"] * bool(self.behaviour.derived)
        return self._function("adopt", "", lines or ["(void)it;"])


def _has_gaps(type_: Type) -> bool:
    """Tell whether a value contains records without fields, which take memory in C."""
    if isinstance(type_, Scalar):
        return False
    parts = [part for _, part in members(type_)]
    return not parts or any(map(_has_gaps, parts))


def _of_all(type_: Type, text: str, name: str, term: str, test: str) -> str:
    """Return a test of all floats in a value; empty: there are none."""
    parts = [*_floats(type_, text)]
    many = [f"{name}((const double *)&{place}, {n})" for place, n in parts if n > 1]
    few = [term.format(place) for place, n in parts if n == 1]
    if name == "are_finite":
        return " && ".join([*many, *([f"{' + '.join(few)} {test}"] if few else [])])
    return f"{' + '.join([*many, *few])} {test}" if parts else ""


def _floats(type_: Type, text: str) -> Iterator[tuple[str, int]]:
    """Yield the floats in a value: parts of nothing else and their numbers, and single ones."""
    places = [*scalars(type_, text)]
    if len(places) >= _MANY and all(place.type == FLOAT for place in places):
        if not _has_gaps(type_):
            yield text, len(places)
            return
    elif isinstance(type_, Scalar):
        yield from ((text, 1) for place in places if place.type == FLOAT)
    for suffix, part in members(type_):
        yield from _floats(part, text + suffix)


class _Mixed(Exception):
    """Drawn numbers act otherwise than as terms of a sum."""


def is_added(measured: tree.Function, drawn: str, group: str) -> bool:
    """Tell whether drawn numbers are added to a group as terms that do not depend on it.

    They are if they only pass through sums and products with parameters, and choose nothing. Then
    the noise is the same whatever is measured.

    Args:
        measured: hook that adds the noise.
        drawn: its argument with the drawn numbers.
        group: its argument with the exact values.

    """
    arguments = {name: Dependence({name} & {drawn, group}) for name in measured.arguments}
    try:
        _Reading(drawn, arguments).result(measured)
    except _Mixed:
        return False
    return True


@dataclass
class _Reading:
    """Dependences of the variables of a function on drawn numbers and exact values."""

    drawn: str
    known: dict[str, Dependence]
    returned: set[str] = field(default_factory=set)

    def result(self, function: tree.Function) -> Dependence:
        """Return the dependences of a function's result."""
        self._read(function.body)
        # In a loop, earlier statements may use results of later ones.
        before: dict[str, Dependence] = {}
        while before != self.known:
            before = {**self.known}
            self._read(function.body)
        return Dependence(self.returned)

    def _read(self, body: Sequence[tree.Statement]) -> None:
        for statement in body:
            match statement:
                case tree.Store(values):
                    for name, value in values:
                        self._keep(name, self._dependence(value))
                case tree.StoreItem(name, places, value):
                    self._unmixed(places)
                    self._keep(name, self._dependence(value))
                case tree.Return(value) if value is not None:
                    self.returned |= self._dependence(value)
                case tree.Return() | tree.Reserve() | tree.Break() | tree.Continue():
                    pass
                case _:
                    # Tests, bounds of loops, and values in error messages.
                    self._unmixed(tree.expressions_of(statement))
                    for block in tree.blocks_of(statement):
                        self._read(block)

    def _keep(self, name: str, made: Dependence) -> None:
        self.known[name] = self.known.get(name, _NOTHING) | made

    def _unmixed(self, expressions: Iterable[tree.Expression]) -> None:
        """Check that expressions that choose what happens depend on parameters only."""
        if any(map(self._dependence, expressions)):
            raise _Mixed

    def _dependence(self, expression: tree.Expression) -> Dependence:
        match expression:
            case tree.Local(name):
                return self.known.get(name, _NOTHING)
            case tree.Item(owner, place):
                self._unmixed([place])
                return self._dependence(owner)
            case tree.Choice(test, value, other):
                self._unmixed([test])
                return self._dependence(value) | self._dependence(other)
            case tree.Call(function, arguments):
                known = dict(zip(function.arguments, map(self._dependence, arguments), strict=True))
                return _Reading(self.drawn, known).result(function)
            case tree.Operation(operator, operands):
                return self._operated(operator, [*map(self._dependence, operands)])
        return _NOTHING.union(*map(self._dependence, expression.parts))

    def _operated(self, operator: tree.Operator, parts: Sequence[Dependence]) -> Dependence:
        made = _NOTHING.union(*parts)
        is_sum = operator in (ADD, SUBTRACT, NEGATIVE)
        is_share = operator in (OVER, DIVIDE) and not parts[-1]
        is_product = operator == MULTIPLY and (made == {self.drawn} or not all(parts))
        if self.drawn in made and not (is_sum or is_share or is_product):
            raise _Mixed
        return made
