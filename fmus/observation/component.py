"""Observation for a learned controller: tracking error and reference in the body frame."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, Vector, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import ACCELERATION, EULER, POSITION, VELOCITY
from auv_fmu.language.vectors import Vector3, sub
from auv_fmu.paper.attitude import rotate_back, rotation_from_euler

SAMPLED = True

#: Units of the members of an observation.
UNITS = dict(enumerate(("m",) * 3 + ("m/s",) * 3 + ("m/s2",) * 3 + ("1",) * 3, start=1))


class Inputs(NamedTuple):
    """Inputs of the paper's controller, which has no velocity sensor."""

    y: Annotated[Vector3, Variable(POSITION, "Measured control point")]
    eta: Annotated[Vector3, Variable(EULER, "Measured Euler angle")]
    y_d: Annotated[Vector3, Variable(POSITION, "Desired control point")]
    dy_d: Annotated[Vector3, Variable(VELOCITY, "Desired velocity")]
    ddy_d: Annotated[Vector3, Variable(ACCELERATION, "Desired acceleration")]


class Outputs(NamedTuple):
    """The observation."""

    o: Annotated[
        Vector,
        12,
        Variable(UNITS, "In the body frame: y - y_d, dy_d, ddy_d and the vertical"),
    ]


def outputs(inputs: Inputs) -> Outputs:
    """Return the observation."""
    rotation = rotation_from_euler(*inputs.eta)
    return Outputs(
        Vector(
            (
                *rotate_back(rotation, sub(inputs.y, inputs.y_d)),
                *rotate_back(rotation, inputs.dy_d),
                *rotate_back(rotation, inputs.ddy_d),
                *rotate_back(rotation, (0.0, 0.0, 1.0)),
            )
        )
    )
