"""Graphics cards, and programs that make runs on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from importlib import import_module
from importlib.util import find_spec
from math import nan
from queue import SimpleQueue
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from orchestrator.machine.errors import InputError, reason
from orchestrator.program.cuda import OPTIONS, in_cuda
from orchestrator.program.library import Source

if TYPE_CHECKING:
    from orchestrator.program.library import Grids

#: Threads of a block: with 255 registers each, two blocks fill a multiprocessor.
_THREADS = 128

#: Most runs at a time: more do not make a card quicker.
_MOST_RUNS = 2**19

#: Share of a card's free memory that runs may take.
_SHARE = 0.8

#: Words of a generator, of 32 bits.
GENERATOR = 624

#: Bytes of a run besides its memory and its numbers: its times, its steps and whether it is refused.
_REST = 64

#: Runs a kernel with a number of threads and its arguments.
Launch = Callable[..., None]


class Card(Protocol):
    """A device that runs kernels.

    Attributes:
        name: for people.
        arrays: the package of arrays in its memory, with numpy's functions.

    """

    name: str
    arrays: Any

    def __enter__(self) -> object:
        """Make it the current device of this thread."""
        ...

    def __exit__(self, *failure: object) -> None: ...

    def free_memory(self) -> int:
        """Return how many bytes are free."""
        ...

    def to_numpy(self, array: Any) -> np.ndarray:
        """Return a copy of an array in this process's memory."""
        ...

    def kernels(self, text: str) -> Callable[[str], Launch]:
        """Compile a text, and return its kernels by name.

        Raises:
            InputError: it cannot be compiled.

        """
        ...


class CudaCard:
    """A graphics card of NVIDIA, by CuPy."""

    def __init__(self, number: int) -> None:
        """Take the card with a number."""
        self.arrays: Any = import_module("cupy")
        runtime = self.arrays.cuda.runtime
        self.name = runtime.getDeviceProperties(number)["name"].decode()
        self._device: AbstractContextManager[object] = self.arrays.cuda.Device(number)

    def __enter__(self) -> object:
        return self._device.__enter__()

    def __exit__(self, *failure: Any) -> None:
        self._device.__exit__(*failure)

    def free_memory(self) -> int:
        """Return how many bytes are free."""
        free, _ = self.arrays.cuda.runtime.memGetInfo()
        return int(free) + int(self.arrays.get_default_memory_pool().free_bytes())

    def to_numpy(self, array: Any) -> np.ndarray:
        """Return a copy of an array in this process's memory."""
        copy: np.ndarray = self.arrays.asnumpy(array)
        return copy

    def kernels(self, text: str) -> Callable[[str], Launch]:
        """Compile a text, unless CuPy has it in its cache, and return its kernels by name.

        Raises:
            InputError: it cannot be compiled.

        """
        module = self.arrays.RawModule(code=text, options=OPTIONS)
        try:
            module.compile()
        except Exception as error:
            raise InputError(f"{self.name} cannot run this program: {reason(error)}") from error

        def kernel(name: str) -> Launch:
            function = module.get_function(name)

            def launch(n: int, *arguments: Any) -> None:
                blocks = max(1, -(-n // _THREADS))
                function((blocks,), (_THREADS,), (np.int32(n), *arguments))

            return launch

        return kernel


def find_cards(instead: str) -> list[Card]:
    """Return the graphics cards of this machine.

    Args:
        instead: advice for a machine without one.

    Raises:
        InputError: there is none, or its driver or CuPy is missing.

    """
    if find_spec("cupy") is None:
        raise InputError(f"a graphics card needs CuPy: pip install 'auv-fmu[gpu]'; {instead}")
    cupy: Any = import_module("cupy")
    try:
        n = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise InputError(
            f"no graphics card of NVIDIA can be used: {reason(error)}; {instead}"
        ) from error
    return [CudaCard(number) for number in range(n)]


def find_card(name: str, instead: str) -> Card:
    """Return the graphics card of a name: `cuda`, or `cuda:1` for the second one.

    Args:
        name: of the card.
        instead: advice for a machine without one.

    Raises:
        InputError: there is none of this name, or its driver or CuPy is missing.

    """
    kind, _, digits = name.partition(":")
    if kind != "cuda" or not (digits or "0").isdecimal():
        raise InputError(f"device = {name!r}: use cpu, cuda or, for the second card, cuda:1")
    cards, number = find_cards(instead), int(digits or "0")
    if number >= len(cards):
        raise InputError(
            f"device = {name!r}: the last card of this machine is cuda:{len(cards) - 1}"
        )
    return cards[number]


class CardProgram:
    """A program that cards run, each many runs at a time; threads may share it.

    Attributes:
        source: its source.
        least_runs: number of runs that take about as long as a single one.
        most_runs: largest number of runs at a time.

    """

    least_runs: ClassVar[int] = 2**15

    def __init__(self, source: Source, cards: Sequence[Card]) -> None:
        """Compile what begins runs; the rest is compiled for the first runs.

        Args:
            source: of the program.
            cards: that run it.

        Raises:
            InputError: it cannot be compiled.

        """
        self.source, self._lock = source, Lock()
        self._same: dict[int, float] | None = None
        self._on = [_Compiled(source, card) for card in cards]
        self._free: SimpleQueue[_Compiled] = SimpleQueue()
        for each in self._on:
            self._free.put(each)
        self.most_runs = min(each.most_runs for each in self._on)

    def runs(self, values: np.ndarray, grids: Grids) -> tuple[np.ndarray, np.ndarray]:
        """Make some runs, as :meth:`.Program.runs` does."""
        same = self._same_in(values)
        card = self._free.get()
        try:
            return card.runs(values, grids, same)
        finally:
            self._free.put(card)

    def _same_in(self, values: np.ndarray) -> Mapping[int, float]:
        """Return the parameters that have been the same in all runs so far."""
        with self._lock:
            if self._same is None:
                self._same = dict(enumerate(values[0].tolist()))
            is_same = (values == [self._same.get(i, nan) for i in range(values.shape[1])]).all(
                axis=0
            )
            if not is_same[[*self._same]].all():
                self._same = {i: value for i, value in self._same.items() if is_same[i]}
            return self._same


class _Compiled:
    """A program on one card."""

    def __init__(self, source: Source, card: Card) -> None:
        self._source, self._card = source, card
        self._same: Mapping[int, float] | None = None
        with card:
            self._rest = card.kernels(in_cuda(source).rest)
            found = card.arrays.empty(2, np.int32)
            self._rest("sizes")(1, found)
            self.words, self.generators = found.tolist()
            n_numbers = self.words + len(source.parameters) + source.n_indices
            size = 8 * n_numbers + 4 * GENERATOR * self.generators + _REST
            self.most_runs = max(1, min(_MOST_RUNS, int(_SHARE * card.free_memory() / size)))

    def runs(
        self, values: np.ndarray, grids: Grids, same: Mapping[int, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Make some runs, of which some parameters are the same in all."""
        n, source = len(values), self._source
        with self._card as card:
            if self._same is not same:
                self._steps, self._same = card.kernels(in_cuda(source, same).steps), same
            arrays: Any = card.arrays
            varied = np.array([i for i in range(values.shape[1]) if i not in same], np.int32)
            memory = arrays.empty((self.words, n), np.uint64)
            words = arrays.empty(GENERATOR * self.generators * n, np.uint32)
            refused = arrays.empty(n, np.int32)
            found = arrays.empty((source.n_indices, n))
            start_times, steps, stop_times, full_steps, all_steps = map(arrays.asarray, grids)
            self._rest("begin_all")(
                n, memory, words, arrays.asarray(values[0]), np.int32(len(varied)),
                arrays.asarray(varied), arrays.asarray(np.ascontiguousarray(values[:, varied].T)),
                start_times, steps, stop_times, full_steps, all_steps, refused,
            )  # fmt: skip
            self._steps("advance")(n, memory, words, all_steps, refused)
            self._rest("give")(n, memory, found, refused)
            is_refused = card.to_numpy(refused).astype(bool)
            indices = card.to_numpy(arrays.ascontiguousarray(found.T))
        indices[is_refused] = nan
        return indices, is_refused
