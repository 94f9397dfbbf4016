"""Which columns a table gets."""

from __future__ import annotations

import pytest

from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import InputError
from orchestrator.runs.run import selected_columns
from support.archives import fmu, variable
from support.small_fmus import connected


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = fmu(
        tmp_path_factory.mktemp("fmu") / "a.fmu",
        variable("y.x", "output"), variable("u", "input"), variable("k", "parameter"),
        variable("y.z", "output"), variable("n", "output", "Integer"),
    )  # fmt: skip
    return connected("s", dict.fromkeys("ba", path))


@pytest.mark.parametrize(
    ("wanted", "columns"),
    [
        ("outputs", "b.y.x b.y.z b.n a.y.x a.y.z a.n"),
        ("a.y.*", "a.y.x a.y.z"),
        ("a.u", "a.u"),
        # In the order of the table, each once.
        (" a.n ,b.*, ,*.n", "b.u b.y.x b.y.z b.n a.n"),
    ],
)
def test_columns_are_chosen_by_patterns(system, wanted, columns):
    assert selected_columns(system, wanted) == columns.split()
    assert selected_columns(system, wanted, is_companion=True) == columns.split()


def test_all_columns_are_no_choice(system):
    assert selected_columns(system, "all") is None


def test_a_pattern_of_nothing_is_refused_except_where_another_run_has_it(system):
    for wanted in ("a.k", "a.u,c.*"):
        with pytest.raises(InputError, match=wanted[-3:].replace("*", r"\*")):
            selected_columns(system, wanted)
    assert selected_columns(system, "a.u,c.*", is_companion=True) == ["a.u"]
    for is_companion in (False, True):
        with pytest.raises(InputError, match="--columns"):
            selected_columns(system, " , ", is_companion)
