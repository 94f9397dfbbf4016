"""Many simulations of one program in one memory: the processor's, or a graphics card's."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim import PortName
from orchestrator.machine.errors import InputError
from orchestrator.machine.workers import cores
from orchestrator.program.card import GENERATOR, Card, find_card, words_of_a_run
from orchestrator.program.cuda import in_cuda
from orchestrator.program.session import Place, Places, SteppedProgram

#: Least number of simulations for which a further thread is worth its start.
_WORTH_A_THREAD = 128

#: Names of the processor as a device.
NAMES_OF_PROCESSOR = (None, "cpu")

#: Bytes of a word.
_WORD = 8


class Beginning(NamedTuple):
    """Parameters and steps of simulations that begin.

    Attributes:
        same: all parameters.
        varied: places of those with a value of its own for each simulation.
        values: these values, (varied, simulations).
        start_time: time of the start [s].
        step: length of a step [s].
        stop_time: time of the last step [s].
        n_steps: number of steps.

    """

    same: np.ndarray
    varied: Sequence[int]
    values: Any
    start_time: float
    step: float
    stop_time: float
    n_steps: int


class Many(ABC):
    """Many simulations of one program, in one memory.

    Attributes:
        program: their program.
        n: their number.
        arrays: the package of arrays in this memory: numpy, or CuPy.
        device: context in which the package takes this memory.
        states: a row for each simulation.
        made: numbers of steps made.
        has_failed: 1 for each that a component has stopped.

    """

    #: Least distance of places in a view [bytes].
    _least_apart: int

    def __init__(
        self,
        program: SteppedProgram,
        n: int,
        arrays: Any,
        device: AbstractContextManager[object],
        states: Any,
        places: Places,
    ) -> None:
        """Take some memory."""
        self.program, self.n, self.arrays, self.device = program, n, arrays, device
        self.states, self._places = states, places
        members = places.members
        self.made, self._is_passed, self.has_failed = (
            self._view([Place(members[name], is_whole=True)])[:, 0]
            for name in ("made", "is_passed", "has_failed")
        )
        self._factors, self._offsets = (
            self._view(
                [Place(members[name] + _WORD * i, False) for i in range(len(program.inputs))]
            )
            for name in ("factors", "offsets")
        )

    def view(self, ports: Sequence[PortName]) -> Any:
        """Return a view of the values of some ports, (n, ports), or a copy without a base."""
        return self._view([self._places.of(port) for port in ports])

    def _view(self, places: Sequence[Place]) -> Any:
        first = places[0]
        apart = places[1].at - first.at if len(places) > 1 else _WORD
        even = [Place(first.at + i * apart, first.is_whole) for i in range(len(places))]
        if places == even and apart > 0 and apart % self._least_apart == 0:
            return self._strided(first, len(places), apart)
        return self.arrays.column_stack([self._view([place]) for place in places])

    @abstractmethod
    def _strided(self, first: Place, n: int, apart: int) -> Any:
        """Return a view of numbers of one type that are the same number of bytes apart."""

    def override(self, target: PortName, numbers: Any) -> None:
        """Give an input of each a value, whatever feeds it."""
        i = self.program.inputs[target]
        self._factors[:, i] = 0.0
        self._offsets[:, i] = numbers
        self._is_passed[:] = 0
        if target in self.program.settables:
            # Nothing feeds it.
            self._view([self._places.columns[target]])[:, 0] = numbers

    @abstractmethod
    def begin(self, which: Any, beginning: Beginning) -> None:
        """Begin those whose numbers are given."""

    @abstractmethod
    def advance(self, until: Any) -> None:
        """Make steps, up to a number of them for each."""

    @abstractmethod
    def pass_on(self) -> None:
        """Bring all up to date after a change."""

    @abstractmethod
    def tune(self, which: int, numbers: Any) -> bool:
        """Set a parameter of each, and tell whether one refuses it."""

    @abstractmethod
    def release(self, target: PortName) -> None:
        """Let an input of each take again what feeds it, or the value that it had before."""


class ManyOnProcessor(Many):
    """Many simulations on the cores of the processor; states are rows of bytes."""

    _least_apart = 4

    def __init__(self, program: SteppedProgram, n: int, threads: int | None) -> None:
        """Take memory, and threads: None for one on each core."""
        self._library = program.library
        states = np.zeros((n, program.size), np.uint8)
        super().__init__(program, n, np, nullcontext(), states, program.places)
        threads = min(threads or cores(), max(n // _WORTH_A_THREAD, 1))
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._parts = [*pairwise(np.linspace(0, n, threads + 1).astype(int).tolist())]

    def view(self, ports: Sequence[PortName]) -> np.ndarray:
        """Return a view of the values of some ports that cannot be written, or a copy."""
        view: np.ndarray = super().view(ports)
        view.flags.writeable = view.base is None
        return view

    def _strided(self, first: Place, n: int, apart: int) -> np.ndarray:
        size = np.dtype(first.dtype).itemsize
        start, step = first.at // size, apart // size
        numbers: np.ndarray = self.states.view(first.dtype)[:, start : start + n * step : step]
        return numbers

    def begin(self, which: np.ndarray, beginning: Beginning) -> None:
        """Begin those whose numbers are given."""
        same, varied, values, *times = beginning
        places = np.array(varied, np.int32)
        self._library.begin_all(
            self.states.ctypes.data, len(which), which.ctypes.data, same.ctypes.data, len(varied),
            places.ctypes.data, values.ctypes.data, *times,
        )  # fmt: skip

    def advance(self, until: np.ndarray) -> None:
        """Make steps, up to a number of them for each."""

        def advance(part: tuple[int, int]) -> None:
            first, last = part
            self._library.advance_all(
                self.states[first:].ctypes.data, last - first, until[first:].ctypes.data
            )

        if self._pool is None:
            advance(self._parts[0])
        else:
            list(self._pool.map(advance, self._parts))

    def pass_on(self) -> None:
        """Bring all up to date after a change."""
        self._library.pass_all(self.states.ctypes.data, self.n)

    def tune(self, which: int, numbers: np.ndarray) -> bool:
        """Set a parameter of each, and tell whether one refuses it."""
        data = np.ascontiguousarray(numbers).ctypes.data
        return bool(self._library.tune_all(self.states.ctypes.data, self.n, which, data))

    def release(self, target: PortName) -> None:
        """Let an input of each take again what feeds it, or the value that it had before."""
        self._library.release_all(self.states.ctypes.data, self.n, self.program.inputs[target])


class ManyOnCard(Many):
    """Many simulations on a graphics card; states are rows of words, side by side in its memory."""

    _least_apart = _WORD

    def __init__(self, program: SteppedProgram, n: int, card: Card) -> None:
        """Compile the kernels, and take memory of a card.

        Raises:
            InputError: they cannot be compiled, or there is too little memory.

        """
        with card:
            arrays = card.arrays
            text = in_cuda(program.source)
            self._rest = card.kernels(text.rest)
            words = words_of_a_run(card, self._rest)
            rows = words + GENERATOR * len(program.source.noises) // 2
            most = card.free_memory() // (_WORD * rows)
            if n > most:
                raise InputError(f"n = {n}: {card.name} has memory for {most}")
            self._advance = card.kernels(text.steps)("advance")
            self._memory = arrays.zeros((rows, n), np.uint64)
            self._random = self._memory[words:].reshape(-1).view(np.uint32)

            def give(*places_at: np.ndarray) -> None:
                on_card = [arrays.zeros(each.shape, np.uint64) for each in places_at]
                self._rest("place")(1, *on_card)
                for at, each in zip(places_at, on_card, strict=True):
                    at[...] = card.to_numpy(each)

            places = program.places_by(give)
            super().__init__(program, n, arrays, card, self._memory.T, places)

    def _strided(self, first: Place, n: int, apart: int) -> Any:
        size = np.dtype(first.dtype).itemsize
        start, step = first.at // _WORD, apart // _WORD
        numbers = self._memory.view(first.dtype)[start : start + n * step : step]
        return numbers[:, first.at % _WORD // size :: _WORD // size].T

    def begin(self, which: Any, beginning: Beginning) -> None:
        """Begin those whose numbers are given."""
        arrays = self.arrays
        same, varied, values, start_time, step, stop_time, n_steps = beginning
        self._rest("begin_some")(
            len(which), self._memory, self._random, np.int32(self.n), which, arrays.asarray(same),
            np.int32(len(varied)), arrays.asarray(np.array(varied, np.int32)), values,
            np.float64(start_time), np.float64(step), np.float64(stop_time), np.int32(n_steps),
        )  # fmt: skip

    def advance(self, until: Any) -> None:
        """Make steps, up to a number of them for each."""
        # There are no refusals to note: has_failed has them.
        self._advance(self.n, self._memory, self._random, until, until)

    def pass_on(self) -> None:
        """Bring all up to date after a change."""
        self._rest("pass_on")(self.n, self._memory, self._random)

    def tune(self, which: int, numbers: Any) -> bool:
        """Set a parameter of each, and tell whether one refuses it."""
        refused = self.arrays.zeros(self.n, np.int32)
        numbers = self.arrays.ascontiguousarray(numbers)
        self._rest("tune_each")(
            self.n, self._memory, self._random, np.int32(which), numbers, refused
        )
        return bool(refused.any())

    def release(self, target: PortName) -> None:
        """Let an input of each take again what feeds it, or the value that it had before."""
        self._rest("release_each")(self.n, self._memory, np.int32(self.program.inputs[target]))


def many_of(
    program: SteppedProgram, n: int, threads: int | None, device: str | Card | None
) -> Many:
    """Return many simulations of a program, which have not begun.

    Args:
        program: of each.
        n: their number.
        threads: number of threads on the processor; None: one for each core.
        device: a card, or its name; None or `cpu`: the processor.

    Raises:
        InputError: there is no such device, it has too little memory, or no compiler.

    """
    if device in NAMES_OF_PROCESSOR:
        return ManyOnProcessor(program, n, threads)
    if isinstance(device, str):
        device = find_card(device, "without device, the processor does the same")
    return ManyOnCard(program, n, device)


def as_array(arrays: Any, values: Any) -> Any:
    """Return values as an array of a package, without a copy if they are in its memory already.

    Args:
        arrays: the package.
        values: an array of any package with DLPack, of numpy, or what numpy takes; texts stay
            numpy's.

    """
    if isinstance(values, arrays.ndarray):
        return values
    there = getattr(values, "__dlpack_device__", None)
    if there is not None and there() == arrays.empty(1).__dlpack_device__():
        return arrays.from_dlpack(values)
    values = np.asarray(values)
    return arrays.asarray(values) if values.dtype.kind in "biuf" else values
