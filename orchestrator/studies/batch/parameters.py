"""Which parameter of which component sets which field of the equations' parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from auv_fmu import motion_planner, plant
from auv_fmu.closed_loop import LongestSteps, Setting
from auv_fmu.disturbance import Disturbance
from auv_fmu.observer import FORMS
from auv_fmu.output_feedback import Gains
from auv_fmu.pd import PdGains
from auv_fmu.plant import INTEGRATORS
from auv_fmu.saturation import SATURATIONS
from auv_fmu.vehicle import Vehicle
from orchestrator.machine.errors import InputError
from orchestrator.system.names import PortName
from orchestrator.system.values import Value
from orchestrator.vehicle.signals import ACTUATORS, AXES, DIRECTIONS, EULER

#: Where a value lies: fields, and places in tuples.
Path = tuple[str | int, ...]

_H_MAX = "h_max"

#: Inputs of the plant that the loop leaves open.
_WATER = [PortName("plant", f"water.{axis}") for axis in AXES]


def _members(group: str, members: Iterable[object], *path: str) -> dict[str, Path]:
    """The parameters `group.member` of a tuple; its field has the group's name unless given."""
    return {f"{group}.{m}": (*(path or (group,)), i) for i, m in enumerate(members)}


def _numbered(group: str, n: int) -> dict[str, Path]:
    return {f"{group}[{i + 1}]": (group, i) for i in range(n)}


def _plain(names: Sequence[str]) -> dict[str, Path]:
    return {name: (name,) for name in names}


_VEHICLE: dict[str, Path] = {name.replace("_", "."): ("vehicle", name) for name in Vehicle._fields}
_BOTH_CONTROLLERS: dict[str, Path] = {
    **_numbered("K1", 3),
    "lambda": ("lambda_",),
    **_numbered("theta_0", 4),
    **_plain(("gamma", "sigma", "eps_t", "ell", "printed_jacobian")),
}

#: By the FMU's name, where each of its parameters but `h_max` lies in the set of the equations.
PATHS: Mapping[str, Mapping[str, Path]] = {
    "AuvPlant": {
        **_VEHICLE,
        "m44": ("roll", "m44"),
        "d44": ("roll", "d44"),
        "righting.roll": ("roll", "righting_roll"),
        "roll": ("roll", "rolls"),
        "ell": ("ell",),
        **_members("tau_max", ACTUATORS, "limits", "tau_max"),
        **_members("tau_min", ACTUATORS, "limits", "tau_min"),
        **_members("eta0", (*AXES, *EULER)),
        **_members("nu0", DIRECTIONS),
        "noise.std": ("noise", "std"),
        "noise.seed": ("noise", "seed"),
        **_members("current", AXES),
        **_members("actuator.T", ACTUATORS, "T"),
        "integrator": ("integrator",),
    },
    "ObserverController": {
        **_BOTH_CONTROLLERS,
        **_numbered("K2", 3),
        **_plain(("k_d", "innovation_gate")),
        "saturation": ("s",),
        "observer": ("form",),
    },
    "PdController": _BOTH_CONTROLLERS,
    "DisturbanceGenerator": _plain(Disturbance._fields),
    "MotionPlanner": {
        **_VEHICLE,
        **_members("tau_d", ACTUATORS),
        **_members("eta0", (*AXES, *EULER[1:])),
        **_members("nu0", (direction for direction in DIRECTIONS if direction != "p")),
        "ell": ("ell",),
    },
}

#: Those that are texts, and what each text stands for.
CHOICES: Mapping[str, Mapping[str, int]] = {
    "saturation": SATURATIONS,
    "observer": FORMS,
    "integrator": INTEGRATORS,
}

#: The sets by the names of the FMUs, with the FMUs' own values.
DEFAULTS: Mapping[str, Any] = {
    "AuvPlant": plant.Parameters(),
    "ObserverController": Gains(),
    "PdController": PdGains(),
    "DisturbanceGenerator": Disturbance(),
    "MotionPlanner": motion_planner.Parameters(),
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
    sets = {component: DEFAULTS[fmu] for component, fmu in fmus.items()}
    longest: dict[str, Any] = {}
    for name, value in parameters.items():
        if name.port == _H_MAX:
            longest[name.component] = value
        elif name not in _WATER:
            path = PATHS[fmus[name.component]][name.port]
            meant = _meant(name, value)
            sets[name.component] = _replaced(sets[name.component], path, meant)
    water: Any = tuple(parameters.get(name, 0.0) for name in _WATER)
    still = sets["plant"]
    sets["plant"] = still._replace(current=plant.flow(still, water))
    return Setting(**sets, h_max=LongestSteps(**longest), h=step)


def _meant(name: PortName, value: Value) -> Value:
    """What the equations take for a value."""
    if not isinstance(value, str):
        return value
    choices = CHOICES[name.port]
    if value not in choices:
        raise InputError(
            f"{name.component}: {name.port} = {value!r}: use one of {', '.join(choices)}"
        )
    return choices[value]


def _replaced(whole: Any, path: Path, value: Value) -> Any:
    """A set with another value at a place."""
    if not path:
        return value
    first, *rest = path
    if isinstance(first, int):
        changed = _replaced(whole[first], tuple(rest), value)
        return (*whole[:first], changed, *whole[first + 1 :])
    return whole._replace(**{first: _replaced(getattr(whole, first), tuple(rest), value)})
