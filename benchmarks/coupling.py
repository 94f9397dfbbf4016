"""Accuracy and cost of the ways to couple FMUs: `python benchmarks/coupling.py`.

Linear FMUs, so that the exact solution is known: two masses with a spring and a damper between
them, and a quarter of a truck on a road. For each way and step the largest error of the coupled
outputs, relative to their amplitudes, and the time of a step in the compiled loop, the least of
some rounds in turns. In `nothing said` the FMUs do not say what their outputs depend on.

A ring of gains is added whose solution is known: what it is solved to, and what that costs.

Last, a ring through the paper's controller, whose measurements follow its own commands: how often
its FMUs exchange values in a run, with their own derivatives and with differences.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch
from zipfile import ZipFile

import numpy as np

from fmus.kinds import NATIVE
from orchestrator.cosim import Experiment, PortName, System, Table, make_plan, simulate_plan
from orchestrator.cosim.loop import compile_stepper
from orchestrator.cosim.ring import Ring
from orchestrator.runs.bundle import current_fmus

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.linear import QUARTER_TRUCK, SINE, TWO_MASSES, Part, error, linear, system_of

#: Steps that are timed, and how often.
_STEPS, _ROUNDS = 2000, 5

_STEP_OF = {"two masses": 0.0125, "quarter truck": 0.00125}
_MODELS = {"two masses": TWO_MASSES, "quarter truck": QUARTER_TRUCK}
_RING = {"a.u0": "b.y1", "a.u1": "s.y0", "b.u0": "a.y1"}


def _time(system: System, step: float, coupling: str) -> float:
    """Time of a step, without the start of a run [us]."""

    def run(n: int) -> float:
        experiment = Experiment(n * step, step, coupling=coupling)
        begin = perf_counter()
        simulate_plan(make_plan(system, experiment, loop="compiled"))
        return perf_counter() - begin

    return 1e6 * (run(_STEPS) - run(1)) / (_STEPS - 1)


def _ring(folder: Path, gain: float) -> System:
    parts = {"s": SINE, "a": Part(D=[[0, 0], [1, 1]]), "b": Part(D=[[0, 0], [gain, 0]])}
    return system_of({name: linear(folder) for name in "sab"}, parts, _RING)


def _controlled(folder: Path, fmu: Path) -> System:
    """A ring in which the position follows the command by a gain."""
    pairs = {"x": "u", "y": "r", "z": "q"}
    fmus = {name: linear(folder) for name in ("s", *pairs)}
    parts = {"s": SINE, **dict.fromkeys(pairs, Part(D=[[0, 0], [0.1, 0.1]]))}
    wires = {
        wire: source
        for name, axis in pairs.items()
        for wire, source in (
            (f"{name}.u0", f"controller.tau.{axis}"),
            (f"{name}.u1", "s.y0"),
            (f"controller.y.{name}", f"{name}.y1"),
        )
    }
    system = system_of({**fmus, "controller": fmu}, parts, wires)
    return system.with_parameters({PortName("controller", "innovation_gate"): 0.0})


def _counted(system: System) -> tuple[int, float]:
    """Steps of Newton's method in a run of 500 steps, and the time of a step [us]."""
    count, step = 0, Ring._step

    def counted(*arguments: Any) -> float:
        nonlocal count
        count += 1
        return step(*arguments)

    with patch.object(Ring, "_step", counted):
        begin = process_time()
        simulate_plan(make_plan(system, Experiment(10.0, 0.02, coupling="solve")))
        return count, 1e6 * (process_time() - begin) / 500


def _without_derivatives(fmu: Path, folder: Path) -> Path:
    """An FMU that does not say that it gives derivatives."""
    path = folder / fmu.name
    with ZipFile(fmu) as old, ZipFile(path, "w") as new:
        for name in old.namelist():
            text = old.read(name).replace(b' providesDirectionalDerivative="true"', b"")
            new.writestr(name, text if name == "modelDescription.xml" else old.read(name))
    return path


def _print(name: str, errors: list[float], least: float) -> None:
    print(f"{name:34}" + "".join(f"{error:10.1e}" for error in errors) + f"{least:10.1f}")


def main() -> None:
    """Print the tables."""
    compile_stepper()
    with TemporaryDirectory() as name:
        folder = Path(name)
        for title, model in _MODELS.items():
            finest = _STEP_OF[title]
            steps = [4 * finest, 2 * finest, finest]
            print(f"{title:34}" + "".join(f"{1e3 * h:7.4g} ms" for h in steps) + "  us a step")
            for says in ("dependencies", "nothing"):
                fmus = {part: linear(folder, says) for part in model.parts}
                system = system_of(fmus, model.parts, model.wires)
                ways = [None, "linear"]
                for coupling in ways:
                    errors = [
                        error(folder, model, Experiment(model.stop, h, coupling=coupling), says)
                        for h in steps
                    ]
                    least = min(_time(system, finest, coupling) for _ in range(_ROUNDS))
                    declared = "nothing said" if says == "nothing" else "dependencies said"
                    _print(f"  {coupling or 'held inputs'}, {declared}", errors, least)
        steps = [0.1, 0.05, 0.025]
        print(
            f"{'ring of gains':34}" + "".join(f"{1e3 * h:7.4g} ms" for h in steps) + "  us a step"
        )
        for gain in (0.45, -0.81, -2.0, 6.0):
            system = _ring(folder, gain)
            for coupling in Experiment.COUPLINGS[:2]:
                errors = []
                for h in steps:
                    table = Table()
                    simulate_plan(make_plan(system, Experiment(5.0, h, coupling=coupling)), [table])
                    right = np.sin(table.time) / (1.0 - gain)
                    errors.append(float(np.abs(table["a.y1"] - right).max()))
                stable = max(errors) < 1.0
                least = (
                    min(_time(system, 0.001, coupling) for _ in range(_ROUNDS))
                    if stable
                    else np.nan
                )
                _print(f"  {coupling}, gain {gain:g}", errors, least)
        fmu = current_fmus(NATIVE) / "ObserverController.fmu"
        print(f"{'ring through the controller':34}{'steps of Newton':>30}  us a step")
        for title, path in {
            "its own derivatives": fmu,
            "differences": _without_derivatives(fmu, folder),
        }.items():
            runs = [_counted(_controlled(folder, path)) for _ in range(_ROUNDS)]
            print(f"  {title:32}{runs[0][0]:30}{min(time for _, time in runs):10.1f}")


if __name__ == "__main__":
    main()
