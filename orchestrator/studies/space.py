"""The runs of a study: which values each of them has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from math import ceil, floor, log2, prod
from typing import Any

import numpy as np

from orchestrator.errors import InputError, reason
from orchestrator.experiments.preparation import Request, prepare
from orchestrator.experiments.scenario import Scenario
from orchestrator.studies.engine import Run
from orchestrator.studies.study import LOG, METHODS, STEP, Range, Sample, StopTime, Study
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.system.values import Value, type_of, typed

#: More runs than this are taken for a mistake.
MOST_RUNS = 1_000_000_000

#: Types of values by those of FMI's variables.
_KINDS = {"Real": float, "Integer": int, "Enumeration": int, "Boolean": bool, "String": str}


class Space:
    """The runs of a study by their numbers.

    A run is a combination of `vary`, whose last value changes fastest, one of the samples, and
    one of the scenarios. Its number says which, and so fixes all its values.

    Attributes:
        columns: the types of what varies, by name.
        has_scenarios: whether there are several.

    """

    def __init__(self, study: Study, systems: Mapping[str, tuple[Scenario, System]]) -> None:
        """Check a study against the systems that it runs, and type its values.

        Args:
            study: whose runs they are.
            systems: of its scenarios, by the names that it has for them.

        Raises:
            InputError: a value does not exist, or cannot be what it shall be.

        """
        self._study, self._scenarios = study, tuple(study.scenario)
        self._systems = {name: system for name, (_, system) in systems.items()}
        for name in study.parameters:
            self._owner(name)
        self.has_scenarios = len(study.scenario) > 1
        self.columns = {name: self._kind(name) for name in study.varied}
        self._grid = {
            name: tuple(self._typed(name, value) for value in values)
            for name, values in study.vary.items()
        }
        self._ranges = dict(study.sample.ranges) if study.sample else {}
        for name in self._ranges:
            self._check_range(name)
        self._shape = tuple(map(len, self._grid.values()))
        n = prod(self._shape) * (study.sample.n if study.sample else 1) * len(self._scenarios)
        if n > MOST_RUNS:
            raise InputError(f"{study.name}: {n:,} runs are more than {MOST_RUNS:,}")
        self._n = n
        self._experiments, self._constants = {}, {}
        for name, (scenario, system) in systems.items():
            constants = self._of(name, study.parameters)
            request = Request(
                self._shortest(study.stop_time), study.step, study.order,
                {port_name(target): value for target, value in constants.items()},
            )  # fmt: skip
            prepared = prepare(scenario, system, request)
            self._experiments[name] = prepared.experiment
            self._constants[name] = {
                target: prepared.system.parameters[port_name(target)] for target in constants
            }
            for step in self._ends(STEP) if STEP in study.varied else ():
                replace(prepared.experiment, step=step)
        self._points = drawn(study.sample) if study.sample else np.empty((1, 0))

    def __len__(self) -> int:
        """How many runs there are."""
        return self._n

    def __getitem__(self, number: int) -> Run:
        """One of the runs."""
        if not 0 <= number < self._n:
            raise IndexError(number)
        scenario, point = self.point(number)
        experiment = self._experiments[scenario]
        stop_time = self._study.stop_time
        return Run(
            number,
            scenario,
            {**self._constants[scenario], **self._of(scenario, point)},
            stop_time.of(point) if stop_time else experiment.stop_time,
            point.get(STEP, experiment.step),
            experiment.order,
        )

    def point(self, number: int) -> tuple[str, dict[str, Any]]:
        """The scenario of a run, and what varies, by name."""
        place, scenario = divmod(number, len(self._scenarios))
        combination, sample = divmod(place, len(self._points))
        point: dict[str, Any] = {}
        indices = np.unravel_index(combination, self._shape) if self._shape else ()
        for (name, values), i in zip(self._grid.items(), indices, strict=True):
            point[name] = values[i]
        for (name, limits), u in zip(
            self._ranges.items(), self._points[sample].tolist(), strict=True
        ):
            point[name] = between(limits, u, self.columns[name] is int)
        return self._scenarios[scenario], point

    @property
    def digest(self) -> str:
        """Of all values: other runs have another one."""
        content = repr((self._scenarios, self._grid, self._ranges)).encode()
        return sha256(content + self._points.tobytes()).hexdigest()

    def _of(self, scenario: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Those of some values that a scenario has."""
        system = self._systems[scenario]
        return {
            name: value
            for name, value in values.items()
            if name != STEP and system.has(port_name(name))
        }

    def _owner(self, name: str) -> tuple[PortName, System]:
        """A system that has a parameter.

        Raises:
            InputError: there is none.

        """
        target = port_name(name)
        for system in self._systems.values():
            if system.has(target):
                return target, system
        # Says what it has instead.
        system.component(target.component).variable(target.port)
        raise AssertionError

    def _kind(self, name: str) -> type[Value]:
        if name == STEP:
            return float
        target, system = self._owner(name)
        return _KINDS[type_of(system.component(target.component).variable(target.port))]

    def _typed(self, name: str, value: Any) -> Value:
        if name == STEP:
            return float(value)
        target, system = self._owner(name)
        return typed(name, system.component(target.component).variable(target.port), value)

    def _check_range(self, name: str) -> None:
        if self.columns[name] not in (float, int):
            raise InputError(f"{name}: only numbers can be sampled; put it under [vary]")
        for end in self._ranges[name][:2]:
            self._typed(name, end)

    def _ends(self, name: str) -> tuple[float, float]:
        values = tuple(map(float, self._grid.get(name) or self._ranges[name][:2]))
        return min(values), max(values)

    def _shortest(self, stop_time: StopTime | None) -> float | None:
        """The end of the shortest run that there may be."""
        if stop_time is None:
            return None
        return stop_time.base + sum(
            min(rate * end for end in self._ends(name)) for name, rate in stop_time.per.items()
        )


def between(limits: Range, u: float, whole: bool) -> float | int:
    """The value at a share of a range; of whole numbers each has the same chance."""
    low, high, spacing = limits
    if whole:
        low, high = min(low, high), max(low, high) + 1
    value = low * (high / low) ** u if spacing == LOG else low + (high - low) * u
    return min(floor(value), int(high) - 1) if whole else value


def drawn(sample: Sample) -> np.ndarray:
    """Shares of the ranges, (samples, values); a sample is what seed and method make it.

    Raises:
        InputError: the method cannot draw that many.

    """
    n, width = sample.n, len(sample.ranges)
    if sample.method == "random":
        return np.random.default_rng(sample.seed).random((n, width))
    from scipy.stats import qmc  # noqa: PLC0415

    generator = np.random.default_rng(sample.seed)
    try:
        if sample.method == METHODS[0]:
            # As many as it is made for, of which the first are taken.
            points: np.ndarray = qmc.Sobol(width, rng=generator).random_base2(ceil(log2(n)))[:n]
        else:
            points = qmc.LatinHypercube(width, rng=generator).random(n)
    except ValueError as error:
        raise InputError(f"method {sample.method!r}: {reason(error)}") from error
    return points
