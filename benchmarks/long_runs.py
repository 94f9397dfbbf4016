"""Speed and memory during a long run: `python benchmarks/long_runs.py`.

Fig. 4 is run for a million steps with the observers of `auv-fmu run`, which keep a row a second.
The output has, for each tenth of the run, the processor time of a step and the resident memory at
its end, and a comparison of the last tenth with the first. With --checkpoint-every it also has the
sizes and times of checkpoints.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

from measuring import python, resident

from auv_fmu.paper.euler import STEP
from fmus.kinds import KINDS, NATIVE
from orchestrator import load
from orchestrator.cosim import (
    Checkpoints,
    Experiment,
    Hook,
    Observer,
    Plan,
    Run,
    Selection,
    make_plan,
    simulate_plan,
)
from orchestrator.cosim.hooks import NEVER
from orchestrator.cosim.observers import CsvFile
from orchestrator.figures.visible import VisibleRows
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.proof import CertificatesFile

#: Parts of a run that are compared, and simulated seconds between the rows that are kept.
_PARTS, _INTERVAL = 10, 1.0


class Parts:
    """A hook that measures each part of a run."""

    def __init__(self, steps: int) -> None:
        """Start to measure a run of a number of steps."""
        self._steps, self._before = steps // _PARTS, 0.0
        self.times: list[float] = []

    def act(self, run: Run) -> int:
        """Take and print the times."""
        now = process_time()
        if run.made:
            self.times.append(1e6 * (now - self._before) / self._steps)
            print(f"{run.made:9} {self.times[-1]:14.2f} {resident():14.1f}", flush=True)
        self._before = now
        return run.made + self._steps if len(self.times) < _PARTS else NEVER


@contextmanager
def timed(times: list[float]) -> Iterator[None]:
    """Record the time of every checkpoint [s]."""
    written: Any = Checkpoints._write

    def counted(self: Checkpoints, run: Run) -> None:
        begun = perf_counter()
        written(self, run)
        times.append(perf_counter() - begun)

    Checkpoints._write = counted  # type: ignore[method-assign]
    try:
        yield
    finally:
        Checkpoints._write = written  # type: ignore[method-assign]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--kind", choices=KINDS, default=NATIVE)
    parser.add_argument("--loop", choices=Plan.LOOPS, default=Plan.LOOPS[0])
    parser.add_argument("--checkpoint-every", type=float, metavar="S")
    options = parser.parse_args()
    experiment = Experiment(options.steps * STEP, STEP)
    parts, durations = Parts(options.steps), list[float]()
    hooks: list[Hook] = [parts]
    print(f"{python()}, kind {options.kind}")
    print(f"{'steps':>9} {'us a step':>14} {'resident [MB]':>14}")
    with TemporaryDirectory(prefix="auvfmu") as temporary, timed(durations):
        folder = Path(temporary)
        observers: list[Observer] = [
            Selection(CsvFile(folder / "result.csv"), _INTERVAL),
            CertificatesFile(folder / "certificates.csv", _INTERVAL),
            Metrics(),
            VisibleRows(),
        ]
        if options.checkpoint_every is not None:
            checkpoints = Checkpoints(folder / "checkpoint", {}, options.checkpoint_every, False)
            observers.append(checkpoints)
            hooks.insert(0, checkpoints)
        simulate_plan(
            make_plan(load("fig4", options.kind), experiment, loop=options.loop), observers, hooks
        )
        sizes = {path.name: path.stat().st_size for path in folder.glob("checkpoint/*")}
    print(f"the last tenth of the first: {parts.times[-1] / parts.times[0]:.3f}")
    for name, size in sizes.items():
        print(f"{name}: {1e-6 * size:.3f} MB")
    if durations:
        print(f"{len(durations)} checkpoints, {1e3 * median(durations):.1f} ms each")


if __name__ == "__main__":
    main()
