"""The gains that keep nearest to the reference while no command passes a limit.

`python tools/best_gains.py` searches the ranges of the ready study `gains`, from its start and over
its time, by differential evolution: for either controller the least `late_error` at which no peak
command is above 10, 20 and 80 N or N·m. It makes some 136,000 runs by the batch engine, which takes
six to seven minutes of one core. A search finds good gains, and no proof that there are no better
ones: with `--seeds 2` each is made twice, and what either found is printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import exp, log
from time import process_time

from scipy.optimize import differential_evolution

from auv_fmu.paper.euler import STEP
from orchestrator.runs.loading import load
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.studies.study import Study
from orchestrator.studies.study_file import read_study
from orchestrator.vehicle.signals import ACTUATORS

#: What no command may pass [N, N·m].
_LIMITS = (10.0, 20.0, 80.0)

#: Generations of a search, and vehicles in each for every gain that is searched.
_GENERATIONS, _VEHICLES = 250, 10

#: Above the logarithm of any error: gains whose commands are too large are worse than all others.
_TOO_LARGE = 10.0


class Search:
    """The gains of one controller, and what comes of them."""

    def __init__(self, study: Study, scenario: str) -> None:
        """Take the ranges of a study that the controller of a scenario has."""
        assert study.sample and study.stop_time, study.name
        system = load(scenario)
        self._engine = BatchEngine({scenario: system})
        self._point = Point(0, scenario, study.parameters, study.stop_time.base, STEP)
        has = system.components["controller"].variables
        ranges = study.sample.ranges
        self.gains = [name for name in ranges if name.partition(".")[2] in has]
        self.bounds = [(log(ranges[name].low), log(ranges[name].high)) for name in self.gains]

    def indices(self, logarithms: Sequence[float]) -> tuple[float, float]:
        """The largest error late in the run [m], and the largest command [N, N·m]."""
        gains = dict(zip(self.gains, map(exp, logarithms), strict=True))
        point = self._point._replace(parameters={**self._point.parameters, **gains})
        [outcome] = self._engine.outcomes([point])
        peaks = [outcome.indices[f"peak_command.{name}"] for name in ACTUATORS]
        return outcome.indices["late_error"], max(peaks)

    def best(self, limit: float, seed: int) -> tuple[float, Sequence[float]]:
        """The least error that is found [m], and the logarithms of its gains."""

        def cost(logarithms: Sequence[float]) -> float:
            error, peak = self.indices(logarithms)
            return log(error) if peak <= limit else _TOO_LARGE + log(peak / limit)

        found = differential_evolution(
            cost, self.bounds, maxiter=_GENERATIONS, popsize=_VEHICLES, tol=0.0, rng=seed,
            polish=False,
        )  # fmt: skip
        return exp(found.fun), found.x


def main() -> None:
    """Search, and print what is found."""
    parser = argparse.ArgumentParser(description="find the best gains under limits of the commands")
    parser.add_argument("--seeds", type=int, default=1, help="searches of each kind (default 1)")
    seeds = range(1, parser.parse_args().seeds + 1)
    study, started = read_study("gains"), process_time()
    for scenario in study.scenario:
        search = Search(study, scenario)
        for limit in _LIMITS:
            found = [search.best(limit, seed) for seed in seeds]
            error, gains = min(found, key=lambda pair: pair[0])
            others = ", ".join(f"{other:.3g}" for other, _ in found)
            print(f"{scenario}, commands up to {limit:g}: {error:.3g} m (by seed: {others})")
            for name, value in zip(search.gains, map(exp, gains), strict=True):
                print(f"    {name} = {value:.4g}", flush=True)
    print(f"{process_time() - started:.0f} s of the processor")


if __name__ == "__main__":
    main()
