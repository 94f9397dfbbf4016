"""docs/reference/fmi-answers.md, row by row, for an FMU of each kind as C would call it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import fmpy
import pytest

from fmus.kinds import NATIVE, PYTHON
from support.calls import CASES, MODEL_EXCHANGE_FUNCTIONS
from support.cells import CREATIONS, FMI3, Key, has_call, mistakes
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

#: Longest time for a row, on a slow machine [s].
PATIENCE = 120.0

#: FMUs without the native loader.
PLAIN = "plain"

#: The component that stands for the others of each kind: all share what answers. The second one is
#: tried where the first has no such port.
COMPONENTS = {PYTHON: REPRESENTATIVES, NATIVE: REPRESENTATIVES[::-1], FMI3: REPRESENTATIVES}
OTHERS = [name for name in NAMES if name not in REPRESENTATIVES]

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

#: The creation that a component without rates refuses.
OF_RATES = (CREATION, "the type fmi2ModelExchange")

#: Functions that PythonFMU's own library answers in part, without a guard.
UNGUARDED = (
    "fmi2FreeFMUstate",
    "fmi2GetBooleanStatus",
    CREATION,
    WITHOUT_AN_INSTANCE,
    *MODEL_EXCHANGE_FUNCTIONS,
)

#: Tries a row on an FMU of a kind and gives the mistakes.
Try = Callable[[str, str, Key, Sequence[str]], dict[str, str]]


def with_port(key: Key, names: Sequence[str]) -> list[str]:
    """The components with the port that a row needs."""
    return [name for name in names if key not in rows() or has_call(name, key)]


def states_of(key: Key) -> list[str]:
    """The states of a row; one without a name for a row without an instance."""
    return [*rows()[key].cells] if key in rows() else [""]


def states_without_loader(key: Key) -> list[str]:
    """The states in which a row also holds without the native loader."""
    cells = (
        rows()[key].cells if key[0] not in UNGUARDED and has_call(REPRESENTATIVES[1], key) else {}
    )
    is_unsound = key in rows() and rows()[key].is_unsound
    return [s for s, cell in cells.items() if s != ERROR and not (cell.answer.fails and is_unsound)]


@pytest.fixture(scope="module")
def tried(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Try]:
    """Rows are tried in a process of their own, which may crash."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:

        @cache
        def unpacked(kind: str, name: str) -> Path:
            fmus = request.getfixturevalue({**FIXTURES, FMI3: "dist3", PLAIN: "plain"}[kind])
            folder = tmp_path_factory.mktemp("status")
            return Path(fmpy.extract(fmus / f"{name}.fmu", folder))

        def answer(kind: str, name: str, key: Key, states: Sequence[str]) -> dict[str, str]:
            another = NAMES[NAMES.index(name) - 1]
            folders = unpacked(kind, name), unpacked(kind, another)
            return pool.submit(mistakes, *folders, kind, key, states).result(PATIENCE)

        yield answer


@pytest.mark.parametrize(
    ("kind", "key"), [pytest.param(k, key, id=f"{k}-{key}") for k in KEYS for key in KEYS[k]]
)
def test_row(tried: Try, kind: str, key: Key):
    names = (*COMPONENTS[kind], *NAMES)
    if key == OF_RATES:
        names = REPRESENTATIVES[1:]
    assert tried(kind, with_port(key, names)[0], key, states_of(key)) == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "key", "turn"),
    [
        pytest.param(kind, key, turn % len(OTHERS), id=f"{kind}-{key}")
        for kind in KEYS
        for turn, key in enumerate(KEYS[kind])
        if key != OF_RATES
    ],
)
def test_row_of_the_others_in_turn(tried: Try, kind: str, key: Key, turn: int):
    name = with_port(key, OTHERS[turn:] + OTHERS[:turn])[0]
    assert tried(kind, name, key, states_of(key)) == {}


@pytest.mark.parametrize("key", [key for key in rows() if states_without_loader(key)])
def test_row_of_a_plain_fmu(tried: Try, key: Key):
    assert tried(PLAIN, REPRESENTATIVES[1], key, states_without_loader(key)) == {}


def test_every_row_is_tried():
    assert CASES.keys() == rows().keys()
