"""A neural network that has learned the sine, and runs without any library.

    y = w3 tanh(W2 tanh(w1 x))

Both hidden layers have five neurons. There are no biases, so the network is an odd function, as the
sine is. The weights were found by least squares at 240 points from 0 to 2 pi, and then rounded to
three places. From -2 pi to 2 pi the error is below 0.005. Outside, the network was never
trained, and its output becomes constant.

This follows PythonFMU's example `mldemo.py`, a component with the same names. That one loads a
network with TensorFlow, which the host must have; here the weights are part of the text. To export
a network of your own, print its weights as tuples and paste them below.

Look at `sin_output_tf` and `sin_output_ref` while `sin_input` grows from -10 to 10.
"""

from __future__ import annotations

from math import sin, tanh
from typing import Annotated, NamedTuple

from auv_fmu import Matrix, Variable, Vector

W1 = Vector((-0.653, 2.608, -2.315, 0.747, -0.101))
W2 = Matrix(
    (
        (4.56, 2.227, -2.736, 1.485, 4.725),
        (0.769, 0.479, 0.239, 1.046, 0.191),
        (0.298, -2.434, 2.268, 1.734, -5.93),
        (-1.921, -0.031, -0.229, -1.846, 1.725),
        (-0.157, 1.605, -0.386, 0.819, 0.677),
    )
)
W3 = Vector((4.044, 1.976, 3.903, -3.042, -0.248))

STOP_TIME = 10.0


class Inputs(NamedTuple):
    """Angle."""

    sin_input: Annotated[float, Variable("rad", "Angle")] = 0.0


class Outputs(NamedTuple):
    """Output of the network, and the exact sine."""

    sin_output_tf: Annotated[float, Variable("1", "Sine of the angle by the network")]
    sin_output_ref: Annotated[float, Variable("1", "Sine of the angle")]


def outputs(inputs: Inputs) -> Outputs:
    """Output of the network, and the exact sine."""
    x = inputs.sin_input
    return Outputs(W3 @ _activated(W2 @ _activated(W1 * x)), sin(x))


def _activated(layer: Annotated[Vector, 5]) -> Annotated[Vector, 5]:
    """The outputs of the neurons of a layer."""
    return Vector(tanh(x) for x in layer)
