"""Comparison with FMUs of other tools: `python benchmarks/others.py [TOOL]...`.

Every tool that is installed makes an FMU of the same small vehicle: thrust commanded in, position
and speed out, an internal lag of the thruster, one explicit step of 20 ms. AuvPlant, in both kinds,
is a whole vehicle. The output has the contents of the FMUs, the problems that fmpy finds, and their
behaviour in a run; times are the shortest of several.

`pip install unifmu casadi grpcio 'protobuf<3.21'` installs the tools; those that are missing are
skipped. CasADi's FMU is for model exchange, so this script makes the step, in Python.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from io import StringIO
from itertools import count
from pathlib import Path
from signal import SIGKILL
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from zipfile import ZipFile

import fmpy
from fmpy.fmi2 import FMU2Slave, fmi2OK
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu

STEP = 0.02
STEPS, REPETITIONS = 200, 50
INSTANCES = 20

#: Steps before a state is saved, and after it.
BEFORE, AFTER = 50, 50

#: Time limit for one FMU [s], and the time between two builds: a zip rounds times to 2 s.
PATIENCE, APART = 300, 2.1

#: First argument of this script where it runs one FMU, which may end the process.
_RUN = "--run"

#: Name of the variable with the descriptor that it tells what it finds through.
_PIPE = "OTHERS_PIPE"

_SURGE = """
    MASS, DRAG, LAG = 30.0, 3.0, 0.1

    def advance(self, h):
        self.thrust += h * (self.tau - self.thrust) / self.LAG
        self.u += h * (self.thrust - self.DRAG * self.u) / self.MASS
        self.x += h * self.u
"""

_PYTHONFMU = f"""
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Surge(Fmi2Slave):
{_SURGE}
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.tau = self.x = self.u = self.thrust = 0.0
        self.register_variable(Real("tau", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("u", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.advance(step_size)
        return True
"""

_UNIFMU = f"""
import pickle

from fmi2 import Fmi2FMU, Fmi2Status


class Model(Fmi2FMU):
{_SURGE}
    def __init__(self, reference_to_attr=None):
        super().__init__(reference_to_attr)
        self.tau = self.x = self.u = self.thrust = 0.0

    def serialize(self):
        return Fmi2Status.ok, pickle.dumps((self.tau, self.x, self.u, self.thrust))

    def deserialize(self, bytes):
        self.tau, self.x, self.u, self.thrust = pickle.loads(bytes)
        return Fmi2Status.ok

    def do_step(self, current_time, step_size, no_step_prior):
        self.advance(step_size)
        return Fmi2Status.ok
"""

_UNIFMU_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Surge" guid="surge" generationTool="unifmu">
  <CoSimulation modelIdentifier="unifmu" needsExecutionTool="true"
    canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    canSerializeFMUstate="true"/>
  <ModelVariables>
    <ScalarVariable name="tau" valueReference="0" causality="input"><Real start="0.0"/>
    </ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="output" initial="calculated"><Real/>
    </ScalarVariable>
    <ScalarVariable name="u" valueReference="2" causality="output" initial="calculated"><Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2"/><Unknown index="3"/></Outputs>
    <InitialUnknowns><Unknown index="2"/><Unknown index="3"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def pythonfmu(folder: Path) -> Path:
    """Build the vehicle by PythonFMU."""
    from pythonfmu import FmuBuilder  # noqa: PLC0415

    script = folder / "surge.py"
    script.write_text(_PYTHONFMU, encoding="utf-8")
    options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
    return Path(FmuBuilder.build_FMU(script, dest=folder, **options))


def unifmu(folder: Path) -> Path:
    """The vehicle in UniFMU's template for Python, with a description written by hand."""
    inside = folder / "surge"
    command = [sys.executable, "-c", "from unifmu.cli import main; main()"]
    subprocess.run(
        [*command, "generate", "python", str(inside)], check=True, capture_output=True, timeout=60
    )
    (inside / "resources/model.py").write_text(_UNIFMU, encoding="utf-8")
    (inside / "modelDescription.xml").write_text(_UNIFMU_DESCRIPTION, encoding="utf-8")
    return Path(shutil.make_archive(str(inside), "zip", inside)).rename(folder / "Surge.fmu")


def casadi(folder: Path) -> Path:
    """Export the vehicle by CasADi."""
    from casadi import DaeBuilder  # noqa: PLC0415

    here = Path.cwd()
    os.chdir(folder)  # CasADi writes here
    try:
        model = DaeBuilder("Surge")
        tau = model.add("tau", "input", {"start": 0.0})
        x, u = (model.add(name, "output", {"start": 0.0}) for name in ("x", "u"))
        thrust = model.add("thrust")
        model.eq(model.der(thrust), (tau - thrust) / 0.1)
        model.eq(model.der(u), (thrust - 3.0 * u) / 30.0)
        model.eq(model.der(x), u)
        headers = Path(fmpy.__file__).parent / "c-code"
        files = model.export_fmu({"no_warning": True})
        options = {"compiler_flags": ["-O2"]}
        files = model.compile_fmu(
            files, {"include_dirs": [str(headers)], "compiler_options": options}
        )
        return folder / model.pack_fmu(files)
    finally:
        os.chdir(here)


def ours(*options: str) -> Callable[[Path], Path]:
    """AuvPlant of one kind."""

    def build(folder: Path) -> Path:
        command = [sys.executable, "-m", "orchestrator", "build", *options, "--out", str(folder)]
        subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE)
        return folder / "AuvPlant.fmu"

    return build


#: Name, the package that must be there, what builds its FMU.
TOOLS: dict[str, tuple[str, Callable[[Path], Path]]] = {
    "pythonfmu": ("pythonfmu", pythonfmu),
    "unifmu": ("unifmu", unifmu),
    "casadi": ("casadi", casadi),
    "ours-python": ("auv_fmu", ours()),
    "ours-native": ("auv_fmu", ours("--kind", "native")),
}


class CoSimulation:
    """An FMI 2.0 FMU for co-simulation, called through the addresses of its functions."""

    def __init__(self, fmu: Path, folder: str) -> None:
        description = fmpy.read_model_description(fmu, validate=False)
        by_name = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=folder,
        )
        self.offers_state = description.coSimulation.canSerializeFMUstate
        self.into = (ctypes.c_uint * 1)(by_name["tau" if "tau" in by_name else "tau.u"])
        names = [v.name for v in description.modelVariables if v.causality == "output"]
        reals = {v.name for v in description.modelVariables if v.type == "Real"}
        self.outputs = [by_name[name] for name in names if name in reals]
        self.out = (ctypes.c_uint * len(self.outputs))(*self.outputs)
        self.value, self.values = (ctypes.c_double * 1)(), (ctypes.c_double * len(self.outputs))()

    def begin(self) -> None:
        """Make an instance and initialise it."""
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        c, dll = self.slave.component, self.slave.dll
        self._set, self._do, self._get = dll.fmi2SetReal, dll.fmi2DoStep, dll.fmi2GetReal
        for function in (self._set, self._do, self._get):
            function.argtypes = None
        self._component = ctypes.c_void_p(c)
        self._step = ctypes.c_double(STEP)

    def step(self, k: int, tau: float) -> int:
        """The worst status of setting the thrust, a step, and getting all outputs."""
        self.value[0] = tau
        c, n = self._component, len(self.outputs)
        return max(
            self._set(c, self.into, ctypes.c_size_t(1), self.value),
            self._do(c, ctypes.c_double(k * STEP), self._step, 1),
            self._get(c, self.out, ctypes.c_size_t(n), self.values),
        )

    def save(self) -> bytes:
        """The state as bytes."""
        state = self.slave.getFMUstate()
        return bytes(self.slave.serializeFMUstate(state))

    def restore(self, state: bytes) -> None:
        """Continue from a saved state."""
        self.slave.setFMUstate(self.slave.deSerializeFMUstate(state))

    def end(self) -> None:
        """Free the instance, but keep the library."""
        self.slave.fmi2FreeInstance(self.slave.component)


class ModelExchange:
    """An FMI 3.0 FMU for model exchange, and the explicit step that it leaves to its host."""

    offers_state = False  # the continuous states are the host's

    def __init__(self, fmu: Path, folder: str) -> None:
        description = fmpy.read_model_description(fmu, validate=False)
        by_name = {v.name: v.valueReference for v in description.modelVariables}
        self.model = FMU3Model(
            guid=description.guid,
            modelIdentifier=description.modelExchange.modelIdentifier,
            unzipDirectory=folder,
        )
        self.into = (ctypes.c_uint32 * 1)(by_name["tau"])
        self.out = (ctypes.c_uint32 * 2)(by_name["x"], by_name["u"])
        self.value, self.values = (ctypes.c_double * 1)(), (ctypes.c_double * 2)()
        self.x, self.dx = (ctypes.c_double * 3)(), (ctypes.c_double * 3)()

    def begin(self) -> None:
        """Make an instance and initialise it."""
        self.model.instantiate()
        self.model.enterInitializationMode()
        self.model.exitInitializationMode()
        self.model.enterContinuousTimeMode()
        dll = self.model.dll
        for name in ("SetTime", "SetFloat64", "GetContinuousStateDerivatives"):
            setattr(self, name, getattr(dll, f"fmi3{name}"))
        self._set, self._derivatives = dll.fmi3SetFloat64, dll.fmi3GetContinuousStateDerivatives
        self._states, self._get = dll.fmi3SetContinuousStates, dll.fmi3GetFloat64
        self._time = dll.fmi3SetTime
        functions = (self._set, self._derivatives, self._states, self._get, self._time)
        for function in functions:
            function.argtypes = None
        self._component = ctypes.c_void_p(self.model.component)

    def step(self, k: int, tau: float) -> int:
        """Worst status of the calls of a step."""
        self.value[0] = tau
        c, x, dx = self._component, self.x, self.dx
        size = ctypes.c_size_t
        status = max(
            self._time(c, ctypes.c_double(k * STEP)),
            self._set(c, self.into, size(1), self.value, size(1)),
            self._derivatives(c, dx, size(3)),
        )
        for i in range(3):
            x[i] += STEP * dx[i]
        return max(
            status,
            self._states(c, x, size(3)),
            self._get(c, self.out, size(2), self.values, size(2)),
        )

    def end(self) -> None:
        """Free the instance, but keep the library."""
        self.model.fmi3FreeInstance(self.model.component)


def run(fmu: Path) -> None:
    """Run one FMU and print the results, one JSON object per line."""
    os.set_inheritable(int(os.environ[_PIPE]), False)  # an FMU may start processes that stay
    with TemporaryDirectory(prefix="others") as folder:
        fmpy.extract(fmu, folder)
        exchange = "ModelExchange" in Path(folder, "modelDescription.xml").read_text("utf-8")
        made = ModelExchange if exchange else CoSimulation

        def instance() -> tuple[CoSimulation | ModelExchange, float]:
            loaded = made(fmu, folder)
            start = perf_counter()
            loaded.begin()
            return loaded, perf_counter() - start

        first, first_seconds = instance()
        say(first=1e3 * first_seconds)
        seconds = []
        for _ in range(INSTANCES):
            loaded, taken = instance()
            seconds.append(taken)
            loaded.end()
        say(further=1e3 * min(seconds))
        say(step=1e6 * min(a_step(first) for _ in range(REPETITIONS)))
        bad, _ = instance()
        say(nan=after_nan(bad))
        bad.end()
        if isinstance(first, CoSimulation):
            again, _ = instance()
            say(state=state(first, again))
            again.end()
        first.end()


def say(**found: object) -> None:
    """Print one line for the parent process, distinct from the FMU's output."""
    os.write(int(os.environ[_PIPE]), json.dumps(found).encode() + b"\n")


def empty_calls() -> float:
    """Seconds of three empty calls through ctypes."""
    compare, number, size = ctypes.CDLL(None).memcmp, (ctypes.c_double * 1)(), ctypes.c_size_t(0)
    start = perf_counter()
    for _ in range(STEPS):
        compare(number, number, size), compare(number, number, size), compare(number, number, size)
    return (perf_counter() - start) / STEPS


_steps = count()


def a_step(instance: CoSimulation | ModelExchange) -> float:
    """Seconds of a step."""
    start = perf_counter()
    for _ in range(STEPS):
        k = next(_steps)
        instance.step(k, math.sin(0.1 * k))
    return (perf_counter() - start) / STEPS


def state(instance: CoSimulation, other: CoSimulation) -> str:
    """True if a run continues from a saved state with the same numbers."""
    if not instance.offers_state:
        return "not offered"

    def rows(fmu: CoSimulation, first: int) -> list[list[float]]:
        rows = []
        for k in range(first, first + AFTER):
            fmu.step(k, math.sin(0.1 * k))
            rows.append(list(fmu.values))
        return rows

    first = next(_steps)
    rows(instance, first)
    saved = instance.save()
    expected = rows(instance, first + BEFORE)
    instance.restore(saved)
    here = rows(instance, first + BEFORE) == expected
    other.restore(saved)
    there = rows(other, first + BEFORE) == expected
    return f"{'exact' if here else 'wrong'}, in another instance {'exact' if there else 'wrong'}"


def after_nan(instance: CoSimulation | ModelExchange) -> str:
    """Effect of a thrust that is NaN."""
    instance.step(0, 1.0)
    status = instance.step(1, math.nan)
    instance.step(2, 1.0)
    finite = all(map(math.isfinite, instance.values))
    refused = "accepted" if status == fmi2OK else f"refused with status {status}"
    return f"{refused}; after a good one outputs are {'finite' if finite else 'NaN'}"


def inside(fmu: Path) -> dict[str, object]:
    """Names in the archive."""
    with ZipFile(fmu) as archive:
        names = archive.namelist()
        binaries = [n for n in names if n.startswith("binaries/") and not n.endswith("/")]
        here = [n for n in binaries if "/linux64/" in n or "/x86_64-linux/" in n]
        text = archive.read("modelDescription.xml").decode()
        with TemporaryDirectory(prefix="others") as folder:
            libraries = sorted({name for n in here for name in needed(archive.extract(n, folder))})
    return {
        "size [kB]": round(fmu.stat().st_size / 1000),
        "platforms": " ".join(sorted({n.split("/")[1] for n in binaries})),
        "sources": any(n.startswith("sources/") and n.endswith(".c") for n in names),
        "needsExecutionTool": 'needsExecutionTool="true"' in text,
        "libraries": " ".join(libraries),
    }


def needed(library: str) -> list[str]:
    """Libraries that a shared library needs, and Python if it takes symbols from it."""
    dynamic = subprocess.run(
        ["readelf", "-d", library], capture_output=True, text=True, check=True, timeout=60
    )
    symbols = subprocess.run(
        ["nm", "-D", "--undefined-only", library],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    libraries = [
        line.split("[")[1][:-1] for line in dynamic.stdout.splitlines() if "(NEEDED)" in line
    ]
    libraries = [name for name in libraries if not name.startswith("ld-")]
    return [*libraries, "Python's symbols"] if " Py_" in symbols.stdout else libraries


def problems(fmu: Path) -> int:
    """Number of problems that fmpy finds."""
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        return len(validate_fmu(str(fmu)))


def differences(first: Path, second: Path) -> str:
    """Difference of two builds."""
    if first.read_bytes() == second.read_bytes():
        return "same bytes"
    with ZipFile(first) as a, ZipFile(second) as b:
        names = sorted({*a.namelist(), *b.namelist()})
        other = [n for n in names if n not in b.namelist() or a.read(n) != b.read(n)]
    return f"differs in {', '.join(other)}" if other else "same files, other bytes"


def measured(fmu: Path) -> dict[str, object]:
    """Results of a process that runs the FMU, which may end that process."""
    reading, writing = os.pipe()
    # UniFMU starts `python3`, which must be the one with its packages.
    path = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"
    process = subprocess.Popen(
        [sys.executable, __file__, _RUN, str(fmu)],
        env={**os.environ, _PIPE: str(writing), "PATH": path},
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    os.close(writing)
    try:
        ended: object = process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        ended = "no end"
    with suppress(ProcessLookupError):
        os.killpg(process.pid, SIGKILL)
    process.wait()
    with os.fdopen(reading, encoding="utf-8") as lines:
        values = {k: v for line in lines for k, v in json.loads(line).items()}
    labels = {
        "first": "first instance [ms]",
        "further": "further instances [ms]",
        "step": "a step [us]",
        "state": "saved state",
        "nan": "NaN as input",
    }
    return {
        **{labels[k]: round(v, 3) if isinstance(v, float) else v for k, v in values.items()},
        "the process ended with": ended,
    }


def main() -> None:
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tool", nargs="*", metavar="TOOL", help=f"of {', '.join(TOOLS)}")
    chosen = parser.parse_args().tool or list(TOOLS)
    print(f"CPython {platform.python_version()}, {platform.machine()}, fmpy {fmpy.__version__}")
    calls = 1e6 * min(empty_calls() for _ in range(REPETITIONS))
    print(f"three empty calls through ctypes: {calls:.2f} us")
    for name in chosen:
        package, build = TOOLS[name]
        if find_spec(package) is None:
            print(f"\n{name}: not installed, skipped")
            continue
        try:
            print(f"\n{name} ({version(package)})", flush=True)
        except PackageNotFoundError:
            print(f"\n{name}")
        with (
            TemporaryDirectory(prefix="others") as folder,
            TemporaryDirectory(prefix="others") as other,
        ):
            try:
                fmu = build(Path(folder))
            except (OSError, RuntimeError, subprocess.SubprocessError) as error:
                print(f"    cannot be built: {error}")
                continue
            sleep(APART)
            results = {
                **inside(fmu),
                "validate_fmu [problems]": problems(fmu),
                "built twice": differences(fmu, build(Path(other))),
                **measured(fmu),
            }
        for label, value in results.items():
            print(f"    {label:24} {value}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == [_RUN]:
        run(Path(sys.argv[2]))
    else:
        main()
