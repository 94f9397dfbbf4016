"""Errors in words for the user, and all problems of a file, collected."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches

#: How many lines of a long text, such as the problems of a description, are shown, and how many
#: letters of each.
_MOST_LINES, _LONGEST_LINE = 10, 300


#: Of many names, this many are shown.
_MOST_NAMES = 5


class InputError(ValueError):
    """The user asked for something that cannot be done; the text says what to change."""


class StartError(InputError):
    """A simulation has failed before its first row, though all that was asked for can be done."""


def reason(error: BaseException) -> str:
    """Return the message of an exception in one line."""
    if isinstance(error, MemoryError):
        return "out of memory"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    more = [f"and {len(lines) - _MOST_LINES} more lines"] * (len(lines) > _MOST_LINES)
    said = (shortened(line, _LONGEST_LINE) for line in (*lines[:_MOST_LINES], *more))
    return "; ".join(said).replace(":; ", ": ") or repr(error)


def unforeseen(error: Exception) -> str:
    """Return the message of an exception during a run in one line.

    Only a full disk and lack of memory are foreseen there. An FMU may have closed files of this
    process, or changed modules of Python.
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
    """Names, of many the first, with something between them."""
    more = len(names) - _MOST_NAMES
    return between.join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def escape_unprintable(text: str, allowed: str = "") -> str:
    """Escape control characters, which the terminal would obey.

    Args:
        text: to be shown.
        allowed: letters that may stay, though they are not printed.

    """
    return "".join(
        letter if letter.isprintable() or letter in allowed else repr(letter)[1:-1]
        for letter in text
    )


def last_line(text: str, otherwise: str = "no reason given") -> str:
    """Return the last line that a child process has written, the reason why it failed."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else otherwise


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint at names that resemble a mistaken one or begin with it; empty if none does."""
    names = list(known)
    members = [other for other in names if other.startswith((f"{name}[", f"{name}."))]
    same = [other for other in names if other.casefold() == name.casefold()]
    near = members[:3] or same[:3] or get_close_matches(name, names, n=3)
    return f"; did you mean {' or '.join(near)}?" if near else ""


class Refused(InputError):
    """Something has problems; the message is the first of them."""

    def __init__(self, *problems: str) -> None:
        """Make the message of the first problem and the number of others."""
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
        self._said: dict[str, set[str]] = {"problem": set(), "note": set()}

    def problem(self, text: str) -> None:
        """Add a problem that makes a run meaningless or impossible."""
        if text not in self._said["problem"]:
            self._said["problem"].add(text)
            self.problems.append(text)

    def note(self, text: str) -> None:
        """Add a problem that changes no number."""
        if self._strict:
            self.problem(text)
        elif text not in self._said["note"]:
            self._said["note"].add(text)
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
