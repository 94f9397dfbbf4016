"""Our master on an FMU or an archive, in a separate process.

`python ours.py FILE STEPS OUT [--order jacobi] [--changed]` writes the result to OUT, and the rows
of all outputs next to it.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator import Result, load, simulate
from orchestrator.cosim import Component, System, Value, Variable, read_component
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import DEFAULT_STEP

#: Name of the component of a single FMU.
ALONE = "fmu"

#: Change of a Real parameter, relative to its start value, or from zero.
_CHANGE = 0.01


def system_of(file: Path) -> System:
    """System in a file."""
    if file.suffix != ".fmu":
        return load(file)
    return System(file.stem, {ALONE: read_component(ALONE, file)}, ())


def step_of(system: System) -> float:
    """Step of a system, or of its first FMU with one [s]."""
    stated = [c.description.defaultExperiment for c in system.components.values()]
    steps = [float(s.stepSize) for s in stated if s is not None and s.stepSize]
    return system.step or next(iter(steps), DEFAULT_STEP)


def changed(component: Component) -> dict[str, float]:
    """Another value for every Real parameter; others are sizes of arrays and names of files."""
    values = {
        variable.name: _other(variable, component.start(variable.name))
        for variable in component.having("parameter")
        if variable.family == "Real"
    }
    return {name: value for name, value in values.items() if value is not None}


def _other(variable: Variable, start: Value | None) -> float | None:
    if not isinstance(start, float):
        return None
    by = _CHANGE * abs(start) or _CHANGE
    lower, upper = (
        limit if value is None else float(value)
        for value, limit in ((variable.min, -np.inf), (variable.max, np.inf))
    )
    return next((value for value in (start + by, start - by) if lower <= value <= upper), None)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run the system in a file, and keep the rows of its outputs."""
    with warnings.catch_warnings(record=True) as caught:
        system = system_of(options.file)
        step = step_of(system)
        end = (system.start_time or 0.0) + options.steps * step
        wanted = changed(system.components[ALONE]) if options.changed else {}
        result = simulate(
            system,
            {f"{ALONE}.{name}": value for name, value in wanted.items()},
            stop_time=min(end, system.stop_time or np.inf),
            step=step,
            order=options.order,
            # Other masters open rings by a delay.
            coupling="delay" if options.order == "jacobi" else None,
        )
    outputs = [
        (name, variable.name, variable.reference)
        for name, component in system.components.items()
        for variable in component.having("output")
        if variable.family == "Real"
    ]
    _keep(result, [f"{name}.{port}" for name, port, _ in outputs], options.out)
    return {
        "step": step,
        "rows": len(result),
        "failure": result.failure,
        "said": [*result.ending.messages, *(str(warning.message) for warning in caught)],
        "outputs": outputs,
        "wanted": wanted,
        "held": {name: result.parameters[f"{ALONE}.{name}"] for name in wanted},
    }


def _keep(result: Result, names: list[str], out: Path) -> None:
    np.save(out.with_suffix(".npy"), np.column_stack([result[n] for n in names] or [result.time]))


def main() -> None:
    """Run the file, and write the result."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("steps", type=int)
    parser.add_argument("out", type=Path)
    parser.add_argument("--order", default="gauss-seidel")
    parser.add_argument("--changed", action="store_true")
    options = parser.parse_args()
    try:
        came = run(options)
    except InputError as error:
        came = {"refusal": str(error)}
    options.out.write_text(json.dumps(came), encoding="utf-8")


if __name__ == "__main__":
    main()
