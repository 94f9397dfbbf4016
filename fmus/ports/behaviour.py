"""What a component's `behaviour.py` may say: the hooks that both kinds of FMU call.

Each public function of a behaviour is one of the :class:`Hooks`. It takes the hook's
arguments that it needs, under their names and in any order; functions that only the behaviour
itself calls begin with an underscore. All of it is in the language of equations (language.md),
because the C kind runs its translation.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from inspect import signature
from string import Formatter
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, Protocol, get_args, get_origin, get_type_hints

from fmus.ports.groups import Nothing, count_values, hints_of
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

        It spares computing that twice. Called only for a state that no `begin` or `advance` gave:
        one that was restored or restarted.
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
            n: as many independent standard normal numbers as the type of this argument has.

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
        """The arguments of a hook that it has, in its own order."""
        hook = self.hooks[name]
        assert hook is not None
        return tuple(signature(hook).parameters)


def read_behaviour(module: ModuleType) -> Behaviour:
    """What the behaviour of a component says.

    Args:
        module: `behaviour` in the folder of the component.

    Raises:
        Misdeclared: it is not a behaviour.

    """
    where, said = module.__name__, vars(module)
    hooks = {name: said[name] for name in HOOKS if isinstance(said.get(name), FunctionType)}
    for name in ("begin", "advance", "Outputs"):
        if name not in said:
            raise Misdeclared(f"{where} has no {name}")
    for together in _TOGETHER:
        there = [name for name in together if name in said]
        missing = [name for name in together if name not in said]
        if there and missing:
            raise Misdeclared(f"{where} has {there[0]}, but no {missing[0]}", there[0])
    for name, value in said.items():
        own = isinstance(value, FunctionType) and value.__module__ == where
        if own and name not in HOOKS and not name.startswith("_"):
            others = f"{', '.join(HOOKS)}; names of other functions begin with _"
            raise Misdeclared(f"{where}.{name} is not one of the hooks {others}", name)
    hints = {name: _types(f"{where}.{name}", hook) for name, hook in hooks.items()}
    types = {**hints["begin"], **hints["advance"]}
    outputs = said["Outputs"]
    groups = get_type_hints(outputs)
    noisy = [name for name in hints.get("measured", ()) if name in {*groups} - {*HOOKS["measured"]}]
    for name, found in hints.items():
        known = (*HOOKS[name], *noisy)
        for argument in found.keys() - {*known, "return"}:
            why = f"{argument}, which is not one of {', '.join(known)}"
            raise Misdeclared(f"{where}.{name} takes {why}", name)
    if "measured" in hooks and len(noisy) != 1:
        why = f"takes {len(noisy)} groups of outputs, not one"
        raise Misdeclared(f"{where}.measured {why}", "measured")
    derived = hints["derive"]["return"] if "derive" in hooks else None
    returned = [tuple, types.get("state"), *([derived] if derived else []), outputs]
    is_stateless = "state" not in types and hints["begin"]["return"] is outputs
    for name in ("begin", "advance"):
        if is_stateless and hints[name]["return"] is outputs:
            continue
        parts = [get_origin(hints[name]["return"]), *get_args(hints[name]["return"])]
        returned[1] = returned[1] or (*parts[1:], Nothing)[0]
        if parts != returned:
            words = ", ".join(map(_word, returned[1:]))
            raise Misdeclared(f"{where}.{name} does not return tuple[{words}]", name)
    return Behaviour(
        {name: hooks.get(name) for name in HOOKS},
        Nothing if is_stateless else returned[1],
        derived,
        types.get("inputs", Nothing),
        outputs,
        next((found["parameters"] for found in hints.values() if "parameters" in found), Nothing),
        is_stateless,
        "".join(noisy),
        count_values(hints["measured"]["n"]) if "measured" in hooks else 0,
        _message(where, said.get("RESTARTED", "")),
    )


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


def _word(kind: Any) -> str:
    return str(getattr(kind, "__name__", kind))
