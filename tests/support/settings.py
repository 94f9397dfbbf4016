"""What tests know of each component: from its ports and its behaviour, or from settings.toml."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from fmus.discovery import components, source_of
from fmus.ports.behaviour import Behaviour
from fmus.ports.groups import ParameterSet
from fmus.ports.port import Port
from support.tiers import slow

SETTINGS = Path(__file__).with_suffix(".toml")


def ports_of(name: str) -> Sequence[Port]:
    """The ports of a component of the bundle, all but `fault`."""
    return source_of(name).definition.ports


#: Names of all components, and of those with inputs.
NAMES = [*components()]
WITH_INPUTS = [n for n in NAMES if any(port.causality == "input" for port in ports_of(n))]

#: One with noise and one without: between them they have ports of all types, states, and all that
#: can go wrong. What every component has from the same base is tried on these, and on the others
#: with `-m slow`.
REPRESENTATIVES = ("AuvPlant", "ObserverController")
EACH = [*REPRESENTATIVES, *slow(*(name for name in NAMES if name not in REPRESENTATIVES))]


class Setting(NamedTuple):
    """Values that a case needs, each of which is good, and values with which all is well again."""

    values: Mapping[str, float]
    good: Mapping[str, float]
    at_start: Mapping[str, float] = {}
    time: float = 0.0


class Trials(NamedTuple):
    """How a component is tried.

    Attributes:
        spread: how far good values may lie from those at the start [share].
        overflow: values with which a state or an output of a step leaves the range of numbers.
        no_start: values that no state and outputs at the start time follow from.
        wild: values with which others need not fit together any more.

    """

    spread: float = 0.5
    overflow: Setting | None = None
    no_start: Setting | None = None
    wild: Mapping[str, Any] = {}


@cache
def trials_of(name: str) -> Trials:
    """How a component is tried; one not in settings.toml, and an FMU of others, as any may be."""
    if name not in components():
        return Trials()
    said: dict[str, Any] = tomllib.loads(SETTINGS.read_text()).get(name, {})
    settings = {key: Setting(**said.pop(key)) for key in ("overflow", "no_start") if key in said}
    return Trials(**said, **settings)


@cache
def choices_of(name: str, port: str) -> Sequence[int]:
    """The values of a port that is an enumeration; of another port none."""
    return [number for p in ports_of(name) if p.name == port for number in p.choices.values()]


def parameters_of(name: str) -> ParameterSet[Any]:
    """What the parameters of a component mean to its equations."""
    return source_of(name).definition.parameters


def behaviour_of(name: str) -> Behaviour:
    return source_of(name).definition.behaviour
