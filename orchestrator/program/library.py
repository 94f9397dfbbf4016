"""Compilation of programs, kept in the user's cache folder, and calls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import CDLL, c_double, c_int, c_size_t, c_void_p, create_string_buffer
from dataclasses import dataclass, field, replace
from functools import partial
from threading import local
from typing import NamedTuple, Protocol

import numpy as np
from fmpy import platform_tuple

from fmus.ports.port import H_MAX
from orchestrator.cosim import Experiment
from orchestrator.machine.cache import read_cached
from orchestrator.machine.compilers import (
    ANY_PROCESSOR,
    EXPORTED,
    MATHEMATICS,
    SAME_NUMBERS,
    compile_text,
    library_key,
    load_library,
    own_compiler,
    zig,
)
from orchestrator.machine.errors import InputError, reason
from orchestrator.program.writer import Text

#: Category in the cache.
CATEGORY = "program"

#: Flags left out, so that compilers compute sine and cosine of an angle in one call.
_TOGETHER = ("-fno-builtin-sin", "-fno-builtin-cos")

#: Flags of the compiler. No number depends on them, or on the compiler.
FLAGS = (
    "-std=c99", "-O3", "-fno-math-errno", *(flag for flag in SAME_NUMBERS if flag not in _TOGETHER),
    "-fomit-frame-pointer", "-fno-stack-protector", "-fno-plt",
    "-fPIC", "-fvisibility=hidden", "-shared", "-s", "-w",
    *EXPORTED,
)  # fmt: skip


@dataclass(frozen=True)
class Source:
    """A program as text, which is sent to the workers of a cluster.

    Attributes:
        text: text in C.
        parameters: names of its parameters, in their order.
        columns: names of the columns of its rows, without the time.
        places: of its parameters in C; empty for one that is changed at the start.
        noises: places of its generators in C.
        is_stepped: True if a host makes single steps.
        n_indices: number of values of its indices.
        library: compiled library; empty: not compiled yet.
        machine: machine of the library.

    """

    text: str = field(repr=False)
    parameters: Sequence[str]
    columns: Sequence[str]
    n_indices: int
    places: Sequence[str]
    noises: Sequence[str]
    is_stepped: bool
    library: bytes = field(default=b"", repr=False)
    machine: str = platform_tuple

    @classmethod
    def of(cls, text: Text) -> Source:
        """Make the source of a text."""
        parameters, columns = tuple(map(str, text.parameters)), tuple(map(str, text.columns))
        places = tuple(
            "" if name.port == H_MAX else place.text for name, place in text.parameters.items()
        )
        return cls(
            text.text(), parameters, columns, text.n_indices, places, tuple(text.noises),
            text.is_stepped,
        )  # fmt: skip

    def with_library(self) -> Source:
        """Return the source with the library that this machine has compiled."""
        if self.library and self.machine == platform_tuple:
            return self
        [library] = read_cached(CATEGORY, self.key).values()
        return replace(self, library=library, machine=platform_tuple)

    @property
    def key(self) -> str:
        """Cache key: text, flags and machine."""
        return library_key(self.text, *FLAGS, machine=self.machine)


class Grids(NamedTuple):
    """Times and steps of some runs, as columns.

    Attributes:
        start_time, step, stop_time: of the experiments, as float64 [s].
        full_steps, steps: numbers of steps of full length, and of all steps, as int32.

    """

    start_time: np.ndarray
    step: np.ndarray
    stop_time: np.ndarray
    full_steps: np.ndarray
    steps: np.ndarray

    @classmethod
    def of(cls, experiments: Iterable[Experiment]) -> Grids:
        """Return the times and steps of experiments."""
        *times, full_steps, steps = zip(*map(_grid, experiments), strict=True)
        return cls(*map(np.array, times), *(np.array(n, np.int32) for n in (full_steps, steps)))

    def rows(self, places: np.ndarray) -> Grids:
        """Return those at some places."""
        return Grids(*(column[places] for column in self))


def _grid(run: Experiment) -> tuple[float, float, float, int, int]:
    return run.start_time, run.step, run.stop_time, run.full_steps, run.rows - 1


class Program:
    """A compiled program; several threads may make runs at the same time.

    Attributes:
        source: its source.
        library: its functions.
        size: bytes of a simulation.

    """

    def __init__(self, source: Source) -> None:
        """Compile a program, unless it is in the cache.

        Raises:
            InputError: it cannot be compiled; the message says what to install.

        """
        self.source = source
        self.library = _loaded(source)
        self.size: int = self.library.size_of_simulation()
        self._memory = _ThreadMemory()

    def run(
        self,
        values: np.ndarray,
        experiment: Experiment,
        rows: np.ndarray | None = None,
    ) -> np.ndarray | None:
        """Make a run.

        Args:
            values: values of its parameters, which are not changed.
            experiment: steps and times of the run.
            rows: array for rows, each with the time and all columns; None: no rows.

        Returns:
            Its indices, NaN for missing ones; None: a component has refused a value.

        """
        indices = np.empty(self.source.n_indices)
        address = indices.ctypes.data
        is_refused = self._refuses(values.ctypes.data, _grid(experiment), rows, address)
        return None if is_refused else indices

    def runs(self, values: np.ndarray, grids: Grids) -> tuple[np.ndarray, np.ndarray]:
        """Make some runs, at most `most_runs`.

        Args:
            values: values of the parameters, (runs, parameters), which are not changed.
            grids: times and steps.

        Returns:
            The indices, (runs, indices), and a mask of the runs that a component has refused. The
            indices of these, and missing ones, are NaN.

        """
        values = np.ascontiguousarray(values)
        indices = np.empty((len(values), self.source.n_indices))
        refused = np.zeros(len(values), dtype=bool)
        given, found = (array.ctypes.data for array in (values, indices))
        for i, grid in enumerate(zip(*(column.tolist() for column in grids), strict=True)):
            refused[i] = self._refuses(given, grid, None, found)
            given, found = given + values.strides[0], found + indices.strides[0]
        indices[refused] = np.nan
        return indices, refused

    def _refuses(
        self,
        values: int,
        grid: tuple[float, float, float, int, int],
        rows: np.ndarray | None,
        indices: int,
    ) -> bool:
        """Make a run, from and into memory; return True if a component has refused a value."""
        memory, library = self._memory.of_size(self.size), self.library
        return bool(
            library.begin(memory, values, *grid)
            or library.run(memory, grid[-1], None if rows is None else rows.ctypes.data)
            or (self.source.n_indices and library.indices(memory, indices))
        )


class Runner(Protocol):
    """A program that makes runs."""

    def runs(self, values: np.ndarray, grids: Grids) -> tuple[np.ndarray, np.ndarray]:
        """Make some runs, as :meth:`Program.runs` does."""
        ...


class Runners(Protocol):
    """The processor or cards, which make the runs of programs.

    Attributes:
        least_runs: number of runs that take about as long as a single one.
        most_runs: largest number of runs at a time.

    """

    least_runs: int
    most_runs: int

    @property
    def names(self) -> Sequence[str]:
        """Names for the record of a study."""
        ...

    @property
    def threads(self) -> int | None:
        """Number of blocks to make at a time; None: one for each core."""
        ...

    def __call__(self, source: Source) -> Runner:
        """Return a program.

        Raises:
            InputError: it cannot be compiled.

        """
        ...

    def portable(self, source: Source) -> Source:
        """Return a source for another machine."""
        ...


class Processor:
    """The processor, which makes one run after the other."""

    least_runs, most_runs = 1, 10_000
    names: Sequence[str] = ()
    threads: int | None = None

    def __call__(self, source: Source) -> Program:
        """Return a compiled program.

        Raises:
            InputError: it cannot be compiled; the message says what to install.

        """
        return Program(source)

    def portable(self, source: Source) -> Source:
        """Return a source with the library that this machine has compiled."""
        return self(source).source.with_library()


PROCESSOR = Processor()


class _ThreadMemory(local):
    """Memory of a simulation, one per thread."""

    def __init__(self) -> None:
        self._memory = create_string_buffer(1)

    def of_size(self, size: int) -> c_void_p:
        if len(self._memory) < size:
            self._memory = create_string_buffer(size)
        return self._memory  # type: ignore[return-value]


def _loaded(source: Source) -> CDLL:
    """Load the library of a program.

    Raises:
        InputError: the program cannot be compiled.

    """
    try:
        library = load_library(CATEGORY, source.key, "run", partial(_compiled, source))
    except OSError as error:
        raise InputError(f"the program cannot be compiled: {reason(error)}") from error
    library.size_of_simulation.restype = c_size_t
    library.begin.argtypes = (
        c_void_p, c_void_p, c_double, c_double, c_double, c_int, c_int,
    )  # fmt: skip
    library.run.argtypes = (c_void_p, c_int, c_void_p)
    if source.n_indices:
        library.indices.argtypes = (c_void_p, c_void_p)
    return library


def _compiled(source: Source) -> bytes:
    """Return the library that came with a program, or compile it.

    Raises:
        InputError: there is no compiler.
        OSError: the compiler fails.

    """
    if source.library and source.machine == platform_tuple:
        return source.library
    compiler = zig(ANY_PROCESSOR) or own_compiler()
    if compiler is None:
        raise InputError(
            "a program needs a C compiler: install gcc or clang, or `pip install ziglang`"
        )
    return compile_text(compiler, source.text, *FLAGS, *MATHEMATICS)
