"""Model predictive control of a cart by projected gradient descent."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector

N = 10  # horizon
DT = 0.1  # sampling time [s]
A = Matrix([[1.0, DT], [0.0, 1.0]])
B = Vector([DT**2 / 2, DT])
Q, R = Vector([10.0, 1.0]), 0.1

SAMPLED, STEP_SIZE, STOP_TIME = True, DT, 10.0


class Parameters(NamedTuple):
    u_max: Annotated[float, Variable("m/s2", "Largest input", POSITIVE, tunable=True)] = 1.0
    rate: Annotated[float, Variable("1", "Step of the descent", POSITIVE)] = 0.3
    iterations: Annotated[int, Variable("1", "Most steps", 1, 50)] = 20


class Inputs(NamedTuple):
    x: Annotated[Vector, 2, Variable("1", "Position and speed")] = Vector([1.0, 0.0])
    target: Annotated[float, Variable("m", "Where to go")] = 0.0


class State(NamedTuple):
    plan: Annotated[Vector, N]


class Outputs(NamedTuple):
    u: Annotated[float, Variable("m/s2", "Acceleration")]
    end: Annotated[float, Variable("m", "Position at the end of the horizon")]


def clip(u: float, limit: float = 1.0) -> float:
    return max(-limit, min(limit, u))


def rollout(x: Vector, u: Vector) -> list[Vector]:
    xs = [x]
    for k in range(N):
        xs.append(A @ xs[k] + B * u[k])
    return xs


def gradient(xs: Matrix, u: Vector, target: float) -> Vector:
    g, costate = [0.0] * N, Vector([0.0, 0.0])
    for k in reversed(range(N)):
        error = xs[k + 1] - Vector([target, 0.0])
        costate = A.T @ costate + Vector(q * e for q, e in zip(Q, error))
        g[k] = B @ costate + R * u[k]
    return g


def check(parameters: Parameters) -> None:
    assert parameters.rate <= 0.5, f"a rate of {parameters.rate:g} diverges"


def start() -> State:
    return State(Vector([0.0] * N))


def derive(parameters: Parameters, state: State, inputs: Inputs) -> Annotated[Vector, N]:
    u = state.plan
    for _ in range(parameters.iterations):
        g = gradient(rollout(inputs.x, u), u, target=inputs.target)
        if max(abs(a) for a in g) < 1e-6:
            return u
        u = Vector(clip(a - parameters.rate * b, parameters.u_max) for a, b in zip(u, g))
    return u


def update(derived: Annotated[Vector, N]) -> State:
    return State(Vector([*derived[1:], derived[-1]]))


def outputs(inputs: Inputs, derived: Annotated[Vector, N]) -> Outputs:
    return Outputs(u=derived[0], end=rollout(inputs.x, derived)[-1][0])


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.plot(derive(Parameters(), start(), Inputs()))
    plt.show()
