"""A fault detector: statistics of the last residuals in a queue, and a CUSUM test."""

from __future__ import annotations

from enum import IntEnum
from math import sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

SIZE = 12  # of the queue
STEP_SIZE, STOP_TIME = 0.1, 30.0


class Fault(IntEnum):
    NONE = 0
    SPIKES = 1
    BIAS = 2
    NOISE = 3


class Parameters(NamedTuple):
    sigma: Annotated[float, Variable("m", "Of a healthy residual", POSITIVE)] = 0.4
    drift: Annotated[float, Variable("1", "Of the CUSUM", POSITIVE, tunable=True)] = 0.5
    spikes: Annotated[int, Variable(description="How many are a fault", minimum=1)] = 3


class Inputs(NamedTuple):
    measured: Annotated[float, Variable("m", "Of the sensor")] = 0.3
    expected: Annotated[float, Variable("m", "Of the model")] = 0.0


class State(NamedTuple):
    queue: Annotated[Vector, SIZE] = Vector([0.0] * SIZE)
    cusum: float = 0.0
    fault: Fault = Fault.NONE
    since: int = 0


class Outputs(NamedTuple):
    found: Annotated[Fault, Variable(description="What is wrong")]
    mean: Annotated[float, Variable("1", "Of the residuals")]
    std: Annotated[float, Variable("1", "Of the residuals")]
    since: Annotated[int, Variable(description="Steps with this fault")]


def statistics(queue: Vector) -> tuple[float, float]:
    mean = sum(queue) / len(queue)
    variance = sum((x - mean) ** 2 for x in queue) / (len(queue) - 1)
    return mean, sqrt(variance)


def classify(queue: Vector, cusum: float, spikes: int = 3, limit: float = 8.0) -> Fault:
    if sum(abs(x) > 3.0 for x in queue) >= spikes and any(abs(x) <= 1.0 for x in queue):
        return Fault.SPIKES
    if cusum > limit or all(x > 0.5 for x in queue):
        return Fault.BIAS
    _, std = statistics(queue)
    return Fault.NOISE if std > 2.0 else Fault.NONE


def start() -> State:
    return State()


def update(parameters: Parameters, state: State, inputs: Inputs) -> State:
    residual = (inputs.measured - inputs.expected) / parameters.sigma
    queue = Vector([*state.queue[1:], residual])
    cusum = min(max(0, state.cusum + abs(residual) - parameters.drift), 100.0)
    fault = classify(queue, cusum, spikes=parameters.spikes)
    since = state.since + 1 if fault is state.fault else 0
    if fault != Fault.NONE and since > 20:
        return State(since=since)
    return State(queue, cusum, fault, since)


def outputs(state: State) -> Outputs:
    assert len(state.queue) > 1
    mean, std = statistics(state.queue)
    return Outputs(state.fault, mean, std, state.since)


if __name__ == "__main__":
    state = start()
    for k in range(100):
        state = update(Parameters(), state, Inputs(measured=0.1 * k))
        print(k, outputs(state))
