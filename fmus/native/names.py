"""Names in C: of variables, which no two share, and those that C has for itself."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from unicodedata import category

from fmus.language.mathematics import FUNCTIONS

#: What all components share in C.
RUNTIME = Path(__file__).parent / "runtime"

#: Names that C has for itself.
_TAKEN = frozenset(
    (
        # keywords that Python lacks
        "auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float",
        "goto", "inline", "int", "long", "register", "restrict", "short", "signed", "sizeof",
        "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "asm",
        "typeof", "alignas", "alignof", "constexpr", "nullptr", "static_assert", "thread_local",
        "typeof_unqual", "true", "false",
        # of C++, which some compile these sources with, and macros of some compilers
        "bool", "catch", "delete", "friend", "linux", "namespace", "new", "operator", "private",
        "protected", "public", "template", "this", "throw", "unix", "using", "virtual",
        # macros and types of the headers; longer ones in capitals are all taken
        "EOF", "L_ctermid", "L_tmpnam", "L_tmpnam_s", "M_E", "NAN", "P_tmpdir", "environ", "errno",
        "isascii", "iscsym", "iscsymf", "math_errhandling", "matherr", "onexit_t", "pclose",
        "popen", "sa_handler", "sa_sigaction", "sched_priority", "stderr", "stdin", "stdout",
        "sys_errlist", "sys_nerr", "toascii", "wcswcs", "wpopen",
        # what functions are given
        "error", "raise_error", *FUNCTIONS,
    )
)  # fmt: skip

#: Words in capitals: the headers of each system have macros of their own, and modes.h has others.
_MACROS = re.compile(r"[A-Z][A-Z0-9_]{3,}|MASK_\w+")

#: Functions and types of the C libraries that could be those of a module and a function in it.
_LIBRARY = re.compile(
    r"(aligned|at|clock|cpu|fmi2|fmi3|function|getdate|is|max|mem|open|posix|pthread|quick|rlim|sched"
    r"|sig|stack|str|sys|syscall|timer|timespec|u|uint|va)_\w+|[a-z]+_([a-z]|unlocked|explicit)"
    r"|int_(fast|least)\d+_\w+|model_\w+|choices_of_\w+|members_\d+"
)

#: Names of structures: of classes, and of tuples, which are joined from those of their parts.
_CLASS = r"[A-Z][a-z]\w+"
_STRUCTURE = rf"{_CLASS}|class_\w+|(int|double)(x\d+|_\w+)"

#: Variables that have one, or begin with _ as much in headers does.
_PREFIXED = re.compile(rf"(v_)*({_STRUCTURE}|_\w+)")


@cache
def in_c(name: str) -> str:
    """The name of a variable or a member in C; no two have the same."""
    name = _without_marks(name)
    if _PREFIXED.fullmatch(name):
        return f"v_{name}"
    stem = name.rstrip("_")
    is_called = stem in _arithmetic() or stem.removeprefix("math_") in FUNCTIONS
    return f"{name}_" if stem in _TAKEN or is_called or _MACROS.fullmatch(stem) else name


def class_in_c(name: str) -> str:
    """The name of the structure of a class."""
    name = _without_marks(name)
    return name if re.fullmatch(_CLASS, name) else f"class_{name}"


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
    """The functions of arithmetic.h."""
    text = (RUNTIME / "arithmetic.h").read_text(encoding="utf-8")
    return frozenset(re.findall(r"^static [\w ]*?(\w+)\(", text, re.MULTILINE))
