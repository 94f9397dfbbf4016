"""Small components whose hooks take given arguments."""

from __future__ import annotations

from functools import cache
from itertools import count
from types import ModuleType
from typing import NamedTuple

_NUMBER = count()

#: Term of each argument in the result of a hook.
_PARTS = {
    "parameters": "0.3 * parameters.p", "state": "0.7 * state.x", "derived": "0.9 * derived",
    "inputs": "0.2 * inputs.u", "t": "0.01 * t", "h": "h",
}  # fmt: skip

_TEXT = """
from typing import Annotated, NamedTuple
from auv_fmu import Refusal, Variable

class Parameters(NamedTuple):
    p: Annotated[float, Variable("1", "Parameter", tunable=True)] = 1.0
    q: Annotated[int, Variable("1", "Seed")] = 5

class Inputs(NamedTuple):
    u: Annotated[float, Variable("1", "Input")] = 0.5

class State(NamedTuple):
    x: float

class Outputs(NamedTuple):
    y: Annotated[float, Variable("1", "Output")]
    z: Annotated[int, Variable("1", "Whole number")]

def start(parameters: Parameters, inputs: Inputs, t: float) -> State:
    return State(0.3 * (parameters.p + inputs.u + t))

def update({update}) -> State:
    if inputs.u > 9.0:
        raise Refusal("no step")
    return State({updated})

def outputs({outputs}) -> Outputs:
    y = {seen}
    if y > 2.5:
        raise Refusal("no outputs")
    return Outputs(y, 7)
"""

_DERIVE = """
def derive({derive}) -> float:
    return {derived}
"""

_GUARD = """
RESTARTED = "restarted at {t}"

def credible(state: State, inputs: Inputs) -> bool:
    return state.x + inputs.u < 1.5

def restarted(state: State) -> State:
    return State(0.1 * state.x)
"""

_NOISE = """
def seed(parameters: Parameters) -> int:
    return parameters.q

def measured(parameters: Parameters, y: float, n: float) -> float:
    return y + 0.1 * parameters.p * n
"""

_TYPES = {name: name.capitalize() for name in ("parameters", "state", "inputs")}


class Hooks(NamedTuple):
    """The hooks of a component, with their arguments."""

    outputs: tuple[str, ...]
    derive: tuple[str, ...] | None  #: None: there is none
    is_sampled: bool
    is_split: bool
    has_guard: bool
    has_noise: bool


@cache
def component(hooks: Hooks) -> ModuleType:
    """The module of a component."""
    update = ("parameters", "state", "inputs", "t", "h", *(["derived"] if hooks.derive else []))
    text = _TEXT.format(
        update=_typed(update), updated=_sum(update), outputs=_typed(hooks.outputs),
        seen=_sum(hooks.outputs),
    )  # fmt: skip
    if hooks.derive:
        text += _DERIVE.format(derive=_typed(hooks.derive), derived=_sum(hooks.derive))
    text += _GUARD * hooks.has_guard + _NOISE * hooks.has_noise
    text += f"SAMPLED = {hooks.is_sampled}\n" + "H_MAX = 0.05\n" * hooks.is_split
    module = ModuleType(f"variant_{next(_NUMBER)}")
    exec(compile(text, module.__name__, "exec", dont_inherit=True), vars(module))
    return module


def _typed(arguments: tuple[str, ...]) -> str:
    return ", ".join(f"{name}: {_TYPES.get(name, 'float')}" for name in arguments)


def _sum(arguments: tuple[str, ...]) -> str:
    return " + ".join(_PARTS[name] for name in arguments)
