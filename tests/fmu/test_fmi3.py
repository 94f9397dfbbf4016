"""The FMUs of FMI 3.0: in fmpy's importer, called from C, and beside the FMUs in Python."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
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

from orchestrator.runs.own_components import build_own
from support.fmi3 import Fmi3Library, Logger
from support.raw import Host, Status, initialised, instance
from support.settings import EACH, NAMES
from support.status_table import fmi3_rows, names_in_fmi3

H = 0.02

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


@pytest.fixture(scope="module")
def plant(unpacked: Path) -> Fmi3Library:
    return Fmi3Library(unpacked / "AuvPlant")


# In fmpy


@pytest.mark.parametrize("name", EACH)
def test_fmpy_gets_the_rows_of_the_python_kind(dist: Path, dist3: Path, name: str):
    ours, theirs = (
        fmpy.simulate_fmu(str(folder / f"{name}.fmu"), stop_time=5.0, output_interval=H)
        for folder in (dist, dist3)
    )
    assert len(ours) == 251
    assert ours.dtype == theirs.dtype
    assert np.array_equal(ours, theirs)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
def test_sources_give_the_same_rows(dist3: Path, tmp_path: Path):
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


# docs/reference/fmi-answers.md


def call(host: Host, function: str, *arguments: Any) -> Status:
    """A call by its name in FMI 3.0."""
    return Status(getattr(host.library.own, function)(c_void_p(host.component), *arguments))


def numbers(function: str, n: int, name: str = "") -> Callable[[Host], Status]:
    """Get or set Float64 or Int32: one reference, of a variable or 1, and so many values."""

    def numbers_of(host: Host) -> Status:
        reference = host.description.find(name).reference if name else 1
        references, values = (c_uint * 1)(reference), (c_double * 2)()
        return call(host, function, references, c_size_t(1), values, c_size_t(n))

    return numbers_of


def entered(host: Host, start: float, has_stop: bool = False, stop: float = 0.0) -> Status:
    tolerance = (c_bool(False), c_double(0.0))
    ends = (c_double(start), c_bool(has_stop), c_double(stop))
    return call(host, "fmi3EnterInitializationMode", *tolerance, *ends)


def answer(host: Host, status: Status) -> str:
    """The answer to a call, from its status, the messages and the next step."""
    statuses = [message.status for message in host.messages]
    assert not host.fault()
    assert statuses == ([] if status == Status.OK else [Status.Error])
    next_step = host.step(0.0, H)
    if status == Status.OK:
        assert next_step == Status.OK
        return "OK"
    assert status == Status.Error
    return "error" if next_step == Status.Error else "refused"


#: The calls of the second table, on an instance that can step.
CALLS: dict[tuple[str, str], Callable[[Host], Status]] = {
    ("fmi3GetFloat64", "the time"): numbers("fmi3GetFloat64", 1, "time"),
    ("fmi3SetFloat64", "the time"): numbers("fmi3SetFloat64", 1, "time"),
    ("fmi3GetFloat64", "more values than references"): numbers("fmi3GetFloat64", 2),
    ("fmi3SetInt32", "fewer values than references"): numbers("fmi3SetInt32", 0),
    **{
        (function, "n = 0, with NULL"): lambda host, function=function: call(
            host, function, *[None] * 8
        )
        for function in ("fmi3GetDirectionalDerivative", "fmi3GetAdjointDerivative")
    },
    ("fmi3DoStep", "NULL for an output argument"): lambda host: call(
        host, "fmi3DoStep", c_double(0.0), c_double(H), c_bool(True), None, None, None, None
    ),
}

#: Arguments of FMI 3.0 between the first ones of an instance and its logger, and after it.
CREATIONS = {
    ("fmi3InstantiateCoSimulation", case): (
        (c_bool(event_mode), c_bool(True), (c_uint * 1)(1), c_size_t(1), None), (None,)
    )
    for case, event_mode in (
        ("eventModeUsed", True),
        ("earlyReturnAllowed and variables for intermediate updates", False),
    )
} | {
    ("fmi3InstantiateModelExchange", "a component with rates"): ((None,), ()),
    ("fmi3InstantiateScheduledExecution", "anything"): ((None,), (None, None, None)),
}  # fmt: skip

#: Start, whether there is a stop, and which.
EXPERIMENTS = {
    ("fmi3EnterInitializationMode", case): experiments
    for case, experiments in (
        ("start NaN or infinite", [(inf, False, 0.0), (nan, False, 0.0)]),
        ("stop NaN or not after start", [(0.0, True, nan), (1.0, True, 0.0)]),
    )
}


@pytest.mark.parametrize("key", CALLS, ids=": ".join)
def test_own_call(plant: Fmi3Library, key: tuple[str, str]):
    with initialised(plant) as host:
        assert answer(host, CALLS[key](host)) == fmi3_rows()[key]


@pytest.mark.parametrize("key", CREATIONS, ids=": ".join)
def test_own_creation(plant: Fmi3Library, key: tuple[str, str]):
    statuses = []
    logger = Logger(lambda environment, status, category, text: statuses.append(status))
    token = plant.description.guid.encode()
    before, after = CREATIONS[key]
    made = getattr(plant.own, key[0])(
        b"own", token, None, c_bool(False), c_bool(True), *before, logger, *after
    )
    assert statuses == ([] if made else [Status.Error])
    plant.own.fmi3FreeInstance(c_void_p(made))
    assert fmi3_rows()[key] == ("instance" if made else "NULL")


@pytest.mark.parametrize("key", EXPERIMENTS, ids=": ".join)
def test_own_experiment(plant: Fmi3Library, key: tuple[str, str]):
    """The answer is as in the table, and so is the run after it."""
    for start, has_stop, stop in EXPERIMENTS[key]:
        with instance(plant) as host:
            status = entered(host, start, has_stop, stop)
            assert not host.fault()
            if fmi3_rows()[key] == "OK":
                assert host.messages == []
                assert status == host.exit() == host.step(start, H) == Status.OK
            else:
                assert status == host.exit() == Status.Error
                assert [message.status for message in host.messages] == [Status.Error]
                assert host.call("fmi2Reset") == entered(host, 0.5) == host.exit() == Status.OK


def test_every_row_is_tried():
    tried = {*CALLS, *CREATIONS, *EXPERIMENTS}
    assert tried == {key for key in fmi3_rows() if key[0].startswith("fmi3")}


@pytest.mark.parametrize("action", ["Get", "Set"])
@pytest.mark.parametrize("kind", OTHER_TYPES)
@pytest.mark.parametrize("case", sorted({case for what, case in fmi3_rows() if OTHER in what}))
def test_other_types(plant: Fmi3Library, kind: str, action: str, case: str):
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
    with initialised(plant) as host:
        status = call(host, f"fmi3{action}{kind}", *arguments)
        assert answer(host, status) == expected
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
    with initialised(plant) as host:
        before = host.content()
        # As many NULLs as any of these functions has arguments.
        status = call(host, function, *[None] * 8)
        assert host.content() == before
        assert answer(host, status) == fmi3_rows()["all other functions", "anything"]


def test_version(plant: Fmi3Library):
    assert plant.own.fmi3GetVersion() == b"3.0"


@pytest.mark.parametrize("target", ["NULL", "freed", "something else"])
def test_pointers_to_other_things_are_not_taken_for_instances(plant: Fmi3Library, target: str):
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


# Parts of FMI 3.0 that FMI 2.0 lacks


def test_time_is_a_variable(plant: Fmi3Library):

    def now(host: Host) -> float:
        value = c_double()
        reference = byref(c_uint(plant.description.find("time").reference))
        count = c_size_t(1)
        assert call(host, "fmi3GetFloat64", reference, count, byref(value), count) == Status.OK
        return value.value

    with instance(plant) as host:
        assert now(host) == 0.0
        assert entered(host, 3.0) == Status.OK
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
    """The restart of the observer is a warning; errors are logged in any case."""
    controller = Fmi3Library(unpacked / "ObserverController")
    measured = controller.description.find("y.x").reference
    warning, discard, error = Status.Warning, Status.Discard, Status.Error

    def choose(host: Host, on: bool, *names: bytes) -> None:
        array = (ctypes.c_char_p * len(names))(*names) if names else None
        n = c_size_t(len(names))
        assert call(host, "fmi3SetDebugLogging", c_bool(on), n, array) == Status.OK

    def statuses_of(host: Host) -> list[Status]:
        assert host.call("fmi2Reset") == host.setup() == host.enter() == host.exit() == Status.OK
        host.messages.clear()
        host.set("Real", [measured], [5.0])
        assert host.step(0.0, H) == Status.OK
        assert host.set("Real", [measured], [nan]) == Status.Discard
        assert host.get("Real", [1000])[0] == Status.Error
        return [message.status for message in host.messages]

    with instance(controller) as host:
        assert statuses_of(host) == [warning, discard, error]
        choose(host, False, b"logStatusWarning")
        assert statuses_of(host) == [discard, error]
        choose(host, True, b"logStatusDiscard")
        assert statuses_of(host) == [discard, error]
        choose(host, True, b"logStatusWarning")
        assert statuses_of(host) == [warning, discard, error]
        choose(host, False)
        assert statuses_of(host) == [error]
        choose(host, True)
        assert statuses_of(host) == [warning, discard, error]


def test_messages_are_neither_formats_nor_names_of_variables(plant: Fmi3Library):
    host = Host(plant)
    assert not host.instantiate(guid=b"50%#1#")
    [message] = host.messages
    assert "token 50%##1## does not match" in message.text


# Arrays

STATE_SPACE = Path(__file__).parents[2] / "examples/state_space/state_space.py"


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A component with scalars, and with arrays."""
    files = []
    for arrays in (False, True):
        folder = tmp_path_factory.mktemp("arrays" if arrays else "scalars")
        files.append(str(build_own(STATE_SPACE, folder, kind="native", fmi="3", arrays=arrays)))
    return files


def test_vectors_and_matrices_may_be_arrays(both):
    assert validate_fmu(both[1]) == []
    variables = {v.name: v for v in fmpy.read_model_description(both[1]).modelVariables}
    sizes = {name: [int(d.start) for d in v.dimensions] for name, v in variables.items()}
    assert {name: size for name, size in sizes.items() if size} == {
        "u": [3], "y": [3], "A": [3, 3], "B": [3, 3], "C": [3, 3], "D": [3, 3], "x0": [3],
    }  # fmt: skip


def test_arrays_hold_what_scalars_do(both):
    numbers = np.arange(9.0) / 8 - 0.5
    places = [f"[{i},{k}]" for i in (1, 2, 3) for k in (1, 2, 3)]
    starts = (
        {**{f"A{at}": n for at, n in zip(places, numbers, strict=True)}, "u[2]": -4.0},
        {"A": [*numbers], "u": [1.0, -4.0, 3.0]},
    )
    scalars, arrays = (
        fmpy.simulate_fmu(file, stop_time=1.0, output_interval=0.1, start_values=given)
        for file, given in zip(both, starts, strict=True)
    )
    assert np.abs(arrays["y"]).max() > 1.0
    for i in range(3):
        np.testing.assert_array_equal(arrays["y"][:, i], scalars[f"y[{i + 1}]"])


def test_an_array_is_passed_as_a_whole_only(both, tmp_path):
    fmpy.extract(both[1], unzipdir=tmp_path)
    description = fmpy.read_model_description(both[1])
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=str(tmp_path),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    [u] = [v.valueReference for v in description.modelVariables if v.name == "u"]
    fmu.setFloat64([u], [5.0, 6.0, 7.0])
    assert fmu.getFloat64([u], nValues=3) == [5.0, 6.0, 7.0]
    with pytest.raises(fmpy.fmi1.FMICallException, match="status 3"):
        fmu.setFloat64([u], [8.0])
    fmu.freeInstance()
