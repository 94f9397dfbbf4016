"""What a behaviour may say: each mistake is told in one line that names it."""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path

import pytest

from fmus.discovery import package_folder
from fmus.ports.behaviour import HOOKS, _message, read_behaviour
from fmus.ports.groups import Nothing
from fmus.ports.port import Misdeclared

GOOD = """\
from __future__ import annotations

from typing import NamedTuple, TypedDict


class State(NamedTuple):
    x: float


class Gains(NamedTuple):
    k: float


class Outputs(TypedDict):
    y: tuple[float, float]


def begin(parameters: Gains) -> tuple[State, Outputs]:
    return State(0.0), {"y": (0.0, parameters.k)}


def advance(h: float, state: State, parameters: Gains) -> tuple[State, Outputs]:
    return _moved(state, h), {"y": (state.x, parameters.k)}


def _moved(state: State, h: float) -> State:
    return State(state.x + h)
"""

SEED = "\n\ndef seed(parameters: Gains) -> int:\n    return 1\n"
MEASURED = """

def measured(n: tuple[float, float], y: tuple[float, float]) -> tuple[float, float]:
    return n[0] + y[0], n[1] + y[1]
"""


def behaviour(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str):
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "own_behaviour", raising=False)
    (folder / "own_behaviour.py").write_text(text)
    return read_behaviour(import_module("own_behaviour"))


def test_types_and_hooks_are_those_of_the_text(tmp_path, monkeypatch):
    said = behaviour(tmp_path, monkeypatch, GOOD)
    assert [name for name, hook in said.hooks.items() if hook] == ["begin", "advance"]
    assert (said.state.__name__, said.parameters.__name__) == ("State", "Gains")
    assert (said.inputs, said.derived, said.noisy, said.draws) == (Nothing, None, "", 0)


def test_hooks_take_what_they_need_in_any_order(tmp_path, monkeypatch):
    said = behaviour(tmp_path, monkeypatch, GOOD + SEED + MEASURED)
    assert (said.noisy, said.draws) == ("y", 2)
    assert said.arguments("advance") == ("h", "state", "parameters")
    assert said.arguments("measured") == ("n", "y")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("def advance", "def _advance", "has no advance"),
        ("class Outputs(TypedDict)", "class Output(TypedDict)", "has no Outputs"),
        (
            "def _moved",
            "def moved",
            "moved is not one of the hooks check, .*, expected; names of other functions begin "
            "with _$",
        ),
        ("(h: float,", "(h,", "advance takes h of no type$"),
        ("(h: float,", "(h: real,", "advance has a type that is not known: name 'real' is not "),
        (
            "Gains) -> tuple[State, Outputs]:\n    return State",
            "Gains) -> Outputs:\n    return State",
            r"begin does not return tuple\[State, Outputs\]$",
        ),
        (
            "advance(h: float,",
            "advance(h: float, dt: float,",
            "advance takes dt, which is not one of",
        ),
        ("\n\ndef _moved", f"{SEED}\n\ndef _moved", "has seed, but no measured"),
        ("\n\ndef _moved", f"{MEASURED}\n\ndef _moved", "has measured, but no seed"),
        ("def _moved", "RESTARTED = 'again'\n\n\ndef _moved", "has RESTARTED, but no credible"),
        (
            "\n\ndef _moved",
            f"{SEED}{MEASURED}\n\ndef _moved".replace(", y: tuple[float, float])", ")"),
            "measured takes 0 groups of outputs, not one",
        ),
    ],
)
def test_mistakes_are_named(tmp_path, monkeypatch, old, new, why):
    with pytest.raises(TypeError, match=f"^own_behaviour.*{why}"):
        behaviour(tmp_path, monkeypatch, GOOD.replace(old, new))


@pytest.mark.parametrize("text", ["{t:>9}", "{t!r}", "{x}", "{t} {t}", "{", "{t:.2d}", "{}", 7])
def test_messages_that_only_python_could_write_are_refused(text):
    with pytest.raises(Misdeclared, match=r"own\.RESTARTED .*{t:g}"):
        _message("own", text)


@pytest.mark.parametrize("path", ["native/translator.py", "python/slave.py"])
def test_both_kinds_call_every_hook(path):
    text = (package_folder("fmus") / path).read_text(encoding="utf-8")
    assert set(re.findall(r"""["'](\w+)["']""", text)) >= HOOKS.keys()
