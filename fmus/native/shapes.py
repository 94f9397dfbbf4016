"""The shapes of types: what a type of the equations is in C, a number or a structure of them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin
from unicodedata import category

from auv_fmu import vectors
from auv_fmu.arrays import Matrix, Vector
from fmus.ports.groups import hints_of, is_class

#: What all components share in C.
RUNTIME = Path(__file__).parent / "runtime"

#: A vector or matrix may be copied to the stack, which has 1 MB in Windows.
_MOST_NUMBERS = 65_536

#: Names that C has for itself.
_TAKEN = frozenset(
    (
        # keywords that Python lacks
        "auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float",
        "goto", "inline", "int", "long", "register", "restrict", "short", "signed", "sizeof",
        "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile",
        # of C++, which some compile these sources with, and macros of some compilers
        "bool", "catch", "delete", "friend", "linux", "namespace", "new", "operator", "private",
        "protected", "public", "template", "this", "throw", "unix", "using", "virtual",
        # macros and types of the headers; longer ones in capitals are all taken
        "EOF", "Error", "M_E", "NAN", "environ", "errno", "matherr", "stderr", "stdin", "stdout",
        # what functions call or are given
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "ceil", "copysign", "cos",
        "cosh", "error", "exp", "expm1", "fabs", "floor", "fmod", "isfinite", "isinf", "isnan",
        "log", "log10", "log1p", "log2", "pow", "sin", "sinh", "sqrt", "tan", "tanh",
        "trunc",
    )
)  # fmt: skip


@dataclass(frozen=True)
class Scalar:
    """A number, or a text of a refusal.

    Attributes:
        name: of its type in C.
        word: what readers call it.

    """

    name: str
    word: str


@dataclass(frozen=True)
class Structure:
    """A tuple: an array `v` where its elements are alike, else one member an element.

    Attributes:
        name: of the structure in C.
        parts: how each element is written after a name, and its shape.
        made: the NamedTuple or TypedDict, Vector or Matrix; None: a plain tuple.

    """

    name: str
    parts: tuple[tuple[str, Shape], ...]
    made: Any = None

    @property
    def is_array(self) -> bool:
        """Whether its elements stand in an array."""
        return bool(self.parts) and self.parts[0][0] == ".v[0]"

    @property
    def word(self) -> str:
        """What readers call it."""
        if self.made is Vector:
            return f"a Vector of {len(self.parts)}"
        if self.made is Matrix:
            row = self.parts[0][1]
            assert isinstance(row, Structure)
            return f"a Matrix of {len(self.parts)} rows of {len(row.parts)}"
        return f"a {self.made.__name__}" if self.made else f"a tuple of {len(self.parts)}"


Shape = Union[Scalar, Structure]

DOUBLE, INTEGER, BOOLEAN, TEXT, NOTHING = (
    Scalar("double", "a float"),
    Scalar("int", "an int"),
    Scalar("int", "a bool"),
    Scalar("const char *", "a text"),
    Scalar("void", "nothing"),
)

_SCALARS: dict[Any, Scalar] = {float: DOUBLE, int: INTEGER, bool: BOOLEAN, str: TEXT}

#: Names of tuples that the equations have given them.
_NAMES = {hint: name for name, hint in vars(vectors).items() if get_origin(hint) is tuple}


#: Words in capitals, for the headers of each system have macros of their own; structures' names.
_PATTERNS = re.compile(
    r"[A-Z][A-Z0-9_]{3,}|_[A-Z]\w*|__\w*|(Vector|Matrix|int|double)(\d*x?\d+|_int|_double)\w*"
)


@cache
def in_c(name: str) -> str:
    """The name of a variable or a member in C."""
    # A mark over a letter is one of its own, which not all compilers take.
    name = "".join(f"_u{ord(c):04x}" if category(c).startswith("M") else c for c in name)
    stem = name.rstrip("_")
    is_taken = stem in _TAKEN | _arithmetic() or _PATTERNS.fullmatch(stem)
    return f"{name}_" if is_taken else name


@cache
def words_of_runtime() -> frozenset[str]:
    """All names in the runtime, which functions, constants and structures cannot have."""
    texts = [path.read_text(encoding="utf-8") for path in sorted(RUNTIME.glob("*.[ch]"))]
    code = re.sub(r"/\*.*?\*/", "", "\n".join(texts), flags=re.DOTALL)
    return frozenset(re.findall(r"\b[A-Za-z_]\w*\b", code))


@cache
def _arithmetic() -> frozenset[str]:
    """The functions of arithmetic.h, which equations call by macros."""
    text = (RUNTIME / "arithmetic.h").read_text(encoding="utf-8")
    return frozenset(re.findall(r"^static [\w ]*?(\w+)\(", text, re.MULTILINE))


def shape_of(hint: Any) -> Shape:
    """What a type is in C.

    Raises:
        TypeError: it is nothing there.

    """
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        sizes = [note for note in notes if type(note) is int]
        if hint is Vector and len(sizes) == 1:
            return vector(*sizes)
        if hint is Matrix and len(sizes) == 2:
            return matrix(*sizes)
    if hint in (Vector, Matrix):
        example = "Vector, 3" if hint is Vector else "Matrix, 2, 3"
        raise TypeError(f"{hint.__name__} has no size here: write Annotated[{example}]")
    if hint in _SCALARS:
        return _SCALARS[hint]
    if get_origin(hint) is tuple and Ellipsis not in get_args(hint):
        return structure([shape_of(part) for part in get_args(hint)], _NAMES.get(hint))
    if is_class(hint, IntEnum):
        return INTEGER
    if isinstance(hint, type) and hasattr(hint, "__annotations__"):
        parts = [(f".{in_c(name)}", shape_of(part)) for name, part in hints_of(hint).items()]
        name = in_c(hint.__name__)
        # A name in lower case may be that of a variable, too.
        is_taken = name in words_of_runtime() or not name[0].isupper()
        return Structure(f"class_{name}" if is_taken else name, tuple(parts), hint)
    name = hint.__name__ if isinstance(hint, type) else hint
    raise TypeError(f"{name} is not a type in the language of equations")


def has_no_size(hint: Any) -> bool:
    """Whether a type is a vector or a matrix of any size."""
    return hint in (Vector, Matrix)


def vector(n: int) -> Structure:
    """The shape of a vector."""
    _check_size(f"a Vector of {n}", n)
    return Structure(f"Vector{n}", tuple((f".v[{i}]", DOUBLE) for i in range(n)), Vector)


def matrix(rows: int, columns: int) -> Structure:
    """The shape of a matrix."""
    _check_size(f"a Matrix of {rows} rows of {columns}", rows * columns)
    row = vector(columns)
    parts = tuple((f".v[{i}]", row) for i in range(rows))
    return Structure(f"Matrix{rows}x{columns}", parts, Matrix)


def _check_size(what: str, n: int) -> None:
    if n < 1:
        raise TypeError(f"{what} is empty")
    if n > _MOST_NUMBERS:
        raise TypeError(f"{what} is too large for C, which takes at most {_MOST_NUMBERS} numbers")


def structure(items: list[Shape], name: str | None = None) -> Structure:
    """The structure of a plain tuple."""
    if TEXT in items:
        raise TypeError("a tuple of texts; choose between texts by if")
    if items and all(item == items[0] for item in items):
        first = items[0]
        own = f"Vector{len(items)}" if first == DOUBLE else f"{first.name}x{len(items)}"
        return Structure(name or own, tuple((f".v[{i}]", item) for i, item in enumerate(items)))
    joined = "_".join(map(_name_of, items)) or "Empty"
    return Structure(name or joined, tuple((f".m{i}", item) for i, item in enumerate(items)))


def _name_of(item: Shape) -> str:
    """The name of a part of a tuple: a tuple within it ends with a mark of its own."""
    is_tuple = isinstance(item, Structure) and item.made is None and not item.is_array
    return f"{item.name}_" if is_tuple else item.name


def inner_structures(shape: Shape) -> Iterator[Structure]:
    """The structures that a structure needs, and itself after them."""
    if isinstance(shape, Structure):
        for _, part in shape.parts:
            yield from inner_structures(part)
        yield shape


def declared(shape: Shape) -> str:
    """A type before a name."""
    return shape.name if shape.name.endswith("*") else f"{shape.name} "


def declaration(shape: Structure) -> str:
    """The definition of a structure, with the comments of a class."""
    made = None if shape.made in (Vector, Matrix) else shape.made
    about = _comments(made)
    members = [f"{part.name} {suffix[1:]};{about.get(suffix, '')}" for suffix, part in shape.parts]
    if shape.is_array:
        members = [f"{shape.parts[0][1].name} v[{len(members)}];"]
    lines = [f"    {line}" for line in members or ["char nothing; /* C has no empty structure */"]]
    text = inspect.cleandoc(made.__doc__ or "").partition("\n")[0] if made else ""
    head = f"/* {strip_sphinx_marks(text)} */\n" if text else ""
    return head + "\n".join(["typedef struct {", *lines, f"}} {shape.name};"])


@cache
def _comments(made: Any) -> dict[str, str]:
    """What `#:` says of the fields of a class, as comments."""
    if made is None:
        return {}
    try:
        text = inspect.getsource(made)
    except OSError:
        return {}  # it was not written as a class
    found = re.findall(r"^    (\w+):.*#: (.*)$", text, re.MULTILINE)
    return {f".{in_c(name)}": f" /* {strip_sphinx_marks(text)} */" for name, text in found}


def strip_sphinx_marks(text: str) -> str:
    """Take the marks that Sphinx reads out of a text."""
    return closed(re.sub(r"(?::\w+:)?`+[~.]?([^`]*)`+", r"\1", text))


def closed(text: str) -> str:
    """A text that does not end the comment it stands in."""
    return text.replace("*/", "* /")
