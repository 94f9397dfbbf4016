"""Which sensors a controller has: what reaches it in the graph of connections."""

from __future__ import annotations

from orchestrator.system.graph import reaching
from orchestrator.system.structure import System
from orchestrator.system.values import unit_of
from orchestrator.vehicle.signals import CONTROLLER

#: Units of a velocity at a port.
_VELOCITY_UNITS = {"m/s", "rad/s"}


def velocities_reaching(system: System, component: str = CONTROLLER) -> list[str]:
    """Velocities of the vehicle that reach a component, directly or through others.

    The vehicle is what the component feeds. Empty for a controller without velocity sensors.
    """
    vehicles = {c.target.component for c in system.connections if c.source.component == component}
    sources = (connection.source for connection in reaching(system, component, until=vehicles))
    return sorted(
        {
            str(source)
            for source in sources
            if source.component in vehicles
            and unit_of(system.component(source.component).variable(source.port)) in _VELOCITY_UNITS
        }
    )
