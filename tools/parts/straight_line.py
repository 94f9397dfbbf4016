"""The straight line `auv_fmu.loop.closed_loop` for a run of Fig. 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from auv_fmu.loop.closed_loop import LongestSteps, Setting
from fmus.ports.port import H_MAX
from orchestrator.program.components import definitions_of
from orchestrator.studies.engine import Point
from orchestrator.system.names import PortName
from orchestrator.system.structure import System


def setting_of(system: System, point: Point) -> Setting:
    """The setting with which the straight line has the numbers of a run."""
    value: Callable[[PortName], Any] = system.with_parameters(point.parameters).value
    sets, longest = dict[str, Any](), dict[str, Any]()
    for name, definition in definitions_of(system).items():
        values = {
            port.name: port.checked(value(PortName(name, port.name)))
            for port in definition.parameters.ports
        }
        sets[name] = definition.parameters.of(values)
        if H_MAX in system.components[name].variables:
            longest[name] = value(PortName(name, H_MAX))
    return Setting(**sets, h_max=LongestSteps(**longest), h=point.step)
