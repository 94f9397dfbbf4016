"""Graphics cards, and programs that make runs on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from importlib import import_module
from importlib.util import find_spec
from itertools import compress
from math import nan
from queue import SimpleQueue
from threading import Lock
from typing import Any, Protocol

import numpy as np

from orchestrator.machine.errors import InputError, reason
from orchestrator.program.cuda import OPTIONS, in_cuda
from orchestrator.program.library import Grids, Source

#: Threads of a block: with 255 registers each, two blocks fill a multiprocessor.
_THREADS = 128

#: Share of a card's free memory that runs may take.
_SHARE = 0.8

#: Words of a generator, of 32 bits.
GENERATOR = 624

#: Bytes of a run besides its memory and its numbers: times, steps, and whether it is refused.
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
    try:
        cupy: Any = import_module("cupy")
        # Without any, this is an error.
        return [CudaCard(number) for number in range(cupy.cuda.runtime.getDeviceCount())]
    # CuPy without a driver, or for another version of CUDA, raises errors of its own.
    except Exception as error:
        # The last line of CuPy's advice has the reason.
        lines = [line.strip() for line in str(error).splitlines() if line.strip(" =")]
        why = lines[-1] if lines else repr(error)
        raise InputError(
            f"no graphics card of NVIDIA can be used: {why}; nvidia-smi shows the driver; {instead}"
        ) from error


class Cards:
    """The graphics cards of this machine, or of a worker that it is sent to."""

    least_runs, most_runs = 2**15, 2**17

    def __init__(self, instead: str, cards: Sequence[Card] = ()) -> None:
        """Take some cards; by default, all of the machine, found when they are needed.

        Args:
            instead: advice for a machine without one.
            cards: to use.

        """
        self._instead, self._cards = instead, [*cards]

    @property
    def cards(self) -> Sequence[Card]:
        """The cards.

        Raises:
            InputError: there is none.

        """
        self._cards = self._cards or find_cards(self._instead)
        return self._cards

    @property
    def names(self) -> Sequence[str]:
        """Names of the cards."""
        return [card.name for card in self.cards]

    @property
    def threads(self) -> int:
        """Number of blocks to make at a time: while a card makes one, the next is prepared."""
        return 2 * len(self.cards)

    def __call__(self, source: Source) -> CardProgram:
        """Return a program on these cards.

        Raises:
            InputError: there is none, or it cannot compile the program.

        """
        return CardProgram(source, self.cards)

    def portable(self, source: Source) -> Source:
        """Return a source for another machine."""
        return source

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without cards, which stay where they are."""
        return {"_instead": self._instead, "_cards": []}


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
        raise InputError(f"device = {name!r}: this machine has {len(cards)} cards")
    return cards[number]


def words_of_a_run(card: Card, kernels: Callable[[str], Launch]) -> int:
    """Return how many words of 64 bits a run takes, besides its generators'."""
    found = card.arrays.empty(1, np.int32)
    kernels("words_of_a_run")(1, found)
    return int(card.to_numpy(found)[0])


class CardProgram:
    """A program that cards run, many runs at a time on each; several threads may make runs.

    Attributes:
        source: its source.

    """

    def __init__(self, source: Source, cards: Sequence[Card]) -> None:
        """Compile what begins runs and gives their results; steps are compiled with the first runs.

        Args:
            source: of the program.
            cards: that run it.

        Raises:
            InputError: it cannot be compiled.

        """
        self.source, self._lock = source, Lock()
        self._same: dict[int, float] | None = None
        self._free: SimpleQueue[_OnCard] = SimpleQueue()
        for card in cards:
            self._free.put(_OnCard(source, card))

    def runs(self, values: np.ndarray, grids: Grids) -> tuple[np.ndarray, np.ndarray]:
        """Make some runs, as :meth:`.Program.runs` does, on the next card that is free."""
        same = self._same_in(values)
        card = self._free.get()
        try:
            return card.runs(values, grids, same)
        finally:
            self._free.put(card)

    def _same_in(self, values: np.ndarray) -> Mapping[int, float]:
        """Return the parameters, by their places, that have been the same in all runs so far."""
        with self._lock:
            before = dict(enumerate(values[0].tolist())) if self._same is None else self._same
            places = [*before]
            is_same = (values[:, places] == [*before.values()]).all(axis=0)
            if self._same is None or not is_same.all():
                self._same = {place: before[place] for place in compress(places, is_same)}
            return self._same


class _OnCard:
    """A program on one card."""

    def __init__(self, source: Source, card: Card) -> None:
        self._source, self._card = source, card
        self._same: Mapping[int, float] | None = None
        with card:
            self._rest = card.kernels(in_cuda(source).rest)
            self._words = words_of_a_run(card, self._rest)
        self._generators = len(source.noises)

    def runs(
        self, values: np.ndarray, grids: Grids, same: Mapping[int, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Make runs, as many at a time as its memory holds; some parameters are the same in all."""
        n_numbers = self._words + values.shape[1] + self._source.n_indices
        size = 8 * n_numbers + 4 * GENERATOR * self._generators + _REST
        with self._card:
            if self._same is not same:
                self._steps = self._card.kernels(in_cuda(self._source, same).steps)
                self._same = same
            n = max(1, int(_SHARE * self._card.free_memory()) // size)
            parts = [slice(first, first + n) for first in range(0, len(values), n)]
            made = [
                self._made(values[part], Grids(*(column[part] for column in grids)))
                for part in parts
            ]
        indices, refused = map(np.concatenate, zip(*made, strict=True))
        return indices, refused

    def _made(self, values: np.ndarray, grids: Grids) -> tuple[np.ndarray, np.ndarray]:
        n, arrays = len(values), self._card.arrays
        assert self._same is not None
        varied = np.array([i for i in range(values.shape[1]) if i not in self._same], np.int32)
        start_times, steps, stop_times, full_steps, all_steps = map(arrays.asarray, grids)
        memory = arrays.empty((self._words, n), np.uint64)
        words = arrays.empty(GENERATOR * self._generators * n, np.uint32)
        refused = arrays.empty(n, np.int32)
        found = arrays.empty((self._source.n_indices, n))
        self._rest("begin_all")(
            n, memory, words, arrays.asarray(values[0]), np.int32(len(varied)),
            arrays.asarray(varied), arrays.asarray(np.ascontiguousarray(values[:, varied].T)),
            start_times, steps, stop_times, full_steps, all_steps, refused,
        )  # fmt: skip
        self._steps("advance")(n, memory, words, all_steps, refused)
        if self._source.n_indices:
            self._rest("give")(n, memory, found, refused)
        is_refused = self._card.to_numpy(refused).astype(bool)
        indices = self._card.to_numpy(arrays.ascontiguousarray(found.T))
        indices[is_refused] = nan
        return indices, is_refused
