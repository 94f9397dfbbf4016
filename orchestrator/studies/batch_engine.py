"""The engine that makes runs by compiled programs, with the numbers of the FMUs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import chain
from math import ceil
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
from orchestrator.program.library import (
    PROCESSOR,
    Grids,
    Program,
    Runner,
    Runners,
    Source,
)
from orchestrator.program.writer import Text, indices_of
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.request import PROGRAM
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.columns import Case, Outcome, Outcomes, Point, Points, Rows, Texts
from orchestrator.studies.engine import listed_kinds, with_functions
from orchestrator.studies.own_functions import OwnFunction
from orchestrator.studies.own_indices import OwnIndex
from orchestrator.vehicle.cautions import (
    OBSERVER,
    RULES,
    WATCHED,
    cautions,
    values_of,
)
from orchestrator.vehicle.indices import INDICES, SMALLEST_DISTANCE, prefixed
from orchestrator.vehicle.signals import loops_of

#: Advice for systems that this engine cannot run.
ADVICE = "use --engine fmu"

#: Failure of a run that the program has refused; it is repeated with FMUs, which give a reason.
REFUSED = "refused"

#: Number of parts in which a block is made, so that it can be stopped between them.
_PARTS = 16

#: Types of columns by the types of ports whose values are only checked for their range.
_NUMBERS = {"Real": "f", "Integer": "i"}

#: Key of the programs of a system: the order, and the decimations of the components.
_Key = tuple[Order | None, tuple[int, ...]]


@dataclass(frozen=True)
class _Compiled:
    """The program of a system, and the places of indices in its results.

    Attributes:
        source: of the program.
        runners: make its runs.
        places: of the columns of indices.
        watched: kinds of cautions, and the places and limits of the values that they depend on.

    """

    source: Source
    runners: Runners
    places: Mapping[str, int]
    watched: Sequence[tuple[str, int, float]]

    @cached_property
    def program(self) -> Runner:
        """The program, compiled."""
        return self.runners(self.source)

    @property
    def on_processor(self) -> Program:
        """The program, which makes runs with rows."""
        program = self.program
        assert isinstance(program, Program)
        return program

    def __getstate__(self) -> Mapping[str, Any]:
        """Return the state without the loaded library; each process loads it."""
        state = {name: value for name, value in self.__dict__.items() if name != "program"}
        return {**state, "source": self.runners.portable(self.source)}


class _Parameter(NamedTuple):
    """A parameter of a program: its place, its port, and the numbers of items of Enumerations."""

    place: int
    port: Port
    items: Mapping[str, int]

    def number(self, value: Any) -> float:
        """Return a value as a number.

        Raises:
            Refusal: the component would refuse it.

        """
        given: Any = self.items.get(value, value) if isinstance(value, str) else value
        return float(self.port.checked(given))

    def column(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return values as numbers, and a mask of those that the component would refuse."""
        numbers, refused = np.zeros(len(values)), np.zeros(len(values), dtype=bool)
        others = ~refused
        if values.dtype.kind == _NUMBERS.get(self.port.type) and not self.port.choices:
            numbers = values.astype(float)
            low, high = self.port.minimum, self.port.maximum
            others = ~np.isfinite(numbers)
            others |= False if low is None else ~(numbers >= low)
            others |= False if high is None else ~(numbers <= high)
            others |= self.port.type == "Integer" and values != values.astype(np.int32)
        distinct, codes = np.unique(values[others], return_inverse=True)
        found = np.zeros(len(distinct))
        for place, value in enumerate(distinct.tolist()):
            try:
                found[place] = self.number(value)
            except Refusal:
                found[place] = np.nan
        numbers[others] = found[codes]
        refused[others] = np.isnan(found)[codes]
        return numbers, refused


@dataclass(frozen=True)
class _Column:
    """The column of a value that varies, in place of a value."""

    name: str


class _Programs:
    """The programs of a system.

    Attributes:
        system: with its own values.
        loops: of its vehicles.

    """

    def __init__(self, system: System, own: Sequence[OwnIndex], runners: Runners) -> None:
        self.system, self.loops = system, loops_of(system)
        self._own, self._runners = own, runners
        self._by_key: dict[_Key, _Compiled] = {}
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
        key = order, tuple(self.system.decimations(step).values())
        if key not in self._by_key:
            self._by_key[key] = self._compiled(order, step)
        return self._by_key[key]

    def _compiled(self, order: Order | None, step: float) -> _Compiled:
        system = self.system
        if self._definitions is None:
            self._definitions = definitions_of(system)
        indices = [*INDICES, *chain.from_iterable(file.indices for file in self._own)]
        reducers = [*dict.fromkeys(index.reducer for index in indices), *WATCHED]
        plan = make_plan(system, Experiment(step * 2.0**20, step, order))
        looking = [[*indices_of(system, loop, reducers)] for loop in self.loops]
        text = Text(plan, self._definitions, [*chain(*looking)], self.loops, is_quick=True)
        columns: dict[str, int] = {}
        watched, first = [], 0
        for (_, prefix), looks in zip(prefixed(self.loops), looking, strict=True):
            places: dict[str, int] = {}
            for look in looks:
                for name, ports in look.reducer.results.items():
                    places[name] = first
                    first += len(ports)
            columns |= {
                f"{prefix}{name}": places[index.name] + i
                for index in indices
                if index.name in places
                for i, name in enumerate(index.columns)
            }
            watched += [
                (rule.kind, places[rule.number], rule.above)
                for rule in RULES
                if rule.number in places
            ]
        if text.positions:
            columns[SMALLEST_DISTANCE] = first
        return _Compiled(Source.of(text), self._runners, columns, watched)

    def plain(self, parameters: Mapping[str, Value]) -> Mapping[str, Value]:
        """Return parameters as single ones: without wildcards and groups."""
        if self._names.issuperset(parameters):
            return parameters
        expanded: Mapping[PortName, Any] = self.system.expanded(parameters)
        return {str(self.system.named(name)): value for name, value in expanded.items()}

    def split(self, case: Case) -> tuple[Mapping[str, Value], Mapping[str, str]]:
        """Return the single parameters of runs that do not vary, and the columns of the others."""
        varied: dict[str, Any] = {name: _Column(name) for name in case.varied}
        every = self.plain({**case.parameters, **varied})
        columns = {name: of.name for name, of in every.items() if isinstance(of, _Column)}
        return {name: value for name, value in every.items() if name not in columns}, columns

    def values(
        self, compiled: _Compiled, case: Case, points: Points
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of all parameters, (runs, parameters), and a mask of refused runs.

        Raises:
            Refusal: a component would refuse a value that all runs have.

        """
        if self._parameters is None:
            # In one assignment, since other threads make runs.
            self._parameters = self._defaults(compiled)
        parameters, defaults = self._parameters
        values, refused = np.tile(defaults, (len(points), 1)), np.zeros(len(points), dtype=bool)
        given, columns = self.split(case)
        for name, value in given.items():
            values[:, parameters[name].place] = parameters[name].number(value)
        for name, column in columns.items():
            place = parameters[name].place
            values[:, place], others = parameters[name].column(points.values[column])
            refused |= others
        return values, refused

    def _defaults(self, compiled: _Compiled) -> tuple[Mapping[str, _Parameter], np.ndarray]:
        """Return all parameters of a program by name, and their values in the system."""
        names = compiled.source.parameters
        parameters = {name: self._parameter(place, name) for place, name in enumerate(names)}
        values = [
            parameter.number(self.system.value(PortName.read(name)))
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
        system = self.system.with_parameters(self.plain(point.parameters))
        plan = make_plan(system, experiment)
        columns = [system.named(PortName.read(name)) for name in compiled.source.columns]
        # The order of systems of the language where none is stated.
        ordered = replace(experiment, order=experiment.order or "feedthrough")
        header = Header.of(system, ordered, columns, PROGRAM)
        scenario = Scenario(point.scenario)
        result = Result(scenario, self.loops, Prepared(scenario, plan))
        result.hold(header, rows, Ending())
        return result

    def outcomes(
        self,
        compiled: _Compiled,
        case: Case,
        points: Points,
        results: np.ndarray,
        refused: np.ndarray,
    ) -> Outcomes:
        """Return the outcomes of runs of a program."""
        return Outcomes(
            points.numbers,
            tuple(compiled.places),
            results[:, [*compiled.places.values()]],
            Texts.where(refused, REFUSED),
            self._cautions(compiled, case, points, results, refused),
        )

    def _cautions(
        self,
        compiled: _Compiled,
        case: Case,
        points: Points,
        results: np.ndarray,
        refused: np.ndarray,
    ) -> Texts:
        """Return the kinds of cautions of runs, from their parameters and results."""
        kinds, codes = self._before(case, points)
        for kind, place, above in compiled.watched:
            marks = results[:, place] > above
            if marks.any():
                distinct, codes = np.unique(2 * codes + marks, return_inverse=True)
                kinds = [(*kinds[code // 2], *[kind] * (code % 2)) for code in distinct.tolist()]
        texts = Texts.of([*map(listed_kinds, kinds)])
        return texts._replace(codes=np.where(refused, 0, texts.codes[codes]))

    def _before(self, case: Case, points: Points) -> tuple[list[tuple[str, ...]], np.ndarray]:
        """Return kinds of cautions that are known before runs, and their places for each run."""
        watched = {f"{loop.controller}.{name}" for loop in self.loops for name in OBSERVER}
        given, every = self.split(case)
        varied = {name: points.values[column] for name, column in every.items() if name in watched}
        columns = [column.tolist() for column in varied.values()]
        places = dict[tuple[Any, ...], int]()
        codes = [
            places.setdefault(key, len(places))
            for key in zip(points.step.tolist(), *columns, strict=True)
        ]
        found = list[tuple[str, ...]]()
        for step, *chosen in places:
            values = {**given, **dict(zip(varied, chosen, strict=True))}
            known = cautions(partial(self.value, values), step, self.loops)
            found.append(tuple(caution.kind for caution in known))
        distinct = {kinds: code for code, kinds in enumerate(dict.fromkeys(found))}
        return [*distinct], np.array([distinct[kinds] for kinds in found])[codes]

    def value(self, parameters: Mapping[str, Value], name: str) -> Value | None:
        """Return the value of a parameter in a run; None if there is no such parameter."""
        value: Value | None
        value = parameters[name] if name in parameters else self._values(name)
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


class BatchEngine:
    """Makes runs by compiled programs."""

    def __init__(
        self,
        systems: Mapping[str, System],
        own: Sequence[OwnIndex] = (),
        functions: Sequence[OwnFunction] = (),
        runners: Runners = PROCESSOR,
    ) -> None:
        """Make an engine.

        Args:
            systems: by the names of scenarios in runs.
            own: the user's own indices.
            functions: those that are functions.
            runners: what makes the runs of a program.

        Raises:
            InputError: a system cannot become a program.

        """
        self.functions = functions
        self.runners = runners
        self.least_runs, self.most_runs = runners.least_runs, runners.most_runs
        self._programs = dict[str, _Programs]()
        for name, system in systems.items():
            system.check()
            try:
                self._programs[name] = _Programs(system, own, runners)
            except InputError as error:
                raise InputError(f"{name}: {error}; {ADVICE}") from None

    @property
    def digest(self) -> str:
        """Hash of the code that makes programs and indices."""
        return code_of("auv_fmu", "fmus", "orchestrator.program", "orchestrator.vehicle")

    def prepare(self, point: Point, is_here: bool = True) -> None:
        """Translate the program of a run, and compile it if runs are made here.

        Raises:
            InputError: its system cannot become a program; the message has the reason.

        """
        try:
            compiled = self._programs[point.scenario].compiled(point.order, point.step)
            if is_here:
                compiled.program  # noqa: B018
        except InputError as error:
            raise InputError(f"{point.scenario}: {error}; {ADVICE}") from None

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        """Make runs, some at a time."""
        n = min(max(ceil(len(points) / _PARTS), self.least_runs), self.most_runs)
        for first in range(0, len(points), n):
            part = points[first : first + n]
            groups = [*self._groups(part)]
            made = Outcomes.joined([self._outcomes(*group, part[rows]) for group, rows in groups])
            order = np.argsort(np.concatenate([rows for _, rows in groups]))
            yield made if len(groups) == 1 else made[order]

    def value(self, point: Point, name: str) -> Value | None:
        """Return the value of a parameter in a run; None if there is no such parameter."""
        programs = self._programs[point.scenario]
        return programs.value(programs.plain(point.parameters), name)

    def _groups(
        self, points: Points
    ) -> Iterator[tuple[tuple[_Programs, _Compiled, Case], np.ndarray]]:
        """Yield cases with their programs, and the places of their runs."""
        for place in dict.fromkeys(points.case.tolist()):
            case, rows = points.cases[place], np.flatnonzero(points.case == place)
            programs = self._programs[case.scenario]
            steps, codes = np.unique(points.step[rows], return_inverse=True)
            made = [programs.compiled(case.order, step) for step in steps.tolist()]
            for compiled in {id(each): each for each in made}.values():
                is_own = np.array([each is compiled for each in made])
                yield (programs, compiled, case), rows[is_own[codes]]

    def _outcomes(
        self, programs: _Programs, compiled: _Compiled, case: Case, points: Points
    ) -> Outcomes:
        """Make runs of the same case and program."""
        try:
            values, refused = programs.values(compiled, case, points)
        except Refusal:
            return _refused(points)
        if self.functions:
            return Outcomes.joined(
                [
                    _refused(points[i : i + 1])
                    if refused[i]
                    else self._by_rows(programs, compiled, case, points[i : i + 1], values[i])
                    for i in range(len(points))
                ]
            )
        results = np.full((len(points), compiled.source.n_indices), np.nan)
        if not refused.all():
            rows: Rows = ~refused if refused.any() else slice(None)
            grids = _grids(case, points[rows])
            results[rows], refused[rows] = compiled.program.runs(values[rows], grids)
        return programs.outcomes(compiled, case, points, results, refused)

    def _by_rows(
        self,
        programs: _Programs,
        compiled: _Compiled,
        case: Case,
        points: Points,
        values: np.ndarray,
    ) -> Outcomes:
        """Make a run with its rows."""
        [point] = points
        experiment, rows = _with_rows(compiled, point)
        results = compiled.on_processor.run(values, experiment, rows)
        if results is None:
            return _refused(points)
        made = programs.outcomes(compiled, case, points, results[np.newaxis], np.zeros(1, bool))
        [outcome] = made
        result = programs.result(compiled, point, experiment, rows)
        return Outcomes.of([with_functions(outcome, self.functions, result)])

    def table(self, point: Point) -> Result:
        """Make a run and return its rows.

        Raises:
            InputError: a component has refused.

        """
        programs = self._programs[point.scenario]
        compiled = programs.compiled(point.order, point.step)
        experiment, rows = _with_rows(compiled, point)
        points = Points.of([point])
        try:
            [values], _ = programs.values(compiled, points.cases[0], points)
        except Refusal as refusal:
            raise InputError(str(refusal)) from None
        if compiled.on_processor.run(values, experiment, rows) is None:
            raise InputError(f"{point.scenario}: a component has refused")
        return programs.result(compiled, point, experiment, rows)


def _refused(points: Points) -> Outcomes:
    """Return the outcomes of runs that a component has refused."""
    return Outcomes.of(Outcome(number, {}, REFUSED) for number in points.numbers.tolist())


def _with_rows(compiled: _Compiled, point: Point) -> tuple[Experiment, np.ndarray]:
    """Return the experiment of a run, and an array for its rows."""
    experiment = Experiment(point.stop_time, point.step, point.order, point.start_time)
    return experiment, np.empty((experiment.rows, 1 + len(compiled.source.columns)))


def _grids(case: Case, points: Points) -> Grids:
    """Return the times and steps of runs of a case; most of them are equal."""
    pairs = [*zip(points.stop_time.tolist(), points.step.tolist(), strict=True)]
    places = {pair: place for place, pair in enumerate(dict.fromkeys(pairs))}
    distinct = Grids.of(Experiment(*pair, case.order, case.start_time) for pair in places)
    return distinct.rows(np.array([places[pair] for pair in pairs]))
