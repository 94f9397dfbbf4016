"""Ports of Sea."""

from __future__ import annotations

from auv_fmu.ocean_current import Current
from auv_fmu.quantities import ACCELERATION, POSITION, VELOCITY
from auv_fmu.sea import Sea
from auv_fmu.waves import MOST, SPECTRA, Waves
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, TIME, Port, inputs, outputs, parameter, setting
from fmus.ports.vehicle import PAPER

DESCRIPTION = "Waves and an ocean current at the vehicle"
ORIGIN = PAPER

_WAVES, _CURRENT, _SEA = Waves(), Current(), Sea()

#: Largest exponent of the spreading: narrower ones need finer angles than it is integrated over.
_NARROWEST = 100.0

_POSITION = inputs("eta", POSITION, "Position of the vehicle, z down from still water")
_DIRECT = (*_POSITION, TIME)

PARAMETERS = ParameterSet(
    Sea,
    waves=ParameterSet(
        Waves,
        spectrum=setting("waves.spectrum", "jonswap", "Spectrum of the waves", SPECTRA),
        Hs=parameter("waves.Hs", _WAVES.Hs, "m", "Significant wave height", 0.0),
        Tp=parameter("waves.Tp", _WAVES.Tp, "s", "Period of the peak of the spectrum", POSITIVE),
        gamma=parameter(
            "waves.gamma", _WAVES.gamma, "1", "JONSWAP peak enhancement factor", 1.0, 10.0
        ),
        highest=parameter(
            "waves.highest",
            _WAVES.highest,
            "1",
            "Highest frequency of the waves, as a multiple of the peak's",
            1.0,
            10.0,
        ),
        direction=parameter(
            "waves.direction",
            _WAVES.direction,
            "rad",
            "Mean direction that the waves go to: 0 north, pi/2 east",
        ),
        s=parameter(
            "waves.s",
            _WAVES.s,
            "1",
            "Spreading exponent s of cos^2s(angle/2); 0: long-crested",
            0.0,
            _NARROWEST,
        ),
        n=setting(
            "waves.count",
            _WAVES.n,
            "Number of regular waves that the sea is the sum of",
            minimum=1,
            maximum=MOST,
        ),
        seed=setting("waves.seed", _WAVES.seed, "Seed of frequencies, phases and directions"),
    ),
    current=ParameterSet(
        Current,
        speed=parameter(
            "current.speed", _CURRENT.speed, "m/s", "Mean speed at the surface", 0.0, tunable=True
        ),
        direction=parameter(
            "current.direction",
            _CURRENT.direction,
            "rad",
            "Direction that the current goes to: 0 north, pi/2 east",
            tunable=True,
        ),
        root=parameter(
            "current.root",
            _CURRENT.root,
            "1",
            "Profile: the root of the height above the bottom, of this degree; 0: no profile",
            0.0,
        ),
        mu=parameter(
            "current.mu",
            _CURRENT.mu,
            "1/s",
            "Rate at which the variation is forgotten (Gauss-Markov)",
            0.0,
        ),
        sigma=parameter(
            "current.sigma",
            _CURRENT.sigma,
            "m/s",
            "Standard deviation of the variation in each horizontal direction",
            0.0,
        ),
        seed=setting("current.seed", _CURRENT.seed, "Seed of the variation"),
    ),
    depth=parameter("depth", _SEA.depth, "m", "Depth of the water; 0: deep", 0.0),
    g=parameter("g", _SEA.g, "m/s2", "Acceleration of gravity", POSITIVE),
)

PORTS: tuple[Port, ...] = (
    *_POSITION,
    *outputs("water", VELOCITY, "Velocity of the water in the earth frame", _DIRECT),
    *outputs("dwater", ACCELERATION, "Acceleration of the water in the earth frame", _DIRECT),
    Port(
        "elevation",
        "output",
        "continuous",
        "Real",
        "Elevation of the surface above still water",
        "m",
        feedthrough=tuple(port.name for port in (*_POSITION[:2], TIME)),
    ),
    *PARAMETERS.ports,
)
