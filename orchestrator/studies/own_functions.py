"""The user's own indices that are functions of a result."""

from __future__ import annotations

import dis
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from sysconfig import get_path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, Self

from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.texts import matches
from orchestrator.runs.result import Result, check_function
from orchestrator.vehicle.indices import columns_of, numbers_of

#: Pickles functions that have no name in a module, if it is installed.
_BY_VALUE = "cloudpickle"


@dataclass(frozen=True)
class OwnFunction:
    """An index that is a function of a result.

    Attributes:
        name: of the index.
        function: returns a number, or a list or dictionary of numbers.
        columns: of the index in the table of a study; empty as long as they are not known.

    """

    name: str
    function: Callable[[Result], object]
    columns: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """Hash of the function and its columns."""
        content = [*_made_of(self.function, None, []), *self.columns]
        return sha256("\0".join(content).encode(errors="surrogatepass")).hexdigest()

    def with_columns(self, columns: Iterable[str]) -> Self:
        """Return the index with its columns, found among all columns of a run."""
        return replace(self, columns=tuple(name for name in columns if matches(name, self.name)))

    def values(self, result: Result) -> dict[str, float]:
        """Return the numbers of a run, by their columns.

        Raises:
            InputError: the function has raised an exception, or returned something else.

        """
        try:
            returned = self.function(result)
        except Exception as error:
            why = f"{type(error).__name__}: {reason(error)}"
            raise InputError(f"index {self.name}: {why}") from error
        values = columns_of(self.name, numbers_of(self.name, returned))
        if self.columns and (more := values.keys() - self.columns):
            columns = ", ".join(self.columns)
            raise InputError(f"index {self.name}: gives {min(more)}, but at first {columns}")
        return values

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the function, with its content if it has no name in a module."""
        return _restored, (self.name, _pickled(self.function), self.columns)


def _restored(name: str, content: bytes, columns: tuple[str, ...]) -> OwnFunction:
    return OwnFunction(name, pickle.loads(content), columns)


def _pickled(function: Callable[[Result], object]) -> bytes:
    if find_spec(_BY_VALUE) is None:
        return pickle.dumps(function)
    by_value = import_module(_BY_VALUE)
    named = function.func if isinstance(function, partial) else function
    module = sys.modules.get(str(getattr(named, "__module__", "")))
    # Other processes may not find a module of the user.
    is_own = module is not None and module.__name__ != "__main__" and not _is_installed(module)
    if is_own:
        by_value.register_pickle_by_value(module)
    try:
        content: bytes = by_value.dumps(function)
    finally:
        if is_own:
            by_value.unregister_pickle_by_value(module)
    return content


def _is_installed(module: ModuleType) -> bool:
    """Return True for a module of Python or of an installed package."""
    folders = (get_path(name) for name in ("stdlib", "purelib", "platlib"))
    file = getattr(module, "__file__", None)
    return file is None or any(map(Path(file).is_relative_to, folders))


def own_functions(functions: Mapping[str, Callable[[Result], object]]) -> tuple[OwnFunction, ...]:
    """Return the user's functions as indices.

    Raises:
        InputError: a name cannot be that of an index, or a function cannot be sent to a process.

    """
    for name, function in functions.items():
        check_function(name, function)
        why = ""
        try:
            _pickled(function)
        except Exception as error:
            why = reason(error)
        is_typed = getattr(function, "__module__", "") == "__main__" and not _has_file()
        if why or (is_typed and find_spec(_BY_VALUE) is None):
            raise InputError(
                f"index {name}: cannot be sent to other processes{why and f' ({why})'}: install "
                f"{_BY_VALUE}, or define it by def in a file"
            )
    return tuple(OwnFunction(name, function) for name, function in functions.items())


def _has_file() -> bool:
    """Return True if this process runs a script, which its workers can import."""
    return Path(getattr(sys.modules["__main__"], "__file__", "")).is_file()


def _made_of(value: object, module: str | None, seen: list[FunctionType]) -> Iterator[str]:
    """Yield texts that differ if a function is another one.

    These are its compiled code, and the values that it uses from its module, from functions around
    it and as defaults; functions of its module count like it, those of other modules do not. Other
    values count as Python prints them, unless it prints where they are in memory.
    """
    if isinstance(value, MethodType):
        used: list[object] = [value.__func__, value.__self__]
    elif isinstance(value, partial):
        used = [value.func, *value.args, *value.keywords.items()]
    elif isinstance(value, FunctionType):
        if module not in (None, value.__module__) or value in seen:
            return
        module = value.__module__
        seen.append(value)
        codes, used = [value.__code__], []
        for code in codes:
            yield repr((code.co_code, code.co_names))
            for constant in code.co_consts:
                (codes if isinstance(constant, CodeType) else used).append(constant)
        steps = chain(*map(dis.get_instructions, codes))
        names = dict.fromkeys(step.argval for step in steps if step.opname == "LOAD_GLOBAL")
        used += [value.__globals__[name] for name in names if name in value.__globals__]
        used += [cell.cell_contents for cell in value.__closure__ or ()]
        used += [value.__defaults__, value.__kwdefaults__]
    else:
        # A set is printed in another order by another process.
        shown = sorted(map(repr, value)) if isinstance(value, Set) else repr(value)
        if not isinstance(value, ModuleType) and " at 0x" not in str(shown):
            yield str(shown)
        return
    for each in used:
        yield from _made_of(each, module, seen)
