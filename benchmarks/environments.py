"""Speed of environments for learning, ours and others': `python benchmarks/environments.py`.

Each is measured in a process of its own, with random actions that stay the same. Printed are the
steps a second, of all environments side by side together, and the simulated seconds a second. For
auv-fmu, a step is an action, and five communication steps.

For the others: `pip install gymnasium envpool crazyflow pyflyt gym-sailing`, then `pip install
'numpy>=2'`, with which PyFlyt runs, too. ship-env, sailboat-gym and holoocean can be installed
by their names, but cannot be run: they need the abandoned package gym, Docker, and a game engine
that is not in the package.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from math import nan
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from measuring import ONE, found_apart, options, python, tell

#: Numbers of environments side by side.
MANY = (1, 64, 1024, 10_000)


class Case(NamedTuple):
    """An environment that is measured.

    Attributes:
        package: that it comes from.
        id: its name.
        what: it simulates.
        length: of a step [s]; NaN: not known.
        module: that registers it.
        numbers: of environments side by side; none: a single one.

    """

    package: str
    id: str
    what: str
    length: float
    module: str = "gymnasium"
    numbers: tuple[int, ...] = ()


OURS = Case("auv-fmu", "auv_fmu/Tracking-v0", "this vehicle", 0.1, "orchestrator.bridges.gymnasium")
CASES = (
    OURS,
    OURS._replace(numbers=MANY),
    Case("gymnasium", "Pendulum-v1", "a pendulum, Python", 0.05),
    Case("gymnasium", "CartPole-v1", "a cart with a pole, numpy", 0.02, "gymnasium", MANY),
    Case("envpool", "Pendulum-v1", "a pendulum, C++", 0.05, "envpool", MANY),
    Case(
        "crazyflow", "DroneFigureEightTrajectory-v0", "a drone, JAX", 0.002, "crazyflow.envs", MANY
    ),
    Case("pyflyt", "PyFlyt/QuadX-Hover-v4", "a drone, PyBullet", 0.025, "PyFlyt.gym_envs"),
    Case("gym-sailing", "Motorboat-v0", "a boat, Python", nan, "gym_sailing"),
)


def rate(step: Callable[[], object], seconds: float) -> float:
    """Calls a second."""
    step()
    n, start = 0, perf_counter()
    while (elapsed := perf_counter() - start) < seconds:
        step()
        n += 1
    return n / elapsed


def measured(case: Case, n: int, seconds: float) -> float:
    """Steps a second of all environments together; n = 0: of a single one."""
    import gymnasium  # noqa: PLC0415

    module: Any = import_module(case.module)
    if case.package == "envpool":
        envs = module.make_gymnasium(case.id, num_envs=n)
    elif n:
        envs = gymnasium.make_vec(case.id, num_envs=n)
    else:
        return single(gymnasium.make(case.id), seconds)
    envs.reset()
    action = envs.action_space.sample()
    if case.package == "envpool":
        action = np.stack([action] * n)
    # Arrays of JAX may not be computed yet.
    return n * rate(lambda: np.asarray(envs.step(action)[1]), seconds)


def single(env: Any, seconds: float) -> float:
    """Steps a second of one environment."""
    env.reset(seed=0)
    action = env.action_space.sample()

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return rate(step, seconds)


def label(package: str) -> str:
    """Name and version."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return package


def main() -> None:
    """Measure and print."""
    parser = options(__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="length of a measurement")
    seconds = parser.parse_args().seconds
    print(python())
    print(f"{'':82} {'steps/s':>12} {'simulated s/s':>14}")
    for case in CASES:
        name = f"{label(case.package):18} {case.id:29} {case.what:25}"
        for n in case.numbers or (0,):
            try:
                found = found_apart(__file__, CASES.index(case), n, seconds, limit=300.0)
                numbers = f"{found:12,.0f} {found * case.length:14,.0f}"
            except RuntimeError as error:
                numbers = str(error)
            print(f"{name} {n or 'single':>7} {numbers}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == [ONE]:
        tell(measured(CASES[int(sys.argv[2])], int(sys.argv[3]), float(sys.argv[4])))
    else:
        main()
