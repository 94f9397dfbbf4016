"""Cost of a large system before its first step: `python benchmarks/planning.py`.

Chains, stars, and neighbours that feed one another, of one small FMU in C that does not declare the
dependencies of its outputs. Our master steps in its default order; libcosim and ecos step all at
once. Every run is a separate process with a time limit. The columns are

- `load`: reading of the file,
- `start`: plan, instances, initialisation and first exchange of values,
- `10 steps`: ten steps; libcosim starts in its first step, whose excess time is subtracted,
- `memory`: largest memory of the process.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from zipfile import ZipFile

import measuring

from orchestrator.cosim import (
    Connection,
    Ending,
    Header,
    PortName,
    System,
    Table,
    read_component,
    write_osp,
    write_ssp,
)
from orchestrator.runs.preparation import load, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario

STEP, STEPS = 0.01, 10

#: Instances, and how long a process may take [s].
SIZES, LIMIT = (100, 1_000, 10_000), 60.0

_SUPPORT = Path(__file__).parents[1] / "tests" / "support"

#: Outputs are computed when they are asked for, or else when the FMU is stepped.
_SOURCE = """
#include "slave.h"
typedef struct { double u, v, y, t; } Instance;
static void compute(Instance *it) { it->y = 0.25 * (it->u + it->v) + 1.0 + it->t; }
Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    return calloc(1, sizeof(Instance));
}
Status fmi2SetupExperiment(Component c, int given, double tolerance, double start, int ends,
                           double end)
{
    ((Instance *)c)->t = start;
    return OK;
}
Status fmi2SetReal(Component c, const unsigned *r, size_t n, const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) (&((Instance *)c)->u)[r[i]] = values[i];
    return OK;
}
Status fmi2GetReal(Component c, const unsigned *r, size_t n, double *values)
{
    size_t i;
    if (RESPONDS || ((Instance *)c)->t == 0.0) compute(c);
    for (i = 0; i < n; i++) values[i] = (&((Instance *)c)->u)[r[i]];
    return OK;
}
Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    ((Instance *)c)->t = t + h;
    compute(c);
    return OK;
}
"""

_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Small" guid="small">
  <CoSimulation modelIdentifier="small" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="3"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def chain(n: int) -> list[tuple[int, int, str]]:
    """A chain: each component feeds the next."""
    return [(i, i + 1, "u") for i in range(n - 1)]


def star(n: int) -> list[tuple[int, int, str]]:
    """A star: the first component feeds all others."""
    return [(0, i, "u") for i in range(1, n)]


def neighbours(n: int) -> list[tuple[int, int, str]]:
    """Neighbours: each component feeds the next, and the next feeds it."""
    return chain(n) + [(i + 1, i, "v") for i in range(n - 1)]


SHAPES = {shape.__name__: shape for shape in (chain, star, neighbours)}


def build(folder: Path, responds: bool) -> Path:
    """Build the FMU."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise SystemExit("planning.py needs a C compiler, cc")
    source, library = folder / "small.c", folder / "small.so"
    source.write_text(_SOURCE, encoding="utf-8")
    options = ("-shared", "-fPIC", "-O1", f"-I{_SUPPORT}", f"-DRESPONDS={responds:d}")
    subprocess.run([compiler, *options, "-o", library, source, _SUPPORT / "defaults.c"], check=True)
    fmu = folder / "small.fmu"
    with ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", _DESCRIPTION)
        archive.write(library, "binaries/linux64/small.so")
    return fmu


def write(fmu: Path, shape: str, n: int, folder: Path) -> None:
    """Write a system in the formats of all hosts."""
    small = read_component("a", fmu)
    names = [f"a{i}" for i in range(n)]
    connections = [
        Connection(PortName(names[source], "y"), PortName(names[target], port))
        for source, target, port in SHAPES[shape](n)
    ]
    components = {name: replace(small, name=name) for name in names}
    system = System("large", components, tuple(connections), step=STEP)
    write_ssp(system, folder)
    write_osp(system, folder)


class _First(Table):
    """A table with the time of the first exchange."""

    at = 0.0

    def begin(self, header: Header) -> None:
        self.at = perf_counter()
        super().begin(header)


def ours(folder: Path) -> tuple[float, float, float]:
    """Run by our master."""
    begun = perf_counter()
    system = load(str(folder / "large.ssp"))
    read = perf_counter()
    prepared = prepare(Scenario(system.name), system, Request(stop_time=STEPS * STEP, loop="auto"))
    table = _First()
    ending: Ending = prepared.run([table])
    end = perf_counter()
    if ending.failure is not None:
        raise SystemExit(ending.failure)
    return read - begun, table.at - read, end - table.at


def in_libcosim(folder: Path) -> tuple[float, float, float]:
    """Run by libcosim."""
    tool = measuring.libcosim()
    begun = perf_counter()
    execution = tool.from_osp_config_file(osp_path=str(folder))
    read = perf_counter()
    if not execution.step(1):
        raise SystemExit("libcosim ended the run")
    first = perf_counter()
    if not execution.step(STEPS - 1):
        raise SystemExit("libcosim ended the run")
    a_step = (perf_counter() - first) / (STEPS - 1)
    return read - begun, first - read - a_step, STEPS * a_step


def in_ecos(folder: Path) -> tuple[float, float, float]:
    """Run by ecos."""
    tool = measuring.ecos()
    begun = perf_counter()
    with tool.EcosSimulation(step_size=STEP, ssp_path=str(folder / "large.ssp")) as simulation:
        read = perf_counter()
        simulation.init()
        first = perf_counter()
        simulation.step(STEPS)
        return read - begun, first - read, perf_counter() - first


HOSTS: dict[str, Callable[[Path], tuple[float, float, float]]] = {
    "here": ours,
    "libcosim": in_libcosim,
    "ecos": in_ecos,
}


def measured(host: str, folder: Path, limit: float) -> str:
    """Results of a process that makes one run, as the end of a line of the table."""
    try:
        *times, memory = measuring.found_apart(__file__, host, folder, limit=limit)
    except RuntimeError as error:
        return str(error)
    return "".join(f"{seconds:10.3f} s" for seconds in times) + f"{memory:9.0f} MB"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES, metavar="N")
    parser.add_argument("--shapes", nargs="+", choices=SHAPES, default=list(SHAPES))
    parser.add_argument("--hosts", nargs="+", choices=HOSTS, default=list(HOSTS))
    parser.add_argument(
        "--limit", type=float, default=LIMIT, metavar="S", help="for one run (default: %(default)s)"
    )
    parser.add_argument(
        "--cached",
        action="store_true",
        help="outputs are computed in steps only, and do not respond to inputs between them",
    )
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    titles = "".join(f"{title:>12}" for title in ("load", "start", f"{STEPS} steps", "memory"))
    print(f"{'':12}{'instances':>9}  {'':9}{titles}")
    with TemporaryDirectory(prefix="auvfmu") as made:
        fmu = build(Path(made), not given.cached)
        for shape in given.shapes:
            for n in given.sizes:
                with TemporaryDirectory(prefix="auvfmu") as folder:
                    write(fmu, shape, n, Path(folder))
                    for host in given.hosts:
                        found = measured(host, Path(folder), given.limit)
                        print(f"{shape:12}{n:9,}  {host:9}{found}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == [measuring.ONE]:
        taken = HOSTS[sys.argv[2]](Path(sys.argv[3]))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        measuring.tell([*taken, peak])
    else:
        main()
