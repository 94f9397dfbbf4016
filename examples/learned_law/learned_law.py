"""A learned law: a network of 96 weights, which `train.py` found by trial on random vehicles.

    x = (omega^2 R'e, omega R'de, omega v) / a_0,  v = R' dy                9 inputs
    u = a_0 W_2 tanh(W_1 x)                                                 an acceleration
    f = M (u + R' ddy_d) + D v, limited to what tau_max allows

e = y - y_d is the error. M and D are mass and drag at the control point (see
`auv_fmu.paper.point_mass`); they, a frequency omega and an acceleration a_0 take the size of the
vehicle out of the network. Its first weights were a saturated PD law of three neurons, u = -a_0
tanh((omega^2 e + 2 omega de) / a_0). Evolution strategies improved them: Salimans et al., Evolution
strategies as a scalable alternative to reinforcement learning, arXiv:1703.03864 (2017).

Nothing is proven of this law. It measures dy, and has no memory: constant forces leave an error.
With the default inputs the vehicle does not move, and the command is constant.
"""

from __future__ import annotations

from math import tanh
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector
from auv_fmu.paper.point_mass import Inputs, Outputs, PointMass, axes, command, limited, times

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "a_0": (0.05, 10.0)}

#: Neurons, and weights: a row for each neuron, a row for each axis.
NEURONS = 8
W_1 = Matrix(
    (
        (2.659, 0.009, -0.210, 1.813, 0.136, 0.162, -0.155, 0.130, 0.387),
        (0.027, 2.062, 0.193, 0.074, 2.892, -0.218, -0.093, -0.472, 0.160),
        (0.208, 0.080, 2.017, 0.366, -0.062, 2.515, 0.024, 0.069, 0.147),
        (0.218, 0.120, 0.063, 1.420, -0.871, -0.223, 0.826, -0.188, 0.332),
        (-0.004, -1.250, -0.227, 0.100, -0.560, -0.216, -0.144, -0.820, -0.337),
        (0.323, 0.529, -0.143, 0.763, 0.329, -0.199, 0.002, 0.588, -0.125),
        (0.971, -1.298, 0.614, 0.119, -0.046, 0.069, -0.131, -0.191, -0.689),
        (-1.119, -0.112, 0.032, -0.172, 0.541, -0.780, -0.374, 0.891, 0.258),
    )
)
W_2 = Matrix(
    (
        (-2.590, -0.162, 0.429, 0.084, 0.303, -0.322, -0.439, 0.724),
        (-0.335, -2.566, 0.333, 0.508, 1.030, -0.099, 0.915, 0.286),
        (0.158, -0.274, -2.745, -0.142, 0.147, 0.104, -0.854, -0.021),
    )
)


class Parameters(NamedTuple):
    """Gains, vehicle, and weights."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    a_0: Annotated[float, Variable("m/s2", "Scale of the acceleration", POSITIVE)] = 1.0
    point: Annotated[PointMass, Variable(name="")] = PointMass()
    W_1: Annotated[Matrix, NEURONS, 9, Variable("1", "Weight of an input")] = W_1
    W_2: Annotated[Matrix, 3, NEURONS, Variable("1", "Weight of a neuron")] = W_2


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Return the command."""
    omega, a_0, point, R_T = parameters.omega, parameters.a_0, parameters.point, axes(inputs.eta)
    e, de, v = R_T @ (inputs.y - inputs.y_d), R_T @ (inputs.dy - inputs.dy_d), R_T @ inputs.dy
    x = omega / a_0 * Vector((*(omega * e), *de, *v))
    u = a_0 * (parameters.W_2 @ Vector(tanh(z) for z in parameters.W_1 @ x))
    force = times(point.mass, u + R_T @ inputs.ddy_d) + times(point.drag, v)
    return Outputs(command(point, limited(point, force)))
