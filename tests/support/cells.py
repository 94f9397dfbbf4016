"""The cells of docs/reference/fmi-answers.md, tried on an FMU.

A trial makes the call of a cell, then looks at what it has changed and at what comes after.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import addressof, c_int, c_void_p
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree import ElementTree

from fmus.discovery import source_of
from fmus.kinds import PYTHON
from fmus.ports.description import fmi2_description
from support import states
from support.calls import BEYOND, CASES, FREED, MANY, OTHER, OWN, Call, Draw, Saved, make
from support.fmi3 import Fmi3Library
from support.raw import (
    MODEL_EXCHANGE,
    Description,
    Host,
    Library,
    Status,
    Variable,
    description_in,
    harmless,
    instance,
)
from support.settings import Setting, Trials, trials_of
from support.status_table import (
    CREATION,
    ERROR,
    WITHOUT_AN_INSTANCE,
    Cell,
    Row,
    creations,
    rows,
    without_an_instance,
)

#: Another kind: FMUs in C of FMI 3.0, called by the functions of FMI 2.0.
FMI3 = "FMI 3.0"

#: Function and case of a row.
Key = tuple[str, str]

#: Step of the trials [s], and how many come before the state stepping is tried.
H, STEPS = 0.02, 3

#: Stop time where one is defined [s].
STOP = 1.0

#: The rows that need values of their own.
_SETTINGS: Mapping[Key, Callable[[Trials], Setting | None]] = {
    ("fmi2DoStep", "values that the equations overflow with"): lambda trials: trials.overflow,
    ("fmi2ExitInitializationMode", "values that give no start"): lambda trials: trials.no_start,
    ("fmi2GetReal", "outputs of values that give no start"): lambda trials: trials.no_start,
}

_NOT_UTF_8 = b"ta\xffnh"

#: Arguments of fmi2Instantiate that make a call differ from a good one.
CREATIONS: dict[str, dict[str, Any]] = {
    "everything as it should be": {},
    "a name that is empty": {"name": b""},
    "a name of white space": {"name": b" \t\n"},
    "a name of 100,000 characters": {"name": b"n" * MANY},
    "a name that is NULL": {"name": None},
    "a name that is not UTF-8": {"name": _NOT_UTF_8},
    "the type fmi2ModelExchange": {"kind": MODEL_EXCHANGE},
    "a GUID that is NULL": {"guid": None},
    "a GUID that is empty": {"guid": b""},
    "a GUID of another FMU": {"guid": b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"},
    "a GUID that is not UTF-8": {"guid": _NOT_UTF_8},
    "a resource location that is NULL": {"location": None},
    "a resource location that does not exist": {"location": b"file:///nowhere/to/be/found"},
    "a resource location that is not UTF-8": {"location": b"file:///" + _NOT_UTF_8},
    "callbacks that are NULL": {"callbacks": "none"},
    "callbacks without a logger": {"callbacks": "no logger"},
    "logging off": {"logging": False},
}


def mistakes(
    folder: Path, other: Path, kind: str, key: Key, states: Sequence[str]
) -> dict[str, str]:
    """Answers of an FMU that differ from the cells of a row, by state.

    Args:
        folder: of the unpacked FMU.
        other: of another FMU, which lends a state.
        kind: of both, or :data:`FMI3`.
        key: of the row.
        states: columns.

    """
    library, company = _prepared(folder, other, kind)
    found = {}
    for state in states:
        try:
            _check(library, company, kind, key, state)
        except Exception as error:  # PythonFMU may leave the exception of an earlier trial.
            found[state] = f"{type(error).__name__}: {error}".splitlines()[0]
    return found


def _check(library: Library, company: Company, kind: str, key: Key, state: str) -> None:
    function, case = key
    if function == CREATION:
        _check_creation(library, case, creations(kind)[case])
    elif function == WITHOUT_AN_INSTANCE:
        _check_without_an_instance(library, case)
    else:
        _check_cell(library, key, state, company)


@cache
def _prepared(folder: Path, other: Path, kind: str) -> tuple[Library, Company]:
    """The library of an FMU, and what its trials need beside it."""
    load = Fmi3Library if kind == FMI3 else Library
    library = load(folder)
    with instance(load(other)) as foreign:
        content = foreign.content()
    beside = Host(library)
    assert beside.instantiate()
    assert beside.setup() == beside.enter() == beside.exit() == Status.OK
    return library, Company(beside, content)


class Company(NamedTuple):
    """Instances and states that a trial needs in addition."""

    other: Host  #: another instance of the same FMU, stepping
    foreign: bytes  #: a serialised state of another FMU


@cache
def has_call(name: str, key: tuple[str, str]) -> bool:
    """True if a component has the ports for the call of a row."""
    return CASES[key](_draw(_description(name))) is not None


@cache
def _description(name: str) -> Description:
    """Description of a component's FMU, without building it."""
    text = fmi2_description(source_of(name).definition, "")
    return description_in(ElementTree.fromstring(text), PYTHON)


def _draw(description: Description, time: float = 0.0) -> Draw:
    return Draw(Random(1), description, time, STOP)


def _check_cell(library: Library, key: Key, state: str, company: Company) -> None:
    row = rows()[key]
    cell = row.cells[state]
    ways = [Trial.check_next_step]
    if cell.answer.name == "discarded" or cell.answer.fails:
        ways += [Trial.check_reset, Trial.check_restored]
    for goes_on in ways:
        with instance(library) as host:
            trial = Trial(host, company, row, state)
            trial.check_call()
            goes_on(trial)


class Trial:
    """An instance in the state of a cell, and the call that the cell is about."""

    def __init__(self, host: Host, company: Company, row: Row, state: str) -> None:
        self.host, self.row, self.state = host, row, state
        self.cell: Cell = row.cells[state]
        self.mode = "stepping" if state == ERROR else state
        self.time = 0.0
        found = _SETTINGS.get(row.key)
        self.setting = found and found(trials_of(host.description.name))
        self._reach(state)
        self.good = host.get_state()
        freed = host.get_state()
        self.saved = Saved(
            {OWN: host.get_state(), OTHER: company.other.get_state()},
            {FREED: freed},
            company.foreign,
        )
        assert host.free_state(freed) == Status.OK
        self.draw = _draw(host.description, self.time)
        drawn = CASES[row.key](self.draw)
        assert drawn is not None, f"{host.description.name} has no such port"
        self.call = Call(*row.key, drawn)

    def _reach(self, state: str) -> None:
        host = self.host
        if state == "instantiated":
            return
        assert host.setup(stop=STOP if self.row.case == BEYOND else None) == Status.OK
        if self.setting is not None:
            self._set(self.setting.at_start)
        assert host.enter() == Status.OK
        if state == "initialising":
            return
        assert host.exit() == Status.OK
        for _ in range(STEPS):
            assert self._step() == Status.OK
        if state == "terminated":
            assert host.call("fmi2Terminate") == Status.OK
        if state == ERROR:
            assert host.call("fmi2SetReal", None, 1, None) == Status.Error

    def _set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            variable = self.host.description.find(name)
            assert self.host.set(variable.type, [variable.reference], [value]) == Status.OK

    def _step(self) -> Status:
        status = self.host.step(self.time, H)
        if status == Status.OK:
            self.time += H
        return status

    def _good_step(self) -> Status:
        """A step, after a good initialisation if there was none yet."""
        if self.mode == "instantiated":
            assert self.host.enter() == Status.OK
        if self.mode in ("instantiated", "initialising"):
            assert self.host.exit() == Status.OK
        self.mode = "stepping"
        return self._step()

    # The call

    def check_call(self) -> None:
        host, call, answer = self.host, self.call, self.cell.answer
        if answer.name == "restored" and self.state == "stepping":
            assert self._step() == Status.OK
        values, content, fault = host.values(), _content(host), host.fault()
        if self.setting is not None:
            self._set(self.setting.values)
        host.messages.clear()
        status = make(host, call, self.saved)
        assert status == self._status(), f"the status is {status.name}"
        logged = {f"fmi2{message.status.name}" for message in host.messages}
        if host.library.answers:
            for message in host.messages:
                # PythonFMU tells what it does not support under a name of its own.
                assert message.category in (f"logStatus{message.status.name}", "cppfmu"), message
        if self.state != ERROR or not answer.fails:
            assert not answer.message or answer.message in logged, f"messages: {logged or 'none'}"
        if self.cell.leads_to != ERROR:
            self.mode = self.cell.leads_to
        if answer.name == "restored":
            self._check_what_is_restored(call)
        elif answer.name == "new":
            self._check_as_new()
        else:
            assert host.fault() == (answer.raises_fault or fault), f"fault is {host.fault()}"
            is_set = self._check_what_is_set(call, values)
            if not is_set and answer.changes_nothing and self.setting is None:
                self._check_unchanged(values, content)

    def _status(self) -> Status:
        """Expected status; without the loader only fmi2OK, and fmi2Discard for steps."""
        answer, library, call = self.cell.answer, self.host.library, self.call
        is_get = answer.name == "refused" and "items" in call.arguments
        if not self._is_told_late and (library.answers or not is_get):
            return Status[answer.status.removeprefix("fmi2")]
        return Status.Discard if self.row.function == "fmi2DoStep" else Status.OK

    @property
    def _is_told_late(self) -> bool:
        """True if only the next step reports the refusal, since there is no loader."""
        answer, is_step = self.cell.answer, self.row.function == "fmi2DoStep"
        refused = answer.fails or (answer.name == "discarded" and not is_step)
        return refused and not self.host.library.answers and not self.row.is_unsound

    def _check_what_is_set(self, call: Call, before: Mapping[str, object]) -> bool:
        """True if the call changes values; it must have changed no others."""
        if not call.function.startswith("fmi2Set") or "items" not in call.arguments:
            return False
        if self.cell.answer.changes_nothing:
            return False
        names = {v.reference: v for v in self.host.description.variables}
        taken = {names[i.reference]: i.value for i in call.arguments["items"]}
        after = self.host.values()
        for variable, value in taken.items():
            found = after[variable.name]
            assert _same(variable, found, value), f"{variable.name} is {found}, not {value}"
        allowed = {variable.name for variable in taken} | {"fault"}
        if self.state in ("initialising", "stepping"):
            for causality in ("output", "local"):
                allowed |= {v.name for v in self.host.description.of(causality)}
        changed = {name for name in before if after[name] != before[name]}
        assert changed <= allowed, f"{sorted(changed - allowed)} changed"
        return True

    def _check_unchanged(self, values: Mapping[str, object], content: object) -> None:
        after = self.host.values()
        changed = {name for name in values if after[name] != values[name]} - {"fault"}
        assert not changed, f"{sorted(changed)} changed"
        assert _content(self.host) == content, "the state has changed"

    def _check_what_is_restored(self, call: Call) -> None:
        slot = call.arguments.get("slot") or call.arguments["bytes_of"]
        assert self.host.content() == self.host.serialised(self.saved.states[slot])
        self.mode = "stepping" if slot == OTHER or self.state == ERROR else self.state

    def _check_as_new(self) -> None:
        with instance(self.host.library) as fresh:
            assert self.host.content() == fresh.content(), "not what a new instance is"
        self.time = 0.0

    # Later calls

    def check_next_step(self) -> None:
        answer = self.cell.answer
        if self._is_told_late:
            if self.mode != "terminated":
                assert self._good_step() == Status.Discard, "a step after what was refused"
        elif self.cell.leads_to == ERROR and answer.name != "restored":
            self._check_error()
        elif self.mode == "terminated":
            expected = Status.Error if self.host.library.answers else Status.Discard
            assert self._step() == expected, "a step after the end"
        else:
            if self.setting is not None:
                self._set(self.setting.good)
            assert self._good_step() == Status.OK, "the next good step is refused"

    def _check_error(self) -> None:
        host = self.host
        for what, status in (
            ("a step", host.step(self.time, H)),
            ("fmi2SetReal", host.set("Real", [], [])),
            ("fmi2EnterInitializationMode", host.enter()),
            ("fmi2Terminate", host.call("fmi2Terminate")),
        ):
            assert status == Status.Error, f"{what} is answered {status.name} in the state error"
        host.values()

    def check_reset(self) -> None:
        assert self.host.call("fmi2Reset") == Status.OK
        assert not self.host.fault()
        self.mode, self.time = "instantiated", 0.0
        assert self._good_step() == Status.OK, "a step is refused after fmi2Reset"

    def check_restored(self) -> None:
        assert self.host.set_state(self.good) == Status.OK
        assert not self.host.fault()
        self.mode = "stepping" if self.state == ERROR else self.state
        if self.mode != "terminated":
            assert self._good_step() == Status.OK, "a step is refused after fmi2SetFMUstate"


def _content(host: Host) -> object:
    """The state without `fault`; None if it cannot be read."""
    return states.without_fault(host.content())


def _same(variable: Variable, found: object, wanted: object) -> bool:
    if variable.type == "String":
        assert isinstance(found, bytes)
        return found.decode() == wanted
    return bool(found) == bool(wanted) if variable.type == "Boolean" else found == wanted


@contextmanager
def _location(library: Library, case: str) -> Iterator[dict[str, Any]]:
    """Make a folder with invalid resources."""
    resources = library.folder / "resources"
    with TemporaryDirectory(prefix="auv_fmu_resources_") as folder:
        made = Path(folder, "resources")
        if case == "a resource location that is a plain path":
            made = resources
        elif case == "a resource location that is an empty folder":
            made.mkdir()
        elif case == "a resource location whose slavemodule.txt is garbage":
            _copied(resources, made)
            (made / "slavemodule.txt").write_bytes(b"\xff\x00/../garbage\n")
        elif case == "a resource location whose script raises":
            _copied(resources, made)
            (made / "raising.py").write_text("raise RuntimeError('on purpose')\n")
            (made / "slavemodule.txt").write_text("raising")
        else:
            yield CREATIONS[case]
            return
        plain = case == "a resource location that is a plain path"
        yield {"location": str(made).encode() if plain else made.as_uri().encode()}


def _copied(resources: Path, made: Path) -> None:
    if resources.exists():
        shutil.copytree(resources, made)
    else:
        made.mkdir()


def _check_creation(library: Library, case: str, possible: bool) -> None:
    host = Host(library)
    with _location(library, case) as arguments:
        made = host.instantiate(**arguments)
    assert made == possible, "an instance" if made else "no instance"
    if made:
        assert host.setup() == host.enter() == host.exit() == host.step(0.0, 0.02) == Status.OK
        host.free()
    else:
        messages = [message.text for message in host.messages]
        assert len(messages) == 1, f"{len(messages)} messages: {messages}"
        assert "\n" not in messages[0]
    with instance(library) as after:
        assert after.setup() == Status.OK, "no instance can be made any more"


def _check_without_an_instance(library: Library, case: str) -> None:
    with instance(library) as witness:
        assert witness.setup() == Status.OK
        before = witness.content()
        target: int | None = None
        memory = (c_int * 64)()
        if case == "an instance that was freed":
            gone = Host(library)
            assert gone.instantiate()
            target = gone.component
            gone.free()
        elif case == "a pointer to something else":
            target = addressof(memory)
        for name, arguments in harmless().items():
            status = witness.call_on(target, name, *arguments)
            assert f"fmi2{status.name}" == without_an_instance()[case], f"{name}: {status.name}"
        witness.library.functions.fmi2FreeInstance(c_void_p(target))
        assert list(memory) == [0] * 64
        assert witness.content() == before
        assert witness.enter() == Status.OK, "the state of another instance has changed"
