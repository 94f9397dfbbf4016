"""Run a host in its own environment: `python drivers.py FUNCTION JOB.json ROWS.csv`.

The Python of that environment runs this file, so it imports one tool and the standard library. JOB
names the FMUs, wires, steps and wanted outputs. The first row of ROWS has the seconds of the steps;
the others have the wanted outputs after every step.
"""

# ruff: noqa: PLC0415 - only one of the tools is installed

from __future__ import annotations

import csv
import json
import sys
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple
from xml.etree import ElementTree
from zipfile import ZipFile

#: Name of the job file in its folder.
JOB = "job.json"

#: Wanted outputs after every step.
Rows = Sequence[Sequence[float]]

#: Rows, and the seconds of the steps.
Result = tuple[Rows, float]


class Job:
    """A run.

    Attributes:
        fmus: paths of the FMUs by component.
        wires: pairs of source and target, each a component and a port.
        wanted: recorded outputs, each a component and a port.
        steps: number of steps.
        step: communication step [s].

    """

    def __init__(self, content: dict[str, Any]) -> None:
        self.fmus: dict[str, str] = content["fmus"]
        self.wires = [(tuple(source), tuple(target)) for source, target in content["wires"]]
        self.wanted = [tuple(port) for port in content["wanted"]]
        self.steps: int = content["steps"]
        self.step: float = content["step"]

    def inputs(self, name: str) -> list[str]:
        """Return the connected inputs of a component."""
        return [port for _, (owner, port) in self.wires if owner == name]

    def outputs(self, name: str) -> list[str]:
        """Return the outputs of a component that are connected or wanted, each once."""
        used = [source for source, _ in self.wires] + self.wanted
        return list(dict.fromkeys(port for owner, port in used if owner == name))


def sofirpy(job: Job) -> Result:
    """Run `simulate`, which logs at the start and after every step."""
    from sofirpy import simulate

    connections = defaultdict(list)
    for (source, output), (target, taking) in job.wires:
        connections[target].append(
            {
                "parameter_name": taking,
                "connect_to_system": source,
                "connect_to_external_parameter": output,
            }
        )
    logged = {name: job.outputs(name) for name in dict(job.wanted)}
    # The tool cuts off steps beyond the end, and rounding may put the last step there.
    table, seconds = _timed(
        simulate,
        stop_time=(job.steps + 0.5) * job.step,
        step_size=job.step,
        fmu_paths={name: Path(path) for name, path in job.fmus.items()},
        connections_config=dict(connections),
        parameters_to_log=logged,
    )
    return table[[f"{name}.{port}" for name, port in job.wanted]].values.tolist()[1:], seconds


def syssimx(job: Job, algorithm: str = "JacobiAlgorithm") -> Result:
    """Run a `System` of `FMUComponent`s, which keep their histories, including the start."""
    from syssimx import Connection, System
    from syssimx.components.fmu import FMUComponent
    from syssimx.system import algorithms

    system = System(name="auv")
    for name, path in job.fmus.items():
        system.add_component(FMUComponent(name, path))
    for (source, output), (target, taking) in job.wires:
        system.add_connection(Connection(source, output, target, taking))
    system.set_algorithm(getattr(algorithms, algorithm)())
    system.initialize(t0=0.0)
    result, seconds = _timed(system.run, t0=0.0, tf=job.steps * job.step, dt=job.step)
    columns = [result[name][1][port] for name, port in job.wanted]
    # The tool adds up its time, and makes a tiny last step if the sum falls short of the end.
    return _rows(columns)[1 : job.steps + 1], seconds


def syssimx_gauss_seidel(job: Job) -> Result:
    """Run the same in the tool's default order."""
    return syssimx(job, "GaussSeidelAlgorithm")


def gemseo_fmu(job: Job) -> Result:
    """Run a `TimeSteppingSystem`, which couples variables of the same name.

    Every discipline gets its ports explicitly, as some outputs and parameters have the same name in
    several FMUs. `input_names=None` means no inputs; an empty list means all inputs and parameters.
    """
    from gemseo_fmu.disciplines.do_step_fmu_discipline import DoStepFMUDiscipline
    from gemseo_fmu.disciplines.time_stepping_system import TimeSteppingSystem

    disciplines = []
    for name, path in job.fmus.items():
        names = {port: f"{name}:{port}" for port in job.outputs(name)}
        names |= {port: ":".join(source) for source, (to, port) in job.wires if to == name}
        disciplines.append(
            DoStepFMUDiscipline(
                path,
                name=name,
                input_names=job.inputs(name) or None,
                output_names=job.outputs(name),
                variable_names=names,
            )
        )
    system = TimeSteppingSystem(disciplines, job.steps * job.step, job.step)
    data, seconds = _timed(system.execute)
    columns = [data[":".join(port)] for port in job.wanted]
    # This tool, too, may make a tiny last step.
    return _rows(columns)[: job.steps], seconds


def pathsim_fmi(job: Job) -> Result:
    """Run a block for each FMU, and a `Scope`."""
    from pathsim import Connection, Simulation
    from pathsim.blocks import Scope
    from pathsim_fmi import CoSimulationFMU

    blocks = {
        name: CoSimulationFMU(path, instance_name=name, dt=job.step)
        for name, path in job.fmus.items()
    }
    scope = Scope()
    connections = [
        Connection(blocks[source][output], blocks[target][taking])
        for (source, output), (target, taking) in job.wires
    ]
    connections += [
        Connection(blocks[name][port], scope[i]) for i, (name, port) in enumerate(job.wanted)
    ]
    simulation = Simulation([*blocks.values(), scope], connections, dt=job.step, log=False)
    _, seconds = _timed(simulation.run, job.steps * job.step)
    _, columns = scope.read()
    # The row at t is recorded after the step from t: its row at 0 is ours after the first step.
    return _rows(columns)[: job.steps], seconds


def cofmupy(job: Job) -> Result:
    """Run a `Coordinator` with its default method, Jacobi."""
    from cofmupy import Coordinator

    targets = defaultdict(list)
    for source, (target, taking) in job.wires:
        targets[source].append({"id": target, "variable": taking, "unit": "", "type": "fmu"})
    configuration = {
        "fmus": [{"id": name, "path": path} for name, path in job.fmus.items()],
        "connections": [
            {"source": {"id": name, "variable": port, "unit": "", "type": "fmu"}, "target": fed}
            for (name, port), fed in targets.items()
        ],
    }
    coordinator = Coordinator()
    coordinator.start(configuration)
    begin = perf_counter()
    for _ in range(job.steps):
        coordinator.do_step(job.step)
    seconds = perf_counter() - begin
    results = coordinator.get_results()
    columns = [results[port] for port in job.wanted]
    return _rows(columns), seconds


def sdf4sim(job: Job) -> Result:
    """Run a graph of the tool's agents, with an initial token of zero on every wire.

    The tool's agent of an FMU needs an input, so `Source` stands in for FMUs without any; `Sink`
    records.
    """
    from sdf4sim import cs, sdf

    step = Fraction(job.step).limit_denominator(10**6)

    class Source(sdf.Agent):  # type: ignore[misc]
        """An FMU without inputs, stepped as `cs.Simulator` does."""

        def __init__(self, slave: Any) -> None:
            self.fmu, self.times = slave.fmu, count()
            variables = slave.description.modelVariables
            self.numbers = {v.name: v.valueReference for v in variables if v.causality == "output"}

        @property
        def inputs(self) -> dict[str, Any]:
            return {}

        @property
        def outputs(self) -> dict[str, Any]:
            return {name: sdf.OutputPort(float, 1) for name in self.numbers}

        def calculate(self, input_tokens: Any) -> dict[str, list[float]]:
            self.fmu.doStep(float(next(self.times) * step), float(step))
            values = self.fmu.getReal(list(self.numbers.values()))
            return {name: [value] for name, value in zip(self.numbers, values, strict=True)}

    class Sink(sdf.Agent):  # type: ignore[misc]
        """Receives the wanted outputs, which the tool's results keep."""

        @property
        def inputs(self) -> dict[str, Any]:
            return {".".join(port): sdf.InputPort(float, 1) for port in job.wanted}

        @property
        def outputs(self) -> dict[str, Any]:
            return {}

        def calculate(self, input_tokens: Any) -> dict[str, Any]:
            return {}

    agents: dict[str, Any] = {"sink": Sink()}
    for name, path in job.fmus.items():
        slave = cs.prepare_slave(name, path)
        agents[name] = cs.Simulator(slave, step) if job.inputs(name) else Source(slave)
    buffers = [
        sdf.Buffer(sdf.Src(*source), sdf.Dst(*target), deque([0.0])) for source, target in job.wires
    ]
    sinks = [sdf.Dst("sink", ".".join(port)) for port in job.wanted]
    buffers += [
        sdf.Buffer(sdf.Src(*port), sink, deque())
        for port, sink in zip(job.wanted, sinks, strict=True)
    ]
    end = sdf.iterations_expired(job.steps)
    results, seconds = _timed(sdf.sequential_run, (agents, buffers), end)
    return _rows([results[sink] for sink in sinks]), seconds


def pycosimlibrary(job: Job) -> Result:
    """Run a `JacobiRunner`, which keeps a snapshot at the start and after every step."""
    from PyCosimLibrary.jacobi_runner import JacobiRunner
    from PyCosimLibrary.loader import FMULoader
    from PyCosimLibrary.scenario import Connection as Wire
    from PyCosimLibrary.scenario import CosimScenario, OutputConnection, SignalType, VarType

    loaded = {name: FMULoader.load(path, name, None) for name, path in job.fmus.items()}
    for loader in loaded.values():
        loader.fmu.instantiate()
    real = {"value_type": VarType.REAL, "signal_type": SignalType.CONTINUOUS}

    def end(side: str, name: str, port: str) -> dict[str, Any]:
        numbers = [loaded[name].vars[port].valueReference]
        return {f"{side}_fmu": loaded[name].fmu, f"{side}_vr": numbers}

    scenario = CosimScenario(
        fmus=[loader.fmu for loader in loaded.values()],
        connections=[
            Wire(**real, **end("source", *source), **end("target", *target))
            for source, target in job.wires
        ],
        outputs=[OutputConnection(**real, **end("source", *port)) for port in job.wanted],
        step_size=job.step,
        stop_time=job.steps * job.step,
        print_interval=job.step,
    )
    result, seconds = _timed(JacobiRunner().run_cosim, scenario, None)
    signals = result.out_signals
    columns = [signals[name][loaded[name].vars[port].valueReference] for name, port in job.wanted]
    return _rows(columns)[1:], seconds


class Slave(NamedTuple):
    """An FMU in initialisation mode, with the same calls for both versions of FMI.

    Attributes:
        numbers: value references by variable.
        get, set: read or write Reals by value references.
        go: ends initialisation mode.
        step: makes a step from a time, of a length [s].

    """

    numbers: dict[str, int]
    get: Callable[[list[int]], list[float]]
    set: Callable[[list[int], list[float]], object]
    go: Callable[[], object]
    step: Callable[[float, float], object]


def fmuloader(job: Job) -> Result:
    """Step the slaves of this loader, which has no master."""

    def loaded(name: str, path: str) -> Slave:
        with ZipFile(path) as archive:
            root: Any = ElementTree.fromstring(archive.read("modelDescription.xml"))
        identifier = root.find("CoSimulation").attrib["modelIdentifier"]
        fmu: Any
        if root.attrib["fmiVersion"].startswith("3"):
            from fmuloader.fmi3 import Fmi3Slave

            fmu = Fmi3Slave(path, model_identifier=identifier)
            token = root.attrib["instantiationToken"]
            fmu.instantiate_co_simulation(name, instantiation_token=token)
            access = fmu.get_float64, fmu.set_float64
        else:
            from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

            fmu = Fmi2Slave(path, model_identifier=identifier)
            fmu.instantiate(name, Fmi2Type.CO_SIMULATION, guid=root.attrib["guid"])
            fmu.setup_experiment(start_time=0.0)
            access = fmu.get_real, fmu.set_real
        fmu.enter_initialization_mode()
        variables = [v.attrib for v in root.find("ModelVariables")]
        numbers = {v["name"]: int(v["valueReference"]) for v in variables}
        return Slave(numbers, *access, fmu.exit_initialization_mode, fmu.do_step)

    return _by_hand(job, loaded)


def fmpy_slaves(job: Job) -> Result:
    """Step fmpy's slaves, whose methods are the functions of FMI."""
    from fmpy import extract, instantiate_fmu, read_model_description

    def loaded(name: str, path: str) -> Slave:
        folder = extract(path)
        description = read_model_description(folder)
        fmu = instantiate_fmu(folder, description, "CoSimulation")
        if description.fmiVersion.startswith("3"):
            access = fmu.getFloat64, fmu.setFloat64
            fmu.enterInitializationMode(startTime=0.0)
        else:
            access = fmu.getReal, fmu.setReal
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
        numbers = {v.name: v.valueReference for v in description.modelVariables}
        return Slave(numbers, *access, fmu.exitInitializationMode, fmu.doStep)

    return _by_hand(job, loaded)


def _by_hand(job: Job, loaded: Callable[[str, str], Slave]) -> Result:
    """Step the slaves of a tool without a master, all side by side (Jacobi)."""
    slaves = {name: loaded(name, path) for name, path in job.fmus.items()}
    values = dict.fromkeys((source for source, _ in job.wires), 0.0)

    def give() -> None:
        for name, slave in slaves.items():
            ports = job.outputs(name)
            read = slave.get([slave.numbers[port] for port in ports])
            values.update({(name, port): value for port, value in zip(ports, read, strict=True)})

    def take() -> None:
        for name, slave in slaves.items():
            fed = [(source, port) for source, (owner, port) in job.wires if owner == name]
            if fed:
                slave.set([slave.numbers[port] for _, port in fed], [values[s] for s, _ in fed])

    for _ in slaves:
        give()
        take()
    for slave in slaves.values():
        slave.go()
    give()
    rows = []
    begin = perf_counter()
    for k in range(job.steps):
        take()
        for slave in slaves.values():
            slave.step(k * job.step, job.step)
        give()
        rows.append([values[port] for port in job.wanted])
    return rows, perf_counter() - begin


def _timed(run: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[Any, float]:
    """Call a function; return its result and the seconds that it took."""
    begin = perf_counter()
    result = run(*arguments, **options)
    return result, perf_counter() - begin


def _rows(columns: Sequence[Any]) -> list[list[float]]:
    return [[float(value) for value in row] for row in zip(*columns, strict=True)]


def write_rows(path: Path, rows: Rows, *seconds: float) -> None:
    """Write the seconds of a host and its rows."""
    with path.open("w", encoding="utf-8", newline="") as lines:
        csv.writer(lines).writerows([seconds, *rows])


if __name__ == "__main__":
    run: Callable[[Job], Result] = globals()[sys.argv[1]]
    rows, seconds = run(Job(json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))))
    # These tools record their rows themselves: reading takes no time.
    write_rows(Path(sys.argv[3]), rows, seconds, 0.0)
