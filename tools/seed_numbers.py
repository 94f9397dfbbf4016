"""What random seas, links and noise do to scenarios: `python tools/seed_numbers.py`.

Each scenario runs with its own seeds, and 60 times with others. A line has a number of the run
with its own seeds, the median of the others, and what 5 % and 95 % of them are below. `sea` runs in
still water too, and `formation-change` without noise. Remarks and pages take their numbers from
here.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator import load, simulate
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import read_scenario
from orchestrator.vehicle.distances import SMALLEST_DISTANCE_LABEL, smallest_distances
from orchestrator.vehicle.signals import Loop, limits, loops_of, tracking_error

#: Over which times the largest errors count [s].
SPANS: Mapping[str, Sequence[tuple[float, float]]] = {
    "sea": [(0, 25), (60, 101)],
    "formation-v": [(25, 121)],
    "formation-change": [(25, 121)],
    "formation-lost-link": [(25, 121), (100, 121)],
    "remus": [(120, 281)],
}

#: The run of the PD controller beside each of them.
COMPANIONS = {
    "sea": "sea-pd",
    "formation-v": "formation-pd",
    "formation-change": "formation-pd",
    "formation-lost-link": "formation-lost-link-pd",
    "remus": "remus-pd",
}

#: Runs without what is random.
_EVEN: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "sea": (
        "still water",
        {"sea.waves.spectrum": "none", "sea.current.speed": 0.0, "sea.current.sigma": 0.0},
    ),
    "formation-change": ("no noise", {"auv*.plant.noise.std": 0.0}),
}


def run(scenario: str, pd: bool, k: int = 0, changes: Mapping[str, Any] | None = None) -> Result:
    """One run of a scenario.

    Args:
        scenario: its name.
        pd: whether the PD controller runs, as beside the scenario.
        k: of the seeds; 0: the scenario's own.
        changes: other values.

    """
    name, values = COMPANIONS[scenario] if pd else scenario, dict(changes or {})
    if scenario == "formation-change":
        own = read_scenario(scenario).parameters
        values |= {str(name): own[name] for name in own if ".planner.stage" in str(name)}
    seeds = [
        f"{component}.{port}"
        for component, part in load(name, "native").components.items()
        for port in part.variables
        if port.endswith("seed") and k
    ]
    values |= {seed: 1000 * k + i for i, seed in enumerate(seeds)}
    return simulate(name, values, kind="native", loop="compiled")


def numbers(scenario: str, result: Result, loops: Sequence[Loop]) -> dict[str, float]:
    """The numbers of a run: of several vehicles the largest, of distances the smallest."""
    sizes = np.array([np.linalg.norm(tracking_error(result, loop), axis=1) for loop in loops])
    found = {}
    for start, end in SPANS[scenario]:
        here = (result.time >= start) & (result.time < end)
        found[f"error from {start:g} s to {min(end, result.time[-1]):g} s [m]"] = sizes[
            :, here
        ].max()
    commands = [result.step_values(*loop.commanded) for loop in loops]
    found["peak command u [N]"] = max(np.abs(one[:, 0]).max() for one in commands)
    found["peak command q, r [N.m]"] = max(np.abs(one[:, 1:]).max() for one in commands)
    if scenario == "remus":
        attained = result.step_values(*(f"allocation.tau_attained.{k}" for k in "uqr"))
        beyond = [np.abs(commands[0] - attained) > 1e-9]
    else:
        beyond = [
            (one < lower) | (one > upper)
            for one, (lower, upper) in zip(
                commands, (limits(result, loop) for loop in loops), strict=True
            )
        ]
    for i, actuator in enumerate("uqr"):
        share = max(one[:, i].mean() for one in beyond)
        found[f"steps beyond the limits, {actuator} [%]"] = 100.0 * share
    if len(loops) > 1:
        found[f"{SMALLEST_DISTANCE_LABEL} [m]"] = smallest_distances(result, loops).min()
    return found


def over_seeds(scenario: str, pd: bool, n: int) -> dict[str, np.ndarray]:
    """The numbers of the run with the scenario's own seeds, and of n with others."""
    loops = loops_of(load(COMPANIONS[scenario] if pd else scenario, "native"))
    rows = [numbers(scenario, run(scenario, pd, k), loops) for k in range(n + 1)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def main() -> None:
    """Print all lines."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", nargs="*", choices=[*SPANS, []], default=[])
    parser.add_argument("--runs", type=int, default=60, metavar="N")
    options = parser.parse_args()
    for scenario in options.scenario or SPANS:
        for pd in (False, True):
            print(f"\n{scenario}, {'PD' if pd else 'proposed'}: own seeds; median (5 % to 95 %)")
            for name, (own, *others) in over_seeds(scenario, pd, options.runs).items():
                low, middle, high = np.percentile(others, (5, 50, 95))
                some = f"; not 0 in {100 * np.mean(np.array(others) > 0):.0f} %" * ("%" in name)
                print(f"  {name:45}{own:8.3f};{middle:8.3f} ({low:.3f} to {high:.3f}){some}")
            if scenario in _EVEN:
                what, changes = _EVEN[scenario]
                loops = loops_of(load(COMPANIONS[scenario] if pd else scenario, "native"))
                even = numbers(scenario, run(scenario, pd, 0, changes), loops)
                print(f"  {what}: {', '.join(f'{name} {x:.3f}' for name, x in even.items())}")


if __name__ == "__main__":
    main()
