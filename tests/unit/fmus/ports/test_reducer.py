"""Indices: each mistake is reported in one line that names it."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import pytest

from fmus.ports.port import Misdeclared
from fmus.ports.reducer import Reducer, is_reducer, read_reducer

GOOD = """\
from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    z: Annotated[float, Variable("m", "Depth", name="plant.eta.z")]
    k: Annotated[tuple[float, float], Variable({"a": "1", 2: "m"}, "Pair", name="a.k")] = (1.0, 2.0)


class State(NamedTuple):
    largest: float


class Outputs(NamedTuple):
    depth: Annotated[float, Variable("m", "Largest depth")]
    pair: Annotated[tuple[float, float], Variable({"a": "1", 2: "m"}, "Two")]


def start(inputs: Inputs) -> State:
    return State(inputs.z)


def update(acting: Inputs, state: State, h: float) -> State:
    return State(max(state.largest, acting.z))


def outputs(state: State, t: float) -> Outputs:
    return Outputs(state.largest, (t, t))
"""


def reducer(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> Reducer:
    (folder / "own_index.py").write_text(text)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "own_index", raising=False)
    return read_reducer(import_module("own_index"))


def test_what_an_index_says(tmp_path, monkeypatch):
    found = reducer(tmp_path, monkeypatch, GOOD)
    assert (found.name, found.last) == ("own_index", None)
    assert [port.name for port in found.ports] == ["plant.eta.z", "a.k.a", "a.k[2]"]
    assert found.defaults == {"a.k.a": 1.0, "a.k[2]": 2.0}
    columns = {name: [port.name for port in ports] for name, ports in found.results.items()}
    assert columns == {"depth": ["depth"], "pair": ["pair.a", "pair[2]"]}
    assert found.meanings == {"depth": "Largest depth", "pair": "Two"}
    assert found.arguments("update") == ("acting", "state", "h")
    assert is_reducer(sys.modules["own_index"])


def test_the_end_of_the_run_that_it_describes_is_declared(tmp_path, monkeypatch):
    assert reducer(tmp_path, monkeypatch, f"{GOOD}\n\nLAST = 3\n").last == 3.0


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("def start", "def begin", "own_index has no function start"),
        ("def update", "def updated", "own_index.updated is called by no function here; is it upd"),
        ("acting: Inputs", "row: Inputs", "own_index.update takes row, which is not one of state,"),
        ("acting: Inputs", "acting: State", "own_index.update takes acting as State; write Inputs"),
        ("acting: Inputs", "acting", "own_index.update takes acting of no type"),
        ("h: float", "h: int", "own_index.update takes h as int; write float"),
        ("inputs: Inputs) -> State", "inputs: Inputs) -> float", "returns float; write State"),
        ("-> Outputs:", "-> float:", "own_index has outputs of the type float; write a NamedTuple"),
        ("    depth: Annotated[float", "    depth: Annotated[int", "only a float has a unit"),
        ('Variable("m", "Largest', 'Variable("m", name="d", description="Largest', "is called d; "),
        ("largest: float", "largest: str", "State.largest has the type str"),
        ('Annotated[float, Variable("m", "Depth", name="plant.eta.z")]', "float", "z has no unit"),
    ],
)  # fmt: skip
def test_a_mistake_is_told(tmp_path, monkeypatch, before, after, words):
    assert GOOD.count(before) >= 1
    with pytest.raises(Misdeclared) as raised:
        reducer(tmp_path, monkeypatch, GOOD.replace(before, after, 1))
    assert words in str(raised.value)


@pytest.mark.parametrize("last", ["-1.0", "'5'", "True"])
def test_the_end_is_some_seconds(tmp_path, monkeypatch, last):
    with pytest.raises(Misdeclared, match="write seconds, more than 0"):
        reducer(tmp_path, monkeypatch, f"{GOOD}\n\nLAST = {last}\n")
