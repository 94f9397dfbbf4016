"""Hooks of a component: each mistake is reported in one line that names it."""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from fmus.ports.behaviour import EXCHANGE, HOOKS, _message, read_behaviour
from fmus.ports.groups import Nothing
from fmus.ports.port import Misdeclared
from orchestrator.machine.identity import package_folder

GOOD = """\
from __future__ import annotations

from typing import NamedTuple


class State(NamedTuple):
    x: float


class Gains(NamedTuple):
    k: float


class Outputs(NamedTuple):
    y: tuple[float, float]


def start(parameters: Gains) -> State:
    return State(parameters.k)


def update(h: float, state: State) -> State:
    return _moved(state, h)


def outputs(state: State, parameters: Gains) -> Outputs:
    return Outputs((state.x, parameters.k))


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


def test_types_and_hooks_are_read_from_the_text(tmp_path, monkeypatch):
    made = behaviour(tmp_path, monkeypatch, GOOD)
    assert [name for name, hook in made.hooks.items() if hook] == ["start", "outputs", "update"]
    assert (made.state.__name__, made.parameters.__name__) == ("State", "Gains")
    assert (made.inputs, made.derived, made.noisy, made.draws) == (Nothing, None, "", 0)


def test_hooks_take_what_they_need_in_any_order(tmp_path, monkeypatch):
    made = behaviour(tmp_path, monkeypatch, GOOD + SEED + MEASURED)
    assert (made.noisy, made.draws) == ("y", 2)
    assert made.arguments("update") == ("h", "state")
    assert made.arguments("measured") == ("n", "y")


@pytest.mark.parametrize(
    "use", ["k = {}(2.0)", "f = lambda: {}(2.0)", "def inner() -> float:\n        return {}(2.0)"]
)
@pytest.mark.parametrize("name", ["moved", "helper", "chek", "Advance"])
def test_a_function_that_another_calls_may_have_any_name(tmp_path, monkeypatch, name, use):
    helper = f"def {name}(x: float) -> float:\n    return x\n\n\n"
    caller = f"def _caller() -> None:\n    {use.format(name)}\n\n\n"
    made = behaviour(
        tmp_path, monkeypatch, GOOD.replace("def _moved", f"{helper}{caller}def _moved")
    )
    assert [name for name, hook in made.hooks.items() if hook] == ["start", "outputs", "update"]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("def update", "def _update", "has start, but no update"),
        ("def outputs", "def _outputs", "has no function outputs"),
        (
            "\n\ndef _moved",
            "\n\ndef chek() -> None:\n    pass\n\n\ndef half() -> None:\n    pass\n\n\ndef _moved",
            r"chek is called by no function here; is it check\?$",
        ),
        ("(h: float,", "(h,", "update takes h of no type$"),
        ("(h: float,", "(h: real,", "update has a type that is not known: name 'real' is not "),
        ("-> Outputs:", "-> tuple[float, float]:", r"outputs returns tuple\[float, f"),
        ("(h: float,", "(h: float, dt: float,", "update takes dt, which is not one of"),
        ("\n\ndef _moved", f"{SEED}\n\ndef _moved", "has seed, but no measured"),
        ("\n\ndef _moved", f"{MEASURED}\n\ndef _moved", "has measured, but no seed"),
        ("def _moved", "RESTARTED = 'again'\n\n\ndef _moved", "has RESTARTED, but no credible"),
        (
            "\n\ndef _moved",
            f"{SEED}{MEASURED}\n\ndef _moved".replace(", y: tuple[float, float])", ")"),
            "measured takes 0 groups of outputs, not one",
        ),
        (
            "def _moved",
            "seed = measured = 1\n\n\ndef _moved",
            "seed is not a function, but has the",
        ),
        (
            "start(parameters: Gains)",
            "start(parameters: State)",
            "outputs takes parameters as Gains",
        ),
        (
            "class Gains(NamedTuple):\n    k: float",
            "Gains = float",
            "start takes parameters of the type float; write a NamedTuple",
        ),
        ("(h: float,", "(h: float, derived: State,", "takes derived, but there is no derive"),
        (
            "\n\ndef _moved",
            "\n\ndef switches(state: State) -> State:\n    return state\n\n\ndef _moved",
            "has switches, but no rates",
        ),
        (
            "\n\ndef _moved",
            "\n\ndef rates(state: State) -> float:\n    return 1.0\n\n\ndef _moved",
            "rates returns float; write a NamedTuple of floats",
        ),
        (
            "\n\ndef _moved",
            "\n\ndef rates(state: State) -> Gains:\n    return Gains(1.0)\n\n\ndef _moved",
            "rates returns the rate of k: float; the state has x: float",
        ),
        ("    x: float\n", "    x: str\n", "State.x has the type str; use float, int"),
        ("    x: float\n", "    x: State\n", "State.x is a State within a State"),
        ("    x: float\n", "    x: Real\n", "State.x has a type that is not known: name 'Real'"),
    ],
)
def test_mistakes_are_named(tmp_path, monkeypatch, old, new, why):
    with pytest.raises(TypeError, match=f"^(own_behaviour.*)?{why}"):
        behaviour(tmp_path, monkeypatch, GOOD.replace(old, new))


@pytest.mark.parametrize("text", ["{t:>9}", "{t!r}", "{x}", "{t} {t}", "{", "{t:.2d}", "{}", 7])
def test_messages_that_only_python_could_write_are_refused(text):
    with pytest.raises(Misdeclared, match=r"own\.RESTARTED .*{t:g}"):
        _message("own", text)


# Every argument and every result of every hook, with every type but its own

CLASSES = """\
from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector


class Mode(IntEnum):
    OFF = 0


class Record(NamedTuple):
    x: float
    on: bool


class Parameters(NamedTuple):
    k: float


class Inputs(NamedTuple):
    u: float


class State(NamedTuple):
    x: float
    mode: Mode


class Derived(NamedTuple):
    x: float


class Outputs(NamedTuple):
    y: Annotated[Vector, 2]
    n: int


RESTARTED = "again"
"""

_Y = "Annotated[Vector, 2]"

#: Types of each argument and each result, from the documentation of the hooks.
RIGHT: dict[str, dict[str, str]] = {
    "check": {"parameters": "Parameters", "return": "None"},
    "start": {"parameters": "Parameters", "inputs": "Inputs", "t": "float", "return": "State"},
    "derive": {
        "parameters": "Parameters", "state": "State", "inputs": "Inputs", "t": "float",
        "return": "Derived",
    },
    "outputs": {
        "parameters": "Parameters", "state": "State", "derived": "Derived", "inputs": "Inputs",
        "t": "float", "return": "Outputs",
    },
    "update": {
        "parameters": "Parameters", "state": "State", "derived": "Derived", "inputs": "Inputs",
        "t": "float", "h": "float", "return": "State",
    },
    "credible": {
        "parameters": "Parameters", "state": "State", "inputs": "Inputs", "return": "bool",
    },
    "restarted": {
        "parameters": "Parameters", "state": "State", "inputs": "Inputs", "return": "State",
    },
    "seed": {"parameters": "Parameters", "return": "int"},
    "measured": {"parameters": "Parameters", "n": "tuple[float, float]", "y": _Y, "return": _Y},
    "check_state": {"parameters": "Parameters", "state": "State", "return": "None"},
}  # fmt: skip

WRONG = (
    "float", "bool", "str", "None", "Record", "Parameters", "State", "Outputs", "tuple[int, float]",
    "Annotated[Vector, 3]", "Vector", "float | None",
)  # fmt: skip

#: Draws are floats, however many.
DRAWS = {"float", "Derived", "Inputs", "Parameters"} | {
    word for word in WRONG if word.startswith(("Annotated", "tuple[float"))
}


def of_hooks(patch: pytest.MonkeyPatch, hooks: dict[str, dict[str, str]]) -> ModuleType:
    module = ModuleType("own_hooks")
    patch.setitem(sys.modules, module.__name__, module)
    text = CLASSES
    for name, types in hooks.items():
        taken = ", ".join(f"{k}: {hint}" for k, hint in types.items() if k != "return")
        text += f"\n\ndef {name}({taken}) -> {types['return']}: ..."
    exec(text, vars(module))
    return module


def test_hooks_of_the_right_types_are_taken(monkeypatch):
    made = read_behaviour(of_hooks(monkeypatch, RIGHT))
    classes = (made.parameters, made.inputs, made.state, made.derived, made.outputs)
    words = ["Parameters", "Inputs", "State", "Derived", "Outputs"]
    assert [kind.__name__ for kind in classes] == words


@pytest.mark.parametrize(
    ("hook", "argument"), [(hook, argument) for hook, types in RIGHT.items() for argument in types]
)
def test_no_other_type_is_taken(monkeypatch, hook, argument):
    for wrong in WRONG:
        is_draw = (hook, argument) == ("measured", "n") and wrong in DRAWS
        if wrong == RIGHT[hook][argument] or is_draw:
            continue
        module = of_hooks(monkeypatch, {**RIGHT, hook: {**RIGHT[hook], argument: wrong}})
        with pytest.raises(Misdeclared) as caught:
            read_behaviour(module)
        message = str(caught.value)
        assert len(message.splitlines()) == 1
        # Results of start and outputs are compared with arguments of other hooks.
        assert caught.value.place[0] == hook or hook in ("start", "outputs")
        assert argument in (*caught.value.place, "return"), wrong


@pytest.mark.parametrize(
    ("path", "uncalled"), [("native/translator.py", ()), ("python/slave.py", EXCHANGE)]
)
def test_both_kinds_call_every_hook(path, uncalled):
    text = (package_folder("fmus") / path).read_text(encoding="utf-8")
    assert set(re.findall(r"""["'](\w+)["']""", text)) >= HOOKS.keys() - {*uncalled}
