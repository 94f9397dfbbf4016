"""The runs of a study: the values of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from itertools import chain, product
from math import cos, pi, prod, sin
from typing import Any

import numpy as np

from orchestrator.cosim import PortName, System, Value, Variable
from orchestrator.machine.errors import Findings, InputError, reason, shortened
from orchestrator.machine.texts import is_finite, literal
from orchestrator.runs.preparation import Prepared, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.columns import Case, Point, Points
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

#: Types of values by the types of FMI variables, and types of columns.
_TYPES = {"Real": float, "Integer": int, "Enumeration": str, "Boolean": bool, "String": str}
_ARRAYS: Mapping[type, Any] = {float: np.float64, int: np.int64, bool: np.bool_, str: np.object_}

#: Number of samples that are drawn at once: a power of two, which Sobol's sequence needs.
_PAGE = 1 << 14


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
        self._samples = study.sample.n if study.sample else 1
        self._n = prod(map(len, study.vary.values())) * self._samples * len(self._scenarios)
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
        self._shares = _Shares(study.sample) if study.sample else None
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
        _, first = self._chosen(np.zeros(1, dtype=np.int64))
        chosen = {name: column.tolist()[0] for name, column in first.items()}
        shortest = study.stop_time and study.stop_time.base + sum(
            min(rate * end for end in self._ends(varied))
            for varied, rate in study.stop_time.per.items()
        )
        request = Request(
            parameters=self._of(name, {**self._constants, **chosen}),
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

    @cached_property
    def _cases(self) -> Sequence[Case]:
        """The common properties of the runs of each scenario."""
        return [
            Case(
                name,
                self._of(name, self._constants),
                tuple(self._of(name, self.columns)),
                self.prepared[name].experiment.order,
                self.prepared[name].experiment.start_time,
            )
            for name in self._scenarios
        ]

    def _of(self, scenario: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values whose names are parameters of a scenario."""
        has = self._has[scenario]
        return {name: value for name, value in values.items() if name in has}

    def __len__(self) -> int:
        """Return the number of runs."""
        return self._n

    def __getitem__(self, number: int) -> Point:
        """Return a run."""
        if not 0 <= number < self._n:
            raise IndexError(number)
        [point] = self.points(np.array([number]))
        return point

    def points(self, numbers: np.ndarray) -> Points:
        """Return some runs."""
        case, values = self._chosen(numbers)
        every = [self.prepared[name].experiment for name in self._scenarios]
        if self._stop_time:
            stop_time = self._stop_time.at(values, len(numbers))
        else:
            stop_time = np.array([experiment.stop_time for experiment in every])[case]
        step = values.get(STEP)
        if step is None:
            step = np.array([experiment.step for experiment in every])[case]
        return Points(numbers, self._cases, case, values, stop_time, step)

    def _chosen(self, numbers: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the places of the scenarios of runs, and the values that vary, by name."""
        place, case = np.divmod(numbers, len(self._scenarios))
        combination, sample = np.divmod(place, self._samples)
        chosen: dict[str, np.ndarray] = {}
        for name, values in reversed(self._grid.items()):
            combination, i = np.divmod(combination, len(values))
            chosen[name] = np.array(values, dtype=_ARRAYS[self.columns[name]])[i]
        shares = iter(() if self._shares is None else self._shares.of(sample).T)
        for key, limits in self._ranges.items():
            size = between(limits, next(shares), self.columns[norm_members(key)[0]] is int)
            chosen |= zip(norm_members(key), _direct(key, size, shares), strict=True)
        return case, chosen

    @property
    def digest(self) -> str:
        """Hash of the values that vary: grids, ranges and the first samples."""
        shares = b"" if self._shares is None else self._shares.of(np.arange(1)).tobytes()
        content = repr((self._grid, self._ranges, self._samples)).encode() + shares
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


# Powers, sines and cosines are Python's, since the last bits of numpy's may differ.


def between(limits: Range, shares: np.ndarray, whole: bool) -> np.ndarray:
    """Return the values at shares of a range; whole numbers have equal shares."""
    low, high, spacing = limits
    if whole:
        low, high = min(low, high), max(low, high) + 1
    if spacing == LOG_SPACING:
        ratio = high / low
        values = float(low) * np.array([ratio**share for share in shares.tolist()])
    else:
        values = float(low) + float(high - low) * shares
    return np.minimum(np.floor(values).astype(np.int64), int(high) - 1) if whole else values


def _direct(key: str, size: np.ndarray, shares: Iterator[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return the members of a norm, with directions from the next shares, evenly distributed."""
    if (n := len(norm_members(key))) == 1:
        return (size,)
    angles = (2.0 * pi * next(shares)).tolist()
    z = 2.0 * next(shares) - 1.0 if n == 3 else np.zeros(len(size))
    across = size * np.sqrt(1.0 - z * z)
    cosines, sines = (np.array([*map(function, angles)]) for function in (cos, sin))
    return (across * cosines, across * sines, size * z)[:n]


class _Shares:
    """Shares of the ranges, which follow from the seed and the method of a sample.

    They are drawn page by page, in any order, but soonest in their own.
    """

    def __init__(self, sample: Sample) -> None:
        """Begin.

        Raises:
            InputError: the method cannot draw so many.

        """
        from scipy.stats import qmc  # noqa: PLC0415

        self._sample, self._width = sample, len(sample.names)
        self._recent: dict[int, np.ndarray] = {}
        generator = np.random.default_rng(sample.seed)
        try:
            if sample.method == SOBOL:
                self._sobol = qmc.Sobol(self._width, rng=generator)
            elif sample.method == LATIN_HYPERCUBE:
                # At once, since each sample depends on all others.
                self._every = qmc.LatinHypercube(self._width, rng=generator).random(sample.n)
        except ValueError as error:
            raise InputError(f"sample: {reason(error)}") from error

    def of(self, samples: np.ndarray) -> np.ndarray:
        """Return the shares of some samples, (samples, values)."""
        if self._sample.method == LATIN_HYPERCUBE:
            every: np.ndarray = self._every[samples]
            return every
        shares = np.empty((len(samples), self._width))
        pages = samples // _PAGE
        for number in np.unique(pages).tolist():
            rows = np.flatnonzero(pages == number)
            shares[rows] = self._page(number)[samples[rows] % _PAGE]
        return shares

    def _page(self, number: int) -> np.ndarray:
        """Return a page; the last two are kept."""
        if number not in self._recent:
            self._recent = dict([*self._recent.items()][-1:])
            self._recent[number] = self._drawn(number * _PAGE)
        return self._recent[number]

    def _drawn(self, first: int) -> np.ndarray:
        """Draw a page."""
        if self._sample.method == SOBOL:
            if first < self._sobol.num_generated:
                self._sobol.reset()
            if ahead := first - self._sobol.num_generated:
                self._sobol.fast_forward(ahead)
            page: np.ndarray = self._sobol.random(_PAGE)
            return page
        generator = np.random.default_rng(self._sample.seed)
        # PCG64, which draws a double from each of its numbers.
        generator.bit_generator.advance(first * self._width)  # type: ignore[attr-defined]
        return generator.random((_PAGE, self._width))
