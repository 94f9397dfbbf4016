"""The engine that makes runs by compiled programs, with the numbers of the FMUs."""

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
    Value,
    make_plan,
)
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import code_of
from orchestrator.program.components import definitions_of
from orchestrator.program.library import Program, Source
from orchestrator.program.writer import Text, indices_of
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.request import PROGRAM
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.engine import Outcome, Point, kinds_of, with_functions
from orchestrator.studies.own_functions import OwnFunction
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.vehicle.cautions import (
    WATCHED,
    cautions,
    cautions_of,
    values_of,
)
from orchestrator.vehicle.indices import INDICES, SMALLEST_DISTANCE, prefixed
from orchestrator.vehicle.signals import loops_of

#: Advice for systems that this engine cannot run.
_ADVICE = "use --engine fmu"

#: Failure of a run that the program has refused; it is repeated with FMUs, which give a reason.
REFUSED = "refused"

#: Key of the programs of a system: the order, and the decimations of the components.
_Key = tuple[Order | None, tuple[int, ...]]


@dataclass(frozen=True)
class _Compiled:
    """The program of a system, and the places of indices in its results.

    Attributes:
        source: of the program.
        groups: for each index, the places of its columns.
        watched: for each loop, the places of the values that cautions depend on.

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
        """Return the indices in the results of a run, without groups of nan."""
        indices = {column: numbers[place] for column, place in self._places.items()}
        if any(map(isnan, indices.values())):
            for group in self.groups:
                if all(isnan(numbers[place]) for place in group.values()):
                    for column in group:
                        del indices[column]
        return indices

    def __getstate__(self) -> Mapping[str, Any]:
        """Return the state without the loaded library; each process loads it."""
        state = {name: value for name, value in self.__dict__.items() if name != "program"}
        return {**state, "source": self.program.source.with_library()}


class _Parameter(NamedTuple):
    """A parameter of a program: its place, its port, and the numbers of items of Enumerations."""

    place: int
    port: Port
    items: Mapping[str, int]


class _Programs:
    """The programs of a system.

    Attributes:
        system: with its own values.
        loops: of its vehicles.

    """

    def __init__(self, system: System, own: Sequence[OwnIndex]) -> None:
        self.system, self.loops = system, loops_of(system)
        self._own = own
        self._by_key: dict[_Key, _Compiled] = {}
        self._by_step: dict[tuple[Order | None, float], _Compiled] = {}
        self._definitions: Mapping[str, Definition] | None = definitions_of(system)
        self._parameters: tuple[Mapping[str, _Parameter], np.ndarray] | None = None
        self._names = frozenset(
            str(PortName(name, port))
            for name, component in system.components.items()
            for port in component.variables
        )

    def compiled(self, order: Order | None, step: float) -> _Compiled:
        """Return the program for an order and a step.

        Raises:
            InputError: there is none.

        """
        if (order, step) not in self._by_step:
            key = order, tuple(self.system.decimations(step).values())
            if key not in self._by_key:
                self._by_key[key] = self._make(order, step)
            self._by_step[order, step] = self._by_key[key]
        return self._by_step[order, step]

    def _make(self, order: Order | None, step: float) -> _Compiled:
        system = self.system
        if self._definitions is None:
            self._definitions = definitions_of(system)
        indices = [*INDICES, *chain.from_iterable(file.indices for file in self._own)]
        reducers = [*dict.fromkeys(index.reducer for index in indices), *WATCHED]
        plan = make_plan(system, Experiment(step * 2.0**20, step, order))
        looking = [[*indices_of(system, loop, reducers)] for loop in self.loops]
        text = Text(plan, self._definitions, [*chain(*looking)], self.loops, is_quick=True)
        groups, watched, first = [], [], 0
        for (_, prefix), looks in zip(prefixed(self.loops), looking, strict=True):
            places: dict[str, int] = {}
            for look in looks:
                for name, ports in look.reducer.results.items():
                    places[name] = first
                    first += len(ports)
            groups += [
                {f"{prefix}{name}": places[index.name] + i for i, name in enumerate(index.columns)}
                for index in indices
                if index.name in places
            ]
            names = (name for reducer in WATCHED for name in reducer.results)
            watched.append({name: places[name] for name in names if name in places})
        if text.positions:
            groups.append({SMALLEST_DISTANCE: first})
        return _Compiled(Source.of(text), groups, watched)

    def plain(self, point: Point) -> Point:
        """Return a run whose parameters are single ones: without wildcards and groups."""
        if self._names.issuperset(point.parameters):
            return point
        expanded = self.system.expanded(point.parameters)
        parameters = {str(self.system.named(name)): value for name, value in expanded.items()}
        return point._replace(parameters=parameters)

    def values(self, compiled: _Compiled, changed: Mapping[str, Value]) -> np.ndarray:
        """Return the values of all parameters of a run.

        Raises:
            Refusal: a component would refuse one.

        """
        if self._parameters is None:
            # In one assignment, since other threads make runs.
            self._parameters = self._defaults(compiled)
        parameters, defaults = self._parameters
        values = defaults.copy()
        for name, value in changed.items():
            parameter = parameters[name]
            values[parameter.place] = _number(parameter, value)
        return values

    def _defaults(self, compiled: _Compiled) -> tuple[Mapping[str, _Parameter], np.ndarray]:
        """Return all parameters of a program by name, and their values in the system."""
        names = compiled.source.parameters
        parameters = {name: self._parameter(place, name) for place, name in enumerate(names)}
        values = [
            _number(parameter, self.system.value(PortName.read(name)))
            for name, parameter in parameters.items()
        ]
        return parameters, np.array(values, dtype=float)

    def _parameter(self, place: int, text: str) -> _Parameter:
        name = self.system.named(PortName.read(text))
        variable = self.system.components[name.component].variables[name.port]
        port = self._ports[name]
        return _Parameter(place, port, {key: int(v) for key, v in variable.items.items()})

    @cached_property
    def _ports(self) -> Mapping[PortName, Port]:
        """The ports of all components, with numbers as choices, which can be pickled."""
        assert self._definitions is not None
        return {
            PortName(name, port.name): replace(
                port, choices={choice: int(number) for choice, number in port.choices.items()}
            )
            for name, definition in self._definitions.items()
            for port in definition.ports
        }

    def result(
        self, compiled: _Compiled, point: Point, experiment: Experiment, rows: np.ndarray
    ) -> Result:
        """Return the result of a run, as :func:`.simulate` does."""
        system = self.system.with_parameters(point.parameters)
        plan = make_plan(system, experiment)
        columns = [system.named(PortName.read(name)) for name in compiled.source.columns]
        # The order of systems of the language where none is stated.
        ordered = replace(experiment, order=experiment.order or "feedthrough")
        header = Header.of(system, ordered, columns, PROGRAM)
        scenario = Scenario(point.scenario)
        result = Result(scenario, self.loops, Prepared(scenario, plan))
        result.hold(header, rows, Ending())
        return result

    def cautions(self, compiled: _Compiled, point: Point, numbers: Sequence[float]) -> str | None:
        """Return the kinds of cautions of a run."""

        def value(name: str) -> Value | None:
            return self.value(point, name)

        every = cautions(value, point.step, self.loops)
        for loop, places in zip(self.loops, compiled.watched, strict=True):
            seen = {name: numbers[i] for name, i in places.items() if not isnan(numbers[i])}
            every += cautions_of(seen, loop, value)
        return kinds_of(every)

    def value(self, point: Point, name: str) -> Value | None:
        """Return the value of a parameter in a run; None if there is no such parameter."""
        value: Value | None
        value = point.parameters[name] if name in point.parameters else self._values(name)
        return value

    @cached_property
    def _values(self) -> Any:
        return cache(values_of(self.system))

    def __getstate__(self) -> dict[str, Any]:
        """Return the state with programs, and without modules, which other machines may lack."""
        if self._definitions is not None:
            self._ports  # noqa: B018
        state = {name: value for name, value in self.__dict__.items() if name != "_values"}
        return {**state, "_definitions": None, "_parameters": None}


def _number(parameter: _Parameter, value: Any) -> float:
    """Return the value of a parameter as a number.

    Raises:
        Refusal: the component would refuse it.

    """
    given: Any = parameter.items.get(value, value) if isinstance(value, str) else value
    return float(parameter.port.checked(given))


class BatchEngine:
    """Makes runs by compiled programs."""

    def __init__(
        self,
        systems: Mapping[str, System],
        own: Sequence[OwnIndex] = (),
        functions: Sequence[OwnFunction] = (),
    ) -> None:
        """Make an engine.

        Args:
            systems: by the names of scenarios in runs.
            own: the user's own indices.
            functions: those that are functions.

        Raises:
            InputError: a system cannot become a program.

        """
        self.functions = functions
        self._programs = dict[str, _Programs]()
        for name, system in systems.items():
            system.check()
            try:
                self._programs[name] = _Programs(system, own)
            except InputError as error:
                raise InputError(f"{name}: {error}; {_ADVICE}") from None

    @property
    def digest(self) -> str:
        """Hash of the code that makes programs and indices."""
        return code_of("auv_fmu", "fmus", "orchestrator.program", "orchestrator.vehicle")

    def prepare(self, point: Point) -> None:
        """Compile the program of a run.

        Raises:
            InputError: its system cannot become a program; the message has the reason.

        """
        try:
            self._programs[point.scenario].compiled(point.order, point.step).program  # noqa: B018
        except InputError as error:
            raise InputError(f"{point.scenario}: {error}; {_ADVICE}") from None

    def outcomes(self, points: Iterable[Point]) -> Iterator[Outcome]:
        """Make runs, in their order."""
        for point in points:
            yield self._outcome(point)

    def value(self, point: Point, name: str) -> Value | None:
        """Return the value of a parameter in a run; None if there is no such parameter."""
        programs = self._programs[point.scenario]
        return programs.value(programs.plain(point), name)

    def _outcome(self, point: Point) -> Outcome:
        programs = self._programs[point.scenario]
        compiled = programs.compiled(point.order, point.step)
        point, experiment = programs.plain(point), _experiment(point)
        try:
            values = programs.values(compiled, point.parameters)
        except Refusal:
            return Outcome(point.number, {}, REFUSED)
        rows = None
        if self.functions:
            rows = np.empty((experiment.rows, 1 + len(compiled.source.columns)))
        results = compiled.program.run(values, experiment, rows)
        if results is None:
            return Outcome(point.number, {}, REFUSED)
        numbers = results.tolist()
        indices = compiled.indices(numbers)
        outcome = Outcome(point.number, indices, None, programs.cautions(compiled, point, numbers))
        if rows is None:
            return outcome
        return with_functions(
            outcome, self.functions, programs.result(compiled, point, experiment, rows)
        )

    def table(self, point: Point) -> Result:
        """Make a run and return its rows.

        Raises:
            InputError: a component has refused.

        """
        programs = self._programs[point.scenario]
        compiled = programs.compiled(point.order, point.step)
        point, experiment = programs.plain(point), _experiment(point)
        rows = np.empty((experiment.rows, 1 + len(compiled.source.columns)))
        try:
            values = programs.values(compiled, point.parameters)
        except Refusal as refusal:
            raise InputError(str(refusal)) from None
        if compiled.program.run(values, experiment, rows) is None:
            raise InputError(f"{point.scenario}: a component has refused")
        return programs.result(compiled, point, experiment, rows)


_experiments: Callable[..., Experiment] = lru_cache(Experiment)


def _experiment(point: Point) -> Experiment:
    return _experiments(point.stop_time, point.step, point.order, point.start_time)
