"""What a component's `behaviour.py` may say: the hooks that both kinds of FMU call.

The functions of a behaviour are the :class:`Hooks`, and those that they call. A hook takes the
arguments that it needs, under their names and in any order. All of it is in the language of
equations (language.md), because the C kind runs its translation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from inspect import signature
from string import Formatter
from types import CodeType, FunctionType, GenericAlias, ModuleType
from typing import Any, NamedTuple, Protocol, get_args

from fmus.ports.groups import (
    Nothing,
    check_type,
    count_values,
    fields_of,
    form,
    hints_of,
    scalars_of,
    word,
)
from fmus.ports.port import Misdeclared


class Hooks(Protocol):
    """The hooks. A behaviour has `Outputs`, `begin` and `advance`; all others are optional.

    Args:
        parameters: what `PARAMETERS` in ports.py makes of the values of the parameters.
        inputs: NamedTuple with a number, tuple, vector or matrix for each group of input ports, in
            their order.
        state: NamedTuple of all that a step depends on besides inputs and parameters;
            :class:`~fmus.ports.groups.Nothing` for a component without memory.
        derived: what `derive` makes of the state.
        outputs: of the type `Outputs`.
        t: time at the beginning of the step, or of the run [s].
        h: length of an internal step [s], at most `h_max`.
        n: how many internal steps a communication step has.

    """

    #: TypedDict or NamedTuple with a number, tuple, vector or matrix for each group of output
    #: ports, in their order.
    Outputs: type

    #: What is logged, once an instance, when `restarted` is called; `{t}` or `{t:g}` is the time.
    RESTARTED: str

    @staticmethod
    def check(parameters: Any) -> None:
        """Refuse parameters, each of which is in its range, that do not fit together.

        Called before `begin`, for each new value of a tunable parameter, and for a state that is
        restored.

        Raises:
            Refusal: they do not fit; the text says why.

        """

    @staticmethod
    def begin(parameters: Any, inputs: Any, t: float) -> tuple[Any, ...]:
        """Return state and outputs at the start time.

        Called at the end of the initialisation, and during it each time that outputs are read after
        a value was set.

        Returns:
            `(state, outputs)`; with a hook `derive`, `(state, derived, outputs)`; only outputs, if
            there is no state.

        """

    @staticmethod
    def derive(parameters: Any, state: Any) -> Any:
        """Return what a step needs of the state, where outputs at the end of the last needed it.

        It spares computing that twice, so `begin` and `advance` return what this would. Called
        before an `advance` whose state was restored or restarted, or whose parameters have changed
        since `begin` or `advance` gave the state.
        """

    @staticmethod
    def credible(parameters: Any, state: Any, inputs: Any) -> bool:
        """Return whether a step may go on from the state.

        Called before each `advance`.
        """

    @staticmethod
    def restarted(parameters: Any, state: Any, inputs: Any) -> Any:
        """Return the state that the step begins with instead.

        Called where `credible` says no, after `RESTARTED` was logged.
        """

    @staticmethod
    def advance(
        parameters: Any, state: Any, derived: Any, inputs: Any, t: float, h: float, n: int
    ) -> tuple[Any, ...]:
        """Return state and outputs after n internal steps with held inputs.

        Called once a communication step. What is not finite is refused, and with it the step.

        Returns:
            What `begin` returns.

        """

    @staticmethod
    def seed(parameters: Any) -> int:
        """Return the seed of the noise of `measured`.

        Called before `begin`.
        """

    @staticmethod
    def measured(parameters: Any, n: Any) -> Any:
        """Return one group of outputs with noise.

        Called after each `begin` and `advance`. A further argument has the name of the group, and
        gets it without noise.

        Args:
            parameters: as above.
            n: as many independent standard normal numbers as the type of this argument has, which
                is of floats only.

        """

    @staticmethod
    def expected(parameters: Any, state: Any, outputs: Any) -> Any:
        """Return the outputs that belong to a state that is restored.

        They are compared with the outputs that are restored with it, which are given for whatever
        else some outputs depend on, such as noise. Without this hook, outputs do not follow from
        the state only: a controller's belong to the beginning of its last step.

        Raises:
            Refusal: no run can have led to the state.

        """


#: How a number in a text may be written: as C writes it, too.
NUMBER_FORMAT = re.compile(r"[+ ]?(?:[1-9][0-9]{0,2})?(?:\.[0-9]{1,3})?[efgEG]")

#: Arguments of each hook, by its name.
HOOKS: Mapping[str, tuple[str, ...]] = {
    name: tuple(signature(hook.__func__).parameters)
    for name, hook in vars(Hooks).items()
    if isinstance(hook, staticmethod)
}

#: What goes together.
_TOGETHER = (("credible", "restarted", "RESTARTED"), ("seed", "measured"))


class Behaviour(NamedTuple):
    """What a behaviour says.

    Attributes:
        hooks: all by name; None for one that it does not have.
        state, derived, inputs, outputs, parameters: types that they take and return; derived is
            None without `derive`.
        is_stateless: whether `begin` and `advance` give only outputs.
        noisy: the group of outputs that `measured` gives; empty: there is none.
        draws: how many numbers it takes.
        restarted: the text `RESTARTED`, as `str.format` takes it.

    """

    hooks: Mapping[str, FunctionType | None]
    state: Any
    derived: Any
    inputs: Any
    outputs: Any
    parameters: Any
    is_stateless: bool
    noisy: str
    draws: int
    restarted: str

    def arguments(self, name: str) -> tuple[str, ...]:
        """The arguments of a hook, in its own order; none of one that it does not have."""
        hook = self.hooks[name]
        return tuple(signature(hook).parameters) if hook else ()


#: Types of the arguments of hooks that are the same for all components.
_ARGUMENTS: Mapping[str, Any] = {"t": float, "h": float, "n": int}

#: Arguments whose types are the component's own, except the outputs.
_GROUPS = ("parameters", "inputs", "state", "derived")

#: Types of what hooks return that are the same for all components.
_RETURNS: Mapping[str, Any] = {"check": type(None), "credible": bool, "seed": int}

#: What other hooks return, by the argument that has the same type.
_SAME = {"derive": "derived", "restarted": "state", "expected": "outputs"}


def read_behaviour(module: ModuleType) -> Behaviour:
    """What the behaviour of a component says.

    Args:
        module: `behaviour` in the folder of the component.

    Raises:
        Misdeclared: it is not a behaviour.

    """
    where, said = module.__name__, vars(module)
    hooks = _hooks(module)
    outputs = said["Outputs"]
    hints = {name: _types(f"{where}.{name}", hook) for name, hook in hooks.items()}
    noisy = _noisy(where, hints, outputs)
    types = _types_of_groups(hints, outputs)
    is_stateless = "state" not in types
    derived = [types["derived"]] if "derive" in hooks else []
    returned = outputs
    if not is_stateless:
        returned = form(GenericAlias(tuple, (types["state"], *derived, outputs)))
    for name, found in hints.items():
        if name in ("begin", "advance"):
            if form(found["return"]) != returned:
                raise Misdeclared(f"{where}.{name} does not return {word(returned)}", name)
        elif name != "measured":
            wanted = _RETURNS[name] if name in _RETURNS else types.get(_SAME[name])
            _check_same(where, name, "return", found["return"], wanted)
        for argument, hint in found.items():
            if argument not in ("return", *noisy) and (name, argument) != ("measured", "n"):
                _check_same(where, name, argument, hint, types[argument])
    for argument, hint in types.items():
        takes = [name for name, found in hints.items() if argument in found]
        check_type(hint, *takes[:1], argument)
    return Behaviour(
        {name: hooks.get(name) for name in HOOKS},
        Nothing if is_stateless else types["state"],
        derived[0] if derived else None,
        types.get("inputs", Nothing),
        outputs,
        types.get("parameters", Nothing),
        is_stateless,
        "".join(noisy),
        count_values(hints["measured"]["n"]) if "measured" in hooks else 0,
        _message(where, said.get("RESTARTED", "")),
    )


def _hooks(module: ModuleType) -> dict[str, FunctionType]:
    """The hooks of a behaviour, if it has those that belong together, and no others."""
    where, said = module.__name__, vars(module)
    for name in ("begin", "advance", "Outputs"):
        if name not in said:
            raise Misdeclared(f"{where} has no {name}")
    if not isinstance(said["Outputs"], type):
        raise Misdeclared(f"{where}.Outputs is no class")
    for together in _TOGETHER:
        there = [name for name in together if name in said]
        missing = [name for name in together if name not in said]
        if there and missing:
            raise Misdeclared(f"{where} has {there[0]}, but no {missing[0]}", there[0])
    for name, value in said.items():
        if name in HOOKS and not isinstance(value, FunctionType):
            raise Misdeclared(f"{where}.{name} is no function, but has the name of a hook", name)
    if unused := _without_use(module):
        others = f"{', '.join(HOOKS)}, and no function here calls it"
        alike = f"; nor {', '.join(unused[1:])}" if len(unused) > 1 else ""
        raise Misdeclared(f"{where}.{unused[0]} is not one of the hooks {others}{alike}", unused[0])
    return {name: said[name] for name in HOOKS if name in said}


def _noisy(where: str, hints: Mapping[str, Mapping[str, Any]], outputs: type) -> list[str]:
    """The group of outputs that `measured` takes and returns, if all arguments are known."""
    groups = fields_of(outputs)
    noisy = [name for name in hints.get("measured", ()) if name in {*groups} - {*HOOKS["measured"]}]
    for name, found in hints.items():
        known = [*HOOKS[name], *(noisy if name == "measured" else ())]
        for argument in (argument for argument in found if argument not in (*known, "return")):
            why = f"{argument}, which is not one of {', '.join(known)}"
            raise Misdeclared(f"{where}.{name} takes {why}", name, argument)
        if "derived" in found and "derive" not in hints:
            raise Misdeclared(f"{where}.{name} takes derived, but there is no derive", name)
    if "measured" not in hints:
        return []
    if len(noisy) != 1:
        why = f"takes {len(noisy)} groups of outputs, not one"
        raise Misdeclared(f"{where}.measured {why}", "measured")
    found = hints["measured"]
    for name in (*noisy, "return"):
        _check_same(where, "measured", name, found[name], groups[noisy[0]])
    check_type(found.get("n", float), "measured", "n")
    if "n" not in found or {*scalars_of(found["n"])} != {float}:
        drawn = word(form(found["n"])) if "n" in found else "nothing"
        why = f"takes {drawn} as n; write a float, or a tuple or Vector of them"
        raise Misdeclared(f"{where}.measured {why}", "measured", "n")
    return noisy


def _types_of_groups(hints: Mapping[str, Mapping[str, Any]], outputs: type) -> dict[str, Any]:
    """The type that each argument has in all hooks: what most of them say."""
    found: dict[str, list[Any]] = {}
    for name, hint in _said_of_groups(hints):
        found.setdefault(name, []).append(form(hint))
    types = {name: max(forms, key=forms.count) for name, forms in found.items()}
    return {**types, **_ARGUMENTS, "outputs": outputs}


def _said_of_groups(hints: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Any]]:
    """The types of the component's own groups, as each hook takes or returns them."""
    for name, found in hints.items():
        yield from ((argument, found[argument]) for argument in _GROUPS if argument in found)
        if name in ("derive", "restarted"):
            yield _SAME[name], found["return"]
        elif name in ("begin", "advance"):
            parts = get_args(found["return"])
            yield from zip(("state", "derived") if len(parts) > 2 else ("state",), parts[:-1])


def _check_same(where: str, name: str, argument: str, hint: Any, wanted: Any) -> None:
    """Refuse an argument, or a result, of another type than it has everywhere else."""
    if form(hint) != form(wanted):
        takes = "returns" if argument == "return" else f"takes {argument} as"
        why = f"{takes} {word(form(hint))}; write {word(form(wanted))}"
        raise Misdeclared(f"{where}.{name} {why}", name, argument)


def _without_use(module: ModuleType) -> list[str]:
    """Functions that nothing calls: perhaps hooks whose names are misspelt."""
    own = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__
    }
    used = {name for function in own.values() for name in _names_in(function.__code__)}
    return [name for name in own if name not in {*HOOKS, *used} and not name.startswith("_")]


def _names_in(code: CodeType) -> Iterator[str]:
    """The names outside of a function that it uses, also in functions within it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names_in(constant)


def _message(where: str, text: Any) -> str:
    """The text `RESTARTED`, if both kinds can write it."""
    try:
        fields = [found[1:] for found in Formatter().parse(text) if found[1] is not None]
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


def _types(where: str, hook: FunctionType) -> dict[str, Any]:
    """The types of a hook's arguments and of what it returns."""
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
