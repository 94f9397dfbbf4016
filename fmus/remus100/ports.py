"""Ports of Remus100."""

from __future__ import annotations

from auv_fmu.hull import Drag, Hull
from auv_fmu.plant import Localisation
from auv_fmu.quantities import ACCELERATION, ETA, NU, POSITION, TAU, VELOCITY
from auv_fmu.remus100 import Parameters
from fmus.ports.groups import ParameterSet
from fmus.ports.port import (
    H_MAX,
    POSITIVE,
    Port,
    inputs,
    outputs,
    parameter,
    parameters,
    setting,
)
from fmus.ports.tail import REMUS, TAIL, TAIL_COMMAND
from fmus.ports.vehicle import CONTROL_POINT

DESCRIPTION = "REMUS 100: underwater vehicle with fins and a propeller, and noisy position sensor"
ORIGIN = REMUS

_HULL, _DRAG, _DEFAULTS, _LOCALISATION = Hull(), Drag(), Parameters(), Localisation()

#: Largest standard deviation [m]: with it, no finite position becomes an infinite measurement.
_FARTHEST = 1e6

_WATER = inputs("water", VELOCITY, "Velocity of the water in the earth frame, added to current")


def _constant(name: str, start: float, description: str) -> Port:
    return parameter(name, start, "s", f"Time constant of {description}", POSITIVE)


PARAMETERS = ParameterSet(
    Parameters,
    hull=ParameterSet(
        Hull,
        length=parameter("length", _HULL.length, "m", "Length of the hull", POSITIVE),
        diameter=parameter("diameter", _HULL.diameter, "m", "Diameter of the hull", POSITIVE),
        mass=parameter(
            "mass", _HULL.mass, "kg", "Mass; the hull is as heavy as its displacement", POSITIVE
        ),
        gravity=parameter("gravity", _HULL.gravity, "m/s2", "Acceleration of gravity", 0.0),
        r_bg=parameters(
            "r_bg", _HULL.r_bg, POSITION, "Centre of mass from the centre of buoyancy, body frame"
        ),
        added_roll=parameter(
            "added_roll",
            _HULL.added_roll,
            "1",
            "Added moment of inertia in roll, per inertia of the hull",
            minimum=0.0,
        ),
    ),
    drag=ParameterSet(
        Drag,
        c_d=parameter("drag.along", _DRAG.c_d, "1", "Drag along the hull, per frontal area", 0.0),
        c_d_across=parameter(
            "drag.across", _DRAG.c_d_across, "1", "Drag across the hull, per area of its side", 0.0
        ),
        wing=parameter(
            "lift.area", _DRAG.wing, "1", "Area that lifts, per length times diameter", POSITIVE
        ),
        oswald=parameter("lift.oswald", _DRAG.oswald, "1", "Oswald's efficiency number", POSITIVE),
        T_surge=_constant("drag.T.surge", _DRAG.T_surge, "surge at low speed"),
        T_sway=_constant("drag.T.sway", _DRAG.T_sway, "sway at low speed"),
        T_heave=_constant("drag.T.heave", _DRAG.T_heave, "heave"),
        T_yaw=_constant("drag.T.yaw", _DRAG.T_yaw, "yaw"),
        zeta_roll=parameter("drag.zeta.roll", _DRAG.zeta_roll, "1", "Damping ratio of roll", 0.0),
        zeta_pitch=parameter(
            "drag.zeta.pitch", _DRAG.zeta_pitch, "1", "Damping ratio of pitch", 0.0
        ),
        fading=parameter(
            "drag.fading",
            _DRAG.fading,
            "s/m",
            "How fast the linear drag of surge and sway fades with speed",
            minimum=0.0,
        ),
    ),
    tail=TAIL,
    T_delta=parameter("fin.T", _DEFAULTS.T_delta, "s", "Time constant of the fins", minimum=0.0),
    T_n=parameter("propeller.T", _DEFAULTS.T_n, "s", "Time constant of the propeller", minimum=0.0),
    ell=CONTROL_POINT,
    eta0=parameters("eta0", _DEFAULTS.eta0, ETA, "Initial posture"),
    nu0=parameters("nu0", _DEFAULTS.nu0, NU, "Initial velocity in the body frame"),
    noise=ParameterSet(
        Localisation,
        std=parameter(
            "noise.std",
            _LOCALISATION.std,
            "m",
            "Standard deviation of each measured coordinate",
            minimum=0.0,
            maximum=_FARTHEST,
        ),
        seed=setting("noise.seed", _LOCALISATION.seed, "Seed of the noise"),
    ),
    current=parameters(
        "current",
        _DEFAULTS.current,
        VELOCITY,
        "Ocean current in the earth frame",
        tunable=True,
    ),
)

PORTS: tuple[Port, ...] = (
    *inputs("command", TAIL_COMMAND, "Command of rudder, stern planes and propeller"),
    *_WATER,
    *outputs("eta", ETA, "Position of the centre of buoyancy and Euler angles"),
    *outputs("nu", NU, "Velocity in the body frame"),
    *outputs("y", POSITION, "Measured control point, with noise"),
    *outputs("dy", VELOCITY, "True velocity of the control point"),
    *outputs(
        "tau_applied", TAU, "Force and moments that fins and propeller give", initially=_WATER
    ),
    *outputs("nu_r", NU, "Velocity through the water in the body frame", initially=_WATER),
    *outputs("actuator", TAIL_COMMAND, "What rudder, stern planes and propeller are"),
    *PARAMETERS.ports,
    H_MAX,
    # At the end: value references of the ports before it stay as they were.
    *inputs("dwater", ACCELERATION, "Acceleration of the water in the earth frame"),
)
