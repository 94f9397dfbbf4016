"""Random programs of the language of equations: in Python and in C they do the same.

Each program is a function of a few numbers, made from a seed, that returns all of its variables. It
is run in both languages with usual and with odd numbers. C may refuse an integer of more than 32
bits where Python goes on; else both give the same bits, or both raise.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from support.language import HEAD, TOO_LARGE, Answer, Twins, module_of, sizes_of

#: Programs in one module, and how often each is run.
BATCH, TRIALS = 100, 12

#: Options of a compiler that ends a process which does what C does not define.
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")

#: A module of ours that has a `white_noise`, too, which is outside the language.
MODULE = "plant"

#: What the programs of a module share.
_SHARED = """
class Mode(IntEnum):
    OFF = 0
    LOW = 1
    HIGH = 7
    LEAST = -2147483648


class Record(NamedTuple):
    x: float
    v: Annotated[Vector, 3]
    k: int = 3
    on: bool = True
    mode: Mode = Mode.LOW
    bias: float = -0.0


class Spare(NamedTuple):
    x: float


XS = Vector((-2.0, -0.5, 0.0, 1.0, 4.0))
YS = Vector((3.0, -1.0, -0.0, 0.5, 0.25))
A = Matrix(((2.0, -1.0, 0.5), (-0.0, 1.5, -0.25), (1.0, 0.0, 3.0)))
THREE = XS[2:]
TWO = Record(1.0, THREE), Record(-0.0, YS[:3], bias=0.0)
PRIMES = (2, 3, 5, 7)
TABLE = ((1, 50.0), (2, -0.5), (0, -0.0))
SIZE = 2


def _check(x: float, k: int) -> None:
    if x < 3.0:
        return
    for j in range(k % 3):
        if j > 0:
            return
    if k == 1:
        raise Refusal(f"{x:g} is refused")


def _both(v: Vector, x: float) -> tuple[Vector, float]:
    return x * v, v.sum()


def mixed(
    x: float, k: int = SIZE, gain: float = -0.0, on: bool = True, mode: Mode = Mode.LOW
) -> float:
    if on and x > 3.0:
        return gain
    for j in range(k % 4):
        if j > x:
            return j * gain
    return x * gain + mode


def white_noise(x: float, w: Annotated[Vector, 3] = THREE) -> float:
    while True:
        if x > 1.0:
            return max(x * a for a in w)
        elif isnan(x):
            break
        x = x * x + 1.0
    return -0.0


def turned(mode: Mode, x: float = -0.0) -> Mode:
    match mode:
        case Mode.OFF | Mode.LEAST:
            return Mode.LOW
        case Mode.HIGH if x > 0.0:
            return Mode.OFF
        case _:
            return mode


def spared(x: float) -> float:
    return Spare(x).x
"""

#: Names that loops and expressions share, and local functions have beside those around them.
_REUSED = ("a", "each", "one", "p")

#: Names of variables that C has, or that the translation gives to something else.
_ODD = (
    "double", "error", "register", "llabs", "math_errhandling", "DIV", "PLACE", "elements", "Spare",
    "Record_Record", "Spare_double", "plant_XS", "plant_mixed", "Mode_LOW", "x\u0302", "x_u0302",
)  # fmt: skip

FLOAT, INT, BOOL, V3, V2, M33, M23, RECORD, MODE, PAIR = (
    "float", "int", "bool", "Annotated[Vector, 3]", "Annotated[Vector, 2]",
    "Annotated[Matrix, 3, 3]", "Annotated[Matrix, 2, 3]", "Record", "Mode", "tuple[Record, Record]",
)  # fmt: skip
TYPES = (FLOAT, INT, BOOL, V3, V2, M33, M23, RECORD, MODE, PAIR)

#: The letters that stand for an expression of a type, and for a variable of one.
LETTERS = dict(zip("FIBVWMNREP", TYPES, strict=True))
NAMES = {"$v": V3, "$r": RECORD}

#: What an expression of a type can be. The first is one that needs no other. A letter after `~` is
#: computed in some cases only: what `^` is before is refused there, for it needs a name.
GRAMMAR = {
    FLOAT: "0.0 | -0.0 | 1.0 | 0.5 | 2.0 | -3.25 | 1e-9 | 1e300 | inf | pi | 1e-310",
    INT: "0 | 1 | 2 | 7 | -5 | 2147483647 | -2147483647",
    BOOL: "True | False",
    V3: "XS[1:4]",
    V2: "YS[:2]",
    M33: "A",
    M23: "Matrix((XS[:3], YS[1:4]))",
    RECORD: "TWO[1]",
    MODE: "Mode.OFF | Mode.LOW | Mode.HIGH | Mode.LEAST",
    PAIR: "TWO",
}
DEEPER = {
    FLOAT: """
        (F + F) | (F - F) | F * F | (F / F) | -F | (F % F) | (F // F) | (~F if B else ~F) | (F + 2)
        | (3 - F) | (I * F) | (I / I) | float(I) | V[0] | V[-1] | V[I % 4] | (V @ XS[1:4]) | V.sum()
        | max(V) | min(F, F, 1.0) | max(F, F) | M[I % 3, 1] | N[1, -1] | interpolate(F, XS, YS)
        | atan2(F, F) | copysign(F, F) | fmod(F, F) | pow(F, F) | abs(F) | fabs(F) | sin(F) | cos(F)
        | tan(F) | atan(F) | tanh(F) | exp(F) | expm1(F) | sqrt(F) | log(F) | log1p(F) | log2(F)
        | log10(F) | asin(F) | acos(F) | sinh(F) | cosh(F) | asinh(F) | acosh(F) | atanh(F)
        | degrees(F) | radians(F) | R.x | 0.5 | inf
        | (F**2) | (F**-1) | (F**SIZE) | (F**3.0) | (I**-2)
        | (F, F)[I % 2] | (F, F)[SIZE - 2] | Record(F, V).x | _both(V, F)[1]
        | (+F) | max(each * F for each in V) | min(F - a for a in W) | max(k * F for k in range(3))
        | max(abs(x - F) for x in reversed(V)) | min(x * x_in for x, x_in in zip(V, XS))
        | mixed(F) | mixed(F, I, gain=F) | mixed(on=B, x=F, mode=E) | white_noise(w=V, x=F)
        | white_noise(F) | spared(F) | P[I % 2].x | P[-1].bias | ((~F, ~F) if B else (~F, -0.0))[1]
        | ((F, V), (F, V))[I % 2][0] | (~R if R.on else ~R).x | (R, R)[SIZE - 1].v[I % 3] | (E * F)
        | ((~V if (F, F)[0] > F else XS[1:4]) @ V)
    """,
    INT: """
        (I + I) | (I - I) | I * I | (I // I) | (I % I) | abs(I) | min(I, I) | max(I, I, 2) | -I | 5
        | (~I if B else ~I) | int(F) | round(F) | floor(F) | ceil(F) | PRIMES[I % 4] | len($v)
        | int(B)
        | int(Mode.HIGH) | (I + Mode.LOW) | R.k | (I**2) | ((I % 7)**3) | (I**0) | PRIMES[SIZE]
        | (+I) | sum(k * I for k in range(3)) | sum(a > F for a in V) | sum(B for _ in PRIMES)
        | sum(1 for a in V if a > F and ~B) | sum(k for k in PRIMES if k > I)
        | sum(~I for k, a in enumerate(W) if k * a > F) | max(k * I for k in PRIMES)
        | min(k - I for k in range(SIZE + 1)) | int(E) | (E + I) | P[I % 2].k | len(PRIMES)
        | (I, I)[SIZE - 1] | (2147483647 - I) | (-2147483647 - I)
    """,
    BOOL: """
        (F < F) | (F <= I) | (I > F) | (I >= I) | (F == F) | (I != I) | (B and ~B) | (B or ~B)
        | (not B) | isnan(F) | isfinite(F) | bool(F) | bool(I) | (R.mode == Mode.LOW) | R.on
        | any(a > F for a in V) | all(a <= F for a in W) | any(k > ~I for k in PRIMES if B)
        | all(1.0 / x > ~F for x in V if x != F) | any(all(a < each for a in W) for each in V)
        | (F < F <= ~F) | (F < F / F < ~F) | (I <= I + 1 < ~F) | (F != max(F, F) > ~F)
        | (I < V[I % 3] < ~I) | (E == Mode.LOW) | (E == E) | (E < I) | (E != E) | (B == B)
        | (~P if B else ~P)[0].on
    """,
    V3: """
        (V + V) | (V - V) | (F * V) | (V * F) | (V / F) | (-V) | (V * 2) | (A @ V) | (M @ V)
        | V.replaced(I % 4, F) | Vector((F, F, I)) | (N.T @ W) | solve(A, V) | M[I % 3] | R.v
        | Vector(each * F for each in V) | Vector(F + each for each in range(3))
        | Vector(one - other for one, other in zip(V, XS)) | Vector(x * F for x in V)
        | Vector(x_in - F for x_in in V) | Vector(F + k for k in range(SIZE + 1))
        | XS[SIZE - 1 : SIZE + 2]
        | Vector([F, I, F]) | (Vector((~F, ~F, ~F)) if Vector((F, F))[0] > F else ~V)
        | _both(V, F)[0]
        | Vector(k * x for k, x in zip(range(3, -9, -SIZE), V))
        | Vector((F,) * 3) | Vector([F] * (SIZE + 1)) | Vector((-0.0,) * 3) | P[I % 2].v
        | ^Vector((F, *W)) | ^Vector((*(-V)[1:], F)) | ^Vector([*(W + YS[3:]), F])
        | ^Vector((*V[:1], *W))
        | Vector(x for x in reversed(V)) | Vector(k * x for k, x in enumerate(V, 1))
        | Vector(k - F for k in reversed(range(SIZE + 1)))
        | Vector(Vector(x * x_in for x_in in V).sum() - x for x in V)
        | Vector(x_in * max(x * x_in for x in W) for x_in in V)
        | Vector(~F if any(a > each for a in W) else each for each in V)
    """,
    V2: """
        Vector((F, F)) | $v[1:] | (N @ V) | (W + YS[3:]) | Vector(a + k for k, a in enumerate(W))
        | YS[:SIZE] | Vector(x * F for x in W) | Vector((F,) * SIZE)
        | Vector(row.sum() for row in N)
    """,
    M33: """
        (M @ M) | (M + A) | (M - A.T) | M.T | (-M) | (F * M) | (M / F) | (N.T @ N)
        | M.replaced(I % 3, V) | Matrix((p + q * F for q in range(3)) for p in range(3))
        | Matrix((x * x_in + F for x_in in V) for x in V) | Matrix((x - F for x in V) for x in V)
        | Matrix([V, (F, 0.0, 1.0), [1.0, F, I]]) | (Matrix((~V, ~V, ~V)) if B else ~M)
        | Matrix((x * x_in for x in V) for x_in in V) | Matrix(x * V for x in V)
        | Matrix((x * min(x - x_in for x in W) for x_in in V) for x in V)
    """,
    M23: "Matrix((V, V)) | (N @ A) | Matrix(((1.0, F, 0.0), (2.0, 0.5, I)))",
    RECORD: """
        Record(F, V, on=B) | Record(v=V, x=F, k=I) | $r._replace(x=F, mode=Mode.HIGH)
        | (Record(~F, ~V) if B else ~R) | (~R if Record(F, V).x > F else Record(~F, ~V, ~I, ~B))
        | Record(F, (~V if (F, F)[0] > F else XS[:3]), on=(~B if B else $r.on))
        | ^Record(*(F, V), k=I) | ^Record(F, *(V, I), bias=F) | $r._replace(v=V, mode=E) | P[I % 2]
        | (~P if B else ~P)[SIZE - 1] | (R, R)[I % 2] | Record(*$r)
        | Record(F, V, int(E), B, turned(E))
    """,
    MODE: """
        R.mode | Mode(I) | Mode((0, 1, 7)[I % 3]) | (~E if B else ~E) | turned(E) | turned(E, F)
        | turned(x=F, mode=E) | (E, E)[I % 2]
        | P[I % 2].mode
    """,
    PAIR: "(R, R) | (~P if B else ~P) | (R, P[1]) | (P[I % 2], $r._replace(x=F)) | (P[1], P[0])",
}

#: Loops and the types of their variables, `#` with endings. The last may have no turns.
LOOPS = {
    "# in range(3)": "I",
    "# in range(1, 4)": "I",
    "# in range(4, 0, -1)": "I",
    "# in range(0, 7, 3)": "I",
    "# in range(SIZE + 1)": "I",
    "# in range(len(XS) - 3)": "I",
    "# in range(SIZE**2, -1, -SIZE)": "I",
    "# in range(2147483645, 2147483647)": "I",
    "# in reversed(range(SIZE + 1))": "I",
    "# in PRIMES": "I",
    "# in V": "F",
    "# in reversed(V)": "F",
    "# in M": "V",
    "# in P": "R",
    "# in (E, E)": "E",
    "_ in range(2)": "",
    "#, #_b in zip(XS, V)": "FF",
    "#, #_b in zip(range(9, SIZE, -3), V)": "IF",
    "#_k, # in enumerate(V)": "IF",
    "#_k, # in enumerate(W, 1)": "IF",
    "#_k, (#, #_b) in enumerate(zip(V, XS))": "IFF",
    "# in range(I % 4)": "I",
}

#: Assignments of more than one name, and their types.
ASSIGNMENTS = {
    "# = #_b = F": "FF",
    "# = #_b = #_c = I": "III",
    "# = #_b = R": "RR",
    "# = #_b = V": "VV",
    "#, _, #_b = V": "FF",
    "#, #_b = W": "FF",
    "#, #_b = P": "RR",
    "#, #_b, #_c = M": "VVV",
    "(#, #_b), #_c = (F, I), B": "FIB",
    "#, #_b = _both(V, F)": "VF",
    "#, #_b = (E, F)": "EF",
    "# = (#_b, #_c) = W": "WFF",
}

#: What a value may be compared with, one after the other.
CASES = {
    INT: "0 | 1 OR 2 | 7 | -5 | 3 OR -2147483647",
    MODE: "Mode.OFF | Mode.LOW OR Mode.HIGH | Mode.HIGH | Mode.LEAST",
}

#: What is said of an assertion that does not hold.
TEXTS = ("", ', "100 % {no}"', ', f"{~F:g} and {{{~I}}} at {~F:.2f} %"')

Variables = dict[str, str]


class Program:
    """One program on its way, from a seed."""

    def __init__(self, name: str, seed: int) -> None:
        self._random = Random(seed)
        self._name, self._count = name, 0
        self._lines: list[str] = []
        self._open: set[str] = set()
        self._odd = self._random.sample(_ODD, len(_ODD))
        #: Lines that return, and what has a value there.
        self._returns: dict[int, Variables] = {}

    def text(self) -> str:
        """The function."""
        arguments: Variables = {
            "x": FLOAT,
            "x_in": FLOAT,
            "k": INT,
            "on": BOOL,
            "v": V3,
            "r": RECORD,
        }
        variables = dict(arguments)
        self._block(variables, "    ", self._random.randint(3, 6), depth=0)
        self._return(variables, "    ")
        for line, known in self._returns.items():
            values = (n if n in known else _simple(hint) for n, hint in variables.items())
            self._lines[line] += f" ({', '.join(values)},)"
        hints = ", ".join(variables.values())
        given = ", ".join(f"{name}: {hint}" for name, hint in arguments.items())
        head = f"def {self._name}({given}) -> tuple[{hints}]:"
        return "\n".join([head, *self._lines]) + "\n"

    def _new(self, hint: str) -> str:
        self._count += 1
        if self._odd and self._random.random() < 0.1:
            return self._odd.pop()
        return f"{hint.strip('AnotedVcrMix[], ')[:1] or 'a'}_{self._count}"

    def _add(self, indent: str, line: str) -> None:
        self._lines.append(indent + line)

    # Statements

    def _block(self, known: Variables, indent: str, n: int, depth: int, loop: bool = False) -> None:
        self._add(indent, "pass")
        for _ in range(n):
            choices = [self._assign, self._assign, self._change, self._swap, self._table]
            choices += [self._several, self._several]
            choices += [self._call] * (self._random.random() < 0.3)
            if depth < 3:
                choices += [self._if, self._for, self._while, self._local]
            if depth < 2:
                choices += [self._match, self._forever]
            self._random.choice(choices)(known, indent, depth)
            if loop and self._random.random() < 0.1:
                self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
                self._add(indent, f"    {self._random.choice(('break', 'continue'))}")
        if self._random.random() < 0.03:
            self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
            value = self._expression(FLOAT, known, 1)
            self._add(indent, f'    raise Refusal(f"no {{{value}:g}} here")')
        if self._random.random() < 0.03:
            text = self._filled(self._random.choice(TEXTS), known, 1)
            self._add(indent, f"assert {self._expression(BOOL, known, 1)}{text}")
        if self._random.random() < 0.06:
            self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
            self._return(known, f"{indent}    ")

    def _return(self, known: Variables, indent: str) -> None:
        """Return all variables; what has no value here, as something simple."""
        self._returns[len(self._lines)] = dict(known)
        self._add(indent, "return")

    def _assign(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice(TYPES)
        value, name = self._expression(hint, known, self._random.randint(1, 3)), self._new(hint)
        said = f": {hint}" * (self._random.random() < 0.1)
        self._add(indent, f"{name}{said} = {value}")
        known[name] = hint

    def _several(self, known: Variables, indent: str, depth: int) -> None:
        head, letters = self._random.choice([*ASSIGNMENTS.items()])
        left, _, right = head.rpartition(" = ")
        value, found = self._filled(right, known, 2), self._named(left, letters, self._new(FLOAT))
        self._add(indent, f"{found[0]} = {value}")
        known |= found[1]

    @staticmethod
    def _named(head: str, letters: str, name: str) -> tuple[str, Variables]:
        """Targets with a name for `#`, and their types."""
        names = re.findall(r"#\w*", head)
        hints = (LETTERS[letter] for letter in letters)
        types = {n.replace("#", name): hint for n, hint in zip(names, hints, strict=True)}
        return head.replace("#", name), types

    def _change(self, known: Variables, indent: str, depth: int) -> None:
        name = self._random.choice([n for n, hint in known.items() if hint in (FLOAT, INT, V3)])
        sign = self._random.choice("+-" if known[name] != FLOAT else "+-*/")
        value = self._expression(known[name], known, 2)
        self._add(indent, f"{name} {sign}= {value}")

    def _swap(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice((FLOAT, INT, V3, RECORD))
        names = [name for name, h in known.items() if h == hint]
        one, other = self._random.choice(names), self._random.choice(names)
        if one != other:
            self._add(indent, f"{one}, {other} = {other}, {self._expression(hint, known, 2)}")

    def _table(self, known: Variables, indent: str, depth: int) -> None:
        """Take a row apart whose place is given a value by it."""
        mode, value = ([n for n, h in known.items() if h == hint] for hint in (INT, FLOAT))
        one, other = self._random.choice(mode), self._random.choice(value)
        place = self._random.choice((one, f"({one} + int({other} > 0.0))"))
        self._add(indent, f"{one}, {other} = TABLE[{place} % 3]")

    def _call(self, known: Variables, indent: str, depth: int) -> None:
        given = ", ".join(self._expression(hint, known, 1) for hint in (FLOAT, INT))
        self._add(indent, f"_check({given})")

    def _if(self, known: Variables, indent: str, depth: int) -> None:
        self._add(indent, f"if {self._expression(BOOL, known, 2)}:")
        for word in ("", "elif", "else"):
            if word == "elif" and self._random.random() < 0.6:
                continue
            if word:
                test = f" {self._filled('~B', known, 2)}" if word == "elif" else ""
                self._add(indent, f"{word}{test}:")
            self._branch(known, indent, depth)
        # What every branch that goes on has given a value has one after it.
        hint = self._random.choice((FLOAT, INT, MODE, RECORD))
        name = self._new(hint)
        if self._random.random() < 0.5:
            self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
            self._add(indent, f"    {name} = {self._expression(hint, known, 1)}")
            self._add(indent, "else:")
            if self._random.random() < 0.3:
                self._return(known, f"{indent}    ")
            else:
                self._add(indent, f"    {name} = {self._expression(hint, known, 1)}")
            known[name] = hint

    def _branch(self, known: Variables, indent: str, depth: int) -> None:
        self._block(dict(known), f"{indent}    ", self._random.randint(1, 2), depth + 1)

    def _match(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice((INT, MODE))
        cases = CASES[hint].split("|")
        self._add(indent, f"match {self._expression(hint, known, 2)}:")
        chosen = self._random.sample(cases, self._random.randint(1, 3))
        is_complete = self._random.random() < 0.7
        kind = self._random.choice((FLOAT, INT))
        name = self._new(kind)
        for case in [*chosen, *["_"] * is_complete]:
            can_be_guarded = case != "_" and self._random.random() < 0.3
            guard = f" if {self._filled('~B', known, 1)}" if can_be_guarded else ""
            self._add(indent, f"    case {case.strip().replace('OR', '|')}{guard}:")
            self._branch(known, f"{indent}    ", depth)
            if case != "_" and self._random.random() < 0.1:
                self._return(known, f"{indent}        ")
            else:
                self._add(indent, f"        {name} = {self._expression(kind, known, 1)}")
        if is_complete:
            known[name] = kind

    def _for(self, known: Variables, indent: str, depth: int) -> None:
        head, letters = self._random.choice([*LOOPS.items()])
        hint = LETTERS[letters[-1]] if letters else FLOAT
        name, is_new = self._new(hint), True
        free = [one for one in _REUSED if one not in self._open and one not in known]
        if free and self._random.random() < 0.5:
            name, is_new = self._random.choice(free), False
        if len(letters) == 1 and self._random.random() < 0.3:
            # It has a value already, which is lost.
            name = self._random.choice([n for n, h in known.items() if h == hint] or [name])
        targets, _, values = head.partition(" in ")
        targets, own = self._named(targets, letters, name)
        self._add(indent, f"for {targets} in {self._filled(values, known, 1)}:")
        was_open = name in self._open
        self._open.add(name)
        self._loop_body(known | own, indent, depth)
        if not was_open:
            self._open.remove(name)
        if is_new and head != [*LOOPS][-1]:
            known |= own

    def _while(self, known: Variables, indent: str, depth: int) -> None:
        name = self._new(INT)
        self._add(indent, f"{name} = {self._random.randint(1, 4)}")
        known[name] = INT
        test = self._filled("~B", known, 1)
        self._add(indent, f"while {name} > 0 and {test}:")
        self._add(indent, f"    {name} -= 1")
        inside = {n: hint for n, hint in known.items() if n != name}
        self._loop_body(inside, indent, depth)

    def _forever(self, known: Variables, indent: str, depth: int) -> None:
        """A loop that only ends from within."""
        name, hint = self._new(INT), self._random.choice((FLOAT, V3))
        last = self._new(hint)
        self._add(indent, f"{name}, {last} = 0, {self._expression(hint, known, 1)}")
        self._add(indent, "while True:")
        self._add(indent, f"    {name} += 1")
        self._add(indent, f"    {last} = {self._expression(hint, known, 1)}")
        self._add(indent, f"    if {name} > 3 or {self._filled('~B', known, 1)}:")
        if self._random.random() < 0.2:
            self._return(known | {last: hint}, f"{indent}        ")
            self._add(indent, f"    if {name} > 2:")
        self._add(indent, "        break")
        self._loop_body(known | {last: hint}, indent, depth)
        known[last] = hint

    def _loop_body(self, inside: Variables, indent: str, depth: int) -> None:
        self._block(dict(inside), f"{indent}    ", self._random.randint(1, 2), depth + 1, loop=True)

    def _local(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice((FLOAT, INT, V3, RECORD))
        name = self._new(hint)
        needed: Variables = {"p": FLOAT, "n": INT, "v": V3, "r": RECORD}
        others: Variables = {"gain": FLOAT, "size": INT, "mode": MODE, "w": V3}
        defaults = dict(zip(others, ("-0.0", "SIZE", "Mode.HIGH", "THREE"), strict=True))
        own = needed | others
        head = ", ".join(
            f"{argument}: {kind}" + (f" = {defaults[argument]}" if argument in others else "")
            for argument, kind in own.items()
        )
        # It captures one name, and has others that are around it, too.
        captured, shadow = f"{name}_c", self._random.choice([n for n in known if n not in own])
        self._add(indent, f"{captured} = {self._expression(FLOAT, known, 1)}")
        self._add(indent, f"def {name}_f({head}) -> {hint}:")
        own |= {captured: FLOAT}
        self._add(indent, f"    {shadow} = {self._expression(FLOAT, own, 2)}")
        own |= {shadow: FLOAT}
        self._add(indent, f"    for each in v:\n{indent}        {shadow} += each * p")
        if self._random.random() < 0.5:
            self._add(indent, f"        if {self._expression(BOOL, own, 1)}:")
            self._add(indent, f"            return {self._expression(hint, own, 1)}")
        self._add(indent, f"    return {self._expression(hint, own, 2)}")
        given = [self._expression(kind, known, 1) for kind in needed.values()]
        n = self._random.randint(0, len(needed))
        named = dict(zip([*needed][n:], given[n:], strict=True))
        for argument, kind in others.items():
            if self._random.random() < 0.4:
                named[argument] = self._expression(kind, known, 1)
        last = [f"{argument}={named[argument]}" for argument in self._shuffled(named)]
        self._add(indent, f"{name} = {name}_f({', '.join([*given[:n], *last])})")
        known[name] = hint

    def _shuffled(self, names: Iterable[str]) -> list[str]:
        found = [*names]
        return self._random.sample(found, len(found))

    # Expressions

    def _expression(self, hint: str, known: Variables, depth: int, always: bool = True) -> str:
        names = [name for name, h in known.items() if h == hint]
        if names and (depth <= 0 or self._random.random() < 0.25):
            return self._random.choice(names)
        choices = (DEEPER if depth > 0 else GRAMMAR)[hint].split("|")
        free = [choice.strip() for choice in choices if always or "^" not in choice]
        return self._filled(self._random.choice(free).strip("^"), known, depth - 1, always)

    def _filled(self, text: str, known: Variables, depth: int, always: bool = True) -> str:
        """A text with expressions for its letters, in which its own names mean something else."""
        own = {
            name for names in re.findall(r"\bfor (.+?) in\b", text) for name in names.split(", ")
        }
        free = {name: hint for name, hint in known.items() if name not in own - _FLOATS}
        parts = re.split(r"(\$\w|~?\b[A-Z]\b)", text)
        return "".join(self._part(part, free, depth, always) for part in parts)

    def _part(self, part: str, known: Variables, depth: int, always: bool) -> str:
        if part in NAMES:
            return self._random.choice([n for n, hint in known.items() if hint == NAMES[part]])
        if (letter := part.strip("~")) in LETTERS:
            return self._expression(LETTERS[letter], known, depth, always and letter == part)
        return part


#: Arguments whose names expressions have for the elements of a vector: these are floats, too.
_FLOATS = {"x", "x_in"}


def _simple(hint: str) -> str:
    return GRAMMAR[hint].split("|")[0].strip()


class Finding(NamedTuple):
    """A program that does not do the same in both languages."""

    seed: int
    given: Sequence[float]
    python: Answer
    c: Answer


def numbers_for(random: Random, types: Sequence[object]) -> list[float]:
    """Arguments, usual and odd ones."""
    odd = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 1e308, -1e308, 5e-324, 1e-160, 1e9)
    found: list[float] = []
    for shape in types:
        word = getattr(shape, "word", "")
        if word == "a float":
            found.append(random.choice(odd) if random.random() < 0.2 else random.uniform(-4.0, 4.0))
        elif word == "a bool":
            found.append(random.randint(0, 1))
        elif made := getattr(shape, "made", None):
            found.append(random.choice([*made]))
        else:
            edge = random.choice((2**31 - 1, -(2**31), 46_341, random.randint(-70_000, 70_000)))
            found.append(edge if random.random() < 0.15 else random.randint(-1, 3))
    return found


def same(python: Answer, c: Answer) -> bool:
    """Whether both answers are one."""
    if c.error == TOO_LARGE:
        return True
    return python.bits == c.bits and bool(python.error) == bool(c.error)


def tried(seeds: Sequence[int], command: Sequence[str]) -> Iterator[Finding]:
    """Findings among the programs of some seeds."""
    texts = [Program(f"program_{seed}", seed).text() for seed in seeds]
    with tempfile.TemporaryDirectory() as folder:
        module = module_of("\n\n".join([HEAD + _SHARED, *texts]), Path(folder), MODULE)
        twins = Twins(module, Path(folder), command)
        for seed in seeds:
            name, random = f"program_{seed}", Random(seed)
            for _ in range(TRIALS):
                given = numbers_for(random, sizes_of(twins.functions[name]))
                c = twins.c(name, given)
                if c.error == TOO_LARGE:
                    continue  # Python's integers grow without end, and take their time
                python = twins.python(name, given)
                if not same(python, c):
                    yield Finding(seed, given, python, c)
                    break


def findings(seed: int) -> list[str]:
    """Findings among a hundred programs."""
    return [str(one) for one in tried(range(seed * BATCH, (seed + 1) * BATCH), ("cc", "-O2"))]
