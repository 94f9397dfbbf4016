"""Random numbers of Python's generator, which a refused step gives back."""

from __future__ import annotations

from random import Random
from typing import Any

from auv_fmu.language.variable import Refusal

#: Bound of normal random numbers: Python makes them from 53 bits.
LARGEST_DRAW = 9.0

#: Number of draws after which the generator's state is saved again.
_MOST_DRAWN = 1_000


def check_draws(*numbers: float) -> None:
    """Refuse numbers that cannot have been drawn."""
    if not all(abs(number) <= LARGEST_DRAW for number in numbers):
        raise Refusal("its noise is none that can be drawn")


class Noise:
    """A generator of independent standard normal numbers.

    Saving its state takes as long as a step. So the state is saved once in many steps, and draws
    are counted, so that they can be repeated after a refused step.
    """

    def __init__(self, generator: Random, count: int) -> None:
        """Continue one of Python's generators, with draws of `count` numbers."""
        self._generator, self._count = generator, count
        self._means, self._deviations = (0.0,) * count, (1.0,) * count
        self._note()

    @classmethod
    def restored(cls, state: Any, count: int) -> Noise:
        """Make a generator from its state.

        Raises:
            Exception: the state is invalid.

        """
        generator = Random()
        generator.setstate(state)
        # setstate changes some invalid states silently, and accepts others that gauss cannot use.
        *_, following = state
        if generator.getstate() != state or type(following) not in (float, type(None)):
            raise Refusal("its noise generator has an invalid state")
        check_draws(following or 0.0)
        return cls(generator, count)

    @property
    def state(self) -> tuple[Any, ...]:
        """State of the generator: immutable, and suitable for JSON."""
        return self._generator.getstate()

    def _note(self) -> None:
        self._noted, self._drawn = self._generator.getstate(), 0

    def draw(self) -> tuple[float, ...]:
        """Draw the next numbers."""
        if self._drawn >= _MOST_DRAWN:
            self._note()
        self._drawn += self._count
        gauss = self._generator.gauss
        return tuple(map(gauss, self._means, self._deviations))

    def take_back(self) -> None:
        """Undo the last draw, so that the next one returns the same numbers."""
        self._drawn -= self._count
        self._generator.setstate(self._noted)
        for _ in range(self._drawn):
            self._generator.gauss(0.0, 1.0)
