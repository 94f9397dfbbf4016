"""Properties of each component for tests: from its ports and behaviour, or from settings.toml."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from fmus.discovery import components, source_of
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

#: One with noise and one without: between them they have ports of all types, states, and every
#: kind of refusal. Properties that all components have from the same base are tested on these, and
#: on the others with `-m slow`.
REPRESENTATIVES = ("AuvPlant", "ObserverController")
EACH = [*REPRESENTATIVES, *slow(*(name for name in NAMES if name not in REPRESENTATIVES))]


class Setting(NamedTuple):
    """Values that a case needs, each good on its own, and values with which the run continues."""

    values: Mapping[str, float]
    good: Mapping[str, float]
    at_start: Mapping[str, float] = {}
    time: float = 0.0


class Trials(NamedTuple):
    """Values that a component is tried with.

    Attributes:
        overflow: a state or an output of a step leaves the range of numbers.
        no_start: no state and outputs at the start time follow from them.

    """

    overflow: Setting | None = None
    no_start: Setting | None = None


@cache
def trials_of(name: str) -> Trials:
    """Values for a component from settings.toml; none for a third-party FMU."""
    if name not in components():
        return Trials()
    settings = tomllib.loads(SETTINGS.read_text()).get(name, {})
    return Trials(**{key: Setting(**values) for key, values in settings.items()})


@cache
def choices_of(name: str, port: str) -> Sequence[int]:
    """The values of a port that is an enumeration; of another port none."""
    return [number for p in ports_of(name) if p.name == port for number in p.choices.values()]


def parameters_of(name: str) -> ParameterSet[Any]:
    """The parameters of a component, as its equations take them."""
    return source_of(name).definition.parameters
