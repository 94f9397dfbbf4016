"""Many vehicles in one process: `python benchmarks/vehicles.py`.

Each vehicle is the closed loop of Fig. 4, four FMUs, without connections to others. Every run is a
separate process, whose rows are dropped. The columns are

- `load`: reading of the scenario,
- `start`: plan, instances, initialisation and first exchange of values,
- `step`: processor time of one vehicle in the compiled loop and in the Python loop,
- `memory`: growth of the process for each vehicle until its first step; for one vehicle, after an
  earlier run.

Below them are the steps of ten vehicles, and of one, in other hosts, for the native kind and
without a read of outputs.
"""

from __future__ import annotations

import argparse
import gc
import sys
from time import perf_counter, process_time

import measuring
import numpy as np

from auv_fmu.paper.euler import STEP
from fmus.kinds import NATIVE, PYTHON, KindName
from orchestrator.cosim import Ending, Header, Plan
from orchestrator.exchange.hosts import compare
from orchestrator.runs.preparation import load, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario

#: Numbers of vehicles, by the kind of their FMUs.
SIZES: dict[KindName, tuple[int, ...]] = {NATIVE: (1, 10, 100, 1000), PYTHON: (1, 10, 100)}

#: Steps of all vehicles together, and the fewest of each.
VEHICLE_STEPS, FEWEST = {NATIVE: 100_000, PYTHON: 2_000}, 20

#: Hosts that run the same vehicles, how many, and in how many steps of all together.
HOSTS_BESIDE, FEW, HOST_STEPS = ("libcosim-ssp", "ecos"), (1, 10), 50_000

#: Both loops, and the one that `load`, `start` and `memory` are of.
LOOPS: tuple[Plan.Loop, ...] = ("compiled", "python")
COMPILED = LOOPS[0]

#: Time limit for a process [s].
LIMIT = 600.0


class Watch:
    """An observer that drops the rows, and records the time of the first exchange."""

    began, memory, spent, ended = 0.0, 0.0, 0.0, 0.0

    def begin(self, header: Header) -> None:
        self.began = perf_counter()
        gc.collect()
        self.memory, self.spent = measuring.resident(), process_time()

    def take(self, rows: np.ndarray) -> None:
        self.ended = process_time()

    def end(self, ending: Ending) -> None:
        pass


def found(n: int, kind: KindName, loop: Plan.Loop, steps: int) -> list[float]:
    """Seconds to load and to start, microseconds of a vehicle's step, and its memory [MB]."""
    # Memory of the first system, and of the libraries.
    prepare(Scenario("warm"), load("fig4", kind), Request(stop_time=STEP, loop=loop)).run([Watch()])
    gc.collect()
    before, begun, watch = measuring.resident(), perf_counter(), Watch()
    system = load({"vehicles": n}, kind)
    loaded = perf_counter()
    prepared = prepare(Scenario(system.name), system, Request(stop_time=steps * STEP, loop=loop))
    ending = prepared.run([watch])
    if ending.failure is not None:
        raise SystemExit(ending.failure)
    microseconds = 1e6 * (watch.ended - watch.spent) / (steps * n)
    return [loaded - begun, watch.began - loaded, microseconds, (watch.memory - before) / n]


def in_hosts(n: int) -> str:
    """Time of a step of a vehicle in other hosts."""
    steps = HOST_STEPS // n
    verdicts = compare(load({"vehicles": n}, NATIVE), HOSTS_BESIDE, steps, STEP)
    return "".join(
        f"{verdict.failure or f'{1e6 / (verdict.steps_per_second * n):.2f} us':>18}"
        for verdict in verdicts
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", type=int, metavar="N", help="default: up to 1000")
    parser.add_argument("--kinds", nargs="+", choices=SIZES, default=list(SIZES))
    given = parser.parse_args()
    print(measuring.python())
    steps_of = "".join(f"{f'step, {loop}':>18}" for loop in LOOPS)
    print(f"{'kind':8}{'vehicles':>9}{'load':>10}{'start':>10}{steps_of}{'memory':>14}")
    for kind in given.kinds:
        for n in given.sizes or SIZES[kind]:
            steps = max(VEHICLE_STEPS[kind] // n, FEWEST)
            all_found = {
                loop: measuring.found_apart(__file__, n, kind, loop, steps, limit=LIMIT)
                for loop in LOOPS
            }
            loading, start, _, memory = all_found[COMPILED]
            of_loops = "".join(f"{all_found[loop][2]:15.2f} us" for loop in LOOPS)
            print(
                f"{kind:8}{n:9,}{loading:8.2f} s{start:8.2f} s{of_loops}{memory:11.3f} MB",
                flush=True,
            )
    print(f"\n{'kind':8}{'vehicles':>9}" + "".join(f"{host:>18}" for host in HOSTS_BESIDE))
    for n in FEW:
        print(f"{NATIVE:8}{n:9,}{in_hosts(n)}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == [measuring.ONE]:
        number, kind, loop, steps = sys.argv[2:]
        measuring.tell(found(int(number), kind, loop, int(steps)))
    else:
        main()
