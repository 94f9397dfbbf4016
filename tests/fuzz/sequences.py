"""Attack FMUs with random sequences of calls and with serialised states that were tampered with.

    PYTHONPATH=tests python -m fuzz.sequences --fmus fmus/dist fmus/dist/native --runs 10000

A call is drawn when the ones before it are answered: most are sensible, many are not, and some
values are extreme. It must be answered as fmi-answers.md says. An instance that gets the good calls
alone must keep the same values and states, and where there are FMUs of both kinds, both must answer
alike. FMUs are native code, so everything runs in processes of its own.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from ctypes import byref, c_double, c_int
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from fuzz.mutants import Trials, reached
from support import states
from support.calls import BEYOND, CASES, ODD_TRUTH, SAME, Call, Draw, Item, Saved, make
from support.hosts import sanitize, sanitizers
from support.raw import (
    LAST_SUCCESSFUL_TIME_KIND,
    TERMINATED_KIND,
    TYPES,
    Host,
    Library,
    Status,
    Variable,
)
from support.settings import trials_of
from support.status_table import ERROR, MODES, Cell, rows
from support.worker import Lost, Worker

SEQUENCES, STATES = KINDS = ("sequences", "states")

#: Seeds in one task, and the longest time for one of them [s].
BATCH, PATIENCE = 25, 30.0

#: Calls of a sequence.
LEAST, MOST = 4, 60

#: Shares of calls that are sensible where they are made, and of values that are extreme.
SENSIBLE, EXTREME = 0.7, 0.03

#: After so many calls the serialised states are compared, too.
STATES_EVERY = 10

#: Steps from the last state, and once more when it is restored, and their length [s].
STEPS, H = 3, 0.02

#: By which share of a time a step may end after the stop time.
ROUNDING = 1e-9

#: Beyond these sizes values are legal, but where the equations lead with them is not foretold.
LARGEST_TAME, SMALLEST_TAME = 1e4, 1e-6

_FIXED, _STEP = "a fixed parameter", "a step"

#: How much more often than other good calls these are made.
_WEIGHTS = {
    ("fmi2DoStep", "a step"): 40,
    ("fmi2DoStep", "a step of another length"): 6,
    ("fmi2SetReal", "all inputs"): 15,
    ("fmi2SetReal", "an input"): 6,
    ("fmi2SetReal", "a tunable parameter"): 6,
    ("fmi2SetReal", "a fixed parameter"): 6,
    ("fmi2SetReal", "n = 2^60"): 0.2,
    ("fmi2SetReal", "100,000 times the same"): 0.02,
    ("fmi2GetReal", "100,000 times the same"): 0.02,
    ("fmi2EnterInitializationMode", ""): 25,
    ("fmi2ExitInitializationMode", ""): 25,
    ("fmi2SetupExperiment", "start"): 6,
    ("fmi2GetFMUstate", ""): 6,
    ("fmi2SetFMUstate", "a state"): 3,
    ("fmi2SetFMUstate", "a state that was serialised"): 3,
    ("fmi2Reset", ""): 0.5,
    ("fmi2Terminate", ""): 0.7,
}

#: What gets an instance out of where no step is taken any more.
_WAYS_OUT = {("fmi2Reset", ""): 10.0, ("fmi2SetFMUstate", "a state"): 10.0}

#: Rows that need values of their own; extreme values bring them about.
_NOT_DRAWN = {
    ("fmi2DoStep", "values that the equations overflow with"),
    ("fmi2ExitInitializationMode", "values that give no start"),
    ("fmi2GetReal", "outputs of values that give no start"),
}
_ALPHABET = [key for key in rows() if key not in _NOT_DRAWN]

#: Where anything may come, nothing comes often.
_RARELY = [min(_WEIGHTS.get(key, 1.0), 1.0) for key in _ALPHABET]

#: Answers to calls that are in order.
_GOOD = ("OK", "new", "restored")

#: Calls that the rest of a run depends on, those that save and free states, and those that read
#: values, which may have to be computed first.
_MOVING = {
    *(f"fmi2Set{fmi_type}" for fmi_type in TYPES),
    *(f"fmi2{name}FMUstate" for name in ("Get", "Set", "Free")),
    *(f"fmi2{name}InitializationMode" for name in ("Enter", "Exit")),
    *(f"fmi2{name}" for name in ("SetupExperiment", "Terminate", "Reset", "DoStep")),
}
_READING = {f"fmi2Get{fmi_type}" for fmi_type in TYPES}

#: One function PythonFMU spells in its own way; faults of bytes depend on their format.
_OWN_WORDS, _REFUSED_STATE = re.compile("fmi2?GetRealOutputDerivatives"), "state refused: "


class Difference(Exception):
    """An answer that is not the expected one."""


@dataclass
class Known:
    """State of an instance as its answers tell it.

    Attributes:
        mode: of the four that a sound instance has.
        in_error: whether it is in the state error.
        fault: whether something was discarded since the beginning.
        wild: whether it has values that the equations may overflow with, or that may not go with
            others.
        time: where the next step begins [s].
        start, stop: of the run; infinite: no stop time [s].

    """

    mode: str = MODES[0]
    in_error: bool = False
    fault: bool = False
    wild: bool = False
    time: float = 0.0
    start: float = 0.0
    stop: float = inf

    @property
    def state(self) -> str:
        """The column of the tables."""
        return ERROR if self.in_error else self.mode


class Side:
    """An instance of one kind, one beside it that gets the good calls alone, and one that lends."""

    def __init__(self, library: Library, foreign: bytes) -> None:
        self.library = library
        self.hosts = self.host, self.beside, other = [Host(library) for _ in range(3)]
        for host in self.hosts:
            assert host.instantiate()
        assert other.setup() == other.enter() == other.exit() == Status.OK
        lent = other.get_state()
        self.saved, self.saved_beside = Saved({"other": lent}, {}, foreign), Saved({"other": lent})

    def make_beside(self, call: Call) -> Status:
        if call.function == "fmi2SetFMUstate":
            return self.beside.set_state(self.saved_beside.states[_slot_of(call)])
        return make(self.beside, call, self.saved_beside)

    def free(self) -> None:
        for host in self.hosts:
            host.free()


class Play:
    """The sequence of a seed on instances of one kind or both."""

    def __init__(self, seed: int, sides: Sequence[Side], note: Callable[[str], object]) -> None:
        self.sides, self._note = sides, note
        self.description = sides[0].library.description
        self._random = Random(f"{seed} {self.description.name}")
        self._known, self._values = Known(), dict[str, Any]()
        self._saved = {"other": Known(mode="stepping")}

    def play(self) -> None:
        """Make all calls.

        Raises:
            Difference: an answer is not the expected one.

        """
        for k in range(self._random.randrange(LEAST, MOST)):
            call = self._drawn()
            self._note(call.shown(self.description))
            self._make(call)
            self._compare(with_states=k % STATES_EVERY == 0)
        self._compare(with_states=True)
        self._expect_equal("ways on from the state", _ways_on)

    # Drawing

    def _drawn(self) -> Call:
        random, known, [side, *_] = self._random, self._known, self.sides
        fixed = [v for v in self.description.of("parameter") if v.variability == "fixed"]
        self._values = {v.name: side.host.value(v) for v in fixed}
        own = [slot for slot in side.saved.states if slot != "other"]
        freed = [*side.saved.freed]
        times = (known.time, known.stop)
        draw = Draw(random, self.description, own, ["other"], freed, *times, "", self._values)
        if random.random() < EXTREME and (call := _extreme(draw)) is not None:
            return call
        keys, weights = _ALPHABET, _RARELY
        if random.random() < SENSIBLE:
            stuck = known.in_error or known.mode == "terminated"
            keys, weights = _good_keys(known.state), _weights(known.state, stuck)
        while True:
            [key] = random.choices(keys, weights)
            arguments = CASES[key](draw)
            if arguments is not None:
                return Call(*key, arguments)

    # Answers

    def _make(self, call: Call) -> None:
        cell, known = self._cell(call), self._known
        expected, refused = cell.answer.status, False
        is_needed = call.function in _MOVING or (known.wild and call.function in _READING)
        after = self._after(call, cell)
        if cell.answer.name in _GOOD and is_needed:
            [status] = {*(side.make_beside(call) for side in self.sides)}
            if status != Status.OK:
                if not after.wild:
                    raise Difference(f"the instance beside it answers {status.name}")
                expected, refused = f"fmi2{status.name}", True
        for side in self.sides:
            try:
                status = make(side.host, call, side.saved)
            except AssertionError as error:
                raise Difference(str(error)) from error
            if f"fmi2{status.name}" != expected:
                raise Difference(f"{status.name} in the state {known.state}, not {expected}")
        if refused:
            fails = expected == "fmi2Error" and not call.function.startswith("fmi2Get")
            after = replace(known, in_error=known.in_error or fails)
        elif cell.answer.name == "OK" and call.function == "fmi2GetFMUstate":
            self._saved[_slot_of(call)] = replace(known, in_error=False)
        self._known = after

    def _cell(self, call: Call) -> Cell:
        """What the table says to a call."""
        case = call.case
        if case in (_FIXED, SAME, ODD_TRUTH):
            [item] = call.arguments["items"]
            port = self._port(call, item)
            case = SAME if _meant(port, item.value) == self._values[port.name] else _FIXED
        if call.function == "fmi2DoStep" and (case == BEYOND or self._is_beyond(call)):
            case = BEYOND if self._is_beyond(call) else _STEP
        return rows()[call.function, case].cells[self._known.state]

    def _is_beyond(self, call: Call) -> bool:
        known, end = self._known, call.arguments["time"] + call.arguments["h"]
        return bool(end > known.stop + ROUNDING * max(abs(known.start), abs(known.stop)))

    def _port(self, call: Call, item: Item) -> Variable:
        fmi_type = call.function.removeprefix("fmi2Set")
        return self.description.find(self.description.names[item.reference, fmi_type])

    def _after(self, call: Call, cell: Cell) -> Known:
        """What is known once a call was answered as the table says."""
        answer, leads_to = cell
        if answer.name == "new":
            return Known()
        if answer.name == "restored":
            return replace(self._saved[_slot_of(call)])
        fault = self._known.fault or answer.raises_fault
        known = replace(self._known, fault=fault, in_error=leads_to == ERROR)
        if leads_to != ERROR:
            known.mode = leads_to
        if answer.name != "OK":
            return known
        arguments = call.arguments
        if call.function == "fmi2SetupExperiment":
            known.time = known.start = arguments["start"]
            stop = arguments["stop"]
            known.stop = stop if stop is not None and stop > known.start else inf
        elif call.function == "fmi2DoStep":
            known.time = arguments["time"] + arguments["h"]
        elif call.function.startswith("fmi2Set") and "items" in arguments:
            for item in arguments["items"]:
                port = self._port(call, item)
                wild = trials_of(self.description.name).wild.get(port.name)
                known.wild |= _meant(port, item.value) == wild or not _is_tame(port, item.value)
        return known

    # Comparisons

    def _compare(self, *, with_states: bool) -> None:
        for side in self.sides:
            tried, beside = side.host, side.beside
            ours, theirs = ({**host.values(), "fault": None} for host in (tried, beside))
            if ours != theirs:
                changed = [name for name in ours if ours[name] != theirs[name]]
                raise Difference(f"other values than without refused calls: {changed[:5]}")
            # What overflows without any refused call raises it, too.
            if tried.fault() != (self._known.fault or beside.fault()):
                raise Difference(f"fault is {tried.fault()}")
            if with_states and len({*map(_state, (tried, beside))}) > 1:
                raise Difference("another state than without the refused calls")
        self._expect_equal("values", Host.values)
        self._expect_equal("times of the last step", _progress)
        self._expect_equal("messages", _messages)
        for side in self.sides:
            side.host.messages.clear()

    def _expect_equal(self, what: str, answer: Callable[[Host], Any]) -> None:
        """Hold the kinds against each other, as text: it tells -0.0 from 0.0, and nan is nan."""
        one, *others = (answer(side.host) for side in self.sides)
        for other in others:
            if repr(one) != repr(other):
                raise Difference(f"{what} of the kinds differ: {_part(one, other)}")


def _slot_of(call: Call) -> str:
    """The slot of the state that a call is about."""
    slot: str = call.arguments.get("slot") or call.arguments["bytes of"]
    return slot


def _meant(port: Variable, value: Any) -> Any:
    return bool(value) if port.type == "Boolean" else value


def _is_tame(port: Variable, value: object) -> bool:
    """Whether no run can overflow with a value, and no other parameter can speak against it."""
    if not isinstance(value, float):
        return True
    if value in (port.minimum, port.maximum):
        return False
    # Only what is drawn to be extreme is -0.0, where a way may come back to itself.
    return repr(value) == "0.0" or SMALLEST_TAME <= abs(value) <= LARGEST_TAME


@cache
def _good_keys(state: str) -> list[tuple[str, str]]:
    """The rows that are answered well in a state."""
    return [key for key in _ALPHABET if rows()[key].cells[state].answer.name in _GOOD]


@cache
def _weights(state: str, stuck: bool) -> list[float]:
    return [_WEIGHTS.get(key, 1.0) + stuck * _WAYS_OUT.get(key, 0.0) for key in _good_keys(state)]


def _extreme(draw: Draw) -> Call | None:
    """A legal value that is very large or very small."""
    name, random = draw.description.name, draw.random
    settings = [*filter(None, (trials_of(name).overflow, trials_of(name).no_start))]
    if settings and random.random() < 0.3:
        setting = random.choice(settings)
        values = {**setting.at_start, **setting.values}
        port = draw.description.find(random.choice([*values]))
        value = values[port.name]
    else:
        port = random.choice([v for v in draw.settable("Real") if v.name != "h_max"])
        value = random.choice((1e308, -1e308, 1e155, -1e155, 1e20, 5e-324, 1e-200, -0.0))
        value = value if port.minimum is None else max(value, port.minimum)
        value = value if port.maximum is None else min(value, port.maximum)
    case = "an input" if port.causality == "input" else f"a {port.variability} parameter"
    return Call("fmi2SetReal", case, {"items": [Item(port.reference, value)]})


def _state(host: Host) -> str:
    return repr(states.without_fault(host.content()))


def _progress(host: Host) -> tuple[Any, ...]:
    """Progress of the steps, without asking for values."""
    at, over = c_double(), c_int()
    return (
        host.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME_KIND, byref(at)).name, at.value,
        host.call("fmi2GetBooleanStatus", TERMINATED_KIND, byref(over)).name, over.value,
    )  # fmt: skip


def _messages(host: Host) -> list[tuple[Status, str]]:
    """All but those of refused states: the same words are not told twice, and these differ."""
    return [
        (message.status, _OWN_WORDS.sub("", message.text))
        for message in host.messages
        if _REFUSED_STATE not in message.text
    ]


def _ways_on(host: Host) -> list[tuple[Status, list[float]]]:
    """Steps from a state, and from the same state once it is restored."""
    state, found = host.get_state(), []
    for _ in range(2):
        for k in range(STEPS):
            found.append((host.step(k * H, H), host.outputs()))
        assert host.set_state(state) == Status.OK
    return found


def _part(one: Any, other: Any) -> str:
    if isinstance(one, dict):
        names = [name for name in one if repr(one[name]) != repr(other[name])]
        one, other = ({name: said[name] for name in names} for said in (one, other))
    return f"{one!r:.300} and {other!r:.300}"


# In a process of its own


class Task(NamedTuple):
    """Seeds of sequences or of states, and a file for the calls as they are made."""

    kind: str
    seeds: Sequence[int]
    log: Path | None = None


class Finding(NamedTuple):
    """A seed and what came of it."""

    seed: int
    what: str


def serve(kinds: Sequence[Mapping[str, Path]], name: str) -> Callable[[Task], list[Finding]]:
    """Prepare a process for tasks on an FMU.

    Args:
        kinds: folders of unpacked FMUs, for each kind.
        name: of the FMU; another one lends it states.

    """
    libraries = [Library(folders[name]) for folders in kinds]
    lenders = [reached(Library(folders[max(folders, key=name.__ne__)]), 0) for folders in kinds]

    @cache
    def trials() -> list[Trials]:
        return [Trials(*both) for both in zip(libraries, lenders, strict=True)]

    def play(seed: int, note: Callable[[str], object]) -> None:
        sides = [Side(one, lent[-1]) for one, lent in zip(libraries, lenders, strict=True)]
        try:
            Play(seed, sides, note).play()
        finally:
            for side in sides:
                side.free()

    def tried(task: Task, seed: int) -> str:
        calls: list[str] = []

        def note(call: str) -> None:
            calls.append(f"    {call}")
            if task.log:
                task.log.write_text("\n".join(calls), encoding="utf-8")

        try:
            if task.kind == STATES:
                for one in trials():
                    one(seed)
            else:
                play(seed, note)
        except Exception as error:
            return "\n".join([*calls, f"{type(error).__name__}: {error}"])
        return ""

    return lambda task: [Finding(s, said) for s in task.seeds if (said := tried(task, s))]


def attack(
    kinds: Sequence[Mapping[str, Path]], name: str, kind: str, seeds: Sequence[int]
) -> list[Finding]:
    """Attack an FMU; a seed that ends the process is a finding.

    Args:
        kinds: folders of unpacked FMUs, for each kind that is attacked at once.
        name: of the FMU.
        kind: `sequences` or `states`.
        seeds: of them.

    """
    findings: list[Finding] = []
    with Worker[Task, list[Finding]](serve, kinds, name) as worker:
        for first in range(0, len(seeds), BATCH):
            batch = seeds[first : first + BATCH]
            found = worker.ask(Task(kind, batch), PATIENCE * BATCH / 5)
            if isinstance(found, Lost):
                found = [f for seed in batch for f in _alone(worker, kind, seed)]
            findings += found
    return findings


def _alone(worker: Worker[Task, list[Finding]], kind: str, seed: int) -> list[Finding]:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "calls")
        found = worker.ask(Task(kind, [seed], log), PATIENCE)
        if isinstance(found, Lost):
            calls = log.read_text(encoding="utf-8") if log.exists() else ""
            return [Finding(seed, f"{calls}\n{found.why}")]
    return found


@contextmanager
def unpacked(fmus: Sequence[Path]) -> Iterator[dict[str, Path]]:
    """Folders of unpacked FMUs, by name."""
    with tempfile.TemporaryDirectory(prefix="auv_fmu_fuzz_") as temporary:
        folders = {}
        for fmu in fmus:
            folders[fmu.stem] = Path(temporary, fmu.stem)
            with zipfile.ZipFile(fmu) as archive:
                archive.extractall(folders[fmu.stem])
        yield folders


def main() -> int:
    """Command line of the module."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.sequences", description=__doc__)
    parser.add_argument(
        "--fmus", type=Path, nargs="+", default=[Path("fmus/dist")], help="a folder for each kind"
    )
    parser.add_argument(
        "--sanitize",
        action="store_true",
        help="compile the sources of the FMUs again, with AddressSanitizer and UBSan",
    )
    parser.add_argument("--only", nargs="*", help="names of FMUs")
    parser.add_argument("--runs", type=int, default=10_000, help="sequences, and states, an FMU")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--jobs", type=int, default=2, help="FMUs attacked at the same time")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.runs)
    failed = False
    with ExitStack() as stack:
        found = [sorted(folder.glob("*.fmu")) for folder in options.fmus]
        kinds = [stack.enter_context(unpacked(fmus)) for fmus in found]
        if not all(kinds) or len({tuple(folders) for folders in kinds}) > 1:
            parser.error("no FMUs, or not the same ones of each kind: auv-fmu build makes them")
        if options.sanitize:
            for folder in kinds[-1].values():
                sanitize(folder)
            reports = stack.enter_context(sanitizers())
            stack.callback(lambda: print(reports))

        def one(name: str) -> list[tuple[str, list[Finding]]]:
            begin, said = time.monotonic(), []
            for kind in KINDS:
                findings = attack(kinds, name, kind, seeds)
                seconds = time.monotonic() - begin
                counts = f"{len(seeds)} {kind}, {len(findings)} findings, {seconds:.0f} s"
                said.append((f"{name}: {counts}", findings))
            return said

        with ThreadPoolExecutor(options.jobs) as pool:
            for said in pool.map(one, options.only or kinds[0]):
                for summary, findings in said:
                    print(summary, *(f"seed {f.seed}: {f.what}" for f in findings[:5]), sep="\n")
                    failed = failed or bool(findings)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
