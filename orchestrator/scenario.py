"""Scenarios: a title, a stop time and parameters over the closed loop, in a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError
from orchestrator.system import PortName

FOLDER = Path(__file__).parent / "scenarios"


@dataclass(frozen=True)
class Scenario:
    """What to run and how to show it.

    Attributes:
        name: of the file, without its ending.
        title: heading of the figures.
        figure: which figure to draw, a key of `orchestrator.figures.FIGURES`.
        stop_time, step: experiment [s]; None: the system's own.
        parameters: values that differ from the components' defaults.

    """

    name: str
    title: str = ""
    figure: str = "tracking"
    stop_time: float | None = None
    step: float | None = None
    parameters: Mapping[PortName, Any] = field(default_factory=dict)


def names() -> list[str]:
    """Scenarios that come with the bundle."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_scenario(name: str) -> Scenario:
    """A scenario of the bundle by its name, or any by the path of its file.

    Raises:
        InputError: there is no such scenario, or its file has a mistake.

    """
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"no scenario {name!r}; there are {', '.join(names())}, or give a .toml or .ssp file"
        ) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: {error}") from error
    known: dict[str, type | tuple[type, ...]] = {
        "title": str,
        "figure": str,
        "stop_time": (int, float),
        "step": (int, float),
    }
    for key, value in content.items():
        if key == "parameters" and isinstance(value, dict):
            continue
        if key not in known:
            raise InputError(f"{path}: unknown entry {key!r}; use parameters, {', '.join(known)}")
        if not isinstance(value, known[key]):
            raise InputError(f"{path}: {key} = {value!r} is of the wrong type")
    parameters = dict(_flattened(content.pop("parameters", {})))
    return Scenario(path.stem, parameters=parameters, **content)


def _flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[PortName, Any]]:
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            yield from _flattened(value, name)
        else:
            yield port_name(name), value


def port_name(text: str) -> PortName:
    """`component.port`, taken apart at the first dot.

    Raises:
        InputError: there is no dot.

    """
    component, dot, port = text.partition(".")
    if not (component and dot and port):
        raise InputError(f"{text!r}: write component.port")
    return PortName(component, port)
