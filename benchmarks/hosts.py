"""Our master compared with other hosts, on any files: `python benchmarks/hosts.py FILE...`.

A single FMU runs here and in `fmpy.simulate_fmu`; a system in Jacobi order, here and in libcosim
and ecos, which make all steps in one call and record nothing, while our master keeps all rows. Each
pair runs in turns, in a separate process; the time before the first step is subtracted. The output
has the medians of the times of both, and of their ratios. Files that a host does not run, or that
end its process, are only counted.

Without files: the FMUs and the system of this project, of the native kind.
"""

from __future__ import annotations

import argparse
import resource
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import fmpy
import measuring

from fmus.kinds import NATIVE
from orchestrator.cosim import (
    System,
    Table,
    read_component,
    read_ssp,
    simulate_plan,
    write_osp,
    write_ssp,
)
from orchestrator.machine.errors import InputError
from orchestrator.runs.bundle import build_bundle
from orchestrator.runs.preparation import prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario

#: Rounds, steps of a run, and the longest time of the steps of one run [s].
ROUNDS, STEPS, LONGEST = 9, 10_000, 0.3

#: Steps of a trial run, and runs of one step; the shortest time of these is subtracted.
FIRST, SET_UPS = 500, 5

#: Time limit for a pair [s].
PATIENCE = 60

#: Makes a number of steps, and returns their time [s].
Run = Callable[[int], float]


def ours(system: System, order: str) -> tuple[Run, float]:
    """Our master with its default loop, and the step that it takes."""
    step = prepare(Scenario(system.name), system, Request(stop_time=1.0)).experiment.step

    def run(steps: int) -> float:
        request = Request(stop_time=steps * step, step=step, order=order)
        prepared, table = prepare(Scenario(system.name), system, request), Table()
        start = perf_counter()
        ending = simulate_plan(prepared.plan, [table])
        seconds = perf_counter() - start
        if ending.failure is not None or len(table) != steps + 1:
            raise InputError(f"{ending.failure or ending.remark}")
        return seconds

    return run, step


def in_fmpy(system: System, step: float, _: Path) -> Run:
    """fmpy on an unpacked FMU."""
    [component] = system.components.values()
    folder = fmpy.extract(str(component.fmu))
    description = fmpy.read_model_description(folder, validate=False)

    def run(steps: int) -> float:
        start = perf_counter()
        fmpy.simulate_fmu(
            folder,
            validate=False,
            model_description=description,
            fmi_type="CoSimulation",
            start_time=0.0,
            stop_time=steps * step,
            output_interval=step,
        )
        return perf_counter() - start

    return run


def in_libcosim(system: System, step: float, folder: Path) -> Run:
    """libcosim on a system in its own format, because third-party archives end its process."""
    tool = measuring.libcosim()
    write_osp(replace(system, step=step), folder)

    def run(steps: int) -> float:
        execution = tool.from_osp_config_file(osp_path=str(folder))
        start = perf_counter()
        if not execution.step(steps):
            raise InputError("libcosim ended the run")
        return perf_counter() - start

    return run


def in_ecos(system: System, step: float, folder: Path) -> Run:
    """ecos on our SSP of a system."""
    tool = measuring.ecos()
    [ssp] = write_ssp(replace(system, step=step), folder)

    def run(steps: int) -> float:
        with tool.EcosSimulation(step_size=step, ssp_path=str(ssp)) as simulation:
            simulation.init()
            start = perf_counter()
            simulation.step(steps)
            return perf_counter() - start

    return run


#: Hosts by the suffixes of their files.
HOSTS = {
    ".fmu": {"fmpy": in_fmpy},
    ".ssp": {"libcosim": in_libcosim, "ecos": in_ecos},
}


def pair(path: Path, host: str, folder: Path) -> None:
    """Time a file here and in another host, in turns, and print both times of a step [s]."""
    alone = path.suffix == ".fmu"
    system = System(path.stem, {"a": read_component("a", path)}, ()) if alone else read_ssp(path)
    here, step = ours(system, "jacobi")
    there = HOSTS[path.suffix][host](system, step, folder)
    taken = max(here(FIRST), there(FIRST))
    steps = max(20, min(STEPS, int(FIRST * LONGEST / taken)))
    runs = [(run, min(run(1) for _ in range(SET_UPS))) for run in (here, there)]
    rounds = [tuple(run(steps) - before for run, before in runs) for _ in range(ROUNDS)]
    found = {
        "here": median(a for a, _ in rounds) / steps,
        "there": median(b for _, b in rounds) / steps,
        "ratio": median(a / b for a, b in rounds),
    }
    measuring.tell(found)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="*", type=Path, metavar="FILE", help=".fmu or .ssp")
    files = parser.parse_args().file
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    print(measuring.python())
    print(f"medians of {ROUNDS} rounds of at most {STEPS} steps")
    with TemporaryDirectory(prefix="auvfmu") as folder:
        if not files:
            build_bundle(Path(folder), kind=NATIVE)
            files = [*sorted(Path(folder).glob("*.fmu")), Path(folder, "auv.ssp")]
        left_out = 0
        for path in files:
            for host in HOSTS[path.suffix]:
                try:
                    found = measuring.found_apart(__file__, path, host, limit=PATIENCE)
                except RuntimeError:
                    left_out += 1
                    continue
                here, there = (1e6 * found[key] for key in ("here", "there"))
                text = f"{path.name:44} {here:9.2f} us here {there:9.2f} us in {host:9}"
                print(f"{text} {found['ratio']:6.3f}", flush=True)
    print(f"{left_out} pairs of a file and a host of which one does not run")


if __name__ == "__main__":
    if sys.argv[1:2] == [measuring.ONE]:
        with TemporaryDirectory(prefix="auvfmu") as work:
            pair(Path(sys.argv[2]), sys.argv[3], Path(work))
    else:
        main()
