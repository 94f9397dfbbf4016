"""Scenarios: a title, a stop time and parameters over the closed loop, in a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError
from orchestrator.system.structure import PortName, port_name

FOLDER = Path(__file__).parent / "scenarios"


@dataclass(frozen=True)
class Scenario:
    """What to run and how to show it.

    Attributes:
        name: of the file, without its ending.
        title: heading of the figures.
        label: of its lines where two runs are drawn together.
        figure: which figure to draw, a key of `orchestrator.analysis.figures.FIGURES`.
        compare: name of a scenario that is run and drawn together with this one.
        stop_time, step: experiment [s]; None: the system's own.
        components: FMUs that take the place of those of the closed loop: names of the bundle's
            own, or paths of .fmu files.
        wires: further wires, as in closed_loop.toml.
        only: the components to keep; empty: all.
        parameters: values that differ from the components' defaults.

    """

    name: str
    title: str = ""
    label: str = ""
    figure: str = "tracking"
    compare: str = ""
    stop_time: float | None = None
    step: float | None = None
    components: Mapping[str, str] = field(default_factory=dict)
    wires: Mapping[str, str] = field(default_factory=dict)
    only: Sequence[str] = ()
    parameters: Mapping[PortName, Any] = field(default_factory=dict)


#: Entries of a scenario file and their types.
_ENTRIES: dict[str, type | tuple[type, ...]] = {
    "title": str,
    "label": str,
    "figure": str,
    "compare": str,
    "stop_time": (int, float),
    "step": (int, float),
    "components": dict,
    "wires": dict,
    "only": list,
    "parameters": dict,
}


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
    for key, value in content.items():
        if key not in _ENTRIES:
            raise InputError(f"{path}: unknown entry {key!r}; use {', '.join(_ENTRIES)}")
        if not isinstance(value, _ENTRIES[key]) or isinstance(value, bool):
            raise InputError(f"{path}: {key} = {value!r} is of the wrong type")
        if key in ("components", "wires", "only") and isinstance(value, (dict, list)):
            texts = list(value.values()) if isinstance(value, dict) else value
            if not all(isinstance(text, str) for text in texts):
                raise InputError(f"{path}: {key} = {value!r} holds something else than names")
    content["parameters"] = dict(_flattened(content.get("parameters", {})))
    content["components"] = {
        component: str(path.parent / fmu) if str(fmu).endswith(".fmu") else str(fmu)
        for component, fmu in content.get("components", {}).items()
    }
    if content.get("compare", "").endswith(".toml"):
        content["compare"] = str(path.parent / content["compare"])
    return Scenario(path.stem, **content)


def _flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[PortName, Any]]:
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            yield from _flattened(value, name)
        else:
            yield port_name(name), value
