"""Definitions of components, from which both kinds of FMU and the page are made."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from types import ModuleType
from typing import Any, NamedTuple

from fmus.ports.behaviour import Behaviour, read_behaviour
from fmus.ports.exchange import exchanged
from fmus.ports.fields import declared
from fmus.ports.groups import ParameterSet
from fmus.ports.port import FAULT, H_MAX, TIME, Misdeclared, Port, is_line, largest_step
from fmus.ports.units import unit_of


class Origin(NamedTuple):
    """Origin of a component: its module's `__author__`, `__license__` and so on."""

    author: str = ""
    license: str = ""
    version: str = ""
    citation: str = ""  #: source of its equation numbers


class DefaultExperiment(NamedTuple):
    """The experiment that a host runs by default; times are in seconds."""

    stop: float
    step: float
    start: float = 0.0
    takes_any_step: bool = True  #: True if other step sizes are possible, too


@dataclass(frozen=True, eq=False)
class Model:
    """Content of an FMU's description.

    Attributes:
        name: name of the model and of its FMU.
        summary: one line.
        origin: author, licence, version and citation.
        ports: all ports but `fault`, in the order of their value references.
        experiment: the default experiment.

    """

    name: str
    summary: str
    origin: Origin
    ports: tuple[Port, ...]
    experiment: DefaultExperiment

    @property
    def local(self) -> tuple[Port, ...]:
        """Continuous states, their rates and event indicators, for model exchange."""
        return ()

    @property
    def identifier(self) -> str:
        """The name of its library, which is valid in C."""
        name = re.sub(r"\W", "_", self.name, flags=re.ASCII)
        return name if name[:1].isalpha() else f"of_{name}"

    @property
    def about(self) -> dict[str, str]:
        """Attributes of modelDescription.xml about its origin."""
        texts = self.origin._asdict()
        del texts["citation"]
        return {name: text for name, text in texts.items() if text}

    @property
    def description(self) -> str:
        """The description in modelDescription.xml."""
        return ". ".join(filter(None, (self.summary, self.origin.citation)))


@dataclass(frozen=True, eq=False)
class Definition(Model):
    """A component.

    Attributes:
        parameters: its parameters but `h_max`, as a group of the equations.
        noisy: names of the outputs that have noise.
        behaviour: its hooks and constants.

    """

    parameters: ParameterSet[Any]
    noisy: tuple[str, ...]
    behaviour: Behaviour

    @property
    def local(self) -> tuple[Port, ...]:
        """Continuous states, their rates and event indicators, for model exchange."""
        return exchanged(self.behaviour)


@cache
def define(name: str, module: ModuleType) -> Definition:
    """Return the definition of a component.

    Raises:
        Misdeclared: it is not a component.

    """
    behaviour = read_behaviour(module)
    inputs = declared(behaviour.inputs, "input")
    direct = (*inputs, *([TIME.name] if behaviour.takes("outputs", "t") else []))
    if not behaviour.takes("outputs", "inputs"):
        direct = direct[len(inputs) :]
    outputs = declared(
        behaviour.outputs,
        "output",
        direct,
        tuple(inputs) if behaviour.takes("start", "inputs") else (),
    )
    own = ParameterSet(
        behaviour.parameters, [*chain(*declared(behaviour.parameters, "parameter").values())]
    )
    ports = (
        *chain(*inputs.values()),
        *_fed_through(behaviour, outputs, inputs),
        *own.ports,
        *([] if behaviour.h_max is None else [largest_step(behaviour.h_max)]),
    )
    _check_names(behaviour, ports)
    check_enumerations(ports)
    summary = (module.__doc__ or name).strip().partition("\n")[0].rstrip(".")
    origin = Origin(*(str(getattr(module, f"__{field}__", "")) for field in Origin._fields))
    for place, text in {"its docstring": summary, **origin._asdict()}.items():
        if not is_line(text.replace("\n", " ").replace("\t", " ")):
            raise Misdeclared(f"{place} is {text!r:.40}; write it without control characters")
    noisy = tuple(port.name for port in outputs[behaviour.noisy]) if behaviour.noisy else ()
    experiment = DefaultExperiment(behaviour.stop, behaviour.step)
    for name_taken in {port.name for port in exchanged(behaviour)} & {port.name for port in ports}:
        raise Misdeclared(f"{name_taken} is the name of a port, and of model exchange", "rates")
    return Definition(name, summary, origin, ports, experiment, own, noisy, behaviour)


def _fed_through(
    behaviour: Behaviour,
    outputs: Mapping[str, tuple[Port, ...]],
    inputs: Mapping[str, tuple[Port, ...]],
) -> Iterator[Port]:
    """Yield the outputs, with dependencies on ports in place of fields of the inputs."""
    names = {field: [port.name for port in ports] for field, ports in inputs.items()}
    names |= {name: [name] for own in [*names.values()] for name in own}
    names[TIME.name] = [TIME.name]
    for field, ports in outputs.items():
        for port in ports:
            place = (behaviour.outputs.__name__, field)
            for dependency in (*port.feedthrough, *(port.initially or ())):
                if dependency not in names:
                    why = f"depends on {dependency!r}; there are {', '.join(names)}"
                    raise Misdeclared(f"{'.'.join(place)} {why}", *place)
            direct = tuple(name for dependency in port.feedthrough for name in names[dependency])
            if behaviour.is_sampled and not {*direct} - {TIME.name}:
                why = "is sampled with the inputs, so it has feedthrough; leave out feedthrough=()"
                raise Misdeclared(f"{'.'.join(place)} {why}", *place)
            initial = (name for dependency in port.initially or () for name in names[dependency])
            yield replace(
                port,
                variability="discrete" if behaviour.is_sampled else port.variability,
                feedthrough=direct,
                initially=tuple(name for name in initial if name not in direct),
            )


def _check_names(behaviour: Behaviour, ports: tuple[Port, ...]) -> None:
    """Refuse two ports of one name, and names that every component has."""
    taken = dict.fromkeys((FAULT.name, TIME.name), "every component")
    made = {
        "input": behaviour.inputs,
        "output": behaviour.outputs,
        "parameter": behaviour.parameters,
    }
    for port in ports:
        name = made[port.causality].__name__
        if port.name in taken:
            why = f"has a name that {taken[port.name]} has already"
            raise Misdeclared(f"{name}.{port.name} {why}", name, port.name)
        taken[port.name] = name if port.name != H_MAX else "H_MAX"


def check_enumerations(ports: tuple[Port, ...]) -> None:
    """Refuse two enumerations of one name, and enumerations with the name of a port or unit.

    Raises:
        Misdeclared: there is one.

    """
    taken: dict[str, object] = {port.name: port for port in ports}
    taken |= {unit_of(port.unit).type_name: port.unit for port in ports if port.unit}
    for port in ports:
        if port.enumeration and taken.setdefault(port.enumeration, port.choices) != port.choices:
            why = f"is the name of {port.name}'s choices, and of something else in the FMU"
            raise Misdeclared(f"{port.enumeration} {why}: rename it", port.enumeration)
