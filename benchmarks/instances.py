"""Size of the FMUs, and the cost of instances after the first: `python benchmarks/instances.py`.

The time of an instance is set against that of a plain Python object of the same class, in the same
repetition: what is above it is FMI, PythonFMU and the loader.
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import fmpy
from fmpy.fmi2 import FMU2Slave

from orchestrator.experiments import bundle

REPETITIONS = 200


def main() -> None:
    """Measure and print."""
    print(f"{'FMU':22} {'size':>9} {'instance':>12} {'/ Python object':>16}")
    with TemporaryDirectory(prefix="auvfmu") as folder:
        bundle.build(Path(folder))
        for path in sorted(Path(folder).glob("*.fmu")):
            unpacked = fmpy.extract(path, unzipdir=Path(folder, path.stem))
            guid = fmpy.read_model_description(path).guid

            def instance(unpacked: str = unpacked, guid: str = guid, name: str = path.stem) -> None:
                fmu = FMU2Slave(guid=guid, modelIdentifier=name, unzipDirectory=str(unpacked))
                fmu.instantiate()
                fmu.freeInstance()

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
            print(
                f"{path.name:22} {path.stat().st_size / 1000:6.0f} kB "
                f"{1e3 * median(times):9.2f} ms {median(ratios):16.1f}"
            )


if __name__ == "__main__":
    main()
