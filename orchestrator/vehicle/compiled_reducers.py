"""Indices over rows, compiled: the numbers of their hooks in Python, far sooner."""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_void_p, create_string_buffer
from functools import cache, partial
from itertools import chain

import numpy as np

from fmus.native.names import RUNTIME
from fmus.ports.reducer import Reducer
from orchestrator.cosim import Experiment, Value
from orchestrator.machine.compilers import (
    EXPORTED,
    FLAGS,
    MATHEMATICS,
    compile_text,
    library_key,
    load_library,
    own_compiler,
)
from orchestrator.machine.identity import code_of

#: Category in the cache.
CATEGORY = "indices"

#: Where the indices of this product are, and all that makes libraries of them.
_OURS = "orchestrator.vehicle.index."
_MADE_OF = ("auv_fmu", "fmus.language", "fmus.native", "fmus.ports", "orchestrator.vehicle")

_OPTIONS = (*FLAGS, *EXPORTED, f"-I{RUNTIME}", "-w", *MATHEMATICS)


class Raised(ArithmeticError):
    """What a hook has raised, in words, and the time of the row that it was [s]."""

    def __init__(self, why: str, time: float) -> None:
        """Say what, and when."""
        super().__init__(why)
        self.time = time


@cache
def library_of(reducer: Reducer) -> CDLL | None:
    """The library of an index; None: there is none, and no compiler that takes no time."""
    module = reducer.hooks["update"].__module__
    # To translate takes far longer than to read the code of all that does.
    made_of = module if module.startswith(_OURS) else _text(reducer)
    if made_of is None:
        return None
    key = library_key(made_of, code_of(*_MADE_OF), *_OPTIONS)
    try:
        library = load_library(CATEGORY, key, "take_rows", partial(_compiled, reducer))
    except OSError:
        return None
    library.size_of_rows.restype = c_size_t
    library.why.argtypes, library.why.restype = (c_void_p,), c_char_p
    library.take_rows.argtypes = (
        c_void_p, c_void_p, c_int, c_int, c_void_p, c_void_p, c_int, c_double, c_double,
    )  # fmt: skip
    library.give_numbers.argtypes = (c_void_p, c_double, c_double, c_void_p)
    return library


@cache
def _text(reducer: Reducer) -> str | None:
    """An index in C; None: it is outside the language of equations."""
    # Slow to import, and most runs find what was translated.
    from fmus.native.reducer import text_over_rows  # noqa: PLC0415

    return text_over_rows(reducer)


def _compiled(reducer: Reducer) -> bytes:
    """The library of an index, compiled now.

    Raises:
        OSError: it cannot be.

    """
    compiler, text = own_compiler(), _text(reducer)
    if compiler is None or text is None:
        raise OSError(f"{reducer.name} cannot be compiled")
    return compile_text(compiler, text, *_OPTIONS)


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
