"""A run of a study, what comes out of it, and what an engine is.

There are two engines. The one here runs FMUs, of any system. The other (:mod:`.batch_engine`) runs
a system of components in the language of equations as one compiled program. Both give the same
numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from orchestrator.cosim import Order, Plan, PortName, make_plan
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import code_of
from orchestrator.machine.user_files import read_archive
from orchestrator.runs.preparation import Prepared
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.vehicle.cautions import Caution, Watch, cautions, values_of
from orchestrator.vehicle.indices import Indices
from orchestrator.vehicle.signals import loops_of


class Point(NamedTuple):
    """One run of a study.

    Attributes:
        number: within the study, from 0.
        scenario: name or path.
        parameters: what it changes, by `component.parameter`, with the scenario's own left out.
        stop_time, step: of the experiment [s].
        order: of evaluation.
        start_time: of the experiment [s].

    """

    number: int
    scenario: str
    parameters: Mapping[str, Any]
    stop_time: float
    step: float
    order: Order | None = None
    start_time: float = 0.0

    @property
    def steps(self) -> float:
        """Length of the run in steps."""
        return (self.stop_time - self.start_time) / self.step


class Outcome(NamedTuple):
    """What comes out of a run.

    Attributes:
        number: of the run.
        indices: by their columns, :func:`.index_columns`; none of a run that has failed.
        failure: why the run ended early, or None.
        cautions: what to be wary of, of :data:`.cautions.CAUTIONS`, with commas between them; None:
            nothing.

    """

    number: int
    indices: Mapping[str, float]
    failure: str | None = None
    cautions: str | None = None


def kinds_of(cautions: Iterable[Caution]) -> str | None:
    """The kinds of some cautions, each once, as an outcome has them."""
    return ", ".join(dict.fromkeys(caution.kind for caution in cautions)) or None


class Engine(Protocol):
    """Makes runs.

    It is pickled, and travels to workers with everything that it needs, FMUs included: they share
    no file system with the process that sends it. What is unpacked or compiled on a worker is kept
    there for the runs that follow.

    Attributes:
        digest: of what the numbers depend on besides the identities of what is run.

    """

    @property
    def digest(self) -> str:
        """A text in hexadecimal digits."""
        ...

    def outcomes(self, points: Sequence[Point]) -> Iterator[Outcome]:
        """Make some runs, in their order.

        Args:
            points: of the study that the engine was made for.

        """
        ...


class FmuEngine:
    """Makes runs with FMUs in the process that it is called in; it takes them along."""

    def __init__(
        self,
        prepared: Mapping[str, Prepared],
        loop: str = Plan.LOOPS[0],
        own: Sequence[OwnIndex] = (),
    ) -> None:
        """Take what is run.

        Args:
            prepared: by the names that runs have for their scenarios.
            loop: that makes the steps, one of :attr:`.Plan.LOOPS`.
            own: indices of the user's own.

        """
        self._prepared, self._loop, self._own = dict(prepared), loop, own

    @property
    def digest(self) -> str:
        """Of the code that says what comes out of rows."""
        return code_of("orchestrator.vehicle", "orchestrator.studies")

    def outcomes(self, points: Sequence[Point]) -> Iterator[Outcome]:
        """Make some runs, in their order.

        Raises:
            KeyboardInterrupt: a signal has come to stop it.

        """
        for point in points:
            try:
                yield self._outcome(point)
            except InputError as error:
                yield Outcome(point.number, {}, str(error))

    def _outcome(self, point: Point) -> Outcome:
        prepared = self._prepared[point.scenario]
        system = prepared.system.with_parameters(
            {PortName.read(name): value for name, value in point.parameters.items()}
        )
        experiment = replace(
            prepared.experiment, stop_time=point.stop_time, step=point.step, order=point.order
        )
        loops = loops_of(system)
        own = [*chain(*(one.indices for one in self._own))]
        indices, watch = Indices(loops, own=own), Watch(loops)
        plan = make_plan(system, experiment, loop=self._loop)
        ending = replace(prepared, plan=plan).run([indices, watch])
        if ending.interrupts:
            raise KeyboardInterrupt
        wary = kinds_of([*cautions(values_of(system), point.step, loops), *watch.found()])
        if ending.failure is not None:
            return Outcome(point.number, {}, ending.failure, wary)
        values = indices.values()
        if failures := indices.failures:
            return Outcome(point.number, {}, f"index {failures[0]}", wary)
        return Outcome(point.number, values, None, wary)

    def __getstate__(self) -> dict[str, Any]:
        """With the FMUs, each once, by their digests.

        Raises:
            InputError: one has changed since it was read.

        """
        archives = {
            part.digest: read_archive(part.fmu, part.digest)
            for prepared in self._prepared.values()
            for part in prepared.system.components.values()
        }
        kept = {"prepared": self._prepared, "loop": self._loop, "own": self._own}
        return {**kept, "archives": archives}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Put the FMUs where this process keeps what is temporary."""
        places = {digest: _place(digest, content) for digest, content in state["archives"].items()}
        self._prepared, self._loop, self._own = {}, state["loop"], state["own"]
        for name, prepared in state["prepared"].items():
            components = {
                part.name: replace(part, fmu=places[part.digest])
                for part in prepared.system.components.values()
            }
            system = replace(prepared.system, components=components)
            self._prepared[name] = replace(prepared, plan=replace(prepared.plan, system=system))


def _place(digest: str, content: bytes) -> Path:
    """Where an FMU lies that has come from elsewhere."""
    path = process_folder() / f"{digest}.fmu"
    if not path.exists():
        path.write_bytes(content)
    return path
