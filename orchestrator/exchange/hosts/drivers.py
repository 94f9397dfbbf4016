"""Tools in environments of their own: `python drivers.py FUNCTION JOB.json ROWS.csv`.

It is run by the Python of such an environment, so it imports one tool and the standard library. JOB
names the FMUs, the wires, the steps and the outputs that are wanted; into ROWS go the seconds that
the steps took, and the wanted outputs after every step.
"""

# ruff: noqa: PLC0415 - only one of the tools is there

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

#: The name of a job in its folder.
JOB = "job.json"

#: Wanted outputs after every step.
Rows = Sequence[Sequence[float]]

#: These, and the seconds of the steps.
Result = tuple[Rows, float]


class Job:
    """What is to be run.

    Attributes:
        fmus: the paths of the FMUs, by the names of the components.
        wires: source and target, each a component and a port.
        wanted: outputs that are recorded, each a component and a port.
        steps: how many.
        step: communication step [s].

    """

    def __init__(self, content: dict[str, Any]) -> None:
        self.fmus: dict[str, str] = content["fmus"]
        self.wires = [(tuple(source), tuple(target)) for source, target in content["wires"]]
        self.wanted = [tuple(port) for port in content["wanted"]]
        self.steps: int = content["steps"]
        self.step: float = content["step"]

    def inputs(self, name: str) -> list[str]:
        """Inputs of a component that are fed."""
        return [port for _, (owner, port) in self.wires if owner == name]

    def outputs(self, name: str) -> list[str]:
        """Outputs of a component that feed something, or are wanted, each once."""
        used = [source for source, _ in self.wires] + self.wanted
        return list(dict.fromkeys(port for owner, port in used if owner == name))


def sofirpy(job: Job) -> Result:
    """`simulate`, which logs at the start, and after every step."""
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
    begin = perf_counter()
    # It cuts off what lies beyond the end, where rounding may put the last step.
    table = simulate(
        stop_time=(job.steps + 0.5) * job.step,
        step_size=job.step,
        fmu_paths={name: Path(path) for name, path in job.fmus.items()},
        connections_config=dict(connections),
        parameters_to_log=logged,
    )
    seconds = perf_counter() - begin
    return table[[f"{name}.{port}" for name, port in job.wanted]].values.tolist()[1:], seconds


def syssimx(job: Job, algorithm: str = "JacobiAlgorithm") -> Result:
    """A `System` of `FMUComponent`s, which keep their histories, the start with them."""
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
    begin = perf_counter()
    result = system.run(t0=0.0, tf=job.steps * job.step, dt=job.step)
    seconds = perf_counter() - begin
    columns = [result[name][1][port] for name, port in job.wanted]
    # It adds up its time, and where that ends below the end makes a last step of next to nothing.
    return [list(row) for row in zip(*columns, strict=True)][1 : job.steps + 1], seconds


def syssimx_gauss_seidel(job: Job) -> Result:
    """The same in the order that the tool takes if it is given none."""
    return syssimx(job, "GaussSeidelAlgorithm")


def gemseo_fmu(job: Job) -> Result:
    """A `TimeSteppingSystem`, which couples by equal names.

    So every discipline is told its ports: some outputs and parameters have one name in several
    FMUs. Without inputs is None; an empty list is all inputs and parameters.
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
    begin = perf_counter()
    data = system.execute()
    seconds = perf_counter() - begin
    columns = [data[":".join(port)] for port in job.wanted]
    # The same here.
    return [[float(x) for x in row] for row in zip(*columns, strict=True)][: job.steps], seconds


def pathsim_fmi(job: Job) -> Result:
    """A block for each FMU, and a `Scope`."""
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
    begin = perf_counter()
    simulation.run(job.steps * job.step)
    seconds = perf_counter() - begin
    _, columns = scope.read()
    # At t it steps what it then shows: its row of t = 0 is ours after the first step.
    return [[float(x) for x in row] for row in zip(*columns, strict=True)][: job.steps], seconds


def cofmupy(job: Job) -> Result:
    """A `Coordinator`, as its configuration is without a word about the method: Jacobi."""
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
    return [[float(x) for x in row] for row in zip(*columns, strict=True)], seconds


def sdf4sim(job: Job) -> Result:
    """A graph of the tool's agents, with an initial token of zero on every wire.

    Its agent of an FMU needs an input, so what has none gets an agent of ours, as does what
    records.
    """
    from sdf4sim import cs, sdf

    step = Fraction(job.step).limit_denominator(10**6)

    class Source(sdf.Agent):  # type: ignore[misc]
        """An FMU without inputs, stepped as `cs.Simulator` steps the others."""

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
        """Takes what is wanted; the tool's results keep it."""

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
    begin = perf_counter()
    results = sdf.sequential_run((agents, buffers), sdf.iterations_expired(job.steps))
    seconds = perf_counter() - begin
    return [list(row) for row in zip(*(results[sink] for sink in sinks), strict=True)], seconds


def pycosimlibrary(job: Job) -> Result:
    """A `JacobiRunner`, which keeps a snapshot at the start and after every step."""
    from PyCosimLibrary.jacobi_runner import JacobiRunner
    from PyCosimLibrary.loader import FMULoader
    from PyCosimLibrary.scenario import Connection as Wire
    from PyCosimLibrary.scenario import CosimScenario, OutputConnection, SignalType, VarType

    loaded = {name: FMULoader.load(path, name, None) for name, path in job.fmus.items()}
    for one in loaded.values():
        one.fmu.instantiate()
    real = {"value_type": VarType.REAL, "signal_type": SignalType.CONTINUOUS}

    def end(side: str, name: str, port: str) -> dict[str, Any]:
        numbers = [loaded[name].vars[port].valueReference]
        return {f"{side}_fmu": loaded[name].fmu, f"{side}_vr": numbers}

    scenario = CosimScenario(
        fmus=[one.fmu for one in loaded.values()],
        connections=[
            Wire(**real, **end("source", *source), **end("target", *target))
            for source, target in job.wires
        ],
        outputs=[OutputConnection(**real, **end("source", *port)) for port in job.wanted],
        step_size=job.step,
        stop_time=job.steps * job.step,
        print_interval=job.step,
    )
    begin = perf_counter()
    signals = JacobiRunner().run_cosim(scenario, None).out_signals
    seconds = perf_counter() - begin
    columns = [signals[name][loaded[name].vars[port].valueReference] for name, port in job.wanted]
    return [list(row) for row in zip(*columns, strict=True)][1:], seconds


class Slave(NamedTuple):
    """An FMU in initialisation mode, the same for both versions of FMI.

    Attributes:
        numbers: value references of its variables.
        get, set: its numbers, by value references.
        go: ends initialisation mode.
        step: from a time, for a length [s].

    """

    numbers: dict[str, int]
    get: Callable[[list[int]], list[float]]
    set: Callable[[list[int], list[float]], object]
    go: Callable[[], object]
    step: Callable[[float, float], object]


def fmuloader(job: Job) -> Result:
    """Its slaves: it loads FMUs, and has no master."""

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
    """Its slaves, of which each is an FMU with the functions of FMI."""
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
    """Slaves of a tool without a master, stepped side by side by a loop of ours."""
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


def write_rows(path: Path, rows: Rows, *seconds: float) -> None:
    """Write what a host took, and its rows."""
    with path.open("w", encoding="utf-8", newline="") as lines:
        csv.writer(lines).writerows([seconds, *rows])


if __name__ == "__main__":
    run: Callable[[Job], Result] = globals()[sys.argv[1]]
    found, taken = run(Job(json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))))
    # They keep their rows themselves: nothing is read after the steps.
    write_rows(Path(sys.argv[3]), found, taken, 0.0)
