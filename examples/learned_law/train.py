"""Improve the weights of `learned_law.py` by evolution strategies, and print them.

    auv-fmu build examples/learned_law --kind native --out examples/learned_law
    python examples/learned_law/train.py

Each generation makes episodes of 20 s with changed weights, along new random references and on new
random vehicles: masses, damping, limits, start and disturbance differ, and so does the law's
knowledge. The cost is the distance from the reference, the effort, and the change of the command
from one step to the next. It takes seven minutes on two busy cores.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import learned_law
import numpy as np

from auv_fmu import Simulations

#: The loop of Fig. 4 with the law.
LOOP = {
    "components": {"controller": str(Path(__file__).with_name("LearnedLaw.fmu"))},
    "wires": {"controller.dy": "plant.dy"},
    "parameters": {"plant.noise.std": 0.003},
}

#: Pairs of changed weights, vehicles of each, generations; standard deviation of the changes, rate.
PAIRS, VEHICLES, GENERATIONS, SPREAD, RATE = 32, 16, 300, 0.05, 0.03

#: Weights of effort and of changes, each as a share of the limits, beside metres.
EFFORT, CHANGE = 0.05, 2.0

#: Vehicles that judge the result; the training has others.
JUDGES = 256

SHAPES = np.shape(learned_law.W_1), np.shape(learned_law.W_2)
W_1_SIZE = learned_law.NEURONS * 9


def vehicles(random: np.random.Generator, n: int) -> dict[str, Any]:
    """Parameters of n random vehicles with their references, and a law's knowledge of them."""

    def around(ratio: float, *shape: int) -> Any:
        """Factors between 1 / ratio and ratio."""
        return ratio ** random.uniform(-1.0, 1.0, (n, *shape))

    m = np.array([25.0, 17.5, 30.0, 22.5, 22.5, 15.0]) * around(1.2, 6)
    d = np.array([30.0, 30.0, 30.0, 20.0, 20.0, 20.0]) * around(1.3, 6) * around(2.0, 1)
    m[:, 3:] *= 0.4 * around(2.5, 1)
    d[:, 3:] *= 0.4 * around(2.5, 1)
    ell = 0.35 * around(1.3)
    levers = np.stack([ell * 0.0 + 1.0, ell, ell], axis=1)
    mass, drag = (k[:, [0, 5, 4]] / levers**2 for k in (m, d))
    tau_max = (mass * levers * 2.0 * around(2.0, 3))[:, [0, 2, 1]]
    start = random.uniform(-3.0, 3.0, (n, 3))
    turns = random.uniform((2.0, -2.0, -6.0), (30.0, 2.0, 6.0), (n, 3))
    given = {f"plant.{k}{i}{i}": v[:, i - 1] for k, v in (("m", m), ("d", d)) for i in range(1, 7)}
    return given | {
        "plant.ell": ell, "controller.ell": ell,
        "plant.tau_max": tau_max, "plant.tau_min": -tau_max, "controller.tau_max": tau_max,
        "controller.mass": mass * around(1.2, 3), "controller.drag": drag * around(1.5, 3),
        "plant.eta0.x": start[:, 0], "plant.eta0.y": start[:, 1], "plant.eta0.z": start[:, 2],
        "plant.eta0.psi": random.uniform(-1.0, 1.0, n),
        "disturbance.A_f": around(3.0), "disturbance.A_d": 2.0 * around(3.0),
        "planner.tau_d": turns, "plant.noise.seed": random.integers(1, 2**31, n),
    }  # fmt: skip


def costs(sims: Simulations, weights: np.ndarray, drawn: dict[str, Any]) -> np.ndarray:
    """Cost of an episode with each row of weights and each vehicle."""
    W_1, W_2 = np.split(weights, [W_1_SIZE], axis=1)
    sims.reset(parameters=drawn | {"controller.W_1": W_1, "controller.W_2": W_2})
    total = np.zeros(sims.n)
    for k in range(1, 51):
        sims.run(until=round(0.4 * k - 0.02, 2))
        before = sims["controller.tau"] / drawn["plant.tau_max"]
        sims.step()
        now = sims["controller.tau"] / drawn["plant.tau_max"]
        error = np.linalg.norm(sims["plant.y"] - sims["planner.y_d"], axis=1)
        effort, change = (now**2).mean(axis=1), np.abs(now - before).mean(axis=1)
        total += np.minimum(error, 5.0) + EFFORT * effort + CHANGE * change
    return np.where(sims.failed, 5.0, total / 50)


def judged(sims: Simulations, weights: np.ndarray) -> np.ndarray:
    """Costs of weights on vehicles that are the same for all."""
    return costs(sims, np.tile(weights, (JUDGES, 1)), vehicles(np.random.default_rng(2), JUDGES))


def beginning(random: np.random.Generator) -> np.ndarray:
    """The PD law of three neurons; the other neurons see something, and do nothing yet."""
    W_1, W_2 = random.normal(size=SHAPES[0]) * 0.5, np.zeros(SHAPES[1])
    axes = np.eye(3)
    W_1[:3] = np.hstack([axes, 2.0 * axes, 0.0 * axes])
    W_2[:, :3] = -axes
    return np.concatenate([W_1.ravel(), W_2.ravel()])


def main() -> None:
    """Train, and print the weights."""
    random = np.random.default_rng(1)
    sims, judges = Simulations(LOOP, 2 * PAIRS * VEHICLES), Simulations(LOOP, JUDGES)
    weights = beginning(random)
    first = best = judged(judges, weights)
    chosen, mean, square, began = weights, 0.0, 0.0, time.perf_counter()
    print(f"at the start: {np.mean(first):.4f}")
    for generation in range(1, GENERATIONS + 1):
        changes = random.normal(size=(PAIRS, len(weights)))
        changes = np.concatenate([changes, -changes])
        drawn = vehicles(random, VEHICLES)
        drawn = {name: np.concatenate([each] * 2 * PAIRS) for name, each in drawn.items()}
        tried = np.repeat(weights + SPREAD * changes, VEHICLES, axis=0)
        cost = costs(sims, tried, drawn).reshape(2 * PAIRS, VEHICLES)
        # Ranks within each vehicle, from -1/2 to 1/2.
        rank = cost.argsort(axis=0).argsort(axis=0).mean(axis=1) / (2 * PAIRS - 1) - 0.5
        slope = rank @ changes / (2 * PAIRS * SPREAD)
        mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
        corrected = np.sqrt(square / (1.0 - 0.99**generation)) + 1e-8
        weights = weights - RATE * (1.0 - generation / (GENERATIONS + 1)) * mean / corrected
        if generation % 25 == 0:
            now = judged(judges, weights)
            if now.mean() < best.mean():
                chosen, best = weights, now
            passed = time.perf_counter() - began
            print(f"{generation}: {now.mean():.4f} after {passed:.0f} s", flush=True)
    better = np.mean(best < first)
    print(f"chosen: {best.mean():.4f}, better on {better:.0%} of {JUDGES} other vehicles")
    parts = np.split(chosen, [W_1_SIZE])
    for name, values, shape in zip(("W_1", "W_2"), parts, SHAPES, strict=True):
        print(f"{name} = Matrix(\n    (")
        for row in values.reshape(shape):
            print(f"        ({', '.join(f'{x:.3f}' for x in row)}),")
        print("    )\n)")


if __name__ == "__main__":
    main()
