"""The fuzzer in CI: few of what it does by the night, and whether it would notice."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import pytest

from fuzz.model import Model
from fuzz.mutants import Trials, reached
from fuzz.player import GOOD, MAKE, Action, Calls
from fuzz.reachable import faults, without_checksum
from fuzz.sequences import Finding, Fuzzer, unpacked
from support import states
from support.calls import CASES, Call, Draw, Item
from support.hosts import GCC, compiled, sanitized, sanitizers
from support.native_states import Unwritable
from support.raw import Description, Library, instance
from support.settings import EACH, NAMES, REPRESENTATIVES
from support.tiers import slow
from support.worker import Lost, Worker

#: Seeds of CI: those of the night come after them.
SEQUENCES, STATES, TWINS = range(200), range(400), range(200)

#: Folders of unpacked FMUs, by name.
Folders = dict[str, Path]

KINDS = ("python", "native")
each_kind = pytest.mark.parametrize("kind", KINDS)


@pytest.fixture(scope="module")
def kinds(dist: Path, native: Path) -> Iterator[dict[str, Folders]]:
    with ExitStack() as stack:
        yield {
            kind: stack.enter_context(unpacked([folder / f"{name}.fmu" for name in NAMES]))
            for kind, folder in zip(KINDS, (dist, native), strict=True)
        }


#: Kinds and components that are tried with `-m slow`.
OTHERS = [((kind, name),) for kind, name in product(KINDS, NAMES) if name not in REPRESENTATIVES]


@pytest.fixture(
    scope="module", params=[*product(KINDS, REPRESENTATIVES), *slow(*OTHERS)], ids=" ".join
)
def fuzzer(request: pytest.FixtureRequest, kinds: dict[str, Folders]) -> Iterator[Fuzzer]:
    kind, name = request.param
    with Fuzzer(kinds[kind], name) as attacker:
        yield attacker


@pytest.fixture(scope="module", params=KINDS)
def planner(request: pytest.FixtureRequest, kinds: dict[str, Folders]) -> Iterator[Fuzzer]:
    with Fuzzer(kinds[request.param], "MotionPlanner") as attacker:
        yield attacker


def explained(fuzzer: Fuzzer, kind: str, findings: list[Finding]) -> str:
    return fuzzer.explained(kind, findings[0]) if findings else ""


def test_sequences_are_answered_as_the_table_says(fuzzer: Fuzzer):
    findings = [f for _, found in fuzzer.attack("sequences", SEQUENCES) for f in found]
    assert not findings, explained(fuzzer, "sequences", findings)


def test_no_state_is_taken_that_cannot_be_reached(fuzzer: Fuzzer):
    findings = [f for _, found in fuzzer.attack("states", STATES) for f in found]
    assert not findings, explained(fuzzer, "states", findings)


@pytest.mark.parametrize("name", EACH)
def test_kinds_answer_alike(kinds: dict[str, Folders], name: str):
    with Fuzzer(kinds["python"], name, kinds["native"]) as fuzzer:
        findings = [f for _, found in fuzzer.attack("twins", TWINS) for f in found]
        assert not findings, explained(fuzzer, "twins", findings)


@pytest.mark.slow
@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_sanitizers_find_nothing(shared: Path, native: Path):
    folders = {name: sanitized(shared, native, name) for name in NAMES}
    with sanitizers() as reports:
        for name, kind in product(REPRESENTATIVES, ("sequences", "states")):
            with Fuzzer(folders, name) as fuzzer:
                findings = [f for _, found in fuzzer.attack(kind, SEQUENCES) for f in found]
                assert not findings, f"{explained(fuzzer, kind, findings)}\n{reports}"


# What it found


def state_of_a(change: str | None = None, **arguments: object) -> Call:
    cases = {None: "a state", "changed": "bytes that were changed"}
    of = {"slot": "a.s0"} if change is None else {"bytes of": "a.s0", "change": change, "seed": 1}
    return Call("fmi2SetFMUstate", cases[change], {**of, **arguments})


STEP = Call("fmi2DoStep", "a step", {"time": 0.0, "h": 0.02})
KEEP = Call("fmi2GetFMUstate", "", {"slot": "a.s0"})
BEGIN = [
    Call(MAKE, GOOD, {}),
    Call("fmi2EnterInitializationMode", "", {}),
    Call("fmi2ExitInitializationMode", "", {}),
]


def of_planner(*calls: Call) -> Calls:
    return Calls({"a": "MotionPlanner"}, [Action("a", call) for call in calls])


def test_refused_state_does_not_end_the_state_error(planner: Fuzzer):
    null = Call("fmi2SetReal", "values NULL, n > 0", {"items": [Item(0, 1.0)], "null": "values"})
    calls = of_planner(*BEGIN, KEEP, null, STEP, state_of_a("changed"), STEP, state_of_a(), STEP)
    assert planner.replay(calls) == ""


#: Changes of a stepping state that were taken once, by what they change.
TAKEN_ONCE: dict[str, tuple[list[str], Callable[[dict[str, Any]], None]]] = {
    "start time too large": (NAMES, lambda said: said.update(start_time=10**400)),
    "still initialising": (NAMES, lambda said: said.update(mode="initialising")),
    "outputs before the start": (
        NAMES, lambda said: said.update(mode="instantiated", state=None, hidden=None)
    ),
    "damping": (["MotionPlanner"], lambda said: said["parameters"].update(d11=4e11)),
}  # fmt: skip


@each_kind
@pytest.mark.parametrize(
    ("name", "what"), [(name, what) for what, (names, _) in TAKEN_ONCE.items() for name in names]
)
def test_state_that_was_taken_once_does_no_harm(kinds, kind, name, what):
    library = Library(kinds[kind][name])
    contents = reached(library, 1)
    said = next(state for state in map(states.read, contents) if state["mode"] == "stepping")
    _, change = TAKEN_ONCE[what]
    change(said)
    try:
        mutant = states.Mutant(states.sealed(said), what)
    except Unwritable:
        pytest.skip("a state of this kind has no place for that")
    with instance(library) as host:
        Trials(host, contents, []).hold(mutant)


# Whether it would notice


def test_answer_that_is_not_the_tables_is_noticed_and_shrunk(planner: Fuzzer):
    """A good value where the table speaks of NaN: the FMU takes it, which the model denies."""
    reference = planner.description().find("tau_d.u").reference
    wrong = Call("fmi2SetReal", "NaN for a parameter", {"items": [Item(reference, 5.0, False)]})
    calls = of_planner(*BEGIN[:1], KEEP, KEEP, wrong, KEEP, *BEGIN[1:], STEP, STEP)
    assert planner.replay(calls).endswith("OK in the state instantiated, not fmi2Error")
    shrunk = planner.shrunk(calls)
    assert [action.call for action in shrunk.actions] == [BEGIN[0], wrong]
    assert planner.show(shrunk).splitlines()[-1].endswith("tau_d.u=5.0)   # NaN for a parameter")


@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_constant_of_one_kind_alone_is_noticed(kinds: dict[str, Folders], tmp_path: Path):
    changed = tmp_path / "DisturbanceGenerator"
    shutil.copytree(kinds["native"]["DisturbanceGenerator"], changed)
    equations = changed / "sources" / "equations.c"
    text = equations.read_text()
    assert text.count("A_f * disturbance_sign(u)") == 1
    equations.write_text(text.replace("A_f * disturbance_sign(u)", "2.0 * A_f"))
    compiled(changed)
    ours = {"DisturbanceGenerator": kinds["python"]["DisturbanceGenerator"]}
    with Fuzzer(ours, "DisturbanceGenerator", {"DisturbanceGenerator": changed}) as fuzzer:
        findings = [f for _, found in fuzzer.attack("twins", range(25)) for f in found]
        [seen] = {f.what.rpartition(": ")[2] for f in findings}
        assert seen == "values differ"
        assert "tau_w.u" in explained(fuzzer, "twins", findings)


def test_seed_gives_the_same_sequence_again(planner: Fuzzer):
    assert planner.sequence(7) == planner.sequence(7)
    assert planner.sequence(7) != planner.sequence(8)


#: What a process does with the tasks of the next test. As text: a process of its own cannot import
#: what stands in a test.
HARM = """lambda task: (
    __import__("os").abort() if task == "crash"
    else __import__("time").sleep(60.0) if task == "hang"
    else task
)"""


def test_process_that_crashes_or_hangs_is_told_and_replaced():
    with Worker[str, str](eval, HARM) as worker:
        assert worker.ask("crash", 30.0) == Lost("SIGABRT")
        assert worker.ask("fine", 30.0) == "fine"
        hung = worker.ask("hang", 0.5)
        assert isinstance(hung, Lost) and "hangs" in hung.why
        assert worker.ask("fine", 30.0) == "fine"


@each_kind
@pytest.mark.parametrize("name", NAMES)
def test_states_that_were_reached_are_told_from_others(
    kinds: dict[str, Folders], kind: str, name: str
):
    library = Library(kinds[kind][name])
    contents = reached(library, 1)
    said = [without_checksum(content) for content in contents]
    samples = [state for state in said if state is not None]
    assert len(samples) == len(contents)
    for content, state in zip(contents, samples, strict=True):
        assert faults(state, library.description, samples) == []
        assert states.sealed(state) == content, "the checksum is another one"
    random = Random(1)
    changed = [states.mutant(random.choice(contents), random, samples) for _ in range(300)]
    found = [without_checksum(mutant.content) for mutant in changed]
    # Numbers alone, as FMUs in C write them, can often be those of another run.
    most = {"python": 110, "native": 260}[kind]
    assert sum(not faults(state, library.description, samples) for state in found) < most


def test_model_follows_a_run():
    description = Description("none", "", "", ())
    known = Model(description)
    draw = Draw(Random(1), description)
    for function, mode in (
        ("fmi2EnterInitializationMode", "initialising"),
        ("fmi2ExitInitializationMode", "stepping"),
        ("fmi2Terminate", "terminated"),
    ):
        arguments = CASES[function, ""](draw)
        assert arguments is not None
        known = known.after(Call(function, "", arguments), {})
        assert known == replace(Model(description), mode=mode)
