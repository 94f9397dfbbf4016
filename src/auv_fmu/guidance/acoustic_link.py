"""What one vehicle tells another under water: messages with its position, late and sometimes lost.

It is not in the paper. The sender's modem sends a message every `period`, from the start of the run
on. A message sent at time t_k arrives after

    latency + |y(t_k) - y_receiver(t_k)| / sound_speed

unless it is lost: by chance, in an outage, or because :data:`PLACES` others are under way. The
sound's path is the straight line to where the receiver is when the message is sent: in the time
that sound needs for 1.5 km, a vehicle of 1 m/s moves by 1 m, which changes the delay by 0.7 ms.

The receiver keeps the message that was sent last. One that is overtaken by a later one counts as
received, and is not used.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.random_numbers import MESSAGE_LOSSES, start, uniform
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, distance

#: Shortest period [s]: no modem is so quick.
_QUICKEST = 0.01

#: Most messages that are under way at the same time.
PLACES = 16

#: Most messages in one step; more are taken for a mistake.
MOST_IN_A_STEP = 10_000

#: What hosts may make of times by rounding, as a share of a step.
_ROUNDING = 1e-6

#: A place of the queue where no message is; the last number of one where there is one is 1.
_NUMBERS = 9
_EMPTY = Vector((0.0,) * _NUMBERS)


class BadLink(ArithmeticError):
    """No link has such parameters, or a step is too long for it."""


class Parameters(NamedTuple):
    """Of the link; the defaults are a quick modem that loses nothing."""

    period: Annotated[float, Variable("s", "Time between two messages", _QUICKEST)] = 1.0
    sound_speed: Annotated[float, Variable("m/s", "Speed of sound in water", POSITIVE)] = 1500.0
    latency: Annotated[float, Variable("s", "Delay by both modems together", 0.0)] = 0.2
    loss: Annotated[float, Variable("1", "Probability that a message is lost", 0.0, 1.0)] = 0.0
    seed: Annotated[int, Variable("1", "Seed of the random numbers that decide what is lost")] = 1
    outage_start: Annotated[
        float, Variable("s", "From when on all messages are lost", name="outage.start")
    ] = 0.0
    outage_duration: Annotated[
        float,
        Variable("s", "How long all messages are lost; 0: never", 0.0, name="outage.duration"),
    ] = 0.0


class Message(NamedTuple):
    """What the sender says of itself."""

    sent: float  #: when [s]
    y: Vector3  #: its measured control point [m], earth frame
    eta: Vector3  #: its attitude (phi, theta, psi) [rad]


class LinkState(NamedTuple):
    """What is under way, and what has arrived."""

    start: float  #: time at which the run began [s]
    sent: int  #: how many messages have been sent
    random: float  #: of the generator
    queue: Annotated[Matrix, PLACES, _NUMBERS]  #: arrival, when sent, y, eta, whether it is one
    newest: Message  #: of those that have arrived, the one that was sent last
    received: int  #: how many have arrived
    lost: int  #: how many never will


def check(parameters: Parameters) -> None:
    """Refuse modems that would always have more messages under way than there are places.

    Raises:
        BadLink: they would.

    """
    period, latency = parameters.period, parameters.latency
    if latency > PLACES * period:
        raise BadLink(
            f"a latency of {latency:g} s with a message every {period:g} s: more than {PLACES:d} "
            f"would be under way; raise period or reduce latency"
        )


def first_state(parameters: Parameters, y: Vector3, eta: Vector3, t: float) -> LinkState:
    """State at the start: vehicles tell each other where they are before they dive.

    Args:
        parameters: of the link.
        y: control point of the sender [m].
        eta: its attitude [rad].
        t: time [s].

    """
    random = start(parameters.seed, MESSAGE_LOSSES)
    queue = Matrix((0.0 for j in range(_NUMBERS)) for i in range(PLACES))
    return LinkState(t, 0, random, queue, Message(t, y, eta), 0, 0)


def delay(parameters: Parameters, y: Vector3, receiver: Vector3) -> float:
    """How long a message is under way [s].

    Args:
        parameters: of the link.
        y: where it is sent [m].
        receiver: where the receiver is then [m].

    """
    return parameters.latency + distance(y, receiver) / parameters.sound_speed


def advance(
    parameters: Parameters,
    state: LinkState,
    y: Vector3,
    eta: Vector3,
    receiver: Vector3,
    t: float,
    h: float,
) -> LinkState:
    """State after a step: all messages are sent and received whose time it is.

    A message whose time is the end of the step belongs to the next one, which knows the position
    there.

    Args:
        parameters: of the link.
        state: at the beginning.
        y: control point of the sender [m], held.
        eta: its attitude [rad], held.
        receiver: control point of the receiver [m], held.
        t: time at the beginning [s].
        h: step [s].

    Raises:
        BadLink: the step has too many messages.

    """
    before, end = t + h - _ROUNDING * h, t + h + _ROUNDING * h
    due = (before - next_time(parameters, state)) / parameters.period
    if not due <= MOST_IN_A_STEP:
        raise BadLink(
            f"a step of {h:g} s has more than {MOST_IN_A_STEP:d} messages; raise period or take "
            f"shorter steps"
        )
    k = 0
    while next_time(parameters, state) < before and k <= due:
        message = Message(next_time(parameters, state), y, eta)
        state = arrived(state, message.sent)
        state = sent(parameters, state, message, delay(parameters, y, receiver))
        k = k + 1
    return arrived(state, end)


def next_time(parameters: Parameters, state: LinkState) -> float:
    """When the next message is sent [s]."""
    return state.start + state.sent * parameters.period


def sent(parameters: Parameters, state: LinkState, message: Message, delay: float) -> LinkState:
    """State after a message is sent.

    Each message takes one random number, also one in an outage: so an outage leaves the fate of
    the others as it was.

    Args:
        parameters: of the link.
        state: when it is sent.
        message: to be sent.
        delay: how long it would be under way [s].

    """
    random, u = uniform(state.random)
    state = state._replace(sent=state.sent + 1, random=random)
    since = message.sent - parameters.outage_start
    place = free_place(state.queue)
    if u < parameters.loss or 0.0 <= since < parameters.outage_duration or place == PLACES:
        return state._replace(lost=state.lost + 1)
    row = Vector((message.sent + delay, message.sent, *message.y, *message.eta, 1.0))
    return state._replace(queue=state.queue.replaced(place, row))


def free_place(queue: Matrix) -> int:
    """The first place of a queue without a message; the number of places: there is none."""
    for k in range(PLACES):
        if queue[k, _NUMBERS - 1] == 0.0:
            return k
    return PLACES


def arrived(state: LinkState, t: float) -> LinkState:
    """State after all messages have been received that arrive until a time.

    Args:
        state: before.
        t: the time [s].

    """
    for k in range(PLACES):
        row = state.queue[k]
        if row[_NUMBERS - 1] > 0.0 and row[0] <= t:
            state = state._replace(
                queue=state.queue.replaced(k, _EMPTY), received=state.received + 1
            )
            if row[1] >= state.newest.sent:
                y, eta = (row[2], row[3], row[4]), (row[5], row[6], row[7])
                state = state._replace(newest=Message(row[1], y, eta))
    return state
