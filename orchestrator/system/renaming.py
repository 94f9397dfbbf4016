"""Systems with other names for their components."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from orchestrator.system.names import PortName
from orchestrator.system.structure import System


def renamed(system: System, names: Mapping[str, str]) -> System:
    """The same system with other names for some components, which are all different."""

    def name_of(component: str) -> str:
        return names.get(component, component)

    def port_of(port: PortName) -> PortName:
        return PortName(name_of(port.component), port.port)

    return replace(
        system,
        components={
            name_of(name): replace(component, name=name_of(name))
            for name, component in system.components.items()
        },
        connections=tuple(
            replace(wire, source=port_of(wire.source), target=port_of(wire.target))
            for wire in system.connections
        ),
        parameters={port_of(port): value for port, value in system.parameters.items()},
        steps={name_of(name): step for name, step in system.steps.items()},
        left_open={port_of(port) for port in system.left_open},
    )


def flattened(system: System) -> System:
    """The same system for tools that know no systems in systems: `auv1.plant` is `auv1_plant`."""
    taken = {name for name in system.components if "." not in name}
    names = {}
    for name in system.components:
        if "." in name:
            plain = name.replace(".", "_")
            while plain in taken:
                plain += "_"
            names[name] = plain
            taken.add(plain)
    return renamed(system, names) if names else system
