"""fmi-answers.md and fmi-answers.csv of docs/reference: what an FMU answers to each call."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from functools import cache
from itertools import product
from typing import NamedTuple

from fmus.kinds import NATIVE, PYTHON
from support.markdown import DOCS, Section, sections

PAGE = DOCS / "reference" / "fmi-answers.md"

#: Columns of the tables of calls.
MODES = ("instantiated", "initialising", "stepping", "terminated")
ERROR = "error"
STATES = (*MODES, ERROR)

#: Rows without an instance: the function that makes one, and other pointers.
CREATION, WITHOUT_AN_INSTANCE = "fmi2Instantiate", "no instance"

#: Entry of a function whose name has only another number.
SAME_NAME = "the same"

_UNSOUND = ("NULL", "n = ", "not UTF-8", "freed", "pointer", "too few", "too many")


class Answer(NamedTuple):
    """An answer: a line of the table of answers."""

    name: str
    status: str
    message: str
    fault: str
    changes: str
    afterwards: str

    @property
    def raises_fault(self) -> bool:
        return self.fault == "rises"

    @property
    def fails(self) -> bool:
        """True if it leads to the state error."""
        return self.afterwards.startswith(self.status) and self.status == "fmi2Error"

    @property
    def changes_nothing(self) -> bool:
        return self.changes.startswith("nothing")


class Cell(NamedTuple):
    """The answer to a call in a state, and the state that it leads to."""

    answer: Answer
    leads_to: str


class Row(NamedTuple):
    """A call with some arguments."""

    function: str
    case: str
    cells: dict[str, Cell]

    @property
    def key(self) -> tuple[str, str]:
        return self.function, self.case

    @property
    def is_unsound(self) -> bool:
        """True if only the loader sees its arguments."""
        return any(word in self.case for word in _UNSOUND)

    def __str__(self) -> str:
        return f"{self.function}: {self.case}" if self.case else self.function


@cache
def _sections() -> dict[str, Section]:
    return {section.heading: section for section in sections(PAGE)}


@cache
def answers() -> dict[str, Answer]:
    return {line[0]: Answer(*line) for line in _sections()["Answers"].rows}


def _keys(functions: str, cases: str) -> Iterator[tuple[str, str]]:
    """Each function and each case of a line."""
    return product(functions.split(", "), cases.split("; "))


@cache
def rows() -> dict[tuple[str, str], Row]:
    """All calls on an instance, by function and case."""
    found: dict[tuple[str, str], Row] = {}
    with PAGE.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        for function, case, *cells in csv.reader(file):
            if function.startswith("fmi2"):
                row = Row(function, case, _cells(dict(zip(STATES, cells, strict=True))))
                assert row.key not in found, f"{row} stands twice"
                found[row.key] = row
    return found


def _cells(texts: dict[str, str]) -> dict[str, Cell]:
    return {state: _cell(text, state) for state, text in texts.items() if text}


def _cell(text: str, state: str) -> Cell:
    name, _, leads_to = (part.strip() for part in text.partition("→"))
    answer = answers()[name or "OK"]
    return Cell(answer, leads_to or (ERROR if answer.fails else state))


def creations(kind: str = PYTHON) -> dict[str, bool]:
    """True if fmi2Instantiate gives an instance, by its arguments."""
    found = _creations("Creating an instance")
    if kind == NATIVE:
        others = _creations("The FMUs in C")
        assert others.keys() <= found.keys()
        found |= others
    return found


def _creations(heading: str) -> dict[str, bool]:
    rows = _sections()[heading].rows
    return {case: answer == "instance" for answer, cases in rows for case in cases.split("; ")}


def without_an_instance() -> dict[str, str]:
    """The status of any call, by the pointer that replaces an instance."""
    rows = _sections()["No instance"].rows
    return {what: answer for places, answer in rows for what in places.split("; ")}


def _tables_of_fmi3() -> list[Section]:
    return [section for section in sections(PAGE) if section.heading == "FMI 3.0"]


@cache
def names_in_fmi3() -> dict[str, str]:
    """The functions of FMI 3.0 that answer as functions of FMI 2.0 do, by the names of these."""
    names, _ = _tables_of_fmi3()
    return {
        function: function.replace("fmi2", "fmi3") if name == SAME_NAME else name
        for functions, name in names.rows
        for function in functions.split(", ")
    }


@cache
def fmi3_rows() -> dict[tuple[str, str], str]:
    """The answers of functions of FMI 3.0 only, by function and case."""
    _, own = _tables_of_fmi3()
    return {key: answer for functions, cases, answer in own.rows for key in _keys(functions, cases)}
