"""The FMUs of FMI 3.0: in fmpy's importer, called from C, and beside the FMUs in Python."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from ctypes import CDLL, addressof, byref, c_bool, c_double, c_size_t, c_uint, c_void_p
from math import inf, nan
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from orchestrator.master.experiment import Experiment
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.structure import System
from support.cells import has_call
from support.fmi3 import Fmi3Library, Logger, trials
from support.kinds import outcome
from support.raw import Host, Status, instance
from support.settings import NAMES, REPRESENTATIVES
from support.status_table import creations, fmi3_rows, names_in_fmi3, rows
from support.trials import CREATIONS
from support.worker import Lost, Worker

H = 0.02

#: Longest time for a trial, on a slow machine [s].
PATIENCE = 60.0

FUNCTIONS = re.findall(
    r"FMI3_Export fmi3\w+TYPE +(\w+);",
    (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(),
)

NUMERIC = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64")
OTHER = "other types"
OTHER_TYPES = (*NUMERIC, "Binary", "Clock")


@pytest.fixture(scope="module")
def unpacked(dist3: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked FMUs, each under its name."""
    folder = tmp_path_factory.mktemp("unpacked")
    for name in NAMES:
        fmpy.extract(dist3 / f"{name}.fmu", unzipdir=folder / name)
    return folder


@pytest.fixture(scope="module", params=NAMES)
def library(request: pytest.FixtureRequest, unpacked: Path) -> Fmi3Library:
    return Fmi3Library(unpacked / request.param)


@pytest.fixture(scope="module")
def plant(unpacked: Path) -> Fmi3Library:
    return Fmi3Library(unpacked / "AuvPlant")


# In fmpy


@pytest.mark.parametrize("name", NAMES)
def test_fmu_is_valid(dist3: Path, name: str):
    assert validate_fmu(str(dist3 / f"{name}.fmu")) == []


@pytest.mark.parametrize("name", NAMES)
def test_alone_it_does_what_the_python_kind_does(dist: Path, dist3: Path, name: str):
    ours, theirs = (
        fmpy.simulate_fmu(str(folder / f"{name}.fmu"), stop_time=5.0, output_interval=H)
        for folder in (dist, dist3)
    )
    assert len(ours) == 251
    assert ours.dtype.names == theirs.dtype.names
    for column in ours.dtype.names:
        assert np.array_equal(ours[column], theirs[column]), column


class Loop:
    """A system of FMUs of FMI 3.0, stepped by the simplest of masters."""

    def __init__(self, system: System, folder: Path) -> None:
        self.connections = system.connections
        self.values: dict[tuple[str, str], float] = {}
        self.slaves, self.groups = {}, {}
        for name, component in system.components.items():
            path = folder / component.fmu.stem
            description = fmpy.read_model_description(str(path))
            self.slaves[name] = FMU3Slave(
                instanceName=name,
                guid=description.guid,
                unzipDirectory=str(path),
                modelIdentifier=description.coSimulation.modelIdentifier,
            )
            self.groups[name] = {
                causality: [
                    v
                    for v in description.modelVariables
                    if v.causality == causality and v.type == "Float64"
                ]
                for causality in ("input", "output")
            }
            self.slaves[name].instantiate()
            self.slaves[name].enterInitializationMode(startTime=0.0)
            self.values |= {(name, v.name): 0.0 for v in self.groups[name]["input"]}

    def give(self) -> None:
        """All inputs from the outputs that there are."""
        for wire in self.connections:
            value = self.values[wire.source.component, wire.source.port]
            self.values[wire.target.component, wire.target.port] = value
        for name, slave in self.slaves.items():
            inputs = self.groups[name]["input"]
            if inputs:
                values = [self.values[name, v.name] for v in inputs]
                slave.setFloat64([v.valueReference for v in inputs], values)

    def take(self) -> None:
        for name, slave in self.slaves.items():
            outputs = self.groups[name]["output"]
            got = slave.getFloat64([v.valueReference for v in outputs])
            self.values |= {(name, v.name): value for v, value in zip(outputs, got, strict=True)}

    def run(self, n: int) -> list[dict[str, float]]:
        """Outputs after each of n steps, with the inputs that led there."""
        rows = []
        # As many exchanges as there are components: nothing depends on more than all others.
        for _ in self.slaves:
            self.take()
            self.give()
        for slave in self.slaves.values():
            slave.exitInitializationMode()
        for k in range(n + 1):
            rows.append({f"{name}.{port}": value for (name, port), value in self.values.items()})
            self.give()
            for slave in self.slaves.values():
                slave.doStep(k * H, H)
            self.take()
        return rows


def test_loop_of_fig4_is_that_of_the_python_kind(dist: Path, unpacked: Path):
    ours = outcome(dist, "fig4", {}, Experiment(100.0, H, "jacobi"))
    loop = Loop(closed_loop(dist, read_scenario("fig4")), unpacked)
    rows = loop.run(5000)
    outputs = [i for i, c in enumerate(ours.columns, start=1) if not c.endswith("fault")]
    theirs = np.array([[row[ours.columns[i - 1]] for i in outputs] for row in rows])
    assert len(theirs) == 5001
    assert np.array_equal(ours.rows[:, outputs], theirs)


@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
def test_sources_alone_give_the_same_rows(dist3: Path, tmp_path: Path):
    fmpy.extract(dist3 / "AuvPlant.fmu", unzipdir=tmp_path / "fmu")
    shutil.rmtree(tmp_path / "fmu" / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(tmp_path / "fmu", tmp_path / "build")
    ours, theirs = (
        fmpy.simulate_fmu(str(path), stop_time=5.0, output_interval=H)
        for path in (dist3 / "AuvPlant.fmu", tmp_path / "fmu")
    )
    assert np.array_equal(ours, theirs)


# The library


def symbols(path: Path) -> set[str]:
    """The functions that a library offers."""
    command = ["nm", "-D", "--defined-only", str(path)]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return {line.split()[-1] for line in lines}


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm is not installed")
def test_library_offers_the_functions_of_the_standard_and_nothing_else(unpacked: Path):
    [path] = (unpacked / "AuvPlant" / "binaries").rglob("AuvPlant*")
    assert symbols(path) == set(FUNCTIONS)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_functions_have_a_prefix_where_it_is_asked_for(unpacked: Path, tmp_path: Path):
    library = tmp_path / "prefixed.so"
    command = ["gcc", "-std=c99", "-shared", "-fPIC", "-DFMI3_FUNCTION_PREFIX=AuvPlant_"]
    sources = unpacked / "AuvPlant" / "sources"
    subprocess.run([*command, "-o", library, sources / "fmi3.c", "-lm"], check=True)
    prefixed = CDLL(str(library))
    assert all(hasattr(prefixed, f"AuvPlant_{name}") for name in FUNCTIONS)


# docs/status.md


SHARED = {
    f"{row} - {state}": (key, state)
    for key, row in rows().items()
    if key[0] in names_in_fmi3()
    for state in row.cells
}


@pytest.fixture(scope="module")
def workers(unpacked: Path) -> Iterator[dict[str, Worker[Any, str]]]:
    """Processes that try cells, one for each component, started when they are needed."""
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(Worker(trials, unpacked / name, unpacked / NAMES[i - 1]))
            for i, name in enumerate(NAMES)
        }


@pytest.mark.parametrize(
    ("name", "cell"),
    [(name, c) for name in REPRESENTATIVES for c in SHARED if has_call(name, SHARED[c][0])],
)
def test_cell_of_both_versions(workers: dict[str, Worker[Any, str]], name: str, cell: str):
    wrong = workers[name].ask(SHARED[cell], PATIENCE)
    assert not isinstance(wrong, Lost), f"the process is lost: {wrong.why}"
    assert wrong == ""


@pytest.mark.parametrize(
    "case", [case for case in creations() if case in CREATIONS and "resource" not in case]
)
def test_creation(plant: Fmi3Library, case: str):
    host = Host(plant)
    assert host.instantiate(**CREATIONS[case]) == creations()[case]
    if not creations()[case]:
        assert len(host.messages) == 1
    host.free()


def test_token_may_be_in_capitals_and_without_braces(plant: Fmi3Library):
    stated = plant.description.guid.encode()
    for token in (stated.upper(), stated.strip(b"{}").upper(), None, b""):
        with instance(plant, guid=token) as host:
            assert host.messages == []


def test_what_is_refused_is_told_with_logging_off(plant: Fmi3Library):
    """Each in its call, and answered again where it is not told again."""
    force, mass, place = (plant.description.find(n).reference for n in ("tau.u", "m11", "eta.x"))
    for status, call in (
        (Status.Discard, lambda host: host.set("Real", [force], [nan])),
        (Status.Discard, lambda host: host.set("Real", [force, mass], [1.0, 77.0])),
        (Status.Discard, lambda host: host.set("Real", [place], [1.0])),
        (Status.Discard, lambda host: host.step(0.0, -1.0)),
        (Status.Error, lambda host: host.get("Real", [0])[0]),
        (Status.Error, lambda host: host.get("Boolean", [force])[0]),
        (Status.Error, lambda host: host.set("Real", [0], [1.0])),
        (Status.Error, lambda host: host.exit()),
    ):
        with instance(plant, logging=False) as host:
            assert host.setup() == host.enter() == host.exit() == Status.OK
            assert host.messages == []
            assert [call(host), call(host)] == [status] * 2
            assert [message.status for message in host.messages] == [status]
            assert host.fault() is (status == Status.Discard)
            assert host.get("Real", [force]) == (Status.OK, [0.0])


def test_references_begin_at_one(library: Fmi3Library):
    """In the order of the variables: some hosts take them for indices."""
    references = [variable.reference for variable in library.description.variables]
    assert references == [*range(1, len(references) + 1)]


class Own:
    """What is tried of the second table: each gives the answer."""

    def __init__(self, library: Fmi3Library) -> None:
        self.library = library
        self.time = library.description.find("time").reference

    def of(self, function: str, case: str) -> str:
        if function.startswith("fmi3Instantiate"):
            return self.creation(function, event_mode=case == "eventModeUsed")
        if function == "fmi3EnterInitializationMode":
            return self.experiment(case)
        with self.stepping() as host:
            if "the time" in case:
                return self.answer(host, self.numbers(host, function, [self.time], 1))
            if "than references" in case:
                n = 2 if "more" in case else 0
                return self.answer(host, self.numbers(host, function, [1], n))
            assert (function, case) == ("fmi3DoStep", "NULL for what is told")
            step = (c_double(0.0), c_double(H), c_bool(True))
            status = self.call(host, function, *step, None, None, None, None)
            return self.answer(host, status)

    @contextmanager
    def stepping(self) -> Iterator[Host]:
        with instance(self.library) as host:
            assert host.setup() == host.enter() == host.exit() == Status.OK
            host.messages.clear()
            yield host

    def call(self, host: Host, function: str, *arguments: Any) -> Status:
        return Status(getattr(self.library.own, function)(c_void_p(host.component), *arguments))

    def numbers(self, host: Host, function: str, references: list[int], n: int) -> Status:
        """Get or set Float64 or Int32."""
        array = (c_uint * len(references))(*references)
        values = (c_double * 2)()
        return self.call(host, function, array, c_size_t(len(references)), values, c_size_t(n))

    def answer(self, host: Host, status: Status) -> str:
        """What a call was answered with, from all that can be seen of it."""
        said = [message.status for message in host.messages]
        assert not host.fault()
        assert said == ([] if status == Status.OK else [Status.Error])
        next_step = host.step(0.0, H)
        if status == Status.OK:
            assert next_step == Status.OK
            return "OK"
        assert status == Status.Error
        return "error" if next_step == Status.Error else "refused"

    def creation(self, function: str, event_mode: bool) -> str:
        said = []
        logger = Logger(lambda environment, status, category, text: said.append(status))
        before = (b"own", self.library.description.guid.encode(), None, c_bool(False), c_bool(True))
        after: tuple[Any, ...] = (None, logger)
        if function == "fmi3InstantiateCoSimulation":
            wanted = (c_uint * 1)(1)
            after = (c_bool(event_mode), c_bool(True), wanted, c_size_t(1), *after, None)
        elif function == "fmi3InstantiateScheduledExecution":
            after = (*after, None, None, None)
        made = getattr(self.library.own, function)(*before, *after)
        assert said == ([] if made else [Status.Error])
        self.library.own.fmi3FreeInstance(c_void_p(made))
        return "instance" if made else "NULL"

    def experiment(self, case: str) -> str:
        """What an experiment is answered with, and whether it is what the FMU goes on with."""
        experiments = {
            "start NaN or infinite": [(inf, False, 0.0), (nan, False, 0.0)],
            "stop NaN or before start": [(0.0, True, nan), (1.0, True, 0.0)],
        }[case]
        answers = {self.answer_to_experiment(*experiment) for experiment in experiments}
        [answer] = answers
        return answer

    def answer_to_experiment(self, start: float, has_stop: bool, stop: float) -> str:
        with instance(self.library) as host:
            status = self.enter(host, start, has_stop, stop)
            assert not host.fault()
            if status == Status.OK:
                assert host.messages == []
                assert host.exit() == host.step(start, H) == Status.OK
                return "OK"
            assert status == host.exit() == Status.Error
            assert [message.status for message in host.messages] == [Status.Error]
            assert host.call("fmi2Reset") == self.enter(host, 0.5) == host.exit() == Status.OK
            return "error"

    def enter(self, host: Host, start: float, has_stop: bool = False, stop: float = 0.0) -> Status:
        tolerance = (c_bool(False), c_double(0.0))
        ends = (c_double(start), c_bool(has_stop), c_double(stop))
        return self.call(host, "fmi3EnterInitializationMode", *tolerance, *ends)


@pytest.mark.parametrize(
    "key", [key for key in fmi3_rows() if key[0].startswith("fmi3")], ids=": ".join
)
def test_own_cell(plant: Fmi3Library, key: tuple[str, str]):
    assert Own(plant).of(*key) == fmi3_rows()[key]


@pytest.mark.parametrize("action", ["Get", "Set"])
@pytest.mark.parametrize("kind", OTHER_TYPES)
@pytest.mark.parametrize("case", sorted({case for what, case in fmi3_rows() if OTHER in what}))
def test_other_types(plant: Fmi3Library, kind: str, action: str, case: str):
    own = Own(plant)
    rows = (f"{action} of {OTHER}", f"Get and Set of {OTHER}")
    [expected] = [fmi3_rows()[row, case] for row in rows if (row, case) in fmi3_rows()]
    n = 0 if case.startswith("n = 0") else 1
    references, values, sizes = (c_uint * 1)(1), (c_double * 2)(1.0, 1.0), (c_size_t * 1)(7)
    arguments = [
        None if n == 0 or "references NULL" in case else references,
        c_size_t(n),
        *([sizes] if kind == "Binary" else ()),
        None if n == 0 or "values NULL" in case else values,
        *([] if kind == "Clock" else [c_size_t(n)]),
    ]
    with own.stepping() as host:
        status = own.call(host, f"fmi3{action}{kind}", *arguments)
        assert own.answer(host, status) == expected
    if action == "Get" and expected == "refused":
        # Nothing but the value has changed.
        size = {"Binary": 8, "Clock": 1}.get(kind) or ctypes.sizeof(
            getattr(fmpy.fmi3, f"fmi3{kind}")
        )
        content = bytes(values)
        assert content[:size] == bytes(size)
        assert content[size:] == bytes((c_double * 2)(1.0, 1.0))[size:]
        assert sizes[0] == (0 if kind == "Binary" else 7)


SUPPORTED = {
    *names_in_fmi3().values(),
    *(function for function, _ in fmi3_rows()),
    "fmi3GetVersion",
}
UNSUPPORTED = [
    name
    for name in FUNCTIONS
    if name not in SUPPORTED and not re.fullmatch(f"fmi3[GS]et({'|'.join(OTHER_TYPES)})", name)
]


@pytest.mark.parametrize("function", UNSUPPORTED)
def test_what_is_not_supported(plant: Fmi3Library, function: str):
    own = Own(plant)
    with own.stepping() as host:
        before = host.content()
        # As many NULLs as any of these functions has arguments.
        status = own.call(host, function, *[None] * 8)
        assert host.content() == before
        assert own.answer(host, status) == fmi3_rows()["all other functions", "anything"]


def test_version(plant: Fmi3Library):
    assert plant.own.fmi3GetVersion() == b"3.0"


@pytest.mark.parametrize("target", ["NULL", "freed", "something else"])
def test_what_is_no_instance_is_told_from_what_is(plant: Fmi3Library, target: str):
    memory = (c_double * 64)()
    with instance(plant) as gone:
        handle = {"NULL": None, "freed": gone.component, "something else": addressof(memory)}[
            target
        ]
    with instance(plant) as witness:
        before = witness.content()
        for function in FUNCTIONS:
            if function.startswith("fmi3Instantiate") or function == "fmi3GetVersion":
                continue
            status = getattr(plant.own, function)(c_void_p(handle), *[None] * 9)
            if function != "fmi3FreeInstance":
                assert status == Status.Error, function
        assert bytes(memory) == bytes(len(memory) * 8)
        assert witness.content() == before


# What FMI 3.0 has and FMI 2.0 has not


def test_time_is_a_variable(plant: Fmi3Library):
    own = Own(plant)

    def now(host: Host) -> float:
        value = c_double()
        reference = byref(c_uint(own.time))
        one = c_size_t(1)
        assert own.call(host, "fmi3GetFloat64", reference, one, byref(value), one) == Status.OK
        return value.value

    with instance(plant) as host:
        assert now(host) == 0.0
        assert own.enter(host, 3.0) == Status.OK
        assert now(host) == 3.0
        assert host.exit() == host.step(3.0, 0.5) == Status.OK
        assert now(host) == 3.5
        saved = host.get_state()
        assert host.step(3.5, 0.25) == Status.OK
        assert host.step(3.75, -1.0) == Status.Discard
        assert now(host) == 3.75
        assert host.set_state(saved) == Status.OK
        assert now(host) == 3.5
        content = host.serialised(saved)
    with instance(plant) as other:
        _, state = other.deserialised(content)
        assert other.set_state(state) == Status.OK
        assert now(other) == 3.5


def test_categories_are_turned_on_and_off_one_by_one(unpacked: Path):
    """The restart of the observer is told as a warning; what is refused is told in any case."""
    controller = Fmi3Library(unpacked / "ObserverController")
    own, measured = Own(controller), controller.description.find("y.x").reference

    def choose(host: Host, on: bool, *names: bytes) -> None:
        array = (ctypes.c_char_p * len(names))(*names) if names else None
        n = c_size_t(len(names))
        assert own.call(host, "fmi3SetDebugLogging", c_bool(on), n, array) == Status.OK

    def heard(host: Host) -> bool:
        assert host.call("fmi2Reset") == host.setup() == host.enter() == host.exit() == Status.OK
        host.messages.clear()
        host.set("Real", [measured], [5.0])
        assert host.step(0.0, H) == Status.OK
        warnings = len(host.messages)
        assert host.set("Real", [measured], [nan]) == Status.Discard
        assert host.get("Real", [1000])[0] == Status.Error
        assert [m.status for m in host.messages[warnings:]] == [Status.Discard, Status.Error]
        return bool(warnings)

    with instance(controller) as host:
        assert heard(host)
        choose(host, False, b"logStatusWarning")
        assert not heard(host)
        choose(host, True, b"logStatusDiscard")
        assert not heard(host)
        choose(host, True, b"logStatusWarning")
        assert heard(host)
        choose(host, False)
        assert not heard(host)
        choose(host, True)
        assert heard(host)


def test_messages_are_no_formats_and_name_no_variables(unpacked: Path):
    controller = Fmi3Library(unpacked / "ObserverController")
    saturation = controller.description.find("saturation")
    with instance(controller) as host:
        assert host.set("String", [saturation.reference], [b"50%#1#"]) == Status.Error
        [message] = host.messages
    assert message.text.startswith("saturation = '50%##1##':")


def test_state_continues_in_another_instance_bit_for_bit(unpacked: Path):
    """Through fmpy, as bytes."""
    path = unpacked / "AuvPlant"
    description = fmpy.read_model_description(str(path))
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output"][:-1]
    slaves = [
        FMU3Slave(
            instanceName=name,
            guid=description.guid,
            unzipDirectory=str(path),
            modelIdentifier="AuvPlant",
        )
        for name in ("one", "other")
    ]
    for slave in slaves:
        slave.instantiate()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
    one, other = slaves
    one.setFloat64([1, 2, 3], [10.0, 0.1, 0.2])
    for k in range(50):
        one.doStep(k * H, H)
    content = one.serializeFMUState(one.getFMUState())
    other.setFMUState(other.deserializeFMUState(content))
    for k in range(50, 100):
        for slave in slaves:
            slave.doStep(k * H, H)
        # With noise from the same generator.
        assert one.getFloat64(outputs) == other.getFloat64(outputs)
    for slave in slaves:
        slave.terminate()
        slave.freeInstance()
