"""Programs compiled, kept in the user's cache folder, and called."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import CDLL, c_double, c_int, c_size_t, c_void_p, create_string_buffer
from dataclasses import dataclass, field, replace
from functools import partial
from threading import local

import numpy as np
from fmpy import platform_tuple

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

#: Sine and cosine of one angle, which belong together, are computed together.
_TOGETHER = ("-fno-builtin-sin", "-fno-builtin-cos")

#: How programs are compiled: no number depends on it, nor on the compiler.
FLAGS = (
    "-std=c99", "-O3", "-fno-math-errno", *(flag for flag in SAME_NUMBERS if flag not in _TOGETHER),
    "-fomit-frame-pointer", "-fno-stack-protector", "-fno-plt",
    "-fPIC", "-fvisibility=hidden", "-shared", "-s", "-w",
    *EXPORTED,
)  # fmt: skip


@dataclass(frozen=True)
class Source:
    """A program as text: what travels to the workers of a cluster.

    Attributes:
        text: of it.
        parameters: names of its parameters, in their order.
        columns: of its rows, without the time.
        n_indices: how many numbers its indices are.
        library: compiled for this machine; empty: it is not yet.
        machine: that it is compiled for.

    """

    text: str = field(repr=False)
    parameters: Sequence[str]
    columns: Sequence[str]
    n_indices: int
    library: bytes = field(default=b"", repr=False)
    machine: str = platform_tuple

    @classmethod
    def of(cls, text: Text) -> Source:
        """The source that a text is."""
        n = sum(len(ports) for one in text.indices for ports in one.reducer.results.values())
        return cls(text.text(), tuple(map(str, text.parameters)), tuple(map(str, text.columns)), n)

    def with_library(self) -> Source:
        """The same, with what this machine has compiled."""
        if self.library and self.machine == platform_tuple:
            return self
        [library] = read_cached(CATEGORY, self.key).values()
        return replace(self, library=library, machine=platform_tuple)

    @property
    def key(self) -> str:
        """Of the text, the flags and the machine."""
        return library_key(self.text, *FLAGS, machine=self.machine)


class Program:
    """A compiled program; several threads may make runs at the same time.

    Attributes:
        source: of it.

    """

    def __init__(self, source: Source) -> None:
        """Compile it, unless it is in the cache.

        Raises:
            InputError: it cannot be compiled; the text says what to do.

        """
        self.source = source
        self._library = _loaded(source)
        self._size = self._library.size_of_simulation()
        self._own = _Own()

    def run(
        self,
        values: np.ndarray,
        experiment: Experiment,
        rows: np.ndarray | None = None,
    ) -> np.ndarray | None:
        """Make a run.

        Args:
            values: of its parameters, which is not changed.
            experiment: whose steps and times it has.
            rows: to be filled, the time and all columns in each; None: they are not wanted.

        Returns:
            Its indices, where what is not there is not a number; None: a component has refused.

        """
        memory, library = self._own.memory(self._size), self._library
        steps = experiment.rows - 1
        if library.begin(
            memory, values.ctypes.data, experiment.start_time, experiment.step,
            experiment.stop_time, experiment.full_steps, steps,
        ):  # fmt: skip
            return None
        if library.run(memory, steps, None if rows is None else rows.ctypes.data):
            return None
        found = np.empty(self.source.n_indices)
        if len(found) and library.indices(memory, found.ctypes.data):
            return None
        return found


class _Own(local):
    """The memory of each thread."""

    def __init__(self) -> None:
        self._memory = create_string_buffer(1)

    def memory(self, size: int) -> c_void_p:
        if len(self._memory) < size:
            self._memory = create_string_buffer(size)
        return self._memory  # type: ignore[return-value]


def _loaded(source: Source) -> CDLL:
    """Load the library of a program.

    Raises:
        InputError: it cannot be compiled.

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
    """The library of a program: the one that came with it, or else compiled now.

    Raises:
        InputError: there is no compiler.
        OSError: it fails.

    """
    if source.library and source.machine == platform_tuple:
        return source.library
    compiler = zig(ANY_PROCESSOR) or own_compiler()
    if compiler is None:
        raise InputError(
            "a program needs a C compiler: install gcc or clang, or `pip install ziglang`"
        )
    return compile_text(compiler, source.text, *FLAGS, *MATHEMATICS)
