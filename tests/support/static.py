"""Components that are functions: systems without FMUs, whose values are solved for by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from orchestrator.cosim import System
from orchestrator.cosim.fmi.instance import Part
from orchestrator.cosim.variables import StringTable
from support.archives import fmu, variable
from support.small_fmus import connected

#: Columns of the ports in the row.
_PLACES = {name: place for place, name in enumerate(("u", "v", "y", "z"))}

#: Outputs, y and z, of inputs, u and v.
Function = Callable[..., tuple[float, float]]


class Static(SimpleNamespace):
    """An instance whose outputs follow from its inputs at once; it counts how often they do."""

    def __init__(self, name: str, function: Function, slopes: object = None) -> None:
        """Compute by a function, and give its derivatives: rows are outputs."""
        super().__init__(name=name, exchanged=0, gives_derivatives=slopes is not None)
        self._function, self._slopes = function, slopes

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        self._values = values

    def exchange(self) -> None:
        self.exchanged += 1
        self._values[2:4] = self._function(*self._values[:2])

    def derivatives(self, outputs: Sequence[str], variable: str) -> list[float]:
        slopes = np.asarray(self._slopes)
        return [float(slopes[_PLACES[output] - 2, _PLACES[variable]]) for output in outputs]

    def read(self, ports: Sequence[str]) -> dict[str, Any]:
        return {port: float(self._values[_PLACES[port]]) for port in ports}

    def enter_initialization(self, values: Mapping[str, Any], start_time: float = 0.0) -> None:
        """Do nothing."""

    def exit_initialization(self) -> None:
        """Do nothing."""


def static_system(
    folder: Path, names: Sequence[str], wires: Mapping[str, str], kind: str = "Real"
) -> System:
    """A system of such components.

    Args:
        folder: for their description.
        names: of the components, in their order.
        wires: sources by targets.
        kind: type of their ports.

    """
    ports = [variable(name, "input", kind) for name in "uv"]
    ports += [variable(name, "output", kind) for name in "yz"]
    path = folder / f"{kind}.fmu"
    return connected("static", dict.fromkeys(names, fmu(path, *ports)), wires)
