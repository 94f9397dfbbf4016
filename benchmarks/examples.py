"""Time of a step of each example: `python benchmarks/examples.py`.

Every example is built as both kinds of FMU. A loop in C calls fmi2DoStep of one instance, and
nothing else, with default inputs. For some examples, there are also:

- The same model as a plain slave of PythonFMU, from `benchmarks/slaves`, as PythonFMU builds it.
- The Reference FMU in C, if `--reference-fmus DIR` names a folder with a release, or a build, of
  github.com/modelica/Reference-FMUs: FMUs in `2.0` and `3.0`. Each communication step is as long
  as a step of its solver, and as `h_max` of the example, so both take the same number of solver
  steps.

All are timed in turns, in one process, and must give the same numbers. The output has medians of
processor time; ratios are taken within each turn.
"""

from __future__ import annotations

import ctypes
import subprocess
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import isclose
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import thread_time
from typing import NamedTuple

import fmpy
from fmpy.simulation import instantiate_fmu
from measuring import options, python
from pythonfmu import FmuBuilder

from fmus.discovery import name_of
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs.own_components import build_own

EXAMPLES = Path(__file__).parents[1] / "examples"
SLAVES = Path(__file__).with_name("slaves")

#: Solver steps of the Reference FMUs [s], by the names of the examples.
SOLVER_STEPS = {
    "bouncing_ball": 0.001, "dahlquist": 0.1, "stair": 0.2, "state_space": 0.001,
    "van_der_pol": 0.01,
}  # fmt: skip

#: Values that keep the counter of Stair rising: ours stays at its limit, theirs ends the run at 10.
OURS = {"stair": {"limit": 2_000_000_000}}
THEIRS = {"stair": {"counter": -2_000_000_000}}

#: Runs of a native FMU for each run of an FMU in Python, and in its turns with a Reference FMU.
RUNS = 20

#: Numbers in an output that is an array in the Reference FMU, and several outputs in ours.
ARRAYS = {"y": 3}

#: Tolerance for a plain slave, which adds up floats in another order.
ROUNDING = 1e-12


class Instance:
    """An instance of an FMU, and the loop that steps it."""

    def __init__(self, fmu: Path, folder: Path, loops: ctypes.CDLL) -> None:
        unpacked = fmpy.extract(fmu, unzipdir=folder)
        self.description = fmpy.read_model_description(unpacked)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.version = self.description.fmiVersion[0]
        self._slave = instantiate_fmu(unpacked, self.description, "CoSimulation")
        self._loop = loops[f"fmi{self.version}_steps"]
        self._loop.restype = ctypes.c_double
        self._step = ctypes.cast(self._slave.dll[f"fmi{self.version}DoStep"], ctypes.c_void_p)

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs that are numbers."""
        outputs = (
            variable for variable in self.variables.values() if variable.causality == "output"
        )
        numbers = (
            variable
            for variable in outputs
            if variable.type in ("Real", "Integer", "Float64", "Int32")
        )
        return [
            name
            for variable in numbers
            for name in (
                [f"{variable.name}[{i + 1}]" for i in range(ARRAYS[variable.name])]
                if variable.dimensions
                else [variable.name]
            )
        ]

    def begin(self, values: Mapping[str, float]) -> None:
        """Start again, with other values."""
        slave = self._slave
        slave.reset()
        if self.version == "2":
            slave.setupExperiment()
        for name, value in values.items():
            if name in self.variables:
                variable = self.variables[name]
                getattr(slave, f"set{variable.type}")([variable.valueReference], [value])
        slave.enterInitializationMode()
        slave.exitInitializationMode()

    def steps(self, h: float, n: int) -> float:
        """Processor time of some steps [s]."""
        component = ctypes.c_void_p(self._slave.component)
        seconds = self._loop(self._step, component, ctypes.c_double(h), ctypes.c_int(n))
        if seconds < 0:
            raise SystemExit(f"{self.description.modelName} refuses a step")
        return float(seconds)

    def steps_from_python(self, h: float, n: int) -> float:
        """Processor time of some steps that Python calls through ctypes [s]."""
        step, component = self._slave.dll["fmi2DoStep"], self._slave.component
        step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        start = thread_time()
        for k in range(n):
            step(component, k * h, h, 1)
        return thread_time() - start

    def number(self, name: str) -> float:
        """Value of an output."""
        array, _, place = name.rstrip("]").partition("[")
        variable = self.variables.get(name) or self.variables[array]
        get = getattr(self._slave, f"get{variable.type}")
        if variable.dimensions:
            return float(get([variable.valueReference], nValues=ARRAYS[array])[int(place) - 1])
        return float(get([variable.valueReference])[0])


class Row(NamedTuple):
    """Instances that are timed in turns.

    Attributes:
        h: step [s].
        instances: by name.
        values: start values of each.

    """

    h: float
    instances: dict[str, Instance]
    values: Mapping[str, Mapping[str, float]]

    def begin(self, name: str) -> Instance:
        """Initialise an instance, and return it."""
        instance = self.instances[name]
        instance.begin({"h_max": self.h, **self.values[name]})
        return instance

    def check(self, steps: int, tolerance: float) -> None:
        """Exit if the outputs of the instances do not change by the same numbers."""
        changes = {}
        for name, instance in self.instances.items():
            # A plain slave has its outputs only after a step.
            self.begin(name).steps(self.h, 1)
            before = {output: instance.number(output) for output in instance.outputs}
            self.begin(name).steps(self.h, steps)
            changes[name] = {output: instance.number(output) - x for output, x in before.items()}
        expected, *others = changes.values()
        for other in others:
            common = expected.keys() & other.keys()
            close = partial(isclose, rel_tol=tolerance, abs_tol=tolerance)
            if not common or not all(close(expected[y], other[y]) for y in common):
                raise SystemExit(f"not the same numbers: {changes}")

    def times(self, steps: int, repetitions: int, runs: int = 1) -> dict[str, list[float]]:
        """Microseconds of a step in each turn, in which native FMUs make some runs."""
        times: dict[str, list[float]] = {name: [] for name in self.instances}
        for _ in range(repetitions):
            for name in self.instances:
                n = runs if name == "native" else 1
                seconds = sum(self.begin(name).steps(self.h, steps) for _ in range(n))
                times[name].append(1e6 * seconds / n / steps)
        return times


def loops(folder: Path) -> ctypes.CDLL:
    """Compile the loops in C."""
    library = folder / "steps.so"
    source = Path(__file__).with_name("steps.c")
    command = [str(machines_compiler()), "-O2", "-fPIC", "-shared", "-o", library, source]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def ratio(times: Mapping[str, Sequence[float]], slow: str, fast: str) -> float:
    """Ratio of two times, as the median over the turns."""
    return median(x / y for x, y in zip(times[slow], times[fast], strict=True))


def rows(folder: Path, names: Sequence[str], calls: ctypes.CDLL) -> Iterator[tuple[str, Row]]:
    """Both kinds of each example, and its plain slave if there is one."""
    for name in names:
        instances = {
            called: Instance(build(name, kind, "2", folder / called), folder / called / name, calls)
            for called, kind in (("native", "native"), ("Python", "python"))
        }
        script = SLAVES / f"{name}.py"
        if script.exists():
            plain = folder / "plain"
            plain.mkdir(exist_ok=True)
            fmu = Path(FmuBuilder.build_FMU(script, dest=plain))
            instances["plain"] = Instance(fmu, plain / name, calls)
        declared = instances["native"].description.defaultExperiment.stepSize
        h = SOLVER_STEPS.get(name, float(declared))
        yield name, Row(h, instances, dict.fromkeys(instances, OURS.get(name, {})))


def references(folder: Path, given: Path, calls: ctypes.CDLL) -> Iterator[tuple[str, Row]]:
    """Examples and their Reference FMUs, in both versions of FMI."""
    for version in ("2", "3"):
        for name, h in SOLVER_STEPS.items():
            theirs = given / f"{version}.0" / f"{name_of(name)}.fmu"
            if not theirs.exists():
                continue
            place = folder / f"beside{version}"
            ours = build(name, "native", version, place)
            pair = {
                "native": Instance(ours, place / name, calls),
                "Reference": Instance(theirs, place / f"{name}_reference", calls),
            }
            values = {"native": OURS.get(name, {}), "Reference": THEIRS.get(name, {})}
            yield f"{name}, FMI {version}.0", Row(h, pair, values)


def build(name: str, kind: str, fmi: str, folder: Path) -> Path:
    """Build the FMU of an example."""
    folder.mkdir(exist_ok=True)
    return build_own(EXAMPLES / name / f"{name}.py", folder, kind=kind, fmi=fmi)


def print_kinds(folder: Path, names: Sequence[str], given: Namespace, calls: ctypes.CDLL) -> None:
    """Print the times of both kinds and of plain slaves."""
    print(
        f"{'':22} {'step [s]':>8} {'native':>8} {'Python':>8} {'/ native':>8} "
        f"{'plain slave':>11} {'Python / plain':>14}"
    )
    for name, row in rows(folder, names, calls):
        row.check(given.steps, ROUNDING)
        times = row.times(given.steps, given.repetitions, RUNS)
        native, slow = (median(times[kind]) for kind in ("native", "Python"))
        line = f"{name:22} {row.h:8g} {native:8.4f} {slow:8.2f} "
        line += f"{ratio(times, 'Python', 'native'):8.0f}"
        if "plain" in times:
            line += f" {median(times['plain']):11.2f} {ratio(times, 'Python', 'plain'):14.2f}"
        print(line, flush=True)
    from_python = median(
        1e6 * row.begin("native").steps_from_python(row.h, given.steps) / given.steps
        for _ in range(given.repetitions)
    )
    print(f"{name}, native, stepped from Python through ctypes: {from_python:.2f} us")


def print_references(folder: Path, given: Namespace, calls: ctypes.CDLL) -> None:
    """Print the times of the native kind and of the Reference FMUs."""
    print(f"{'':22} {'step [s]':>8} {'native':>8} {'Reference FMU':>13} {'native / it':>11}")
    for name, row in references(folder, given.reference_fmus, calls):
        row.check(given.steps, 0.0)
        times = row.times(given.steps, RUNS * given.repetitions)
        print(
            f"{name:22} {row.h:8g} {median(times['native']):8.4f} "
            f"{median(times['Reference']):13.4f} {ratio(times, 'native', 'Reference'):11.2f}",
            flush=True,
        )


def main() -> None:
    """Measure and print."""
    parser = options(__doc__)
    # The ball of BouncingBall rests after 2600 steps.
    parser.set_defaults(steps=2000, repetitions=25)
    parser.add_argument("--reference-fmus", type=Path, metavar="DIR", help="of FMUs in C")
    parser.add_argument("example", nargs="*", help="default: all")
    given = parser.parse_args()
    names = given.example or sorted(path.stem for path in EXAMPLES.glob("*/*.py"))
    print(f"{python()}, processor time of a step [us]")
    print(f"medians of {given.repetitions} turns of {given.steps} steps; native: {RUNS} times more")
    with TemporaryDirectory(prefix="auvfmu") as temporary:
        folder = Path(temporary)
        calls = loops(folder)
        print_kinds(folder, names, given, calls)
        if given.reference_fmus is not None:
            print_references(folder, given, calls)


if __name__ == "__main__":
    main()
