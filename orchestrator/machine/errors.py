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
    """What an exception says, in one line."""
    if isinstance(error, MemoryError):
        return "out of memory"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    more = [f"and {len(lines) - _MOST_LINES} more lines"] * (len(lines) > _MOST_LINES)
    said = (shortened(line, _LONGEST_LINE) for line in (*lines[:_MOST_LINES], *more))
    return "; ".join(said).replace(":; ", ": ") or repr(error)


def unforeseen(error: Exception) -> str:
    """What an exception says during a run, in one line.

    But for a full disk or short memory none is foreseen there. An FMU may have closed files of this
    process, or changed what Python's modules hold.
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
    """A text for a message, cut where it gets long."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Names, of many the first, with something between them."""
    more = len(names) - _MOST_NAMES
    return between.join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def escape_unprintable(text: str, allowed: str = "") -> str:
    """Escape what would speak to the terminal, in names as well.

    Args:
        text: to be shown.
        allowed: letters that may stay, though they are not printed.

    """
    return "".join(
        letter if letter.isprintable() or letter in allowed else repr(letter)[1:-1]
        for letter in text
    )


def last_line(text: str, otherwise: str = "no reason given") -> str:
    """The last line of what a child process has said: the reason why it failed."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else otherwise


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint at names that resemble a mistaken one, or begin with it; empty if there is none."""
    names = list(known)
    members = [other for other in names if other.startswith((f"{name}[", f"{name}."))]
    same = [other for other in names if other.casefold() == name.casefold()]
    near = members[:3] or same[:3] or get_close_matches(name, names, n=3)
    return f"; did you mean {' or '.join(near)}?" if near else ""


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
        """Begin with none; where it is strict, everything is a problem."""
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
