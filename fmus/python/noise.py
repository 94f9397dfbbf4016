"""Python's random numbers, of which those of a refused step are drawn again."""

from __future__ import annotations

from random import Random
from typing import Any

from auv_fmu.language.variable import Refusal

#: No normal number that is drawn is larger: it is made of 53 bits.
LARGEST_DRAW = 9.0

#: Numbers that are drawn between two notes of a generator's state.
_MOST_DRAWN = 1_000


def check_draws(*numbers: float) -> None:
    """Refuse numbers that are not drawn."""
    if not all(abs(number) <= LARGEST_DRAW for number in numbers):
        raise Refusal("its noise is none that can be drawn")


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
        self._means, self._deviations = (0.0,) * count, (1.0,) * count
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
        check_draws(following or 0.0)
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
        return tuple(map(gauss, self._means, self._deviations))

    def take_back(self) -> None:
        """Let the numbers that were drawn last be the next ones."""
        self._drawn -= self._count
        self._generator.setstate(self._noted)
        for _ in range(self._drawn):
            self._generator.gauss(0.0, 1.0)
