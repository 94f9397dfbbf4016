"""The runs of a study: the values of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from itertools import chain, product
from math import ceil, cos, floor, log2, pi, prod, sin, sqrt
from typing import Any

import numpy as np

from orchestrator.cosim import PortName, System, Value, Variable
from orchestrator.machine.errors import Findings, InputError, reason, shortened
from orchestrator.machine.texts import is_finite, literal
from orchestrator.runs.preparation import Prepared, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.engine import Point
from orchestrator.studies.study import (
    LATIN_HYPERCUBE,
    LOG_SPACING,
    MOST_RUNS,
    SOBOL,
    STEP,
    Range,
    Sample,
    Study,
    norm_members,
)
from orchestrator.vehicle.indices import Index, index_columns, index_units
from orchestrator.vehicle.signals import loops_of

#: Types of values by the types of FMI variables.
_TYPES = {"Real": float, "Integer": int, "Enumeration": str, "Boolean": bool, "String": str}


class Space:
    """The runs of a study by their numbers.

    A run is a combination of `vary` (the last value changes fastest), a sample (next fastest) and a
    scenario (fastest of all). All its values follow from its number.

    Attributes:
        columns: types of the values that vary, by name.
        prepared: shortest run of each scenario, by the scenario's name.
        indices: columns of indices.
        has_scenarios: True if there are several.
        units: of values that vary, as the FMUs write them, and of the user's own indices; empty
            without a unit.
        logarithmic: True for values that are sampled by their logarithm.

    """

    def __init__(
        self,
        study: Study,
        systems: Mapping[str, tuple[Scenario, System]],
        own: Sequence[Index] = (),
    ) -> None:
        """Check a study with its systems, and convert its values to the types of FMI.

        Args:
            study: of the runs.
            systems: of its scenarios, by name.
            own: the user's own indices.

        Raises:
            InputError: a name does not exist, or a value has the wrong type.

        """
        findings = Findings()
        known = _Names([system for _, system in systems.values()])
        self._stop_time, self._scenarios = study.stop_time, tuple(study.scenario)
        self.has_scenarios = len(self._scenarios) > 1
        self.columns: dict[str, type[Value]] = {}
        for name in study.varied:
            with findings.collecting():
                self.columns[name] = known.value_type(name)
        self.units = {name: known.unit(name) for name in self.columns}
        self._grid: dict[str, tuple[Value, ...]] = {}
        for name, values in study.vary.items():
            with findings.collecting():
                typed = tuple(known.typed(name, value) for value in values)
                [(value, n)] = Counter(typed).most_common(1)
                if n > 1:
                    raise InputError(f"vary: {name}: {literal(value)} is stated twice")
                self._grid[name] = typed
        self._ranges = study.sample.ranges if study.sample else {}
        self.logarithmic = {
            name: limits.spacing == LOG_SPACING for name, limits in self._ranges.items()
        }
        self._limits = {
            name: limits[:2] if key == name else (-max(limits[:2]), max(limits[:2]))
            for key, limits in self._ranges.items()
            for name in norm_members(key)
        }
        for name, ends in self._limits.items():
            with findings.collecting():
                if self.columns.get(name, float) not in (float, int):
                    raise InputError(f"{name}: only numbers can be sampled; put it under [vary]")
                if self.columns.get(name) is int and name not in self._ranges:
                    raise InputError(f"{name}: an integer cannot be part of a norm")
                for end in ends:
                    known.typed(name, end)
        samples = study.sample.n if study.sample else 1
        self._n = prod(map(len, study.vary.values())) * samples * len(self._scenarios)
        if self._n > MOST_RUNS:
            findings.problem(f"{study.name}: {self._n:,} runs are more than {MOST_RUNS:,}")
        given: dict[str, Any] = {}
        with findings.collecting():
            given = known.expanded(study.parameters)
        self._constants: dict[str, Value] = {}
        for name, value in given.items():
            with findings.collecting():
                if name in self.columns:
                    raise InputError(f"{study.name}: {name} is stated twice")
                self._constants[name] = known.typed(name, value)
        findings.refuse()
        self._points = draw_shares(study.sample) if study.sample else np.empty((1, 0))
        names = {name for name in (*given, *study.varied) if name != STEP}
        self._has = {
            scenario: {name for name in names if system.has(PortName.read(name))}
            for scenario, (_, system) in systems.items()
        }
        self.prepared: dict[str, Prepared] = {}
        for name, system in systems.items():
            with findings.collecting():
                self.prepared[name] = self._prepared(name, study, *system)
        findings.refuse()
        every = [loops_of(system) for _, system in systems.values()]
        columns = (index_columns(loops, own) for loops in every)
        self.indices = tuple(dict.fromkeys(chain.from_iterable(columns)))
        for loops, index in product(every, own):
            self.units |= index_units(index, loops)

    def _prepared(self, name: str, study: Study, scenario: Scenario, system: System) -> Prepared:
        """Prepare the shortest run of a scenario."""
        _, chosen = self.chosen(0)
        shortest = study.stop_time and study.stop_time.base + sum(
            min(rate * end for end in self._ends(varied))
            for varied, rate in study.stop_time.per.items()
        )
        request = Request(
            parameters=self._parameters(name, chosen),
            stop_time=shortest,
            step=chosen.get(STEP, study.step),
            order=study.order,
        )
        prepared = prepare(scenario, system, request)
        for step in self._ends(STEP) if STEP in self.columns else ():
            prepared.experiment.check_step(step)
        return prepared

    def _ends(self, name: str) -> Sequence[float]:
        """Return the values of a grid, or the two ends of a range."""
        return [float(value) for value in self._grid.get(name) or self._limits[name]]

    def _parameters(self, scenario: str, chosen: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a run that its scenario has."""
        has = self._has[scenario]
        return {name: value for name, value in {**self._constants, **chosen}.items() if name in has}

    def __len__(self) -> int:
        """Return the number of runs."""
        return self._n

    def __getitem__(self, number: int) -> Point:
        """Return a run."""
        if not 0 <= number < self._n:
            raise IndexError(number)
        scenario, chosen = self.chosen(number)
        experiment = self.prepared[scenario].experiment
        return Point(
            number,
            scenario,
            self._parameters(scenario, chosen),
            self._stop_time.at(chosen) if self._stop_time else experiment.stop_time,
            chosen.get(STEP, experiment.step),
            experiment.order,
            experiment.start_time,
        )

    def chosen(self, number: int) -> tuple[str, dict[str, Any]]:
        """Return the scenario of a run, and the values that vary, by name."""
        place, scenario = divmod(number, len(self._scenarios))
        combination, sample = divmod(place, len(self._points))
        chosen: dict[str, Any] = {}
        for name, values in reversed(self._grid.items()):
            combination, i = divmod(combination, len(values))
            chosen[name] = values[i]
        shares = iter(self._points[sample].tolist())
        for key, limits in self._ranges.items():
            size = between(limits, next(shares), self.columns[norm_members(key)[0]] is int)
            chosen |= zip(norm_members(key), _direct(key, size, shares), strict=True)
        return self._scenarios[scenario], chosen

    @property
    def digest(self) -> str:
        """Hash of all values that vary."""
        content = repr((self._grid, self._ranges)).encode() + self._points.tobytes()
        return sha256(content).hexdigest()


class _Names:
    """Names that a study may use: the step, and all names of at least one of its systems."""

    def __init__(self, systems: Sequence[System]) -> None:
        self._systems = systems

    def value_type(self, name: str) -> type[Value]:
        """Return the type of a value."""
        return float if name == STEP else _TYPES[self._variable(name).family]

    def unit(self, name: str) -> str:
        """Return the unit of a value; empty without a unit, or if systems have different ones."""
        if name == STEP:
            return "s"
        target = PortName.read(name)
        units = {
            _variable(system, target).unit or "" for system in self._systems if system.has(target)
        }
        return units.pop() if len(units) == 1 else ""

    def typed(self, name: str, value: Any) -> Value:
        """Convert a value to its type; for an Enumeration, to the name of the item."""
        if name != STEP:
            variable = self._variable(name)
            shown: Value = variable.shown(variable.typed(value, name))
            return shown
        if not is_finite(value):
            raise InputError(f"{STEP} = {shortened(repr(value))}: not a number of seconds")
        return float(value)

    def expanded(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by single ports, expanded by the first system that has the port."""
        stated = {PortName.read(name): value for name, value in values.items()}
        ports: dict[str, Any] = {}
        unknown = dict.fromkeys(map(str, stated))
        for system in reversed(self._systems):
            expanded = system.expanded(stated)
            ports |= {str(port): value for port, value in expanded.items() if system.has(port)}
            absent = {str(port) for port in expanded if not system.has(port)}
            unknown = {name: None for name in unknown if name in absent}
        return {**{name: values[name] for name in unknown}, **ports}

    def _variable(self, name: str) -> Variable:
        target = PortName.read(name)
        having = (system for system in self._systems if system.has(target))
        return _variable(next(having, self._systems[-1]), target)


def _variable(system: System, name: PortName) -> Variable:
    return system.variable(system.named(name))


def between(limits: Range, share: float, whole: bool) -> float | int:
    """Return the value at a share of a range; whole numbers have equal shares."""
    low, high, spacing = limits
    if whole:
        low, high = min(low, high), max(low, high) + 1
    value = low * (high / low) ** share if spacing == LOG_SPACING else low + (high - low) * share
    return min(floor(value), int(high) - 1) if whole else value


def _direct(key: str, size: float, shares: Iterator[float]) -> tuple[float, ...]:
    """Return the members of a norm, with a direction from the next shares, evenly distributed."""
    if (n := len(norm_members(key))) == 1:
        return (size,)
    angle = 2.0 * pi * next(shares)
    z = 2.0 * next(shares) - 1.0 if n == 3 else 0.0
    across = size * sqrt(1.0 - z * z)
    return (across * cos(angle), across * sin(angle), size * z)[:n]


def draw_shares(sample: Sample) -> np.ndarray:
    """Return shares of the ranges, (samples, values), which follow from the seed and the method.

    Raises:
        InputError: the method cannot draw so many.

    """
    from scipy.stats import qmc  # noqa: PLC0415

    n, width = sample.n, len(sample.names)
    generator = np.random.default_rng(sample.seed)
    try:
        if sample.method == SOBOL:
            # The first of a power of two, for which the sequence is made.
            points: np.ndarray = qmc.Sobol(width, rng=generator).random_base2(ceil(log2(n)))[:n]
        elif sample.method == LATIN_HYPERCUBE:
            points = qmc.LatinHypercube(width, rng=generator).random(n)
        else:
            points = generator.random((n, width))
    except ValueError as error:
        raise InputError(f"sample: {reason(error)}") from error
    return points
