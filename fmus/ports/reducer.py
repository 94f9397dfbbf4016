"""Declarations of indices, which reduce a run to some numbers, row by row.

An index only observes: it reads signals of components, and passes nothing to them. It has the form
of a component, and all of it is in the language of equations. A row of a run is an instance of its
`Inputs`, whose ports have the names of signals and parameters of the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import signature
from itertools import chain
from types import FunctionType, ModuleType
from typing import Any

from auv_fmu.language.quantities import group_name
from auv_fmu.language.variable import Variable
from fmus.ports.behaviour import check_same, check_spelling, seconds_in, types_of_hook
from fmus.ports.fields import declared
from fmus.ports.groups import Nothing, check_type, class_of, fields_of, form, is_record, split, word
from fmus.ports.port import Misdeclared, Port, Value

#: The functions of an index, and the arguments that each may take: `inputs` is the row at the end
#: of a step, or the first row; `before` the row at its beginning; `acting` the one of the two that
#: contains the values used in the step; `t` the time of `inputs`, `h` the length of the step,
#: `begin` and `end` the start of the run and its planned end [s].
HOOKS: Mapping[str, tuple[str, ...]] = {
    "start": ("inputs", "t", "begin", "end"),
    "update": ("state", "inputs", "before", "acting", "t", "h", "begin", "end"),
    "outputs": ("state", "t", "begin", "end"),
}

#: Arguments that are rows.
ROWS = ("inputs", "before", "acting")


@dataclass(frozen=True, eq=False)
class Reducer:
    """One or several indices with the same inputs.

    Attributes:
        name: name of its module.
        hooks: functions by name.
        inputs, state, outputs: types that they take and return.
        ports: ports of the inputs, with the names of signals or parameters.
        defaults: values of inputs that a run may lack, by name.
        results: ports of the outputs, by their fields: each field is an index; an index without a
            value is not a number.
        meanings: descriptions of the indices, by the same names.
        last: time before the end of the run in which rows count [s]; None: all rows count.

    """

    name: str
    hooks: Mapping[str, FunctionType]
    inputs: Any
    state: Any
    outputs: Any
    ports: tuple[Port, ...]
    defaults: Mapping[str, Value]
    results: Mapping[str, tuple[Port, ...]]
    meanings: Mapping[str, str]
    last: float | None

    @property
    def n_results(self) -> int:
        """Number of the values of its indices."""
        return sum(map(len, self.results.values()))

    def arguments(self, name: str) -> tuple[str, ...]:
        """Return the arguments of a hook, in its own order."""
        return tuple(signature(self.hooks[name]).parameters)


def is_reducer(module: ModuleType) -> bool:
    """Return True if a module has what only an index has."""
    hooks = [hook for name, hook in vars(module).items() if name in HOOKS and callable(hook)]
    taken = {argument for hook in hooks for argument in getattr(hook, "__annotations__", ())}
    return "LAST" in vars(module) or bool(taken & {"before", "acting", "begin", "end"})


def read_reducer(module: ModuleType) -> Reducer:
    """Read the hooks of an index.

    Raises:
        Misdeclared: it is not an index.

    """
    where, names = module.__name__, vars(module)
    check_spelling(module, HOOKS)
    for name in HOOKS:
        if not isinstance(names.get(name), FunctionType):
            raise Misdeclared(f"{where} has no function {name}; an index has {', '.join(HOOKS)}")
    hooks: dict[str, FunctionType] = {name: names[name] for name in HOOKS}
    hints = {name: types_of_hook(f"{where}.{name}", hook) for name, hook in hooks.items()}
    types = _types(where, hints)
    inputs = declared(types["inputs"], "input")
    results = _results(types["outputs"])
    ports = tuple(chain(*inputs.values()))
    optional = chain(*(inputs[field] for field in types["inputs"]._field_defaults))
    return Reducer(
        where.rpartition(".")[2],
        hooks,
        types["inputs"],
        types["state"],
        types["outputs"],
        ports,
        {port.name: port.start for port in optional if port.start is not None},
        results,
        {field: _meaning(types["outputs"], field) for field in results},
        seconds_in(names, "LAST", None),
    )


def _results(outputs: Any) -> dict[str, tuple[Port, ...]]:
    """Return the outputs by their fields; refuse those that cannot be indices."""
    ports_of = declared(outputs, "output")
    for field, ports in ports_of.items():
        place = (outputs.__name__, field)
        if is_record(class_of(fields_of(outputs)[field])) or any(p.type != "Real" for p in ports):
            why = "is not a float, or a tuple or Vector of them, as every index is"
            raise Misdeclared(f"{'.'.join(place)} {why}", *place)
        for port in ports:
            if group_name(port.name) != field:
                why = f"is called {port.name}; an index has the name of its field"
                raise Misdeclared(f"{'.'.join(place)} {why}", *place)
    return ports_of


def _meaning(outputs: Any, field: str) -> str:
    [variable] = (
        note for note in split(fields_of(outputs)[field])[1] if isinstance(note, Variable)
    )
    return str(variable.description)


def _types(where: str, hints: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the types of inputs, state and outputs; refuse hooks that contradict each other."""
    rows = [hint for own in hints.values() for name, hint in own.items() if name in ROWS]
    states = [own["state"] for own in hints.values() if "state" in own]
    states += [hints[name]["return"] for name in ("start", "update")]
    types = {
        "inputs": _usual(rows) if rows else Nothing,
        "state": _usual(states),
        "outputs": hints["outputs"]["return"],
    }
    for name, own in hints.items():
        for argument, hint in own.items():
            if argument == "return":
                wanted = types["outputs" if name == "outputs" else "state"]
            elif argument not in HOOKS[name]:
                why = f"{argument}, which is not one of {', '.join(HOOKS[name])}"
                raise Misdeclared(f"{where}.{name} takes {why}", name, argument)
            else:
                wanted = types.get("inputs" if argument in ROWS else argument, float)
            check_same(where, name, argument, hint, wanted)
    for name, hint in types.items():
        if not is_record(hint):
            why = f"has {name} of the type {word(form(hint))}; write a NamedTuple"
            raise Misdeclared(f"{where} {why}", name)
        check_type(hint, name)
    return types


def _usual(hints: list[Any]) -> Any:
    """Return the most frequent type."""
    forms = [form(hint) for hint in hints]
    return max(forms, key=forms.count)
