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

from auv_fmu.language import vectors
from auv_fmu.language.arrays import Matrix, Vector
from fmus.ports.groups import hints_of, is_class, is_record

#: What all components share in C.
RUNTIME = Path(__file__).parent / "runtime"

#: How a text begins that says where it is about.
PLACED = re.compile(r".+:\d+: ")

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
        "EOF", "L_ctermid", "L_tmpnam", "L_tmpnam_s", "M_E", "NAN", "P_tmpdir", "environ", "errno",
        "isascii", "iscsym", "iscsymf", "math_errhandling", "matherr", "onexit_t", "pclose",
        "popen", "sa_handler", "sa_sigaction", "sched_priority", "stderr", "stdin", "stdout",
        "sys_errlist", "sys_nerr", "toascii", "wcswcs", "wpopen",
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
        made: the NamedTuple, Vector or Matrix; None: a plain tuple.

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


#: Words in capitals: the headers of each system have macros of their own, and modes.h has others.
_MACROS = re.compile(r"[A-Z][A-Z0-9_]{3,}|MASK_\w+")

#: Functions and types of the C libraries that could be those of a module and a function in it.
_LIBRARY = re.compile(
    r"(aligned|at|clock|cpu|fmi2|fmi3|function|getdate|int|is|max|mem|open|posix|pthread|quick|rlim|sched"
    r"|sig|stack|str|sys|syscall|timer|timespec|u|uint|va)_\w+|[a-z]+_([a-z]|unlocked|explicit)"
)

#: Names of structures: of classes, and of tuples, which are joined from those of their parts.
_CLASS = r"[A-Z][a-z]\w+"
_STRUCTURE = rf"{_CLASS}|class_\w+|(int|double)(x\d+|_\w+)"

#: Variables that have one, or begin with _ as much in headers does.
_PREFIXED = re.compile(rf"(v_)*({_STRUCTURE}|_\w+)")

#: Classes that would have the name of a vector or a matrix.
_ARRAYS = re.compile(r"(Vector|Matrix)\d\w*")


@cache
def in_c(name: str) -> str:
    """The name of a variable or a member in C; no two have the same."""
    name = _without_marks(name)
    if _PREFIXED.fullmatch(name):
        return f"v_{name}"
    stem = name.rstrip("_")
    is_taken = stem in _TAKEN | _arithmetic() or _MACROS.fullmatch(stem)
    return f"{name}_" if is_taken else name


def _without_marks(name: str) -> str:
    """A name in which a mark over a letter is a number: not all compilers take marks."""
    name = re.sub(r"_u+(?=[0-9a-f]{5})", r"\g<0>u", name)
    return "".join(f"_u{ord(c):05x}" if category(c).startswith("M") else c for c in name)


@cache
def words_of_runtime() -> frozenset[str]:
    """All names in the runtime, which functions, constants and structures cannot have."""
    texts = [path.read_text(encoding="utf-8") for path in sorted(RUNTIME.glob("*.[ch]"))]
    code = re.sub(r"/\*.*?\*/", "", "\n".join(texts), flags=re.DOTALL)
    return frozenset(re.findall(r"\b[A-Za-z_]\w*\b", code))


def is_of_library(name: str) -> bool:
    """Whether a C library may have a function, a type or a macro of this name."""
    return name in _TAKEN or any(one.fullmatch(name) for one in (_LIBRARY, _MACROS))


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
    if is_record(hint):
        fields = hints_of(hint).items()
        parts = [(f".{in_c(name)}", _field(hint, name, part)) for name, part in fields]
        name = _without_marks(hint.__name__)
        is_free = re.fullmatch(_CLASS, name) and not _ARRAYS.fullmatch(name)
        is_taken = not is_free or name in words_of_runtime()
        return Structure(f"class_{name}" if is_taken else name, tuple(parts), hint)
    name = hint.__name__ if isinstance(hint, type) else hint
    raise TypeError(f"{name} is not a type in the language of equations")


def _field(made: type, name: str, hint: Any) -> Shape:
    """The shape of a field of a class."""
    try:
        shape = shape_of(hint)
        if shape == TEXT:
            raise TypeError("texts are for raise Refusal(...) only")
    except TypeError as error:
        if PLACED.match(str(error)):
            raise
        raise TypeError(f"{place_of(made, name)}{made.__name__}.{name}: {error}") from None
    return shape


def place_of(made: type, field: str = "") -> str:
    """Where a class stands, or a field of it, as the beginning of a message; empty: not known."""
    try:
        lines, first = inspect.getsourcelines(made)
        path = inspect.getsourcefile(made)
    except OSError:
        return ""
    at = [i for i, line in enumerate(lines) if field and re.match(rf"\s+{field}\s*:", line)]
    return f"{path}:{first + (at or [0])[0]}: "


def has_no_size(hint: Any) -> bool:
    """Whether a type is a vector or a matrix of any size, or a tuple with one."""
    parts = get_args(hint) if get_origin(hint) is tuple else ()
    return hint in (Vector, Matrix) or any(map(has_no_size, parts))


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
