"""The fuzzer in CI: few of what it does by the night, and whether it would notice."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from fuzz import sequences
from fuzz.crashing import crashing
from fuzz.mutants import Trials
from fuzz.sequences import KINDS, SEQUENCES, STATES, attack, unpacked
from support import states
from support.hosts import GCC, compiled, sanitized, sanitizers
from support.raw import Library
from support.settings import NAMES, REPRESENTATIVES
from support.worker import Lost, Worker

#: Seeds of CI: those of the night come after them.
SEEDS = {SEQUENCES: range(150), STATES: range(400)}

#: Folders of unpacked FMUs, by name.
Folders = Mapping[str, Path]


@pytest.fixture(scope="module")
def kinds(dist: Path, native: Path) -> Iterator[list[Folders]]:
    with ExitStack() as stack:
        fmus = ([folder / f"{name}.fmu" for name in NAMES] for folder in (dist, native))
        yield [stack.enter_context(unpacked(paths)) for paths in fmus]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_both_kinds_answer_as_the_table_says(kinds: list[Folders], name: str, kind: str):
    """And alike; of states that were tampered with, none is taken that cannot be gone on from."""
    assert attack(kinds, name, kind, SEEDS[kind]) == []


@pytest.mark.slow
@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_sanitizers_find_nothing(shared: Path, native: Path):
    folders = {name: sanitized(shared, native, name) for name in REPRESENTATIVES}
    with sanitizers() as reports:
        for name in REPRESENTATIVES:
            for kind in KINDS:
                assert attack([folders], name, kind, range(100)) == [], reports


# What it found

#: Changes of a stepping state that were taken once, by what they change.
TAKEN_ONCE: dict[str, Callable[[dict[str, Any]], None]] = {
    "start time too large": lambda said: said.update(start_time=10**400),
    "still initialising": lambda said: said.update(mode="initialising"),
    "outputs before the start": lambda said: said.update(
        mode="instantiated", state=None, hidden=None
    ),
}


@pytest.mark.parametrize("name", NAMES)
def test_states_that_were_taken_once_do_no_harm(kinds: list[Folders], name: str):
    python, native = (Trials(Library(folders[name])) for folders in kinds)
    for what, change in TAKEN_ONCE.items():
        said = states.read(python.bases[2])
        assert said is not None and said["mode"] == "stepping"
        change(said)
        python.hold(states.Mutant(states.sealed(said), what))
    for mode in range(4):
        native.hold(states.Mutant(states.with_mode(native.bases[2], mode), f"mode {mode}"))


# Whether it would notice


@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_constant_of_one_kind_alone_is_noticed(kinds: list[Folders], tmp_path: Path):
    name, changed = "DisturbanceGenerator", tmp_path / "DisturbanceGenerator"
    shutil.copytree(kinds[1][name], changed)
    equations = changed / "sources" / "equations.c"
    text = equations.read_text()
    assert text.count("A_f * disturbance_sign(u)") == 1
    equations.write_text(text.replace("A_f * disturbance_sign(u)", "2.0 * A_f"))
    compiled(changed)
    found = attack([{name: kinds[0][name]}, {name: changed}], name, SEQUENCES, range(25))
    assert found
    assert all("of the kinds differ: " in finding.what for finding in found)
    assert any("'tau_w.u'" in finding.what for finding in found)


def test_call_that_ends_the_process_is_told(kinds: list[Folders], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sequences, "serve", crashing)
    [finding] = attack(kinds[:1], "AuvPlant", SEQUENCES, range(40))
    assert finding == (26, "fmi2DoStep()\nSIGABRT")


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
