"""The straight line `auv_fmu.loop.closed_loop` with the parameters of a system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auv_fmu.loop.closed_loop import LongestSteps, Setting
from auv_fmu.paper.euler import STEP
from fmus.ports.port import H_MAX
from orchestrator.program.components import definitions_of
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import typed


def setting_of(system: System, step: float = STEP) -> Setting:
    """The parameters of the components of Fig. 2, as their equations take them."""
    given = {name: _values(system, name) for name in system.components}
    of = {
        name: definition.parameters.of(given[name])
        for name, definition in definitions_of(system).items()
    }
    longest = LongestSteps(*(given[name][H_MAX] for name in LongestSteps._fields))
    return Setting(of["plant"], of["controller"], of["disturbance"], of["planner"], longest, step)


def _values(system: System, component: str) -> Mapping[str, Any]:
    """The numbers of all parameters of a component."""
    found: dict[str, Any] = {}
    for variable in system.components[component].having("parameter"):
        name = PortName(component, variable.name)
        found[variable.name] = typed(str(name), variable, system.value(name))
    return found
