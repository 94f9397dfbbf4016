"""Memory that FMUs leak: `python benchmarks/leaks.py [N] [--only WORD]`.

Makes an instance, initialises and steps it, saves, serialises and restores its state, resets and
frees it, N times, 10,000 if no number is given. Prints the resident memory after a tenth of the
cycles and after all of them, and the memory that each cycle between them leaked.

Measures every FMU in a Python host and in a C host, built with both loaders, and a plain FMU of
PythonFMU with one variable, which shows the leaks of PythonFMU itself.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
from fmpy.fmi2 import FMU2Slave
from pythonfmu import FmuBuilder

from fmus.python.packaging import loader_compiler
from orchestrator.runs import bundle

_PAGE = os.sysconf("SC_PAGE_SIZE")
_LIBPYTHON = Path(
    str(sysconfig.get_config_var("LIBDIR")), str(sysconfig.get_config_var("INSTSONAME"))
)

_STATUS = Path("/proc/self/statm")

#: First argument of this script where it is the Python host.
_HOST = "--host"

_BARE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Bare(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x = 0.0
        self.register_variable(Real("x", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        return True
"""


def bare(folder: Path) -> Path:
    """A plain FMU of PythonFMU."""
    script = folder / "bare.py"
    script.write_text(_BARE, encoding="utf-8")
    options = {"handle-state": True, "serialize-state": True}
    return Path(FmuBuilder.build_FMU(script, dest=folder, **options))


def cycle(folder: Path) -> None:
    """One cycle of an instance in a Python host."""
    fmu = FMU2Slave(guid="", modelIdentifier=identifier(folder), unzipDirectory=str(folder))
    fmu.instantiate()
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.02)
    state = fmu.getFMUstate()
    again = fmu.deSerializeFMUstate(fmu.serializeFMUstate(state))
    fmu.setFMUstate(again)
    fmu.freeFMUstate(state)
    fmu.freeFMUstate(again)
    fmu.reset()
    fmu.freeInstance()


@cache
def identifier(folder: Path) -> str:
    """Name of an FMU's library."""
    return str(fmpy.read_model_description(folder).coSimulation.modelIdentifier)


def be_host(folder: Path, counts: list[int]) -> None:
    """Run cycles in Python, and print the same as the C host."""
    done = 0
    for count in counts:
        for _ in range(count - done):
            cycle(folder)
        done = count
        print(done, _STATUS.read_text(encoding="ascii").split()[1], flush=True)


def rows(folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and unpacked folder of every FMU that is measured."""
    for loader in ("native", "plain"):
        bundle.build_bundle(folder / loader, loader=loader)
        for path in sorted((folder / loader).glob("*.fmu")):
            yield f"{path.stem}, {loader}", Path(fmpy.extract(path, folder / loader / path.stem))
    yield "empty slave of PythonFMU", Path(fmpy.extract(bare(folder), folder / "bare"))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=10_000, help="default: %(default)s")
    parser.add_argument("--only", default="", help="rows with this word in their names")
    options = parser.parse_args()
    n = options.n
    counts = [str(n // 10), str(n)]
    print(f"{'FMU':30} {'host':6} {n // 10:>8} cycles {n:>8} cycles {'left of a cycle':>16}")
    with TemporaryDirectory(prefix="auvfmu") as temporary:
        host = Path(temporary, "cycles")
        source = Path(__file__).with_name("cycles.c")
        subprocess.run([str(loader_compiler()), "-O2", "-o", host, source, "-ldl"], check=True)
        for name, folder in rows(Path(temporary)):
            if options.only not in name:
                continue
            library = folder / "binaries/linux64" / f"{identifier(folder)}.so"
            python = [sys.executable, __file__, _HOST, str(folder)]
            c = [str(host), str(library), (folder / "resources").as_uri()]
            print(f"{name:30} Python {outcome([*python, *counts])}", flush=True)
            print(f"{'':30} C      {outcome([*c, *counts])}", flush=True)


def outcome(command: list[str]) -> str:
    """Output of a host as the cells of a row; FMUs without the loader need Python preloaded."""
    environment = {**os.environ, "LD_PRELOAD": str(_LIBPYTHON)}
    process = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    readings = [[int(word) for word in line.split()] for line in process.stdout.splitlines()]
    cells = "".join(f"{pages * _PAGE / 1e6:12.1f} MB" for _, pages in readings)
    if process.returncode != 0:
        return f"{cells} ended with status {process.returncode}"
    (first, before), (last, after) = readings
    return f"{cells} {(after - before) * _PAGE / (last - first):14.0f} B"


if __name__ == "__main__":
    if sys.argv[1:2] == [_HOST]:
        be_host(Path(sys.argv[2]), [int(count) for count in sys.argv[3:]])
    else:
        main()
