"""Ports of FormationPlanner."""

from __future__ import annotations

from auv_fmu.formation import MOST, SHAPES, Estimator, Parameters, Stages
from auv_fmu.quantities import ACCELERATION, POSITION, VELOCITY
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, parameter, setting
from fmus.ports.vehicle import CONTROL_POINT, LIMITS, PAPER, VEHICLE, reference

DESCRIPTION = "Formation planner: reference of a vehicle that keeps its place beside a leader"
ORIGIN = PAPER

#: Fields of its inputs that bear another name than their group of ports.
GROUP_OF = {"psi_0": "eta_0"}

_DEFAULTS, _STAGES, _ESTIMATOR = Parameters(), Stages(), Estimator()

#: Most vehicles of a formation.
_CROWD = 64

_INPUTS = (
    *inputs("y_0", POSITION, "Control point of the leader's reference, or as a link brings it"),
    *inputs("dy_0", VELOCITY, "Velocity of the leader's reference, unless `estimated`"),
    *inputs("ddy_0", ACCELERATION, "Acceleration of the leader's reference, unless `estimated`"),
    *inputs("eta_0", {"psi": "rad"}, "Heading of the leader's path"),
    Port("age", "input", "continuous", "Real", "Age of y_0, if `estimated`", "s", start=0.0),
)

_NAMES = {value: name for name, value in SHAPES.items()}


def _of_each_stage(name: str, starts: tuple[float, ...], description: str) -> tuple[Port, ...]:
    return tuple(
        parameter(f"stage[{k}].{name}", start, "m", description)
        for k, start in enumerate(starts, start=1)
    )


def _of_each_change(
    name: str, starts: tuple[float, ...], description: str, minimum: float | None = None
) -> tuple[Port, ...]:
    return tuple(
        parameter(f"stage[{k}].{name}", start, "s", description, minimum)
        for k, start in enumerate(starts, start=2)
    )


_SHAPE = tuple(
    setting(
        f"stage[{k}].shape",
        _NAMES[shape],
        "Shape: line (abreast), column (astern), v, circle, or table (the offset)",
        SHAPES,
    )
    for k, shape in enumerate(_STAGES.shape, start=1)
)
_SPACING = tuple(
    parameter(f"stage[{k}].spacing", start, "m", "Distance of neighbours, except in a table", 0.0)
    for k, start in enumerate(_STAGES.spacing, start=1)
)
_X = _of_each_stage("offset.x", _STAGES.x, "Offset of a table: forward")
_Y = _of_each_stage("offset.y", _STAGES.y, "Offset of a table: to starboard")
_Z = _of_each_stage("offset.z", _STAGES.z, "Offset of a table: down")
_T = _of_each_change("t", _STAGES.t, "When the change to the stage begins")
_DURATION = _of_each_change("duration", _STAGES.duration, "How long the change takes", POSITIVE)

_COUNT = setting(
    "stages", _STAGES.n, "Number of stages; later ones are not used", minimum=1, maximum=MOST
)

PARAMETERS = ParameterSet(
    Parameters,
    number=setting("number", _DEFAULTS.number, "Place of this vehicle", minimum=1, maximum=_CROWD),
    vehicles=setting(
        "vehicles", _DEFAULTS.vehicles, "Number of vehicles", minimum=1, maximum=_CROWD
    ),
    stages=ParameterSet(
        Stages,
        n=_COUNT,
        shape=_SHAPE,
        spacing=_SPACING,
        x=_X,
        y=_Y,
        z=_Z,
        t=_T,
        duration=_DURATION,
    ),
    omega_chi=parameter(
        "omega_chi", _DEFAULTS.omega_chi, "rad/s", "Of the filter of the heading", POSITIVE
    ),
    turn_chi=parameter(
        "turn_chi", _DEFAULTS.turn_chi, "rad/s", "Fastest turn that the formation follows", 0.0
    ),
    estimated=setting(
        "estimated",
        _DEFAULTS.estimated,
        "Whether the leader is known by y_0, eta_0 and age only, and estimated by (23), (51)",
    ),
    estimator=ParameterSet(
        Estimator,
        lambda_=parameter("lambda", _ESTIMATOR.lambda_, "m/s", "Lambda = lambda I", POSITIVE),
        k_d=parameter("k_d", _ESTIMATOR.k_d, "1/s", "Gain of the observer", POSITIVE),
        age_max=parameter(
            "age_max", _ESTIMATOR.age_max, "s", "Age from which y_0 is not used any more", 0.0
        ),
        z_max=parameter(
            "z_max", _ESTIMATOR.z_max, "m", "Largest error that is corrected at once", POSITIVE
        ),
    ),
    vehicle=VEHICLE,
    ell=CONTROL_POINT,
    limits=LIMITS,
    speed_max=parameter("speed_max", _DEFAULTS.speed_max, "m/s", "Largest accepted speed", 0.0),
    turn_max=parameter("turn_max", _DEFAULTS.turn_max, "rad/s", "Largest accepted turn rate", 0.0),
)

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *reference("Posture of a vehicle that points along its reference", _INPUTS),
    *PARAMETERS.ports,
    H_MAX,
)
