"""Random components: if `check` passes one, it can be built, and both kinds do the same.

Each is a script made from a seed, with ports, state and noise of any types and any of the hooks.
Every other one has a type exchanged, or another mistake, which is reported with its line. A script
that passes has valid descriptions, and both kinds take the same steps: parameters change during
the run, and from a restored state they continue as before it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from fmpy.validation import validate_fmu

from fmus import check
from fmus.kinds import KINDS
from support.own import built
from support.raw import Host, Library, Variable, instance

FLOAT, INT, BOOL, MODE, V3, M22, II, FF, BB, PAIR, EMPTY = (
    "float", "int", "bool", "Mode", "Annotated[Vector, 3]", "Annotated[Matrix, 2, 2]",
    "tuple[int, int]", "tuple[float, float]", "tuple[bool, bool]", "Pair", "Empty",
)  # fmt: skip

#: Template of a value of each type, and the accessors of its parts with their types.
PARTS: Mapping[str, tuple[str, Sequence[tuple[str, str]]]] = {
    V3: ("Vector(({}, {}, {}))", [(f"[{i}]", FLOAT) for i in range(3)]),
    M22: (
        "Matrix((({}, {}), ({}, {})))",
        [(f"[{i}, {k}]", FLOAT) for i in range(2) for k in range(2)],
    ),
    II: ("({}, {})", [("[0]", INT), ("[1]", INT)]),
    FF: ("({}, {})", [("[0]", FLOAT), ("[1]", FLOAT)]),
    BB: ("({}, {})", [("[0]", BOOL), ("[1]", BOOL)]),
    EMPTY: ("Empty()", ()),
    PAIR: ("Pair({}, {}, {})", [(".a", FLOAT), (".n", INT), (".on", BOOL)]),
}
TYPES = (FLOAT, INT, BOOL, MODE, *PARTS)

#: Expressions of each type.
RULES: Mapping[str, Sequence[str]] = {
    FLOAT: (
        "0.5 * {f} - 0.25 * {f}", "({f} if {b} else 0.5 * {f})", "{f} / (2.0 + abs({f}))",
        "1e305 * {f} * {f}", "white_noise({f})", "TABLE[{i} % 3]",
    ),
    INT: (
        "({i} % 1000 + 3 * ({i} % 1000)) % 997", "int({f} % 50.0)", "max({i} % 7, -2)",
        "min({i} % 5, int({b}))", "({m} + {i} % 9) % 100",
    ),
    BOOL: ("{f} < {f}", "not {b}", "{i} % 3 == {i} % 2", "{m} == Mode.LOW"),
    MODE: ("(Mode.HIGH if {b} else {m})", "Mode.LOW"),
}  # fmt: skip
LETTERS = {"f": FLOAT, "i": INT, "b": BOOL, "m": MODE}
CONSTANTS = {FLOAT: ("-0.0", "1.25"), INT: ("0", "-3"), BOOL: ("True",), MODE: ("Mode.OFF",)}

#: Types of the draws of `measured`, and the accessors of their numbers.
DRAWS = {
    FLOAT: ("n",),
    FF: ("n[0]", "n[1]"),
    V3: ("n[0]", "n[1]", "n[2]"),
    "tuple[tuple[float, float], float]": ("n[0][0]", "n[0][1]", "n[1]"),
    "Draws": ("n.a", "n.b[0]", "n.b[1]"),
}

#: A type in the annotation of an argument, a result or a field.
_TYPE = re.compile(
    r"(?<=[ \[])(float|int|bool|Mode|Pair|State|Inputs|Outputs|Derived|Parameters|None)"
    r"(?=[,\]):]| =)"
)

#: File and line of a mistake or an exception.
_PLACE = re.compile(r"\S+\.py:\d+: ")

#: Descriptions.
ABOUT = ("", "Plain", 'ü \\" \\\\ <&> 100 % {t:g} ??/ */', "'")

#: Messages of a restart.
MESSAGES = ("again at {t:g} s", "100 % at {t}", "{{t}} is {t:.3f} %d", "ü without a time")

#: Names of fields that C or the runtime has, too.
NAMES = ("double", "error", "state", "llabs", "math_errhandling", "x_u0302", "self", "made")

#: Modules of the bundle with functions outside the language; a user's own may have these names.
HELPERS = (("plant", "white_noise"), ("euler", "internal_steps"), ("closed_loop", "closed_loop"))

#: Changes that are refused, or mean the same in both kinds.
MISTAKES = (
    ("HIGH = 7", "HIGH = 2147483648"), ("HIGH = 7", "HIGH = 4294967303"),
    ("HIGH = 7", "HIGH = -5000000000"), ("] = 4\n", "] = True\n"), ("] = 4\n", "] = Mode.HIGH\n"),
    ("] = 0.25\n", "] = 1\n"), ('"double")', '"x")'), ('"double")', "'a\"b')"),
    ('"double")', '"back\\\\slash")'), ('"double")', '"two\\nlines")'),
    ('description="', 'description="\\x0b'), ('description="', 'description="two\\nlines'),
    ("Mode.LOW", "(Mode.LOW + 1) % 3"), ("Mode.OFF", "0"), ("] = 0\n", "] = False\n"),
    ("SAMPLED = True", "SAMPLED = 1"), ("{t:g}", "{t!r}"),
)  # fmt: skip

HEAD = '''\
"""A random component."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import Annotated, NamedTuple

from HELPER import white_noise

from auv_fmu import Matrix, Refusal, Variable, Vector

TABLE = tuple(map(float, Path(__file__).with_name("table.txt").read_text().split()))


class Mode(IntEnum):
    """An enumeration."""

    OFF = 0
    LOW = -2147483648
    HIGH = 7


class Pair(NamedTuple):
    """A record."""

    a: Annotated[float, Variable("m")] = 0.25
    n: Annotated[int, Variable()] = 4
    on: Annotated[bool, Variable()] = True


class Empty(NamedTuple):
    """Nothing."""


class Draws(NamedTuple):
    """Numbers for noise."""

    a: float
    b: Annotated[Vector, 2]


def _shown() -> str:
    """What no hook calls may be any Python."""
    with open(__file__) as file:
        return {"text": file.read()}["text"]


if __name__ == "__main__":
    print(*(line for line in _shown()))
'''

#: A module in the same folder.
HELPER = """\
def white_noise(x: float, limit: float = 2.0) -> float:
    assert x < 59.0, f"{x:g} is too large"
    while True:
        if x <= limit:
            return x
        x = x * 0.5
"""

#: Results of hooks, and types of their arguments.
RETURNS = {"start": "State", "update": "State", "derive": "Derived", "outputs": "Outputs"}
TAKEN = {
    "parameters": "Parameters", "inputs": "Inputs", "state": "State", "derived": "Derived",
    "t": FLOAT,
}  # fmt: skip

#: Names that something has, and their types.
Names = dict[str, str]


class Component:
    """A random component, from a seed."""

    def __init__(self, seed: int, rules: Mapping[str, Sequence[str]] = RULES) -> None:
        self._random, self._rules = Random(seed), rules

    def text(self) -> str:
        """The script."""
        draw = self._random
        odd = draw.sample(NAMES, len(NAMES))
        groups = {
            name: {
                odd.pop() if odd and draw.random() < 0.2 else f"{name[0].lower()}{i}": draw.choice(
                    TYPES
                )
                for i in range(draw.randint(1, 4))
            }
            for name in ("Parameters", "Inputs", "State", "Outputs", "Derived")
        }
        groups["Parameters"] = {"gain": FLOAT, **groups["Parameters"]}
        derives, restarts = draw.random() < 0.7, draw.random() < 0.5
        if not derives:
            del groups["Derived"]
        parts = [HEAD, *(self._class(name, fields) for name, fields in groups.items())]
        known = {name.lower(): names_of(name.lower(), fields) for name, fields in groups.items()}
        known |= {"t": {"t": FLOAT}, "h": {"h": FLOAT}}
        arguments = {
            "start": self._some("parameters", "inputs", "t"),
            "update": ["h", *known.keys() & {*TAKEN}],
            "outputs": self._some(*(known.keys() & {*TAKEN})),
        }
        if derives:
            arguments["derive"] = self._some("parameters", "state", "inputs", "t")
        if draw.random() < 0.3:
            parts += ["SAMPLED = True\n"]
            arguments["outputs"] = [*{*arguments["outputs"], "inputs"}]
        if draw.random() < 0.3:
            parts += ["H_MAX = 0.03\n"]
        for hook, taken in arguments.items():
            made = RETURNS[hook]
            names = {
                name: hint for argument in sorted(taken) for name, hint in known[argument].items()
            }
            signature = ", ".join(
                f"{argument}: {TAKEN.get(argument, FLOAT)}" for argument in sorted(taken)
            )
            result = self._made(made, groups[made], names)
            lines = [f"return {result}"]
            if draw.random() < 0.3:
                test, value = self._number(BOOL, names, 2), self._number(FLOAT, names)
                text = f"{{{value}:g}} is refused: {{{self._number(INT, names)}}} %"
                lines.insert(0, f"if {test} and {value} > 3.0:\n        raise Refusal(f'{text}')")
            parts += [function(f"{hook}({signature}) -> {made}:", lines)]
        if restarts:
            parts += self._restart(groups["State"], known["state"], known["inputs"])
        if draw.random() < 0.7:
            parts += self._noise(groups["Outputs"], known["parameters"])
        lines = ["if parameters.gain > 50.0:", "    raise Refusal('gain is large')"]
        parts += [function("check(parameters: Parameters) -> None:", lines)]
        return "\n\n".join(parts)

    def _some(self, *arguments: str) -> list[str]:
        """Some of the arguments that a hook may take."""
        return [argument for argument in sorted(arguments) if self._random.random() < 0.7]

    def _class(self, name: str, fields: Names) -> str:
        lines = [f"    {self._field(name, field, hint)}" for field, hint in fields.items()]
        return "\n".join([f"class {name}(NamedTuple):", f'    """{name}."""', "", *lines]) + "\n"

    def _field(self, name: str, field: str, hint: str) -> str:
        if name in ("State", "Derived"):
            return f"{field}: {hint}"
        draw, parts = self._random, [f'description="{self._random.choice(ABOUT)}"']
        if name == "Parameters" and (field == "gain" or draw.random() < 0.5):
            parts += ["tunable=True"]
        if name != "Outputs" and hint in (FLOAT, INT) and draw.random() < 0.5:
            parts += ["minimum=-1000", "maximum=1000"]
        if hint == V3 and draw.random() < 0.5:
            parts += ['members=("x", "v", "double")']
        note = f"Variable({', '.join(parts)})"
        inner = hint[len("Annotated[") : -1] if hint.startswith("Annotated") else hint
        kind = hint if hint in (PAIR, EMPTY) else f"Annotated[{inner}, {note}]"
        return f"{field}: {kind}" + ("" if name == "Outputs" else f" = {self._value(hint, {})}")

    def _restart(self, fields: Names, state: Names, inputs: Names) -> Iterator[str]:
        test = self._number(BOOL, state)
        yield f'RESTARTED = "{self._random.choice(MESSAGES)}"\n'
        yield function("credible(state: State) -> bool:", [f"return {test}"])
        made = self._made("State", fields, state | inputs)
        head = "restarted(state: State, inputs: Inputs) -> State:"
        yield function(head, [f"return {made}"])

    def _noise(self, fields: Names, parameters: Names) -> Iterator[str]:
        group, hint = self._random.choice([*fields.items()])
        drawn = self._random.choice([*DRAWS])
        names = names_of("", {group: hint}) | dict.fromkeys(DRAWS[drawn], FLOAT) | parameters
        yield function("seed() -> int:", [f"return {self._random.randint(-5, 5)}"])
        head = f"measured(parameters: Parameters, n: {drawn}, {group}: {hint}) -> {hint}:"
        yield function(head, [f"return {self._value(hint, names)}"])

    # Values

    def _made(self, name: str, fields: Names, names: Names) -> str:
        return f"{name}({', '.join(self._value(hint, names) for hint in fields.values())})"

    def _value(self, hint: str, names: Names) -> str:
        if hint not in PARTS:
            return self._number(hint, names)
        text, parts = PARTS[hint]
        return text.format(*(self._number(part, names) for _, part in parts))

    def _number(self, hint: str, names: Names, depth: int = 1) -> str:
        found = [name for name, kind in names.items() if kind == hint]
        if not names or not depth:
            return self._random.choice(found or CONSTANTS[hint])
        rule = self._random.choice(self._rules[hint])
        for letter, kind in LETTERS.items():
            while f"{{{letter}}}" in rule:
                rule = rule.replace(f"{{{letter}}}", self._number(kind, names, depth - 1), 1)
        return f"({rule})"


def names_of(owner: str, fields: Names) -> Names:
    """Expressions and types of all numbers in some fields."""
    found = {}
    for field, hint in fields.items():
        name = f"{owner}.{field}" if owner else field
        found |= {f"{name}{part}": kind for part, kind in PARTS.get(hint, ("", [("", hint)]))[1]}
    return found


def function(head: str, lines: Sequence[str]) -> str:
    """Text of a function."""
    return (
        "\n".join([f"def {head}", '    """A hook."""', *(f"    {line}" for line in lines)]) + "\n"
    )


def text_of(seed: int) -> str:
    """Script of a seed's component; an odd seed gives one with a mistake."""
    draw = Random(seed)
    module, function = draw.choice(HELPERS)
    text = Component(seed).text().replace("HELPER", module).replace("white_noise", function)
    if seed % 2:
        places = [(match.span(), "") for match in _TYPE.finditer(text, text.index("class Draws"))]
        if seed % 4 == 3:
            places = [
                (m.span(), new) for old, new in MISTAKES for m in re.finditer(re.escape(old), text)
            ]
        other = draw.choice((*TYPES, "State", "Inputs", "Outputs", "Parameters", "None", "str"))
        (start, end), new = draw.choice(places)
        text = text[:start] + (new or other) + text[end:]
    return text


def files_of(seed: int) -> Mapping[str, str]:
    """Texts of all files of a seed's component."""
    module, function = Random(seed).choice(HELPERS)
    return {
        f"random_{seed}.py": text_of(seed),
        f"{module}.py": HELPER.replace("white_noise", function),
        "table.txt": "0.25 -0.0 1e9\n",
    }


# Trials


def findings(seed: int) -> list[str]:
    """List the problems of the component of a seed."""
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = files_of(seed)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        (folder / "checked").mkdir()
        # Other tests import modules of these names.
        _forget(files)
        try:
            return [*filter(None, [_finding(folder / f"random_{seed}.py", folder, seed)])]
        finally:
            sys.path.remove(str(folder.resolve()))
            _forget(files)


def _forget(files: Iterable[str]) -> None:
    """Remove the modules of some files from the process."""
    for name in files:
        sys.modules.pop(name.removesuffix(".py"), None)


def _finding(script: Path, folder: Path, seed: int) -> str:
    mistakes = check.mistakes(script, folder / "checked")
    if mistakes:
        is_told = seed % 2 and all(map(_PLACE.match, mistakes))
        return "" if is_told else f"refused: {mistakes}"
    for fmu in (folder / "checked").glob("*.fmu"):
        if flaws := validate_fmu(str(fmu)):
            return f"{fmu.name}: {flaws}"
    return difference(script, folder, range(seed, seed + 6))


def difference(script: Path, folder: Path, plan: Sequence[int]) -> str:
    """The first difference of the two kinds, with a random step for each number of a plan."""
    traces = [_trace(Library(built(script, kind, folder / kind)), plan) for kind in KINDS]
    for place, (in_python, in_c) in enumerate(zip(*traces, strict=True)):
        if repr(in_python) != repr(in_c):
            return f"at {place}: Python {in_python}, C {in_c}"
    return ""


def _trace(library: Library, plan: Sequence[int]) -> list[Any]:
    """All values after each step, the second half twice, from the same state."""
    found: list[Any] = []
    with instance(library) as host:
        host.setup()
        _set(host, Random(plan[0]), ("input",))
        host.enter()
        host.exit()
        for seed in plan[1:]:
            _step(host, Random(seed), found.append)
            state = host.get_state()
            again: list[list[Any]] = [[], []]
            for answers in again:
                host.set_state(state)
                _step(host, Random(seed + 1), answers.append)
                _step(host, Random(seed + 2), answers.append)
            host.set_state(state)
            host.free_state(state)
            straight: list[Any] = []
            _step(host, Random(seed + 1), straight.append)
            found += [*straight, *again[0]]
            if repr(again[0]) != repr(again[1]) or repr(again[0][: len(straight)]) != repr(
                straight
            ):
                found.append(("not restored", library.description.kind))
        found += [(m.status, m.category, _PLACE.sub("", m.text)) for m in host.messages]
    return found


def _step(host: Host, draw: Random, note: Callable[[Any], None]) -> None:
    """Set inputs, and perhaps parameters, look at what follows them, and take a step."""
    _set(host, draw, ("input", "parameter") if draw.random() < 0.5 else ("input",))
    if draw.random() < 0.5:
        note(sorted(host.values().items()))
    note((host.step(draw.random(), draw.choice((0.02, 0.1))), sorted(host.values().items())))


def _set(host: Host, draw: Random, causalities: Sequence[str]) -> None:
    for variable in host.description.variables:
        if variable.causality in causalities and draw.random() < 0.7:
            host.set(variable.type, [variable.reference], [_value(variable, draw)])


def _value(variable: Variable, draw: Random) -> Any:
    return {
        "Real": draw.choice((-0.0, 0.5, 60.0, draw.uniform(-3.0, 3.0))),
        "Integer": draw.choice((0, 7, -(2**31), draw.randint(-100, 100))),
        "Boolean": draw.randint(0, 1),
        "String": draw.choice((b"low", b"high", b"middle")),
    }[variable.type]
