"""Systems from a seed, and their archives.

All Reals stand for a number of the size of one, in a unit of their own: whatever a chain of units
and transformations makes of them, loops have the gain that their formulas are drawn with.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from support import archives, small_fmus

_SOURCE = Path(__file__).with_name("slave.c")

#: A formula: an operator and its operands, which are formulas, names or constants.
Formula = tuple[Any, ...]


class Unit(NamedTuple):
    """A value in base units is factor * value + offset."""

    base: str
    factor: float = 1.0
    offset: float = 0.0


class Quantity(NamedTuple):
    """Units of one dimension, and what zero and one are in base units."""

    units: tuple[str, ...]
    zero: float = 0.0
    one: float = 1.0


UNITS = {
    "kg": Unit("kg"), "g": Unit("kg", 1e-3), "t": Unit("kg", 1e3), "K": Unit("K"),
    "degC": Unit("K", 1.0, 273.15), "rad": Unit("rad"), "deg": Unit("rad", 0.017453292519943295),
    "m/s": Unit("m s"), "km/h": Unit("m s", 1.0 / 3.6),
}  # fmt: skip
_BASES = {"kg": 'kg="1"', "K": 'K="1"', "rad": 'rad="1"', "m s": 'm="1" s="-1"'}
QUANTITIES = {
    "mass": Quantity(("kg", "g", "t"), 0.0, 5.0),
    "temperature": Quantity(("K", "degC"), 280.0, 10.0),
    "angle": Quantity(("rad", "deg"), 0.0, 0.5),
    "speed": Quantity(("m/s", "km/h"), 0.0, 3.0),
}

ITEMS = ("low", "medium", "high", "top")

#: Declarations of the dependencies of outputs.
RIGHT, ABSENT, UNLISTED, ALL = DECLARATIONS = ("right", "absent", "unlisted", "all")

_TEXTS = ("calm", "storm", "fog", "x")

#: A kind that is a Real which must be greater than zero.
POSITIVE = "Positive"

_COUNTED = ("Integer", "Enumeration")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    Attributes:
        name: of it.
        causality: input, output or parameter.
        kind: Real, Positive, Integer, Boolean, Enumeration or String.
        start: value of an input or a parameter.
        quantity: of a Real; empty: it has no unit.
        unit: of a Real.

    """

    name: str
    causality: str
    kind: str
    start: Any = None
    quantity: str = ""
    unit: str = ""

    @property
    def type(self) -> str:
        return "Real" if self.kind == POSITIVE else self.kind


@dataclass
class State:
    """A state of an FMU: its first value, and a formula for the next one."""

    start: Any
    next: Formula = ("number", 0.0)


@dataclass
class Fmu:
    """An FMU.

    Attributes:
        name: of the file.
        variables: in the order of the description.
        states: that it keeps.
        outputs: a formula for each.
        responds: whether outputs are computed when they are asked for, or else when it is stepped.
        declares: one of :data:`DECLARATIONS`.
        capabilities: attributes of the description.

    """

    name: str
    variables: list[Variable] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    outputs: dict[str, Formula] = field(default_factory=dict)
    responds: bool = True
    declares: str = RIGHT
    capabilities: tuple[str, ...] = ()

    def having(self, causality: str) -> list[Variable]:
        return [variable for variable in self.variables if variable.causality == causality]

    def named(self, name: str) -> Variable:
        return next(variable for variable in self.variables if variable.name == name)

    def needs(self, output: str) -> set[str]:
        """The inputs that an output is computed from."""
        return {leaf[1] for leaf in leaves(self.outputs[output]) if leaf[0] == "input"}


@dataclass
class Wire:
    """A connection of a component's output with a component's input.

    Attributes:
        source, target: component and port.
        linear: factor and offset, after the units are those of the target.
        mapped: pairs of values.

    """

    source: tuple[str, str]
    target: tuple[str, str]
    linear: tuple[float, float] | None = None
    mapped: tuple[tuple[Any, Any], ...] = ()


@dataclass
class Part:
    """A component.

    Attributes:
        name: of it.
        fmu: that it is an instance of.
        values: of parameters and inputs that nothing feeds, as they are in the end.
        hidden: values that others win over.
        every: how many communication steps it takes in one of its own.

    """

    name: str
    fmu: Fmu
    values: dict[str, Any] = field(default_factory=dict)
    hidden: dict[str, Any] = field(default_factory=dict)
    every: int = 1


@dataclass
class Drawn:
    """A system, with its parts in the order of the file.

    Attributes:
        strong: whether values that go round its rings may grow.

    """

    seed: int
    parts: dict[str, Part]
    wires: list[Wire]
    step: float
    start_time: float
    stop_time: float
    strong: bool


def leaves(formula: Formula) -> list[Formula]:
    """The leaves of a formula: numbers, variables, states and the time."""
    if formula[0] in ("number", "text", "input", "parameter", "state", "time", "length"):
        return [formula]
    return [leaf for operand in formula[1:] for leaf in leaves(operand)]


# Numbers of the size of one, and values in units


def number(value: float) -> Formula:
    return ("number", value)


def plus(*terms: Formula) -> Formula:
    total = terms[0]
    for term in terms[1:]:
        total = ("+", total, term)
    return total


def times(a: Formula | float, b: Formula) -> Formula:
    return ("*", number(a) if isinstance(a, float) else a, b)


def _scale(variable: Variable) -> tuple[float, float]:
    """A value is offset + factor * number."""
    if not variable.unit:
        return 1.0, 0.0
    quantity, unit = QUANTITIES[variable.quantity], UNITS[variable.unit]
    return quantity.one / unit.factor, (quantity.zero - unit.offset) / unit.factor


def plain(variable: Variable) -> Formula:
    """The number that a Real stands for, or that is made of something else."""
    leaf = (variable.causality, variable.name)
    if variable.kind == "Boolean":
        return ("pick", leaf, number(0.37), number(-0.23))
    if variable.kind in _COUNTED:
        return times(0.21, leaf)
    if variable.kind == "String":
        return ("pick", ("same", leaf, ("text", "storm")), number(0.31), number(-0.11))
    factor, offset = _scale(variable)
    if (factor, offset) == (1.0, 0.0):
        return leaf
    return ("/", ("-", leaf, number(offset)), number(factor))


def in_unit(variable: Variable, formula: Formula) -> Formula:
    """A number as a value of a variable."""
    factor, offset = _scale(variable)
    if (factor, offset) == (1.0, 0.0):
        return formula
    return plus(times(factor, formula), number(offset))


# Drawing


class _Draw:
    """A system while it is drawn."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.seed = seed
        self.parts: dict[str, Part] = {}
        self.wires: list[Wire] = []
        # Shares of FMUs that compute outputs when asked, and of outputs with feedthrough.
        self.responding = self.random.choice((0.0, 0.5, 1.0, 1.0))
        self.feedthrough = self.random.choice((0.4, 0.7, 1.0))
        # Rings of Reals only, which can be solved; a fixed-point iteration of some diverges.
        self.tight = self.chance(0.3)
        self.strong = self.tight and self.chance(0.5)
        if self.tight:
            self.responding = self.feedthrough = 1.0
        # Formulas in a ring are such that it has one solution, and does not grow.
        self.ringed: set[str] = set()

    def chance(self, share: float) -> bool:
        return self.random.random() < share

    def between(self, low: float, high: float) -> float:
        return round(self.random.uniform(low, high), 3)

    def signed(self, low: float, high: float) -> float:
        return self.between(low, high) * self.random.choice((-1.0, 1.0))

    def system(self) -> Drawn:
        random = self.random
        n = random.choice((1, 2, 2, 3, 3, 3, 4, 4, 5, 6, 7, 8, 10))
        self._make_parts(n)
        styles = ("ring", "rings", "star", "chain", "random", "any")
        self._wire(random.choice(styles[:2] if self.tight else styles))
        self.ringed = _ringed(self.parts, self.wires)
        for fmu in {id(part.fmu): part.fmu for part in self.parts.values()}.values():
            self._compute(fmu)
        self._set()
        self._transform()
        step = random.choice((0.1, 0.05, 0.02, 0.125))
        slow = self.chance(0.1 if self.tight else 0.3)
        for part in self.parts.values():
            part.every = random.choice((1, 1, 2, 3)) if slow else 1
        start = random.choice((0.0, 0.0, 0.0, 3.0, 1.1, -2.5))
        steps = random.randint(3, 9) + (random.choice((0.0, 0.0, 0.5, 0.25)))
        stop = start + steps * step
        return Drawn(self.seed, self.parts, self.wires, step, start, stop, self.strong)

    def _make_parts(self, n: int) -> None:
        random = self.random
        kinds = ["Real"] * 6 + [POSITIVE, "Integer", "Boolean", "Enumeration", "String"]
        if self.tight or self.chance(0.35):
            kinds = ["Real"] if self.strong or self.chance(0.7) else ["Real", "Real", "Boolean"]
        quantity = random.choice(list(QUANTITIES))
        quantities = random.choice(([""], [quantity], ["", quantity], ["", *QUANTITIES]))
        if self.tight:
            quantities = quantities[:1]
        declared = random.choice(
            ((RIGHT,), (ABSENT,), (RIGHT, RIGHT, ABSENT, ALL), DECLARATIONS, DECLARATIONS)
        )
        fmus: list[Fmu] = []
        names = [f"c{i}" for i in range(n)]
        random.shuffle(names)
        for name in names:
            if fmus and self.chance(0.15):
                fmu = random.choice(fmus)
            else:
                fmu = self._fmu(f"f{len(fmus)}", kinds, quantities, random.choice(declared))
                fmus.append(fmu)
            self.parts[name] = Part(name, fmu)

    def _fmu(self, name: str, kinds: list[str], quantities: list[str], declares: str) -> Fmu:
        random = self.random
        variables = []
        for causality, letter, most in (
            ("input", "u", 3),
            ("output", "y", 3),
            ("parameter", "p", 2),
        ):
            for i in range(random.randint(causality != "parameter", most)):
                kind = random.choice(kinds if causality != "parameter" else ["Real", *kinds])
                quantity = random.choice(quantities) if kind == "Real" else ""
                unit = random.choice(QUANTITIES[quantity].units) if quantity else ""
                blank = Variable(f"{letter}{i}", causality, kind, None, quantity, unit)
                start = None if causality == "output" else self._value(blank)
                variables.append(Variable(blank.name, causality, kind, start, quantity, unit))
        capabilities = [
            attribute
            for attribute in ("providesDirectionalDerivative", "canInterpolateInputs")
            if self.chance(0.4)
        ]
        if self.chance(0.4):
            capabilities += ["canGetAndSetFMUstate", "canSerializeFMUstate"]
        if self.chance(0.3):
            random.shuffle(variables)
        return Fmu(
            name,
            variables,
            responds=self.chance(self.responding),
            declares=declares,
            capabilities=tuple(capabilities),
        )

    def _value(self, variable: Variable) -> Any:
        """A value for an input or a parameter."""
        random = self.random
        match variable.kind:
            case "Real":
                factor, offset = _scale(variable)
                return offset + factor * self.signed(0.05, 0.6)
            case "Positive":
                return self.between(0.6, 1.6)
            case "Boolean":
                # Rings of truth values begin with the value at which all of them rest.
                return variable.causality == "parameter" and self.chance(0.5)
            case "String":
                return random.choice(_TEXTS)
            case _:
                return 1 if variable.causality == "input" else random.randint(1, 4)

    def _wire(self, style: str) -> None:
        """Feed inputs from outputs; the style decides which outputs are near."""
        random = self.random
        names = list(self.parts)
        random.shuffle(names)
        place = {name: i for i, name in enumerate(names)}
        n = len(names)
        size = random.randint(2, max(2, n - 1))
        for name, part in self.parts.items():
            i = place[name]
            for variable in part.fmu.having("input"):
                if self.chance(0.12):
                    continue
                nearby = names
                match style:
                    case "chain":
                        nearby = names[max(i - 1, 0) : i]
                    case "star":
                        nearby = names[:1] if i else names[:0]
                    case "ring":
                        nearby = [names[i - 1]] if i else names[-1:]
                        if self.chance(0.15):
                            nearby = names
                    case "rings":
                        # Rings of some neighbours each, fed by the ring before them.
                        first = i - i % size
                        ring = names[first : first + size]
                        nearby = [ring[(i - first - 1) % len(ring)]]
                        if first and self.chance(0.3):
                            nearby = names[:first]
                        if self.chance(0.2):
                            nearby = ring
                    case "random":
                        nearby = names[:i]
                sources = [
                    (other, output)
                    for other in nearby
                    for output in self.parts[other].fmu.having("output")
                    if _fits(output, variable)
                ]
                if sources:
                    other, output = random.choice(sources)
                    self.wires.append(Wire((other, output.name), (name, variable.name)))

    def _compute(self, fmu: Fmu) -> None:
        """Formulas of states and outputs."""
        random = self.random
        in_ring = any(part.fmu is fmu and part.name in self.ringed for part in self.parts.values())
        for output in fmu.having("output"):
            how = self._now
            if not self.chance(self.feedthrough):
                how = random.choice((self._state, self._state, self._at_time))
            fmu.outputs[output.name] = how(fmu, output, in_ring)

    def _inputs(self, fmu: Fmu, *kinds: str) -> list[Variable]:
        return [variable for variable in fmu.having("input") if not kinds or variable.kind in kinds]

    def _some(self, found: list[Variable]) -> list[Variable]:
        if not found:
            return []
        return self.random.sample(found, self.random.randint(1, len(found)))

    def _gain(self, fmu: Fmu) -> Formula | None:
        """A parameter as a factor."""
        found = [variable for variable in fmu.having("parameter") if variable.kind == "Real"]
        return ("tanh", plain(self.random.choice(found))) if found and self.chance(0.3) else None

    def _weighted(self, fmu: Fmu, most: float) -> Formula:
        """A sum of inputs; no change of an input comes out greater than `most`."""
        chosen = self._some(self._inputs(fmu))
        terms: list[Formula] = [number(self.signed(0.1, 0.5))]
        for variable in chosen:
            term = times(self.signed(0.4, 1.0) * most / len(chosen), plain(variable))
            gain = self._gain(fmu)
            # A gain of zero would hide that there is a loop.
            terms.append(times(plus(number(0.7), times(0.3, gain)), term) if gain else term)
        return plus(*terms)

    def _state(self, fmu: Fmu, output: Variable, in_ring: bool) -> Formula:
        """An output that is a state."""
        random = self.random
        place = len(fmu.states)
        own: Formula = ("state", place)
        state = State(None)
        fmu.states.append(state)
        match output.kind:
            case "Real":
                state.start = self.signed(0.05, 0.6)
                pull = plus(self._weighted(fmu, 0.8), times(-self.between(0.3, 2.0), own))
                state.next = plus(own, times(("length",), pull))
                return in_unit(output, own)
            case "Positive":
                state.start = 1.0
                pull = plus(number(1.0), times(0.4, ("tanh", self._weighted(fmu, 0.8))))
                pull = ("-", pull, own)
                state.next = plus(own, times(("length",), pull))
                return own
            case "Boolean":
                state.start = False
                state.next = (">", self._weighted(fmu, 0.9), number(self.signed(0.01, 0.3)))
            case "String":
                state.start = random.choice(_TEXTS)
                inputs = self._inputs(fmu, "String")
                other: Formula = ("input", inputs[0].name) if inputs else ("text", "night")
                condition = (">", self._weighted(fmu, 0.9), number(self.signed(0.01, 0.3)))
                state.next = ("pick", condition, other, ("text", random.choice(_TEXTS)))
            case _:
                state.start = random.randint(1, 4)
                pushed = (">", self._weighted(fmu, 0.9), number(self.signed(0.01, 0.3)))
                more = ("pick", pushed, number(2.0), number(1.0))
                state.next = plus(("mod", plus(own, more), number(4.0)), number(1.0))
        return own

    def _at_time(self, fmu: Fmu, output: Variable, in_ring: bool) -> Formula:
        """An output that follows from the time, and parameters."""
        wave = ("sin", plus(times(self.between(0.5, 4.0), ("time",)), number(self.between(0, 3))))
        match output.kind:
            case "Real":
                gain = self._gain(fmu)
                return in_unit(output, times(plus(number(0.6), gain), wave) if gain else wave)
            case "Positive":
                return plus(number(1.25), times(0.7, wave))
            case "Boolean":
                return (">", wave, number(self.signed(0.01, 0.6)))
            case "String":
                return ("pick", (">", wave, number(0.137)), ("text", "fog"), ("text", "storm"))
        return plus(("floor", times(1.9, plus(wave, number(1.0)))), number(1.0))

    def _now(self, fmu: Fmu, output: Variable, in_ring: bool) -> Formula:
        """An output with feedthrough, if there are inputs for it."""
        random = self.random
        most = self.between(0.3, 0.85)
        kind = output.kind if self._inputs(fmu) else ""
        match kind:
            case "Real":
                return in_unit(output, self._real(fmu, most, in_ring))
            case "Positive":
                positive = self._inputs(fmu, POSITIVE)
                if not positive:
                    return plus(number(1.1), times(0.5, ("tanh", self._weighted(fmu, most))))
                u: Formula = ("input", random.choice(positive).name)
                return random.choice(
                    (
                        ("sqrt", u),
                        plus(number(0.7), ("/", number(0.25), u)),
                        plus(number(1.0), times(0.4, ("log", u))),
                    )
                )
            case "String" if not in_ring and (inputs := self._inputs(fmu, "String")):
                condition = (">", self._weighted(fmu, 0.9), number(self.signed(0.01, 0.3)))
                return ("pick", condition, ("input", inputs[0].name), ("text", "night"))
            case "Integer" | "Enumeration" if inputs := self._inputs(fmu, *_COUNTED):
                return ("max", ("input", inputs[0].name), number(float(random.randint(1, 3))))
        how = self._condition if kind == "Boolean" else self._at_time
        return how(fmu, output, in_ring)

    def _condition(self, fmu: Fmu, output: Variable, in_ring: bool) -> Formula:
        """A Boolean with feedthrough; in a ring it cannot become false by becoming true."""
        wave = self._at_time(fmu, output, in_ring)
        inputs = self._inputs(fmu, "Boolean")
        if inputs:
            leaf: Formula = ("input", self.random.choice(inputs).name)
            either: Formula = ("or", leaf, wave)
            return either if in_ring else self.random.choice((("not", leaf), either))
        if in_ring:
            return wave
        return (">", self._weighted(fmu, 1.5), number(self.signed(0.01, 0.3)))

    def _real(self, fmu: Fmu, most: float, in_ring: bool) -> Formula:
        random = self.random
        if self.strong and in_ring:
            return self._weighted(fmu, self.between(0.8, 4.0))
        smooth = self._weighted(fmu, most)
        choices: list[Formula] = [
            smooth,
            smooth,
            smooth,
            times(0.9, ("tanh", smooth)),
            times(1.1, ("sin", times(0.8, smooth))),
        ]
        if positive := self._inputs(fmu, POSITIVE):
            u: Formula = ("input", random.choice(positive).name)
            bent: Formula = random.choice((("log", u), ("sqrt", u), ("/", number(0.8), u)))
            choices += [times(0.3, bent), plus(times(0.3, bent), times(0.5, smooth))]
        if not in_ring:
            other = self._weighted(fmu, 0.9)
            choices += [
                times(smooth, other),
                ("pick", (">", smooth, number(0.0123)), smooth, other),
                ("max", smooth, other),
                ("/", smooth, plus(number(1.0), times(other, other))),
            ]
        return random.choice(choices)

    def _set(self) -> None:
        """Values of parameters and of inputs that nothing feeds."""
        fed = {wire.target for wire in self.wires}
        for name, part in self.parts.items():
            for variable in part.fmu.variables:
                if variable.causality == "output" or (name, variable.name) in fed:
                    continue
                if self.chance(0.5):
                    part.values[variable.name] = self._value(variable)
                    if self.chance(0.2):
                        part.hidden[variable.name] = self._value(variable)

    def _transform(self) -> None:
        """Transformations of connections."""
        share = self.random.choice((0.0, 0.2, 0.5))
        for wire in self.wires:
            source = self.parts[wire.source[0]].fmu.named(wire.source[1])
            target = self.parts[wire.target[0]].fmu.named(wire.target[1])
            inside = wire.source[0] in self.ringed and wire.target[0] in self.ringed
            if self.chance(share if source.type == "Real" or not share else 0.5):
                self._transformed(wire, source, target, inside)

    def _transformed(self, wire: Wire, source: Variable, target: Variable, inside: bool) -> None:
        random = self.random
        if source.kind == "Real" and target.kind == "Real":
            factor = self.signed(0.3, 0.95)
            one, zero = _scale(target)
            wire.linear = factor, one * self.signed(0.05, 0.2) + (1.0 - factor) * zero
        elif inside or source.kind != target.kind:
            return
        elif source.kind == "Boolean":
            wire.mapped = ((False, True), (True, random.choice((True, False))))
        elif source.kind in _COUNTED:
            keys = random.sample(range(1, 5), random.randint(1, 3))
            wire.mapped = tuple((key, random.randint(1, 4)) for key in keys)


def _fits(output: Variable, variable: Variable) -> bool:
    if variable.kind in _COUNTED:
        return output.kind in _COUNTED
    if variable.kind == "Real" and output.kind == "Integer":
        return not variable.unit
    return output.kind == variable.kind and output.quantity == variable.quantity


def reached(
    nodes: Iterable[Hashable], edges: Iterable[tuple[Hashable, Hashable]]
) -> dict[Any, set[Any]]:
    """The nodes that can be reached from each node along one edge or several."""
    after: dict[Any, set[Any]] = {node: set() for node in nodes}
    for a, b in edges:
        after[a].add(b)
    found: dict[Any, set[Any]] = {}
    for node in after:
        found[node], ahead = set(), [node]
        while ahead:
            new = after[ahead.pop()] - found[node]
            found[node] |= new
            ahead += new
    return found


def _ringed(parts: dict[str, Part], wires: list[Wire]) -> set[str]:
    """Components that reach themselves along connections."""
    found = reached(parts, ((wire.source[0], wire.target[0]) for wire in wires))
    return {name for name in parts if name in found[name]}


def draw(seed: int) -> Drawn:
    """The system of a seed."""
    return _Draw(seed).system()


# Writing


def _postfix(fmu: Fmu, formula: Formula) -> list[str]:
    operator, *operands = formula
    match operator:
        case "number" | "text":
            return [_word(operands[0])]
        case "input" | "parameter":
            return [f"${[variable.name for variable in fmu.variables].index(operands[0])}"]
        case "state":
            return [f"@{operands[0]}"]
        case "time" | "length":
            return ["t" if operator == "time" else "h"]
    return [word for operand in operands for word in _postfix(fmu, operand)] + [operator]


def _word(value: Any) -> str:
    return f"'{value}" if isinstance(value, str) else repr(float(value or 0.0))


def model_text(fmu: Fmu) -> str:
    """The formulas of an FMU, as its library reads them."""

    def counted(formula: Formula) -> str:
        words = _postfix(fmu, formula)
        return " ".join((str(len(words)), *words))

    lines = [f"{fmu.responds:d} {len(fmu.variables)}"]
    lines += [f"{variable.kind[0]} {_word(variable.start)}" for variable in fmu.variables]
    lines += [str(len(fmu.states))]
    lines += [f"{_word(state.start)} {counted(state.next)}" for state in fmu.states]
    lines += [str(len(fmu.outputs))]
    places = {variable.name: i for i, variable in enumerate(fmu.variables)}
    lines += [f"{places[name]} {counted(formula)}" for name, formula in fmu.outputs.items()]
    return "\n".join(lines) + "\n"


def _units(prefix: str = "") -> str:
    """Definitions of all units, as FMI and SSP have them."""
    return "".join(
        f'<{prefix}Unit name="{name}"><{prefix}BaseUnit {_BASES[unit.base]} '
        f'factor="{unit.factor!r}" offset="{unit.offset!r}"/></{prefix}Unit>'
        for name, unit in UNITS.items()
    )


def literal(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def description(fmu: Fmu) -> str:
    """Its modelDescription.xml."""
    variables = []
    for i, variable in enumerate(fmu.variables):
        inside = f' unit="{variable.unit}"' if variable.unit else ""
        if variable.kind == "Enumeration":
            inside = ' declaredType="Level"'
        start = None if variable.start is None else literal(variable.start)
        variables.append(
            small_fmus.variable(variable.name, i, variable.causality, variable.type, start, inside)
        )
    places = {variable.name: str(i) for i, variable in enumerate(fmu.variables, start=1)}
    inputs = [variable.name for variable in fmu.having("input")]

    def unknown(name: str) -> str:
        found = inputs if fmu.declares == ALL else sorted(fmu.needs(name), key=inputs.index)
        listed = " ".join(places[needed] for needed in found)
        return small_fmus.unknown(int(places[name]), None if fmu.declares == ABSENT else listed)

    unknowns = [
        unknown(variable.name) for variable in fmu.having("output") if fmu.declares != UNLISTED
    ]
    types = small_fmus.enumeration("Level", {name: i for i, name in enumerate(ITEMS, start=1)})
    return small_fmus.description(
        "slave",
        variables,
        unknowns,
        " ".join(
            f'{name}="true"'
            for name in ("canHandleVariableCommunicationStepSize", *fmu.capabilities)
        ),
        f"<UnitDefinitions>{_units()}</UnitDefinitions><TypeDefinitions>{types}</TypeDefinitions>",
    )


def write(drawn: Drawn, folder: Path) -> Path:
    """Write a system as an archive."""
    fmus = {part.fmu.name: part.fmu for part in drawn.parts.values()}
    for name, fmu in fmus.items():
        model = {"model.txt": model_text(fmu)}
        small_fmus.write(folder / f"{name}.fmu", description(fmu), _SOURCE, resources=model)
    random = Random(drawn.seed)
    files: dict[str, str | Path] = {
        f"resources/{name}.fmu": folder / f"{name}.fmu" for name in fmus
    }
    inner: list[str] = []
    outer: dict[str, str] = {}
    for part in drawn.parts.values():
        own = {}
        for name, value in part.values.items():
            text = _parameter(part.fmu.named(name), value)
            if name in part.hidden:
                own[name] = _parameter(part.fmu.named(name), part.hidden[name])
                outer[f"{part.name}.{name}"] = text
            else:
                own[name] = text
        bindings = archives.binding(own) if own else ""
        if own and random.random() < 0.5:
            file = f"parameters/{part.name}.ssv"
            files[file] = archives.parameter_set(own)
            bindings = archives.binding(source=file)
        hint = _hint(part.every * drawn.step) if part.every > 1 else ""
        fmu = f"resources/{part.fmu.name}.fmu"
        component = archives.component(
            part.name, fmu, bindings, type="application/x-fmu-sharedlibrary"
        )
        inner.append(component.replace("</ssd:Component>", f"{hint}</ssd:Component>"))
    wires = [
        archives.connection(*map(".".join, (wire.source, wire.target)), _inside(drawn, wire))
        for wire in drawn.wires
    ]
    random.shuffle(wires)
    bindings = archives.binding(outer) if outer else ""
    system = archives.system("".join(inner), "".join(wires), "", name="top", bindings=bindings)
    text = archives.described(system)
    # The units and items of these systems, in the place of those.
    items = "".join(
        f'<ssc:Item name="{name}" value="{i}"/>' for i, name in enumerate(ITEMS, start=1)
    )
    head, _, _ = text.partition("<ssd:Enumerations>")
    text = (
        f'{head}<ssd:Enumerations><ssc:Enumeration name="Level">{items}'
        f"</ssc:Enumeration></ssd:Enumerations><ssd:Units>{_units('ssc:')}</ssd:Units>"
        f'<ssd:DefaultExperiment startTime="{drawn.start_time!r}" stopTime="{drawn.stop_time!r}"/>'
        "</ssd:SystemStructureDescription>"
    )
    return archives.archive(folder / "system.ssp", text, files)


def _hint(step: float) -> str:
    return (
        '<ssd:Annotations><ssc:Annotation type="com.opensimulationplatform"><osp:StepSizeHint '
        'xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations" '
        f'value="{step!r}"/></ssc:Annotation></ssd:Annotations>'
    )


def _parameter(variable: Variable, value: Any) -> str:
    if variable.kind == "Enumeration":
        value = ITEMS[value - 1]
    return f'{variable.type} value="{literal(value)}"'


def _inside(drawn: Drawn, wire: Wire) -> str:
    """The transformation of a connection."""
    if wire.linear is not None:
        factor, offset = wire.linear
        return f'<ssc:LinearTransformation factor="{factor!r}" offset="{offset!r}"/>'
    if not wire.mapped:
        return ""
    name = drawn.parts[wire.source[0]].fmu.named(wire.source[1]).kind

    def word(value: Any) -> str:
        return ITEMS[value - 1] if name == "Enumeration" else literal(value)

    pairs = "".join(
        f'<ssc:MapEntry source="{word(a)}" target="{word(b)}"/>' for a, b in wire.mapped
    )
    return f"<ssc:{name}MappingTransformation>{pairs}</ssc:{name}MappingTransformation>"
