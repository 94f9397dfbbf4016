"""The setting of the loop that the parameters of its components make."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from auv_fmu import plant
from auv_fmu.closed_loop import LongestSteps, Setting
from fmus.auv_plant import ports as auv_plant
from fmus.disturbance_generator import ports as disturbance_generator
from fmus.motion_planner import ports as motion_planner
from fmus.observer_controller import ports as observer_controller
from fmus.pd_controller import ports as pd_controller
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, Refusal
from orchestrator.analysis.signals import AXES
from orchestrator.errors import InputError
from orchestrator.system.names import PortName
from orchestrator.system.values import Value

#: Where a value lies: fields, and places in tuples.
Path = tuple[str | int, ...]

#: Inputs of the plant that the loop leaves open.
_WATER = [PortName("plant", f"water.{axis}") for axis in AXES]


class _Parameters(NamedTuple):
    """The parameters of a component."""

    ports: Mapping[str, Port]
    paths: Mapping[str, Path]  #: where each lies in the set of the equations
    starts: Any  #: that set, of the ports' own values


def _declared(parameters: ParameterSet[Any]) -> _Parameters:
    ports = {port.name: port for port in parameters.ports}
    starts = {name: port.start for name, port in ports.items() if port.start is not None}
    return _Parameters(ports, parameters.paths, parameters.of(starts))


#: By the name of the FMU.
_COMPONENTS: Mapping[str, _Parameters] = {
    "AuvPlant": _declared(auv_plant.PARAMETERS),
    "ObserverController": _declared(observer_controller.PARAMETERS),
    "PdController": _declared(pd_controller.PARAMETERS),
    "DisturbanceGenerator": _declared(disturbance_generator.PARAMETERS),
    "MotionPlanner": _declared(motion_planner.PARAMETERS),
}


def setting_of(
    fmus: Mapping[str, str], parameters: Mapping[PortName, Value], step: float
) -> Setting:
    """The setting of the loop.

    Args:
        fmus: the name of the FMU of each component; these are the blocks of the setting.
        parameters: that differ from the FMUs' own, in the types of their ports.
        step: of the run [s].

    Raises:
        InputError: a component would refuse a value.

    """
    components = {name: _COMPONENTS[fmu] for name, fmu in fmus.items()}
    sets = {name: component.starts for name, component in components.items()}
    longest: dict[str, Any] = {}
    for name, value in parameters.items():
        component, port = name.component, name.port
        declared = components[component].ports.get(port)
        if port == H_MAX.name:
            longest[component] = value
        elif declared:
            try:
                meant = declared.meaning(declared.checked(value))
            except Refusal as refusal:
                raise InputError(f"{component}: {refusal}") from None
            sets[component] = _replaced(sets[component], components[component].paths[port], meant)
    water: Any = tuple(parameters.get(name, 0.0) for name in _WATER)
    sets["plant"] = sets["plant"]._replace(current=plant.flow(sets["plant"], water))
    return Setting(**sets, h_max=LongestSteps(**longest), h=step)


def _replaced(whole: Any, path: Path, value: object) -> Any:
    """A set with another value at a place."""
    if not path:
        return value
    first, *rest = path
    if isinstance(first, int):
        changed = _replaced(whole[first], tuple(rest), value)
        return (*whole[:first], changed, *whole[first + 1 :])
    return whole._replace(**{first: _replaced(getattr(whole, first), tuple(rest), value)})
