"""What is found wrong with a file: all of it is collected, so that it can be said at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.errors import InputError


class Refused(InputError):
    """A file is refused for its findings, which hold every problem; the text is the first."""


class Findings:
    """What is wrong with a file, in the order in which it was found.

    Attributes:
        problems: what makes a run meaningless, or impossible.
        notes: what is not as it should be, and changes no number.

    """

    def __init__(self, strict: bool = False) -> None:
        """Begin with none; for who is strict, everything is a problem."""
        self._strict = strict
        self.problems: list[str] = []
        self.notes: list[str] = []

    def problem(self, text: str) -> None:
        """Take note of what makes a run meaningless, or impossible."""
        if text not in self.problems:
            self.problems.append(text)

    def note(self, text: str) -> None:
        """Take note of what changes no number."""
        if self._strict:
            self.problem(text)
        elif text not in self.notes:
            self.notes.append(text)

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Take note of the mistake that ends what is done here, and let the rest go on."""
        try:
            yield
        except Refused:
            pass
        except InputError as error:
            self.problem(str(error))

    def refuse(self) -> None:
        """Refuse what has problems.

        Raises:
            Refused: with the first of them.

        """
        if self.problems:
            more = len(self.problems) - 1
            others = f" (and {more} more: see `auv-fmu check`)" if more else ""
            raise Refused(f"{self.problems[0]}{others}")
