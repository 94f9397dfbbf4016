"""The hooks of a component, which both kinds of FMU call.

They are the functions of x_k+1 = update(x_k, u_k) and y_k = outputs(x_k, u_k). A hook takes the
arguments that it needs, under their names and in any order. All hooks are in the language of
equations (language.md), because the C kind runs their translation.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from difflib import get_close_matches
from inspect import signature
from math import isfinite
from string import Formatter
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from fmus.ports.groups import (
    Nothing,
    check_type,
    count_values,
    fields_of,
    form,
    hints_of,
    is_record,
    scalars_of,
    word,
)
from fmus.ports.port import Misdeclared

#: The functions that a component may have, and their arguments; docs/explanation/component.md
#: describes their calls and results. `measured` also takes the group that it returns.
HOOKS: Mapping[str, tuple[str, ...]] = {
    "check": ("parameters",),
    "start": ("parameters", "inputs", "t"),
    "derive": ("parameters", "state", "inputs", "t"),
    "outputs": ("parameters", "state", "derived", "inputs", "t"),
    "update": ("parameters", "state", "derived", "inputs", "t", "h"),
    "credible": ("parameters", "state", "inputs"),
    "restarted": ("parameters", "state", "inputs"),
    "seed": ("parameters",),
    "measured": ("parameters", "n"),
    "check_state": ("parameters", "state"),
    "rates": ("parameters", "state", "derived", "inputs", "t"),
    "switches": ("parameters", "state", "derived", "inputs", "t"),
    "event": ("parameters", "state", "derived", "inputs", "t"),
}

#: The hooks of model exchange, which no step calls.
EXCHANGE = ("rates", "switches", "event")

#: Formats of numbers in texts that C supports, too.
NUMBER_FORMAT = re.compile(r"[+ ]?(?:[1-9][0-9]{0,2})?(?:\.[0-9]{1,3})?[efgEG]")

#: Sets of names: a component has all names of a set, or none.
_TOGETHER = (("start", "update"), ("credible", "restarted", "RESTARTED"), ("seed", "measured"))

#: Classes that a hook must take if a component has them, and the argument.
_CLASSES = {"Parameters": "parameters", "Inputs": "inputs", "State": "state"}


class Behaviour(NamedTuple):
    """The hooks and constants of a component.

    Attributes:
        hooks: all hooks by name; None for a missing one.
        parameters, inputs, state, outputs: types that hooks take and return.
        derived: type that `derive` returns; None without this hook.
        noisy: name of the group of outputs that `measured` returns; empty without this hook.
        draws: number of random numbers that `measured` takes.
        rates, switches: types that these hooks return, with floats only; None without them.
        restarted: the text `RESTARTED`, for `str.format`.
        is_sampled: True if the outputs belong to the last communication point.
        h_max: default of the largest internal step [s]; None if no step is split.
        step, stop: times of the default experiment [s].

    """

    hooks: Mapping[str, FunctionType | None]
    parameters: Any
    inputs: Any
    state: Any
    outputs: Any
    derived: Any
    noisy: str
    draws: int
    rates: Any
    switches: Any
    restarted: str
    is_sampled: bool
    h_max: float | None
    step: float
    stop: float

    def arguments(self, name: str) -> tuple[str, ...]:
        """Return the arguments of a hook, in its own order; empty for a missing hook."""
        hook = self.hooks[name]
        return tuple(signature(hook).parameters) if hook else ()

    def takes(self, name: str, argument: str) -> bool:
        """Return True if a hook takes an argument, directly or through another hook's result."""
        taken = {*self.arguments(name)}
        if name == "outputs" and "parameters" in self.arguments("measured"):
            taken.add("parameters")
        if name in ("outputs", "update", "derive", "rates"):
            if "derived" in taken:
                taken |= {*self.arguments("derive")}
            if "state" in taken:
                taken |= {*self.arguments("credible"), *self.arguments("restarted")}
        return argument in taken


#: Types of arguments that are the same for all components.
_ARGUMENTS: Mapping[str, Any] = {"t": float, "h": float}

#: Arguments whose types each component declares.
_GROUPS = ("parameters", "inputs", "state", "derived")

#: Types of results that are the same for all components.
_RETURNS: Mapping[str, Any] = {
    "check": type(None), "check_state": type(None), "credible": bool, "seed": int,
}  # fmt: skip

#: The argument that has the same type as the result of a hook.
_SAME = {
    "start": "state", "update": "state", "restarted": "state", "event": "state",
    "derive": "derived",
}  # fmt: skip


def read_behaviour(module: ModuleType) -> Behaviour:
    """Read the hooks and constants of a component's module.

    Raises:
        Misdeclared: it is not a component.

    """
    where, names = module.__name__, vars(module)
    hooks = _hooks(module)
    hints = {name: types_of_hook(f"{where}.{name}", hook) for name, hook in hooks.items()}
    outputs = hints["outputs"]["return"]
    if not is_record(outputs):
        raise Misdeclared(
            f"{where}.outputs returns {word(form(outputs))}, no NamedTuple", "outputs"
        )
    noisy = _noisy(where, hints, outputs)
    types = _types_of_groups(hints)
    _check_exchange(where, hints, types.get("state", Nothing))
    if "state" in types and "start" not in hooks:
        name = next(name for name, own in hints.items() if "state" in own)
        raise Misdeclared(f"{where}.{name} takes a state, but there is no start", name)
    for name, own in hints.items():
        if name not in ("outputs", "measured", "rates", "switches"):
            wanted = _RETURNS[name] if name in _RETURNS else types[_SAME[name]]
            check_same(where, name, "return", own["return"], wanted)
        for argument, hint in own.items():
            if argument not in ("return", *noisy) and (name, argument) != ("measured", "n"):
                check_same(where, name, argument, hint, types[argument])
    for argument, hint in {**types, "outputs": outputs}.items():
        takes = [name for name, own in hints.items() if argument in (name, *own)]
        if argument in _CLASSES.values() and not is_record(hint):
            why = f"{argument} of the type {word(form(hint))}; write a NamedTuple"
            raise Misdeclared(f"{where}.{takes[0]} takes {why}", takes[0], argument)
        check_type(hint, *takes[:1], argument)
    for cls, argument in _CLASSES.items():
        if cls in names and argument not in types:
            raise Misdeclared(f"{cls} is there, but no hook takes {argument}", cls)
    behaviour = Behaviour(
        {name: hooks.get(name) for name in HOOKS},
        types.get("parameters", Nothing),
        types.get("inputs", Nothing),
        types.get("state", Nothing),
        outputs,
        types.get("derived"),
        "".join(noisy),
        count_values(hints["measured"]["n"]) if "measured" in hooks else 0,
        hints["rates"]["return"] if "rates" in hooks else None,
        hints["switches"]["return"] if "switches" in hooks else None,
        _message(where, names.get("RESTARTED", "")),
        names.get("SAMPLED", False),
        seconds_in(names, "H_MAX", None),
        seconds_in(names, "STEP_SIZE", 0.02),
        seconds_in(names, "STOP_TIME", 100.0),
    )
    _check_constants(where, behaviour)
    return behaviour


def _check_constants(where: str, behaviour: Behaviour) -> None:
    """Refuse constants that contradict the hooks."""
    if not isinstance(behaviour.is_sampled, bool):
        raise Misdeclared(f"SAMPLED is {behaviour.is_sampled!r:.40}; write True or False")
    if behaviour.is_sampled and not behaviour.takes("outputs", "inputs"):
        raise Misdeclared(f"{where}.outputs takes no inputs, so it is not SAMPLED", "outputs")
    if behaviour.h_max is not None and behaviour.hooks["update"] is None:
        raise Misdeclared(f"{where} has H_MAX, but no update", "outputs")
    if behaviour.rates is not None and behaviour.is_sampled:
        raise Misdeclared(f"{where} is SAMPLED, and rates are of continuous components", "rates")


def seconds_in(names: Mapping[str, Any], name: str, default: Any) -> Any:
    """Read a constant that is a time, as a float."""
    number = names.get(name, default)
    is_number = isinstance(number, (float, int)) and not isinstance(number, bool)
    if number is not default and not (is_number and isfinite(number) and number > 0):
        raise Misdeclared(f"{name} is {number!r:.40}; write seconds, more than 0")
    return number if number is None else float(number)


def _hooks(module: ModuleType) -> dict[str, FunctionType]:
    """Return the hooks of a component; refuse an incomplete set, and misspelt names."""
    where, names = module.__name__, vars(module)
    if "outputs" not in names:
        raise Misdeclared(f"{where} has no function outputs")
    for together in _TOGETHER:
        there = [name for name in together if name in names]
        missing = [name for name in together if name not in names]
        if there and missing:
            raise Misdeclared(f"{where} has {there[0]}, but no {missing[0]}", there[0])
    for name, value in names.items():
        if name in HOOKS and not isinstance(value, FunctionType):
            raise Misdeclared(f"{where}.{name} is not a function, but has the name of a hook", name)
    check_spelling(module, HOOKS)
    return {name: names[name] for name in HOOKS if name in names}


def _noisy(where: str, hints: Mapping[str, Mapping[str, Any]], outputs: type) -> list[str]:
    """Return the group of outputs that `measured` takes and returns; refuse unknown arguments."""
    groups = fields_of(outputs)
    noisy = [name for name in hints.get("measured", ()) if name in {*groups} - {*HOOKS["measured"]}]
    for name, types in hints.items():
        known = [*HOOKS[name], *(noisy if name == "measured" else ())]
        for argument in (argument for argument in types if argument not in (*known, "return")):
            why = f"{argument}, which is not one of {', '.join(known)}"
            raise Misdeclared(f"{where}.{name} takes {why}", name, argument)
        if "derived" in types and "derive" not in hints:
            raise Misdeclared(f"{where}.{name} takes derived, but there is no derive", name)
    if "measured" not in hints:
        return []
    if len(noisy) != 1:
        why = f"takes {len(noisy)} groups of outputs, not one"
        raise Misdeclared(f"{where}.measured {why}", "measured")
    types = hints["measured"]
    for name in (*noisy, "return"):
        check_same(where, "measured", name, types[name], groups[noisy[0]])
    check_type(types.get("n", float), "measured", "n")
    if "n" not in types or {*scalars_of(types["n"])} != {float}:
        drawn = word(form(types["n"])) if "n" in types else "nothing"
        why = f"takes {drawn} as n; write a float, or a tuple or Vector of them"
        raise Misdeclared(f"{where}.measured {why}", "measured", "n")
    return noisy


def _check_exchange(where: str, hints: Mapping[str, Mapping[str, Any]], state: Any) -> None:
    """Refuse hooks of model exchange without rates, and rates that are not of the state."""
    for name in EXCHANGE:
        if name in hints and "rates" not in hints:
            raise Misdeclared(f"{where} has {name}, but no rates", name)
    if "rates" in hints and "credible" in hints:
        raise Misdeclared(f"{where} has rates, and credible, which only steps call", "rates")
    for name in ("rates", "switches"):
        made = hints.get(name, {}).get("return", Nothing)
        if not (is_record(made) and {*scalars_of(made)} <= {float}):
            why = f"returns {word(form(made))}; write a NamedTuple of floats"
            raise Misdeclared(f"{where}.{name} {why}", name)
    fields = fields_of(state)
    for name, hint in fields_of(hints["rates"]["return"]).items() if "rates" in hints else ():
        if name not in fields or form(hint) != form(fields[name]):
            known = ", ".join(f"{name}: {word(form(hint))}" for name, hint in fields.items())
            why = f"returns the rate of {name}: {word(form(hint))}; the state has {known}"
            raise Misdeclared(f"{where}.rates {why}", "rates")


def _types_of_groups(hints: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the type of each argument: the one that most hooks declare."""
    forms_of: dict[str, list[Any]] = {}
    for name, hint in hints.items():
        pairs = [(argument, argument) for argument in _GROUPS if argument in hint]
        for group, place in [*pairs, *([(_SAME[name], "return")] if name in _SAME else [])]:
            forms_of.setdefault(group, []).append(form(hint[place]))
    types = {name: max(forms, key=forms.count) for name, forms in forms_of.items()}
    return {**types, **_ARGUMENTS}


def check_same(where: str, name: str, argument: str, hint: Any, wanted: Any) -> None:
    """Refuse an argument or a result whose type differs between hooks."""
    if form(hint) != form(wanted):
        takes = "returns" if argument == "return" else f"takes {argument} as"
        why = f"{takes} {word(form(hint))}; write {word(form(wanted))}"
        raise Misdeclared(f"{where}.{name} {why}", name, argument)


def check_spelling(module: ModuleType, hooks: Collection[str]) -> None:
    """Refuse an unused function with a name similar to a hook's."""
    own = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__
    }
    used = {name for function in own.values() for name in _names_in(function.__code__)}
    for name in own.keys() - {*hooks} - used:
        for hook in get_close_matches(name, hooks, 1, 0.75):
            why = f"is called by no function here; is it {hook}?"
            raise Misdeclared(f"{module.__name__}.{name} {why}", name)


def _names_in(code: CodeType) -> Iterator[str]:
    """Yield the global names that a function uses, also in nested functions."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names_in(constant)


def _message(where: str, text: Any) -> str:
    """Return the text `RESTARTED`; refuse one that only Python could format."""
    try:
        fields = [part[1:] for part in Formatter().parse(text) if part[1] is not None]
        good = [
            name == "t" and conversion is None and (not form or NUMBER_FORMAT.fullmatch(form))
            for name, form, conversion in fields
        ]
    except (TypeError, ValueError):
        good = [False]
    if len(good) > 1 or not all(good):
        why = "is not a text with the time at most once, as {t} or {t:g}, and other braces doubled"
        raise Misdeclared(f"{where}.RESTARTED {why}", "RESTARTED")
    return str(text)


def types_of_hook(where: str, hook: FunctionType) -> dict[str, Any]:
    """Return the types of a hook's arguments and of its result."""
    try:
        hints = hints_of(hook)
    except NameError as error:
        why = f"has a type that is not known: {error}"
        raise Misdeclared(f"{where} {why}", hook.__name__) from None
    for name in (*signature(hook).parameters, "return"):
        if name not in hints:
            why = f"takes {name} of no type" if name != "return" else "does not say what it returns"
            raise Misdeclared(f"{where} {why}", hook.__name__)
    return hints
