"""Runs by compiled programs: the numbers of the FMUs, far sooner."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import chain
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.variable import Refusal
from fmus.ports.definition import Definition
from fmus.ports.port import Port
from orchestrator.cosim import (
    Ending,
    Experiment,
    Header,
    Order,
    PortName,
    System,
    Table,
    Value,
    make_plan,
)
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import code_of
from orchestrator.program.components import definitions_of
from orchestrator.program.library import Program, Source
from orchestrator.program.writer import Text, indices_of
from orchestrator.studies.engine import Outcome, Point, kinds_of
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.vehicle.cautions import (
    WATCHED,
    cautions,
    cautions_seen,
    values_of,
)
from orchestrator.vehicle.distances import SMALLEST_DISTANCE, smallest_of
from orchestrator.vehicle.indices import INDICES, prefixed
from orchestrator.vehicle.signals import loops_of

#: What makes every system.
_OTHER = "use --engine fmu"

#: Said of a run that the program has refused: FMUs make it again, and say why.
REFUSED = "refused"

#: What tells apart the programs that a system has: the order, and the steps of components.
_Key = tuple[Order | None, tuple[int, ...]]


@dataclass(frozen=True)
class _Ready:
    """The program of a system, as it travels, and what its numbers are.

    Attributes:
        source: of the program.
        groups: for each index, its columns and their places among the numbers.
        watched: for each loop, the places of what cautions follow from.

    """

    source: Source
    groups: Sequence[Mapping[str, int]]
    watched: Sequence[Mapping[str, int]]

    @cached_property
    def program(self) -> Program:
        """The program, compiled."""
        return Program(self.source)

    @cached_property
    def _places(self) -> Mapping[str, int]:
        return {column: place for group in self.groups for column, place in group.items()}

    def indices(self, numbers: Sequence[float]) -> dict[str, float]:
        """The indices among the numbers of a run, without those that are not there."""
        found = {column: numbers[place] for column, place in self._places.items()}
        if any(map(isnan, found.values())):
            for group in self.groups:
                if all(isnan(numbers[place]) for place in group.values()):
                    for column in group:
                        del found[column]
        return found

    def __getstate__(self) -> Mapping[str, Any]:
        """Without the library, which each process loads."""
        kept = {name: one for name, one in self.__dict__.items() if name != "program"}
        return {**kept, "source": self.program.source.with_library()}


class _Parameter(NamedTuple):
    """A parameter of a program: its place, and the port that says what it can be."""

    place: int
    port: Port
    items: Mapping[str, int]


class _Known:
    """A system that a program is made of.

    Attributes:
        system: with its own values.
        loops: of its vehicles.

    """

    def __init__(self, system: System, own: Sequence[OwnIndex]) -> None:
        self.system, self.loops = system, loops_of(system)
        self._own = own
        self._ready: dict[_Key, _Ready] = {}
        self._found: dict[tuple[Order | None, float], _Ready] = {}
        self._definitions: Mapping[str, Definition] | None = definitions_of(system)
        self._parameters: tuple[Mapping[str, _Parameter], np.ndarray] | None = None
        self._names = frozenset(
            str(PortName(name, port))
            for name, component in system.components.items()
            for port in component.variables
        )

    def ready(self, order: Order | None, step: float) -> _Ready:
        """The program for an order and a step.

        Raises:
            InputError: there is none.

        """
        if (order, step) not in self._found:
            key = order, tuple(self.system.decimations(step).values())
            if key not in self._ready:
                self._ready[key] = self._written(order, step)
            self._found[order, step] = self._ready[key]
        return self._found[order, step]

    def _written(self, order: Order | None, step: float) -> _Ready:
        system = self.system
        if self._definitions is None:
            self._definitions = definitions_of(system)
        indices = [*INDICES, *chain.from_iterable(one.indices for one in self._own)]
        reducers = [*dict.fromkeys(index.reducer for index in indices), *WATCHED]
        plan = make_plan(system, Experiment(step * 2.0**20, step, order))
        looking = [[*indices_of(system, loop, reducers)] for loop in self.loops]
        text = Text(plan, self._definitions, [*chain(*looking)], is_quick=True)
        groups, watched, first = [], [], 0
        for (_, prefix), looks in zip(prefixed(self.loops), looking, strict=True):
            places: dict[str, int] = {}
            for look in looks:
                for name, ports in look.reducer.results.items():
                    places[name] = first
                    first += len(ports)
            found = (index for index in indices if index.name in places)
            groups += [
                {f"{prefix}{one}": places[index.name] + i for i, one in enumerate(index.columns)}
                for index in found
            ]
            names = (name for one in WATCHED for name in one.results)
            watched.append({name: places[name] for name in names if name in places})
        return _Ready(Source.of(text), groups, watched)

    def plain(self, point: Point) -> Point:
        """A run without names that mean several parameters: stars, and groups of them."""
        if self._names.issuperset(point.parameters):
            return point
        expanded = self.system.expanded(point.parameters)
        parameters = {str(self.system.named(name)): value for name, value in expanded.items()}
        return point._replace(parameters=parameters)

    def values(self, ready: _Ready, changed: Mapping[str, Value]) -> np.ndarray:
        """The values of all parameters of a run.

        Raises:
            Refusal: a component would refuse one.

        """
        if self._parameters is None:
            # At once: other threads make runs.
            self._parameters = self._taken(ready)
        parameters, own = self._parameters
        values = own.copy()
        for name, value in changed.items():
            one = parameters[name]
            values[one.place] = _number(one, value)
        return values

    def _taken(self, ready: _Ready) -> tuple[Mapping[str, _Parameter], np.ndarray]:
        """All parameters of a program by their names, and the values that the system has."""
        names = ready.source.parameters
        parameters = {name: self._parameter(place, name) for place, name in enumerate(names)}
        own = [
            _number(one, self.system.value(PortName.read(name))) for name, one in parameters.items()
        ]
        return parameters, np.array(own, dtype=float)

    def _parameter(self, place: int, text: str) -> _Parameter:
        name = self.system.named(PortName.read(text))
        variable = self.system.components[name.component].variables[name.port]
        port = self._ports[name]
        return _Parameter(place, port, {key: int(v) for key, v in variable.items.items()})

    @cached_property
    def _ports(self) -> Mapping[PortName, Port]:
        """The ports of all components, whose choices are numbers: modules do not travel."""
        assert self._definitions is not None
        return {
            PortName(name, port.name): replace(
                port, choices={choice: int(number) for choice, number in port.choices.items()}
            )
            for name, definition in self._definitions.items()
            for port in definition.ports
        }

    def positions(self, ready: _Ready, rows: np.ndarray) -> np.ndarray:
        """The positions of all vehicles in some rows."""
        places = {name: i for i, name in enumerate(ready.source.columns, 1)}
        return np.stack(
            [rows[:, [places[name] for name in loop.position]] for loop in self.loops], axis=1
        )

    def cautions(self, ready: _Ready, point: Point, numbers: Sequence[float]) -> str | None:
        """What to be wary of in a run."""

        def value(name: str) -> Value | None:
            return self.value(point, name)

        found = cautions(value, point.step, self.loops)
        for loop, places in zip(self.loops, ready.watched, strict=True):
            seen = {name: numbers[i] for name, i in places.items() if not isnan(numbers[i])}
            found += cautions_seen(seen, loop, value, point.step)
        return kinds_of(found)

    def value(self, point: Point, name: str) -> Value | None:
        """The value of a parameter in a run; None: there is no such parameter."""
        found: Value | None
        found = point.parameters[name] if name in point.parameters else self._values(name)
        return found

    @cached_property
    def _values(self) -> Any:
        return cache(values_of(self.system))

    def __getstate__(self) -> dict[str, Any]:
        """Without modules, which other machines need not have, but with what is compiled."""
        if self._definitions is not None:
            self._ports  # noqa: B018
        kept = {name: one for name, one in self.__dict__.items() if name != "_values"}
        return {**kept, "_definitions": None, "_parameters": None}


def _number(one: _Parameter, value: Any) -> float:
    """The number of a parameter's value.

    Raises:
        Refusal: the component would refuse it.

    """
    given: Any = one.items.get(value, value) if isinstance(value, str) else value
    return float(one.port.checked(given))


class BatchEngine:
    """Makes runs by the compiled programs of their systems, one after the other in each thread."""

    def __init__(self, systems: Mapping[str, System], own: Sequence[OwnIndex] = ()) -> None:
        """Take systems.

        Args:
            systems: by the names that runs have for their scenarios.
            own: indices of the user's own.

        Raises:
            InputError: one of them cannot be a program.

        """
        self._known = dict[str, _Known]()
        for name, system in systems.items():
            system.check()
            try:
                self._known[name] = _Known(system, own)
            except InputError as error:
                raise InputError(f"{name}: {error}; {_OTHER}") from None

    @property
    def digest(self) -> str:
        """Of the code that makes programs, and of what makes indices of them."""
        return code_of("auv_fmu", "fmus", "orchestrator.program", "orchestrator.vehicle")

    def prepare(self, point: Point) -> None:
        """Compile the program of a run.

        Raises:
            InputError: it cannot be one; the text says why.

        """
        try:
            self._ready(point).program  # noqa: B018
        except InputError as error:
            raise InputError(f"{point.scenario}: {error}; {_OTHER}") from None

    def outcomes(self, points: Iterable[Point]) -> Iterator[Outcome]:
        """Make some runs, in their order."""
        for point in points:
            yield self._outcome(point)

    def value(self, point: Point, name: str) -> Value | None:
        """The value of a parameter in a run; None: there is no such parameter."""
        known = self._known[point.scenario]
        return known.value(known.plain(point), name)

    def _ready(self, point: Point) -> _Ready:
        return self._known[point.scenario].ready(point.order, point.step)

    def _outcome(self, point: Point) -> Outcome:
        known, ready = self._known[point.scenario], self._ready(point)
        point, program = known.plain(point), ready.program
        experiment = _experiment(point)
        is_fleet = len(known.loops) > 1
        try:
            values = known.values(ready, point.parameters)
        except Refusal:
            return Outcome(point.number, {}, REFUSED)
        rows = None
        if is_fleet:
            rows = np.empty((experiment.rows, 1 + len(ready.source.columns)))
        found = program.run(values, experiment, rows)
        if found is None:
            return Outcome(point.number, {}, REFUSED)
        numbers = found.tolist()
        indices: dict[str, float] = {}
        if rows is not None:
            indices[SMALLEST_DISTANCE] = float(smallest_of(known.positions(ready, rows)).min())
        indices |= ready.indices(numbers)
        return Outcome(point.number, indices, None, known.cautions(ready, point, numbers))

    def table(self, point: Point) -> Table:
        """A run with its rows.

        Raises:
            InputError: a component has refused.

        """
        known, ready = self._known[point.scenario], self._ready(point)
        point, experiment = known.plain(point), _experiment(point)
        rows = np.empty((experiment.rows, 1 + len(ready.source.columns)))
        try:
            values = known.values(ready, point.parameters)
        except Refusal as refusal:
            raise InputError(str(refusal)) from None
        if ready.program.run(values, experiment, rows) is None:
            raise InputError(f"{point.scenario}: a component has refused")
        system = known.system.with_parameters(point.parameters)
        parameters = {
            name: variable.shown(system.value(name))
            for component in system.components.values()
            for variable in component.having("parameter")
            for name in (PortName(component.name, variable.name),)
        }
        return Table.of(
            Header(tuple(ready.source.columns), experiment, parameters), rows, Ending(None)
        )


_experiments: Callable[..., Experiment] = lru_cache(Experiment)


def _experiment(point: Point) -> Experiment:
    return _experiments(point.stop_time, point.step, point.order, point.start_time)
