"""Messages under water with the position of a vehicle, late and sometimes lost.

Not in the paper. The sender's modem sends a message every `period`, from the start of the run
on. A message sent at time t_k arrives after

    latency + |y(t_k) - y_receiver(t_k)| / sound_speed

unless it is lost: by chance, in an outage, or because :data:`PLACES` others are under way. The
sound travels along the straight line to the receiver's position at the time of sending: while it
travels 1.5 km, a vehicle moves by 1 m at 1 m/s, which changes the delay by 0.7 ms.

The receiver keeps the message that was sent last. A message that a later one overtakes counts as
received, but is not used.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.random_numbers import MESSAGE_LOSSES, start, uniform
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import Vector3, distance

#: Shortest period [s], which no modem reaches.
_QUICKEST = 0.01

#: Most messages that are under way at the same time.
PLACES = 16

#: Most messages in one step; more are regarded as a mistake.
MOST_IN_A_STEP = 10_000

#: Tolerance for rounded times, as a share of a step.
_ROUNDING = 1e-6

#: Numbers in a place of the queue, and an empty place. The last number of an occupied one is 1.
_NUMBERS = 9
_EMPTY = Vector((0.0,) * _NUMBERS)


class Parameters(NamedTuple):
    """Parameters of the link; the defaults are a quick modem that loses nothing."""

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
    """A message of the sender about itself."""

    sent: float  #: time of sending [s]
    y: Vector3  #: measured control point [m], earth frame
    eta: Vector3  #: attitude (phi, theta, psi) [rad]


class LinkState(NamedTuple):
    """Messages under way, and the newest one that has arrived."""

    start: float  #: time at which the run began [s]
    sent: int  #: number of messages sent
    random: float  #: state of the generator
    queue: Annotated[Matrix, PLACES, _NUMBERS]  #: arrival, sending, y, eta, 1
    newest: Message  #: last sent one of the messages that have arrived
    received: int  #: number of messages that have arrived
    lost: int  #: number of messages that never will


def check(parameters: Parameters) -> None:
    """Refuse a link with more messages under way than :data:`PLACES`.

    Raises:
        Refusal: the latency is too long for the period.

    """
    period, latency = parameters.period, parameters.latency
    if latency > PLACES * period:
        raise Refusal(
            f"a latency of {latency:g} s with a message every {period:g} s: more than {PLACES:d} "
            f"would be under way; raise period or reduce latency"
        )


def first_state(parameters: Parameters, y: Vector3, eta: Vector3, t: float) -> LinkState:
    """State at the start, when the receiver knows the position of the sender.

    Args:
        parameters: of the link.
        y: control point of the sender [m].
        eta: its attitude [rad].
        t: time [s].

    """
    random = start(parameters.seed, MESSAGE_LOSSES)
    queue = Matrix((0.0 for j in range(_NUMBERS)) for i in range(PLACES))
    return LinkState(t, 0, random, queue, Message(t, y, eta), 0, 0)


def advance(
    parameters: Parameters,
    state: LinkState,
    y: Vector3,
    eta: Vector3,
    receiver: Vector3,
    t: float,
    h: float,
) -> LinkState:
    """State after a step, in which all messages that are due are sent and received.

    A message that is due at the end of the step is sent in the next one, which has the position of
    that time.

    Args:
        parameters: of the link.
        state: at the beginning.
        y: control point of the sender [m], held.
        eta: its attitude [rad], held.
        receiver: control point of the receiver [m], held.
        t: time at the beginning [s].
        h: step [s].

    Raises:
        Refusal: the step has too many messages.

    """
    before, end = t + h - _ROUNDING * h, t + h + _ROUNDING * h
    due = (before - next_time(parameters, state)) / parameters.period
    if not due <= MOST_IN_A_STEP:
        raise Refusal(
            f"a step of {h:g} s has more than {MOST_IN_A_STEP:d} messages; raise period or take "
            f"shorter steps"
        )
    delay, k = parameters.latency + distance(y, receiver) / parameters.sound_speed, 0
    while next_time(parameters, state) < before and k <= due:
        message = Message(next_time(parameters, state), y, eta)
        state = arrived(state, message.sent)
        state = sent(parameters, state, message, delay)
        k = k + 1
    return arrived(state, end)


def next_time(parameters: Parameters, state: LinkState) -> float:
    """Time at which the next message is sent [s]."""
    return state.start + state.sent * parameters.period


def sent(parameters: Parameters, state: LinkState, message: Message, delay: float) -> LinkState:
    """State after a message is sent.

    Each message takes one random number, also in an outage. So an outage does not change which of
    the other messages are lost.

    Args:
        parameters: of the link.
        state: when it is sent.
        message: to be sent.
        delay: time that it would be under way [s].

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
    """First free place of a queue; :data:`PLACES` if there is none."""
    for k in range(PLACES):
        if queue[k, _NUMBERS - 1] == 0.0:
            return k
    return PLACES


def arrived(state: LinkState, t: float) -> LinkState:
    """State after the arrival of all messages until a time.

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
