"""The search for gains, the same for all laws.

Differential evolution searches the logarithms of the gains: Storn and Price, Journal of Global
Optimization 11 (1997). The first round is a Latin hypercube over the ranges, and includes the
law's own values. A candidate costs the mean of its runs: all tasks, with draws that the benchmark
does not use. At the end the best candidates compete with the law's own values on other draws.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.discovery import digest_at
from orchestrator.benchmark.contest import (
    Law,
    Vehicle,
    members,
    prepared,
    study_of_law,
)
from orchestrator.benchmark.cost import COLUMNS, costs
from orchestrator.cosim import PortName
from orchestrator.studies.columns import Outcomes, Points
from orchestrator.studies.study import Study
from orchestrator.studies.sweep import Means, Ready, making_runs


class Budget(NamedTuple):
    """Extent of a search.

    Attributes:
        rounds: of candidates.
        candidates: in each round.
        draws: for each task and candidate.
        finalists: candidates that compete at the end.
        final_draws: for each task and finalist.
        seed: of the candidates; those of the draws follow from the benchmark's.

    """

    rounds: int = 12
    candidates: int = 32
    draws: int = 16
    finalists: int = 7
    final_draws: int = 64
    seed: int = 1


#: The fewest candidates: each new one is made of four others.
FEWEST = 5


def search(law: Law, vehicle: Vehicle, budget: Budget, means: Means) -> dict[str, Any]:
    """Search the gains of a law for a vehicle.

    Returns:
        The gains, their cost and that of the law's own values, and the digest of the search.

    Raises:
        InputError: the runs cannot be made.

    """
    final = _prepared(law, vehicle, budget.final_draws, 2, means)
    own = _own(law, final)
    some = np.array([own, *_found(law, vehicle, budget, own, means)])
    found = _costs(law, final, np.exp(some), means)
    best = found.argmin()
    return {
        "digest": digest(law, vehicle, budget),
        "cost": round(float(found[best]), 6),
        "cost_of_own": round(float(found[0]), 6),
        "gains": {
            name: float(f"{value:.4g}")
            for name, value in zip(law.gains, np.exp(some[best]).tolist(), strict=True)
        },
    }


def _found(law: Law, vehicle: Vehicle, budget: Budget, own: np.ndarray, means: Means) -> np.ndarray:
    """Return the finalists, the best first: logarithms of gains (finalists, names)."""
    if not law.gains:
        return np.empty((0, 0))
    from scipy.optimize import differential_evolution  # noqa: PLC0415
    from scipy.stats import qmc  # noqa: PLC0415

    ready = _prepared(law, vehicle, budget.draws, 1, means)
    low, high = (np.log([limits[i] for limits in law.gains.values()]) for i in (0, 1))
    generator = np.random.default_rng(budget.seed)
    shares = qmc.LatinHypercube(len(low), rng=generator).random(budget.candidates)
    first = low + shares * (high - low)
    first[0] = own
    result = differential_evolution(
        lambda some: _costs(law, ready, np.exp(some.T), means),
        [*zip(low, high, strict=True)],
        init=first,
        maxiter=budget.rounds - 1,
        tol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=generator,
    )
    best: np.ndarray = result.population[np.argsort(result.population_energies)]
    return best[: budget.finalists]


def digest(law: Law, vehicle: Vehicle, budget: Budget) -> str:
    """Return a hash of the law, the vehicle, the budget and the files of the benchmark."""
    here = Path(__file__).parent
    files = *sorted(here.glob("components/*.py")), here / "cost.py", here / "score.py"
    own = [digest_at(file) for file in files]
    content = (law.digest, {**law.gains}, vehicle.scenario.digest, vehicle.study.sample)
    return sha256(repr((content, vehicle.known, budget, own)).encode()).hexdigest()[:16]


def training(study: Study, number: int) -> Study:
    """Return a study with other draws."""
    assert study.sample is not None
    return replace(study, sample=study.sample._replace(seed=study.sample.seed + number))


def _prepared(law: Law, vehicle: Vehicle, draws: int, number: int, means: Means) -> Ready:
    """Return a law with a vehicle, ready for runs with these draws."""
    study = training(study_of_law(law, vehicle, draws), number)
    return prepared(law, vehicle, study, {}, means)


def _own(law: Law, ready: Ready) -> np.ndarray:
    """Return the logarithms of the law's own gains; a group has its first member's."""
    [loop] = ready.space.prepared.values()
    firsts = (next(iter(members(law, {name: 0.0}))) for name in law.gains)
    values: Any = [loop.system.value(PortName.read(name)) for name in firsts]
    # A gain may be zero by default.
    own: np.ndarray = np.log(np.maximum(np.array(values, dtype=float), 1e-9))
    return own


def _costs(law: Law, ready: Ready, gains: np.ndarray, means: Means) -> np.ndarray:
    """Return the mean cost of each candidate: gains (candidates, names)."""
    points = ready.space.points(np.arange(len(ready.space)))
    n, columns = len(points), dict[str, np.ndarray]()
    for name, values in zip(law.gains, gains.T, strict=True):
        columns |= dict.fromkeys(members(law, {name: 0.0}), np.repeat(values, n))
    every = Points(
        np.arange(n * len(gains)),
        [case._replace(varied=(*case.varied, *columns)) for case in points.cases],
        np.tile(points.case, len(gains)),
        {**{k: np.tile(v, len(gains)) for k, v in points.values.items()}, **columns},
        np.tile(points.stop_time, len(gains)),
        np.tile(points.step, len(gains)),
    )
    with making_runs(ready.engine, [every], workers=means.workers) as blocks:
        made = Outcomes.joined([*blocks])
    made = made[np.argsort(made.numbers)]
    numbers: Mapping[str, np.ndarray] = {
        name: made.indices[:, made.columns.index(name)] for name in COLUMNS
    }
    mean: np.ndarray = costs(numbers).reshape(len(gains), n).mean(axis=1)
    return mean


def written(gains: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Return the text of a file of gains, by vehicle and law."""
    lines = ["# Gains of the benchmark, written by `auv-fmu benchmark --tune`."]
    for vehicle, of_laws in gains.items():
        for law, found in of_laws.items():
            lines += ["", f'["{vehicle}"."{law}"]', f'digest = "{found["digest"]}"']
            lines += [f"cost = {found['cost']!r}", f"cost_of_own = {found['cost_of_own']!r}"]
            pairs = (f'"{name}" = {value!r}' for name, value in found["gains"].items())
            lines.append(f"gains = {{ {', '.join(pairs)} }}")
    return "\n".join(lines) + "\n"
