"""Errors with messages for the user, and the collected problems of a file."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches

#: Largest number of lines of a message, and of letters of each.
_MOST_LINES, _LONGEST_LINE = 10, 300

#: Largest number of names in a list.
_MOST_NAMES = 5


class InputError(ValueError):
    """A request that cannot be fulfilled; the message tells the user what to change."""


class StartError(InputError):
    """A simulation that failed before its first row, though the request was valid."""


def reason(error: BaseException) -> str:
    """Return the message of an exception in one line."""
    if isinstance(error, MemoryError):
        return "out of memory"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    more = [f"and {len(lines) - _MOST_LINES} more lines"] * (len(lines) > _MOST_LINES)
    shown = (shortened(line, _LONGEST_LINE) for line in (*lines[:_MOST_LINES], *more))
    return "; ".join(shown).replace(":; ", ": ") or repr(error)


def unforeseen(error: Exception) -> str:
    """Return the message of an exception during a run in one line.

    Only a full disk and lack of memory are expected there. For others an FMU may be the cause: it
    may have closed files of this process, or changed modules of Python.
    """
    if isinstance(error, InputError | MemoryError):
        return reason(error)
    if isinstance(error, OSError) and error.errno != errno.EBADF:
        return reason(error)
    return (
        f"{type(error).__name__}: {reason(error)}; if an FMU has changed this process, --isolate "
        "gives it a separate one"
    )


def shortened(text: str, most: int = 80) -> str:
    """Cut a long text for a message."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Join names, of many the first ones and the number of the rest."""
    more = len(names) - _MOST_NAMES
    return between.join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def escape_unprintable(text: str, allowed: str = "") -> str:
    """Escape control characters, which a terminal would interpret, except the allowed ones."""
    return "".join(
        letter if letter.isprintable() or letter in allowed else repr(letter)[1:-1]
        for letter in text
    )


def last_line(text: str, otherwise: str = "no reason given") -> str:
    """Return the last line that a child process has written, in which it says why it failed."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else otherwise


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint at names that resemble an unknown one or begin with it; empty if none do."""
    names = list(known)
    members = [other for other in names if other.startswith((f"{name}[", f"{name}."))]
    same = [other for other in names if other.casefold() == name.casefold()]
    near = members[:3] or same[:3] or get_close_matches(name, names, n=3)
    return f"; did you mean {' or '.join(near)}?" if near else ""


class Refused(InputError):
    """A file or system with problems; the message contains the first of them."""

    def __init__(self, *problems: str) -> None:
        """Take all problems."""
        self.problems = problems
        more = len(problems) - 1
        others = f" (and {more} more: see `auv-fmu check`)" if more else ""
        super().__init__(f"{problems[0]}{others}")


class Findings:
    """Problems of a file, in the order in which they were found.

    Attributes:
        problems: those that make a run meaningless or impossible.
        notes: those that change no number.

    """

    def __init__(self, strict: bool = False) -> None:
        """Begin with none; if `strict`, notes are problems, too."""
        self._strict = strict
        self.problems: list[str] = []
        self.notes: list[str] = []
        self._known: dict[str, set[str]] = {"problem": set(), "note": set()}

    def problem(self, text: str) -> None:
        """Add a problem that makes a run meaningless or impossible."""
        if text not in self._known["problem"]:
            self._known["problem"].add(text)
            self.problems.append(text)

    def note(self, text: str) -> None:
        """Add a problem that changes no number."""
        if self._strict:
            self.problem(text)
        elif text not in self._known["note"]:
            self._known["note"].add(text)
            self.notes.append(text)

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Add the errors that end the context, and continue after it."""
        try:
            yield
        except InputError as error:
            for text in error.problems if isinstance(error, Refused) else [str(error)]:
                self.problem(text)

    def refuse(self) -> None:
        """Raise an error if there are problems.

        Raises:
            Refused: with all of them.

        """
        if self.problems:
            raise Refused(*self.problems)
