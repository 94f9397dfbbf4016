"""What is found wrong with a file: all of it is collected, so that it can be said at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.machine.errors import InputError


class Refused(InputError):
    """Something is refused for problems, of which the text has the first."""

    def __init__(self, *problems: str) -> None:
        """Say the first, and how many there are."""
        self.problems = problems
        more = len(problems) - 1
        others = f" (and {more} more: see `auv-fmu check`)" if more else ""
        super().__init__(f"{problems[0]}{others}")


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
        self._said: dict[str, set[str]] = {"problem": set(), "note": set()}

    def problem(self, text: str) -> None:
        """Take note of what makes a run meaningless, or impossible."""
        if text not in self._said["problem"]:
            self._said["problem"].add(text)
            self.problems.append(text)

    def note(self, text: str) -> None:
        """Take note of what changes no number."""
        if self._strict:
            self.problem(text)
        elif text not in self._said["note"]:
            self._said["note"].add(text)
            self.notes.append(text)

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Take note of the mistakes that end what is done here, and let the rest go on."""
        try:
            yield
        except InputError as error:
            for text in error.problems if isinstance(error, Refused) else [str(error)]:
                self.problem(text)

    def refuse(self) -> None:
        """Refuse what has problems.

        Raises:
            Refused: with all of them.

        """
        if self.problems:
            raise Refused(*self.problems)
