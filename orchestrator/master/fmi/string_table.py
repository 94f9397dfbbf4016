"""Texts of a run: in the row, which holds floats, a number stands for each."""

from __future__ import annotations

from collections.abc import Iterable


class Texts:
    """Texts by their numbers, which they keep: the first is empty, and the next one takes the next.

    What FMUs say is not forgotten, so that a run in which one has a new text in every step takes
    memory for all of them.
    """

    def __init__(self) -> None:
        """Begin with the empty text."""
        self.restore([""])

    def __len__(self) -> int:
        """How many there are."""
        return len(self._texts)

    def number(self, text: str) -> int:
        """The number of a text, which it gets if it has none."""
        found = self._numbers.setdefault(text, len(self._texts))
        if found == len(self._texts):
            self._texts.append(text)
        return found

    def text(self, number: float) -> str:
        """The text of a number.

        Raises:
            ValueError: it has none.

        """
        if not 0 <= number < len(self._texts):
            raise ValueError(f"no text has the number {number:g}")
        return self._texts[int(number)]

    def since(self, n: int) -> list[str]:
        """All texts but the first so many."""
        return self._texts[n:]

    def state(self) -> list[str]:
        """All of them, as JSON has them."""
        return list(self._texts)

    def restore(self, state: Iterable[str]) -> None:
        """Take on the texts of another process, with their numbers."""
        self._texts = list(state)
        self._numbers = {text: number for number, text in enumerate(self._texts)}
