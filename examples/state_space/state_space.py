"""A linear system in state-space form, with its matrices as parameters.

    dx/dt = A x + B u
    y     = C x + D u

It has three states, three inputs and three outputs; a smaller system leaves rows and columns at
zero. The elements of a matrix are ports of their own: A[1,2] is in the first row and the second
column. The matrices are tunable, so the system may change during a run. It is stepped by the
explicit Euler rule.

This is the model StateSpace of the Reference FMUs of the Modelica Association, with the same names
and values, except that its sizes are fixed. It gives their published result.

With the default values all matrices are the identity: each state grows like exp(t). Look at `y`;
then set A to (0, 1, 0), (-1, 0, 0), (0, 0, -1) for an oscillator and a decay.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Matrix, Variable, Vector

IDENTITY = Matrix(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))

H_MAX, STEP_SIZE, STOP_TIME = 0.001, 0.1, 10.0


class Parameters(NamedTuple):
    """Matrices, and state at the start."""

    A: Annotated[Matrix, 3, 3, Variable("1/s", "From states to rates", tunable=True)] = IDENTITY
    B: Annotated[Matrix, 3, 3, Variable("1/s", "From inputs to rates", tunable=True)] = IDENTITY
    C: Annotated[Matrix, 3, 3, Variable("1", "From states to outputs", tunable=True)] = IDENTITY
    D: Annotated[Matrix, 3, 3, Variable("1", "From inputs to outputs", tunable=True)] = IDENTITY
    x0: Annotated[Vector, 3, Variable("1", "State at the start")] = Vector((0.0, 0.0, 0.0))


class Inputs(NamedTuple):
    """Inputs of the system."""

    u: Annotated[Vector, 3, Variable("1", "Inputs")] = Vector((1.0, 2.0, 3.0))


class State(NamedTuple):
    """State of the system."""

    x: Annotated[Vector, 3, Variable("1", "State")]


class Outputs(NamedTuple):
    """Outputs of the system."""

    y: Annotated[Vector, 3, Variable("1", "Outputs")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.x0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    return State(state.x + h * rates(parameters, state, inputs).x)


def rates(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """Rates of the state."""
    return State(parameters.A @ state.x + parameters.B @ inputs.u)


def outputs(parameters: Parameters, state: State, inputs: Inputs) -> Outputs:
    """Outputs of the system."""
    return Outputs(parameters.C @ state.x + parameters.D @ inputs.u)
