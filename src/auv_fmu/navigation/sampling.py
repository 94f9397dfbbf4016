"""Samples of all sensors: taken now and then, and late or lost.

A sensor takes a sample at the first step at or after each multiple of its `period`, from the start
of the run on. The sample arrives `delay` later, unless it is lost: by chance, or in an outage. In
between, the sensor holds its last value. The sample of the start is there at once and is never
lost, because a vehicle is aligned before it dives.

The errors of a sample are white noise, and a bias that is drawn at the start and then walks at
random. Each sample takes its random numbers whether or not it is lost, so an outage does not change
the other samples.
"""

from __future__ import annotations

from math import fmod, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.random_numbers import gaussian, start, uniform
from auv_fmu.language.variable import Refusal, Variable

#: Most numbers in a sample; a sensor with fewer leaves the last ones zero.
WIDTH = 6

#: Most samples that are under way at the same time.
PLACES = 16

#: Tolerance for rounded times, as a share of a period [1], and of a delay [s].
_ROUNDING = 1e-6
_MOMENT = 1e-9

_ZERO = Vector((0.0,) * WIDTH)


class Sampling(NamedTuple):
    """When samples are taken, how late they come, and which are lost."""

    period: Annotated[float, Variable("s", "Time between two samples; 0: every step", 0.0)] = 0.0
    delay: Annotated[float, Variable("s", "Time until a sample arrives", 0.0)] = 0.0
    loss: Annotated[float, Variable("1", "Probability that a sample is lost", 0.0, 1.0)] = 0.0
    outage_start: Annotated[
        float, Variable("s", "From when on all samples are lost", name="outage.start")
    ] = 0.0
    outage_duration: Annotated[
        float,
        Variable("s", "How long all samples are lost; 0: never", 0.0, name="outage.duration"),
    ] = 0.0
    seed: Annotated[int, Variable("1", "Seed of the errors and losses")] = 1


class Errors(NamedTuple):
    """Standard deviations of the errors of a sample, in the units of its numbers."""

    noise: Annotated[Vector, WIDTH]  #: the white noise's
    bias: Annotated[Vector, WIDTH]  #: the bias's at the start
    walk: Annotated[Vector, WIDTH]  #: the bias's change in 1 s


class SampleState(NamedTuple):
    """Samples under way, and the last one that has arrived."""

    start: float  #: time at which the run began [s]
    due: float  #: number of the next sample, a whole number
    last: float  #: time of the last one [s]
    random: float  #: state of the generator
    bias: Annotated[Vector, WIDTH]
    held: Annotated[Vector, WIDTH]  #: the last one that has arrived
    taken: float  #: time at which that one was taken [s]
    fresh: bool  #: it has arrived in this step
    queue: Annotated[Matrix, PLACES, WIDTH + 1]  #: those under way: time of taking, and numbers
    first: int  #: place of the oldest one in the queue
    waiting: int  #: number of them


def check(sampling: Sampling) -> None:
    """Refuse more samples under way than there are places for.

    Args:
        sampling: parameters.

    Raises:
        Refusal: the delay is too long for the period.

    """
    period, delay = sampling.period, sampling.delay
    if delay > PLACES * period:
        raise Refusal(
            f"a delay of {delay:g} s with a sample every {period:g} s: more than {PLACES:d} would "
            f"be under way; raise period or reduce delay"
        )


def begin(sampling: Sampling, errors: Errors, stream: int, t: float) -> SampleState:
    """State before the first sample.

    Args:
        sampling, errors: parameters.
        stream: of the random numbers.
        t: time [s].

    """
    random, bias = drawn(start(sampling.seed, stream), errors.bias)
    queue = Matrix((0.0 for j in range(WIDTH + 1)) for i in range(PLACES))
    return SampleState(t, 0.0, t, random, bias, _ZERO, t, False, queue, 0, 0)


def advance(
    sampling: Sampling, errors: Errors, state: SampleState, true: Vector, t: float
) -> SampleState:
    """State after what is due at a time, of a sensor whose errors add to the true numbers.

    Args:
        sampling, errors: parameters.
        state: after the last step.
        true: numbers of a sample without errors.
        t: time [s].

    """
    state = arrived(sampling, state, t)
    if not is_due(sampling, state, t):
        return state
    state, error = erred(errors, state, t)
    return sampled(sampling, state, true + error, t)


def drawn(random: float, std: Vector) -> tuple[float, Vector]:
    """State of a generator after some numbers, and normal numbers with standard deviations.

    Args:
        random: state of the generator before.
        std: standard deviations; where one is zero, no number is drawn.

    """
    numbers = std
    for k in range(len(std)):
        if std[k] > 0.0:
            random, n = gaussian(random)
            numbers = numbers.replaced(k, std[k] * n)
    return random, numbers


def is_due(sampling: Sampling, state: SampleState, t: float) -> bool:
    """True if a sample is taken at time t [s]."""
    if sampling.period > 0.0:
        return t - state.start >= (state.due - _ROUNDING) * sampling.period
    return t > state.last or state.due == 0.0


def arrived(sampling: Sampling, state: SampleState, t: float) -> SampleState:
    """State after the arrival of all samples until time t [s]."""
    state = state._replace(fresh=False)
    latest, k = t - sampling.delay + _MOMENT, 0
    while state.waiting > 0 and state.queue[state.first, 0] <= latest and k < PLACES:
        row = state.queue[state.first]
        state = state._replace(
            held=row[1:],
            taken=row[0],
            fresh=True,
            first=(state.first + 1) % PLACES,
            waiting=state.waiting - 1,
        )
        k = k + 1
    return state


def erred(errors: Errors, state: SampleState, t: float) -> tuple[SampleState, Vector]:
    """State after the errors of a sample are drawn, and the errors.

    Args:
        errors: their standard deviations.
        state: when the sample is taken.
        t: time of that [s].

    """
    random, change = drawn(state.random, errors.walk)
    random, noise = drawn(random, errors.noise)
    bias = state.bias + sqrt(t - state.last) * change
    return state._replace(random=random, bias=bias), bias + noise


def sampled(sampling: Sampling, state: SampleState, sample: Vector, t: float) -> SampleState:
    """State after a sample is taken; it may arrive at once.

    Args:
        sampling: parameters.
        state: after the errors of this sample are drawn.
        sample: its numbers, with their errors.
        t: time [s].

    """
    first = state.due == 0.0
    random, u = uniform(state.random)
    due = state.due + 1.0
    if sampling.period > 0.0:
        elapsed = (t - state.start) / sampling.period + _ROUNDING
        due = elapsed - fmod(elapsed, 1.0) + 1.0
    state = state._replace(due=due, last=t, random=random)
    since = t - sampling.outage_start
    out = u < sampling.loss or 0.0 <= since < sampling.outage_duration
    if first or (sampling.delay == 0.0 and not out):
        return state._replace(held=sample, taken=t, fresh=True)
    if out or state.waiting == PLACES:
        return state
    place = (state.first + state.waiting) % PLACES
    return state._replace(
        queue=state.queue.replaced(place, Vector((t, *sample))), waiting=state.waiting + 1
    )
