"""docs/reference/fmi-answers.md, cell by cell, for each FMU as a C program would call it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from itertools import cycle
from pathlib import Path

import fmpy
import pytest

from fmus.native.names import RUNTIME
from orchestrator.runs import bundle
from support.calls import CASES, MODEL_EXCHANGE_FUNCTIONS
from support.cells import has_call
from support.kinds import FIXTURES
from support.raw import TYPES
from support.settings import NAMES, REPRESENTATIVES
from support.status_table import (
    CREATION,
    ERROR,
    STATES,
    WITHOUT_AN_INSTANCE,
    creations,
    names_in_fmi3,
    rows,
    without_an_instance,
)
from support.trials import CREATIONS, FMI3, Place, trials
from support.worker import Lost, Worker

#: Longest time for a trial, on a slow machine [s].
PATIENCE = 60.0

#: By name: what the test of a cell is called.
CELLS: dict[str, Place] = {
    **{f"{row} - {state}": (key, state) for key, row in rows().items() for state in row.cells},
    **{f"{CREATION}: {case}": ((CREATION, case), "") for case in creations()},
    **{f"on {what}": ((WITHOUT_AN_INSTANCE, what), "") for what in without_an_instance()},
}

#: Cells that hold in FMI 3.0 under other names; it has no resources to be found.
OF_BOTH_VERSIONS = {
    name: (key, state)
    for name, (key, state) in CELLS.items()
    if key[0] in names_in_fmi3() and (state or (key[1] in CREATIONS and "resource" not in key[1]))
}

#: Cells that PythonFMU's own library has a part in, and no guard of ours.
UNGUARDED = (
    "fmi2FreeFMUstate",
    "fmi2GetBooleanStatus",
    CREATION,
    WITHOUT_AN_INSTANCE,
    *MODEL_EXCHANGE_FUNCTIONS,
)

#: Cells that hold without the native loader.
OF_THE_SLAVE = {
    name: (key, state)
    for name, (key, state) in CELLS.items()
    if key[0] not in UNGUARDED
    and state != ERROR
    and not (rows()[key].cells[state].answer.fails and rows()[key].is_unsound)
}

#: With ports of most types.
PLAIN = "ObserverController"


#: Calls that the loader stops, and what becomes of them without it: one of each kind.
WITHOUT_THE_LOADER = {
    ("fmi2SetDebugLogging", "categories NULL, n > 0"): "crash",
    ("fmi2SetReal", "references NULL, n > 0"): "crash",
    ("fmi2SetReal", "n = 2^60"): "crash",
    ("fmi2SetString", "a text that is not UTF-8"): "fmi2Fatal, then crash",
    ("fmi2SetString", "a text that is NULL"): "fmi2OK",
    ("fmi2GetReal", "values NULL, n > 0"): "crash",
    ("fmi2GetFMUstate", "NULL"): "crash",
    ("fmi2SetFMUstate", "NULL"): "fmi2Fatal, then crash",
    ("fmi2SetFMUstate", "a pointer to something else"): "crash",
    ("fmi2FreeFMUstate", "NULL"): "crash",
    ("fmi2SerializedFMUstateSize", "a pointer to something else"): "crash",
    ("fmi2SerializeFMUstate", "bytes NULL"): "crash",
    ("fmi2DeSerializeFMUstate", "bytes NULL, n > 0"): "fmi2OK",
    ("fmi2DeSerializeFMUstate", "state NULL"): "crash",
    ("fmi2GetRealStatus", "NULL"): "crash",
    ("fmi2GetBooleanStatus", "fmi2Terminated"): "fmi2OK",
    ("fmi2Instantiate", "a name that is NULL"): "crash",
    ("fmi2Instantiate", "a name that is not UTF-8"): "crash",
    ("fmi2Instantiate", "the type fmi2ModelExchange"): "an instance",
    ("fmi2Instantiate", "a GUID of another FMU"): "an instance",
    ("fmi2Instantiate", "a resource location that is NULL"): "crash",
    ("fmi2Instantiate", "a resource location that does not exist"): "crash",
    ("fmi2Instantiate", "a resource location whose slavemodule.txt is garbage"): "crash",
    ("no instance", "NULL"): "crash",
}


def unpacked(fmus: Path, folder: Path, *names: str) -> list[Path]:
    return [Path(fmpy.extract(fmus / f"{name}.fmu", folder / name)) for name in names]


#: What stands for the others in the fast tests: every kind, and every one of the representatives.
FAST = set(zip((*FIXTURES, FMI3), cycle(REPRESENTATIVES), strict=False))

# All components share what answers. So each cell is tried with a representative of each kind, and
# with one of the others in turn.


def having(kind: str, place: Place, turn: int) -> Iterator[str]:
    """The components that a cell is tried with."""
    key, state = place
    able = [name for name in NAMES if not state or has_call(name, key)]
    yield from (name for name in able if (kind, name) in FAST)
    others = REPRESENTATIVES if kind == FMI3 else NAMES
    ordered = [others[(turn + i) % len(others)] for i in range(len(others))]
    yield from [name for name in ordered if name in able and (kind, name) not in FAST][:1]


#: Kinds, components, and the cells that they have.
ALL = [
    pytest.param(
        kind,
        name,
        cell,
        id=f"{kind}-{name}-{cell}",
        marks=() if (kind, name) in FAST else pytest.mark.slow,
    )
    for kind in (*FIXTURES, FMI3)
    for turn, (cell, place) in enumerate((OF_BOTH_VERSIONS if kind == FMI3 else CELLS).items())
    for name in having(kind, place, turn)
]


@pytest.fixture(scope="module")
def workers(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str, str], Worker[Place, str]]]:
    """Processes that try cells, one for each kind and component."""
    with ExitStack() as stack:

        @cache
        def worker(kind: str, name: str) -> Worker[Place, str]:
            another = NAMES[NAMES.index(name) - 1]
            fmus = request.getfixturevalue({**FIXTURES, FMI3: "dist3"}[kind])
            folders = unpacked(fmus, tmp_path_factory.mktemp("status"), name, another)
            return stack.enter_context(Worker(trials, *folders, kind))

        yield worker


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Worker[Place, str]]:
    """The same for an FMU without the native loader."""
    folder = tmp_path_factory.mktemp("plain")
    bundle.build_bundle(folder, loader="plain")
    with Worker(trials, *unpacked(folder, folder, PLAIN, "AuvPlant")) as process:
        yield process


def hold(worker: Worker[Place, str], cell: Place) -> None:
    wrong = worker.ask(cell, PATIENCE)
    assert not isinstance(wrong, Lost), f"the process is lost: {wrong.why}"
    assert wrong == ""


@pytest.mark.parametrize(("kind", "name", "cell"), ALL)
def test_cell(workers: Callable[[str, str], Worker[Place, str]], kind: str, name: str, cell: str):
    hold(workers(kind, name), CELLS[cell])


@pytest.mark.parametrize("cell", [c for c in OF_THE_SLAVE if has_call(PLAIN, OF_THE_SLAVE[c][0])])
def test_cell_of_a_plain_fmu(plain: Worker[Place, str], cell: str):
    hold(plain, OF_THE_SLAVE[cell])


@pytest.mark.slow
@pytest.mark.parametrize("key", WITHOUT_THE_LOADER, ids=": ".join)
def test_what_becomes_of_calls_on_a_plain_fmu(plain: Worker[Place, str], key: tuple[str, str]):
    wrong = plain.ask((key, "stepping"), PATIENCE)
    expected = WITHOUT_THE_LOADER[key]
    if isinstance(wrong, Lost):
        assert wrong.why.startswith("SIG"), wrong
        assert "crash" in expected
    else:
        # What is freed twice does not crash each time.
        assert wrong.endswith(expected.removeprefix("fmi2").removesuffix(", then crash"))


def test_page_has_the_modes_of_the_runtime():
    """In a mode that host.h does not name, whatever a function is called with is an error."""
    text = (RUNTIME / "host.h").read_text(encoding="utf-8")
    masks = dict(re.findall(r"^#define (\w+) ([^/\n]+)", text, re.MULTILINE))
    modes = dict(zip(("INSTANTIATED", "INITIALISING", "STEPPING", "TERMINATED", "AFTER_ERROR"),
                     STATES, strict=True))  # fmt: skip

    def named(words: str) -> set[str]:
        found = re.findall(r"\w+", words)
        return {modes[word] for word in found if word in modes}.union(
            *(named(masks[word]) for word in found if word in masks)
        )

    def mask(function: str) -> str:
        name = function.removeprefix("fmi2")
        value = re.fullmatch(f"(Get|Set)(?:{'|'.join(TYPES)}|\\w*Status)", name)
        name = "FMUstate" if "FMUstate" in name else value[1] if value else name
        return masks.get(f"MASK_{name}", masks["MASK_NotSupported"])

    answered = {
        function: {
            state
            for row in rows().values()
            for state, cell in row.cells.items()
            if row.function == function and not cell.answer.fails
        }
        for function, _ in rows()
    }
    assert answered == {function: named(mask(function)) for function in answered}


def test_every_row_is_tried():
    assert CASES.keys() == rows().keys()
