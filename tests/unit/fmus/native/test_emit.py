"""Each construct of the language gives the same bits in Python and in C.

Numbers of every magnitude: overflow, underflow, division by zero and domain errors are among
them.
"""

from __future__ import annotations

import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from math import isnan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.language import tree
from fmus.language.build import Untranslatable
from fmus.language.mathematics import CONSTANTS, FUNCTIONS
from fmus.language.types import BOOL, FLOAT
from fmus.native.emit import Emitter
from support.language import HEAD, TOO_LARGE, Twins, c_text, module_of, sizes_of

ZIG = (sys.executable, "-m", "ziglang", "cc")

#: Compilers, as FMUs are compiled by them.
COMMANDS = {"gcc": ("gcc", "-O2"), "clang": ("clang", "-O2"), "zig": (*ZIG, "-O2")}

#: One that is there.
COMPILED = next((name for name in ("gcc", "clang") if shutil.which(name)), "")

#: Constants and classes of all functions.
SHARED = '''
class Mode(IntEnum):
    """An enumeration."""

    OFF = 0
    HEAT = 2


class Inner(NamedTuple):
    """A record in a record."""

    a: float
    n: int = 7


class Record(NamedTuple):
    """A record."""

    x: float
    v: Annotated[Vector, 3]
    inner: Inner
    on: bool = True
    mode: Mode = Mode.OFF


XS, YS = Vector((-2.0, -0.5, 1.0, 4.0)), Vector((3.0, -1.0, 0.5, 0.25))
A = Matrix(((2.0, -1.0, 0.5), (0.0, 1.5, -0.25)))
POWERS = (1, 2, 4, 8)
NESTED = ((1.0, 2.5), (-3.0, 0.125))
class File(NamedTuple):
    """A record whose name C has."""

    a: float
    b: float


class pose(NamedTuple):
    """A record in lower case."""

    x: float


START = Inner(0.5)
N = 3
TABLE = ((1, 50.0), (2, 10.0), (0, 30.0))
RAGGED = Vector((1.0, 2.0)), Vector((3.0, 4.0, 5.0))
MIXED, PAIR = (0, 1.5), (1, 2)
SQUARED = 2.0


def _shifted(v: Vector, by: float = 0.5) -> Vector:
    return v + Vector(by for _ in range(len(v)))


def _doubled(given: tuple[Vector, float]) -> tuple[Vector, float]:
    return 2.0 * given[0], given[1]
'''

#: A name for each construct, and a function that consists of little else.
CONSTRUCTS = {
    **{
        name: f"def f(x: float) -> float:\n    return {name}(x)\n"
        for name in sorted(
            FUNCTIONS.keys()
            - {"atan2", "copysign", "fmod", "pow", "isfinite", "isinf", "isnan"}
            - {"ceil", "floor", "trunc"}
        )
    },
    **{
        name: f"def f(x: float, y: float) -> float:\n    return {name}(x, y)\n"
        for name in ("atan2", "copysign", "fmod", "pow", "min", "max")
    },
    **{
        name: f"def f(x: float) -> bool:\n    return {name}(x)\n"
        for name in ("isfinite", "isinf", "isnan", "bool")
    },
    **{
        name: f"def f(x: float) -> int:\n    return {name}(x)\n"
        for name in ("ceil", "floor", "trunc", "int", "round")
    },
    **{
        name: f"def f(x: float) -> float:\n    return x * math.{name}\n"
        for name in sorted(CONSTANTS)
    },
    **{
        f"float {sign}": f"def f(x: float, y: float) -> float:\n    return x {sign} y\n"
        for sign in ("+", "-", "*", "/", "//", "%")
    },
    **{
        f"int {sign}": f"def f(k: int, n: int) -> int:\n    return k {sign} n\n"
        for sign in ("+", "-", "*", "//", "%")
    },
    **{
        f"mixed {sign}": f"def f(x: float, n: int) -> float:\n    return 3 {sign} x {sign} n\n"
        for sign in ("+", "-", "*", "/", "//", "%")
    },
    **{
        f"comparison {sign}": (
            "def f(x: float, y: float, k: int) -> tuple[bool, bool]:\n"
            f"    return x {sign} y, k {sign} x\n"
        )
        for sign in ("<", "<=", ">", ">=", "==", "!=")
    },
    "int /": "def f(k: int, n: int) -> float:\n    return k / n\n",
    "int min max": (
        "def f(k: int, n: int) -> tuple[int, int]:\n"
        "    return min(k, n, 5), max(k, n)\n"
    ),
    "minus": "def f(x: float, k: int) -> tuple[float, int]:\n    return -x, -k\n",
    "abs": "def f(x: float, k: int) -> tuple[float, int]:\n    return abs(x), abs(k)\n",
    "float of": "def f(k: int, on: bool) -> tuple[float, float]:\n    return float(k), float(on)\n",
    "int of bool": "def f(on: bool) -> int:\n    return int(on) + 1\n",
    "min max of three": (
        "def f(x: float, y: float) -> float:\n"
        "    return max(min(x, y, 1.0), -1.0, y)\n"
    ),
    "min max of a vector": (
        "def f(v: Annotated[Vector, 4]) -> tuple[float, float]:\n    return min(v), max(v)\n"
    ),
    "chain": "def f(x: float, y: float) -> bool:\n    return -1.0 < x <= y < 3.0\n",
    "and or not": (
        "def f(x: float, y: float, on: bool) -> bool:\n"
        "    return (x > 0.0 and 1.0 / x > y) or not (on or y != 0.0 and x / y < 1.0)\n"
    ),
    "conditional expression": (
        "def f(x: float, y: float) -> float:\n    return x / y if y else (1.0 if x > 0.0 else -x)\n"
    ),
    "if elif else": (
        "def f(x: float, k: int) -> float:\n"
        "    if x > 1.0:\n        y = x / k\n    elif k > 3:\n        y = 1.0 / x\n"
        "    else:\n        y = x\n        y += 1.0\n    return y\n"
    ),
    "for range": (
        "def f(x: float, n: int) -> float:\n"
        "    total = 0.0\n    for k in range(n % 7):\n        total += x / (k + 1)\n"
        "    for k in range(5, -3, -2):\n        total -= k * x\n    return total\n"
    ),
    "for vector": (
        "def f(v: Annotated[Vector, 3]) -> float:\n"
        "    total = 1.0\n    for x in v:\n        total = total * x + 1.0\n    return total\n"
    ),
    "for matrix": (
        "def f(B: Annotated[Matrix, 2, 3]) -> float:\n"
        "    total = 0.0\n    for row in B:\n        for x in row:\n            total += x\n"
        "    return total\n"
    ),
    "for tuple": (
        "def f(x: float) -> float:\n"
        "    for a, b in NESTED:\n        x = a * x + b\n    for k in POWERS:\n        x -= k\n"
        "    return x\n"
    ),
    "for zip enumerate": (
        "def f(v: Annotated[Vector, 3], x: float) -> float:\n"
        "    for k, (a, b) in enumerate(zip(v, XS)):\n        x += (a - b) * k\n    return x\n"
    ),
    "what a loop runs over stays what it was": (
        "def f(v: Annotated[Vector, 3], k: int) -> Annotated[Vector, 3]:\n"
        "    for x in v:\n        v = x * v\n"
        "    for x in A[k % 2]:\n        k += 1\n        v = v.replaced(k % 3, x)\n    return v\n"
    ),
    "break continue": (
        "def f(x: float, n: int) -> float:\n"
        "    for k in range(20):\n        if k % 3 == n % 3:\n            continue\n"
        "        x = x * 0.5 + k\n        if x > 12.0:\n            break\n    return x\n"
    ),
    "while": (
        "def f(x: float) -> tuple[float, int]:\n"
        "    k = 0\n    while abs(x) > 1e-3 and k < 50:\n        x /= 3.0\n        k += 1\n"
        "    return x, k\n"
    ),
    "assignments": (
        "def f(x: float, y: float, k: int) -> tuple[float, float, int]:\n"
        "    x, y = y, x + y\n    a: float = x\n    a *= 2.0\n    a -= y\n    k += 2\n    k *= k\n"
        "    (x, y), k = (y, a), k - 1\n    return x, y, k\n"
    ),
    "taken apart": (
        "def f(r: Record) -> float:\n"
        "    x, v, (a, n), on, mode = r\n    p, _, q = v\n"
        "    return x + p * q - a * n + on - mode\n"
    ),
    "local function": (
        "def f(x: float, y: float) -> float:\n"
        "    def g(a: float) -> float:\n        return a / x\n"
        "    def h(b: float) -> float:\n        return g(b) + g(b * y)\n    return h(2.0) - h(y)\n"
    ),
    "record": (
        "def f(x: float, v: Annotated[Vector, 3], k: int) -> Record:\n"
        "    first = Record(x, v, Inner(x / 2.0), mode=Mode.HEAT)\n"
        "    return first._replace(on=first.inner.n > k, inner=START._replace(n=k))\n"
    ),
    "enumeration": (
        "def f(r: Record) -> tuple[bool, int]:\n"
        "    mode = Mode.HEAT if r.on else r.mode\n    return mode == Mode.OFF, mode + 1\n"
    ),
    "constants": (
        "def f(k: int) -> tuple[int, float, float]:\n"
        "    return POWERS[k % 4], NESTED[k % 2][-1], START.a\n"
    ),
    "element": "def f(v: Annotated[Vector, 3], k: int) -> float:\n    return v[k] + v[0] - v[-1]\n",
    "element of a matrix": (
        "def f(B: Annotated[Matrix, 2, 3], i: int, j: int) -> float:\n"
        "    return B[i, j] + B[i][j] - B[-1, 0] * A[1, j]\n"
    ),
    "slice": (
        "def f(v: Annotated[Vector, 4]) -> tuple[float, float]:\n"
        "    w = v[1:3]\n    return w @ v[::2], Vector((*v[2:], 1.0, *w)).sum()\n"
    ),
    "elements of what has no name": (
        "def f(v: Annotated[Vector, 3], k: int, r: Record) -> tuple[float, float, float]:\n"
        "    def twice(by: float) -> Annotated[Matrix, 2, 3]:\n        return by * Matrix((v, v))\n"
        "    def kept(by: float) -> Record:\n        return r._replace(x=by)\n"
        "    return twice(2.0)[k, 1], kept(v[0]).v[k], (r.v if k > 0 else v)[k - 1]\n"
    ),
    "len": "def f(v: Annotated[Vector, 4]) -> int:\n    return len(v) * len(A)\n",
    "vector + -": (
        "def f(v: Annotated[Vector, 3], w: Annotated[Vector, 3]) -> Annotated[Vector, 3]:\n"
        "    return -(v + w) - w\n"
    ),
    "vector * /": (
        "def f(v: Annotated[Vector, 3], x: float, k: int) -> Annotated[Vector, 3]:\n"
        "    return 2 * v / x - x * v * k\n"
    ),
    "vector @": (
        "def f(v: Annotated[Vector, 3], w: Annotated[Vector, 3]) -> float:\n"
        "    return v @ w + v.sum()\n"
    ),
    "replaced": (
        "def f(v: Annotated[Vector, 3], k: int, x: float) -> Annotated[Vector, 3]:\n"
        "    return v.replaced(k, x).replaced(-1, 2)\n"
    ),
    "matrix + - * /": (
        "def f(B: Annotated[Matrix, 2, 3], x: float) -> Annotated[Matrix, 2, 3]:\n"
        "    return x * (A - B) / 3.0 + -B * 2\n"
    ),
    "matrix @": (
        "def f(B: Annotated[Matrix, 2, 3], v: Annotated[Vector, 3]) -> tuple[\n"
        "    Annotated[Matrix, 3, 3], Annotated[Vector, 2]\n]:\n    return A.T @ B, B @ v\n"
    ),
    "matrix replaced": (
        "def f(B: Annotated[Matrix, 2, 3], k: int) -> Annotated[Matrix, 2, 3]:\n"
        "    return B.replaced(k, A[0])\n"
    ),
    "vector of an expression": (
        "def f(v: Annotated[Vector, 3], x: float) -> Annotated[Vector, 3]:\n"
        "    return Vector(a / x + k for k, a in enumerate(v)) - Vector(x * k for k in range(3))\n"
    ),
    "matrix of an expression": (
        "def f(v: Annotated[Vector, 3], x: float) -> Annotated[Matrix, 3, 2]:\n"
        "    return Matrix((a * x + j for j in range(2)) for a in v)\n"
    ),
    "tuple of an expression": (
        "def f(x: float) -> tuple[int, int, int]:\n    return tuple(int(k * x) for k in range(3))\n"
    ),
    "matrix of rows": (
        "def f(v: Annotated[Vector, 2], x: float) -> Annotated[Matrix, 2, 2]:\n"
        "    return Matrix((v, (x, 1))) @ Matrix((Vector((x, 0.0)), v))\n"
    ),
    "interpolate": "def f(x: float) -> float:\n    return interpolate(x, XS, YS)\n",
    "solve": (
        "def f(B: Annotated[Matrix, 2, 2], v: Annotated[Vector, 2]) -> Annotated[Vector, 2]:\n"
        "    return solve(B, v)\n"
    ),
    "raise": (
        "def f(x: float, k: int) -> float:\n"
        "    if x > 1.0:\n        raise Refusal(f\"100 % of {x:.3f} or {x:g} in {k}\")\n"
        "    if k > 1:\n        raise ValueError(\"no\")\n    return x\n"
    ),
    "raise with a bool and texts": (
        "def f(x: float, on: bool) -> float:\n"
        "    def no(text: str) -> None:\n        raise Refusal(f\"{text}, {on}, {x > 2.0}\")\n"
        "    if x > 1.0:\n        no('say \"hi\", 100 % \\\\')\n    return x\n"
    ),
    "while after an error in it": (
        "def f(x: float) -> float:\n"
        "    y = 0.0\n    while y < 3.0:\n        if x < 0.0:\n            y = 1.0 / (x - x)\n"
        "            y = 0.0\n            continue\n        y += 1.0\n    return y\n"
    ),
    "while after an error before it": (
        "def f(x: float) -> float:\n"
        "    def halved(y: float) -> float:\n        while y > 5.0:\n            y *= 0.5\n"
        "        return y\n    return halved(1.0 / x) if abs(x) > 1e-9 or x == 0.0 else x\n"
    ),
    "ring buffer": (
        "def f(v: Annotated[Vector, 4], x: float, k: int) -> tuple[\n"
        "    float, Annotated[Vector, 4], int\n]:\n"
        "    at = k % 4\n    return v[at], v.replaced(at, x), (at + 1) % 4\n"
    ),
    "taken apart by a part of itself": (
        "def f(k: int, x: float) -> tuple[int, float]:\n"
        "    mode = k % 3\n    mode, dwell = TABLE[mode]\n"
        "    for _ in range(2):\n        for _ in range(2):\n            mode, y = TABLE[mode]\n"
        "            dwell += x * y\n    return mode, dwell\n"
    ),
    "one variable in a loop and an expression": (
        "def f(v: Annotated[Vector, 3], x: float) -> Annotated[Vector, 3]:\n"
        "    total = 0.0\n    for a in v:\n        total += a\n"
        "    w = Vector(x * a for a in v)\n    for i in range(3):\n        total -= i\n"
        "    return w * total + Vector(i / x for i in range(3))\n"
    ),
    "names of an expression's own": (
        "def f(elements: float, x: float) -> Annotated[Vector, 3]:\n"
        "    place = 2.0\n    v = Vector(x * place for place in range(3))\n"
        "    v = Vector(v * x + elements for v in v)\n"
        "    return v + Vector(elements * place / k for k in range(1, 4))\n"
    ),
    "local function with names of its own": (
        "def f(x: float, k: int) -> float:\n"
        "    s = 2.0 * x\n"
        "    def g(a: float) -> float:\n        s = 0\n        for i in range(3):\n"
        "            s += i\n        x = a * s\n        return x\n"
        "    for i in range(2):\n        s += g(x) * i\n    s *= 2.0\n    return s - g(s) * k\n"
    ),
    "range up to the largest int": (
        "def f(x: float) -> float:\n"
        "    for i in range(2147483000, 2147483647, 100):\n        x += i\n"
        "    for i in range(-2147483000, -2147483648, -500):\n        x += i\n    return x\n"
    ),
    "tuples of different parts": (
        "def f(x: float) -> tuple[float, float]:\n"
        "    (xs, ys), (a, b) = RAGGED, MIXED\n"
        "    return xs.sum() * x + ys[2], -MIXED[0] * x + -PAIR[0] * 1.0 + a - b\n"
    ),
    "tuples in tuples": (
        "def f(x: float, k: int) -> float:\n"
        "    a, b = (x, k, 2.0 * x), ((x, k), 0.5)\n    return a[2] * b[1] + b[0][0] - a[1]\n"
    ),
    "local function in an expression in an expression": (
        "def f(x: float, v: Annotated[Vector, 3]) -> Annotated[Vector, 3]:\n"
        "    def g(a: float) -> float:\n        return a + x\n"
        "    w = Vector(Vector(g(b) for b in v).sum() for _ in range(3))\n"
        "    return w + Vector(g(b) for b in v)\n"
    ),
    "stars are fitted": (
        "def f(x: float, k: int) -> Inner:\n"
        "    def g(a: float, n: int) -> float:\n        return a * n + x\n"
        "    t = (x, k)\n    return Inner(g(*t), k)\n"
    ),
    "what is dropped is computed": (
        "def f(x: float, k: int) -> float:\n"
        "    y, _ = 2.0, 1.0 / x\n    for _ in A[k]:\n        y += 1.0\n"
        "    _, z, _ = A[k]\n    return y + z\n"
    ),
    "for after an error in it": (
        "def f(x: float, k: int) -> float:\n"
        "    n, y = (2000000000 if x == 0.0 else k % 3), 0.0\n"
        "    for i in range(n):\n        for j in range(n):\n            if 1.0 / x > y:\n"
        "                continue\n            y += 1.0\n"
        "        if y < 1.0:\n            continue\n        y += 1.0\n    return y\n"
    ),
    "for after an error before it": (
        "def f(x: float, k: int) -> float:\n"
        "    def work(n: int) -> float:\n        y = x\n        for i in range(n):\n"
        "            for j in range(n):\n                y = y * 0.5 + j\n        return y\n"
        "    n = 2000000000 if x == 0.0 else k % 3\n    return 1.0 / x + work(n)\n"
    ),
    "raise with texts": (
        "def f(x: float) -> float:\n"
        "    low, high = 'too low\\t', 'too\\r high'\n"
        "    if x > 1.0:\n"
        "        raise Refusal(f\"{high} ??! {x > 2.0} {x:8.3f} {'' if x > 3.0 else low}\")\n"
        "    return x\n"
    ),
    "names that C reserves": (
        "def f(_Bool: float, x\u0302: float, double_int: pose) -> float:\n"
        "    pose_ = double_int._replace(x=_Bool)\n    each1 = x\u0302\n"
        "    def each2(a: float) -> float:\n        return a * each1\n"
        "    v = Vector(each2(k * pose_.x) for k in range(2))\n    return v.sum() + pose_.x\n"
    ),
    "names of C": (
        "def f(double: float, error: int, int_: float) -> float:\n"
        "    switch, sin, NAN = double / int_, 1.0, 0.5\n    register = switch + sin * NAN\n"
        "    return register * error\n"
    ),
    "names of arithmetic.h": (
        "def f(x: float, y: float, power: int) -> float:\n"
        "    smaller, larger = min(x, y), max(x, y)\n    quotient, nearest = x / y, round(power)\n"
        "    OVERFLOW = pow(smaller, power) if larger < 9.0 else quotient\n"
        "    return OVERFLOW + nearest % 7\n"
    ),
    "names that end alike": (
        "def f(error: float, error_: float, Vector3: float) -> Annotated[Vector, 3]:\n"
        "    choice = File(error, error_)\n    return Vector((choice.a, choice.b, Vector3))\n"
    ),
    "powers of a float": (
        "def f(x: float) -> tuple[float, float, float, float, float]:\n"
        "    return x**2, -(x**3), x**-1, x**0, (x * 2.0) ** (N + 2)\n"
    ),
    "powers to a float": (
        "def f(x: float, k: int) -> tuple[float, float, float]:\n"
        "    return x**-4.0, x**SQUARED, k**3.0\n"
    ),
    "powers of an int": (
        "def f(k: int, on: bool) -> tuple[int, int, int, int, int]:\n"
        "    k %= 17\n    return k**2, (k - 9) ** 7, -(k**0), on**3, (k % 3 - 1) ** 2000000001\n"
    ),
    "a power of an int below 1": "def f(k: int) -> float:\n    return k**-2 + (k % 5) ** -1\n",
    "a power in place": "def f(x: float) -> float:\n    x **= 3\n    return x\n",
    "a record in a condition": (
        "def f(x: float, r: Inner) -> tuple[Inner, float]:\n"
        "    return Inner(x) if Inner(x, 2).a > 0.0 else r, x\n"
    ),
    "a record with others in conditions": (
        "def f(x: float, r: Record) -> Record:\n"
        "    return r._replace(\n"
        "        v=Vector((x, 1.0, 2.0)) if Vector((x, x)).sum() > 1.0 else r.v,\n"
        "        inner=Inner(x) if (x, 1.0)[0] > 0.0 else r.inner._replace(a=2.0),\n"
        "    )\n"
    ),
    "a vector in a condition in a matrix": (
        "def f(x: float, v: Annotated[Vector, 2]) -> Annotated[Matrix, 2, 2]:\n"
        "    return Matrix((Vector((x, 2.0)) if Vector((x, 1.0))[0] > v[0] else v, (1.0, x)))\n"
    ),
    "an expression with a name of the expression around it": (
        "def f(x: Annotated[Vector, 2], x_in: float) -> Annotated[Matrix, 2, 3]:\n"
        "    return Matrix((x * x_in for x_in in XS[:N]) for x in x)\n"
    ),
    "ranges of sums of constants": (
        "def f(v: Annotated[Vector, 4], x: float) -> tuple[Annotated[Vector, 4], float]:\n"
        "    w = Vector(x * k for k in range(N + 1))\n    d = 0.0\n"
        "    for k in range(len(v) - 1):\n        d += v[k + 1] - v[k]\n"
        "    for k in range(N**2 - 1, -N // 2, -(N % 2)):\n        d = d * x + k\n"
        "    return w + Vector(d for _ in range(len(XS))), v[N] + MIXED[N - 2]\n"
    ),
    "slices by constants": (
        "def f(v: Annotated[Vector, 4]) -> tuple[Annotated[Vector, 3], float, float]:\n"
        "    return v[:N], v[N - 2 :: N - 1].sum(), max(v[-N : len(v)])\n"
    ),
    "loops over names that have a value": (
        "def f(x: float, k: int, v: Annotated[Vector, 3]) -> tuple[float, int]:\n"
        "    for k in range(k % 4):\n        for k in range(2):\n            x += k\n"
        "        x = x * 0.5 + k\n    y = k + x\n"
        "    for x in v:\n        y = y * x\n    for k, y in enumerate(v):\n        pass\n"
        "    return x + y, k\n"
    ),
    "loops that change their names": (
        "def f(x: float, n: int) -> float:\n"
        "    for k in range(n % 5):\n        k *= 2\n        x += k\n"
        "    for a in XS:\n        if a < x:\n            a = x\n        x = 0.5 * a + 1.0\n"
        "    for i, b in enumerate(XS):\n        i += 1\n        b /= i\n        x += b\n"
        "    return x\n"
    ),
    "zip of ranges": (
        "def f(v: Annotated[Vector, 4]) -> Annotated[Vector, 3]:\n"
        "    y = 0.0\n    for k, x in zip(range(7, -5, -N), v):\n        y = y * x + k\n"
        "    for i, (k, n) in enumerate(zip(range(N), range(2, 9, 2))):\n        y += i * k - n\n"
        "    return Vector(x * k + y for k, x in zip(range(1, N + 1), v))\n"
    ),
    "an early return": (
        "def f(x: float, k: int) -> float:\n"
        "    def check(a: float) -> None:\n        if a < 1.0:\n            return\n"
        "        for _ in range(k):\n            if a > 2.0:\n                return\n"
        "        raise Refusal(\"no\")\n"
        "    check(x)\n    return x\n"
    ),
    "lists in vectors and matrices": (
        "def f(x: float) -> tuple[Annotated[Vector, 2], Annotated[Matrix, 2, 2]]:\n"
        "    v = Vector([x, 1.0])\n"
        "    return v, Matrix([[x, 0.0], v]) + Matrix(([1.0, x], (x, 2)))\n"
    ),
    "results of any size": (
        "def f(v: Annotated[Vector, 3], w: Annotated[Vector, 2]) -> tuple[\n"
        "    Annotated[Vector, 3], float\n]:\n"
        "    def halved(x: Annotated[Vector, 2]) -> tuple[Vector, float]:\n"
        "        return 0.5 * x, x.sum()\n"
        "    (a, b), (c, d) = _doubled((v, 2.0)), halved(w)\n    return a, b + c @ w + d\n"
    ),
    "names of structures": (
        "def f(x: float, Inner_Record: float, File_: Inner) -> tuple[Inner, Record]:\n"
        "    Inner_Record_, Inner_double, Inner_, class_pose = x, 2.0, x * 3.0, pose(x)\n"
        "    int_Inner, pairs = (1, File_), ((x, 2), (Inner_Record, 3))\n"
        "    y = Inner_Record_ * Inner_double + Inner_ + pairs[1][0] + int_Inner[0]\n"
        "    return Inner(y), Record(class_pose.x, XS[:3], int_Inner[1])\n"
    ),
    "names that are numbers of others in C": (
        "def f(x\u0302: float, x_u0302: float, x_u00302: float, v__x: float, _x: float) -> float:\n"
        "    llabs, v_State = abs(int(x_u0302 / 1e9)), 2.0\n"
        "    return x\u0302 - x_u0302 * x_u00302 + llabs + v__x / _x + v_State\n"
    ),
    "match of an enumeration": (
        "def f(k: int, x: float) -> float:\n    mode = Mode.HEAT if k > 0 else Mode.OFF\n"
        "    match mode:\n        case Mode.OFF if x > 1.0:\n            y = 1.0 / x\n"
        "        case Mode.OFF:\n            y = x\n"
        "        case Mode.HEAT:\n            y = 2.0 * x\n"
        "    return y\n"
    ),
    "match of an int": (
        "def f(k: int, x: float) -> float:\n"
        "    match (k + 3) % 7:\n        case 0 | 2:\n            x += 1.0\n        case 4:\n"
        "            return 1.0 / x\n        case -1 if x > 0.0:\n            x = 5.0\n"
        "        case _ if x > 2.0:\n            x = -x\n        case _:\n            x *= 2.0\n"
        "    return x\n"
    ),
    "members of ints": (
        "def f(k: int, on: bool) -> tuple[int, int]:\n"
        "    mode = Mode(k % 4)\n    return +mode, mode + on\n"
    ),
    "raise of assert": (
        "def f(x: float, k: int) -> float:\n"
        "    assert x == x, 'NaN'\n    assert x > 0.0 or k % 2, f'{x:g} and {k}'\n"
        "    assert k != 3\n    return x\n"
    ),
    "defaults and names of arguments": (
        "def f(x: float, v: Annotated[Vector, 3]) -> tuple[float, float, float]:\n"
        "    def g(a: float, b: float = 2.0, *, n: int = N) -> float:\n"
        "        return a * b + n * x\n"
        "    return g(x), g(b=x, a=1.0), _shifted(v, by=g(x, n=3)).sum() + _shifted(v)[1]\n"
    ),
    "loops that have ended": (
        "def f(x: float, v: Annotated[Vector, 3]) -> tuple[float, int, float]:\n"
        "    for k, a in enumerate(v, 1):\n        if a > x:\n            break\n"
        "    y = a * k\n    for c in range(N):\n        y += c\n"
        "    for k in reversed(range(2, 9, 3)):\n"
        "        y = y * 0.5 + k\n    for b in reversed(v):\n        y = y * x + b\n"
        "    return y, k + c, b\n"
    ),
    "names of loops for other values": (
        "def f(x: float, v: Annotated[Vector, 3], k: int) -> tuple[float, int]:\n"
        "    for a in range(3):\n        a += 1\n        k += a % 5\n"
        "    for a in v:\n        x += a\n    for i in range(2):\n"
        "        for i in range(2, 4):\n            x += i\n"
        "        k += i % 7\n        for k in range(2):\n            pass\n    return x, k\n"
    ),
    "a loop over members of an enumeration for an int": (
        "def f(x: float, k: int) -> tuple[float, int]:\n"
        "    n = 3\n    for n in (Mode.OFF, Mode.HEAT):\n        x += n\n"
        "    for i, k in enumerate((Mode.HEAT, Mode.OFF), 2147483646):\n        x += k * i\n"
        "    return x + n, k\n"
    ),
    "one value under two types": (
        "_TWO = (True, 2)\ndef _g(a: float, t: tuple[bool, int] = _TWO) -> float:\n"
        "    return a * t[0] + _TWO[1]\n"
        "def f(x: float) -> float:\n    return _g(x) + _TWO[1]\n"
    ),
    "names of loops that are over": (
        "def f(x: float, v: Annotated[Vector, 3]) -> tuple[float, int, int]:\n"
        "    for k in range(3):\n        pass\n    while k > -3:\n        k -= 2\n"
        "    n = k\n    for i in range(2):\n        for a in v:\n            x += a\n"
        "        for a in range(i + 1):\n            n += a\n"
        "    for j in range(4):\n        if x > j:\n            j = 7\n        n += j\n"
        "    return x, n, j\n"
    ),
    "loops that may give earlier names another value": (
        "def f(x: float, n: int, v: Annotated[Vector, 3]) -> tuple[float, int, float, float]:\n"
        "    for k in range(3):\n        x += k\n    for k in range(n % 3):\n        x += k\n"
        "    for a in v:\n        if a > x:\n            break\n"
        "    for _ in range(n % 2):\n        for a in v:\n            x += a\n"
        "    n = 0\n    while True:\n        y = x * 0.5\n        n += 1\n        if y < n:\n"
        "            break\n        x -= 7.0\n        if n > 9:\n            y = x\n"
        "            break\n"
        "    return x, k, a, y\n"
    ),
    "match with another way for all others": (
        "def f(k: int, x: float) -> float:\n    match k:\n        case 1 | _ if x > 1.0:\n"
        "            x = 2.0\n        case 1 | _:\n            x = 1.0 / x\n    return x\n"
    ),
    "zip that ends with a range": (
        "def f(v: Annotated[Vector, 3], x: float) -> tuple[float, Annotated[Vector, 3]]:\n"
        "    for a, k, i in zip(v, range(3), range(3)):\n        x += a * k + i\n"
        "    return x, Vector(a * k + x for a, k in zip(v, range(4)))\n"
    ),
    "sums and tests in loops": (
        "def f(x: float, v: Annotated[Vector, 4], k: int) -> tuple[int, bool, bool, float, int]:\n"
        "    def near(a: float) -> bool:\n        return abs(a - x) < 1.0\n"
        "    n = sum(i for i, b in enumerate(v) if near(b) if b > 0.0) + sum(a > x for a in v)\n"
        "    on = any(1.0 / a > x for a in v if a < 2.0)\n"
        "    y = max(a * x for a in v) + min(x - i for i in range(N))\n"
        "    return n, on, all(near(a) for a in v), y, max(i * k for i in range(3, 0, -1))\n"
    ),
    "a place in what a function gives": (
        "def f(x: float, k: int, r: Record) -> tuple[float, float, float]:\n"
        "    def g(a: float) -> Record:\n        return r._replace(x=a, v=a * r.v)\n"
        "    row = (A if x > 0.0 else 2.0 * A)[k]\n"
        "    return row[k] + g(x).v[k], (2.0 * A)[k - 1][k], (x, 2.0, r.x)[k]\n"
    ),
    "rows some times over": (
        "def f(x: float, v: Annotated[Vector, 2]) -> Annotated[Matrix, 4, 2]:\n"
        "    B = Matrix([a] * 2 for a in v) @ Matrix(((x, 1.0), *NESTED[:1]))\n"
        "    return Matrix((v, *B, (x,) * 2))\n"
    ),
    "nothing is returned": (
        "def f(x: float) -> float:\n"
        "    def g(a: float, why: str = 'large') -> None:\n        if a < 0.0:\n"
        "            return None\n        if a > 2.0:\n"
        "            raise Refusal(f'{a:g} is {why}') from None\n        return\n"
        "    g(x)\n    g(3.0 * x, why='larger')\n    return x\n"
    ),
    "an if of many branches": (
        "def f(k: int) -> int:\n    if k == -1:\n        n = 1\n"
        + "".join(f"    elif k == {i}:\n        n = {i * i}\n" for i in range(90))
        + "    else:\n        n = -k // 2\n    return n\n"
    ),
    "a while that is left": (
        "def f(x: float, k: int) -> float:\n"
        "    n = 0\n    while True:\n        n += 1\n        x = 0.5 * x\n"
        "        if n > 5:\n            break\n        if x < 1.0:\n            continue\n"
        "        if k == 2:\n            return x\n    return x + n\n"
    ),
    "several names for a value": (
        "def f(x: float, k: int) -> tuple[float, float, float]:\n"
        "    a = b = 2.0 * x\n    (c, d), e = f_ = (a, b), 3.0\n    a += 1.0\n"
        "    return a + c, b - d, e * f_[1] + k\n"
    ),
    "tuples some times over": (
        "def f(x: float) -> tuple[Annotated[Vector, 3], float]:\n"
        "    v = Vector([0.0] * N) + Vector((x, 1.0, 2.0)) * +x\n    t = (x, 1.0) * 2\n"
        "    return v + Vector((1.0,) * N), t[3] + t[2]\n"
    ),
    "comparisons of expressions": (
        "def f(x: float, k: int) -> tuple[bool, bool]:\n"
        "    return 0.0 < 1.0 / x <= 2.0 * x, -3 < k % 5 < 2 * x != k\n"
    ),
    "stars of expressions": (
        "def f(x: float, v: Annotated[Vector, 3]) -> tuple[Annotated[Vector, 5], float]:\n"
        "    w = Vector((x, *(x * v), *-v[:1]))\n    t = (*-v, x)\n    return w, t[0] * t[3]\n"
    ),
    "an early return from loops": (
        "def f(x: float, v: Annotated[Vector, 3]) -> float:\n"
        "    if x < 0.0:\n        return -x\n    for k, a in enumerate(v):\n        if a > x:\n"
        "            return a / k\n    return x\n"
    ),
    "range of a constant": (
        "def f(x: float) -> Annotated[Vector, 3]:\n    return Vector(x * k for k in range(N))\n"
    ),
}  # fmt: skip

#: Constants and functions whose annotations are wrong.
WRONG_CONSTANTS = """
class Default(NamedTuple):
    a: float
    n: int = 2.5


class Texts(NamedTuple):
    a: float
    b: str


class Lists(NamedTuple):
    a: list[float]


class Inner_double(NamedTuple):
    a: int


def _listed(x: list[float]) -> float:
    return 1.0


def _listing(x: float) -> tuple[float, ...]:
    return (x,)


def _why(x: float, why: str = 5) -> float:
    if x > 1.0:
        raise Refusal(f"{why}")
    return x


def _on(x: float, on: bool = 5) -> float:
    return x if on else 0.0


LARGE, ZERO, WRONG = 3000000000, Inner(0), Inner(0.5, 2.5)
LONG, PLAIN = Record(1.0, Vector((1.0,) * 4), START), Record(1.0, (1.0, 2.0, 3.0), START)


def _nothing(x: float) -> None:
    if x > 1.0:
        raise Refusal("no")


def _none(x: float) -> None:
    return x


def _any(v: Vector) -> float:
    return v.sum()


_twice = {2: lambda x: x * 2.0}
_rebound = _twice[2]


"""

floats = st.floats() | st.floats(-3.0, 3.0) | st.sampled_from([0.0, -0.0, 1.0, 0.5, 5e-324, 1e308])
integers = st.integers(-(2**31), 2**31 - 1) | st.integers(-5, 8)
KINDS = {"a float": floats, "an int": integers, "a bool": st.integers(0, 1)}


def text_of() -> str:
    functions = [text.replace("def f(", f"def f{i}(") for i, text in enumerate(CONSTRUCTS.values())]
    return "\n\n".join([HEAD + SHARED, *functions])


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Twins]:
    return {}


def twins_of(kept: dict[str, Twins], command: str, factory: pytest.TempPathFactory) -> Twins:
    """All functions, compiled once."""
    if command not in kept:
        folder = factory.mktemp("constructs")
        name = f"constructs_{len(kept)}"
        kept[command] = Twins(module_of(text_of(), folder, name), folder, COMMANDS[command])
    return kept[command]


def marked(command: str) -> Any:
    there = find_spec("ziglang") if command == "zig" else shutil.which(command)
    missing = pytest.mark.skipif(not there, reason=f"{command} is not installed")
    return pytest.param(command, marks=[missing, *([pytest.mark.slow] if command != "gcc" else [])])


@pytest.mark.parametrize("command", [marked(command) for command in COMMANDS])
@pytest.mark.parametrize("name", CONSTRUCTS)
def test_python_and_c_agree_bit_for_bit(
    twins: dict[str, Twins], tmp_path_factory: pytest.TempPathFactory, command: str, name: str
):
    both = twins_of(twins, command, tmp_path_factory)
    function = f"f{[*CONSTRUCTS].index(name)}"
    types = sizes_of(both.functions[function])

    @given(st.tuples(*(st.sampled_from([*t.made]) if t.made else KINDS[t.word] for t in types)))
    @settings(max_examples=20, deadline=None)
    def agree(numbers: tuple[float, ...]) -> None:
        python, c = both.python(function, numbers), both.c(function, numbers)
        if c.error == TOO_LARGE:
            # C has no room where Python has: it reports that, and gives no other number.
            return
        assert bool(python.error) == bool(c.error)
        if name.startswith("raise"):
            assert python.error == c.error
        assert python.bits == c.bits

    agree()


def test_no_element_of_a_temporary_value_is_read(
    twins: dict[str, Twins], tmp_path_factory: pytest.TempPathFactory
):
    """C99, 6.5.2.2: a function's result ends with the next sequence point."""
    text = twins_of(twins, COMPILED, tmp_path_factory).text
    assert not re.search(r"\)(\.\w+)*\.v\[", text)


@pytest.mark.parametrize("name", ["int +", "int *", "floor"])
def test_an_integer_that_c_cannot_hold_is_refused(
    twins: dict[str, Twins], tmp_path_factory: pytest.TempPathFactory, name: str
):
    both = twins_of(twins, COMPILED, tmp_path_factory)
    function = f"f{[*CONSTRUCTS].index(name)}"
    given_ = (2.0**31,) if name == "floor" else (2**31 - 1, 2**31 - 1)
    assert both.c(function, given_).error == TOO_LARGE
    assert not isnan(sum(given_))


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("y = float(sum(k * a for k, a in enumerate(v, 1)))", "sum of floats is not in"),
        ("for k, a in enumerate(v, int(y)): y += k * a", "enumerate with a start that is not a c"),
        ("for a, b in zip(v, v, strict=True): y += a * b", "zip with strict="),
        ("for k in enumerate(v): y += k[1]", "enumerate without a name for each part"),
        ("y = max(y, v[1], key=abs)", "max with key="),
        ("y = max(*v)", "max with a star"),
        ("y = 1.0 * round(v[1], ndigits=1)", "round with ndigits="),
        ("y = v.sum(axis=0)", "sum with axis="),
        ("y = 1.0 * float(*v)", "float with a star"),
        ("y = Texts(y, 'b').a", "Texts.b: texts are for raise Refusal(...) only"),
        ("y = Lists((y,)).a[0]", "Lists.a: list[float] is not a type in the language"),
        ("y = _listed((y,))", "the argument x of _listed: list[float] is not a type"),
        ("y = _listing(y)[0]", "the result of _listing: tuple[float, ...] is not a type"),
        ("y = y**0.5", "** with other than a whole constant is not in"),
        ("y = y**y", "** with other than a whole constant is not in"),
        ("y = v**2", "a Vector of 3 where a number is wanted"),
        ("for k in range(N / 2): y += k", "a bound of a range that is a float, not an int"),
        ("y = v[: int(y)].sum()", "a slice other than a constant one"),
        ("y = v[:: N - 3].sum()", "a slice with a step of 0"),
        ("y = Vector(1.0 for _ in range(N - 3)).sum()", "a number of elements that is not a con"),
        ("for k, a in zip(range(int(y)), v): y += k", "a range of other than constants"),
        ("for k, a in zip(range(-(2**31), 2**31, 3), v): y += k", "2147483648 is an int"),
        ("for k, a in zip(range(-2147483647, 2147483647), v): y += k", "a range of so many"),
        ("for k in range(3): k = 0.5 * y", "k is an int and gets a float"),
        ("for v in v: y += v", "v is a Vector of 3 and gets a float: use another name"),
        ("y = interpolate(y, (0, 1), (10, 20))", "a tuple of 2 with other than floats"),
        ("y = {1: y}[1]", "a dict is not in the language of equations; use a NamedTuple"),
        ("k = 3000000000", "3000000000 is an int of more than 32 bits: write 3000000000.0"),
        ("y = Vector(0.0 for _ in range(70000)).sum()", "a Vector of 70000 is too large for C"),
        ("k = LARGE", "3000000000 is an int of more than 32 bits"),
        ("y += A[0:1, 2]", "a slice of a Matrix: its column j is A.T[j]"),
        ('raise Refusal(f"{y!r}")', "!r in a text"),
        ("y, y = 1.0, y", "a name twice in one assignment"),
        (
            "def g(a: float) -> float:\n        return a + y\n"
            "    def h(b: float) -> float:\n        y = 2.0 * b\n        return g(b) + y\n"
            "    y = h(v[0])",
            "y, which g uses, is changed",
        ),
        (
            "z = 2.0\n    def g(a: float) -> float:\n        return a + z\n"
            "    def h(z: float) -> float:\n        return g(z)\n    y = h(y)",
            "z has two meanings here: rename one",
        ),
        (
            "def g(a: float) -> float:\n        return a + y\n    w = Vector(g(y) for y in v)",
            "y has two meanings here: rename one",
        ),
        ("for a in POWERS: y += a\n    for a in v: y += a\n    y += a", "a is an int and gets a f"),
        ("for k in foo(y):\n        break", "foo is not a function of equations"),
        ("y += 1.0\n    def y(a: float) -> float:\n        return a", "y is given a value twice"),
        ("if N > 5:\n        def g() -> float:\n            return 1.0\n    y = g()", "g may have"),
        ("for k in range(2 ** 3.0): y += k", "a bound of a range that is a float, not an int"),
        ("for k, a in enumerate(v, -(2**31) - 2): y += a", "-2147483650 is an int of more than 32"),
        ("t = tuple('a' for _ in range(3))", "a tuple of texts; choose between texts by if"),
        ("y = _why(y)", "the default value of why is an int where a text is wanted"),
        ("y = _on(y)", "the default value of on is an int where a bool is wanted"),
        ("why = 'a\\0b'\n    raise Refusal(f'{why}!')", "a text with a NUL"),
        ("raise Refusal('\\ud800')", "or with half a letter"),
        ("raise Refusal(f'{v}')", "{v} in a text"),
        ("k = int(y)\n    match k:\n        case 1.5: y = 1.0\n        case 2: y = 2.0",
         "a case other than an int"),
        ("k = 1\n    k = v", "k is an int and gets a Vector of 3: use another name"),
        ("k = Inner(y, Inner(y))", "an Inner where an int is wanted"),
        ("y = math.foo(y)", "the name math.foo is not known here"),
        ("y = 1.0\n    yield y", "yield is not in the language"),
        ("raise Refusal('a\\0b')", "a text with a NUL"),
        ("raise Refusal('a') from y", "a raise with from is not in the language"),
        ("raise KeyError('a')", "KeyError may not be raised: write raise Refusal(...)"),
        ("w = ((0.0,) * 10**9)[:1]", "a tuple of 1 times 1000000000 is too large for C"),
        ("w = tuple(1.0 for _ in range(10**9))", "a tuple of 1000000000 is too large for C"),
        ("def g(a: float) -> float:\n        return g(a)\n    y = g(y)", "g calls itself"),
        ("y = v(1.0)", "a Vector of 3 is called"),
        (
            "if y < 0.0: y = 0.0\n" + "".join(f"    elif y < {i}: y += {i}\n" for i in range(110)),
            "more than 100 branches: use a tuple of values, or functions",
        ),
        (
            "k = int(y)\n    match k:\n"
            + "".join(f"        case {i}: y += 1.0\n" for i in range(110)),
            "more than 100 branches: use a tuple of values, or functions",
        ),
        ("k = (y, 3)\n    r = Inner(*k, 4)", "Inner takes a, n"),
        ("k = (3, y)\n    r = Inner(*k)", "*k is an int where a float is wanted"),
        ("y = WRONG.n * y", "WRONG.n is a float where an int is wanted"),
        ("y = LONG.v[2]", "LONG.v is not a Vector of 3"),
        ("y = PLAIN.v[2]", "PLAIN.v is not a Vector of 3"),
        ("y = Default(y).n * y", "the default value of n is a float where an int is wanted"),
        ("_ = y\n    y = _", "a value of _ is not in the language"),
        ("y = 1.0 * len(y)", "len of a float"),
        ("y = 1.0 if y > 0.0 and len(A[int(y)]) > 2 else 2.0", "this is computed only in some cas"),
        ("y = 1.0 * _nothing(y)", "what returns nothing is used as a value"),
        ("k = _nothing(y)", "what returns nothing is used as a value"),
        ("y = _none(y)", "_none returns a value, and its type is None"),
        ("y = _any(v, 5.0)", "_any takes v"),
        ("for k in range(0, 5, 1, 7): y += k", "range with 4 arguments"),
        ("k = (y, 2)\n    y = k.m0", "m0 is not a field of a tuple of 2"),
        ("y = POWERS[1.0]", "a subscript that is a float, not an int"),
        ("y = NESTED[0, 1]", "two subscripts of a tuple of 2"),
        ("w = A[0:1]", "a slice of a Matrix"),
        ('for k in ("a", "b"): y += 1.0', "a tuple of texts; choose between texts by if"),
        ('raise Refusal(f"{y:.{N}f}")', "a format that is computed"),
        ("y = y * sin", "the name sin is not in the language"),
        ("y = _rebound(y)", "<lambda> is not made by def in a module"),
        ("w = Vector(v[0:0])", "a slice without elements"),
        (
            "def g(w: Vector) -> float:\n        return w.sum()\n    y = g(v)",
            "has no size here",
        ),
        (
            "def g(w: flaot) -> float:\n        return w\n    y = g(y)",
            "name 'flaot' is not defined",
        ),
        ("y = " + "y / " * 250 + "y", "an expression of 200 levels: take it apart"),
        ("y = v + Vector((1.0, 2.0))", "a Vector of 3 + a Vector of 2 is not defined"),
        ("k = 0\n    k += 0.5", "k is an int and gets a float: begin with a float"),
        ("y = ZERO.a", "ZERO.a is an int where a float is wanted: write 0.0"),
        ("y = (0, 1.5)[int(y)]", "a tuple of ints and floats: write all of them as floats"),
        (
            "def g(a: float) -> float:\n        return a\n"
            "    def g(a: float) -> float:\n        return 2.0 * a\n    y = g(y)",
            "g is given a value twice",
        ),
        (
            "def g(a: float) -> float:\n        return N * a\n    N = 4.0\n    y = g(y) + N",
            "N may have no value here",
        ),
        (
            "for k in range(3):\n        def g(a: float) -> float:\n            return a * k\n"
            "    y = g(y)",
            "g may have no value here",
        ),
    ],
)  # fmt: skip
def test_what_c_would_compute_otherwise_is_refused(tmp_path: Path, line: str, why: str):
    function = f"def f(y: float, v: Annotated[Vector, 3]) -> float:\n    {line}\n    return y\n"
    constants = WRONG_CONSTANTS
    module = module_of(HEAD + SHARED + constants + function, tmp_path, "refused")
    with pytest.raises((TypeError, Untranslatable), match=re.escape(why)) as error:
        c_text({"f": module.f})
    assert re.match(rf"{tmp_path}/refused\.py:\d+: ", str(error.value))


def test_classes_of_two_modules_may_have_one_name(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "tanks.py").write_text(
        "from __future__ import annotations\n\nfrom typing import NamedTuple\n\n\n"
        "class State(NamedTuple):\n    level: float\n\n\n"
        "def filled(x: float) -> State:\n    return State(x)\n"
    )
    text = HEAD + (
        "from tanks import filled\nfrom fmus.ports.groups import Nothing as Void\n\n\n"
        "class State(NamedTuple):\n    x: float\n\n\nclass Nothing(NamedTuple):\n    x: float\n\n\n"
        "def f(x: float) -> State:\n    return State(2.0 * filled(x).level)\n\n\n"
        "def g(x: float) -> Nothing:\n    _ = Void()\n    return Nothing(x)\n"
    )
    both = Twins(module_of(text, tmp_path, "of_two"), tmp_path)
    for name, numbers in (("f", (6.0,)), ("g", (3.0,))):
        assert both.c(name, (3.0,)).numbers == both.python(name, (3.0,)).numbers == numbers
    sys.modules.pop("tanks")


def test_vectors_may_be_imported_by_another_name(tmp_path: Path):
    text = HEAD + (
        "from auv_fmu import Matrix as M, Vector as V\n\n\n"
        "def f(x: float) -> Annotated[V, 2]:\n"
        "    return M((x * j for j in range(2)) for _ in range(2)) @ V(k + x for k in range(2))\n"
    )
    both = Twins(module_of(text, tmp_path, "renamed"), tmp_path)
    assert both.c("f", (3.0,)).numbers == both.python("f", (3.0,)).numbers == (12.0, 12.0)


def test_a_variable_may_be_named_as_c_would_name_what_it_uses(tmp_path: Path):
    """In tank.py, `tank_level` and `tank_AREA` for the function `level` and the constant `AREA`."""
    text = HEAD + (
        "AREA = 2.0\n\n\n"
        "def level(x: float) -> float:\n    return x / AREA\n\n\n"
        "def f(x: float) -> float:\n    tank_AREA = 3.0 * AREA\n    tank_level = level(x)\n"
        "    return tank_level + tank_AREA\n"
    )
    both = Twins(module_of(text, tmp_path, "tank"), tmp_path)
    assert both.c("f", (3.0,)).numbers == both.python("f", (3.0,)).numbers == (7.5,)


def test_a_choice_of_many_is_written_side_by_side():
    """A thread has an empty stack."""
    x = tree.Local("x", FLOAT)
    body: list[tree.Statement] = [tree.Return(x)]
    for k in range(900):
        test = tree.Operation(tree.LESS, (x, tree.Number(float(k), FLOAT)), BOOL)
        body = [tree.If(test, [tree.Return(tree.Number(0.5, FLOAT))], body)]
    function = tree.Function("own", "f", {"x": FLOAT}, FLOAT, body)
    with ThreadPoolExecutor() as pool:
        text = pool.submit(lambda: Emitter([function]).text()).result()
    assert text.count("\n    } else if (x < ") == 899
    assert text.endswith("\n    } else {\n        return x;\n    }\n}")


def test_variables_are_declared_in_the_order_of_their_first_use(tmp_path: Path):
    """The GUID of an FMU follows from its text, which must be the same in each process."""
    names = "qwertyuiop"
    stores = [f"{name} = {i}.0 * x" for i, name in enumerate(names)]
    text = HEAD + (
        f"def f(x: float) -> float:\n    if x > 0.0:\n        {'; '.join(stores)}\n"
        f"    else:\n        {'; '.join(reversed(stores))}\n    return {' + '.join(names)}\n"
    )
    text = c_text({"f": module_of(text, tmp_path, "ordered").f})
    assert re.findall(r"    double (\w) = 0", text) == [*names]


def test_constants_of_one_value_keep_their_names(tmp_path: Path):
    text = HEAD + (
        "KILO, GRAMS = 1000.0, 1000.0\n\n\ndef f(x: float) -> float:\n    return x * KILO / GRAMS\n"
    )
    both = Twins(module_of(text, tmp_path, "units"), tmp_path)
    assert "units_KILO" in both.text
    assert "units_GRAMS" in both.text
    assert both.c("f", (3.0,)).numbers == (3.0,)


def test_classes_functions_and_constants_share_no_name(tmp_path: Path):
    """In a module whose own name begins as classes, or names of C, do."""
    text = HEAD + (
        "class Foo(NamedTuple):\n    x: float\n    n: int\n\n\n"
        "class Foox2(NamedTuple):\n    y: float\n\n\nclass Foo_bar(NamedTuple):\n    z: float\n"
        "\n\nx2 = 5.0\n\n\n"
        "def bar(x: float, both: tuple[Foo, Foo], of: Foox2) -> Foo_bar:\n"
        "    return Foo_bar(both[0].x + 10.0 * of.y + x2 * x)\n"
    )
    for module in ("Foo", "_Foo", "__"):
        folder = tmp_path / module
        folder.mkdir()
        both = Twins(module_of(text, folder, module), folder)
        numbers = (2.0, 1.0, 1, 3.0, 1, 4.0)
        assert both.c("bar", numbers) == both.python("bar", numbers)
        assert both.c("bar", numbers).numbers == (51.0,)


def test_constants_of_one_name_keep_their_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """One is imported and redefined, one imported by another name, one like a member."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "gains.py").write_text(
        "from __future__ import annotations\n\nGAIN = 2.0\nOTHER = 3.0\n\n\n"
        "def gained(x: float) -> float:\n    return x * GAIN * OTHER\n"
    )
    text = (
        HEAD
        + SHARED
        + (
            "from gains import GAIN, OTHER as K, gained\n\n"
            "GAIN = 10.0 * GAIN\nOTHER = 7.0\nMode_HEAT, Record_v = 40, 5.0\n\n\n"
            "def f(x: float) -> float:\n"
            "    return gained(x) + GAIN + 100.0 * K + OTHER + Mode.HEAT + Mode_HEAT + Record_v\n"
        )
    )
    both = Twins(module_of(text, tmp_path, "with_gains"), tmp_path)
    sys.modules.pop("gains")
    assert both.c("f", (1.0,)).numbers == both.python("f", (1.0,)).numbers == (380.0,)


def test_a_function_that_is_bound_again_is_the_one_it_was(tmp_path: Path):
    text = HEAD + (
        "def h(x: float) -> float:\n    return x + 1.0\n\n\nold = h\n\n\n"
        "def h(x: float) -> float:\n    return x * 5.0\n\n\n"
        "def f(x: float) -> float:\n    return old(x) - h(x)\n"
    )
    both = Twins(module_of(text, tmp_path, "bound_again"), tmp_path)
    assert both.c("f", (3.0,)).numbers == both.python("f", (3.0,)).numbers == (-11.0,)


def test_comments_stay_comments(tmp_path: Path):
    text = HEAD + (
        "def f(x: float) -> float:\n"
        '    """Twice */ x."""\n'
        "    y = x  # a */ b ??/\n    y += x  # see a */ y = 5.0; /* b\n    return y\n"
    )
    both = Twins(module_of(text, tmp_path, "commented"), tmp_path)
    assert both.c("f", (3.0,)).numbers == (6.0,)


def test_numbers_of_numpy_are_refused(tmp_path: Path):
    """An operation with one gives another, which divides by zero."""
    text = HEAD.replace("import math\n", "import math\n\nimport numpy as np\n") + (
        "G = np.float64(2.0) * 1.5\n\n\ndef f(x: float) -> float:\n    return G * x\n"
    )
    with pytest.raises(Untranslatable, match=r"G is not a number.*write float\(...\)"):
        c_text({"f": module_of(text, tmp_path, "with_numpy").f})


def test_functions_are_files_of_one_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Modules in the folder of a component are translated with it."""
    (tmp_path / "helpers_beside.py").write_text(
        "from __future__ import annotations\n\n\ndef half(x: float) -> float:\n    return x / 2.0\n"
    )
    text = (
        HEAD
        + "from helpers_beside import half\n\n\ndef f(x: float) -> float:\n    return half(x)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    both = Twins(module_of(text, tmp_path, "with_helpers"), tmp_path)
    assert both.c("f", [3.0]).numbers == both.python("f", [3.0]).numbers == (1.5,)
