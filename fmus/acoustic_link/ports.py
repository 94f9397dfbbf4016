"""Ports of AcousticLink."""

from __future__ import annotations

from auv_fmu.acoustic_link import Parameters
from auv_fmu.quantities import EULER, POSITION
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, setting
from fmus.ports.vehicle import PAPER

DESCRIPTION = "Acoustic link: messages with a vehicle's position, late and sometimes lost"
ORIGIN = PAPER

_DEFAULTS = Parameters()

#: Shortest period [s]: no modem is so quick.
_QUICKEST = 0.01

_Y = inputs("y", POSITION, "Measured control point of the sender")
_ETA = inputs("eta", EULER, "Measured Euler angle of the sender")


def _count(name: str, description: str) -> Port:
    return Port(name, "output", "discrete", "Integer", description)


PARAMETERS = ParameterSet(
    Parameters,
    period=parameter("period", _DEFAULTS.period, "s", "Time between two messages", _QUICKEST),
    sound_speed=parameter(
        "sound_speed", _DEFAULTS.sound_speed, "m/s", "Speed of sound in water", POSITIVE
    ),
    latency=parameter("latency", _DEFAULTS.latency, "s", "Delay by both modems", 0.0),
    loss=parameter("loss", _DEFAULTS.loss, "1", "Probability that a message is lost", 0.0, 1.0),
    seed=setting("seed", _DEFAULTS.seed, "Seed of the random numbers that decide what is lost"),
    outage_start=parameter(
        "outage.start", _DEFAULTS.outage_start, "s", "From when on all messages are lost"
    ),
    outage_duration=parameter(
        "outage.duration", _DEFAULTS.outage_duration, "s", "How long all messages are lost", 0.0
    ),
)

PORTS: tuple[Port, ...] = (
    *_Y,
    *_ETA,
    *inputs("receiver", POSITION, "Control point of the receiver"),
    *outputs("y_0", POSITION, "Last known control point of the sender", initially=_Y),
    *outputs("eta_0", EULER, "Last known Euler angle of the sender", initially=_ETA),
    Port("age", "output", "continuous", "Real", "Time since the last known was sent", "s"),
    _count("received", "Number of messages that have arrived"),
    _count("lost", "Number of messages that will not arrive"),
    *PARAMETERS.ports,
)
