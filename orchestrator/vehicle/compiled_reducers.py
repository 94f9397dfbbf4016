"""Indices over rows, compiled: the numbers of their hooks in Python, far sooner."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_void_p, create_string_buffer
from functools import cache
from hashlib import sha256
from itertools import chain
from pathlib import Path

import numpy as np
from fmpy import platform_tuple, sharedLibraryExtension

from fmus.compilers import EXPORTED, FLAGS, MATHEMATICS
from fmus.language.build import Untranslatable
from fmus.native.names import RUNTIME
from fmus.native.reducer import text_over_rows
from fmus.ports.reducer import Reducer
from orchestrator.machine.cache import made_once, read_cached
from orchestrator.machine.children import compile_text, find_fast_compiler
from orchestrator.master.experiment import Experiment
from orchestrator.system.values import Value

#: Category in the cache.
CATEGORY = "indices"

#: Sources of the runtime that the indices include.
_INCLUDED = ("arithmetic.h", "error.h", "text.c", "host.h")


class Raised(ArithmeticError):
    """What a hook has raised, in words, and the time of the row that it was [s]."""

    def __init__(self, why: str, time: float) -> None:
        """Say what, and when."""
        super().__init__(why)
        self.time = time


@cache
def library_of(reducer: Reducer) -> CDLL | None:
    """The library of an index; None: there is none, and no compiler that takes no time."""
    try:
        text = text_over_rows(reducer)
    except Untranslatable:
        return None
    digest = sha256("\0".join((text, *FLAGS, platform_tuple)).encode())
    for name in _INCLUDED:
        digest.update((RUNTIME / name).read_bytes())
    key, name = digest.hexdigest()[:24], f"indices{sharedLibraryExtension}"
    with suppress(OSError):
        if read_cached(CATEGORY, key) or find_fast_compiler():
            place = made_once(CATEGORY, key, lambda: {name: _compiled(text)})[name]
            return _loaded(place)
    return None


def _compiled(text: str) -> bytes:
    compiler = find_fast_compiler()
    assert compiler is not None
    options = (*FLAGS, *EXPORTED, f"-I{RUNTIME}", "-w", *MATHEMATICS)
    return compile_text(compiler, text, *options)


def _loaded(place: Path) -> CDLL:
    library = CDLL(str(place))
    library.size_of_rows.restype = c_size_t
    library.why.argtypes, library.why.restype = (c_void_p,), c_char_p
    library.take_rows.argtypes = (
        c_void_p, c_void_p, c_int, c_int, c_void_p, c_void_p, c_int, c_double, c_double,
    )  # fmt: skip
    library.give_numbers.argtypes = (c_void_p, c_double, c_double, c_void_p)
    return library


class CompiledReduction:
    """An index of a run in progress."""

    def __init__(
        self,
        library: CDLL,
        reducer: Reducer,
        places: Mapping[str, int],
        constants: Mapping[str, Value],
        run: Experiment,
    ) -> None:
        """Start with no rows.

        Args:
            library: of the index.
            reducer: that it is.
            places: in a row, by the names of its ports, of those that change.
            constants: values of the others.
            run: that the rows are of.

        """
        self._library, self._reducer, self._run = library, reducer, run
        self._memory = create_string_buffer(library.size_of_rows())
        names = [port.name for port in reducer.ports]
        self._from = np.array([places.get(name, -1) for name in names], dtype=np.intc)
        self._constants = np.array([float(constants.get(name, 0.0)) for name in names])

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account.

        Raises:
            Raised: by one of them.

        """
        rows = np.ascontiguousarray(rows)
        taken = self._library.take_rows(
            self._memory, rows.ctypes.data, len(rows), rows.shape[1], self._from.ctypes.data,
            self._constants.ctypes.data, self._run.acting_row, self._run.start_time,
            self._run.stop_time,
        )  # fmt: skip
        if taken < len(rows):
            raise Raised(self._library.why(self._memory).decode(), float(rows[taken, 0]))

    def found(self) -> list[float]:
        """The numbers of its results, in their order.

        Raises:
            Raised: by what gives them.

        """
        found = np.empty(sum(1 for _ in chain(*self._reducer.results.values())))
        run = self._run
        if self._library.give_numbers(
            self._memory, run.start_time, run.stop_time, found.ctypes.data
        ):
            raise Raised(self._library.why(self._memory).decode(), run.stop_time)
        numbers: list[float] = found.tolist()
        return numbers
