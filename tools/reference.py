"""Reference results, with which a user checks an import into another tool.

For each FMU, in the manner of the FMI cross-check: `NAME_in.csv` with inputs over time,
`NAME_ref.csv` with the outputs, `NAME_ref.opt` with the experiment, in the folder `reference` of
its component. For the system: `reference/auv_ref.csv` and `auv_ref.opt`, from a Jacobi run, which
is what most tools do.

`python tools/reference.py [FOLDER]` writes them anew, into this repository or FOLDER.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import fmpy
import numpy as np
from fmpy.util import write_csv

from fmus.discovery import REFERENCE, components
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.files import CsvFile
from orchestrator.master.plan import make_plan
from orchestrator.master.simulation import simulate_to_end
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import Component, read_component

#: Length of the reference runs [s] and their step [s].
STOP_TIME, STEP = 4.0, 0.02


def reference_inputs(component: Component) -> np.ndarray:
    """Inputs without special values: a sine of its own for each, small enough for the gate."""
    names = [variable.name for variable in component.having("input")]
    time = np.arange(round(STOP_TIME / STEP) + 1) * STEP
    table = np.zeros(len(time), dtype=[(name, np.float64) for name in ("time", *names)])
    table["time"] = time
    for i, name in enumerate(names, start=1):
        table[name] = 0.1 * np.sin((0.5 + 0.1 * i) * time)
    return table


def reference_outputs(component: Component, inputs: np.ndarray) -> np.ndarray:
    """Outputs of an FMU that runs alone with these inputs, by fmpy."""
    names = [variable.name for variable in component.having("output") if variable.type == "Real"]
    table: np.ndarray = fmpy.simulate_fmu(
        str(component.fmu),
        stop_time=STOP_TIME,
        step_size=STEP,
        output_interval=STEP,
        input=inputs,
        output=names,
    )
    return table


def write_reference(dist: Path, root: Path) -> list[Path]:
    """Write the reference results of the closed loop and of each FMU of the bundle.

    Args:
        dist: folder with the built bundle.
        root: of the repository that they are for.

    Returns:
        The files written.

    """
    written = []
    for name, package in components().items():
        folder = root.joinpath(*package.split("."), REFERENCE)
        written += write_component_reference(dist / f"{name}.fmu", folder)
    written.append(root / REFERENCE / "auv_ref.csv")
    written[-1].parent.mkdir(exist_ok=True)
    jacobi = Experiment(STOP_TIME, STEP, "jacobi")
    simulate_to_end(make_plan(closed_loop(dist), jacobi), [CsvFile(written[-1])])
    written.append(_write_options(written[-1].with_name("auv")))
    return written


def write_component_reference(fmu: Path, folder: Path) -> list[Path]:
    """Write the reference results of one FMU, and return the files written."""
    folder.mkdir(parents=True, exist_ok=True)
    component = read_component(fmu.stem, fmu)
    inputs = reference_inputs(component)
    written = []
    for suffix, table in (("in", inputs), ("ref", reference_outputs(component, inputs))):
        if len(table.dtype.names or ()) > 1:
            written.append(folder / f"{fmu.stem}_{suffix}.csv")
            write_csv(written[-1], table)
    return [*written, _write_options(folder / fmu.stem)]


def _write_options(stem: Path) -> Path:
    path = stem.with_name(f"{stem.name}_ref.opt")
    path.write_text(
        f"StartTime,0.0\nStopTime,{STOP_TIME}\nStepSize,{STEP}\nRelTol,0.0\n"
        f"OutputIntervalLength,{STEP}\n",
        encoding="utf-8",
    )
    return path


def main() -> None:
    """Write the reference results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parents[1])
    for path in write_reference(current_fmus(), parser.parse_args().folder):
        print(path)


if __name__ == "__main__":
    main()
