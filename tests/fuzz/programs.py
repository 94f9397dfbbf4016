"""Random programs of the language of equations: in Python and in C they do the same.

    PYTHONPATH=tests python -m fuzz.programs --runs 10000

Each program is a function of a few numbers, made from a seed, that returns all of its variables. It
is run in both languages with usual and with odd numbers. C may refuse an integer of more than 32
bits where Python goes on; else both give the same bits, or both raise.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from support.hosts import sanitizers
from support.language import HEAD, TOO_LARGE, Answer, Twins, module_of, sizes_of

#: Programs in one module, and how often each is run.
BATCH, TRIALS = 100, 12

#: Options of a compiler that ends a process which does what C does not define.
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")

#: What the programs of a module share.
_SHARED = '''
class Mode(IntEnum):
    """An enumeration."""

    OFF = 0
    LOW = 1
    HIGH = 7


class Record(NamedTuple):
    """A record."""

    x: float
    v: Annotated[Vector, 3]
    k: int = 3
    on: bool = True
    mode: Mode = Mode.LOW


XS = Vector((-2.0, -0.5, 0.0, 1.0, 4.0))
YS = Vector((3.0, -1.0, 0.0, 0.5, 0.25))
A = Matrix(((2.0, -1.0, 0.5), (0.0, 1.5, -0.25), (1.0, 0.0, 3.0)))
PRIMES = (2, 3, 5, 7)
TABLE = ((1, 50.0), (2, -0.5), (0, 1e3))
SIZE = 2


def _check(x: float, k: int) -> None:
    """Refuse some numbers, and return early from others."""
    if x < 3.0:
        return
    for j in range(k % 3):
        if j > 0:
            return
    if k == 1:
        raise Refusal(f"{x:g} is refused")


def _both(v: Vector, x: float) -> tuple[Vector, float]:
    """A result of any size."""
    return x * v, v.sum()
'''

#: Names that loops and expressions share, and local functions have beside those around them.
_REUSED = ("a", "each", "one", "p")

FLOAT, INT, BOOL, V3, V2, M33, M23, RECORD = (
    "float", "int", "bool", "Annotated[Vector, 3]", "Annotated[Vector, 2]",
    "Annotated[Matrix, 3, 3]", "Annotated[Matrix, 2, 3]", "Record",
)  # fmt: skip
TYPES = (FLOAT, INT, BOOL, V3, V2, M33, M23, RECORD)

#: The letters that stand for an expression of a type, and for a variable of one.
LETTERS = dict(zip("FIBVWMNR", TYPES, strict=True))
NAMES = {"$v": V3, "$r": RECORD}

#: What an expression of a type can be. The first is one that needs no other.
GRAMMAR = {
    FLOAT: "0.0 | -0.0 | 1.0 | 0.5 | 2.0 | -3.25 | 1e-9 | 1e300 | inf | pi | 1e-310",
    INT: "0 | 1 | 2 | 7 | -5",
    BOOL: "True | False",
    V3: "XS[1:4]",
    V2: "YS[:2]",
    M33: "A",
    M23: "Matrix((XS[:3], YS[1:4]))",
    RECORD: "Record(1.0, XS[:3])",
}
DEEPER = {
    FLOAT: """
        (F + F) | (F - F) | F * F | (F / F) | -F | (F % F) | (F // F) | (F if B else F) | (F + 2)
        | (3 - F) | (I * F) | (I / I) | float(I) | V[0] | V[-1] | V[I % 4] | (V @ XS[1:4]) | V.sum()
        | max(V) | min(F, F, 1.0) | max(F, F) | M[I % 3, 1] | N[1, -1] | interpolate(F, XS, YS)
        | atan2(F, F) | copysign(F, F) | fmod(F, F) | pow(F, F) | abs(F) | fabs(F) | sin(F) | cos(F)
        | tan(F) | atan(F) | tanh(F) | exp(F) | expm1(F) | sqrt(F) | log(F) | log1p(F) | log2(F)
        | log10(F) | asin(F) | acos(F) | sinh(F) | cosh(F) | asinh(F) | acosh(F) | atanh(F)
        | degrees(F) | radians(F) | R.x | 0.5 | inf
        | (F**2) | (F**-1) | (F**SIZE) | (F**3.0) | (I**-2)
        | (F, F)[I % 2] | (F, F)[SIZE - 2] | Record(F, V).x | _both(V, F)[1]
    """,
    INT: """
        (I + I) | (I - I) | I * I | (I // I) | (I % I) | abs(I) | min(I, I) | max(I, I, 2) | -I | 5
        | (I if B else I) | int(F) | round(F) | floor(F) | ceil(F) | PRIMES[I % 4] | len($v)
        | int(B)
        | int(Mode.HIGH) | (I + Mode.LOW) | R.k | (I**2) | ((I % 7)**3) | (I**0) | PRIMES[SIZE]
    """,
    BOOL: """
        (F < F) | (F <= I) | (I > F) | (I >= I) | (F == F) | (I != I) | (B and B) | (B or B)
        | (not B) | isnan(F) | isfinite(F) | bool(F) | bool(I) | (R.mode == Mode.LOW) | R.on
    """,
    V3: """
        (V + V) | (V - V) | (F * V) | (V * F) | (V / F) | (-V) | (V * 2) | (A @ V) | (M @ V)
        | V.replaced(I % 4, F) | Vector((F, F, I)) | (N.T @ W) | solve(A, V) | M[I % 3] | R.v
        | Vector(each * F for each in V) | Vector(F + each for each in range(3))
        | Vector(one - other for one, other in zip(V, XS)) | Vector(x * F for x in V)
        | Vector(x_in - F for x_in in V) | Vector(F + k for k in range(SIZE + 1))
        | XS[SIZE - 1 : SIZE + 2]
        | Vector([F, I, F]) | (Vector((F, F, F)) if Vector((F, F))[0] > F else V) | _both(V, F)[0]
        | Vector(k * x for k, x in zip(range(3, -9, -SIZE), V))
    """,
    V2: "Vector((F, F)) | $v[1:] | (N @ V) | (W + YS[3:]) | Vector(a + k for k, a in enumerate(W))"
    " | YS[:SIZE] | Vector(x * F for x in W)",
    M33: """
        (M @ M) | (M + A) | (M - A.T) | M.T | (-M) | (F * M) | (M / F) | (N.T @ N)
        | M.replaced(I % 3, V) | Matrix((p + q * F for q in range(3)) for p in range(3))
        | Matrix((x * x_in + F for x_in in V) for x in V) | Matrix((x - F for x in V) for x in V)
        | Matrix([V, (F, 0.0, 1.0), [1.0, F, I]]) | (Matrix((V, V, V)) if B else M)
    """,
    M23: "Matrix((V, V)) | (N @ A) | Matrix(((1.0, F, 0.0), (2.0, 0.5, I)))",
    RECORD: """
        Record(F, V, on=B) | Record(v=V, x=F, k=I) | $r._replace(x=F, mode=Mode.HIGH)
        | (Record(F, V) if B else R) | (R if Record(F, V).x > F else Record(F, V, I, B))
        | Record(F, (V if (F, F)[0] > F else XS[:3]), on=(B if B else $r.on))
    """,
}

Variables = dict[str, str]


class Program:
    """One program on its way, from a seed."""

    def __init__(self, name: str, seed: int) -> None:
        self._random = Random(seed)
        self._name, self._count = name, 0
        self._lines: list[str] = []
        self._open: set[str] = set()

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
        self._block(variables, "    ", self._random.randint(3, 8), depth=0)
        results = list(variables)
        hints = ", ".join(variables[name] for name in results)
        given = ", ".join(f"{name}: {hint}" for name, hint in arguments.items())
        head = f"def {self._name}({given}) -> tuple[{hints}]:"
        return "\n".join([head, *self._lines, f"    return ({', '.join(results)},)"]) + "\n"

    def _new(self, hint: str) -> str:
        self._count += 1
        return f"{hint.strip('AnotedVcrMix[], ')[:1] or 'a'}_{self._count}"

    def _add(self, indent: str, line: str) -> None:
        self._lines.append(indent + line)

    # Statements

    def _block(self, known: Variables, indent: str, n: int, depth: int, loop: bool = False) -> None:
        self._add(indent, "pass")
        for _ in range(n):
            choices = [self._assign, self._assign, self._change, self._swap, self._table]
            choices += [self._call] * (self._random.random() < 0.3)
            if depth < 3:
                choices += [self._if, self._for, self._while, self._local]
            self._random.choice(choices)(known, indent, depth)
            if loop and self._random.random() < 0.1:
                self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
                self._add(indent, f"    {self._random.choice(('break', 'continue'))}")
        if self._random.random() < 0.03:
            self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
            value = self._expression(FLOAT, known, 1)
            self._add(indent, f'    raise Refusal(f"no {{{value}:g}} here")')

    def _assign(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice(TYPES)
        value, name = self._expression(hint, known, 3), self._new(hint)
        self._add(indent, f"{name} = {value}")
        known[name] = hint

    def _change(self, known: Variables, indent: str, depth: int) -> None:
        name = self._random.choice([n for n, hint in known.items() if hint in (FLOAT, INT, V3)])
        sign = self._random.choice("+-" if known[name] != FLOAT else "+-*/")
        value = self._expression(known[name], known, 2)
        self._add(indent, f"{name} {sign}= {value}")

    def _swap(self, known: Variables, indent: str, depth: int) -> None:
        hint = self._random.choice((FLOAT, INT, V3))
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
        inside = []
        for word in ("", "elif", "else"):
            if word == "elif" and self._random.random() < 0.6:
                continue
            if word:
                test = f" {self._expression(BOOL, known, 2)}" if word == "elif" else ""
                self._add(indent, f"{word}{test}:")
            branch = dict(known)
            self._block(branch, f"{indent}    ", self._random.randint(1, 3), depth + 1)
            inside.append(branch)
        # What every branch has given a value has one after it.
        hint = self._random.choice((FLOAT, INT))
        name = self._new(hint)
        if self._random.random() < 0.5:
            self._add(indent, f"if {self._expression(BOOL, known, 1)}:")
            self._add(indent, f"    {name} = {self._expression(hint, known, 1)}")
            self._add(indent, "else:")
            self._add(indent, f"    {name} = {self._expression(hint, known, 1)}")
            known[name] = hint

    def _for(self, known: Variables, indent: str, depth: int) -> None:
        inside, name = dict(known), self._new(FLOAT)
        free = [one for one in _REUSED if one not in self._open]
        if free and self._random.random() < 0.5:
            name = self._random.choice(free)
        kind = self._random.randrange(7)
        hint = INT if kind in (0, 4, 5) else FLOAT
        if self._random.random() < 0.3:
            # It has a value already, which is lost.
            name = self._random.choice([n for n, h in known.items() if h == hint] or [name])
        if kind == 0:
            stops = (
                "3",
                "1, 4",
                "4, 0, -1",
                "0, 7, 3",
                "SIZE + 1",
                "len(XS) - 3",
                "SIZE**2, -1, -SIZE",
            )
            stop = self._random.choice((*stops, f"{name}_n"))
            if stop == f"{name}_n":
                self._add(indent, f"{name}_n = {self._expression(INT, known, 1)} % 4")
                known[f"{name}_n"] = inside[f"{name}_n"] = INT
            self._add(indent, f"for {name} in range({stop}):")
            inside[name] = INT
        elif kind == 1:
            self._add(indent, f"for {name} in {self._expression(V3, known, 1)}:")
            inside[name] = FLOAT
        elif kind == 2:
            self._add(indent, f"for {name}, {name}_b in zip(XS, {self._vector(known)}):")
            inside |= {name: FLOAT, f"{name}_b": FLOAT}
        elif kind == 3:
            self._add(indent, f"for {name}_k, {name} in enumerate({self._vector(known)}):")
            inside |= {f"{name}_k": INT, name: FLOAT}
        elif kind == 4:
            self._add(indent, f"for {name} in PRIMES:")
            inside[name] = INT
        elif kind == 5:
            self._add(
                indent, f"for {name}, {name}_b in zip(range(9, SIZE, -3), {self._vector(known)}):"
            )
            inside |= {name: INT, f"{name}_b": FLOAT}
        else:
            self._add(indent, "for _ in range(2):")
        was_open = name in self._open
        self._open.add(name)
        self._loop_body(inside, indent, depth)
        if not was_open:
            self._open.remove(name)

    def _vector(self, known: Variables) -> str:
        names = [name for name, hint in known.items() if hint in (V3, V2)]
        return self._random.choice([*names, "XS", "YS"])

    def _while(self, known: Variables, indent: str, depth: int) -> None:
        name = self._new(INT)
        self._add(indent, f"{name} = {self._random.randint(1, 4)}")
        known[name] = INT
        test = self._expression(BOOL, known, 1)
        self._add(indent, f"while {name} > 0 and {test}:")
        self._add(indent, f"    {name} -= 1")
        inside = {n: hint for n, hint in known.items() if n != name}
        self._loop_body(inside, indent, depth)

    def _loop_body(self, inside: Variables, indent: str, depth: int) -> None:
        self._block(dict(inside), f"{indent}    ", self._random.randint(1, 3), depth + 1, loop=True)

    def _local(self, known: Variables, indent: str, depth: int) -> None:
        name = self._new(BOOL)
        own: Variables = {"p": FLOAT, "n": INT, "v": V3, "r": RECORD}
        hints = ", ".join(f"{argument}: {hint}" for argument, hint in own.items())
        # It captures one name, and has others that are around it, too.
        captured, shadow = f"{name}_c", self._random.choice([n for n in known if n not in own])
        self._add(indent, f"{captured} = {self._expression(FLOAT, known, 1)}")
        self._add(indent, f"def {name}_f({hints}) -> float:")
        own |= {captured: FLOAT}
        self._add(indent, f"    {shadow} = {self._expression(FLOAT, own, 2)}")
        own |= {shadow: FLOAT}
        self._add(indent, f"    for each in v:\n{indent}        {shadow} += each * p")
        self._add(indent, f"    return {self._expression(FLOAT, own, 2)}")
        own = {argument: own[argument] for argument in ("p", "n", "v", "r")}
        given = ", ".join(self._expression(hint, known, 1) for hint in own.values())
        self._add(indent, f"{name} = {name}_f({given})")
        known[name] = FLOAT

    # Expressions

    def _expression(self, hint: str, known: Variables, depth: int) -> str:
        names = [name for name, h in known.items() if h == hint]
        if names and (depth <= 0 or self._random.random() < 0.25):
            return self._random.choice(names)
        choices = (DEEPER if depth > 0 else GRAMMAR)[hint].split("|")
        parts = re.split(r"(\$\w|\b[A-Z]\b)", self._random.choice(choices).strip())
        return "".join(self._part(part, known, depth - 1) for part in parts)

    def _part(self, part: str, known: Variables, depth: int) -> str:
        if part in NAMES:
            return self._random.choice([n for n, hint in known.items() if hint == NAMES[part]])
        return self._expression(LETTERS[part], known, depth) if part in LETTERS else part


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
        else:
            large = random.random() < 0.1
            found.append(random.randint(-70_000, 70_000) if large else random.randint(0, 1))
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
        module = module_of("\n\n".join([HEAD + _SHARED, *texts]), Path(folder), f"own_{seeds[0]}")
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


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.programs", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="programs (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the first program")
    parser.add_argument("--show", action="store_true", help="print the program of the first seed")
    parser.add_argument("--compiler", default="cc -O2", help="command (default: %(default)s)")
    parser.add_argument("--sanitize", action="store_true", help="compile with sanitizers")
    options = parser.parse_args()
    if options.show:
        print(Program("program", options.seed).text())
        return 0
    if options.sanitize and "ASAN_OPTIONS" not in os.environ:
        command = [sys.executable, "-m", "fuzz.programs", *sys.argv[1:]]
        with sanitizers() as reports:
            status = subprocess.run(command, check=False).returncode
            print(reports, end="")
        return status
    compiler = ("gcc", *SANITIZED) if options.sanitize else options.compiler.split()
    wrong, seeds = 0, range(options.seed, options.seed + options.runs)
    for start in range(0, len(seeds), BATCH):
        for finding in tried(seeds[start : start + BATCH], compiler):
            wrong += 1
            print(f"seed {finding.seed}: {[*finding.given]}")
            print(f"  Python {finding.python}\n  C {finding.c}", flush=True)
    print(f"{len(seeds)} programs, {wrong} of them differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
