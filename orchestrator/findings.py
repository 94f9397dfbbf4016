"""What is found wrong with a file: all of it is collected, so that it can be said at once."""

from __future__ import annotations

from orchestrator.errors import InputError


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

    def refuse(self) -> None:
        """Refuse what has problems.

        Raises:
            InputError: with the first of them.

        """
        if self.problems:
            more = len(self.problems) - 1
            others = f" (and {more} more: see `auv-fmu check`)" if more else ""
            raise InputError(f"{self.problems[0]}{others}")
