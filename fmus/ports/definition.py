"""What a component is: the one thing that both kinds of FMU, and its page, are made from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

from fmus.ports.behaviour import HOOKS, Behaviour, read_behaviour
from fmus.ports.groups import Field, Nothing, ParameterSet, form, ports_in, word
from fmus.ports.port import FAULT, H_MAX, TIME, Misdeclared, Port, is_line
from fmus.ports.variable import declared


class Origin(NamedTuple):
    """Where a component comes from."""

    author: str = ""
    license: str = ""
    version: str = ""
    citation: str = ""  #: what its equation numbers refer to


@dataclass(frozen=True, eq=False)
class Definition:
    """A component.

    Attributes:
        name: of the component, and of its FMU.
        summary: one line.
        origin: where it comes from.
        ports: all but `fault`, in the order of their value references.
        parameters: what its parameters mean to the equations.
        group_of: fields of its inputs that bear another name than their group of ports.
        behaviour: how it runs.

    """

    name: str
    summary: str
    origin: Origin
    ports: tuple[Port, ...]
    parameters: ParameterSet[Any]
    group_of: Mapping[str, str]
    behaviour: Behaviour

    @property
    def about(self) -> dict[str, str]:
        """What modelDescription.xml says of its origin."""
        said = self.origin._asdict()
        del said["citation"]
        return {name: text for name, text in said.items() if text}

    @property
    def description(self) -> str:
        """What modelDescription.xml says of it."""
        return ". ".join(filter(None, (self.summary, self.origin.citation)))


@cache
def define(name: str, *modules: ModuleType) -> Definition:
    """What modules say of a component, the same each time.

    Args:
        name: of the component.
        modules: `ports` and `behaviour` of its folder, or the one module that says it all.

    Raises:
        TypeError: they do not go together; in one module it is a Misdeclared.

    """
    if len(modules) == 1:
        return _of_one_module(name, modules[0])
    ports, behaviour = modules
    return Definition(
        name,
        ports.DESCRIPTION,
        getattr(ports, "ORIGIN", Origin()),
        ports.PORTS,
        ports.PARAMETERS,
        getattr(ports, "GROUP_OF", {}),
        read_behaviour(behaviour),
    )


#: Names of the classes whose fields are ports, with the causality of these.
_CLASSES = {"Inputs": "input", "Outputs": "output", "Parameters": "parameter"}


def _of_one_module(name: str, module: ModuleType) -> Definition:
    said = read_behaviour(module)
    made = {cls: _class(said, module, cls) for cls in _CLASSES}
    taken = said.arguments("begin")
    inputs = made["Inputs"]._fields if "inputs" in taken else ()
    direct = (*inputs, *([TIME.name] * ("t" in taken)))
    fields = {cls: declared(made[cls], causality, direct) for cls, causality in _CLASSES.items()}
    _hold_apart(fields)
    own = ParameterSet(made["Parameters"], **fields["Parameters"])
    internal = (H_MAX,) if "n" in said.arguments("advance") else ()
    ports = (
        *(port for field in fields["Inputs"].values() for port in ports_in(field)),
        *_fed_through(fields["Outputs"], fields["Inputs"], direct),
        *own.ports,
        *internal,
    )
    summary = (module.__doc__ or name).strip().partition("\n")[0].rstrip(".")
    origin = Origin(*(str(getattr(module, f"__{field}__", "")) for field in Origin._fields))
    for place, text in {"its docstring": summary, **origin._asdict()}.items():
        if not is_line(text.replace("\n", " ").replace("\t", " ")):
            raise Misdeclared(f"{place} is {text!r:.40}; write it without control characters")
    return Definition(name, summary, origin, ports, own, {}, said)


def _class(said: Behaviour, module: ModuleType, cls: str) -> Any:
    """The class of a name, if it is what the hooks take and return."""
    argument, made = cls.lower(), getattr(module, cls, Nothing)
    used = getattr(said, argument)
    if used is Nothing and made is not Nothing:
        raise Misdeclared(f"{cls} is there, but no hook takes {argument}", cls)
    if used is not made:
        hook = next(name for name in ("begin", *HOOKS) if argument in said.arguments(name))
        why = f"{argument} are of the type {word(form(used))}; call it {cls}"
        raise Misdeclared(why, hook, argument)
    return made


def _fed_through(
    fields: Mapping[str, Field], inputs: Mapping[str, Field], direct: Sequence[str]
) -> Iterator[Port]:
    """The outputs, with the names of ports where the fields of the inputs stood.

    At the start they depend on all that `begin` takes.
    """
    names = {field: [port.name for port in ports_in(ports)] for field, ports in inputs.items()}
    names[TIME.name] = [TIME.name]
    for field, ports in fields.items():
        for port in ports_in(ports):
            for one in port.feedthrough:
                if one not in names:
                    why = f"depends on {one!r}; there are {', '.join(names)}"
                    raise Misdeclared(f"Outputs.{field} {why}", "Outputs", field)
            later = [one for one in direct if one not in (*port.feedthrough, TIME.name)]
            yield replace(
                port,
                feedthrough=tuple(name for one in port.feedthrough for name in names[one]),
                initially=tuple(name for one in later for name in names[one]),
            )


def _hold_apart(fields: Mapping[str, Mapping[str, Field]]) -> None:
    """Hold the names of ports apart, also from those that a component has anyway."""
    taken = dict.fromkeys((FAULT.name, TIME.name, H_MAX.name), "every component")
    for cls, found in fields.items():
        for field in found:
            if field in taken:
                why = f"has a name that {taken[field]} has already"
                raise Misdeclared(f"{cls}.{field} {why}", cls, field)
            taken[field] = cls
