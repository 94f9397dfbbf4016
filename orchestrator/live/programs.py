"""The programs of the live page: each system of a run as one program, and what they share.

Indices are no part of a program: they take its rows, as those of a run of FMUs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from fmus.ports.definition import Definition
from orchestrator.machine.errors import InputError
from orchestrator.program.components import definitions_of
from orchestrator.program.writer import EXPORTED, Equations, Text, Unsupported
from orchestrator.runs.preparation import Prepared
from orchestrator.vehicle.indices import metrics

#: What makes the indices.
REDUCERS = tuple(dict.fromkeys(one.reducer for one in metrics()))


class Source(NamedTuple):
    """A source of a module.

    Attributes:
        text: in C.
        called: its functions that the page calls.
        others: other functions that more than one source has.

    """

    text: str
    called: Sequence[str] = ()
    others: Sequence[str] = ()


#: Functions of a program, and of an index.
OF_PROGRAM = (
    ("size_of_simulation", "begin", "run_with_events", "rows_shown", "failure", "restarts"),
    ("run", "set"),
)
_OF_INDEX = ("reduce",), ("size_of_rows", "take_rows", "give_numbers")


class Programs:
    """Programs of several runs, whose components share their equations.

    Runs of the same system have the same program, whatever their parameters are.
    """

    def __init__(self, runs: Sequence[Prepared]) -> None:
        """Write them.

        Raises:
            InputError: a system cannot be a program; the text says why.

        """
        definitions = [definitions_of_run(run) for run in runs]
        all_ = [one for found in definitions for one in found.values()]
        try:
            self._equations = Equations(all_, REDUCERS, is_tuned=True)
        except Unsupported as error:
            name = runs[0].scenario.name
            raise InputError(f"{name}: the live page cannot run {error}") from None
        self._numbers: dict[str, int] = {}
        #: Of each run, with what must not be another one's identity.
        self._known: dict[int, tuple[Prepared, int, Text]] = {}
        for run, found in zip(runs, definitions, strict=True):
            text = self._text(run, found)
            number = self._numbers.setdefault(text.apart(), len(self._numbers))
            self._known[id(run)] = run, number, text

    @cached_property
    def sources(self) -> Mapping[str, Source]:
        """The sources by their names: of the equations, of each program, and of each index."""
        equations = self._equations
        indices = {
            one.name: "\n\n".join((equations.header, EXPORTED, reducer.over_run()))
            for one in REDUCERS
            for reducer in [equations.reducers[id(one)]]
        }
        return {
            "equations": Source(equations.apart()),
            **{f"p{n}": Source(text, *OF_PROGRAM) for text, n in self._numbers.items()},
            **{name: Source(text, *_OF_INDEX) for name, text in indices.items()},
        }

    def find(self, run: Prepared) -> tuple[int, Text] | None:
        """The number of a run's program, and what it is written from; None: it is another one."""
        if id(run) in self._known:
            _, number, text = self._known[id(run)]
            return number, text
        definitions = definitions_of_run(run)
        if not self._equations.kinds.keys() >= {*definitions.values()}:
            return None
        text = self._text(run, definitions)
        written = text.apart()
        return (self._numbers[written], text) if written in self._numbers else None

    def _text(self, run: Prepared, definitions: Mapping[str, Definition]) -> Text:
        return Text(run.plan, definitions, alters=True, shared=self._equations)


def definitions_of_run(run: Prepared) -> Mapping[str, Definition]:
    """The definitions of all components.

    Raises:
        InputError: one is not in the language of equations.

    """
    try:
        return definitions_of(run.plan.system)
    except InputError as error:
        raise InputError(f"{run.scenario.name}: the live page cannot run {error}") from None
