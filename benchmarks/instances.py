"""Size of the FMUs, and the cost of instances after the first: `python benchmarks/instances.py`.

The time of an instance is compared with a plain Python object of the same class, in the same
repetition: the difference is due to FMI, PythonFMU and the loader. Leaked memory is the growth of
resident memory over many instances that were made and freed, and over as many resets of one.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import fmpy
from fmpy.fmi2 import FMU2Slave
from measuring import resident

from fmus.kinds import PYTHON
from orchestrator.runs.bundle import current_fmus

REPETITIONS = 200

#: Instances or resets before memory is first read, and between the two readings.
WARM_UP, MANY = 2000, 5000


def growth(function: Callable[[], object]) -> float:
    """Bytes that remain after one call."""
    for _ in range(WARM_UP):
        function()
    gc.collect()
    before = resident()
    for _ in range(MANY):
        function()
    gc.collect()
    return 1e6 * (resident() - before) / MANY


def main() -> None:
    """Measure and print."""
    print(
        f"{'FMU':24} {'size':>6} {'instance':>11} {'/ Python object':>16} "
        f"{'stays of an instance':>21} {'of a reset':>11}"
    )
    with TemporaryDirectory(prefix="auvfmu") as folder:
        for path in sorted(current_fmus(PYTHON).glob("*.fmu")):
            unpacked = fmpy.extract(path, unzipdir=Path(folder, path.stem))
            guid = fmpy.read_model_description(path).guid

            def made(
                unpacked: str = unpacked, guid: str = guid, name: str = path.stem
            ) -> FMU2Slave:
                fmu = FMU2Slave(guid=guid, modelIdentifier=name, unzipDirectory=str(unpacked))
                fmu.instantiate()
                return fmu

            def instance(made: Callable[[], FMU2Slave] = made) -> None:
                made().freeInstance()

            instance()
            script = Path(unpacked, "resources", "slavemodule.txt").read_text(encoding="utf-8")
            slave = getattr(sys.modules[script.strip()], path.stem)
            times, ratios = [], []
            for _ in range(REPETITIONS):
                start = perf_counter()
                instance()
                middle = perf_counter()
                slave(instance_name="plain")
                end = perf_counter()
                times.append(middle - start)
                ratios.append((middle - start) / (end - middle))
            kept = made()
            print(
                f"{path.name:24} {path.stat().st_size / 1000:3.0f} kB "
                f"{1e3 * median(times):8.2f} ms {median(ratios):16.1f} "
                f"{growth(instance):19.0f} B {growth(kept.reset):9.0f} B"
            )
            kept.freeInstance()


if __name__ == "__main__":
    main()
