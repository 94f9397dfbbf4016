"""A component in C, as a program has it: its structure, its start, its outputs and its step.

What the FMUs' runtime does is written here for one component, without what only a host asks for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from auv_fmu.paper import euler
from fmus.language.tree import Function
from fmus.language.types import FLOAT, Scalar, Type, type_of
from fmus.native.emit import Emitter, closed, members, number_in_c, unbroken
from fmus.native.names import in_c
from fmus.native.pieces import function, initializer, scalars, structure
from fmus.ports.definition import Definition
from fmus.ports.groups import Nothing
from fmus.ports.port import H_MAX, Port
from orchestrator.program.noise import is_added

#: Equations of the time step.
EULER = (euler.internal_steps, euler.end_of_step)

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

#: From so many numbers on, a loop checks them.
_MANY = 4

#: A number so large that whatever it is multiplied by shows, unless that is zero.
_LARGE = 1e300


@dataclass
class Kind:
    """A component in C, of which a system may have several.

    Attributes:
        definition: of it.
        functions: its hooks as trees.
        emitter: of all equations.
        name: of its structure, and what its functions begin with.
        euler: equations of the time step.
        is_tuned: whether parameters may change after the start.
        is_checked: whether each call says whether what it has computed is sound.
        foreseen: outputs that others take before their inputs are known, if only these are wanted
            then.
        is_alone: whether no other component of the program is of this kind, so that its functions
            may stand where they are called.

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
        said = self.said = self.definition.behaviour
        self.types = {
            "parameters": type_of(said.parameters),
            "inputs": type_of(said.inputs),
            "state": type_of(said.state),
            "outputs": type_of(said.outputs),
            "derived": type_of(said.derived or Nothing),
        }
        self.is_timed = said.takes("outputs", "t") or said.takes("derive", "t")
        self.follows_inputs = said.takes("outputs", "inputs")
        self.derives_anew = any(said.takes("derive", one) for one in ("state", "inputs", "t"))
        self.steps = said.hooks["update"] is not None
        self.has_h_max = said.h_max is not None

    @cached_property
    def ports(self) -> Mapping[str, Sequence[Port]]:
        """Its ports by causality, in the order of the numbers of their group."""
        found: dict[str, list[Port]] = {"input": [], "output": [], "parameter": []}
        for port in self.definition.ports:
            if port.name != H_MAX or not self.has_h_max:
                found[port.causality].append(port)
        return found

    def text(self) -> Iterator[str]:
        """Its functions."""
        if self.said.draws:
            yield self._draw()
        yield self._evaluate()
        if self.foreseen:
            yield self._foresee()
        yield self._start()
        yield self._advance()
        if self.is_tuned:
            yield self._adopt()

    def are_finite(self, outputs: str) -> str:
        """Whether all outputs are finite; empty: they have no floats."""
        return _of_all(self.types["outputs"], outputs, "are_finite", "0.0 * {}", "== 0.0")

    def is_sound(self, state: str) -> str:
        """Whether a run can go on from a state; empty: it has no numbers."""
        limit = f"<= {number_in_c(euler.LARGEST_STATE**2)}"
        size = _of_all(self.types["state"], state, "sum_of_squares", "{0} * {0}", limit)
        among = [
            f"({' || '.join(f'{place.text} == {int(one)}' for one in place.type.made)})"
            for place in scalars(self.types["state"], state)
            if place.type.made is not None
        ]
        return " && ".join([*among, *([size] if size else [])])

    def _type(self, group: str) -> str:
        return self.emitter.type(self.types[group])

    def call(self, hook: str, **given: str) -> str:
        """The call of a hook, with other arguments than the component's own if they are given."""
        called = self.functions[hook]
        known = {
            "parameters": "it->parameters", "inputs": "it->inputs", "state": "it->state",
            "derived": "it->derived", "t": "it->time", **given,
        }  # fmt: skip
        return self.emitter.call(called, [known[name] for name in called.arguments])

    def _function(self, name: str, arguments: str, lines: Sequence[str]) -> str:
        how = "WITHIN" if self.is_alone and name != "start" else "APART"
        head = f"{how} void {self.name}_{name}({self.name} *it{arguments}, Error *error)"
        names = re.findall(r"(\w+)(?=,|$)", arguments)
        return function(head, lines, ["error", *filter(None, names)])

    def structure(self) -> str:
        """Its structure."""
        rows = [f"{self._type(what)} {what};" for what in ("parameters", "inputs", "state")]
        rows.append(f"{self._type('outputs')} outputs;")
        if self.said.derived:
            rows.append(f"{self._type('derived')} derived;")
            rows.append("int underived; /* whether it must be derived again before use */")
        if self.steps:
            rows.append("double longest_step; /* that is not split [s] */")
        if self.is_timed:
            rows.append("double time; /* of the state [s] */")
        if self.tells:
            rows += ["double restarted; /* when its state first was [s] */", "int has_restarted;"]
        if self.said.draws:
            rows.append(f"double draws[{self.said.draws}];")
            rows.append("int is_noisy; /* whether each draw makes a difference */")
            rows.append("int has_noise; /* whether it has begun */")
            rows.append("int undrawn; /* how often numbers are still to be drawn */")
            rows.append("generator noise;")
        return f"/* {closed(self.definition.summary)} */\n{structure(self.name, rows)}"

    def _derive(self, state: str, time: str) -> list[str]:
        if not self.said.derived:
            return []
        derived = f"it->derived = {self.call('derive', state=state, t=time)};"
        return ["if (it->underived) {", f"    {derived}", "    it->underived = error->raised;", "}"]

    @property
    def tells(self) -> bool:
        """Whether it keeps when its state was first started over."""
        return self.is_tuned and self.said.hooks["credible"] is not None

    def _guarded(self, *, tells: bool = False) -> list[str]:
        """A copy of the state, which a guard may start over."""
        lines = [f"{self._type('state')} state = it->state;"]
        if self.said.hooks["credible"]:
            lines.append(f"if (!{self.call('credible', state='state')}) {{")
            lines.append(f"    state = {self.call('restarted', state='state')};")
            if tells:
                lines.append("    if (!it->has_restarted) it->restarted = t;")
                lines.append("    it->has_restarted = 1;")
            lines.append("}")
        return lines

    def _computed(self) -> list[str]:
        """What computes the outputs."""
        is_guarded = self.said.hooks["credible"] is not None
        lines, state = self._guarded() * is_guarded, "state" if is_guarded else "it->state"
        if self.said.takes("outputs", "derived"):
            lines += self._derive(state, "it->time")
        lines.append(f"{self._type('outputs')} outputs = {self.call('outputs', state=state)};")
        if self.said.draws:
            group = f"outputs.{in_c(self.said.noisy)}"
            type_ = self.functions["measured"].returns
            lines.append(f"const {self.emitter.type(type_)} exact = {group};")
            measured = f"{group} = {self._measured('it->draws', 'exact')};"
            lines.append(measured)
            floats = [one.text for one in scalars(type_, group) if one.type == FLOAT]
            if self._may_skip and floats:
                # Noise of zero may still change the sign of a zero.
                zeros = " || ".join(f"{one} == 0.0" for one in floats)
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
        lines = [f"{to.text} = {of.text};" for port, to, of in places if port.name in self.foreseen]
        return self._function("foresee", "", [*self._computed(), *lines])

    def _measured(self, draws: str, group: str) -> str:
        type_ = self.functions["measured"].arguments["n"]
        n = initializer(type_, (f"{draws}[{i}]" for i in range(self.said.draws)))
        n = n if isinstance(type_, Scalar) else f"({self.emitter.type(type_)}){n}"
        return self.call("measured", **{"n": n, self.said.noisy: group})

    def _start(self) -> str:
        said, lines = self.said, list[str]()
        if said.hooks["check"]:
            lines.append(f"{self.call('check')};")
        if self.is_timed:
            lines.append("it->time = t;")
        if said.derived:
            lines.append("it->underived = 1;")
        if said.draws:
            lines += ["if (!it->has_noise) {", *(f"    {line}" for line in self._seed()), "}"]
        if said.hooks["start"]:
            lines.append(f"it->state = {self.call('start', t='t')};")
            if sound := self.is_sound("it->state"):
                lines.append(f"if (!({sound})) {_UNSOUND}")
        lines.append(f"{self.name}_evaluate(it, error);")
        if not self.is_checked and (finite := self.are_finite("it->outputs")):
            lines.append(f"if (!({finite})) {_NOT_FINITE}")
        return self._function("start", ", double t", lines)

    @cached_property
    def _may_skip(self) -> bool:
        """Whether noise that is multiplied by zero need not be drawn."""
        # Parameters that change may let it count, and so may what is measured.
        return not self.is_tuned and is_added(self.functions["measured"], "n", self.said.noisy)

    def _seed(self) -> list[str]:
        """What begins the noise, and finds whether it counts."""
        n, type_ = self.said.draws, self.functions["measured"].returns
        name = self.emitter.type(type_)
        # They differ, or their difference would not show.
        large = ", ".join(f"{_LARGE / (1.0 + 0.37 * i)!r}" for i in range(n))
        noisy = [
            "Error other = {0}, *error = &other;",
            "(void)error;",
            f"const double large[{n}] = {{{large}}};",
            f"const {name} none = {'0.0' if isinstance(type_, Scalar) else '{0}'};",
            f"const {name} all = {self._measured('large', 'none')};",
            "it->is_noisy = memcmp(&all, &none, sizeof all) != 0;",
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
        """What draws all that is still to be drawn."""
        return function(
            f"static inline void {self.name}_draw({self.name} *it)",
            [
                "if (it->noise.place == 0) {",
                f"    seed_generator(&it->noise, (uint32_t){self.call('seed')});",
                "}",
                "for (; it->undrawn > 0; it->undrawn--) {",
                f"    draw_normals(&it->noise, it->draws, {self.said.draws});",
                "}",
            ],
            (),
        )

    def _advance(self) -> str:
        said, lines = self.said, list[str]()
        if self.is_timed:
            anew = " it->underived = 1;" * said.takes("derive", "t")
            lines += ["if (it->time != t) {", f"    it->time = t;{anew}", "}"]
        if self.steps:
            split = self.emitter.call(self.euler["internal_steps"], ["h", "it->longest_step"])
            lines += [
                *self._guarded(tells=self.tells),
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
                lines += [f"    {line}" for line in self._derive("state", time)]
            lines.append(f"    state = {self.call('update', state='state', t=time, h='step')};")
            if said.takes("derive", "state") or said.takes("derive", "t"):
                lines.append("    it->underived = 1;")
            lines.append("}")
            if self.is_checked:
                sound = self.is_sound("state")
                lines += [f"if (!({sound})) {_UNSOUND}"] * bool(sound)
                lines.append("if (error->raised) return;")
            lines.append("it->state = state;")
        if self.is_timed:
            lines.append("it->time = end;")
            if said.takes("derive", "t") and not self.steps:
                lines.append("it->underived = 1;")
        if said.draws:
            lines += ["it->undrawn++;", f"if (it->is_noisy) {self.name}_draw(it);"]
        if not said.is_sampled and not self.follows_inputs:
            lines.append(f"{self.name}_evaluate(it, error);")
        return self._function("advance", ", double t, double h, double end", lines)

    def _adopt(self) -> str:
        """What follows from parameters that have changed."""
        lines = [f"{self.call('check')};"] if self.said.hooks["check"] else []
        lines += ["it->underived = 1;"] * bool(self.said.derived)
        return self._function("adopt", "", lines or ["(void)it;"])


def _has_gaps(type_: Type) -> bool:
    """Whether records without fields lie in a value, which C gives room."""
    if isinstance(type_, Scalar):
        return False
    parts = [part for _, part in members(type_)]
    return not parts or any(map(_has_gaps, parts))


def _of_all(type_: Type, text: str, name: str, term: str, test: str) -> str:
    """A test of all floats in a value; empty: there is none."""
    places = [*scalars(type_, text)]
    floats = [place.text for place in places if place.type == FLOAT]
    if not floats:
        return ""
    if _MANY <= len(floats) == len(places) and not _has_gaps(type_):
        called = f"{name}((const double *)&{text}, {len(floats)})"
        return called if name == "are_finite" else f"{called} {test}"
    return f"{' + '.join(term.format(one) for one in floats)} {test}"
