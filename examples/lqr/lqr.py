"""A linear quadratic regulator that brings a cart to rest at its origin.

    p[k+1] = p[k] + T v[k] + T^2 / (2 m) u[k],  v[k+1] = v[k] + T / m u[k]

Of all controllers, u = -K x with x = (p, v) has the least cost, which is the sum of

    x'Q x + r u^2,  Q = diag(q_p, q_v)

over all samples. The gain follows from the discrete algebraic Riccati equation

    K = (r + B'P B)^-1 B'P A,  P = Q + A'P (A - B K)

which is iterated from P = Q. This happens once, because `derive` takes only the parameters. See
Åström and Wittenmark, Computer-Controlled Systems. The regulator is sampled, and has no memory.
Step it every `T` seconds, the period for which the gain is computed.

A larger `r` makes the control slower and cheaper. Look at `K_p`, `K_v` and `rounds`, and
connect `u` to a cart whose position and velocity come back as `p` and `v`.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Refusal, Variable, Vector

#: Most rounds of the iteration, and the relative change of the gain that ends it.
ROUNDS, ACCURACY = 10_000, 1e-12

SAMPLED = True
STEP_SIZE, STOP_TIME = 0.05, 5.0


class Parameters(NamedTuple):
    """Cart, and weights of the cost."""

    m: Annotated[float, Variable("kg", "Mass of the cart", minimum=POSITIVE)] = 2.0
    T: Annotated[float, Variable("s", "Sampling period", minimum=POSITIVE)] = 0.05
    q_p: Annotated[float, Variable("1/m2", "Weight of the position", minimum=0.0)] = 1.0
    q_v: Annotated[float, Variable("s2/m2", "Weight of the velocity", minimum=0.0)] = 0.1
    r: Annotated[float, Variable("1/N2", "Weight of the force", minimum=POSITIVE)] = 0.01


class Inputs(NamedTuple):
    """Measured motion of the cart."""

    p: Annotated[float, Variable("m", "Position of the cart")] = 1.0
    v: Annotated[float, Variable("m/s", "Velocity of the cart")] = 0.0


class Regulator(NamedTuple):
    """Values that depend on parameters only."""

    K: Annotated[Vector, 2]
    rounds: int


class Outputs(NamedTuple):
    """Outputs of the regulator."""

    u: Annotated[float, Variable("N", "Force on the cart")]
    K_p: Annotated[float, Variable("N/m", "Gain of the position")]
    K_v: Annotated[float, Variable("N.s/m", "Gain of the velocity")]
    rounds: Annotated[int, Variable("1", "Rounds of the iteration")]


def derive(parameters: Parameters) -> Regulator:
    """The gain, once for all samples."""
    m, T = parameters.m, parameters.T
    A = Matrix(((1.0, T), (0.0, 1.0)))
    B = Matrix(((T * T / (2 * m),), (T / m,)))
    Q = Matrix(((parameters.q_p, 0.0), (0.0, parameters.q_v)))

    def gain(P: Annotated[Matrix, 2, 2]) -> Annotated[Matrix, 1, 2]:
        return (B.T @ P @ A) / (parameters.r + (B.T @ P @ B)[0, 0])

    P, K, change, rounds = Q, gain(Q), inf, 0
    while change > ACCURACY * max(K[0]) and rounds < ROUNDS:
        P = Q + A.T @ P @ (A - B @ K)
        better = gain(P)
        change = max(Vector(abs(difference) for difference in (better - K)[0]))
        K = better
        rounds += 1
    if rounds == ROUNDS:
        raise Refusal(f"the gain has not converged after {ROUNDS} rounds")
    return Regulator(K[0], rounds)


def outputs(derived: Regulator, inputs: Inputs) -> Outputs:
    """Outputs of the regulator."""
    K = derived.K
    return Outputs(-(K @ Vector((inputs.p, inputs.v))), K[0], K[1], derived.rounds)
