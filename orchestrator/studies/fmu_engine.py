"""Runs of FMUs, of any system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError
from orchestrator.master.events import Event, Events
from orchestrator.master.experiment import Experiment
from orchestrator.master.loop import LOOPS, chosen
from orchestrator.master.simulation import simulate
from orchestrator.studies.engine import Outcome, Run
from orchestrator.studies.indices import Indices
from orchestrator.system.leftovers import process_folder
from orchestrator.system.names import port_name
from orchestrator.system.structure import System
from orchestrator.system.unpacking import archive_of


class FmuEngine:
    """Makes runs with FMUs in the process that it is called in; it takes them along."""

    def __init__(
        self,
        systems: Mapping[str, System],
        loop: str = LOOPS[0],
        events: Mapping[str, tuple[Event, ...]] | None = None,
    ) -> None:
        """Take systems.

        Args:
            systems: by the names that runs have for their scenarios.
            loop: that makes the steps, one of :data:`orchestrator.master.loop.LOOPS`.
            events: that happen in their runs.

        """
        self._systems, self._loop, self._events = dict(systems), loop, dict(events or {})

    @property
    def digest(self) -> str:
        """Of the FMUs, of how they are connected, and of their parameters."""
        content = [
            (
                name,
                [(part.name, part.digest) for part in system.components.values()],
                system.connections,
                system.parameters,
                self._events.get(name, ()),
            )
            for name, system in self._systems.items()
        ]
        return sha256(repr(content).encode()).hexdigest()

    def outcomes(self, runs: Sequence[Run]) -> Iterator[Outcome]:
        """Make some runs, in their order.

        Raises:
            KeyboardInterrupt: somebody wants it to stop.

        """
        for run in runs:
            try:
                yield self._outcome(run)
            except InputError as error:
                yield Outcome(run.number, {}, str(error))

    def _outcome(self, run: Run) -> Outcome:
        system = self._systems[run.scenario].with_parameters(
            {port_name(name): value for name, value in run.parameters.items()}
        )
        experiment = Experiment(run.stop_time, run.step, run.order, system.start_time or 0.0)
        indices = Indices()
        events = self._events.get(run.scenario)
        ending = simulate(
            system,
            experiment,
            [indices],
            loop=chosen(self._loop, experiment),
            attendants=[Events(events)] if events else (),
        )
        if ending.signals:
            raise KeyboardInterrupt
        if ending.failure is not None:
            return Outcome(run.number, {}, ending.failure)
        return Outcome(run.number, indices.values())

    def __getstate__(self) -> dict[str, Any]:
        """With the FMUs, each once, by their digests.

        Raises:
            InputError: one has changed since it was read.

        """
        archives = {
            part.digest: archive_of(part.fmu, part.digest)
            for system in self._systems.values()
            for part in system.components.values()
        }
        return {
            "systems": self._systems,
            "loop": self._loop,
            "events": self._events,
            "archives": archives,
        }

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Put the FMUs where this process keeps what is temporary."""
        places = {digest: _place(digest, content) for digest, content in state["archives"].items()}
        self._loop, self._events = state["loop"], state["events"]
        self._systems = {
            name: replace(
                system,
                components={
                    part.name: replace(part, fmu=places[part.digest])
                    for part in system.components.values()
                },
            )
            for name, system in state["systems"].items()
        }


def _place(digest: str, content: bytes) -> Path:
    """Where an FMU lies that has come from elsewhere."""
    path = process_folder() / f"{digest}.fmu"
    if not path.exists():
        path.write_bytes(content)
    return path
