"""Runs four FMUs in another tool: `python drivers.py HOST JOB.json ROWS.csv`.

It is run by the Python of the tool's own environment, so it imports that tool, what comes with it
and the standard library. JOB names the FMUs, the wires, the steps and the outputs that are wanted;
into ROWS go the seconds that the steps took, and the wanted outputs after every step.
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
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

Rows = list[list[float]]


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


def sofirpy(job: Job) -> tuple[Rows, float]:
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


def syssimx(job: Job, algorithm: str = "JacobiAlgorithm") -> tuple[Rows, float]:
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


def syssimx_gauss_seidel(job: Job) -> tuple[Rows, float]:
    """The same in the order that the tool takes if it is given none."""
    return syssimx(job, "GaussSeidelAlgorithm")


def gemseo_fmu(job: Job) -> tuple[Rows, float]:
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


def pathsim_fmi(job: Job) -> tuple[Rows, float]:
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


def cofmupy(job: Job) -> tuple[Rows, float]:
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


def sdf4sim(job: Job) -> tuple[Rows, float]:
    """A graph of the tool's agents, with an initial token of zero on every wire.

    Its agent of an FMU needs an input, so what has none gets an agent of ours, as does what
    records.
    """
    from sdf4sim import cs, sdf

    step = Fraction(job.step).limit_denominator(10**6)

    class Source(sdf.Agent):
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

    class Sink(sdf.Agent):
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


class Loaded:
    """A slave of fmuloader in initialisation mode, the same for both versions of FMI."""

    def __init__(self, name: str, path: str, identifier: str, attributes: dict[str, str]) -> None:
        self.fmu: Any
        self.get: Callable[[Sequence[int]], list[float]]
        if attributes["fmiVersion"].startswith("3"):
            from fmuloader.fmi3 import Fmi3Slave

            self.fmu = Fmi3Slave(path, model_identifier=identifier)
            token = attributes["instantiationToken"]
            self.fmu.instantiate_co_simulation(name, instantiation_token=token)
            self.get, self.set = self.fmu.get_float64, self.fmu.set_float64
        else:
            from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

            self.fmu = Fmi2Slave(path, model_identifier=identifier)
            self.fmu.instantiate(name, Fmi2Type.CO_SIMULATION, guid=attributes["guid"])
            self.fmu.setup_experiment(start_time=0.0)
            self.get, self.set = self.fmu.get_real, self.fmu.set_real
        self.fmu.enter_initialization_mode()


def fmuloader(job: Job) -> tuple[Rows, float]:
    """Its slaves, stepped by a loop of ours: it loads FMUs, and has no master."""
    slaves, numbers = {}, {}
    for name, path in job.fmus.items():
        with ZipFile(path) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        identifier = root.find("CoSimulation").attrib["modelIdentifier"]
        variables = root.find("ModelVariables")
        numbers[name] = {v.attrib["name"]: int(v.attrib["valueReference"]) for v in variables}
        slaves[name] = Loaded(name, path, identifier, root.attrib)
    values = dict.fromkeys((source for source, _ in job.wires), 0.0)

    def give() -> None:
        for name, slave in slaves.items():
            ports = job.outputs(name)
            read = slave.get([numbers[name][port] for port in ports])
            values.update({(name, port): value for port, value in zip(ports, read, strict=True)})

    def take() -> None:
        for name, slave in slaves.items():
            fed = [(source, port) for source, (owner, port) in job.wires if owner == name]
            if fed:
                slave.set([numbers[name][port] for _, port in fed], [values[s] for s, _ in fed])

    for _ in slaves:
        give()
        take()
    for slave in slaves.values():
        slave.fmu.exit_initialization_mode()
    give()
    rows = []
    begin = perf_counter()
    for k in range(job.steps):
        take()
        for slave in slaves.values():
            slave.fmu.do_step(k * job.step, job.step)
        give()
        rows.append([values[port] for port in job.wanted])
    return rows, perf_counter() - begin


def main() -> None:
    """Run one job, and write its rows."""
    host, job, table = sys.argv[1:]
    run: Callable[[Job], tuple[Rows, float]] = globals()[host]
    try:
        rows, seconds = run(Job(json.loads(Path(job).read_text(encoding="utf-8"))))
    except Exception as error:
        sys.exit(f"reason: {type(error).__name__}: {' '.join(str(error).split())}")
    with Path(table).open("w", encoding="utf-8", newline="") as lines:
        csv.writer(lines).writerows([[seconds], *rows])


if __name__ == "__main__":
    main()
