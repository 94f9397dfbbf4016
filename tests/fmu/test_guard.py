"""What no slave can be told: wrong pointers, dead handles, text that is none, FMUs without a slave.

None of it may end the host. Each test is one class of mistakes, on one small FMU of each kind: the
guard is the loader's, or that of the FMUs in C, and the same for all.
"""

from __future__ import annotations

import ctypes
import gc
import math
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from ctypes import c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import fmpy
import pytest

from fmus.python.own import build_own
from fmus.python.packaging import loader_compiler
from support.kinds import FIXTURES
from support.raw_fmi import (
    DISCARD,
    ERROR,
    FATAL,
    MODEL_EXCHANGE,
    OF_MODEL_EXCHANGE,
    OK,
    RawFmu,
)  # fmt: skip

pytestmark = pytest.mark.skipif(loader_compiler() is None, reason="there is no C compiler")

#: A Real input and the String parameter of the controller, and what is no UTF-8.
NOT_UTF8 = [b"\xff", b"\xc0\xaf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xe2\x82", b"\x80"]


@pytest.fixture(scope="module")
def python_folder(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpacked(dist, tmp_path_factory)


@pytest.fixture(scope="module", params=FIXTURES.values(), ids=FIXTURES.keys())
def fmus(request: pytest.FixtureRequest) -> Path:
    """The FMUs of one of the kinds."""
    folder: Path = request.getfixturevalue(request.param)
    return folder


@pytest.fixture(scope="module")
def folder(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpacked(fmus, tmp_path_factory)


def unpacked(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("guarded")
    fmpy.extract(fmus / "ObserverController.fmu", unzipdir=target)
    return target


@pytest.fixture
def python_fmu(python_folder: Path) -> RawFmu:
    return RawFmu(python_folder)


@pytest.fixture
def fmu(folder: Path) -> RawFmu:
    return RawFmu(folder)


@pytest.fixture
def component(fmu: RawFmu) -> Iterator[int]:
    made = fmu.initialised()
    yield made
    fmu.FreeInstance(made)


def reference(folder: Path, name: str) -> Any:
    [found] = (
        variable.valueReference
        for variable in fmpy.read_model_description(folder).modelVariables
        if variable.name == name
    )
    return (c_uint * 1)(found)


def steps(fmu: RawFmu, component: int) -> int:
    status: int = fmu.DoStep(component, 0.0, 0.02, 1)
    return status


# Instances


@pytest.mark.parametrize(
    ("what", "arguments"),
    [
        ("has no name", {"name": None}),
        *(("name of the instance is not UTF-8", {"name": b"a" + bad}) for bad in NOT_UTF8),
        ("GUID is not UTF-8", {"guid": b"\xff"}),
        ("is not that of this FMU", {"guid": b"{00000000-0000-0000-0000-000000000000}"}),
        ("is not that of this FMU", {"guid": b"{}"}),
        ("co-simulation only", {"kind": MODEL_EXCHANGE}),
        ("co-simulation only", {"kind": 77}),
    ],
)
def test_instance_that_cannot_be_is_null_with_one_message(fmu, what, arguments):
    assert fmu.instantiate(**arguments, logging=0) is None
    [message] = fmu.messages
    assert message.text.startswith("fmi2Instantiate: ")
    assert what in message.text
    assert (message.status, message.category) == (ERROR, "logStatusError")


@pytest.mark.parametrize(
    ("what", "location"),
    [
        ("no resource location", None),
        ("not UTF-8", b"file:///tmp/%ff"),
        ("zero byte", b"file:///tmp%00/x"),
        ("%%20", b"file:///tmp/a%2520b"),
        ("No such file", b"file:///nowhere"),
        ("slavemodule.txt", b"file://"),
        ("File name too long", b"file:///" + 100_000 * b"x"),
    ],
)
def test_place_without_a_slave_is_null_with_one_message(python_fmu, what, location):
    before = list(sys.path)
    assert python_fmu.instantiate(location=location, logging=0) is None
    [message] = python_fmu.messages
    assert what in message.text
    assert (message.status, message.category) == (ERROR, "logStatusError")
    assert sys.path == before


def test_guid_is_that_of_the_description_or_not_stated(fmu: RawFmu, folder: Path):
    stated = fmpy.read_model_description(folder).guid.encode()
    bare = stated.strip(b"{}")
    for guid in (None, b"", stated, bare, stated.upper(), bare.upper(), bare.lower()):
        made = fmu.instantiate(guid=guid)
        assert made
        fmu.FreeInstance(made)
    assert fmu.messages == []
    for guid in (stated + b"x", b"x" + stated, stated[:-2]):
        assert fmu.instantiate(guid=guid) is None


@pytest.mark.parametrize(
    ("files", "what"),
    [
        ({"slavemodule.txt": None}, "slavemodule.txt"),
        ({"slavemodule.txt": b""}, "names no module"),
        ({"slavemodule.txt": b"../x"}, "names no module"),
        ({"slavemodule.txt": b"\xff\xfe\x00"}, "UnicodeDecodeError"),
        ({"slavemodule.txt": b"absent"}, "absent.py"),
        ({"slavemodule.txt": b"os", "os.py": b"x = 1"}, "another module os"),
        ({"guid.txt": None}, "guid.txt"),
        ({"{script}.py": None}, ".py"),
        ({"slavemodule.txt": b"guarded_a", "guarded_a.py": b""}, "holds no slave"),
        ({"slavemodule.txt": b"guarded_b", "guarded_b.py": b"class A: pass"}, "holds no slave"),
        ({"slavemodule.txt": b"guarded_c", "guarded_c.py": b"x = ("}, "SyntaxError"),
        ({"slavemodule.txt": b"guarded_d", "guarded_d.py": b"\xff\xfe\xfd"}, "SyntaxError"),
        ({"slavemodule.txt": b"guarded_e", "guarded_e.py": b"x = 1\0"}, "Error"),
        ({"slavemodule.txt": b"guarded_f", "guarded_f.py": b"raise SystemExit(3)"}, "SystemExit"),
        ({"slavemodule.txt": b"guarded_g", "guarded_g.py": b"import no_such"}, "no_such"),
        ({"slavemodule.txt": b"guarded_h", "guarded_h.py": b"1 / 0 # \xc3\xbc"}, "ZeroDivision"),
        ({"slavemodule.txt": b"guarded_i",
          "guarded_i.py": b"class Fmi2Slave: pass\nclass A(Fmi2Slave):\n"
                          b"    def __init__(self, **_): raise ValueError('not today')"},
         "not today"),
        ({"slavemodule.txt": b"guarded_j",
          "guarded_j.py": b"class Fmi2Slave: pass\nclass A(Fmi2Slave):\n"
                          b"    def __init__(self, **_): pass"},
         "_get_log_queue"),
    ],
)  # fmt: skip
def test_folder_without_a_slave_is_null_with_one_message(
    python_fmu, python_folder, tmp_path, files, what
):
    resources = tmp_path / "resources"
    shutil.copytree(python_folder / "resources", resources)
    script = (resources / "slavemodule.txt").read_text()
    for name, content in files.items():
        path = resources / name.format(script=script)
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content)
    before = list(sys.path)
    assert python_fmu.instantiate(location=resources.as_uri().encode(), logging=0) is None
    [message] = python_fmu.messages
    assert what in message.text
    assert message.status in (ERROR, FATAL)
    assert sys.path == before
    made = python_fmu.instantiate()
    assert made, "the sound one still works"
    python_fmu.FreeInstance(made)


@pytest.mark.parametrize(
    "name", ["slavemodule.txt", "guid.txt", "{script}.py", "__pycache__/{script}.{tag}.pyc"]
)
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_resource_that_is_no_file_is_not_waited_for(
    python_fmu, python_folder, tmp_path, name: str, kind: str
):
    """A pipe would be read from for ever, and so would the device."""
    resources = tmp_path / "resources"
    shutil.copytree(python_folder / "resources", resources)
    script = (resources / "slavemodule.txt").read_text()
    path = resources / name.format(script=script, tag=sys.implementation.cache_tag)
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    assert python_fmu.instantiate(location=resources.as_uri().encode(), logging=0) is None
    [message] = python_fmu.messages
    assert f"{path} is no regular file" in message.text or kind == "folder"


def test_library_beside_the_loader_is_found_where_the_loader_was(
    python_folder, tmp_path, monkeypatch
):
    """A host may load by a path from the current folder, and then go elsewhere."""
    libraries = "binaries/linux64"
    for name in ("ours", "theirs"):
        shutil.copytree(python_folder / libraries, tmp_path / name / libraries)
    (tmp_path / "theirs" / libraries / "ObserverController_pythonfmu.so").write_text("planted")
    monkeypatch.chdir(tmp_path / "ours")
    fmu = RawFmu(Path())
    monkeypatch.chdir(tmp_path / "theirs")
    made = fmu.instantiate(location=(python_folder / "resources").as_uri().encode())
    assert made, fmu.messages
    fmu.FreeInstance(made)


@pytest.mark.parametrize("logger", [False, True])
def test_host_without_a_logger_is_survived(fmu: RawFmu, capfd, logger: bool):
    nothing = (c_void_p * 5)() if logger else None
    made = fmu.instantiate(callbacks=nothing)
    assert fmu.SetReal(made, None, 1, None) == ERROR
    fmu.FreeInstance(made)
    assert "raw: logStatusError: fmi2SetReal: no array" in capfd.readouterr().err


# Arguments

ONE = (c_uint * 1)(0)
REALS, INTEGERS = (c_double * 2)(), (c_int * 2)()
STRINGS = (c_char_p * 1)(b"tanh")
TOO_MANY = 2**31

#: Function, arguments that cannot be forwarded.
WRONG = [
    *(
        (f"{verb}{kind}", arguments)
        for kind, values in (("Real", REALS), ("Integer", INTEGERS), ("Boolean", INTEGERS),
                             ("String", STRINGS))
        for verb in ("Get", "Set")
        for arguments in ((None, 1, values), (ONE, 1, None), (None, 1, None),
                          (ONE, TOO_MANY, values), (ONE, 2**64 - 1, values))
    ),
    ("SetString", (ONE, 1, (c_char_p * 1)())),
    *(("SetString", (ONE, 1, (c_char_p * 1)(bad))) for bad in NOT_UTF8),
    ("SetDebugLogging", (1, 1, None)),
    ("SetDebugLogging", (1, 1, (c_char_p * 1)())),
    ("SetDebugLogging", (1, 1, (c_char_p * 1)(b"\xff"))),
    ("SetDebugLogging", (1, TOO_MANY, STRINGS)),
    ("GetFMUstate", (None,)),
    ("GetFMUstate", (c_void_p(4711),)),
    ("SetFMUstate", (None,)),
    ("SetFMUstate", (4711,)),
    ("FreeFMUstate", (None,)),
    ("FreeFMUstate", (c_void_p(4711),)),
    ("SerializedFMUstateSize", (None, c_size_t())),
    ("SerializedFMUstateSize", (4711, c_size_t())),
    ("SerializedFMUstateSize", (None, None)),
    ("SerializeFMUstate", (None, b"", 0)),
    ("SerializeFMUstate", (4711, b"0123", 4)),
    ("DeSerializeFMUstate", (None, 4, c_void_p())),
    ("DeSerializeFMUstate", (b"{}", 2, None)),
    ("DeSerializeFMUstate", (b"{}", 2, c_void_p(4711))),
    ("DeSerializeFMUstate", (b"", 0, c_void_p())),
    ("DeSerializeFMUstate", (b"{}", 2**63, c_void_p())),
    *((f"Get{kind}Status", (2, None)) for kind in ("", "Real", "Integer", "Boolean", "String")),
]  # fmt: skip


@pytest.mark.parametrize(("function", "arguments"), WRONG)
def test_wrong_argument_is_an_error_with_one_message(fmu, component, function, arguments):
    assert getattr(fmu, function)(component, *arguments) == ERROR
    [message] = fmu.messages
    assert message.text.startswith(f"fmi2{function}: ")
    assert (message.status, message.category) == (ERROR, "logStatusError")


def test_no_values_need_no_arrays(fmu: RawFmu, component: int):
    for kind in ("Real", "Integer", "Boolean", "String"):
        for verb in ("Get", "Set"):
            assert getattr(fmu, f"{verb}{kind}")(component, None, 0, None) == OK
    assert fmu.SetDebugLogging(component, 1, 0, None) == OK
    assert steps(fmu, component) == OK
    assert fmu.messages == []


#: What is refused, as function, arguments of an initialised FMU, and answer.
def refusals(folder: Path) -> list[tuple[str, tuple[Any, ...], int]]:
    an_input, output, gain = (reference(folder, name) for name in ("y.x", "tau.u", "k_d"))
    fixed, choice = reference(folder, "h_max"), reference(folder, "saturation")
    unknown, nan, one = (c_uint * 1)(4711), (c_double * 1)(math.nan), (c_double * 1)(1.0)
    return [
        ("SetReal", (an_input, 1, nan), DISCARD),
        ("SetReal", (gain, 1, (c_double * 1)(-1.0)), DISCARD),
        ("SetReal", (output, 1, one), DISCARD),
        ("SetReal", (fixed, 1, one), DISCARD),
        ("SetString", (choice, 1, (c_char_p * 1)(b"sigmoid")), DISCARD),
        ("DoStep", (0.0, -1.0, 1), DISCARD),
        ("GetReal", (unknown, 1, one), ERROR),
        ("GetBoolean", (an_input, 1, INTEGERS), ERROR),
        ("CancelStep", (), ERROR),
        ("EnterEventMode", (), ERROR),
        ("SetReal", (unknown, 1, one), ERROR),
        ("EnterInitializationMode", (), ERROR),
    ]


def test_what_is_refused_is_told_with_logging_off(fmu: RawFmu, folder: Path):
    """Each in its call, and answered again where it is not told again."""
    for function, arguments, answer in refusals(folder):
        fmu.messages.clear()
        made = fmu.instantiate(logging=0)
        fmu.SetupExperiment(made, 0, 0.0, 0.0, 0, 0.0)
        fmu.EnterInitializationMode(made)
        assert fmu.ExitInitializationMode(made) == OK
        assert fmu.messages == []
        assert getattr(fmu, function)(made, *arguments) == answer, function
        [message] = fmu.messages
        assert message.status == answer
        assert message.category == {DISCARD: "logStatusDiscard", ERROR: "logStatusError"}[answer]
        assert getattr(fmu, function)(made, *arguments) == answer, function
        fmu.FreeInstance(made)


def test_fixed_parameters_may_be_set_to_what_they_are(fmu, folder, component):
    """As a host does that sets all start values once more."""
    fixed = [
        variable
        for variable in fmpy.read_model_description(folder).modelVariables
        if (variable.causality, variable.variability) == ("parameter", "fixed")
    ]
    assert {variable.type for variable in fixed} >= {"Real", "Boolean", "String"}
    types = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
    for variable in fixed:
        values = (types[variable.type] * 1)()
        arguments = (component, (c_uint * 1)(variable.valueReference), 1, values)
        assert getattr(fmu, f"Get{variable.type}")(*arguments) == OK
        assert getattr(fmu, f"Set{variable.type}")(*arguments) == OK, variable.name
    assert steps(fmu, component) == OK
    assert fmu.messages == []


@pytest.mark.parametrize(
    ("bad", "value", "answer"),
    [("y.y", math.nan, DISCARD), ("k_d", -1.0, DISCARD), ("h_max", 0.5, DISCARD),
     ("tau.u", 0.0, DISCARD), (None, 0.0, ERROR)],
)  # fmt: skip
@pytest.mark.parametrize("place", [0, 1, 2])
def test_of_several_values_all_are_taken_or_none(
    fmu, folder, component, bad: str | None, value: float, answer: int, place: int
):
    """An input and a tunable parameter beside a value that is bad, wherever it stands."""
    good = [reference(folder, "y.x")[0], reference(folder, "k_d")[0]]
    read, all_three = (c_double * 2)(), [(r, v) for r, v in zip(good, (0.5, 60.0), strict=True)]
    all_three.insert(place, (4711 if bad is None else reference(folder, bad)[0], value))
    before = (c_double * 2)()
    assert fmu.GetReal(component, (c_uint * 2)(*good), 2, before) == OK
    names, values = (
        (c_uint * 3)(*(r for r, _ in all_three)),
        (c_double * 3)(*(v for _, v in all_three)),
    )
    assert fmu.SetReal(component, names, 3, values) == answer
    assert fmu.GetReal(component, (c_uint * 2)(*good), 2, read) == OK
    assert [*read] == [*before]
    assert steps(fmu, component) == (OK if answer == DISCARD else ERROR)
    assert len(fmu.messages) == 1


def test_several_parameters_are_taken_in_one_call_while_stepping(fmu, folder, component):
    names = (c_uint * 3)(*(reference(folder, name)[0] for name in ("k_d", "lambda", "y.x")))
    values, read = (c_double * 3)(60.0, 0.5, 0.25), (c_double * 3)()
    assert fmu.SetReal(component, names, 3, values) == OK
    assert fmu.GetReal(component, names, 3, read) == OK
    assert [*read] == [*values]
    assert steps(fmu, component) == OK


@pytest.mark.parametrize("function", OF_MODEL_EXCHANGE)
def test_functions_of_model_exchange_are_there_and_do_nothing(fmu, component, function: str):
    """Some hosts look for them in every FMU."""
    assert getattr(fmu, function)(component, *CALLS[function]) == ERROR
    [message] = fmu.messages
    assert message.text == f"FMI function not supported: fmi2{function}"
    assert steps(fmu, component) == OK


def in_error(fmu: RawFmu, component: int) -> None:
    assert fmu.SetReal(component, None, 1, None) == ERROR


def test_error_state_lets_through_what_does_not_go_on(fmu, folder, component):
    """Values and states can be read, nothing can be set or stepped, until reset or restored."""
    gain = reference(folder, "k_d")
    state, value = c_void_p(), (c_double * 1)(1.0)
    assert fmu.GetFMUstate(component, state) == OK
    in_error(fmu, component)
    for kind, values in (("Real", value), ("Integer", INTEGERS), ("Boolean", INTEGERS),
                         ("String", STRINGS)):  # fmt: skip
        assert getattr(fmu, f"Set{kind}")(component, gain, 1, values) == ERROR
    assert fmu.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == ERROR
    for function in ("EnterInitializationMode", "ExitInitializationMode", "Terminate",
                     "CancelStep"):  # fmt: skip
        assert getattr(fmu, function)(component) == ERROR
    assert steps(fmu, component) == ERROR
    before = value[0]
    assert fmu.GetReal(component, gain, 1, value) == OK
    assert value[0] != before
    other, size = c_void_p(), c_size_t()
    assert fmu.GetFMUstate(component, other) == OK
    assert fmu.SerializedFMUstateSize(component, other, size) == OK
    assert fmu.FreeFMUstate(component, other) == OK
    assert fmu.SetFMUstate(component, state) == OK
    assert steps(fmu, component) == OK
    in_error(fmu, component)
    assert fmu.Reset(component) == OK
    assert fmu.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == OK


# What is not alive


def zero(kind: Any) -> Any:
    """What nobody may look at."""
    return kind() if kind in (c_int, c_double, c_size_t) else None


#: Everything that takes a component, with arguments that are right, or that nobody may look at.
CALLS = {
    **{f"{verb}{kind}": (ONE, 1, values)
       for kind, values in (("Real", REALS), ("Integer", INTEGERS), ("Boolean", INTEGERS),
                            ("String", STRINGS))
       for verb in ("Get", "Set")},
    "SetDebugLogging": (1, 0, None),
    "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
    "EnterInitializationMode": (),
    "ExitInitializationMode": (),
    "Terminate": (),
    "Reset": (),
    "GetFMUstate": (c_void_p(),),
    "SetFMUstate": (4711,),
    "FreeFMUstate": (c_void_p(4711),),
    "SerializedFMUstateSize": (4711, c_size_t()),
    "SerializeFMUstate": (4711, b"0123", 4),
    "DeSerializeFMUstate": (b"{}", 2, c_void_p()),
    "GetDirectionalDerivative": (ONE, 1, ONE, 1, REALS, REALS),
    "SetRealInputDerivatives": (ONE, 1, INTEGERS, REALS),
    "GetRealOutputDerivatives": (ONE, 1, INTEGERS, REALS),
    "DoStep": (0.0, 0.02, 1),
    "CancelStep": (),
    **{name: tuple(zero(kind) for kind in kinds) for name, kinds in OF_MODEL_EXCHANGE.items()},
    **{f"Get{kind}Status": (2, values)
       for kind, values in (("", INTEGERS), ("Real", REALS), ("Integer", INTEGERS),
                            ("Boolean", INTEGERS), ("String", STRINGS))},
}  # fmt: skip


def dead(fmu: RawFmu) -> dict[str, int | None]:
    """Components that are none."""
    freed, state = fmu.initialised(), c_void_p()
    fmu.FreeInstance(freed)
    alive = fmu.initialised()
    assert fmu.GetFMUstate(alive, state) == OK
    return {
        "NULL": None,
        "freed": freed,
        "a state": state.value,
        "next to one": alive + 1,
        "an address": ctypes.addressof(REALS),
        "all bits": 2**64 - 1,
    }


def test_no_function_touches_what_is_not_alive(fmu: RawFmu, capfd):
    for what, component in dead(fmu).items():
        capfd.readouterr()
        for function, arguments in CALLS.items():
            assert getattr(fmu, function)(component, *arguments) == ERROR, (what, function)
            expected = f"fmi2{function}: not a live instance of this FMU\n"
            assert capfd.readouterr().err == expected
        fmu.FreeInstance(component)
    assert fmu.messages == []


def test_handle_of_another_fmu_is_told_from_ones_own(fmu: RawFmu, fmus: Path, tmp_path: Path):
    fmpy.extract(fmus / "MotionPlanner.fmu", unzipdir=tmp_path)
    other = RawFmu(tmp_path)
    theirs, ours = other.initialised(), fmu.initialised()
    assert steps(fmu, theirs) == ERROR
    state = c_void_p()
    assert other.GetFMUstate(theirs, state) == OK
    assert fmu.SetFMUstate(ours, state) == ERROR
    fmu.FreeInstance(theirs)
    assert steps(other, theirs) == OK
    other.FreeInstance(theirs)
    fmu.FreeInstance(ours)


def test_freed_state_and_its_copies_are_dead(fmu: RawFmu, component: int):
    state = c_void_p()
    assert fmu.GetFMUstate(component, state) == OK
    copy = c_void_p(state.value)
    assert fmu.FreeFMUstate(component, state) == OK
    assert state.value is None
    assert fmu.FreeFMUstate(component, state) == OK, "there is nothing to free"
    assert fmu.SetFMUstate(component, copy) == ERROR
    assert fmu.FreeFMUstate(component, copy) == ERROR
    assert fmu.GetFMUstate(component, copy) == ERROR


def test_handle_is_given_once(fmu: RawFmu, component: int):
    """Whatever is freed in between, and with more alive than a table begins with."""
    handles = []
    for _ in range(100):
        made = fmu.instantiate()
        handles.append(made)
        fmu.FreeInstance(made)
    states = [c_void_p() for _ in range(3000)]
    for _ in range(2):
        for state in states:
            assert fmu.GetFMUstate(component, state) == OK
        handles += [state.value for state in states]
        assert fmu.SetFMUstate(component, states[-1]) == OK
        for state in states:
            assert fmu.FreeFMUstate(component, state) == OK
    assert len({component, *handles}) == 1 + len(handles)


def test_states_end_with_their_instance(fmu: RawFmu, component: int):
    other, state = fmu.initialised(), c_void_p()
    assert fmu.GetFMUstate(other, state) == OK
    assert fmu.SetFMUstate(component, state) == OK
    fmu.FreeInstance(other)
    assert fmu.SetFMUstate(component, state) == ERROR


def test_state_that_is_given_is_used_again(fmu: RawFmu, component: int):
    """And holds what it is now."""
    first, kept = c_void_p(), c_void_p()
    assert fmu.GetFMUstate(component, first) == OK
    before = first.value

    def again(times: int) -> int:
        for _ in range(times):
            assert steps(fmu, component) == OK
            assert fmu.GetFMUstate(component, first) == OK
        gc.collect()
        return sys.getallocatedblocks()

    blocks = again(100)
    assert again(500) - blocks < 500, "less than one object a call"
    assert first.value == before
    assert fmu.GetFMUstate(component, kept) == OK
    assert serialised(fmu, component, first) == serialised(fmu, component, kept)


def serialised(fmu: RawFmu, component: int, state: c_void_p) -> bytes:
    size = c_size_t()
    assert fmu.SerializedFMUstateSize(component, state, size) == OK
    content = ctypes.create_string_buffer(size.value)
    assert fmu.SerializeFMUstate(component, state, content, size) == OK
    return content.raw


@pytest.mark.parametrize("difference", [-1, 1, 1000, 2**40])
def test_size_is_that_of_the_state(fmu: RawFmu, component: int, difference: int):
    """PythonFMU copies as many bytes as it is told, whatever lies behind the state."""
    state = c_void_p()
    assert fmu.GetFMUstate(component, state) == OK
    size = len(serialised(fmu, component, state))
    content = ctypes.create_string_buffer(size + 1000)
    assert fmu.SerializeFMUstate(component, state, content, size + difference) == ERROR
    assert content.raw == bytes(size + 1000)


@pytest.mark.parametrize("content", [b"nothing", b"{}", 1000 * b"x"])
def test_bytes_that_are_no_state_end_in_the_error_state(fmu, component, content: bytes):
    state, good = c_void_p(), c_void_p()
    assert fmu.GetFMUstate(component, good) == OK
    before = serialised(fmu, component, good)
    assert fmu.DeSerializeFMUstate(component, content, len(content), state) == OK
    assert fmu.SetFMUstate(component, state) == ERROR
    [message] = fmu.messages
    assert message.text.startswith("state refused: ")
    assert fmu.GetFMUstate(component, state) == OK
    assert serialised(fmu, component, state) == before
    assert steps(fmu, component) == ERROR
    assert fmu.SetFMUstate(component, good) == OK
    assert steps(fmu, component) == OK


# Calls within calls


def test_logger_that_calls_back_is_refused(fmu: RawFmu, component: int, capfd):
    answers = []

    def call() -> None:
        answers.append(steps(fmu, component))
        fmu.FreeInstance(component)

    fmu.when_told = call
    in_error(fmu, component)
    fmu.when_told = lambda: None
    assert answers == [ERROR]
    assert "fmi2FreeInstance: called by the logger" in capfd.readouterr().err
    assert fmu.Reset(component) == OK


def test_messages_of_a_call_are_told_in_their_order_after_all_is_done(fmu, folder, component):
    """Also where the logger calls back: the instance is let go, and its values are as they stay."""
    unknown = range(4711, 4716)
    references, values = (c_uint * 6)(*reference(folder, "k_d"), *unknown), (c_double * 6)()
    answers = []
    fmu.when_told = lambda: answers.append(steps(fmu, component))
    assert fmu.GetReal(component, references, 6, values) == ERROR
    fmu.when_told = lambda: None
    expected = [f"no Real has the value reference {reference}" for reference in unknown]
    assert [message.text for message in fmu.messages] == expected
    assert answers == [ERROR] * 5
    assert values[0] > 0.0
    assert values[1:] == [0.0] * 5
    assert steps(fmu, component) == OK


def test_threads_on_one_instance_take_turns(fmu: RawFmu, component: int):
    answers: list[int] = []

    def run() -> None:
        for _ in range(200):
            state = c_void_p()
            answers.append(fmu.GetFMUstate(component, state))
            answers.append(fmu.FreeFMUstate(component, state))
            answers.append(fmu.DoStep(component, 0.0, 0.02, 1))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [OK] * (4 * 200 * 3)


def test_threads_that_make_instances_leave_the_process_as_it_was(
    fmus: Path, folder: Path, tmp_path: Path
):
    """Each of the Python kind puts its folder on sys.path while others look for theirs."""
    fmpy.extract(fmus / "MotionPlanner.fmu", unzipdir=tmp_path)
    before, answers = list(sys.path), []

    def run(place: Path) -> None:
        fmu = RawFmu(place)
        for _ in range(10):
            made = fmu.initialised()
            answers.append(steps(fmu, made))
            fmu.FreeInstance(made)
            assert fmu.instantiate(guid=b"{0}", location=b"file:///nowhere") is None

    threads = [threading.Thread(target=run, args=(place,)) for place in 3 * (folder, tmp_path)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [OK] * 60
    assert sys.path == before


#: Forks while a thread makes an instance, which takes its time; what the child makes is its status.
FORKS = """
import os, sys, threading
from pathlib import Path
from support.raw_fmi import RawFmu

slow, quick = map(RawFmu, map(Path, sys.argv[1:]))
thread = threading.Thread(target=slow.instantiate)
thread.start()
while not hasattr(sys, "is_being_made"):
    thread.join(0.01)
child = os.fork()
if child == 0:
    os._exit(0 if quick.instantiate() else 1)
_, status = os.waitpid(child, 0)
assert status == 0
assert quick.instantiate(), "after the other"
"""

SLOW = """
import sys, time
from pythonfmu import Fmi2Slave

class Slow(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        if kwargs.get("resources"):
            sys.is_being_made = True
            time.sleep(1.0)

    def do_step(self, t, h):
        return True
"""


def test_child_that_is_forked_waits_for_no_thread_of_its_parent(python_folder, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    fmpy.extract(build_own(tmp_path / "slow.py", tmp_path), unzipdir=tmp_path / "slow")
    subprocess.run(
        [sys.executable, "-c", FORKS, tmp_path / "slow", python_folder],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        check=True,
        timeout=30,
    )


# Slaves of other people

FOREIGN = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real, String
from pythonfmu.enums import Fmi2Status

class Foreign(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.s = 1.0, "text"
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        discrete = Fmi2Variability.discrete
        self.register_variable(String("s", causality=Fmi2Causality.output, variability=discrete))

    def exit_initialization_mode(self):
        self.log("50% of 100%d", Fmi2Status.warning)

    def do_step(self, t, h):
        if t == 1.0:
            raise ValueError("not at one")
        if t == 2.0:
            self.x = "no number"
        if t == 3.0:
            self.s = "\\udcff"
            self.log("\\udcff and \\u00fc", Fmi2Status.warning)
        return True

    def _set_fmu_state(self, state):
        raise ValueError("no way back")
"""


@pytest.fixture(scope="module")
def foreign_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "foreign_slave.py").write_text(FOREIGN)
    fmpy.extract(build_own(folder / "foreign_slave.py", folder), unzipdir=folder / "unpacked")
    return folder / "unpacked"


@pytest.fixture
def foreign(foreign_folder: Path) -> RawFmu:
    return RawFmu(foreign_folder)


def test_percent_signs_arrive_as_a_format_that_prints_them(foreign: RawFmu):
    foreign.FreeInstance(foreign.initialised())
    [message] = foreign.messages
    assert message.text == "50%% of 100%%d"
    assert message.category == "logStatusWarning"


def test_categories_choose_messages_but_not_errors(foreign: RawFmu):
    for categories, heard in (([b"logStatusWarning"], 1), ([b"logEvents", b"x"], 0)):
        foreign.messages.clear()
        made = foreign.instantiate(logging=0)
        chosen = (c_char_p * len(categories))(*categories)
        assert foreign.SetDebugLogging(made, 1, len(categories), chosen) == OK
        foreign.SetupExperiment(made, 0, 0.0, 0.0, 0, 0.0)
        foreign.EnterInitializationMode(made)
        foreign.ExitInitializationMode(made)
        assert len(foreign.messages) == heard
        assert foreign.DoStep(made, 1.0, 0.1, 1) == DISCARD
        assert "foreign_slave.py:18: ValueError: not at one" in foreign.messages[-1].text
        foreign.FreeInstance(made)


def test_after_fatal_nobody_is_called(foreign: RawFmu):
    made, other, state = foreign.initialised(), foreign.initialised(), c_void_p()
    assert foreign.GetFMUstate(made, state) == OK
    foreign.messages.clear()
    assert foreign.SetFMUstate(made, state) == FATAL
    [message] = foreign.messages
    assert "ValueError('no way back')" in message.text
    for function, arguments in CALLS.items():
        assert getattr(foreign, function)(made, *arguments) == FATAL, function
    foreign.FreeInstance(made)
    assert foreign.DoStep(made, 0.0, 0.1, 1) == ERROR, "freed, and nothing more"
    assert foreign.DoStep(other, 0.0, 0.1, 1) == OK
    foreign.FreeInstance(other)


def test_value_of_another_type_is_told_in_the_call_that_meets_it(foreign, foreign_folder):
    made, value = foreign.initialised(), (c_double * 1)()
    x = reference(foreign_folder, "x")
    assert foreign.GetReal(made, x, 1, value) == OK
    assert foreign.DoStep(made, 2.0, 0.1, 1) == OK
    foreign.messages.clear()
    assert foreign.GetReal(made, x, 1, value) == ERROR
    assert "could not convert string to float" in foreign.messages[-1].text
    assert foreign.messages[-1].status == ERROR
    assert foreign.DoStep(made, 3.0, 0.1, 1) == DISCARD
    foreign.FreeInstance(made)


def test_text_of_a_slave_that_cannot_be_encoded_is_survived(foreign, foreign_folder):
    made, value = foreign.initialised(), (c_char_p * 1)()
    foreign.messages.clear()
    assert foreign.DoStep(made, 3.0, 0.1, 1) == OK
    assert [message.text for message in foreign.messages] == ["? and ü"]
    assert foreign.GetString(made, reference(foreign_folder, "s"), 1, value) == OK
    assert value[0] == b"?"
    foreign.FreeInstance(made)


def test_refusal_of_a_step_is_no_error(fmu: RawFmu, component: int):
    assert fmu.DoStep(component, 0.0, -1.0, 1) == DISCARD
    assert steps(fmu, component) == OK
