"""Tools that are installed beside this program, each run in a separate process.

`python -m orchestrator.exchange.hosts.here TOOL FOLDER` does it: some leave threads running or end
the process when something is wrong.
"""

from __future__ import annotations

import ctypes
import importlib
import pickle
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from fmpy.ssp.simulation import simulate_ssp

from orchestrator.cosim import Experiment, System, write_osp, write_ssp
from orchestrator.exchange.hosts.drivers import write_rows
from orchestrator.machine.errors import InputError

#: In the folder: what is run, and where files for the tool go.
GIVEN, _EXPORT = "given", "export"

#: The name of parameter sets that ecos is told to apply.
_PARAMETER_SET = "scenario"

#: In the folder: what came of it.
ROWS = "rows.csv"

#: What both versions of FMI call a floating-point number.
_NUMBERS = ("Real", "Float64")


class Ran(NamedTuple):
    """A run in a host.

    Attributes:
        rows: of all Real outputs, one a step.
        seconds: that the steps have taken.
        reading: what it took to read the rows, where the tool does not record them itself.

    """

    rows: np.ndarray
    seconds: float
    reading: float = 0.0


def real_outputs(system: System) -> list[tuple[str, str, int]]:
    """Component, port and value reference of every Real output."""
    return [
        (component.name, variable.name, variable.reference)
        for component in system.components.values()
        for variable in component.having("output")
        if variable.type in _NUMBERS
    ]


def fmi_of(system: System) -> str:
    """The newest version of FMI that FMUs of a system have."""
    return max(str(one.description.fmiVersion) for one in system.components.values())


def check_parameters(system: System, host: str) -> None:
    """Check that parameters are what they are in the FMUs, for hosts that apply none.

    Raises:
        InputError: one is not.

    """
    for name, value in system.changed().items():
        raise InputError(f"{host} cannot set parameters, and the system has {name} = {value}")


def check_choices(system: System, host: str) -> None:
    """The same for hosts that leave Enumerations as they are."""
    for name, value in system.changed("Enumeration").items():
        raise InputError(f"{host} cannot set choices, and the system has {name} = {value}")


def _names(system: System, between: str = ".") -> list[str]:
    """Names of all Real outputs, as tools write them."""
    return [f"{component}{between}{port}" for component, port, _ in real_outputs(system)]


def _stepped(
    step: Callable[[], object], read: Callable[[], list[float]], experiment: Experiment
) -> Ran:
    """Step a tool that is read after each step."""
    rows, seconds, reading = [], 0.0, 0.0
    for _ in range(experiment.rows - 1):
        start = perf_counter()
        step()
        stepped = perf_counter()
        rows.append(read())
        seconds += stepped - start
        reading += perf_counter() - stepped
    return Ran(np.array(rows), seconds, reading)


def _libcosim(system: System, experiment: Experiment, opener: str, **path: str) -> Ran:
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    log_output_level(CosimLogLevel.ERROR)
    execution = getattr(CosimExecution, opener)(**path)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    references: dict[str, list[int]] = {}
    for component, _, reference in real_outputs(system):
        references.setdefault(component, []).append(reference)
    index = {name: execution.slave_index_from_instance_name(name) for name in references}

    def one() -> None:
        if not execution.step():
            raise InputError("libcosim ended the run")

    def read() -> list[float]:
        return [
            value
            for name, wanted in references.items()
            for value in observer.last_real_values(index[name], wanted)
        ]

    return _stepped(one, read, experiment)


def libcosim_ssp(system: System, experiment: Experiment, folder: Path) -> Ran:
    check_choices(system, "libcosim")
    # Of an SSP it reads the components of the outermost system only, as does ecos.
    system = system.flattened()
    [path] = write_ssp(system, folder, flat=True)
    return _libcosim(system, experiment, "from_ssp_file", ssp_path=str(path))


def libcosim_osp(system: System, experiment: Experiment, folder: Path) -> Ran:
    write_osp(system, folder)
    return _libcosim(system, experiment, "from_osp_config_file", osp_path=str(folder))


def ecos(system: System, experiment: Experiment, folder: Path) -> Ran:
    if experiment.start_time != 0.0:
        # It tells the FMUs a start time, and then steps them from 0 s.
        raise InputError(f"ecos can start at 0 s only, not at {experiment.start_time:g} s")
    check_choices(system, "ecos")
    # ecospy needs libtbb, which the wheel tbb puts where the loader does not look.
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    ecospy = importlib.import_module("ecospy")
    system = system.flattened()
    names = _names(system, "::")
    parameter_set = {"parameter_set": _PARAMETER_SET} if system.parameters else {}
    with _ecos_simulation(ecospy, system, experiment, folder) as simulation:
        simulation.init(**parameter_set)
        return _stepped(simulation.step, lambda: [*map(simulation.get_real, names)], experiment)


def _ecos_simulation(ecospy: Any, system: System, experiment: Experiment, folder: Path) -> Any:
    """A simulation of ecos: it reads no SSP 2.0, so with FMI 3.0 its calls say what is in one."""
    if fmi_of(system) == "2.0":
        # It makes one instance of a file, whatever refers to it.
        [path] = write_ssp(system, folder, flat=True, parameter_set=_PARAMETER_SET)
        return ecospy.EcosSimulation(experiment.step, ssp_path=str(path))
    structure = ecospy.EcosSimulationStructure()
    for name, component in system.components.items():
        structure.add_model(name, shutil.copyfile(component.fmu, folder / f"{name}.fmu"))
    for wire in system.connections:
        source, target = (f"{end.component}::{end.port}" for end in (wire.source, wire.target))
        structure.make_real_connection(source, target)
    values = {f"{name.component}::{name.port}": x for name, x in system.parameters.items()}
    structure.add_parameter_set(_PARAMETER_SET, values)
    return ecospy.EcosSimulation(experiment.step, structure=structure)


def fmpy_ssp(system: System, experiment: Experiment, folder: Path) -> Ran:
    check_parameters(system, "fmpy.ssp")
    [path] = write_ssp(system, folder)
    start_time, step = experiment.start_time, experiment.step
    start = perf_counter()
    # It accumulates its time, so the last step may be there or not: ask for half a step more.
    table = simulate_ssp(str(path), start_time, experiment.stop_time + 0.5 * step, step)
    seconds = perf_counter() - start
    # Its row at a time has the outputs of the step that begins there.
    rows = np.column_stack([table[name] for name in _names(system)])
    return Ran(rows[: experiment.rows - 1], seconds)


if __name__ == "__main__":
    run: Callable[[System, Experiment, Path], Ran] = globals()[sys.argv[1]]
    folder = Path(sys.argv[2])
    (folder / _EXPORT).mkdir()
    system, experiment = pickle.loads((folder / GIVEN).read_bytes())
    try:
        ran = run(system, experiment, folder / _EXPORT)
    except InputError as error:
        sys.exit(str(error))
    write_rows(folder / ROWS, ran.rows.tolist(), ran.seconds, ran.reading)
