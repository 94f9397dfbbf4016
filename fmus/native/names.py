"""Names in C: unique names of variables, and names that C reserves."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from unicodedata import category

from fmus.language.mathematics import FUNCTIONS

#: Folder of the C code that all components share.
RUNTIME = Path(__file__).parent / "runtime"

#: Names that C reserves.
_TAKEN = frozenset(
    (
        # keywords that Python lacks
        "auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float",
        "goto", "inline", "int", "long", "register", "restrict", "short", "signed", "sizeof",
        "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "asm",
        "typeof", "alignas", "alignof", "constexpr", "nullptr", "static_assert", "thread_local",
        "typeof_unqual", "true", "false",
        # keywords of C++, as which some users compile these sources, and macros of some compilers
        "bool", "catch", "delete", "friend", "linux", "namespace", "new", "operator", "private",
        "protected", "public", "template", "this", "throw", "unix", "using", "virtual",
        # macros and types of the headers; longer names in capitals are all excluded
        "EOF", "L_ctermid", "L_tmpnam", "L_tmpnam_s", "M_E", "NAN", "P_tmpdir", "environ", "errno",
        "isascii", "iscsym", "iscsymf", "math_errhandling", "matherr", "onexit_t", "pclose",
        "popen", "sa_handler", "sa_sigaction", "sched_priority", "stderr", "stdin", "stdout",
        "sys_errlist", "sys_nerr", "toascii", "wcswcs", "wpopen",
        # names in the generated functions
        "error", "raise_error", *FUNCTIONS,
    )
)  # fmt: skip

#: Names in capitals: headers of each system, and ours, define macros.
_MACROS = re.compile(r"[A-Z][A-Z0-9_]{3,}|MASK_\w+")

#: Functions and types of C libraries with the form MODULE_FUNCTION.
_LIBRARY = re.compile(
    r"(aligned|at|clock|cpu|fmi2|fmi3|function|getdate|is|max|mem|open|posix|pthread|quick|rlim|sched"
    r"|sig|stack|str|sys|syscall|timer|timespec|u|uint|va)_\w+|[a-z]+_([a-z]|unlocked|explicit)"
    r"|int_(fast|least)\d+_\w+|model_\w+|choices_of_\w+|members_\d+"
)

#: Names of structures: for classes, and for tuples, joined from the names of their parts.
_CLASS = r"[A-Z][a-z]\w+"
_STRUCTURE = rf"{_CLASS}|class_\w+|(int|double)(x\d+|_\w+)"

#: Variables with the name of a structure, or with a leading _ like many names in headers.
_PREFIXED = re.compile(rf"(v_)*({_STRUCTURE}|_\w+)")


@cache
def in_c(name: str) -> str:
    """Return the name of a variable or a member in C; different names stay different."""
    name = _without_marks(name)
    if _PREFIXED.fullmatch(name):
        return f"v_{name}"
    stem = name.rstrip("_")
    is_called = stem in _arithmetic() or re.sub("^(math|dual)_", "", stem) in FUNCTIONS
    return f"{name}_" if stem in _TAKEN or is_called or _MACROS.fullmatch(stem) else name


def class_in_c(name: str) -> str:
    """Return the name of the structure of a class."""
    name = _without_marks(name)
    return name if re.fullmatch(_CLASS, name) else f"class_{name}"


def _without_marks(name: str) -> str:
    """Replace combining marks by numbers, since not all compilers accept them in names."""
    name = re.sub(r"_u+(?=[0-9a-f]{5})", r"\g<0>u", name)
    return "".join(f"_u{ord(c):05x}" if category(c).startswith("M") else c for c in name)


@cache
def words_of_runtime() -> frozenset[str]:
    """Return all names in the runtime, which functions, constants and structures cannot have."""
    texts = [path.read_text(encoding="utf-8") for path in sorted(RUNTIME.glob("*.[ch]"))]
    code = re.sub(r"/\*.*?\*/", "", "\n".join(texts), flags=re.DOTALL)
    return frozenset(re.findall(r"\b[A-Za-z_]\w*\b", code))


def is_of_library(name: str) -> bool:
    """Return True if a C library may have a function, a type or a macro of this name."""
    return name in _TAKEN or any(pattern.fullmatch(name) for pattern in (_LIBRARY, _MACROS))


@cache
def _arithmetic() -> frozenset[str]:
    """Return the functions of arithmetic.h and dual.h."""
    texts = ((RUNTIME / name).read_text(encoding="utf-8") for name in ("arithmetic.h", "dual.h"))
    return frozenset(re.findall(r"^static [\w ]*?(\w+)\(", "\n".join(texts), re.MULTILINE))
