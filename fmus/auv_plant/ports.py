"""Ports of AuvPlant."""

from __future__ import annotations

from auv_fmu.plant import ETA_0, INTEGRATORS, NU_0, Localisation, Parameters, RollAxis
from auv_fmu.quantities import ACCELERATION, ETA, LAG, NU, POSITION, TAU, TAU_W, VELOCITY
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, outputs, parameter, parameters, setting
from fmus.ports.vehicle import CONTROL_POINT, LIMITS, PAPER, VEHICLE

DESCRIPTION = "Autonomous underwater vehicle with limited actuators and noisy position sensor"
ORIGIN = PAPER

_ROLL, _LOCALISATION, _DEFAULTS = RollAxis(), Localisation(), Parameters()

#: Largest standard deviation [m]: with it, no finite position becomes an infinite measurement.
_FARTHEST = 1e6

_COMMAND = inputs("tau", TAU, "Commanded force and moments")

_ROLLS = setting(
    "roll",
    _ROLL.rolls,
    "Whether roll is free; if false, the vehicle follows (1) and (2). Not in the paper",
)
_CURRENT = parameters(
    "current",
    _DEFAULTS.current,
    VELOCITY,
    "Ocean current in the earth frame; not in the paper",
    tunable=True,
)
_LAGS = parameters(
    "actuator.T",
    _DEFAULTS.T,
    LAG,
    "Time constant of the actuator lag, after the limits; 0: no lag. Not in the paper (Remark 2)",
    minimum=0.0,
)
_INTEGRATOR = setting(
    "integrator",
    "euler",
    "Scheme that integrates (1) and (2): euler, as in the paper, or rk4",
    INTEGRATORS,
)

PARAMETERS = ParameterSet(
    Parameters,
    vehicle=VEHICLE,
    roll=ParameterSet(
        RollAxis,
        m44=parameter("m44", _ROLL.m44, "kg.m2", "Roll inertia, including added inertia", POSITIVE),
        d44=parameter("d44", _ROLL.d44, "kg.m2/s", "Linear damping of roll", minimum=0.0),
        righting_roll=parameter(
            "righting.roll",
            _ROLL.righting_roll,
            "N.m",
            "Righting moment in roll, not given in the paper; by default as in pitch",
        ),
        rolls=_ROLLS,
    ),
    ell=CONTROL_POINT,
    limits=LIMITS,
    eta0=parameters("eta0", ETA_0, ETA, "Initial posture"),
    nu0=parameters("nu0", NU_0, NU, "Initial velocity in the body frame"),
    noise=ParameterSet(
        Localisation,
        std=parameter(
            "noise.std",
            _LOCALISATION.std,
            "m",
            "Standard deviation of each measured coordinate, not given in the paper",
            minimum=0.0,
            maximum=_FARTHEST,
        ),
        seed=setting("noise.seed", _LOCALISATION.seed, "Seed of the noise"),
    ),
    current=_CURRENT,
    T=_LAGS,
    integrator=_INTEGRATOR,
)

_LATER = (_ROLLS, *_CURRENT, *_LAGS, _INTEGRATOR)

_WATER = inputs("water", VELOCITY, "Velocity of the water in the earth frame, added to current")

PORTS: tuple[Port, ...] = (
    *_COMMAND,
    *inputs("tau_w", TAU_W, "Disturbance, with the sign of (2)"),
    *outputs("eta", ETA, "Position of the centre of mass and Euler angles"),
    *outputs("nu", NU, "Velocity in the body frame"),
    *outputs("y", POSITION, "Measured control point, with noise"),
    *outputs("dy", VELOCITY, "True velocity of the control point"),
    *outputs("tau_applied", TAU, "Force and moments after the limits of (3)", _COMMAND),
    *PARAMETERS.before(*_LATER),
    H_MAX,
    *_LATER,
    *_WATER,
    *outputs("nu_r", NU, "Velocity through the water in the body frame", initially=_WATER),
    *inputs("dwater", ACCELERATION, "Acceleration of the water in the earth frame"),
)
