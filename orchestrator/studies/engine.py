"""Engines, which make the runs of a study, and the one that makes them with FMUs.

The other engine (:mod:`.batch_engine`) runs a system of components in the language of equations as
one compiled program. Both give the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any, Protocol

from orchestrator.cosim import Plan, PortName, make_plan
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import code_of
from orchestrator.machine.user_files import read_archive
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.result import Result
from orchestrator.studies.columns import Outcome, Outcomes, Point, Points
from orchestrator.studies.own_functions import OwnFunction
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.vehicle.cautions import Watch, cautions, values_of
from orchestrator.vehicle.indices import Indices
from orchestrator.vehicle.signals import loops_of


def listed_kinds(kinds: Iterable[str]) -> str | None:
    """Return kinds of cautions as text for an outcome."""
    return ", ".join(dict.fromkeys(kinds)) or None


def with_functions(outcome: Outcome, functions: Sequence[OwnFunction], result: Result) -> Outcome:
    """Return an outcome with the numbers of functions, or with the failure of one."""
    values = dict(outcome.indices)
    try:
        for function in functions:
            values |= function.values(result)
    except InputError as error:
        return outcome._replace(indices={}, failure=str(error))
    return outcome._replace(indices=values)


class Engine(Protocol):
    """Makes runs.

    An engine is pickled and sent to workers with everything that it needs, including FMUs, since
    workers need not share a file system with the sender. Workers keep what they unpack or compile.
    """

    #: The user's own indices that are functions.
    functions: Sequence[OwnFunction]

    @property
    def least_runs(self) -> int:
        """Number of runs that take about as long as a single one."""
        ...

    @property
    def most_runs(self) -> int:
        """Largest number of runs in a block."""
        ...

    @property
    def digest(self) -> str:
        """Hash of the code, on which the numbers depend besides the systems."""
        ...

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        """Make runs of the study that the engine was made for, some at a time, in their order."""
        ...


def outcomes_of(engine: Engine, points: Iterable[Point]) -> Iterator[Outcome]:
    """Make single runs."""
    for point in points:
        yield from chain(*engine.outcomes(Points.of([point])))


class FmuEngine:
    """Makes runs with FMUs in the calling process."""

    least_runs, most_runs = 1, 10_000

    def __init__(
        self,
        prepared: Mapping[str, Prepared],
        loop: str = Plan.LOOPS[0],
        own: Sequence[OwnIndex] = (),
        functions: Sequence[OwnFunction] = (),
    ) -> None:
        """Make an engine.

        Args:
            prepared: runs by the names of their scenarios.
            loop: that makes the steps, one of :attr:`.Plan.LOOPS`.
            own: the user's own indices.
            functions: those that are functions.

        """
        self._prepared, self._loop, self._own = dict(prepared), loop, own
        self.functions = functions

    @property
    def digest(self) -> str:
        """Hash of the code that computes the indices."""
        return code_of("orchestrator.vehicle", "orchestrator.studies")

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        """Make runs, one by one.

        Raises:
            KeyboardInterrupt: there was a signal to stop.

        """
        for point in points:
            try:
                outcome = self._outcome(point)
            except InputError as error:
                outcome = Outcome(point.number, {}, str(error))
            yield Outcomes.of([outcome])

    def _outcome(self, point: Point) -> Outcome:
        prepared = self._prepared[point.scenario]
        system = prepared.system.with_parameters(
            {PortName.read(name): value for name, value in point.parameters.items()}
        )
        experiment = replace(
            prepared.experiment, stop_time=point.stop_time, step=point.step, order=point.order
        )
        loops = loops_of(system)
        own = [*chain(*(file.indices for file in self._own))]
        indices, watch = Indices(loops, own=own), Watch(loops)
        run = replace(prepared, plan=make_plan(system, experiment, loop=self._loop))
        result = Result(run.scenario, loops, run)
        ending = run.run([indices, watch, *([result] if self.functions else [])])
        if ending.interrupts:
            raise KeyboardInterrupt
        found = [*cautions(values_of(system), point.step, loops), *watch.found()]
        kinds = listed_kinds(caution.kind for caution in found)
        if ending.failure is not None:
            return Outcome(point.number, {}, ending.failure, kinds)
        values = indices.values()
        if failures := indices.failures:
            return Outcome(point.number, {}, f"index {failures[0]}", kinds)
        return with_functions(Outcome(point.number, values, None, kinds), self.functions, result)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state, in which each system has its FMUs.

        Raises:
            InputError: one has changed since it was read.

        """
        for prepared in self._prepared.values():
            for part in prepared.system.components.values():
                read_archive(part.fmu, part.digest)
        return self.__dict__
