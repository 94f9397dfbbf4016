"""Derivatives that an FMU gives, beside differences of its own outputs."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_double
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

#: Steps of a run before its derivatives are taken, and their size [s].
STEPS, H = 20, 0.02

#: Largest error of a derivative, relative to one or its own size, where differences are smooth.
TOLERANCE = 1e-9

#: Types of floats in both versions of FMI.
_FLOATS = ("Real", "Float64")

Variable = Any


class Differentiated:
    """An instance in fmpy, at random values."""

    def __init__(self, path: Path, folder: Path, exchange: bool = False) -> None:
        """Unpack and instantiate an FMU of FMI 2.0 or 3.0, perhaps for model exchange."""
        description = fmpy.read_model_description(str(path))
        self.is_fmi3 = description.fmiVersion.startswith("3")
        self.variables = {variable.name: variable for variable in description.modelVariables}
        own = {
            "unzipDirectory": fmpy.extract(str(path), unzipdir=str(folder)),
            "guid": description.guid,
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "instanceName": path.stem,
        }
        of_fmi2, of_fmi3 = (FMU2Model, FMU3Model) if exchange else (FMU2Slave, FMU3Slave)
        self.fmu: Any = of_fmi3(**own) if self.is_fmi3 else of_fmi2(**own)
        self.fmu.instantiate()
        rated = [(v.derivative, v) for v in description.modelVariables if v.derivative]
        self.states, self.rates = ([pair[k] for pair in rated] for k in (0, 1))

    def having(self, *causalities: str, tunable: bool = False) -> list[Variable]:
        """Its floats of some causalities; parameters only if they may change in a run."""
        return [
            variable
            for variable in self.variables.values()
            if variable.causality in causalities
            and variable.type in _FLOATS
            and variable.name != "h_max"
            and (not tunable or variable.variability != "fixed")
        ]

    @property
    def unknowns(self) -> list[Variable]:
        """Its outputs, states and rates."""
        return [*self.having("output"), *self.states, *self.rates]

    def get(self, variables: Sequence[Variable]) -> np.ndarray:
        """The values of variables."""
        read = self.fmu.getFloat64 if self.is_fmi3 else self.fmu.getReal
        return np.array(read([variable.valueReference for variable in variables]))

    def set(self, variable: Variable, value: float) -> None:
        """Set a variable, or a continuous state."""
        if variable in self.states:
            values = self.get(self.states)
            values[self.states.index(variable)] = value
            self.fmu.setContinuousStates((c_double * len(values))(*values), len(values))
            return
        write = self.fmu.setFloat64 if self.is_fmi3 else self.fmu.setReal
        write([variable.valueReference], [value])

    def begin(self) -> None:
        """Enter initialisation."""
        if not self.is_fmi3:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def shake(self, rng: random.Random, size: float) -> None:
        """Change all inputs by random numbers, within their limits."""
        for variable in self.having("input"):
            low, high = limits(variable)
            value = self.get([variable])[0] + rng.uniform(-size, size)
            self.set(variable, float(np.clip(value, low, high)))

    def jacobian(self, knowns: Sequence[Variable], adjoint: bool = False) -> np.ndarray:
        """Derivatives of all outputs by some variables, as the FMU gives them."""
        outputs = [variable.valueReference for variable in self.unknowns]
        inputs = [variable.valueReference for variable in knowns]
        if adjoint:
            give = self.fmu.getAdjointDerivative
            rows = [give([output], inputs, [1.0], len(inputs)) for output in outputs]
            return np.array(rows)
        columns = [self._column(outputs, known) for known in inputs]
        return np.array(columns).reshape(len(inputs), len(outputs)).T

    def _column(self, outputs: list[int], known: int) -> list[float]:
        return list(self.fmu.getDirectionalDerivative(outputs, [known], [1.0]))

    def differences(self, knowns: Sequence[Variable]) -> tuple[np.ndarray, np.ndarray]:
        """The same by central differences of fourth order, and their own errors."""
        outputs = self.unknowns
        found = np.full((2, len(outputs), len(knowns)), np.nan)
        for i, variable in enumerate(knowns):
            held = self.get([variable])[0]
            low, high = limits(variable)
            h = 1e-3 * max(1.0, abs(held))
            if held - h < low or held + h > high:
                continue
            try:
                halves = [self._difference(variable, held, h / 2**k, outputs) for k in range(3)]
            except FMICallException:
                continue  # a value that is refused
            finally:
                self.set(variable, held)
            finer = [(4.0 * b - a) / 3.0 for a, b in pairwise(halves)]
            found[0, :, i], found[1, :, i] = finer[1], np.abs(finer[1] - finer[0])
        return found[0], found[1]

    def _difference(
        self, variable: Variable, held: float, h: float, outputs: Sequence[Variable]
    ) -> np.ndarray:
        self.set(variable, held + h)
        above = self.get(outputs)
        self.set(variable, held - h)
        return (above - self.get(outputs)) / (2.0 * h)


def limits(variable: Variable) -> tuple[float, float]:
    """Least and largest value of a variable."""
    low, high = variable.min, variable.max
    return float(low if low is not None else -np.inf), float(high if high is not None else np.inf)


def errors_of(it: Differentiated, knowns: Sequence[Variable]) -> np.ndarray:
    """Errors of derivatives where differences are smooth; others are NaN."""
    found, (other, rough) = it.jacobian(knowns), it.differences(knowns)
    scale = 1.0 + np.abs(other)
    error = np.abs(found - other) / scale
    error[~(rough / scale < TOLERANCE / 2.0)] = np.nan
    return error


def in_steps(path: Path, folder: Path, seed: int) -> Iterator[np.ndarray]:
    """Yield errors at the start and in a run of steps."""
    rng = random.Random(seed)
    with instance(path, folder) as it:
        it.begin()
        it.shake(rng, 0.3)
        yield errors_of(it, it.having("input", "parameter"))
        it.fmu.exitInitializationMode()
        for k in range(STEPS):
            it.shake(rng, 0.1)
            it.fmu.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
        it.shake(rng, 0.1)
        yield errors_of(it, it.having("input", "parameter", tunable=True))


def in_exchange(path: Path, folder: Path, seed: int) -> Iterator[np.ndarray]:
    """Yield errors in continuous-time mode, at a random state."""
    rng = random.Random(seed)
    with instance(path, folder, exchange=True) as it:
        it.begin()
        it.fmu.exitInitializationMode()
        it.fmu.enterContinuousTimeMode()
        for state in it.states:
            it.set(state, it.get([state])[0] + rng.uniform(-0.1, 0.1))
        it.shake(rng, 0.3)
        yield errors_of(it, [*it.having("input", "parameter", tunable=True), *it.states])


@contextmanager
def instance(path: Path, folder: Path, exchange: bool = False) -> Iterator[Differentiated]:
    """An instance that is freed at the end."""
    it = Differentiated(path, folder, exchange)
    try:
        yield it
    finally:
        it.fmu.freeInstance()


def check(path: Path, folder: Path, share: float = 0.9) -> None:
    """Derivatives equal differences where outputs are smooth, at least in a share of all places."""
    exchanges = fmpy.read_model_description(str(path)).modelExchange is not None
    ways = (in_steps, in_exchange) if exchanges else (in_steps,)
    errors = np.concatenate(
        [
            error.ravel()
            for seed in range(3)
            for way in ways
            for error in way(path, folder / f"{way.__name__}{seed}", seed)
        ]
    )
    smooth = errors[np.isfinite(errors)]
    assert len(smooth) >= share * len(errors)
    assert (smooth < TOLERANCE).all()
