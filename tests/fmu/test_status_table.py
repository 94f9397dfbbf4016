"""docs/reference/fmi-answers.md, row by row, for an FMU of each kind as C would call it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import fmpy
import pytest

from fmus.kinds import NATIVE, PYTHON
from support.calls import CASES, MODEL_EXCHANGE_FUNCTIONS
from support.cells import has_call
from support.kinds import FIXTURES
from support.settings import NAMES, REPRESENTATIVES
from support.status_table import (
    CREATION,
    ERROR,
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

#: A function, and the case of its arguments.
Key = tuple[str, str]

#: The component that stands for the others of each kind: all share what answers. The second one is
#: tried where the first has no such port.
COMPONENTS = {PYTHON: REPRESENTATIVES, NATIVE: REPRESENTATIVES[::-1], FMI3: REPRESENTATIVES}

WITHOUT_STATES = [
    *((CREATION, case) for case in creations()),
    *((WITHOUT_AN_INSTANCE, what) for what in without_an_instance()),
]
KEYS = {
    **{kind: [*rows(), *WITHOUT_STATES] for kind in FIXTURES},
    # There are no resources to be found.
    FMI3: [
        key
        for key in (*rows(), *WITHOUT_STATES)
        if key[0] in names_in_fmi3()
        and (key in rows() or (key[1] in CREATIONS and "resource" not in key[1]))
    ],
}

#: Functions that PythonFMU's own library has a part in, and no guard of ours.
UNGUARDED = (
    "fmi2FreeFMUstate",
    "fmi2GetBooleanStatus",
    CREATION,
    WITHOUT_AN_INSTANCE,
    *MODEL_EXCHANGE_FUNCTIONS,
)

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


def of_the_slave(key: Key) -> list[str]:
    """The states in which a row holds without the native loader."""
    cells = rows()[key].cells if key[0] not in UNGUARDED and has_call(PLAIN, key) else {}
    is_unsound = key in rows() and rows()[key].is_unsound
    return [s for s, cell in cells.items() if s != ERROR and not (cell.answer.fails and is_unsound)]


def unpacked(fmus: Path, folder: Path, *names: str) -> list[Path]:
    return [Path(fmpy.extract(fmus / f"{name}.fmu", folder / name)) for name in names]


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
def plain_worker(
    plain: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Worker[Place, str]]:
    """The same for an FMU without the native loader."""
    folders = unpacked(plain, tmp_path_factory.mktemp("plain"), PLAIN, "AuvPlant")
    with Worker(trials, *folders) as process:
        yield process


def mistakes(worker: Worker[Place, str], key: Key, states: Sequence[str]) -> dict[str, str]:
    """The cells of a row that are not as the table says."""
    said = {state: worker.ask((key, state), PATIENCE) for state in states}
    return {
        state: f"the process is lost: {text.why}" if isinstance(text, Lost) else text
        for state, text in said.items()
        if text
    }


@pytest.mark.parametrize(
    ("kind", "key"), [pytest.param(k, key, id=f"{k}-{key}") for k in KEYS for key in KEYS[k]]
)
def test_row(workers: Callable[[str, str], Worker[Place, str]], kind: str, key: Key):
    names = (*COMPONENTS[kind], *NAMES)
    name = next(name for name in names if key not in rows() or has_call(name, key))
    states = [*rows()[key].cells] if key in rows() else [""]
    assert mistakes(workers(kind, name), key, states) == {}


@pytest.mark.parametrize("key", [key for key in rows() if of_the_slave(key)])
def test_row_of_a_plain_fmu(plain_worker: Worker[Place, str], key: Key):
    assert mistakes(plain_worker, key, of_the_slave(key)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("key", WITHOUT_THE_LOADER, ids=": ".join)
def test_what_becomes_of_calls_on_a_plain_fmu(plain_worker: Worker[Place, str], key: Key):
    wrong = plain_worker.ask((key, "stepping"), PATIENCE)
    expected = WITHOUT_THE_LOADER[key]
    if isinstance(wrong, Lost):
        assert wrong.why.startswith("SIG"), wrong
        assert "crash" in expected
    else:
        # What is freed twice does not crash each time.
        assert wrong.endswith(expected.removeprefix("fmi2").removesuffix(", then crash"))


def test_every_row_is_tried():
    assert CASES.keys() == rows().keys()
