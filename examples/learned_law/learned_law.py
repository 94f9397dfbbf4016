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
from auv_fmu.language.quantities import TAU
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.point_mass import Inputs, PointMass, axes, command, limited, times

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "a_0": (0.05, 10.0)}

#: Neurons, and weights: a row for each neuron, a row for each axis.
NEURONS = 8
W_1 = Matrix(
    (
        (2.286, 0.053, -0.190, 1.639, 0.328, -0.336, -0.337, -0.157, 0.289),
        (0.158, 2.265, 0.288, 0.013, 2.184, -0.433, -0.196, -0.082, 0.424),
        (0.166, 0.108, 1.969, 0.189, 0.138, 2.318, 0.053, -0.018, 0.296),
        (-0.658, -0.307, -0.063, 1.234, -0.934, -0.203, 1.273, 0.201, 0.542),
        (-0.163, -1.220, -0.052, -0.468, -0.724, -0.324, -0.299, -0.655, -0.101),
        (-0.116, 0.536, -0.467, 0.496, 0.981, -0.116, -0.235, 0.304, -0.551),
        (0.907, -0.620, 0.470, 0.147, -0.390, 0.076, 0.203, 0.234, -0.588),
        (-0.722, -0.431, -0.212, 0.092, 0.698, -1.181, 0.026, 0.129, -1.204),
    )
)
W_2 = Matrix(
    (
        (-2.599, 0.214, -0.159, -0.050, 0.255, -0.326, -0.649, 0.639),
        (-0.357, -2.546, 0.148, 0.309, 1.196, -0.637, 1.123, 0.305),
        (0.427, 0.060, -2.518, 0.291, 0.449, 0.589, -0.672, -0.367),
    )
)


class Parameters(NamedTuple):
    """Gains, vehicle, and weights."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    a_0: Annotated[float, Variable("m/s2", "Scale of the acceleration", POSITIVE)] = 1.0
    point: Annotated[PointMass, Variable(name="")] = PointMass()
    W_1: Annotated[Matrix, NEURONS, 9, Variable("1", "Weight of an input")] = W_1
    W_2: Annotated[Matrix, 3, NEURONS, Variable("1", "Weight of a neuron")] = W_2


class Outputs(NamedTuple):
    """The command."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments")]


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Return the command."""
    omega, a_0, point, R_T = parameters.omega, parameters.a_0, parameters.point, axes(inputs.eta)
    e, de, v = R_T @ (inputs.y - inputs.y_d), R_T @ (inputs.dy - inputs.dy_d), R_T @ inputs.dy
    x = omega / a_0 * Vector((*(omega * e), *de, *v))
    u = a_0 * (parameters.W_2 @ Vector(tanh(z) for z in parameters.W_1 @ x))
    force = times(point.mass, u + R_T @ inputs.ddy_d) + times(point.drag, v)
    return Outputs(command(point, limited(point, force)))
