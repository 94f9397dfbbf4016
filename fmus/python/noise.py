"""Python's random numbers, of which those of a refused step are drawn again."""

from __future__ import annotations

from math import isfinite
from random import Random
from typing import Any

from fmus.ports.port import Refusal

#: Bound of the magnitude of a normal number: it is made of a uniform one that has 53 bits.
LARGEST_NORMAL = 9.0

#: Numbers that are drawn between two notes of a generator's state.
_MOST_DRAWN = 1_000


class Noise:
    """A generator of independent standard normal numbers.

    To note its state takes as long as a step. So it is noted once in many steps, and what was drawn
    since then is counted, to be drawn again where a step is refused.
    """

    def __init__(self, generator: Random, count: int) -> None:
        """Begin where a generator is.

        Args:
            generator: of Python.
            count: of the numbers that are drawn together.

        """
        self._generator, self._count = generator, count
        self._note()

    @classmethod
    def restored(cls, state: Any, count: int) -> Noise:
        """The generator that has a state.

        Raises:
            Exception: none has.

        """
        generator = Random()
        generator.setstate(state)
        # Some of what setstate takes it changes in silence, or only gauss finds out about.
        *_, following = state
        if generator.getstate() != state or type(following) not in (float, type(None)):
            raise Refusal("its noise generator has an invalid state")
        if not isfinite(following or 0.0):
            raise Refusal("its noise is not finite")
        return cls(generator, count)

    @property
    def state(self) -> tuple[Any, ...]:
        """What it is restored from: immutable, fit for JSON."""
        return self._generator.getstate()

    def _note(self) -> None:
        self._noted, self._drawn = self._generator.getstate(), 0

    def draw(self) -> tuple[float, ...]:
        """The next numbers."""
        if self._drawn >= _MOST_DRAWN:
            self._note()
        self._drawn += self._count
        gauss = self._generator.gauss
        return tuple([gauss(0.0, 1.0) for _ in range(self._count)])

    def take_back(self) -> None:
        """Let the numbers that were drawn last be the next ones."""
        self._drawn -= self._count
        self._generator.setstate(self._noted)
        for _ in range(self._drawn):
            self._generator.gauss(0.0, 1.0)
