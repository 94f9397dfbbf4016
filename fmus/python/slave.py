"""The slave of a component, made from its definition.

Its methods are written out and compiled, because they run once a step: `advance` of a component
that derives something of its state, may restart, and splits its steps becomes

    def advance(self, state, derived, inputs, t, h, n):
        if not credible(self.parameters, state, inputs):
            self.say(RESTARTED.format(t=t), warning, RESTARTED)
            state = restarted(self.parameters, state, inputs)
        for i in range(n):
            if derived is None:
                derived = derive(self.parameters, state, inputs)
            state = update(self.parameters, state, derived, inputs, t + i * h, h)
            derived = None
        return state, derived

and the method of a simpler one is shorter by what it lacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import isfinite
from types import ModuleType
from typing import Any

from pythonfmu import DefaultExperiment
from pythonfmu.enums import Fmi2Status

from auv_fmu.euler import LARGEST_STATE
from auv_fmu.variable import Refusal
from fmus.ports.behaviour import HOOKS, Behaviour
from fmus.ports.definition import Definition, define
from fmus.ports.groups import (
    SCOPE,
    Nothing,
    gathered,
    hints_of,
    packed,
    reals_first,
    scattered,
    unpacking,
)
from fmus.python.component import Component
from fmus.python.state import measuring


@cache
def slave_of(name: str, module: ModuleType) -> type[Component]:
    """The class of a component, the same each time: an FMU's script asks once an instance.

    Args:
        name: of the component.
        module: that says it all.

    Raises:
        Misdeclared: it is no component.

    """
    definition = define(name, module)
    said, norm = definition.behaviour, measuring(definition.behaviour.state)
    inputs = [port for port in definition.ports if port.causality == "input"]
    members: dict[str, Any] = {
        "__module__": module.__package__ or module.__name__,
        "__doc__": definition.summary,
        **definition.about,
        "description": definition.description,
        "default_experiment": DefaultExperiment(0.0, said.stop, said.step),
        "definition": definition,
        "ports": definition.ports,
        "outputs_of": _made_of(said, "outputs"),
        "derived_of": _made_of(said, "derive"),
        "unpack": staticmethod(unpacking(said.inputs, inputs)),
        "norm": staticmethod(norm),
    }
    scope: dict[str, Any] = {
        **SCOPE,
        **said.hooks,
        "isfinite": isfinite,
        "norm": norm,
        "nothing": Nothing(),
        "Refusal": Refusal,
        "RESTARTED": said.restarted,
        "warning": Fmi2Status.warning,
    }
    methods = [
        *(_method(hook, HOOKS[hook], _plain(said, hook)) for hook in _PLAIN if said.hooks[hook]),
        _method("evaluate", _EVALUATE, _evaluate(definition, scope)),
        _method("advance", _ADVANCE, _advance(said)),
    ]
    if said.hooks["start"] is None:
        methods.append(_method("start", HOOKS["start"], ["return nothing"]))
    for method in methods:
        exec(method, scope, members)
    made = type(name, (Component,), members)
    # PythonFMU looks methods up by names that miss Python's cache: the first class has them.
    for method in ("do_step", "get_real", "set_real", "get_boolean"):
        setattr(made, method, getattr(made, method))
    return made


#: Hooks that a method does nothing but call.
_PLAIN = ("start", "check", "check_state", "seed")

_EVALUATE = ("state", "derived", "inputs", "t", "draws")
_ADVANCE = ("state", "derived", "inputs", "t", "h", "n")


def _made_of(said: Behaviour, hook: str) -> frozenset[str]:
    """What a hook's result changes with."""
    known = ("inputs", "parameters", "t", "state")
    return frozenset(argument for argument in known if said.takes(hook, argument))


def _method(name: str, arguments: tuple[str, ...], lines: Iterator[str] | list[str]) -> str:
    """The text of a method."""
    return "\n    ".join([f"def {name}({', '.join(('self', *arguments))}):", *lines])


def _call(said: Behaviour, hook: str, **given: str) -> str:
    """A call of a hook in a method that has its arguments, and the parameters."""
    given = {"parameters": "self.parameters", **given}
    return f"{hook}({', '.join(given.get(name, name) for name in said.arguments(hook))})"


def _plain(said: Behaviour, hook: str) -> Iterator[str]:
    yield f"return {_call(said, hook, parameters='parameters')}"


def _guard(said: Behaviour, *lines: str) -> Iterator[str]:
    """How a run goes on from another state; the lines are executed where it does."""
    if said.hooks["credible"]:
        yield f"if not {_call(said, 'credible')}:"
        yield from (f"    {line}" for line in (*lines, f"state = {_call(said, 'restarted')}"))


def _derive(said: Behaviour, hook: str, t: str) -> Iterator[str]:
    """How what a hook needs is derived, once."""
    if "derived" in said.arguments(hook):
        yield f"if derived is None: derived = {_call(said, 'derive', t=t)}"


def _advance(said: Behaviour) -> Iterator[str]:
    """How a run goes on."""
    yield from _guard(said, "self.say(RESTARTED.format(t=t), warning, RESTARTED)")
    t, indent = "t", ""
    if said.h_max is not None:
        yield "for i in range(n):"
        t, indent = "t + i * h", "    "
    if said.hooks["update"]:
        for line in _derive(said, "update", t):
            yield indent + line
        yield f"{indent}state = {_call(said, 'update', t=t)}"
    if _made_of(said, "derive") & {"state", "t"}:
        yield f"{indent}derived = None"
    yield f"if not norm(state) <= {LARGEST_STATE}: self.check_size(state)"
    yield "return state, derived"


def _evaluate(definition: Definition, scope: dict[str, Any]) -> Iterator[str]:
    """How outputs are evaluated; the names that it needs are put into the scope."""
    said = definition.behaviour
    yield from _guard(said)
    yield from _derive(said, "outputs", "t")
    yield f"groups = {_call(said, 'outputs')}"
    yield f"values = {packed(said.outputs, 'groups')}"
    # What is finite may still be too large to be added up.
    yield "if not isfinite(sum(values)): self._store.check_outputs(values)"
    if said.noisy:
        yield from _measure(definition, scope)
    yield "return derived, values"


def _measure(definition: Definition, scope: dict[str, Any]) -> Iterator[str]:
    """How an output gets its noise."""
    said = definition.behaviour
    order = [p.name for p in reals_first(definition.ports) if p.causality == "output"]
    values = [f"values[{order.index(name)}]" for name in definition.noisy]
    hint = hints_of(said.outputs)[said.noisy]
    drawn = iter([f"draws[{i}]" for i in range(said.draws)])
    n = gathered(hints_of(said.hooks["measured"])["n"], drawn, scope)
    before = gathered(hint, iter(values), scope)
    flat = ", ".join(text for text, _ in scattered(hint, "noisy"))
    after = "noisy" if flat == "*noisy" else f"({flat},)"
    yield f"noisy = {_call(said, 'measured', **{'n': n, said.noisy: before})}"
    yield f"{', '.join(values)}, = noisy = {after}"
    yield "if not isfinite(sum(noisy)) and not all(map(isfinite, noisy)):"
    yield "    raise Refusal('a sampled output is not finite')"
