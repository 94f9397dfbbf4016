"""The slave of a component, made from its definition.

Its methods are generated and compiled, because they run once a step. For a component with the hooks
`derive`, `credible` and `restarted` and with `H_MAX`, `advance` is

    def advance(self, state, derived, inputs, t, h, n):
        if derived is None:
            good = credible(self.parameters, state, inputs)
            if not good: state = restarted(self.parameters, state, inputs)
            derived = good, state, derive(self.parameters, state, inputs)
        good, state, known = derived
        if not good: self.log_once(RESTARTED.format(t=t), warning, RESTARTED)
        for i in range(n):
            if known is None: known = derive(self.parameters, state, inputs)
            state = update(self.parameters, state, known, inputs, t + i * h, h)
            known = None
        return state, None

A simpler component gets only the lines that it needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import isfinite
from types import ModuleType
from typing import Any

from pythonfmu import DefaultExperiment
from pythonfmu.enums import Fmi2Status

from auv_fmu.paper.euler import LARGEST_STATE
from fmus.ports.behaviour import HOOKS, Behaviour
from fmus.ports.definition import Definition, define
from fmus.ports.groups import (
    SCOPE,
    Nothing,
    gathered,
    hints_of,
    packed,
    unpacking,
)
from fmus.python.component import Component
from fmus.python.state import measuring


@cache
def slave_of(name: str, module: ModuleType) -> type[Component]:
    """Return the class of a component; it is cached, since each instance of an FMU asks for it.

    Raises:
        Misdeclared: it is not a component.

    """
    definition = define(name, module)
    behaviour, square = definition.behaviour, measuring(definition.behaviour.state)
    inputs = [port for port in definition.ports if port.causality == "input"]
    members: dict[str, Any] = {
        "__module__": module.__package__ or module.__name__,
        "__doc__": definition.summary,
        **definition.about,
        "description": definition.description,
        "default_experiment": DefaultExperiment(0.0, behaviour.stop, behaviour.step),
        "definition": definition,
        "ports": definition.ports,
        "outputs_of": _made_of(behaviour, "outputs"),
        "derived_of": _made_of(behaviour, "derive", *_GUARD),
        "unpack": staticmethod(unpacking(behaviour.inputs, inputs)),
        "square": staticmethod(square),
    }
    scope: dict[str, Any] = {
        **SCOPE,
        **behaviour.hooks,
        "isfinite": isfinite,
        "square": square,
        "nothing": Nothing(),
        "RESTARTED": behaviour.restarted,
        "warning": Fmi2Status.warning,
    }
    methods = [
        *(
            _method(hook, HOOKS[hook], _plain(behaviour, hook))
            for hook in _PLAIN
            if behaviour.hooks[hook]
        ),
        _method("evaluate", _EVALUATE, _evaluate(definition, scope)),
        _method("advance", _ADVANCE, _advance(behaviour)),
    ]
    if behaviour.hooks["start"] is None:
        methods.append(_method("start", HOOKS["start"], ["return nothing"]))
    for method in methods:
        exec(method, scope, members)
    made = type(name, (Component,), members)
    # PythonFMU's look-ups miss Python's method cache, so these are found in the first class.
    for method in ("do_step", "get_real", "set_real", "get_boolean"):
        setattr(made, method, getattr(made, method))
    return made


#: Hooks with a method that only calls them.
_PLAIN = ("start", "check", "check_state", "seed")

#: Hooks that replace a state that is not credible.
_GUARD = ("credible", "restarted")

_EVALUATE = ("state", "derived", "inputs", "t", "draws")
_ADVANCE = ("state", "derived", "inputs", "t", "h", "n")


def _made_of(behaviour: Behaviour, *hooks: str) -> frozenset[str]:
    """Return the arguments that the results of hooks depend on."""
    known = ("inputs", "parameters", "t", "state")
    return frozenset(
        argument for argument in known if any(behaviour.takes(hook, argument) for hook in hooks)
    )


def _method(name: str, arguments: tuple[str, ...], lines: Iterator[str] | list[str]) -> str:
    """Return the text of a method."""
    return "\n    ".join([f"def {name}({', '.join(('self', *arguments))}):", *lines])


def _call(behaviour: Behaviour, hook: str, **given: str) -> str:
    """Return the call of a hook in a method with the same names of arguments."""
    given = {"parameters": "self.parameters", **given}
    return f"{hook}({', '.join(given.get(name, name) for name in behaviour.arguments(hook))})"


def _plain(behaviour: Behaviour, hook: str) -> Iterator[str]:
    yield f"return {_call(behaviour, hook, parameters='parameters')}"


def _known(behaviour: Behaviour, hook: str) -> Iterator[str]:
    """Yield statements that compute the derived values for a hook, once."""
    derive = _call(behaviour, "derive") if "derived" in behaviour.arguments(hook) else "None"
    if behaviour.hooks["credible"]:
        yield from _guarded(behaviour, derive)
    elif derive != "None":
        yield f"if derived is None: derived = {derive}"


def _guarded(behaviour: Behaviour, derive: str) -> Iterator[str]:
    """Yield statements that choose a credible state, once; `known` are its derived values."""
    yield "if derived is None:"
    yield f"    good = {_call(behaviour, 'credible')}"
    yield f"    if not good: state = {_call(behaviour, 'restarted')}"
    yield f"    derived = good, state, {derive}"
    yield "good, state, known = derived"


def _advance(behaviour: Behaviour) -> Iterator[str]:
    """Yield the statements of `advance`."""
    derived = "derived"
    if behaviour.hooks["credible"]:
        # Log the restart before `derive`, which may refuse the step.
        yield from _guarded(behaviour, "None")
        yield "if not good: self.log_once(RESTARTED.format(t=t), warning, RESTARTED)"
        derived = "known"
    t, indent = "t", ""
    if behaviour.h_max is not None:
        yield "for i in range(n):"
        t, indent = "t + i * h", "    "
    if behaviour.hooks["update"]:
        if "derived" in behaviour.arguments("update"):
            yield f"{indent}if {derived} is None: {derived} = {_call(behaviour, 'derive', t=t)}"
        yield f"{indent}state = {_call(behaviour, 'update', derived=derived, t=t)}"
    if _made_of(behaviour, "derive") & {"state", "t"}:
        yield f"{indent}{derived} = None"
    if behaviour.hooks["update"]:
        yield f"if not square(state) <= {LARGEST_STATE * LARGEST_STATE}: self.check_size(state)"
    yield f"return state, {'None' if behaviour.hooks['credible'] else 'derived'}"


def _evaluate(definition: Definition, scope: dict[str, Any]) -> Iterator[str]:
    """Yield the statements of `evaluate`, and add the names that they need to the scope."""
    behaviour = definition.behaviour
    yield from _known(behaviour, "outputs")
    groups = {name: f"_{name}" for name in hints_of(behaviour.outputs)}
    call = _call(
        behaviour, "outputs", derived="known" if behaviour.hooks["credible"] else "derived"
    )
    yield f"{', '.join(groups.values())}, = {call}"
    if behaviour.noisy:
        hint = hints_of(behaviour.hooks["measured"])["n"]
        n = gathered(hint, iter([f"draws[{i}]" for i in range(behaviour.draws)]), scope)
        noisy = groups[behaviour.noisy]
        yield f"{noisy} = {_call(behaviour, 'measured', **{'n': n, behaviour.noisy: noisy})}"
    yield f"values = {packed(behaviour.outputs, groups)}"
    # The sum of finite values may be infinite.
    yield "if not isfinite(sum(values)): self._store.check_outputs(values)"
    yield "return derived, values"
