"""Calls that no slave can answer: wrong pointers, dead handles, invalid text, FMUs without a slave.

No such call may end the host. Each test is one class of mistakes that fmi-answers.md lacks, on
one small FMU of each kind: the guard is the loader's or the runtime's, and the same for all FMUs.
"""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import partial
from math import nan
from pathlib import Path
from typing import Any

import fmpy
import pytest

from fmus.python.component import LONGEST_MESSAGE
from fmus.python.packaging import build_script, loader_compiler
from support.fmi3 import Fmi3Library
from support.kinds import FIXTURES
from support.raw import Host, Library, Message, Status, harmless, initialised, instance

pytestmark = pytest.mark.skipif(loader_compiler() is None, reason="there is no C compiler")

NOT_UTF8 = [b"\xff", b"\xc0\xaf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xe2\x82", b"\x80"]

#: A value reference of no port.
UNKNOWN = 4711

OK, ERROR = Status.OK, Status.Error


def unpacked(
    fmus: Path, temporary: pytest.TempPathFactory, name: str = "ObserverController"
) -> Path:
    return Path(fmpy.extract(fmus / f"{name}.fmu", temporary.mktemp("guarded")))


@pytest.fixture(scope="module")
def python(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    return Library(unpacked(dist, tmp_path_factory))


@pytest.fixture(scope="module", params=FIXTURES.values(), ids=FIXTURES.keys())
def fmus(request: pytest.FixtureRequest) -> Path:
    """The FMUs of one of the kinds."""
    folder: Path = request.getfixturevalue(request.param)
    return folder


@pytest.fixture(scope="module")
def library(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    return Library(unpacked(fmus, tmp_path_factory))


@pytest.fixture(scope="module")
def planner(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Another FMU of the same kind."""
    return Library(unpacked(fmus, tmp_path_factory, "MotionPlanner"))


@pytest.fixture(scope="module", params=[*FIXTURES.values(), "dist3"], ids=[*FIXTURES, "FMI 3.0"])
def of_any_version(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Library:
    folder = unpacked(request.getfixturevalue(request.param), tmp_path_factory)
    return Fmi3Library(folder) if request.param == "dist3" else Library(folder)


@pytest.fixture
def host(library: Library) -> Iterator[Host]:
    with initialised(library) as host:
        yield host


def reference(host: Host, name: str) -> int:
    return host.description.find(name).reference


def put(host: Host, name: str, value: Any) -> Status:
    port = host.description.find(name)
    return host.set(port.type, [port.reference], [value])


def in_error(host: Host) -> None:
    assert host.call("fmi2SetReal", None, 1, None) == ERROR


# Instances


def refused(library: Library, **arguments: Any) -> Message:
    """The only message, with logging off, of a call that gives no instance."""
    host = Host(library)
    before = list(sys.path)
    assert not host.instantiate(**arguments, logging=False)
    assert sys.path == before
    [message] = host.messages
    return message


@pytest.mark.parametrize(
    ("what", "location"),
    [
        ("not UTF-8", b"file:///tmp/%ff"),
        ("zero byte", b"file:///tmp%00/x"),
        ("%%20", b"file:///tmp/a%2520b"),
        ("slavemodule.txt", b"file://"),
        ("File name too long", b"file:///" + 100_000 * b"x"),
    ],
)
def test_place_without_a_slave_is_null_with_one_message(python, what, location):
    message = refused(python, location=location)
    assert what in message.text
    assert (message.status, message.category) == (ERROR, "logStatusError")


def test_guid_is_in_the_description_or_not_stated(of_any_version: Library):
    stated = of_any_version.description.guid.encode()
    bare = stated.strip(b"{}")
    for guid in (None, b"", stated, bare, stated.upper(), bare.upper(), bare.lower()):
        with instance(of_any_version, guid=guid) as host:
            assert host.messages == []
    for guid in (stated + b"x", b"x" + stated, stated[:-2]):
        assert not Host(of_any_version).instantiate(guid=guid)


@pytest.fixture
def resources(python: Library, tmp_path: Path) -> Path:
    return Path(shutil.copytree(python.folder / "resources", tmp_path / "resources"))


def script_of(resources: Path) -> str:
    return (resources / "slavemodule.txt").read_text()


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
def test_folder_without_a_slave_is_null_with_one_message(python, resources, files, what):
    script = script_of(resources)
    for name, content in files.items():
        path = resources / name.format(script=script)
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content)
    message = refused(python, location=resources.as_uri().encode())
    assert what in message.text
    assert message.status in (ERROR, Status.Fatal)
    with instance(python):
        pass  # The sound one still works.


def test_long_reason_is_cut_between_characters(python, resources):
    """Percent signs are doubled, as in all formats."""
    (resources / "slavemodule.txt").write_text("guarded_k")
    why = "100 % %d %% " + "ü" * 2000
    (resources / "guarded_k.py").write_text(f"raise ValueError({why!r})", encoding="utf-8")
    message = refused(python, location=resources.as_uri().encode())
    whole = f"fmi2Instantiate: ValueError: {why}"
    assert message.text == whole[:LONGEST_MESSAGE].replace("%", "%%")


@pytest.mark.parametrize(
    "name", ["slavemodule.txt", "guid.txt", "{script}.py", "__pycache__/{script}.{tag}.pyc"]
)
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_resources_other_than_files_are_refused_at_once(python, resources, name: str, kind: str):
    """Reading a pipe or the device would not end."""
    path = resources / name.format(script=script_of(resources), tag=sys.implementation.cache_tag)
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    message = refused(python, location=resources.as_uri().encode())
    assert f"{path} is not a regular file" in message.text or kind == "folder"


def test_library_beside_the_loader_is_found_where_the_loader_was(python, tmp_path, monkeypatch):
    """A host may load by a path from the current folder, and then go elsewhere."""
    libraries = "binaries/linux64"
    for name in ("ours", "theirs"):
        shutil.copytree(python.folder / libraries, tmp_path / name / libraries)
    shutil.copy(python.folder / "modelDescription.xml", tmp_path / "ours")
    (tmp_path / "theirs" / libraries / "ObserverController_pythonfmu.so").write_text("planted")
    monkeypatch.chdir(tmp_path / "ours")
    library = Library(Path())
    monkeypatch.chdir(tmp_path / "theirs")
    with instance(library, location=python.location.encode()):
        pass


# Arguments

ONE = (c_uint * 1)(0)
STRINGS = (c_char_p * 1)(b"tanh")
ARRAYS = {"Real": (c_double * 2)(), "Integer": (c_int * 2)(), "Boolean": (c_int * 2)(),
          "String": STRINGS}  # fmt: skip
TOO_MANY = c_size_t(2**31)

#: Function, and arguments that cannot be forwarded; docs/reference/fmi-answers.md has others.
WRONG = [
    *(
        (f"{verb}{kind}", (ONE, n, values))
        for kind, values in ARRAYS.items()
        for verb in ("Get", "Set")
        for n in (TOO_MANY, c_size_t(2**64 - 1))
    ),
    *(("SetString", (ONE, c_size_t(1), (c_char_p * 1)(bad))) for bad in NOT_UTF8),
    ("SetDebugLogging", (1, TOO_MANY, STRINGS)),
    ("GetFMUstate", (byref(c_void_p(4711)),)),
    ("DeSerializeFMUstate", (b"{}", c_size_t(2), byref(c_void_p(4711)))),
    ("DeSerializeFMUstate", (b"{}", c_size_t(2**63), byref(c_void_p()))),
]


@pytest.mark.parametrize(("function", "arguments"), WRONG)
def test_wrong_argument_is_an_error_with_one_message(host: Host, function, arguments):
    assert host.call(f"fmi2{function}", *arguments) == ERROR
    [message] = host.messages
    assert message.text.startswith(f"fmi2{function}: ")
    assert (message.status, message.category) == (ERROR, "logStatusError")


#: Refused calls on an FMU that is initialised, each with its answer.
REFUSED = [
    *(
        (Status.Discard, lambda host, name=name, value=value: put(host, name, value))
        for name, value in (("y.x", nan), ("k_d", -1.0))
    ),
    *(
        (ERROR, lambda host, name=name, value=value: put(host, name, value))
        for name, value in (("tau.u", 1.0), ("h_max", 1.0), ("saturation", 1))
    ),
    (Status.Discard, lambda host: host.step(0.0, -1.0)),
    (ERROR, lambda host: host.get("Real", [UNKNOWN])[0]),
    (ERROR, lambda host: host.get("Boolean", [reference(host, "y.x")])[0]),
    (ERROR, lambda host: host.set("Real", [UNKNOWN], [1.0])),
    (ERROR, Host.enter),
]  # fmt: skip


@pytest.mark.parametrize(("status", "call"), REFUSED)
@pytest.mark.parametrize("logging", [True, False])
def test_refusals_are_told_once_and_only_errors_with_logging_off(
    of_any_version: Library, status, call, logging
):
    """Each in its call; a repeated one has the same answer and no message."""
    with initialised(of_any_version, logging=logging) as host:
        assert [call(host), call(host)] == [status] * 2
        logged = [(message.status, message.category) for message in host.messages]
        is_told = logging or status == ERROR
        assert logged == [(status, f"logStatus{status.name}")] * is_told
        assert host.fault() is (status == Status.Discard)
        assert host.value(host.description.find("y.x")) == 0.0


@pytest.mark.parametrize("start", [0.0, -3.0, 1e6])
def test_sum_of_steps_reaches_the_stop_time_and_no_step_goes_beyond(
    of_any_version: Library, start: float
):
    """Ten times 0.1 is not 1 for a host that adds it up."""
    with instance(of_any_version) as host:
        assert host.setup(start, start + 1.0) == host.enter() == host.exit() == OK
        time = start
        for _ in range(10):
            assert host.step(time, 0.1) == OK
            time += 0.1
        saved = host.get_state()
        assert host.step(time, 0.0) == OK
        assert host.step(time, 0.1) == host.step(time, 0.0) == ERROR
        assert len(host.messages) == 1
        assert host.set_state(saved) == OK
        assert host.step(time, 0.1) == ERROR, "the stop time belongs to the state"
        assert host.call("fmi2Reset") == host.setup(start) == host.enter() == host.exit() == OK
        assert host.step(start, 2.0) == OK


@pytest.mark.parametrize(
    ("bad", "value", "answer"),
    [("y.y", nan, Status.Discard), ("k_d", -1.0, Status.Discard), ("h_max", 0.5, ERROR),
     ("tau.u", 0.0, ERROR), (None, 0.0, ERROR), ("lambda", 0.5, OK)],
)  # fmt: skip
@pytest.mark.parametrize("place", [0, 1, 2])
def test_of_several_values_all_are_taken_or_none(
    host: Host, bad: str | None, value: float, answer: Status, place: int
):
    """An input, a tunable parameter and a value that may be bad, in any order."""
    good = [reference(host, "y.x"), reference(host, "k_d")]
    before, given = host.get("Real", good), [0.5, 60.0]
    references, values = [*good], [*given]
    references.insert(place, UNKNOWN if bad is None else reference(host, bad))
    values.insert(place, value)
    assert host.set("Real", references, values) == answer
    assert host.get("Real", good) == ((OK, given) if answer == OK else before)
    assert host.step(0.0, 0.02) == (ERROR if answer == ERROR else OK)
    assert len(host.messages) == (answer != OK)


# Dead handles


def test_no_function_touches_what_is_not_alive(library: Library, capfd):
    with initialised(library) as gone:
        freed = gone.component
    with initialised(library) as host:
        assert host.component is not None
        for component in (None, freed, host.get_state(), host.component + 1, 2**64 - 1):
            capfd.readouterr()
            for function, arguments in harmless().items():
                assert host.call_on(component, function, *arguments) == ERROR, function
                expected = f"{function}: not a live instance of this FMU\n"
                assert capfd.readouterr().err == expected
            library.functions.fmi2FreeInstance(c_void_p(component))
        assert host.messages == []


def test_handle_of_another_fmu_is_told_from_ones_own(host: Host, planner: Library):
    with initialised(planner) as other:
        assert host.call_on(other.component, "fmi2Reset") == ERROR
        assert host.set_state(other.get_state()) == ERROR
        host.library.functions.fmi2FreeInstance(c_void_p(other.component))
        assert other.step(0.0, 0.02) == OK


def test_handle_is_given_once(host: Host):
    """Also after others were freed, and with more than a table begins with."""
    handles = [host.component]
    for _ in range(100):
        with instance(host.library) as other:
            handles.append(other.component)
    for _ in range(2):
        states = [host.get_state() for _ in range(3000)]
        handles += states
        assert host.set_state(states[-1]) == OK
        for state in states:
            assert host.free_state(state) == OK
    assert len({*handles}) == len(handles)


def test_states_end_with_their_instance(host: Host):
    with initialised(host.library) as other:
        state = other.get_state()
        assert host.set_state(state) == OK
    assert host.set_state(state) == ERROR


def test_state_that_is_given_is_used_again(host: Host):
    """It holds the present values."""
    first = c_void_p()
    assert host.call("fmi2GetFMUstate", byref(first)) == OK
    before = first.value
    assert before

    def again(times: int) -> int:
        for _ in range(times):
            assert host.step(0.0, 0.02) == OK
            assert host.call("fmi2GetFMUstate", byref(first)) == OK
        gc.collect()
        return sys.getallocatedblocks()

    blocks = again(100)
    assert again(500) - blocks < 500, "less than one object a call"
    assert first.value == before
    assert host.serialised(before) == host.content()


# Calls within calls


def test_logger_that_calls_back_is_refused(host: Host, capfd):
    answers = []

    def call() -> None:
        answers.append(host.step(0.0, 0.02))
        host.library.functions.fmi2FreeInstance(c_void_p(host.component))

    host.when_told = call
    in_error(host)
    host.when_told = lambda: None
    assert answers == [ERROR]
    assert "fmi2FreeInstance: called by the logger" in capfd.readouterr().err
    assert host.call("fmi2Reset") == OK


def test_messages_of_a_call_are_told_in_their_order(host: Host):
    """Also if the logger calls back, which changes no value of the call."""
    unknown = range(UNKNOWN, UNKNOWN + 5)
    answers = []
    host.when_told = lambda: answers.append(host.step(0.0, 0.02))
    status, values = host.get("Real", [reference(host, "k_d"), *unknown])
    host.when_told = lambda: None
    assert status == ERROR
    expected = [f"no Real has the value reference {reference}" for reference in unknown]
    assert [message.text for message in host.messages] == expected
    assert answers == [ERROR] * 5
    assert values[0] > 0.0
    assert values[1:] == [0.0] * 5
    assert host.step(0.0, 0.02) == OK


def test_thread_waits_until_the_logger_has_come_back(host: Host):
    answers: list[Status] = []
    meanwhile: list[Status] = []
    thread = threading.Thread(target=lambda: answers.append(host.call("fmi2Reset")))

    def hear() -> None:
        thread.start()
        thread.join(0.05)
        meanwhile.extend(answers)

    host.when_told = hear
    in_error(host)
    thread.join()
    assert (meanwhile, answers) == ([], [OK])


def at_once(*tasks: Callable[[], object]) -> None:
    """Do something in threads."""
    threads = [threading.Thread(target=task) for task in tasks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def test_threads_on_one_instance_take_turns(host: Host):
    answers: list[Status] = []

    def run() -> None:
        for _ in range(200):
            answers.append(host.free_state(host.get_state()))
            answers.append(host.step(0.0, 0.02))

    at_once(*[run] * 4)
    assert answers == [OK] * (4 * 200 * 2)


def test_threads_that_make_instances_leave_the_process_as_it_was(
    library: Library, planner: Library
):
    """Each of the Python kind puts its folder on sys.path while others look for theirs."""
    before, answers = list(sys.path), []

    def run(library: Library) -> None:
        for _ in range(10):
            with initialised(library) as host:
                answers.append(host.step(0.0, 0.02))
            assert not Host(library).instantiate(guid=b"{0}", location=b"file:///nowhere")

    at_once(*(partial(run, loaded) for loaded in 3 * (library, planner)))
    assert answers == [OK] * 60
    assert sys.path == before


#: Forks while a thread makes an instance, which takes its time; what the child makes is its status.
FORKS = """
import os, sys, threading
from pathlib import Path
from support.raw import Host, Library

slow, quick = (Host(Library(Path(folder))) for folder in sys.argv[1:])
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


def test_child_that_is_forked_waits_for_no_thread_of_its_parent(python, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    fmpy.extract(build_script(tmp_path / "slow.py", tmp_path), unzipdir=tmp_path / "slow")
    subprocess.run(
        [sys.executable, "-c", FORKS, tmp_path / "slow", python.folder],
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
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "foreign_slave.py").write_text(FOREIGN)
    fmu = build_script(folder / "foreign_slave.py", folder)
    return Library(Path(fmpy.extract(fmu, folder / "unpacked")))


def test_percent_signs_arrive_as_a_format_that_prints_them(foreign: Library):
    with instance(foreign) as host:
        assert host.enter() == host.exit() == OK
    [message] = host.messages
    assert message.text == "50%% of 100%%d"
    assert message.category == "logStatusWarning"


def test_categories_choose_messages_but_not_errors(foreign: Library):
    for categories, expected in (([b"logStatusWarning"], 1), ([b"logEvents", b"x"], 0)):
        with instance(foreign, logging=False) as host:
            n = len(categories)
            chosen = (c_char_p * n)(*categories)
            assert host.call("fmi2SetDebugLogging", 1, c_size_t(n), chosen) == OK
            assert host.enter() == host.exit() == OK
            assert len(host.messages) == expected
            assert host.step(1.0, 0.1) == Status.Discard
            assert "foreign_slave.py:18: ValueError: not at one" in host.messages[-1].text


def test_after_fatal_the_slave_is_not_called(foreign: Library):
    with initialised(foreign) as other:
        with initialised(foreign) as host:
            assert host.set_state(host.get_state()) == Status.Fatal
            [message] = host.messages
            assert "ValueError('no way back')" in message.text
            for function, arguments in harmless().items():
                assert host.call(function, *arguments) == Status.Fatal, function
            freed = host.component
        assert host.call_on(freed, "fmi2Reset") == ERROR, "freed, and nothing more"
        assert other.step(0.0, 0.1) == OK


def test_value_of_another_type_is_told_in_the_call_that_meets_it(foreign: Library):
    with initialised(foreign) as host:
        x = [reference(host, "x")]
        assert host.get("Real", x) == (OK, [1.0])
        assert host.step(2.0, 0.1) == OK
        assert host.get("Real", x)[0] == ERROR
        assert "could not convert string to float" in host.messages[-1].text
        assert host.messages[-1].status == ERROR
        assert host.step(3.0, 0.1) == Status.Discard


def test_text_of_a_slave_that_cannot_be_encoded_is_survived(foreign: Library):
    with initialised(foreign) as host:
        assert host.step(3.0, 0.1) == OK
        assert [message.text for message in host.messages] == ["? and ü"]
        assert host.get("String", [reference(host, "s")]) == (OK, [b"?"])
