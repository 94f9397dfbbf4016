"""Ports and states that are not all doubles: in both kinds alike, bit for bit and word for word."""

from __future__ import annotations

import json
import re
import shutil
import struct
from binascii import crc32
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib import import_module
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from fmpy.validation import validate_fmu
from hypothesis import example, given
from hypothesis import strategies as st

from fmus.ports.definition import define
from fmus.python.slave import slave_of
from fmus.python.state import from_bytes, to_bytes
from support.all_types import build
from support.fmi3 import Fmi3Library
from support.instances import messages_of
from support.raw import Host, Library, Status, initialised, instance

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

#: File and line of an exception, which only the kind in Python has.
_LINE = re.compile(r"component\.py:\d+: ")

MOST, LEAST = 2**31 - 1, -(2**31)

INTEGERS = ("k", "pair[1]", "pair[2]")
REALS = ("u", "v[1]", "v[2]", "v[3]", "A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("all_types")


@pytest.fixture(scope="module")
def libraries(folder: Path) -> Sequence[Library]:
    """The FMUs in Python, in C, and in C of FMI 3.0."""
    return (
        Library(build.python(folder / "python")),
        Library(build.native(folder / "native")),
        Fmi3Library(build.native(folder / "native3", "3")),
    )


def bits(value: Any) -> Any:
    return struct.pack("<d", value) if isinstance(value, float) else value


class Run:
    """An instance by the names of its ports, and its answers so far."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self.time = 0.0
        self.answers: list[Any] = []
        self.saved: list[int] = []

    def note(self, status: Status, *more: Any) -> Status:
        messages = [(message.status, _LINE.sub("", message.text)) for message in self.host.messages]
        self.host.messages.clear()
        self.answers.append((status, messages, *map(bits, more)))
        return status

    def references(self, names: Sequence[str]) -> list[int]:
        return [self.host.description.find(name).reference for name in names]

    def set(self, kind: str, **values: Any) -> Status:
        return self.set_all(kind, values)

    def set_all(self, kind: str, values: dict[str, Any]) -> Status:
        return self.note(self.host.set(kind, self.references([*values]), [*values.values()]))

    def get(self, kind: str, *names: str) -> list[Any]:
        status, values = self.host.get(kind, self.references(names))
        self.note(status, *values)
        return values

    def start(self) -> None:
        self.host.setup()  # no function of FMI 3.0
        for call in (self.host.enter, self.host.exit):
            self.note(call())

    def step(self, h: float = 0.02) -> Status:
        status = self.note(self.host.step(self.time, h))
        self.time += h
        return status

    def look(self) -> dict[str, Any]:
        values = self.host.values()
        values.pop("time", None)
        self.note(Status.OK, *(values[name] for name in sorted(values)))
        return values

    def save(self) -> None:
        self.saved.append(self.host.get_state())

    def restore(self, which: int, serialised: bool) -> None:
        if self.saved:
            state: int | None = self.saved[which % len(self.saved)]
            if serialised:
                _, state = self.host.deserialised(self.host.serialised(state or 0))
            self.note(self.host.set_state(state))


def both(folder: Path, variant: str) -> Sequence[Library]:
    """A variant whose outputs are computed at other times, in Python and in C."""
    made = build.native(folder / variant, component=build.definition(variant))
    return Library(build.python(folder / f"{variant}_python", variant)), Library(made)


@pytest.fixture(scope="module")
def sampled(folder: Path) -> Sequence[Library]:
    return both(folder, "sampled")


@pytest.fixture(scope="module")
def prompt(folder: Path) -> Sequence[Library]:
    return both(folder, "prompt")


@pytest.fixture(scope="module", params=["libraries", "sampled", "prompt"])
def variants(request: pytest.FixtureRequest) -> Sequence[Library]:
    found: Sequence[Library] = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def runs(libraries) -> Iterator[list[Run]]:
    """One of each kind, to be initialised."""
    with ExitStack() as stack:
        yield [Run(stack.enter_context(instance(library))) for library in libraries]


@pytest.fixture
def stepping(libraries) -> Iterator[list[Run]]:
    with ExitStack() as stack:
        yield [Run(stack.enter_context(initialised(library))) for library in libraries]


def answers_agree(runs: Sequence[Run]) -> None:
    """Compare all answers of both kinds; FMI 3.0 has other words in some messages."""
    first, second, *third = (run.answers for run in runs)
    assert first == second
    for answers in third:
        assert [(status, *values) for status, _, *values in first] == [
            (status, *values) for status, _, *values in answers
        ]


@pytest.mark.parametrize("name", ["python", "native", "native3"])
def test_description_is_valid(libraries, folder, name):
    assert validate_fmu(str(folder / f"{name}.fmu")) == []


def test_inputs_start_where_they_are_said_to(runs):
    for run in runs:
        values = run.look()
        assert (values["k"], values["u"], values["go"], values["A[2,1]"]) == (3, 0.25, 1, -1.5)
        run.start()
        values = run.look()
        assert (values["n"], values["x"], values["on"], values["doing"]) == (3, 0.25, 1, 2)
    answers_agree(runs)


def test_numbers_choose_members_and_all_parameters_reach_the_equations(runs):
    for run in runs:
        run.set("Integer", **{"mode": -7, "limits.kind": 2})
        run.set("Integer", **{"step": -3, "mixed.n": 17, "limits.most": 9})
        run.set("Boolean", counts=1)
        run.set("Real", **{"limits.default": 2.5, "K[1,2]": 7.0, "offset[3]": 0.125, "mixed.x": 3})
        run.start()
        assert run.look()["doing"] == -7
        run.step()
        assert run.look()["n"] == 0
        assert run.set("Integer", mode=2) == Status.Error
    answers_agree(runs)


def test_integer_that_leaves_32_bits_discards_the_step(stepping):
    for run in stepping:
        run.set("Integer", k=7)
        for n in (MOST, LEAST):
            run.set_all("Integer", {"pair[1]": n})
            assert run.step() == (Status.Discard if n == MOST else Status.OK)
            run.look()
        texts = [text for _, messages, *_ in run.answers for _, text in messages]
        assert texts == ["step refused at t = 0 s: OverflowError: an integer exceeds 32 bits"]
    answers_agree(stepping)


def test_what_seed_and_noise_raise_is_said_in_both_kinds(libraries):
    for values, why in (
        ({"step": 13}, "initialisation refused: step = 13: no seed"),
        (
            {"limits.default": 0.0},
            "initialisation refused: ZeroDivisionError: float division by zero",
        ),
    ):
        kind = "Integer" if "step" in values else "Real"
        with ExitStack() as stack:
            runs = [Run(stack.enter_context(instance(library))) for library in libraries]
            for run in runs:
                run.set_all(kind, values)
                run.start()
                assert run.answers[-1] == (Status.Error, [(Status.Error, why)])
            answers_agree(runs)


def test_wild_state_is_restarted_with_its_derived_values(stepping):
    for run in stepping:
        run.set("Real", u=1e9)
        assert run.step() == run.step() == run.step() == Status.OK
        run.look()
        assert any("x was wild" in text for _, messages, *_ in run.answers for _, text in messages)
    answers_agree(stepping)


@pytest.mark.parametrize(
    ("kind", "values", "status", "why"),
    [
        ("Integer", {"k": -6}, Status.Discard, "k = -6: must be at least -5"),
        ("Integer", {"pair[1]": 5, "k": -9}, Status.Discard, "k = -9: must be at least -5"),
        ("Integer", {"want": 1}, Status.Discard, "want = 1: use one of 0 (off), 2 (heat), -7 (c"),
        ("Integer", {"n": 1}, Status.Error, "n is an output and cannot be set"),
        ("Boolean", {"on": 1}, Status.Error, "on is an output and cannot be set"),
        ("Boolean", {"fault": 1}, Status.Error, "fault is an output and cannot be set"),
        ("Real", {"u": 5.0, "v[2]": nan}, Status.Discard, "v[2] = nan: must be finite"),
        ("Integer", {"step": 4}, Status.Error, "step is fixed and cannot change after init"),
        ("Real", {"k": 1.0}, Status.Error, "no Real has the value reference 0"),
        ("Boolean", {"k": 1}, Status.Error, "no Boolean has the value reference 0"),
        ("Integer", {"go": 1}, Status.Error, "no Integer has the value reference 2"),
    ],
)  # fmt: skip
def test_values_that_no_port_takes_are_refused_as_a_whole(stepping, kind, values, status, why):
    for run in stepping:
        before = run.look()
        assert run.set_all(kind, values) == status
        assert {**run.look(), "fault": 0} == before
    [(level, text)] = stepping[0].answers[-2][1]
    assert level == status and text.startswith(why)
    answers_agree(stepping)


def test_integers_and_truth_values_can_be_read_as_reals(stepping):
    names = ("doing", "on", "k", "go", "x", "fault", "flags[3]")
    for run in stepping:
        assert run.get("Real", *names) == [2.0, 1.0, 3.0, 1.0, 0.25, 0.0, 0.0]
        assert run.get("Boolean", "on", "fault", "go", "counts") == [1, 0, 1, 1]
    answers_agree(stepping)


def test_outputs_before_the_run_follow_every_set_value(runs):
    """With any type of get call; and there are no outputs without a start."""
    for run in runs:
        run.note(run.host.setup())
        run.note(run.host.enter())
        run.set("Integer", k=11)
        assert run.get("Integer", "n") == [11]
        run.set("Boolean", go=0)
        assert run.get("Boolean", "on", "flags[2]") == [0, 0]
        run.set("Integer", k=12)
        assert run.get("Real", "n") == [12.0]
        run.set("Integer", step=3)
        run.set("Integer", **{"limits.most": 2})
        assert run.get("Boolean", "fault") == [0]
        assert run.get("Integer", "k", "n", "k") == [12, 0, 12]
        assert run.get("Boolean", "on") == [0]
    answers_agree(runs)


#: Single numbers as ports, as groups, and with noise.
SCALARS = """\
from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Parameters(NamedTuple):
    std: Annotated[float, Variable("1", "Deviation")] = 0.5


class Inputs(NamedTuple):
    u: Annotated[float, Variable("1", "Value", -8.0, 8.0)] = 1.0
    w: Annotated[tuple[float, float], Variable("1", "Values")] = (0.0, 2.0)


class Outputs(NamedTuple):
    seen: Annotated[float, Variable()]
    y: Annotated[float, Variable()]
    k: Annotated[int, Variable()]


def outputs(inputs: Inputs, parameters: Parameters) -> Outputs:
    return Outputs(inputs.u, inputs.u + inputs.w[0] * parameters.std, int(1000.0 * inputs.u))


def seed() -> int:
    return 7


def measured(parameters: Parameters, n: float, y: float) -> float:
    return y + parameters.std * n
"""


def test_scalars_are_groups_of_their_own_with_noise_and_ranges(tmp_path, monkeypatch):
    """A Real input in a range is checked, also if all are set in one call."""
    (tmp_path / "scalars.py").write_text(SCALARS)
    monkeypatch.syspath_prepend(tmp_path)
    module = import_module("scalars")
    slave = slave_of("Scalars", module)(instance_name="scalars")
    slave._has_loader = True
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    library = Library(build.native(tmp_path / "native", component=define("Scalars", module)))
    with initialised(library) as host:
        for t, values in enumerate(([3.0, -1.0, 0.5], [3.0, -9.0, 9.0], [8.5, 0.0, 0.0])):
            slave.set_real([0, 1, 2], values)
            status = host.set("Real", [0, 1, 2], values)
            assert status == (Status.Discard if t == 2 else Status.OK)
            assert slave.do_step(t, 0.25)
            assert host.step(t, 0.25) == Status.OK
            _, got = host.get("Real", [3, 4])
            assert [*map(bits, got)] == [*map(bits, slave.get_real([3, 4]))]
            assert host.get("Integer", [5])[1] == slave.get_integer([5]) == [3000]
        [message] = host.messages
    assert messages_of(slave) == [message.text] == ["u = 8.5: must be at most 8"]


MEMBERS = """\
from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Mode(IntEnum):
    OFF = 0
    ON = 1
    FAR = 4


class Inputs(NamedTuple):
    k: Annotated[int, Variable()] = 0


class State(NamedTuple):
    mode: Mode
    last: int


class Outputs(NamedTuple):
    last: Annotated[int, Variable()]


def start() -> State:
    return State(Mode.ON, Mode.FAR)


def update(state: State, inputs: Inputs) -> State:
    return State(Mode((state.mode + inputs.k) % 6), min(state.mode, inputs.k > 0))


def outputs(state: State) -> Outputs:
    return Outputs(state.last)
"""


def test_an_int_may_be_a_member_or_a_truth_value_but_a_member_no_other_int(tmp_path, monkeypatch):
    """An FMU takes its own states; a step to any other is refused."""
    (tmp_path / "members.py").write_text(MEMBERS)
    monkeypatch.syspath_prepend(tmp_path)
    module = import_module("members")
    slave = slave_of("Members", module)(instance_name="members")
    slave._has_loader = True
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    library = Library(build.native(tmp_path / "native", component=define("Members", module)))
    with initialised(library) as host:
        for t, k in enumerate((0, 3, 1, 2, 0)):
            for state in (slave._get_fmu_state(), from_bytes(to_bytes(slave._get_fmu_state()))):
                slave._set_fmu_state(state)
            assert host.set_state(host.get_state()) == Status.OK
            slave.set_integer([0], [k])
            host.set("Integer", [0], [k])
            assert host.get("Integer", [1])[1] == slave.get_integer([1])
            steps = slave.do_step(t, 1.0), host.step(t, 1.0) == Status.OK
            assert steps == ((False, False) if k == 1 else (True, True))
        texts = {"step refused at t = 2 s: ValueError: 5 is not a valid Mode"}
        assert {*messages_of(slave)} == {message.text for message in host.messages} == texts


# Any calls

numbers = st.sampled_from((0, 1, -1, 3, 7, 2, -7, -5, -6, MOST, LEAST, MOST - 3)) | st.integers(
    LEAST, MOST
)
reals = st.floats(-1e3, 1e3) | st.sampled_from((0.0, -0.0, 1e7, 1e99, 1e300, nan, inf))


def some(names: Sequence[str], values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.dictionaries(st.sampled_from(names), values, max_size=4)


calls = st.one_of(
    st.tuples(
        st.just("set_all"), st.just("Integer"), some((*INTEGERS, "step", "n", "mixed.n"), numbers)
    ),
    # Apart from the others: FMI 3.0 has another call for enumerations.
    st.tuples(st.just("set_all"), st.just("Integer"), some(("want",), numbers)),
    st.tuples(st.just("set_all"), st.just("Boolean"), some(("go", "counts"), st.booleans())),
    st.tuples(
        st.just("set_all"),
        st.just("Real"),
        some((*REALS, "gain", "K[2,1]", "limits.default"), reals),
    ),
    st.tuples(
        st.just("set_all"), st.just("Real"), st.fixed_dictionaries(dict.fromkeys(REALS, reals))
    ),
    st.tuples(st.just("step"), st.sampled_from((0.02, 0.02, 0.01, 0.07, 0.0, -1.0, 1e9))),
    st.tuples(st.just("look")),
    st.tuples(st.just("save")),
    st.tuples(st.just("restore"), st.integers(0, 9), st.booleans()),
)


@given(before=st.lists(calls, max_size=4), after=st.lists(calls, max_size=25))
@example(before=[("set_all", "Integer", {"k": MOST})], after=[("step", 0.02), ("look",)])
@example(before=[], after=[("step", 0.02), ("look",), ("step", 0.02), ("look",)])
@example(
    before=[],
    after=[
        ("set_all", "Real", {"v[1]": 1.0, "v[2]": 2.0, "v[3]": 3.0}),
        ("step", 0.02),
        ("save",),
        ("set_all", "Real", {"gain": 2.5}),
        ("step", 0.02),
        ("look",),
        ("restore", 0, True),
        ("set_all", "Real", {"gain": 2.5}),
        ("step", 0.02),
        ("look",),
        ("set_all", "Real", {"u": 1e300}),
        ("step", 0.02),
        ("set_all", "Real", {"u": 0.0, "gain": 0.5}),
        ("step", 0.02),
    ],
)
def test_both_kinds_answer_alike_whatever_is_called(variants, before, after):
    with ExitStack() as stack:
        runs = [Run(stack.enter_context(instance(library))) for library in variants]
        for run in runs:
            for call, *arguments in before:
                getattr(run, call)(*arguments)
            run.start()
            for call, *arguments in after:
                getattr(run, call)(*arguments)
            run.look()
        answers_agree(runs)


@given(first=st.lists(calls, max_size=8), then=st.lists(calls, min_size=1, max_size=8))
def test_run_continues_from_the_bytes_of_its_state(variants, first, then):
    for library in variants:
        with initialised(library) as host, initialised(library) as another:
            left, right = Run(host), Run(another)
            for call, *arguments in first:
                getattr(left, call)(*arguments)
            if any(status == Status.Error for status, *_ in left.answers):
                continue  # it may be in the state error
            _, state = another.deserialised(host.content())
            if right.note(another.set_state(state)) != Status.OK:
                continue  # an earlier call has failed
            right.time, right.answers, left.answers = left.time, [], []
            assert another.content() == host.content()
            for run in (left, right):
                run.saved.clear()
                for call, *arguments in then:
                    getattr(run, call)(*arguments)
                run.look()
            assert [answer[2:] for answer in left.answers] == [
                answer[2:] for answer in right.answers
            ]


# States that no run has led to


def changed(content: bytes, place: Sequence[Any], value: Any) -> bytes:
    """A state of the kind in Python with one other value."""
    document = json.loads(content)
    part = document
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    del document["checksum"]
    return json.dumps({**document, "checksum": crc32(json.dumps(document).encode())}).encode()


@pytest.mark.parametrize(
    ("place", "value", "why"),
    [
        (("state", 0), 1.0, "1.0 is not of type int"),
        (("state", 0), MOST + 1, "an integer exceeds 32 bits"),
        (("state", 0), "1", "'1' is not of type int"),
        (("state", 2), 1, "1 is not of type bool"),
        (("state", 3), 1, "1 is not of type Mode"),
        (("state", 3), 2.0, "2.0 is not of type Mode"),
        (("state", 4), [0.0] * 3, "[0.0, 0.0, 0.0] instead of 4 values"),
        (("state", 4, 3), nan, "a value is not finite"),
        (("state", 5), [[1.0, 2.0], [3.0]], "[3.0] instead of 2 values"),
        (("state", 6, 2, 0), None, "None is not of type bool"),
        (("state", 6, 3), 99, "99 is not of type Mode"),
        (("state", 6, 1), -1, "count = -1"),
        (("inputs", 8), -6, "k = -6: must be at least -5"),
        (("inputs", 8), 1.0, "k = 1.0: must be an Integer"),
        (("inputs", 9), 1, "go = 1: must be a Boolean"),
        (("inputs", 12), 1, "want = 1: use one of 0 (off), 2 (heat), -7 (cool)"),
        (("parameters", "mode"), "COLD", "mode = 'COLD': must be an Enumeration"),
    ],
)
def test_state_of_another_type_is_refused(libraries, place, value, why):
    with initialised(libraries[0]) as host:
        before = host.content()
        _, state = host.deserialised(changed(before, place, value))
        assert host.set_state(state) == Status.Error
        assert [message.text for message in host.messages] == [f"state refused: {why}"]
        assert host.content() == before


#: Bytes of a state in C from its end: the checksum, whether there is a fault, whether the outputs
#: are fresh, and they; of the noise what is drawn, and the generator.
_OUTPUTS = 4 + 4 + 4 + 8 * 4 + 11 * 8
_NOISE = _OUTPUTS + 2 * 8 + 8 + 4 + 4 + 4 * 624
_STATE = _NOISE + 4 + 8 + 4 + 4 + 9 * 8 + 4 + 2 * 4 + 4 + 4 + 8 + 3 * 4


@pytest.mark.parametrize(
    ("place", "word", "why"),
    [
        (_STATE - 4 - 8, 2, "2 is not of type bool"),
        (_STATE - 4 - 8 - 4, 1, "1 is not of type Mode"),
        (_STATE - 4 - 8 - 4 - 4 - 9 * 8, -1, "count = -1"),
        (_STATE - 4 - 8 - 4 - 4 - 9 * 8 - 4 - 2 * 4, -8, "-8 is not of type Mode"),
        (_STATE + 4, 2, "it has missing or unknown parts"),
        (_STATE + 4 + 4, 1, "want = 1: use one of 0 (off), 2 (heat), -7 (cool)"),
        (_STATE + 4 + 4 * 4, 2, "go: must be a Boolean"),
        (_STATE + 4 + 5 * 4, -6, "k = -6: must be at least -5"),
        (_OUTPUTS + 4, 0x40220001, "its noise is none that can be drawn"),
        (_OUTPUTS + 4, 0x7FF80000, "its noise is none that can be drawn"),
        (_OUTPUTS + 2 * 8 + 4, 0x7FF00000, "its noise is none that can be drawn"),
        (_OUTPUTS + 2 * 8 + 8 + 4, 2, "its noise generator has an invalid state"),
        (_OUTPUTS - 4, 0x7FF00000, "x = inf: must be finite"),
        (4 + 4 + 4 + 4, 7, "flags[3]: must be a Boolean"),
        (4 + 4 + 4, 3, "its outputs are neither fresh nor not"),
        (4 + 4, 2, "its fault is neither true nor false"),
    ],
)
def test_words_that_no_state_has_are_refused_in_c(sampled, place, word, why):
    """Places are counted from the end."""
    with initialised(sampled[1]) as host:
        before = bytearray(host.content())
        at = len(before) - place
        before[at : at + 4] = struct.pack("<i", word)
        before[-4:] = struct.pack("<I", crc32(before[:-4]))
        _, state = host.deserialised(bytes(before))
        assert host.set_state(state) == Status.Error
        assert [message.text for message in host.messages] == [f"state refused: {why}"]
